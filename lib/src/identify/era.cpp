// SPDX-License-Identifier: MIT
// PURPOSE    eigensystem realization from system Markov parameters, or from their data correlations
// METHOD     SVD of H(0); R^T H(1) S once for every order that will be asked for; observer gain by least squares through
//            the identified observability matrix. ERA/DC: see era_correlation.cpp for the matrix that is decomposed
// REFERENCE  paper eq. (43)-(54); Juang and Pappa (1985); ERA/DC: Juang, Cooper, Wright (1988); EMAC: Pappa, Elliott,
//            Schenk (1993)
// NUMERICS   the columns of H hold Y_k only: with Y0_k the truncation mixes noise modes in (trap 1)
// WORKSPACE  H, the factors and what the SVD asks for; an SVD of (r n_y) x (c n_u) and 2 r n_y c n_u k flop
#include <okid/steps/era.h>

#include "identify/emac.hpp"
#include "identify/era_correlation.hpp"
#include "identify/era_leading.hpp"
#include "identify/identify.hpp"
#include "identify/triangular.hpp"
#include "linalg/linalg.hpp"

#include <algorithm>
#include <cmath>

using std::size_t;

struct okid_era {
    okid_era_config_t config;
    int height, breadth, rank; // of what is decomposed
    okid_real_t *hankel, *left, *values, *right, *work, *product, *core, *rotated;
    okid::correlation correlation;
};

namespace {

bool correlated(const okid_era& e) { return e.config.tau > 0; }

size_t lay_out(okid_era& e, okid::arena& memory) {
    const auto height = static_cast<size_t>(e.height), breadth = static_cast<size_t>(e.breadth),
               rank = static_cast<size_t>(e.rank);
    e.hankel = memory.take<okid_real_t>(height * breadth);
    e.left = memory.take<okid_real_t>(height * rank);
    e.values = memory.take<okid_real_t>(rank);
    e.right = memory.take<okid_real_t>(rank * breadth);
    // The products begin when the SVD is done: one memory for both.
    e.work = e.product = memory.take<okid_real_t>(std::max(okid::linalg::svd_work(e.height, e.breadth),
                                                           height * std::max(rank, static_cast<size_t>(e.config.n_y))));
    e.core = memory.take<okid_real_t>(rank * rank);
    e.rotated = memory.take<okid_real_t>(rank * static_cast<size_t>(std::max(e.config.n_y, e.config.n_u)));
    if (correlated(e)) e.correlation.lay_out(e.rank, memory);
    return memory.bytes();
}

bool valid(const okid_era_config_t& c) {
    if (c.n_u < 1 || c.n_y < 1 || c.rows < 1 || c.cols < 1) return false;
    if (c.tau == 0) return c.xi == 0 && c.zeta == 0;
    return c.tau >= 1 && c.tau <= std::min(c.rows, c.cols) && c.xi >= 0 && c.xi <= 64 && c.zeta >= 0 && c.zeta <= 64;
}

okid_era plan(const okid_era_config_t& c) {
    okid_era e{};
    e.config = c;
    e.height = c.rows * c.n_y;
    e.breadth = c.cols * c.n_u;
    if (correlated(e)) {
        e.correlation = okid::correlation(c);
        e.height = e.correlation.rows * c.n_y;
        e.breadth = e.correlation.rank;
    }
    e.rank = std::min(e.height, e.breadth);
    return e;
}

int largest_order(const okid_era& e) { return std::min<int>(e.rank, e.config.rows * e.config.n_y); }

/// The matrix to decompose (shift 0), or the one a sample later (shift 1).
void fill(okid_era& e, const okid_real_t* markov, int shift) {
    const okid_era_config_t& c = e.config;
    if (correlated(e))
        e.correlation.fill(markov, shift, e.hankel);
    else
        okid::fill_hankel(c.n_u, c.n_y, c.rows, c.cols, markov + (1 + shift) * c.n_u * c.n_y, e.hankel);
}

/// out (count x count) <- U^T H(shift) V of the first singular vectors; H(shift) V stays in product.
void fill_core(okid_era& e, const okid_real_t* markov, int shift, int count, okid_real_t* out) {
    fill(e, markov, shift);
    okid::linalg::multiply(false, true, e.height, count, e.breadth, 1, e.hankel, e.height, e.right, e.rank, 0,
                           e.product, e.height);
    okid::linalg::multiply(true, false, count, count, e.height, 1, e.left, e.height, e.product, e.height, 0, out,
                           count);
}

/// out (order x order) <- Sigma^(-1/2) core Sigma^(-1/2).
void scale_core(const okid_era& e, int order, const okid_real_t* core, int ld, okid_real_t* out) {
    for (int j = 0; j < order; ++j)
        for (int i = 0; i < order; ++i) out[j * order + i] = core[j * ld + i] / std::sqrt(e.values[i] * e.values[j]);
}

/// rotated (rank x count) <- P^+ rhs without Sigma: least squares on the first r block rows of the observability matrix.
/// @param rhs  r n_y x count, leading dimension height
bool project(okid_era& e, int order, const okid_real_t* rhs, int count) {
    okid::linalg::multiply(true, false, order, count, e.config.rows * e.config.n_y, 1, e.left, e.height, rhs, e.height,
                           0, e.rotated, e.rank);
    return !correlated(e) || e.correlation.solve(order, e.rank, e.rotated, count);
}

} // namespace

okid::era_view okid::view_of(const okid_era_t* self) {
    return {self->height,
            self->breadth,
            self->rank,
            self->left,
            self->values,
            self->right,
            correlated(*self) ? self->correlation.right : nullptr};
}

size_t okid_era_memsize(const okid_era_config_t* config) {
    if (config == nullptr || !valid(*config)) return 0;
    okid_era e = plan(*config);
    okid::arena memory;
    memory.take<okid_era>(1);
    return lay_out(e, memory);
}

int32_t okid_era_max_order(const okid_era_config_t* config) {
    return config == nullptr || !valid(*config) ? 0 : largest_order(plan(*config));
}

int32_t okid_era_markov_last(const okid_era_config_t* config) {
    return config == nullptr || !valid(*config)
               ? 0
               : config->rows + config->cols + (config->xi + config->zeta) * config->tau;
}

okid_status_t okid_era_create(okid_era_t** self, const okid_era_config_t* config, void* block, size_t bytes) {
    if (self == nullptr || config == nullptr || block == nullptr) return OKID_ERR_NULL;
    if (!valid(*config)) return OKID_ERR_DIM;
    if (bytes < okid_era_memsize(config)) return OKID_ERR_MEMORY;
    okid::linalg::warm_up();
    okid::arena memory(block);
    auto* e = memory.take<okid_era>(1);
    *e = plan(*config);
    lay_out(*e, memory);
    *self = e;
    return OKID_OK;
}

okid_status_t okid_era_decompose(okid_era_t* self, const okid_real_t* markov) {
    if (self == nullptr || markov == nullptr) return OKID_ERR_NULL;
    okid_era& e = *self;
    if (correlated(e) && !e.correlation.prepare(markov)) return OKID_ERR_NUMERIC;
    fill(e, markov, 0);
    if (okid::linalg::svd(e.height, e.breadth, e.hankel, e.left, e.values, e.right, e.work) != 0)
        return OKID_ERR_NUMERIC;
    fill_core(e, markov, 1, e.rank, e.core);
    if (correlated(e)) e.correlation.observability(e.rank, e.left);
    return OKID_OK;
}

okid_status_t okid::decompose_leading(okid_era_t* self, const okid_real_t* markov, int count, int past) {
    okid_era& e = *self;
    leading_triplets found(e.config, past, count);
    arena counted;
    found.lay_out(counted);
    if (correlated(e) || counted.bytes() > linalg::svd_work(e.height, e.breadth) * sizeof(okid_real_t))
        return okid_era_decompose(self, markov);
    arena memory(e.work); // that of an SVD, which is not made
    found.lay_out(memory);
    if (!found.find(markov)) return okid_era_decompose(self, markov);
    const auto put = [](const double* from, int many, okid_real_t* to) {
        for (int k = 0; k < many; ++k) to[k] = static_cast<okid_real_t>(from[k]);
    };
    std::fill_n(e.values, e.rank, okid_real_t{0});
    put(found.values, found.count, e.values);
    put(found.left, found.count * e.height, e.left);
    for (int c = 0; c < found.count; ++c)
        put(found.core + at(0, c, found.count), found.count, e.core + at(0, c, e.rank));
    for (int c = 0; c < e.config.n_u; ++c)
        put(found.first + at(0, c, found.count), found.count, e.right + at(0, c, e.rank));
    return OKID_OK;
}

const okid_real_t* okid_era_singular_values(const okid_era_t* self, int32_t* count) {
    if (count != nullptr) *count = self != nullptr ? self->rank : 0;
    return self != nullptr ? self->values : nullptr;
}

okid_status_t okid_era_realize(okid_era_t* self, int32_t order, okid_real_t* A, okid_real_t* B, okid_real_t* C,
                               const okid_real_t* gain_markov, okid_real_t* K) {
    if (self == nullptr || A == nullptr || B == nullptr || C == nullptr) return OKID_ERR_NULL;
    okid_era& e = *self;
    if (order < 1 || order > largest_order(e) || !(e.values[order - 1] > 0)) return OKID_ERR_DIM;
    const int ny = e.config.n_y, nu = e.config.n_u;
    scale_core(e, order, e.core, e.rank, A);
    if (correlated(e) && !project(e, order, e.correlation.input, nu)) return OKID_ERR_NUMERIC;
    for (int c = 0; c < nu; ++c)
        for (int i = 0; i < order; ++i)
            B[c * order + i] = correlated(e) ? e.rotated[c * e.rank + i] / std::sqrt(e.values[i])
                                             : std::sqrt(e.values[i]) * e.right[c * e.rank + i];
    for (int j = 0; j < order; ++j)
        for (int o = 0; o < ny; ++o)
            C[j * ny + o] = e.left[static_cast<size_t>(j) * static_cast<size_t>(e.height) + static_cast<size_t>(o)] *
                            std::sqrt(e.values[j]);
    if (gain_markov == nullptr || K == nullptr) return OKID_OK;
    // L = P^+ [Y0_1; ..; Y0_r], P = R Sigma^(1/2); K = -L. The stack is made in `product`, which is free by now.
    for (int c = 0; c < ny; ++c)
        for (int i = 0; i < e.config.rows; ++i) {
            const okid_real_t* y0 =
                gain_markov + (static_cast<size_t>(i * ny) + static_cast<size_t>(c)) * static_cast<size_t>(ny);
            std::copy(y0, y0 + ny,
                      e.product + static_cast<size_t>(c) * static_cast<size_t>(e.height) + static_cast<size_t>(i * ny));
        }
    if (!project(e, order, e.product, ny)) return OKID_ERR_NUMERIC;
    for (int c = 0; c < ny; ++c)
        for (int i = 0; i < order; ++i) K[c * order + i] = -e.rotated[c * e.rank + i] / std::sqrt(e.values[i]);
    return OKID_OK;
}

okid_status_t okid_era_realize_near(okid_era_t* self, int32_t order, const okid_real_t* markov, okid_real_t* A,
                                    okid_real_t* C) {
    if (self == nullptr || markov == nullptr || A == nullptr || C == nullptr) return OKID_ERR_NULL;
    okid_era& e = *self;
    if (correlated(e) || order < 1 || order > largest_order(e) || !(e.values[order - 1] > 0)) return OKID_ERR_DIM;
    fill_core(e, markov, 1, order, A);
    scale_core(e, order, A, order, A);
    okid_real_t* now = e.hankel; // of H(0): 1 and its change
    fill_core(e, markov, 0, order, now);
    scale_core(e, order, now, order, now);
    for (int j = 0; j < order; ++j) { // A less the change times A
        okid_real_t* column = A + static_cast<size_t>(j * order);
        okid::linalg::multiply(false, false, order, 1, order, 1, now, order, column, order, 0, e.rotated, order);
        for (int i = 0; i < order; ++i) column[i] += column[i] - e.rotated[i];
        for (int o = 0; o < e.config.n_y; ++o)
            C[j * e.config.n_y + o] = e.product[okid::at(o, j, e.height)] / std::sqrt(e.values[j]);
    }
    return OKID_OK;
}

okid_status_t okid_era_emac(const okid_era_t* self, int32_t order, const okid_modes_t* modes, okid_real_t* emac) {
    return okid::era_emac(self, order, modes, emac, false);
}

okid_status_t okid::era_emac(const okid_era_t* self, int32_t order, const okid_modes_t* modes, okid_real_t* emac,
                             bool while_it_lasts) {
    if (self == nullptr || modes == nullptr || modes->mu_re == nullptr || modes->mu_im == nullptr ||
        modes->psi_re == nullptr || modes->psi_im == nullptr || emac == nullptr)
        return OKID_ERR_NULL;
    const okid_era& e = *self;
    if (order < 1 || order > e.rank) return OKID_ERR_DIM;
    const int ny = e.config.n_y, last = e.height / ny - 1;
    constexpr okid_real_t quarter_pi = static_cast<okid_real_t>(0.78539816339744831);
    for (int k = 0; k < modes->count; ++k) {
        const size_t at = static_cast<size_t>(k) * static_cast<size_t>(order);
        const okid_real_t *re = modes->psi_re + at, *im = modes->psi_im + at;
        const int steps = while_it_lasts ? okid::telling_row(std::hypot(modes->mu_re[k], modes->mu_im[k]), last) : last;
        okid_real_t power_re = 1, power_im = 0; // mu to the number of rows between the two that are compared
        for (int n = 0; n < steps; ++n) {
            const okid_real_t turned = power_re * modes->mu_re[k] - power_im * modes->mu_im[k];
            power_im = power_re * modes->mu_im[k] + power_im * modes->mu_re[k];
            power_re = turned;
        }
        okid_real_t weighted = 0, total = 0;
        for (int o = 0; o < ny; ++o) {
            okid_real_t first_re = 0, first_im = 0, end_re = 0, end_im = 0;
            const okid_real_t* column = e.left + o;
            for (int i = 0; i < order; ++i, column += e.height) {
                const okid_real_t root = std::sqrt(e.values[i]), first = root * column[0],
                                  end = root * column[steps * ny];
                first_re += first * re[i];
                first_im += first * im[i];
                end_re += end * re[i];
                end_im += end * im[i];
            }
            const okid_real_t expected_re = power_re * first_re - power_im * first_im;
            const okid_real_t expected_im = power_im * first_re + power_re * first_im;
            const okid_real_t a = std::hypot(expected_re, expected_im), b = std::hypot(end_re, end_im);
            const okid_real_t weight = first_re * first_re + first_im * first_im;
            total += weight;
            if (!(a > 0) || !(b > 0)) continue;
            const okid_real_t turn = std::abs(
                std::atan2(end_im * expected_re - end_re * expected_im, end_re * expected_re + end_im * expected_im));
            weighted += weight * std::min(a, b) / std::max(a, b) * std::max(okid_real_t{0}, 1 - turn / quarter_pi);
        }
        emac[k] = total > 0 ? weighted / total : 0;
    }
    return OKID_OK;
}
