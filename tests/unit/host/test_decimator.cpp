// SPDX-License-Identifier: MIT
// Decimation: which input an output is, and that a pause in one piece is a pause sample by sample.
#include "align/decimator.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <unity.h>
#include <vector>

using namespace okid_host;

void setUp(void) {}
void tearDown(void) {}

namespace {

constexpr double nothing = std::numeric_limits<double>::quiet_NaN();

struct recorder : grid_sink {
    std::vector<std::array<double, 2>> rows;
    std::vector<std::int64_t> times; ///< of each row, when it went out
    std::vector<grid_gap> gaps;
    std::int64_t out_of_turn = 0;
    const decimator* from = nullptr;
    void on_sample(std::int64_t index, const double* row) override {
        out_of_turn += index != static_cast<std::int64_t>(rows.size());
        rows.push_back({row[0], row[1]});
        times.push_back(from->time_ns(index));
    }
    void on_missing(std::int64_t index, std::int64_t count) override {
        out_of_turn += index != static_cast<std::int64_t>(rows.size()) || count <= 0;
        rows.insert(rows.end(), static_cast<std::size_t>(count), {nothing, nothing});
        times.insert(times.end(), static_cast<std::size_t>(count), 0);
    }
    void on_gap(const grid_gap& gap) override { gaps.push_back(gap); }
};

bool missing(double number) { return number != number; }

/// Inputs before `begin` and behind a pause of `pause`, 700 more; the first channel is the number of the input.
void play(int factor, std::int64_t begin, std::int64_t pause, bool in_one_piece, std::int64_t limit, recorder& out,
          std::int64_t* emitted, std::int64_t* received) {
    decimator to(2, factor, out);
    out.from = &to;
    if (limit) to.set_limit(limit);
    const double none[] = {nothing, nothing};
    for (std::int64_t n = 0; n < begin + pause + 700; ++n) {
        if (n == begin && pause > 0) {
            to.on_gap({0, begin, begin + pause - 1, pause, gap_cause::driver});
            to.on_gap({1, begin, begin + pause - 1, pause, gap_cause::link_down});
            if (in_one_piece) {
                to.on_missing(n, pause);
                n += pause - 1;
                continue;
            }
        }
        if (n >= begin && n < begin + pause) {
            to.note_time(n, 0);
            to.on_sample(n, none);
            continue;
        }
        to.note_time(n, 1000 + n);
        const double row[] = {static_cast<double>(n), 1};
        to.on_sample(n, row);
    }
    to.finish();
    *emitted = to.emitted();
    *received = to.channel(1).received;
    TEST_ASSERT_EQUAL_INT64(*emitted, to.channel(0).expected);
}

} // namespace

/// The filter is symmetric and passes what is constant: a ramp comes out as the number of the input in its middle.
static void test_an_output_is_the_input_in_the_middle_of_the_filter(void) {
    for (const int factor : {2, 3, 4}) {
        recorder out;
        std::int64_t emitted = 0, received = 0;
        play(factor, 0, 0, true, 0, out, &emitted, &received);
        const auto half = static_cast<std::int64_t>(fir_kernel(factor).half());
        TEST_ASSERT_EQUAL_INT64((700 - 1 - 2 * half) / factor + 1, static_cast<std::int64_t>(out.rows.size()));
        TEST_ASSERT_EQUAL_INT64(emitted, static_cast<std::int64_t>(out.rows.size()));
        TEST_ASSERT_EQUAL_INT64(emitted, received);
        TEST_ASSERT_EQUAL_INT64(0, out.out_of_turn);
        TEST_ASSERT_EQUAL_UINT64(0, out.gaps.size());
        for (std::size_t k = 0; k < out.rows.size(); ++k) {
            const std::int64_t middle = half + factor * static_cast<std::int64_t>(k);
            TEST_ASSERT_DOUBLE_WITHIN(1e-6, static_cast<double>(middle), out.rows[k][0]);
            TEST_ASSERT_DOUBLE_WITHIN(1e-9, 1, out.rows[k][1]);
            TEST_ASSERT_EQUAL_INT64(1000 + middle, out.times[k]);
        }
    }
}

/// Pauses of every length around those of the filter and of the ring, from any input on, with a limit and without.
static void test_a_pause_in_one_piece_is_one_sample_by_sample(void) {
    for (const int factor : {2, 3})
        for (const std::int64_t begin : {0, 1, 301})
            for (const std::int64_t pause : {1, 5, 127, 128, 129, 130, 192, 193, 257, 300, 384, 385, 512, 513, 3000})
                for (const std::int64_t limit : {0, 100, 200}) {
                    char text[80];
                    std::snprintf(text, sizeof text, "by %d, %lld missing from %lld on, limit %lld", factor,
                                  static_cast<long long>(pause), static_cast<long long>(begin),
                                  static_cast<long long>(limit));
                    recorder whole, single;
                    std::int64_t emitted[2] = {}, received[2] = {};
                    play(factor, begin, pause, true, limit, whole, &emitted[0], &received[0]);
                    play(factor, begin, pause, false, limit, single, &emitted[1], &received[1]);
                    TEST_ASSERT_EQUAL_INT64_MESSAGE(0, whole.out_of_turn + single.out_of_turn, text);
                    TEST_ASSERT_EQUAL_INT64_MESSAGE(emitted[1], emitted[0], text);
                    TEST_ASSERT_EQUAL_INT64_MESSAGE(received[1], received[0], text);
                    TEST_ASSERT_EQUAL_UINT64_MESSAGE(single.rows.size(), whole.rows.size(), text);
                    const auto half = static_cast<std::int64_t>(fir_kernel(factor).half());
                    std::int64_t lost = 0;
                    for (std::size_t k = 0; k < whole.rows.size(); ++k) {
                        const std::int64_t first =
                            factor * static_cast<std::int64_t>(k) + 1; // the filter's first input
                        const bool meets = first < begin + pause && first + 2 * half > begin;
                        lost += meets;
                        for (std::size_t c = 0; c < 2; ++c) {
                            TEST_ASSERT_EQUAL_INT_MESSAGE(meets, missing(whole.rows[k][c]), text);
                            TEST_ASSERT_EQUAL_INT_MESSAGE(meets, missing(single.rows[k][c]), text);
                            if (!meets) TEST_ASSERT_EQUAL_DOUBLE_MESSAGE(single.rows[k][c], whole.rows[k][c], text);
                        }
                        TEST_ASSERT_EQUAL_INT64_MESSAGE(single.times[k], whole.times[k], text);
                    }
                    TEST_ASSERT_EQUAL_UINT64_MESSAGE(single.gaps.size(), whole.gaps.size(), text);
                    TEST_ASSERT_EQUAL_UINT64_MESSAGE(lost > 0 ? 2 : 0, whole.gaps.size(), text);
                    for (std::size_t k = 0; k < whole.gaps.size(); ++k) {
                        const grid_gap &a = whole.gaps[k], &b = single.gaps[k];
                        TEST_ASSERT_EQUAL_INT64_MESSAGE(lost, a.count, text);
                        TEST_ASSERT_EQUAL_INT64_MESSAGE(b.count, a.count, text);
                        TEST_ASSERT_EQUAL_INT64_MESSAGE(b.first, a.first, text);
                        TEST_ASSERT_EQUAL_INT64_MESSAGE(a.first + a.count - 1, a.last, text);
                        TEST_ASSERT_TRUE_MESSAGE(a.cause == (a.channel == 0 ? gap_cause::driver : gap_cause::link_down),
                                                 text);
                    }
                }
}

int main(void) {
    UNITY_BEGIN();
    RUN_TEST(test_an_output_is_the_input_in_the_middle_of_the_filter);
    RUN_TEST(test_a_pause_in_one_piece_is_one_sample_by_sample);
    return UNITY_END();
}
