// SPDX-License-Identifier: MIT
// Every X_memsize() of the public headers takes the least of each dimension and refuses what lies below, each alone.
#include <okid/accumulator.h>
#include <okid/change.h>
#include <okid/correlation.h>
#include <okid/identify.h>
#include <okid/mechanics.h>
#include <okid/mkr.h>
#include <okid/modal.h>
#include <okid/model.h>
#include <okid/refine.h>
#include <okid/stabilization.h>
#include <okid/steps/era.h>
#include <okid/steps/observer.h>
#include <okid/steps/skew.h>
#include <okid/steps/square_root.h>
#include <okid/steps/subspace.h>
#include <okid/track.h>
#include <okid/uncertainty.h>
#include <okid/watch.h>
#include <unity.h>

void setUp(void) {}
void tearDown(void) {}

typedef const int32_t sizes_t[4];

static size_t accumulator(sizes_t n) {
    okid_accumulator_config_t c = okid_accumulator_defaults(n[0], n[1], n[2]);
    c.buffer = n[3];
    return okid_accumulator_memsize(&c);
}
static size_t blocks_of_sums(sizes_t n) {
    okid_accumulator_config_t c = okid_accumulator_defaults(2, 2, 2);
    c.edges = 1;
    c.block = n[0];
    c.slots = n[1];
    c.spare_slots = n[2];
    return okid_accumulator_memsize(&c);
}
static size_t square_root(sizes_t n) {
    const okid_square_root_config_t c = {.n_u = n[0], .n_y = n[1], .lags = n[2], .batch = n[3], .forgetting = 1};
    return okid_square_root_memsize(&c);
}
static size_t blocks_of_factors(sizes_t n) {
    const okid_square_root_config_t c = {
        .n_u = 2, .n_y = 2, .lags = 2, .block = n[0], .slots = n[1], .spare_slots = n[2], .forgetting = 1};
    return okid_square_root_memsize(&c);
}
static size_t correlation(sizes_t n) {
    okid_correlation_config_t c = okid_correlation_defaults(n[0], n[1], n[2]);
    c.own_lags = n[3];
    return okid_correlation_memsize(&c);
}
static size_t blocks_of_correlations(sizes_t n) {
    okid_correlation_config_t c = okid_correlation_defaults(2, 2, 2);
    c.block = n[0];
    c.slots = n[1];
    c.buffer = n[2];
    return okid_correlation_memsize(&c);
}
static size_t change(sizes_t n) {
    okid_change_config_t c = okid_change_defaults(n[0], n[1], n[2], 100);
    c.blocks = n[3];
    return okid_change_memsize(&c);
}
static size_t watch(sizes_t n) {
    const okid_watch_config_t c = okid_watch_defaults(n[0], n[1], n[2], n[3]);
    return okid_watch_memsize(&c);
}
static size_t judged_by(sizes_t n) {
    okid_watch_config_t c = okid_watch_defaults(1, 1, 4, 8);
    c.block = n[0];
    c.learn = n[1];
    c.confirm = n[2];
    return okid_watch_memsize(&c);
}
static size_t track(sizes_t n) {
    okid_track_config_t c = okid_track_defaults(n[0], n[1]);
    c.max_tracks = n[2];
    c.born = n[3];
    return okid_track_memsize(&c);
}
static size_t stabilization(sizes_t n) {
    const okid_stabilization_config_t c = okid_stabilization_defaults(n[0], n[1], n[2]);
    return okid_stabilization_memsize(&c);
}
static size_t identify(sizes_t n) {
    okid_identify_config_t c = okid_identify_defaults(n[0], n[1], 100);
    c.p = n[2];
    c.rows = n[3];
    return okid_identify_memsize(&c);
}
static size_t identify_outputs(sizes_t n) {
    okid_identify_config_t c = okid_identify_defaults(0, n[0], 100);
    c.p = 4;
    c.rows = n[1];
    c.order = n[2];
    c.max_order = n[3];
    return okid_identify_memsize(&c);
}
static size_t jackknife(sizes_t n) {
    okid_identify_config_t c = okid_identify_defaults(n[0], n[1], 100);
    c.p = n[2];
    c.rows = n[3];
    okid_accumulator_config_t sums = okid_accumulator_defaults(c.n_u, c.n_y, okid_identify_lags(&c));
    sums.edges = 1;
    const okid_jackknife_config_t both = okid_jackknife_defaults(&c, &sums);
    return okid_jackknife_memsize(&both);
}
static size_t replicates(sizes_t n) {
    const okid_replicates_config_t c = okid_replicates_defaults(n[0], n[1], n[2]);
    return okid_replicates_memsize(&c);
}
static size_t replicates_of_masses(sizes_t n) {
    const okid_mkr_config_t mkr = okid_mkr_defaults(n[3], 0.01);
    okid_replicates_config_t c = okid_replicates_defaults(n[0], n[1], n[2]);
    c.mkr = &mkr;
    return okid_replicates_memsize(&c);
}
static size_t refine(sizes_t n) {
    okid_refine_config_t c = okid_refine_defaults(n[0], n[1], n[2]);
    c.runs = n[3];
    return okid_refine_memsize(&c);
}
static size_t era(sizes_t n) {
    okid_era_config_t c = okid_era_defaults(n[0], n[1], n[2]);
    c.cols = n[3];
    return okid_era_memsize(&c);
}
static size_t subspace(sizes_t n) {
    const okid_subspace_config_t c = {.n_u = n[0], .n_y = n[1], .rows = n[2], .max_order = n[3]};
    return okid_subspace_memsize(&c);
}
static size_t output_error(sizes_t n) { return okid_subspace_output_error_memsize(n[0], n[1], n[2], n[3]); }
static size_t observer(sizes_t n) {
    const okid_observer_config_t c = okid_observer_defaults(n[0], n[1], n[2]);
    return okid_observer_memsize(&c);
}
static size_t observer_factor(sizes_t n) {
    const okid_observer_config_t c = okid_observer_defaults(n[0], n[1], n[2]);
    return okid_observer_factor_memsize(&c);
}
static size_t structured(sizes_t n) {
    const okid_observer_config_t c = okid_observer_defaults(n[0], n[1], n[2]);
    return okid_structured_memsize(&c);
}
static size_t skew(sizes_t n) {
    const int32_t sensing[4] = {0};
    okid_mkr_config_t mkr = okid_mkr_defaults(2, 0.01);
    mkr.output_sensing = sensing;
    okid_skew_config_t c = okid_skew_defaults(n[0], n[1], n[2], &mkr);
    c.replicates = n[3];
    return okid_skew_memsize(&c);
}
static size_t skew_of_masses(sizes_t n) {
    const int32_t sensing[4] = {0};
    okid_mkr_config_t mkr = okid_mkr_defaults(n[0], 0.01);
    mkr.output_sensing = sensing;
    const okid_skew_config_t c = okid_skew_defaults(1, 1, 4, &mkr);
    return okid_skew_memsize(&c);
}
static size_t mkr(sizes_t n) { return okid_mkr_memsize(n[0], n[1], n[2], n[3]); }
static size_t mechanics(sizes_t n) { return okid_mechanics_memsize(n[0], n[1]); }
static size_t hold(sizes_t n) { return okid_mechanics_hold_memsize(n[0], n[1], n[2]); }
static size_t modal(sizes_t n) { return okid_modal_memsize(n[0], n[1]); }
static size_t model_fit(sizes_t n) {
    const okid_model_t m = {.n_u = n[0], .n_y = n[1], .n_z = n[2]};
    return okid_model_fit_memsize(&m);
}

/// The dimensions in the order of the header, the least of each, and sizes that are fine with the least of any one.
static const struct {
    const char* name;
    size_t (*bytes)(sizes_t);
    int count;
    int32_t least[4], fine[4];
} each_memsize[] = {
    {"accumulator: n_u, n_y, lags, buffer", accumulator, 4, {0, 1, 1, 0}, {2, 2, 2, 2}},
    {"accumulator: block, slots, spare_slots", blocks_of_sums, 3, {0, 0, 0}, {0, 0, 0}},
    {"square_root: n_u, n_y, lags, batch", square_root, 4, {0, 1, 1, 0}, {2, 2, 2, 2}},
    {"square_root: block, slots, spare_slots", blocks_of_factors, 3, {0, 0, 0}, {0, 0, 0}},
    {"correlation: n_u, n_y, lags, own_lags", correlation, 4, {1, 1, 1, 0}, {2, 2, 2, 1}},
    {"correlation: block, slots, buffer", blocks_of_correlations, 3, {0, 1, 0}, {2, 2, 2}},
    {"change: n_u, n_y, rows, blocks", change, 4, {0, 1, 2, 0}, {2, 2, 4, 20}},
    {"watch: n_u, n_y, max_order, lead", watch, 4, {0, 1, 1, 0}, {2, 2, 2, 2}},
    {"watch: block, learn, confirm", judged_by, 3, {0, 0, 0}, {2, 2, 2}},
    {"track: n_y, max_modes, max_tracks, born", track, 4, {1, 1, 1, 0}, {2, 2, 2, 2}},
    {"stabilization: n_y, max_models, max_poles", stabilization, 3, {1, 1, 1}, {2, 2, 2}},
    {"identify: n_u, n_y, p, rows", identify, 4, {0, 1, 1, 0}, {2, 2, 4, 8}},
    {"identify, no inputs: n_y, rows, order, max_order", identify_outputs, 4, {1, 0, 0, 0}, {2, 8, 4, 4}},
    {"jackknife: n_u, n_y, p, rows", jackknife, 4, {0, 1, 1, 0}, {2, 2, 4, 8}},
    {"replicates: n_u, n_y, n_z", replicates, 3, {0, 1, 1}, {2, 2, 2}},
    {"replicates: n_u, n_y, n_z, n_x", replicates_of_masses, 4, {1, 1, 1, 1}, {2, 2, 4, 2}},
    {"refine: n_u, n_y, n_z, runs", refine, 4, {0, 1, 1, 0}, {2, 2, 2, 2}},
    {"era: n_u, n_y, rows, cols", era, 4, {1, 1, 1, 1}, {2, 2, 2, 2}},
    {"subspace: n_u, n_y, rows, max_order", subspace, 4, {0, 1, 2, 0}, {2, 2, 4, 4}},
    {"subspace_output_error: n_u, n_y, n_z, records", output_error, 4, {0, 1, 1, 1}, {2, 2, 2, 2}},
    {"observer: n_u, n_y, p", observer, 3, {1, 1, 1}, {2, 2, 2}},
    {"observer_factor: n_u, n_y, p", observer_factor, 3, {1, 1, 1}, {2, 2, 2}},
    {"structured: n_u, n_y, p", structured, 3, {1, 1, 1}, {2, 2, 2}},
    {"skew: n_u, n_y, n_z, replicates", skew, 4, {1, 1, 1, 2}, {2, 2, 4, 20}},
    {"skew: n_x", skew_of_masses, 1, {1}, {2}},
    {"mkr: n_u, n_y, n_z, n_x", mkr, 4, {1, 1, 1, 1}, {2, 2, 4, 2}},
    {"mechanics: n_x, n_u", mechanics, 2, {1, 1}, {2, 2}},
    {"mechanics_hold: n_u, n_y, n_z", hold, 3, {1, 1, 1}, {2, 2, 2}},
    {"modal: n_y, n_z", modal, 2, {1, 1}, {2, 2}},
    {"model_fit: n_u, n_y, n_z", model_fit, 3, {0, 1, 1}, {2, 2, 2}},
};

static void each_dimension_alone_has_its_least(void) {
    for (size_t i = 0; i < sizeof each_memsize / sizeof *each_memsize; ++i)
        for (int k = 0; k < each_memsize[i].count; ++k) {
            int32_t n[4];
            for (int j = 0; j < 4; ++j) n[j] = each_memsize[i].fine[j];
            TEST_ASSERT_TRUE_MESSAGE(each_memsize[i].bytes(n) > 0, each_memsize[i].name);
            n[k] = each_memsize[i].least[k];
            TEST_ASSERT_TRUE_MESSAGE(each_memsize[i].bytes(n) > 0, each_memsize[i].name);
            --n[k];
            TEST_ASSERT_EQUAL_UINT64_MESSAGE(0, each_memsize[i].bytes(n), each_memsize[i].name);
        }
}

static void no_configuration_needs_no_memory(void) {
    TEST_ASSERT_EQUAL_UINT64(0, okid_accumulator_memsize(NULL));
    TEST_ASSERT_EQUAL_UINT64(0, okid_square_root_memsize(NULL));
    TEST_ASSERT_EQUAL_UINT64(0, okid_correlation_memsize(NULL));
    TEST_ASSERT_EQUAL_UINT64(0, okid_correlation_sums_memsize(NULL));
    TEST_ASSERT_EQUAL_UINT64(0, okid_change_memsize(NULL));
    TEST_ASSERT_EQUAL_UINT64(0, okid_watch_memsize(NULL));
    TEST_ASSERT_EQUAL_UINT64(0, okid_track_memsize(NULL));
    TEST_ASSERT_EQUAL_UINT64(0, okid_stabilization_memsize(NULL));
    TEST_ASSERT_EQUAL_UINT64(0, okid_identify_memsize(NULL));
    TEST_ASSERT_EQUAL_UINT64(0, okid_jackknife_memsize(NULL));
    TEST_ASSERT_EQUAL_UINT64(0, okid_replicates_memsize(NULL));
    TEST_ASSERT_EQUAL_UINT64(0, okid_refine_memsize(NULL));
    TEST_ASSERT_EQUAL_UINT64(0, okid_era_memsize(NULL));
    TEST_ASSERT_EQUAL_UINT64(0, okid_subspace_memsize(NULL));
    TEST_ASSERT_EQUAL_UINT64(0, okid_observer_memsize(NULL));
    TEST_ASSERT_EQUAL_UINT64(0, okid_observer_factor_memsize(NULL));
    TEST_ASSERT_EQUAL_UINT64(0, okid_structured_memsize(NULL));
    TEST_ASSERT_EQUAL_UINT64(0, okid_skew_memsize(NULL));
    TEST_ASSERT_EQUAL_UINT64(0, okid_model_fit_memsize(NULL));
}

int main(void) {
    UNITY_BEGIN();
    RUN_TEST(each_dimension_alone_has_its_least);
    RUN_TEST(no_configuration_needs_no_memory);
    return UNITY_END();
}
