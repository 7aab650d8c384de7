// SPDX-License-Identifier: MIT
// From M, R, K to state space and modes.
#include "mechanics_rig.h"

#include <float.h>

static okid_status_t modes(int n, const okid_real_t* M, const okid_real_t* R, const okid_real_t* K, int32_t* count,
                           okid_real_t* f, okid_real_t* zeta, okid_real_t* re, okid_real_t* im) {
    const size_t bytes = okid_mechanics_memsize(n, 1);
    void* work = malloc(bytes);
    const okid_mechanics_t self = {.n_x = n, .M = M, .R = R, .K = K};
    okid_modes_t out = {.count = *count, .frequency_hz = f, .damping_ratio = zeta, .shape_re = re, .shape_im = im};
    const okid_status_t status = okid_mechanics_modes(&self, &out, work, bytes);
    *count = out.count;
    free(work);
    return status;
}

// ---- continuous --------------------------------------------------------------------------------------------------------

// Newton: for any state and force the model's accelerations satisfy M x'' + R x' + K x = B_a u, and every row of the
// outputs is the named combination of displacement, velocity and acceleration.
static void continuous_model_is_newtons_law(void) {
    enum { NY = 3 };
    uint64_t seed = 5;
    for (int which = 1; which <= 3; ++which) {
        okid_real_t C_p[NY * S_MAX], C_v[NY * S_MAX], C_a[NY * S_MAX], B_a[S_MAX * 2];
        make(which, 0, 0);
        const int n = s.n, z = 2 * n;
        for (int i = 0; i < NY * n; ++i) {
            C_p[i] = (okid_real_t)(s_uniform(&seed) - 0.5);
            C_v[i] = (okid_real_t)(s_uniform(&seed) - 0.5);
            C_a[i] = (okid_real_t)(s_uniform(&seed) - 0.5);
        }
        for (int i = 0; i < 2 * n; ++i) B_a[i] = (okid_real_t)(s_uniform(&seed) - 0.5);
        const okid_mechanics_t truth = {n, 2, NY, s.M, s.R, s.K, B_a, C_p, C_v, C_a};
        const size_t bytes = okid_mechanics_memsize(n, 2);
        void* work = malloc(bytes);
        TEST_ASSERT_EQUAL(OKID_OK, okid_mechanics_continuous(&truth, m.A, m.B, m.C, m.D, work, bytes));
        free(work);
        double state[2 * S_MAX], rate[2 * S_MAX];
        const double u[] = {0.7, -1.3};
        for (int i = 0; i < z; ++i) state[i] = (s_uniform(&seed) - 0.5) * (i < n ? 1e-3 : 1);
        for (int i = 0; i < z; ++i) {
            rate[i] = (double)m.B[i] * u[0] + (double)m.B[z + i] * u[1];
            for (int j = 0; j < z; ++j) rate[i] += (double)m.A[j * z + i] * state[j];
        }
        for (int i = 0; i < n; ++i) {
            TEST_ASSERT_EQUAL_DOUBLE(state[n + i], rate[i]);
            double force = 0, size = 0;
            for (int j = 0; j < n; ++j) {
                const double parts[] = {(double)s.M[j * n + i] * rate[n + j], (double)s.R[j * n + i] * state[n + j],
                                        (double)s.K[j * n + i] * state[j]};
                for (int k = 0; k < 3; ++k) {
                    force += parts[k];
                    size += fabs(parts[k]);
                }
            }
            for (int j = 0; j < 2; ++j) force -= (double)B_a[j * n + i] * u[j];
            TEST_ASSERT_TRUE(fabs(force) < TOLERANCE(1e-13, 1e-5) * size);
        }
        for (int o = 0; o < NY; ++o) {
            double y = (double)m.D[o] * u[0] + (double)m.D[NY + o] * u[1], expected = 0, size = 0;
            for (int j = 0; j < z; ++j) y += (double)m.C[j * NY + o] * state[j];
            for (int j = 0; j < n; ++j) {
                expected += (double)C_p[j * NY + o] * state[j] + (double)C_v[j * NY + o] * state[n + j] +
                            (double)C_a[j * NY + o] * rate[n + j];
                size += fabs((double)C_a[j * NY + o] * rate[n + j]);
            }
            TEST_ASSERT_DOUBLE_WITHIN(TOLERANCE(1e-12, 1e-4) * size, expected, y);
        }
    }
}

// A map that is not given is one of zeros, whatever the outputs held before.
static void maps_that_are_absent_are_zeros(void) {
    enum { NY = 3 };
    uint64_t seed = 9;
    static const okid_real_t none[NY * S_MAX];
    okid_real_t maps[3][NY * S_MAX], B_a[S_MAX * 2];
    make(2, 0, 0);
    for (int k = 0; k < 3; ++k)
        for (int i = 0; i < NY * s.n; ++i) maps[k][i] = (okid_real_t)(s_uniform(&seed) - 0.5);
    for (int i = 0; i < 2 * s.n; ++i) B_a[i] = (okid_real_t)(s_uniform(&seed) - 0.5);
    const size_t bytes = okid_mechanics_memsize(s.n, 2);
    void* work = malloc(bytes);
    for (int given = 0; given < 8; ++given) {
        const okid_real_t* at[2][3];
        for (int k = 0; k < 3; ++k) {
            at[0][k] = given >> k & 1 ? maps[k] : NULL;
            at[1][k] = given >> k & 1 ? maps[k] : none;
        }
        system_t both[2];
        for (int way = 0; way < 2; ++way) {
            system_t* to = &both[way];
            memset(to, 0xff, sizeof *to); // numbers that are none
            const okid_mechanics_t truth = {s.n, 2, NY, s.M, s.R, s.K, B_a, at[way][0], at[way][1], at[way][2]};
            TEST_ASSERT_EQUAL(OKID_OK, okid_mechanics_continuous(&truth, to->A, to->B, to->C, to->D, work, bytes));
        }
        for (int i = 0; i < 2 * s.n * NY; ++i) TEST_ASSERT_TRUE(both[0].C[i] == both[1].C[i]);
        for (int i = 0; i < 2 * NY; ++i) TEST_ASSERT_TRUE(both[0].D[i] == both[1].D[i]);
    }
    free(work);
}

static void maps_place_gains_and_kinds(void) {
    const int32_t dof[] = {2, 0, 1}, kind[] = {OKID_SENSE_ACCELERATION, OKID_SENSE_DISPLACEMENT, OKID_SENSE_VELOCITY};
    const okid_real_t gain[] = {-1, 2, (okid_real_t)0.5};
    okid_real_t B_a[9], C_p[9], C_v[9], C_a[9];
    const okid_real_t forces[] = {0, 0, -1, 2, 0, 0, 0, (okid_real_t)0.5, 0};
    TEST_ASSERT_EQUAL(OKID_OK, okid_mechanics_inputs(3, 3, dof, gain, B_a));
    TEST_ASSERT_EQUAL_MEMORY(forces, B_a, sizeof forces);
    TEST_ASSERT_EQUAL(OKID_OK, okid_mechanics_outputs(3, 3, dof, gain, kind, C_p, C_v, C_a));
    for (int i = 0; i < 9; ++i) {
        TEST_ASSERT_EQUAL_DOUBLE(i == 1 ? 2 : 0, C_p[i]); // row 1, column 0
        TEST_ASSERT_EQUAL_DOUBLE(i == 5 ? 0.5 : 0, C_v[i]);
        TEST_ASSERT_EQUAL_DOUBLE(i == 6 ? -1 : 0, C_a[i]);
    }
    TEST_ASSERT_EQUAL(OKID_OK, okid_mechanics_inputs(3, 3, dof, NULL, B_a));
    TEST_ASSERT_EQUAL_DOUBLE(1, B_a[2]);
    TEST_ASSERT_EQUAL(OKID_OK, okid_mechanics_outputs(3, 3, dof, NULL, kind, C_p, C_v, C_a));
    TEST_ASSERT_EQUAL_DOUBLE(1, C_a[6]);
    const int32_t outside[] = {0, 3, 1}, no_kind[] = {0, 3, 1};
    TEST_ASSERT_EQUAL(OKID_ERR_DIM, okid_mechanics_inputs(3, 3, outside, NULL, B_a));
    TEST_ASSERT_EQUAL(OKID_ERR_DIM, okid_mechanics_inputs(0, 3, dof, NULL, B_a));
    TEST_ASSERT_EQUAL(OKID_ERR_NULL, okid_mechanics_inputs(3, 3, NULL, NULL, B_a));
    TEST_ASSERT_EQUAL(OKID_ERR_DIM, okid_mechanics_outputs(3, 3, outside, NULL, kind, C_p, C_v, C_a));
    TEST_ASSERT_EQUAL(OKID_ERR_DIM, okid_mechanics_outputs(3, 3, dof, NULL, no_kind, C_p, C_v, C_a));
    TEST_ASSERT_EQUAL(OKID_ERR_DIM, okid_mechanics_outputs(3, 0, dof, NULL, kind, C_p, C_v, C_a));
    TEST_ASSERT_EQUAL(OKID_ERR_NULL, okid_mechanics_outputs(3, 3, dof, NULL, NULL, C_p, C_v, C_a));
}

// ---- modes -------------------------------------------------------------------------------------------------------------

static void modes_of_a_uniform_chain_in_closed_form(void) {
    enum { N = 8 };
    const double mass = 1.7, spring = 9e4, alpha = 0.8, beta = 4e-5;
    okid_real_t M[N * N] = {0}, K[N * N] = {0}, R[N * N], f[N], zeta[N], re[N * N], im[N * N];
    for (int i = 0; i < N; ++i) {
        M[i * N + i] = (okid_real_t)mass;
        K[i * N + i] = (okid_real_t)((i < N - 1 ? 2 : 1) * spring);
        if (i > 0) K[i * N + i - 1] = K[(i - 1) * N + i] = (okid_real_t)-spring;
    }
    for (int i = 0; i < N * N; ++i) R[i] = (okid_real_t)(alpha * M[i] + beta * K[i]);
    for (int damped = 0; damped < 2; ++damped) {
        int32_t count = 0;
        TEST_ASSERT_EQUAL(OKID_OK, modes(N, M, damped ? R : NULL, K, &count, f, zeta, re, im));
        TEST_ASSERT_EQUAL(N, count);
        for (int k = 0; k < N; ++k) {
            const double angle = (2 * k + 1) * pi / (2 * N + 1), omega = 2 * sqrt(spring / mass) * sin(angle / 2);
            const double ratio = damped ? alpha / (2 * omega) + beta * omega / 2 : 0;
            assert_near(omega / (2 * pi), TOLERANCE(1e-13, 1e-5), f[k]);
            TEST_ASSERT_DOUBLE_WITHIN(TOLERANCE(1e-13, 1e-5), ratio, zeta[k]);
            double top = 0; // shape sin(i angle), i = 1..N, largest entry 1
            for (int i = 0; i < N; ++i)
                if (fabs(sin((i + 1) * angle)) > fabs(top)) top = sin((i + 1) * angle);
            double misfit = 0, opposite = 0; // entries of one size may tie: the sign is then free
            for (int i = 0; i < N; ++i) {
                const double shape = sin((i + 1) * angle) / top;
                misfit = fmax(misfit, hypot(re[k * N + i] - shape, im[k * N + i]));
                opposite = fmax(opposite, hypot(re[k * N + i] + shape, im[k * N + i]));
            }
            TEST_ASSERT_TRUE(fmin(misfit, opposite) < TOLERANCE(1e-11, 1e-3));
        }
    }
}

static void modes_of_the_structures(void) {
    for (int which = 1; which <= 3; ++which) {
        okid_real_t f[S_MAX], zeta[S_MAX];
        int32_t count = 0;
        s_make(&s, which);
        TEST_ASSERT_EQUAL(OKID_OK, modes(s.n, s.M, s.R, s.K, &count, f, zeta, NULL, NULL));
        TEST_ASSERT_EQUAL(s.n, count);
        assert_near(s.omega[0] / (2 * pi), TOLERANCE(1e-12, 1e-4), f[0]);
        assert_near(s.omega[1] / (2 * pi), TOLERANCE(1e-12, 1e-4), f[s.n - 1]);
        assert_near(0.01, TOLERANCE(1e-11, 1e-2), zeta[0]);
        assert_near(0.01, TOLERANCE(1e-11, 1e-2), zeta[s.n - 1]);
        for (int k = 0; k < s.n; ++k) {
            const double omega = 2 * pi * f[k];
            assert_near(s.alpha / (2 * omega) + s.beta * omega / 2, TOLERANCE(1e-11, 1e-2), zeta[k]);
        }
    }
}

static void rigid_and_overdamped_motions_are_no_modes(void) {
    enum { N = 3 };
    const okid_real_t M[] = {2, 0, 0, 0, 1, 0, 0, 0, 3};
    const okid_real_t K[] = {900, -900, 0, -900, 900, 0, 0, 0, 300}; // 1 and 2 float together, 3 stands alone
    okid_real_t R[] = {0, 0, 0, 0, 0, 0, 0, 0, 90};                  // zeta 1.5 there
    okid_real_t f[N], zeta[N], re[N * N], im[N * N];
    int32_t count = 0;
    TEST_ASSERT_EQUAL(OKID_OK, modes(N, M, R, K, &count, f, zeta, re, im));
    TEST_ASSERT_EQUAL(1, count);
    assert_near(sqrt(900 * 1.5) / (2 * pi), TOLERANCE(1e-12, 1e-5), f[0]);
    TEST_ASSERT_DOUBLE_WITHIN(TOLERANCE(1e-12, 1e-5), -0.5, re[0]);
    TEST_ASSERT_DOUBLE_WITHIN(TOLERANCE(1e-12, 1e-5), 1, re[1]);
    R[8] = 6; // zeta 0.1
    TEST_ASSERT_EQUAL(OKID_OK, modes(N, M, R, K, &count, f, zeta, re, im));
    TEST_ASSERT_EQUAL(2, count);
    assert_near(10 / (2 * pi), TOLERANCE(1e-12, 1e-5), f[0]);
    assert_near(0.1, TOLERANCE(1e-12, 1e-5), zeta[0]);
}

/// Undamped masses of any size; free: the first spring to the ground is missing. @return modes found
static int32_t chain(int n, double speed, int is_free, uint64_t seed) {
    okid_real_t M[S_MAX * S_MAX] = {0}, f[S_MAX], zeta[S_MAX];
    int32_t count = 0;
    memset(&s, 0, sizeof s);
    s.n = n;
    for (int i = 0; i < n; ++i) {
        M[i * n + i] = (okid_real_t)(0.5 + s_uniform(&seed));
        if (i > 0 || !is_free) s_spring(&s, i, i - 1, speed * speed * (0.5 + s_uniform(&seed)));
    }
    TEST_ASSERT_EQUAL(OKID_OK, modes(n, M, NULL, s.K, &count, f, zeta, NULL, NULL));
    return count;
}

// Rounding moves the double zero of a body that floats, in proportion to the fastest pole.
static void what_floats_has_one_mode_less_at_any_speed(void) {
    for (int n = 2; n <= S_MAX; ++n)
        for (uint64_t seed = 1; seed <= 20; ++seed)
            for (double speed = 1e-4; speed < 1e5; speed *= 100) {
                TEST_ASSERT_EQUAL_INT32(n, chain(n, speed, 0, seed));
                TEST_ASSERT_EQUAL_INT32(n - 1, chain(n, speed, 1, seed));
            }
}

// Two oscillators that know nothing of each other: below 16 sqrt(eps) of the faster one nothing is a mode.
static void the_slowest_mode_is_sixteen_roots_of_eps_of_the_fastest(void) {
    const double root = sqrt(sizeof(okid_real_t) == sizeof(float) ? FLT_EPSILON : DBL_EPSILON);
    for (int above = 0; above < 2; ++above)
        for (double speed = 0.01; speed < 200; speed *= 10) {
            const double slow = (above ? 16.4 : 15.6) * root * speed;
            const okid_real_t M[] = {1, 0, 0, 1},
                              K[] = {(okid_real_t)(slow * slow), 0, 0, (okid_real_t)(speed * speed)};
            okid_real_t f[2], zeta[2];
            int32_t count = 0;
            TEST_ASSERT_EQUAL(OKID_OK, modes(2, M, NULL, K, &count, f, zeta, NULL, NULL));
            TEST_ASSERT_EQUAL_INT32(1 + above, count);
        }
}

static void a_pole_that_is_real_can_be_the_fastest(void) {
    const double root = sqrt(sizeof(okid_real_t) == sizeof(float) ? FLT_EPSILON : DBL_EPSILON);
    for (int place = 0; place < 3; ++place)
        for (int stiff = 0; stiff < 2; ++stiff)
            for (int above = 0; above < 2; ++above) {
                const double fast = 10, slow = (above ? 16.4 : 15.6) * root * fast; // a mass in oil: poles -10 and -0.1
                const okid_real_t M[] = {1, 0, 0, 0, 1, 0, 0, 0, 1};
                okid_real_t R[9] = {0}, K[9] = {0}, f[3], zeta[3];
                int32_t count = 0;
                for (int i = 0; i < 3; ++i) K[4 * i] = (okid_real_t)(i == place ? stiff : slow * slow);
                R[4 * place] = (okid_real_t)(fast + 0.1 * stiff);
                TEST_ASSERT_EQUAL(OKID_OK, modes(3, M, R, K, &count, f, zeta, NULL, NULL));
                TEST_ASSERT_EQUAL_INT32(2 * above, count);
            }
}

static void wrong_use_is_refused(void) {
    okid_real_t f[S_MAX], zeta[S_MAX], out[S_NZ * S_NZ];
    int32_t count = 0;
    char work[64];
    make(1, OKID_SENSE_ACCELERATION, 0);
    okid_mechanics_t truth = {3, 2, 3, s.M, s.R, s.K, out, NULL, NULL, out};
    TEST_ASSERT_EQUAL(0, okid_mechanics_memsize(0, 1));
    TEST_ASSERT_EQUAL(0, okid_mechanics_memsize(1, 0));
    TEST_ASSERT_EQUAL(OKID_ERR_MEMORY, okid_mechanics_continuous(&truth, m.A, m.B, m.C, m.D, work, sizeof work));
    TEST_ASSERT_EQUAL(OKID_ERR_NULL, okid_mechanics_continuous(&truth, m.A, m.B, m.C, NULL, work, sizeof work));
    TEST_ASSERT_EQUAL(OKID_ERR_NULL, okid_mechanics_continuous(NULL, m.A, m.B, m.C, m.D, work, sizeof work));
    truth.n_y = 0;
    TEST_ASSERT_EQUAL(OKID_ERR_DIM, okid_mechanics_continuous(&truth, m.A, m.B, m.C, m.D, work, sizeof work));
    TEST_ASSERT_EQUAL(OKID_ERR_NULL, modes(3, NULL, NULL, s.K, &count, f, zeta, NULL, NULL));
    TEST_ASSERT_EQUAL(OKID_ERR_NULL, modes(3, s.M, NULL, s.K, &count, f, zeta, f, NULL));
    okid_modes_t found = {.frequency_hz = f, .damping_ratio = zeta};
    TEST_ASSERT_EQUAL(OKID_ERR_MEMORY, okid_mechanics_modes(&truth, &found, work, 64));
    truth.n_x = 0;
    TEST_ASSERT_EQUAL(OKID_ERR_DIM, okid_mechanics_modes(&truth, &found, work, 64));
}

static void a_mass_matrix_that_is_none_is_refused(void) {
    okid_real_t f[S_MAX], zeta[S_MAX];
    int32_t count = 0;
    make(1, OKID_SENSE_ACCELERATION, 0);
    s.M[0] = -1;
    TEST_ASSERT_EQUAL(OKID_ERR_NUMERIC, s_continuous(&s, &m));
    TEST_ASSERT_EQUAL(OKID_ERR_NUMERIC, modes(s.n, s.M, s.R, s.K, &count, f, zeta, NULL, NULL));
}

int main(void) {
    UNITY_BEGIN();
    RUN_TEST(continuous_model_is_newtons_law);
    RUN_TEST(maps_that_are_absent_are_zeros);
    RUN_TEST(maps_place_gains_and_kinds);
    RUN_TEST(modes_of_a_uniform_chain_in_closed_form);
    RUN_TEST(modes_of_the_structures);
    RUN_TEST(rigid_and_overdamped_motions_are_no_modes);
    RUN_TEST(what_floats_has_one_mode_less_at_any_speed);
    RUN_TEST(the_slowest_mode_is_sixteen_roots_of_eps_of_the_fastest);
    RUN_TEST(a_pole_that_is_real_can_be_the_fastest);
    RUN_TEST(wrong_use_is_refused);
    RUN_TEST(a_mass_matrix_that_is_none_is_refused);
    return UNITY_END();
}
