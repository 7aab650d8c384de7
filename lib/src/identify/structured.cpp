// SPDX-License-Identifier: MIT
// PURPOSE    observer Markov parameters from the shift-structured sums of one run, in O(m q) memory
// METHOD     G of [v_n; ..; v_(n-p)] less its copy shifted by one block has rank 2m+2 (+2 when centred): first block row,
//            sample before the run, sample at its end, lag sums. The generalised Schur algorithm on [G I; I 0] (Householder
//            among columns of one sign, orthogonal-diagonal hyperbolic rotations between signs) ends with the generator of
//            G^-1, whose first block rows are the solution; two refinement steps against G, walked diagonal by diagonal
// REFERENCE  paper eq. (36)-(39); Kailath, Sayed, SIAM Review 37 (1995); Chandrasekaran, Sayed, SIAM J. Matrix Anal. Appl.
//            17 (1996) for the rotations; Higham, ACM TOMS 14 (1988) for the 1-norm
// NUMERICS   the structured inverse alone leaves Markov errors of 1e-12 (noise) to 1e-6 (conditions of 1e11); refined they
//            are those of the dense solver with noise and with quantised codes of 16 and 24 bits, and below 1e-11 without
//            noise, where the Gram matrix is singular
// WORKSPACE  2 (m+2)(n+m) + (1 + 3 min(4, n_y)) n + O(m^2) doubles, n = m(p+1), or the Arnoldi basis of the companion
//            radius where that is larger; (6 m + 14 n_y + 40) n^2 flop a ridge
#include <okid/steps/observer.h>

#include "identify/companion.hpp"
#include "identify/rotations.hpp"
#include "identify/stabilise.hpp"
#include "linalg/arena.hpp"
#include "linalg/linalg.hpp"

#include <algorithm>
#include <cmath>

namespace okid {
namespace {

using std::size_t;
constexpr int batch = 4;                 // outputs solved at a time
constexpr int refinements = 2;           // against the matrix without ridge
constexpr double rank_tolerance = 1e-10; // of the unit-diagonal Gram of the input lags
constexpr double input_ridge = 1e-12;    // lets the elimination pass pivots that are zero
constexpr double constant = 1e-13;       // share of the sum of squares below which nothing but rounding is left

struct structured_work {
    double *scale, *centre, *sum; // of channels; of lag rows, less the centre. Live through the radius
    double *generator, *vector, *block, *x, *rhs, *out, *inner, *border, *weight;
    companion_work companion;
};

size_t lay_out(const okid_observer_config_t& c, void* memory, structured_work* work) {
    const auto m = static_cast<size_t>(c.n_u + c.n_y), n = m * static_cast<size_t>(c.p + 1),
               ny = static_cast<size_t>(c.n_y), columns = std::min<size_t>(batch, ny);
    structured_work w{};
    arena solving(memory);
    w.scale = solving.take<double>(m);
    w.centre = solving.take<double>(m);
    w.sum = solving.take<double>(n);
    arena radius = solving; // the two never meet: one memory for both
    w.generator = solving.take<double>(2 * (m + 2) * (n + m));
    w.vector = solving.take<double>(m + 2);
    w.block = solving.take<double>(m * m);
    w.x = solving.take<double>(n * columns);
    w.rhs = solving.take<double>(n * columns);
    w.out = solving.take<double>(n * columns);
    w.inner = solving.take<double>(2 * (m + 2) * columns);
    w.border = solving.take<double>(ny * ny);
    w.weight = solving.take<double>(ny * columns);
    w.companion.lay_out(c.n_y, c.p, radius);
    if (work != nullptr) *work = w;
    return std::max(solving.bytes(), radius.bytes());
}

/// The nearest number of 16 significant bits: its products with sums of integer codes are exact.
double short_number(double x) {
    int exponent = 0;
    const double fraction = std::frexp(x, &exponent);
    return std::ldexp(std::round(fraction * 65536), exponent - 16);
}

/// The problem in hand: sizes, the sums and where everything is written. G below is equilibrated and centred.
struct solver {
    int n_u, n_y, p, m, n, q;
    const double *S, *head, *tail;
    bool mean;
    long long rows;
    structured_work w;
    okid_observer_info_t* info;
    int height = 0, plus = 0; // of the generator: rows, columns of either sign

    static size_t at(int row, int column, int ld) {
        return static_cast<size_t>(column) * static_cast<size_t>(ld) + static_cast<size_t>(row);
    }
    double edge(const double* samples, int lag, int channel) const {
        return (samples[at(channel, lag, m)] - w.centre[channel]) * w.scale[channel];
    }
    double lag_sum(int lag, int channel) const { return w.sum[at(channel, lag, m)] * w.scale[channel]; }
    double* column(int j) const { return w.generator + at(0, j, height); }
    bool is_regressor(int k) const { return k < n_u || k >= m; }
    int regressor(int k) const { return k < n_u ? k : k + n_y; }

    /// Centres, lag sums and scales. @return the first channel that does not move, or -1
    int prepare(const double* total) {
        const auto count = static_cast<double>(rows);
        for (int c = 0; c < m; ++c) {
            w.centre[c] = mean ? short_number(total[c] / count) : 0;
            w.sum[c] = mean ? total[c] - count * w.centre[c] : 0;
            for (int a = 0; a < p; ++a) {
                const size_t k = at(c, a, m);
                w.sum[k + static_cast<size_t>(m)] = mean ? w.sum[k] + (head[k] - tail[k]) : 0;
            }
            const double square = S[at(c, c, m)], offset = count * w.centre[c] + 2 * w.sum[c];
            const double d = square - w.centre[c] * offset - w.sum[c] * w.sum[c] / count;
            if (!(d > constant * square)) return c;
            w.scale[c] = 1 / std::sqrt(d);
        }
        return -1;
    }

    /// w.block = S_lag about the centres, scaled; the lag sums are not yet taken out.
    void load(int lag) {
        const auto count = static_cast<double>(rows);
        for (int c = 0; c < m; ++c)
            for (int r = 0; r < m; ++r) {
                const double cr = w.centre[r], cc = w.centre[c];
                const double shifted = S[at(r, lag * m + c, m)] - count * cr * cc;
                w.block[at(r, c, m)] = (shifted - cr * w.sum[at(c, lag, m)] - w.sum[r] * cc) * w.scale[r] * w.scale[c];
            }
    }

    /// use(a, b) for every block (a, b), a <= b, with w.block = that block of G, lag sums not taken out.
    template <class Use> void walk(Use use) {
        for (int lag = 0; lag <= p; ++lag) {
            load(lag);
            for (int a = 0; a + lag <= p; ++a) {
                use(a, a + lag);
                if (a + lag == p) break;
                for (int c = 0; c < m; ++c) {
                    const double in = edge(head, a + lag, c), gone = edge(tail, a + lag, c);
                    for (int r = 0; r < m; ++r) w.block[at(r, c, m)] += edge(head, a, r) * in - edge(tail, a, r) * gone;
                }
            }
        }
    }

    /// out = G x for `columns` columns.
    void multiply(const double* x, double* out, int columns) {
        std::fill(out, out + at(0, columns, n), 0.0);
        walk([&](int a, int b) {
            linalg::multiply(false, false, m, columns, m, 1, w.block, m, x + b * m, n, 1, out + a * m, n);
            if (a < b) linalg::multiply(true, false, m, columns, m, 1, w.block, m, x + a * m, n, 1, out + b * m, n);
        });
        for (int j = 0; j < columns && mean; ++j) {
            double sum = 0;
            for (int k = 0; k < n; ++k) sum += lag_sum(k / m, k % m) * x[at(k, j, n)];
            for (int k = 0; k < n; ++k) out[at(k, j, n)] -= lag_sum(k / m, k % m) * sum / static_cast<double>(rows);
        }
    }

    /// Generator of [G I; I 0] for the first `channels` channels. The rows of I stand above those of G: what elimination
    /// frees there they grow into, so that every column is one piece.
    bool load_generator(int channels, double ridge) {
        const int c = channels;
        const double root = std::sqrt(static_cast<double>(rows));
        height = c * (p + 2);
        plus = c + (mean ? 2 : 1);
        std::fill(w.generator, column(2 * plus), 0.0);
        for (int b = 0; b <= p; ++b) {
            load(b);
            for (int i = 0; i < c; ++i) {
                const int row = (b + 1) * c + i;
                for (int j = 0; j < c; ++j)
                    column(j)[row] = w.block[at(j, i, m)] - lag_sum(b, i) * lag_sum(0, j) / static_cast<double>(rows);
                if (b > 0) {
                    column(c)[row] = edge(head, b - 1, i);
                    column(plus + c)[row] = edge(tail, b - 1, i);
                }
                if (b > 0 && mean) {
                    column(c + 1)[row] = lag_sum(b - 1, i) / root;
                    column(plus + c + 1)[row] = lag_sum(b, i) / root;
                }
            }
        }
        for (int j = 0; j < c; ++j) { // Cholesky of the first block, all rows with it
            column(j)[j] = 1;
            column(j)[c + j] += ridge;
            for (int i = 0; i < j; ++i) {
                const double factor = column(i)[c + j];
                for (int k = 0; k < height; ++k) column(j)[k] -= factor * column(i)[k];
                column(j)[c + i] = 0;
            }
            const double pivot = column(j)[c + j];
            if (!(pivot > 0)) return false;
            for (int k = 0; k < height; ++k) column(j)[k] /= std::sqrt(pivot);
        }
        for (int j = 0; j < c; ++j) {
            std::copy(column(j), column(j + 1), column(plus + j));
            std::fill(column(plus + j) + c, column(plus + j) + 2 * c, 0.0);
        }
        return true;
    }

    void shift(int channels) {
        for (int j = 0; j < channels; ++j) {
            std::copy_backward(column(j), column(j + 1) - channels, column(j + 1));
            std::fill(column(j), column(j) + channels, 0.0);
        }
    }

    /// Eliminate all rows of G: the generator is then that of -(G + ridge)^-1 in its first n rows. Writes the squared
    /// pivots unless they are nullptr; false when one is not positive.
    bool eliminate(int channels, double ridge, double* pivots) {
        if (!load_generator(channels, ridge)) return false;
        for (int i = 0; i < channels && pivots != nullptr; ++i) pivots[i] = std::pow(column(i)[channels + i], 2);
        for (int k = 1; k <= p; ++k) {
            shift(channels);
            for (int i = 0; i < channels; ++i) {
                const int row = (k + 1) * channels + i;
                reflect(column(i), plus - i, height, row, w.vector);
                reflect(column(plus), plus, height, row, w.vector);
                const double pivot = rotate(column(i), column(plus), height, row);
                if (!(pivot > 0)) return false;
                if (pivots != nullptr) pivots[k * channels + i] = pivot;
            }
        }
        shift(channels);
        return true;
    }

    /// Do the inputs excite too little? By the rank of the Gram of all input lags, its pivots taken in lag order; an input
    /// that is a combination of those before it at the same instant is named.
    bool poor_input() {
        double* pivots = w.x;
        const int size = n_u * (p + 1);
        std::fill(pivots, pivots + size, 0.0);
        eliminate(n_u, input_ridge, pivots); // when it stops, the pivots beyond count as zero
        const double largest = *std::max_element(pivots, pivots + size);
        const double least = *std::min_element(pivots, pivots + size); // all are 0 when the first block stopped it
        info->input_excitation = least > 0 ? least / largest : 0;
        for (int k = 0; k < n_u; ++k)
            if (!(pivots[k] > rank_tolerance)) {
                info->channel = k;
                return true;
            }
        const auto rank = std::count_if(pivots, pivots + size, [](double v) { return v > rank_tolerance; });
        return rank <= std::min(4, p) * n_u;
    }

    void add_products(double* out, int columns, int size) { // out += inverse generator * (signs of `inner`)
        for (int j = 0; j < columns; ++j)
            for (int k = 0; k < plus; ++k) w.inner[at(k, j, 2 * plus)] *= -1;
        linalg::multiply(false, false, size, columns, 2 * plus, 1, w.generator, height, w.inner, 2 * plus, 1, out, n);
    }

    /// out += (columns of the inverse that belong to y_n) weight.
    void add_border(double* out, int columns) {
        linalg::multiply(true, false, 2 * plus, columns, n_y, 1, w.generator + n_u, height, w.weight, n_y, 0, w.inner,
                         2 * plus);
        add_products(out, columns, n);
    }

    /// out = K^-1 rhs on the regressors, K the Gram matrix without the rows and columns of y_n (rhs is 0 there).
    void apply_inverse(int columns) {
        std::fill(w.out, w.out + at(0, columns, n), 0.0);
        for (int k = 0; k <= p; ++k) {
            linalg::multiply(true, false, 2 * plus, columns, n - k * m, 1, w.generator, height, w.rhs + k * m, n, 0,
                             w.inner, 2 * plus);
            add_products(w.out + k * m, columns, n - k * m);
        }
        for (int j = 0; j < columns; ++j)
            for (int o = 0; o < n_y; ++o) w.weight[at(o, j, n_y)] = -w.out[at(n_u + o, j, n)];
        linalg::cholesky_solve(n_y, w.border, n_y, w.weight, n_y, columns);
        add_border(w.out, columns);
        clear_outputs(w.out, columns);
    }

    void clear_outputs(double* x, int columns) const {
        for (int j = 0; j < columns; ++j) std::fill(x + at(n_u, j, n), x + at(m, j, n), 0.0);
    }

    /// 1-norm of K + ridge.
    double norm(double ridge) {
        std::fill(w.out, w.out + n, ridge);
        walk([&](int a, int b) {
            for (int c = 0; c < m; ++c)
                for (int r = 0; r < m; ++r) {
                    if (!is_regressor(a * m + r) || !is_regressor(b * m + c)) continue;
                    const double centring = lag_sum(a, r) * lag_sum(b, c) / static_cast<double>(rows);
                    const double v = std::abs(w.block[at(r, c, m)] - centring);
                    w.out[b * m + c] += v;
                    if (a < b) w.out[a * m + r] += v;
                }
        });
        return *std::max_element(w.out, w.out + n); // the rows of y_n hold the ridge alone
    }

    /// Estimate of the 1-norm of K^-1.
    double inverse_norm() {
        double estimate = 0;
        for (int k = 0; k < n; ++k) w.rhs[k] = is_regressor(k) ? 1.0 / q : 0;
        for (int step = 0; step < 5; ++step) {
            std::copy(w.rhs, w.rhs + n, w.x);
            apply_inverse(1);
            double size = 0, slope = 0;
            int best = 0;
            for (int k = 0; k < n; ++k) {
                size += std::abs(w.out[k]);
                w.rhs[k] = is_regressor(k) ? std::copysign(1.0, w.out[k]) : 0;
            }
            estimate = std::max(estimate, size);
            apply_inverse(1);
            for (int k = 0; k < n; ++k) {
                slope += w.out[k] * w.x[k];
                if (std::abs(w.out[k]) > std::abs(w.out[best])) best = k;
            }
            if (!(std::abs(w.out[best]) > slope)) break;
            std::fill(w.rhs, w.rhs + n, 0.0);
            w.rhs[best] = 1;
        }
        return estimate;
    }

    /// All that apply_inverse() needs, for one ridge; false when the ridged Gram is not positive definite.
    bool factor(double ridge) {
        if (!eliminate(m, ridge, nullptr)) return false;
        const double *positive = w.generator + n_u, *negative = column(plus) + n_u;
        linalg::multiply(false, true, n_y, n_y, plus, 1, negative, height, negative, height, 0, w.border, n_y);
        linalg::multiply(false, true, n_y, n_y, plus, -1, positive, height, positive, height, 1, w.border, n_y);
        return linalg::cholesky(n_y, w.border, n_y) == 0;
    }

    /// theta, and the covariance unless it is nullptr, for one ridge; false when the ridged Gram is not positive definite.
    bool solve(double ridge, bool refine_unridged, okid_real_t* theta, okid_real_t* covariance) {
        if (!factor(ridge)) return false;
        info->condition = norm(ridge) * inverse_norm();
        info->ridge = ridge;
        for (int first = 0; first < n_y; first += batch) {
            const int columns = std::min(batch, n_y - first);
            start(first, columns);
            for (int step = 0; step < refinements; ++step) refine(columns, refine_unridged ? 0 : ridge);
            for (int j = 0; j < columns; ++j)
                for (int k = 0; k < q; ++k) {
                    const int i = regressor(k), o = first + j;
                    const double value = w.x[at(i, j, n)] * w.scale[i % m] / w.scale[n_u + o];
                    theta[at(o, k, n_y)] = static_cast<okid_real_t>(value);
                }
            if (covariance != nullptr) innovation(first, columns, theta, covariance);
        }
        return true;
    }

    /// x = [theta^T; -I in the rows of y_n] of outputs first.., from the first block row of the inverse.
    void start(int first, int columns) {
        std::fill(w.x, w.x + at(0, columns, n), 0.0);
        std::fill(w.weight, w.weight + at(0, columns, n_y), 0.0);
        for (int j = 0; j < columns; ++j) w.weight[at(first + j, j, n_y)] = -1;
        linalg::cholesky_solve(n_y, w.border, n_y, w.weight, n_y, columns);
        add_border(w.x, columns);
        clear_outputs(w.x, columns);
        for (int j = 0; j < columns; ++j) w.x[at(n_u + first + j, j, n)] = -1;
    }

    void refine(int columns, double ridge) {
        multiply(w.x, w.rhs, columns);
        const size_t size = at(0, columns, n);
        for (size_t k = 0; k < size; ++k) w.rhs[k] = -w.rhs[k] - ridge * w.x[k];
        clear_outputs(w.rhs, columns);
        apply_inverse(columns);
        for (size_t k = 0; k < size; ++k) w.x[k] += w.out[k];
    }

    /// w.rhs <- (G of the part about the means of the whole) w.x, `lags` the lag sums of the part about the centres.
    void multiply_part(const okid_run_sums_t& part, double* lags, int columns) {
        const auto count = static_cast<double>(part.rows);
        for (int c = 0; c < m; ++c) {
            lags[c] = mean ? part.sum[c] - count * w.centre[c] : 0;
            for (int k = c; k < p * m; k += m) lags[k + m] = mean ? lags[k] + (part.head[k] - part.tail[k]) : 0;
        }
        solver own = *this;
        own.S = part.S;
        own.head = part.head;
        own.tail = part.tail;
        own.rows = part.rows;
        own.mean = false; // the means are taken out below
        own.w.sum = lags;
        own.multiply(w.x, w.rhs, columns);
        for (int j = 0; j < columns && mean; ++j) {
            double by_part = 0, by_whole = 0;
            for (int k = 0; k < n; ++k) {
                by_part += lags[k] * w.scale[k % m] * w.x[at(k, j, n)];
                by_whole += lag_sum(k / m, k % m) / static_cast<double>(rows) * w.x[at(k, j, n)];
            }
            for (int k = 0; k < n; ++k)
                w.rhs[at(k, j, n)] -= lags[k] * w.scale[k % m] * by_whole +
                                      lag_sum(k / m, k % m) / static_cast<double>(rows) * (by_part - count * by_whole);
        }
    }

    /// change = theta without the part, less theta: -(sum over its rows of e v^T) K^-1. After factor().
    void leave_out(const okid_run_sums_t& part, const okid_real_t* theta, okid_real_t* change) {
        for (int first = 0; first < n_y; first += batch) {
            const int columns = std::min(batch, n_y - first);
            std::fill(w.x, w.x + at(0, columns, n), 0.0);
            for (int j = 0; j < columns; ++j) {
                const double scale = w.scale[n_u + first + j];
                for (int k = 0; k < q; ++k)
                    w.x[at(regressor(k), j, n)] = theta[at(first + j, k, n_y)] * scale / w.scale[regressor(k) % m];
                w.x[at(n_u + first + j, j, n)] = -1;
            }
            multiply_part(part, w.out, columns);
            clear_outputs(w.rhs, columns);
            apply_inverse(columns);
            for (int j = 0; j < columns; ++j)
                for (int k = 0; k < q; ++k)
                    change[at(first + j, k, n_y)] = static_cast<okid_real_t>(
                        w.out[at(regressor(k), j, n)] * w.scale[regressor(k) % m] / w.scale[n_u + first + j]);
        }
    }

    /// Covariance of the residual, [theta, -I] G [theta, -I]^T / dof, of outputs first.. with themselves and those before.
    /// theta, rounded where it is not double, only meets what G x leaves on the regressors: next to nothing.
    void innovation(int first, int columns, const okid_real_t* theta, okid_real_t* covariance) {
        const auto freedom = static_cast<double>(std::max(rows - q, 1LL));
        multiply(w.x, w.out, columns);
        for (int j = 0; j < columns; ++j)
            for (int o = 0; o <= first + j; ++o) {
                double sum = -w.out[at(n_u + o, j, n)] / w.scale[n_u + o];
                for (int k = 0; k < q; ++k)
                    sum += theta[at(o, k, n_y)] * w.out[at(regressor(k), j, n)] / w.scale[regressor(k) % m];
                covariance[at(o, first + j, n_y)] = covariance[at(first + j, o, n_y)] =
                    static_cast<okid_real_t>(sum / w.scale[n_u + first + j] / freedom);
            }
    }
};

bool is_complete(const okid_run_sums_t& sums, bool mean) {
    return sums.S != nullptr && sums.head != nullptr && sums.tail != nullptr && (!mean || sums.sum != nullptr);
}

solver make_solver(const okid_observer_config_t& c, bool mean, const okid_run_sums_t& sums, okid_observer_info_t* info,
                   void* work) {
    const int m = c.n_u + c.n_y, n = m * (c.p + 1);
    solver s{c.n_u, c.n_y, c.p, m, n, n - c.n_y, sums.S, sums.head, sums.tail, mean, sums.rows, {}, info};
    lay_out(c, work, &s.w);
    linalg::warm_up();
    return s;
}

} // namespace
} // namespace okid

size_t okid_structured_memsize(const okid_observer_config_t* config) {
    if (config == nullptr || config->n_u < 1 || config->n_y < 1 || config->p < 1) return 0;
    return okid::lay_out(*config, nullptr, nullptr);
}

okid_status_t okid_structured_solve(const okid_observer_config_t* config, okid_detrend_t detrend,
                                    const okid_run_sums_t* sums, okid_real_t* theta, okid_real_t* innovation,
                                    okid_observer_info_t* info, void* work, size_t bytes) {
    const bool mean = detrend == OKID_DETREND_MEAN;
    if (config == nullptr || sums == nullptr || !okid::is_complete(*sums, mean) || theta == nullptr ||
        info == nullptr || work == nullptr)
        return OKID_ERR_NULL;
    const size_t needed = okid_structured_memsize(config);
    if (needed == 0) return OKID_ERR_DIM;
    if (bytes < needed) return OKID_ERR_MEMORY;
    *info = okid_observer_info_t{0, 0, 0, 0, 0, -1};
    okid::solver s = okid::make_solver(*config, mean, *sums, info, work);
    if (sums->rows < s.q) return OKID_ERR_TOO_SHORT;
    info->channel = s.prepare(sums->sum);
    if (info->channel >= 0) return info->channel < s.n_u ? OKID_ERR_INPUT : OKID_ERR_OUTPUT;
    if (s.poor_input()) return OKID_ERR_EXCITATION;
    const double ridge_min = config->ridge_min > 0 ? config->ridge_min : 1e-12;
    const bool numerical = ridge_min <= 1e-10; // a floor only: refinement takes it out again
    if (!s.solve(ridge_min, numerical, theta, innovation) && !s.solve(ridge_min * 1e2, numerical, theta, innovation))
        return OKID_ERR_NUMERIC;
    auto radius = [&] {
        return okid::companion_radius(s.n_u, s.n_y, s.p, theta, s.w.scale + s.n_u, false, s.w.companion);
    };
    info->radius = info->radius_plain = radius();
    if (info->radius < 1 || config->unstable != 0) return OKID_OK;
    return okid::stabilise(ridge_min, [&](double ridge) {
        if (!s.solve(ridge, false, theta, innovation)) return false;
        info->radius = radius();
        return info->radius < 1;
    });
}

okid_status_t okid_structured_leave_out(const okid_observer_config_t* config, okid_detrend_t detrend,
                                        const okid_run_sums_t* whole, double ridge, const okid_real_t* theta,
                                        const okid_run_sums_t* parts, int32_t count, okid_real_t* change, void* work,
                                        size_t bytes) {
    const bool mean = detrend == OKID_DETREND_MEAN;
    const auto complete = [mean](const okid_run_sums_t& sums) { return okid::is_complete(sums, mean); };
    if (config == nullptr || whole == nullptr || theta == nullptr || parts == nullptr || change == nullptr ||
        work == nullptr || !complete(*whole) || (count > 0 && !std::all_of(parts, parts + count, complete)))
        return OKID_ERR_NULL;
    const size_t needed = okid_structured_memsize(config);
    if (needed == 0 || count < 0 || !(ridge >= 0)) return OKID_ERR_DIM;
    if (bytes < needed) return OKID_ERR_MEMORY;
    okid::solver s = okid::make_solver(*config, mean, *whole, nullptr, work);
    if (whole->rows < s.q) return OKID_ERR_TOO_SHORT;
    if (s.prepare(whole->sum) >= 0 || !s.factor(ridge)) return OKID_ERR_NUMERIC;
    for (int b = 0; b < count; ++b) s.leave_out(parts[b], theta, change + okid::solver::at(0, b, s.q * s.n_y));
    return OKID_OK;
}
