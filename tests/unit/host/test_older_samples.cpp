// SPDX-License-Identifier: MIT
// What is left of samples that are no longer kept: the rates sample by sample are those of the whole record, and sums in blocks
// of time hold every row of them, gaps or not, in memory that does not grow.
#include "consensus/consensus_runs.hpp"
#include "consensus/rate_chain.hpp"
#include "live/agreement.hpp"
#include "record/older_samples.hpp"
#include "record/record.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <random>
#include <unity.h>

using namespace okid_host;

namespace {

constexpr int n_u = 1, n_y = 2, lags = 12;
constexpr std::size_t m = n_u + n_y, width = m * (lags + 1);

/// A white force and two responses that ring a little, by a recursion of their own.
std::vector<double> rows_of(std::size_t count, unsigned seed) {
    std::mt19937 random(seed);
    std::normal_distribution<double> normal;
    std::vector<double> out(count * m);
    double a = 0, b = 0, before = 0;
    for (std::size_t n = 0; n < count; ++n) {
        const double force = normal(random), next = 1.6 * a - 0.9 * before + force;
        before = std::exchange(a, next);
        b = 0.8 * b + 0.3 * a;
        out[n * m] = force;
        out[n * m + 1] = a + 0.1 * normal(random);
        out[n * m + 2] = b + 0.1 * normal(random);
    }
    return out;
}

std::vector<double> gram_of(okid_accumulator_t* sums) {
    std::vector<double> out(width * width);
    TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_gram(sums, OKID_DETREND_NONE, out.data(), nullptr));
    return out;
}

bool is_missing(double x) { return x != x; } // unity.h hides std::isnan

owned_sums sums_like(int of_lags) {
    okid_accumulator_config_t config = okid_accumulator_defaults(n_u, n_y, of_lags);
    config.edges = 1;
    owned_sums out(config);
    TEST_ASSERT_NOT_NULL(out.sums);
    return out;
}

void assert_same(const std::vector<double>& expected, const std::vector<double>& found, double tolerance) {
    const double most = *std::max_element(expected.begin(), expected.end());
    for (std::size_t i = 0; i < expected.size(); ++i)
        TEST_ASSERT_DOUBLE_WITHIN(tolerance * most, expected[i], found[i]);
}

record_options options() {
    record_options out;
    out.inputs = {"u"};
    out.outputs = {"a", "b"};
    out.fs_hz = 100;
    return out;
}

record_set set_of(const std::vector<std::vector<double>>& records) {
    record_set out;
    out.n_u = n_u;
    out.n_y = n_y;
    for (const auto& rows : records) out.add("r", rows.data(), rows.size() / m);
    return out;
}

} // namespace

void setUp() {}
void tearDown() {}

static void rates_row_by_row_are_those_of_the_record() {
    for (const int decimate : {1, 3})
        for (const bool silent : {false, true}) {
            std::vector<double> rows = rows_of(40000, 5), scale;
            for (std::size_t i = 7000 * m; i < 7011 * m; ++i) rows[i] = NAN; // too long to be bridged
            rate_chain chain(m, 100, decimate);
            std::vector<std::vector<double>> found(chain.count());
            chain.begin_record(silent);
            for (std::size_t n = 0; n < rows.size(); n += m) {
                if (n == 9000 * m) { // goes on elsewhere
                    rate_chain other(m, 100, decimate);
                    TEST_ASSERT_FALSE(other.put_back({1, 2, 3}));
                    TEST_ASSERT_TRUE(other.put_back(chain.state()));
                    chain = other;
                }
                chain.add(rows.data() + n,
                          [&](std::size_t k, const double* row) { found[k].insert(found[k].end(), row, row + m); });
            }
            const auto levels = make_levels({rows}, n_u, n_y, 100, silent, decimate, scale);
            TEST_ASSERT_TRUE(levels.size() >= 4);
            for (std::size_t k = 0; k < levels.size(); ++k) { // those are centred, in units of their spread
                const sample_rows& whole = levels[k].records[0];
                TEST_ASSERT_EQUAL_UINT64(whole.size(), found[k].size());
                for (std::size_t c = 0; c < m; ++c) {
                    double shift = 0, there = 0;
                    for (std::size_t i = c; i < whole.size(); i += m)
                        if (!is_missing(whole[i])) shift += found[k][i] - whole[i] * scale[c], ++there;
                    for (std::size_t i = c; i < whole.size(); i += m) {
                        TEST_ASSERT_EQUAL(is_missing(whole[i]), is_missing(found[k][i]));
                        if (!is_missing(whole[i]) && !silent)
                            TEST_ASSERT_DOUBLE_WITHIN(1e-9, whole[i] * scale[c] + shift / there, found[k][i]);
                    }
                }
            }
        }
}

/// A state with a number that cannot be one, too short or too long, is none, and the chain goes on as it was.
static void what_is_no_state_of_rates_is_not_taken() {
    const std::vector<double> rows = rows_of(1000, 7);
    rate_chain chain(m, 100, 2), other(m, 100, 2);
    chain.begin_record(false);
    other.begin_record(false);
    const auto nothing = [](std::size_t, const double*) {};
    for (std::size_t n = 0; n < rows.size(); n += m) chain.add(rows.data() + n, nothing);
    const std::vector<double> state = chain.state(), fresh = other.state();
    const auto refused = [&](const std::vector<double>& wrong) {
        return !other.put_back(wrong) && other.state() == fresh;
    };
    for (std::size_t length = 0; length < state.size(); length += 7)
        TEST_ASSERT_TRUE(refused({state.begin(), state.begin() + static_cast<std::ptrdiff_t>(length)}));
    std::vector<double> wrong = state;
    wrong.push_back(0);
    TEST_ASSERT_TRUE(refused(wrong));
    for (std::size_t place = 0; place < 2;
         ++place) // samples that came, rows that wait: of the first rate a filter of 128
        for (const double value : {-1.0, 0.5, 127.5, 1e16, 2000.0, static_cast<double>(NAN)}) {
            wrong = state;
            wrong[place] = value;
            TEST_ASSERT_TRUE((place == 0 && value == 2000) || refused(wrong));
        }
    wrong = state;
    wrong[0] = 127; // fewer than wait
    TEST_ASSERT_TRUE(refused(wrong));
    TEST_ASSERT_TRUE(other.put_back(state) && other.state() == state);
}

/// Every row, whether nothing is missing, a sample now and then, or every 30th: then blocks are folded.
static void blocks_hold_every_row() {
    for (const std::size_t gap_each : {std::size_t{0}, std::size_t{997}, std::size_t{30}}) {
        std::vector<double> rows = rows_of(30000, 6);
        for (std::size_t n = gap_each; gap_each > 0 && n * m < rows.size(); n += gap_each)
            rows[n * m + n / gap_each % m] = NAN;
        level_memory memory(n_u, n_y, lags + 4, 100);
        const owned_sums whole = sums_like(lags + 4), taken = sums_like(lags), direct = sums_like(lags);
        for (std::size_t n = 0; n < rows.size(); n += m) memory.add(rows.data() + n);
        TEST_ASSERT_TRUE(okid_accumulator_add(whole.sums, rows.data(), rows.size() / m) >= 0);
        TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_merge(direct.sums, whole.sums));
        okid_accumulator_stats_t counts;
        okid_accumulator_stats(whole.sums, &counts);
        TEST_ASSERT_EQUAL_INT64(counts.samples, memory.samples());
        TEST_ASSERT_TRUE(memory.take(taken.sums));
        TEST_ASSERT_EQUAL_INT64(okid_accumulator_rows(whole.sums), okid_accumulator_rows(taken.sums));
        const std::vector<double> all = gram_of(direct.sums);
        assert_same(all, gram_of(taken.sums), 1e-12);
        const std::size_t blocks = memory.blocks();
        TEST_ASSERT_TRUE(blocks >= 8 && blocks <= level_memory::most_blocks + 2);
        for (std::size_t k = 0; k < blocks; ++k) { // each can be taken out, and all together leave nothing
            const owned_sums part = sums_like(lags);
            TEST_ASSERT_TRUE(memory.take_block(k, part.sums));
            TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_remove(taken.sums, part.sums, 1));
        }
        TEST_ASSERT_EQUAL_INT64(0, okid_accumulator_rows(taken.sums));
        const std::vector<std::byte> state = memory.state();
        level_memory again(n_u, n_y, lags + 4, 100), other(n_u, n_y, lags, 100);
        const auto taken_by = [&](level_memory& by, std::size_t bytes) {
            byte_reader from(state.data(), bytes);
            return by.put_back(from) && from.left() == 0;
        };
        TEST_ASSERT_FALSE(taken_by(other, state.size()));
        for (std::size_t cut = 0; cut < state.size(); cut += 501) TEST_ASSERT_FALSE(taken_by(again, cut));
        TEST_ASSERT_TRUE(taken_by(again, state.size()));
        const owned_sums twice = sums_like(lags);
        again.merge(memory);
        TEST_ASSERT_EQUAL_INT64(2 * memory.samples(), again.samples());
        TEST_ASSERT_TRUE(again.take(twice.sums));
        std::vector<double> doubled = all;
        for (double& x : doubled) x *= 2;
        assert_same(doubled, gram_of(twice.sums), 1e-12);
    }
}

/// Without gaps neighbours become one when there are too many: blocks of one length, none of them with half of all in it.
static void blocks_without_gaps_are_alike() {
    level_memory memory(n_u, n_y, lags, 100);
    const std::vector<double> rows = rows_of(20000, 9);
    for (std::size_t n = 0; n < 20000; ++n) {
        memory.add(rows.data() + n * m);
        if (n % 1900 != 1899) continue;
        std::vector<std::int64_t> lengths;
        for (std::size_t k = 0; k < memory.blocks(); ++k) {
            const owned_sums part = sums_like(lags);
            TEST_ASSERT_TRUE(memory.take_block(k, part.sums));
            lengths.push_back(okid_accumulator_rows(part.sums));
        }
        const std::int64_t all = static_cast<std::int64_t>(n) + 1 - lags;
        TEST_ASSERT_EQUAL_INT64(all, std::accumulate(lengths.begin(), lengths.end(), std::int64_t{0}));
        TEST_ASSERT_DOUBLE_WITHIN(1e-9, static_cast<double>(all) / static_cast<double>(lengths.size()),
                                  memory.rows_of_block());
        lengths.pop_back(); // the newest one is not full
        const auto [least, most] = std::minmax_element(lengths.begin(), lengths.end());
        TEST_ASSERT_TRUE(lengths.size() >= 10 && *most - *least <= lags);
    }
}

/// What begins in silence has a row from its first sample on, as if zeros stood before it.
static void silence_stands_before_a_record() {
    const std::vector<double> rows = rows_of(60, 10);
    level_memory memory(n_u, n_y, lags, 100);
    const owned_sums taken = sums_like(lags), direct = sums_like(lags);
    std::vector<double> padded(lags * m);
    padded.insert(padded.end(), rows.begin(), rows.end());
    memory.silence();
    for (std::size_t n = 0; n < rows.size(); n += m) memory.add(rows.data() + n);
    TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_add(direct.sums, padded.data(), padded.size() / m));
    TEST_ASSERT_TRUE(memory.take(taken.sums));
    TEST_ASSERT_EQUAL_INT64(60, okid_accumulator_rows(taken.sums));
    TEST_ASSERT_EQUAL_INT64(60, memory.samples());
    assert_same(gram_of(direct.sums), gram_of(taken.sums), 1e-12);
}

/// Whichever outputs go: what is left has the sums of a record that never had them, folded blocks included.
static void outputs_go_out_of_the_sums() {
    const std::vector<std::vector<bool>> flags = {{false, true}, {true, false}, {true, true}};
    std::vector<double> rows = rows_of(9000, 11);
    for (std::size_t n = 30; n < 9000; n += 30) rows[n * m] = NAN;
    level_memory memory(n_u, n_y, lags, 100);
    for (std::size_t n = 0; n < rows.size(); n += m) memory.add(rows.data() + n);
    for (const std::vector<bool>& kept : flags) {
        const int outputs = static_cast<int>(std::count(kept.begin(), kept.end(), true));
        std::vector<double> fewer;
        for (std::size_t i = 0; i < rows.size(); ++i)
            if (i % m < n_u || kept[i % m - n_u]) fewer.push_back(rows[i]);
        okid_accumulator_config_t config = okid_accumulator_defaults(n_u, outputs, lags);
        config.edges = 1;
        const owned_sums direct(config), taken(config);
        const auto size = static_cast<std::size_t>((n_u + outputs) * (lags + 1));
        TEST_ASSERT_TRUE(okid_accumulator_add(direct.sums, fewer.data(), 9000) >= 0);
        const level_memory less = memory.without_outputs(kept);
        TEST_ASSERT_EQUAL_INT64(memory.samples(), less.samples());
        TEST_ASSERT_EQUAL_UINT64(memory.blocks(), less.blocks());
        TEST_ASSERT_TRUE(less.take(taken.sums));
        std::vector<double> expected(size * size), found(size * size);
        TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_gram(direct.sums, OKID_DETREND_NONE, expected.data(), nullptr));
        TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_gram(taken.sums, OKID_DETREND_NONE, found.data(), nullptr));
        assert_same(expected, found, 1e-12);
    }
}

/// A state whose sums are of another kind, in one number of their configuration, is none; and nothing has changed.
static void sums_of_another_kind_are_not_taken_back() {
    using config = okid_accumulator_config_t;
    const std::vector<double> rows = rows_of(500, 8);
    level_memory memory(n_u, n_y, lags, 100);
    for (std::size_t n = 0; n < rows.size(); n += m) memory.add(rows.data() + n);
    const std::vector<std::byte> state = memory.state();
    config own[2]; // of the window, and of what it had no room for
    byte_reader whole(state.data(), state.size());
    whole.word();
    for (config& each : own) {
        const std::uint64_t bytes = whole.word();
        TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_peek(whole.bytes(bytes), bytes, &each));
    }
    const auto with = [&](const config& window, const config& base) {
        std::vector<std::byte> other;
        put_word(other, 500);
        for (const config* each : {&window, &base}) {
            const owned_sums sums(*each);
            TEST_ASSERT_NOT_NULL(sums.sums);
            std::vector<std::byte> bytes(okid_accumulator_serialised_size(sums.sums));
            TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_serialise(sums.sums, bytes.data(), bytes.size()));
            put_word(other, bytes.size());
            other.insert(other.end(), bytes.begin(), bytes.end());
        }
        level_memory to(n_u, n_y, lags, 100);
        byte_reader from(other.data(), other.size());
        const bool taken = to.put_back(from);
        TEST_ASSERT_EQUAL_INT64(taken ? 500 : 0, to.samples());
        return taken;
    };
    TEST_ASSERT_TRUE(with(own[0], own[1]));
    for (std::int32_t config::* number :
         {&config::n_u, &config::n_y, &config::lags, &config::slots, &config::spare_slots, &config::edges}) {
        config window = own[0], base = own[1];
        window.*number += number == &config::edges && window.edges ? -1 : 1;
        base.*number += number == &config::edges ? -1 : number == &config::slots ? 2 : 1;
        if (number == &config::slots || number == &config::spare_slots) base.edges = 0, base.block = 50, base.slots = 2;
        TEST_ASSERT_FALSE(with(window, own[1]));
        TEST_ASSERT_FALSE(with(own[0], base));
    }
    config codes = own[0], fading = own[1];
    codes.sample = OKID_SAMPLE_INT16;
    fading.block = 50;
    fading.forgetting = 0.9;
    TEST_ASSERT_FALSE(with(codes, own[1]));
    TEST_ASSERT_FALSE(with(own[0], fading));
}

/// Older and newest samples together have all rows but those at the seams, the filters' and the lags'.
static void nothing_is_lost_between_older_and_newest() {
    const std::size_t kept = newest_samples(m), count = 3 * kept;
    std::vector<double> rows = rows_of(count, 8);
    for (std::size_t n = 0; n < count; ++n) rows[n * m + 2] += 5; // an offset
    record_set set = set_of({rows});
    const auto older = split_older(set, options());
    TEST_ASSERT_NOT_NULL(older.get());
    TEST_ASSERT_EQUAL_INT64(static_cast<long long>(count), older->samples() + static_cast<long long>(set.count()));
    TEST_ASSERT_TRUE(set.count() <= kept && set.count() > kept / 2);
    TEST_ASSERT_EQUAL_MEMORY(rows.data() + (count - set.count()) * m, set.samples.data(), set.samples.size() * 8);
    TEST_ASSERT_EQUAL_INT64(older->samples(), older->level(0).samples());
    TEST_ASSERT_EQUAL_INT64(older->samples(), older->begun());
    TEST_ASSERT_EQUAL_INT64(0, older->records());
    const owned_sums sums = sums_like(lags), direct = sums_like(lags);
    TEST_ASSERT_TRUE(older->level(0).take(sums.sums));
    for (std::size_t n = 0; n < count; ++n) rows[n * m + 2] -= 5;
    TEST_ASSERT_TRUE(okid_accumulator_add(direct.sums, rows.data(), static_cast<std::size_t>(older->samples())) >= 0);
    std::vector<double> expected = gram_of(direct.sums), found = gram_of(sums.sums);
    for (double& x : expected) x /= static_cast<double>(okid_accumulator_rows(direct.sums));
    for (double& x : found) x /= static_cast<double>(okid_accumulator_rows(sums.sums));
    assert_same(expected, found, 1e-3); // the mean is that of the samples kept then
    record_set few = set_of({rows_of(kept, 9)});
    TEST_ASSERT_NULL(split_older(few, options()).get());
}

/// A record that ends before the middle of the samples kept goes as a whole; its faults are no part of the sums.
static void records_go_as_a_whole_and_screened() {
    const std::size_t kept = newest_samples(m), each = kept / 10;
    std::vector<std::vector<double>> records;
    for (unsigned k = 0; k < 24; ++k) records.push_back(rows_of(each, 20 + k));
    records[3][(each / 2) * m + 1] = 1e4; // a spike
    record_set set = set_of(records);
    const auto older = split_older(set, options());
    TEST_ASSERT_NOT_NULL(older.get());
    TEST_ASSERT_EQUAL_INT64(0, older->begun());
    TEST_ASSERT_EQUAL_INT64(24, older->records() + static_cast<long long>(set.records.size()));
    for (const record_data& record : set.records) TEST_ASSERT_EQUAL_UINT64(each, record.count);
    TEST_ASSERT_EQUAL_INT64(1, older->missing());
    TEST_ASSERT_EQUAL_INT64(static_cast<long long>(each), older->longest());
    double energy[m];
    const owned_sums sums = sums_like(lags);
    TEST_ASSERT_TRUE(older->level(0).take(sums.sums));
    TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_energy(sums.sums, OKID_DETREND_NONE, energy));
    TEST_ASSERT_TRUE(energy[1] < 1e7);
    const std::vector<std::byte> state = older->state();
    older_samples again(options(), "", state);
    TEST_ASSERT_TRUE(again.state() == state);
    TEST_ASSERT_TRUE(static_cast<double>(state.size()) < older_samples::bytes(n_u, n_y));
    again.merge(*older);
    TEST_ASSERT_EQUAL_INT64(2 * older->samples(), again.samples());
}

/// Hits at several places are all kept as samples, as far as max_memory_mb holds them; then `memory_full` says so.
static void hits_at_places_are_kept_as_samples() {
    stream_config config;
    config.inputs = {"u"};
    config.outputs = {"a", "b"};
    config.rate_hz = 100;
    config.wanted.method = "auto";
    config.scale.assign(m, 1);
    config.offset.assign(m, 0);
    const std::vector<double> rows = rows_of(2000, 11);
    for (const bool places : {true, false}) {
        config.hits = places ? std::vector<int>{1, 2} : std::vector<int>();
        config.wanted.max_memory_mb = followed_modes::bytes(config, 0) / 1e6 + 3;
        agreement kept(config);
        for (int k = 0; k < 100; ++k)
            for (std::size_t n = 0; n < rows.size(); n += m) kept.add(rows.data() + n);
        TEST_ASSERT_EQUAL(places, kept.overflowed());
        TEST_ASSERT_EQUAL(!places, kept.basis() == 200000);
        TEST_ASSERT_EQUAL_INT64(200000, kept.stats().samples);
    }
}

int main() {
    UNITY_BEGIN();
    RUN_TEST(rates_row_by_row_are_those_of_the_record);
    RUN_TEST(what_is_no_state_of_rates_is_not_taken);
    RUN_TEST(blocks_hold_every_row);
    RUN_TEST(blocks_without_gaps_are_alike);
    RUN_TEST(silence_stands_before_a_record);
    RUN_TEST(outputs_go_out_of_the_sums);
    RUN_TEST(sums_of_another_kind_are_not_taken_back);
    RUN_TEST(nothing_is_lost_between_older_and_newest);
    RUN_TEST(records_go_as_a_whole_and_screened);
    RUN_TEST(hits_at_places_are_kept_as_samples);
    return UNITY_END();
}
