// SPDX-License-Identifier: MIT
// PURPOSE    the parameters of a model in modal coordinates, and the signals all derivatives of its outputs are made of
// METHOD     with s(t+1) = w s(t) + b u(t): dy/db_c = c phi_c, phi_c(t+1) = w phi_c(t) + u_c(t); dy/dw = c s',
//            s'(t+1) = w s'(t) + s(t); dy/ds(0) = c w^t; dy/dc = s; dy/dD = u. One gain into each mode is held (a mode's
//            scale may stand in c or in b), so that its phi is not needed; without inputs its largest initial state
// REFERENCE  docs/numerics.md, refinement
// NUMERICS   stable poles only: nothing grows
// WORKSPACE  (64 + 1) (n_z (n_u + 2) + n_u + 1) + 64 n_y numbers
#include "identify/refine_signals.hpp"

#include <cmath>

namespace okid {

using linalg::multiply;

void hold_starts(const refine_layout& l, const refine_parameters& p) {
    for (int k = 0; k < l.n_z; k += l.size(k)) {
        double largest = -1;
        for (int r = 0; r < l.runs; ++r) {
            const double* x = p.start + at(k, r, l.n_z);
            const double power = x[0] * x[0] + (l.pair[k] ? x[1] * x[1] : 0);
            if (power > largest) std::fill(l.fixed + k, l.fixed + k + l.size(k), r), largest = power;
        }
    }
}

void refine_signals::lay_out(const refine_layout& l, arena& memory) {
    layout = &l;
    now = memory.take<double>(area(l.of_run()));
    signals = memory.take<double>(area(l.of_run(), batch));
    errors = memory.take<double>(area(l.n_y, batch));
    follows = memory.take<bool>(batch);
}

void refine_signals::start(const refine_parameters& p, int run) {
    const refine_layout& l = *layout;
    std::fill(now, now + l.of_run(), 0.0);
    std::copy(p.start + at(0, run, l.n_z), p.start + at(0, run + 1, l.n_z), now + l.states());
    for (int k = 0; k < l.n_z; k += l.size(k)) now[l.decay() + k] = 1;
    now[l.one()] = l.constants ? 1 : 0;
    columns = 0;
    broken = true;
}

namespace {

/// x <- w x, and y added where there is one.
void advance(std::complex<double> w, bool pair, double* x, const double* y) {
    const double f = x[0];
    if (!pair) {
        x[0] = w.real() * f + (y != nullptr ? y[0] : 0);
        return;
    }
    const double g = x[1];
    x[0] = w.real() * f - w.imag() * g + (y != nullptr ? y[0] : 0);
    x[1] = w.real() * g + w.imag() * f + (y != nullptr ? y[1] : 0);
}

} // namespace

bool refine_signals::sample(const refine_parameters& p, const double* v) {
    const refine_layout& l = *layout;
    const double* y = v + l.n_u;
    std::copy(v, v + l.n_u, now);
    const bool known = std::all_of(y, y + l.n_y, [](double x) { return std::isfinite(x); });
    if (known) {
        std::copy(now, now + l.of_run(), signals + at(0, columns, l.of_run()));
        std::copy(y, y + l.n_y, errors + at(0, columns, l.n_y));
        follows[columns++] = !broken;
    }
    broken = !known;
    for (int k = 0; k < l.n_z; k += l.size(k)) {
        const std::complex<double> w = p.w(l, k);
        double* s = now + l.states() + k;
        for (int i = 0; i < l.gains(); ++i) {
            double* phi = now + l.phi() + i * l.n_z + k;
            advance(w, l.pair[k], phi, nullptr);
            phi[0] += v[l.input(k, i)];
        }
        advance(w, l.pair[k], now + l.slope() + k, s);
        advance(w, l.pair[k], s, nullptr);
        for (int c = 0; c < l.n_u; ++c)
            for (int part = 0; part < l.size(k); ++part) s[part] += p.input[at(k + part, c, l.n_z)] * v[c];
        advance(w, l.pair[k], now + l.decay() + k, nullptr);
    }
    return columns == batch;
}

void refine_signals::find_errors(const refine_parameters& p) const {
    const refine_layout& l = *layout;
    multiply(false, false, l.n_y, columns, l.n_u + l.n_z, -1, p.shows, l.n_y, signals, l.of_run(), 1, errors, l.n_y);
}

int refine_signals::rows() const {
    constexpr double died_out = 1e-14;
    const refine_layout& l = *layout;
    for (int k = l.decay(); columns > 0 && k < l.of_run(); ++k) // a stable mode is largest in the first sample
        if (!(std::abs(signals[k]) < died_out)) return l.of_run();
    return l.decay();
}

} // namespace okid
