// SPDX-License-Identifier: MIT
// Which tracks of which runs make a mode, on tracks written by hand: each bound of the decision from both sides.
#include "consensus/quantity.hpp"
#include "hand_made_tracks.hpp"

#include <algorithm>
#include <cmath>
#include <unity.h>

using namespace okid_host;

namespace {

/// One mode at 10 Hz in so many of six runs.
consensus_mode found_by(std::size_t runs_with, double emac = 1, double damping_scatter = 0) {
    auto runs = rate(6, 30, 3);
    for (std::size_t r = 0; r < runs_with; ++r)
        runs[r].tracks.push_back(track(10, 0.01 * (1 + (r % 2 ? damping_scatter : -damping_scatter)), bending, emac));
    const auto modes = find_agreement(runs);
    TEST_ASSERT_EQUAL_UINT64(1, modes.size());
    return modes[0];
}

} // namespace

void setUp() {}
void tearDown() {}

static void half_of_the_runs_make_a_mode() {
    TEST_ASSERT_TRUE(found_by(6).confident());
    TEST_ASSERT_TRUE(found_by(4).confident());
    TEST_ASSERT_TRUE(found_by(3).found_in == 0.5 && !has(found_by(3), "few_runs"));
    TEST_ASSERT_TRUE(has(found_by(2), "few_runs"));
}

static void a_short_lived_or_scattering_pole_is_noise() {
    TEST_ASSERT_TRUE(found_by(6, 0.55).confident());
    TEST_ASSERT_TRUE(has(found_by(6, 0.45), "noise_shape"));
    TEST_ASSERT_TRUE(found_by(6, 1, 0.25).confident());
    TEST_ASSERT_TRUE(has(found_by(6, 1, 0.45), "noise_shape"));
}

/// It falls to a seventh in 1.3 s: at the end of 2.4 s little is left, at that of 0.3 s all. Only a force makes that a decay.
static void what_dies_away_is_judged_where_it_lasts() {
    for (const int inputs : {0, 1}) {
        auto runs = rate(4, 30, 3);
        give(runs, 0, 4, track(4, 0.06, bending, 0.95));
        const auto lower = rate(8, 30, 3, 3, 12.5);
        runs.insert(runs.end(), lower.begin(), lower.end());
        give(runs, 4, 12, track(4, 0.06, bending, 0.1));
        for (consensus_run& run : runs) run.inputs = inputs;
        const auto modes = find_agreement(runs);
        TEST_ASSERT_EQUAL_UINT64(1, modes.size());
        TEST_ASSERT_EQUAL(inputs == 1, modes[0].confident());
        TEST_ASSERT_EQUAL(inputs == 0, has(modes[0], "noise_shape"));
    }
}

/// One pole to order 28, from 32 on two, one on either side: the first was both. If they have one shape it may be the mode.
static void a_pole_that_higher_orders_resolve_is_none() {
    for (const bool alike : {false, true}) {
        consensus_run run = rate(1, 17, 3, 0, 256)[0];
        run.orders = consensus_orders(64);
        const shape both = {1.0, 0.0, 0.0};
        for (const int order : run.orders) {
            if (order <= 28) run.poles.push_back({order, 31.08, 0.022, 0.8, 0.8, both});
            if (order >= 32) run.poles.push_back({order, 30.92, 0.022, 1, 1, bending});
            if (order >= 32) run.poles.push_back({order, 31.40, 0.016, 1, 1, alike ? bending : torsion});
        }
        link_tracks(run);
        const auto merged = std::count_if(run.tracks.begin(), run.tracks.end(),
                                          [](const run_track& found) { return found.orders.back() <= 28; });
        TEST_ASSERT_EQUAL_UINT64(alike ? 3 : 2, run.tracks.size());
        TEST_ASSERT_EQUAL_INT(alike ? 1 : 0, merged);
    }
}

/// Two modes of one output, 0.8 Hz apart: a horizon of 0.3 s sees one pole between them, one of 2.4 s sees both.
static void only_runs_that_can_part_two_modes_vote_on_them() {
    auto runs = rate(6, 30, 1);
    give(runs, 0, 6, track(10.4, 0.06, {1.0}));
    const auto lower = rate(6, 30, 1, 3, 12.5);
    runs.insert(runs.end(), lower.begin(), lower.end());
    give(runs, 6, 12, track(4.0, 0.004, {1.0}));
    give(runs, 6, 12, track(4.8, 0.004, {1.0}));
    const auto middle = rate(6, 30, 1, 1, 50); // 0.6 s
    runs.insert(runs.end(), middle.begin(), middle.end());
    for (const consensus_mode& mode : find_agreement(runs))
        if (mode.frequency_hz < 5) {
            TEST_ASSERT_EQUAL_INT(6, mode.could);
            TEST_ASSERT_TRUE(mode.confident());
        }
}

/// The same horizons, three outputs: a shape of its own is told from the other's where time alone does not part them.
static void other_shapes_part_two_modes() {
    for (const bool alike : {true, false}) {
        auto runs = rate(6, 30, 3);
        const auto lower = rate(6, 30, 3, 3, 12.5);
        runs.insert(runs.end(), lower.begin(), lower.end());
        give(runs, 0, 12, track(4.0, 0.004, bending));
        give(runs, 0, 12, track(4.3, 0.004, alike ? bending : torsion));
        const auto modes = find_agreement(runs);
        TEST_ASSERT_EQUAL_UINT64(2, modes.size());
        for (const consensus_mode& mode : modes) TEST_ASSERT_EQUAL_INT(alike ? 6 : 12, mode.could);
    }
}

static void the_longest_horizons_vote_where_none_can_part() {
    auto runs = rate(6, 30, 1);
    give(runs, 0, 6, track(10, 0.001, {1.0}));
    give(runs, 0, 2, track(10.3, 0.001, {1.0})); // of six runs, none of which can
    const auto modes = find_agreement(runs);
    TEST_ASSERT_EQUAL_UINT64(2, modes.size());
    TEST_ASSERT_EQUAL_INT(6, modes[1].could);
    TEST_ASSERT_TRUE(modes[0].confident() && !modes[1].confident());
}

/// Two of one shape are one mode where their half-power bands touch, or where fewer than nine tenths of the runs see both; of
/// other shapes they are two, and one output cannot tell.
static void a_close_pair_is_split_only_by_its_shapes() {
    for (const double apart_hz : {0.19, 0.21})
        for (const bool alike : {true, false})
            for (const std::size_t both : {8U, 9U}) {
                auto runs = rate(10, 200, 3);
                give(runs, 0, 10, track(10, 0.01, bending));
                give(runs, 0, both, track(10 + apart_hz, 0.01, alike ? bending : torsion, 0.9));
                const auto modes = find_agreement(runs);
                TEST_ASSERT_EQUAL_UINT64(2, modes.size());
                TEST_ASSERT_TRUE(modes[0].confident());
                TEST_ASSERT_EQUAL(alike && (apart_hz < 0.2 || both < 9), has(modes[1], "split"));
            }
    auto runs = rate(6, 300, 1);
    give(runs, 0, 6, track(10, 0.01, {1.0}));
    give(runs, 0, 5, track(10.3, 0.01, {1.0}));
    for (const consensus_mode& mode : find_agreement(runs)) TEST_ASSERT_TRUE(mode.confident());
}

/// Two of a bell, 0.05 % apart at a damping ratio of 2e-5 and much alike: noise exchanges their shapes, not their frequencies,
/// between runs and from order to order. One run of three has a pole between them.
static void doublets_keep_their_frequencies() {
    const double f = 800, split = 0.4, zeta = 2e-5;
    const shape one = {1.0, 0.9, 0.2}, near = {1.0, 0.8, 0.4}, other = {1.0, 0.5, 0.5};
    auto runs = rate(9, 4000, 3, 0, 2000);
    give(runs, 0, 4, track(f, zeta, one));
    give(runs, 0, 4, track(f + split, zeta, other));
    give(runs, 4, 6, track(f, zeta, other));
    give(runs, 4, 6, track(f + split, zeta, one));
    give(runs, 6, 9, track(f + 0.3 * split, 2 * zeta, one, 0.9));
    std::vector<double> found;
    for (const consensus_mode& mode : find_agreement(runs))
        if (mode.confident()) found.push_back(mode.frequency_hz);
    TEST_ASSERT_EQUAL_UINT64(2, found.size());
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, f, std::min(found[0], found[1]));
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, f + split, std::max(found[0], found[1]));
    consensus_run run = rate(1, 4000, 3, 0, 2000)[0];
    run.orders = consensus_orders(24);
    for (const int order : run.orders) {
        const bool exchanged = order % 4 == 0;
        run.poles.push_back({order, f, zeta, 1, 1, exchanged ? near : one});
        run.poles.push_back({order, f + split, zeta, 1, 1, exchanged ? one : near});
    }
    link_tracks(run);
    TEST_ASSERT_EQUAL_UINT64(2, run.tracks.size());
    for (const run_track& t : run.tracks) TEST_ASSERT_TRUE(t.frequency_spread < 1e-9);
}

/// Five runs see both of two, the upper one first; the steadiest sees the lower alone. That one is the mode of all six.
static void a_track_is_no_member_where_its_run_has_a_nearer_one() {
    auto runs = rate(6, 4000, 3, 0, 2000);
    run_track lower = track(800, 2e-5), upper = track(800.4, 2e-5);
    lower.length = 20;
    give(runs, 0, 1, lower);
    upper.length = 15;
    give(runs, 1, 6, upper);
    lower.length = 10;
    give(runs, 1, 6, lower);
    const auto modes = find_agreement(runs);
    TEST_ASSERT_EQUAL_UINT64(2, modes.size());
    for (const consensus_mode& mode : modes) TEST_ASSERT_EQUAL_INT(mode.frequency_hz < 800.2 ? 6 : 5, mode.hits);
}

/// Beside a stronger mode of the same shape, further off than its bandwidth, but no run can tell one from the other.
static void a_shadow_of_a_mode_is_split() {
    auto runs = rate(6, 30, 3); // 0.3 s x 3 outputs x 0.5 Hz = 0.45 beats
    give(runs, 0, 6, track(10, 0.001, bending));
    give(runs, 0, 5, track(10.5, 0.001, bending));
    auto modes = find_agreement(runs);
    TEST_ASSERT_TRUE(modes[0].confident() && has(modes[1], "split"));
    runs = rate(6, 60, 3); // 0.9 beats
    give(runs, 0, 6, track(10, 0.001, bending));
    give(runs, 0, 5, track(10.5, 0.001, bending));
    modes = find_agreement(runs);
    TEST_ASSERT_TRUE(modes[0].confident() && modes[1].confident());
}

/// A slow mode: three quarters of a period for one output, less where several look together.
static void the_horizon_holds_a_mode() {
    TEST_ASSERT_TRUE(can_see(rate(6, 30, 1)[0], 2.51) && !can_see(rate(6, 30, 1)[0], 2.49));
    TEST_ASSERT_TRUE(can_see(rate(6, 30, 6)[0], 1.26) && !can_see(rate(6, 30, 6)[0], 1.24));
    TEST_ASSERT_TRUE(can_see(rate(6, 30, 60)[0], 1.01) && !can_see(rate(6, 30, 60)[0], 0.99));
    TEST_ASSERT_TRUE(can_see(rate(6, 30, 1)[0], 41.9) && !can_see(rate(6, 30, 1)[0], 42.1));
}

/// Outputs 1 and 3 measure accelerations, 2 a velocity; the structure has normal modes.
static void velocities_beside_accelerations_are_no_noise() {
    const std::complex<double> i(0, 1);
    const std::vector<double> hz = {4, 9, 15}, real[] = {{1, 0.6, 0.3}, {1, -0.7, -0.5}, {0.4, 0.9, 1}};
    auto runs = rate(6, 60, 3);
    for (std::size_t k = 0; k < 3; ++k) {
        shape of = {real[k][0], real[k][1], real[k][2]};
        of[1] *= -i;
        give(runs, 0, 4, track(hz[k], 0.01, of, 1, shape_collinearity(of, {})));
    }
    for (const consensus_mode& mode : find_agreement(runs)) TEST_ASSERT_TRUE(mode.mpc < 0.6);
    std::vector<bool> turned;
    for (const consensus_mode& mode : find_agreement(runs, &turned)) {
        TEST_ASSERT_TRUE(mode.confident());
        TEST_ASSERT_DOUBLE_WITHIN(1e-12, 1, mode.mpc);
    }
    TEST_ASSERT_TRUE(turned == std::vector<bool>({false, true, false}));
}

static void complex_modes_are_not_turned() {
    const std::complex<double> i(0, 1);
    TEST_ASSERT_TRUE(
        turned_outputs(
            {{1.0, 0.5 + 0.4 * i, -0.3 + 0.5 * i}, {1.0, -0.6 + 0.5 * i, 0.2 - 0.8 * i}, {0.7, 1.0 + 0.0 * i, 0.5 * i}})
            .empty());
    TEST_ASSERT_TRUE(turned_outputs({bending, torsion}).empty());
}

/// Folding keeps the decay, and gives back what was folded; 430 Hz at 100 samples a second stands at 30 Hz, 380 Hz mirrored at 20.
static void a_folded_band_keeps_decays() {
    for (const double f : {430.0, 380.0}) {
        const zoom_band zoom{100, static_cast<int>(f / 50)};
        double frequency = f, damping = 0.01;
        zoom.fold(frequency, damping);
        TEST_ASSERT_DOUBLE_WITHIN(0.5, f == 430 ? 30 : 20, frequency);
        TEST_ASSERT_DOUBLE_WITHIN(1e-9, f * 0.01, frequency * damping);
        zoom.unfold(frequency, damping);
        TEST_ASSERT_DOUBLE_WITHIN(1e-9, f, frequency);
        TEST_ASSERT_DOUBLE_WITHIN(1e-12, 0.01, damping);
    }
}

int main() {
    UNITY_BEGIN();
    RUN_TEST(half_of_the_runs_make_a_mode);
    RUN_TEST(a_short_lived_or_scattering_pole_is_noise);
    RUN_TEST(what_dies_away_is_judged_where_it_lasts);
    RUN_TEST(a_pole_that_higher_orders_resolve_is_none);
    RUN_TEST(only_runs_that_can_part_two_modes_vote_on_them);
    RUN_TEST(other_shapes_part_two_modes);
    RUN_TEST(the_longest_horizons_vote_where_none_can_part);
    RUN_TEST(a_close_pair_is_split_only_by_its_shapes);
    RUN_TEST(doublets_keep_their_frequencies);
    RUN_TEST(a_track_is_no_member_where_its_run_has_a_nearer_one);
    RUN_TEST(a_shadow_of_a_mode_is_split);
    RUN_TEST(the_horizon_holds_a_mode);
    RUN_TEST(velocities_beside_accelerations_are_no_noise);
    RUN_TEST(complex_modes_are_not_turned);
    RUN_TEST(a_folded_band_keeps_decays);
    return UNITY_END();
}
