// SPDX-License-Identifier: MIT
// Deadlines: never early, no drift, the statistics are those of the lateness. Nothing here depends on how fast the machine is.
#include <drv/pacer.h>

#include <unity.h>

void setUp(void) {}
void tearDown(void) {}

static void test_never_early_and_no_drift(void) {
    drv_pacer_t pacer;
    drv_pacer_start(&pacer, 2000000);
    for (int n = 0; n < 200; ++n) {
        TEST_ASSERT_EQUAL_INT(1, drv_pacer_wait(&pacer, n * 500000LL, NULL, NULL));
        TEST_ASSERT_TRUE(drv_pacer_now(&pacer) >= n * 500000LL);
    }
    TEST_ASSERT_EQUAL_UINT64(200, pacer.count);
    TEST_ASSERT_TRUE(pacer.mean_ns >= 0 && pacer.mean_ns <= (double)pacer.worst_ns);
    TEST_ASSERT_TRUE(drv_pacer_deviation(&pacer) <= (double)pacer.worst_ns);
}

static void test_a_late_start_catches_up(void) {
    drv_pacer_t pacer;
    drv_pacer_start(&pacer, -1000000000); // the first deadlines have gone by
    for (int n = 0; n < 10; ++n) TEST_ASSERT_EQUAL_INT(1, drv_pacer_wait(&pacer, n * 1000000LL, NULL, NULL));
    TEST_ASSERT_TRUE(pacer.worst_ns >= 1000000000);
    TEST_ASSERT_TRUE(pacer.mean_ns >= 991000000);
}

static int count_down(void* context) {
    int* left = context;
    return --*left <= 0;
}

static void test_stop_is_asked_while_waiting(void) {
    drv_pacer_t pacer;
    int left = 3;
    drv_pacer_start(&pacer, 0);
    TEST_ASSERT_EQUAL_INT(0, drv_pacer_wait(&pacer, 3600 * 1000000000LL, count_down, &left));
    TEST_ASSERT_EQUAL_INT(0, left);
    TEST_ASSERT_EQUAL_UINT64(0, pacer.count);
    TEST_ASSERT_EQUAL_DOUBLE(0.0, drv_pacer_deviation(&pacer));
}

int main(void) {
    UNITY_BEGIN();
    RUN_TEST(test_never_early_and_no_drift);
    RUN_TEST(test_a_late_start_catches_up);
    RUN_TEST(test_stop_is_asked_while_waiting);
    return UNITY_END();
}
