// SPDX-License-Identifier: MIT
// find_agreement() on tracks written by hand: each constant of the decision from both sides.
#include "hand_made_tracks.hpp"

#include <algorithm>
#include <cmath>
#include <unity.h>

using namespace okid_host;

namespace {

using modes = std::vector<consensus_mode>;

std::vector<consensus_run> joined(std::vector<consensus_run> runs, const std::vector<consensus_run>& more) {
    runs.insert(runs.end(), more.begin(), more.end());
    return runs;
}

bool is_there(double value) { return value < INFINITY; }

/// The only mode, found in so many of so many runs.
consensus_mode only(std::size_t hits, std::size_t count, const run_track& found) {
    auto runs = rate(count, 30);
    give(runs, 0, hits, found);
    const modes all = find_agreement(runs);
    TEST_ASSERT_EQUAL_UINT64(1, all.size());
    return all[0];
}

/// Two kinds of tracks, each in three of six runs: how many modes are they?
std::size_t modes_of(const run_track& one, const run_track& other) {
    auto runs = rate(6, 30);
    give(runs, 0, 3, one);
    give(runs, 3, 6, other);
    return find_agreement(runs).size();
}

/// A shape whose MAC with {1, 0, 0} is this.
shape of_mac(double mac) { return {std::sqrt(mac), std::sqrt(1 - mac), 0.0}; }

/// A strong track in all of six runs and a weak one in five of the same: is the weak one split?
bool weak_is_split(int rows, const run_track& strong, const run_track& weak) {
    auto runs = rate(6, rows);
    give(runs, 0, 6, strong);
    give(runs, 0, 5, weak);
    const modes all = find_agreement(runs);
    TEST_ASSERT_EQUAL_UINT64(2, all.size());
    TEST_ASSERT_TRUE(all[0].confident());
    return has(all[1], "split");
}

/// Six runs with so many states that find so many modes: are they full?
bool are_full(int states, int count, double emac = 1) {
    auto runs = rate(6, 30);
    for (consensus_run& run : runs) run.states = states;
    for (int k = 0; k < count; ++k) give(runs, 0, 3, track(10 + k, 0.001, bending, emac));
    find_agreement(runs);
    return runs[0].full && runs[5].full;
}

} // namespace

void setUp() {}
void tearDown() {}

static void half_of_the_votes_decide() {
    const run_track mode = track(10, 0.01);
    TEST_ASSERT_FALSE(has(only(4, 8, mode), "few_runs"));
    TEST_ASSERT_TRUE(has(only(3, 7, mode), "few_runs"));
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, 3.0 / 7, only(3, 7, mode).found_in);
    TEST_ASSERT_EQUAL_INT(7, only(3, 7, mode).could);
    TEST_ASSERT_EQUAL_INT(3, only(3, 7, mode).hits);
}

static void fewer_than_three_runs_decide_nothing() {
    const run_track mode = track(10, 0.01);
    TEST_ASSERT_TRUE(only(3, 3, mode).confident());
    TEST_ASSERT_TRUE(only(2, 2, mode).why == std::vector<std::string>{"few_runs"});
}

static void an_agreement_of_one_half_is_believed() {
    TEST_ASSERT_TRUE(only(6, 6, track(10, 0.01, bending, 0.5)).confident());
    TEST_ASSERT_TRUE(only(6, 6, track(10, 0.01, bending, 0.499)).why == std::vector<std::string>{"noise_shape"});
    TEST_ASSERT_TRUE(only(6, 6, track(10, 0.01, bending, 0.625, 0.6)).confident()); // 0.625 x 1.6 / 2
    TEST_ASSERT_TRUE(has(only(6, 6, track(10, 0.01, bending, 0.625, 0.59)), "noise_shape"));
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, 0.8 * 0.75 * 0.7, only(4, 5, track(10, 0.01, bending, 0.75, 0.4)).agreement);
}

/// Half of the runs a share above, half below the median: 1.4826 times that over 0.6 is the scatter.
static void scatter_of_damping_costs_agreement() {
    for (const double share : {0.1, 0.3, 0.5}) {
        auto runs = rate(6, 30);
        give(runs, 0, 3, track(10, 0.01 * (1 - share)));
        give(runs, 3, 6, track(10, 0.01 * (1 + share)));
        const consensus_mode mode = find_agreement(runs).at(0);
        TEST_ASSERT_DOUBLE_WITHIN(1e-12, 1.4826 * share, mode.damping_spread);
        TEST_ASSERT_DOUBLE_WITHIN(1e-12, 1 / (1 + std::pow(1.4826 * share / 0.6, 2)), mode.agreement);
    }
}

static void one_per_cent_of_frequency_is_one_mode() {
    TEST_ASSERT_EQUAL_UINT64(1, modes_of(track(10, 0.001), track(10.099, 0.001)));
    TEST_ASSERT_EQUAL_UINT64(2, modes_of(track(10, 0.001), track(10.101, 0.001)));
    TEST_ASSERT_EQUAL_UINT64(1, modes_of(track(10, 0.001), track(9.901, 0.001)));
    TEST_ASSERT_EQUAL_UINT64(2, modes_of(track(10, 0.001), track(9.899, 0.001)));
    // Broad ones within half the smaller damping.
    TEST_ASSERT_EQUAL_UINT64(1, modes_of(track(10, 0.06), track(10.299, 0.06)));
    TEST_ASSERT_EQUAL_UINT64(2, modes_of(track(10, 0.06), track(10.301, 0.06)));
    TEST_ASSERT_EQUAL_UINT64(2, modes_of(track(10, 0.06), track(10.2, 0.01)));
}

static void a_mac_of_eight_tenths_is_one_mode() {
    TEST_ASSERT_EQUAL_UINT64(1, modes_of(track(10, 0.01, of_mac(1)), track(10, 0.01, of_mac(0.801))));
    TEST_ASSERT_EQUAL_UINT64(2, modes_of(track(10, 0.01, of_mac(1)), track(10, 0.01, of_mac(0.799))));
}

/// Two tracks of one run are two vibrations, however near.
static void a_run_has_one_track_in_a_mode() {
    auto runs = rate(6, 30);
    give(runs, 0, 6, track(10, 0.01));
    give(runs, 0, 6, track(10.01, 0.01));
    TEST_ASSERT_EQUAL_UINT64(2, find_agreement(runs).size());
}

/// Of two clusters that a track could belong to, the nearest in frequency, shape and damping has it.
static void a_track_goes_to_the_nearest_cluster() {
    const shape near = of_mac(0.9);
    const struct {
        run_track a, b, third; // the third belongs to b
    } cases[] = {{track(10, 0.01), track(10.1, 0.01), track(10.06, 0.01)},
                 {track(10, 0.01, near), track(10, 0.01, of_mac(1)), track(10, 0.01, of_mac(0.99))},
                 {track(10, 0.01), track(10.0001, 0.03), track(10, 0.025)}};
    for (const auto& one : cases) {
        auto runs = rate(7, 30);
        give(runs, 0, 6, one.a);
        give(runs, 0, 6, one.b);
        run_track last = one.third;
        last.length = 4; // ranked behind the others
        give(runs, 6, 7, last);
        const modes all = find_agreement(runs);
        TEST_ASSERT_EQUAL_UINT64(2, all.size());
        for (const consensus_mode& mode : all) {
            const bool is_b =
                runs[0].tracks[static_cast<std::size_t>(mode.members[0].second)].damping_ratio == one.b.damping_ratio &&
                mode.members[0].second == 1;
            TEST_ASSERT_EQUAL_UINT64(is_b ? 7 : 6, mode.members.size());
        }
    }
}

static void what_is_overdamped_or_out_of_band_is_no_mode() {
    auto runs = rate(6, 30);
    give(runs, 0, 6, track(10, 0.199));
    give(runs, 0, 6, track(20, 0.2));
    give(runs, 0, 6, track(41.9, 0.01));
    give(runs, 0, 6, track(42.1, 0.01));
    for (consensus_run& run : runs) run.bottom = 0.05;
    give(runs, 0, 6, track(4.9, 0.01));
    give(runs, 0, 6, track(5.1, 0.01));
    const modes all = find_agreement(runs);
    TEST_ASSERT_EQUAL_UINT64(3, all.size());
    TEST_ASSERT_TRUE(all[0].frequency_hz == 5.1 && all[1].frequency_hz == 10 && all[2].frequency_hz == 41.9);
}

/// Runs whose horizon holds too few periods do not vote, though they may have found it.
static void runs_with_too_few_periods_do_not_vote() {
    for (const double hz : {2.49, 2.51}) { // 0.75 periods in 0.3 s
        auto runs = joined(rate(4, 30), rate(4, 300));
        give(runs, 0, 8, track(hz, 0.01));
        const consensus_mode mode = find_agreement(runs).at(0);
        TEST_ASSERT_EQUAL_INT(hz > 2.5 ? 8 : 4, mode.could);
        TEST_ASSERT_EQUAL_INT(hz > 2.5 ? 8 : 4, mode.hits);
        TEST_ASSERT_EQUAL_UINT64(8, mode.members.size());
    }
}

/// Nobody sees it: the tracks give its values, and nothing else speaks for it.
static void what_no_run_can_see_is_not_believed() {
    auto runs = rate(6, 30);
    give(runs, 0, 6, track(1, 0.01));
    const consensus_mode mode = find_agreement(runs).at(0);
    TEST_ASSERT_EQUAL_INT(0, mode.could);
    TEST_ASSERT_TRUE(mode.found_in == 0 && mode.frequency_hz == 1 && has(mode, "few_runs"));
    TEST_ASSERT_TRUE(mode.resolved_hz == INFINITY);
}

/// Beats of both modes in horizon x outputs: 0.75 are enough. Of twelve runs six have a horizon of 0.3 s.
static void runs_vote_from_three_quarters_of_a_beat() {
    for (const std::size_t n_y : {1U, 2U}) {
        const shape all_of(n_y, 1.0);
        const double bound = 2.5 / static_cast<double>(n_y);
        for (const double apart : {0.98 * bound, 1.02 * bound}) {
            auto runs = joined(rate(6, 30, static_cast<int>(n_y)), rate(6, 300, static_cast<int>(n_y)));
            give(runs, 0, 12, track(10, 0.001, all_of));
            give(runs, 0, 12, track(10 + apart, 0.001, all_of));
            const modes all = find_agreement(runs);
            TEST_ASSERT_EQUAL_UINT64(2, all.size());
            TEST_ASSERT_DOUBLE_WITHIN(1e-9, apart, all[0].spacing_hz);
            TEST_ASSERT_EQUAL_INT(apart > bound ? 12 : 6, all[0].could);
            TEST_ASSERT_EQUAL_INT(apart > bound ? 12 : 6, all[0].parted);
        }
    }
}

/// Eight horizons, none of which can part two modes: the six longest vote, whatever place they have in the list.
static void the_six_longest_horizons_vote() {
    auto runs = rate(8, 30, 1);
    const int rows[] = {31, 38, 33, 36, 32, 37, 34, 35};
    for (std::size_t r = 0; r < 8; ++r) runs[r].rows = rows[r];
    give(runs, 0, 8, track(10.3, 0.0001, {1.0}));
    for (std::size_t r = 0; r < 8; ++r)
        if (rows[r] > 34) give(runs, r, r + 1, track(10, 0.0001, {1.0})); // four of the six
    const modes all = find_agreement(runs);
    TEST_ASSERT_EQUAL_INT(6, all[0].could);
    TEST_ASSERT_EQUAL_INT(4, all[0].hits);
    TEST_ASSERT_EQUAL_INT(6, all[1].hits);
    TEST_ASSERT_EQUAL_INT(0, all[0].parted);
}

/// What counts as a neighbour: three runs of one rate found it, and half of those that could.
static void a_neighbour_is_supported_at_one_rate() {
    for (const std::size_t hits : {2U, 3U, 4U})
        for (const std::size_t count : {6U, 8U}) {
            auto runs = rate(count, 300);
            give(runs, 0, count, track(10, 0.001));
            give(runs, 0, hits, track(12, 0.001));
            const bool counts = hits >= 3 && 2 * hits >= count;
            TEST_ASSERT_EQUAL(counts, is_there(find_agreement(runs).at(0).spacing_hz));
        }
    auto runs = joined(rate(4, 300), rate(4, 300, 3, 1)); // two of each of two rates
    give(runs, 0, 8, track(10, 0.001));
    give(runs, 2, 6, track(12, 0.001));
    TEST_ASSERT_TRUE(find_agreement(runs).at(0).spacing_hz == INFINITY);
}

/// Within 2.5 bandwidths and of the same shape it is the same vibration; the nearest of two neighbours counts.
static void a_neighbour_is_another_vibration() {
    struct neighbour {
        double hz;
        shape of;
        bool counts;
    };
    for (const auto& [hz, of, counts] : {neighbour{10.50, bending, false}, neighbour{10.53, bending, true},
                                         neighbour{10.50, torsion, true}, neighbour{9.5, bending, true}}) {
        auto runs = rate(6, 300);
        give(runs, 0, 6, track(10, 0.01));
        give(runs, 0, 6, track(hz, hz < 10 ? 0.005 : 0.01, of));
        give(runs, 0, 6, track(13, 0.01));
        const modes all = find_agreement(runs);
        const consensus_mode& mode = all[hz < 10 ? 1 : 0];
        TEST_ASSERT_DOUBLE_WITHIN(1e-9, counts ? std::abs(hz - 10) : 3, mode.spacing_hz);
    }
    for (const double mac : {0.89, 0.91}) {
        auto runs = rate(6, 300);
        give(runs, 0, 6, track(10, 0.01, of_mac(1)));
        give(runs, 0, 6, track(10.3, 0.01, of_mac(mac)));
        TEST_ASSERT_EQUAL(mac < 0.9, is_there(find_agreement(runs)[0].spacing_hz));
    }
}

static void split_is_closer_than_two_and_a_half_bandwidths() {
    TEST_ASSERT_TRUE(weak_is_split(300, track(10, 0.01), track(10.51, 0.01))); // 2.5 x 0.2051
    TEST_ASSERT_FALSE(weak_is_split(300, track(10, 0.01), track(10.52, 0.01)));
}

static void split_is_of_the_same_shape() {
    TEST_ASSERT_TRUE(weak_is_split(300, track(10, 0.01, of_mac(1)), track(10.3, 0.01, of_mac(0.91))));
    TEST_ASSERT_FALSE(weak_is_split(300, track(10, 0.01, of_mac(1)), track(10.3, 0.01, of_mac(0.89))));
}

/// Hardly damped: within 1 % of the stronger one, though every run can tell them apart.
static void split_is_within_one_per_cent() {
    TEST_ASSERT_TRUE(weak_is_split(3000, track(10, 1e-5), track(10.099, 1e-5)));
    TEST_ASSERT_FALSE(weak_is_split(3000, track(10, 1e-5), track(10.101, 1e-5)));
}

/// The third longest horizon says what three runs can tell apart: 0.75 beats in 0.5 s x 3 outputs are 0.5 Hz.
static void a_shadow_is_closer_than_three_runs_can_tell() {
    for (const double hz : {10.49, 10.51}) {
        auto runs = rate(6, 30);
        runs[0].rows = runs[3].rows = 500;
        runs[5].rows = 50;
        give(runs, 0, 6, track(10, 1e-5));
        give(runs, 1, 6, track(hz, 1e-5));
        const modes all = find_agreement(runs);
        TEST_ASSERT_DOUBLE_WITHIN(1e-12, 0.5, all[0].resolved_hz);
        TEST_ASSERT_EQUAL(hz < 10.5, has(all[1], "split"));
    }
}

/// Neither of two that agree as well is the weaker one, and one that is doubtful itself splits nobody off.
static void only_a_stronger_confident_mode_splits() {
    auto runs = rate(6, 300);
    give(runs, 0, 6, track(10, 0.01));
    give(runs, 0, 6, track(10.3, 0.01));
    for (const consensus_mode& mode : find_agreement(runs)) TEST_ASSERT_TRUE(mode.confident());
    runs = rate(6, 300);
    give(runs, 0, 6, track(10, 0.01, bending, 0.45)); // noise_shape
    give(runs, 0, 5, track(10.3, 0.01, bending, 0.4));
    TEST_ASSERT_FALSE(has(find_agreement(runs)[1], "split"));
}

static void two_outputs_split_nothing() {
    for (const std::size_t n_y : {2U, 3U}) {
        auto runs = rate(6, 300, static_cast<int>(n_y));
        const shape of(n_y, 1.0);
        give(runs, 0, 6, track(10, 0.01, of));
        give(runs, 0, 5, track(10.3, 0.01, of));
        TEST_ASSERT_EQUAL(n_y == 3, has(find_agreement(runs)[1], "split"));
    }
}

/// Values are medians over MOESP and CVA where the horizon holds 1.5 periods; the shape is that of the steadiest track.
static void values_come_from_runs_that_are_sharp() {
    auto runs = rate(8, 30);
    for (const std::size_t r : {2U, 3U, 4U}) runs[r].method = OKID_METHOD_N4SID_MOESP;
    runs[6].method = OKID_METHOD_N4SID_SSARX;
    runs[7].method = OKID_METHOD_OKID_ERA;
    runs[0].rows = 14; // 1.4 periods of 10 Hz
    const double damping[] = {0.02, 0.010, 0.011, 0.012, 0.013, 0.014, 0.02, 0.02};
    for (std::size_t r = 0; r < 8; ++r) {
        run_track one = track(10 + (r == 0 || r > 5 ? 0.08 : 0.01 * static_cast<double>(r)), damping[r]);
        one.damping_spread = r == 4 ? 0.01 : 0.02;
        one.shape[1] = 0.5 + 0.001 * static_cast<double>(r);
        give(runs, r, r + 1, one);
    }
    const consensus_mode mode = find_agreement(runs).at(0);
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, 0.012, mode.damping_ratio);
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, 10.03, mode.frequency_hz);
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, 0.504, mode.shape[1].real());
    runs[0].rows = 16; // now it is: the median of six
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, 0.0125, find_agreement(runs).at(0).damping_ratio);
}

/// Two states a mode fill three quarters of them. A mode that only half of the runs find counts, one of noise does not.
/// Of four poles the two in the middle are as near to the medians: which one gives the shape is not left to rounding.
static void the_shape_of_a_track_does_not_hang_on_rounding() {
    const auto second_entry = [](int orders, double moved) {
        consensus_run run;
        run.fs_hz = 100;
        for (int k = 0; k < orders; ++k) {
            run.orders.push_back(4 + 2 * k);
            const double by = k == 2 ? 1 + moved : 1, f = (10 + 0.004 * k) * by, zeta = (0.01 + 0.0001 * k) * by;
            run.poles.push_back({run.orders.back(), f, zeta, 1, 1, {1.0, 0.1 * k}});
        }
        link_tracks(run);
        TEST_ASSERT_EQUAL(1, run.tracks.size());
        return run.tracks.front().shape[1].real();
    };
    for (const double moved : {-1e-9, -1e-13, 0.0, 1e-13, 1e-9}) TEST_ASSERT_EQUAL_DOUBLE(0.1, second_entry(4, moved));
    TEST_ASSERT_EQUAL_DOUBLE(0.2, second_entry(5, 0));
}

static void runs_are_full_of_modes() {
    TEST_ASSERT_FALSE(are_full(24, 9));
    TEST_ASSERT_TRUE(are_full(24, 10));
    TEST_ASSERT_FALSE(are_full(24, 10, 0.79));
    TEST_ASSERT_TRUE(are_full(24, 10, 0.81));
    TEST_ASSERT_FALSE(are_full(0, 10)); // no limit, as of responses
}

/// The level is the highest rate that sees it well; the scatter is that of its subspace runs about the values.
static void level_and_scatter_are_those_of_the_highest_rate() {
    auto runs = joined(rate(4, 30, 3, 1), rate(4, 30, 3, 0));
    runs[7].method = OKID_METHOD_OKID_ERA;
    const double hz[] = {10, 10, 10, 10, 10.03, 9.96, 10, 10.09};
    for (std::size_t r = 0; r < 8; ++r) give(runs, r, r + 1, track(hz[r], r < 4 ? 0.01 : 0.001 * hz[r]));
    const consensus_mode mode = find_agreement(runs).at(0);
    TEST_ASSERT_EQUAL_INT(0, mode.level);
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, std::sqrt((0.03 * 0.03 + 0.04 * 0.04) / 3), mode.frequency_scatter_hz);
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, std::sqrt((0.03 * 0.03 + 0.04 * 0.04) / 3) / 1000, mode.damping_scatter);
}

int main() {
    UNITY_BEGIN();
    RUN_TEST(half_of_the_votes_decide);
    RUN_TEST(fewer_than_three_runs_decide_nothing);
    RUN_TEST(an_agreement_of_one_half_is_believed);
    RUN_TEST(scatter_of_damping_costs_agreement);
    RUN_TEST(one_per_cent_of_frequency_is_one_mode);
    RUN_TEST(a_mac_of_eight_tenths_is_one_mode);
    RUN_TEST(a_run_has_one_track_in_a_mode);
    RUN_TEST(a_track_goes_to_the_nearest_cluster);
    RUN_TEST(what_is_overdamped_or_out_of_band_is_no_mode);
    RUN_TEST(runs_with_too_few_periods_do_not_vote);
    RUN_TEST(what_no_run_can_see_is_not_believed);
    RUN_TEST(runs_vote_from_three_quarters_of_a_beat);
    RUN_TEST(the_six_longest_horizons_vote);
    RUN_TEST(a_neighbour_is_supported_at_one_rate);
    RUN_TEST(a_neighbour_is_another_vibration);
    RUN_TEST(split_is_closer_than_two_and_a_half_bandwidths);
    RUN_TEST(split_is_of_the_same_shape);
    RUN_TEST(split_is_within_one_per_cent);
    RUN_TEST(a_shadow_is_closer_than_three_runs_can_tell);
    RUN_TEST(only_a_stronger_confident_mode_splits);
    RUN_TEST(two_outputs_split_nothing);
    RUN_TEST(values_come_from_runs_that_are_sharp);
    RUN_TEST(the_shape_of_a_track_does_not_hang_on_rounding);
    RUN_TEST(runs_are_full_of_modes);
    RUN_TEST(level_and_scatter_are_those_of_the_highest_rate);
    return UNITY_END();
}
