// SPDX-License-Identifier: MIT
// PURPOSE    the singular values that errors of the observer alone give the Hankel matrix
// METHOD     theta is least squares: its error has covariance Se x (V V^T)^-1. Draws of it go through the recursion (40),
//            linearised; the norm of the Hankel matrix of each by power iteration
// REFERENCE  paper eq. (39), (40); docs/numerics.md, order
// NUMERICS   linearised, because theta + error of a lightly damped structure is unstable as often as not. Draws are signs:
//            the same covariance as normal numbers, and the same on every machine
// WORKSPACE  noise_work; for each draw n_y q^2 + 4 last p n_y^2 n_u + 40 rows^2 n_y n_u flop
#include "identify/noise_level.hpp"

#include "identify/companion.hpp"
#include "identify/signs.hpp"
#include "identify/triangular.hpp"
#include "linalg/linalg.hpp"

#include <algorithm>
#include <cmath>

namespace okid {
namespace {

using linalg::multiply;
using std::size_t;
constexpr int draws = 3, iterations = 10;
constexpr double margin = 1.5;

/// d Y_n = d Ybar^I_n + sum_h (d theta^y_h Y_(n-h) + theta^y_h d Y_(n-h)). Blocks of a stack stand one below the other,
/// the newest on top and p zeros at the bottom, so that each sum is one product.
void propagate(const okid_observer_config_t& c, int last, const noise_work& w) {
    const int n_u = c.n_u, n_y = c.n_y, m = n_u + n_y, before = (last + c.p) * n_y, tall = before + n_y;
    for (int n = 0; n <= last; ++n) {
        okid_real_t *top = w.changes + (last - n) * n_y, *next = top + n_y;
        const okid_real_t* own = w.error + (n == 0 ? 0 : area(n_u + (n - 1) * m, n_y));
        for (int k = 0; k < n_u; ++k)
            for (int o = 0; o < n_y; ++o) top[area(k, tall) + size_t(o)] = n <= c.p ? own[k * n_y + o] : 0;
        multiply(false, false, n_y, n_u, c.p * n_y, 1, w.feedback_error, n_y, w.stack + (last - n) * n_y, before, 1,
                 top, tall);
        multiply(false, false, n_y, n_u, c.p * n_y, 1, w.feedback, n_y, next, tall, 1, top, tall);
    }
    for (int n = 0; n <= last; ++n)
        for (int k = 0; k < n_u; ++k) {
            const okid_real_t* from = w.changes + area(k, tall) + (last - n) * n_y;
            std::copy(from, from + n_y, w.markov + area(n * n_u + k, n_y));
        }
}

double length(const okid_real_t* x, size_t count) {
    double sum = 0;
    for (size_t k = 0; k < count; ++k) sum += double(x[k]) * double(x[k]);
    return std::sqrt(sum);
}

/// Largest singular value of [blocks_(i+j+1)], rows x rows blocks; the iteration starts anywhere and comes from below.
double hankel_norm(int n_u, int n_y, int rows, const okid_real_t* blocks, okid_real_t* left, okid_real_t* right,
                   signs& sign) {
    const size_t tall = area(rows, n_y), wide = area(rows, n_u), block = area(n_y, n_u);
    for (size_t k = 0; k < wide; ++k) right[k] = static_cast<okid_real_t>(sign());
    double norm = 0;
    for (int step = 0; step < iterations; ++step) {
        const double size = length(right, wide);
        if (!(size > 0)) return 0;
        for (size_t k = 0; k < wide; ++k) right[k] = static_cast<okid_real_t>(right[k] / size);
        std::fill(left, left + tall, okid_real_t{0});
        for (int i = 0; i < rows; ++i) // the blocks of a block row stand side by side
            multiply(false, false, n_y, 1, rows * n_u, 1, blocks + static_cast<size_t>(i + 1) * block, n_y, right,
                     rows * n_u, 0, left + area(i, n_y), n_y);
        norm = length(left, tall);
        std::fill(right, right + wide, okid_real_t{0});
        for (int i = 0; i < rows; ++i)
            multiply(true, false, rows * n_u, 1, n_y, 1, blocks + static_cast<size_t>(i + 1) * block, n_y,
                     left + area(i, n_y), n_y, 1, right, rows * n_u);
    }
    return norm;
}

} // namespace

void noise_work::lay_out(const okid_observer_config_t& c, int rows, int last, arena& memory) {
    const int q = c.n_u + c.p * (c.n_u + c.n_y);
    draw = memory.take<double>(area(c.n_y, q));
    solve = memory.take<double>(solve_work(c.n_y));
    error = memory.take<okid_real_t>(area(c.n_y, q));
    plain = memory.take<okid_real_t>(area(c.n_y, q));
    root = memory.take<okid_real_t>(area(c.n_y, c.n_y));
    markov = memory.take<okid_real_t>(area(last + 1, c.n_y * c.n_u));
    left = memory.take<okid_real_t>(area(rows, c.n_y));
    right = memory.take<okid_real_t>(area(rows, c.n_u));
    for (okid_real_t** each : {&feedback, &feedback_error}) *each = memory.take<okid_real_t>(area(c.p * c.n_y, c.n_y));
    stack = memory.take<okid_real_t>(area((last + c.p) * c.n_y, c.n_u));
    changes = memory.take<okid_real_t>(area((last + 1 + c.p) * c.n_y, c.n_u));
}

void begin_spread(const okid_observer_config_t& c, const okid_real_t* theta, const okid_real_t* markov, int last,
                  const noise_work& w) {
    const int n_y = c.n_y, before = (last + c.p) * n_y, tall = before + n_y;
    std::fill(w.stack, w.stack + area(before, c.n_u), okid_real_t{0});
    std::fill(w.changes, w.changes + area(tall, c.n_u), okid_real_t{0});
    for (int n = 0; n < last; ++n) // nothing follows on the last one
        for (int k = 0; k < c.n_u; ++k) {
            const okid_real_t* from = markov + area(n * c.n_u + k, n_y);
            std::copy(from, from + n_y, w.stack + area(k, before) + (last - 1 - n) * n_y);
        }
    take_feedback(c.n_u, n_y, c.p, theta, w.feedback);
}

void spread_error(const okid_observer_config_t& c, int last, const noise_work& w) {
    take_feedback(c.n_u, c.n_y, c.p, w.error, w.feedback_error);
    propagate(c, last, w);
}

double noise_level(const okid_observer_config_t& c, void* observer_work, const okid_real_t* theta,
                   const okid_real_t* innovation, const okid_real_t* markov, int rows, int last, const noise_work& w) {
    const int n_y = c.n_y, q = c.n_u + c.p * (c.n_u + n_y);
    std::copy(innovation, innovation + n_y * n_y, w.root);
    if (linalg::cholesky(n_y, w.root, n_y) != 0) return 0; // no innovations, no error
    for (int k = 1; k < n_y; ++k) std::fill(w.root + area(k, n_y), w.root + area(k, n_y) + k, okid_real_t{0});
    begin_spread(c, theta, markov, last, w);
    signs sign;
    double sum = 0;
    for (int k = 0; k < draws; ++k) {
        for (size_t i = 0; i < area(n_y, q); ++i) w.draw[i] = sign();
        observer_error(c, observer_work, w.draw, w.solve);
        std::transform(w.draw, w.draw + area(n_y, q), w.plain, [](double x) { return static_cast<okid_real_t>(x); });
        multiply(false, false, n_y, q, n_y, 1, w.root, n_y, w.plain, n_y, 0, w.error, n_y);
        spread_error(c, last, w);
        const double norm = hankel_norm(c.n_u, n_y, rows, w.markov, w.left, w.right, sign);
        sum += norm * norm;
    }
    return margin * std::sqrt(sum / draws);
}

} // namespace okid
