// SPDX-License-Identifier: MIT
// Where a mode stops to belong to a track: the bounds of track.h in frequency and shape, and what 0 stands for.
#include "modal_rig.h"

#include <okid/track.h>
#include <unity.h>

enum { NY = 3, MODES = 3 };

static void* block;
static okid_tracks_t* tracks;
static int count, turns, filled_with = 0xff; // what stands in the block: numbers that are none
static okid_real_t f[MODES], zeta[MODES], re[MODES * NY], im[MODES * NY];
static int32_t number[MODES];

static void create(okid_track_config_t config) {
    const size_t bytes = okid_track_memsize(&config);
    TEST_ASSERT_GREATER_THAN(0, bytes);
    free(block);
    block = malloc(bytes);
    memset(block, filled_with, bytes);
    TEST_ASSERT_EQUAL(OKID_OK, okid_track_create(&tracks, &config, block, bytes));
    count = turns = 0;
}

void setUp(void) { create(okid_track_defaults(NY, MODES)); }

void tearDown(void) {
    free(block);
    block = NULL;
}

/// One more mode of the update in hand: its shape is (cos angle, i sin angle, 0), of any phase and size.
static void put(double frequency, double angle) {
    const double turn = 0.7 * ++turns, size = 1 + 0.4 * sin(3.0 * turns);
    const double shape[2][NY] = {{cos(angle) * cos(turn), -sin(angle) * sin(turn), 0},
                                 {cos(angle) * sin(turn), sin(angle) * cos(turn), 0}};
    f[count] = (okid_real_t)frequency;
    zeta[count] = (okid_real_t)0.01;
    for (int o = 0; o < NY; ++o) {
        re[count * NY + o] = (okid_real_t)(shape[0][o] * size);
        im[count * NY + o] = (okid_real_t)(shape[1][o] * size);
    }
    ++count;
}

/// One more mode whose shape is like no other.
static void put_another(double frequency) {
    put(frequency, 0);
    for (int o = 0; o < NY; ++o) re[(count - 1) * NY + o] = o == 2, im[(count - 1) * NY + o] = 0;
}

/// @return the number of the last mode
static int32_t update(void) {
    const int last = count > 0 ? count - 1 : 0;
    TEST_ASSERT_EQUAL(OKID_OK, okid_track_update(tracks, count, f, zeta, re, im, number));
    count = 0;
    return number[last];
}

/// A mode of 10 Hz and shape angle 0, seen so often.
static void settle(int times) {
    for (int k = 0; k < times; ++k) {
        put(10, 0);
        update();
    }
    TEST_ASSERT_EQUAL_INT32(1, number[0]);
}

/// ((1 - MAC) / (1 - mac))^2 of shapes at some angle.
static double unlike(double angle, double mac) { return pow(pow(sin(angle), 2) / (1 - mac), 2); }

/// A mode at the bound belongs to track 1 just within it, not just beyond it. `before` leads to where it comes.
static void assert_bound(void (*before)(void), double apart, double reach, double angle, int close) {
    for (int beyond = 0; beyond < 2; ++beyond)
        for (int below = 0; below < 2; ++below) {
            before();
            const double away = reach * apart * (beyond ? 1.003 : 0.997);
            const double frequency = 10 * (1 + (below ? -away : away));
            put_another(close ? frequency + 0.05 : 40);
            put(frequency, angle);
            TEST_ASSERT_EQUAL_INT32(beyond ? 0 : 1, update());
        }
}

static void settled(void) {
    setUp();
    settle(20);
}

static void settled_and_jumped(void) {
    settled();
    okid_track_jump(tracks);
}

static void the_next_mode_is_near_in_frequency_and_shape(void) {
    assert_bound(settled, 1, 0.05, 0, 0);
    for (double angle = 0.1; unlike(angle, 0.5) < 1; angle += 0.1)
        assert_bound(settled, sqrt(1 - unlike(angle, 0.5)), 0.05, angle, 0);
    settled();
    put(10, acos(sqrt(0.501))); // its MAC
    TEST_ASSERT_EQUAL_INT32(1, update());
    settled();
    put(10, acos(sqrt(0.499)));
    TEST_ASSERT_EQUAL_INT32(0, update());
}

static void a_jump_reaches_further_and_asks_for_more_likeness(void) {
    assert_bound(settled_and_jumped, 1, 0.3, 0, 0);
    for (double angle = 0.1; unlike(angle, 0.75) < 1; angle += 0.1)
        assert_bound(settled_and_jumped, sqrt(1 - unlike(angle, 0.75)), 0.3, angle, 0);
    settled_and_jumped();
    put(10, acos(sqrt(0.751)));
    TEST_ASSERT_EQUAL_INT32(1, update());
    settled_and_jumped();
    put(10, acos(sqrt(0.749)));
    TEST_ASSERT_EQUAL_INT32(0, update());
}

static const double turned = 0.7; // rad; MAC 0.58

static void turned_once(void) {
    settled();
    put(10, turned);
    TEST_ASSERT_EQUAL_INT32(1, update());
}

/// Angle of the mean when a shape at `turned` has come to others at 0, with the weight it gets.
static double mean_angle(double weight) { return atan2(weight * sin(turned), 1 - weight + weight * cos(turned)); }

// 0.65 are for the shape last seen, 0.35 for the mean of some ten, into which the last one has come with a tenth.
static void shape_last_seen_and_mean_share_the_distance(void) {
    const double mean = mean_angle(0.1);
    for (double angle = -0.3; angle < 0.8; angle += 0.1) {
        const double shape = 0.65 * fmin(1, unlike(turned - angle, 0.5)) + 0.35 * fmin(1, unlike(mean - angle, 0.5));
        assert_bound(turned_once, sqrt(1 - shape), 0.05, angle, 0);
    }
}

static void turned_early(void) {
    setUp();
    settle(3);
    put(10, turned);
    TEST_ASSERT_EQUAL_INT32(1, update());
}

static void the_mean_of_few_is_that_of_all_of_them(void) {
    const double mean = mean_angle(0.25); // the fourth
    assert_bound(turned_early, sqrt(1 - 0.35 * unlike(mean - turned, 0.5)), 0.05, turned, 0);
}

static void turned_and_jumped(void) {
    turned_once();
    okid_track_jump(tracks);
}

static void after_a_jump_the_likelier_of_both_shapes_counts(void) {
    const double mean = mean_angle(0.1);
    for (double angle = -0.2; angle < 0.9; angle += 0.2) {
        const double shape = fmin(unlike(turned - angle, 0.75), unlike(mean - angle, 0.75));
        if (shape < 0.95) assert_bound(turned_and_jumped, sqrt(1 - shape), 0.3, angle, 0);
    }
}

static void settled_with_close_modes(void) {
    okid_track_config_t config = okid_track_defaults(NY, MODES);
    config.close_hz = 0.1;
    create(config);
    settle(20);
}

static void turned_with_close_modes(void) {
    settled_with_close_modes();
    put(10, turned);
    TEST_ASSERT_EQUAL_INT32(1, update());
}

static void seen_close(void) {
    settled_with_close_modes();
    put_another(10.05);
    put(10, turned);
    TEST_ASSERT_EQUAL_INT32(1, update());
}

// Of a mode beside another one, or of a track last seen so, the mean says it all; what was seen so is no part of it.
static void close_modes_are_known_by_the_mean_which_waits(void) {
    const double mean = mean_angle(0.1);
    for (double angle = -0.3; angle < 0.6; angle += 0.3)
        assert_bound(turned_with_close_modes, sqrt(1 - unlike(mean - angle, 0.5)), 0.05, angle, 1);
    assert_bound(seen_close, sqrt(1 - unlike(turned, 0.5)), 0.05, turned, 0);
    assert_bound(seen_close, 1, 0.05, 0, 0);
}

/// Updates without the mode, then with it.
static int32_t number_after_absence(int updates) {
    settled();
    for (int k = 0; k < updates; ++k) {
        put_another(40);
        update();
    }
    put(10, 0);
    return update();
}

static void a_hundred_misses_end_a_track(void) {
    TEST_ASSERT_EQUAL_INT32(1, number_after_absence(99));
    TEST_ASSERT_EQUAL_INT32(0, number_after_absence(100));
}

static void three_hits_in_a_row_make_one(void) {
    for (int k = 0; k < 3; ++k) {
        put(10, 0);
        TEST_ASSERT_EQUAL_INT32(k < 2 ? 0 : 1, update());
    }
}

// A track lost as long ago as its successor exists is one with it, with all its hits; one lost later is another mode.
static void a_candidate_goes_on_with_what_was_lost_before_it(void) {
    for (int shared = 0; shared < 3; ++shared) {
        setUp();
        settle(5);
        for (int k = 0; k < 3; ++k) {
            put(12, 0);
            if (k < shared) put(10, 0);
            update();
        }
        TEST_ASSERT_EQUAL_INT32(shared < 2 ? 1 : 2, number[0]);
        TEST_ASSERT_EQUAL_INT32(shared < 2 ? 1 : 2, okid_track_count(tracks));
        okid_track_t known;
        TEST_ASSERT_EQUAL(OKID_OK, okid_track_get(tracks, 0, &known));
        TEST_ASSERT_EQUAL_INT32(shared < 2 ? 8 + shared : 7, known.hits);
        TEST_ASSERT_EQUAL_INT32(shared < 2 ? 0 : 1, known.misses);
        TEST_ASSERT_DOUBLE_WITHIN(1e-5, shared < 2 ? 12 : 10, known.frequency_hz);
        TEST_ASSERT_DOUBLE_WITHIN(1e-8, 0.01, known.damping_ratio);
    }
}

static void a_candidate_that_is_not_seen_is_none(void) {
    put(10, 0);
    put_another(20);
    update();
    TEST_ASSERT_EQUAL_INT32(2, okid_track_count(tracks));
    put(10, 0);
    update();
    TEST_ASSERT_EQUAL_INT32(1, okid_track_count(tracks));
    update();
    TEST_ASSERT_EQUAL_INT32(0, okid_track_count(tracks));
}

/// Modes that come, go and change, some of them close, and jumps. @return a sum of all that is said of them
static uint64_t story(int fill) {
    uint64_t seed = 5, sum = 0;
    filled_with = fill;
    okid_track_config_t config = {.n_y = NY, .max_modes = MODES, .max_tracks = 5, .dies = 4, .close_hz = 0.3};
    create(config);
    for (int k = 0; k < 400; ++k) {
        if (k % 23 == 0) okid_track_jump(tracks);
        for (int m = 0; m < MODES; ++m)
            if (rig_uniform(&seed) > 0.2) put(10 + m + 0.5 * rig_uniform(&seed), m + 0.6 * rig_uniform(&seed));
        const int modes = count;
        update();
        for (int m = 0; m < modes; ++m) sum = sum * 31 + (uint64_t)number[m];
        for (int j = 0; j < okid_track_count(tracks); ++j) {
            okid_track_t known;
            TEST_ASSERT_EQUAL(OKID_OK, okid_track_get(tracks, j, &known));
            sum = sum * 31 + (uint64_t)(known.number + 7 * known.hits + 11 * known.misses);
        }
    }
    return sum;
}

static void what_stood_in_the_block_is_not_seen(void) {
    const uint64_t first = story(0xff);
    TEST_ASSERT_EQUAL_UINT64(first, story(0));
    TEST_ASSERT_EQUAL_UINT64(first, story(1));
}

int main(void) {
    UNITY_BEGIN();
    RUN_TEST(the_next_mode_is_near_in_frequency_and_shape);
    RUN_TEST(a_jump_reaches_further_and_asks_for_more_likeness);
    RUN_TEST(shape_last_seen_and_mean_share_the_distance);
    RUN_TEST(the_mean_of_few_is_that_of_all_of_them);
    RUN_TEST(after_a_jump_the_likelier_of_both_shapes_counts);
    RUN_TEST(close_modes_are_known_by_the_mean_which_waits);
    RUN_TEST(a_hundred_misses_end_a_track);
    RUN_TEST(three_hits_in_a_row_make_one);
    RUN_TEST(a_candidate_goes_on_with_what_was_lost_before_it);
    RUN_TEST(a_candidate_that_is_not_seen_is_none);
    RUN_TEST(what_stood_in_the_block_is_not_seen);
    return UNITY_END();
}
