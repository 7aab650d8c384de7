// SPDX-License-Identifier: MIT
// Accumulators of all three kinds refuse each call that lacks one pointer, and what one of them was not created for.
#include "accumulators.hpp"
#include "refusals.hpp"

extern "C" void setUp() {}
extern "C" void tearDown() {}

namespace {

using okid_test::bytes_t;

enum { SAMPLES = 6, LAGS = 2 };
const double numbers[2 * SAMPLES] = {1, 2, -1, 3, 0, 1, 2, -2, 1, 1, -3, 2};
const float floats[2 * SAMPLES] = {1, 2, -1, 3, 0, 1, 2, -2, 1, 1, -3, 2};
const int16_t words[2 * SAMPLES] = {1, 2, -1, 3, 0, 1, 2, -2, 1, 1, -3, 2};
const int32_t longs[2 * SAMPLES] = {1, 2, -1, 3, 0, 1, 2, -2, 1, 1, -3, 2};

/// Accumulators of one input and one output.
struct sums : okid_test::sums {
    explicit sums(okid_sample_t sample, int32_t rows = 0, int32_t slots = 0)
        : okid_test::sums(config_of(sample, rows, slots)) {}
    static okid_accumulator_config_t config_of(okid_sample_t sample, int32_t rows, int32_t slots) {
        okid_accumulator_config_t c = okid_accumulator_defaults(1, 1, LAGS);
        c.sample = sample;
        c.block = rows;
        c.slots = slots;
        c.edges = slots == 0;
        return c;
    }
};

struct correlations : okid_test::correlations {
    explicit correlations(okid_sample_t sample) : okid_test::correlations(config_of(sample)) {}
    static okid_correlation_config_t config_of(okid_sample_t sample) {
        okid_correlation_config_t c = okid_correlation_defaults(1, 1, LAGS);
        c.sample = sample;
        c.slots = 64;
        return c;
    }
};

struct factors : okid_test::factors {
    factors() : okid_test::factors(okid_square_root_defaults(1, 1, LAGS)) {}
};

/// Samples may be missing where there are none.
template <class Object, class Sample, class Add>
void samples_are_needed(const char* name, Object* self, const Sample* samples, const Add& add) {
    size_t count = SAMPLES;
    const auto call = [&] { return add(self, samples, count); };
    each_pointer_is_needed(name, call, {self, samples});
    count = 0;
    samples = nullptr;
    TEST_ASSERT_EQUAL_MESSAGE(OKID_OK, call(), name);
}

void creating() {
    okid_accumulator_config_t a = okid_accumulator_defaults(1, 1, LAGS);
    const okid_accumulator_config_t* a_config = &a;
    okid_correlation_config_t c = okid_correlation_defaults(1, 1, LAGS);
    const okid_correlation_config_t* c_config = &c;
    okid_square_root_config_t r = okid_square_root_defaults(1, 1, LAGS);
    const okid_square_root_config_t* r_config = &r;
    size_t a_bytes = okid_accumulator_memsize(&a), c_bytes = okid_correlation_memsize(&c),
           r_bytes = okid_square_root_memsize(&r);
    bytes_t room(a_bytes + c_bytes + r_bytes);
    void *a_block = room.data(), *c_block = room.data(), *r_block = room.data();
    okid_accumulator_t *a_made = nullptr, **a_self = &a_made;
    okid_correlation_t *c_made = nullptr, **c_self = &c_made;
    okid_square_root_t *r_made = nullptr, **r_self = &r_made;
    const auto accumulator = [&] { return okid_accumulator_create(a_self, a_config, a_block, a_bytes); };
    each_pointer_is_needed("accumulator", accumulator, {a_self, a_config, a_block});
    each_size_has_a_least("accumulator", accumulator, {{&a.n_u, 0}, {&a.n_y, 1}, {&a.lags, 1}, {&a.buffer, 0}});
    each_value_is_refused("accumulator", accumulator, a.forgetting, {0.0, -1.0, 1.5});
    every_byte_is_needed("accumulator", accumulator, a_bytes);
    const auto correlation = [&] { return okid_correlation_create(c_self, c_config, c_block, c_bytes); };
    each_pointer_is_needed("correlation", correlation, {c_self, c_config, c_block});
    each_size_has_a_least("correlation", correlation, {{&c.n_u, 1}, {&c.n_y, 1}, {&c.lags, 1}, {&c.slots, 1}});
    each_value_is_refused("correlation", correlation, c.forgetting, {0.0, -1.0, 1.5});
    every_byte_is_needed("correlation", correlation, c_bytes);
    const auto square_root = [&] { return okid_square_root_create(r_self, r_config, r_block, r_bytes); };
    each_pointer_is_needed("square_root", square_root, {r_self, r_config, r_block});
    each_size_has_a_least("square_root", square_root, {{&r.n_u, 0}, {&r.n_y, 1}, {&r.lags, 1}, {&r.batch, 0}});
    each_value_is_refused("square_root", square_root, r.forgetting, {0.0, -1.0, 1.5});
    every_byte_is_needed("square_root", square_root, r_bytes);
}

void adding() {
    sums d(OKID_SAMPLE_DOUBLE), w(OKID_SAMPLE_INT16), l(OKID_SAMPLE_INT32);
    samples_are_needed("add", d.self, numbers, okid_accumulator_add);
    samples_are_needed("add_f32", d.self, floats, okid_accumulator_add_f32);
    samples_are_needed("add_i16", w.self, words, okid_accumulator_add_i16);
    samples_are_needed("add_i32", l.self, longs, okid_accumulator_add_i32);
    correlations cd(OKID_SAMPLE_DOUBLE), cw(OKID_SAMPLE_INT16), cl(OKID_SAMPLE_INT32);
    samples_are_needed("correlation_add", cd.self, numbers, okid_correlation_add);
    samples_are_needed("correlation_add_i16", cw.self, words, okid_correlation_add_i16);
    samples_are_needed("correlation_add_i32", cl.self, longs, okid_correlation_add_i32);
    factors r;
    samples_are_needed("square_root_add", r.self, numbers, okid_square_root_add);
    samples_are_needed("square_root_add_f32", r.self, floats, okid_square_root_add_f32);
    samples_are_needed("square_root_add_i16", r.self, words, okid_square_root_add_i16);
    samples_are_needed("square_root_add_i32", r.self, longs, okid_square_root_add_i32);
}

/// Sums of one kind of samples take no other.
void samples_of_another_kind() {
    const okid_sample_t kinds[] = {OKID_SAMPLE_DOUBLE, OKID_SAMPLE_INT16, OKID_SAMPLE_INT24, OKID_SAMPLE_INT32};
    for (const okid_sample_t kind : kinds) {
        sums a(kind);
        correlations c(kind);
        const okid_status_t number = kind == OKID_SAMPLE_DOUBLE ? OKID_OK : OKID_ERR_MISMATCH;
        const okid_status_t word = kind == OKID_SAMPLE_INT16 ? OKID_OK : OKID_ERR_MISMATCH;
        const okid_status_t code = kind == OKID_SAMPLE_INT24 || kind == OKID_SAMPLE_INT32 ? OKID_OK : OKID_ERR_MISMATCH;
        TEST_ASSERT_EQUAL(number, okid_accumulator_add(a.self, numbers, SAMPLES));
        TEST_ASSERT_EQUAL(number, okid_accumulator_add_f32(a.self, floats, SAMPLES));
        TEST_ASSERT_EQUAL(word, okid_accumulator_add_i16(a.self, words, SAMPLES));
        TEST_ASSERT_EQUAL(code, okid_accumulator_add_i32(a.self, longs, SAMPLES));
        TEST_ASSERT_EQUAL(number, okid_correlation_add(c.self, numbers, SAMPLES));
        TEST_ASSERT_EQUAL(word, okid_correlation_add_i16(c.self, words, SAMPLES));
        TEST_ASSERT_EQUAL(code, okid_correlation_add_i32(c.self, longs, SAMPLES));
    }
}

void putting_together_and_taking_apart() {
    sums whole(OKID_SAMPLE_DOUBLE), part(OKID_SAMPLE_DOUBLE), window(OKID_SAMPLE_DOUBLE, 2, 4);
    for (okid_accumulator_t* each : {part.self, window.self})
        TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_add(each, numbers, SAMPLES));
    okid_accumulator_t *to = whole.self, *from = part.self, *slots = window.self;
    const int32_t both[2] = {0, 1}, *channels = both;
    each_pointer_is_needed("copy", [&] { return okid_accumulator_copy(to, from); }, {to, from});
    each_pointer_is_needed("merge", [&] { return okid_accumulator_merge(to, from); }, {to, from});
    each_pointer_is_needed("remove", [&] { return okid_accumulator_remove(to, from, 1); }, {to, from});
    each_pointer_is_needed("take_slots", [&] { return okid_accumulator_take_slots(to, slots, 0, 1); }, {to, slots});
    each_pointer_is_needed("take_channels", [&] { return okid_accumulator_take_channels(to, from, channels); },
                           {to, from, channels});
    each_pointer_is_needed("pair_slots", [&] { return okid_accumulator_pair_slots(slots); }, {slots});
    each_pointer_is_needed("drop_slots", [&] { return okid_accumulator_drop_slots(slots, 1); }, {slots});
    each_pointer_is_needed("centre", [&] { return okid_accumulator_centre(to); }, {to});
    correlations c(OKID_SAMPLE_DOUBLE), d(OKID_SAMPLE_DOUBLE);
    TEST_ASSERT_EQUAL(OKID_OK, okid_correlation_add(d.self, numbers, SAMPLES));
    each_pointer_is_needed("correlation_merge", [&] { return okid_correlation_merge(c.self, d.self); },
                           {c.self, d.self});
    factors r, s;
    TEST_ASSERT_EQUAL(OKID_OK, okid_square_root_add(s.self, numbers, SAMPLES));
    each_pointer_is_needed("square_root_merge", [&] { return okid_square_root_merge(r.self, s.self); },
                           {r.self, s.self});
}

void results() {
    constexpr size_t n = 2 * (LAGS + 1);
    sums a(OKID_SAMPLE_DOUBLE);
    TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_add(a.self, numbers, SAMPLES));
    double room[n * n], energies[2], S[2 * n], head[2 * LAGS], tail[2 * LAGS], sum[2];
    double *gram = room, *energy = energies;
    okid_run_sums_t run{S, head, tail, sum, nullptr, 0}, *of = &run;
    each_pointer_is_needed("gram", [&] { return okid_accumulator_gram(a.self, OKID_DETREND_NONE, gram, nullptr); },
                           {a.self, gram});
    each_pointer_is_needed("energy", [&] { return okid_accumulator_energy(a.self, OKID_DETREND_NONE, energy); },
                           {a.self, energy});
    each_pointer_is_needed("run", [&] { return okid_accumulator_run(a.self, OKID_DETREND_NONE, of); },
                           {a.self, of, run.S, run.head, run.tail, run.sum});
    correlations c(OKID_SAMPLE_DOUBLE);
    TEST_ASSERT_EQUAL(OKID_OK, okid_correlation_add(c.self, numbers, SAMPLES));
    okid_correlation_sums_t found{}, *out = &found;
    size_t bytes = okid_correlation_sums_memsize(c.self);
    bytes_t memory(bytes);
    void* block = memory.data();
    const auto correlate = [&] { return okid_correlation_sums(c.self, OKID_DETREND_NONE, out, block, bytes); };
    each_pointer_is_needed("correlation_sums", correlate, {c.self, out, block});
    every_byte_is_needed("correlation_sums", correlate, bytes);
    factors r;
    TEST_ASSERT_EQUAL(OKID_OK, okid_square_root_add(r.self, numbers, SAMPLES));
    okid_real_t triangle[n * n], *factor = triangle;
    each_pointer_is_needed("square_root_gram",
                           [&] { return okid_square_root_gram(r.self, OKID_DETREND_NONE, gram, nullptr); },
                           {r.self, gram});
    each_pointer_is_needed("square_root_factor",
                           [&] { return okid_square_root_factor(r.self, OKID_DETREND_NONE, factor, nullptr); },
                           {r.self, factor});
}

void bytes_of_a_file() {
    sums a(OKID_SAMPLE_DOUBLE);
    correlations c(OKID_SAMPLE_DOUBLE);
    TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_add(a.self, numbers, SAMPLES));
    TEST_ASSERT_EQUAL(OKID_OK, okid_correlation_add(c.self, numbers, SAMPLES));
    size_t bytes = okid_accumulator_serialised_size(a.self);
    bytes_t file(bytes);
    void* out = file.data();
    const void* in = file.data();
    okid_accumulator_config_t found{}, *config = &found;
    const auto write = [&] { return okid_accumulator_serialise(a.self, out, bytes); };
    each_pointer_is_needed("serialise", write, {a.self, out});
    every_byte_is_needed("serialise", write, bytes);
    each_pointer_is_needed("peek", [&] { return okid_accumulator_peek(in, bytes, config); }, {in, config});
    each_pointer_is_needed("deserialise", [&] { return okid_accumulator_deserialise(a.self, in, bytes); },
                           {a.self, in});
    bytes = okid_correlation_serialised_size(c.self);
    file.resize(bytes);
    in = out = file.data();
    okid_correlation_config_t of_correlations{}, *correlation = &of_correlations;
    const auto write_correlation = [&] { return okid_correlation_serialise(c.self, out, bytes); };
    each_pointer_is_needed("correlation_serialise", write_correlation, {c.self, out});
    every_byte_is_needed("correlation_serialise", write_correlation, bytes);
    each_pointer_is_needed("correlation_peek", [&] { return okid_correlation_peek(in, bytes, correlation); },
                           {in, correlation});
    each_pointer_is_needed("correlation_deserialise", [&] { return okid_correlation_deserialise(c.self, in, bytes); },
                           {c.self, in});
}

/// What answers nothing does nothing, and without an object there is nothing to count.
void without_an_object_nothing_happens() {
    const double scale[2] = {1, 1};
    okid_accumulator_stats_t a_stats, c_stats, r_stats;
    okid_accumulator_config_t a_config;
    okid_correlation_config_t c_config;
    okid_square_root_config_t r_config;
    a_stats.samples = c_stats.samples = r_stats.samples = a_config.n_y = c_config.n_y = r_config.n_y = 7;
    okid_accumulator_reset(nullptr);
    okid_accumulator_set_units(nullptr, scale, nullptr);
    okid_accumulator_gap(nullptr, 1);
    okid_accumulator_stats(nullptr, &a_stats);
    okid_accumulator_config(nullptr, &a_config);
    okid_correlation_reset(nullptr);
    okid_correlation_set_units(nullptr, scale);
    okid_correlation_gap(nullptr, 1);
    okid_correlation_stats(nullptr, &c_stats);
    okid_correlation_config(nullptr, &c_config);
    okid_square_root_reset(nullptr);
    okid_square_root_set_units(nullptr, scale, nullptr);
    okid_square_root_gap(nullptr, 1);
    okid_square_root_stats(nullptr, &r_stats);
    okid_square_root_config(nullptr, &r_config);
    for (const okid_accumulator_stats_t* each : {&a_stats, &c_stats, &r_stats})
        TEST_ASSERT_EQUAL_INT64(0, each->samples);
    for (const int32_t outputs : {a_config.n_y, c_config.n_y, r_config.n_y}) TEST_ASSERT_EQUAL_INT32(0, outputs);
    TEST_ASSERT_EQUAL_INT64(0, okid_accumulator_rows(nullptr));
    TEST_ASSERT_EQUAL_INT64(0, okid_square_root_rows(nullptr));
    TEST_ASSERT_EQUAL_INT32(0, okid_accumulator_slots(nullptr));
    TEST_ASSERT_EQUAL_INT64(0, okid_accumulator_slot_rows(nullptr, 0));
    TEST_ASSERT_EQUAL_UINT64(0, okid_accumulator_serialised_size(nullptr));
    TEST_ASSERT_EQUAL_UINT64(0, okid_correlation_serialised_size(nullptr));
    sums a(OKID_SAMPLE_DOUBLE);
    correlations c(OKID_SAMPLE_DOUBLE);
    factors r;
    okid_accumulator_set_units(a.self, nullptr, nullptr);
    okid_accumulator_stats(a.self, nullptr);
    okid_accumulator_config(a.self, nullptr);
    okid_correlation_set_units(c.self, nullptr);
    okid_correlation_stats(c.self, nullptr);
    okid_correlation_config(c.self, nullptr);
    okid_square_root_set_units(r.self, nullptr, nullptr);
    okid_square_root_stats(r.self, nullptr);
    okid_square_root_config(r.self, nullptr);
}

/// A gap of less than no samples is none: the run goes on, and the row behind it is a row.
void negative_gaps_are_none() {
    sums a(OKID_SAMPLE_DOUBLE);
    correlations c(OKID_SAMPLE_DOUBLE);
    factors r;
    TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_add(a.self, numbers, LAGS));
    TEST_ASSERT_EQUAL(OKID_OK, okid_correlation_add(c.self, numbers, LAGS));
    TEST_ASSERT_EQUAL(OKID_OK, okid_square_root_add(r.self, numbers, LAGS));
    a.gap(-1);
    c.gap(-1);
    r.gap(-1);
    TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_add(a.self, numbers, 1));
    TEST_ASSERT_EQUAL(OKID_OK, okid_correlation_add(c.self, numbers, 1));
    TEST_ASSERT_EQUAL(OKID_OK, okid_square_root_add(r.self, numbers, 1));
    for (const okid_accumulator_stats_t& each : {a.stats(), c.stats(), r.stats()}) {
        TEST_ASSERT_EQUAL_INT64(1, each.rows);
        TEST_ASSERT_EQUAL_INT64(0, each.gaps);
        TEST_ASSERT_EQUAL_INT64(0, each.missing);
    }
}

} // namespace

int main() {
    UNITY_BEGIN();
    RUN_TEST(creating);
    RUN_TEST(adding);
    RUN_TEST(samples_of_another_kind);
    RUN_TEST(putting_together_and_taking_apart);
    RUN_TEST(results);
    RUN_TEST(bytes_of_a_file);
    RUN_TEST(without_an_object_nothing_happens);
    RUN_TEST(negative_gaps_are_none);
    return UNITY_END();
}
