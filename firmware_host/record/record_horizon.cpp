// SPDX-License-Identifier: MIT
// PURPOSE  how far back a method may look in the records there are
#include "record_horizon.hpp"

#include "error.hpp"
#include "result/method.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>

namespace okid_host {
namespace {

/// Gaps cost p rows each: the largest p up to `most` whose rows are ten times its unknowns; the best there is otherwise.
int choose_p_beside_gaps(const std::vector<long long>& runs, int n_u, int n_y, int least, int most) {
    int best = least;
    double best_share = 0;
    for (int p = most; p >= least; --p) {
        long long rows = 0;
        for (const long long run : runs) rows += std::max(0LL, run - p);
        const double share = static_cast<double>(rows) / static_cast<double>(n_u + p * (n_u + n_y));
        if (share >= 10) return p;
        if (share > best_share) {
            best_share = share;
            best = p;
        }
    }
    return best;
}

/// p for the samples there are.
int choose_p(const record_options& options, const record_set& set, long long samples, bool gaps,
             result_context& context) {
    const int n_u = static_cast<int>(options.inputs.size()), n_y = static_cast<int>(options.outputs.size());
    const int least_p = n_y >= 2 ? 1 : 2; // p n_y states: two make the first mode
    const long long least = 10LL * (n_u + least_p * (n_u + n_y));
    if (samples < least)
        throw failure(exit_no_model,
                      fmt::format("no model: too few samples: {} complete samples, but even the smallest model of {} "
                                  "inputs and {} outputs needs {} (10 for each unknown). Record longer or use fewer "
                                  "channels",
                                  samples, n_u, n_y, least),
                      OKID_ERR_TOO_SHORT);
    int p = okid_identify_usable_p(n_u, n_y, options.p, samples);
    if (gaps) {
        const auto runs = complete_runs(set);
        p = choose_p_beside_gaps(runs, n_u, n_y, std::min(least_p, p), p);
    }
    if (p < options.p)
        context.warnings.emplace_back("p_reduced",
                                      fmt::format("p is {} instead of {}: {} samples{} support no more unknowns (10 "
                                                  "rows for each). Record longer{} for sharper damping",
                                                  p, options.p, samples, gaps ? " with these gaps" : "",
                                                  gaps ? " or fix the gaps" : ""));
    return p;
}

/// Block rows of a method without observer: as many as leave ten Hankel columns for each unknown.
int choose_rows(const record_options& options, const record_set& set, long long samples, okid_identify_config_t config,
                result_context& context) {
    const int n_u = config.n_u, n_y = config.n_y;
    const int least = n_y >= 2 ? 2 : 3; // (rows - 1) n_y states: two make the first mode
    const int wanted = rows_used(config.method, options.inputs.size(), options.p, options.rows);
    const auto runs = complete_runs(set);
    config.fs_hz = options.fs_hz;
    for (int i = std::max(wanted, least); i >= least; --i) {
        config.rows = i;
        const long long lags = okid_identify_lags(&config);
        long long columns = 0;
        for (const long long run : runs) columns += std::max(0LL, run - lags);
        if (columns < 10 * unknowns_of(config.method, n_u, n_y, i)) continue;
        if (i != wanted)
            context.warnings.emplace_back("rows_reduced",
                                          fmt::format("{} block rows instead of {}: {} samples support no more "
                                                      "unknowns (10 for each). Record longer for sharper damping",
                                                      i, wanted, samples));
        return i;
    }
    throw failure(exit_no_model,
                  fmt::format("no model: too few samples: {} complete samples, but even the smallest model of {} "
                              "inputs and {} outputs needs {} in one stretch. Record longer or use fewer channels",
                              samples, n_u, n_y, 10 * unknowns_of(config.method, n_u, n_y, least) + 2 * least - 1),
                  OKID_ERR_TOO_SHORT);
}

} // namespace

void choose_horizon(const record_options& options, const record_set& set, const missing_count& missing,
                    okid_identify_config_t& config, result_context& context) {
    const long long samples = static_cast<long long>(set.count()) - missing.samples;
    if (!looks_back_rows(config.method, options.inputs.size())) {
        config.p = choose_p(options, set, samples, missing.samples > 0, context);
        config.rows = options.rows;
        return;
    }
    config.rows = choose_rows(options, set, samples, config, context);
    config.p = 0;
    if (options.p_given && (is_subspace(config.method) || options.rows > 0))
        context.warnings.emplace_back("p_ignored",
                                      fmt::format("--p belongs to the observer of the okid methods: {} looks back {} "
                                                  "block rows here (--rows)",
                                                  options.method, config.rows));
}

} // namespace okid_host
