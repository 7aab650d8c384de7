// SPDX-License-Identifier: MIT
// The virtual rig against closed forms: discretisation, damping, response, noise, codes, frames.
#include "error.hpp"
#include "rig/gaussian.hpp"
#include "rig/rig.hpp"
#include "rig/rig_files.hpp"
#include "rig/rig_frames.hpp"
#include "rig/rig_run.hpp"

#include <cmath>
#include <cstdio>
#include <string>
#include <unistd.h>
#include <unity.h> // last: old versions define macros over <cmath>

using Eigen::MatrixXd;
using okid_host::rig;
using okid_host::rig_run;

namespace {

rig demo() { return okid_host::load_rig(OKID_SOURCE_DIR "/tests/replay/demo_rig.toml"); }

/// One mass, 2 Hz, 5 %.
rig oscillator() {
    rig out;
    out.rate_hz = 50;
    out.duration_s = 4;
    const double w = 4 * M_PI;
    out.body.M = MatrixXd::Constant(1, 1, 2.0);
    out.body.K = MatrixXd::Constant(1, 1, 2.0 * w * w);
    out.body.R = MatrixXd::Constant(1, 1, 2.0 * 2 * 0.05 * w);
    out.force_dofs = out.sense_dofs = {1};
    out.sensing = "displacement";
    return out;
}

double relative(const MatrixXd& a, const MatrixXd& b) { return (a - b).norm() / b.norm(); }

void modes_and_rayleigh_damping() {
    const rig r = demo();
    const okid_host::rig_modes modes = okid_host::structure_modes(r.body);
    TEST_ASSERT_EQUAL_UINT64(3, modes.frequency_hz.size());
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, 0.01, modes.damping_ratio[0]);
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, 0.01, modes.damping_ratio[2]);
    for (std::size_t k = 0; k < 3; ++k) { // det(K - w^2 M) = 0, zeta = alpha/(2 w) + beta w/2
        const double w = 2 * M_PI * modes.frequency_hz[k];
        TEST_ASSERT_DOUBLE_WITHIN(1e-11 * r.body.K.determinant(), 0, (r.body.K - w * w * r.body.M).determinant());
        TEST_ASSERT_DOUBLE_WITHIN(1e-12, *r.alpha / (2 * w) + *r.beta * w / 2, modes.damping_ratio[k]);
    }
    TEST_ASSERT_TRUE(r.warnings.empty());
}

void free_decay_is_exact() {
    const rig r = oscillator();
    const auto d = okid_host::discretise(r.body, r.force_dofs, r.sense_dofs, r.sensing, "zoh", r.rate_hz);
    const double w = 4 * M_PI, zeta = 0.05, wd = w * std::sqrt(1 - zeta * zeta);
    Eigen::Vector2d state(1, 0);
    for (int n = 0; n <= 200; ++n) {
        const double t = n / r.rate_hz;
        const double exact = std::exp(-zeta * w * t) * (std::cos(wd * t) + zeta * w / wd * std::sin(wd * t));
        TEST_ASSERT_DOUBLE_WITHIN(1e-12, exact, state(0));
        state = d.A * state;
    }
}

void step_and_ramp_are_exact() {
    const rig r = oscillator();
    const double k = r.body.K(0, 0), w = 4 * M_PI, zeta = 0.05, wd = w * std::sqrt(1 - zeta * zeta);
    const auto step = [&](double t) {
        return (1 - std::exp(-zeta * w * t) * (std::cos(wd * t) + zeta * w / wd * std::sin(wd * t))) / k;
    };
    const auto ramp = [&](double t) { // response to u = t from rest
        const double a = -2 * zeta / w;
        return (t + a - std::exp(-zeta * w * t) * (a * std::cos(wd * t) + (1 + a * zeta * w) / wd * std::sin(wd * t))) /
               k;
    };
    const auto zoh = okid_host::discretise(r.body, {1}, {1}, "displacement", "zoh", r.rate_hz);
    const auto foh = okid_host::discretise(r.body, {1}, {1}, "displacement", "foh", r.rate_hz);
    Eigen::VectorXd a = Eigen::VectorXd::Zero(2), b = a;
    for (int n = 0; n < 200; ++n) {
        const double t = n / r.rate_hz;
        TEST_ASSERT_DOUBLE_WITHIN(1e-12 / k, step(t), a(0));
        TEST_ASSERT_DOUBLE_WITHIN(1e-11 / k, ramp(t), b(0));
        a = zoh.A * a + zoh.B0 + zoh.B1;
        b = foh.A * b + foh.B0 * t + foh.B1 * (t + 1 / r.rate_hz);
    }
    TEST_ASSERT_TRUE(zoh.B1.isZero(0));
}

void sensors() {
    const rig r = demo();
    const auto acc = okid_host::discretise(r.body, {1}, {3, 1}, "acceleration", "zoh", r.rate_hz);
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, 0, acc.D(0, 0));
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, 1 / r.body.M(0, 0), acc.D(1, 0)); // D = (M^-1)_ii
    MatrixXd expected(1, 6);
    expected << -r.body.K.row(0) / r.body.M(0, 0), -r.body.R.row(0) / r.body.M(0, 0);
    TEST_ASSERT_TRUE(relative(acc.C.row(1), expected) < 1e-14);
    const auto vel = okid_host::discretise(r.body, {1}, {2}, "velocity", "zoh", r.rate_hz);
    TEST_ASSERT_TRUE(vel.D.isZero(0) && vel.C(0, 4) == 1 && vel.C.norm() == 1);
}

/// The run obeys the model: what is left is noise of the size asked for, plus rounding to codes.
void response_noise_and_codes() {
    rig quiet = demo(), loud = demo();
    quiet.noise_percent = 0;
    quiet.bits = loud.bits = 24;
    loud.noise_percent = 2;
    const rig_run a = okid_host::simulate_rig(quiet), b = okid_host::simulate_rig(loud);
    TEST_ASSERT_EQUAL_UINT64(4, a.channels.size());
    const auto model =
        okid_host::discretise(quiet.body, quiet.force_dofs, quiet.sense_dofs, quiet.sensing, "zoh", quiet.rate_hz);
    Eigen::VectorXd state = Eigen::VectorXd::Zero(6);
    double noise = 0, signal = 0, force = 0;
    for (std::size_t n = 0; n < a.count; ++n) {
        const double u = a.channels[0].value(n);
        TEST_ASSERT_TRUE(u == b.channels[0].value(n)); // noise is on the outputs alone
        const Eigen::VectorXd y = model.C * state + model.D * u;
        for (std::size_t k = 0; k < 3; ++k)
            TEST_ASSERT_DOUBLE_WITHIN(0.5001 * a.channels[k + 1].scale, y(static_cast<Eigen::Index>(k)),
                                      a.channels[k + 1].value(n));
        state = model.A * state + model.B0 * u;
        const double error = b.channels[1].value(n) - a.channels[1].value(n);
        noise += error * error, signal += y(0) * y(0), force += u * u;
    }
    TEST_ASSERT_DOUBLE_WITHIN(0.001, 0.02, std::sqrt(noise / signal));
    TEST_ASSERT_DOUBLE_WITHIN(0.05, 1.0, std::sqrt(force / static_cast<double>(a.count)));
}

void codes_have_room() {
    for (const int bits : {4, 8, 12, 16, 24}) {
        rig r = demo();
        r.bits = bits;
        const std::int32_t limit = (1 << (bits - 1)) - 1;
        for (const auto& channel : okid_host::simulate_rig(r).channels) {
            std::int32_t largest = 0;
            for (const std::int32_t code : channel.codes) largest = std::max(largest, std::abs(code));
            TEST_ASSERT_TRUE(largest <= limit / 1.25 + 1 && largest > limit / 3);
        }
    }
}

void excitations() {
    for (const char* kind : {"white", "chirp", "hammer"}) {
        rig r = demo();
        r.excitation = kind;
        r.force_dofs = {1, 3};
        r.force_rms = 3;
        const MatrixXd u = okid_host::rig_forces(r, r.samples());
        for (int k = 0; k < 2; ++k)
            TEST_ASSERT_DOUBLE_WITHIN(0.1, 3.0, u.row(k).norm() / std::sqrt(static_cast<double>(u.cols())));
        TEST_ASSERT_TRUE(std::abs(u.row(0).dot(u.row(1))) < 0.1 * u.row(0).norm() * u.row(1).norm());
    }
    rig r = demo();
    r.excitation = "none";
    r.force_dofs.clear();
    const rig_run free = okid_host::simulate_rig(r);
    TEST_ASSERT_EQUAL_UINT64(3, free.channels.size());
    TEST_ASSERT_TRUE(free.channels[0].codes[0] != 0);
    TEST_ASSERT_TRUE(std::abs(free.channels[0].codes[4999]) < 2000);
}

void random_numbers_are_fixed() {
    okid_host::gaussian a(1, 0), again(1, 0), other(1, 1);
    double sum = 0, square = 0, cross = 0;
    const int n = 100000;
    for (int i = 0; i < n; ++i) {
        const double x = a.next(), y = other.next();
        TEST_ASSERT_TRUE(x == again.next());
        sum += x, square += x * x, cross += x * y;
    }
    TEST_ASSERT_DOUBLE_WITHIN(0.015, 0, sum / n);
    TEST_ASSERT_DOUBLE_WITHIN(0.02, 1, square / n);
    TEST_ASSERT_DOUBLE_WITHIN(0.015, 0, cross / n);
}

void frames() {
    rig r = demo();
    r.duration_s = 0.02;
    rig_run run = okid_host::simulate_rig(r);
    run.channels[0].codes[1] = -2;
    run.channels[3].codes[1] = 0x1234;
    const auto messages = okid_host::rig_messages(run);
    TEST_ASSERT_EQUAL_UINT64(2, messages.size());
    TEST_ASSERT_EQUAL_STRING("Shaker", messages[0].name.c_str());
    const drv_frame_t shaker = okid_host::rig_frame(run, messages[0], 1, 5),
                      accel = okid_host::rig_frame(run, messages[1], 1, 5);
    TEST_ASSERT_EQUAL_UINT32(0x100, shaker.id);
    TEST_ASSERT_EQUAL_UINT32(0x101, accel.id);
    const std::uint8_t expected[] = {1, 0, 0xfe, 0xff};
    TEST_ASSERT_EQUAL_UINT8(4, shaker.len);
    TEST_ASSERT_EQUAL_UINT8_ARRAY(expected, shaker.data, 4);
    TEST_ASSERT_EQUAL_HEX8(0x34, accel.data[6]);
    TEST_ASSERT_EQUAL_HEX8(0x12, accel.data[7]);
    const std::string log = okid_host::rig_log(run);
    TEST_ASSERT_EQUAL_UINT64(0, log.find("(1700000000.000000) vcan0 100#0000"));
    TEST_ASSERT_TRUE(log.find("(1700000000.004130) vcan0 101#0100") != std::string::npos);
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, 130e-6, okid_host::frame_spacing_s(run, 2));
    run.rate_hz = 10000;
    TEST_ASSERT_TRUE(okid_host::frame_spacing_s(run, 2) * 2 < 1e-4);
}

void counter_wraps_and_many_channels() {
    rig_run run;
    run.rate_hz = 100;
    run.count = 70000;
    run.forces = 4;
    for (int k = 0; k < 9; ++k) {
        run.channels.emplace_back();
        run.channels.back().signal = (k < 4 ? "Force" : "Accel") + std::to_string(k + 1);
        run.channels.back().codes.assign(run.count, k);
    }
    const auto messages = okid_host::rig_messages(run);
    TEST_ASSERT_EQUAL_UINT64(4, messages.size()); // 3 + 1 forces, 3 + 2 sensors
    TEST_ASSERT_EQUAL_STRING("Shaker2", messages[1].name.c_str());
    TEST_ASSERT_EQUAL_STRING("Accel2", messages[3].name.c_str());
    for (std::size_t i = 0; i < 4; ++i)
        for (std::size_t j = 0; j < i; ++j) TEST_ASSERT_TRUE(messages[i].id != messages[j].id);
    const drv_frame_t frame = okid_host::rig_frame(run, messages[3], 65537, 0);
    TEST_ASSERT_EQUAL_HEX8(1, frame.data[0]);
    TEST_ASSERT_EQUAL_HEX8(0, frame.data[1]);
    TEST_ASSERT_EQUAL_HEX8(8, frame.data[4]);
}

void a_change_keeps_the_motion() {
    rig r = demo();
    r.noise_percent = 0;
    r.sensing = "displacement";
    r.bits = 24;
    okid_host::rig_change change;
    change.at_s = 10;
    change.after = r.body;
    change.after.K *= 0.5;
    r.changes.push_back(change);
    const rig_run changed = okid_host::simulate_rig(r);
    r.changes.clear();
    const rig_run plain = okid_host::simulate_rig(r);
    for (std::size_t n = 0; n <= 2500; ++n) // at the moment of change the place is still the same
        TEST_ASSERT_DOUBLE_WITHIN(changed.channels[1].scale + plain.channels[1].scale, plain.channels[1].value(n),
                                  changed.channels[1].value(n));
    TEST_ASSERT_TRUE(std::abs(plain.channels[1].value(2600) - changed.channels[1].value(2600)) >
                     100 * plain.channels[1].scale);
}

/// The rig file with `from` replaced; the refusal must hold `part`.
void refused(const std::string& text, const std::string& part) {
    char name[] = "/tmp/okid_rig_XXXXXX";
    const int fd = mkstemp(name);
    TEST_ASSERT_TRUE(fd >= 0);
    TEST_ASSERT_TRUE(write(fd, text.data(), text.size()) == static_cast<ssize_t>(text.size()));
    close(fd);
    std::string message;
    try {
        okid_host::load_rig(name);
    } catch (const okid_host::failure& error) {
        TEST_ASSERT_EQUAL_INT(okid_host::exit_usage, error.code);
        message = error.what();
    }
    std::remove(name);
    if (message.find(part) == std::string::npos)
        TEST_FAIL_MESSAGE(("expected \"" + part + "\" in \"" + message + "\"").c_str());
}

void bad_files() {
    const std::string head = "rate_hz = 100.0\nduration_s = 1.0\n", rest = "force_dofs = [1]\nsense_dofs = [1]\n";
    const std::string body =
        "M = [[1.0, 0.0], [0.0, 1.0]]\nK = [[200.0, -100.0], [-100.0, 100.0]]\nR = [[0.2, 0.0], [0.0, 0.1]]\n";
    refused("", "rate_hz");
    refused(head, "masses");
    refused(head + rest, "masses");
    refused(head + "masses = [1.0]\nM = [[1.0]]\n", "both are given");
    refused(head + "masses = [1.0]\nsprings = [1.0]\nzeta = [0.1]\n", "force_dofs");
    refused(head + body + "zeta = [0.1, 0.1]\n" + rest, "both are given");
    refused(head + "M = [[1.0, 0.2], [0.0, 1.0]]\n", "symmetric");
    refused(head + "M = [[1.0, 2.0], [2.0, 1.0]]\n", "positive definite");
    refused(head + "M = [[1.0, 0.0], [0.0]]\n", "row of 2");
    refused(head + "masses = []\n", "masses");
    refused(head + "masses = 3\n", "masses");
    refused(head + "masses = [1.0]\nsprings = [1.0]\nR = [[-0.1]]\n" + rest, "decays");
    refused(head + "masses = [1.0]\nsprings = [1.0]\nR = [[5.0]]\n" + rest, "oscillates");
    refused(head + body + rest + "[[change]]\nat_s = 0.5\n", "what changes");
    refused(head + body + rest + "[[change]]\nsprings = [1.0, 1.0]\n", "at_s");
    refused(head + body + rest + "[[change]]\nat_s = 7.0\nsprings = [1.0, 1.0]\n", "from 0 to 1");
    refused(head + body + rest + "[change]\nat_s = 0.5\n", "change");
    refused(head + body + rest + "[[change]]\nat_s = 0.5\nspring = [1.0, 1.0]\n", "did you mean \"springs\"");
    refused("rate_hz = 1e6\nduration_s = 1e4\n", "200 million");
}

void configuration_and_truth() {
    const rig r = demo();
    const rig_run run = okid_host::simulate_rig(r);
    const std::string config = okid_host::rig_config(r, run, "a \"b\".dbc");
    TEST_ASSERT_TRUE(config.find("dbc = \"a \\\"b\\\".dbc\"") != std::string::npos);
    TEST_ASSERT_TRUE(config.find("rate_hz = 250\n") != std::string::npos);
    TEST_ASSERT_TRUE(okid_host::rig_truth(r).find("\"schema\": \"okid.truth/1\"") != std::string::npos);
    TEST_ASSERT_EQUAL_UINT64(0, okid_host::rig_csv(run).find("# fs_hz: 250\n"));
}

} // namespace

void setUp(void) {}
void tearDown(void) {}

int main(void) {
    UNITY_BEGIN();
    RUN_TEST(modes_and_rayleigh_damping);
    RUN_TEST(free_decay_is_exact);
    RUN_TEST(step_and_ramp_are_exact);
    RUN_TEST(sensors);
    RUN_TEST(response_noise_and_codes);
    RUN_TEST(codes_have_room);
    RUN_TEST(excitations);
    RUN_TEST(random_numbers_are_fixed);
    RUN_TEST(frames);
    RUN_TEST(counter_wraps_and_many_channels);
    RUN_TEST(a_change_keeps_the_motion);
    RUN_TEST(bad_files);
    RUN_TEST(configuration_and_truth);
    return UNITY_END();
}
