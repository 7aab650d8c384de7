// SPDX-License-Identifier: MIT
// PURPOSE    observer Markov parameters from the Gram matrix (OKID least squares), made stable where needed
// METHOD     unit-diagonal scaling, ridge, Cholesky, one refinement step; spectral radius of the ARX companion matrix by
//            Arnoldi; when it reaches 1, the smallest ridge of a half-decade grid above which all are stable
// REFERENCE  paper eq. (36)-(39); Phan, Horta, Juang, Longman (1992); docs/numerics.md trap 22 for the ridge
// NUMERICS   squares cond(V): fine to 1e7 with exact sums; the refinement step takes the ridge of 1e-12 out again
//            double in every build; theta is rounded to okid_real_t and its companion matrix judged as it is then
// WORKSPACE  q^2 + 3 m (p+1) n_y doubles and the Arnoldi basis; q^3/3 + 2 q^2 n_y flop a ridge
#include <okid/steps/observer.h>

#include "identify/companion.hpp"
#include "identify/noise_level.hpp"
#include "identify/stabilise.hpp"
#include "identify/triangular.hpp"
#include "linalg/arena.hpp"
#include "linalg/linalg.hpp"

#include <algorithm>
#include <cmath>

namespace okid {
namespace {

using std::size_t;
constexpr double rank_tolerance = 1e-10; // of the unit-diagonal Gram of the input lags

struct observer_work {
    double *factor, *scale, *x, *t, *out, *estimate, *condition;
    companion_work companion;
};

size_t lay_out(const okid_observer_config_t& c, arena& memory, observer_work* work) {
    const auto m = static_cast<size_t>(c.n_u + c.n_y), n = m * static_cast<size_t>(c.p + 1),
               ny = static_cast<size_t>(c.n_y);
    const size_t q = n - ny;
    observer_work w{};
    w.factor = memory.take<double>(q * q);
    w.scale = memory.take<double>(n);
    w.x = memory.take<double>(q * ny);
    w.t = memory.take<double>(n * ny);
    w.out = memory.take<double>(n * ny);
    w.estimate = memory.take<double>(q * ny);
    w.condition = memory.take<double>(4 * q);
    w.companion.lay_out(c.n_y, c.p, memory);
    if (work != nullptr) *work = w;
    return memory.bytes();
}

/// The problem in hand: sizes, the Gram matrix and where everything is written.
struct solver {
    int n_u, n_y, p, m, n, q;
    const double* gram;
    long long rows;
    bool bare; // of a replicate: theta and nothing else
    observer_work w;
    okid_observer_info_t* info;

    /// Gram index of regressor k: u_n first, then all of lags 1..p.
    size_t index(int k) const { return static_cast<size_t>(k < n_u ? k : k + n_y); }
    double entry(int i, int j) const { return gram[index(j) * static_cast<size_t>(n) + index(i)]; }

    void equilibrate() {
        for (int k = 0; k < n; ++k) {
            const double d = gram[static_cast<size_t>(k) * static_cast<size_t>(n + 1)];
            w.scale[k] = d > 0 ? 1 / std::sqrt(d) : 0;
        }
    }

    /// The first input that is a combination of those before it at the same instant; -1 when there is none.
    int repeated_input() {
        double* a = w.factor;
        for (int j = 0; j < n_u; ++j)
            for (int i = 0; i < n_u; ++i)
                a[j * n_u + i] = gram[static_cast<size_t>(j) * static_cast<size_t>(n) + static_cast<size_t>(i)] *
                                 w.scale[i] * w.scale[j];
        for (int k = 0; k < n_u; ++k) {
            if (!(a[k * n_u + k] > rank_tolerance)) return k;
            for (int j = k + 1; j < n_u; ++j) {
                const double f = a[j * n_u + k] / a[k * n_u + k];
                for (int i = k + 1; i < n_u; ++i) a[j * n_u + i] -= f * a[k * n_u + i];
            }
        }
        return -1;
    }

    /// Rank and pivot ratio of the unit-diagonal Gram of all input lags, by pivoted Cholesky in `factor`.
    int input_rank() {
        const int size = n_u * (p + 1);
        double* a = w.factor;
        auto at = [&](int k) { return static_cast<size_t>(k / n_u * m + k % n_u); };
        for (int j = 0; j < size; ++j)
            for (int i = 0; i < size; ++i)
                a[j * size + i] = gram[at(j) * static_cast<size_t>(n) + at(i)] * w.scale[at(i)] * w.scale[at(j)];
        double largest = 0, smallest = 1e300;
        int rank = 0;
        for (int k = 0; k < size; ++k) {
            int best = k;
            for (int i = k; i < size; ++i)
                if (a[i * size + i] > a[best * size + best]) best = i;
            const double pivot = a[best * size + best];
            if (k == 0) largest = pivot;
            smallest = std::min(smallest, std::max(pivot, 0.0));
            if (!(pivot > rank_tolerance * std::max(largest, 1e-300))) break;
            ++rank;
            for (int i = 0; i < size; ++i) std::swap(a[k * size + i], a[best * size + i]);
            for (int j = 0; j < size; ++j) std::swap(a[j * size + k], a[j * size + best]);
            for (int j = k + 1; j < size; ++j) {
                const double f = a[j * size + k] / pivot;
                for (int i = k + 1; i < size; ++i) a[j * size + i] -= f * a[k * size + i];
            }
        }
        info->input_excitation = largest > 0 ? smallest / largest : 0;
        return rank;
    }

    /// theta for one ridge; false when the ridged Gram is not positive definite.
    bool solve(double ridge, bool refine_unridged, okid_real_t* theta) {
        double norm = 0;
        for (int j = 0; j < q; ++j) {
            double column = 0;
            for (int i = 0; i < q; ++i) {
                const double v = entry(i, j) * w.scale[index(i)] * w.scale[index(j)] + (i == j ? ridge : 0);
                w.factor[static_cast<size_t>(j) * static_cast<size_t>(q) + static_cast<size_t>(i)] = v;
                column += std::abs(v);
            }
            if (w.scale[index(j)] == 0) w.factor[static_cast<size_t>(j) * static_cast<size_t>(q + 1)] = 1;
            norm = std::max(norm, column);
        }
        if (linalg::cholesky(q, w.factor, q) != 0) return false;
        info->ridge = ridge;
        std::fill(w.x, w.x + q * n_y, 0.0);
        residual(0, true);
        correct();
        if (!bare) {
            info->condition = linalg::cholesky_condition(q, w.factor, q, norm, w.condition);
            residual(refine_unridged ? 0 : ridge, false);
            correct();
        }
        for (int k = 0; k < q; ++k)
            for (int o = 0; o < n_y; ++o)
                theta[k * n_y + o] = static_cast<okid_real_t>(w.x[o * q + k] * w.scale[index(k)]);
        return true;
    }

    /// estimate = right-hand side - (scaled Gram + ridge) x.
    void residual(double ridge, bool of_zero) {
        std::fill(w.t, w.t + n * n_y, 0.0);
        for (int o = 0; o < n_y; ++o)
            for (int k = 0; k < q; ++k)
                w.t[static_cast<size_t>(o) * static_cast<size_t>(n) + index(k)] = w.x[o * q + k] * w.scale[index(k)];
        if (of_zero)
            std::fill(w.out, w.out + n * n_y, 0.0);
        else
            linalg::multiply(false, false, n, n_y, n, 1, gram, n, w.t, n, 0, w.out, n);
        for (int o = 0; o < n_y; ++o)
            for (int k = 0; k < q; ++k) {
                const size_t i = index(k);
                const double rhs = gram[static_cast<size_t>(n_u + o) * static_cast<size_t>(n) + i];
                w.estimate[o * q + k] =
                    w.scale[i] * (rhs - w.out[static_cast<size_t>(o) * static_cast<size_t>(n) + i]) -
                    ridge * w.x[o * q + k];
            }
    }

    void correct() {
        linalg::cholesky_solve(q, w.factor, q, w.estimate, q, n_y);
        for (int i = 0; i < q * n_y; ++i) w.x[i] += w.estimate[i];
    }

    /// Covariance of the residual from the Gram matrix: (G_yy - G_yv theta^T - theta G_vy + theta G theta^T) / dof, with
    /// theta as it was before rounding.
    void innovation(okid_real_t* cov) {
        std::fill(w.t, w.t + n * n_y, 0.0);
        for (int o = 0; o < n_y; ++o) {
            for (int k = 0; k < q; ++k)
                w.t[static_cast<size_t>(o) * static_cast<size_t>(n) + index(k)] = -(w.x[o * q + k] * w.scale[index(k)]);
            w.t[static_cast<size_t>(o) * static_cast<size_t>(n) + static_cast<size_t>(n_u + o)] = 1;
        }
        linalg::multiply(false, false, n, n_y, n, 1, gram, n, w.t, n, 0, w.out, n);
        linalg::multiply(true, false, n_y, n_y, n, 1 / static_cast<double>(std::max(rows - q, 1LL)), w.t, n, w.out, n,
                         0, w.estimate, n_y);
        std::transform(w.estimate, w.estimate + n_y * n_y, cov, [](double x) { return static_cast<okid_real_t>(x); });
    }
};

} // namespace

void observer_error(const okid_observer_config_t& config, void* work, double* draw, double* solve) {
    arena memory(work);
    observer_work w;
    lay_out(config, memory, &w);
    const int m = config.n_u + config.n_y, q = config.n_u + config.p * m;
    solve_lower_right(q, w.factor, q, draw, config.n_y, config.n_y, solve);
    for (int k = 0; k < q; ++k) {
        const double scale = w.scale[k < config.n_u ? k : k + config.n_y];
        for (int o = 0; o < config.n_y; ++o) draw[k * config.n_y + o] *= scale;
    }
}

void observer_change(const okid_observer_config_t& config, void* work, double* x) {
    arena memory(work);
    observer_work w;
    lay_out(config, memory, &w);
    const int q = config.n_u + config.p * (config.n_u + config.n_y);
    const auto scale = [&] {
        for (int o = 0; o < config.n_y; ++o)
            for (int k = 0; k < q; ++k) x[o * q + k] *= w.scale[k < config.n_u ? k : k + config.n_y];
    };
    scale();
    linalg::cholesky_solve(q, w.factor, q, x, q, config.n_y);
    scale();
}

} // namespace okid

size_t okid_observer_memsize(const okid_observer_config_t* config) {
    if (config == nullptr || config->n_u < 1 || config->n_y < 1 || config->p < 1) return 0;
    okid::arena memory;
    return okid::lay_out(*config, memory, nullptr);
}

okid_status_t okid_observer_solve(const okid_observer_config_t* config, const double* gram, int64_t rows,
                                  okid_real_t* theta, okid_real_t* innovation, okid_observer_info_t* info, void* work,
                                  size_t bytes) {
    if (config == nullptr || gram == nullptr || theta == nullptr || info == nullptr || work == nullptr)
        return OKID_ERR_NULL;
    const size_t needed = okid_observer_memsize(config);
    if (needed == 0) return OKID_ERR_DIM;
    if (bytes < needed) return OKID_ERR_MEMORY;
    *info = okid_observer_info_t{0, 0, 0, 0, 0, -1};
    const int m = config->n_u + config->n_y, n = m * (config->p + 1);
    okid::solver s{config->n_u, config->n_y,           config->p, m,   n, n - config->n_y, gram,
                   rows,        config->unstable == 2, {},        info};
    okid::arena memory(work);
    okid::lay_out(*config, memory, &s.w);
    okid::linalg::warm_up();
    if (rows < s.q) return OKID_ERR_TOO_SHORT;
    for (int c = 0; c < m; ++c)
        if (!(gram[static_cast<size_t>(c) * static_cast<size_t>(n + 1)] > 0)) {
            info->channel = c;
            return c < s.n_u ? OKID_ERR_INPUT : OKID_ERR_OUTPUT;
        }
    s.equilibrate();
    if (!s.bare) info->channel = s.repeated_input();
    if (info->channel >= 0) return OKID_ERR_EXCITATION;
    if (!s.bare && s.input_rank() <= std::min(4, s.p) * s.n_u) return OKID_ERR_EXCITATION;
    const double ridge_min = config->ridge_min > 0 ? config->ridge_min : 1e-12;
    const bool numerical = ridge_min <= 1e-10; // a floor only: the refinement step takes it out again
    if (!s.solve(ridge_min, numerical, theta) && !s.solve(ridge_min * 1e2, numerical, theta)) return OKID_ERR_NUMERIC;
    if (s.bare) {
        if (innovation != nullptr) s.innovation(innovation);
        return OKID_OK;
    }
    auto radius = [&] {
        return okid::companion_radius(s.n_u, s.n_y, s.p, theta, s.w.scale + s.n_u, config->unstable == 3,
                                      s.w.companion);
    };
    info->radius = info->radius_plain = radius();
    if (!(info->radius < 1) && config->unstable != 1) {
        const okid_status_t status = okid::stabilise(ridge_min, [&](double ridge) {
            if (!s.solve(ridge, false, theta)) return false;
            info->radius = radius();
            return info->radius < 1;
        });
        if (status != OKID_OK) return status;
    }
    if (innovation != nullptr) s.innovation(innovation);
    return OKID_OK;
}
