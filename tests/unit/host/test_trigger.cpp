// SPDX-License-Identifier: MIT
// When identification begins: which sample is the trigger's, and which samples before it are still there.
#include "align/trigger.hpp"

#include <cmath>
#include <string>
#include <unity.h>
#include <vector>

using namespace okid_host;

void setUp(void) {}
void tearDown(void) {}

namespace {

constexpr double rate_hz = 100;

/// Two channels; the second one triggers: 0.5 of its raw number less 3.
live_config make_config(trigger_source source, drv_gpio_edge_t edge, double pretrigger_s = 0) {
    live_config config;
    config.rate_hz = rate_hz;
    config.channels.resize(2);
    config.channels[0].layout.scale = 1;
    config.channels[1].name = "force";
    config.channels[1].unit = "N";
    config.channels[1].layout.scale = 0.5;
    config.channels[1].layout.offset = -3;
    config.trigger.source = source;
    config.trigger.edge = edge;
    config.trigger.pretrigger_s = pretrigger_s;
    config.trigger.channel = 1;
    config.trigger.level = 2;
    config.trigger.place.chip = "gpiochip0";
    config.trigger.place.offset = 17;
    return config;
}

/// The sample with which these numbers (in N, NaN = missing) cross 2 N, -1 = none of them.
std::int64_t crossing(drv_gpio_edge_t edge, const std::vector<double>& newtons) {
    trigger one(make_config(trigger_source::level, edge));
    TEST_ASSERT_TRUE(one.waiting());
    for (std::size_t i = 0; i < newtons.size(); ++i) {
        const double row[] = {100, (newtons[i] + 3) / 0.5};
        const auto at = static_cast<std::int64_t>(i);
        if (!one.add(at, row, 1, 1000 * at)) continue;
        TEST_ASSERT_FALSE(one.waiting());
        TEST_ASSERT_EQUAL_INT64(at, one.sample());
        TEST_ASSERT_EQUAL_INT64(1000 * at, one.time_ns());
        return at;
    }
    TEST_ASSERT_TRUE(one.waiting());
    return -1;
}

struct kept {
    std::int64_t index, count;
    double number; ///< -1: missing
};

std::vector<kept> kept_of(const trigger& one) {
    std::vector<kept> out;
    one.each_kept([&](std::int64_t index, const double* row, std::int64_t count) {
        out.push_back({index, count, row ? row[1] : -1});
    });
    return out;
}

} // namespace

static void test_a_level_is_crossed_in_the_wanted_direction(void) {
    TEST_ASSERT_EQUAL_INT64(2, crossing(DRV_GPIO_RISING, {0, 1.5, 2.5}));
    TEST_ASSERT_EQUAL_INT64(-1, crossing(DRV_GPIO_FALLING, {0, 1.5, 2.5}));
    TEST_ASSERT_EQUAL_INT64(2, crossing(DRV_GPIO_BOTH, {0, 1.5, 2.5}));
    TEST_ASSERT_EQUAL_INT64(-1, crossing(DRV_GPIO_RISING, {3, 2.5, 1}));
    TEST_ASSERT_EQUAL_INT64(2, crossing(DRV_GPIO_FALLING, {3, 2.5, 1}));
    TEST_ASSERT_EQUAL_INT64(2, crossing(DRV_GPIO_BOTH, {3, 2.5, 1}));
    TEST_ASSERT_EQUAL_INT64(4, crossing(DRV_GPIO_RISING, {3, 2.5, 1, 1, 5}));
}

/// To the level is enough; to stand at it at first is not, nor is to leave it.
static void test_a_number_at_the_level(void) {
    TEST_ASSERT_EQUAL_INT64(1, crossing(DRV_GPIO_RISING, {1, 2, 3}));
    TEST_ASSERT_EQUAL_INT64(1, crossing(DRV_GPIO_FALLING, {3, 2, 1}));
    TEST_ASSERT_EQUAL_INT64(-1, crossing(DRV_GPIO_BOTH, {2, 3, 4}));
    TEST_ASSERT_EQUAL_INT64(-1, crossing(DRV_GPIO_BOTH, {2, 1, 0}));
    TEST_ASSERT_EQUAL_INT64(-1, crossing(DRV_GPIO_BOTH, {3, 4, 5}));
}

static void test_a_missing_sample_does_not_hide_a_crossing(void) {
    TEST_ASSERT_EQUAL_INT64(2, crossing(DRV_GPIO_RISING, {1, NAN, 3}));
    TEST_ASSERT_EQUAL_INT64(3, crossing(DRV_GPIO_FALLING, {NAN, 3, NAN, 1}));
    TEST_ASSERT_EQUAL_INT64(-1, crossing(DRV_GPIO_BOTH, {NAN, 3, NAN, 4}));
}

static void test_an_edge_belongs_to_the_first_sample_that_is_not_before_it(void) {
    for (const std::int64_t late_ns : {0, 1, 999}) { // frames have microseconds: an edge in their midst is no later
        trigger one(make_config(trigger_source::gpio, DRV_GPIO_RISING));
        const double row[] = {1, 1};
        TEST_ASSERT_FALSE(one.add(0, row, 1, 1000));
        one.edge(3000 + late_ns);
        one.edge(5000); // the first one counts
        TEST_ASSERT_FALSE(one.add(1, row, 1, 2999));
        TEST_ASSERT_FALSE(one.add(2, nullptr, 1, 9000));
        TEST_ASSERT_TRUE(one.add(3, row, 1, 3000));
        TEST_ASSERT_EQUAL_INT64(3, one.sample());
        TEST_ASSERT_EQUAL_INT64(3000, one.time_ns());
        TEST_ASSERT_FALSE(one.waiting());
    }
}

static void test_an_edge_that_is_reported_late_is_looked_up(void) {
    trigger one(make_config(trigger_source::gpio, DRV_GPIO_RISING));
    const double row[] = {1, 1};
    for (std::int64_t n = 0; n < 6; ++n) {
        TEST_ASSERT_FALSE(one.add(n, n == 3 ? nullptr : row, 1, n == 3 ? 8000 : 1000 * n));
        TEST_ASSERT_FALSE(one.look_back()); // no edge yet
    }
    one.edge(3000);
    TEST_ASSERT_TRUE(one.look_back());
    TEST_ASSERT_EQUAL_INT64(4, one.sample()); // 3 is missing
    TEST_ASSERT_EQUAL_INT64(3000, one.time_ns());
    TEST_ASSERT_FALSE(one.look_back()); // it has come
    trigger ahead(make_config(trigger_source::gpio, DRV_GPIO_RISING));
    TEST_ASSERT_FALSE(ahead.add(0, row, 1, 1000));
    ahead.edge(2000);
    TEST_ASSERT_FALSE(ahead.look_back()); // it lies ahead
    TEST_ASSERT_TRUE(ahead.add(1, row, 1, 2000));
}

/// An edge before the first sample is that sample's. One of longer ago than a second is that of the oldest one kept.
static void test_an_edge_before_the_oldest_sample(void) {
    trigger young(make_config(trigger_source::gpio, DRV_GPIO_RISING));
    trigger old(make_config(trigger_source::gpio, DRV_GPIO_RISING));
    const double row[] = {1, 1};
    for (std::int64_t n = 0; n <= 400; ++n) {
        if (n < 50) {
            TEST_ASSERT_FALSE(young.add(n, row, 1, 10000000 * (n + 1)));
        }
        TEST_ASSERT_FALSE(old.add(n, row, 1, 10000000 * (n + 1)));
    }
    for (trigger* one : {&young, &old}) {
        one->edge(5000000);
        TEST_ASSERT_TRUE(one->look_back());
        TEST_ASSERT_EQUAL_INT64(one == &old ? 300 : 0, one->sample()); // a second ago
        TEST_ASSERT_EQUAL_INT64(5000000, one->time_ns());
    }
}

/// 0.2 s at 100 Hz: twenty samples before that of the trigger, and that one.
static void test_the_samples_before_a_level(void) {
    trigger one(make_config(trigger_source::level, DRV_GPIO_RISING, 0.2));
    for (std::int64_t n = 0; n < 90; ++n) {
        const double row[] = {0, n < 89 ? static_cast<double>(n) / 100 : 1000};
        TEST_ASSERT_EQUAL_INT(n == 89, one.add(n, row, 1, n));
    }
    const std::vector<kept> all = kept_of(one);
    TEST_ASSERT_EQUAL_UINT64(21, all.size());
    for (std::size_t k = 0; k < all.size(); ++k) {
        TEST_ASSERT_EQUAL_INT64(69 + static_cast<std::int64_t>(k), all[k].index);
        TEST_ASSERT_EQUAL_INT64(1, all[k].count);
        TEST_ASSERT_EQUAL_DOUBLE(k < 20 ? static_cast<double>(69 + k) / 100 : 1000, all[k].number);
    }
}

/// An edge of which nothing is known until a second later: the samples before it are still there, and those since.
static void test_the_samples_before_an_edge_of_a_second_ago(void) {
    trigger one(make_config(trigger_source::gpio, DRV_GPIO_RISING, 0.2));
    for (std::int64_t n = 0; n <= 400; ++n) {
        const double row[] = {0, static_cast<double>(n)};
        TEST_ASSERT_FALSE(one.add(n, row, 1, 10000000 * n));
    }
    one.edge(INT64_C(10000000) * 300);
    TEST_ASSERT_TRUE(one.look_back());
    TEST_ASSERT_EQUAL_INT64(300, one.sample());
    const std::vector<kept> all = kept_of(one);
    TEST_ASSERT_EQUAL_UINT64(121, all.size());
    for (std::size_t k = 0; k < all.size(); ++k) {
        TEST_ASSERT_EQUAL_INT64(280 + static_cast<std::int64_t>(k), all[k].index);
        TEST_ASSERT_EQUAL_DOUBLE(static_cast<double>(280 + k), all[k].number);
    }
}

/// A pause that reaches into the time before the trigger is handed on from there on.
static void test_a_pause_before_the_trigger(void) {
    trigger one(make_config(trigger_source::level, DRV_GPIO_RISING, 0.2));
    const double low[] = {0, 0}, high[] = {0, 100};
    TEST_ASSERT_FALSE(one.add(0, low, 1, 0));
    TEST_ASSERT_FALSE(one.add(1, nullptr, 10, 0)); // all of it lies too far back
    TEST_ASSERT_FALSE(one.add(11, low, 1, 0));
    TEST_ASSERT_FALSE(one.add(12, nullptr, 30, 0)); // 12 ... 41
    TEST_ASSERT_FALSE(one.add(42, low, 1, 0));
    TEST_ASSERT_TRUE(one.add(43, high, 1, 0));
    const std::vector<kept> all = kept_of(one);
    TEST_ASSERT_EQUAL_UINT64(3, all.size());
    TEST_ASSERT_EQUAL_INT64(23, all[0].index);
    TEST_ASSERT_EQUAL_INT64(19, all[0].count);
    TEST_ASSERT_EQUAL_DOUBLE(-1, all[0].number);
    TEST_ASSERT_EQUAL_INT64(42, all[1].index);
    TEST_ASSERT_EQUAL_DOUBLE(0, all[1].number);
    TEST_ASSERT_EQUAL_INT64(43, all[2].index);
    TEST_ASSERT_EQUAL_DOUBLE(100, all[2].number);
}

static void test_without_a_trigger_nothing_is_waited_for(void) {
    TEST_ASSERT_FALSE(trigger(make_config(trigger_source::immediate, DRV_GPIO_RISING)).waiting());
}

static void test_what_is_said_of_a_trigger_that_never_came(void) {
    const auto text = [](drv_gpio_edge_t edge) { return trigger(make_config(trigger_source::level, edge)).awaited(); };
    TEST_ASSERT_EQUAL_STRING("force to rise to 2 N", text(DRV_GPIO_RISING).c_str());
    TEST_ASSERT_EQUAL_STRING("force to fall to 2 N", text(DRV_GPIO_FALLING).c_str());
    TEST_ASSERT_EQUAL_STRING("force to cross 2 N", text(DRV_GPIO_BOTH).c_str());
    trigger level(make_config(trigger_source::level, DRV_GPIO_RISING));
    TEST_ASSERT_EQUAL_STRING("the trigger never came: waited for force to rise to 2 N, but the channel had no sample",
                             level.missed().c_str());
    for (const double newtons : {1.0, -4.0, 1.5, 0.0}) {
        const double row[] = {0, (newtons + 3) / 0.5};
        TEST_ASSERT_FALSE(level.add(0, row, 1, 0));
    }
    TEST_ASSERT_EQUAL_STRING(
        "the trigger never came: waited for force to rise to 2 N, its values lay between -4 and 1.5",
        level.missed().c_str());
    trigger line(make_config(trigger_source::gpio, DRV_GPIO_RISING));
    TEST_ASSERT_EQUAL_STRING("an edge of gpiochip0 line 17", line.awaited().c_str());
    TEST_ASSERT_TRUE(line.missed().find("none came") != std::string::npos);
    line.edge(1000);
    TEST_ASSERT_TRUE(line.missed().find("after the last sample") != std::string::npos);
}

int main(void) {
    UNITY_BEGIN();
    RUN_TEST(test_a_level_is_crossed_in_the_wanted_direction);
    RUN_TEST(test_a_number_at_the_level);
    RUN_TEST(test_a_missing_sample_does_not_hide_a_crossing);
    RUN_TEST(test_an_edge_belongs_to_the_first_sample_that_is_not_before_it);
    RUN_TEST(test_an_edge_that_is_reported_late_is_looked_up);
    RUN_TEST(test_an_edge_before_the_oldest_sample);
    RUN_TEST(test_the_samples_before_a_level);
    RUN_TEST(test_the_samples_before_an_edge_of_a_second_ago);
    RUN_TEST(test_a_pause_before_the_trigger);
    RUN_TEST(test_without_a_trigger_nothing_is_waited_for);
    RUN_TEST(test_what_is_said_of_a_trigger_that_never_came);
    return UNITY_END();
}
