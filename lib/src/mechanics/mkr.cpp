// SPDX-License-Identifier: MIT
// PURPOSE    mass, damping and stiffness from a discrete state-space model
// METHOD     choose n_x modes, take each to continuous time by its own hold factor, scale it by the co-located pairs so
//            that w w^T is its residue, sum the modes
// REFERENCE  paper eq. (96)-(123); De Angelis, Lus, Betti, Longman (2002); corrections: docs/numerics.md traps 10-21
// NUMERICS   M and K lose cond(V) eps times their own condition; R also 1/(2 zeta), being the small real part of
//            large complex sums. t_k enters as t_k^2 (M, K, R do not see its sign), averaged before the root (trap 12)
// WORKSPACE  okid_mkr_memsize(): the pole analysis and 14 n_x^2 numbers; 30 n_z^3 flop
#include <okid/mkr.h>

#include "linalg/linalg.hpp"
#include "mkr.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

using std::size_t;
using real = okid_real_t;
using complex = std::complex<double>;
using okid::mkr_work;

namespace {

constexpr double pi = 3.14159265358979323846, nyquist_margin = 0.99;

size_t lay_out(int n_u, int n_y, int n_z, int n_x, okid::arena& memory, mkr_work& w) {
    const auto x = static_cast<size_t>(n_x), pairs = static_cast<size_t>(n_z / 2);
    w.n_x = n_x;
    w.poles.lay_out(n_u, n_y, n_z, memory);
    w.listed = memory.take<int>(pairs);
    w.share = memory.take<double>(pairs);
    w.taken = memory.take<int32_t>(x);
    for (real** square :
         {&w.M, &w.K, &w.R, &w.R_normal, &w.W_re, &w.W_im, &w.mobility, &w.closure, &w.one, &w.two, &w.left, &w.right})
        *square = memory.take<real>(x * x);
    for (real** column : {&w.frequency, &w.damping, &w.lambda_re, &w.lambda_im, &w.strength, &w.mpc, &w.phase,
                          &w.spread, &w.values, &w.balance})
        *column = memory.take<real>(x);
    w.work = memory.take<real>(okid::linalg::svd_work(n_x, n_x));
    return memory.bytes();
}

bool usable(real gain) { return std::isfinite(gain) && gain != 0; }

bool valid(const okid_model_t& m, const okid_mkr_config_t& c) {
    if (m.n_u < 1 || m.n_y < 1 || m.n_z < 1 || c.n_x < 1 || !(c.dt > 0) || !std::isfinite(c.dt)) return false;
    if (c.hold != OKID_HOLD_ZERO && c.hold != OKID_HOLD_FIRST) return false;
    for (int32_t j = 0; j < m.n_u; ++j)
        if (c.input_dof[j] < -1 || c.input_dof[j] >= c.n_x || (c.input_gain != nullptr && !usable(c.input_gain[j])))
            return false;
    for (int32_t o = 0; o < m.n_y; ++o)
        if (c.output_dof[o] < -1 || c.output_dof[o] >= c.n_x ||
            (c.output_gain != nullptr && !usable(c.output_gain[o])) || c.output_sensing[o] < OKID_SENSE_DISPLACEMENT ||
            c.output_sensing[o] > OKID_SENSE_ACCELERATION)
            return false;
    return true;
}

/// Is there a sensor or an actuator at every degree of freedom, and both at one? Fills result.pairs and result.dof.
bool instrumented(const okid_model_t& m, const okid_mkr_config_t& c, okid_mkr_t& result) {
    for (int32_t d = 0; d < c.n_x; ++d) {
        const auto forces = static_cast<int32_t>(std::count(c.input_dof, c.input_dof + m.n_u, d));
        const auto sensors = static_cast<int32_t>(std::count(c.output_dof, c.output_dof + m.n_y, d));
        result.pairs += forces * sensors;
        if (forces + sensors > 0) continue;
        result.dof = d;
        return false;
    }
    return result.pairs > 0;
}

/// Pairs 0 < zeta < 1 below Nyquist, ascending in |lambda|: the rule and the order of okid_modal_analyse().
int list_modes(mkr_work& w) {
    int found = 0;
    for (int k = 0; k < w.poles.n_z; ++k) {
        if (!w.poles.pair(k)) continue;
        const complex mu = w.poles.mu(k);
        if (!(std::abs(mu) < 1) || std::arg(mu) > nyquist_margin * pi || std::abs(okid::logarithm(mu)) > pi) continue;
        const double size = std::abs(okid::logarithm(mu));
        int at = found++;
        for (; at > 0 && std::abs(okid::logarithm(w.poles.mu(w.listed[at - 1]))) > size; --at)
            w.listed[at] = w.listed[at - 1];
        w.listed[at] = k;
    }
    return found;
}

/// share[i]: part of mode i in |c b|^2/(2 |Re lambda|), the variance under white forces, averaged over the channels.
void find_shares(mkr_work& w, int found, double dt, int32_t hold) {
    const okid::poles& p = w.poles;
    const auto variance = [&](int i, int o, int c) {
        const int k = w.listed[i];
        const complex l = okid::logarithm(p.mu(k));
        return std::norm(p.shows(o, k) * p.takes(k, c) * okid::hold_inverse(l, dt, hold)) / -l.real();
    };
    std::fill(w.share, w.share + found, 0.0);
    for (int o = 0; o < p.n_y; ++o)
        for (int c = 0; c < p.n_u; ++c) {
            double total = 0;
            for (int i = 0; i < found; ++i) total += variance(i, o, c);
            for (int i = 0; total > 0 && i < found; ++i) w.share[i] += variance(i, o, c) / total;
        }
    for (int i = 0; i < found; ++i) w.share[i] /= double(p.n_y) * double(p.n_u);
}

/// The n_x strongest into w.taken, ascending. @return the margin to the strongest one left, 0 if none was left
double choose(mkr_work& w, int found) {
    const auto place = [&](int i) { // how many are stronger; the earlier one wins a tie
        int stronger = 0;
        for (int j = 0; j < found; ++j)
            stronger += w.share[j] > w.share[i] || (j < i && w.share[j] == w.share[i]) ? 1 : 0;
        return stronger;
    };
    double weakest = 1, left = 0;
    for (int i = 0, taken = 0; i < found; ++i) {
        if (place(i) >= w.n_x) {
            left = std::max(left, w.share[i]);
            continue;
        }
        weakest = std::min(weakest, w.share[i]);
        w.strength[taken] = static_cast<real>(w.share[i]);
        w.taken[taken++] = i;
    }
    return left > 0 ? weakest / left : 0;
}

/// Column k of W: t^2 from the co-located pairs, then sensors (mean) before actuators. @return false: cannot be scaled
bool scale_mode(mkr_work& w, const okid_model_t& m, const okid_mkr_config_t& c, int k) {
    const okid::poles& p = w.poles;
    const int pole = w.listed[w.taken[k]];
    const complex l = okid::logarithm(p.mu(pole)), lambda = l / c.dt;
    const complex hold = okid::hold_inverse(l, c.dt, c.hold);
    const auto force = [&](int j) { // b_j as for a unit force
        return p.takes(pole, j) * hold / (c.input_gain != nullptr ? double(c.input_gain[j]) : 1.0);
    };
    const auto motion = [&](int o) { // c_o lambda^-b: displacement
        complex value = p.shows(o, pole) / (c.output_gain != nullptr ? double(c.output_gain[o]) : 1.0);
        for (int b = 0; b < c.output_sensing[o]; ++b) value /= lambda;
        return value;
    };
    complex cross = 0;
    double seen = 0, driven = 0, misfit = 0;
    for (int j = 0; j < m.n_u; ++j)
        for (int o = 0; o < m.n_y; ++o) {
            if (c.input_dof[j] < 0 || c.input_dof[j] != c.output_dof[o]) continue;
            cross += std::conj(motion(o)) * force(j);
            seen += std::norm(motion(o));
            driven += std::norm(force(j));
        }
    const complex square = cross / seen, t = std::sqrt(square);
    if (!(std::abs(t) > 0) || !std::isfinite(std::abs(t))) return false;
    for (int j = 0; j < m.n_u; ++j)
        for (int o = 0; o < m.n_y; ++o)
            if (c.input_dof[j] >= 0 && c.input_dof[j] == c.output_dof[o])
                misfit += std::norm(force(j) - square * motion(o));
    w.spread[k] = static_cast<real>(std::sqrt(misfit / driven));
    w.lambda_re[k] = static_cast<real>(lambda.real());
    w.lambda_im[k] = static_cast<real>(lambda.imag());
    w.frequency[k] = static_cast<real>(std::abs(lambda) / (2 * pi));
    w.damping[k] = static_cast<real>(-lambda.real() / std::abs(lambda));
    for (int d = 0; d < c.n_x; ++d) {
        complex sensed = 0, driven_by = 0;
        int sensors = 0, forces = 0;
        for (int o = 0; o < m.n_y; ++o)
            if (c.output_dof[o] == d) sensed += motion(o), ++sensors;
        for (int j = 0; j < m.n_u; ++j)
            if (c.input_dof[j] == d) driven_by += force(j), ++forces;
        const complex entry = sensors > 0 ? t * sensed / double(sensors) : driven_by / (t * double(forces));
        w.W_re[k * c.n_x + d] = static_cast<real>(entry.real());
        w.W_im[k * c.n_x + d] = static_cast<real>(entry.imag());
    }
    return true;
}

/// out = 2 Re(W L^power W^T), symmetric (traps 11, 12: transpose, each column as w w^T).
void modal_sum(mkr_work& w, int power, real* out) {
    const auto n = static_cast<size_t>(w.n_x);
    for (size_t k = 0; k < n; ++k) {
        const complex lambda(w.lambda_re[k], w.lambda_im[k]);
        complex f = 1;
        for (int e = 0; e < std::abs(power); ++e) f *= power > 0 ? lambda : 1.0 / lambda;
        for (size_t i = k * n; i < (k + 1) * n; ++i) {
            const complex value = f * complex(w.W_re[i], w.W_im[i]);
            w.one[i] = static_cast<real>(value.real());
            w.two[i] = static_cast<real>(value.imag());
        }
    }
    okid::linalg::multiply(false, true, w.n_x, w.n_x, w.n_x, 2, w.one, w.n_x, w.W_re, w.n_x, 0, out, w.n_x);
    okid::linalg::multiply(false, true, w.n_x, w.n_x, w.n_x, -2, w.two, w.n_x, w.W_im, w.n_x, 1, out, w.n_x);
    okid::symmetrise(w.n_x, out);
}

/// out = sign * S^-1 of a symmetric S, definite or not, scaled to unit diagonal before. @return false: singular
bool invert(mkr_work& w, const real* S, real sign, real* out) {
    const auto n = static_cast<size_t>(w.n_x);
    for (size_t i = 0; i < n; ++i) {
        const real size = std::abs(S[i * n + i]);
        if (!std::isfinite(size)) return false;
        w.balance[i] = size > 0 ? 1 / std::sqrt(size) : real(1);
    }
    for (size_t j = 0; j < n; ++j)
        for (size_t i = 0; i < n; ++i) w.one[j * n + i] = S[j * n + i] * w.balance[i] * w.balance[j];
    if (okid::linalg::svd(w.n_x, w.n_x, w.one, w.left, w.values, w.right, w.work) != 0) return false;
    if (!(w.values[n - 1] > static_cast<real>(n) * std::numeric_limits<real>::epsilon() * w.values[0])) return false;
    for (size_t k = 0; k < n; ++k)
        for (size_t i = 0; i < n; ++i) w.left[k * n + i] /= w.values[k];
    okid::linalg::multiply(true, true, w.n_x, w.n_x, w.n_x, sign, w.right, w.n_x, w.left, w.n_x, 0, out, w.n_x);
    for (size_t j = 0; j < n; ++j)
        for (size_t i = 0; i < n; ++i) out[j * n + i] *= w.balance[i] * w.balance[j];
    okid::symmetrise(w.n_x, out);
    return true;
}

/// M, K and R of eq. (116), (123). @return false: a sum is singular
bool assemble(mkr_work& w) {
    modal_sum(w, 0, w.closure);
    modal_sum(w, 1, w.mobility);
    if (!invert(w, w.mobility, 1, w.M)) return false;
    modal_sum(w, -1, w.R);
    if (!invert(w, w.R, -1, w.K)) return false;
    modal_sum(w, 2, w.R);
    okid::linalg::multiply(false, false, w.n_x, w.n_x, w.n_x, 1, w.R, w.n_x, w.M, w.n_x, 0, w.one, w.n_x);
    okid::linalg::multiply(false, false, w.n_x, w.n_x, w.n_x, -1, w.M, w.n_x, w.one, w.n_x, 0, w.R, w.n_x);
    okid::symmetrise(w.n_x, w.R);
    return true;
}

void publish(const mkr_work& w, okid_mkr_t& result) {
    result.n_x = w.n_x;
    result.M = w.M;
    result.K = w.K;
    result.R = w.R;
    result.R_normal = w.R_normal;
    result.frequency_hz = w.frequency;
    result.damping_ratio = w.damping;
    result.lambda_re = w.lambda_re;
    result.lambda_im = w.lambda_im;
    result.W_re = w.W_re;
    result.W_im = w.W_im;
    result.mode = w.taken;
    result.strength = w.strength;
    result.mpc = w.mpc;
    result.phase = w.phase;
    result.pair_spread = w.spread;
    result.condition = w.poles.condition;
}

} // namespace

void okid::symmetrise(int n, okid_real_t* a) {
    const auto ld = static_cast<size_t>(n);
    for (size_t j = 0; j < ld; ++j)
        for (size_t i = 0; i < j; ++i) a[j * ld + i] = a[i * ld + j] = (a[j * ld + i] + a[i * ld + j]) / 2;
}

size_t okid_mkr_memsize(int32_t n_u, int32_t n_y, int32_t n_z, int32_t n_x) {
    if (n_u < 1 || n_y < 1 || n_z < 1 || n_x < 1) return 0;
    okid::arena memory;
    mkr_work w{};
    return lay_out(n_u, n_y, n_z, n_x, memory, w);
}

okid_status_t okid_mkr_identify(const okid_model_t* model, const okid_mkr_config_t* config, okid_mkr_t* result,
                                void* work, size_t bytes) {
    if (model == nullptr || config == nullptr || result == nullptr || work == nullptr || model->A == nullptr ||
        model->B == nullptr || model->C == nullptr || model->D == nullptr || config->input_dof == nullptr ||
        config->output_dof == nullptr || config->output_sensing == nullptr)
        return OKID_ERR_NULL;
    const okid_model_t& m = *model;
    const okid_mkr_config_t& c = *config;
    if (!valid(m, c)) return OKID_ERR_DIM;
    if (bytes < okid_mkr_memsize(m.n_u, m.n_y, m.n_z, c.n_x)) return OKID_ERR_MEMORY;
    okid::linalg::warm_up();
    *result = okid_mkr_t{};
    result->dof = result->feedthrough_row = -1;
    if (!instrumented(m, c, *result)) return OKID_ERR_MISMATCH;
    okid::arena memory(work);
    mkr_work w{};
    lay_out(m.n_u, m.n_y, m.n_z, c.n_x, memory, w);
    const okid_status_t found = w.poles.find(m);
    if (found != OKID_OK) return found;
    result->admissible = list_modes(w);
    if (result->admissible < c.n_x) return OKID_ERR_NO_MODES;
    find_shares(w, result->admissible, c.dt, c.hold);
    const double margin = choose(w, result->admissible);
    for (int k = 0; k < c.n_x; ++k)
        if (!scale_mode(w, m, c, k)) return OKID_ERR_NUMERIC;
    if (!assemble(w)) return OKID_ERR_NUMERIC;
    publish(w, *result);
    result->margin = static_cast<real>(margin);
    okid::check_mkr(w, m, c, *result);
    return result->notes != 0 ? OKID_WARN_MODEL : OKID_OK;
}
