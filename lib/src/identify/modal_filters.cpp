// SPDX-License-Identifier: MIT
// PURPOSE    filters in the modal coordinates of a given A, and the Gram matrix of their signals over a run of samples
// METHOD     phi(t+1) = w phi(t) + u(t) for every eigenvalue and input; 64 samples at a time into the sums
// REFERENCE  docs/numerics.md section 2, "B,D,z0 by output error"
// NUMERICS   needs independent eigenvectors; unstable eigenvalues grow until the numbers end (the caller looks)
// WORKSPACE  base^2 + (64 + n_y) base numbers; base^2 flop a sample, base = n_z n_u + n_z + n_u
#include "identify/modal_filters.hpp"

#include <cmath>

namespace okid {

using linalg::multiply;
using std::size_t;

namespace {

constexpr int batch = 64;
constexpr double died_out = 1e-14;

size_t area(int rows, int cols) { return static_cast<size_t>(rows) * static_cast<size_t>(cols); }

} // namespace

modal_filters::modal_filters(int inputs, int outputs, int states, arena& memory)
    : n_u(inputs), n_y(outputs), n_z(states), base(n_u + n_z * n_u + n_z), free(base - n_z), used(0) {
    modes = memory.take<double>(area(n_z, n_z));
    sums = memory.take<double>(area(base, base));
    with_y = memory.take<double>(area(base, n_y));
    a_ = memory.take<okid_real_t>(area(n_z, n_z));
    vectors_ = memory.take<okid_real_t>(area(n_z, n_z));
    re_ = memory.take<okid_real_t>(area(n_z, 1));
    im_ = memory.take<okid_real_t>(area(n_z, 1));
    eigen_ = memory.take<okid_real_t>(linalg::eigen_work(n_z));
    shapes_ = memory.take<double>(area(n_y, n_z));
    shared_ = memory.take<double>(area(n_z, n_z));
    state_ = memory.take<double>(area(base, 1));
    signals_ = memory.take<double>(area(base, batch));
    outputs_ = memory.take<double>(area(n_y, batch));
}

bool modal_filters::decompose(const okid_real_t* A, const okid_real_t* C) {
    std::copy(A, A + at(0, n_z, n_z), a_);
    if (linalg::eigen(n_z, a_, re_, im_, vectors_, eigen_) != 0) return false;
    std::copy(vectors_, vectors_ + at(0, n_z, n_z), modes);
    double* observe = with_y; // C in double: n_y n_z of its base n_y numbers
    std::copy(C, C + at(0, n_z, n_y), observe);
    multiply(false, false, n_y, n_z, n_z, 1, observe, n_y, modes, n_z, 0, shapes_, n_y);
    multiply(true, false, n_z, n_z, n_y, 1, shapes_, n_y, shapes_, n_y, 0, shared_, n_z);
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
