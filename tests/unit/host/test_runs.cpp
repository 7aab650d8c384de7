// SPDX-License-Identifier: MIT
// Which runs look at a record: horizons and orders that hold the modes, as far as the samples bear them, and the bands that are
// looked into because modes stand too close.
#include "consensus/consensus_runs.hpp"
#include "result/method.hpp"

#include <algorithm>
#include <cmath>
#include <random>
#include <unity.h>

using namespace okid_host;

namespace {

record_level with(long long samples) {
    record_level out;
    out.fs_hz = 1000;
    out.top = 0.48;
    out.samples = samples;
    return out;
}

std::vector<int> rows_of(int n_u, int n_y, long long samples, bool crowded = false, int level = 1) {
    std::vector<int> out;
    for (const consensus_run& run : plan_runs(n_u, n_y, level, with(samples), crowded)) out.push_back(run.rows);
    return out;
}

struct pole {
    double hz, radius;
};

/// One output under noise, 1000 samples a second.
record_level noise_driven(std::size_t count, const std::vector<pole>& poles = {{215, 0.999}, {60, 0.995}}) {
    std::mt19937 random(5);
    std::normal_distribution<double> normal;
    record_level out = with(static_cast<long long>(count));
    sample_rows& rows = out.records.emplace_back();
    std::vector<std::complex<double>> states(poles.size());
    for (std::size_t i = 0; i < count; ++i) {
        const double force = normal(random);
        double sum = poles.empty() ? force : 0;
        for (std::size_t k = 0; k < poles.size(); ++k) {
            states[k] = states[k] * std::polar(poles[k].radius, 2 * M_PI * poles[k].hz / 1000) + force;
            sum += states[k].imag();
        }
        rows.push_back(0.1 * sum);
    }
    return out;
}

/// A doubtful mode that two runs found and none can tell from its neighbour.
consensus_mode close_mode(double frequency_hz, double spacing_hz) {
    consensus_mode out;
    out.frequency_hz = frequency_hz;
    out.damping_ratio = 1e-4;
    out.spacing_hz = spacing_hz;
    out.hits = 2;
    out.parted = 3;
    out.why = {"few_runs"};
    return out;
}

std::vector<double> rates_of(const std::vector<record_level>& levels, const std::vector<consensus_mode>& modes) {
    std::vector<double> out;
    for (const record_level& level : zoomed_levels(levels, modes, 0, 1, false)) out.push_back(level.fs_hz);
    return out;
}

} // namespace

void setUp() {}
void tearDown() {}

/// CVA and MOESP long and short (three fifths), SSARX between them (four fifths), OKID-ERA; block rows x outputs hold 90 states,
/// 180 of crowds, from 30 block rows and 40 lags on; block rows x channels stay below 450.
static void horizons_hold_the_modes() {
    TEST_ASSERT_TRUE(rows_of(1, 1, 1'000'000) == std::vector<int>({90, 90, 54, 54, 72, 90}));
    TEST_ASSERT_TRUE(rows_of(1, 1, 1'000'000, true) == std::vector<int>({180, 180, 108, 108, 144, 180}));
    TEST_ASSERT_TRUE(rows_of(2, 6, 1'000'000) == std::vector<int>({30, 30, 18, 18, 24, 40}));
    TEST_ASSERT_TRUE(rows_of(0, 2, 1'000'000) == std::vector<int>({45, 45, 27, 27, 36, 45}));
    TEST_ASSERT_TRUE(rows_of(1, 29, 1'000'000) == std::vector<int>({15, 15, 9, 9, 12, 15}));
    TEST_ASSERT_TRUE(rows_of(0, 100, 1'000'000) == std::vector<int>({6, 6, 4, 4, 5, 8}));
    const okid_method_t methods[] = {OKID_METHOD_N4SID_CVA,   OKID_METHOD_N4SID_MOESP, OKID_METHOD_N4SID_CVA,
                                     OKID_METHOD_N4SID_MOESP, OKID_METHOD_N4SID_SSARX, OKID_METHOD_OKID_ERA};
    const auto runs = plan_runs(1, 1, 2, with(1'000'000), false);
    for (std::size_t i = 0; i < runs.size(); ++i) {
        TEST_ASSERT_EQUAL(methods[i], runs[i].method);
        TEST_ASSERT_TRUE(runs[i].level == 2 && runs[i].inputs == 1 && runs[i].outputs == 1 && runs[i].fs_hz == 1000);
        TEST_ASSERT_EQUAL_INT(runs[i].rows == 54 ? 52 : 64, runs[i].states);
        TEST_ASSERT_EQUAL_INT(runs[i].states, runs[i].orders.back());
    }
    TEST_ASSERT_EQUAL_INT(128, plan_runs(1, 1, 0, with(1'000'000), true)[0].states);
}

/// Ten samples for each unknown of one output, of more than three outputs thirty for each of all; without a force a lag for
/// twenty samples. Below four block rows there is no run.
static void few_samples_bear_short_horizons() {
    TEST_ASSERT_EQUAL_INT(30, rows_of(1, 1, 900)[0]); // 3 unknowns a block row
    TEST_ASSERT_EQUAL_INT(29, rows_of(1, 1, 899)[0]);
    TEST_ASSERT_EQUAL_INT(10, rows_of(2, 6, 500)[0]); // 500 x 6 / 30 / 10
    TEST_ASSERT_EQUAL_INT(9, rows_of(2, 6, 499)[0]);
    TEST_ASSERT_EQUAL_UINT64(6, rows_of(1, 1, 120).size());
    TEST_ASSERT_EQUAL_UINT64(1, rows_of(1, 1, 119).size()); // OKID-ERA alone
    TEST_ASSERT_EQUAL_INT(4, rows_of(1, 1, 120)[2]);
    TEST_ASSERT_EQUAL_INT(35, rows_of(0, 1, 700).back());
    TEST_ASSERT_EQUAL_UINT64(6, rows_of(0, 1, 80).size());
    TEST_ASSERT_EQUAL_UINT64(5, rows_of(0, 1, 79).size()); // without OKID-ERA
}

/// A record with less than 1,400 samples has no lower rate: a third of them for each unknown.
static void a_record_without_a_lower_rate_has_longer_horizons() {
    TEST_ASSERT_EQUAL_INT(23, rows_of(8, 2, 1399, false, 0)[0]); // 18 unknowns a block row
    TEST_ASSERT_EQUAL_INT(7, rows_of(8, 2, 1400, false, 0)[0]);
    TEST_ASSERT_EQUAL_INT(7, rows_of(8, 2, 1399)[0]);
    TEST_ASSERT_EQUAL_INT(90, rows_of(1, 1, 900, false, 0)[0]);
    TEST_ASSERT_EQUAL_UINT64(5, rows_of(1, 1, 40, false, 0).size()); // without OKID-ERA
    TEST_ASSERT_TRUE(rows_of(1, 1, 39, false, 0).empty());
}

/// States are even, and as many as the Hankel matrix holds: of projections a block row less than of lags.
static void orders_stay_within_the_horizon() {
    const auto runs = plan_runs(1, 1, 1, with(900), false);
    TEST_ASSERT_EQUAL_INT(28, run_config(runs[0], 1, 1).max_order); // 29 states
    TEST_ASSERT_EQUAL_INT(28, runs[0].states);
    TEST_ASSERT_EQUAL_INT(runs[5].rows - runs[5].rows % 2, run_config(runs[5], 1, 1).max_order);
    TEST_ASSERT_TRUE(run_config(runs[0], 1, 1).rows == 30 && run_config(runs[0], 1, 1).p == 0);
    TEST_ASSERT_TRUE(run_config(runs[5], 1, 1).p == runs[5].rows && run_config(runs[5], 1, 1).rows == 0);
    TEST_ASSERT_EQUAL(OKID_HANKEL_INNOVATIONS, run_config(runs[5], 1, 1).hankel);
    TEST_ASSERT_EQUAL(OKID_HANKEL_SYSTEM, run_config(runs[5], 0, 1).hankel);
    TEST_ASSERT_EQUAL(OKID_HANKEL_SYSTEM, run_config(runs[0], 1, 1).hankel);
    TEST_ASSERT_TRUE(consensus_orders(33) == std::vector<int>({4, 6, 8, 10, 12, 14, 16, 18, 20, 22, 24, 28, 32}));
    TEST_ASSERT_TRUE(consensus_orders(3).empty());
    const std::vector<int> many = consensus_orders(130);
    TEST_ASSERT_TRUE(std::vector<int>(many.end() - 10, many.end()) ==
                     std::vector<int>({60, 64, 72, 80, 88, 96, 104, 112, 120, 128}));
}

static void no_run_asks_for_more_lags_than_the_longest() {
    for (const int n_u : {0, 1, 3})
        for (const int n_y : {1, 2, 8, 40}) {
            int most = 0;
            for (const bool crowded : {false, true})
                for (const long long samples : {500, 5000, 5'000'000})
                    for (const consensus_run& run : plan_runs(n_u, n_y, 0, with(samples), crowded)) {
                        const okid_identify_config_t config = run_config(run, n_u, n_y);
                        most = std::max(most, okid_identify_lags(&config));
                    }
            TEST_ASSERT_EQUAL_INT(most, longest_lags(n_u, n_y));
        }
}

/// Every run finds both modes, in the same order for any number of threads.
static void runs_find_the_modes() {
    std::vector<record_level> levels = {noise_driven(20000)};
    levels.push_back(levels[0]);
    levels[1].top = 0.3;
    const auto one = look_at(levels, 0, 0, 1, false, 1), three = look_at(levels, 0, 0, 1, false, 3);
    TEST_ASSERT_EQUAL_UINT64(12, one.size());
    TEST_ASSERT_EQUAL_UINT64(6, look_at(levels, 1, 0, 1, false, 1).size());
    for (std::size_t r = 0; r < 12; ++r) {
        TEST_ASSERT_EQUAL_INT(r < 6 ? 0 : 1, one[r].level);
        TEST_ASSERT_TRUE(one[r].method == three[r].method && one[r].rows == three[r].rows);
        TEST_ASSERT_EQUAL_UINT64(one[r].tracks.size(), three[r].tracks.size());
        for (const double hz : {215.0, 60.0})
            TEST_ASSERT_TRUE(std::any_of(one[r].tracks.begin(), one[r].tracks.end(), [&](const run_track& found) {
                return std::abs(found.frequency_hz / hz - 1) < 0.01;
            }));
    }
    for (const consensus_run& run : look_at(levels, 1, 0, 1, false, 1)) TEST_ASSERT_EQUAL_DOUBLE(0.3, run.top);
}

/// Three orders for each state that past and future share, at least 24: of two modes and of noise 24, of twelve modes all. ERA on
/// covariances has all. The states of a run, by which it is full or not, stay as they are.
static void orders_end_where_nothing_is_shared() {
    std::vector<pole> twelve;
    for (int k = 1; k <= 12; ++k) twelve.push_back({35.0 * k, 0.998});
    const auto orders_to = [](const record_level& level) {
        std::vector<int> out;
        for (const consensus_run& run : look_at({level}, 0, 0, 1, false, 1)) {
            TEST_ASSERT_EQUAL_INT(run.rows == 54 ? 52 : 64, run.states);
            for (const run_pole& found : run.poles) TEST_ASSERT_LESS_OR_EQUAL_INT(run.orders.back(), found.order);
            if (is_subspace(run.method))
                out.push_back(run.orders.back());
            else
                TEST_ASSERT_EQUAL_INT(64, run.orders.back());
        }
        return out;
    };
    TEST_ASSERT_TRUE(orders_to(noise_driven(20000)) == std::vector<int>(5, 24));
    TEST_ASSERT_TRUE(orders_to(noise_driven(20000, {})) == std::vector<int>(5, 24));
    std::vector<pole> five(twelve.begin(), twelve.begin() + 5);
    TEST_ASSERT_TRUE(orders_to(noise_driven(20000, five)) == std::vector<int>(5, 28)); // 30 is none of them
    TEST_ASSERT_EQUAL_UINT64(5, orders_to(noise_driven(20000, twelve)).size());
    for (const int highest : orders_to(noise_driven(20000, twelve))) TEST_ASSERT_TRUE(highest == 64 || highest == 52);
}

/// The sums that the long CVA run keeps are those made anew from the level.
static void sums_are_made_once() {
    record_level level = noise_driven(4000);
    sample_rows& rows = level.records[0];
    sample_rows driven;
    for (std::size_t i = 1; i < rows.size(); ++i)
        driven.insert(driven.end(), {rows[i - 1], rows[i], rows[i] - rows[i - 1]});
    level.records[0] = driven; // one force, two outputs
    level.samples = static_cast<long long>(driven.size() / 3);
    const auto runs = look_at({level}, 0, 1, 2, false, 1);
    std::size_t kept = 0;
    for (consensus_run run : runs) {
        if (!run.sums) continue;
        TEST_ASSERT_EQUAL(OKID_METHOD_N4SID_CVA, run.method);
        const auto first = sums_of(run, level, 1, 2, false);
        run.sums.reset();
        const auto again = sums_of(run, level, 1, 2, false);
        const okid_identify_config_t config = run_config(run, 1, 2);
        const auto size = static_cast<std::size_t>(3 * (okid_identify_lags(&config) + 1));
        std::vector<double> one(size * size), other(size * size);
        TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_gram(first->sums, OKID_DETREND_NONE, one.data(), nullptr));
        TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_gram(again->sums, OKID_DETREND_NONE, other.data(), nullptr));
        TEST_ASSERT_TRUE(first != again && one == other);
        ++kept;
    }
    TEST_ASSERT_EQUAL_UINT64(1, kept);
}

/// A level of which a subspace run is full is looked at again with twice the horizon, in place of its runs.
static void crowded_levels_are_looked_at_closer() {
    std::vector<record_level> levels = {noise_driven(20000)};
    levels.push_back(levels[0]);
    auto runs = look_at(levels, 0, 0, 1, false, 1);
    for (consensus_run& run : runs) run.full = run.level == 1 && run.method == OKID_METHOD_OKID_ERA;
    TEST_ASSERT_FALSE(look_closer(levels, 0, 1, false, 1, runs));
    runs.back().full = runs[6].full = true;
    TEST_ASSERT_EQUAL_INT(1, runs[6].level);
    TEST_ASSERT_TRUE(look_closer(levels, 0, 1, false, 1, runs));
    TEST_ASSERT_EQUAL_UINT64(12, runs.size());
    for (const consensus_run& run : runs) { // room for twice the states, as far as its horizon holds them
        const int held = is_subspace(run.method) ? run.rows - 1 : run.rows;
        TEST_ASSERT_EQUAL_INT(consensus_orders(std::min(run.level == 1 ? 128 : 64, held)).back(), run.states);
    }
    TEST_ASSERT_EQUAL_INT(180, std::max_element(runs.begin(), runs.end(), [](const auto& a, const auto& b) {
                                   return a.rows < b.rows;
                               })->rows);
}

/// Where no horizon holds a beat of two modes and a quarter, the first rate that does: 90 rows are 1.44 s at 62.5 a second.
static void close_modes_are_looked_at_in_their_band() {
    const std::vector<record_level> levels = {noise_driven(100'000)};
    TEST_ASSERT_TRUE(rates_of(levels, {close_mode(215, 1)}) == std::vector<double>({62.5}));
    TEST_ASSERT_TRUE(rates_of(levels, {close_mode(215, 1.25 / 1.43)}) == std::vector<double>({62.5}));
    TEST_ASSERT_TRUE(rates_of(levels, {close_mode(204, 1.25 / 1.45)}) == std::vector<double>({1000.0 / 24}));
    TEST_ASSERT_TRUE(rates_of(levels, {close_mode(215, 1), close_mode(214, 1)}).size() == 1); // one band shows both
    TEST_ASSERT_TRUE(rates_of(levels, {close_mode(215, 1), close_mode(300, 1)}).size() == 2);
    TEST_ASSERT_TRUE(rates_of(levels, {close_mode(215, 0.01)}).empty()); // more than a 96th of the rate is not tried
    consensus_mode sure = close_mode(215, 1), parted = sure, alone = sure, unknown = sure, brief = sure;
    sure.why.clear();
    parted.parted = 4;
    alone.hits = 1;
    unknown.spacing_hz = 0;
    brief.damping_ratio = 1.01 * 2 / 1.25 / (2 * M_PI * 215); // two of its decays are over before 1.25 s
    for (const consensus_mode& mode : {sure, parted, alone, unknown, brief})
        TEST_ASSERT_TRUE(rates_of(levels, {mode}).empty());
    brief.damping_ratio *= 0.98;
    TEST_ASSERT_EQUAL_UINT64(1, rates_of(levels, {brief}).size());
}

int main() {
    UNITY_BEGIN();
    RUN_TEST(horizons_hold_the_modes);
    RUN_TEST(few_samples_bear_short_horizons);
    RUN_TEST(a_record_without_a_lower_rate_has_longer_horizons);
    RUN_TEST(orders_stay_within_the_horizon);
    RUN_TEST(no_run_asks_for_more_lags_than_the_longest);
    RUN_TEST(runs_find_the_modes);
    RUN_TEST(orders_end_where_nothing_is_shared);
    RUN_TEST(sums_are_made_once);
    RUN_TEST(crowded_levels_are_looked_at_closer);
    RUN_TEST(close_modes_are_looked_at_in_their_band);
    return UNITY_END();
}
