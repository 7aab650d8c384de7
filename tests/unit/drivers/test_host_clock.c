// SPDX-License-Identifier: MIT
// Host time does not move when the computer's clock is set.
#include <drv/host_clock.h>

#include <time.h>
#include <unity.h>

static const int64_t second = 1000000000, hour = INT64_C(3600000000000), real0 = INT64_C(1700000000000000000);

void setUp(void) {}
void tearDown(void) {}

/// Both clocks at `steady_ns`, one of them set forward by `set_ns`, the pair read with so wide a bracket.
static drv_clock_pair_t pair_at(int64_t steady_ns, int64_t set_ns, int64_t bracket_ns) {
    drv_clock_pair_t pair = {steady_ns, real0 + steady_ns + set_ns, steady_ns + bracket_ns};
    return pair;
}

static int look(drv_host_clock_t* clock, int64_t steady_ns, int64_t set_ns, int64_t bracket_ns) {
    drv_clock_pair_t pair = pair_at(steady_ns, set_ns, bracket_ns);
    return drv_host_clock_look(clock, &pair);
}

static void test_host_time_is_the_real_time_and_goes_on(void) {
    int64_t before = drv_clock_pair(CLOCK_REALTIME, 1).reference_ns;
    int64_t first = drv_host_time_ns(), next = drv_host_time_ns();
    int64_t after = drv_clock_pair(CLOCK_REALTIME, 1).reference_ns;
    TEST_ASSERT_TRUE(first > before - second && next < after + second); // however long we are kept waiting between them
    TEST_ASSERT_TRUE(next >= first);
    drv_host_clock_t clock = {0};
    drv_clock_pair_t pair = drv_clock_pair(CLOCK_REALTIME, 3);
    TEST_ASSERT_TRUE(pair.before_ns <= pair.after_ns);
    TEST_ASSERT_EQUAL_INT(0, drv_host_clock_look(&clock, &pair));
    int64_t apart = drv_host_clock_carry(&clock, pair.reference_ns) - pair.reference_ns;
    int64_t most = 2000000 + pair.after_ns - pair.before_ns;
    TEST_ASSERT_TRUE(apart > -most && apart < most); // as long as nobody sets it, host time is CLOCK_REALTIME
}

/// Stamps every millisecond; the clock is set by an hour while frames wait, and frames of before and after it are read
/// together.
static void check_set(int64_t by_ns) {
    drv_host_clock_t clock = {0};
    TEST_ASSERT_EQUAL_INT(0, look(&clock, 100 * second, 0, 1000));
    int64_t base = drv_host_clock_carry(&clock, real0 + 100 * second) - 100 * second;
    int64_t at = 100 * second, set = 0;
    for (int batch = 0; batch < 40; ++batch) {
        int64_t stamps[8], truth[8];
        for (int i = 0; i < 8; ++i) {
            at += 1000000;
            if (batch == 11 && i == 3) set += by_ns;
            if (batch == 31 && i == 5) set -= by_ns;
            truth[i] = at;
            stamps[i] = real0 + at + set;
        }
        int64_t swap = stamps[6]; // two came over different processors
        stamps[6] = stamps[7], stamps[7] = swap;
        swap = truth[6], truth[6] = truth[7], truth[7] = swap;
        int found = look(&clock, at + 300000, set, batch % 2 ? 50 : 40000000); // a reader held up between the clocks
        TEST_ASSERT_EQUAL_INT(batch == 11 || batch == 31, found);
        for (int i = 0; i < 8; ++i) {
            int64_t off = drv_host_clock_carry(&clock, stamps[i]) - base - truth[i];
            TEST_ASSERT_TRUE(off > -2000000 && off < 2000000);
        }
    }
    TEST_ASSERT_EQUAL_UINT32(2, clock.sets);
}

static void test_forward(void) { check_set(hour); }
static void test_back(void) { check_set(-hour); }
static void test_by_years(void) { check_set(10 * 365 * 24 * hour); } // a computer without a battery hears from NTP

/// A bracket as wide as a step hides it: it is found by the next look that is tight enough.
static void test_a_look_that_cannot_tell(void) {
    drv_host_clock_t clock = {0};
    TEST_ASSERT_EQUAL_INT(0, look(&clock, second, 0, 100));
    TEST_ASSERT_EQUAL_INT(0, look(&clock, 2 * second, 5000000, 10000000));
    TEST_ASSERT_EQUAL_INT(1, look(&clock, 3 * second, 5000000, 100));
    TEST_ASSERT_EQUAL_INT(0, look(&clock, 4 * second, 5000000, 100));
}

int main(void) {
    UNITY_BEGIN();
    RUN_TEST(test_host_time_is_the_real_time_and_goes_on);
    RUN_TEST(test_forward);
    RUN_TEST(test_back);
    RUN_TEST(test_by_years);
    RUN_TEST(test_a_look_that_cannot_tell);
    return UNITY_END();
}
