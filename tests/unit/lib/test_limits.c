// SPDX-License-Identifier: MIT
// The limits that the headers state: the least and the most of a key are taken, what is beyond them is not (memory of 0 bytes).
#include <math.h>
#include <okid/accumulator.h>
#include <okid/change.h>
#include <okid/correlation.h>
#include <okid/identify.h>
#include <okid/refine.h>
#include <okid/stabilization.h>
#include <okid/steps/observer.h>
#include <okid/steps/square_root.h>
#include <okid/steps/subspace.h>
#include <okid/uncertainty.h>
#include <okid/watch.h>
#include <unity.h>

void setUp(void) {}
void tearDown(void) {}

#define TAKEN(kind, ...) (okid_##kind##_memsize(&(okid_##kind##_config_t){__VA_ARGS__}) > 0)
/// `key` of a config that is fine otherwise; later members of an initialiser win.
#define LIMITS(kind, fine, key, least, most)                                                                           \
    do {                                                                                                               \
        const long long low = (least), high = (most);                                                                  \
        okid_##kind##_config_t config = fine;                                                                          \
        for (int beyond = 0; beyond < 2; ++beyond) {                                                                   \
            config.key = (int32_t)(low - beyond);                                                                      \
            TEST_ASSERT_EQUAL_MESSAGE(!beyond, okid_##kind##_memsize(&config) > 0, #kind " " #key ", least");          \
            config.key = (int32_t)(high + beyond);                                                                     \
            TEST_ASSERT_EQUAL_MESSAGE(!beyond, okid_##kind##_memsize(&config) > 0, #kind " " #key ", most");           \
        }                                                                                                              \
    } while (0)

static void of_the_sums(void) {
    const okid_accumulator_config_t sums = {.n_u = 1, .n_y = 1, .lags = 2, .forgetting = 1, .block = 8, .edges = 1};
    LIMITS(accumulator, sums, n_u, 0, 255);
    LIMITS(accumulator, sums, n_y, 1, 255);
    LIMITS(accumulator, sums, lags, 1, 4096);
    LIMITS(accumulator, sums, slots, 0, 65536);
    LIMITS(accumulator, sums, spare_slots, 0, 65536);
    LIMITS(accumulator, sums, buffer, 0, 65536);
    const okid_square_root_config_t root = {.n_u = 1, .n_y = 1, .lags = 2, .forgetting = 1, .block = 1};
    LIMITS(square_root, root, n_u, 0, 255);
    LIMITS(square_root, root, n_y, 1, 255);
    LIMITS(square_root, root, lags, 1, 4096);
    LIMITS(square_root, root, batch, 0, 1024);
    LIMITS(square_root, root, slots, 0, 65536);
    LIMITS(square_root, root, spare_slots, 0, 65536);
    const okid_correlation_config_t lagged = {.n_u = 1, .n_y = 1, .lags = 256, .slots = 1, .forgetting = 1};
    LIMITS(correlation, lagged, n_u, 1, 255);
    LIMITS(correlation, lagged, n_y, 1, 255);
    LIMITS(correlation, lagged, lags, 1, 65536);
    LIMITS(correlation, lagged, own_lags, 0, 256);
    LIMITS(correlation, lagged, slots, 1, 4096);
    LIMITS(correlation, lagged, buffer, 0, 65536);
}

static void memory_that_fades_needs_blocks(void) {
    for (int block = 0; block < 3; ++block)
        for (int fades = 0; fades < 2; ++fades) {
            const double forgetting = fades ? 0.99 : 1;
            const int taken = block > 0 || !fades;
            TEST_ASSERT_EQUAL(taken, TAKEN(accumulator, .n_u = 1, .n_y = 1, .lags = 2, .block = block,
                                           .forgetting = forgetting, .edges = 1));
            TEST_ASSERT_EQUAL(
                taken, TAKEN(square_root, .n_u = 1, .n_y = 1, .lags = 2, .block = block, .forgetting = forgetting));
            TEST_ASSERT_EQUAL(taken, TAKEN(correlation, .n_u = 1, .n_y = 1, .lags = 4, .block = block, .slots = 1,
                                           .forgetting = forgetting));
        }
    TEST_ASSERT_FALSE(TAKEN(accumulator, .n_u = 1, .n_y = 1, .lags = 2, .block = 8, .forgetting = 0.99));
    for (int wrong = 0; wrong < 3; ++wrong) {
        const double forgetting = (const double[]){0, -0.5, 1.001}[wrong];
        TEST_ASSERT_FALSE(
            TAKEN(accumulator, .n_u = 1, .n_y = 1, .lags = 2, .block = 8, .edges = 1, .forgetting = forgetting));
        TEST_ASSERT_FALSE(TAKEN(square_root, .n_u = 1, .n_y = 1, .lags = 2, .block = 8, .forgetting = forgetting));
        TEST_ASSERT_FALSE(
            TAKEN(correlation, .n_u = 1, .n_y = 1, .lags = 4, .block = 8, .slots = 1, .forgetting = forgetting));
    }
}

static void of_what_is_made_of_them(void) {
    const okid_change_config_t change = okid_change_defaults(1, 1, 8, 100);
    LIMITS(change, change, rows, 3, 512); // 2 rows of one output hold no mode
    LIMITS(change, change, n_u, 0, 256);
    LIMITS(change, change, n_y, 1, 256);
    LIMITS(change, change, blocks, 0, 1024);
    okid_change_config_t wide = okid_change_defaults(4, 4, 512, 100); // 2 i (n_u + n_y) = 8192
    TEST_ASSERT_TRUE(okid_change_memsize(&wide) > 0);
    wide.n_y = 5;
    TEST_ASSERT_EQUAL(0, okid_change_memsize(&wide));
    for (int order = -2; order <= 9; ++order)
        TEST_ASSERT_EQUAL(order >= 0 && order % 2 == 0 && order <= 7,
                          TAKEN(change, .n_y = 1, .rows = 8, .order = order, .fs_hz = 100));
    const okid_subspace_config_t subspace = {.n_u = 1, .n_y = 1, .rows = 4};
    LIMITS(subspace, subspace, rows, 2, 8192); // 2 i (n_u + n_y) = 32768
    LIMITS(subspace, subspace, method, OKID_SUBSPACE_MOESP, OKID_SUBSPACE_SSARX);
    const okid_refine_config_t refine = okid_refine_defaults(1, 1, 4);
    LIMITS(refine, refine, blocks, 2, 64);
    LIMITS(refine, refine, offset, 0, 1);
    const okid_stabilization_config_t poles = okid_stabilization_defaults(1, 1024, 16);
    LIMITS(stabilization, poles, max_poles, 1, 1024); // models times poles: 2^20
    LIMITS(stabilization, poles, max_models, 1, 65536);
    const okid_watch_config_t watch = okid_watch_defaults(1, 1, 4, 8);
    LIMITS(watch, watch, n_u, 0, 4096);
    LIMITS(watch, watch, n_y, 1, 4096);
    LIMITS(watch, watch, max_order, 1, 4096);
    LIMITS(watch, watch, learn, 0, 1024);
    for (int negative = 0; negative < 2; ++negative) {
        TEST_ASSERT_EQUAL(!negative, TAKEN(watch, .n_y = 1, .max_order = 4, .lead = -negative));
        TEST_ASSERT_EQUAL(!negative, TAKEN(watch, .n_y = 1, .max_order = 4, .block = -negative));
        TEST_ASSERT_EQUAL(!negative, TAKEN(watch, .n_y = 1, .max_order = 4, .confirm = -negative));
        TEST_ASSERT_EQUAL(!negative, TAKEN(refine, .n_u = 1, .n_y = 1, .n_z = 1, .iterations = -negative));
        TEST_ASSERT_EQUAL(!negative, TAKEN(refine, .n_u = 1, .n_y = 1, .n_z = 1, .runs = -negative));
    }
    TEST_ASSERT_FALSE(TAKEN(watch, .n_y = 1, .max_order = 4, .ratio = 1));
    TEST_ASSERT_TRUE(TAKEN(watch, .n_y = 1, .max_order = 4, .ratio = 1.001));
    TEST_ASSERT_FALSE(TAKEN(watch, .n_y = 1, .max_order = 4, .ratio = HUGE_VAL));
}

static void of_deviations(void) {
    const okid_replicates_config_t replicates = okid_replicates_defaults(1, 1, 1);
    LIMITS(replicates, replicates, n_u, 0, 1048576);
    LIMITS(replicates, replicates, n_y, 1, 1048576);
}

/// n_z (n_u + runs + 1) + n_u + runs of a refinement is at most 16384.
static void unknowns_of_a_refinement(void) {
    TEST_ASSERT_TRUE(TAKEN(refine, .n_u = 1, .n_y = 1, .n_z = 5460, .runs = 1)); // 5460 * 3 + 2 = 16382
    TEST_ASSERT_FALSE(TAKEN(refine, .n_u = 1, .n_y = 1, .n_z = 5461, .runs = 1));
    TEST_ASSERT_TRUE(TAKEN(refine, .n_u = 1, .n_y = 1, .n_z = 1, .runs = 8190)); // 8192 + 8191 = 16383
    TEST_ASSERT_FALSE(TAKEN(refine, .n_u = 1, .n_y = 1, .n_z = 1, .runs = 8191));
    TEST_ASSERT_TRUE(TAKEN(refine, .n_u = 8191, .n_y = 1, .n_z = 1));
    TEST_ASSERT_FALSE(TAKEN(refine, .n_u = 8192, .n_y = 1, .n_z = 1));
    const okid_refine_config_t of_outputs = {.n_u = 1, .n_y = 1, .n_z = 1}; // outputs have no part in it
    LIMITS(refine, of_outputs, n_y, 1, 16384);
}

static void of_an_identification(void) {
    const okid_identify_config_t era = {.n_u = 1, .n_y = 1, .p = 4, .fs_hz = 100},
                                 ambient = {.n_y = 1, .p = 4, .fs_hz = 100},
                                 n4sid = {.n_u = 1, .n_y = 1, .fs_hz = 100, .method = OKID_METHOD_N4SID_CVA};
    LIMITS(identify, era, p, 1, 4096);
    LIMITS(identify, era, rows, 0, 8192);
    LIMITS(identify, era, n_u, 0, 255);
    LIMITS(identify, era, n_y, 1, 255);
    LIMITS(identify, ambient, p, 1, 4096); // rows = p
    for (int kind = 0; kind < 3; ++kind)   // solver and content of the Hankel matrix: only where an observer is solved
        for (int solver = OKID_SOLVER_DENSE; solver <= OKID_SOLVER_STRUCTURED; ++solver)
            for (int hankel = OKID_HANKEL_SYSTEM; hankel <= OKID_HANKEL_LITERAL + 1; ++hankel) {
                okid_identify_config_t c = kind == 0 ? era : kind == 1 ? ambient : n4sid;
                c.solver = (okid_solver_t)solver;
                c.hankel = (okid_hankel_t)hankel;
                const int plain = solver == OKID_SOLVER_DENSE && hankel == OKID_HANKEL_SYSTEM;
                TEST_ASSERT_EQUAL(kind == 0 ? hankel <= OKID_HANKEL_LITERAL : plain, okid_identify_memsize(&c) > 0);
            }
    for (int method = OKID_METHOD_OKID_ERA; method <= OKID_METHOD_N4SID_SSARX + 1; ++method)
        TEST_ASSERT_EQUAL(method <= OKID_METHOD_N4SID_SSARX,
                          TAKEN(identify, .n_u = 1, .n_y = 1, .p = 4, .fs_hz = 100, .method = (okid_method_t)method));
    for (int rows = -1; rows < 4; ++rows)
        TEST_ASSERT_EQUAL(rows == 0 || rows > 1, TAKEN(identify, .n_u = 1, .n_y = 2, .rows = rows, .fs_hz = 100,
                                                       .method = OKID_METHOD_N4SID_CVA));
    for (int negative = 0; negative < 2; ++negative) {
        TEST_ASSERT_EQUAL(!negative, TAKEN(identify, .n_u = 1, .n_y = 1, .p = 4, .fs_hz = 100, .order = -negative));
        TEST_ASSERT_EQUAL(!negative, TAKEN(identify, .n_u = 1, .n_y = 1, .p = 4, .fs_hz = 100, .max_order = -negative));
    }
    for (int wrong = 0; wrong < 4; ++wrong) {
        const double fs_hz = (const double[]){0, -1, HUGE_VAL, NAN}[wrong];
        TEST_ASSERT_FALSE(TAKEN(identify, .n_u = 1, .n_y = 1, .p = 4, .fs_hz = fs_hz));
        TEST_ASSERT_FALSE(TAKEN(change, .n_y = 1, .rows = 8, .fs_hz = fs_hz));
    }
}

/// The lags that a method looks back, and what it can carry: 128 states unless more are asked for.
static void lags_and_orders_of_an_identification(void) {
    okid_identify_config_t c = {.n_u = 2, .n_y = 3, .p = 9, .rows = 7, .fs_hz = 100};
    TEST_ASSERT_EQUAL(9, okid_identify_lags(&c));
    TEST_ASSERT_EQUAL(14, okid_identify_max_order(&c)); // 7 block columns of 2 inputs
    c.rows = 0;
    TEST_ASSERT_EQUAL(27, okid_identify_max_order(&c)); // 9 lags of 3 outputs; 18 block rows
    c.max_order = 20;
    TEST_ASSERT_EQUAL(20, okid_identify_max_order(&c));
    c.order = 22;
    TEST_ASSERT_EQUAL(22, okid_identify_max_order(&c));
    c.max_order = c.order = 0;
    c.p = 100;
    TEST_ASSERT_EQUAL(128, okid_identify_max_order(&c));
    c.order = 150;
    TEST_ASSERT_EQUAL(150, okid_identify_max_order(&c));
    c.order = 0;
    c.n_u = 0;
    c.rows = 7;
    TEST_ASSERT_EQUAL(14, okid_identify_lags(&c));
    TEST_ASSERT_EQUAL(21, okid_identify_max_order(&c));
    c.method = OKID_METHOD_OKID_ERA_DC;
    TEST_ASSERT_EQUAL(18, okid_identify_lags(&c));
    c.method = OKID_METHOD_N4SID_CVA;
    TEST_ASSERT_EQUAL(13, okid_identify_lags(&c));
    TEST_ASSERT_EQUAL(18, okid_identify_max_order(&c));
    c.rows = 0;
    TEST_ASSERT_EQUAL(59, okid_identify_lags(&c));
    TEST_ASSERT_EQUAL(87, okid_identify_max_order(&c));
}

/// A tenth of the rows of a record can be unknowns: 10 (n_u + p m) <= samples.
static void lags_that_a_record_carries(void) {
    TEST_ASSERT_EQUAL(40, okid_identify_usable_p(2, 3, 40, 2020)); // 10 (2 + 40 * 5)
    TEST_ASSERT_EQUAL(39, okid_identify_usable_p(2, 3, 40, 2019));
    TEST_ASSERT_EQUAL(1, okid_identify_usable_p(2, 3, 40, 70));
    TEST_ASSERT_EQUAL(1, okid_identify_usable_p(2, 3, 40, 0));
}

/// What 0 stands for, as the headers say: the same memory as the number itself, and another than the next.
static void defaults_are_numbers(void) {
    const struct {
        size_t usual, named, next;
    } each[] = {
        {okid_change_memsize(&(okid_change_config_t){.n_u = 1, .n_y = 1, .rows = 8, .fs_hz = 100}),
         okid_change_memsize(&(okid_change_config_t){.n_u = 1, .n_y = 1, .rows = 8, .fs_hz = 100, .blocks = 20}),
         okid_change_memsize(&(okid_change_config_t){.n_u = 1, .n_y = 1, .rows = 8, .fs_hz = 100, .blocks = 21})},
        {okid_square_root_memsize(&(okid_square_root_config_t){.n_u = 1, .n_y = 1, .lags = 8, .forgetting = 1}),
         okid_square_root_memsize(
             &(okid_square_root_config_t){.n_u = 1, .n_y = 1, .lags = 8, .batch = 32, .forgetting = 1}),
         okid_square_root_memsize(
             &(okid_square_root_config_t){.n_u = 1, .n_y = 1, .lags = 8, .batch = 48, .forgetting = 1})},
        {okid_accumulator_memsize(&(okid_accumulator_config_t){.n_u = 1, .n_y = 1, .lags = 8, .forgetting = 1}),
         okid_accumulator_memsize(
             &(okid_accumulator_config_t){.n_u = 1, .n_y = 1, .lags = 8, .forgetting = 1, .buffer = 256}),
         okid_accumulator_memsize(
             &(okid_accumulator_config_t){.n_u = 1, .n_y = 1, .lags = 8, .forgetting = 1, .buffer = 300})},
        {okid_subspace_memsize(&(okid_subspace_config_t){.n_u = 1, .n_y = 1, .rows = 200}),
         okid_subspace_memsize(&(okid_subspace_config_t){.n_u = 1, .n_y = 1, .rows = 200, .max_order = 128}),
         okid_subspace_memsize(&(okid_subspace_config_t){.n_u = 1, .n_y = 1, .rows = 200, .max_order = 160})},
    };
    for (size_t k = 0; k < sizeof each / sizeof *each; ++k) {
        TEST_ASSERT_TRUE(each[k].usual > 0 && each[k].usual < each[k].next);
        TEST_ASSERT_EQUAL(each[k].named, each[k].usual);
    }
}

/// The structured solver: 2 (m + 2)(n + m) + (1 + 3 min(4, n_y)) n numbers, n = m (p + 1), and those of small matrices.
static void memory_of_the_structured_solver(void) {
    // their companions take less
    static const int sizes[][3] = {{20, 6, 5}, {30, 2, 10}, {40, 1, 20}};
    for (size_t k = 0; k < sizeof sizes / sizeof *sizes; ++k) {
        const int n_y = sizes[k][1], m = sizes[k][0] + n_y, n = m * (sizes[k][2] + 1), columns = n_y < 4 ? n_y : 4;
        const int large = 2 * (m + 2) * (n + m) + (1 + 3 * columns) * n,
                  small = m * m + n_y * n_y + n_y * columns + 2 * (m + 2) * columns + 3 * m + 2;
        const okid_observer_config_t c = okid_observer_defaults(sizes[k][0], n_y, sizes[k][2]);
        const int most = (int)sizeof(double) * (large + small) + 14 * 64;
        TEST_ASSERT_TRUE((int)okid_structured_memsize(&c) <= most);
        TEST_ASSERT_TRUE((int)okid_structured_memsize(&c) >= most - 14 * 64);
    }
}

int main(void) {
    UNITY_BEGIN();
    RUN_TEST(of_the_sums);
    RUN_TEST(memory_that_fades_needs_blocks);
    RUN_TEST(of_what_is_made_of_them);
    RUN_TEST(of_deviations);
    RUN_TEST(unknowns_of_a_refinement);
    RUN_TEST(of_an_identification);
    RUN_TEST(lags_and_orders_of_an_identification);
    RUN_TEST(lags_that_a_record_carries);
    RUN_TEST(memory_of_the_structured_solver);
    RUN_TEST(defaults_are_numbers);
    return UNITY_END();
}
