// SPDX-License-Identifier: MIT
// PURPOSE  the runs of a consensus over one set of records
// METHOD   at each rate MOESP and CVA with a long and a short horizon, SSARX between them, and OKID-ERA with the innovations in
//          its Hankel matrix (ERA on covariances without inputs); every order from the one decomposition of a run
#include "consensus_runs.hpp"

#include "files/side_by_side.hpp"
#include "result/judgement.hpp"
#include "result/method.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <new>
#include <numeric>
#include <set>

namespace okid_host {
namespace {

constexpr int long_rows = 30, lags_of_observer = 40, order_of_crowds = 128;
/// Block rows x outputs: the states of a Hankel matrix. A plate of 23 modes under one accelerometer has 46, and as many again
/// of noise beside them. Few channels ask for long horizons, and there they are cheap.
constexpr int rows_of_outputs = 90, rows_of_crowds = 180;
constexpr int most_unknowns = 450; ///< block rows x channels: the decomposition costs their third power
constexpr double short_share = 0.6, middle_share = 0.8;
constexpr int fewest_rows = 4;
/// Orders for each state that past and future share beyond chance: a weak mode among strong ones shows above twice as many.
/// What is higher holds noise alone and costs its third power.
constexpr int orders_of_a_state = 3, fewest_most = 24, no_limit = std::numeric_limits<int>::max();
constexpr int enough_voters = 4, few_voters = 2; ///< runs that tell a mode from its neighbour, that found it
constexpr double beats_wanted = 1.25;            ///< of both in the horizon: with room for the shorter ones
constexpr double most_decays = 2;                ///< times in which the mode falls to 1 / e: what is over tells nothing
constexpr int most_factor = 96;
/// Of the samples, in rows of the longest lags: then shorter ones need no sums of their own. What falls away stands at the
/// beginning of records, where a struck structure rings most.
constexpr double least_kept = 0.999;

std::unique_ptr<std::byte[]> memory(std::size_t bytes) {
    return std::unique_ptr<std::byte[]>(bytes ? new (std::nothrow) std::byte[bytes] : nullptr);
}

consensus_run run_of(okid_method_t method, int rows) {
    consensus_run run;
    run.method = method;
    run.rows = rows;
    return run;
}

/// Block rows, or lags, with which rows x outputs is what a run's states ask for.
int rows_for_states(int n_y, bool crowded) { return ((crowded ? rows_of_crowds : rows_of_outputs) + n_y - 1) / n_y; }

/// Block rows that so many samples bear. @param alone  no lower rate has longer horizons
int rows_of(int n_u, int n_y, long long samples, bool crowded, bool alone = false) {
    // Ten samples an unknown of one output; what more than three outputs have in common is estimated from all of them. A record
    // that is too short for a lower rate makes do with a third: of 12 periods, horizons of 4 rows show no mode.
    const long long borne = samples * std::max(3, n_y) / (alone ? 10 : 30) / (n_y + 2LL * n_u);
    const int wanted = std::max(long_rows, rows_for_states(n_y, crowded));
    return static_cast<int>(std::min<long long>({wanted, borne, std::max(6, most_unknowns / (n_u + n_y))}));
}

/// To the lags that the sums of the older samples have: those of more outputs, of which some are left out, have fewer.
void shorten(consensus_run& run, int n_u, int n_y, const record_level& level) {
    for (; level.older && run.rows > fewest_rows; --run.rows) {
        const okid_identify_config_t config = run_config(run, n_u, n_y);
        if (okid_identify_lags(&config) <= level.older->lags()) return;
    }
}

/// States that the Hankel matrix of a run holds, an even number, at most `most`.
int most_states(const consensus_run& run, int n_y, int most) {
    const int held = (is_subspace(run.method) ? run.rows - 1 : run.rows) * n_y;
    return std::min(most, held - held % 2);
}

/// Do past and future share more states than a run of CVA has? Their canonical correlations say so. Where modes overlap, a run with
/// too few states shows hardly one of them clearly.
bool shares_more(const okid_identified_t& model, const consensus_run& run) {
    const auto filled = static_cast<int>(judgement::most_filled * run.states);
    if (model.singular_count <= filled) return false;
    return static_cast<double>(model.singular_values[filled]) > judgement::surely_shared;
}

/// States that past and future share beyond chance: canonical correlations above the largest one of white noise, of so many
/// numbers in the past and in the future of so many samples (Wachter 1980).
int shared_states(const okid_identified_t& model, const consensus_run& run, long long samples) {
    const double past = std::min(1.0, run.rows * (run.inputs + run.outputs) / static_cast<double>(samples)),
                 future = std::min(1.0, run.rows * run.outputs / static_cast<double>(samples));
    const double of_chance = std::sqrt(past * (1 - future)) + std::sqrt(future * (1 - past));
    int out = 0;
    const auto shared = [&](int k) { return static_cast<double>(model.singular_values[k]) > of_chance; };
    while (out < model.singular_count && shared(out)) ++out;
    return out;
}

/// Keeps the orders up to `most`; all of ERA without a force: slow modes of ambient records show in its high orders alone (of
/// tests/kinds a tower's, a cable's, a chimney's).
void keep_orders(consensus_run& run, int most) {
    if (!is_subspace(run.method) && run.inputs == 0) return;
    run.most_order = std::min(run.most_order, most);
    while (run.orders.size() > 1 && run.orders.back() > most) run.orders.pop_back();
}

/// A run's decomposition, which a MOESP run of the same rows takes over from a CVA run.
struct run_decomposition {
    std::unique_ptr<std::byte[]> block;
    okid_identify_t* identifier = nullptr;
    okid_identified_t model{};
    int rows = 0; ///< 0: none stands

    bool take(const okid_identify_config_t& config, const owned_sums& sums) {
        if (rows > 0 && rows == config.rows && config.method == OKID_METHOD_N4SID_MOESP)
            return okid_identify_decompose_as(identifier, config.method, config.max_order, &model) == OKID_OK;
        const std::size_t bytes = okid_identify_memsize(&config);
        block = memory(bytes);
        rows = 0;
        if (!block || !sums.sums || okid_identify_create(&identifier, &config, block.get(), bytes) != OKID_OK ||
            okid_identify_decompose(identifier, sums.sums, &model) != OKID_OK)
            return false;
        if (config.method == OKID_METHOD_N4SID_CVA) rows = config.rows;
        return true;
    }
};

/// @param most  highest order worth its time at this level, no_limit until the first CVA run tells it
bool find_poles(int n_u, int n_y, const owned_sums& sums, run_decomposition& of, consensus_run& run, int& most) {
    keep_orders(run, most);
    if (!of.take(run_config(run, n_u, n_y), sums)) return false;
    if (run.method == OKID_METHOD_N4SID_CVA) {
        run.full = shares_more(of.model, run);
        const int shared = shared_states(of.model, run, okid_accumulator_rows(sums.sums));
        if (most == no_limit) most = std::max(fewest_most, orders_of_a_state * shared);
        keep_orders(run, most);
    }
    collect_poles(of.identifier, of.model, run);
    link_tracks(run);
    return true;
}

void place_run(consensus_run& run, const record_level& level, int number, int n_u, int n_y) {
    run.level = number;
    run.inputs = n_u;
    run.outputs = n_y;
    run.fs_hz = level.fs_hz;
    run.top = level.top;
    run.bottom = level.bottom;
    run.band = level.band;
    shorten(run, n_u, n_y, level);
    const okid_identify_config_t config = run_config(run, n_u, n_y);
    run.orders = consensus_orders(std::min(config.max_order, okid_identify_max_order(&config)));
    run.states = run.orders.empty() ? 0 : run.orders.back();
}

} // namespace

std::vector<consensus_run> plan_runs(int n_u, int n_y, int number, const record_level& level, bool crowded) {
    const int m = n_u + n_y;
    const long long samples = level.samples;
    const int rows = rows_of(n_u, n_y, samples, crowded, number == 0 && samples < 2 * fewest_samples);
    const int less = std::max(fewest_rows, static_cast<int>(std::lround(short_share * rows)));
    const int middle = std::max(fewest_rows, static_cast<int>(std::lround(middle_share * rows)));
    std::vector<consensus_run> out;
    if (rows >= fewest_rows)
        out = {run_of(OKID_METHOD_N4SID_CVA, rows), run_of(OKID_METHOD_N4SID_MOESP, rows),
               run_of(OKID_METHOD_N4SID_CVA, less), run_of(OKID_METHOD_N4SID_MOESP, less),
               run_of(OKID_METHOD_N4SID_SSARX, middle)};
    const int lags = std::max(lags_of_observer, rows_for_states(n_y, crowded));
    int p = n_u > 0 ? okid_identify_usable_p(n_u, n_y, lags, samples)
                    : static_cast<int>(std::min<long long>(lags, samples / 20));
    p = std::min(p, std::max(8, most_unknowns / m));
    if (p * n_y >= fewest_rows) out.push_back(run_of(OKID_METHOD_OKID_ERA, p));
    for (consensus_run& run : out) {
        if (crowded) run.most_order = order_of_crowds;
        place_run(run, level, number, n_u, n_y);
    }
    return out;
}

okid_identify_config_t run_config(const consensus_run& run, int n_u, int n_y) {
    okid_identify_config_t config{};
    config.n_u = n_u;
    config.n_y = n_y;
    config.method = run.method;
    if (is_subspace(run.method))
        config.rows = run.rows;
    else
        config.p = run.rows;
    if (n_u > 0 && !is_subspace(run.method)) config.hankel = OKID_HANKEL_INNOVATIONS;
    config.order = fewest_rows;
    config.max_order = most_states(run, n_y, run.most_order);
    config.fs_hz = run.fs_hz;
    config.detrend = OKID_DETREND_NONE; // levels are centred
    return config;
}

okid_identify_config_t longest_run(int n_u, int n_y, double fs_hz, bool crowded) {
    consensus_run run = run_of(OKID_METHOD_N4SID_CVA, rows_of(n_u, n_y, std::numeric_limits<int>::max(), crowded));
    run.fs_hz = fs_hz;
    return run_config(run, n_u, n_y);
}

int longest_lags(int n_u, int n_y) {
    record_level endless;
    endless.fs_hz = 1;
    endless.samples = std::numeric_limits<int>::max();
    int out = 1;
    for (const consensus_run& run : plan_runs(n_u, n_y, 0, endless, true)) {
        const okid_identify_config_t config = run_config(run, n_u, n_y);
        out = std::max(out, okid_identify_lags(&config));
    }
    return out;
}

namespace {

/// Those of the level, where sums of older samples are in units of the channels; empty: there are none.
std::vector<double> units_of(const record_level& level) {
    std::vector<double> out;
    if (level.older)
        for (const double one : level.scale) out.push_back(1 / one);
    return out;
}

} // namespace

owned_sums level_sums(const record_level& level, int n_u, int n_y, int lags, bool at_rest) {
    okid_accumulator_config_t shape = okid_accumulator_defaults(n_u, n_y, lags);
    shape.edges = 1;
    owned_sums out(shape);
    const auto m = static_cast<std::size_t>(n_u + n_y);
    const std::vector<double> silence(at_rest ? static_cast<std::size_t>(lags) * m : 0);
    const bool alone = level.older == nullptr;
    sample_rows in_units;
    for (const auto& rows : level.records) {
        if (!out.sums) break;
        in_units = alone ? sample_rows() : rows;
        for (std::size_t i = 0; i < in_units.size(); ++i) in_units[i] *= level.scale[i % m];
        okid_accumulator_gap(out.sums, 0);
        okid_status_t status = OKID_OK;
        if (at_rest) status = okid_accumulator_add(out.sums, silence.data(), static_cast<std::size_t>(lags));
        if (status >= 0)
            status = okid_accumulator_add(out.sums, alone ? rows.data() : in_units.data(), rows.size() / m);
        if (status < 0) out.sums = nullptr;
    }
    if (alone || !out.sums) return out;
    okid_accumulator_set_units(out.sums, units_of(level).data(), nullptr);
    if (!level.older->take(out.sums)) out.sums = nullptr;
    return out;
}

std::shared_ptr<const owned_sums> sums_of(const consensus_run& run, const record_level& level, int n_u, int n_y,
                                          bool at_rest) {
    const okid_identify_config_t config = run_config(run, n_u, n_y);
    const int lags = okid_identify_lags(&config);
    return run.sums ? run.sums : std::make_shared<owned_sums>(level_sums(level, n_u, n_y, lags, at_rest));
}

namespace {

/// Sums with fewer lags from those with more; none where that would leave out too many of the level's samples.
owned_sums shortened(const record_level& level, const owned_sums& longest, int lags, int n_u, int n_y) {
    if (!longest.sums ||
        static_cast<double>(okid_accumulator_rows(longest.sums)) < least_kept * static_cast<double>(level.samples))
        return {};
    return with_fewer_lags(longest.sums, n_u, n_y, lags, units_of(level));
}

/// The runs of one level with their poles linked, those with the horizon of the first one before the others: a CVA run, which
/// knows how high orders are worth their time.
std::vector<consensus_run> run_level(std::vector<consensus_run> runs, const record_level& level, int n_u, int n_y,
                                     bool at_rest) {
    std::vector<int> lags;
    for (const consensus_run& run : runs) {
        const okid_identify_config_t config = run_config(run, n_u, n_y);
        lags.push_back(okid_identify_lags(&config));
    }
    const std::set<int> sorted(lags.begin(), lags.end());
    std::vector<int> horizons(sorted.rbegin(), sorted.rend());
    std::vector<consensus_run> out;
    if (horizons.empty()) return out;
    const int longest = horizons.front();
    const auto own_horizon = std::find(horizons.begin(), horizons.end(), lags.front());
    std::rotate(horizons.begin(), own_horizon, own_horizon + 1);
    const auto all = std::make_shared<owned_sums>(level_sums(level, n_u, n_y, longest, at_rest));
    owned_sums own;
    int most = no_limit;
    for (const int horizon : horizons) {
        if (horizon != longest) own = shortened(level, *all, horizon, n_u, n_y);
        if (horizon != longest && !own.sums) own = level_sums(level, n_u, n_y, horizon, at_rest);
        run_decomposition of;
        for (std::size_t i = 0; i < runs.size(); ++i) {
            if (lags[i] != horizon) continue;
            if (!find_poles(n_u, n_y, horizon == longest ? *all : own, of, runs[i], most)) continue;
            if (i == 0 && horizon == longest) runs[i].sums = all;
            out.push_back(std::move(runs[i]));
        }
    }
    return out;
}

/// The runs of these levels, one level after the other.
std::vector<consensus_run> run_levels(const std::vector<record_level>& levels, const std::vector<std::size_t>& numbers,
                                      int n_u, int n_y, bool at_rest, int threads, bool crowded) {
    std::vector<std::vector<consensus_run>> of_level(numbers.size());
    side_by_side(numbers.size(), threads, [&](std::size_t i) {
        const record_level& level = levels[numbers[i]];
        of_level[i] =
            run_level(plan_runs(n_u, n_y, static_cast<int>(numbers[i]), level, crowded), level, n_u, n_y, at_rest);
    });
    std::vector<consensus_run> out;
    for (auto& runs : of_level)
        for (consensus_run& run : runs) out.push_back(std::move(run));
    return out;
}

} // namespace

std::vector<consensus_run> look_at(const std::vector<record_level>& levels, std::size_t first, int n_u, int n_y,
                                   bool at_rest, int threads) {
    std::vector<std::size_t> numbers(levels.size() - first);
    std::iota(numbers.begin(), numbers.end(), first);
    return run_levels(levels, numbers, n_u, n_y, at_rest, threads, false);
}

bool look_closer(const std::vector<record_level>& levels, int n_u, int n_y, bool at_rest, int threads,
                 std::vector<consensus_run>& runs) {
    std::set<std::size_t> crowded;
    for (const consensus_run& run : runs)
        if (run.full && is_subspace(run.method)) crowded.insert(static_cast<std::size_t>(run.level));
    auto closer = run_levels(levels, {crowded.begin(), crowded.end()}, n_u, n_y, at_rest, threads, true);
    const auto replaced = [&](const consensus_run& run) {
        return std::any_of(closer.begin(), closer.end(), [&](const auto& other) { return other.level == run.level; });
    };
    runs.erase(std::remove_if(runs.begin(), runs.end(), replaced), runs.end());
    for (consensus_run& run : closer) runs.push_back(std::move(run));
    return !closer.empty();
}

std::vector<record_level> zoomed_levels(const std::vector<record_level>& levels,
                                        const std::vector<consensus_mode>& modes, int n_u, int n_y, bool at_rest) {
    std::vector<record_level> out;
    const record_level& first = levels.front();
    const auto shows = [](const record_level& level, double f) {
        const double share = level.zoom().folded(f) / level.fs_hz;
        return share > level.bottom && share < level.top;
    };
    for (const consensus_mode& mode : modes) {
        const double decays_s = 1 / (2 * M_PI * mode.frequency_hz * mode.damping_ratio);
        const double wanted_s = beats_wanted / (n_y * mode.spacing_hz);
        if (mode.confident() || mode.parted >= enough_voters || mode.hits < few_voters || wanted_s == 0 ||
            wanted_s > most_decays * decays_s)
            continue;
        for (int factor = 2; factor <= most_factor;
             factor = factor % 3 ? factor * 3 / 2 : factor * 4 / 3) { // 2 3 4 6 8 ..
            const int rows = rows_of(n_u, n_y, first.samples / factor, false);
            if (rows * factor / first.fs_hz < wanted_s) continue;
            const auto has = [&](const record_level& level) {
                return level.fs_hz <= first.fs_hz / factor * (1 + 1e-9) && shows(level, mode.frequency_hz);
            };
            if (std::any_of(out.begin(), out.end(), has)) break;
            record_level zoomed =
                zoomed_level(first, static_cast<std::size_t>(n_u + n_y), factor, mode.frequency_hz, at_rest);
            if (zoomed.records.empty()) continue;
            out.push_back(std::move(zoomed));
            break;
        }
    }
    return out;
}

} // namespace okid_host
