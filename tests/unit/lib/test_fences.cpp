// SPDX-License-Identifier: MIT
// Mechanics and models read and write no array further than it reaches, the work block included, on either side.
#include "fenced.hpp"

#include <okid/mechanics.h>
#include <okid/mkr.h>
#include <okid/modal.h>
#include <okid/model.h>
#include <okid/steps/skew.h>
#include <okid/track.h>

#include <cmath>
#include <limits>

extern "C" void setUp() {}
extern "C" void tearDown() {}

namespace {

using real = okid_real_t;
using reals = std::vector<real>;
using whole = std::vector<int32_t>;

enum { X = 3, Z = 2 * X, U = 2, Y = 3, COUNT = 200 };
const double dt = 0.02;

const reals masses = {2, 0, 0, 0, 1, 0, 0, 0, 3}, springs = {900, -400, 0, -400, 800, -400, 0, -400, 500},
            dampers = {real(1.8), real(-0.8), 0, real(-0.8), real(1.6), real(-0.8), 0, real(-0.8), 1};
const whole forces = {0, 2}, sensors = {0, 1, 2}, kinds = {2, 0, 1};

/// Three masses in a row, in arrays with fences.
struct chain {
    fenced<real> M, R, K, B_a, C_p, C_v, C_a, A, B, C, D, A_d, B_d, D_d, gain;
    okid_model_t continuous{}, discrete{};

    explicit chain(fence where)
        : M(where, masses), R(where, dampers), K(where, springs), B_a(where, X * U), C_p(where, Y * X),
          C_v(where, Y * X), C_a(where, Y * X), A(where, Z * Z), B(where, Z * U), C(where, Y * Z), D(where, Y * U),
          A_d(where, Z * Z), B_d(where, Z * U), D_d(where, Y * U), gain(where, Z * Y) {
        const fenced<int32_t> in(where, forces), out(where, sensors), kind(where, kinds);
        const fenced<real> push(where, reals{1, 2}), show(where, reals{1, -1, 3});
        TEST_ASSERT_EQUAL(OKID_OK, okid_mechanics_inputs(X, U, in, push, B_a));
        TEST_ASSERT_EQUAL(OKID_OK, okid_mechanics_outputs(X, Y, out, show, kind, C_p, C_v, C_a));
        const okid_mechanics_t truth{X, U, Y, M, R, K, B_a, C_p, C_v, C_a};
        const fenced<unsigned char> work(where, okid_mechanics_memsize(X, U));
        TEST_ASSERT_EQUAL(OKID_OK, okid_mechanics_continuous(&truth, A, B, C, D, work, work.size()));
        std::memset(gain, 0, gain.size() * sizeof(real));
        gain[0] = real(0.1);
        continuous = {U, Y, Z, A, B, C, D, nullptr};
        discrete = {U, Y, Z, A_d, B_d, C, D_d, gain};
        sample(where, OKID_HOLD_ZERO);
    }

    void sample(fence where, int32_t hold) const {
        const fenced<unsigned char> work(where, okid_mechanics_hold_memsize(U, Y, Z));
        TEST_ASSERT_EQUAL(OKID_OK, okid_mechanics_c2d(&continuous, dt, hold, A_d, B_d, D_d, work, work.size()));
    }
};

void near(const real* a, const real* b, int count) {
    double off = 0, size = 0;
    for (int i = 0; i < count; ++i) {
        off = std::max(off, std::abs(double(a[i]) - double(b[i])));
        size = std::max(size, std::abs(double(b[i])));
    }
    TEST_ASSERT_TRUE(off <= 1e-9 * size);
}

void holds() {
    on_both_sides([](fence where) {
        const chain c(where);
        for (const int32_t hold : {OKID_HOLD_ZERO, OKID_HOLD_FIRST}) {
            c.sample(where, hold);
            const fenced<real> A(where, Z * Z), B(where, Z * U), D(where, Y * U);
            const fenced<unsigned char> work(where, okid_mechanics_hold_memsize(U, Y, Z));
            TEST_ASSERT_EQUAL(OKID_OK, okid_mechanics_d2c(&c.discrete, dt, hold, A, B, D, work, work.size()));
            near(A, c.A, Z * Z);
            near(B, c.B, Z * U);
            near(D, c.D, Y * U);
        }
    });
}

void modes() {
    on_both_sides([](fence where) {
        const chain c(where);
        const fenced<real> f(where, X), zeta(where, X), re(where, Y * X), im(where, Y * X), mpc(where, X),
            mu_re(where, X), mu_im(where, X), psi_re(where, Z * X), psi_im(where, Z * X);
        okid_modes_t found{0, 0, f, zeta, nullptr, re, im, nullptr, nullptr, nullptr, nullptr};
        const okid_mechanics_t truth{X, U, Y, c.M, c.R, c.K, nullptr, nullptr, nullptr, nullptr};
        const fenced<unsigned char> work(where, okid_mechanics_memsize(X, 1)), more(where, okid_modal_memsize(Y, Z));
        TEST_ASSERT_EQUAL(OKID_OK, okid_mechanics_modes(&truth, &found, work, work.size()));
        TEST_ASSERT_EQUAL_INT32(X, found.count);
        const reals expected(f + 0, f + X);
        found = {0, 0, f, zeta, mpc, re, im, mu_re, mu_im, psi_re, psi_im};
        TEST_ASSERT_EQUAL(OKID_OK, okid_modal_analyse(&c.discrete, dt, &found, more, more.size()));
        TEST_ASSERT_EQUAL_INT32(X, found.count);
        near(f, expected.data(), X);
        const fenced<real> a(where, reals{1, 2}), b(where, reals{0, 1});
        TEST_ASSERT_EQUAL_DOUBLE(1, okid_modal_mac(2, a, b, a, b));
    });
}

void mass_damping_and_stiffness() {
    on_both_sides([](fence where) {
        const chain c(where);
        const fenced<int32_t> in(where, forces), out(where, sensors), kind(where, kinds);
        const fenced<real> push(where, reals{1, 2}), show(where, reals{1, -1, 3});
        const okid_mkr_config_t config{X, OKID_HOLD_ZERO, dt, in, push, out, show, kind};
        const fenced<unsigned char> work(where, okid_mkr_memsize(U, Y, Z, X));
        okid_mkr_t found;
        TEST_ASSERT_EQUAL(OKID_OK, okid_mkr_identify(&c.discrete, &config, &found, work, work.size()));
        near(found.M, c.M, X * X);
        near(found.K, c.K, X * X);
        near(found.R, c.R, X * X);
        const fenced<real> f(where, reals(found.frequency_hz, found.frequency_hz + X)),
            zeta(where, reals(found.damping_ratio, found.damping_ratio + X)), weight(where, reals{1, 2, 3}),
            R(where, X * X);
        okid_pdc_t pdc;
        TEST_ASSERT_EQUAL(OKID_OK, okid_pdc_fit(X, f, zeta, weight, &pdc));
        TEST_ASSERT_EQUAL(OKID_OK, okid_pdc_damping(X, &pdc, c.M, c.K, R));
        near(R, c.R, X * X);
    });
}

void models_at_work() {
    on_both_sides([](fence where) {
        const chain c(where);
        const fenced<real> u(where, COUNT * U), y(where, COUNT * Y), x0(where, reals{1, 0, -1, 2, 0, 3}),
            found(where, Z), predicted(where, COUNT * Y), work(where, okid_model_workspace(&c.discrete));
        for (int i = 0; i < COUNT * U; ++i) u[i] = real(std::sin(0.3 * i * i));
        TEST_ASSERT_EQUAL(OKID_OK, okid_model_simulate(&c.discrete, u, COUNT, x0, y, work));
        TEST_ASSERT_EQUAL(OKID_OK, okid_model_predict(&c.discrete, u, y, COUNT, x0, predicted, work));
        near(predicted, y, COUNT * Y);
        const fenced<unsigned char> fit(where, okid_model_fit_memsize(&c.discrete));
        const fenced<double> rows(where, COUNT * (U + Y)), sums(where, 5 * Y);
        for (int n = 0; n < COUNT; ++n) {
            for (int j = 0; j < U; ++j) rows[n * (U + Y) + j] = u[n * U + j];
            for (int o = 0; o < Y; ++o) rows[n * (U + Y) + U + o] = y[n * Y + o];
        }
        std::memset(sums, 0, sums.size() * sizeof(double));
        TEST_ASSERT_EQUAL(OKID_OK, okid_model_fit(&c.discrete, rows, COUNT, x0, sums, fit, fit.size()));
        for (int o = 0; o < Y; ++o) TEST_ASSERT_TRUE(sums[o] < 1e-20 * sums[3 * Y + o] && sums[4 * Y + o] == COUNT);
        for (const int missing : {0, 1}) {
            if (missing != 0) y[7] = std::numeric_limits<real>::quiet_NaN();
            TEST_ASSERT_EQUAL(OKID_OK, okid_model_initial_state(&c.discrete, u, y, COUNT, found, work));
            near(found, x0, Z);
        }
    });
}

void followed_modes() {
    on_both_sides([](fence where) {
        okid_track_config_t config = okid_track_defaults(2, 3);
        config.close_hz = 0.1;
        const fenced<unsigned char> block(where, okid_track_memsize(&config));
        okid_tracks_t* tracks = nullptr;
        TEST_ASSERT_EQUAL(OKID_OK, okid_track_create(&tracks, &config, block, block.size()));
        const fenced<real> f(where, reals{1, 2, 3}), zeta(where, 3), re(where, reals{1, 0, 0, 1, 1, 1}), im(where, 6);
        const fenced<int32_t> number(where, 3);
        std::memset(im, 0, im.size() * sizeof(real));
        for (int k = 0; k < 9; ++k) {
            if (k == 6) okid_track_jump(tracks);
            TEST_ASSERT_EQUAL(OKID_OK, okid_track_update(tracks, 3, f, zeta, re, im, number));
            for (int m = 0; m < 3; ++m) TEST_ASSERT_EQUAL_INT32(k < 2 ? 0 : m + 1, number[m]);
        }
    });
}

void delays() {
    on_both_sides([](fence where) {
        const chain c(where);
        const fenced<int32_t> in(where, forces), out(where, sensors), kind(where, kinds);
        const fenced<real> push(where, reals{1, 2}), show(where, reals{1, -1, 3}), C(where, Y * Z), D(where, Y * U);
        const okid_mkr_config_t mkr{X, OKID_HOLD_ZERO, dt, in, push, out, show, kind};
        okid_skew_config_t config = okid_skew_defaults(U, Y, Z, &mkr);
        config.replicates = 3;
        const fenced<unsigned char> block(where, okid_skew_memsize(&config));
        okid_skew_t* skew = nullptr;
        okid_skew_result_t found;
        TEST_ASSERT_EQUAL(OKID_OK, okid_skew_create(&skew, &config, block, block.size()));
        TEST_ASSERT_EQUAL(OKID_OK, okid_skew_begin(skew, &c.discrete));
        for (int r = 0; r < 3; ++r) TEST_ASSERT_EQUAL(OKID_OK, okid_skew_add(skew, &c.discrete));
        TEST_ASSERT_EQUAL(OKID_ERR_RANGE, okid_skew_add(skew, &c.discrete));
        TEST_ASSERT_EQUAL(OKID_OK, okid_skew_finish(skew, &found));
        TEST_ASSERT_EQUAL(OKID_OK, okid_skew_correct(skew, C, D));
        near(C, c.C, Y * Z);
        near(D, c.D_d, Y * U);
    });
}

} // namespace

int main() {
    UNITY_BEGIN();
    RUN_TEST(holds);
    RUN_TEST(modes);
    RUN_TEST(mass_damping_and_stiffness);
    RUN_TEST(models_at_work);
    RUN_TEST(followed_modes);
    RUN_TEST(delays);
    return UNITY_END();
}
