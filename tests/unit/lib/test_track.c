// SPDX-License-Identifier: MIT
// Modes keep their numbers: over scatter, absence, crossing, jumps; noise gets none; the assignment is the best one.
#include "modal_rig.h"

#include <okid/okid.h>
#include <unity.h>

enum { NY = 3, MODES = 8, TRACKS = 16 };

static void* block;
static okid_tracks_t* tracks;
static int count;
static okid_real_t f[MODES], zeta[MODES], re[MODES * NY], im[MODES * NY];
static int32_t number[MODES];

static void create(int n_y, int most_tracks, int dies) {
    const okid_track_config_t c = {.n_y = n_y, .max_modes = MODES, .max_tracks = most_tracks, .dies = dies};
    const size_t bytes = okid_track_memsize(&c);
    TEST_ASSERT_GREATER_THAN(0, bytes);
    free(block);
    block = malloc(bytes);
    TEST_ASSERT_EQUAL(OKID_ERR_MEMORY, okid_track_create(&tracks, &c, block, bytes - 1));
    TEST_ASSERT_EQUAL(OKID_OK, okid_track_create(&tracks, &c, block, bytes));
    count = 0;
}

void setUp(void) { create(NY, TRACKS, 0); }

void tearDown(void) {
    free(block);
    block = NULL;
}

/// One more mode of the update in hand. Shapes of different kinds are orthogonal, turned by any angle.
static void put(double frequency, int kind, double angle) {
    f[count] = (okid_real_t)frequency;
    zeta[count] = (okid_real_t)0.01;
    for (int o = 0; o < NY; ++o) {
        re[count * NY + o] = (okid_real_t)((o == kind) * cos(angle));
        im[count * NY + o] = (okid_real_t)((o == kind) * sin(angle));
    }
    ++count;
}

static void update(void) {
    TEST_ASSERT_EQUAL(OKID_OK, okid_track_update(tracks, count, f, zeta, re, im, number));
    count = 0;
}

static void three_modes(double scale) {
    put(10 * scale, 0, 0.3);
    put(20 * scale, 1, 1.0);
    put(40 * scale, 2, 2.0);
}

static void expect(int a, int b, int c) {
    TEST_ASSERT_EQUAL_INT(a, number[0]);
    TEST_ASSERT_EQUAL_INT(b, number[1]);
    TEST_ASSERT_EQUAL_INT(c, number[2]);
}

static void settle(void) {
    for (int k = 0; k < 3; ++k) {
        three_modes(1);
        update();
    }
    expect(1, 2, 3);
}

static void born_after_three_hits_in_a_row(void) {
    three_modes(1);
    update();
    expect(0, 0, 0);
    put(10, 0, 0); // the others are absent: they start again
    update();
    for (int k = 0; k < 2; ++k) {
        three_modes(1);
        update();
        TEST_ASSERT_EQUAL_INT(1, number[0]);
        TEST_ASSERT_EQUAL_INT(0, number[1]);
    }
    three_modes(1);
    update();
    TEST_ASSERT_EQUAL_INT(1, number[0]);
    TEST_ASSERT_TRUE(number[1] > 1 && number[2] > 1 && number[1] != number[2]);
    okid_track_t known;
    TEST_ASSERT_EQUAL_INT(3, okid_track_count(tracks));
    int hits = 0;
    for (int k = 0; k < 3; ++k) {
        TEST_ASSERT_EQUAL(OKID_OK, okid_track_get(tracks, k, &known));
        if (known.number == 1) hits = known.hits;
    }
    TEST_ASSERT_EQUAL_INT(5, hits);
    TEST_ASSERT_EQUAL(OKID_ERR_DIM, okid_track_get(tracks, 3, &known));
}

static void absence_is_survived_and_does_not_number_anew(void) {
    settle();
    for (int k = 0; k < 99; ++k) {
        put(10, 0, 0);
        put(40, 2, 0);
        update();
        TEST_ASSERT_EQUAL_INT(1, number[0]);
        TEST_ASSERT_EQUAL_INT(3, number[1]);
    }
    three_modes(1.001);
    update();
    expect(1, 2, 3);
}

static void after_many_misses_it_ends(void) {
    create(NY, TRACKS, 5);
    settle();
    for (int k = 0; k < 5; ++k) {
        put(10, 0, 0);
        update();
    }
    for (int k = 0; k < 3; ++k) {
        put(10, 0, 0);
        put(20, 1, 0);
        update();
    }
    TEST_ASSERT_EQUAL_INT(1, number[0]);
    TEST_ASSERT_GREATER_THAN(3, number[1]); // its number is not given again
}

static void close_modes_that_swap_order_keep_their_identity(void) {
    for (int k = 0; k < 40; ++k) {
        const double shift = 0.002 * (k - 20); // they cross at k = 20
        const double a = 10 + shift, b = 10 - shift;
        if (a < b) {
            put(a, 0, k);
            put(b, 1, -k);
        } else {
            put(b, 1, -k);
            put(a, 0, k);
        }
        update();
        if (k < 3) continue;
        TEST_ASSERT_EQUAL_INT(k < 20 ? 1 : 2, number[0]);
        TEST_ASSERT_EQUAL_INT(k < 20 ? 2 : 1, number[1]);
    }
}

// A second pole near a mode: the mode keeps its track by being nearer, and no track has two modes.
static void the_assignment_is_the_best(void) {
    settle();
    put(9.8, 0, 0);
    put(10.02, 0, 0);
    put(20, 1, 0);
    put(40, 2, 0);
    update();
    TEST_ASSERT_EQUAL_INT(0, number[0]);
    TEST_ASSERT_EQUAL_INT(1, number[1]);
    // All moved by less than the gap between them: nearest-first would give one away.
    create(1, TRACKS, 0);
    for (int k = 0; k < 3; ++k) {
        for (int m = 0; m < 4; ++m)
            f[m] = (okid_real_t)(10 + 0.2 * m), zeta[m] = (okid_real_t)0.01, re[m] = 1, im[m] = 0;
        TEST_ASSERT_EQUAL(OKID_OK, okid_track_update(tracks, 4, f, zeta, re, im, number));
    }
    for (int m = 0; m < 4; ++m) f[m] += (okid_real_t)0.12;
    TEST_ASSERT_EQUAL(OKID_OK, okid_track_update(tracks, 4, f, zeta, re, im, number));
    for (int m = 1; m < 4; ++m) TEST_ASSERT_EQUAL_INT(number[m - 1] + 1, number[m]);
}

static void a_jump_is_followed_by_the_shape(void) {
    settle();
    for (int k = 0; k < 3; ++k) {
        three_modes(0.85);
        update();
        if (k < 2) expect(0, 0, 0);
    }
    expect(1, 2, 3);
    put(8.5, 0, 0); // the last update in which the old one was seen can be the first of the new one
    put(17, 1, 0);
    put(34, 2, 0);
    put(19, 1, 0);
    update();
    for (int k = 0; k < 2; ++k) {
        put(8.5, 0, 0);
        put(34, 2, 0);
        put(19, 1, 0);
        update();
    }
    TEST_ASSERT_EQUAL_INT(2, number[2]);
    for (int k = 0; k < 3; ++k) { // another shape at a frequency that was lost is another mode
        put(8.5, 0, 0);
        put(14, 0, 0);
        put(34, 2, 0);
        update();
    }
    TEST_ASSERT_EQUAL_INT(1, number[0]);
    TEST_ASSERT_GREATER_THAN(3, number[1]);
    TEST_ASSERT_EQUAL_INT(3, number[2]);
}

/// So many updates of three modes with a fourth at 8 Hz, and so many without the one at 10 Hz. @return number of the one at 8 Hz
static int stood_beside(int both, int alone, int kind) {
    settle();
    for (int k = 0; k < both; ++k) {
        three_modes(1);
        put(8, kind, 0.5);
        update();
        expect(1, 2, 3);
        TEST_ASSERT_EQUAL_INT(k < 2 ? 0 : 4, number[3]);
    }
    for (int k = 0; k < alone; ++k) {
        put(8, kind, 0.5);
        put(20, 1, 1);
        put(40, 2, 2);
        update();
        TEST_ASSERT_EQUAL_INT(2, number[1]);
        TEST_ASSERT_EQUAL_INT(3, number[2]);
    }
    return number[0];
}

static void a_mode_that_stood_beside_itself_keeps_its_number(void) {
    TEST_ASSERT_EQUAL_INT(4, stood_beside(40, 9, 0)); // it may come back
    setUp();
    TEST_ASSERT_EQUAL_INT(1, stood_beside(40, 10, 0));
    put(8, 0, 0.5);
    update();
    TEST_ASSERT_EQUAL_INT(1, number[0]);
    setUp();
    TEST_ASSERT_EQUAL_INT(4, stood_beside(40, 60, 1)); // of another shape
    setUp();
    TEST_ASSERT_EQUAL_INT(4, stood_beside(120, 60, 0)); // a mode of its own, for as long as tracks live
}

// A change that is known of: no waiting for three hits, and what stood between is nothing.
static void an_announced_jump(void) {
    settle();
    for (int k = 0; k < 2; ++k) { // of samples from before and after
        three_modes(1);
        put(8.6, 0, 0);
        put(17.2, 1, 0);
        update();
    }
    okid_track_jump(tracks);
    TEST_ASSERT_EQUAL_INT(3, okid_track_count(tracks));
    three_modes(0.85);
    update();
    expect(1, 2, 3);
    three_modes(0.65); // only once
    update();
    expect(0, 0, 0);
}

// Against all permutations, on random modes and tracks.
static double best_of_all(int n, double cost[5][5], int row, unsigned used) {
    if (row == n) return 0;
    double least = 1 + best_of_all(n, cost, row + 1, used);
    for (int j = 0; j < n; ++j)
        if (!(used >> j & 1u) && cost[row][j] < 1) {
            const double sum = cost[row][j] + best_of_all(n, cost, row + 1, used | 1u << j);
            if (sum < least) least = sum;
        }
    return least;
}

static void as_good_as_every_permutation(void) {
    uint64_t state = 7;
    for (int trial = 0; trial < 300; ++trial) {
        enum { N = 5 };
        double was[N], cost[N][N];
        create(1, TRACKS, 0);
        for (int m = 0; m < N; ++m) {
            was[m] = 10 + 1.5 * rig_uniform(&state);
            zeta[m] = re[m] = 1;
            im[m] = 0;
        }
        for (int k = 0; k < 3; ++k) {
            for (int m = 0; m < N; ++m) f[m] = (okid_real_t)was[m];
            TEST_ASSERT_EQUAL(OKID_OK, okid_track_update(tracks, N, f, zeta, re, im, number));
        }
        int column[N + 1] = {0};
        for (int m = 0; m < N; ++m) column[number[m]] = m;
        for (int m = 0; m < N; ++m) {
            f[m] = (okid_real_t)(10 + 1.5 * rig_uniform(&state));
            for (int j = 0; j < N; ++j) {
                const double x = ((double)f[m] - (double)(okid_real_t)was[j]) / (0.05 * (double)(okid_real_t)was[j]);
                cost[m][j] = x * x;
            }
        }
        TEST_ASSERT_EQUAL(OKID_OK, okid_track_update(tracks, N, f, zeta, re, im, number));
        double sum = 0;
        for (int m = 0; m < N; ++m) sum += number[m] ? cost[m][column[number[m]]] : 1;
        TEST_ASSERT_TRUE(fabs(sum - best_of_all(N, cost, 0, 0)) < 1e-4);
    }
}

static void a_full_house_takes_no_more(void) {
    create(NY, 2, 0);
    for (int k = 0; k < 5; ++k) {
        three_modes(1);
        update();
    }
    expect(1, 2, 0);
    TEST_ASSERT_EQUAL_INT(2, okid_track_count(tracks));
}

static void empty_updates_and_wrong_arguments(void) {
    settle();
    update(); // no mode
    three_modes(1);
    update();
    expect(1, 2, 3);
    TEST_ASSERT_EQUAL(OKID_ERR_DIM, okid_track_update(tracks, MODES + 1, f, zeta, re, im, number));
    TEST_ASSERT_EQUAL(OKID_ERR_DIM, okid_track_update(tracks, -1, f, zeta, re, im, number));
    TEST_ASSERT_EQUAL(OKID_ERR_NULL, okid_track_update(tracks, 1, NULL, zeta, re, im, number));
    f[0] = 0;
    TEST_ASSERT_EQUAL(OKID_ERR_DIM, okid_track_update(tracks, 1, f, zeta, re, im, number));
    three_modes(1);
    update();
    expect(1, 2, 3); // nothing changed
    okid_track_config_t c = {.n_y = 0, .max_modes = 1, .max_tracks = 1};
    TEST_ASSERT_EQUAL(0, okid_track_memsize(&c));
    c.n_y = 1;
    c.frequency = 1;
    TEST_ASSERT_EQUAL(0, okid_track_memsize(&c));
    TEST_ASSERT_EQUAL(0, okid_track_memsize(NULL));
}

int main(void) {
    UNITY_BEGIN();
    RUN_TEST(born_after_three_hits_in_a_row);
    RUN_TEST(absence_is_survived_and_does_not_number_anew);
    RUN_TEST(after_many_misses_it_ends);
    RUN_TEST(close_modes_that_swap_order_keep_their_identity);
    RUN_TEST(the_assignment_is_the_best);
    RUN_TEST(a_jump_is_followed_by_the_shape);
    RUN_TEST(a_mode_that_stood_beside_itself_keeps_its_number);
    RUN_TEST(an_announced_jump);
    RUN_TEST(as_good_as_every_permutation);
    RUN_TEST(a_full_house_takes_no_more);
    RUN_TEST(empty_updates_and_wrong_arguments);
    return UNITY_END();
}
