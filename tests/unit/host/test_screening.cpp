// SPDX-License-Identifier: MIT
// Faults of an output put into samples by hand, each bound from both sides: which samples become missing, and what is said.
#include "record/screening.hpp"

#include <cmath>
#include <unity.h>

using namespace okid_host;

namespace {

using column = std::vector<double>;

/// Values -0.9 .. 0.9, each once, in an order without pattern: median 0, a spread (1.4826 x MAD) of 0.667.
column moving(std::size_t count = 2000) {
    column out;
    for (std::size_t k = 0; k < count; ++k)
        out.push_back(1.8 * static_cast<double>((k * 1237 + 17) % count) / static_cast<double>(count) - 0.9);
    return out;
}

/// An input, the output looked at and a second one that is sound.
record_set set_of(const column& y) {
    record_set set;
    set.n_u = 1;
    set.n_y = 2;
    const column other = moving(y.size());
    column rows;
    for (std::size_t i = 0; i < y.size(); ++i) rows.insert(rows.end(), {i % 7 ? 0.0 : 1.0, y[i], 2 * other[i]});
    set.add("", rows, 0, y.size());
    return set;
}

bool is_nan(double x) { return x != x; }

struct outcome {
    std::vector<std::size_t> missing; // samples of the first output
    std::string said;                 // of all remarks, a line each
    bool kept;
};

outcome screened(const column& y) {
    record_set set = set_of(y);
    const screened_outputs out = screen_outputs(set, {"a", "b"});
    outcome result{{}, "", out.kept[0]};
    TEST_ASSERT_TRUE(out.kept[1]);
    for (std::size_t i = 0; i < y.size(); ++i) {
        TEST_ASSERT_TRUE(set.samples[3 * i] == (i % 7 ? 0.0 : 1.0) && !is_nan(set.samples[3 * i + 2]));
        if (is_nan(set.samples[3 * i + 1]))
            result.missing.push_back(i);
        else
            TEST_ASSERT_TRUE(set.samples[3 * i + 1] == y[i]);
    }
    for (const auto& [code, text] : out.said) {
        TEST_ASSERT_EQUAL_STRING("screened", code.c_str());
        result.said += text + "\n";
    }
    return result;
}

bool says(const outcome& one, const char* words) { return one.said.find(words) != std::string::npos; }

/// One value at so many single samples, 20 apart.
void put(column& y, double value, std::size_t count, std::size_t first = 10) {
    for (std::size_t k = 0; k < count; ++k) y[first + 20 * k] = value;
}

/// One value for so many samples in a row.
column held(double value, std::size_t count, std::size_t first = 500, column y = moving()) {
    for (std::size_t k = 0; k < count; ++k) y[first + k] = value;
    return y;
}

/// Row by row, as a stream goes: what is a spike in the record is one there, away from its ends, and beside a force that
/// otherwise rests it is an answer.
void spikes_of_single_rows(void) {
    column y = moving();
    y[700] = 40;
    y[1200] = -35;
    y[1990] = 50; // within what judges it, but not to be judged at an end
    record_set set = set_of(y);
    for (std::size_t i = 0; i < y.size(); ++i) set.samples[3 * i] = i == 1198 ? 100 : 0.1 * static_cast<double>(i % 2);
    const usual_values usual = usual_of(set);
    TEST_ASSERT_EQUAL_DOUBLE(10, usual.pulse[0]);
    column row(3), gone;
    for (std::size_t i = 0; i < y.size(); ++i) {
        without_spikes(set.samples.data(), y.size(), i, usual, row.data());
        TEST_ASSERT_TRUE(row[0] == set.samples[3 * i] && row[2] == set.samples[3 * i + 2]);
        if (is_nan(row[1])) gone.push_back(static_cast<double>(i));
    }
    TEST_ASSERT_EQUAL_INT(2, static_cast<int>(gone.size()));
    TEST_ASSERT_TRUE(gone[0] == 700 && gone[1] == 1990);
}

} // namespace

void setUp() {}
void tearDown() {}

static void a_sound_output_is_left_alone() {
    const outcome one = screened(moving());
    TEST_ASSERT_TRUE(one.kept && one.missing.empty() && one.said.empty());
}

static void ten_samples_at_an_extreme_are_clipped() {
    for (const double extreme : {1.0, -1.0})
        for (const std::size_t count : {9U, 10U}) {
            column y = moving();
            put(y, extreme, count);
            const outcome one = screened(y);
            TEST_ASSERT_EQUAL_UINT64(count == 10 ? 10 : 0, one.missing.size());
            if (count < 10) continue;
            TEST_ASSERT_TRUE(says(one, "output \"a\": clipped (10 samples, the first is number 10)"));
            TEST_ASSERT_EQUAL_UINT64(10, one.missing.front());
            TEST_ASSERT_EQUAL_UINT64(190, one.missing.back());
        }
}

/// Six on each side: no gap is left that could be bridged. Where that would be more than a hundredth of the record, none.
static void a_few_clipped_samples_take_their_neighbours_along() {
    for (const std::size_t count : {2199U, 2200U}) {
        const outcome one = screened(held(1, 10, 1000, moving(count)));
        TEST_ASSERT_TRUE(says(one, "clipped (10 samples, the first is number 1000)"));
        TEST_ASSERT_EQUAL_UINT64(count == 2200 ? 22 : 10, one.missing.size());
        TEST_ASSERT_EQUAL_UINT64(count == 2200 ? 994 : 1000, one.missing.front());
        TEST_ASSERT_EQUAL_UINT64(count == 2200 ? 1015 : 1009, one.missing.back());
    }
}

/// A flat top has three times the samples of the hundredth of the range below it, and of the next value.
static void clipped_is_three_times_what_is_just_below() {
    for (const std::size_t count : {29U, 30U}) {
        column y = moving(), z = moving();
        put(y, 1, count);
        put(z, 1, count);
        for (std::size_t k = 0; k < 10; ++k) y[17 + 20 * k] = 0.984 + 0.001 * static_cast<double>(k); // 0.019 wide
        put(z, 0.95, 10, 17);
        TEST_ASSERT_EQUAL(count == 30, says(screened(y), "clipped"));
        TEST_ASSERT_EQUAL(count == 30, says(screened(z), "clipped"));
    }
}

static void a_flat_top_below_a_spike_is_one() {
    column y = moving();
    put(y, 1, 10);
    y[700] = 40;
    const outcome one = screened(y);
    TEST_ASSERT_TRUE(says(one, "clipped (10 samples") && says(one, "spikes (1 sample, the first is number 700)"));
    TEST_ASSERT_EQUAL_UINT64(11, one.missing.size());
}

/// The range was smaller at first: parts of 500 samples have their own extremes, and lend them to their neighbours.
static void a_flat_top_of_a_part_is_one() {
    for (const std::size_t count : {7999U, 8000U}) {
        column y = moving(count);
        std::size_t clipped = 0;
        for (std::size_t i = 2200; i < 3300; ++i)
            if (y[i] > 0.6) y[i] = 0.6, ++clipped;
        TEST_ASSERT_EQUAL_UINT64(count == 8000 ? clipped : 0, screened(y).missing.size());
    }
    column y = moving(8000); // a quiet part shows the steps of its converter, three samples of four on one of two
    for (std::size_t i = 2000; i < 4000; ++i) y[i] = i % 5 ? 0.1 : 0.0;
    TEST_ASSERT_TRUE(screened(y).missing.empty());
}

static void thirty_two_equal_samples_are_frozen() {
    TEST_ASSERT_TRUE(screened(held(0.33, 31)).missing.empty());
    const outcome one = screened(held(0.33, 32));
    TEST_ASSERT_TRUE(says(one, "frozen at one value (32 samples, the first is number 500)"));
    TEST_ASSERT_EQUAL_UINT64(32, one.missing.size());
    TEST_ASSERT_EQUAL_UINT64(500, one.missing.front());
    TEST_ASSERT_EQUAL_UINT64(531, one.missing.back());
}

/// At zero a quarter of that is enough, eight times what the channel usually keeps a value.
static void eight_zeros_are_a_drop() {
    TEST_ASSERT_TRUE(screened(held(0, 7)).missing.empty());
    TEST_ASSERT_TRUE(says(screened(held(0, 8)), "dropped to zero (8 samples, the first is number 500)"));
}

/// A channel that keeps every value for five samples is frozen from forty on.
static void a_slow_channel_keeps_its_values_longer() {
    for (const std::size_t count : {35U, 40U}) {
        column y = moving(), slow;
        for (std::size_t i = 0; i < y.size(); ++i) slow.push_back(y[i / 5]);
        TEST_ASSERT_EQUAL_UINT64(count == 40 ? 40 : 0, screened(held(0.333, count, 500, slow)).missing.size());
    }
}

/// It must move beside the stretch, by three tenths of its usual spread: else it rested.
static void at_rest_is_not_frozen() {
    for (const bool before : {true, false})
        for (const double share : {0.2, 0.4}) {
            column y = held(0.33, 40);
            const std::size_t first = before ? 440 : 540;
            for (std::size_t i = first; i < first + 60; ++i) y[i] *= share;
            TEST_ASSERT_EQUAL_UINT64(share > 0.3 ? 40 : 0, screened(y).missing.size());
        }
    TEST_ASSERT_EQUAL_UINT64(40, screened(held(0.33, 40, 0)).missing.size()); // nothing before: what follows decides
    TEST_ASSERT_EQUAL_UINT64(40, screened(held(0.33, 40, 1960)).missing.size());
}

static void a_spike_is_fifteen_spreads_out() {
    for (const double value : {9.7, 10.3, -10.3}) { // 15 x 0.667 = 10.0
        column y = moving();
        y[700] = value;
        const outcome one = screened(y);
        TEST_ASSERT_EQUAL_UINT64(std::abs(value) > 10 ? 1 : 0, one.missing.size());
        if (std::abs(value) < 10) continue;
        TEST_ASSERT_TRUE(says(one, "spikes (1 sample, the first is number 700)"));
        TEST_ASSERT_EQUAL_UINT64(700, one.missing[0]);
    }
}

/// What lies two to six samples beside it is five times smaller; the very next may belong to it.
static void a_hit_is_no_spike() {
    for (const int apart : {-7, -6, -2, -1, 1, 2, 6, 7}) {
        column y = moving();
        y[700] = 12;
        y[static_cast<std::size_t>(700 + apart)] = 3;
        TEST_ASSERT_EQUAL_UINT64(std::abs(apart) >= 2 && std::abs(apart) <= 6 ? 0 : 1, screened(y).missing.size());
        y[static_cast<std::size_t>(700 + apart)] = 2.3; // a fifth of it is 2.4
        TEST_ASSERT_EQUAL_UINT64(1, screened(y).missing.size());
    }
    for (const std::size_t at : {5U, 6U, 1993U, 1994U}) { // what stands at the ends has no neighbours on one side
        column y = moving();
        y[at] = 12;
        TEST_ASSERT_EQUAL_UINT64(at == 6 || at == 1993 ? 1 : 0, screened(y).missing.size());
    }
    for (const std::size_t count : {99U, 100U}) {
        column y = moving(count);
        y[50] = 12;
        TEST_ASSERT_EQUAL_UINT64(count == 100 ? 1 : 0, screened(y).missing.size());
    }
}

/// A pulse that runs along a beam after a hit is as narrow as a spike; the record about it is as lively, and dies away.
static void a_peak_of_a_lively_stretch_is_no_spike() {
    for (const std::size_t at : {10U, 700U, 1990U})
        for (const double lively : {1.5, 2.5}) { // about it 8 x 0.667 x lively = 8.0 or 13.3
            column y = moving();
            const std::size_t last = std::min<std::size_t>(2000, std::max<std::size_t>(at + 64, 128) + 1);
            for (std::size_t i = last - 129; i < last; ++i) y[i] = moving(129)[i - (last - 129)] * lively;
            for (std::size_t d = 1; d <= 6; ++d) y[at - d] = y[at + d] = 0.1;
            y[at] = 12;
            TEST_ASSERT_EQUAL_UINT64(1, screened(y).missing.size()); // a single sample
            y[at + 1] = 5;
            TEST_ASSERT_EQUAL_UINT64(lively < 2 ? 1 : 0, screened(y).missing.size());
        }
}

/// What is a fault is one in any unit, about any mean, and upside down.
static void offset_unit_and_sign_change_no_fault() {
    column clipped = moving(), spiky = moving(), hit = moving(), pulse = moving(), rest = held(0.33, 40),
           lively = moving();
    put(clipped, 1, 10);
    put(clipped, -1, 12, 17);
    spiky[700] = 40, spiky[900] = -35, spiky[901] = -6;
    hit[700] = 12, hit[701] = 2.5, hit[696] = 2.3, hit[705] = 3;
    pulse[700] = 12, pulse[699] = 3, pulse[701] = -1;
    for (std::size_t i = 440; i < 500; ++i) rest[i] *= 0.25;
    for (std::size_t i = 636; i < 765; ++i) lively[i] = moving(129)[i - 636] * 2.5;
    for (std::size_t d = 1; d <= 6; ++d) lively[700 - d] = lively[700 + d] = 0.125 * static_cast<double>(d % 3);
    lively[700] = 12;
    std::size_t faults = 0;
    for (const column& y : {clipped, spiky, hit, pulse, rest, lively, held(0.33, 31), held(0.33, 32), held(0.33, 40)}) {
        const outcome as_it_is = screened(y);
        faults += as_it_is.missing.size();
        for (const double unit : {1.0, -1.0, 0.125, -64.0})
            for (const double offset : {0.0, 2.0, -2.0, 4096.0}) { // whatever rounding does, equal samples stay equal
                column other = y;
                for (double& x : other) x = unit * (x + offset);
                const outcome one = screened(other);
                TEST_ASSERT_TRUE(one.missing == as_it_is.missing && one.kept == as_it_is.kept);
                TEST_ASSERT_EQUAL_STRING(as_it_is.said.c_str(), one.said.c_str());
            }
    }
    TEST_ASSERT_EQUAL_UINT64(22 + 2 + 1 + 1 + 32 + 40, faults);
}

/// Each spike costs the 60 samples behind it too: of 1940 samples with clean lags nine cost 28 %, ten 31 %.
static void an_output_that_loses_three_tenths_goes() {
    for (const std::size_t count : {9U, 10U}) {
        column y = moving();
        for (std::size_t k = 0; k < count; ++k) y[100 + 150 * k] = 12 + 0.01 * static_cast<double>(k);
        const outcome one = screened(y);
        TEST_ASSERT_EQUAL(count == 9, one.kept);
        TEST_ASSERT_EQUAL(count == 9, says(one, "left out as gaps"));
        TEST_ASSERT_EQUAL(count == 10, says(one, "the whole output is left out"));
        TEST_ASSERT_EQUAL_UINT64(count, one.missing.size());
    }
}

/// The same for samples that were missing before: nothing is faulty, but complete rows are what all outputs share.
static void an_output_that_costs_the_others_three_tenths_goes() {
    for (const std::size_t count : {9U, 10U}) {
        column y = moving();
        for (std::size_t k = 0; k < count; ++k) y[100 + 150 * k] = NAN;
        const outcome one = screened(y);
        TEST_ASSERT_EQUAL(count == 9, one.kept);
        TEST_ASSERT_EQUAL(count == 10, says(one, "samples missing so often that only 1330 have 60 complete ones before "
                                                 "them, of another output 1940"));
        TEST_ASSERT_EQUAL(count == 9, one.said.empty());
    }
}

static void an_output_that_never_moves_goes() {
    const outcome one = screened(column(2000, 0.7));
    TEST_ASSERT_FALSE(one.kept);
    TEST_ASSERT_TRUE(one.missing.empty());
    TEST_ASSERT_TRUE(says(one, "output \"a\" never moves: the whole output is left out"));
}

/// Where no output moves nothing is left out: what reads the record says what is wrong with it.
static void where_nothing_moves_all_is_kept() {
    record_set set;
    set.n_y = 2;
    set.add("", column(400, 1.0), 0, 200);
    const screened_outputs out = screen_outputs(set, {"a", "b"});
    TEST_ASSERT_TRUE(out.kept[0] && out.kept[1] && out.said.empty());
}

/// The only output, clipped at every second crest: what is clean of it has to do, and that is said.
static void the_only_output_is_not_left_out() {
    column y = moving();
    for (double& x : y) x = std::min(x, 0.2);
    record_set set;
    set.n_y = 1;
    set.add("", y, 0, y.size());
    const screened_outputs out = screen_outputs(set, {"a"});
    TEST_ASSERT_TRUE(out.kept[0] && out.said.size() == 1);
    TEST_ASSERT_TRUE(out.said[0].second.find("clipped") != std::string::npos);
    const std::string end = ": left out as gaps", &text = out.said[0].second;
    TEST_ASSERT_EQUAL_STRING(end.c_str(), text.substr(text.size() - end.size()).c_str());
}

/// Of two records it rests in the second, named for its file: from 32 samples on these are missing.
static void an_output_that_rests_in_one_record_is_missing_there() {
    for (const std::size_t count : {31U, 32U}) {
        record_set set;
        set.n_y = 1;
        set.add("one.csv", moving(), 0, 2000);
        set.add("two.csv", column(count, 0.7), 0, count);
        const screened_outputs out = screen_outputs(set, {"a"});
        TEST_ASSERT_TRUE(out.kept[0]);
        TEST_ASSERT_EQUAL(count == 32, is_nan(set.samples.back()));
        TEST_ASSERT_FALSE(is_nan(set.samples[1999]));
        TEST_ASSERT_EQUAL_UINT64(count == 32 ? 1 : 0, out.said.size());
        TEST_ASSERT_EQUAL(count == 32,
                          !out.said.empty() && out.said[0].second.find("output \"a\" of two.csv never moves") == 0);
    }
}

static void channels_of_outputs_that_go_are_taken_out() {
    const record_set set = set_of({1, 2, 3});
    const record_set less = without_outputs(set, {false, true});
    TEST_ASSERT_TRUE(less.n_u == 1 && less.n_y == 1 && less.records.size() == 1 && less.records[0].count == 3);
    for (std::size_t i = 0; i < 3; ++i) {
        TEST_ASSERT_TRUE(less.samples[2 * i] == set.samples[3 * i]);
        TEST_ASSERT_TRUE(less.samples[2 * i + 1] == set.samples[3 * i + 2]);
    }
}

int main() {
    UNITY_BEGIN();
    RUN_TEST(a_sound_output_is_left_alone);
    RUN_TEST(ten_samples_at_an_extreme_are_clipped);
    RUN_TEST(a_few_clipped_samples_take_their_neighbours_along);
    RUN_TEST(clipped_is_three_times_what_is_just_below);
    RUN_TEST(a_flat_top_below_a_spike_is_one);
    RUN_TEST(a_flat_top_of_a_part_is_one);
    RUN_TEST(thirty_two_equal_samples_are_frozen);
    RUN_TEST(eight_zeros_are_a_drop);
    RUN_TEST(a_slow_channel_keeps_its_values_longer);
    RUN_TEST(at_rest_is_not_frozen);
    RUN_TEST(a_spike_is_fifteen_spreads_out);
    RUN_TEST(a_hit_is_no_spike);
    RUN_TEST(a_peak_of_a_lively_stretch_is_no_spike);
    RUN_TEST(offset_unit_and_sign_change_no_fault);
    RUN_TEST(an_output_that_loses_three_tenths_goes);
    RUN_TEST(an_output_that_costs_the_others_three_tenths_goes);
    RUN_TEST(an_output_that_never_moves_goes);
    RUN_TEST(where_nothing_moves_all_is_kept);
    RUN_TEST(the_only_output_is_not_left_out);
    RUN_TEST(an_output_that_rests_in_one_record_is_missing_there);
    RUN_TEST(channels_of_outputs_that_go_are_taken_out);
    RUN_TEST(spikes_of_single_rows);
    return UNITY_END();
}
