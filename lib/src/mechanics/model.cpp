// SPDX-License-Identifier: MIT
// PURPOSE    simulate and predict with a discrete state-space model
// METHOD     plain recursions; of A the band alone, which of a model in modal coordinates is three wide
// REFERENCE  paper eq. (13), (15), (16), (20) with L = -K
// NUMERICS   those of the numbers of the model
// WORKSPACE  okid_model_workspace() numbers
#include <okid/model.h>

#include "model_fit.hpp"

#include <algorithm>
#include <climits>
#include <cmath>
#include <cstdlib>

using std::size_t;

namespace {

bool sized(const okid_model_t& m) { return m.n_u >= 0 && m.n_y >= 1 && m.n_z >= 1; }

/// y = M x + y, M rows x cols column-major, 0 farther than `band` from its diagonal.
void add_product(int rows, int cols, const okid_real_t* M, const okid_real_t* x, okid_real_t* y, int band = INT_MAX) {
    for (int j = 0; j < cols; ++j) {
        const okid_real_t v = x[j];
        const okid_real_t* column = M + static_cast<size_t>(j) * static_cast<size_t>(rows);
        const int last = band < rows - 1 - j ? j + band + 1 : rows;
        for (int i = std::max(0, j - band); i < last; ++i) y[i] += column[i] * v;
    }
}

/// How far from its diagonal an n x n matrix goes.
int band_of(int n, const okid_real_t* M) {
    int out = 0;
    for (int j = 0; j < n; ++j)
        for (int i = 0; i < n; ++i)
            if (M[j * n + i] != 0) out = std::max(out, std::abs(i - j));
    return out;
}

struct stepper {
    const okid_model_t& model;
    okid_real_t *x, *next;
    int band;
    size_t z() const { return static_cast<size_t>(model.n_z); }

    stepper(const okid_model_t& m, size_t count, const okid_real_t* x0, okid_real_t* work)
        : model(m), x(work), next(work + m.n_z), band(count > 1 ? band_of(m.n_z, m.A) : INT_MAX) {
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
        add_product(model.n_z, model.n_z, model.A, x, next, band);
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
    return model != nullptr && sized(*model) ? okid::initial_state_numbers(*model) : 0; // simulation takes less
}

okid_status_t okid_model_simulate(const okid_model_t* model, const okid_real_t* u, size_t count, const okid_real_t* x0,
                                  okid_real_t* y, okid_real_t* work) {
    if (model == nullptr || u == nullptr || y == nullptr || work == nullptr) return OKID_ERR_NULL;
    if (!sized(*model)) return OKID_ERR_DIM;
    stepper s(*model, count, x0, work);
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
    stepper s(*model, count, x0, work);
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
