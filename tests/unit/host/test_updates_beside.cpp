// SPDX-License-Identifier: MIT
// What is given up when a machine is too slow, and in which order: by a clock made up; and rows that come faster than they
// can be summed.
#include "live/relief.hpp"
#include "live/session.hpp"
#include "live/update_thread.hpp"

#include <array>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <random>
#include <string>
#include <unity.h>

using namespace okid_host;

void setUp(void) {}
void tearDown(void) {}

namespace {

std::string standing(const relief& one) {
    std::string out;
    for (const auto& [step, letter] : {std::pair{overload_step::pictures, 'p'}, std::pair{overload_step::updates, 'u'},
                                       std::pair{overload_step::publishing, 'P'}})
        if (one.stands(step)) out += letter;
    return out;
}

/// Looked at every 10 ms. @return what stood, each time it changed
std::string watched(const std::string& loads, double each_s) {
    relief one;
    std::string out, last;
    double now = 1000;
    for (const char load : loads)
        for (int k = 0; k < each_s * 100; ++k, now += 0.01) {
            one.look(now, load == '.');
            if (standing(one) != last) out += (last = standing(one)) + ".";
        }
    return out;
}

void test_one_step_after_the_other_and_back() {
    TEST_ASSERT_EQUAL_STRING("p.pu.puP.", watched("!", 3).c_str());
    TEST_ASSERT_EQUAL_STRING("p.pu.puP.pu.p..", watched("!.", 5).c_str());
    TEST_ASSERT_EQUAL_STRING("p.", watched("!", 0.4).c_str());
    TEST_ASSERT_EQUAL_STRING("p..", watched("!....", 0.4).c_str());
}

void test_a_stop_of_the_program_and_short_bursts_are_none() {
    relief one;
    TEST_ASSERT_EQUAL_INT(0, one.look(1000, true));
    TEST_ASSERT_EQUAL_INT(0, one.look(1005, false)); // stopped for 5 s: what came meanwhile waits
    TEST_ASSERT_EQUAL_INT(0, one.look(1005.05, true));
    TEST_ASSERT_EQUAL_STRING("", watched("!.!.!.!.!.!.!.!.", 0.2).c_str());
}

live_config node(const std::string& bus = "type = \"serial\"\nframing = \"ascii\"\ndevice = \"/dev/null\"\n",
                 const std::array<std::string, 2>& where = {"field = 0\n", "field = 1\n"}) {
    const std::string path = "test_updates_beside.toml";
    std::ofstream(path) << "[acquisition]\nrate_hz = 100\n[[bus]]\nname = \"b\"\n"
                        << bus << "[[channel]]\nname = \"f\"\nrole = \"force\"\n"
                        << where[0] << "[[channel]]\nname = \"a\"\nrole = \"acceleration\"\n"
                        << where[1] << "[identification]\np = 20\nupdate_s = 1.0\n";
    live_config out = load_config(path);
    std::remove(path.c_str());
    return out;
}

/// A mass on a spring under white noise.
template <class To> void made_up(int samples, const To& to) {
    std::mt19937 random(1);
    std::normal_distribution<double> normal;
    double last[3] = {0, 0, 0};
    for (int n = 1; n <= samples; ++n) {
        const double row[2] = {normal(random), 1.8 * last[1] - 0.97 * last[2] + last[0] + 0.1 * normal(random)};
        last[2] = std::exchange(last[1], row[1]);
        last[0] = row[0];
        to(row);
    }
}

/// Two obliged updates would take longer than all of it is handed over in.
void feed(update_thread& to, int samples) {
    int n = 0;
    made_up(samples, [&](const double* row) {
        to.add(row);
        if (++n % 100 == 0) to.update(n);
    });
}

void test_beyond_the_bound_updates_go_and_every_row_stays() {
    const live_config config = node();
    constexpr int samples = 20000;
    update_maker at_once(config), beside(config);
    update_thread patient(at_once, false, 2);
    feed(patient, samples);
    for (const update_report& each : patient.finish()) TEST_ASSERT_NOT_EQUAL(update_report::skipped, each.fate);
    update_thread pressed(beside, true, 2, 2000);
    feed(pressed, samples);
    int given_up = 0, of_all = 0;
    for (const update_report& each : pressed.finish()) {
        ++of_all;
        given_up += each.fate == update_report::given_up;
    }
    TEST_ASSERT_EQUAL_INT(samples / 100, of_all);
    TEST_ASSERT_GREATER_THAN_INT(0, given_up);
    TEST_ASSERT_EQUAL_INT64(at_once.sums().sums().rows(), beside.sums().sums().rows());
    TEST_ASSERT_EQUAL_INT(OKID_OK, at_once.sums().sums().run());
    TEST_ASSERT_EQUAL_INT(OKID_OK, beside.sums().sums().run());
    const okid_identified_t &a = at_once.sums().model(), &b = beside.sums().model();
    TEST_ASSERT_EQUAL_INT(a.mode_count, b.mode_count);
    for (int k = 0; k < a.mode_count; ++k) TEST_ASSERT_EQUAL_DOUBLE(a.frequency_hz[k], b.frequency_hz[k]);
}

/// What a session tells in the end.
struct last_words : session_listener {
    nlohmann::json result, stats;
    void on_sample(std::int64_t, const double*) override {}
    void on_missing(std::int64_t, std::int64_t) override {}
    void on_gap(const grid_gap&) override {}
    void on_event(const std::string& text) override {
        const auto event = nlohmann::json::parse(text);
        if (event["type"] == "result") result = event["result"];
        if (event["type"] == "stats") stats = event;
    }
};

/// Frames come faster than their updates can be made; those that are obliged are given up beyond the bound, and it is said.
void test_updates_that_were_given_up_are_told() {
    for (const std::size_t most_waiting : {std::size_t{2000}, update_thread::most_waiting}) {
        const live_config config = node("type = \"socketcan\"\ninterface = \"vcan0\"\n",
                                        {"can_id = 256\nstart_bit = 0\nlength = 16\nsigned = true\n",
                                         "can_id = 256\nstart_bit = 16\nlength = 16\nsigned = true\n"});
        last_words seen;
        session_options options;
        options.live = true;
        options.table = false;
        options.listener = &seen;
        options.most_waiting = most_waiting;
        session live(config, options);
        std::int64_t n = 0;
        made_up(20000, [&](const double* row) {
            drv_frame_t frame{};
            frame.id = 256;
            frame.len = 4;
            frame.time_ns = 1700000000000000000 + ++n * 10000000;
            for (int i = 0; i < 2; ++i) {
                const auto code = static_cast<std::uint16_t>(std::lround(100 * row[i]));
                frame.data[2 * i] = static_cast<std::uint8_t>(code);
                frame.data[2 * i + 1] = static_cast<std::uint8_t>(code >> 8);
            }
            live.frame(frame);
        });
        live.finish();
        std::string said;
        for (const auto& warning : seen.result["warnings"])
            if (warning["code"] == "updates_given_up") said = warning["text"];
        TEST_ASSERT_EQUAL_INT(most_waiting > 2000, said.empty());
        TEST_ASSERT_EQUAL_INT64(20000, seen.stats["channel"]["a"]["received"].get<std::int64_t>());
        TEST_ASSERT_EQUAL_INT64(0, seen.stats["channel"]["a"]["missing"].get<std::int64_t>());
    }
}

} // namespace

int main() {
    UNITY_BEGIN();
    RUN_TEST(test_one_step_after_the_other_and_back);
    RUN_TEST(test_a_stop_of_the_program_and_short_bursts_are_none);
    RUN_TEST(test_beyond_the_bound_updates_go_and_every_row_stays);
    RUN_TEST(test_updates_that_were_given_up_are_told);
    return UNITY_END();
}
