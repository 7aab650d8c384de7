// SPDX-License-Identifier: MIT
// PURPOSE    the Gauss-Newton step of the refinement from the sums of one pass
// METHOD     D, the shapes c and the constants enter each output through the same signals E = [u; s; 1]: their part of the
//            normal matrix is weight x G_EE and is eliminated once for all outputs, G_FF - G_FE G_EE^-1 G_EF. The gains,
//            poles and initial states act through the shapes: their normal matrix is that remainder, every 2 x 2 block of
//            two modes multiplied by the sums over the outputs of weight c_k c_l and weight c_k conj(c_l)
// REFERENCE  docs/numerics.md, refinement; Golub, Pereyra (1973) for the elimination
// NUMERICS   signals scaled to one size, floors of 1e-13: what the data do not determine is left where it is
// WORKSPACE  4 total^2 numbers; linear^3/3 + linear^2 shaped + shaped^3/3 flop and n_z^2 n_y
#include "identify/refine_step.hpp"

#include <cmath>

namespace okid {

using linalg::multiply;
using complex = std::complex<double>;

namespace {

constexpr double equations_floor = 1e-13;

} // namespace

void refine_sums::lay_out(const refine_layout& l, arena& memory) {
    gram = memory.take<double>(area(l.total(), l.total()));
    with_e = memory.take<double>(area(l.total(), l.n_y));
    square = memory.take<double>(area(l.n_y));
    mean = memory.take<double>(area(l.n_y, l.runs));
    output = memory.take<double>(area(l.n_y));
}

void refine_change::lay_out(const refine_layout& l, arena& memory) {
    linear = memory.take<double>(area(l.linear(), l.n_y));
    shaped = memory.take<double>(area(l.shaped()));
}

void refine_change::add_to(const refine_layout& l, const refine_parameters& p, double alpha,
                           const refine_parameters& out) const {
    std::copy(p.pole, p.pole + refine_parameters::count(l), out.pole);
    for (int o = 0; o < l.n_y; ++o)
        for (int i = 0; i < l.n_u + l.n_z; ++i) out.shows[at(o, i, l.n_y)] += alpha * linear[at(i, o, l.linear())];
    for (int k = 0; k < l.n_z; k += l.size(k))
        for (int j = k; j < k + l.size(k); ++j) {
            for (int i = 0; i < l.gains(); ++i) out.input[at(j, l.input(k, i), l.n_z)] += alpha * shaped[i * l.n_z + j];
            out.pole[j] += alpha * shaped[l.gains() * l.n_z + j];
            for (int r = 0; r < l.runs; ++r)
                out.start[at(j, r, l.n_z)] += alpha * shaped[(l.gains() + 1 + r) * l.n_z + j];
        }
}

void refine_equations::lay_out(const refine_layout& l, arena& memory) {
    layout = &l;
    weight = memory.take<double>(area(l.n_y));
    scale = memory.take<double>(area(l.total()));
    own = memory.take<double>(area(l.linear(), l.linear()));
    cross = memory.take<double>(area(l.linear(), l.shaped()));
    across = memory.take<double>(area(l.linear(), l.shaped()));
    left = memory.take<double>(area(l.shaped(), l.shaped()));
    core = memory.take<double>(area(l.shaped(), l.shaped()));
    factor = memory.take<double>(area(l.shaped(), l.shaped()));
    balance = memory.take<double>(area(l.shaped()));
    gradient = memory.take<double>(area(l.shaped()));
    residual = memory.take<double>(area(l.total(), l.n_y));
    alike = memory.take<complex>(area(l.n_z, l.n_z));
    mirror = memory.take<complex>(area(l.n_z, l.n_z));
}

/// Weights of the outputs, one scale for the two parts of a signal of a pair, sums over the outputs.
void refine_equations::weigh(const refine_sums& sums) const {
    const refine_layout& l = *layout;
    for (int o = 0; o < l.n_y; ++o) weight[o] = sums.square[o] > 0 ? 1 / sums.square[o] : 0;
    const auto power = [&](int i) { return sums.gram[at(i, i, l.total())]; };
    for (int i = 0; i < l.total(); ++i) scale[i] = power(i);
    for (int first = l.n_u; first < l.total(); first += first == l.n_u ? l.n_z + l.runs : l.n_z)
        for (int k = 0; k < l.n_z; k += l.size(k))
            if (l.pair[k]) scale[first + k] = scale[first + k + 1] = power(first + k) + power(first + k + 1);
    for (int i = 0; i < l.total(); ++i) scale[i] = scale[i] > 0 ? 1 / std::sqrt(scale[i]) : 0;
    for (int k = 0; k < l.n_z; k += l.size(k))
        for (int j = 0; j < l.n_z; j += l.size(j)) {
            complex a = 0, m = 0;
            for (int o = 0; o < l.n_y; ++o) {
                const complex c = at_point->shape(l, o, k), d = at_point->shape(l, o, j);
                a += weight[o] * c * d;
                m += weight[o] * c * std::conj(d);
            }
            alike[at(k, j, l.n_z)] = a;
            mirror[at(k, j, l.n_z)] = m;
        }
}

/// The block of two signals of the modes k and l, at (row, col) of `left`: derivatives are Re(c q) and -Im(c q).
void refine_equations::expand_pair(int row, int col, int k, int l) const {
    const refine_layout& s = *layout;
    const int n = s.shaped();
    const bool p = s.pair[k], q = s.pair[l];
    const double* z = left + at(row, col, n);
    const double z11 = z[0], z12 = q ? z[n] : 0, z21 = p ? z[1] : 0, z22 = p && q ? z[n + 1] : 0;
    const complex both = alike[at(k, l, s.n_z)] * complex(z11 - z22, z12 + z21) / 2.0;
    const complex turned = mirror[at(k, l, s.n_z)] * complex(z11 + z22, z21 - z12) / 2.0;
    double* h = core + at(row, col, n);
    h[0] = both.real() + turned.real();
    if (q) h[n] = turned.imag() - both.imag();
    if (p) h[1] = -both.imag() - turned.imag();
    if (p && q) h[n + 1] = turned.real() - both.real();
}

void refine_equations::expand() const {
    const refine_layout& l = *layout;
    for (int b = 0; b < l.shaped(); b += l.n_z)
        for (int j = 0; j < l.n_z; j += l.size(j))
            for (int a = 0; a < l.shaped(); a += l.n_z)
                for (int k = 0; k < l.n_z; k += l.size(k)) expand_pair(a + k, b + j, k, j);
}

bool refine_equations::prepare(const refine_parameters& p, const refine_sums& sums, bool only_starts) {
    const refine_layout& l = *layout;
    const int e = l.linear(), f = l.shaped();
    at_point = &p;
    starts_only = only_starts;
    weigh(sums);
    const auto scaled = [&](int i, int j) { return scale[i] * scale[j] * sums.gram[at(i, j, l.total())]; };
    for (int c = 0; c < e; ++c)
        for (int r = 0; r < e; ++r) own[at(r, c, e)] = scaled(r, c);
    for (int c = 0; c < e; ++c) own[at(c, c, e)] += scale[c] > 0 ? equations_floor : 1;
    for (int c = 0; c < f; ++c) {
        for (int r = 0; r < e; ++r) cross[at(r, c, e)] = scaled(r, e + c);
        for (int r = 0; r < f; ++r) left[at(r, c, f)] = scaled(e + r, e + c);
        left[at(c, c, f)] += equations_floor;
    }
    if (!starts_only) {
        if (linalg::cholesky(e, own, e) != 0) return false;
        std::copy(cross, cross + area(e, f), across);
        linalg::cholesky_solve(e, own, e, across, e, f);
        multiply(true, false, f, f, e, -1, cross, e, across, e, 1, left, f);
    }
    expand();
    for (int k = 0; k < f; ++k)
        if (stays(k)) hold(k);
    return true;
}

/// Is this one of the shaped parameters that are not free?
bool refine_equations::stays(int k) const {
    const refine_layout& l = *layout;
    const int slope = l.gains() * l.n_z, starts = slope + l.n_z;
    if (k < starts) return starts_only || (k >= slope && l.held[k - slope]);
    return l.n_u == 0 && !starts_only && (k - starts) / l.n_z == l.fixed[(k - starts) % l.n_z];
}

void refine_equations::hold(int k) const {
    const int f = layout->shaped();
    std::fill(core + area(f, k), core + area(f, k + 1), 0.0);
    for (int r = 0; r < f; ++r) core[at(k, r, f)] = 0;
    core[at(k, k, f)] = 1;
}

bool refine_equations::damp(double mu) const {
    const int f = layout->shaped();
    for (int k = 0; k < f; ++k) {
        const double h = core[at(k, k, f)];
        balance[k] = h > 0 ? 1 / std::sqrt(h) : 0;
    }
    for (int c = 0; c < f; ++c) {
        for (int r = 0; r < f; ++r) factor[at(r, c, f)] = core[at(r, c, f)] * balance[r] * balance[c];
        factor[at(c, c, f)] = 1 + mu + equations_floor;
    }
    return linalg::cholesky(f, factor, f) == 0;
}

/// out = sum over the outputs of weight times (Re(c q) e, -Im(c q) e) for signals q; `projected` holds q e.
void refine_equations::reduce(const double* projected, double* out) const {
    const refine_layout& l = *layout;
    for (int first = 0; first < l.shaped(); first += l.n_z)
        for (int k = 0; k < l.n_z; k += l.size(k)) {
            complex sum = 0; // of weight c (f + i g)
            for (int o = 0; o < l.n_y; ++o) {
                const double* q = projected + at(first + k, o, l.total());
                sum += weight[o] * at_point->shape(l, o, k) * complex(q[0], l.pair[k] ? q[1] : 0.0);
            }
            out[first + k] = sum.real();
            if (l.pair[k]) out[first + k + 1] = -sum.imag();
        }
}

double refine_equations::step(const double* with_e, const refine_change& out) const {
    const refine_layout& l = *layout;
    const int e = l.linear(), f = l.shaped(), t = l.total();
    for (int o = 0; o < l.n_y; ++o)
        for (int i = 0; i < t; ++i) residual[at(i, o, t)] = scale[i] * with_e[at(i, o, t)];
    std::fill(out.linear, out.linear + area(e, l.n_y), 0.0);
    double promise = 0;
    if (!starts_only) {
        for (int o = 0; o < l.n_y; ++o)
            std::copy(residual + at(0, o, t), residual + at(e, o, t), out.linear + at(0, o, e));
        linalg::cholesky_solve(e, own, e, out.linear, e, l.n_y);
        multiply(true, false, f, l.n_y, e, -1, cross, e, out.linear, e, 1, residual + e, t);
        for (int o = 0; o < l.n_y; ++o)
            for (int i = 0; i < e; ++i) promise += weight[o] * residual[at(i, o, t)] * out.linear[at(i, o, e)];
    }
    reduce(residual + e, out.shaped);
    for (int k = 0; k < f; ++k)
        if (stays(k)) out.shaped[k] = 0;
    for (int k = 0; k < f; ++k) gradient[k] = out.shaped[k] *= balance[k];
    linalg::cholesky_solve(f, factor, f, out.shaped, f, 1);
    for (int k = 0; k < f; ++k) {
        promise += gradient[k] * out.shaped[k];
        out.shaped[k] *= balance[k];
    }
    if (!starts_only) take_from_linear(out);
    for (int o = 0; o < l.n_y; ++o)
        for (int i = 0; i < e; ++i) out.linear[at(i, o, e)] *= scale[i];
    for (int k = 0; k < f; ++k) out.shaped[k] *= scale[e + k];
    return promise;
}

/// What the step of the shaped parameters does to an output, c delta in each signal, the linear ones make room for.
void refine_equations::take_from_linear(const refine_change& out) const {
    const refine_layout& l = *layout;
    const int e = l.linear(), f = l.shaped(), t = l.total();
    for (int first = 0; first < f; first += l.n_z)
        for (int k = 0; k < l.n_z; k += l.size(k)) {
            const complex delta(out.shaped[first + k], l.pair[k] ? out.shaped[first + k + 1] : 0.0);
            for (int o = 0; o < l.n_y; ++o) {
                const complex shown = at_point->shape(l, o, k) * delta;
                residual[at(e + first + k, o, t)] = shown.real();
                if (l.pair[k]) residual[at(e + first + k + 1, o, t)] = -shown.imag();
            }
        }
    multiply(false, false, e, l.n_y, f, -1, across, e, residual + e, t, 1, out.linear, e);
}

} // namespace okid
