// SPDX-License-Identifier: MIT
// Frames of several buses in the order of time: a program that was away for seconds gives no sample up, nor does one whose
// adapter holds its frames back for five, nor one of whose readers is behind by any time, as long as there is memory.
#include "acquire/ring_merge.hpp"
#include "align/grid.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <memory>
#include <random>
#include <string>
#include <unistd.h>
#include <unity.h>
#include <vector>

using namespace okid_host;

void setUp(void) {}
void tearDown(void) {}

namespace {

constexpr std::size_t plenty = 1 << 20;
constexpr std::int64_t begin_ns = 1700000000000000000, period_ns = 1000000;

struct ring {
    explicit ring(std::size_t capacity)
        : block(new std::byte[drv_ring_memsize(capacity)]()),
          self(drv_ring_create(capacity, block.get(), drv_ring_memsize(capacity))) {}
    std::unique_ptr<std::byte[]> block;
    drv_ring_t* self;
};

/// Sample `number` of a bus: counter and value.
drv_frame_t sample(std::uint8_t bus, std::uint32_t number, std::int64_t late_ns = 0) {
    drv_frame_t out{};
    out.time_ns = begin_ns + period_ns * number + bus * 1000 + late_ns;
    out.id = 0x100;
    out.bus = bus;
    out.len = 4;
    for (int i = 0; i < 4; ++i) out.data[i] = static_cast<std::uint8_t>(number >> (i < 2 ? 8 * i : 8 * (i - 2)));
    return out;
}

void fill(ring& to, std::uint8_t bus, std::uint32_t first, std::uint32_t end) {
    for (std::uint32_t n = first; n < end; ++n) {
        const drv_frame_t frame = sample(bus, n);
        drv_ring_push(to.self, &frame, 1);
    }
}

live_config make_config(std::size_t buses) {
    live_config config;
    config.rate_hz = 1000;
    config.buses.resize(buses);
    for (std::size_t i = 0; i < buses; ++i) {
        channel_config channel;
        channel.name = "c" + std::to_string(i);
        channel.bus = i;
        channel.frame.id = 0x100;
        drv_signal_t counter{};
        counter.length = 16;
        counter.scale = 1;
        channel.layout = counter;
        channel.layout.start_bit = 16;
        drv_signal_prepare(&channel.layout);
        drv_signal_prepare(&counter);
        channel.sequence = counter;
        config.channels.push_back(channel);
    }
    return config;
}

struct sums : grid_sink {
    std::int64_t samples = 0, holes = 0;
    void on_sample(std::int64_t, const double* row) override {
        ++samples;
        holes += row[0] != row[0] || row[0] != row[1];
    }
    void on_missing(std::int64_t, std::int64_t count) override { holes += count; }
    void on_gap(const grid_gap& gap) override { holes += gap.count; }
};

void in_the_order_of_time() {
    ring a(4096), b(4096), c(4096);
    ring_merge merge;
    merge.add(a.self, plenty, nullptr);
    merge.add(b.self, plenty, nullptr);
    merge.add(c.self, plenty, nullptr);
    fill(a, 0, 0, 3000);
    fill(b, 1, 1000, 2000);
    std::vector<drv_frame_t> got(7);
    std::int64_t before = 0;
    std::size_t total = 0, idle = 0;
    while (idle < 2) {
        const std::size_t count = merge.take(got.data(), got.size());
        idle = count ? 0 : idle + 1;
        for (std::size_t i = 0; i < count; ++i) {
            TEST_ASSERT_TRUE(got[i].time_ns >= before);
            before = got[i].time_ns;
        }
        total += count;
    }
    TEST_ASSERT_EQUAL_UINT64(4000, total);
    TEST_ASSERT_EQUAL_UINT64(0, merge.take(got.data(), got.size()));
}

void what_a_ring_lost_stands_before_its_next_frame() {
    ring a(64), b(64);
    ring_merge merge;
    merge.add(a.self, plenty, nullptr);
    merge.add(b.self, plenty, nullptr);
    fill(a, 0, 0, 100); // 36 are gone
    fill(b, 1, 90, 100);
    std::vector<drv_frame_t> got(200);
    std::size_t count = 0;
    for (std::size_t more; (more = merge.take(got.data() + count, got.size() - count)) > 0;) count += more;
    TEST_ASSERT_EQUAL_UINT64(74, count);
    for (std::size_t i = 0; i < count; ++i) TEST_ASSERT_EQUAL_INT(i == 0 ? DRV_LOSS_DRIVER : 0, got[i].loss);
    TEST_ASSERT_EQUAL_UINT64(36, drv_ring_missed(a.self));
}

/// Five seconds of two buses wait: each sample is whole.
void a_backlog_costs_nothing() {
    ring a(8192), b(8192);
    ring_merge merge;
    merge.add(a.self, plenty, nullptr);
    merge.add(b.self, plenty, nullptr);
    fill(a, 0, 0, 5000);
    fill(b, 1, 0, 5000);
    const live_config config = make_config(2);
    sums sink;
    grid on(config, sink);
    std::vector<drv_frame_t> got(256);
    for (std::size_t count; (count = merge.take(got.data(), got.size())) > 0;)
        for (std::size_t i = 0; i < count; ++i) on.push(got[i]);
    on.finish();
    TEST_ASSERT_EQUAL_INT64(5000, sink.samples);
    TEST_ASSERT_EQUAL_INT64(0, sink.holes);
}

/// One bus arrives `late` samples behind the other. @return numbers that are missing
std::int64_t held_back(std::uint32_t late) {
    const live_config config = make_config(2);
    sums sink;
    grid on(config, sink);
    const std::uint32_t count = 12000;
    for (std::uint32_t n = 0; n < count; ++n) {
        on.push(sample(0, n));
        if (n < 2000 || n >= 2000 + late) on.push(sample(1, n));
        for (std::uint32_t k = 2000; n + 1 == 2000 + late && k <= n; ++k) on.push(sample(1, k, period_ns * (n - k)));
    }
    on.finish();
    return sink.holes;
}

void an_adapter_may_hold_frames_back_for_five_seconds() {
    TEST_ASSERT_EQUAL_INT64(0, held_back(300));
    TEST_ASSERT_EQUAL_INT64(0, held_back(900));
    TEST_ASSERT_EQUAL_INT64(0, held_back(5000));
    TEST_ASSERT_TRUE(held_back(6500) > 0); // no sample waits for ever
}

std::size_t take_all(ring_merge& merge, std::vector<drv_frame_t>& into) {
    std::vector<drv_frame_t> got(256);
    const std::size_t before = into.size();
    for (std::size_t count; (count = merge.take(got.data(), got.size())) > 0;)
        into.insert(into.end(), got.begin(), got.begin() + static_cast<std::ptrdiff_t>(count));
    return into.size() - before;
}

/// One reader has read everything, the other one nothing of the last nine seconds: 0.1 gave those up.
void a_reader_that_is_behind_is_waited_for() {
    ring a(16384), b(16384);
    watermark marks[2];
    ring_merge merge;
    merge.add(a.self, plenty, &marks[0]);
    merge.add(b.self, plenty, &marks[1]);
    fill(a, 0, 0, 10000);
    fill(b, 1, 0, 1000);
    marks[0].emptied(begin_ns + 10000 * period_ns);
    marks[1].emptied(begin_ns + 1000 * period_ns);
    std::vector<drv_frame_t> got;
    TEST_ASSERT_INT64_WITHIN(4, 2000, take_all(merge, got));
    TEST_ASSERT_TRUE(merge.waiting());
    TEST_ASSERT_EQUAL_UINT64(1, merge.waited_for());
    fill(b, 1, 1000, 10000);
    marks[1].emptied(begin_ns + 10000 * period_ns);
    take_all(merge, got);
    marks[0].ended();
    marks[1].ended();
    take_all(merge, got);
    TEST_ASSERT_FALSE(merge.waiting());
    TEST_ASSERT_EQUAL_UINT64(20000, got.size());
    TEST_ASSERT_EQUAL_UINT64(0, merge.hurried());
    const live_config config = make_config(2);
    sums sink;
    grid on(config, sink);
    for (const drv_frame_t& frame : got) on.push(frame);
    on.finish();
    TEST_ASSERT_EQUAL_INT64(10000, sink.samples);
    TEST_ASSERT_EQUAL_INT64(0, sink.holes);
    TEST_ASSERT_EQUAL_UINT64(0, on.bus(1).too_late);
}

/// The memory for those that wait is used up: they go on and are counted; what comes later than the grid waits is given up
/// and counted, and nothing is lost in silence.
void at_the_bound_frames_go_on_and_are_counted() {
    ring a(16384), b(16384);
    watermark marks[2];
    ring_merge merge;
    merge.add(a.self, 12288, &marks[0]);
    merge.add(b.self, 12288, &marks[1]);
    const live_config config = make_config(2);
    sums sink;
    grid on(config, sink);
    std::vector<drv_frame_t> got;
    marks[1].emptied(begin_ns);
    for (std::uint32_t n = 0; n < 30000; ++n) {
        fill(a, 0, n, n + 1);
        marks[0].emptied(begin_ns + period_ns * (n + 2));
        take_all(merge, got);
        TEST_ASSERT_TRUE(drv_ring_used(a.self) <= 12288);
    }
    TEST_ASSERT_EQUAL_UINT64(0, drv_ring_overrun(a.self));
    TEST_ASSERT_INT64_WITHIN(100, 30000 - 12288, got.size()); // a batch is out of the ring
    TEST_ASSERT_INT64_WITHIN(100, 30000 - 12288, merge.hurried());
    fill(b, 1, 20000, 30000);
    marks[0].ended();
    marks[1].ended();
    take_all(merge, got);
    for (const drv_frame_t& frame : got) on.push(frame);
    on.finish();
    const grid_bus_counts counts = on.bus(1);
    TEST_ASSERT_EQUAL_UINT64(10000, counts.received);
    TEST_ASSERT_EQUAL_INT64(static_cast<std::int64_t>(counts.received - counts.too_late), on.channel(1).received);
    TEST_ASSERT_EQUAL_INT64(on.channel(1).expected, on.channel(0).expected);
}

/// For a journal, which is to be on the disk: no frame waits longer than that.
void patience_ends() {
    constexpr std::int64_t patience = 20000000, hour = 3600000000000;
    for (const bool ends : {false, true}) { // no moment between the two is far enough from now on every machine
        ring a(64), b(64);
        watermark marks[2];
        ring_merge merge(patience);
        merge.add(a.self, 64, &marks[0]);
        merge.add(b.self, 64, &marks[1]);
        drv_frame_t frame = sample(0, 0);
        frame.time_ns = drv_host_time_ns() + (ends ? -patience - 1 : hour);
        drv_ring_push(a.self, &frame, 1);
        std::vector<drv_frame_t> got;
        TEST_ASSERT_EQUAL_UINT64(ends, take_all(merge, got));
        TEST_ASSERT_EQUAL_UINT64(ends, merge.hurried());
    }
}

/// A reader that sleeps over an empty queue holds nobody up, one that has not seen yet what waits in its queue does.
void a_silent_bus_is_read_up_to_now() {
    int ends[2];
    TEST_ASSERT_EQUAL_INT(0, pipe(ends));
    watermark mark;
    const std::int64_t before = drv_host_time_ns() - 5000000;
    mark.emptied(before);
    TEST_ASSERT_TRUE(mark.until() < before);
    mark.idle(ends[0]);
    TEST_ASSERT_TRUE(mark.until() >= before + 4000000);
    TEST_ASSERT_EQUAL_INT64(1, write(ends[1], "x", 1));
    TEST_ASSERT_TRUE(mark.until() < before);
    mark.at_work();
    TEST_ASSERT_TRUE(mark.until() < before);
    mark.saw(before - 30000000); // a packet whose first sample is that old
    mark.emptied(before);
    TEST_ASSERT_TRUE(mark.until() <= before - 30000000);
    mark.ended();
    TEST_ASSERT_EQUAL_INT64(watermark::all_read, mark.until());
    close(ends[0]);
    close(ends[1]);
}

/// Readers that are stalled, of a bus with counters, one without, and a line, which stamps what it reads when it reads it.
struct stalled_run {
    explicit stalled_run(unsigned seed) : draw(seed) {
        config.channels[1].sequence.reset();
        config.channels[2].sequence.reset();
        for (int i = 0; i < 3; ++i) merge.add(rings[i]->self, plenty, &marks[i]);
    }
    /// @return what is wrong, "" = nothing
    std::string run() {
        const double seconds = 0.1 * std::pow(50, std::uniform_real_distribution<>(0, 1)(draw));
        const double begin = std::uniform_real_distribution<>(0, 15 - seconds)(draw);
        const int who = std::uniform_int_distribution<>(0, 4)(draw); // 3 = the merge, 4 = the whole program
        const std::int64_t from = begin_ns + std::llround(begin * 1e9), to = from + std::llround(seconds * 1e9);
        grid on(config, sink);
        for (std::int64_t now = begin_ns; now < begin_ns + 15 * second; now += tick) {
            const bool stalls = now >= from && now < to;
            for (int i = 0; i < 3; ++i)
                if (!stalls || (who != i && who != 4)) read(static_cast<std::uint8_t>(i), now);
            if (!stalls || who < 3) serve(on);
        }
        for (int i = 0; i < 3; ++i) read(static_cast<std::uint8_t>(i), begin_ns + 15 * second), marks[i].ended();
        serve(on);
        on.finish();
        std::uint64_t late = 0;
        for (std::size_t i = 0; i < 3; ++i) late += on.bus(i).too_late + on.bus(i).duplicate;
        char text[160];
        std::snprintf(text, sizeof text, "%.2f s of %d at %.2f s: %lld holes, %lld steps, %llu given up, %lld samples",
                      seconds, who, begin, static_cast<long long>(sink.holes), static_cast<long long>(sink.steps),
                      static_cast<unsigned long long>(late), static_cast<long long>(sink.samples));
        return sink.holes == 0 && sink.steps == 0 && late == 0 && sink.samples > 14900 ? "" : text;
    }

  private:
    static constexpr std::int64_t second = 1000000000, tick = 10000000;
    struct checked : grid_sink {
        std::int64_t samples = 0, holes = 0, steps = 0;
        double last[3] = {};
        void on_sample(std::int64_t, const double* row) override {
            for (int c = 0; c < 3; ++c) {
                holes += row[c] != row[c];
                steps += samples > 0 && row[c] != last[c] + 1;
                last[c] = row[c];
            }
            ++samples;
        }
        void on_missing(std::int64_t, std::int64_t count) override { holes += count; }
        void on_gap(const grid_gap&) override {}
    };
    void read(std::uint8_t bus, std::int64_t now) {
        for (; begin_ns + period_ns * next[bus] + 1000 * bus <= now; ++next[bus]) {
            drv_frame_t frame = sample(bus, next[bus]);
            if (bus == 2) frame.time_ns = now;
            drv_ring_push(rings[bus]->self, &frame, 1);
        }
        marks[bus].emptied(now);
    }
    void serve(grid& on) {
        std::vector<drv_frame_t> got;
        take_all(merge, got);
        for (const drv_frame_t& frame : got) on.push(frame);
    }
    std::mt19937 draw;
    live_config config = make_config(3);
    std::unique_ptr<ring> rings[3] = {std::make_unique<ring>(8192), std::make_unique<ring>(8192),
                                      std::make_unique<ring>(8192)};
    watermark marks[3];
    ring_merge merge;
    std::uint32_t next[3] = {};
    checked sink;
};

void stalls_lose_nothing() {
    const bool slow = std::getenv("OKID_SLOW") != nullptr;
    for (unsigned seed = 1; seed <= (slow ? 1000U : 60U); ++seed) {
        const std::string fault = stalled_run(seed).run();
        TEST_ASSERT_TRUE_MESSAGE(fault.empty(), (std::to_string(seed) + ": " + fault).c_str());
    }
}

} // namespace

int main() {
    UNITY_BEGIN();
    RUN_TEST(a_reader_that_is_behind_is_waited_for);
    RUN_TEST(at_the_bound_frames_go_on_and_are_counted);
    RUN_TEST(patience_ends);
    RUN_TEST(a_silent_bus_is_read_up_to_now);
    RUN_TEST(stalls_lose_nothing);
    RUN_TEST(in_the_order_of_time);
    RUN_TEST(what_a_ring_lost_stands_before_its_next_frame);
    RUN_TEST(a_backlog_costs_nothing);
    RUN_TEST(an_adapter_may_hold_frames_back_for_five_seconds);
    return UNITY_END();
}
