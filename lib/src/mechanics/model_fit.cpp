// SPDX-License-Identifier: MIT
// PURPOSE    what a model leaves of a measured record, simulated and predicted in one pass; the initial state that leaves least
// METHOD     [D 0 C; B 0 A] and [D 0 C; B - K D, K, A - K C] as one matrix each: recursion.c. x0 from the normal equations of
//            y - y_forced = C A^n x0, a block of samples at a time: [C; C A; ..] of a block, and A^L from block to block
// REFERENCE  paper eq. (13), (15), (16), (20) with L = -K
// NUMERICS   double, whatever the numbers of the model are. The normal equations of x0 are scaled to unit diagonal with a
//            ridge of 1e-12: poles that died out early carry little and are left near zero instead of blowing up
// WORKSPACE  okid_model_fit_memsize(): two matrices of (n_y + n_z) x (n_u + n_y + n_z), padded; for x0 one of them and
//            L n_y n_z numbers more
#include "model_fit.hpp"

#include "recursion.h"

#include "identify/triangular.hpp"
#include "linalg/arena.hpp"

#include <algorithm>
#include <cmath>

using std::size_t;

namespace {

bool sized(const okid_model_t& m) { return m.n_u >= 0 && m.n_y >= 1 && m.n_z >= 1; }

struct fit_memory {
    okid_follow_t follow{};
    double *simulator, *predictor;

    fit_memory(const okid_model_t& m, bool predicts, okid::arena& memory) {
        follow.n_u = static_cast<size_t>(m.n_u);
        follow.n_y = static_cast<size_t>(m.n_y);
        follow.n_z = static_cast<size_t>(m.n_z);
        follow.ld = okid_recursion_padded(follow.n_y + follow.n_z);
        const size_t matrix = follow.ld * (follow.n_u + follow.n_y + follow.n_z);
        follow.simulator = simulator = memory.take<double>(matrix);
        predictor = memory.take<double>(predicts ? matrix : 0);
        follow.simulated = memory.take<double>(2 * follow.ld);
        follow.predicted = memory.take<double>(2 * follow.ld);
    }

    /// The matrices, and states of zero.
    void fill(const okid_model_t& m, bool predicts) {
        for (double* state : {follow.simulated, follow.predicted}) std::fill(state, state + 2 * follow.ld, 0.0);
        const size_t n_u = follow.n_u, n_y = follow.n_y, n_z = follow.n_z, ld = follow.ld, states = n_u + n_y;
        std::fill(simulator, simulator + ld * (states + n_z), 0.0);
        for (size_t c = 0; c < n_u; ++c) {
            std::copy(m.D + c * n_y, m.D + (c + 1) * n_y, simulator + c * ld);
            std::copy(m.B + c * n_z, m.B + (c + 1) * n_z, simulator + c * ld + n_y);
        }
        for (size_t c = 0; c < n_z; ++c) {
            std::copy(m.C + c * n_y, m.C + (c + 1) * n_y, simulator + (states + c) * ld);
            std::copy(m.A + c * n_z, m.A + (c + 1) * n_z, simulator + (states + c) * ld + n_y);
        }
        if (m.K == nullptr || !predicts) return;
        std::copy(simulator, simulator + ld * (states + n_z), predictor);
        for (size_t c = 0; c < states + n_z; ++c)
            for (size_t o = 0; o < n_y; ++o) {
                const double seen = c >= n_u && c < states ? -1.0 * (c - n_u == o) : simulator[c * ld + o];
                for (size_t k = 0; k < n_z; ++k)
                    predictor[c * ld + n_y + k] -= static_cast<double>(m.K[o * n_z + k]) * seen;
            }
        follow.predictor = predictor;
    }
};

constexpr double ridge = 1e-12, faded = 1e-9;

using okid::at;
using okid::linalg::multiply;

/// Normal equations of the initial state, a block of samples at a time.
struct first_state {
    int n_u, n_y, n_z, length; ///< samples of a block
    fit_memory fit;
    double *rows, *sums;                            ///< of a block, [u; y]
    double *observe, *square;                       ///< C A^k, n_y length x n_z; its Gram matrix
    double *step, *power, *seen, *spare;            ///< A^length; A to the block in hand; products
    double *normal, *right, *errors, *part, *scale; ///< normal right = ...; what the forced response leaves of a block

    first_state(const okid_model_t& m, okid::arena& memory)
        : n_u(m.n_u), n_y(m.n_y), n_z(m.n_z), length(m.n_z <= 12 ? 128 : 32), fit(m, false, memory) {
        const auto z = static_cast<size_t>(n_z), y = static_cast<size_t>(n_y), block = static_cast<size_t>(length);
        rows = memory.take<double>(block * static_cast<size_t>(n_u + n_y));
        sums = memory.take<double>(5 * y);
        observe = memory.take<double>(block * y * z);
        square = memory.take<double>(z * z);
        step = memory.take<double>(z * z);
        power = memory.take<double>(z * z);
        spare = memory.take<double>(z * z);
        normal = memory.take<double>(z * z);
        seen = memory.take<double>(std::max(y, z) * z);
        right = memory.take<double>(z);
        part = memory.take<double>(z);
        scale = memory.take<double>(z);
        errors = memory.take<double>(block * y);
    }

    void begin(const okid_model_t& m) {
        fit.fill(m, false);
        fit.follow.sums = sums;
        fit.follow.errors = errors;
        std::fill(sums, sums + 5 * n_y, 0.0);
        std::fill(normal, normal + n_z * n_z, 0.0);
        std::fill(right, right + n_z, 0.0);
        std::copy(m.A, m.A + n_z * n_z, spare); // in double
        const int ld = n_y * length;
        for (int c = 0; c < n_z; ++c) std::copy(m.C + at(0, c, n_y), m.C + at(0, c + 1, n_y), observe + at(0, c, ld));
        for (int k = 1; k < length; ++k)
            multiply(false, false, n_y, n_z, n_z, 1, observe + (k - 1) * n_y, ld, spare, n_z, 0, observe + k * n_y, ld);
        multiply(true, false, n_z, n_z, ld, 1, observe, ld, observe, ld, 0, square, n_z);
        std::copy(spare, spare + n_z * n_z, step);
        for (int k = 1; k < length; k *= 2) { // a power of two
            multiply(false, false, n_z, n_z, n_z, 1, step, n_z, step, n_z, 0, power, n_z);
            std::swap(step, power);
        }
        std::fill(power, power + n_z * n_z, 0.0);
        for (int k = 0; k < n_z; ++k) power[at(k, k, n_z)] = 1;
    }

    /// The largest number of C A^n at the sample n of the block.
    double size(int n) {
        multiply(false, false, n_y, n_z, n_z, 1, observe + n * n_y, n_y * length, power, n_z, 0, seen, n_y);
        double most = 0;
        for (int i = 0; i < n_y * n_z; ++i) most = std::max(most, std::abs(seen[i]));
        return most;
    }

    /// Samples of the block with all outputs, one by one.
    void add_known(int count) {
        for (int n = 0; n < count; ++n) {
            const double* left = errors + n * n_y;
            if (!std::all_of(left, left + n_y, [](double x) { return std::isfinite(x); })) continue;
            (void)size(n); // C A^n
            multiply(true, false, n_z, n_z, n_y, 1, seen, n_y, seen, n_y, 1, normal, n_z);
            multiply(true, false, n_z, 1, n_y, 1, seen, n_y, left, n_y, 1, right, n_z);
        }
    }

    /// The rows of a block. @return false: the rest of the record no longer sees the initial state
    bool add(int count, double first) {
        fit.follow.errors = errors;
        okid_recursion_pick().follow(&fit.follow, rows, static_cast<size_t>(count));
        if (count < length || !std::all_of(errors, errors + count * n_y, [](double x) { return std::isfinite(x); })) {
            add_known(count);
        } else {
            multiply(false, false, n_z, n_z, n_z, 1, square, n_z, power, n_z, 0, seen, n_z);
            multiply(true, false, n_z, n_z, n_z, 1, power, n_z, seen, n_z, 1, normal, n_z);
            multiply(true, false, n_z, 1, n_y * length, 1, observe, n_y * length, errors, n_y * length, 0, part, n_z);
            multiply(true, false, n_z, 1, n_z, 1, power, n_z, part, n_z, 1, right, n_z);
        }
        multiply(false, false, n_z, n_z, n_z, 1, step, n_z, power, n_z, 0, spare, n_z);
        std::swap(power, spare);
        const double now = size(0);
        return now > faded * first && std::isfinite(now);
    }

    bool solve() {
        for (int i = 0; i < n_z; ++i) scale[i] = normal[at(i, i, n_z)] > 0 ? 1 / std::sqrt(normal[at(i, i, n_z)]) : 0;
        for (int j = 0; j < n_z; ++j) {
            for (int i = 0; i < n_z; ++i) normal[at(i, j, n_z)] *= scale[i] * scale[j];
            normal[at(j, j, n_z)] = scale[j] > 0 ? 1 + ridge : 1;
            right[j] *= scale[j];
        }
        if (okid::linalg::cholesky(n_z, normal, n_z) != 0) return false;
        okid::linalg::cholesky_solve(n_z, normal, n_z, right, n_z, 1);
        for (int i = 0; i < n_z; ++i) right[i] *= scale[i];
        return std::all_of(right, right + n_z, [](double x) { return std::isfinite(x); });
    }
};

} // namespace

size_t okid_model_fit_memsize(const okid_model_t* model) {
    if (model == nullptr || !sized(*model)) return 0;
    okid::arena memory;
    const fit_memory unused(*model, true, memory);
    return memory.bytes();
}

okid_status_t okid_model_fit(const okid_model_t* model, const double* rows, size_t count, const okid_real_t* x0,
                             double* sums, void* work, size_t bytes) {
    if (model == nullptr || rows == nullptr || sums == nullptr || work == nullptr) return OKID_ERR_NULL;
    if (!sized(*model)) return OKID_ERR_DIM;
    if (bytes < okid_model_fit_memsize(model)) return OKID_ERR_MEMORY;
    okid::arena memory(work);
    fit_memory fit(*model, true, memory);
    fit.fill(*model, true);
    okid_follow_t& follow = fit.follow;
    for (double* state : {follow.simulated, follow.predicted})
        if (x0 != nullptr) std::copy(x0, x0 + follow.n_z, state + follow.n_y);
    follow.sums = sums;
    okid_recursion_pick().follow(&follow, rows, count);
    return OKID_OK;
}

size_t okid::initial_state_numbers(const okid_model_t& model) {
    okid::arena memory;
    const first_state unused(model, memory);
    return memory.bytes() / sizeof(okid_real_t); // whole lines of memory
}

okid_status_t okid_model_initial_state(const okid_model_t* model, const okid_real_t* u, const okid_real_t* y,
                                       size_t count, okid_real_t* x0, okid_real_t* work) {
    if (model == nullptr || u == nullptr || y == nullptr || x0 == nullptr || work == nullptr) return OKID_ERR_NULL;
    if (!sized(*model)) return OKID_ERR_DIM;
    okid::arena memory(work);
    first_state s(*model, memory);
    s.begin(*model);
    const double first = s.size(1);
    for (size_t n = 0; n < count;) {
        const size_t more = std::min(count - n, static_cast<size_t>(s.length));
        double* row = s.rows;
        for (size_t k = 0; k < more; ++k, ++n) {
            for (int c = 0; c < s.n_u; ++c, ++u) *row++ = std::isfinite(*u) ? static_cast<double>(*u) : 0;
            for (int o = 0; o < s.n_y; ++o) *row++ = static_cast<double>(*y++);
        }
        if (!s.add(static_cast<int>(more), first)) break;
    }
    if (!s.solve()) return OKID_ERR_NUMERIC;
    for (int i = 0; i < s.n_z; ++i) x0[i] = static_cast<okid_real_t>(s.right[i]);
    return OKID_OK;
}
