// SPDX-License-Identifier: MIT
// Frames without a counter as adapters hand them over, for the tests of their places: laws of arrival, and what comes out.
#pragma once
#include "grid_frames.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <functional>
#include <memory>
#include <random>
#include <seeds.h>
#include <set>
#include <string>
#include <unity.h>
#include <utility>
#include <vector>

namespace okid_host {

/// Channel c of identifier 0x100 + c on bus buses[c]; its number is the number of the sample.
inline live_config make_config(double rate_hz, const std::vector<std::size_t>& buses) {
    live_config config = lanes_of(buses.size(), 0, rate_hz, 4);
    for (std::size_t c = 0; c < buses.size(); ++c) {
        config.channels[c].bus = buses[c];
        config.channels[c].layout = bits_at(0, 32);
    }
    return config;
}

inline drv_frame_t make_frame(std::size_t channel, std::size_t bus, std::int64_t value, double time_s) {
    drv_frame_t frame{};
    frame.id = static_cast<std::uint32_t>(0x100 + channel);
    frame.bus = static_cast<std::uint8_t>(bus);
    frame.len = 4;
    frame.time_ns = day_ns + std::llround(time_s * 1e6) * 1000;
    for (int i = 0; i < 4; ++i) frame.data[i] = static_cast<std::uint8_t>(value >> 8 * i);
    return frame;
}

/// Rows as they come out; how many are not what a lossless, aligned stream would give.
struct rows : grid_sink {
    explicit rows(std::size_t n) : width(n), previous(n, NAN) {}
    std::size_t width;
    std::vector<double> previous;
    std::int64_t at = 0, torn = 0, unlike = 0, marked = 0, uncertain = 0;
    std::set<std::int64_t> values; ///< numbers of channel 0 that came out
    void on_sample(std::int64_t, const double* row) override {
        for (std::size_t c = 0; c < width; ++c) {
            torn += row[c] == row[c] && previous[c] == previous[c] && row[c] - previous[c] != 1;
            unlike += row[c] == row[c] && row[0] == row[0] && row[c] != row[0];
            previous[c] = row[c] == row[c] ? row[c] : previous[c] + 1;
        }
        if (row[0] == row[0]) values.insert(static_cast<std::int64_t>(row[0]));
        ++at;
    }
    void on_missing(std::int64_t, std::int64_t count) override {
        at += count;
        for (double& each : previous) each += static_cast<double>(count);
    }
    void on_gap(const grid_gap& gap) override { marked += gap.count; }
};

inline unsigned seeds() { return draw_seeds(150, 1000); }

/// Arrival of the sample of time t; calls come in order.
using law = std::function<double(double)>;

/// One lane, 30 s. @return what came out against what was sent
inline void play(double rate_hz, double ppm, int samples, const law& arrival, const std::set<int>& lost, rows& out) {
    const live_config config = make_config(rate_hz, {0});
    grid on(config, out);
    double heard_s = 0;
    for (int n = 0; n < samples; ++n) {
        heard_s = std::max(heard_s, arrival(n / rate_hz * (1 + 1e-6 * ppm)));
        if (!lost.count(n)) on.push(make_frame(0, 0, n, heard_s));
    }
    on.finish();
    const grid_channel_counts counts = on.channel(0);
    out.uncertain = counts.uncertain;
    TEST_ASSERT_EQUAL_INT64(counts.expected, counts.received + out.marked);
    TEST_ASSERT_EQUAL_UINT64(0, on.bus(0).duplicate + on.bus(0).out_of_order);
}

struct stall {
    double at_s, length_s, faster; ///< faster = 0: made up for at once; else at so many times the rate
};

/// What a law gives behind stalls of the sender.
inline law behind(const std::vector<stall>& stalls, law usual) {
    return [stalls, usual](double t) {
        double out = usual(t);
        for (const stall& s : stalls)
            if (t >= s.at_s) {
                const double free_s = s.at_s + s.length_s + (s.faster > 0 ? (t - s.at_s) / s.faster : 0);
                out = std::max(out, free_s);
            }
        return out;
    };
}

/// Delays of a scheduler: mostly short, now and then some milliseconds.
inline law scheduled(double short_s, double long_s, double often, std::mt19937& random) {
    return [=, &random](double t) {
        std::uniform_real_distribution<double> one(0, 1);
        const double kind = one(random), size = one(random);
        return t + (kind < often ? long_s : short_s) * size;
    };
}

/// A host that polls every `every_s`, each poll late by a uniform delay.
inline law polled(double every_s, double late_s, double phase, std::mt19937& random) {
    return [=, &random, poll = std::make_shared<std::pair<double, double>>(-1e9, 0.0)](double t) {
        const double due = (std::ceil(t / every_s - phase) + phase) * every_s;
        if (due > poll->first) *poll = {due, due + late_s * std::uniform_real_distribution<double>(0, 1)(random)};
        return poll->second;
    };
}

inline double pick(std::mt19937& random, double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(random);
}

} // namespace okid_host
