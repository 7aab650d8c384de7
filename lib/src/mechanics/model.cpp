// SPDX-License-Identifier: MIT
// PURPOSE    simulate and predict with a discrete state-space model; least-squares initial state
// METHOD     plain recursions; x0 from the normal equations of y - y_forced = C A^n x0 over the record
// REFERENCE  paper eq. (13), (15), (16), (20) with L = -K
// NUMERICS   the normal equations of x0 are scaled to unit diagonal with a ridge of 1e-12 (1e-6 in float):
//            poles that died out early carry little and are left near zero instead of blowing up
// WORKSPACE  okid_model_workspace() numbers
#include <okid/model.h>

#include "linalg/linalg.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

using std::size_t;

namespace {

/// On the unit diagonal of the normal equations of x0; in float what their rounding needs to stay positive definite.
constexpr okid_real_t ridge =
    std::max(static_cast<okid_real_t>(1e-12), 8 * std::numeric_limits<okid_real_t>::epsilon());
constexpr auto faded = static_cast<okid_real_t>(1e-9);

bool sized(const okid_model_t& m) { return m.n_u >= 0 && m.n_y >= 1 && m.n_z >= 1; }

/// y = M x + y, M rows x cols column-major.
void add_product(int rows, int cols, const okid_real_t* M, const okid_real_t* x, okid_real_t* y) {
    for (int j = 0; j < cols; ++j) {
        const okid_real_t v = x[j];
        const okid_real_t* column = M + static_cast<size_t>(j) * static_cast<size_t>(rows);
        for (int i = 0; i < rows; ++i) y[i] += column[i] * v;
    }
}

struct stepper {
    const okid_model_t& model;
    okid_real_t *x, *next;
    size_t z() const { return static_cast<size_t>(model.n_z); }

    stepper(const okid_model_t& m, const okid_real_t* x0, okid_real_t* work) : model(m), x(work), next(work + m.n_z) {
        if (x0 != nullptr)
            std::copy(x0, x0 + z(), x);
        else
            std::fill(x, x + z(), okid_real_t{0});
    }
    void output(const okid_real_t* u, okid_real_t* y) const {
        std::fill(y, y + model.n_y, okid_real_t{0});
        add_product(model.n_y, model.n_z, model.C, x, y);
        add_product(model.n_y, model.n_u, model.D, u, y);
    }
    void step(const okid_real_t* u, const okid_real_t* correction) {
        std::fill(next, next + z(), okid_real_t{0});
        add_product(model.n_z, model.n_z, model.A, x, next);
        add_product(model.n_z, model.n_u, model.B, u, next);
        if (correction != nullptr) add_product(model.n_z, model.n_y, model.K, correction, next);
        std::swap(x, next);
    }
};

bool finite(const okid_real_t* v, int count) {
    return std::all_of(v, v + count, [](okid_real_t x) { return std::isfinite(x); });
}

/// A sample with a missing input counts as no force.
const okid_real_t* usable_input(const okid_real_t* u, int count, okid_real_t* spare) {
    if (finite(u, count)) return u;
    std::transform(u, u + count, spare, [](okid_real_t x) { return std::isfinite(x) ? x : okid_real_t{0}; });
    return spare;
}

} // namespace

size_t okid_model_workspace(const okid_model_t* model) {
    const auto z = static_cast<size_t>(model->n_z), y = static_cast<size_t>(model->n_y),
               u = static_cast<size_t>(model->n_u);
    return 2 * z + u + 2 * y + 2 * y * z + z * z + z;
}

okid_status_t okid_model_simulate(const okid_model_t* model, const okid_real_t* u, size_t count, const okid_real_t* x0,
                                  okid_real_t* y, okid_real_t* work) {
    if (model == nullptr || u == nullptr || y == nullptr || work == nullptr) return OKID_ERR_NULL;
    if (!sized(*model)) return OKID_ERR_DIM;
    stepper s(*model, x0, work);
    okid_real_t* spare = work + 2 * model->n_z;
    for (size_t n = 0; n < count; ++n) {
        const okid_real_t* input = usable_input(u + n * static_cast<size_t>(model->n_u), model->n_u, spare);
        s.output(input, y + n * static_cast<size_t>(model->n_y));
        s.step(input, nullptr);
    }
    return OKID_OK;
}

okid_status_t okid_model_predict(const okid_model_t* model, const okid_real_t* u, const okid_real_t* y, size_t count,
                                 const okid_real_t* x0, okid_real_t* yhat, okid_real_t* work) {
    if (model == nullptr || model->K == nullptr || u == nullptr || y == nullptr || yhat == nullptr || work == nullptr)
        return OKID_ERR_NULL;
    if (!sized(*model)) return OKID_ERR_DIM;
    stepper s(*model, x0, work);
    okid_real_t *spare = work + 2 * model->n_z, *innovation = spare + model->n_u;
    const auto ny = static_cast<size_t>(model->n_y);
    for (size_t n = 0; n < count; ++n) {
        const okid_real_t* input = usable_input(u + n * static_cast<size_t>(model->n_u), model->n_u, spare);
        okid_real_t* out = yhat + n * ny;
        s.output(input, out);
        const okid_real_t* measured = y + n * ny;
        for (size_t o = 0; o < ny; ++o) innovation[o] = measured[o] - out[o];
        s.step(input, finite(innovation, model->n_y) ? innovation : nullptr);
    }
    return OKID_OK;
}

okid_status_t okid_model_initial_state(const okid_model_t* model, const okid_real_t* u, const okid_real_t* y,
                                       size_t count, okid_real_t* x0, okid_real_t* work) {
    if (model == nullptr || u == nullptr || y == nullptr || x0 == nullptr || work == nullptr) return OKID_ERR_NULL;
    if (!sized(*model)) return OKID_ERR_DIM;
    const auto z = static_cast<size_t>(model->n_z), ny = static_cast<size_t>(model->n_y),
               nu = static_cast<size_t>(model->n_u);
    stepper s(*model, nullptr, work);
    okid_real_t* spare = work + 2 * z;
    okid_real_t *out = spare + nu, *residual = out + ny, *observe = residual + ny, *moved = observe + ny * z;
    okid_real_t *normal = moved + ny * z, *scale = normal + z * z;
    std::copy(model->C, model->C + ny * z, observe); // C A^n
    std::fill(normal, normal + z * z, okid_real_t{0});
    std::fill(x0, x0 + z, okid_real_t{0});
    okid_real_t first = 0;
    for (size_t n = 0; n < count; ++n) {
        const okid_real_t* input = usable_input(u + n * nu, model->n_u, spare);
        s.output(input, out);
        for (size_t o = 0; o < ny; ++o) residual[o] = y[n * ny + o] - out[o];
        if (finite(residual, model->n_y)) {
            okid::linalg::multiply(true, false, model->n_z, model->n_z, model->n_y, 1, observe, model->n_y, observe,
                                   model->n_y, 1, normal, model->n_z);
            okid::linalg::multiply(true, false, model->n_z, 1, model->n_y, 1, observe, model->n_y, residual, model->n_y,
                                   1, x0, model->n_z);
        }
        s.step(input, nullptr);
        okid::linalg::multiply(false, false, model->n_y, model->n_z, model->n_z, 1, observe, model->n_y, model->A,
                               model->n_z, 0, moved, model->n_y);
        std::swap(observe, moved);
        okid_real_t size = 0;
        for (size_t i = 0; i < ny * z; ++i) size = std::max(size, std::abs(observe[i]));
        if (n == 0) first = size;
        if (!(size > faded * first) || !std::isfinite(size)) break; // the rest of the record no longer sees x0
    }
    for (size_t i = 0; i < z; ++i) scale[i] = normal[i * z + i] > 0 ? 1 / std::sqrt(normal[i * z + i]) : 0;
    for (size_t j = 0; j < z; ++j) {
        for (size_t i = 0; i < z; ++i) normal[j * z + i] *= scale[i] * scale[j];
        normal[j * z + j] = scale[j] > 0 ? 1 + ridge : 1;
        x0[j] *= scale[j];
    }
    if (okid::linalg::cholesky(model->n_z, normal, model->n_z) != 0) return OKID_ERR_NUMERIC;
    okid::linalg::cholesky_solve(model->n_z, normal, model->n_z, x0, model->n_z, 1);
    for (size_t i = 0; i < z; ++i) x0[i] *= scale[i];
    return OKID_OK;
}
