// SPDX-License-Identifier: MIT
// PURPOSE    passes over the records at one set of parameters: sums for a step, scores of blocks, whiteness of the residuals
// METHOD     64 samples at a time into the Gram matrix of the signals of a run, which is added to that of all runs
// REFERENCE  docs/numerics.md, refinement; Box, Jenkins (1976) for the test of the residuals
// NUMERICS   the residuals are y - yhat sample by sample; their constants come off with their sums
// WORKSPACE  of_run^2 numbers; of_run^2 flop a sample and 2 n_y (of_run + n_z + n_u)
#include "identify/refine_pass.hpp"

#include <cmath>
#include <limits>

namespace okid {

using linalg::multiply;

void refine_pass::lay_out(const refine_layout& l, arena& memory) {
    layout = &l;
    signals.lay_out(l, memory);
    run_gram = memory.take<double>(area(l.of_run(), l.of_run()));
    run_with_e = memory.take<double>(area(l.of_run(), l.n_y));
    history = memory.take<double>(area(l.n_y, lags));
    correlation = memory.take<double>(area(l.n_y, lags));
}

/// All samples of one run; flush() takes a batch.
template <class Flush>
void refine_pass::walk(const refine_parameters& p, const refine_records& records, int run, Flush flush) {
    const int m = layout->n_u + layout->n_y;
    const double* v = records.samples;
    for (int r = 0; r < run; ++r) v += at(0, records.counts[r], m);
    signals.start(p, run);
    for (int t = 0; t < records.counts[run]; ++t, v += m) {
        if (!signals.sample(p, v) && t + 1 < records.counts[run]) continue;
        signals.find_errors(p);
        flush();
        signals.columns = 0;
    }
}

void refine_pass::sum(const refine_parameters& p, const refine_records& records, refine_sums& sums) {
    const refine_layout& l = *layout;
    const int n = l.of_run(), total = l.total();
    std::fill(sums.gram, sums.gram + area(total, total), 0.0);
    std::fill(sums.with_e, sums.with_e + area(total, l.n_y), 0.0);
    std::fill(sums.square, sums.square + l.n_y, 0.0);
    sums.used = 0;
    for (int r = 0; r < l.runs; ++r) {
        std::fill(run_gram, run_gram + area(n, n), 0.0);
        std::fill(run_with_e, run_with_e + area(n, l.n_y), 0.0);
        long long used = 0;
        walk(p, records, r, [&] {
            const int rows = signals.rows(), columns = signals.columns;
            used += columns;
            lower_product(rows, [columns](int) { return columns; }, signals.signals, n, 1, run_gram, n);
            multiply(false, true, rows, l.n_y, columns, 1, signals.signals, n, signals.errors, l.n_y, 1, run_with_e, n);
            for (int c = 0; c < columns; ++c)
                for (int o = 0; o < l.n_y; ++o) sums.square[o] += std::pow(signals.errors[at(o, c, l.n_y)], 2);
        });
        sums.used += used;
        for (int c = 0; c < n; ++c)
            for (int k = 0; k < n; ++k)
                sums.gram[at(l.place(k, r), l.place(c, r), total)] += run_gram[at(std::max(k, c), std::min(k, c), n)];
        for (int o = 0; o < l.n_y; ++o) {
            const double mean = l.constants && used > 0 ? run_with_e[at(l.one(), o, n)] / double(used) : 0;
            sums.mean[at(o, r, l.n_y)] = mean;
            sums.square[o] -= double(used) * mean * mean;
            for (int k = 0; k < n; ++k)
                sums.with_e[at(l.place(k, r), o, total)] +=
                    run_with_e[at(k, o, n)] - mean * run_gram[at(std::max(k, l.one()), std::min(k, l.one()), n)];
        }
    }
    sums.likelihood = 0;
    for (int o = 0; o < l.n_y; ++o) {
        const double rounding = 1e-32 * sums.output[o] + std::numeric_limits<double>::min();
        sums.square[o] = std::max(sums.square[o] / double(sums.used), rounding);
        sums.likelihood -= double(sums.used) / 2 * std::log(sums.square[o]);
    }
}

/// One residual into the sums of products with those before it.
void refine_pass::correlate(const double* e, bool follows) {
    const int n_y = layout->n_y;
    if (!follows) seen = 0;
    for (int lag = 1; lag <= lags && lag <= seen; ++lag) {
        const double* before = history + at(0, static_cast<int>((seen - lag) % lags), n_y);
        for (int o = 0; o < n_y; ++o) correlation[at(o, lag - 1, n_y)] += e[o] * before[o];
        ++products[lag - 1];
    }
    std::copy(e, e + n_y, history + at(0, static_cast<int>(seen % lags), n_y));
    ++seen;
}

double refine_pass::score(const refine_parameters& p, const refine_records& records, const refine_sums& sums,
                          int blocks, double* scores) {
    const refine_layout& l = *layout;
    const int n = l.of_run(), total = l.total();
    std::fill(correlation, correlation + area(l.n_y, lags), 0.0);
    std::fill(products, products + lags, 0LL);
    std::fill(scores, scores + area(total, l.n_y) * static_cast<std::size_t>(blocks), 0.0);
    long long first = 0; // used samples before the batch
    for (int r = 0; r < l.runs; ++r)
        walk(p, records, r, [&] {
            const int rows = signals.rows(), columns = signals.columns;
            for (int c = 0; c < columns; ++c) {
                double* e = signals.errors + at(0, c, l.n_y);
                for (int o = 0; o < l.n_y; ++o) e[o] -= sums.mean[at(o, r, l.n_y)];
                correlate(e, signals.follows[c]);
            }
            for (int c = 0, next = 0; blocks > 0 && c < columns; c = next) {
                const long long block = (first + c) * blocks / sums.used;
                for (next = c; next < columns && (first + next) * blocks / sums.used == block;) ++next;
                multiply(false, true, rows, l.n_y, next - c, 1, signals.signals + at(0, c, n), n,
                         signals.errors + at(0, c, l.n_y), l.n_y, 0, run_with_e, n);
                double* score = scores + static_cast<std::size_t>(block) * area(total, l.n_y);
                for (int o = 0; o < l.n_y; ++o)
                    for (int k = 0; k < rows; ++k) score[at(l.place(k, r), o, total)] += run_with_e[at(k, o, n)];
            }
            first += columns;
        });
    double sum = 0;
    for (int lag = 0; lag < lags; ++lag)
        for (int o = 0; o < l.n_y && products[lag] > 0; ++o) {
            const double r = correlation[at(o, lag, l.n_y)] / (double(products[lag]) * sums.square[o]);
            sum += double(products[lag]) * r * r;
        }
    return sum / (lags * l.n_y);
}

} // namespace okid
