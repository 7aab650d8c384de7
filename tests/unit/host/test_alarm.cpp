// SPDX-License-Identifier: MIT
// The alarm on estimates made up: means of white noise over windows that overlap, with standard deviations as uncertain as
// those of a jackknife. No alarm in a very long time of nothing; one for a shift, over when it is gone.
#include "live/alarm.hpp"
#include "live/settling.hpp"
#include "publish/terminal_table.hpp"

#include <cmath>
#include <deque>
#include <random>
#include <unity.h>

using namespace okid_host;

namespace {

constexpr double hz = 10, sample_sigma = 0.04;

/// One mode, its frequency the mean of noisy samples of the last `window` (0 = all).
class source {
  public:
    source(std::int64_t window, unsigned seed) : window_(window), random_(seed) {}
    observed_mode next(std::int64_t samples, double shift) {
        for (std::int64_t n = 0; n < samples; ++n) {
            const double value = hz + shift + sample_sigma * normal_(random_);
            sum_ += value;
            kept_.push_back(value);
            if (window_ > 0 && static_cast<std::int64_t>(kept_.size()) > window_) {
                sum_ -= kept_.front();
                kept_.pop_front();
            }
        }
        end += samples;
        const auto count = static_cast<double>(kept_.size());
        first = end - static_cast<std::int64_t>(count);
        std::chi_squared_distribution<double> chi(19);
        return {1, sum_ / count, sample_sigma / std::sqrt(count) * std::sqrt(chi(random_) / 19), true};
    }
    std::int64_t first = 0, end = 0;

  private:
    std::int64_t window_;
    std::mt19937 random_;
    std::normal_distribution<double> normal_;
    std::deque<double> kept_;
    double sum_ = 0;
};

int count_turns(std::int64_t window, std::int64_t every, int updates, unsigned seed) {
    source from(window, seed);
    alarm_watch alarm{alarm_config{}};
    (void)from.next(window > 0 ? window : 500, 0);
    int turns = 0;
    for (int k = 0; k < updates; ++k) {
        const observed_mode mode = from.next(every, 0);
        turns += alarm.update({mode}, from.first, from.end);
    }
    return turns;
}

} // namespace

void setUp() {}
void tearDown() {}

static void test_nothing_happens_for_long() {
    for (const std::int64_t window : {200, 2000}) // overlapping by nothing, and by 97 %
        for (const std::int64_t every : {64, 500})
            for (unsigned seed = 1; seed <= 4; ++seed) TEST_ASSERT_EQUAL_INT(0, count_turns(window, every, 4000, seed));
    for (unsigned seed = 1; seed <= 4; ++seed) TEST_ASSERT_EQUAL_INT(0, count_turns(0, 64, 4000, seed));
}

static void test_a_shift_is_told_once_and_its_end_too() {
    source from(2000, 7);
    alarm_watch alarm{alarm_config{}};
    (void)from.next(2000, 0);
    for (int k = 0; k < 60; ++k) {
        const observed_mode mode = from.next(64, 0);
        TEST_ASSERT_FALSE(alarm.update({mode}, from.first, from.end));
    }
    const double shift = 20 * sample_sigma / std::sqrt(2000);
    int begun = 0, ended = 0;
    for (int k = 0; k < 400; ++k) {
        const observed_mode mode = from.next(64, k < 200 ? shift : 0);
        if (!alarm.update({mode}, from.first, from.end)) continue;
        (alarm.standing() ? begun : ended)++;
        if (!alarm.standing()) continue;
        TEST_ASSERT_LESS_THAN(32, k); // within the window
        TEST_ASSERT_EQUAL_INT(1, alarm.away().front().track);
        TEST_ASSERT_DOUBLE_WITHIN(3 * sample_sigma / std::sqrt(2000), hz, alarm.away().front().baseline_hz);
        TEST_ASSERT_TRUE(alarm.is_away(1) && !alarm.is_away(2));
    }
    TEST_ASSERT_EQUAL_INT(1, begun);
    TEST_ASSERT_EQUAL_INT(1, ended);
}

static void test_what_makes_no_baseline() {
    source from(2000, 8);
    alarm_watch alarm{alarm_config{}};
    for (int k = 0; k < 100; ++k) { // never at rest, no track, no sigma: then even a jump says nothing
        observed_mode mode = from.next(64, k < 50 ? 0 : 1);
        if (k % 3 == 0) mode.at_rest = false;
        if (k % 3 == 1) mode.track = 0;
        if (k % 3 == 2) mode.sigma_hz = NAN;
        TEST_ASSERT_FALSE(alarm.update({mode}, from.first, from.end));
    }
}

static void test_a_single_wild_update_is_no_alarm() {
    source from(2000, 9);
    alarm_watch alarm{alarm_config{}};
    for (int k = 0; k < 200; ++k) {
        observed_mode mode = from.next(64, 0);
        if (k > 50 && k % 10 == 0) mode.frequency_hz += 1;
        TEST_ASSERT_FALSE(alarm.update({mode}, from.first, from.end));
    }
}

static void test_table_fits_the_terminal() {
    table_state state;
    state.t = 12.5;
    state.settled = true;
    for (int k = 1; k <= 12; ++k) {
        mode_row& row = state.modes.emplace_back();
        row.track = k;
        row.frequency_hz = 10.0 * k;
        row.frequency_std_hz = 0.001;
    }
    const auto whole = terminal_table::render(state, false, 200, 40);
    TEST_ASSERT_EQUAL_UINT(14, whole.size());
    TEST_ASSERT_TRUE(whole[1].find("± σ") != std::string::npos && whole[2].find("±") != std::string::npos);
    const auto low = terminal_table::render(state, false, 200, 6);
    TEST_ASSERT_EQUAL_UINT(6, low.size());
    TEST_ASSERT_EQUAL_STRING("… 9 more", low.back().c_str());
    for (const std::string& line : terminal_table::render(state, false, 10, 40)) {
        std::size_t characters = 0;
        for (const char c : line) characters += (static_cast<unsigned char>(c) & 0xC0) != 0x80;
        TEST_ASSERT_LESS_OR_EQUAL_UINT(10, characters);
    }
    TEST_ASSERT_TRUE(terminal_table::render(state, true, 80, 40)[0].rfind("\x1b[32m", 0) == 0);
    state.alarm = state.modes[3].alarm = true;
    TEST_ASSERT_TRUE(terminal_table::render(state, true, 80, 40)[0].rfind("\x1b[31m", 0) == 0);
    TEST_ASSERT_TRUE(terminal_table::render(state, true, 80, 40)[5].rfind("\x1b[31m", 0) == 0);
    TEST_ASSERT_EQUAL_UINT(1, terminal_table::render(state, false, 80, 1).size());
}

static void test_at_rest() {
    double f[2] = {10, 20}, zeta[2] = {0.01, 0.02};
    okid_identified_t model{};
    model.mode_count = 2;
    model.frequency_hz = f;
    model.damping_ratio = zeta;
    settling rest;
    TEST_ASSERT_FALSE(rest.add(model, {1, 2}, {}));
    TEST_ASSERT_FALSE(rest.add(model, {1, 2}, {}));
    TEST_ASSERT_TRUE(rest.add(model, {1, 2}, {}));
    f[1] = 20.05; // a quarter of a percent
    TEST_ASSERT_FALSE(rest.add(model, {1, 2}, {}));
    TEST_ASSERT_TRUE(rest.at_rest(0) && !rest.at_rest(1));
    TEST_ASSERT_FALSE(rest.add(model, {1, 2}, {0.001, 0.02})); // not more than its own scatter
    TEST_ASSERT_TRUE(rest.at_rest(0) && rest.at_rest(1));
    f[1] = 25;
    TEST_ASSERT_TRUE(rest.add(model, {1, 0}, {})); // a mode without a track does not count
    rest.reset();
    TEST_ASSERT_FALSE(rest.add(model, {1, 2}, {}));
    for (int k = 0; k < 5; ++k) TEST_ASSERT_FALSE(rest.add(model, {0, 0}, {})); // nothing is nothing to rest
}

int main() {
    UNITY_BEGIN();
    RUN_TEST(test_nothing_happens_for_long);
    RUN_TEST(test_a_shift_is_told_once_and_its_end_too);
    RUN_TEST(test_what_makes_no_baseline);
    RUN_TEST(test_a_single_wild_update_is_no_alarm);
    RUN_TEST(test_table_fits_the_terminal);
    RUN_TEST(test_at_rest);
    return UNITY_END();
}
