// SPDX-License-Identifier: MIT
// PURPOSE    a model beside another one, its poles and shapes moved to first order
// METHOD     with A v_k = w_k v_k and E = V^-1 dA V: dw_k = E_kk, dv_k = sum over j of v_j E_jk / (w_k - w_j), j other than k.
//            A pair stands as x + i y, so that a real 2 x 2 block is s -> alpha s + beta conj(s): alpha = E_jk, beta = the
//            entry of the conjugate of k
// REFERENCE  Stewart, Sun, Matrix Perturbation Theory (1990) ch. V; docs/numerics.md, uncertainty
// NUMERICS   the inverse of V by normal equations, corrected twice: for conditions to 1e7
// WORKSPACE  8 n^2 numbers; 6 n^3 flop a model
#include "identify/first_order.hpp"

#include <cmath>

namespace okid {

using linalg::multiply;
using complex = std::complex<double>;

void first_order::lay_out(int inputs, int outputs, int largest, arena& memory) {
    n_u = inputs;
    n_y = outputs;
    const int wide = std::max({largest, n_u, n_y});
    for (double** each : {&basis, &inverse, &A, &turn}) *each = memory.take<double>(area(largest, largest));
    for (double** each : {&room, &spare}) *each = memory.take<double>(area(wide, wide));
    B = memory.take<double>(area(largest, n_u));
    C = memory.take<double>(area(n_y, largest));
    for (okid_real_t** each : {&a, &vectors, &out_A}) *each = memory.take<okid_real_t>(area(largest, largest));
    for (okid_real_t** each : {&re, &im}) *each = memory.take<okid_real_t>(area(largest));
    eigen = memory.take<okid_real_t>(linalg::eigen_work(largest));
    out_B = memory.take<okid_real_t>(area(largest, n_u));
    out_C = memory.take<okid_real_t>(area(n_y, largest));
    ready = false;
}

/// inverse <- basis^-1; `turn` and `room` are used up.
bool first_order::invert() const {
    double *normal = turn, *miss = room, *step = spare;
    multiply(true, false, n, n, n, 1, basis, n, basis, n, 0, normal, n);
    if (linalg::cholesky(n, normal, n) != 0) return false;
    std::fill(inverse, inverse + area(n, n), 0.0);
    double largest = 1;
    for (int pass = 0; pass < 3; ++pass) {
        std::fill(miss, miss + area(n, n), 0.0);
        for (int k = 0; k < n; ++k) miss[at(k, k, n)] = 1;
        multiply(false, false, n, n, n, -1, basis, n, inverse, n, 1, miss, n);
        multiply(true, false, n, n, n, 1, basis, n, miss, n, 0, step, n);
        linalg::cholesky_solve(n, normal, n, step, n, n);
        largest = 0;
        for (std::size_t k = 0; k < area(n, n); ++k) {
            inverse[k] += step[k];
            largest = std::max(largest, std::abs(miss[k]));
        }
    }
    return largest < 1e-6;
}

void first_order::begin(const okid_model_t& model) {
    ready = false;
    n = model.n_z;
    std::copy(model.A, model.A + area(n, n), a);
    std::copy(model.A, model.A + area(n, n), A);
    if (!std::all_of(A, A + area(n, n), [](double x) { return std::isfinite(x); })) return;
    if (linalg::eigen(n, a, re, im, vectors, eigen) != 0) return;
    for (int k = 0; k < n; k += size(k)) {
        for (int r = 0; r < n; ++r) basis[at(r, k, n)] = double(vectors[at(r, k, n)]);
        for (int r = 0; pair(k) && r < n; ++r) basis[at(r, k + 1, n)] = -double(vectors[at(r, k + 1, n)]);
    }
    if (!invert()) return;
    if (n_u > 0) {
        std::copy(model.B, model.B + area(n, n_u), room);
        multiply(false, false, n, n_u, n, 1, inverse, n, room, n, 0, B, n);
    }
    std::copy(model.C, model.C + area(n_y, n), room);
    multiply(false, false, n_y, n, n, 1, room, n_y, basis, n, 0, C, n_y);
    ready = true;
}

/// The block of modes j and k of `turn`, out of that of E in `room`.
void first_order::turn_vectors(int j, int k) const {
    const bool p = pair(j), q = pair(k);
    const double* z = room + at(j, k, n);
    double* out = turn + at(j, k, n);
    const double z12 = q ? z[n] : 0, z21 = p ? z[1] : 0, z22 = p && q ? z[n + 1] : 0;
    if (!q) {
        const complex one = j == k ? 0.0 : complex(z[0], z21) / (pole(k) - pole(j));
        out[0] = one.real();
        if (p) out[1] = one.imag();
        return;
    }
    if (!p) {
        const complex one = complex(z[0], -z12) / (pole(k) - pole(j));
        out[0] = one.real();
        out[n] = -one.imag();
        return;
    }
    const complex alpha = j == k ? 0.0 : complex(z[0] + z22, z21 - z12) / 2.0 / (pole(k) - pole(j));
    const complex beta = complex(z[0] - z22, z21 + z12) / 2.0 / (std::conj(pole(k)) - pole(j));
    out[0] = alpha.real() + beta.real();
    out[n + 1] = alpha.real() - beta.real();
    out[1] = alpha.imag() + beta.imag();
    out[n] = beta.imag() - alpha.imag();
}

okid_model_t first_order::of(const okid_model_t& other) const {
    if (!ready || other.n_z != n) return other;
    for (std::size_t i = 0; i < area(n, n); ++i) spare[i] = double(other.A[i]) - A[i];
    multiply(false, false, n, n, n, 1, inverse, n, spare, n, 0, turn, n);
    multiply(false, false, n, n, n, 1, turn, n, basis, n, 0, room, n);
    std::fill(out_A, out_A + area(n, n), okid_real_t{0});
    for (int k = 0; k < n; k += size(k)) {
        const double* z = room + at(k, k, n);
        const complex w = pole(k) + (pair(k) ? complex(z[0] + z[n + 1], z[1] - z[n]) / 2.0 : complex(z[0]));
        okid_real_t* out = out_A + at(k, k, n);
        out[0] = static_cast<okid_real_t>(w.real());
        if (pair(k)) {
            out[n + 1] = out[0];
            out[1] = static_cast<okid_real_t>(w.imag());
            out[n] = -out[1];
        }
        for (int j = 0; j < n; j += size(j)) turn_vectors(j, k);
    }
    std::copy(other.C, other.C + area(n_y, n), room);
    multiply(false, false, n_y, n, n, 1, room, n_y, basis, n, 0, spare, n_y);
    multiply(false, false, n_y, n, n, 1, C, n_y, turn, n, 1, spare, n_y);
    for (std::size_t i = 0; i < area(n_y, n); ++i) out_C[i] = static_cast<okid_real_t>(spare[i]);
    if (n_u > 0) {
        std::copy(other.B, other.B + area(n, n_u), room);
        multiply(false, false, n, n_u, n, 1, inverse, n, room, n, 0, spare, n);
        multiply(false, false, n, n_u, n, -1, turn, n, B, n, 1, spare, n);
        for (std::size_t i = 0; i < area(n, n_u); ++i) out_B[i] = static_cast<okid_real_t>(spare[i]);
    }
    return {n_u, n_y, n, out_A, n_u > 0 ? out_B : other.B, out_C, other.D, nullptr};
}

} // namespace okid
