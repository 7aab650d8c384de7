// SPDX-License-Identifier: MIT
// Criteria of the stabilization diagram at their very limits, in numbers that are exact: what reaches a limit holds,
// what passes it by one bit does not.
#include <okid/okid.h>

#include <math.h>
#include <stdlib.h>
#include <unity.h>

enum { NY = 2, MODELS = 12, POLES = 4 };

static void* block;
static okid_stabilization_t* diagram;
static okid_real_t f[POLES], zeta[POLES], one[POLES], re[POLES * NY], im[POLES * NY];
static okid_stabilized_t found;
static int models;

void setUp(void) { models = 0; }
void tearDown(void) {
    free(block);
    block = NULL;
}

static void create(double share) {
    const okid_stabilization_config_t c = {.n_y = NY,
                                           .max_models = MODELS,
                                           .max_poles = POLES,
                                           .frequency = 0.25,
                                           .damping = 0.5,
                                           .mac = 0.5,
                                           .share = share};
    const size_t bytes = okid_stabilization_memsize(&c);
    tearDown();
    block = malloc(bytes);
    TEST_ASSERT_EQUAL(OKID_OK, okid_stabilization_create(&diagram, &c, block, bytes));
}

static void put(int k, double frequency, double damping, double first, double second) {
    f[k] = (okid_real_t)frequency;
    zeta[k] = (okid_real_t)damping;
    one[k] = 1;
    re[k * NY] = (okid_real_t)first, re[k * NY + 1] = (okid_real_t)second;
    im[k * NY] = im[k * NY + 1] = 0;
}

static void add(int count) {
    const okid_identified_t model = {.n_y = NY,
                                     .p = 20,
                                     .n_z = 2 * ++models,
                                     .mode_count = count,
                                     .frequency_hz = f,
                                     .damping_ratio = zeta,
                                     .mpc = one,
                                     .emac = one,
                                     .shape_re = re,
                                     .shape_im = im};
    TEST_ASSERT_EQUAL(OKID_OK, okid_stabilization_add(diagram, &model));
}

/// What a pole of 8 Hz, damping 0.5 and shape (1, 0) holds beside this one of the order before.
static int holds_beside(double frequency, double damping, double first, double second) {
    create(0);
    models = 0;
    put(0, frequency, damping, first, second);
    add(1);
    put(0, 8, 0.5, 1, 0);
    add(1);
    TEST_ASSERT_EQUAL(OKID_OK, okid_stabilization_find(diagram, &found));
    return found.poles[1].holds;
}

static void a_quarter_of_the_frequency_holds_and_no_more(void) {
    const int all = OKID_HOLDS_FREQUENCY | OKID_HOLDS_DAMPING | OKID_HOLDS_SHAPE;
    const okid_real_t beyond =
        sizeof(okid_real_t) == 8 ? (okid_real_t)nextafter(10, 11) : (okid_real_t)nextafterf(10, 11);
    TEST_ASSERT_EQUAL(all, holds_beside(10, 0.5, 1, 0));
    TEST_ASSERT_EQUAL(all, holds_beside(6, 0.5, 1, 0));
    TEST_ASSERT_EQUAL(0, holds_beside((double)beyond, 0.5, 1, 0));
}

static void half_of_the_damping_holds_and_no_more(void) {
    const int others = OKID_HOLDS_FREQUENCY | OKID_HOLDS_SHAPE;
    TEST_ASSERT_EQUAL(others | OKID_HOLDS_DAMPING, holds_beside(8, 0.25, 1, 0));
    TEST_ASSERT_EQUAL(others | OKID_HOLDS_DAMPING, holds_beside(8, 0.75, 1, 0));
    TEST_ASSERT_EQUAL(others, holds_beside(8, 0.75 + 1e-6, 1, 0));
    TEST_ASSERT_EQUAL(others, holds_beside(8, 0.25 - 1e-6, 1, 0));
}

/// MAC of (1, 0) and (1, 1): one half.
static void half_of_the_shape_holds_and_no_less(void) {
    const int others = OKID_HOLDS_FREQUENCY | OKID_HOLDS_DAMPING;
    TEST_ASSERT_EQUAL(others | OKID_HOLDS_SHAPE, holds_beside(8, 0.5, 1, 1));
    TEST_ASSERT_EQUAL(others, holds_beside(8, 0.5, 1, 1.001));
    TEST_ASSERT_EQUAL(others, holds_beside(8, 0.5, 0, 1)); // none at all: the partner is the pole all the same
}

/// Of several within reach the one with the likest shape counts, of those alike the first.
static void the_partner_is_the_likest_in_shape(void) {
    create(0);
    put(0, 8, 0.5, 0, 1);
    put(1, 9, 0.125, 1, 0);
    put(2, 8.5, 0.5, 1, 0);
    put(3, 20, 0.5, 1, 0);
    add(4);
    put(0, 8, 0.5, 1, 0);
    add(1);
    TEST_ASSERT_EQUAL(OKID_OK, okid_stabilization_find(diagram, &found));
    TEST_ASSERT_EQUAL(OKID_HOLDS_FREQUENCY | OKID_HOLDS_SHAPE, found.poles[4].holds);
}

/// Poles of 8 Hz in `hits` of eight models, with others far away in the rest.
static void gather(int hits, double share) {
    create(share);
    models = 0;
    for (int m = 0; m < 8; ++m) {
        put(0, m < hits ? 8 : 100.0 * (1 << m), 0.5, 1, 0);
        add(1);
    }
    TEST_ASSERT_EQUAL(OKID_OK, okid_stabilization_find(diagram, &found));
}

static void the_share_of_the_models_makes_a_mode(void) {
    gather(4, 0.5);
    TEST_ASSERT_EQUAL(1, found.cluster_count);
    TEST_ASSERT_EQUAL(4, found.clusters[0].hits);
    TEST_ASSERT_EQUAL(1, found.clusters[0].physical);
    gather(3, 0.5);
    TEST_ASSERT_EQUAL(1, found.cluster_count);
    TEST_ASSERT_EQUAL(0, found.clusters[0].physical);
}

/// A fifth of eight models is two.
static void a_fifth_of_the_models_is_listed(void) {
    gather(2, 0.5);
    TEST_ASSERT_EQUAL(1, found.cluster_count);
    TEST_ASSERT_EQUAL(2, found.clusters[0].hits);
    gather(1, 0.5);
    TEST_ASSERT_EQUAL(0, found.cluster_count);
    create(0.5); // of eleven it is three
    for (int m = 0; m < 11; ++m) {
        put(0, m < 2 ? 8 : m < 5 ? 1 : 100.0 * (1 << m), 0.5, 1, 0);
        add(1);
    }
    TEST_ASSERT_EQUAL(OKID_OK, okid_stabilization_find(diagram, &found));
    TEST_ASSERT_EQUAL(1, found.cluster_count);
    TEST_ASSERT_EQUAL_DOUBLE(1, found.clusters[0].frequency_hz);
}

/// Two poles have as many about them: the one that was added first gathers them.
static void ties_go_to_the_pole_added_first(void) {
    static const double frequencies[] = {8, 9.5, 11.5, 13.8};
    create(0.5);
    for (int m = 0; m < 4; ++m) {
        put(0, frequencies[m], 0.5, 1, 0);
        add(1);
    }
    TEST_ASSERT_EQUAL(OKID_OK, okid_stabilization_find(diagram, &found));
    TEST_ASSERT_EQUAL(1, found.cluster_count);
    TEST_ASSERT_EQUAL(3, found.clusters[0].hits);
    TEST_ASSERT_EQUAL(1, found.clusters[0].pole);
    TEST_ASSERT_EQUAL(-1, found.poles[3].cluster);
}

/// Median, and 1.4826 times the median of the distances from it; of an even number the mean of the middle two.
static void a_mode_is_described_by_medians(void) {
    static const double frequencies[] = {8, 8.5, 7.75, 8.125, 9}, dampings[] = {0.5, 0.25, 0.5625, 0.75, 0.375};
    for (int count = 4; count <= 5; ++count) {
        create(0.5);
        models = 0;
        for (int m = 0; m < count; ++m) {
            put(0, frequencies[m], dampings[m], 1, 0);
            one[0] = (okid_real_t)(0.5 + 0.125 * m);
            add(1);
        }
        TEST_ASSERT_EQUAL(OKID_OK, okid_stabilization_find(diagram, &found));
        TEST_ASSERT_EQUAL(1, found.cluster_count);
        const okid_cluster_t* c = &found.clusters[0];
        TEST_ASSERT_EQUAL(count, c->hits);
        TEST_ASSERT_EQUAL_DOUBLE(count == 4 ? 8.0625 : 8.125, c->frequency_hz);
        TEST_ASSERT_EQUAL_DOUBLE(count == 4 ? 0.53125 : 0.5, c->damping_ratio);
        TEST_ASSERT_EQUAL_DOUBLE(count == 4 ? 0.6875 : 0.75, c->mpc);
        // distances 1/16 7/16 5/16 1/16, and 1/8 3/8 3/8 0 7/8; 1/32 9/32 1/32 7/32, and 0 1/4 1/16 1/4 1/8
        TEST_ASSERT_DOUBLE_WITHIN(1e-12, 1.4826 * (count == 4 ? 0.1875 : 0.375), c->frequency_spread_hz);
        TEST_ASSERT_DOUBLE_WITHIN(1e-12, 1.4826 * (count == 4 ? 0.125 : 0.125), c->damping_ratio_spread);
        // the member nearest to them in units of the criteria
        TEST_ASSERT_EQUAL(0, c->pole);
    }
}

int main(void) {
    UNITY_BEGIN();
    RUN_TEST(a_quarter_of_the_frequency_holds_and_no_more);
    RUN_TEST(half_of_the_damping_holds_and_no_more);
    RUN_TEST(half_of_the_shape_holds_and_no_less);
    RUN_TEST(the_partner_is_the_likest_in_shape);
    RUN_TEST(the_share_of_the_models_makes_a_mode);
    RUN_TEST(a_fifth_of_the_models_is_listed);
    RUN_TEST(ties_go_to_the_pole_added_first);
    RUN_TEST(a_mode_is_described_by_medians);
    return UNITY_END();
}
