// SPDX-License-Identifier: MIT
// Frames of several buses in the order of time: a program that was away for seconds gives no sample up, and neither does
// one whose adapter holds its frames back for five.
#include "acquire/ring_merge.hpp"
#include "align/grid.hpp"

#include <memory>
#include <unity.h>
#include <vector>

using namespace okid_host;

void setUp(void) {}
void tearDown(void) {}

namespace {

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
    merge.add(a.self);
    merge.add(b.self);
    merge.add(c.self);
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
    merge.add(a.self);
    merge.add(b.self);
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
    merge.add(a.self);
    merge.add(b.self);
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

} // namespace

int main() {
    UNITY_BEGIN();
    RUN_TEST(in_the_order_of_time);
    RUN_TEST(what_a_ring_lost_stands_before_its_next_frame);
    RUN_TEST(a_backlog_costs_nothing);
    RUN_TEST(an_adapter_may_hold_frames_back_for_five_seconds);
    return UNITY_END();
}
