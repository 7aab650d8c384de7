// SPDX-License-Identifier: MIT
// Proportional damping coefficients from frequencies and damping ratios.
#include "structures.h"

#include <unity.h>

enum { MODES = 8 };

static okid_real_t frequency[MODES], zeta[MODES], weight[MODES];
static okid_pdc_t pdc;

static const double pi = 3.14159265358979323846;

void setUp(void) {}
void tearDown(void) {}

static void rayleigh(int count, double alpha, double beta) {
    for (int k = 0; k < count; ++k) {
        const double omega = 2 * pi * (10 + 15.0 * k);
        frequency[k] = (okid_real_t)(omega / (2 * pi));
        zeta[k] = (okid_real_t)(alpha / (2 * omega) + beta * omega / 2);
    }
}

static void assert_near(double expected, double relative, double found) {
    TEST_ASSERT_DOUBLE_WITHIN(relative * fabs(expected), expected, found);
}

static void rayleigh_damping_is_found(void) {
    const double pairs[][2] = {{0.7, 3e-5}, {1.2, 0}, {0, 8e-5}, {-0.2, 2e-4}};
    for (int i = 0; i < 4; ++i) {
        rayleigh(MODES, pairs[i][0], pairs[i][1]);
        TEST_ASSERT_EQUAL(OKID_OK, okid_pdc_fit(MODES, frequency, zeta, NULL, &pdc));
        TEST_ASSERT_DOUBLE_WITHIN(TOLERANCE(1e-14, 1e-6), pairs[i][0], pdc.alpha);
        TEST_ASSERT_DOUBLE_WITHIN(TOLERANCE(1e-18, 1e-10), pairs[i][1], pdc.beta);
        TEST_ASSERT_TRUE(pdc.residual < TOLERANCE(1e-14, 1e-6));
    }
}

// Trap 20: the unscaled columns of eq. (127) differ by omega^2, a condition of 1e4 to 1e5; scaled it is a few units. Both
// modes of a conjugate pair (the paper's sum to n_z) change nothing.
static void trap_20_columns_are_scaled_and_conjugates_do_not_matter(void) {
    double aa = 0, ab = 0, bb = 0;
    rayleigh(MODES, 0.7, 3e-5);
    for (int k = 0; k < MODES; ++k) {
        const double omega = 2 * pi * frequency[k], a = 1 / (2 * omega), b = omega / 2;
        aa += a * a;
        ab += a * b;
        bb += b * b;
        zeta[k] *= (okid_real_t)(1 + 0.1 * sin(3.0 * k)); // not proportional: the two fits must agree, not be perfect
    }
    const double mean = (aa + bb) / 2, half = sqrt((aa - bb) * (aa - bb) / 4 + ab * ab);
    const double smallest = (aa * bb - ab * ab) / (mean + half);
    TEST_ASSERT_TRUE(sqrt((mean + half) / smallest) > 1e4);
    TEST_ASSERT_EQUAL(OKID_OK, okid_pdc_fit(MODES, frequency, zeta, NULL, &pdc));
    TEST_ASSERT_TRUE(pdc.condition < 3);
    okid_real_t f2[2 * MODES], z2[2 * MODES];
    for (int k = 0; k < 2 * MODES; ++k) {
        f2[k] = frequency[k / 2];
        z2[k] = zeta[k / 2];
    }
    okid_pdc_t both;
    TEST_ASSERT_EQUAL(OKID_OK, okid_pdc_fit(2 * MODES, f2, z2, NULL, &both));
    assert_near(pdc.alpha, TOLERANCE(1e-13, 1e-6), both.alpha);
    assert_near(pdc.beta, TOLERANCE(1e-13, 1e-6), both.beta);
    assert_near(pdc.residual, TOLERANCE(1e-13, 1e-6), both.residual);
    TEST_ASSERT_TRUE(pdc.residual > 0.02 && pdc.residual < 0.1);
}

// The least-squares solution is where the gradient vanishes, with weights too.
static void the_fit_is_the_weighted_least_squares_solution(void) {
    rayleigh(MODES, 0.7, 3e-5);
    for (int k = 0; k < MODES; ++k) {
        zeta[k] *= (okid_real_t)(1 + 0.2 * cos(2.0 * k));
        weight[k] = (okid_real_t)(1 + 3 * (k % 3));
    }
    TEST_ASSERT_EQUAL(OKID_OK, okid_pdc_fit(MODES, frequency, zeta, weight, &pdc));
    double ga = 0, gb = 0, sa = 0, sb = 0;
    for (int k = 0; k < MODES; ++k) {
        const double omega = 2 * pi * frequency[k], a = 1 / (2 * omega), b = omega / 2;
        const double e = zeta[k] - (double)pdc.alpha * a - (double)pdc.beta * b;
        ga += weight[k] * a * e;
        gb += weight[k] * b * e;
        sa += weight[k] * a * fabs(e);
        sb += weight[k] * b * fabs(e);
    }
    TEST_ASSERT_TRUE(fabs(ga) < TOLERANCE(1e-12, 1e-5) * sa);
    TEST_ASSERT_TRUE(fabs(gb) < TOLERANCE(1e-12, 1e-5) * sb);
    for (int k = 2; k < MODES; ++k) weight[k] = 0; // two modes left: fitted exactly
    TEST_ASSERT_EQUAL(OKID_OK, okid_pdc_fit(MODES, frequency, zeta, weight, &pdc));
    TEST_ASSERT_TRUE(pdc.residual < TOLERANCE(1e-14, 1e-6));
    for (int k = 0; k < 2; ++k) {
        const double omega = 2 * pi * frequency[k];
        assert_near(zeta[k], TOLERANCE(1e-13, 1e-6), (double)pdc.alpha / (2 * omega) + (double)pdc.beta * omega / 2);
    }
}

static void one_mode_gives_the_right_matrix(void) {
    const okid_real_t M[] = {2}, K[] = {5000};
    const double omega = sqrt(2500.0);
    okid_real_t R[1];
    frequency[0] = frequency[1] = frequency[2] = (okid_real_t)(omega / (2 * pi));
    zeta[0] = zeta[1] = zeta[2] = (okid_real_t)0.015;
    for (int count = 1; count <= 3; count += 2) { // three modes of one frequency say no more than one
        TEST_ASSERT_EQUAL(OKID_OK, okid_pdc_fit(count, frequency, zeta, NULL, &pdc));
        TEST_ASSERT_EQUAL(OKID_OK, okid_pdc_damping(1, &pdc, M, K, R));
        assert_near(2 * 0.015 * omega * 2, TOLERANCE(1e-14, 1e-6), R[0]); // 2 zeta omega m
        assert_near((double)pdc.alpha, TOLERANCE(1e-12, 1e-5), (double)pdc.beta * omega * omega);
        TEST_ASSERT_TRUE(pdc.condition > TOLERANCE(1e14, 1e5));
    }
}

static void damping_matrix_of_the_structures(void) {
    for (int which = 1; which <= 3; ++which) {
        structure_t s;
        okid_real_t f[S_MAX], z[S_MAX], R[S_MAX * S_MAX];
        s_make(&s, which);
        const size_t bytes = okid_mechanics_memsize(s.n, 1);
        void* work = malloc(bytes);
        const okid_mechanics_t mechanics = {.n_x = s.n, .M = s.M, .R = s.R, .K = s.K};
        okid_modes_t modes = {.frequency_hz = f, .damping_ratio = z};
        TEST_ASSERT_EQUAL(OKID_OK, okid_mechanics_modes(&mechanics, &modes, work, bytes));
        TEST_ASSERT_EQUAL(s.n, modes.count);
        TEST_ASSERT_EQUAL(OKID_OK, okid_pdc_fit(modes.count, f, z, NULL, &pdc));
        TEST_ASSERT_EQUAL(OKID_OK, okid_pdc_damping(s.n, &pdc, s.M, s.K, R));
        assert_near(s.alpha, TOLERANCE(1e-11, 1e-2), pdc.alpha);
        assert_near(s.beta, TOLERANCE(1e-11, 1e-2), pdc.beta);
        TEST_ASSERT_TRUE(s_error(R, s.R, s.n * s.n) < TOLERANCE(1e-11, 1e-2));
        free(work);
    }
}

static void wrong_use_is_refused(void) {
    const okid_real_t one[] = {1};
    okid_real_t R[1];
    rayleigh(MODES, 0.7, 3e-5);
    TEST_ASSERT_EQUAL(OKID_ERR_NULL, okid_pdc_fit(MODES, NULL, zeta, NULL, &pdc));
    TEST_ASSERT_EQUAL(OKID_ERR_NULL, okid_pdc_fit(MODES, frequency, NULL, NULL, &pdc));
    TEST_ASSERT_EQUAL(OKID_ERR_NULL, okid_pdc_fit(MODES, frequency, zeta, NULL, NULL));
    TEST_ASSERT_EQUAL(OKID_ERR_DIM, okid_pdc_fit(0, frequency, zeta, NULL, &pdc));
    for (int k = 0; k < MODES; ++k) weight[k] = 0;
    TEST_ASSERT_EQUAL(OKID_ERR_DIM, okid_pdc_fit(MODES, frequency, zeta, weight, &pdc));
    weight[3] = -1;
    TEST_ASSERT_EQUAL(OKID_ERR_DIM, okid_pdc_fit(MODES, frequency, zeta, weight, &pdc));
    zeta[2] = (okid_real_t)NAN;
    TEST_ASSERT_EQUAL(OKID_ERR_DIM, okid_pdc_fit(MODES, frequency, zeta, NULL, &pdc));
    frequency[1] = 0;
    zeta[2] = (okid_real_t)0.01;
    TEST_ASSERT_EQUAL(OKID_ERR_DIM, okid_pdc_fit(MODES, frequency, zeta, NULL, &pdc));
    TEST_ASSERT_EQUAL(OKID_ERR_NULL, okid_pdc_damping(1, NULL, one, one, R));
    TEST_ASSERT_EQUAL(OKID_ERR_NULL, okid_pdc_damping(1, &pdc, one, NULL, R));
    TEST_ASSERT_EQUAL(OKID_ERR_DIM, okid_pdc_damping(0, &pdc, one, one, R));
}

int main(void) {
    UNITY_BEGIN();
    RUN_TEST(rayleigh_damping_is_found);
    RUN_TEST(trap_20_columns_are_scaled_and_conjugates_do_not_matter);
    RUN_TEST(the_fit_is_the_weighted_least_squares_solution);
    RUN_TEST(one_mode_gives_the_right_matrix);
    RUN_TEST(damping_matrix_of_the_structures);
    RUN_TEST(wrong_use_is_refused);
    return UNITY_END();
}
