// SPDX-License-Identifier: MIT
// Frames lost, doubled and out of order over many seeds: the gaps on the grid are the losses that were made.
#include "grid_frames.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <map>
#include <random>
#include <seeds.h>
#include <set>
#include <unity.h>

using namespace okid_host;

void setUp(void) {}
void tearDown(void) {}

namespace {

drv_frame_t make_frame(const live_config& config, std::size_t message, std::int64_t sample, std::uint64_t first_counter,
                       double late_s = 0) {
    const auto counter = static_cast<std::int64_t>(first_counter + static_cast<std::uint64_t>(sample));
    const double at_s = static_cast<double>(sample) / config.rate_hz + late_s;
    return lane_frame(config, message, counter, sample,
                      std::llround(at_s * 1e9) + static_cast<std::int64_t>(message) * 20000);
}

/// Remembers what came out and checks that every number stands in its row.
struct recorder : grid_sink {
    std::int64_t base = -1, rows = 0, bulk = 0, nans = 0, wrong = 0;
    std::size_t width = 0;
    std::vector<grid_gap> gaps;
    void on_sample(std::int64_t index, const double* row) override {
        wrong += index != rows + bulk;
        ++rows;
        for (std::size_t i = 0; i < width; ++i) {
            if (row[i] != row[i]) {
                ++nans;
                continue;
            }
            const auto sample = static_cast<std::int64_t>(row[i]);
            if (base < 0) base = sample - index;
            wrong += sample != base + index;
        }
    }
    void on_missing(std::int64_t index, std::int64_t count) override {
        wrong += index != rows + bulk;
        bulk += count;
        nans += count * static_cast<std::int64_t>(width);
    }
    void on_gap(const grid_gap& gap) override {
        wrong += gap.last - gap.first + 1 != gap.count;
        gaps.push_back(gap);
    }
    std::int64_t marked() const {
        std::int64_t sum = 0;
        for (const grid_gap& gap : gaps) sum += gap.count;
        return sum;
    }
};

struct stream {
    live_config config;
    recorder out;
    grid on;
    explicit stream(live_config c) : config(std::move(c)), on(config, out) { out.width = config.channels.size(); }
    void send(std::size_t message, std::int64_t sample, std::uint64_t first_counter, double late_s = 0,
              std::uint8_t loss = 0) {
        drv_frame_t frame = make_frame(config, message, sample, first_counter, late_s);
        frame.loss = loss;
        on.push(frame);
    }
};

void check_seed(unsigned seed) {
    std::mt19937 random(seed);
    const auto pick = [&](int low, int high) { return std::uniform_int_distribution<int>(low, high)(random); };
    static const unsigned widths[] = {8, 12, 16, 16, 32};
    const auto messages = static_cast<std::size_t>(pick(1, 6));
    const unsigned bits = widths[pick(0, 4)];
    const std::uint64_t first_counter =
        std::uniform_int_distribution<std::uint64_t>(0, (std::uint64_t{1} << bits) - 1)(random);
    stream s(lanes_of(messages, bits));
    const int samples = pick(200, 900), joined = pick(0, static_cast<int>(messages) - 1);
    struct sent {
        drv_frame_t frame;
        int place;
    };
    std::vector<sent> frames;
    std::int64_t lost = 0, doubled = 0;
    const int loss_percent = pick(0, 20), burst_most = pick(1, 30);
    std::vector<int> burst(messages, 0);
    for (int n = 0; n < samples; ++n)
        for (std::size_t m = n == 0 ? static_cast<std::size_t>(joined) : 0; m < messages; ++m) {
            const bool may = n >= 3 && n < samples - 30;
            if (may && burst[m] == 0 && pick(0, 99) < loss_percent) burst[m] = pick(1, burst_most);
            if (may && burst[m] > 0) {
                --burst[m];
                ++lost;
                continue;
            }
            burst[m] = 0;
            frames.push_back({make_frame(s.config, m, n, first_counter), 0});
            if (may && pick(0, 49) == 0) {
                frames.push_back(frames.back());
                ++doubled;
            }
        }
    // Reordered: every frame may come up to 8 places early or late.
    const int shuffle = pick(0, 1) ? 8 : 0;
    for (std::size_t i = 0; i < frames.size(); ++i) {
        const bool inner = i > 4 * messages && i + 20 * messages < frames.size();
        frames[i].place = static_cast<int>(2 * i) + (inner ? pick(-shuffle, shuffle) : 0);
    }
    std::stable_sort(frames.begin(), frames.end(), [](const sent& a, const sent& b) { return a.place < b.place; });
    for (const sent& each : frames) s.on.push(each.frame);
    s.on.finish();
    char text[160];
    std::snprintf(text, sizeof text, "seed %u: %zu messages, %u bits, %d samples, %lld lost, reorder %d", seed,
                  messages, bits, samples, static_cast<long long>(lost), shuffle);
    TEST_ASSERT_EQUAL_INT64_MESSAGE(0, s.out.wrong, text);
    TEST_ASSERT_EQUAL_INT64_MESSAGE(lost, s.out.marked(), text);
    TEST_ASSERT_EQUAL_INT64_MESSAGE(lost, s.out.nans, text);
    TEST_ASSERT_EQUAL_UINT64_MESSAGE(static_cast<std::uint64_t>(doubled), s.on.bus(0).duplicate, text);
    TEST_ASSERT_EQUAL_UINT64_MESSAGE(frames.size(), s.on.bus(0).received, text);
    TEST_ASSERT_EQUAL_INT64_MESSAGE(samples - (joined > 0), s.out.rows + s.out.bulk, text);
    std::int64_t missing = 0;
    for (std::size_t c = 0; c < messages; ++c) missing += s.on.channel(c).expected - s.on.channel(c).received;
    TEST_ASSERT_EQUAL_INT64_MESSAGE(lost, missing, text);
    if (shuffle == 0) TEST_ASSERT_EQUAL_UINT64_MESSAGE(0, s.on.bus(0).out_of_order, text);
}

} // namespace

static void test_gaps_are_the_losses() {
    for (unsigned seed = 1; seed <= draw_seeds(2500, 10000); ++seed) check_seed(seed);
}

static void test_counter_wraps_many_times() {
    stream s(lanes_of(3, 4)); // a counter of four bits
    for (int n = 0; n < 5000; ++n)
        for (std::size_t m = 0; m < 3; ++m)
            if (!(m == 1 && n % 100 == 50)) s.send(m, n, 13);
    s.on.finish();
    TEST_ASSERT_EQUAL_INT64(0, s.out.wrong);
    TEST_ASSERT_EQUAL_INT64(5000, s.out.rows);
    TEST_ASSERT_EQUAL_INT64(50, s.out.marked());
}

static void test_unrelated_counters_are_aligned_by_time() {
    stream s(lanes_of(2, 16));
    for (int n = 0; n < 2000; ++n) {
        s.send(0, n, 100);
        s.send(1, n, 40000);
    }
    s.on.finish();
    TEST_ASSERT_EQUAL_INT64(0, s.out.wrong);
    TEST_ASSERT_EQUAL_INT64(2000, s.out.rows);
    TEST_ASSERT_EQUAL_INT64(0, s.out.marked());
}

static void test_causes() {
    stream s(lanes_of(2, 16));
    const auto both = [&](int from, int to) {
        for (int n = from; n < to; ++n)
            for (std::size_t m = 0; m < 2; ++m) s.send(m, n, 0);
    };
    both(0, 100);
    s.send(0, 105, 0, 0, DRV_LOSS_OVERFLOW);
    s.send(1, 105, 0);
    both(106, 200);
    s.send(0, 210, 0, 0, DRV_LOSS_DRIVER);
    s.send(1, 210, 0);
    both(211, 300);
    s.send(0, 70000, 0, 0, DRV_LOSS_LINK); // the counter went round once while the link was down
    s.send(1, 70000, 0);
    both(70001, 70100);
    for (int n = 70100; n < 70200; ++n) s.send(0, n, 0); // the other sensor falls silent
    s.on.finish();
    TEST_ASSERT_EQUAL_INT64(0, s.out.wrong);
    std::map<gap_cause, std::int64_t> by;
    for (const grid_gap& gap : s.out.gaps) by[gap.cause] += gap.count;
    TEST_ASSERT_EQUAL_INT64(10, by[gap_cause::socket_overflow]);
    TEST_ASSERT_EQUAL_INT64(20, by[gap_cause::driver]);
    TEST_ASSERT_EQUAL_INT64(2 * 69700, by[gap_cause::link_down]);
    TEST_ASSERT_EQUAL_INT64(99, by[gap_cause::stall]); // the last sample was cut by the end
    TEST_ASSERT_EQUAL_INT64(0, by[gap_cause::sequence]);
}

/// For more than a second while another goes on: a stall, whether it comes back in its place or from zero. Where all are
/// silent frames were lost, and where it stays silent while its interface is down that is the cause.
static void test_a_silence_has_a_cause() {
    for (const bool restarts : {false, true})
        for (const bool other : {true, false})
            for (const int lost : {900, 1000, 1001, 3000}) {
                stream s(lanes_of(2, 16));
                for (int n = 0; n < 5000; ++n)
                    for (std::size_t m = 0; m < 2; ++m) {
                        const bool away = n >= 500 && n < 500 + lost && (m == 1 || !other);
                        if (!away)
                            s.send(m, n, restarts && m == 1 && n >= 500 ? -static_cast<std::uint64_t>(500 + lost) : 0);
                    }
                s.on.finish();
                const bool stalls = lost > 1000 && other;
                for (const grid_gap& gap : s.out.gaps)
                    TEST_ASSERT_TRUE(gap.cause == (stalls ? gap_cause::stall : gap_cause::sequence));
                TEST_ASSERT_EQUAL_INT64(other ? lost : 2 * lost, s.out.marked());
            }
    for (const bool down : {false, true}) {
        stream s(lanes_of(2, 16, 1000, 2));
        for (int n = 0; n < 9000; ++n) {
            s.send(0, n, 0);
            if (n < 500) s.send(1, n, 0);
            if (n == 600) s.on.set_link(1, down);
        }
        const auto which = static_cast<std::size_t>(down ? gap_cause::link_down : gap_cause::stall);
        TEST_ASSERT_GREATER_THAN_UINT64(8000, s.on.bus(1).lost[which]); // while it lasts
        s.on.finish();
        TEST_ASSERT_EQUAL_UINT64(8499, s.on.bus(1).lost[which]); // the last sample was cut by the end
        TEST_ASSERT_EQUAL_UINT64(1, s.out.gaps.size());
        TEST_ASSERT_TRUE(s.out.gaps[0].cause == (down ? gap_cause::link_down : gap_cause::stall));
    }
}

static void test_a_damaged_counter_moves_nothing() {
    stream s(lanes_of(2, 16));
    for (int n = 0; n < 1000; ++n)
        for (std::size_t m = 0; m < 2; ++m) {
            drv_frame_t frame = make_frame(s.config, m, n, 0);
            if (n == 500 && m == 1) frame.data[1] ^= 0x80;
            s.on.push(frame);
        }
    s.on.finish();
    TEST_ASSERT_EQUAL_INT64(0, s.out.wrong);
    TEST_ASSERT_EQUAL_INT64(1000, s.out.rows);
    TEST_ASSERT_EQUAL_INT64(1, s.out.marked());
    TEST_ASSERT_EQUAL_UINT64(1, s.on.bus(0).decode_errors);
}

static void test_a_sender_that_starts_anew_is_taken_up() {
    stream s(lanes_of(2, 16));
    for (int n = 0; n < 1000; ++n)
        for (std::size_t m = 0; m < 2; ++m) s.send(m, n, 30000);
    recorder& out = s.out;
    out.width = 0; // numbers begin anew too
    for (int n = 0; n < 1000; ++n)
        for (std::size_t m = 0; m < 2; ++m) s.send(m, n, 0, 1.5);
    s.on.finish();
    TEST_ASSERT_EQUAL_INT64(0, out.wrong);
    TEST_ASSERT_EQUAL_INT(2, out.gaps.size());
    TEST_ASSERT_EQUAL_INT64(out.gaps[0].first, out.gaps[1].first);
    TEST_ASSERT_EQUAL_INT64(out.gaps[0].last, out.gaps[1].last);
    TEST_ASSERT_EQUAL_INT64(1000, s.on.channel(0).expected - 1000 - out.gaps[0].count);
    TEST_ASSERT_EQUAL_INT64(2000, s.on.channel(1).received);
}

static void test_cadence_with_jitter_and_losses() {
    for (unsigned seed = 1; seed <= 200; ++seed) {
        std::mt19937 random(seed);
        std::uniform_real_distribution<double> jitter(-0.2e-3, 0.2e-3);
        stream s(lanes_of(2, 0));
        std::int64_t lost = 0;
        for (int n = 0; n < 3000; ++n)
            for (std::size_t m = 0; m < 2; ++m) {
                if (n > 100 && n < 2900 && random() % 50 == 0) {
                    ++lost;
                    continue;
                }
                s.send(m, n, 0, jitter(random));
            }
        s.on.finish();
        char text[64];
        std::snprintf(text, sizeof text, "seed %u", seed);
        TEST_ASSERT_EQUAL_INT64_MESSAGE(0, s.out.wrong, text);
        TEST_ASSERT_EQUAL_INT64_MESSAGE(lost, s.out.marked(), text);
    }
}

static void test_cadence_survives_bursts() {
    stream s(lanes_of(2, 0)); // a reader that wakes every 10 ms, a device clock 50 ppm fast
    for (int n = 0; n < 20000; ++n)
        for (std::size_t m = 0; m < 2; ++m) {
            const double true_s = n * 1e-3 * (1 - 50e-6), seen_s = std::ceil(true_s / 10e-3) * 10e-3;
            s.send(m, n, 0, seen_s - n * 1e-3);
        }
    s.on.finish();
    TEST_ASSERT_EQUAL_INT64(0, s.out.wrong);
    TEST_ASSERT_EQUAL_INT64(20000, s.out.rows);
    TEST_ASSERT_EQUAL_INT64(0, s.out.marked());
}

static void test_frames_that_are_no_data() {
    stream s(lanes_of(2, 16));
    for (int n = 0; n < 100; ++n) {
        for (std::size_t m = 0; m < 2; ++m) s.send(m, n, 0);
        drv_frame_t other = make_frame(s.config, 0, n, 0);
        other.id = 0x7FF;
        s.on.push(other);
        other.id = 0x100;
        other.flags = DRV_FRAME_EXTENDED;
        s.on.push(other);
        other.bus = 7;
        s.on.push(other);
        drv_frame_t cut = make_frame(s.config, 1, n, 0);
        cut.len = 7;
        s.on.push(cut);
    }
    s.on.finish();
    TEST_ASSERT_EQUAL_INT64(100, s.out.rows);
    TEST_ASSERT_EQUAL_INT64(0, s.out.nans);
    TEST_ASSERT_EQUAL_UINT64(100, s.on.bus(0).decode_errors);
    TEST_ASSERT_EQUAL_UINT64(300, s.on.bus(0).received);
}

static void test_a_silent_message_is_named() {
    stream s(lanes_of(2, 16));
    for (int n = 0; n < 5000; ++n) s.send(0, n, 0);
    s.on.finish();
    TEST_ASSERT_EQUAL_INT(1, s.on.silent_channels().size());
    TEST_ASSERT_EQUAL_INT(1, s.on.silent_channels()[0]);
    TEST_ASSERT_EQUAL_INT64(0, s.on.channel(1).received);
    TEST_ASSERT_TRUE(s.out.rows > 4990);
    stream none(lanes_of(2, 16));
    none.on.finish();
    TEST_ASSERT_EQUAL_INT64(0, none.on.emitted());
    TEST_ASSERT_EQUAL_INT(2, none.on.silent_channels().size());
}

static void test_limit() {
    stream s(lanes_of(2, 16));
    s.on.set_limit(250);
    for (int n = 0; n < 1000 && s.on.emitted() < 250; ++n)
        for (std::size_t m = 0; m < 2; ++m) s.send(m, n, 0);
    s.on.finish();
    TEST_ASSERT_EQUAL_INT64(250, s.out.rows);
    TEST_ASSERT_EQUAL_INT64(250, s.on.channel(1).expected);
}

/// Anything may come: the grid stays bounded and consistent.
static void test_noise() {
    for (unsigned seed = 1; seed <= 300; ++seed) {
        std::mt19937_64 random(seed);
        live_config config = lanes_of(4, seed % 2 ? 16 : 8);
        if (seed % 3 == 0) config.channels[2].sequence.reset();
        stream s(config);
        s.out.width = 0;
        for (int i = 0; i < 3000; ++i) {
            drv_frame_t frame{};
            frame.id = 0x100 + static_cast<std::uint32_t>(random() % 4);
            frame.len = random() % 20 ? 8 : static_cast<std::uint8_t>(random() % 9);
            frame.time_ns = day_ns + static_cast<std::int64_t>(random() % 4000000000u);
            frame.loss = random() % 50 ? 0 : static_cast<std::uint8_t>(random() % 8);
            for (auto& byte : frame.data) byte = static_cast<std::uint8_t>(random());
            s.on.push(frame);
        }
        s.on.finish();
        TEST_ASSERT_EQUAL_INT64(0, s.out.wrong);
        for (std::size_t c = 0; c < 4; ++c) TEST_ASSERT_EQUAL_INT64(s.on.emitted(), s.on.channel(c).expected);
        std::int64_t missing = 0;
        for (std::size_t c = 0; c < 4; ++c) missing += s.on.channel(c).expected - s.on.channel(c).received;
        TEST_ASSERT_EQUAL_INT64(missing, s.out.marked());
    }
}

int main(void) {
    UNITY_BEGIN();
    RUN_TEST(test_gaps_are_the_losses);
    RUN_TEST(test_counter_wraps_many_times);
    RUN_TEST(test_unrelated_counters_are_aligned_by_time);
    RUN_TEST(test_causes);
    RUN_TEST(test_a_silence_has_a_cause);
    RUN_TEST(test_a_damaged_counter_moves_nothing);
    RUN_TEST(test_a_sender_that_starts_anew_is_taken_up);
    RUN_TEST(test_cadence_with_jitter_and_losses);
    RUN_TEST(test_cadence_survives_bursts);
    RUN_TEST(test_frames_that_are_no_data);
    RUN_TEST(test_a_silent_message_is_named);
    RUN_TEST(test_limit);
    RUN_TEST(test_noise);
    return UNITY_END();
}
