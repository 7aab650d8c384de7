// SPDX-License-Identifier: MIT
// Accumulators that differ in one number of their configuration, each alone: they go together where that does no harm.
#include "accumulators.hpp"

#include <cmath>

extern "C" void setUp() {}
extern "C" void tearDown() {}

using namespace okid_test;

namespace {

/// Growing sums with room for further records.
okid_accumulator_config_t growing() {
    okid_accumulator_config_t c = okid_accumulator_defaults(2, 2, 3);
    c.edges = 1;
    return c;
}

okid_accumulator_config_t window() {
    okid_accumulator_config_t c = okid_accumulator_defaults(2, 2, 3);
    c.block = 4;
    c.slots = 3;
    c.spare_slots = 1;
    return c;
}

okid_accumulator_config_t fading() {
    okid_accumulator_config_t c = growing();
    c.block = 4;
    c.forgetting = 0.9;
    return c;
}

/// The configuration with one number changed.
template <class Config, class Number> Config with(Config c, Number Config::* place, Number value) {
    c.*place = value;
    return c;
}

using accumulator_config = okid_accumulator_config_t;

void merging() {
    const sums one(growing());
    const auto expect = [&](okid_status_t status, const accumulator_config& c) {
        const sums other(c);
        TEST_ASSERT_EQUAL(status, okid_accumulator_merge(one.self, other.self));
        if (c.lags == growing().lags) TEST_ASSERT_EQUAL(status, okid_accumulator_merge(other.self, one.self));
    };
    expect(OKID_OK, growing());
    for (const int32_t off : {-1, 1}) {
        expect(OKID_ERR_MISMATCH, with(growing(), &accumulator_config::n_u, 2 + off));
        expect(OKID_ERR_MISMATCH, with(growing(), &accumulator_config::n_y, 2 + off));
    }
    expect(OKID_ERR_MISMATCH, with(growing(), &accumulator_config::lags, 2));
    expect(OKID_OK, with(growing(), &accumulator_config::lags, 4)); // the first ones are taken
    expect(OKID_ERR_MISMATCH, with(growing(), &accumulator_config::sample, OKID_SAMPLE_INT16));
    expect(OKID_ERR_MISMATCH, with(growing(), &accumulator_config::edges, 0));
    expect(OKID_ERR_MISMATCH, fading());
    expect(OKID_ERR_MISMATCH, with(window(), &accumulator_config::edges, 1));
    expect(OKID_OK, with(growing(), &accumulator_config::buffer, 7));
    expect(OKID_OK, with(growing(), &accumulator_config::block, 5));
    TEST_ASSERT_EQUAL(OKID_ERR_MISMATCH, okid_accumulator_merge(one.self, one.self));
}

void removing() {
    const sums one(growing()), faded(fading());
    const auto expect = [&](okid_status_t status, const accumulator_config& c) {
        const sums other(c);
        TEST_ASSERT_EQUAL(status, okid_accumulator_remove(one.self, other.self, 1));
        TEST_ASSERT_EQUAL(status, okid_accumulator_remove(other.self, one.self, 1));
    };
    expect(OKID_OK, growing());
    for (const int32_t off : {-1, 1}) {
        expect(OKID_ERR_MISMATCH, with(growing(), &accumulator_config::n_u, 2 + off));
        expect(OKID_ERR_MISMATCH, with(growing(), &accumulator_config::n_y, 2 + off));
        expect(OKID_ERR_MISMATCH, with(growing(), &accumulator_config::lags, 3 + off));
    }
    expect(OKID_ERR_MISMATCH, with(growing(), &accumulator_config::sample, OKID_SAMPLE_INT16));
    expect(OKID_ERR_MISMATCH, with(growing(), &accumulator_config::edges, 0));
    expect(OKID_ERR_MISMATCH, with(window(), &accumulator_config::edges, 1));
    expect(OKID_ERR_MISMATCH, fading());
    TEST_ASSERT_EQUAL(OKID_ERR_MISMATCH, okid_accumulator_remove(one.self, one.self, 1));
    const sums part(growing()), fading_part(fading());
    for (const double weight : {0.0, -1.0, 1.01, std::nan("")}) {
        TEST_ASSERT_EQUAL(OKID_ERR_RANGE, okid_accumulator_remove(one.self, part.self, weight));
        TEST_ASSERT_EQUAL(OKID_ERR_RANGE, okid_accumulator_remove(faded.self, fading_part.self, weight));
    }
    TEST_ASSERT_EQUAL(OKID_ERR_RANGE, okid_accumulator_remove(one.self, part.self, 0.5)); // nothing fades
    TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_remove(faded.self, fading_part.self, 0.5));
    const double samples[4 * 5] = {1, 2, 3, 4, 5, 6, 7, 8, 9, 1, 2, 3, 4, 5, 6, 7, 8, 9, 1, 2};
    TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_add(part.self, samples, 5)); // more than there is
    TEST_ASSERT_EQUAL(OKID_ERR_MISMATCH, okid_accumulator_remove(one.self, part.self, 1));
}

void slots_of_a_window() {
    const sums from(window());
    double samples[4 * 11];
    for (int i = 0; i < 4 * 11; ++i) samples[i] = std::sin(i * i);
    TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_add(from.self, samples, 11)); // three of lags, two slots of four
    TEST_ASSERT_EQUAL_INT32(3, okid_accumulator_slots(from.self));
    const auto expect = [&](okid_status_t status, const accumulator_config& c) {
        const sums to(c);
        TEST_ASSERT_EQUAL(status, okid_accumulator_take_slots(to.self, from.self, 0, 2));
    };
    expect(OKID_OK, growing());
    expect(OKID_OK, with(growing(), &accumulator_config::lags, 2));
    expect(OKID_ERR_MISMATCH, with(growing(), &accumulator_config::lags, 4));
    for (const int32_t off : {-1, 1}) {
        expect(OKID_ERR_MISMATCH, with(growing(), &accumulator_config::n_u, 2 + off));
        expect(OKID_ERR_MISMATCH, with(growing(), &accumulator_config::n_y, 2 + off));
    }
    expect(OKID_ERR_MISMATCH, with(growing(), &accumulator_config::sample, OKID_SAMPLE_INT16));
    expect(OKID_ERR_MISMATCH, with(growing(), &accumulator_config::edges, 0));
    expect(OKID_ERR_MISMATCH, with(window(), &accumulator_config::edges, 1));
    expect(OKID_ERR_MISMATCH, fading());
    const sums to(growing());
    TEST_ASSERT_EQUAL(OKID_ERR_DIM, okid_accumulator_take_slots(to.self, from.self, -1, 1));
    TEST_ASSERT_EQUAL(OKID_ERR_DIM, okid_accumulator_take_slots(to.self, from.self, 0, -1));
    TEST_ASSERT_EQUAL(OKID_ERR_DIM, okid_accumulator_take_slots(to.self, from.self, 0, 4));
    TEST_ASSERT_EQUAL(OKID_ERR_DIM, okid_accumulator_take_slots(to.self, from.self, 2, 2));
    TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_take_slots(to.self, from.self, 0, 0));
    TEST_ASSERT_EQUAL_INT64(0, okid_accumulator_rows(to.self));
    TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_take_slots(to.self, from.self, 0, 3));
    TEST_ASSERT_EQUAL_INT64(8, okid_accumulator_rows(to.self));
    for (const int32_t k : {-1, 3}) TEST_ASSERT_EQUAL_INT64(0, okid_accumulator_slot_rows(from.self, k));
    TEST_ASSERT_EQUAL(OKID_ERR_DIM, okid_accumulator_drop_slots(from.self, -1));
    TEST_ASSERT_EQUAL(OKID_ERR_DIM, okid_accumulator_drop_slots(from.self, 3));
    TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_drop_slots(from.self, 0));
    TEST_ASSERT_EQUAL_INT64(8, okid_accumulator_rows(from.self));
    TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_drop_slots(from.self, 1));
    TEST_ASSERT_EQUAL_INT64(4, okid_accumulator_rows(from.self));
    TEST_ASSERT_EQUAL(OKID_ERR_MISMATCH, okid_accumulator_pair_slots(to.self)); // no window
}

void channels_of_another() {
    const sums from(growing());
    const int32_t all[4] = {0, 1, 2, 3};
    const auto expect = [&](okid_status_t status, const accumulator_config& c) {
        const sums to(c);
        TEST_ASSERT_EQUAL(status, okid_accumulator_take_channels(to.self, from.self, all));
    };
    expect(OKID_OK, growing());
    for (const int32_t off : {-1, 1}) expect(OKID_ERR_MISMATCH, with(growing(), &accumulator_config::lags, 3 + off));
    expect(OKID_ERR_MISMATCH, with(growing(), &accumulator_config::sample, OKID_SAMPLE_INT16));
    expect(OKID_ERR_MISMATCH, with(growing(), &accumulator_config::edges, 0));
    expect(OKID_ERR_MISMATCH, with(window(), &accumulator_config::edges, 1));
    expect(OKID_ERR_MISMATCH, fading());
    TEST_ASSERT_EQUAL(OKID_ERR_MISMATCH, okid_accumulator_take_channels(from.self, from.self, all));
    const sums windowed(window()), more(with(window(), &accumulator_config::spare_slots, 2));
    TEST_ASSERT_EQUAL(OKID_ERR_MISMATCH, okid_accumulator_take_channels(more.self, windowed.self, all));
    accumulator_config fewer = growing();
    fewer.n_u = fewer.n_y = 1;
    const sums to(fewer);
    const struct {
        okid_status_t status;
        int32_t channels[2];
    } each[] = {{OKID_OK, {0, 2}},      {OKID_OK, {1, 3}},      {OKID_ERR_DIM, {-1, 2}}, {OKID_ERR_DIM, {0, 4}},
                {OKID_ERR_DIM, {2, 3}}, {OKID_ERR_DIM, {0, 1}}, {OKID_ERR_DIM, {2, 1}}};
    for (const auto& one : each)
        TEST_ASSERT_EQUAL(one.status, okid_accumulator_take_channels(to.self, from.self, one.channels));
    accumulator_config outputs = growing();
    outputs.n_u = 0;
    const sums seen(outputs);
    const int32_t twice[2] = {2, 2};
    TEST_ASSERT_EQUAL(OKID_ERR_DIM, okid_accumulator_take_channels(seen.self, from.self, twice));
}

/// What a copy and a file need in common.
void copies_and_files() {
    for (const accumulator_config& base : {growing(), window(), fading()}) {
        const sums one(base);
        const bytes_t file = one.file();
        const auto expect = [&](okid_status_t of_a_copy, okid_status_t of_a_file, const accumulator_config& c) {
            if (okid_accumulator_memsize(&c) == 0) return;
            const sums other(c);
            TEST_ASSERT_EQUAL(of_a_copy, okid_accumulator_copy(other.self, one.self));
            TEST_ASSERT_EQUAL(of_a_file, okid_accumulator_deserialise(other.self, file.data(), file.size()));
        };
        const okid_status_t no = OKID_ERR_MISMATCH, yes = OKID_OK;
        expect(yes, yes, base);
        for (const int32_t off : {-1, 1}) {
            expect(no, no, with(base, &accumulator_config::n_u, base.n_u + off));
            expect(no, no, with(base, &accumulator_config::n_y, base.n_y + off));
            expect(no, no, with(base, &accumulator_config::lags, base.lags + off));
            expect(no, no, with(base, &accumulator_config::block, base.block + off));
            expect(no, no, with(base, &accumulator_config::slots, base.slots + off));
            expect(no, no, with(base, &accumulator_config::spare_slots, base.spare_slots + off));
            expect(no, no, with(base, &accumulator_config::forgetting, base.forgetting + 0.05 * off));
        }
        expect(no, no, with(base, &accumulator_config::sample, OKID_SAMPLE_INT16));
        expect(no, no, with(base, &accumulator_config::edges, 1 - base.edges));
        expect(no, yes, with(base, &accumulator_config::buffer, 7));
        expect(no, yes, with(base, &accumulator_config::saturated_missing, 1));
        TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_copy(one.self, one.self));
    }
    const accumulator_config direct = with(growing(), &accumulator_config::lags, 80);
    const sums one(direct), bulk(with(direct, &accumulator_config::bulk, 1));
    TEST_ASSERT_GREATER_THAN_UINT64(one.block.size(), bulk.block.size()); // it pays at so many lags
    TEST_ASSERT_EQUAL(OKID_ERR_MISMATCH, okid_accumulator_copy(bulk.self, one.self));
    TEST_ASSERT_EQUAL(OKID_ERR_MISMATCH, okid_accumulator_copy(one.self, bulk.self));
    const bytes_t file = one.file();
    TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_deserialise(bulk.self, file.data(), file.size()));
}

using correlation_config = okid_correlation_config_t;

void correlations_of_another_kind() {
    correlation_config base = okid_correlation_defaults(2, 2, 5), blocks = base;
    base.own_lags = blocks.own_lags = 2;
    base.slots = blocks.slots = 3;
    blocks.block = 4;
    blocks.forgetting = 0.9;
    const correlations one(base);
    const auto expect = [&](okid_status_t status, const correlation_config& c) {
        const correlations other(c);
        TEST_ASSERT_EQUAL(status, okid_correlation_merge(one.self, other.self));
        TEST_ASSERT_EQUAL(status, okid_correlation_merge(other.self, one.self));
    };
    expect(OKID_OK, base);
    for (const int32_t off : {-1, 1}) {
        expect(OKID_ERR_MISMATCH, with(base, &correlation_config::n_u, 2 + off));
        expect(OKID_ERR_MISMATCH, with(base, &correlation_config::n_y, 2 + off));
        expect(OKID_ERR_MISMATCH, with(base, &correlation_config::lags, 5 + off));
        expect(OKID_ERR_MISMATCH, with(base, &correlation_config::own_lags, 2 + off));
        expect(OKID_OK, with(base, &correlation_config::slots, 3 + off));
    }
    expect(OKID_ERR_MISMATCH, with(base, &correlation_config::sample, OKID_SAMPLE_INT16));
    expect(OKID_ERR_MISMATCH, with(base, &correlation_config::block, 4));
    TEST_ASSERT_EQUAL(OKID_ERR_MISMATCH, okid_correlation_merge(one.self, one.self));
    for (const correlation_config& config : {base, blocks}) {
        const bytes_t file = correlations(config).file();
        const auto read = [&](okid_status_t status, const correlation_config& c) {
            if (okid_correlation_memsize(&c) == 0) return;
            const correlations other(c);
            TEST_ASSERT_EQUAL(status, okid_correlation_deserialise(other.self, file.data(), file.size()));
        };
        read(OKID_OK, config);
        for (const int32_t off : {-1, 1}) {
            read(OKID_ERR_MISMATCH, with(config, &correlation_config::n_u, config.n_u + off));
            read(OKID_ERR_MISMATCH, with(config, &correlation_config::n_y, config.n_y + off));
            read(OKID_ERR_MISMATCH, with(config, &correlation_config::lags, config.lags + off));
            read(OKID_ERR_MISMATCH, with(config, &correlation_config::own_lags, config.own_lags + off));
            read(OKID_ERR_MISMATCH, with(config, &correlation_config::block, config.block + off));
            read(OKID_ERR_MISMATCH, with(config, &correlation_config::slots, config.slots + off));
            read(OKID_ERR_MISMATCH, with(config, &correlation_config::forgetting, config.forgetting + 0.05 * off));
        }
        read(OKID_ERR_MISMATCH, with(config, &correlation_config::sample, OKID_SAMPLE_INT16));
        read(OKID_OK, with(config, &correlation_config::buffer, 7));
    }
}

using factor_config = okid_square_root_config_t;

void factors_of_another_kind() {
    const factor_config base = okid_square_root_defaults(2, 2, 3);
    factor_config window = base, fading = base;
    window.block = fading.block = 4;
    window.slots = 2;
    fading.forgetting = 0.9;
    const factors one(base);
    const auto expect = [&](okid_status_t status, const factor_config& c) {
        const factors other(c);
        TEST_ASSERT_EQUAL(status, okid_square_root_merge(one.self, other.self));
        TEST_ASSERT_EQUAL(status, okid_square_root_merge(other.self, one.self));
    };
    expect(OKID_OK, base);
    for (const int32_t off : {-1, 1}) {
        expect(OKID_ERR_MISMATCH, with(base, &factor_config::n_u, 2 + off));
        expect(OKID_ERR_MISMATCH, with(base, &factor_config::n_y, 2 + off));
        expect(OKID_ERR_MISMATCH, with(base, &factor_config::lags, 3 + off));
    }
    expect(OKID_ERR_MISMATCH, window);
    expect(OKID_ERR_MISMATCH, fading);
    expect(OKID_OK, with(base, &factor_config::batch, 7));
    TEST_ASSERT_EQUAL(OKID_ERR_MISMATCH, okid_square_root_merge(one.self, one.self));
}

using counts = okid_accumulator_stats_t;

void assert_counts(const counts& expected, const counts& found) {
    TEST_ASSERT_EQUAL_INT64(expected.samples, found.samples);
    TEST_ASSERT_EQUAL_INT64(expected.missing, found.missing);
    TEST_ASSERT_EQUAL_INT64(expected.gaps, found.gaps);
    TEST_ASSERT_EQUAL_INT64(expected.saturated, found.saturated);
    TEST_ASSERT_EQUAL_INT64(expected.rows, found.rows);
}

/// The counts of both parts differ, so that none stands for another.
template <class Object, class Config, class Add, class Merge>
void parts_are_counted(const Config& config, Add add, Merge merge) {
    int16_t codes[4 * 30];
    for (int i = 0; i < 4 * 30; ++i) codes[i] = static_cast<int16_t>(i * i % 97 - 40);
    codes[17] = 32767, codes[18] = -32768; // in what both parts hold
    const Object one(config), other(config), none(config);
    const auto feed = [&](const Object& to, int samples, int64_t missing, int again) {
        TEST_ASSERT_EQUAL(OKID_WARN_SATURATED, add(to.self, codes, samples));
        to.gap(missing);
        TEST_ASSERT_EQUAL(OKID_OK, add(to.self, codes + 40, again));
    };
    feed(one, 9, 5, 7);
    feed(other, 13, 11, 17);
    const counts part{30, 11, 1, 2, 30 - 2 * 3, 0}, all{46, 16, 2, 4, 46 - 4 * 3, 0}; // three lags
    assert_counts({16, 5, 1, 2, 16 - 2 * 3, 0}, one.stats());
    assert_counts(part, other.stats());
    TEST_ASSERT_EQUAL(OKID_OK, merge(one.self, other.self));
    TEST_ASSERT_EQUAL(OKID_OK, merge(one.self, none.self));
    TEST_ASSERT_EQUAL(OKID_OK, merge(none.self, one.self));
    assert_counts(part, other.stats());
    for (const Object* each : {&one, &none}) assert_counts(all, each->stats());
}

void counts_of_parts_add_up() {
    const accumulator_config c = with(growing(), &accumulator_config::sample, OKID_SAMPLE_INT16);
    parts_are_counted<sums>(c, okid_accumulator_add_i16, okid_accumulator_merge);
    correlation_config d = okid_correlation_defaults(2, 2, 3);
    d.sample = OKID_SAMPLE_INT16;
    d.slots = 9;
    parts_are_counted<correlations>(d, okid_correlation_add_i16, okid_correlation_merge);
    parts_are_counted<factors>(okid_square_root_defaults(2, 2, 3), okid_square_root_add_i16, okid_square_root_merge);
}

/// What is taken out again is no longer counted.
void counts_of_a_part_go_with_it() {
    const accumulator_config config = with(growing(), &accumulator_config::sample, OKID_SAMPLE_INT16);
    const sums whole(config), part(config);
    int16_t codes[4 * 20];
    for (int i = 0; i < 4 * 20; ++i) codes[i] = static_cast<int16_t>(i * i % 97 - 40);
    codes[17] = 32767;
    TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_add_i16(whole.self, codes + 20, 15));
    whole.gap(4);
    const counts before = whole.stats();
    TEST_ASSERT_EQUAL(OKID_WARN_SATURATED, okid_accumulator_add_i16(part.self, codes, 8));
    part.gap(3);
    TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_merge(whole.self, part.self));
    TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_remove(whole.self, part.self, 1));
    assert_counts(before, whole.stats());
}

/// A file that is shorter or longer than it says is none, wherever it ends.
void files_of_another_length() {
    const double samples[4 * 6] = {1, 2, 3, 4, 5, 6, 7, 8, 9, 1, 2, 3, 4, 5, 6, 7, 8, 9, 1, 2, 3, 4, 5, 6};
    const sums one(growing());
    TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_add(one.self, samples, 6));
    correlation_config c = okid_correlation_defaults(2, 2, 3);
    const correlations other(c);
    TEST_ASSERT_EQUAL(OKID_OK, okid_correlation_add(other.self, samples, 6));
    bytes_t file = one.file(), correlation = other.file();
    file.push_back(0);
    correlation.push_back(0);
    okid_accumulator_config_t found;
    for (size_t bytes = 0; bytes <= file.size(); ++bytes) {
        const okid_status_t status = bytes + 1 == file.size() ? OKID_OK : OKID_ERR_FORMAT;
        TEST_ASSERT_EQUAL(status, okid_accumulator_peek(file.data(), bytes, &found));
        TEST_ASSERT_EQUAL(status, okid_accumulator_deserialise(one.self, file.data(), bytes));
    }
    for (size_t bytes = 0; bytes <= correlation.size(); ++bytes) {
        const okid_status_t status = bytes + 1 == correlation.size() ? OKID_OK : OKID_ERR_FORMAT;
        TEST_ASSERT_EQUAL(status, okid_correlation_peek(correlation.data(), bytes, &c));
        TEST_ASSERT_EQUAL(status, okid_correlation_deserialise(other.self, correlation.data(), bytes));
    }
    for (size_t at = 0; at + 1 < file.size(); ++at) { // one bit
        file[at] ^= 1;
        TEST_ASSERT_EQUAL(OKID_ERR_FORMAT, okid_accumulator_deserialise(one.self, file.data(), file.size() - 1));
        file[at] ^= 1;
    }
}

} // namespace

int main() {
    UNITY_BEGIN();
    RUN_TEST(merging);
    RUN_TEST(removing);
    RUN_TEST(slots_of_a_window);
    RUN_TEST(channels_of_another);
    RUN_TEST(copies_and_files);
    RUN_TEST(correlations_of_another_kind);
    RUN_TEST(factors_of_another_kind);
    RUN_TEST(counts_of_parts_add_up);
    RUN_TEST(counts_of_a_part_go_with_it);
    RUN_TEST(files_of_another_length);
    return UNITY_END();
}
