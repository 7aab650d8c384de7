// SPDX-License-Identifier: MIT
// PURPOSE    can M, K and R be believed: definiteness, closure of the modes, feedthrough, complexity; normal-mode damping
// METHOD     Cholesky of M, -M, K, R; |2 Re W W^T| (eq. 115); D against C_a M^-1 B_a; MPC and phase of W sqrt(2 i w_d),
//            which is real for a structure with normal modes, right timing and right polarity
// REFERENCE  paper eq. (9), (115), (119); MPC: Pappa, Elliott, Schenk (1993); docs/numerics.md traps 14, 15, 21
// NUMERICS   sums in double; all checks are free of units
// WORKSPACE  that of mkr.cpp
#include "linalg/linalg.hpp"
#include "mkr.hpp"

#include <algorithm>
#include <cmath>

using std::size_t;
using real = okid_real_t;
using complex = std::complex<double>;

namespace okid {
namespace {

constexpr double residual_limit = 0.03, feedthrough_limit = 0.1, mpc_limit = 0.9, spread_limit = 0.1, margin_limit = 2;

bool definite(mkr_work& w, const real* a, real sign) {
    const auto n = static_cast<size_t>(w.n_x);
    for (size_t i = 0; i < n * n; ++i) w.one[i] = sign * a[i];
    return linalg::cholesky(w.n_x, w.one, w.n_x) == 0;
}

/// w.balance: what brings the rows of W to one size, so that no unit of a degree of freedom outweighs the others.
void scale_rows(mkr_work& w) {
    for (int i = 0; i < w.n_x; ++i) {
        double size = 0;
        for (int k = 0; k < w.n_x; ++k)
            size += double(w.lambda_im[k]) * std::norm(complex(w.W_re[k * w.n_x + i], w.W_im[k * w.n_x + i]));
        w.balance[i] = static_cast<real>(1 / std::sqrt(size)); // a row of zeros has no inverse before
    }
}

/// MPC and phase of mode k with the rows scaled, and its real shape F(:, k), unscaled, into w.one.
void describe_mode(mkr_work& w, int k) {
    const auto n = static_cast<size_t>(w.n_x), first = static_cast<size_t>(k) * n;
    const complex turn = std::sqrt(complex(0, 2 * double(w.lambda_im[k])));
    complex square = 0;
    double size = 0;
    for (size_t i = first; i < first + n; ++i) {
        const complex v = turn * complex(w.W_re[i], w.W_im[i]) * double(w.balance[i - first]);
        square += v * v;
        size += std::norm(v);
    }
    const double angle = std::arg(square) / 2;
    w.phase[k] = static_cast<real>(angle);
    w.mpc[k] = static_cast<real>(std::norm(square) / (size * size)); // |sum v^2|^2 / (sum |v|^2)^2
    for (size_t i = first; i < first + n; ++i)
        w.one[i] = static_cast<real>((turn * complex(w.W_re[i], w.W_im[i]) * std::polar(1.0, -angle)).real());
}

/// R = M F diag(2 zeta w / (f^T M f)) F^T M with the real shapes F in w.one.
void normal_mode_damping(mkr_work& w) {
    const auto n = static_cast<size_t>(w.n_x);
    linalg::multiply(false, false, w.n_x, w.n_x, w.n_x, 1, w.M, w.n_x, w.one, w.n_x, 0, w.two, w.n_x);
    for (size_t k = 0; k < n; ++k) {
        double mass = 0;
        for (size_t i = 0; i < n; ++i) mass += double(w.one[k * n + i]) * double(w.two[k * n + i]);
        const double rate = mass != 0 ? -2 * double(w.lambda_re[k]) / mass : 0;
        for (size_t i = 0; i < n; ++i) w.one[k * n + i] = static_cast<real>(rate * double(w.two[k * n + i]));
    }
    linalg::multiply(false, true, w.n_x, w.n_x, w.n_x, 1, w.one, w.n_x, w.two, w.n_x, 0, w.R_normal, w.n_x);
    symmetrise(w.n_x, w.R_normal);
}

real closure_residual(const mkr_work& w) {
    const auto n = static_cast<size_t>(w.n_x);
    double square = 0, size = 0;
    for (size_t j = 0; j < n; ++j)
        for (size_t i = 0; i < n; ++i) {
            const double entry = double(w.closure[j * n + i]) * double(w.balance[i]) * double(w.balance[j]);
            square += entry * entry;
            size +=
                std::norm(complex(w.W_re[j * n + i], w.W_im[j * n + i])) * double(w.balance[i]) * double(w.balance[i]);
        }
    return static_cast<real>(std::sqrt(square) / (2 * size));
}

/// D of the continuous model against C_a M^-1 B_a, row by row, relative to sum |c b / lambda| of the modes.
void check_feedthrough(const mkr_work& w, const okid_model_t& m, const okid_mkr_config_t& c, okid_mkr_t& result) {
    const okid::poles& p = w.poles;
    const int32_t hold = c.hold;
    double worst = 0, along = 0, length = 0;
    for (int o = 0; o < m.n_y; ++o) {
        if (c.output_dof[o] < 0) continue;
        const double shown = c.output_gain != nullptr ? double(c.output_gain[o]) : 1;
        double misfit = 0, size = 0;
        for (int j = 0; j < m.n_u; ++j) {
            if (c.input_dof[j] < 0) continue;
            const double gain = shown * (c.input_gain != nullptr ? double(c.input_gain[j]) : 1);
            double direct = double(m.D[static_cast<size_t>(j) * static_cast<size_t>(m.n_y) + static_cast<size_t>(o)]),
                   modes = 0;
            for (int k = 0; k < w.n_x; ++k) {
                const int pole = w.listed[w.taken[k]];
                const complex l = logarithm(p.mu(pole)), residue = p.shows(o, pole) * p.takes(pole, j);
                direct -= 2 * (residue * hold_feed(l, hold)).real();
                modes += 2 * std::abs(residue * hold_inverse(l, c.dt, hold) / l) * c.dt;
            }
            double expected = 0;
            if (c.output_sensing[o] == OKID_SENSE_ACCELERATION)
                expected = gain * double(w.mobility[c.input_dof[j] * c.n_x + c.output_dof[o]]);
            misfit += (direct - expected) * (direct - expected);
            size += modes * modes;
            if (c.input_dof[j] != c.output_dof[o]) continue;
            along += direct / gain * (expected / gain);
            length += expected / gain * (expected / gain);
        }
        const double relative = size > 0 ? std::sqrt(misfit / size) : 0;
        if (relative < worst || !(size > 0)) continue;
        worst = relative;
        result.feedthrough_row = o;
    }
    result.feedthrough = static_cast<real>(worst);
    result.gain = static_cast<real>(length > 0 ? along / length : 0);
}

} // namespace

void check_mkr(mkr_work& w, const okid_model_t& model, const okid_mkr_config_t& config, okid_mkr_t& result) {
    uint32_t notes = 0;
    if (definite(w, w.M, -1))
        notes |= OKID_MKR_POLARITY;
    else if (!definite(w, w.M, 1))
        notes |= OKID_MKR_MASS;
    if (!definite(w, w.K, 1)) notes |= OKID_MKR_STIFFNESS;
    if (!definite(w, w.R, 1)) notes |= OKID_MKR_DAMPING;
    scale_rows(w);
    for (int k = 0; k < w.n_x; ++k) describe_mode(w, k);
    normal_mode_damping(w);
    result.residual = closure_residual(w);
    check_feedthrough(w, model, config, result);
    if (!(result.residual <= residual_limit)) notes |= OKID_MKR_RESIDUAL;
    if (!(result.feedthrough <= feedthrough_limit)) notes |= OKID_MKR_FEEDTHROUGH;
    if (!(*std::min_element(w.mpc, w.mpc + w.n_x) >= mpc_limit)) notes |= OKID_MKR_COMPLEX;
    if (!(*std::max_element(w.spread, w.spread + w.n_x) <= spread_limit)) notes |= OKID_MKR_SPREAD;
    if (result.margin > 0 && result.margin < margin_limit) notes |= OKID_MKR_CLOSE;
    result.notes = notes;
}

} // namespace okid

const char* okid_mkr_note(uint32_t bit) {
    switch (bit) {
    case OKID_MKR_POLARITY: return "polarity";
    case OKID_MKR_MASS: return "mass_indefinite";
    case OKID_MKR_STIFFNESS: return "stiffness_indefinite";
    case OKID_MKR_DAMPING: return "damping_indefinite";
    case OKID_MKR_RESIDUAL: return "residual";
    case OKID_MKR_FEEDTHROUGH: return "feedthrough_misfit";
    case OKID_MKR_COMPLEX: return "complex_modes";
    case OKID_MKR_SPREAD: return "pairs_disagree";
    case OKID_MKR_CLOSE: return "choice_unclear";
    default: return nullptr;
    }
}
