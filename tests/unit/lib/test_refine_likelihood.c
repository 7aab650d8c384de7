// SPDX-License-Identifier: MIT
// Where a refinement ends, by simulation: no entry of A, B, C or D can be moved to a larger likelihood. The gain of the
// refinement from sums is that of the rows in them, to which samples older than the lags mean nothing.
#include "modal_rig.h"

#include <okid/okid.h>
#include <unity.h>

enum { NU = 3, NY = 2, NZ = 5, M = NU + NY, N = 2500, L = 150, ENTRIES = NZ * NZ + NZ * NU + NY * NZ + NY * NU };

/// A, B, C and D, one behind the other.
typedef struct system_t {
    okid_real_t A[NZ * NZ], B[NZ * NU], C[NY * NZ], D[NY * NU];
} system_t;

static double samples[N * M], residual[N * NY];
static system_t truth;
static void *block, *sum_block, *room;

void tearDown(void) {
    free(block), free(sum_block), free(room);
    block = sum_block = room = NULL;
}

static void make(double off, system_t* out) {
    static const double pairs[2][2] = {{0.964, 0.6}, {0.96, 1.7}}; // after L lags 0.4 % are left
    uint64_t state = 21;
    memset(out, 0, sizeof *out);
    for (int k = 0; k < 2; ++k) {
        const int i = 2 * k;
        out->A[i * (NZ + 1)] = out->A[(i + 1) * (NZ + 1)] = (1 - 0.01 * off) * pairs[k][0] * cos(pairs[k][1]);
        out->A[i * NZ + i + 1] = pairs[k][0] * sin(pairs[k][1]);
        out->A[(i + 1) * NZ + i] = -out->A[i * NZ + i + 1];
    }
    out->A[NZ * NZ - 1] = 0.7 - 0.02 * off;
    for (int i = 0; i < NZ * NU; ++i) out->B[i] = (rig_uniform(&state) + 0.2) * (1 + 0.05 * off * (i % 3));
    for (int i = 0; i < NY * NZ; ++i) out->C[i] = rig_uniform(&state) - 0.4 + 0.05 * off * (i % 2);
    for (int i = 0; i < NY * NU; ++i) out->D[i] = rig_uniform(&state) + 0.1 * off;
}

static int remembered; ///< samples that a state remembers; 0: all of them

/// Residuals of a simulation from this state.
static void simulate(const system_t* s, const okid_real_t* x0) {
    double x[NZ] = {0}, next[NZ], old[NZ * NU]; // A^L B
    for (int i = 0; x0 != NULL && i < NZ; ++i) x[i] = (double)x0[i];
    for (int j = 0; j < NU; ++j) {
        double* power = old + j * NZ;
        for (int i = 0; i < NZ; ++i) power[i] = (double)s->B[j * NZ + i];
        for (int k = 0; k < remembered; ++k) {
            memcpy(next, power, sizeof next);
            for (int i = 0; i < NZ; ++i) {
                power[i] = 0;
                for (int l = 0; l < NZ; ++l) power[i] += (double)s->A[l * NZ + i] * next[l];
            }
        }
    }
    for (int n = 0; n < N; ++n) {
        const double* v = samples + n * M;
        for (int o = 0; o < NY; ++o) {
            double y = 0;
            for (int j = 0; j < NU; ++j) y += (double)s->D[j * NY + o] * v[j];
            for (int i = 0; i < NZ; ++i) y += (double)s->C[i * NY + o] * x[i];
            residual[n * NY + o] = v[NU + o] - y;
        }
        for (int i = 0; i < NZ; ++i) {
            next[i] = 0;
            for (int j = 0; j < NU; ++j) next[i] += (double)s->B[j * NZ + i] * v[j];
            for (int l = 0; l < NZ; ++l) next[i] += (double)s->A[l * NZ + i] * x[l];
            for (int j = 0; remembered > 0 && n >= remembered && j < NU; ++j)
                next[i] -= old[j * NZ + i] * samples[(n - remembered) * M + j];
        }
        memcpy(x, next, sizeof x);
    }
}

/// Of the rows from `first` on, less their means where an offset is unknown; the mean squares go to `squares`.
static double likelihood(const system_t* s, const okid_real_t* x0, int first, int offset, double* squares) {
    double sum = 0;
    simulate(s, x0);
    for (int o = 0; o < NY; ++o) {
        double mean = 0, square = 0;
        for (int n = first; n < N; ++n) mean += residual[n * NY + o] / (N - first);
        for (int n = first; n < N; ++n) square += pow(residual[n * NY + o] - (offset ? mean : 0), 2) / (N - first);
        sum -= (N - first) / 2.0 * log(square);
        squares[o] = square;
    }
    return sum;
}

void setUp(void) {
    uint64_t state = 4;
    remembered = 0;
    make(0, &truth);
    memset(samples, 0, sizeof samples);
    for (int n = 0; n < N; ++n) {
        samples[n * M] = rig_normal(&state);
        samples[n * M + 1] = 0.5 * samples[n * M] + 2 * rig_normal(&state);
        samples[n * M + 2] = rig_normal(&state) + (n > 0 ? 0.6 * samples[(n - 1) * M + 1] : 0); // of several instants
    }
    simulate(&truth, NULL);
    for (int n = 0; n < N; ++n)
        for (int o = 0; o < NY; ++o)
            samples[n * M + NU + o] = -residual[n * NY + o] + (0.2 + 0.1 * o) * rig_normal(&state);
}

/// Constants in every channel, as a sensor adds them.
static void shift(void) {
    for (int n = 0; n < N; ++n)
        for (int c = 0; c < M; ++c) samples[n * M + c] += 0.7 * (c + 1);
}

static void is_a_maximum(const okid_refined_t* found, int first, int offset) {
    system_t at;
    double squares[NY], others[NY];
    memcpy(at.A, found->A, sizeof at.A);
    memcpy(at.B, found->B, sizeof at.B);
    memcpy(at.C, found->C, sizeof at.C);
    memcpy(at.D, found->D, sizeof at.D);
    okid_real_t* const entries = at.A; // all of them
    TEST_ASSERT_EQUAL(sizeof at, ENTRIES * sizeof *entries);
    const double best = likelihood(&at, found->x0, first, offset, squares);
    int falls = 0;
    for (int k = 0; k < ENTRIES; ++k)
        for (double step = 1e-4; step < 0.05; step *= 4)
            for (int sign = -1; sign <= 1; sign += 2) {
                const okid_real_t kept = entries[k];
                entries[k] += (okid_real_t)(sign * step);
                const double other = likelihood(&at, found->x0, first, offset, others);
                entries[k] = kept;
                TEST_ASSERT_TRUE(other < best + 2e-3); // a further step promises a thousandth at most
                falls += other < best - 1;
            }
    TEST_ASSERT_GREATER_THAN(ENTRIES, falls);
    const double unknowns = (NZ * (NU + NY + (first == 0)) + NY * NU + (first == 0 && offset ? NY : 0)) / (double)NY;
    for (int o = 0; o < NY; ++o)
        TEST_ASSERT_DOUBLE_WITHIN(
            2e-3, 1, (double)found->noise_std[o] / sqrt(squares[o] * (N - first) / (N - first - unknowns)));
}

static void from_a_record(int offset) {
    const okid_refine_config_t config = {NU, NY, NZ, 1, 0, 0, offset};
    const size_t bytes = okid_refine_memsize(&config);
    const int32_t count = N;
    okid_refine_t* self = NULL;
    okid_refined_t found;
    system_t rough;
    make(1, &rough);
    const okid_model_t start = {
        .n_u = NU, .n_y = NY, .n_z = NZ, .A = rough.A, .B = rough.B, .C = rough.C, .D = rough.D};
    tearDown();
    block = malloc(bytes);
    TEST_ASSERT_EQUAL(OKID_OK, okid_refine_create(&self, &config, block, bytes));
    TEST_ASSERT_EQUAL(OKID_OK, okid_refine_run(self, &start, &count, samples, &found));
    TEST_ASSERT_EQUAL(1, found.converged);
    is_a_maximum(&found, 0, offset);
}

static void from_sums(okid_detrend_t detrend) {
    const okid_refine_config_t config = {NU, NY, NZ, 0, 0, 0, 0};
    const okid_correlation_config_t lagged = okid_correlation_defaults(NU, NY, L);
    const size_t bytes = okid_refine_memsize(&config), sum_bytes = okid_correlation_memsize(&lagged);
    okid_refine_t* self = NULL;
    okid_correlation_t* sums = NULL;
    okid_correlation_sums_t made;
    okid_refined_t found;
    system_t rough, best;
    double squares[NY];
    make(1, &rough);
    const okid_model_t start = {
        .n_u = NU, .n_y = NY, .n_z = NZ, .A = rough.A, .B = rough.B, .C = rough.C, .D = rough.D};
    tearDown();
    block = malloc(bytes), sum_block = malloc(sum_bytes);
    TEST_ASSERT_EQUAL(OKID_OK, okid_correlation_create(&sums, &lagged, sum_block, sum_bytes));
    TEST_ASSERT_EQUAL(OKID_OK, okid_correlation_add(sums, samples, N));
    const size_t room_bytes = okid_correlation_sums_memsize(sums);
    room = malloc(room_bytes);
    TEST_ASSERT_EQUAL(OKID_OK, okid_correlation_sums(sums, detrend, &made, room, room_bytes));
    TEST_ASSERT_EQUAL(OKID_OK, okid_refine_create(&self, &config, block, bytes));
    TEST_ASSERT_EQUAL(OKID_OK, okid_refine_from_correlation(self, &start, &made, &found));
    TEST_ASSERT_EQUAL(1, found.converged);
    const int first = N - (int)found.samples, offset = detrend == OKID_DETREND_MEAN;
    TEST_ASSERT_EQUAL(L, first);
    remembered = L;
    is_a_maximum(&found, first, offset);
    memcpy(best.A, found.A, sizeof best.A);
    memcpy(best.B, found.B, sizeof best.B);
    memcpy(best.C, found.C, sizeof best.C);
    memcpy(best.D, found.D, sizeof best.D);
    const double before = likelihood(&rough, NULL, first, offset, squares),
                 after = likelihood(&best, NULL, first, offset, squares);
    TEST_ASSERT_TRUE(after - before > 100);
    TEST_ASSERT_DOUBLE_WITHIN(1e-7 * (after - before), after - before, found.gain);
    remembered = 0;
}

static void a_record_ends_at_a_maximum(void) {
    from_a_record(0);
    from_a_record(1);
    shift();
    from_a_record(1);
}

static void sums_end_at_a_maximum_of_their_rows(void) {
    from_sums(OKID_DETREND_NONE);
    shift();
    from_sums(OKID_DETREND_MEAN);
}

int main(void) {
    UNITY_BEGIN();
    RUN_TEST(a_record_ends_at_a_maximum);
    RUN_TEST(sums_end_at_a_maximum_of_their_rows);
    return UNITY_END();
}
