// SPDX-License-Identifier: MIT
// PURPOSE    state-space model and modes of mass, damping and stiffness
// METHOD     Cholesky of M; eigenvectors of the balanced continuous state matrix
// REFERENCE  paper eq. (1)-(9); (2): u is n_u x 1
// NUMERICS   M^-1 K to cond(M) eps. A rigid-body pair is a defective double zero, which rounding moves to sqrt(eps) of the
//            fastest pole: what lies below 16 of that is no mode
// WORKSPACE  okid_mechanics_memsize(): 12 n_x^2 numbers and the eigensolver's
#include <okid/mechanics.h>

#include "exponential.hpp"
#include "linalg/arena.hpp"
#include "linalg/linalg.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

using std::size_t;
using real = okid_real_t;

namespace {

constexpr double pi = 3.14159265358979323846;

struct mechanics_work {
    real *factor, *solved;                       // n_x x n_x; M^-1 [K R B_a], n_x x (2 n_x + n_u)
    real *a, *vectors, *scale, *re, *im, *eigen; // modes
    int* order;
};

size_t lay_out(int n_x, int n_u, okid::arena& memory, mechanics_work& w) {
    const auto x = static_cast<size_t>(n_x), z = 2 * x;
    w.factor = memory.take<real>(x * x);
    w.solved = memory.take<real>(x * (z + static_cast<size_t>(n_u)));
    w.a = memory.take<real>(z * z);
    w.vectors = memory.take<real>(z * z);
    w.scale = memory.take<real>(z);
    w.re = memory.take<real>(z);
    w.im = memory.take<real>(z);
    w.eigen = memory.take<real>(okid::linalg::eigen_work(2 * n_x));
    w.order = memory.take<int>(z);
    return memory.bytes();
}

/// w.solved = M^-1 [K R B_a]; R and B_a may be NULL (zero, left out). @return false: M is not positive definite
bool solve_mass(int n_x, const real* M, const real* K, const real* R, const real* B_a, int n_u, mechanics_work& w) {
    const size_t square = static_cast<size_t>(n_x) * static_cast<size_t>(n_x);
    std::copy(M, M + square, w.factor);
    if (okid::linalg::cholesky(n_x, w.factor, n_x) != 0) return false;
    std::copy(K, K + square, w.solved);
    if (R != nullptr)
        std::copy(R, R + square, w.solved + square);
    else
        std::fill(w.solved + square, w.solved + 2 * square, real(0));
    if (B_a != nullptr)
        std::copy(B_a, B_a + static_cast<size_t>(n_x) * static_cast<size_t>(n_u), w.solved + 2 * square);
    okid::linalg::cholesky_solve(n_x, w.factor, n_x, w.solved, n_x, 2 * n_x + (B_a != nullptr ? n_u : 0));
    return true;
}

/// A = [0 I; -M^-1 K, -M^-1 R]
void state_matrix(size_t x, const real* solved, real* A) {
    const size_t z = 2 * x;
    std::fill(A, A + z * z, real(0));
    for (size_t j = 0; j < z; ++j)
        for (size_t i = 0; i < x; ++i) A[j * z + x + i] = -solved[j * x + i];
    for (size_t j = 0; j < x; ++j) A[(x + j) * z + j] = 1;
}

/// C(:, block) += map, one of C_p, C_v; NULL adds nothing.
void add_map(size_t count, const real* map, real* C) {
    if (map != nullptr)
        for (size_t i = 0; i < count; ++i) C[i] += map[i];
}

/// Column `shape` turned and scaled so that its largest entry is 1.
void normalise(size_t n, real* re, real* im) {
    size_t best = 0;
    for (size_t i = 1; i < n; ++i)
        if (std::hypot(re[i], im[i]) > std::hypot(re[best], im[best])) best = i;
    const real a = re[best], b = im[best], square = a * a + b * b;
    for (size_t i = 0; i < n; ++i) {
        const real x = (re[i] * a + im[i] * b) / square, y = (im[i] * a - re[i] * b) / square;
        re[i] = x;
        im[i] = y;
    }
}

/// Underdamped poles into w.order, ascending in size. @return how many
int list_modes(int n_z, mechanics_work& w) {
    real fastest = 0;
    for (int k = 0; k < n_z; ++k) fastest = std::max(fastest, std::hypot(w.re[k], w.im[k]));
    const real slowest = 16 * std::sqrt(std::numeric_limits<real>::epsilon()) * fastest;
    int found = 0;
    for (int k = 0; k < n_z; ++k) {
        const real size = std::hypot(w.re[k], w.im[k]);
        if (!(w.im[k] > 0 && size > slowest)) continue;
        int at = found++;
        for (; at > 0 && std::hypot(w.re[w.order[at - 1]], w.im[w.order[at - 1]]) > size; --at)
            w.order[at] = w.order[at - 1];
        w.order[at] = k;
    }
    return found;
}

} // namespace

okid_status_t okid_mechanics_inputs(int32_t n_x, int32_t n_u, const int32_t* dof, const okid_real_t* gain,
                                    okid_real_t* B_a) {
    if (dof == nullptr || B_a == nullptr) return OKID_ERR_NULL;
    if (n_x < 1 || n_u < 1) return OKID_ERR_DIM;
    for (int32_t j = 0; j < n_u; ++j)
        if (dof[j] < 0 || dof[j] >= n_x) return OKID_ERR_DIM;
    const auto x = static_cast<size_t>(n_x), u = static_cast<size_t>(n_u);
    std::fill(B_a, B_a + x * u, real(0));
    for (size_t j = 0; j < u; ++j) B_a[j * x + static_cast<size_t>(dof[j])] = gain != nullptr ? gain[j] : 1;
    return OKID_OK;
}

okid_status_t okid_mechanics_outputs(int32_t n_x, int32_t n_y, const int32_t* dof, const okid_real_t* gain,
                                     const int32_t* sensing, okid_real_t* C_p, okid_real_t* C_v, okid_real_t* C_a) {
    if (dof == nullptr || sensing == nullptr || C_p == nullptr || C_v == nullptr || C_a == nullptr)
        return OKID_ERR_NULL;
    if (n_x < 1 || n_y < 1) return OKID_ERR_DIM;
    for (int32_t o = 0; o < n_y; ++o)
        if (dof[o] < 0 || dof[o] >= n_x || sensing[o] < OKID_SENSE_DISPLACEMENT || sensing[o] > OKID_SENSE_ACCELERATION)
            return OKID_ERR_DIM;
    const auto x = static_cast<size_t>(n_x), y = static_cast<size_t>(n_y);
    real* const maps[] = {C_p, C_v, C_a};
    for (real* map : maps) std::fill(map, map + x * y, real(0));
    for (size_t o = 0; o < y; ++o)
        maps[sensing[o]][static_cast<size_t>(dof[o]) * y + o] = gain != nullptr ? gain[o] : 1;
    return OKID_OK;
}

size_t okid_mechanics_memsize(int32_t n_x, int32_t n_u) {
    if (n_x < 1 || n_u < 1) return 0;
    okid::arena memory;
    mechanics_work w{};
    return lay_out(n_x, n_u, memory, w);
}

okid_status_t okid_mechanics_continuous(const okid_mechanics_t* self, okid_real_t* A, okid_real_t* B, okid_real_t* C,
                                        okid_real_t* D, void* work, size_t bytes) {
    if (self == nullptr || self->M == nullptr || self->R == nullptr || self->K == nullptr || self->B_a == nullptr ||
        A == nullptr || B == nullptr || C == nullptr || D == nullptr || work == nullptr)
        return OKID_ERR_NULL;
    const okid_mechanics_t& s = *self;
    if (s.n_x < 1 || s.n_u < 1 || s.n_y < 1) return OKID_ERR_DIM;
    if (bytes < okid_mechanics_memsize(s.n_x, s.n_u)) return OKID_ERR_MEMORY;
    okid::linalg::warm_up();
    okid::arena memory(work);
    mechanics_work w{};
    lay_out(s.n_x, s.n_u, memory, w);
    if (!solve_mass(s.n_x, s.M, s.K, s.R, s.B_a, s.n_u, w)) return OKID_ERR_NUMERIC;
    const auto x = static_cast<size_t>(s.n_x), z = 2 * x, u = static_cast<size_t>(s.n_u),
               y = static_cast<size_t>(s.n_y);
    const real* minv_b = w.solved + z * x;
    state_matrix(x, w.solved, A);
    for (size_t j = 0; j < u; ++j)
        for (size_t i = 0; i < x; ++i) {
            B[j * z + i] = 0;
            B[j * z + x + i] = minv_b[j * x + i];
        }
    std::fill(C, C + y * z, real(0));
    std::fill(D, D + y * u, real(0));
    if (s.C_a != nullptr) {
        okid::linalg::multiply(false, false, s.n_y, 2 * s.n_x, s.n_x, -1, s.C_a, s.n_y, w.solved, s.n_x, 0, C, s.n_y);
        okid::linalg::multiply(false, false, s.n_y, s.n_u, s.n_x, 1, s.C_a, s.n_y, minv_b, s.n_x, 0, D, s.n_y);
    }
    add_map(y * x, s.C_p, C);
    add_map(y * x, s.C_v, C + y * x);
    return OKID_OK;
}

okid_status_t okid_mechanics_modes(const okid_mechanics_t* self, okid_modes_t* modes, void* work, size_t bytes) {
    if (self == nullptr || self->M == nullptr || self->K == nullptr || modes == nullptr ||
        modes->frequency_hz == nullptr || modes->damping_ratio == nullptr ||
        (modes->shape_re == nullptr) != (modes->shape_im == nullptr) || work == nullptr)
        return OKID_ERR_NULL;
    const int n_x = self->n_x;
    if (n_x < 1) return OKID_ERR_DIM;
    if (bytes < okid_mechanics_memsize(n_x, 1)) return OKID_ERR_MEMORY;
    okid::linalg::warm_up();
    okid::arena memory(work);
    mechanics_work w{};
    lay_out(n_x, 1, memory, w);
    if (!solve_mass(n_x, self->M, self->K, self->R, nullptr, 0, w)) return OKID_ERR_NUMERIC;
    const auto x = static_cast<size_t>(n_x), z = 2 * x;
    state_matrix(x, w.solved, w.a);
    okid::balance(2 * n_x, w.a, w.scale);
    if (okid::linalg::eigen(2 * n_x, w.a, w.re, w.im, w.vectors, w.eigen) != 0) return OKID_ERR_NUMERIC;
    modes->count = list_modes(2 * n_x, w);
    for (size_t m = 0; m < static_cast<size_t>(modes->count); ++m) {
        const auto k = static_cast<size_t>(w.order[m]);
        const real size = std::hypot(w.re[k], w.im[k]);
        modes->frequency_hz[m] = size / static_cast<real>(2 * pi);
        modes->damping_ratio[m] = -w.re[k] / size;
        if (modes->shape_re == nullptr) continue;
        real *re = modes->shape_re + m * x, *im = modes->shape_im + m * x;
        for (size_t i = 0; i < x; ++i) {
            re[i] = w.scale[i] * w.vectors[k * z + i];
            im[i] = w.scale[i] * w.vectors[(k + 1) * z + i];
        }
        normalise(x, re, im);
    }
    return OKID_OK;
}
