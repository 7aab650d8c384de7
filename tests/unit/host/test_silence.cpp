// SPDX-License-Identifier: MIT
// A node that dies while others go on is named after a second, once, and by the time it fell silent; where all are silent
// none is. And a table that rests on no new samples has not settled.
#include "live/session.hpp"
#include "live/silence_watch.hpp"

#include <cmath>
#include <cstdio>
#include <fstream>
#include <random>
#include <string>
#include <unity.h>
#include <utility>
#include <vector>

using namespace okid_host;

void setUp(void) {}
void tearDown(void) {}

namespace {

using named = std::vector<std::pair<std::size_t, std::int64_t>>;

void rows(silence_watch& to, named& out, std::int64_t from, std::int64_t until, const std::vector<double>& row) {
    for (std::int64_t n = from; n < until; ++n)
        to.add(n, row.data(), [&](std::size_t channel, std::int64_t first) { out.emplace_back(channel, first); });
}

void test_a_silent_channel_is_named_once_after_a_second() {
    silence_watch watch(2, 100);
    named out;
    rows(watch, out, 0, 50, {1, 1});
    rows(watch, out, 50, 150, {1, NAN});
    TEST_ASSERT_EQUAL_UINT64(0, out.size()); // a second, not more
    rows(watch, out, 150, 1000, {1, NAN});
    TEST_ASSERT_EQUAL_UINT64(1, out.size());
    TEST_ASSERT_EQUAL_UINT64(1, out[0].first);
    TEST_ASSERT_EQUAL_INT64(50, out[0].second);
    rows(watch, out, 1000, 1001, {1, 1});
    rows(watch, out, 1001, 1200, {NAN, 1});
    TEST_ASSERT_EQUAL_UINT64(2, out.size());
    TEST_ASSERT_EQUAL_UINT64(0, out[1].first);
    TEST_ASSERT_EQUAL_INT64(1001, out[1].second);
}

void test_where_all_are_silent_none_is_named() {
    silence_watch watch(2, 100);
    named out;
    rows(watch, out, 0, 50, {1, 1});
    watch.add_missing(50); // 1,000 of them
    rows(watch, out, 1050, 1200, {NAN, NAN});
    rows(watch, out, 1200, 1300, {1, NAN});
    TEST_ASSERT_EQUAL_UINT64(0, out.size());
    rows(watch, out, 1300, 1301, {1, NAN});
    TEST_ASSERT_EQUAL_UINT64(1, out.size());
    TEST_ASSERT_EQUAL_INT64(50, out[0].second);
}

struct listener : session_listener {
    std::vector<nlohmann::json> events;
    void on_sample(std::int64_t, const double*) override {}
    void on_missing(std::int64_t, std::int64_t) override {}
    void on_gap(const grid_gap&) override {}
    void on_event(const std::string& text) override { events.push_back(nlohmann::json::parse(text)); }
};

/// Force and response of a mass on a spring at 100 Hz for 60 s; the response ends after 30 s.
void test_a_session_names_it_and_does_not_settle() {
    const std::string path = "test_silence.toml";
    std::ofstream(path) << "[acquisition]\nrate_hz = 100\n[[bus]]\nname = \"b\"\ntype = \"socketcan\"\n"
                           "interface = \"vcan0\"\n[[channel]]\nname = \"f\"\nrole = \"force\"\ncan_id = 256\n"
                           "start_bit = 16\nlength = 16\nsigned = true\nsequence = { start_bit = 0, length = 16 }\n"
                           "[[channel]]\nname = \"a\"\nrole = \"acceleration\"\ncan_id = 257\nstart_bit = 16\n"
                           "length = 16\nsigned = true\nsequence = { start_bit = 0, length = 16 }\n"
                           "[identification]\nmethod = \"okid-era\"\np = 20\norder = 2\nupdate_s = 5.0\n";
    const live_config config = load_config(path);
    std::remove(path.c_str());
    listener seen;
    session_options options;
    options.table = false;
    options.listener = &seen;
    session live(config, options);
    std::mt19937 random(1);
    std::normal_distribution<double> normal;
    double last[3] = {0, 0, 0};
    std::uint64_t lost = 0;
    for (int n = 0; n < 6000; ++n) {
        const double row[2] = {normal(random), 1.8 * last[1] - 0.97 * last[2] + last[0] + 0.1 * normal(random)};
        last[2] = std::exchange(last[1], row[1]);
        last[0] = row[0];
        for (unsigned i = 0; i < (n < 3000 ? 2 : 1); ++i) {
            drv_frame_t frame{};
            frame.id = 256 + i;
            frame.len = 4;
            frame.time_ns = 1700000000000000000 + n * INT64_C(10000000) + i * 1000;
            const auto code = static_cast<std::uint16_t>(std::lround(100 * row[i]));
            for (int b = 0; b < 2; ++b) {
                frame.data[b] = static_cast<std::uint8_t>(n >> 8 * b);
                frame.data[2 + b] = static_cast<std::uint8_t>(code >> 8 * b);
            }
            live.frame(frame);
        }
        if (n == 4500) lost = live.stats_event()["bus"]["b"]["lost_by"]["stall"].get<std::uint64_t>();
    }
    int reports = 0, settled = 0;
    for (const nlohmann::json& event : seen.events) {
        if (event["type"] == "bus") {
            ++reports;
            TEST_ASSERT_EQUAL_STRING("silent", event["event"].get<std::string>().c_str());
            TEST_ASSERT_EQUAL_STRING("a", event["channel"].get<std::string>().c_str());
            TEST_ASSERT_EQUAL_INT64(3000, event["first"].get<std::int64_t>());
            TEST_ASSERT_EQUAL_DOUBLE(31.01, event["t"].get<double>());
        }
        if (event["type"] != "modes") continue;
        const bool rests = event["settled"].get<bool>();
        settled += rests;
        TEST_ASSERT_FALSE(rests && event["t"] > 30.5);
    }
    TEST_ASSERT_EQUAL_INT(1, reports); // before the run ends
    TEST_ASSERT_GREATER_THAN_INT(0, settled);
    TEST_ASSERT_GREATER_THAN_UINT64(1400, lost); // counted while it lasts
    live.finish();
    TEST_ASSERT_EQUAL_UINT64(2999, live.stats_event()["bus"]["b"]["lost_by"]["stall"].get<std::uint64_t>());
}

} // namespace

int main() {
    UNITY_BEGIN();
    RUN_TEST(test_a_silent_channel_is_named_once_after_a_second);
    RUN_TEST(test_where_all_are_silent_none_is_named);
    RUN_TEST(test_a_session_names_it_and_does_not_settle);
    return UNITY_END();
}
