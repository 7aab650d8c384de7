// SPDX-License-Identifier: MIT
// PURPOSE    what the blocks of the Hankel matrix hold, and models out of it
// METHOD     system: Y_k. innovations: [Y_k Su^(1/2), Y0_k Se^(1/2)] with Cholesky factors for the roots: any root gives
//            the same singular values and observability. literal: [Y_k Y0_k]. What ERA finds as input matrix is
//            [B Su^(1/2), L Se^(1/2)]: B by a triangular solve, K by least squares as always
// REFERENCE  paper eq. (42); docs/numerics.md trap 1
// NUMERICS   the Y0_k of an ARX model of finite p have more than n_z modes: unscaled they push noise modes into the
//            first singular values, weighted by the innovations they enter as far as the data speak of them. Without
//            noise Se vanishes and with it their part
// WORKSPACE  the sequence of blocks, in the object
#include "identify/identify.hpp"
#include "identify/triangular.hpp"

#include "linalg/linalg.hpp"

#include <algorithm>
#include <cmath>

using std::size_t;

namespace okid {
namespace {

/// root (n x n) <- lower factor of the symmetric matrix entry(r, c), or, where that is singular, the roots of its diagonal.
template <class Entry> void take_root(int n, Entry entry, okid_real_t* root) {
    constexpr okid_real_t floor = linalg::limit_of<okid_real_t>(1e-12);
    for (int c = 0; c < n; ++c)
        for (int r = 0; r < n; ++r)
            root[area(c, n) + static_cast<size_t>(r)] =
                static_cast<okid_real_t>(entry(r, c)) * (r == c ? 1 + floor : 1);
    const bool regular = linalg::cholesky(n, root, n) == 0;
    for (int c = 0; c < n; ++c) {
        std::fill(root + area(c, n), root + area(c, n) + (regular ? c : n), okid_real_t{0});
        if (!regular) root[area(c, n + 1)] = static_cast<okid_real_t>(std::sqrt(std::max(0.0, double(entry(c, c)))));
    }
}

bool weighted(const okid_identify& s) { return s.config.hankel == OKID_HANKEL_INNOVATIONS; }

void take_innovation_root(okid_identify& s) {
    take_root(
        s.n_y, [&](int r, int c) { return s.innovation[area(c, s.n_y) + static_cast<size_t>(r)]; }, s.innovation_root);
}

} // namespace

void weigh_by_gram(okid_identify& s, int stride, int64_t rows) {
    if (!weighted(s)) return;
    take_root(
        s.n_u,
        [&](int r, int c) { return s.gram[area(c, stride) + static_cast<size_t>(r)] / static_cast<double>(rows); },
        s.input_root);
    take_innovation_root(s);
}

void weigh_by_factor(okid_identify& s, int64_t rows) {
    if (!weighted(s)) return;
    const auto* factor = reinterpret_cast<const okid_real_t*>(s.gram);
    const auto scale = static_cast<okid_real_t>(1 / std::sqrt(static_cast<double>(rows)));
    for (int c = 0; c < s.n_u; ++c)
        for (int r = 0; r < s.n_u; ++r)
            s.input_root[area(c, s.n_u) + static_cast<size_t>(r)] =
                r < c ? 0 : scale * factor[area(r, s.n) + static_cast<size_t>(c)];
    take_innovation_root(s);
}

bool knows_noise(const okid_identify_config_t& config) {
    return config.n_u > 0 && config.method == OKID_METHOD_OKID_ERA && config.hankel == OKID_HANKEL_SYSTEM &&
           config.solver == OKID_SOLVER_DENSE && config.order == 0;
}

namespace {

/// Without noise the innovations are rounding, and what they leave in the matrix is too: taken out where it holds no more
/// than 1e-10 of the power.
void drop_rounding(const okid_identify& s) {
    double system = 0, gain = 0;
    for (int k = 1; k <= s.markov_last; ++k) {
        const okid_real_t* block = s.sequence + area(k, s.n_y * s.width);
        for (int i = 0; i < s.n_y * s.width; ++i)
            (i < s.n_y * s.n_u ? system : gain) += static_cast<double>(block[i]) * static_cast<double>(block[i]);
    }
    if (!(gain <= 1e-10 * system)) return;
    for (int k = 1; k <= s.markov_last; ++k)
        std::fill(s.sequence + area(k, s.n_y * s.width) + area(s.n_y, s.n_u), s.sequence + area(k + 1, s.n_y * s.width),
                  okid_real_t{0});
}

} // namespace

const okid_real_t* hankel_blocks(okid_identify& s) {
    if (s.config.hankel == OKID_HANKEL_SYSTEM) return s.markov;
    const int n_u = s.n_u, n_y = s.n_y;
    for (int k = 1; k <= s.markov_last; ++k) {
        const okid_real_t *system = s.markov + area(k, n_y * n_u), *gain = s.gain + area(k - 1, n_y * n_y);
        okid_real_t *left = s.sequence + area(k, n_y * s.width), *right = left + area(n_y, n_u);
        if (weighted(s)) {
            linalg::multiply(false, false, n_y, n_u, n_u, 1, system, n_y, s.input_root, n_u, 0, left, n_y);
            linalg::multiply(false, false, n_y, n_y, n_y, 1, gain, n_y, s.innovation_root, n_y, 0, right, n_y);
        } else {
            std::copy(system, system + n_y * n_u, left);
            std::copy(gain, gain + n_y * n_y, right);
        }
    }
    if (weighted(s)) drop_rounding(s);
    return s.sequence;
}

okid_status_t realise_era(okid_identify& s, int order, bool whole) {
    const okid_status_t status = okid_era_realize(s.era, order, s.A, s.B, s.C, whole ? s.gain : nullptr, s.K);
    if (status != OKID_OK || !weighted(s)) return status;
    for (int c = s.n_u - 1; c >= 0; --c) { // B root = what was found
        okid_real_t* column = s.B + area(c, order);
        for (int later = c + 1; later < s.n_u; ++later) {
            const okid_real_t factor = s.input_root[area(c, s.n_u) + static_cast<size_t>(later)];
            const okid_real_t* from = s.B + area(later, order);
            for (int i = 0; i < order; ++i) column[i] -= factor * from[i];
        }
        for (int i = 0; i < order; ++i) column[i] /= s.input_root[area(c, s.n_u + 1)];
    }
    return OKID_OK;
}

} // namespace okid
