// SPDX-License-Identifier: MIT
// From 16-bit codes to modes, as a board does it: chain W1 of docs/numerics.md (three masses, one force, three
// accelerometers), identified in the number type of the build and compared with its mechanics.
#include "modal_rig.h"
#include "tolerance.h"

#include <okid/okid.h>
#include <unity.h>

enum { DOF = 3, M = 1 + DOF, N = 10000, P = 40, LAST = 160, SEEDS = 5 };

// Relative. Without noise, 4 times the worst of the seeds on both backends: double sees the rounding of the codes, float adds
// 1e-7 to the place of a pole. With 1 % of noise both types stand under one and the same limit, the acceptance table of
// docs/numerics.md: float adds less than a tenth of what the noise does.
static const double quiet_frequency = TOLERANCE(4e-7, 3e-6), quiet_damping = TOLERANCE(8e-5, 4e-4), quiet_markov = 2e-5;
static const double noisy_frequency = 4.7e-5, noisy_damping = 6.5e-3, noisy_markov = 2.5e-3;

/// The chain as it is: modes, and each mode's exact step under a held force.
typedef struct chain_t {
    double dt, omega[DOF], zeta[DOF], phi[DOF][DOF]; // phi[k]: mode k, mass-normalised
    double step[DOF][2][2], push[DOF][2];
} chain_t;

static chain_t chain;

/// Eigenvectors of a symmetric 3 x 3 matrix by Jacobi rotations; v[k] belongs to values[k].
static void symmetric_modes(double a[DOF][DOF], double values[DOF], double v[DOF][DOF]) {
    for (int i = 0; i < DOF; ++i)
        for (int j = 0; j < DOF; ++j) v[i][j] = i == j;
    for (int sweep = 0; sweep < 30; ++sweep)
        for (int p = 0; p < DOF; ++p)
            for (int q = p + 1; q < DOF; ++q) {
                const double angle = 0.5 * atan2(2 * a[p][q], a[q][q] - a[p][p]), c = cos(angle), s = sin(angle);
                for (int k = 0; k < DOF; ++k) {
                    const double x = a[k][p], y = a[k][q];
                    a[k][p] = c * x - s * y;
                    a[k][q] = s * x + c * y;
                }
                for (int k = 0; k < DOF; ++k) {
                    const double x = a[p][k], y = a[q][k], vx = v[p][k], vy = v[q][k];
                    a[p][k] = c * x - s * y;
                    a[q][k] = s * x + c * y;
                    v[p][k] = c * vx - s * vy;
                    v[q][k] = s * vx + c * vy;
                }
            }
    for (int i = 0; i < DOF; ++i) values[i] = a[i][i];
}

static void make_chain(void) {
    const double mass[DOF] = {1.0, 0.8, 1.2}, spring[DOF + 1] = {3e4, 2e4, 2.5e4, 0};
    double a[DOF][DOF] = {{0}}, square[DOF], v[DOF][DOF];
    for (int i = 0; i < DOF; ++i) {
        a[i][i] = (spring[i] + spring[i + 1]) / mass[i];
        if (i > 0) a[i][i - 1] = a[i - 1][i] = -spring[i] / sqrt(mass[i] * mass[i - 1]);
    }
    symmetric_modes(a, square, v);
    for (int k = 0; k < DOF; ++k) { // ascending: count the smaller ones
        int place = 0;
        for (int j = 0; j < DOF; ++j) place += square[j] < square[k];
        chain.omega[place] = sqrt(square[k]);
        for (int i = 0; i < DOF; ++i) chain.phi[place][i] = v[k][i] / sqrt(mass[i]);
    }
    const double first = chain.omega[0], last = chain.omega[DOF - 1];
    chain.dt = 0.6 * 3.14159265358979323846 / last; // highest mode at 0.6 Nyquist
    for (int k = 0; k < DOF; ++k) {                 // R = alpha M + beta K with 1 % at the end modes
        const double w = chain.omega[k], beta = 0.02 / (first + last), alpha = beta * first * last;
        const double zeta = chain.zeta[k] = (alpha / w + beta * w) / 2, damped = w * sqrt(1 - zeta * zeta);
        const double fade = exp(-zeta * w * chain.dt), c = fade * cos(damped * chain.dt),
                     s = fade * sin(damped * chain.dt) / damped;
        chain.step[k][0][0] = c + zeta * w * s;
        chain.step[k][0][1] = s;
        chain.step[k][1][0] = -w * w * s;
        chain.step[k][1][1] = c - zeta * w * s;
        chain.push[k][0] = (1 - chain.step[k][0][0]) / (w * w) * chain.phi[k][0];
        chain.push[k][1] = -chain.step[k][1][0] / (w * w) * chain.phi[k][0];
    }
}

/// Accelerations under a force that is held over each sample, from rest; v is [u; y] in m x count.
static void simulate(double* v, int count) {
    double x[DOF][2] = {{0}};
    for (int n = 0; n < count; ++n) {
        double* sample = v + n * M;
        for (int i = 0; i < DOF; ++i) sample[1 + i] = 0;
        for (int k = 0; k < DOF; ++k) {
            const double w = chain.omega[k], q = x[k][0], rate = x[k][1];
            const double acceleration = chain.phi[k][0] * sample[0] - w * w * q - 2 * chain.zeta[k] * w * rate;
            for (int i = 0; i < DOF; ++i) sample[1 + i] += chain.phi[k][i] * acceleration;
            for (int r = 0; r < 2; ++r)
                x[k][r] = chain.step[k][r][0] * q + chain.step[k][r][1] * rate + chain.push[k][r] * sample[0];
        }
    }
}

/// The record of a seed as codes of +-32000 over the largest value of each channel; scale turns codes into units.
static void record_codes(double noise, uint64_t seed, int16_t* codes, double scale[M]) {
    double *v = calloc((size_t)N * M, sizeof *v), square[M] = {0}, largest[M] = {0};
    uint64_t state = seed * 2654435761u + 99;
    for (int n = 0; n < N; ++n) v[n * M] = rig_normal(&state);
    simulate(v, N);
    for (int i = 0; i < N * M; ++i) square[i % M] += v[i] * v[i];
    for (int i = 0; i < N * M; ++i) {
        if (i % M > 0) v[i] += noise * sqrt(square[i % M] / N) * rig_normal(&state);
        largest[i % M] = fmax(largest[i % M], fabs(v[i]));
    }
    for (int c = 0; c < M; ++c) scale[c] = largest[c] / 32000;
    for (int i = 0; i < N * M; ++i) codes[i] = (int16_t)lrint(v[i] / scale[i % M]);
    free(v);
}

/// Relative Frobenius distance of the identified Markov parameters from those of the chain.
static double markov_error(const okid_identified_t* model) {
    double v[(LAST + 1) * M] = {1}, top = 0, bottom = 0;
    simulate(v, LAST + 1);
    for (int n = 0; n <= LAST; ++n)
        for (int i = 0; i < DOF; ++i) {
            const double truth = v[n * M + 1 + i], error = model->markov[n * DOF + i] - truth;
            top += error * error;
            bottom += truth * truth;
        }
    return sqrt(top / bottom);
}

static void identify_codes(double noise, double frequency_limit, double damping_limit, double markov_limit) {
    const okid_accumulator_config_t a = {1, DOF, P, OKID_SAMPLE_INT16, 0, 0, 1.0, 0, 0};
    const okid_identify_config_t c = {1, DOF, P, 0, 0, 0, 1 / chain.dt, OKID_METHOD_OKID_ERA, OKID_DETREND_MEAN};
    const size_t bytes[2] = {okid_accumulator_memsize(&a), okid_identify_memsize(&c)};
    void* blocks[2] = {malloc(bytes[0]), malloc(bytes[1])};
    int16_t* codes = malloc(sizeof *codes * N * M);
    for (uint64_t seed = 1; seed <= SEEDS; ++seed) {
        okid_accumulator_t* accumulator;
        okid_identify_t* identifier;
        okid_identified_t model;
        double scale[M];
        record_codes(noise, seed, codes, scale);
        TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_create(&accumulator, &a, blocks[0], bytes[0]));
        TEST_ASSERT_EQUAL(OKID_OK, okid_identify_create(&identifier, &c, blocks[1], bytes[1]));
        okid_accumulator_set_units(accumulator, scale, NULL);
        TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_add_i16(accumulator, codes, N));
        TEST_ASSERT_GREATER_OR_EQUAL(0, okid_identify_run(identifier, accumulator, &model));
        TEST_ASSERT_EQUAL(DOF, model.mode_count);
        for (int k = 0; k < DOF; ++k) {
            const double f = chain.omega[k] / 6.283185307179586;
            TEST_ASSERT_DOUBLE_WITHIN(frequency_limit * f, f, model.frequency_hz[k]);
            TEST_ASSERT_DOUBLE_WITHIN(damping_limit * chain.zeta[k], chain.zeta[k], model.damping_ratio[k]);
        }
        TEST_ASSERT_DOUBLE_WITHIN(markov_limit, 0, markov_error(&model));
    }
    free(codes);
    free(blocks[0]);
    free(blocks[1]);
}

void setUp(void) { make_chain(); }
void tearDown(void) {}

static void codes_without_noise(void) { identify_codes(0, quiet_frequency, quiet_damping, quiet_markov); }
static void codes_with_one_percent_of_noise(void) {
    identify_codes(0.01, noisy_frequency, noisy_damping, noisy_markov);
}

int main(void) {
    UNITY_BEGIN();
    RUN_TEST(codes_without_noise);
    RUN_TEST(codes_with_one_percent_of_noise);
    return UNITY_END();
}
