// SPDX-License-Identifier: MIT
// After create nothing touches the heap: the per-sample path and the whole identification, on every backend. The
// allocator of the process is interposed and counted.
#include "modal_rig.h"

#include <okid/okid.h>
#include <okid/steps/square_root.h>
#include <unity.h>

extern void* __libc_malloc(size_t size);
extern void* __libc_calloc(size_t count, size_t size);
extern void* __libc_realloc(void* block, size_t size);
extern void __libc_free(void* block);
extern void* __libc_memalign(size_t alignment, size_t size);

static volatile long calls;

void* malloc(size_t size) {
    ++calls;
    return __libc_malloc(size);
}
void* calloc(size_t count, size_t size) {
    ++calls;
    return __libc_calloc(count, size);
}
void* realloc(void* block, size_t size) {
    ++calls;
    return __libc_realloc(block, size);
}
void free(void* block) {
    ++calls;
    __libc_free(block);
}
int posix_memalign(void** block, size_t alignment, size_t size) {
    ++calls;
    *block = __libc_memalign(alignment, size);
    return *block ? 0 : 12;
}
void* aligned_alloc(size_t alignment, size_t size) {
    ++calls;
    return __libc_memalign(alignment, size);
}
void* memalign(size_t alignment, size_t size) {
    ++calls;
    return __libc_memalign(alignment, size);
}

enum { P = 40, N = 5000 };

void setUp(void) {}
void tearDown(void) {}

static void the_interposer_counts(void) {
    const long before = calls;
    void* volatile block = malloc(10);
    free(block);
    TEST_ASSERT_EQUAL(before + 2, calls);
}

static void nothing_after_create(void) {
    rig_t rig;
    rig_make(&rig);
    double* v = rig_record(&rig, N, 0.02, NULL, 3);
    int16_t* codes = malloc(sizeof *codes * N * RIG_M);
    for (int i = 0; i < N * RIG_M; ++i) codes[i] = (int16_t)lrint(v[i] * 500);
    v[2000 * RIG_M] = NAN; // a gap on the way
    const okid_accumulator_config_t configs[] = {
        {RIG_NU, RIG_NY, P, OKID_SAMPLE_DOUBLE, 0, 0, 1.0, 1, 0},
        {RIG_NU, RIG_NY, P, OKID_SAMPLE_DOUBLE, 500, 6, 1.0, 0, 6},
        {RIG_NU, RIG_NY, P, OKID_SAMPLE_INT16, 0, 0, 1.0, 1, 0},
        {RIG_NU, RIG_NY, P, OKID_SAMPLE_INT16, 500, 0, 0.9999, 1, 0},
    };
    for (size_t k = 0; k < sizeof configs / sizeof *configs; ++k) {
        const okid_identify_config_t ident = {RIG_NU,
                                              RIG_NY,
                                              P,
                                              0,
                                              0,
                                              40,
                                              RIG_FS,
                                              OKID_METHOD_OKID_ERA,
                                              OKID_DETREND_MEAN,
                                              k == 1 ? OKID_SOLVER_STRUCTURED : OKID_SOLVER_DENSE};
        const size_t bytes = okid_accumulator_memsize(&configs[k]), more = okid_identify_memsize(&ident);
        void *b1 = malloc(bytes), *b2 = malloc(more);
        okid_accumulator_t* a;
        okid_identify_t* s;
        okid_identified_t out;
        TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_create(&a, &configs[k], b1, bytes));
        TEST_ASSERT_EQUAL(OKID_OK, okid_identify_create(&s, &ident, b2, more));
        const long before = calls;
        okid_status_t added = OKID_OK, found = OKID_OK, scanned = OKID_OK;
        for (int n = 0; n < N; n += 100) {
            const int integer = configs[k].sample == OKID_SAMPLE_INT16;
            added = integer ? okid_accumulator_add_i16(a, codes + n * RIG_M, 100)
                            : okid_accumulator_add(a, v + n * RIG_M, 100);
            if (n % 1000 == 900 && n != 2900) found = okid_identify_run(s, a, &out); // 2900: the window holds the gap
        }
        for (int order = 2; order <= 40; order += 2) scanned = okid_identify_order(s, order, &out);
        const long after = calls;
        TEST_ASSERT_GREATER_OR_EQUAL(0, added);
        TEST_ASSERT_GREATER_OR_EQUAL(0, found);
        TEST_ASSERT_GREATER_OR_EQUAL(0, scanned);
        TEST_ASSERT_EQUAL_MESSAGE(0, after - before, okid_backend());
        free(b1);
        free(b2);
    }
    free(v);
    free(codes);
}

static void nothing_for_standard_deviations(void) {
    rig_t rig;
    rig_make(&rig);
    double* v = rig_record(&rig, N, 0.02, NULL, 3);
    const okid_method_t methods[] = {OKID_METHOD_OKID_ERA, OKID_METHOD_N4SID_MOESP};
    for (size_t k = 0; k < 2 * (sizeof methods / sizeof *methods); ++k) {
        okid_jackknife_config_t config = {.linear = k % 2,
                                          .identify = {.n_u = RIG_NU,
                                                       .n_y = RIG_NY,
                                                       .p = P,
                                                       .rows = P,
                                                       .max_order = 20,
                                                       .fs_hz = RIG_FS,
                                                       .method = methods[k / 2]}};
        config.sums = (okid_accumulator_config_t){
            .n_u = RIG_NU, .n_y = RIG_NY, .lags = okid_identify_lags(&config.identify), .forgetting = 1, .edges = 1};
        const okid_replicates_config_t sums = {RIG_NU, RIG_NY, 20, NULL};
        const size_t bytes[] = {okid_accumulator_memsize(&config.sums), okid_accumulator_memsize(&config.sums),
                                okid_identify_memsize(&config.identify), okid_jackknife_memsize(&config),
                                okid_replicates_memsize(&sums)};
        void* blocks[5];
        for (int i = 0; i < 5; ++i) blocks[i] = malloc(bytes[i]);
        okid_accumulator_t *whole, *part;
        okid_identify_t* s;
        okid_jackknife_t* jackknife;
        okid_replicates_t* replicates;
        okid_identified_t full;
        okid_uncertainty_t out;
        TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_create(&whole, &config.sums, blocks[0], bytes[0]));
        TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_create(&part, &config.sums, blocks[1], bytes[1]));
        TEST_ASSERT_EQUAL(OKID_OK, okid_identify_create(&s, &config.identify, blocks[2], bytes[2]));
        TEST_ASSERT_EQUAL(OKID_OK, okid_jackknife_create(&jackknife, &config, blocks[3], bytes[3]));
        TEST_ASSERT_EQUAL(OKID_OK, okid_replicates_create(&replicates, &sums, blocks[4], bytes[4]));
        TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_add(whole, v, N));
        TEST_ASSERT_GREATER_OR_EQUAL(0, okid_identify_run(s, whole, &full));
        const okid_model_t view = {full.n_u, full.n_y, full.n_z, full.A, full.B, full.C, full.D, NULL};
        const long before = calls;
        okid_status_t status = okid_replicates_begin(replicates, &view, full.dt);
        if (status >= 0)
            status = config.linear ? okid_jackknife_begin_linear(jackknife, s, whole, &full)
                                   : okid_jackknife_begin(jackknife, whole, &full);
        for (int n = 0; status >= 0 && n < 10; ++n) {
            okid_model_t model;
            double share;
            okid_accumulator_reset(part);
            status = okid_accumulator_add(part, v + (size_t)n * 500 * RIG_M, 500);
            if (status >= 0) status = okid_jackknife_delete(jackknife, part, 1, &model, &share);
            if (status >= 0) status = okid_replicates_add(replicates, &model, share);
        }
        if (status >= 0) status = okid_replicates_finish(replicates, &out);
        const long after = calls;
        TEST_ASSERT_GREATER_OR_EQUAL(0, status);
        TEST_ASSERT_TRUE(out.frequency_std_hz[0] > 0);
        TEST_ASSERT_EQUAL_MESSAGE(0, after - before, okid_backend());
        for (int i = 0; i < 5; ++i) free(blocks[i]);
    }
    free(v);
}

static void nothing_in_the_second_kernel(void) {
    rig_t rig;
    rig_make(&rig);
    double* v = rig_record(&rig, N, 0.02, NULL, 3);
    v[2000 * RIG_M] = NAN;
    const okid_square_root_config_t configs[] = {{RIG_NU, RIG_NY, P, 0, 0, 0, 0, 1},
                                                 {RIG_NU, RIG_NY, P, 0, 500, 4, 2, 1},
                                                 {RIG_NU, RIG_NY, P, 0, 500, 0, 0, 0.999}};
    const okid_identify_config_t ident = {.n_u = RIG_NU, .n_y = RIG_NY, .p = P, .max_order = 40, .fs_hz = RIG_FS};
    for (size_t k = 0; k < sizeof configs / sizeof *configs; ++k) {
        const size_t bytes = okid_square_root_memsize(&configs[k]), more = okid_identify_memsize(&ident);
        void *b1 = malloc(bytes), *b2 = malloc(more), *b3 = malloc(bytes);
        okid_square_root_t *a, *b;
        okid_identify_t* s;
        okid_identified_t out;
        const long before = calls;
        TEST_ASSERT_EQUAL(OKID_OK, okid_square_root_create(&a, &configs[k], b1, bytes));
        TEST_ASSERT_EQUAL(OKID_OK, okid_square_root_create(&b, &configs[k], b3, bytes));
        TEST_ASSERT_EQUAL(OKID_OK, okid_identify_create(&s, &ident, b2, more));
        const okid_status_t added = okid_square_root_add(a, v, N), found = okid_identify_run_factor(s, a, &out);
        const okid_status_t merged = k == 0 ? okid_square_root_merge(b, a) : OKID_OK;
        okid_square_root_reset(a);
        const long after = calls;
        TEST_ASSERT_EQUAL(OKID_WARN_MISSING, added);
        TEST_ASSERT_GREATER_OR_EQUAL(0, found);
        TEST_ASSERT_EQUAL(OKID_OK, merged);
        TEST_ASSERT_EQUAL_MESSAGE(0, after - before, okid_backend());
        free(b1);
        free(b2);
        free(b3);
    }
    free(v);
}

static void nothing_in_any_method(void) {
    rig_t rig;
    rig_make(&rig);
    double* v = rig_record(&rig, N, 0.02, NULL, 3);
    for (int method = OKID_METHOD_OKID_ERA_DC; method <= OKID_METHOD_N4SID_SSARX; ++method) {
        const okid_identify_config_t ident = {
            .n_u = RIG_NU, .n_y = RIG_NY, .p = 20, .rows = 20, .fs_hz = RIG_FS, .method = (okid_method_t)method};
        const int lags = okid_identify_lags(&ident);
        const okid_accumulator_config_t sums = {
            .n_u = RIG_NU, .n_y = RIG_NY, .lags = lags, .forgetting = 1, .edges = 1};
        const okid_square_root_config_t root = {.n_u = RIG_NU, .n_y = RIG_NY, .lags = lags, .forgetting = 1};
        const size_t bytes[] = {okid_identify_memsize(&ident), okid_accumulator_memsize(&sums),
                                okid_square_root_memsize(&root)};
        void *b1 = malloc(bytes[0]), *b2 = malloc(bytes[1]), *b3 = malloc(bytes[2]);
        okid_identify_t* s;
        okid_accumulator_t* a;
        okid_square_root_t* q;
        okid_identified_t out;
        TEST_ASSERT_EQUAL(OKID_OK, okid_identify_create(&s, &ident, b1, bytes[0]));
        TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_create(&a, &sums, b2, bytes[1]));
        TEST_ASSERT_EQUAL(OKID_OK, okid_square_root_create(&q, &root, b3, bytes[2]));
        const long before = calls;
        okid_status_t added = okid_accumulator_add(a, v, N), scanned = OKID_OK;
        const okid_status_t found = okid_identify_run(s, a, &out);
        for (int order = 2; order <= 20; order += 2) scanned = okid_identify_order(s, order, &out);
        if (added == OKID_OK) added = okid_square_root_add(q, v, N);
        const okid_status_t again = okid_identify_run_factor(s, q, &out);
        const long after = calls;
        TEST_ASSERT_EQUAL(OKID_OK, added);
        TEST_ASSERT_GREATER_OR_EQUAL(0, found);
        TEST_ASSERT_GREATER_OR_EQUAL(0, scanned);
        TEST_ASSERT_GREATER_OR_EQUAL(0, again);
        TEST_ASSERT_EQUAL_MESSAGE(0, after - before, okid_backend());
        free(b1);
        free(b2);
        free(b3);
    }
    free(v);
}

static void nothing_without_inputs_nor_in_other_forms(void) {
    rig_t rig;
    rig_make(&rig);
    double* v = rig_record(&rig, N, 0.02, NULL, 3);
    for (int form = 0; form < 4; ++form) { // outputs only: ERA, ERA/DC; with inputs: innovations, literal
        const int n_u = form < 2 ? 0 : RIG_NU;
        const okid_identify_config_t ident = {.n_u = n_u,
                                              .n_y = RIG_M - n_u,
                                              .p = 20,
                                              .rows = 20,
                                              .fs_hz = RIG_FS,
                                              .method = form == 1 ? OKID_METHOD_OKID_ERA_DC : OKID_METHOD_OKID_ERA,
                                              .hankel = form < 2 ? OKID_HANKEL_SYSTEM : (okid_hankel_t)(form - 1)};
        const okid_accumulator_config_t sums = {
            .n_u = n_u, .n_y = RIG_M - n_u, .lags = okid_identify_lags(&ident), .forgetting = 1, .edges = 1};
        const okid_stabilization_config_t shape = {.n_y = RIG_M - n_u, .max_models = 10, .max_poles = 10};
        const size_t bytes[] = {okid_identify_memsize(&ident), okid_accumulator_memsize(&sums),
                                okid_stabilization_memsize(&shape)};
        void *b1 = malloc(bytes[0]), *b2 = malloc(bytes[1]), *b3 = malloc(bytes[2]);
        okid_identify_t* s;
        okid_accumulator_t* a;
        okid_stabilization_t* diagram;
        okid_identified_t out;
        okid_stabilized_t clusters;
        TEST_ASSERT_EQUAL(OKID_OK, okid_identify_create(&s, &ident, b1, bytes[0]));
        TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_create(&a, &sums, b2, bytes[1]));
        TEST_ASSERT_EQUAL(OKID_OK, okid_stabilization_create(&diagram, &shape, b3, bytes[2]));
        const long before = calls;
        const okid_status_t added = okid_accumulator_add(a, v, N), found = okid_identify_run(s, a, &out);
        okid_status_t scanned = OKID_OK;
        for (int order = 2; order <= 20 && scanned >= 0; order += 2) {
            scanned = okid_identify_poles(s, order, &out);
            if (scanned >= 0) scanned = okid_stabilization_add(diagram, &out);
        }
        const okid_status_t gathered = okid_stabilization_find(diagram, &clusters);
        const long after = calls;
        TEST_ASSERT_EQUAL(OKID_OK, added);
        TEST_ASSERT_GREATER_OR_EQUAL(0, found);
        TEST_ASSERT_GREATER_OR_EQUAL(0, scanned);
        TEST_ASSERT_EQUAL(OKID_OK, gathered);
        TEST_ASSERT_GREATER_THAN(0, clusters.cluster_count);
        TEST_ASSERT_EQUAL_MESSAGE(0, after - before, okid_backend());
        free(b1);
        free(b2);
        free(b3);
    }
    free(v);
}

int main(void) {
    UNITY_BEGIN();
    RUN_TEST(the_interposer_counts);
    RUN_TEST(nothing_after_create);
    RUN_TEST(nothing_for_standard_deviations);
    RUN_TEST(nothing_in_the_second_kernel);
    RUN_TEST(nothing_in_any_method);
    RUN_TEST(nothing_without_inputs_nor_in_other_forms);
    return UNITY_END();
}
