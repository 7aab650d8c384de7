// SPDX-License-Identifier: MIT
// PURPOSE    filters in the modal coordinates of a given A, and the Gram matrix of their signals over a run of samples
// METHOD     phi(t+1) = w phi(t) + u(t) for every eigenvalue and input; 64 samples at a time into the sums. Without a gap the
//            sums of two signals a, b solve S - w_a S w_b = (what the inputs and the two ends add): run()
// REFERENCE  docs/numerics.md, "Subspace methods"
// NUMERICS   needs independent eigenvectors; unstable eigenvalues grow until the numbers end (the caller looks). run() divides
//            by 1 - |w|^2: not below 1e-6
// WORKSPACE  base^2 + (64 + n_y) base numbers and what okid_filters_t takes; base = n_z n_u + n_z + n_u. base^2 flop a sample,
//            run() (2.5 n_z + 9 n_u + n_z n_u / 2) (n_u + n_y)
#include "identify/modal_filters.hpp"

#include "mechanics/recursion.h"

#include <cmath>
#include <complex>

namespace okid {

using linalg::multiply;
using std::size_t;

namespace {

constexpr int batch = 64, stretch = OKID_FILTERS_STRETCH, block = OKID_FILTERS_BLOCK; // samples of sample(), of run()
constexpr double died_out = 1e-14, least_decay = 1e-6, denormal = 1e-200;

/// In eight sums, so that none waits for the other.
bool all_finite(const double* x, size_t count) {
    double sums[8] = {};
    size_t i = 0;
    for (; i + 8 <= count; i += 8)
        for (size_t k = 0; k < 8; ++k) sums[k] += x[i + k] * 0.0;
    for (; i < count; ++i) sums[0] += x[i] * 0.0;
    return std::all_of(sums, sums + 8, [](double one) { return one == 0; });
}

/// Plain products and quotients: std::complex looks for infinite parts, which settles() and run() exclude.
std::complex<double> times(std::complex<double> a, std::complex<double> b) {
    return {a.real() * b.real() - a.imag() * b.imag(), a.real() * b.imag() + a.imag() * b.real()};
}
std::complex<double> over(std::complex<double> a, std::complex<double> b) {
    return times(a, std::conj(b)) / (b.real() * b.real() + b.imag() * b.imag());
}

} // namespace

modal_filters::modal_filters(int inputs, int outputs, int states, arena& memory)
    : n_u(inputs), n_y(outputs), n_z(states), base(n_u + n_z * n_u + n_z), free(base - n_z), used(0) {
    modes = memory.take<double>(area(n_z, n_z));
    sums = memory.take<double>(area(base, base));
    with_y = memory.take<double>(area(base, n_y));
    a_ = memory.take<okid_real_t>(area(n_z, n_z));
    vectors_ = memory.take<okid_real_t>(area(n_z, n_z));
    re_ = memory.take<okid_real_t>(area(n_z));
    im_ = memory.take<okid_real_t>(area(n_z));
    eigen_ = memory.take<okid_real_t>(linalg::eigen_work(n_z));
    shapes_ = memory.take<double>(area(n_y, n_z));
    shared_ = memory.take<double>(area(n_z, n_z));
    state_ = memory.take<double>(area(base));
    signals_ = memory.take<double>(area(base, batch));
    outputs_ = memory.take<double>(area(n_y, batch));
    const int most = static_cast<int>(okid_filters_padded(area(n_z, 1))), m = n_u + n_y;
    const int wide = static_cast<int>(okid_filters_padded(area(m, 1)));
    powers_ = memory.take<double>(area(2 * most, block + 1));
    filter_states_ = memory.take<double>(area(2 * most, n_u + 1));
    filter_sums_ = memory.take<double>(area(2 * wide, n_z * (n_u + 1)));
    filter_lags_ = memory.take<double>(area(wide, n_u * block));
    filter_work_ = memory.take<double>(okid_filters_work(area(n_u), area(n_z)));
    with_v_ = memory.take<double>(area(n_u + 2 * n_z * (n_u + 1), m));
}

bool modal_filters::decompose(const okid_real_t* A, const okid_real_t* C) {
    std::copy(A, A + at(0, n_z, n_z), a_);
    if (linalg::eigen(n_z, a_, re_, im_, vectors_, eigen_) != 0) return false;
    if (!sort_modes()) return false;
    double* observe = with_y; // C in double: n_y n_z of its base n_y numbers
    std::copy(C, C + at(0, n_z, n_y), observe);
    multiply(false, false, n_y, n_z, n_z, 1, observe, n_y, modes, n_z, 0, shapes_, n_y);
    multiply(true, false, n_z, n_z, n_y, 1, shapes_, n_y, shapes_, n_y, 0, shared_, n_z);
    return true;
}

/// The slowest first: of w^t what is left stands together. `modes` <- the vectors in that order. @return false: not all are numbers
bool modal_filters::sort_modes() {
    double *re = state_, *im = signals_; // free until start()
    std::copy(re_, re_ + n_z, re);
    std::copy(im_, im_ + n_z, im);
    for (int to = 0; to < n_z; to += size(to)) {
        int best = -1;
        for (int k = 0; k < n_z; k += im[k] > 0 ? 2 : 1)
            if (std::isfinite(re[k]) && (best < 0 || std::hypot(re[k], im[k]) > std::hypot(re[best], im[best])))
                best = k;
        if (best < 0) return false;
        const int wide = im[best] > 0 ? 2 : 1;
        std::copy(vectors_ + at(0, best, n_z), vectors_ + at(0, best + wide, n_z), modes + at(0, to, n_z));
        for (int part = 0; part < wide; ++part) {
            re_[to + part] = static_cast<okid_real_t>(re[best + part]);
            im_[to + part] = static_cast<okid_real_t>(im[best + part]);
            re[best + part] = NAN; // taken
        }
    }
    return true;
}

/// x <- w x, mode by mode.
void modal_filters::advance(double* x) const {
    for (int k = 0; k < n_z; k += size(k)) {
        const double f = x[k], w = re_[k];
        x[k] = w * f;
        if (!pair(k)) continue;
        const double g = x[k + 1], v = im_[k];
        x[k] = w * f - v * g;
        x[k + 1] = w * g + v * f;
    }
}

void modal_filters::start() {
    waiting_ = 0;
    used = 0;
    std::fill(sums, sums + at(0, base, base), 0.0);
    std::fill(with_y, with_y + at(0, n_y, base), 0.0);
    std::fill(state_, state_ + base, 0.0);
    for (int k = 0; k < n_z; k += size(k)) state_[free + k] = 1;
}

void modal_filters::sample(const double* v) {
    std::copy(v, v + n_u, state_);
    if (std::all_of(v + n_u, v + n_u + n_y, [](double y) { return std::isfinite(y); })) {
        std::copy(state_, state_ + base, signals_ + at(0, waiting_, base));
        std::copy(v + n_u, v + n_u + n_y, outputs_ + at(0, waiting_, n_y));
        if (++waiting_ == batch) flush();
    }
    for (int c = 0; c < n_u; ++c) {
        double* phi = state_ + n_u + c * n_z;
        advance(phi);
        for (int k = 0; k < n_z; k += size(k)) phi[k] += v[c];
    }
    advance(state_ + free);
}

void modal_filters::flush() {
    double largest = 0; // of w^t: once it has died out it needs no product any more
    for (int c = 0; c < waiting_; ++c)
        for (int k = free; k < base; ++k) largest = std::max(largest, std::abs(signals_[at(k, c, base)]));
    const int rows = largest > died_out || !(largest >= 0) ? base : free, columns = waiting_;
    used += waiting_;
    waiting_ = 0;
    if (columns == 0 || rows == 0) return;
    lower_product(rows, [columns](int) { return columns; }, signals_, base, 1, sums, base);
    multiply(false, true, rows, n_y, columns, 1, signals_, base, outputs_, n_y, 1, with_y, base);
}

bool modal_filters::settles() const {
    for (int k = 0; k < n_z; ++k) {
        const double re = re_[k], im = im_[k];
        if (!(re * re + im * im <= 1 - least_decay)) return false;
    }
    return true;
}

/// Powers of w, the states at the beginning, no sums.
void modal_filters::place_powers() {
    blocks_ = 0;
    for (int k = 0; k < n_z; k += size(k)) ++blocks_;
    lanes_ = blocks_ * (n_u + 1);
    padded_ = static_cast<int>(okid_filters_padded(area(blocks_, 1)));
    const int m = static_cast<int>(okid_filters_padded(area(n_u + n_y, 1))), step = 2 * padded_;
    std::fill(powers_, powers_ + at(0, block + 1, step), 0.0);
    std::fill(filter_states_, filter_states_ + at(0, n_u + 1, step), 0.0);
    std::fill(filter_sums_, filter_sums_ + at(0, 2 * lanes_, m), 0.0);
    std::fill(filter_lags_, filter_lags_ + at(0, n_u * block, m), 0.0);
    for (int k = 0, mode = 0; k < n_z; k += size(k), ++mode) {
        filter_states_[at(mode, n_u, step)] = 1;
        std::complex<double> power = 1;
        for (int j = 0; j <= block; ++j, power = times(power, {re_[k], im_[k]})) {
            double* to = powers_ + okid_filters_power(area(mode, 1), area(j, 1));
            to[0] = power.real();
            to[4] = power.imag();
        }
    }
}

/// Signals times rows, out of the sums over blocks and within them.
void modal_filters::sum_lanes() {
    const int m = n_u + n_y, wide = n_u + 2 * lanes_;
    const int padded = static_cast<int>(okid_filters_padded(area(m, 1)));
    for (int c = 0; c < m; ++c) {
        double* column = with_v_ + at(0, c, wide);
        for (int i = 0; i < n_u; ++i) column[i] = filter_lags_[at(c, i * block, padded)];
        for (int lane = 0; lane < lanes_; ++lane)
            for (int part = 0; part < 2; ++part) {
                double sum = filter_sums_[at(c, 2 * lane + part, padded)];
                const int group = lane / blocks_;
                const double* power = powers_ + okid_filters_power(area(lane % blocks_, 1), 0) + 4 * part;
                for (int d = 1; group < n_u && d < block; ++d, power += 8)
                    sum += *power * filter_lags_[at(c, group * block + d, padded)];
                column[n_u + part * lanes_ + lane] = sum;
            }
    }
}

/// Sums of the state of lane s with that of lane t.
void modal_filters::two_states(int s, int t) {
    using complex = std::complex<double>;
    const auto signal = [&](int lane) { // place among the signals of its real part
        int k = 0;
        for (int b = lane % blocks_; b > 0; --b) k += size(k);
        return n_u + lane / blocks_ * n_z + k;
    };
    const auto z_of = [&](int lane) {
        const double* its = filter_states_ + at(lane % blocks_, lane / blocks_, 2 * padded_);
        return complex(its[0], its[padded_]);
    };
    const auto w_of = [&](int lane) {
        const double* its = powers_ + okid_filters_power(area(lane % blocks_, 1), 1);
        return complex(its[0], its[4]);
    };
    const auto with_input = [&](int lane, int group) {
        if (group == n_u) return complex(0);
        const double* column = with_v_ + at(n_u, group, n_u + 2 * lanes_);
        return complex(column[lane], column[lanes_ + lane]);
    };
    const int a = s / blocks_, b = t / blocks_;
    const double first = a == n_u && b == n_u, inputs = a < n_u && b < n_u ? with_v_[at(a, b, n_u + 2 * lanes_)] : 0;
    const auto solve = [&](complex w, complex q, complex z) { // of the second state or of its conjugate
        const complex v = w_of(s);
        return over(times(v, with_input(s, b)) + times(w, q) + inputs + first - times(z_of(s), z), 1.0 - times(v, w));
    };
    const complex w = w_of(t), q = with_input(t, a), z = z_of(t);
    const complex h1 = solve(std::conj(w), std::conj(q), std::conj(z)), h2 = solve(w, q, z);
    const int i = signal(s), j = signal(t);
    const bool p = im_[(i - n_u) % n_z] > 0, r = im_[(j - n_u) % n_z] > 0;
    sums[at(i, j, base)] = (h1.real() + h2.real()) / 2;
    if (p) sums[at(i + 1, j, base)] = (h1.imag() + h2.imag()) / 2;
    if (r) sums[at(i, j + 1, base)] = (h2.imag() - h1.imag()) / 2;
    if (p && r) sums[at(i + 1, j + 1, base)] = (h1.real() - h2.real()) / 2;
}

bool modal_filters::run(const double* v, int count) {
    const int m = n_u + n_y;
    if (n_u == 0 && !all_finite(v, area(count, m))) return false;
    place_powers();
    const int wide = n_u + 2 * lanes_;
    okid_filters_t filters{area(n_u, 1),   area(m, 1),   area(blocks_, 1), area(blocks_, 1), powers_,
                           filter_states_, filter_sums_, filter_lags_,     filter_work_};
    const auto step = okid_recursion_pick().filters;
    for (int n = 0; n < count; n += stretch, v += at(0, stretch, m)) {
        double* z = filter_states_ + at(0, n_u, 2 * padded_);
        int last = 0; // w^t that has died out needs no product any more
        for (int k = 0; k < blocks_; ++k)
            if (std::hypot(z[k], z[padded_ + k]) < died_out)
                z[k] = z[padded_ + k] = 0;
            else
                last = k + 1;
        filters.lasting = area(last);
        step(&filters, v, area(std::min(stretch, count - n)));
        for (int k = 0; k < 2 * padded_ * (n_u + 1); ++k)
            if (std::abs(filter_states_[k]) < denormal) filter_states_[k] = 0;
    }
    sum_lanes();
    for (int c = 0; c < m; ++c) // what is no number stays none in the sums with the first input
        if (!std::isfinite(with_v_[at(0, c, wide)])) return false;
    const auto copy = [&](int from, int to) {
        for (int c = 0; c < n_u; ++c) sums[at(to, c, base)] = with_v_[at(from, c, wide)];
        for (int o = 0; o < n_y; ++o) with_y[at(to, o, base)] = with_v_[at(from, n_u + o, wide)];
    };
    for (int c = 0; c < n_u; ++c) copy(c, c);
    for (int c = 0, lane = 0; c <= n_u; ++c)
        for (int k = 0; k < n_z; k += this->size(k), ++lane) {
            copy(n_u + lane, n_u + c * n_z + k);
            if (pair(k)) copy(n_u + lanes_ + lane, n_u + c * n_z + k + 1);
        }
    for (int s = 0; s < blocks_ * (n_u + 1); ++s)
        for (int t = 0; t <= s; ++t) two_states(s, t);
    used = count;
    return true;
}

void modal_filters::complete_sums() {
    flush();
    for (int c = 0; c < base; ++c)
        for (int r = 0; r < c; ++r) sums[at(r, c, base)] = sums[at(c, r, base)];
}

void modal_filters::expand(const double* z, int ldz, double* out, int ldo) const {
    for (int l = 0; l < n_z; l += size(l))
        for (int k = 0; k < n_z; k += size(k)) {
            const bool p = pair(k), q = pair(l);
            const double z11 = z[at(k, l, ldz)], z12 = q ? z[at(k, l + 1, ldz)] : 0, z21 = p ? z[at(k + 1, l, ldz)] : 0,
                         z22 = p && q ? z[at(k + 1, l + 1, ldz)] : 0;
            const double s11 = shared_[at(k, l, n_z)], s12 = q ? shared_[at(k, l + 1, n_z)] : 0,
                         s21 = p ? shared_[at(k + 1, l, n_z)] : 0, s22 = p && q ? shared_[at(k + 1, l + 1, n_z)] : 0;
            out[at(k, l, ldo)] += s11 * z11 - s12 * z12 - s21 * z21 + s22 * z22;
            if (q) out[at(k, l + 1, ldo)] += s11 * z12 + s12 * z11 - s21 * z22 - s22 * z21;
            if (p) out[at(k + 1, l, ldo)] += s11 * z21 - s12 * z22 + s21 * z11 - s22 * z12;
            if (p && q) out[at(k + 1, l + 1, ldo)] += s11 * z22 + s12 * z21 + s21 * z12 + s22 * z11;
        }
}

void modal_filters::shape(int output, const double* z, double* out) const {
    const double* c = shapes_ + output;
    for (int k = 0; k < n_z; k += size(k)) {
        const double c1 = c[at(0, k, n_y)];
        out[k] += c1 * z[k];
        if (!pair(k)) continue;
        const double c2 = c[at(0, k + 1, n_y)];
        out[k] -= c2 * z[k + 1];
        out[k + 1] += c1 * z[k + 1] + c2 * z[k];
    }
}

} // namespace okid
