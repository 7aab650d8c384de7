// SPDX-License-Identifier: MIT
// Stabilization flags and clusters, on poles that are made up and on those of a record.
#include "modal_rig.h"
#include "tolerance.h"

#include <okid/okid.h>
#include <unity.h>

enum { MODELS = 30, POLES = 8 };

static void *block, *memory[2];
static okid_stabilization_t* diagram;
static okid_real_t f[POLES], zeta[POLES], mpc[POLES], emac[POLES], re[POLES * RIG_NY], im[POLES * RIG_NY];
static okid_identified_t model;
static okid_stabilized_t found;

static void create(int models, int poles, double share) {
    const okid_stabilization_config_t c = {.n_y = RIG_NY, .max_models = models, .max_poles = poles, .share = share};
    const size_t bytes = okid_stabilization_memsize(&c);
    TEST_ASSERT_GREATER_THAN(0, bytes);
    free(block);
    block = malloc(bytes);
    TEST_ASSERT_EQUAL(OKID_ERR_MEMORY, okid_stabilization_create(&diagram, &c, block, bytes - 1));
    TEST_ASSERT_EQUAL(OKID_OK, okid_stabilization_create(&diagram, &c, block, bytes));
}

void setUp(void) {
    model = (okid_identified_t){.n_y = RIG_NY};
    model.frequency_hz = f;
    model.damping_ratio = zeta;
    model.mpc = mpc;
    model.emac = emac;
    model.shape_re = re;
    model.shape_im = im;
}

void tearDown(void) {
    free(block);
    free(memory[0]);
    free(memory[1]);
    block = memory[0] = memory[1] = NULL;
}

/// One more pole of the model in hand: shape `kind` is a unit vector, so that different kinds are orthogonal.
static void put(double frequency, double damping, int kind) {
    const int k = model.mode_count++;
    f[k] = (okid_real_t)frequency;
    zeta[k] = (okid_real_t)damping;
    mpc[k] = emac[k] = 1;
    for (int o = 0; o < RIG_NY; ++o) {
        re[k * RIG_NY + o] = o == kind ? 1 : (okid_real_t)0.01;
        im[k * RIG_NY + o] = 0;
    }
}

static void add(int horizon, int order) {
    model.p = horizon;
    model.n_z = order;
    TEST_ASSERT_EQUAL(OKID_OK, okid_stabilization_add(diagram, &model));
    model.mode_count = 0;
}

static void flags_compare_with_the_order_before_of_the_same_horizon(void) {
    create(MODELS, POLES, 0);
    put(10, 0.01, 0);
    add(20, 2);
    put(50, 0.01, 0); // another horizon begins: nothing before it
    add(30, 2);
    put(10.05, 0.0102, 0); // all three hold, against the first model
    put(10.02, 0.02, 1);   // frequency only
    put(12, 0.01, 0);      // new
    add(20, 4);
    put(10.05, 0.0102, 1); // the pole of its shape, not the nearest in damping
    add(20, 6);
    TEST_ASSERT_EQUAL(OKID_OK, okid_stabilization_find(diagram, &found));
    TEST_ASSERT_EQUAL(4, found.model_count);
    TEST_ASSERT_EQUAL(6, found.pole_count);
    const int all = OKID_HOLDS_FREQUENCY | OKID_HOLDS_DAMPING | OKID_HOLDS_SHAPE;
    const int expected[] = {0, 0, all, OKID_HOLDS_FREQUENCY, 0, OKID_HOLDS_FREQUENCY | OKID_HOLDS_SHAPE};
    for (int k = 0; k < 6; ++k) TEST_ASSERT_EQUAL(expected[k], found.poles[k].holds);
    TEST_ASSERT_EQUAL(30, found.poles[1].horizon);
    TEST_ASSERT_EQUAL(4, found.poles[4].order);
}

static void modes_are_found_and_noise_is_not(void) {
    create(MODELS, POLES, 0.5);
    uint64_t state = 7;
    for (int m = 0; m < MODELS; ++m) {
        const double shift = 1e-3 * rig_normal(&state);
        put(80 + 40 * rig_uniform(&state), 0.05 * rig_uniform(&state), m % 3); // noise anywhere
        put(20 * (1 + shift), 0.01 * (1 + 20 * shift), 0);
        if (m >= 6) put(20.02 * (1 - shift), 0.02, 1);  // a close mode of another shape
        if (m % 3 == 0) put(60 * (1 + shift), 0.01, 2); // in a third of the models: listed, no mode
        if (m % 2 == 0) put(20 * (1 + 2e-3), 0.2, 0);   // a double of the first: only one a model counts
        add(m < MODELS / 2 ? 20 : 30, 2 * (m % (MODELS / 2) + 1));
    }
    TEST_ASSERT_EQUAL(OKID_OK, okid_stabilization_find(diagram, &found));
    int physical = 0, listed = 0;
    for (int c = 0; c < found.cluster_count; ++c) {
        const okid_cluster_t* cluster = &found.clusters[c];
        int members[MODELS] = {0}, count = 0, k = 0;
        TEST_ASSERT_TRUE(c == 0 || cluster->frequency_hz >= cluster[-1].frequency_hz);
        for (int m = 0; m < MODELS; ++m) // poles stand model by model
            for (const int order = found.poles[k].order, horizon = found.poles[k].horizon;
                 k < found.pole_count && found.poles[k].order == order && found.poles[k].horizon == horizon; ++k)
                members[m] += found.poles[k].cluster == c;
        for (int m = 0; m < MODELS; ++m) {
            TEST_ASSERT_TRUE(members[m] <= 1);
            count += members[m];
        }
        TEST_ASSERT_EQUAL(cluster->hits, count);
        TEST_ASSERT_EQUAL(c, found.poles[cluster->pole].cluster);
        TEST_ASSERT_EQUAL(cluster->hits >= 0.5 * MODELS, cluster->physical);
        physical += cluster->physical;
        listed += cluster->hits == MODELS / 3 && fabs(cluster->frequency_hz - 60) < 0.1;
    }
    TEST_ASSERT_EQUAL(1, listed);
    TEST_ASSERT_GREATER_OR_EQUAL(2, physical);
    const okid_cluster_t *first = &found.clusters[0], *second = &found.clusters[1];
    for (int c = 0; c < found.cluster_count; ++c) { // by what they are, not by place: they lie 0.1 % apart
        if (found.clusters[c].hits == MODELS) first = &found.clusters[c];
        if (found.clusters[c].hits == MODELS - 6) second = &found.clusters[c];
    }
    TEST_ASSERT_EQUAL(MODELS, first->hits);
    TEST_ASSERT_DOUBLE_WITHIN(0.02, 20, first->frequency_hz);
    TEST_ASSERT_DOUBLE_WITHIN(1e-3, 0.01, first->damping_ratio);
    TEST_ASSERT_TRUE(first->frequency_spread_hz > 0.005 && first->frequency_spread_hz < 0.04);
    TEST_ASSERT_EQUAL(MODELS - 6, second->hits);
    TEST_ASSERT_DOUBLE_WITHIN(1e-6, 0.02, second->damping_ratio);
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, 0, second->damping_ratio_spread);
    const okid_stabilized_t before = found; // finding again changes nothing
    const okid_cluster_t copy = *first;
    TEST_ASSERT_EQUAL(OKID_OK, okid_stabilization_find(diagram, &found));
    TEST_ASSERT_EQUAL(before.cluster_count, found.cluster_count);
    TEST_ASSERT_EQUAL_MEMORY(&copy, first, sizeof copy);
}

static void orders_of_a_record_give_its_modes(void) {
    enum { N = 6000, P = 20 };
    rig_t rig;
    rig_make(&rig);
    double* v = rig_record(&rig, N, 0.05, NULL, 2);
    const okid_identify_config_t c = {.n_u = RIG_NU, .n_y = RIG_NY, .p = P, .fs_hz = RIG_FS};
    const okid_accumulator_config_t a = {.n_u = RIG_NU, .n_y = RIG_NY, .lags = P, .forgetting = 1, .edges = 1};
    const size_t bytes = okid_identify_memsize(&c), more = okid_accumulator_memsize(&a);
    memory[0] = malloc(bytes);
    memory[1] = malloc(more);
    okid_identify_t* identifier;
    okid_accumulator_t* accumulator;
    okid_identified_t one;
    TEST_ASSERT_EQUAL(OKID_OK, okid_identify_create(&identifier, &c, memory[0], bytes));
    TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_create(&accumulator, &a, memory[1], more));
    TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_add(accumulator, v, N));
    TEST_ASSERT_EQUAL(OKID_OK, okid_identify_run(identifier, accumulator, &one));
    create(15, 15, 0);
    okid_real_t whole[POLES];
    for (int order = 2; order <= 30; order += 2) {
        TEST_ASSERT_GREATER_OR_EQUAL(0, okid_identify_order(identifier, order, &one));
        const int count = one.mode_count;
        for (int k = 0; k < count && k < POLES; ++k) whole[k] = one.frequency_hz[k];
        TEST_ASSERT_GREATER_OR_EQUAL(0, okid_identify_poles(identifier, order, &one));
        TEST_ASSERT_EQUAL(count, one.mode_count); // the same poles, without the rest of the model
        for (int k = 0; k < count && k < POLES; ++k) TEST_ASSERT_TRUE(whole[k] == one.frequency_hz[k]);
        TEST_ASSERT_EQUAL(OKID_OK, okid_stabilization_add(diagram, &one));
    }
    TEST_ASSERT_EQUAL(OKID_OK, okid_stabilization_find(diagram, &found));
    int physical = 0;
    for (int k = 0; k < found.cluster_count; ++k) {
        if (!found.clusters[k].physical) continue;
        TEST_ASSERT_TRUE(physical < RIG_MODES);
        TEST_ASSERT_DOUBLE_WITHIN(1e-3 * rig_frequency[physical], rig_frequency[physical],
                                  found.clusters[k].frequency_hz);
        TEST_ASSERT_DOUBLE_WITHIN(0.1 * rig_damping[physical], rig_damping[physical], found.clusters[k].damping_ratio);
        ++physical;
    }
    TEST_ASSERT_EQUAL(RIG_MODES, physical);
    TEST_ASSERT_EQUAL(OKID_ERR_NULL, okid_identify_poles(NULL, 2, &one));
    TEST_ASSERT_EQUAL(OKID_ERR_DIM, okid_identify_poles(identifier, 0, &one));
    free(v);
}

/// The leading singular triplets alone (okid_identify_decompose()) give the poles that the whole decomposition gives.
static void poles_need_no_whole_decomposition(void) {
    enum { N = 6000, P = 20, MOST = 16 };
    rig_t rig;
    rig_make(&rig);
    double* v = rig_record(&rig, N, 0.05, NULL, 2);
    const okid_method_t methods[] = {OKID_METHOD_OKID_ERA, OKID_METHOD_N4SID_MOESP, OKID_METHOD_N4SID_CVA,
                                     OKID_METHOD_N4SID_SSARX};
    for (int i = 0; i < 4; ++i) {
        okid_identify_config_t c = {
            .n_u = RIG_NU, .n_y = RIG_NY, .p = P, .max_order = MOST, .order = 4, .fs_hz = RIG_FS};
        c.method = methods[i];
        if (i == 0) c.hankel = OKID_HANKEL_INNOVATIONS;
        const okid_accumulator_config_t a = {
            .n_u = RIG_NU, .n_y = RIG_NY, .lags = okid_identify_lags(&c), .forgetting = 1, .edges = 1};
        const size_t bytes = okid_identify_memsize(&c), more = okid_accumulator_memsize(&a);
        char *own = malloc(bytes), *sums = malloc(more);
        okid_identify_t* identifier;
        okid_accumulator_t* accumulator;
        okid_identified_t one;
        double whole[MOST / 2][POLES][2];
        int count[MOST / 2];
        TEST_ASSERT_EQUAL(OKID_OK, okid_identify_create(&identifier, &c, own, bytes));
        TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_create(&accumulator, &a, sums, more));
        TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_add(accumulator, v, N));
        TEST_ASSERT_GREATER_OR_EQUAL(0, okid_identify_run(identifier, accumulator, &one));
        for (int order = 2; order <= MOST; order += 2) {
            TEST_ASSERT_GREATER_OR_EQUAL(0, okid_identify_poles(identifier, order, &one));
            count[order / 2 - 1] = one.mode_count;
            for (int k = 0; k < one.mode_count; ++k) {
                whole[order / 2 - 1][k][0] = one.frequency_hz[k];
                whole[order / 2 - 1][k][1] = one.emac[k];
            }
        }
        TEST_ASSERT_EQUAL(OKID_OK, okid_identify_decompose(identifier, accumulator, &one));
        for (int order = 2; order <= MOST; order += 2) {
            TEST_ASSERT_GREATER_OR_EQUAL(0, okid_identify_poles(identifier, order, &one));
            TEST_ASSERT_EQUAL(count[order / 2 - 1], one.mode_count);
            for (int k = 0; k < one.mode_count; ++k) {
                TEST_ASSERT_DOUBLE_WITHIN(1e-6 * RIG_FS, whole[order / 2 - 1][k][0], one.frequency_hz[k]);
                TEST_ASSERT_DOUBLE_WITHIN(1e-4, whole[order / 2 - 1][k][1], one.emac[k]);
            }
        }
        free(own);
        free(sums);
    }
    okid_identified_t none;
    TEST_ASSERT_EQUAL(OKID_ERR_NULL, okid_identify_decompose(NULL, NULL, &none));
    free(v);
}

/// MOESP from the factor that CVA left, and CVA again, are those from the sums, to the bit.
static void one_factor_serves_both_projections(void) {
    enum { N = 6000, ROWS = 12, MOST = 16, ORDER = 10 };
    rig_t rig;
    rig_make(&rig);
    double* v = rig_record(&rig, N, 0.05, NULL, 2);
    okid_identify_config_t c = {.n_u = RIG_NU, .n_y = RIG_NY, .rows = ROWS, .max_order = MOST, .order = 4};
    c.fs_hz = RIG_FS;
    const okid_method_t methods[] = {OKID_METHOD_N4SID_CVA, OKID_METHOD_N4SID_MOESP, OKID_METHOD_N4SID_CVA};
    okid_identify_t *identifier[4], *both;
    okid_identified_t own_found[4], one;
    void* blocks[4];
    c.method = methods[0];
    const okid_accumulator_config_t a = {
        .n_u = RIG_NU, .n_y = RIG_NY, .lags = okid_identify_lags(&c), .forgetting = 1, .edges = 1};
    const size_t more = okid_accumulator_memsize(&a);
    void* sums = malloc(more);
    okid_accumulator_t* accumulator;
    TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_create(&accumulator, &a, sums, more));
    TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_add(accumulator, v, N));
    for (int i = 0; i < 4; ++i) {
        c.method = i < 3 ? methods[i] : OKID_METHOD_N4SID_SSARX;
        const size_t bytes = okid_identify_memsize(&c);
        blocks[i] = malloc(bytes);
        TEST_ASSERT_EQUAL(OKID_OK, okid_identify_create(&identifier[i], &c, blocks[i], bytes));
    }
    both = identifier[0];
    TEST_ASSERT_EQUAL(OKID_ERR_MISMATCH, okid_identify_decompose_as(both, OKID_METHOD_N4SID_MOESP, MOST, &one));
    for (int i = 0; i < 3; ++i) {
        TEST_ASSERT_EQUAL(OKID_OK, i == 0 ? okid_identify_decompose(both, accumulator, &one)
                                          : okid_identify_decompose_as(both, methods[i], MOST, &one));
        TEST_ASSERT_GREATER_OR_EQUAL(0, okid_identify_poles(both, ORDER, &one));
        okid_identify_t* own = identifier[i > 0 ? i : 2];
        TEST_ASSERT_EQUAL(OKID_OK, okid_identify_decompose(own, accumulator, &own_found[i]));
        TEST_ASSERT_GREATER_OR_EQUAL(0, okid_identify_poles(own, ORDER, &own_found[i]));
        TEST_ASSERT_EQUAL(own_found[i].mode_count, one.mode_count);
        TEST_ASSERT_EQUAL_MEMORY(own_found[i].frequency_hz, one.frequency_hz,
                                 (size_t)one.mode_count * sizeof *one.frequency_hz);
        TEST_ASSERT_EQUAL_MEMORY(own_found[i].singular_values, one.singular_values, MOST * sizeof *one.singular_values);
    }
    TEST_ASSERT_EQUAL(OKID_ERR_MISMATCH, okid_identify_decompose_as(both, OKID_METHOD_N4SID_SSARX, MOST, &one));
    TEST_ASSERT_EQUAL(OKID_ERR_MISMATCH, okid_identify_decompose_as(both, OKID_METHOD_OKID_ERA, MOST, &one));
    TEST_ASSERT_EQUAL(OKID_ERR_MISMATCH, okid_identify_decompose_as(both, OKID_METHOD_N4SID_MOESP, 0, &one));
    TEST_ASSERT_EQUAL(OKID_ERR_MISMATCH, okid_identify_decompose_as(identifier[1], methods[0], MOST, &one));
    TEST_ASSERT_EQUAL(OKID_OK, okid_identify_decompose(identifier[3], accumulator, &own_found[3]));
    TEST_ASSERT_EQUAL(OKID_ERR_MISMATCH, okid_identify_decompose_as(identifier[3], methods[1], MOST, &own_found[3]));
    TEST_ASSERT_GREATER_OR_EQUAL(0, okid_identify_run(both, accumulator, &one)); // a whole model keeps no factor for it
    TEST_ASSERT_EQUAL(OKID_ERR_MISMATCH, okid_identify_decompose_as(both, methods[1], MOST, &one));
    for (int i = 0; i < 4; ++i) free(blocks[i]);
    free(sums);
    free(v);
}

static void what_does_not_fit_is_refused(void) {
    create(2, 2, 0);
    put(1, 0.1, 0);
    add(1, 2);
    model.n_y = 2;
    TEST_ASSERT_EQUAL(OKID_ERR_MISMATCH, okid_stabilization_add(diagram, &model));
    model.n_y = RIG_NY;
    model.mode_count = 3;
    TEST_ASSERT_EQUAL(OKID_ERR_DIM, okid_stabilization_add(diagram, &model));
    model.mode_count = 0;
    add(1, 4); // a model without modes counts all the same
    TEST_ASSERT_EQUAL(OKID_ERR_DIM, okid_stabilization_add(diagram, &model));
    TEST_ASSERT_EQUAL(OKID_OK, okid_stabilization_find(diagram, &found));
    TEST_ASSERT_EQUAL(2, found.model_count);
    TEST_ASSERT_EQUAL(1, found.pole_count);
    TEST_ASSERT_EQUAL(0, found.cluster_count); // once is no company
    TEST_ASSERT_EQUAL(OKID_ERR_NULL, okid_stabilization_add(diagram, NULL));
    TEST_ASSERT_EQUAL(OKID_ERR_NULL, okid_stabilization_find(diagram, NULL));
    const okid_stabilization_config_t good = {.n_y = 1, .max_models = 1, .max_poles = 1};
    okid_stabilization_config_t bad[] = {good, good, good, good, good, good, good};
    bad[0].n_y = 0;
    bad[1].max_models = 0;
    bad[2].max_poles = (1 << 20) + 1;
    bad[3].frequency = -1;
    bad[4].mac = 1;
    bad[5].share = 1.5;
    bad[6].damping = NAN;
    for (size_t k = 0; k < sizeof bad / sizeof *bad; ++k) TEST_ASSERT_EQUAL(0, okid_stabilization_memsize(&bad[k]));
    TEST_ASSERT_EQUAL(OKID_ERR_DIM, okid_stabilization_create(&diagram, &bad[0], block, 1 << 20));
}

int main(void) {
    UNITY_BEGIN();
    RUN_TEST(flags_compare_with_the_order_before_of_the_same_horizon);
    RUN_TEST(modes_are_found_and_noise_is_not);
    RUN_TEST(orders_of_a_record_give_its_modes);
    RUN_TEST(poles_need_no_whole_decomposition);
    RUN_TEST(one_factor_serves_both_projections);
    RUN_TEST(what_does_not_fit_is_refused);
    return UNITY_END();
}
