// SPDX-License-Identifier: MIT
// Nodes on clocks of their own, brought to one grid; decimation: every sample that comes out is that of its time.
#include "align/aligner.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <random>
#include <unity.h>

using namespace okid_host;

void setUp(void) {}
void tearDown(void) {}

namespace {

constexpr std::int64_t epoch_ns = INT64_C(1700000000000000000);
constexpr double pi = 3.14159265358979323846, amplitude = 1e8;

double signal_at(double t_s, double frequency_hz) { return amplitude * std::sin(2 * pi * frequency_hz * t_s); }

/// Message 0x100 on bus 0, message 0x101 on bus 1, a 32-bit counter and a 32-bit number in each.
live_config make_config(double rate_hz, bool free_0, bool free_1) {
    live_config config;
    config.rate_hz = rate_hz;
    config.buses.resize(2);
    config.buses[0].free_clock = free_0;
    config.buses[1].free_clock = free_1;
    for (std::size_t i = 0; i < 2; ++i) {
        channel_config channel;
        channel.name = "c" + std::to_string(i);
        channel.bus = i;
        channel.frame = {static_cast<std::uint32_t>(0x100 + i), 0, 0};
        channel.layout.start_bit = 32;
        channel.layout.length = 32;
        channel.layout.is_signed = 1;
        channel.layout.scale = 1;
        drv_signal_prepare(&channel.layout);
        drv_signal_t counter{};
        counter.length = 32;
        counter.scale = 1;
        drv_signal_prepare(&counter);
        channel.sequence = counter;
        config.channels.push_back(channel);
    }
    return config;
}

/// A node that samples at (k + phase) / (rate (1 - ppm)) by the true time.
struct node {
    std::size_t bus;
    double rate_hz, phase, frequency_hz; ///< 0 Hz: the number is that of the sample
    std::int64_t next = 0;
    double time_s() const { return (static_cast<double>(next) + phase) / rate_hz; }
    drv_frame_t frame(const live_config& config, double late_s, double host_step_s) const {
        drv_frame_t out{};
        const channel_config& channel = config.channels[bus];
        out.id = channel.frame.id;
        out.bus = static_cast<std::uint8_t>(bus);
        out.len = 8;
        out.time_ns = (epoch_ns + std::llround((time_s() + late_s + host_step_s) * 1e9)) / 1000 * 1000;
        const std::int64_t number = frequency_hz > 0 ? std::llround(signal_at(time_s(), frequency_hz)) : next;
        drv_signal_put(&*channel.sequence, out.data, 8, next + 77);
        drv_signal_put(&channel.layout, out.data, 8, number);
        return out;
    }
};

/// What comes out; a row of the reference (channel 0) tells its time.
struct recorder : grid_sink {
    std::vector<std::array<double, 2>> rows;
    std::vector<grid_gap> gaps;
    std::int64_t out_of_turn = 0;
    void on_sample(std::int64_t index, const double* row) override {
        out_of_turn += index != static_cast<std::int64_t>(rows.size());
        rows.push_back({row[0], row[1]});
    }
    void on_missing(std::int64_t index, std::int64_t count) override {
        out_of_turn += index != static_cast<std::int64_t>(rows.size());
        for (std::int64_t i = 0; i < count; ++i) rows.push_back({NAN, NAN});
    }
    void on_gap(const grid_gap& gap) override { gaps.push_back(gap); }
    std::int64_t missing(std::size_t channel) const {
        return std::count_if(rows.begin(), rows.end(), [&](const auto& row) { return row[channel] != row[channel]; });
    }
    std::int64_t marked(std::size_t channel) const {
        std::int64_t sum = 0;
        for (const grid_gap& gap : gaps) sum += gap.channel == channel ? gap.count : 0;
        return sum;
    }
};

struct world {
    live_config config;
    node a, b;
    double jitter_s = 50e-6;
    std::mt19937_64 random{5};
    double host_step_s = 0, step_at_s = 1e9;
    std::int64_t lose_first = -1, lose_last = -1; ///< of node b

    /// Frames of both in the order of their arrival.
    void run(aligner& to, double seconds) {
        std::exponential_distribution<double> late(1 / jitter_s);
        while (std::min(a.time_s(), b.time_s()) < seconds) {
            node& one = a.time_s() <= b.time_s() ? a : b;
            const bool lost = &one == &b && one.next >= lose_first && one.next <= lose_last;
            const double step_s = one.time_s() >= step_at_s ? host_step_s : 0;
            if (!lost) to.push(one.frame(config, late(random), step_s));
            ++one.next;
        }
        to.finish();
    }
};

/// By how much the free channel is off the signal at the reference's time, in seconds of a sine's slope: rms.
double time_error_s(const recorder& out, double rate_hz, double frequency_hz, std::size_t from) {
    double sum = 0;
    std::size_t count = 0;
    for (std::size_t n = from; n < out.rows.size(); ++n) {
        if (out.rows[n][0] + out.rows[n][1] != out.rows[n][0] + out.rows[n][1]) continue;
        const double error = out.rows[n][1] - signal_at(out.rows[n][0] / rate_hz, frequency_hz);
        sum += error * error;
        ++count;
    }
    TEST_ASSERT_TRUE(count > 0);
    return std::sqrt(2 * sum / static_cast<double>(count)) / (amplitude * 2 * pi * frequency_hz);
}

} // namespace

static void test_the_filter_passes_its_band_and_nothing_beside_it(void) {
    for (const double ratio : {0.5, 1.0, 1.37, 4.0, 10.0}) {
        const fir_kernel kernel(ratio);
        std::vector<double> w(2 * kernel.half());
        const double band = std::min(1.0, 1 / ratio); // of the lower rate, in units of the input rate
        double worst = 0, through = 0;
        for (double fraction = 0; fraction < 1; fraction += 0.0371) {
            kernel.weights(fraction, w.data());
            const auto reply = [&](double f, double& re, double& im) {
                re = im = 0;
                for (std::size_t i = 0; i < w.size(); ++i) {
                    const double t = static_cast<double>(i) + 1 - static_cast<double>(kernel.half()) - fraction;
                    re += w[i] * std::cos(2 * pi * f * t);
                    im += w[i] * std::sin(2 * pi * f * t);
                }
            };
            double re = 0, im = 0;
            for (double f = 0; f <= fir_kernel::pass_band * band; f += 0.01 * band) {
                reply(f, re, im);
                worst = std::max(worst, std::hypot(re - 1, im));
            }
            for (double f = 0.55 * band; ratio > 1 && f <= 0.5; f += 0.01 * band) {
                reply(f, re, im);
                through = std::max(through, std::hypot(re, im));
            }
        }
        std::printf("ratio %.2f: error in the pass band %.1e, beyond it %.1e\n", ratio, worst, through);
        TEST_ASSERT_TRUE(worst < 3e-5);
        TEST_ASSERT_TRUE(through < 3e-5);
    }
}

static void test_a_node_on_its_own_clock(void) {
    for (const double ppm : {-9000.0, -137.0, 0.0, 60.0, 5000.0}) {
        const double rate = 1000, f = 120;
        world w{make_config(rate, false, true), {0, rate, 0, 0}, {1, rate * (1 + 1e-6 * ppm), 0.37, f}};
        recorder out;
        aligner to(w.config, out);
        w.run(to, 40);
        const double early = time_error_s(out, rate, f, 0), late = time_error_s(out, rate, f, 20000);
        const auto skews = to.skews();
        std::printf(
            "%+.0f ppm: out %zu of 40000, off by %.2f us rms, %.2f us in the second half; told: %.2f +- %.2f us, "
            "%+.1f ppm\n",
            ppm, out.rows.size(), 1e6 * early, 1e6 * late, skews[0].us, skews[0].std_us, skews[0].rate_ppm);
        TEST_ASSERT_EQUAL_INT64(0, out.out_of_turn);
        TEST_ASSERT_TRUE(out.rows.size() > 35000);
        TEST_ASSERT_EQUAL_INT64(0, out.missing(0) + out.missing(1));
        TEST_ASSERT_TRUE(early < 20e-6); // jitter of both: 50 us mean, one-sided
        TEST_ASSERT_TRUE(late < 4e-6);
        TEST_ASSERT_EQUAL_UINT64(1, skews.size());
        TEST_ASSERT_EQUAL_UINT64(1, skews[0].channel);
        TEST_ASSERT_TRUE(std::abs(skews[0].rate_ppm + ppm / (1 + 1e-6 * ppm)) < 1);
    }
}

static void test_lost_samples_are_marked_and_none_is_made_up(void) {
    const double rate = 1000, f = 90;
    world w{make_config(rate, false, true), {0, rate, 0, 0}, {1, rate * (1 + 50e-6), 0.6, f}};
    w.lose_first = 9000, w.lose_last = 9004;
    recorder out;
    aligner to(w.config, out);
    w.run(to, 15);
    TEST_ASSERT_EQUAL_INT64(0, out.missing(0));
    TEST_ASSERT_TRUE(out.missing(1) >= 68 && out.missing(1) <= 69); // 64 taps over 5 samples
    TEST_ASSERT_EQUAL_INT64(out.missing(1), out.marked(1));
    TEST_ASSERT_EQUAL_UINT64(1, out.gaps.size());
    TEST_ASSERT_TRUE(gap_cause::sequence == out.gaps[0].cause);
    TEST_ASSERT_EQUAL_INT64(to.channel(1).expected - to.channel(1).received, out.missing(1));
    TEST_ASSERT_EQUAL_UINT64(5, to.bus(1).lost[static_cast<std::size_t>(gap_cause::sequence)]);
    TEST_ASSERT_TRUE(time_error_s(out, rate, f, 2000) < 10e-6);
}

static void test_the_host_clock_is_set(void) {
    for (const double step_s : {3600.0, -3600.0, 0.5}) {
        const double rate = 1000, f = 90;
        world w{make_config(rate, false, true), {0, rate, 0, 0}, {1, rate * (1 - 40e-6), 0.2, f}};
        w.host_step_s = step_s;
        w.step_at_s = 20;
        recorder out;
        aligner to(w.config, out);
        w.run(to, 45);
        std::printf("set by %+.1f s: %zu rows, missing %lld, off by %.2f us rms\n", step_s, out.rows.size(),
                    static_cast<long long>(out.missing(1)), 1e6 * time_error_s(out, rate, f, 0));
        TEST_ASSERT_EQUAL_INT64(0, out.out_of_turn);
        TEST_ASSERT_TRUE(out.rows.size() > 42000);
        TEST_ASSERT_TRUE(out.missing(1) < 3000);
        TEST_ASSERT_EQUAL_INT64(out.missing(1), out.marked(1));
        TEST_ASSERT_TRUE(time_error_s(out, rate, f, 0) < 20e-6);
    }
}

static void test_a_node_that_falls_silent_and_comes_back(void) {
    const double rate = 500, f = 60;
    world w{make_config(rate, false, true), {0, rate, 0, 0}, {1, rate * (1 + 80e-6), 0.6, f}};
    w.lose_first = 5000, w.lose_last = 9999;
    recorder out;
    aligner to(w.config, out);
    w.run(to, 40);
    std::printf("silent for 5000 samples: missing %lld, off by %.2f us rms\n", static_cast<long long>(out.missing(1)),
                1e6 * time_error_s(out, rate, f, 1000));
    TEST_ASSERT_EQUAL_INT64(0, out.missing(0));
    TEST_ASSERT_TRUE(out.missing(1) >= 5062 && out.missing(1) < 5070);
    TEST_ASSERT_EQUAL_INT64(out.missing(1), out.marked(1));
    TEST_ASSERT_TRUE(time_error_s(out, rate, f, 1000) < 10e-6);
}

static void test_all_nodes_on_their_own_clocks_at_two_rates(void) {
    const double rate = 1000, f = 130;
    live_config config = make_config(rate, true, true);
    config.buses[1].rate_hz = 2500;
    world w{config, {0, rate, 0, 0}, {1, 2500 * (1 + 110e-6), 0.9, f}};
    recorder out;
    aligner to(w.config, out);
    w.run(to, 20);
    TEST_ASSERT_EQUAL_INT64(0, out.missing(0) + out.missing(1));
    TEST_ASSERT_TRUE(out.rows.size() > 17000);
    TEST_ASSERT_TRUE(time_error_s(out, rate, f, 5000) < 6e-6);
}

static void test_decimation(void) {
    const double rate = 250;
    for (const double f : {0.44 * rate, 0.58 * rate, 1.3 * rate}) {
        live_config config = make_config(rate, false, false);
        config.decimate = 4;
        world w{config, {0, 4 * rate, 0, 0}, {1, 4 * rate, 0, f}};
        w.jitter_s = 1e-6;
        recorder out;
        aligner to(w.config, out);
        w.run(to, 10);
        double worst = 0;
        for (const auto& row : out.rows) {
            const double expected = f < 0.5 * rate ? signal_at(row[0] / (4 * rate), f) : 0;
            worst = std::max(worst, std::abs(row[1] - expected) / amplitude);
        }
        std::printf("decimation by 4, %.0f Hz: %zu samples, worst %.1e\n", f, out.rows.size(), worst);
        TEST_ASSERT_EQUAL_INT64(0, out.out_of_turn);
        TEST_ASSERT_TRUE(out.rows.size() >= 2500 - 70 && out.rows.size() <= 2500);
        TEST_ASSERT_TRUE(worst < 3e-5);
        TEST_ASSERT_EQUAL_INT64(static_cast<std::int64_t>(out.rows.size()), to.emitted());
        TEST_ASSERT_TRUE(std::abs(static_cast<double>(to.time_ns(to.emitted() - 1) - epoch_ns) * 1e-9 -
                                  out.rows.back()[0] / (4 * rate)) < 1e-4);
    }
    live_config config = make_config(rate, false, false);
    config.decimate = 4;
    world w{config, {0, 4 * rate, 0, 0}, {1, 4 * rate, 0, 30}};
    w.lose_first = w.lose_last = 4000;
    recorder out;
    aligner to(w.config, out);
    to.set_limit(2000);
    w.run(to, 10);
    TEST_ASSERT_EQUAL_INT64(2000, to.emitted());
    TEST_ASSERT_EQUAL_INT64(64, out.missing(1)); // 256 taps, every fourth
    TEST_ASSERT_EQUAL_INT64(64, out.marked(1));
    TEST_ASSERT_EQUAL_INT64(2000 - 64, to.channel(1).received);
}

/// What befell the frames of a node on its own clock is counted on its bus, beside what befell the reference.
static void test_frames_of_a_node_are_counted_on_its_bus(void) {
    world w{make_config(1000, false, true), {0, 1000, 0, 0}, {1, 1000, 0.4, 50}};
    recorder out;
    aligner to(w.config, out);
    std::uint64_t received = 0;
    const auto send = [&](const drv_frame_t& frame, std::size_t bus) {
        received += bus;
        to.push(frame);
    };
    drv_frame_t held{};
    for (int n = 0; n < 3000; ++n, ++w.a.next, ++w.b.next) {
        send(w.a.frame(w.config, 0, 0), 0);
        if (n == 500) send(w.a.frame(w.config, 0, 0), 0); // the reference, twice
        const drv_frame_t frame = w.b.frame(w.config, 0, 0);
        if (n % 100 == 50) {
            held = frame;
            continue;
        }
        send(frame, 1);
        if (n % 100 == 51) send(held, 1); // late by one
        if (n % 200 == 20) send(frame, 1);
        drv_frame_t cut = frame;
        cut.len = 6;
        if (n % 1000 == 33) send(cut, 1);
    }
    to.finish();
    TEST_ASSERT_EQUAL_UINT64(3001, to.bus(0).received);
    TEST_ASSERT_EQUAL_UINT64(1, to.bus(0).duplicate);
    TEST_ASSERT_EQUAL_UINT64(0, to.bus(0).out_of_order + to.bus(0).decode_errors);
    TEST_ASSERT_EQUAL_UINT64(received, to.bus(1).received);
    TEST_ASSERT_EQUAL_UINT64(15, to.bus(1).duplicate);
    TEST_ASSERT_EQUAL_UINT64(30, to.bus(1).out_of_order);
    TEST_ASSERT_EQUAL_UINT64(0, to.bus(1).too_late);
    TEST_ASSERT_EQUAL_UINT64(3, to.bus(1).decode_errors);
}

/// Channels are named by their place in the configuration, whichever of them is the reference.
static void test_silent_channels_of_a_node_and_of_the_reference(void) {
    for (const bool first_is_free : {false, true})
        for (int heard = 0; heard < 4; ++heard) {
            world w{make_config(1000, first_is_free, !first_is_free), {0, 1000, 0, 0}, {1, 1000, 0.4, 0}};
            recorder out;
            aligner to(w.config, out);
            for (int n = 0; n < 50; ++n, ++w.a.next, ++w.b.next) {
                if (heard & 1) to.push(w.a.frame(w.config, 0, 0));
                if (heard & 2) to.push(w.b.frame(w.config, 0, 0));
            }
            to.finish();
            std::vector<std::size_t> silent;
            for (std::size_t c = 0; c < 2; ++c)
                if (!(heard >> c & 1)) silent.push_back(c);
            TEST_ASSERT_TRUE(silent == to.silent_channels());
            TEST_ASSERT_EQUAL_UINT64(0, to.skews().size()); // nothing has begun
        }
}

int main(void) {
    UNITY_BEGIN();
    RUN_TEST(test_the_filter_passes_its_band_and_nothing_beside_it);
    RUN_TEST(test_a_node_on_its_own_clock);
    RUN_TEST(test_lost_samples_are_marked_and_none_is_made_up);
    RUN_TEST(test_the_host_clock_is_set);
    RUN_TEST(test_a_node_that_falls_silent_and_comes_back);
    RUN_TEST(test_all_nodes_on_their_own_clocks_at_two_rates);
    RUN_TEST(test_decimation);
    RUN_TEST(test_frames_of_a_node_are_counted_on_its_bus);
    RUN_TEST(test_silent_channels_of_a_node_and_of_the_reference);
    return UNITY_END();
}
