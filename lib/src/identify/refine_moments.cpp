// SPDX-License-Identifier: MIT
// PURPOSE    the sums a step of the refinement needs, from correlation sums instead of a record
// METHOD     x(t) = sum_i w^i u(t-1-i), i < L, obeys x(t+1) = w x(t) + u(t) - w^L u(t-L); with z likewise of the pole v, summed
//            over the rows of a run: (1 - w v) sum x z = w sum x z~ + v sum x~ z + sum x~ z~ + (x z at the head) - (x z at the
//            tail), x~ = u(t) - w^L u(t-L). sum u' x = sum_i w^i R(1 + i) is a polynomial of the correlations. Derivatives by
//            w and v in the same way: no matrix over the lags, no transform, all edges exact
// REFERENCE  docs/numerics.md, refinement from sums
// NUMERICS   a sum of squares exactly; but signals end after L lags: what a mode still rings then is left out, |w|^L of it
// WORKSPACE  (2 n_u n_z)^2 complex numbers twice; 16 n_z m n_u L flop, nothing a sample
#include "identify/refine_moments.hpp"

#include <cmath>
#include <limits>

namespace okid {

using complex = std::complex<double>;
using std::size_t;

void refine_moments::lay_out(const refine_layout& l, arena& memory) {
    layout = &l;
    const int m = l.n_u + l.n_y, two = 2 * l.n_u;
    with = memory.take<complex>(area(m, base()));
    late = memory.take<complex>(area(l.n_u, base()));
    alike = memory.take<complex>(area(base(), base()));
    mirror = memory.take<complex>(area(base(), base()));
    end = memory.take<complex>(area(base()));
    total = memory.take<complex>(area(base()));
    block = memory.take<complex>(area(two, two));
    turned = memory.take<complex>(area(two, two));
    horner = memory.take<double>(4 * area(m, l.n_u));
    one = memory.take<double>(area(l.total()));
}

/// value = sum_i w^i column(i), slope its derivative by w, i < lags; `width` numbers a column.
void refine_moments::evaluate(const double* columns, int width, int lags, complex w, complex* value,
                              complex* slope) const {
    double *re = horner, *im = re + width, *slope_re = im + width, *slope_im = slope_re + width;
    std::fill(horner, horner + area(4, width), 0.0);
    const double a = w.real(), b = w.imag();
    for (int i = lags - 1; i >= 0; --i) {
        const double* column = columns + area(width, i);
        for (int e = 0; e < width; ++e) {
            const double x = re[e], y = im[e], dx = slope_re[e];
            slope_re[e] = a * dx - b * slope_im[e] + x;
            slope_im[e] = a * slope_im[e] + b * dx + y;
            re[e] = a * x - b * y + column[e];
            im[e] = a * y + b * x;
        }
    }
    for (int e = 0; e < width; ++e) {
        value[e] = {re[e], im[e]};
        slope[e] = {slope_re[e], slope_im[e]};
    }
}

/// Everything that depends on one pole alone, and the products at the ends.
void refine_moments::look_at_record(const refine_parameters& p, const okid_correlation_sums_t& record) {
    const refine_layout& l = *layout;
    const int n_u = l.n_u, m = n_u + l.n_y, n = base();
    std::fill(alike, alike + area(n, n), complex(0));
    std::fill(mirror, mirror + area(n, n), complex(0));
    for (int k = 0; k < l.n_z; k += l.size(k)) {
        const int at_pole = 2 * n_u * k;
        evaluate(record.U + area(m, n_u), m * n_u, record.lags, p.w(l, k), with + area(m, at_pole),
                 with + area(m, at_pole + n_u));
        evaluate(record.T + area(n_u, n_u), n_u * n_u, record.lags, p.w(l, k), late + area(n_u, at_pole),
                 late + area(n_u, at_pole + n_u));
        evaluate(record.lag_sum + n_u, n_u, record.lags, p.w(l, k), total + at_pole, total + at_pole + n_u);
    }
    const size_t of_end = area(n_u, record.lags);
    for (int piece = 0; piece < 2 * record.runs; ++piece) {
        const double* inputs = record.ends + of_end * static_cast<size_t>(piece);
        const double sign = (piece % 2 == 0 ? 1 : -1) * record.weight[piece / 2];
        for (int k = 0; k < l.n_z; k += l.size(k))
            evaluate(inputs, n_u, record.lags, p.w(l, k), end + 2 * n_u * k, end + 2 * n_u * k + n_u);
        for (int k = 0; k < l.n_z; k += l.size(k))
            for (int c = 2 * n_u * k; c < 2 * n_u * (k + 1); ++c)
                for (int j = 0; j <= k; j += l.size(j))
                    for (int r = 2 * n_u * j; r < 2 * n_u * (j + 1); ++r) {
                        alike[at(r, c, n)] += sign * end[r] * end[c];
                        mirror[at(r, c, n)] += sign * end[r] * std::conj(end[c]);
                    }
    }
}

/// Sums of products of the signals of the poles j <= k, those of k conjugated or not. With G = N / D, D = 1 - w v:
/// G_w = (N_w + v G)/D, G_v = (N_v + w G)/D, G_wv = (N_wv + w G_w + v G_v + G)/D.
void refine_moments::multiply_poles(const refine_parameters& p, const okid_correlation_sums_t& record, int j, int k,
                                    bool conjugate, complex* out) const {
    const refine_layout& l = *layout;
    const int n_u = l.n_u, m = n_u + l.n_y, two = 2 * n_u;
    const auto turn = [&](complex x) { return conjugate ? std::conj(x) : x; };
    const complex w = p.w(l, j), v = turn(p.w(l, k)), d = 1.0 - w * v;
    const double L = record.lags;
    const complex wL = std::pow(w, L), vL = std::pow(v, L), wL_w = L * wL / w,
                  vL_v = L * vL / v; // and their derivatives
    const double* oldest = record.U + area(m, record.lags * n_u);
    const double* both_old = record.T + area(n_u, record.lags * n_u);
    const complex* ends = (conjugate ? mirror : alike) + at(two * j, two * k, base());
    const auto edge = [&](int r, int c) { return ends[at(r, c, base())]; };
    for (int b = 0; b < n_u; ++b)       // input of pole k
        for (int a = 0; a < n_u; ++a) { // input of pole j
            const int x = two * j + a, z = two * k + b;
            const complex x0 = with[at(b, x, m)], dx0 = with[at(b, x + n_u, m)];
            const complex x1 = late[at(b, x, n_u)], dx1 = late[at(b, x + n_u, n_u)];
            const complex z0 = turn(with[at(a, z, m)]), dz0 = turn(with[at(a, z + n_u, m)]);
            const complex z1 = turn(late[at(a, z, n_u)]), dz1 = turn(late[at(a, z + n_u, n_u)]);
            const double ab = oldest[at(a, b, m)], ba = oldest[at(b, a, m)], old = both_old[at(a, b, n_u)];
            const complex n = w * (x0 - vL * x1) + v * (z0 - wL * z1) + record.U[at(a, b, m)] - vL * ab - wL * ba +
                              wL * vL * old + edge(a, b);
            const complex n_w =
                x0 - vL * x1 + w * (dx0 - vL * dx1) - wL_w * (v * z1 + ba - vL * old) + edge(n_u + a, b);
            const complex n_v =
                z0 - wL * z1 + v * (dz0 - wL * dz1) - vL_v * (w * x1 + ab - wL * old) + edge(a, n_u + b);
            const complex n_wv =
                wL_w * vL_v * old - vL_v * (x1 + w * dx1) - wL_w * (z1 + v * dz1) + edge(n_u + a, n_u + b);
            const complex g = n / d, by_w = (n_w + v * g) / d, by_v = (n_v + w * g) / d;
            const complex both = (n_wv + w * by_w + v * by_v + g) / d;
            out[at(a, b, two)] = g;
            out[at(n_u + a, b, two)] = by_w;
            out[at(a, n_u + b, two)] = by_v;
            out[at(n_u + a, n_u + b, two)] = both;
        }
}

/// Signal i of pole k, 0: s, 1 .. n_u - 1: phi, n_u: the derivative of s. @return its place among all
int refine_moments::place(int k, int i) const {
    const refine_layout& l = *layout;
    const int first = i == 0 ? l.states() : i < l.n_u ? l.phi() + (i - 1) * l.n_z : l.slope();
    return l.place(first + k, 0);
}

/// What signal i of pole k is made of: weight of its phi (or derivative) of input c.
complex refine_moments::weight(const refine_parameters& p, int k, int i, int c) const {
    const refine_layout& l = *layout;
    if (i > 0 && i < l.n_u) return l.input(k, i - 1) == c ? 1.0 : 0.0;
    const double* b = p.input + at(k, c, l.n_z);
    return {b[0], l.pair[k] ? b[1] : 0.0};
}

/// The signals of the poles j <= k into the Gram matrix, real and imaginary parts as signals of their own.
void refine_moments::expand(const refine_parameters& p, int j, int k, double* gram) const {
    const refine_layout& l = *layout;
    const int n_u = l.n_u, two = 2 * n_u, t = l.total();
    const auto put = [&](int r, int c, double x) { gram[at(r, c, t)] = gram[at(c, r, t)] = x; };
    for (int b = 0; b <= n_u; ++b)
        for (int a = 0; a <= n_u; ++a) {
            complex plain = 0, conjugate = 0;
            for (int d = 0; d < n_u; ++d)
                for (int c = 0; c < n_u; ++c) {
                    const complex left = weight(p, j, a, c), right = weight(p, k, b, d);
                    const size_t from = at(a == n_u ? n_u + c : c, b == n_u ? n_u + d : d, two);
                    plain += left * right * block[from];
                    conjugate += left * std::conj(right) * turned[from];
                }
            const int row = place(j, a), column = place(k, b);
            const bool pairs = l.pair[j] && l.pair[k];
            put(row, column, (plain + conjugate).real() / 2);
            if (l.pair[j]) put(row + 1, column, (plain + conjugate).imag() / 2);
            if (l.pair[k]) put(row, column + 1, (plain - conjugate).imag() / 2);
            if (pairs) put(row + 1, column + 1, (conjugate - plain).real() / 2);
        }
}

/// Products of the signals with the channels: with the inputs into the Gram matrix, with the outputs into `with_e`.
void refine_moments::correlate(const refine_parameters& p, const okid_correlation_sums_t& record,
                               const refine_sums& sums) const {
    const refine_layout& l = *layout;
    const int n_u = l.n_u, m = n_u + l.n_y, t = l.total();
    const auto put = [&](int row, int channel, double x) {
        if (channel < n_u)
            sums.gram[at(row, channel, t)] = sums.gram[at(channel, row, t)] = x;
        else
            sums.with_e[at(row, channel - n_u, t)] = x;
    };
    for (int r = 0; r < m; ++r) {
        for (int c = 0; c < n_u; ++c) put(c, r, record.U[at(r, c, m)]);
        for (int k = 0; k < l.n_z; k += l.size(k))
            for (int i = 0; i <= n_u; ++i) {
                complex x = 0;
                for (int c = 0; c < n_u; ++c)
                    x += weight(p, k, i, c) * with[at(r, 2 * n_u * k + (i == n_u ? n_u : 0) + c, m)];
                put(place(k, i), r, x.real());
                if (l.pair[k]) put(place(k, i) + 1, r, x.imag());
            }
    }
}

/// Take the means over the rows off all signals and outputs.
void refine_moments::centre(const refine_parameters& p, const okid_correlation_sums_t& record,
                            const refine_sums& sums) const {
    const refine_layout& l = *layout;
    const int n_u = l.n_u, t = l.total();
    std::copy(record.sum, record.sum + n_u, one);
    for (int k = 0; k < l.n_z; k += l.size(k))
        for (int i = 0; i <= n_u; ++i) {
            complex x = 0;
            for (int c = 0; c < n_u; ++c) x += weight(p, k, i, c) * total[2 * n_u * k + (i == n_u ? n_u : 0) + c];
            one[place(k, i)] = x.real();
            if (l.pair[k]) one[place(k, i) + 1] = x.imag();
        }
    for (int c = 0; c < t; ++c)
        for (int r = 0; r < t; ++r) sums.gram[at(r, c, t)] -= one[r] * one[c] / record.rows;
    for (int o = 0; o < l.n_y; ++o)
        for (int r = 0; r < t; ++r) sums.with_e[at(r, o, t)] -= one[r] * record.sum[n_u + o] / record.rows;
}

void refine_moments::sum(const refine_parameters& p, const okid_correlation_sums_t& record, refine_sums& sums) {
    const refine_layout& l = *layout;
    const int n_u = l.n_u, own = n_u + l.n_z, t = l.total(), m = n_u + l.n_y;
    look_at_record(p, record);
    correlate(p, record, sums);
    for (int k = 0; k < l.n_z; k += l.size(k))
        for (int j = 0; j <= k; j += l.size(j)) {
            multiply_poles(p, record, j, k, false, block);
            multiply_poles(p, record, j, k, true, turned);
            expand(p, j, k, sums.gram);
        }
    if (record.centred != 0) centre(p, record, sums);
    sums.used = static_cast<long long>(record.rows);
    sums.likelihood = 0;
    for (int o = 0; o < l.n_y; ++o) {
        const double* y = sums.with_e + at(0, o, t);
        double square = record.Y[at(n_u + o, o, m)];
        if (record.centred != 0) square -= record.sum[n_u + o] * record.sum[n_u + o] / record.rows;
        for (int i = 0; i < own; ++i) {
            one[i] = p.shows[at(o, i, l.n_y)];
            square -= one[i] * y[i];
        }
        linalg::multiply(false, false, t, 1, own, -1, sums.gram, t, one, own, 1, sums.with_e + at(0, o, t), t);
        for (int i = 0; i < own; ++i) square -= one[i] * y[i];
        const double rounding = 1e-15 * sums.output[o] + std::numeric_limits<double>::min();
        sums.square[o] = std::max(square / record.rows, rounding);
        sums.likelihood -= record.rows / 2 * std::log(sums.square[o]);
    }
}

} // namespace okid
