// SPDX-License-Identifier: MIT
// A pointer that must be given and is not is refused, each one for itself, before anything is read or written.
#include <okid/okid.h>
#include <okid/steps/era.h>
#include <okid/steps/observer.h>
#include <okid/steps/square_root.h>
#include <okid/steps/subspace.h>
#include <stddef.h>
#include <unity.h>

void setUp(void) {}
void tearDown(void) {}

static max_align_t room[512]; // zeros: all that is not missing
static int missing;           // the pointer that is

/// Pointer number k of a call.
static void* given(int k) { return k == missing ? NULL : (void*)room; }

/// The call with each of its pointers missing in turn.
#define REFUSES(pointers, ...)                                                                                         \
    do {                                                                                                               \
        for (missing = 0; missing < (pointers); ++missing)                                                             \
            TEST_ASSERT_EQUAL_MESSAGE(OKID_ERR_NULL, (__VA_ARGS__), #__VA_ARGS__);                                     \
    } while (0)

static okid_run_sums_t sums_from(int first) {
    return (okid_run_sums_t){
        .S = given(first), .head = given(first + 1), .tail = given(first + 2), .sum = given(first + 3)};
}

static okid_model_t model_from(int first, int inputs) {
    return (okid_model_t){.n_u = 1,
                          .n_y = 1,
                          .n_z = 1,
                          .A = given(first),
                          .C = given(first + 1),
                          .B = inputs ? given(first + 2) : NULL,
                          .D = inputs ? given(first + 3) : NULL};
}

static void of_the_observer(void) {
    REFUSES(5, okid_observer_solve(given(0), given(1), 9, given(2), NULL, given(3), given(4), 1));
    REFUSES(5, okid_observer_solve_factor(given(0), given(1), 9, given(2), NULL, given(3), given(4), 1));
    REFUSES(5, okid_structured_solve(given(0), OKID_DETREND_NONE, given(1), given(2), NULL, given(3), given(4), 1));
    REFUSES(4, okid_structured_solve((void*)room, OKID_DETREND_MEAN, &(okid_run_sums_t[]){sums_from(0)}[0], (void*)room,
                                     NULL, (void*)room, room, 1));
    REFUSES(6, okid_structured_leave_out(given(0), OKID_DETREND_NONE, given(1), 0, given(2), given(3), 1, given(4),
                                         given(5), 1));
    const okid_run_sums_t whole = {.S = (void*)room, .head = (void*)room, .tail = (void*)room, .sum = (void*)room};
    REFUSES(4, okid_structured_leave_out((void*)room, OKID_DETREND_MEAN, &(okid_run_sums_t[]){sums_from(0)}[0], 0,
                                         (void*)room, &whole, 1, (void*)room, room, 1));
    REFUSES(4, okid_structured_leave_out((void*)room, OKID_DETREND_MEAN, &whole, 0, (void*)room,
                                         &(okid_run_sums_t[]){sums_from(0)}[0], 1, (void*)room, room, 1));
    REFUSES(2, okid_markov_recursion(1, 1, 1, given(0), 1, given(1), NULL));
}

static void of_era(void) {
    okid_modes_t modes = {.count = 1};
    REFUSES(3, okid_era_create(given(0), given(1), given(2), 1));
    REFUSES(2, okid_era_decompose(given(0), given(1)));
    REFUSES(4, okid_era_realize(given(0), 1, given(1), given(2), given(3), NULL, NULL));
    REFUSES(4, okid_era_realize_near(given(0), 1, given(1), given(2), given(3)));
    for (int way = 0; way < 2; ++way)
        for (missing = 0; missing < 7; ++missing) {
            modes.mu_re = given(2), modes.mu_im = given(3), modes.psi_re = given(4), modes.psi_im = given(5);
            const okid_modes_t* all = missing == 1 ? NULL : &modes;
            TEST_ASSERT_EQUAL(OKID_ERR_NULL, way == 0 ? okid_era_emac(given(0), 1, all, given(6))
                                                      : okid_subspace_emac(given(0), 1, (void*)room, all, given(6)));
        }
    missing = -1;
    TEST_ASSERT_EQUAL(OKID_ERR_NULL, okid_subspace_emac(given(0), 1, NULL, &modes, given(1)));
}

static void of_the_subspace(void) {
    REFUSES(3, okid_subspace_create(given(0), given(1), given(2), 1));
    REFUSES(3, okid_subspace_decompose(given(0), given(1), 9, given(2)));
    REFUSES(3, okid_subspace_decompose_factor(given(0), given(1), 9, given(2)));
    REFUSES(5, okid_subspace_realize(given(0), 1, given(1), given(2), given(3), given(4), NULL, NULL));
    const okid_model_t fine = {.n_u = 1, .n_y = 1, .n_z = 1, .A = (void*)room, .C = (void*)room};
    const okid_records_t one = {1, (void*)room, (void*)room};
    for (missing = 0; missing < 9; ++missing) {
        const okid_model_t model = {.n_u = 1, .n_y = 1, .n_z = 1, .A = given(2), .C = given(3)};
        const okid_records_t records = {1, given(4), given(5)};
        TEST_ASSERT_EQUAL(OKID_ERR_NULL,
                          okid_subspace_output_error(missing == 0 ? NULL : &model, missing == 1 ? NULL : &records,
                                                     given(6), given(7), NULL, given(8), 1));
    }
    missing = -1;
    TEST_ASSERT_EQUAL(OKID_ERR_MEMORY, okid_subspace_output_error(&fine, &one, given(0), given(0), NULL, given(0), 1));
}

static void of_an_identification(void) {
    REFUSES(3, okid_identify_create(given(0), given(1), given(2), 1));
    REFUSES(3, okid_identify_run(given(0), given(1), given(2)));
    REFUSES(3, okid_identify_decompose(given(0), given(1), given(2)));
    REFUSES(2, okid_identify_decompose_as(given(0), OKID_METHOD_N4SID_MOESP, 2, given(1)));
    REFUSES(3, okid_identify_run_factor(given(0), given(1), given(2)));
    REFUSES(2, okid_identify_order(given(0), 1, given(1)));
    REFUSES(2, okid_identify_poles(given(0), 1, given(1)));
    REFUSES(4, okid_identify_set_inputs(given(0), given(1), given(2), given(3)));
    TEST_ASSERT_EQUAL(0, okid_identify_max_order(NULL));
    TEST_ASSERT_EQUAL(0, okid_identify_lags(NULL));
    TEST_ASSERT_EQUAL(0, okid_identify_memsize(NULL));
}

static void of_a_refinement(void) {
    REFUSES(3, okid_refine_create(given(0), given(1), given(2), 1));
    for (int way = 0; way < 2; ++way)
        for (missing = 0; missing < 9 - way; ++missing) {
            const okid_model_t model = model_from(4, 1);
            const okid_model_t* start = missing == 1 ? NULL : &model;
            TEST_ASSERT_EQUAL(OKID_ERR_NULL, way == 0
                                                 ? okid_refine_run(given(0), start, given(2), given(3), given(8))
                                                 : okid_refine_from_correlation(given(0), start, given(2), given(3)));
        }
    REFUSES(5, okid_refine_replicate(given(0), 0, given(1), given(2), given(3), given(4)));
}

static void of_deviations(void) {
    okid_model_t model;
    REFUSES(3, okid_replicates_create(given(0), given(1), given(2), 1));
    for (missing = 0; missing < 4; ++missing) {
        model = model_from(2, 0);
        TEST_ASSERT_EQUAL(OKID_ERR_NULL, okid_replicates_begin(given(0), missing == 1 ? NULL : &model, 1));
        if (missing != 1) TEST_ASSERT_EQUAL(OKID_ERR_NULL, okid_replicates_add(given(0), &model, 0.1));
    }
    REFUSES(2, okid_replicates_finish(given(0), given(1)));
    REFUSES(2, okid_replicates_last(given(0), given(1)));
    REFUSES(3, okid_jackknife_create(given(0), given(1), given(2), 1));
    REFUSES(3, okid_jackknife_begin(given(0), given(1), given(2)));
    REFUSES(4, okid_jackknife_begin_linear(given(0), given(1), given(2), given(3)));
    REFUSES(3, okid_jackknife_delete(given(0), (void*)room, 1, given(1), given(2)));
}

static void of_what_watches(void) {
    REFUSES(3, okid_change_create(given(0), given(1), given(2), 1));
    REFUSES(3, okid_change_add(given(0), given(1), given(2)));
    REFUSES(1, okid_change_learn(given(0)));
    REFUSES(2, okid_change_test(given(0), given(1)));
    REFUSES(2, okid_change_mode(given(0), 0, given(1)));
    REFUSES(3, okid_watch_create(given(0), given(1), given(2), 1));
    for (missing = 0; missing < 7; ++missing) {
        const okid_identified_t its = {
            .n_y = 1, .n_z = 1, .A = given(2), .C = given(3), .K = given(4), .innovation = given(5), .mean = given(6)};
        TEST_ASSERT_EQUAL(OKID_ERR_NULL, okid_watch_set_model(given(0), missing == 1 ? NULL : &its));
    }
    REFUSES(3, okid_stabilization_create(given(0), given(1), given(2), 1));
    REFUSES(2, okid_stabilization_add(given(0), given(1)));
    REFUSES(2, okid_stabilization_find(given(0), given(1)));
    missing = -1;
    TEST_ASSERT_EQUAL(0, okid_watch_add(NULL, (void*)room));
    TEST_ASSERT_EQUAL(0, okid_watch_add(given(0), NULL));
    TEST_ASSERT_EQUAL(0, okid_change_blocks(NULL));
    TEST_ASSERT_EQUAL(0, okid_change_order(NULL));
    okid_change_clear(NULL);
    okid_watch_gap(NULL);
    okid_watch_reset(NULL);
    okid_watch_state(NULL, NULL);
}

int main(void) {
    UNITY_BEGIN();
    RUN_TEST(of_the_observer);
    RUN_TEST(of_era);
    RUN_TEST(of_the_subspace);
    RUN_TEST(of_an_identification);
    RUN_TEST(of_a_refinement);
    RUN_TEST(of_deviations);
    RUN_TEST(of_what_watches);
    return UNITY_END();
}
