// SPDX-License-Identifier: MIT
// The compile-time sizes of static arrays are never less than what the library asks for, and not much more (Eigen backend).
#include <okid/modal.h>
#include <okid/steps/era.h>
#include <okid/steps/observer.h>
#include <unity.h>

enum { SLACK = 1200 };

void setUp(void) {}
void tearDown(void) {}

static void check(size_t needed, size_t bound, int at_most) {
    TEST_ASSERT_GREATER_THAN(0, needed);
    TEST_ASSERT_GREATER_OR_EQUAL((long)needed, (long)bound);
    if (at_most) TEST_ASSERT_LESS_OR_EQUAL((long)needed + SLACK, (long)bound);
}

static void test_structured(void) {
    for (int n_u = 1; n_u <= 6; ++n_u)
        for (int n_y = 1; n_y <= 12; ++n_y)
            for (int p = 1; p <= 60; ++p) {
                const okid_observer_config_t config = {.n_u = n_u, .n_y = n_y, .p = p};
                check(okid_structured_memsize(&config), OKID_STRUCTURED_BYTES(n_u, n_y, p), 1);
            }
}

static void test_era(void) {
    for (int n_u = 1; n_u <= 6; ++n_u)
        for (int n_y = 1; n_y <= 12; ++n_y)
            for (int rows = 1; rows <= 50; rows += 7)
                for (int cols = 1; cols <= 50; cols += 3) {
                    const okid_era_config_t config = {.n_u = n_u, .n_y = n_y, .rows = rows, .cols = cols};
                    check(okid_era_memsize(&config), OKID_ERA_BYTES(n_u, n_y, rows, cols), cols * n_u >= n_y);
                }
}

static void test_modes(void) {
    for (int n_z = 1; n_z <= 100; ++n_z) check(okid_modal_memsize(3, n_z), OKID_MODAL_BYTES(n_z), 1);
}

int main(void) {
    UNITY_BEGIN();
    RUN_TEST(test_structured);
    RUN_TEST(test_era);
    RUN_TEST(test_modes);
    return UNITY_END();
}
