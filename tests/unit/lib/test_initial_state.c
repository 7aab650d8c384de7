// SPDX-License-Identifier: MIT
// okid_model_initial_state() beside the least squares written out, for records that no initial state fits: samples and
// forces missing, records shorter and longer than a block, models of few and of many states.
#include <math.h>
#include <okid/model.h>
#include <stdlib.h>
#include <string.h>
#include <unity.h>

enum { MOST_Z = 16, MOST_Y = 3, MOST_U = 2, MOST = 500 };

static okid_real_t A[MOST_Z * MOST_Z], B[MOST_Z * MOST_U], C[MOST_Y * MOST_Z], D[MOST_Y * MOST_U];
static okid_real_t u[MOST * MOST_U], y[MOST * MOST_Y], found[MOST_Z];
static double expected[MOST_Z];
static uint64_t seed;

void setUp(void) { seed = 3; }
void tearDown(void) {}

static double draw(void) {
    seed = seed * 6364136223846793005u + 1442695040888963407u;
    return (double)(seed >> 11) / 4503599627370496.0 - 1;
}

/// Pairs of poles of radius 0.97 and more, mixed by shears; outputs of noise.
static void make(int n_u, int n_y, int n_z) {
    memset(A, 0, sizeof A);
    for (int i = 0; i < n_z; i += 2) {
        const double radius = 0.97 + 0.02 * i / n_z, angle = 0.3 + 2.4 * i / n_z;
        A[i * n_z + i] = (okid_real_t)(radius * (i + 1 < n_z ? cos(angle) : 1));
        if (i + 1 >= n_z) continue;
        A[(i + 1) * n_z + i + 1] = A[i * n_z + i];
        A[i * n_z + i + 1] = (okid_real_t)(radius * sin(angle));
        A[(i + 1) * n_z + i] = -A[i * n_z + i + 1];
    }
    for (int i = 0; i < n_z * n_u; ++i) B[i] = (okid_real_t)draw();
    for (int i = 0; i < n_z * n_y; ++i) C[i] = (okid_real_t)draw();
    for (int i = 0; i < n_y * n_u; ++i) D[i] = (okid_real_t)draw();
    for (int i = 0; i < MOST * n_u; ++i) u[i] = (okid_real_t)draw();
    for (int i = 0; i < MOST * n_y; ++i) y[i] = (okid_real_t)(5 * draw());
}

/// Least squares of y - y_forced = C A^n x0 over the samples whose outputs are all there.
static void written_out(int n_u, int n_y, int n_z, int count) {
    double x[MOST_Z] = {0}, next[MOST_Z], seen[MOST_Y * MOST_Z], more[MOST_Y * MOST_Z];
    double normal[MOST_Z * MOST_Z] = {0}, right[MOST_Z] = {0};
    for (int i = 0; i < n_y * n_z; ++i) seen[i] = C[i];
    for (int n = 0; n < count; ++n) {
        double left[MOST_Y], force[MOST_U];
        int whole = 1;
        for (int j = 0; j < n_u; ++j) force[j] = isfinite(u[n * n_u + j]) ? u[n * n_u + j] : 0;
        for (int o = 0; o < n_y; ++o) {
            left[o] = y[n * n_y + o];
            for (int i = 0; i < n_z; ++i) left[o] -= C[i * n_y + o] * x[i];
            for (int j = 0; j < n_u; ++j) left[o] -= D[j * n_y + o] * force[j];
            whole &= isfinite(left[o]) != 0;
        }
        for (int i = 0; i < n_z && whole; ++i)
            for (int o = 0; o < n_y; ++o) {
                right[i] += seen[i * n_y + o] * left[o];
                for (int j = 0; j < n_z; ++j) normal[j * n_z + i] += seen[i * n_y + o] * seen[j * n_y + o];
            }
        for (int i = 0; i < n_z; ++i) {
            next[i] = 0;
            for (int j = 0; j < n_z; ++j) next[i] += A[j * n_z + i] * x[j];
            for (int j = 0; j < n_u; ++j) next[i] += B[j * n_z + i] * force[j];
            for (int o = 0; o < n_y; ++o) {
                more[i * n_y + o] = 0;
                for (int j = 0; j < n_z; ++j) more[i * n_y + o] += seen[j * n_y + o] * A[i * n_z + j];
            }
        }
        memcpy(x, next, sizeof x);
        memcpy(seen, more, sizeof seen);
    }
    for (int k = 0; k < n_z; ++k) // Gauss and Jordan: the matrix is positive definite
        for (int i = 0; i < n_z; ++i) {
            if (i == k) continue;
            const double f = normal[k * n_z + i] / normal[k * n_z + k];
            for (int j = 0; j < n_z; ++j) normal[j * n_z + i] -= f * normal[j * n_z + k];
            right[i] -= f * right[k];
        }
    for (int i = 0; i < n_z; ++i) expected[i] = right[i] / normal[i * n_z + i];
}

static void both_ways(int n_u, int n_y, int n_z, int count) {
    const okid_model_t model = {n_u, n_y, n_z, A, B, C, D, NULL};
    okid_real_t* work = malloc(sizeof *work * okid_model_workspace(&model));
    TEST_ASSERT_EQUAL(OKID_OK, okid_model_initial_state(&model, u, y, (size_t)count, found, work));
    free(work);
    written_out(n_u, n_y, n_z, count);
    double size = 0;
    for (int i = 0; i < n_z; ++i) size = fmax(size, fabs(expected[i]));
    for (int i = 0; i < n_z; ++i) TEST_ASSERT_DOUBLE_WITHIN(1e-7 * size, expected[i], found[i]);
}

static void least_squares_of_noise(void) {
    for (int n_z = 1; n_z <= MOST_Z; n_z += n_z < 11 ? 3 : 1)
        for (int n_y = 1; n_y <= MOST_Y; ++n_y)
            for (int n_u = 0; n_u <= MOST_U; ++n_u) {
                make(n_u, n_y, n_z);
                const int counts[] = {2 * n_z, 31, 32, 33, 127, 128, 129, MOST};
                for (size_t k = 0; k < sizeof counts / sizeof *counts; ++k)
                    if (counts[k] >= 2 * n_z) both_ways(n_u, n_y, n_z, counts[k]);
            }
}

static void missing_outputs_and_forces(void) {
    for (int n_z = 2; n_z <= MOST_Z; n_z += 14) {
        make(2, 2, n_z);
        for (int n = 3; n < MOST; n += 37) y[2 * n + n % 2] = (okid_real_t)NAN;
        for (int n = 0; n < 3; ++n) y[2 * n] = (okid_real_t)INFINITY; // the record begins with some
        for (int n = 5; n < MOST; n += 41) u[2 * n + n % 2] = (okid_real_t)NAN;
        both_ways(2, 2, n_z, MOST);
        both_ways(2, 2, n_z, 100);
    }
}

// What an initial state leaves behind dies out: a record goes on as it likes from there.
static void what_comes_after_the_state_has_died_out_changes_nothing(void) {
    make(1, 1, 2);
    for (int i = 0; i < 4; ++i) A[i] *= (okid_real_t)0.5; // 0.5^128: below any rounding
    okid_real_t short_record[2];
    const okid_model_t model = {1, 1, 2, A, B, C, D, NULL};
    okid_real_t* work = malloc(sizeof *work * okid_model_workspace(&model));
    TEST_ASSERT_EQUAL(OKID_OK, okid_model_initial_state(&model, u, y, 128, short_record, work));
    TEST_ASSERT_EQUAL(OKID_OK, okid_model_initial_state(&model, u, y, MOST, found, work));
    TEST_ASSERT_EQUAL_MEMORY(short_record, found, sizeof short_record);
    free(work);
}

static okid_status_t of(int n_z) {
    const okid_model_t model = {1, 1, n_z, A, B, C, D, NULL};
    okid_real_t* work = malloc(sizeof *work * okid_model_workspace(&model));
    const okid_status_t status = okid_model_initial_state(&model, u, y, MOST, found, work);
    free(work);
    return status;
}

static void a_state_that_outgrows_all_numbers_is_refused(void) {
    for (int n_z = 1; n_z <= 3; ++n_z) {
        make(1, 1, n_z);
        TEST_ASSERT_EQUAL(OKID_OK, of(n_z));
        A[0] = (okid_real_t)1e30; // within a block
        TEST_ASSERT_EQUAL(OKID_ERR_NUMERIC, of(n_z));
    }
}

static void a_gain_of_kalman_changes_nothing(void) {
    okid_real_t gain[6], plain[6];
    for (int i = 0; i < 6; ++i) gain[i] = (okid_real_t)draw();
    make(1, 1, 6);
    y[7] = (okid_real_t)NAN;
    TEST_ASSERT_EQUAL(OKID_OK, of(6));
    memcpy(plain, found, sizeof plain);
    const okid_model_t model = {1, 1, 6, A, B, C, D, gain};
    okid_real_t* work = malloc(sizeof *work * okid_model_workspace(&model));
    TEST_ASSERT_EQUAL(OKID_OK, okid_model_initial_state(&model, u, y, MOST, found, work));
    TEST_ASSERT_EQUAL_MEMORY(plain, found, sizeof plain);
    free(work);
}

// A state that stays: the mean of what the force does not explain, over the whole record.
static void the_initial_state_of_a_constant_is_the_mean(void) {
    double sum = 0;
    make(1, 1, 1);
    A[0] = C[0] = 1;
    B[0] = D[0] = 0;
    for (int n = 0; n < MOST; ++n) sum += y[n];
    TEST_ASSERT_EQUAL(OKID_OK, of(1));
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, sum / MOST, found[0]);
}

static void a_record_without_outputs_says_nothing(void) {
    make(1, 1, 2);
    for (int n = 0; n < MOST; ++n) y[n] = (okid_real_t)NAN;
    TEST_ASSERT_EQUAL(OKID_OK, of(2));
    for (int i = 0; i < 2; ++i) TEST_ASSERT_EQUAL_DOUBLE(0, found[i]);
}

int main(void) {
    UNITY_BEGIN();
    RUN_TEST(least_squares_of_noise);
    RUN_TEST(missing_outputs_and_forces);
    RUN_TEST(what_comes_after_the_state_has_died_out_changes_nothing);
    RUN_TEST(a_state_that_outgrows_all_numbers_is_refused);
    RUN_TEST(a_gain_of_kalman_changes_nothing);
    RUN_TEST(the_initial_state_of_a_constant_is_the_mean);
    RUN_TEST(a_record_without_outputs_says_nothing);
    return UNITY_END();
}
