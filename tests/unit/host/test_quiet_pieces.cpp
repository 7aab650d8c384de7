// SPDX-License-Identifier: MIT
// Where events end in records without a force: bursts of noise that leave a free decay, made block by block.
#include "narrow_bands.hpp"
#include "record/quiet_pieces.hpp"

#include <unity.h>

using namespace okid_host;

namespace {

constexpr std::size_t every = 4000, burst = 300; // samples

/// Bursts, one each `every` samples; between them what is left falls to a share of it.
record_set driven(std::size_t times, double left, std::size_t outputs = 2) {
    series noise = white(times * every, 1, 3);
    record_set out;
    out.n_y = outputs;
    std::vector<double> rows;
    for (std::size_t t = 0; t < noise.size(); ++t) {
        const std::size_t since = t % every;
        const double amplitude =
            since < burst ? 1 : std::max(left, std::exp(-(static_cast<double>(since) - burst) / 200.0));
        for (std::size_t k = 0; k < outputs; ++k) rows.push_back((k + 1.0) * amplitude * noise[t] + 40);
    }
    out.add("r", rows.data(), noise.size());
    return out;
}

} // namespace

void setUp() {}
void tearDown() {}

static void each_event_leaves_a_piece_that_begins_behind_it() {
    const record_set whole = driven(3, 1e-3), pieces = after_events(whole);
    TEST_ASSERT_EQUAL_UINT64(3, pieces.records.size());
    for (std::size_t k = 0; k < 3; ++k) {
        const std::size_t least = k < 2 ? 1000 : 3000, most = every - burst;
        TEST_ASSERT_TRUE(pieces.records[k].count > least && pieces.records[k].count < most);
        // it is a stretch of the whole, and nothing of the next burst is in it
        const double* first = pieces.rows(pieces.records[k]);
        std::size_t at = k * every + burst;
        while (at < whole.count() && whole.samples[at * 2] != *first) ++at;
        TEST_ASSERT_TRUE(at >= k * every + burst && at < k * every + burst + 600);
        TEST_ASSERT_TRUE(at + pieces.records[k].count <= (k + 1) * every);
        TEST_ASSERT_EQUAL_MEMORY(first, whole.samples.data() + at * 2, pieces.records[k].count * 2 * sizeof(double));
    }
}

static void power_that_falls_less_is_no_event() {
    TEST_ASSERT_EQUAL_UINT64(3, after_events(driven(3, 0.05)).records.size());
    TEST_ASSERT_EQUAL_UINT64(0, after_events(driven(3, 0.5)).records.size());
    TEST_ASSERT_EQUAL_UINT64(1, after_events(driven(1, 1e-3)).records.size());
}

static void missing_samples_and_dead_outputs_are_no_events() {
    record_set whole = driven(3, 1e-3), steady = driven(3, 1);
    for (record_set* set : {&whole, &steady})
        for (std::size_t t = 0; t < set->count(); ++t) {
            if (t % every > 2000 && t % every < 2400) set->samples[2 * t] = set->samples[2 * t + 1] = NAN;
            if (set == &whole) set->samples[2 * t + 1] = 7;
        }
    TEST_ASSERT_EQUAL_UINT64(3, after_events(whole).records.size());
    TEST_ASSERT_EQUAL_UINT64(0, after_events(steady).records.size());
    whole.samples.assign(whole.samples.size(), 5);
    TEST_ASSERT_EQUAL_UINT64(0, after_events(whole).records.size());
    whole.samples.assign(whole.samples.size(), NAN);
    TEST_ASSERT_EQUAL_UINT64(0, after_events(whole).records.size());
}

static void a_measured_force_needs_none() {
    record_set forced = driven(3, 1e-3);
    forced.n_u = forced.n_y = 1;
    TEST_ASSERT_EQUAL_UINT64(0, after_events(forced).records.size());
}

int main() {
    UNITY_BEGIN();
    RUN_TEST(each_event_leaves_a_piece_that_begins_behind_it);
    RUN_TEST(power_that_falls_less_is_no_event);
    RUN_TEST(missing_samples_and_dead_outputs_are_no_events);
    RUN_TEST(a_measured_force_needs_none);
    return UNITY_END();
}
