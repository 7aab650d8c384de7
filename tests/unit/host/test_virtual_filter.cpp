// SPDX-License-Identifier: MIT
// Virtual sensors of a model without forces, of all sensors, some and none: sizes of zero are sizes too.
#include "live/virtual_filter.hpp"

#include <cmath>
#include <unity.h>

using namespace okid_host;

namespace {

/// One mode of 5 Hz and 1 % at 100 Hz, seen by two outputs at 1 and -0.5 of its motion; no inputs.
virtual_model one_mode() {
    virtual_model out;
    out.outputs = {"a", "b"};
    out.dt = 0.01;
    const double angle = 2 * M_PI * 5 * out.dt, radius = std::exp(-0.01 * angle);
    out.A.resize(2, 2);
    out.A << radius * std::cos(angle), radius * std::sin(angle), -radius * std::sin(angle), radius * std::cos(angle);
    out.B.resize(2, 0);
    out.C.resize(2, 2);
    out.C << 1, 0, -0.5, 0;
    out.D.resize(2, 0);
    out.K = 0.3 * Eigen::MatrixXd::Ones(2, 2);
    out.noise = 0.01 * Eigen::MatrixXd::Identity(2, 2);
    out.mean = Eigen::VectorXd::Zero(2);
    out.widen = Eigen::VectorXd::Ones(2);
    return out;
}

} // namespace

void setUp() {}
void tearDown() {}

static void what_is_measured_comes_back_as_it_is() {
    virtual_filter filter(one_mode());
    const double row[] = {0.7, -0.35};
    const auto& now = filter.step(row);
    TEST_ASSERT_EQUAL_DOUBLE(0.7, now.y[0]);
    TEST_ASSERT_EQUAL_DOUBLE(-0.35, now.y[1]);
    TEST_ASSERT_EQUAL_DOUBLE(0, now.y_std.maxCoeff());
    TEST_ASSERT_EQUAL_INT64(0, now.force.size());
}

static void a_missing_sensor_follows_the_other() {
    virtual_filter filter(one_mode());
    for (int i = 0; i < 500; ++i) {
        const double motion = std::cos(2 * M_PI * 5 * 0.01 * i), row[] = {motion, NAN};
        const auto& now = filter.step(row);
        if (i > 300) TEST_ASSERT_DOUBLE_WITHIN(0.15, -0.5 * motion, now.y[1]);
        TEST_ASSERT_TRUE(now.y_std[1] > 0);
    }
}

static void with_no_sensor_at_all_the_model_goes_on_alone() {
    virtual_filter filter(one_mode());
    const double there[] = {1, -0.5}, missing[] = {NAN, NAN};
    filter.step(there);
    double before = 0;
    for (int i = 0; i < 50; ++i) {
        const auto& now = filter.step(missing);
        TEST_ASSERT_TRUE(std::isfinite(now.y[0]) && now.y_std[0] >= before);
        before = now.y_std[0] * (1 - 1e-9);
    }
}

int main() {
    UNITY_BEGIN();
    RUN_TEST(what_is_measured_comes_back_as_it_is);
    RUN_TEST(a_missing_sensor_follows_the_other);
    RUN_TEST(with_no_sensor_at_all_the_model_goes_on_alone);
    return UNITY_END();
}
