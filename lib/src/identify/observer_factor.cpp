// SPDX-License-Identifier: MIT
// PURPOSE    observer Markov parameters from the triangular factor of the regression rows, made stable where needed
// METHOD     unit columns, sqrt(ridge) I stacked under the factor by Householder reflectors, back substitution; ARX radius
//            and ridge search as in observer.cpp; rank of the inputs by Gram-Schmidt with column pivoting
// REFERENCE  paper eq. (36)-(39); Bjorck, Numerical Methods for Least Squares Problems (1996) 2.7; numerics.md trap 22
// NUMERICS   works at cond(V), nothing is squared. The floor of the ridge stands well above the rounding noise of a
//            rank-deficient factor and well below its smallest singular value that means something
// WORKSPACE  two triangles, a batch of rows, n n_u (p+1) numbers of inputs, the Arnoldi basis; 2/3 q^3 flop a ridge
#include <okid/steps/observer.h>
#include <okid/steps/square_root.h>

#include "accumulate/householder.h"
#include "identify/companion.hpp"
#include "identify/stabilise.hpp"
#include "linalg/arena.hpp"
#include "linalg/linalg.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace okid {
namespace {

using std::size_t;
using real = okid_real_t;
constexpr size_t batch = 32;
constexpr real rank_tolerance = real(1e-10); // of the unit-diagonal Gram of the input lags, as in observer.cpp
// The ridge that noise-free data need: rounding leaves singular values near eps in their factor, what data mean stands
// above eps^(1/2). The root of the ridge goes between.
const double ridge_floor = std::pow(std::numeric_limits<real>::epsilon(), 1.5);

struct factor_work {
    real *scale, *triangle, *rows, *panel, *x, *t, *out, *inputs, *estimate;
    companion_work companion;
};

size_t lay_out(const okid_observer_config_t& c, arena& memory, factor_work* work) {
    const auto n_u = static_cast<size_t>(c.n_u), n_y = static_cast<size_t>(c.n_y), lags = static_cast<size_t>(c.p) + 1;
    const size_t n = (n_u + n_y) * lags, stride = okid_triangle_stride(n);
    factor_work w{};
    w.scale = memory.take<real>(n);
    w.triangle = memory.take<real>(okid_triangle_size(stride));
    w.rows = memory.take<real>(batch * stride);
    w.panel = memory.take<real>((batch + 3) * OKID_PANEL);
    w.x = memory.take<real>(n);
    w.t = memory.take<real>(n * n_y);
    w.out = memory.take<real>(n * n_y);
    w.inputs = memory.take<real>(n * n_u * lags);
    w.estimate = memory.take<real>(2 * n);
    w.companion.lay_out(c.n_y, c.p, memory);
    if (work != nullptr) *work = w;
    return memory.bytes();
}

real dot(const real* x, const real* y, size_t count) {
    real sum = 0;
    for (size_t i = 0; i < count; ++i) sum += x[i] * y[i];
    return sum;
}

/// 1-norm of a symmetric q x q operator that is only applied, by Hager's estimate. work: 2 q numbers.
template <class Apply> double symmetric_norm(size_t q, real* work, Apply apply) {
    real *x = work, *y = work + q;
    std::fill(x, x + q, real(1) / static_cast<real>(q));
    double estimate = 0;
    for (int step = 0; step < 5; ++step) {
        std::copy(x, x + q, y);
        apply(y);
        double size = 0;
        for (size_t i = 0; i < q; ++i) size += std::abs(y[i]);
        if (step > 0 && size <= estimate) break;
        estimate = size;
        for (size_t i = 0; i < q; ++i) y[i] = y[i] >= 0 ? real(1) : real(-1);
        apply(y);
        const real* best = std::max_element(y, y + q, [](real a, real b) { return std::abs(a) < std::abs(b); });
        if (std::abs(*best) <= dot(x, y, q)) break;
        std::fill(x, x + q, real(0));
        x[best - y] = 1;
    }
    return estimate;
}

/// The problem in hand: sizes, the factor and where everything is written.
struct factor_solver {
    size_t n_u, n_y, m, n, q, stride;
    const real* factor;
    int64_t rows;
    factor_work w;
    okid_observer_info_t* info;

    real entry(size_t i, size_t j) const { return factor[j * n + i]; }
    real* row(size_t i) const { return w.triangle + okid_triangle_row(stride, i); } // from its panel on

    void equilibrate() const {
        for (size_t j = 0; j < n; ++j) {
            double square = 0;
            for (size_t i = 0; i <= j; ++i)
                square += static_cast<double>(entry(i, j)) * static_cast<double>(entry(i, j));
            w.scale[j] = square > 0 ? static_cast<real>(1 / std::sqrt(square)) : real(0);
        }
    }

    /// The first channel that is constant; -1 when there is none.
    int32_t constant_channel() const {
        for (size_t c = 0; c < m; ++c)
            if (w.scale[c < n_u ? c : q + c - n_u] == 0) return static_cast<int32_t>(c);
        return -1;
    }

    /// The first input that is a combination of those before it at the same instant; -1 when there is none.
    int32_t repeated_input() const {
        for (size_t k = 0; k < n_u; ++k) {
            const real rest = entry(k, k) * w.scale[k];
            if (!(rest * rest > rank_tolerance)) return static_cast<int32_t>(k);
        }
        return -1;
    }

    /// Rank and pivot ratio of all input lags: the squares of the pivots are those of the Gram matrix.
    size_t input_rank() const {
        const size_t count = n_u * (n / m);
        for (size_t k = 0; k < count; ++k) {
            const size_t lag = k / n_u, j = lag == 0 ? k : n_u + (lag - 1) * m + k % n_u;
            for (size_t i = 0; i < n; ++i) w.inputs[k * n + i] = entry(i, j) * w.scale[j];
        }
        real most = 0, least = 1;
        size_t rank = 0;
        for (size_t k = 0; k < count; ++k) {
            real *column = w.inputs + k * n, *best = column, pivot = -1;
            for (real* c = column; c < w.inputs + count * n; c += n) {
                const real square = dot(c, c, n);
                if (square > pivot) {
                    pivot = square;
                    best = c;
                }
            }
            if (k == 0) most = pivot;
            least = std::min(least, pivot);
            if (!(pivot > rank_tolerance * most)) break;
            ++rank;
            std::swap_ranges(column, column + n, best);
            for (real* c = column + n; c < w.inputs + count * n; c += n) {
                const real part = dot(column, c, n) / pivot;
                for (size_t i = 0; i < n; ++i) c[i] -= part * column[i];
            }
        }
        info->input_excitation = least / most; // no channel is constant: the first pivot is 1
        return rank;
    }

    /// Factor of the scaled rows with sqrt(ridge) I under them, regressors and outputs.
    void factorise(double ridge) const {
        for (size_t i = 0; i < stride; ++i) {
            real* r = row(i);
            for (size_t j = i - i % OKID_PANEL; j < stride; ++j)
                r[j] = i < q && i <= j && j < n ? entry(i, j) * w.scale[j] : real(0);
        }
        const real root = static_cast<real>(std::sqrt(ridge));
        for (size_t begin = 0; begin < q; begin += batch) {
            const size_t count = std::min(batch, q - begin);
            std::fill(w.rows, w.rows + count * stride, real(0));
            for (size_t i = 0; i < count; ++i) w.rows[i * stride + begin + i] = root;
            okid_householder_pick()(w.triangle, stride, w.rows, static_cast<int32_t>(count), begin, w.panel);
        }
    }

    /// y <- R^-1 y
    void back(real* y) const {
        for (size_t i = q; i-- > 0;) y[i] = (y[i] - dot(row(i) + i + 1, y + i + 1, q - i - 1)) / row(i)[i];
    }
    /// y <- R^-T y
    void forward(real* y) const {
        for (size_t i = 0; i < q; ++i) {
            y[i] /= row(i)[i];
            for (size_t j = i + 1; j < q; ++j) y[j] -= row(i)[j] * y[i];
        }
    }
    /// y <- R^T R y
    void gram(real* y) const {
        for (size_t i = 0; i < q; ++i) y[i] = dot(row(i) + i, y + i, q - i);
        for (size_t i = q; i-- > 0;) {
            const real z = y[i];
            y[i] = 0;
            for (size_t j = i; j < q; ++j) y[j] += row(i)[j] * z;
        }
    }

    /// theta for one ridge; false when it is not finite.
    bool solve(double ridge, real* theta) const {
        factorise(ridge);
        info->ridge = ridge;
        real finite = 0;
        for (size_t o = 0; o < n_y; ++o) {
            for (size_t i = 0; i < q; ++i) w.x[i] = row(i)[q + o];
            back(w.x);
            for (size_t k = 0; k < q; ++k) {
                theta[k * n_y + o] = w.x[k] * w.scale[k] / w.scale[q + o];
                finite += theta[k * n_y + o] * 0;
            }
        }
        return finite == 0;
    }

    void condition() const {
        info->condition = symmetric_norm(q, w.estimate, [this](real* y) { gram(y); }) *
                          symmetric_norm(q, w.estimate, [this](real* y) {
                              forward(y);
                              back(y);
                          });
    }

    /// Covariance of the residual: E^T E / dof with E = F [-theta^T; I].
    void innovation(const real* theta, real* cov) const {
        for (size_t o = 0; o < n_y; ++o) {
            real* t = w.t + o * n;
            for (size_t k = 0; k < q; ++k) t[k] = -theta[k * n_y + o];
            std::fill(t + q, t + n, real(0));
            t[q + o] = 1;
        }
        const int size = static_cast<int>(n), ny = static_cast<int>(n_y);
        const auto freedom = static_cast<real>(std::max<int64_t>(rows - static_cast<int64_t>(q), 1));
        linalg::multiply(false, false, size, ny, size, real(1), factor, size, w.t, size, real(0), w.out, size);
        linalg::multiply(true, false, ny, ny, size, real(1) / freedom, w.out, size, w.out, size, real(0), cov, ny);
    }
};

okid_status_t check(const factor_solver& s, int p) {
    s.info->channel = s.constant_channel();
    if (s.info->channel >= 0) return static_cast<size_t>(s.info->channel) < s.n_u ? OKID_ERR_INPUT : OKID_ERR_OUTPUT;
    s.info->channel = s.repeated_input();
    if (s.info->channel >= 0) return OKID_ERR_EXCITATION;
    return s.input_rank() <= static_cast<size_t>(std::min(4, p)) * s.n_u ? OKID_ERR_EXCITATION : OKID_OK;
}

} // namespace
} // namespace okid

size_t okid_observer_factor_memsize(const okid_observer_config_t* config) {
    if (config == nullptr || config->n_u < 1 || config->n_y < 1 || config->p < 1) return 0;
    okid::arena memory;
    return okid::lay_out(*config, memory, nullptr);
}

okid_status_t okid_observer_solve_factor(const okid_observer_config_t* config, const okid_real_t* factor, int64_t rows,
                                         okid_real_t* theta, okid_real_t* innovation, okid_observer_info_t* info,
                                         void* work, size_t bytes) {
    if (config == nullptr || factor == nullptr || theta == nullptr || info == nullptr || work == nullptr)
        return OKID_ERR_NULL;
    const size_t needed = okid_observer_factor_memsize(config);
    if (needed == 0) return OKID_ERR_DIM;
    if (bytes < needed) return OKID_ERR_MEMORY;
    *info = okid_observer_info_t{0, 0, 0, 0, 0, -1};
    const auto n_u = static_cast<size_t>(config->n_u), n_y = static_cast<size_t>(config->n_y), m = n_u + n_y,
               n = m * (static_cast<size_t>(config->p) + 1);
    okid::factor_solver s{n_u, n_y, m, n, n - n_y, okid_triangle_stride(n), factor, rows, {}, info};
    okid::arena memory(work);
    okid::lay_out(*config, memory, &s.w);
    okid::linalg::warm_up();
    if (rows < static_cast<int64_t>(s.q)) return OKID_ERR_TOO_SHORT;
    s.equilibrate();
    const okid_status_t fit = okid::check(s, config->p);
    if (fit != OKID_OK) return fit;
    auto radius = [&] {
        return okid::companion_radius(config->n_u, config->n_y, config->p, theta, s.w.scale + s.q, false,
                                      s.w.companion);
    };
    if (!s.solve(std::max(config->ridge_min, okid::ridge_floor), theta)) return OKID_ERR_NUMERIC;
    info->radius = info->radius_plain = radius();
    if (!(info->radius < 1) && config->unstable == 0) {
        const okid_status_t status = okid::stabilise(std::max(config->ridge_min, 1e-12), [&](double ridge) {
            if (!s.solve(ridge, theta)) return false;
            info->radius = radius();
            return info->radius < 1;
        });
        if (status != OKID_OK) return status;
    }
    s.condition();
    if (innovation != nullptr) s.innovation(theta, innovation);
    return OKID_OK;
}
