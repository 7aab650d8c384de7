// SPDX-License-Identifier: MIT
// The rate by time stamps: punctual, in bursts, behind stalls at either end, and with a nominal rate that is wrong.
#include "align/rate_meter.hpp"

#include <algorithm>
#include <functional>
#include <unity.h>

using namespace okid_host;

void setUp(void) {}
void tearDown(void) {}

namespace {

double measured(double nominal_hz, double true_hz, double seconds, const std::function<double(double)>& arrival) {
    rate_meter meter(nominal_hz);
    double heard_s = 0;
    for (int n = 0; n < seconds * true_hz; ++n) {
        heard_s = std::max(heard_s, arrival(n / true_hz));
        const bool came = n % 97 != 5; // a sample that is missing has no time
        meter.add(n, came ? 1700000000000000000 + static_cast<std::int64_t>(heard_s * 1e9) : 0);
    }
    return meter.rate_hz();
}

double poll(double t) { return (static_cast<int>(t / 0.0161) + 1) * 0.0161; }

void test_punctual() {
    TEST_ASSERT_DOUBLE_WITHIN(1e-3, 1000.1, measured(1000, 1000.1, 10, [](double t) { return t; }));
    TEST_ASSERT_DOUBLE_WITHIN(1e-3, 950, measured(1000, 950, 60, [](double t) { return t; }));
    TEST_ASSERT_DOUBLE_WITHIN(1e-3, 100, measured(100, 100, 3, [](double t) { return t; }));
}

void test_bursts() {
    TEST_ASSERT_DOUBLE_WITHIN(0.1, 1000, measured(1000, 1000, 30, poll));
    TEST_ASSERT_DOUBLE_WITHIN(0.5, 1000, measured(1000, 1000, 5, poll));
}

void test_stalls() {
    const auto behind = [](double from_s, double to_s) {
        return [=](double t) { return t >= from_s && t < to_s ? to_s : t; };
    };
    TEST_ASSERT_DOUBLE_WITHIN(0.05, 1000, measured(1000, 1000, 30, behind(0, 4)));
    TEST_ASSERT_DOUBLE_WITHIN(0.05, 1000, measured(1000, 1000, 30, behind(26, 31)));
    TEST_ASSERT_DOUBLE_WITHIN(0.05, 1000, measured(1000, 1000, 30, behind(13, 17)));
}

void test_a_clock_that_is_set() {
    for (const double by_s : {3600.0, -3600.0, 12.0})
        for (const int at : {100, 15000, 29000}) {
            rate_meter meter(1000);
            for (int n = 0; n < 30000; ++n)
                meter.add(n, 1700000000000000000 + static_cast<std::int64_t>((n / 1001.0 + (n < at ? 0 : by_s)) * 1e9));
            TEST_ASSERT_DOUBLE_WITHIN(0.05, 1001, meter.rate_hz());
        }
}

void test_too_little() {
    rate_meter meter(1000);
    TEST_ASSERT_EQUAL_DOUBLE(0, meter.rate_hz());
    meter.add(0, 1);
    TEST_ASSERT_EQUAL_DOUBLE(0, meter.rate_hz());
}

} // namespace

int main() {
    UNITY_BEGIN();
    RUN_TEST(test_punctual);
    RUN_TEST(test_bursts);
    RUN_TEST(test_stalls);
    RUN_TEST(test_a_clock_that_is_set);
    RUN_TEST(test_too_little);
    return UNITY_END();
}
