// SPDX-License-Identifier: MIT
// PURPOSE  the colour of the noise, and records without it
// METHOD   an autoregression of the residuals (Levinson), common to all outputs: y = G u + e becomes F y = G F u + F e with F e
//          white, so that least squares is maximum likelihood again. Ljung, System Identification (1999) ch. 7
#include "whitening.hpp"

#include <algorithm>
#include <cmath>

namespace okid_host {
namespace {

constexpr std::size_t most_order = 40;

/// Add the products of one output's residuals to `sums`, lags 0 to most_order, and how many there were to `pairs`.
void add_products(std::vector<double>& e, std::vector<double>& sums, std::vector<double>& pairs) {
    double mean = 0, there = 0;
    for (const double x : e)
        if (std::isfinite(x)) mean += x, ++there;
    for (double& x : e) x = std::isfinite(x) ? x - mean / there : 0;
    for (std::size_t lag = 0; lag <= most_order && lag < e.size(); ++lag) {
        for (std::size_t t = lag; t < e.size(); ++t) sums[lag] += e[t] * e[t - lag];
        pairs[lag] += there * (1 - static_cast<double>(lag) / static_cast<double>(e.size()));
    }
}

} // namespace

std::vector<double> residual_correlation(const okid_model_t& model, const double* x0, const sample_runs& runs) {
    const auto n_u = static_cast<std::size_t>(model.n_u), n_y = static_cast<std::size_t>(model.n_y), m = n_u + n_y;
    std::vector<std::vector<double>> sums(n_y, std::vector<double>(most_order + 1, 0.0)), pairs = sums;
    std::vector<double> work(okid_model_workspace(&model)), u, y, e, out(most_order + 1, 0.0);
    const double* v = runs.samples.data();
    for (std::size_t run = 0; run < runs.counts.size(); ++run) {
        const auto count = static_cast<std::size_t>(runs.counts[run]);
        u.resize(count * n_u);
        y.resize(count * n_y);
        for (std::size_t t = 0; t < count; ++t) std::copy_n(v + t * m, n_u, &u[t * n_u]);
        const double* start = x0 + run * static_cast<std::size_t>(model.n_z);
        if (okid_model_simulate(&model, u.data(), count, start, y.data(), work.data()) < 0) return {};
        e.resize(count);
        for (std::size_t o = 0; o < n_y; ++o) {
            for (std::size_t t = 0; t < count; ++t) e[t] = v[t * m + n_u + o] - y[t * n_y + o];
            add_products(e, sums[o], pairs[o]);
        }
        v += count * m;
    }
    for (std::size_t o = 0; o < n_y; ++o)
        for (std::size_t lag = 0; lag <= most_order; ++lag)
            if (sums[o][0] > 0 && pairs[o][lag] > 0)
                out[lag] += sums[o][lag] / pairs[o][lag] * pairs[o][0] / sums[o][0] / static_cast<double>(n_y);
    return out;
}

std::vector<double> whitening_filter(const std::vector<double>& correlation, double samples) {
    std::vector<double> filter{1}, best = filter;
    if (correlation.empty() || !(correlation[0] > 0)) return best;
    double left = correlation[0], least = samples * std::log(left);
    for (std::size_t order = 1; order < correlation.size() && static_cast<double>(100 * order) < samples; ++order) {
        double forward = 0;
        for (std::size_t k = 0; k < order; ++k) forward += filter[k] * correlation[order - k];
        const double reflection = -forward / left;
        left *= 1 - reflection * reflection;
        if (!(left > 0)) break;
        std::vector<double> next = filter;
        next.push_back(0);
        for (std::size_t k = 1; k <= order; ++k) next[k] += reflection * filter[order - k];
        filter = std::move(next);
        if (const double criterion = samples * std::log(left) + 2 * static_cast<double>(order); criterion < least) {
            least = criterion;
            best = filter;
        }
    }
    return best;
}

void filter_run(const std::vector<double>& filter, std::size_t channels, const double* samples, std::size_t count,
                std::vector<double>& out) {
    const std::size_t order = filter.size() - 1;
    const double* const end = samples + count * channels;
    for (const double* now = samples + order * channels; now < end; now += channels)
        for (std::size_t c = 0; c < channels; ++c) {
            double sum = 0;
            for (std::size_t k = 0; k <= order; ++k) sum += filter[k] * *(now + c - k * channels);
            out.push_back(sum);
        }
}

void filter_runs(const std::vector<double>& filter, std::size_t channels, std::size_t least, sample_runs& runs) {
    const std::size_t order = filter.size() - 1;
    std::vector<double> out;
    out.reserve(runs.samples.size());
    const double* v = runs.samples.data();
    std::vector<std::int32_t> counts;
    for (const std::int32_t count : runs.counts) {
        const double* const end = v + static_cast<std::size_t>(count) * channels;
        if (static_cast<std::size_t>(count) < order + least) {
            v = end;
            continue;
        }
        filter_run(filter, channels, v, static_cast<std::size_t>(count), out);
        v = end;
        counts.push_back(count - static_cast<std::int32_t>(order));
    }
    runs.counts = std::move(counts);
    runs.samples = std::move(out);
}

} // namespace okid_host
