// SPDX-License-Identifier: MIT
// PURPOSE    continuous to discrete and back, for an input that is held or goes straight between samples
// METHOD     forward: one exponential of [A dt, B dt, 0; 0, 0, I; 0, 0, 0], whose first block row is [A_d, G1, G2];
//            back: pole by pole in the eigenvectors of A_d
// REFERENCE  paper eq. (12)-(14); block exponential: Van Loan (1978). The paper gives no way back (trap 19)
// NUMERICS   forward: about n_z eps in balanced states; back: cond(V) eps, C and A exact for the principal logarithm
// WORKSPACE  okid_mechanics_hold_memsize()
#include "exponential.hpp"
#include "linalg/arena.hpp"
#include "linalg/linalg.hpp"
#include "poles.hpp"

#include <algorithm>
#include <cmath>

using std::size_t;
using real = okid_real_t;
using complex = std::complex<double>;

namespace {

struct forward_work {
    real *a, *scale, *big, *result, *spare; // n_z x n_z, n_z, and three of (n_z + 2 n_u)^2
};

size_t lay_out(int n_u, int n_z, okid::arena& memory, forward_work& w) {
    const auto z = static_cast<size_t>(n_z), all = z + 2 * static_cast<size_t>(n_u);
    w.a = memory.take<real>(z * z);
    w.scale = memory.take<real>(z);
    w.big = memory.take<real>(all * all);
    w.result = memory.take<real>(all * all);
    w.spare = memory.take<real>(all * all);
    return memory.bytes();
}

struct backward_work {
    okid::poles poles;
    real *factored, *inverse, *combined; // V f(J) and V^-1, n_z x n_z; n_z x n_u
};

size_t lay_out(int n_u, int n_y, int n_z, okid::arena& memory, backward_work& w) {
    const auto z = static_cast<size_t>(n_z);
    w.poles.lay_out(n_u, n_y, n_z, memory);
    w.factored = memory.take<real>(z * z);
    w.inverse = memory.take<real>(z * z);
    w.combined = memory.take<real>(z * static_cast<size_t>(n_u));
    return memory.bytes();
}

bool wrong(const okid_model_t& m, double dt, int hold) {
    return m.n_u < 1 || m.n_y < 1 || m.n_z < 1 || !(dt > 0) || !std::isfinite(dt) ||
           (hold != OKID_HOLD_ZERO && hold != OKID_HOLD_FIRST);
}

bool missing(const okid_model_t& m, int hold, const real* A, const real* B, const real* D, const void* work) {
    return m.A == nullptr || m.B == nullptr || m.D == nullptr || (hold != OKID_HOLD_ZERO && m.C == nullptr) ||
           A == nullptr || B == nullptr || D == nullptr || work == nullptr;
}

/// w.big = [A dt, beta B dt, 0; 0, 0, I; 0, 0, 0] in balanced states (without the last block for the zero hold).
/// @return beta, a power of two that keeps the inputs from setting the norm
real fill_block(const okid_model_t& m, double dt, size_t all, forward_work& w) {
    const auto z = static_cast<size_t>(m.n_z), u = static_cast<size_t>(m.n_u);
    for (size_t i = 0; i < z * z; ++i) w.a[i] = static_cast<real>(m.A[i] * dt);
    okid::balance(m.n_z, w.a, w.scale);
    std::fill(w.big, w.big + all * all, real(0));
    for (size_t j = 0; j < z; ++j) std::copy(w.a + j * z, w.a + (j + 1) * z, w.big + j * all);
    real largest = 0;
    for (size_t c = 0; c < u; ++c) {
        real sum = 0;
        for (size_t i = 0; i < z; ++i) sum += std::abs(static_cast<real>(m.B[c * z + i] * dt) / w.scale[i]);
        largest = std::max(largest, sum);
    }
    const real beta = largest > 0 && std::isfinite(largest) ? std::exp2(-std::ceil(std::log2(largest))) : 1;
    for (size_t c = 0; c < u; ++c)
        for (size_t i = 0; i < z; ++i)
            w.big[(z + c) * all + i] = beta * static_cast<real>(m.B[c * z + i] * dt) / w.scale[i];
    for (size_t c = z + u; c < all; ++c) w.big[c * all + c - u] = 1;
    return beta;
}

/// out = V f(poles) X: the matrix function f of A_d applied to what has the modal coordinates X, in the model's states.
template <class Function>
void apply(okid::poles& p, const Function& f, const real* X, int cols, real* factored, real* out) {
    const auto z = static_cast<size_t>(p.n_z);
    for (int k = 0; k < p.n_z; ++k) {
        const complex value = f(p.mu(k));
        const auto a = static_cast<real>(value.real()), b = static_cast<real>(value.imag());
        const real* v = p.V + static_cast<size_t>(k) * z;
        real* to = factored + static_cast<size_t>(k) * z;
        if (!p.pair(k)) {
            for (size_t i = 0; i < z; ++i) to[i] = a * v[i];
            continue;
        }
        for (size_t i = 0; i < z; ++i) {
            to[i] = a * v[i] - b * v[z + i];
            to[z + i] = b * v[i] + a * v[z + i];
        }
        ++k;
    }
    okid::linalg::multiply(false, false, p.n_z, cols, p.n_z, 1, factored, p.n_z, X, p.n_z, 0, out, p.n_z);
    for (size_t c = 0; c < static_cast<size_t>(cols); ++c)
        for (size_t i = 0; i < z; ++i) out[c * z + i] *= p.scale[i];
}

} // namespace

size_t okid_mechanics_hold_memsize(int32_t n_u, int32_t n_y, int32_t n_z) {
    if (n_u < 1 || n_y < 1 || n_z < 1) return 0;
    okid::arena forward, backward;
    forward_work f{};
    backward_work b{};
    return std::max(lay_out(n_u, n_z, forward, f), lay_out(n_u, n_y, n_z, backward, b));
}

okid_status_t okid_mechanics_c2d(const okid_model_t* continuous, double dt, int32_t hold, okid_real_t* A,
                                 okid_real_t* B, okid_real_t* D, void* work, size_t bytes) {
    if (continuous == nullptr || missing(*continuous, hold, A, B, D, work)) return OKID_ERR_NULL;
    const okid_model_t& m = *continuous;
    if (wrong(m, dt, hold)) return OKID_ERR_DIM;
    if (bytes < okid_mechanics_hold_memsize(m.n_u, m.n_y, m.n_z)) return OKID_ERR_MEMORY;
    okid::linalg::warm_up();
    okid::arena memory(work);
    forward_work w{};
    lay_out(m.n_u, m.n_z, memory, w);
    const auto z = static_cast<size_t>(m.n_z), u = static_cast<size_t>(m.n_u), y = static_cast<size_t>(m.n_y);
    const size_t all = z + (hold == OKID_HOLD_FIRST ? 2 * u : u);
    const real beta = fill_block(m, dt, all, w);
    if (!okid::exponential(static_cast<int>(all), w.big, w.result, w.spare)) return OKID_ERR_NUMERIC;
    real* gains = w.result + z * all; // G1, then G2
    for (size_t j = 0; j < z; ++j)
        for (size_t i = 0; i < z; ++i) A[j * z + i] = w.result[j * all + i] * (w.scale[i] / w.scale[j]);
    for (size_t c = 0; c < all - z; ++c)
        for (size_t i = 0; i < z; ++i) gains[c * all + i] *= w.scale[i] / beta;
    for (size_t c = 0; c < u; ++c) std::copy(gains + c * all, gains + c * all + z, B + c * z);
    std::copy(m.D, m.D + y * u, D);
    if (hold == OKID_HOLD_ZERO) return OKID_OK;
    const real* second = gains + u * all;
    for (size_t c = 0; c < u; ++c)
        for (size_t i = 0; i < z; ++i) B[c * z + i] -= second[c * all + i];
    const int ld = static_cast<int>(all);
    okid::linalg::multiply(false, false, m.n_z, m.n_u, m.n_z, 1, A, m.n_z, second, ld, 1, B, m.n_z);
    okid::linalg::multiply(false, false, m.n_y, m.n_u, m.n_z, 1, m.C, m.n_y, second, ld, 1, D, m.n_y);
    return OKID_OK;
}

okid_status_t okid_mechanics_d2c(const okid_model_t* discrete, double dt, int32_t hold, okid_real_t* A, okid_real_t* B,
                                 okid_real_t* D, void* work, size_t bytes) {
    if (discrete == nullptr || missing(*discrete, hold, A, B, D, work)) return OKID_ERR_NULL;
    const okid_model_t& m = *discrete;
    if (wrong(m, dt, hold)) return OKID_ERR_DIM;
    if (bytes < okid_mechanics_hold_memsize(m.n_u, m.n_y, m.n_z)) return OKID_ERR_MEMORY;
    okid::linalg::warm_up();
    okid::arena memory(work);
    backward_work w{};
    lay_out(m.n_u, m.n_y, m.n_z, memory, w);
    okid::poles& p = w.poles;
    const okid_status_t found = p.find(m);
    if (found != OKID_OK) return found;
    const auto z = static_cast<size_t>(m.n_z), u = static_cast<size_t>(m.n_u), y = static_cast<size_t>(m.n_y);
    for (size_t k = 0; k < z; ++k)
        if (p.im[k] == 0 && !(p.re[k] > 0)) return OKID_ERR_MISMATCH;
    std::fill(w.factored, w.factored + z * z, real(0));
    for (size_t i = 0; i < z; ++i) w.factored[i * z + i] = 1 / p.scale[i];
    p.into(w.factored, m.n_z, w.inverse);
    apply(p, [&](complex mu) { return okid::logarithm(mu) / dt; }, w.inverse, m.n_z, w.factored, A);
    apply(
        p, [&](complex mu) { return okid::hold_inverse(okid::logarithm(mu), dt, hold); }, p.input, m.n_u, w.factored,
        B);
    std::copy(m.D, m.D + y * u, D);
    if (hold == OKID_HOLD_ZERO) return OKID_OK;
    apply(
        p, [&](complex mu) { return okid::hold_feed(okid::logarithm(mu), hold); }, p.input, m.n_u, w.factored,
        w.combined);
    okid::linalg::multiply(false, false, m.n_y, m.n_u, m.n_z, -1, m.C, m.n_y, w.combined, m.n_z, 1, D, m.n_y);
    return OKID_OK;
}
