// SPDX-License-Identifier: MIT
// A model that no longer predicts is noticed within a few blocks; louder or softer excitation, spikes and gaps are not taken
// for a change.
#include "modal_rig.h"

#include <okid/okid.h>
#include <unity.h>

enum { P = 12, LENGTH = 4000, BLOCK = 32, CONFIRM = 3 };

static rig_t rig;
static void *watch_block, *identify_block, *accumulator_block;
static okid_watch_t* watch;
static okid_identified_t model;

static void* make(size_t bytes) {
    TEST_ASSERT_GREATER_THAN(0, bytes);
    return malloc(bytes);
}

static double* record(int count, double noise, uint64_t seed) { return rig_record(&rig, count, noise, NULL, seed); }

/// A model from a record of its own.
static void identify(double noise) {
    const okid_accumulator_config_t a = {RIG_NU, RIG_NY, P, OKID_SAMPLE_DOUBLE, 0, 0, 1.0, 0, 0};
    const okid_identify_config_t c = {.n_u = RIG_NU, .n_y = RIG_NY, .p = P, .order = RIG_NZ, .fs_hz = RIG_FS};
    accumulator_block = make(okid_accumulator_memsize(&a));
    identify_block = make(okid_identify_memsize(&c));
    okid_accumulator_t* sums = NULL;
    okid_identify_t* identifier = NULL;
    TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_create(&sums, &a, accumulator_block, okid_accumulator_memsize(&a)));
    TEST_ASSERT_EQUAL(OKID_OK, okid_identify_create(&identifier, &c, identify_block, okid_identify_memsize(&c)));
    double* v = record(LENGTH, noise, 1);
    TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_add(sums, v, LENGTH));
    free(v);
    TEST_ASSERT_GREATER_OR_EQUAL(0, okid_identify_run(identifier, sums, &model));
}

void setUp(void) {
    rig_make(&rig);
    identify(0.01);
    const okid_watch_config_t c = {.n_u = RIG_NU, .n_y = RIG_NY, .max_order = RIG_NZ, .lead = P};
    const size_t bytes = okid_watch_memsize(&c);
    watch_block = make(bytes);
    TEST_ASSERT_EQUAL(OKID_ERR_MEMORY, okid_watch_create(&watch, &c, watch_block, bytes - 1));
    TEST_ASSERT_EQUAL(OKID_OK, okid_watch_create(&watch, &c, watch_block, bytes));
}

void tearDown(void) {
    free(watch_block);
    free(identify_block);
    free(accumulator_block);
}

/// @return the sample after which a change was told, -1 when none was
static int feed(const double* v, int count, double scale) {
    okid_real_t sample[RIG_M];
    for (int n = 0; n < count; ++n) {
        for (int i = 0; i < RIG_M; ++i) sample[i] = (okid_real_t)(scale * v[n * RIG_M + i]);
        if (okid_watch_add(watch, sample)) return n;
    }
    return -1;
}

static okid_watch_state_t state(void) {
    okid_watch_state_t out;
    okid_watch_state(watch, &out);
    return out;
}

static void quiet_while_nothing_changes(void) {
    double* v = record(60000, 0.01, 2);
    TEST_ASSERT_EQUAL_INT(-1, feed(v, 100, 1)); // without a model
    TEST_ASSERT_EQUAL(OKID_OK, okid_watch_set_model(watch, &model));
    TEST_ASSERT_EQUAL_INT(1, state().learning);
    TEST_ASSERT_EQUAL_INT(-1, feed(v, P + 16 * BLOCK, 1));
    TEST_ASSERT_EQUAL_INT(1, state().watching);
    TEST_ASSERT_EQUAL_INT(0, state().learning);
    TEST_ASSERT_EQUAL_INT(-1, feed(v, 60000, 1));
    free(v);
}

/// From the record of the rig with its second spring changed by `by` percent of the frequency of mode 2.
static int delay_of(double percent) {
    double* v = record(2000, 0.01, 3);
    TEST_ASSERT_EQUAL(OKID_OK, okid_watch_set_model(watch, &model));
    TEST_ASSERT_EQUAL_INT(-1, feed(v, 2000, 1));
    free(v);
    const double angle = 6.283185307179586 * rig_frequency[1] * (1 + percent / 100) / RIG_FS;
    const double radius = exp(-rig_damping[1] * 6.283185307179586 * rig_frequency[1] / RIG_FS);
    rig.A[2 * RIG_NZ + 2] = rig.A[3 * RIG_NZ + 3] = radius * cos(angle);
    rig.A[2 * RIG_NZ + 3] = radius * sin(angle);
    rig.A[3 * RIG_NZ + 2] = -radius * sin(angle);
    v = record(2000, 0.01, 4);
    const int delay = feed(v, 2000, 1);
    free(v);
    return delay;
}

static void a_change_is_told_within_a_few_blocks(void) {
    const int delay = delay_of(-2.4); // a spring 10 % softer, as a rule
    TEST_ASSERT_GREATER_THAN(0, delay);
    TEST_ASSERT_LESS_THAN((CONFIRM + 1) * BLOCK, delay);
    TEST_ASSERT_EQUAL_INT(0, state().watching); // once: it wants another model
}

static void a_small_change_too(void) { TEST_ASSERT_LESS_THAN((CONFIRM + 2) * BLOCK, delay_of(-1)); }

/// The structure goes on from where it is, driven `force` times as hard, with `noise` on every sensor.
static int drive(double* x, uint64_t* seed, int count, double force, double noise) {
    okid_real_t sample[RIG_M];
    for (int n = 0; n < count; ++n) {
        const double u = force * rig_normal(seed);
        double next[RIG_NZ];
        sample[0] = (okid_real_t)u;
        for (int o = 0; o < RIG_NY; ++o) {
            double y = rig.D[o] * u + noise * rig_normal(seed);
            for (int j = 0; j < RIG_NZ; ++j) y += rig.C[j * RIG_NY + o] * x[j];
            sample[1 + o] = (okid_real_t)y;
        }
        for (int i = 0; i < RIG_NZ; ++i) {
            next[i] = rig.B[i] * u;
            for (int j = 0; j < RIG_NZ; ++j) next[i] += rig.A[j * RIG_NZ + i] * x[j];
        }
        memcpy(x, next, sizeof next);
        if (okid_watch_add(watch, sample)) return n;
    }
    return -1;
}

static void louder_softer_and_spikes_are_no_change(void) {
    double x[RIG_NZ] = {0};
    uint64_t seed = 5;
    TEST_ASSERT_EQUAL(OKID_OK, okid_watch_set_model(watch, &model));
    TEST_ASSERT_EQUAL_INT(-1, drive(x, &seed, 2000, 1, 0.03));
    TEST_ASSERT_EQUAL_INT(-1, drive(x, &seed, 2000, 100, 0.03)); // louder by far: the model is not perfect
    TEST_ASSERT_EQUAL_INT(-1, drive(x, &seed, 2000, 0, 0.03));   // and off
    TEST_ASSERT_EQUAL_INT(-1, drive(x, &seed, 2000, 1, 0.03));
    TEST_ASSERT_EQUAL_INT(-1, drive(x, &seed, 3000, 30, 0.9)); // noise that grows with the excitation
    TEST_ASSERT_EQUAL_INT(-1, drive(x, &seed, 3000, 1, 0.03));
    for (int k = 0; k < 10; ++k) {
        okid_real_t spike[RIG_M] = {0, 1000, 0, 0};
        TEST_ASSERT_EQUAL_INT(0, okid_watch_add(watch, spike));
        TEST_ASSERT_EQUAL_INT(-1, drive(x, &seed, 400, 1, 0.03));
    }
}

static void gaps_are_no_change(void) {
    double* v = record(12000, 0.01, 6);
    okid_real_t missing[RIG_M] = {0};
    missing[1] = (okid_real_t)NAN;
    TEST_ASSERT_EQUAL(OKID_OK, okid_watch_set_model(watch, &model));
    for (int n = 0; n < 12000; n += 400) {
        TEST_ASSERT_EQUAL_INT(-1, feed(v + (size_t)n * RIG_M, 300, 1)); // and 100 are gone
        if (n % 800 == 0)
            okid_watch_gap(watch);
        else
            TEST_ASSERT_EQUAL_INT(0, okid_watch_add(watch, missing));
    }
    TEST_ASSERT_EQUAL_INT(1, state().watching);
    free(v);
}

static void the_model_at_work_stays_while_the_next_one_learns(void) {
    double* v = record(4000, 0.01, 7);
    TEST_ASSERT_EQUAL(OKID_OK, okid_watch_set_model(watch, &model));
    TEST_ASSERT_EQUAL_INT(-1, feed(v, 1000, 1));
    TEST_ASSERT_EQUAL(OKID_OK, okid_watch_set_model(watch, &model));
    TEST_ASSERT_EQUAL_INT(1, state().watching);
    TEST_ASSERT_EQUAL_INT(1, state().learning);
    for (int n = 0; n < 4000; ++n) v[n * RIG_M + 2] = -v[n * RIG_M + 2]; // a sensor turned over
    TEST_ASSERT_GREATER_THAN(0, feed(v, 400, 1));
    free(v);
}

static void models_that_cannot_be_watched(void) {
    okid_identified_t other = model;
    other.n_y = 2;
    TEST_ASSERT_EQUAL(OKID_ERR_MISMATCH, okid_watch_set_model(watch, &other));
    other = model;
    other.n_z = RIG_NZ + 1;
    TEST_ASSERT_EQUAL(OKID_ERR_MISMATCH, okid_watch_set_model(watch, &other));
    other = model;
    other.warnings |= OKID_NOTE_PREDICTOR_UNSTABLE;
    TEST_ASSERT_EQUAL(OKID_ERR_UNSTABLE, okid_watch_set_model(watch, &other));
    other = model;
    other.K = NULL;
    TEST_ASSERT_EQUAL(OKID_ERR_NULL, okid_watch_set_model(watch, &other));
    for (int k = 0; k < 2; ++k) { // a single input needs both of its matrices
        other = model;
        *(k ? &other.B : &other.D) = NULL;
        TEST_ASSERT_EQUAL(OKID_ERR_MISMATCH, okid_watch_set_model(watch, &other));
    }
    okid_real_t singular[RIG_NY * RIG_NY] = {0};
    other = model;
    other.innovation = singular;
    TEST_ASSERT_EQUAL(OKID_ERR_NUMERIC, okid_watch_set_model(watch, &other));
    TEST_ASSERT_EQUAL_INT(0, state().learning);
    okid_watch_config_t c = {.n_u = RIG_NU, .n_y = RIG_NY, .max_order = RIG_NZ, .ratio = 1};
    TEST_ASSERT_EQUAL(0, okid_watch_memsize(&c));
    c.ratio = 0;
    c.n_y = 0;
    TEST_ASSERT_EQUAL(0, okid_watch_memsize(&c));
}

/// One state, no input: neither B nor D is asked for, and the watch says that it learns.
static void a_model_of_one_state_without_inputs_is_taken(void) {
    const okid_real_t A = (okid_real_t)0.5, C = 1, K = (okid_real_t)0.1, innovation = 1;
    const double mean = 0;
    const okid_watch_config_t c = okid_watch_defaults(0, 1, 1, 4);
    const size_t bytes = okid_watch_memsize(&c);
    void* block = malloc(bytes);
    okid_watch_t* self = NULL;
    okid_watch_state_t state;
    okid_identified_t one = {.n_y = 1, .n_z = 1, .A = &A, .C = &C, .K = &K, .innovation = &innovation, .mean = &mean};
    TEST_ASSERT_EQUAL(OKID_OK, okid_watch_create(&self, &c, block, bytes));
    TEST_ASSERT_EQUAL(OKID_OK, okid_watch_set_model(self, &one));
    okid_watch_state(self, &state);
    TEST_ASSERT_EQUAL(0, state.watching);
    TEST_ASSERT_EQUAL(1, state.learning);
    for (int n = 0; n < 4 + 16 * 32; ++n) { // the lead, and sixteen blocks
        const okid_real_t sample = n % 2 ? 1 : -1;
        TEST_ASSERT_EQUAL(0, okid_watch_add(self, &sample));
        okid_watch_state(self, &state); // from the last one on, not before
        TEST_ASSERT_EQUAL(n == 4 + 16 * 32 - 1, state.watching);
        TEST_ASSERT_EQUAL(n < 4 + 16 * 32 - 1, state.learning);
    }
    free(block);
}

/// A mode of `angle` a sample that is forgotten only after some thousand samples, with measurement noise alone (K = 0).
typedef struct {
    double angle, x[2];
    uint64_t seed;
} slow_t;

static void slow_next(slow_t* slow, okid_real_t sample[2]) {
    const double u = rig_normal(&slow->seed), c = 0.999 * cos(slow->angle), s = 0.999 * sin(slow->angle);
    sample[0] = (okid_real_t)u;
    sample[1] = (okid_real_t)(slow->x[0] + 0.01 * rig_normal(&slow->seed));
    const double next[2] = {c * slow->x[0] + s * slow->x[1] + u, -s * slow->x[0] + c * slow->x[1]};
    memcpy(slow->x, next, sizeof next);
}

/// @return the sample after which a change was told, -1 when none was
static int slow_feed(okid_watch_t* self, slow_t* slow, int count) {
    okid_real_t sample[2];
    for (int n = 0; n < count; ++n) {
        slow_next(slow, sample);
        if (okid_watch_add(self, sample)) return n;
    }
    return -1;
}

/// The mode rings on for thousands of samples: where it is behind a gap comes from the samples, not from its decay.
static void a_gap_is_no_change_with(int lead) {
    slow_t slow = {.angle = 0.3, .seed = 9};
    const okid_real_t c = (okid_real_t)(0.999 * cos(slow.angle)), s = (okid_real_t)(0.999 * sin(slow.angle));
    const okid_real_t A[4] = {c, -s, s, c}, B[2] = {1, 0}, C[2] = {1, 0}, D = 0, K[2] = {0, 0},
                      innovation = (okid_real_t)1e-4;
    const double mean[2] = {0, 0};
    const okid_watch_config_t config = okid_watch_defaults(1, 1, 2, lead);
    void* block = make(okid_watch_memsize(&config));
    okid_watch_t* self = NULL;
    okid_real_t lost[2];
    const okid_identified_t one = {
        .n_u = 1, .n_y = 1, .n_z = 2, .A = A, .B = B, .C = C, .D = &D, .K = K, .innovation = &innovation, .mean = mean};
    TEST_ASSERT_EQUAL(OKID_OK, okid_watch_create(&self, &config, block, okid_watch_memsize(&config)));
    TEST_ASSERT_EQUAL(OKID_OK, okid_watch_set_model(self, &one));
    TEST_ASSERT_EQUAL_INT(-1, slow_feed(self, &slow, lead + 16 * BLOCK));
    for (int gap = 1; gap <= 256; gap *= 2) {
        for (int n = 0; n < gap; ++n) slow_next(&slow, lost);
        okid_watch_gap(self);
        TEST_ASSERT_EQUAL_INT(-1, slow_feed(self, &slow, 600));
    }
    slow.angle *= 1.02; // and a change that a gap hides is noticed behind it
    okid_watch_gap(self);
    const int delay = slow_feed(self, &slow, 600);
    TEST_ASSERT_GREATER_THAN(0, delay);
    TEST_ASSERT_LESS_THAN(lead + (CONFIRM + 2) * BLOCK, delay);
    free(block);
}

static void a_gap_is_no_change_though_the_predictor_forgets_slowly(void) {
    for (int lead = 8; lead <= 16; ++lead) a_gap_is_no_change_with(lead);
}

int main(void) {
    UNITY_BEGIN();
    RUN_TEST(quiet_while_nothing_changes);
    RUN_TEST(a_change_is_told_within_a_few_blocks);
    RUN_TEST(a_small_change_too);
    RUN_TEST(louder_softer_and_spikes_are_no_change);
    RUN_TEST(gaps_are_no_change);
    RUN_TEST(a_gap_is_no_change_though_the_predictor_forgets_slowly);
    RUN_TEST(the_model_at_work_stays_while_the_next_one_learns);
    RUN_TEST(models_that_cannot_be_watched);
    RUN_TEST(a_model_of_one_state_without_inputs_is_taken);
    return UNITY_END();
}
