// SPDX-License-Identifier: MIT
// Poles written by hand: which of them are one track of a run, what the track tells, and which tracks come first.
#include "hand_made_tracks.hpp"

#include <algorithm>
#include <cmath>
#include <unity.h>

using namespace okid_host;

namespace {

constexpr double degree = M_PI / 180;

shape turned_by(double degrees) { return {std::cos(degrees * degree), std::sin(degrees * degree), 0.0}; }

run_pole pole(double frequency_hz, double damping_ratio, const shape& of = bending) {
    return {0, frequency_hz, damping_ratio, 1, 1, of};
}

/// The tracks of a run with so many orders from 4 on, two apart; at place k of `poles` those of the k-th order.
std::vector<run_track> linked(int orders, const std::vector<std::vector<run_pole>>& poles) {
    consensus_run run;
    run.fs_hz = 100;
    for (int k = 0; k < orders; ++k) run.orders.push_back(4 + 2 * k);
    for (std::size_t k = 0; k < poles.size(); ++k)
        for (run_pole one : poles[k]) {
            one.order = run.orders[k];
            run.poles.push_back(one);
        }
    link_tracks(run);
    return run.tracks;
}

/// One pole at two orders, the other at the next two: are they the same vibration?
bool same(const run_pole& first, const run_pole& then) {
    return linked(4, {{first}, {first}, {then}, {then}}).size() == 1;
}

/// A pole of 10 Hz, 1 % at two orders, then two poles: does the track go on with the first of them?
bool goes_on_with(const run_pole& first, const run_pole& second) {
    const run_pole begun = pole(10, 0.01, turned_by(0));
    const auto tracks = linked(4, {{begun}, {begun}, {first, second}, {first, second}});
    TEST_ASSERT_EQUAL_UINT64(1, tracks.size());
    const auto half_way = [&](const run_pole& to) {
        return std::abs(tracks[0].frequency_hz - (10 + to.frequency_hz) / 2);
    };
    TEST_ASSERT_TRUE(std::min(half_way(first), half_way(second)) < 1e-12);
    return half_way(first) < half_way(second);
}

/// Tracks at 10 Hz with shapes 0, 22 and 44 degrees apart: those at the ends are one mode only by way of the middle one.
std::size_t modes_with(const run_track& end, const run_track& middle, bool middle_sees = true) {
    auto runs = rate(6, 30);
    for (std::size_t r = 0; r < 6; ++r) {
        run_track one = r % 3 == 1 ? middle : end;
        one.shape = turned_by(22.0 * static_cast<double>(r % 3));
        give(runs, r, r + 1, one);
        if (r % 3 == 1 && !middle_sees) runs[r].rows = 7; // 0.7 periods
    }
    return find_agreement(runs).size();
}

run_track ranked(double damping_spread, double frequency_spread, int length) {
    run_track out = track(10, 0.01);
    out.damping_spread = damping_spread;
    out.frequency_spread = frequency_spread;
    out.length = length;
    return out;
}

} // namespace

void setUp() {}
void tearDown() {}

/// One per cent, or the smaller damping ratio where that is more; never three per cent.
static void a_track_goes_on_near_its_frequency() {
    const struct {
        double damping, then, most;
    } cases[] = {
        {0.001, 0.001, 0.01}, {0.02, 0.02, 0.02}, {0.02, 0.015, 0.015}, {0.015, 0.02, 0.015}, {0.2, 0.2, 0.03}};
    for (const auto& [damping, then, most] : cases)
        for (const double way : {-1.0, 1.0}) {
            TEST_ASSERT_TRUE(same(pole(10, damping), pole(10 * (1 + way * (most - 1e-4)), then)));
            TEST_ASSERT_FALSE(same(pole(10, damping), pole(10 * (1 + way * (most + 1e-4)), then)));
        }
    // a folded band, of half the rate
    TEST_ASSERT_TRUE(same(pole(430, 0.0001), pole(430.49, 0.0001)));
    TEST_ASSERT_FALSE(same(pole(430, 0.0001), pole(430.51, 0.0001)));
}

/// Three tenths of the larger damping ratio, or a thousandth.
static void a_track_goes_on_near_its_damping() {
    const struct {
        double one, other;
        bool are_same;
    } cases[] = {{0.01, 0.0142, true}, {0.01, 0.0144, false}, {0.0001, 0.00105, true}, {0.0001, 0.00115, false}};
    for (const auto& [one, other, are_same] : cases) {
        TEST_ASSERT_EQUAL(are_same, same(pole(10, one), pole(10, other)));
        TEST_ASSERT_EQUAL(are_same, same(pole(10, other), pole(10, one)));
    }
    TEST_ASSERT_TRUE(same(pole(10, 0.249), pole(10, 0.249)) && !same(pole(10, 0.251), pole(10, 0.251)));
    TEST_ASSERT_TRUE(same(pole(10, 2e-7), pole(10, 2e-7)) && !same(pole(10, 5e-8), pole(10, 5e-8)));
}

static void a_track_keeps_its_shape() {
    TEST_ASSERT_TRUE(same(pole(10, 0.01, turned_by(0)), pole(10, 0.01, turned_by(18))));  // MAC 0.905
    TEST_ASSERT_FALSE(same(pole(10, 0.01, turned_by(0)), pole(10, 0.01, turned_by(19)))); // 0.894
}

/// Four orders, and two fifths of those from its first on; missing for eight states it goes on, for ten it does not.
static void a_track_is_long_enough() {
    const std::vector<run_pole> some = {pole(10, 0.01)}, none;
    TEST_ASSERT_EQUAL_UINT64(0, linked(3, {some, some, some}).size());
    TEST_ASSERT_EQUAL_UINT64(1, linked(4, {some, some, some, some}).size());
    TEST_ASSERT_EQUAL_UINT64(1, linked(10, {some, some, some, some}).size());
    TEST_ASSERT_EQUAL_UINT64(0, linked(11, {some, some, some, some}).size());
    TEST_ASSERT_EQUAL_UINT64(1, linked(11, {none, some, some, some, some}).size());
    TEST_ASSERT_EQUAL_UINT64(1, linked(7, {some, some, none, none, none, some, some}).size());
    TEST_ASSERT_EQUAL_UINT64(0, linked(8, {some, some, none, none, none, none, some, some}).size());
}

/// Distance: of frequency in hundredths, five times what the MAC lacks, of damping in shares of the larger.
static void the_nearest_pole_goes_on() {
    const run_pole off = pole(10.04, 0.01, turned_by(0));                   // 0.4
    TEST_ASSERT_TRUE(goes_on_with(pole(10.02, 0.01, turned_by(0)), off));   // 0.2
    TEST_ASSERT_TRUE(goes_on_with(pole(10, 0.01, turned_by(16)), off));     // 0.38
    TEST_ASSERT_FALSE(goes_on_with(pole(10, 0.01, turned_by(17)), off));    // 0.43
    const run_pole near = pole(10.025, 0.01, turned_by(0));                 // 0.25
    TEST_ASSERT_TRUE(goes_on_with(pole(10, 0.0131, turned_by(0)), near));   // 0.24
    TEST_ASSERT_FALSE(goes_on_with(pole(10, 0.0136, turned_by(0)), near));  // 0.26
    TEST_ASSERT_FALSE(goes_on_with(pole(10, 0.0074, turned_by(0)), near));  // 0.26
    TEST_ASSERT_TRUE(goes_on_with(near, pole(9.974, 0.01, turned_by(0))));  // 0.26
    TEST_ASSERT_TRUE(goes_on_with(pole(9.99, 0.0098, turned_by(5)), near)); // 0.1 + 0.04 + 0.02
}

/// Two tracks and one pole that both could take: the nearer one does, the other goes on behind it.
static void a_pole_belongs_to_one_track() {
    const run_pole low = pole(10, 0.001), high = pole(10.06, 0.001), between = pole(10.02, 0.001);
    const auto tracks = linked(5, {{low, high}, {low, high}, {between}, {low, high}, {low, high}});
    TEST_ASSERT_EQUAL_UINT64(2, tracks.size());
    for (const run_track& one : tracks) TEST_ASSERT_EQUAL_INT(one.frequency_hz < 10.03 ? 5 : 4, one.length);
}

static void a_track_tells_medians_and_spreads() {
    std::vector<std::vector<run_pole>> poles;
    for (int k = 0; k < 4; ++k)
        poles.push_back({{0, 10 + 0.02 * k, 0.01 + 0.001 * k, 0.9 + 0.01 * k, 0.8 - 0.02 * k, bending}});
    const run_track one = linked(4, poles).at(0);
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, 10.03, one.frequency_hz);
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, 0.0115, one.damping_ratio);
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, 0.915, one.mpc);
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, 0.77, one.emac);
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, std::sqrt(5.0) / 2 * 0.02 / 10.03, one.frequency_spread); // of 0, 1, 2, 3
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, std::sqrt(5.0) / 2 * 0.001 / 0.0115, one.damping_spread);
    TEST_ASSERT_EQUAL_INT(4, one.length);
    TEST_ASSERT_TRUE(one.orders == std::vector<int>({4, 6, 8, 10}));
}

/// The first track of a mode is what the others are compared with: one that is seen, then steady ones, then long ones. A
/// spread of frequency counts a hundred times one of damping, an order a fiftieth.
static void steady_and_long_tracks_come_first() {
    const run_track end = ranked(0.1, 0.001, 10);
    TEST_ASSERT_EQUAL_UINT64(1, modes_with(end, ranked(0.09, 0.001, 10)));
    TEST_ASSERT_EQUAL_UINT64(2, modes_with(end, ranked(0.11, 0.001, 10)));
    TEST_ASSERT_EQUAL_UINT64(1, modes_with(end, ranked(0.19, 0, 10)));
    TEST_ASSERT_EQUAL_UINT64(2, modes_with(end, ranked(0.21, 0, 10)));
    TEST_ASSERT_EQUAL_UINT64(1, modes_with(end, ranked(0.19, 0.001, 15)));
    TEST_ASSERT_EQUAL_UINT64(2, modes_with(end, ranked(0.21, 0.001, 15)));
    TEST_ASSERT_EQUAL_UINT64(2, modes_with(end, ranked(0, 0, 30), false));
}

int main() {
    UNITY_BEGIN();
    RUN_TEST(a_track_goes_on_near_its_frequency);
    RUN_TEST(a_track_goes_on_near_its_damping);
    RUN_TEST(a_track_keeps_its_shape);
    RUN_TEST(a_track_is_long_enough);
    RUN_TEST(the_nearest_pole_goes_on);
    RUN_TEST(a_pole_belongs_to_one_track);
    RUN_TEST(a_track_tells_medians_and_spreads);
    RUN_TEST(steady_and_long_tracks_come_first);
    return UNITY_END();
}
