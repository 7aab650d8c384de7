// SPDX-License-Identifier: MIT
// The gain that is held in each mode: that of the input that drives it hardest, by gain and by size of the input; of
// inputs that drive it alike the first. It leaves the refinement as it came, all others move.
#include "modal_rig.h"

#include <okid/okid.h>
#include <unity.h>

enum { NU = 2, NY = 2, NZ = 5, M = NU + NY, N = 3000, L = 500 };
static const double limit = 1e-9;

typedef struct system_t {
    okid_real_t A[NZ * NZ], B[NZ * NU], C[NY * NZ], D[NY * NU];
} system_t;

static double samples[N * M];
static okid_refined_t found;
static void *block, *sum_block, *room;

void setUp(void) {}
void tearDown(void) {
    free(block), free(sum_block), free(room);
    block = sum_block = room = NULL;
}

/// Two modes as rotations, one pole on the real axis. The second input has the gains of the first, turned, times
/// `share`.
static void make(double share, double off, system_t* out) {
    static const double pairs[2][2] = {{0.9, 0.6}, {0.85, 1.7}}, gains[2][2] = {{0.5, 0.25}, {-0.75, 1}};
    memset(out, 0, sizeof *out);
    for (int k = 0; k < 2; ++k) {
        const int i = 2 * k;
        out->A[i * (NZ + 1)] = out->A[(i + 1) * (NZ + 1)] = pairs[k][0] * (1 - 0.01 * off) * cos(pairs[k][1]);
        out->A[i * NZ + i + 1] = pairs[k][0] * sin(pairs[k][1]);
        out->A[(i + 1) * NZ + i] = -out->A[i * NZ + i + 1];
        out->B[i] = gains[k][0], out->B[i + 1] = gains[k][1];
        out->B[NZ + i] = -share * gains[k][1], out->B[NZ + i + 1] = share * gains[k][0];
    }
    out->A[NZ * NZ - 1] = 0.7 - 0.02 * off;
    out->B[NZ - 1] = 0.5;
    out->B[2 * NZ - 1] = -share * 0.5;
    uint64_t state = 21;
    for (int i = 0; i < NY * NZ; ++i) out->C[i] = rig_uniform(&state) + 0.3 + 0.05 * off * (i % 2);
    for (int i = 0; i < NY * NU; ++i) out->D[i] = rig_uniform(&state) + 0.1 * off;
}

static okid_model_t view(const system_t* s) {
    return (okid_model_t){.n_u = NU, .n_y = NY, .n_z = NZ, .A = s->A, .B = s->B, .C = s->C, .D = s->D};
}

/// Inputs of -1 and 1, times `size` the second, so that their mean squares are equal to the bit; the system answers
/// from rest.
static void record(const system_t* s, double size) {
    uint64_t state = 4;
    double x[NZ] = {0}, next[NZ];
    for (int n = 0; n < N; ++n) {
        double* v = samples + n * M;
        v[0] = rig_uniform(&state) < 0.5 ? -1 : 1;
        v[1] = rig_uniform(&state) < 0.5 ? -size : size;
        for (int o = 0; o < NY; ++o) {
            v[NU + o] = s->D[o] * v[0] + s->D[NY + o] * v[1];
            for (int i = 0; i < NZ; ++i) v[NU + o] += s->C[i * NY + o] * x[i];
        }
        for (int i = 0; i < NZ; ++i) {
            next[i] = s->B[i] * v[0] + s->B[NZ + i] * v[1];
            for (int l = 0; l < NZ; ++l) next[i] += s->A[l * NZ + i] * x[l];
        }
        memcpy(x, next, sizeof x);
    }
}

static void refine(const system_t* start, int from_sums) {
    const okid_refine_config_t config = {NU, NY, NZ, from_sums ? 0 : 1, 0, 0, 0};
    const size_t bytes = okid_refine_memsize(&config);
    const okid_model_t model = view(start);
    const int32_t count = N;
    okid_refine_t* self = NULL;
    tearDown();
    block = malloc(bytes);
    TEST_ASSERT_EQUAL(OKID_OK, okid_refine_create(&self, &config, block, bytes));
    if (!from_sums) {
        TEST_ASSERT_GREATER_OR_EQUAL(0, okid_refine_run(self, &model, &count, samples, &found));
        return;
    }
    const okid_correlation_config_t lagged = okid_correlation_defaults(NU, NY, L);
    const size_t sum_bytes = okid_correlation_memsize(&lagged);
    okid_correlation_t* sums = NULL;
    okid_correlation_sums_t made;
    sum_block = malloc(sum_bytes);
    TEST_ASSERT_EQUAL(OKID_OK, okid_correlation_create(&sums, &lagged, sum_block, sum_bytes));
    TEST_ASSERT_EQUAL(OKID_OK, okid_correlation_add(sums, samples, N));
    const size_t room_bytes = okid_correlation_sums_memsize(sums);
    room = malloc(room_bytes);
    TEST_ASSERT_EQUAL(OKID_OK, okid_correlation_sums(sums, OKID_DETREND_NONE, &made, room, room_bytes));
    TEST_ASSERT_GREATER_OR_EQUAL(0, okid_refine_from_correlation(self, &model, &made, &found));
}

/// Did the gains of this input stay, mode for mode, and those of the other one move?
static void held(const system_t* start, int input) {
    for (int k = 0; k < NZ; k += 2) {
        double moved = 0;
        for (int i = k; i < k + 2 && i < NZ; ++i) {
            TEST_ASSERT_DOUBLE_WITHIN(limit, start->B[input * NZ + i], found.B[input * NZ + i]);
            moved = fmax(moved, fabs(start->B[(1 - input) * NZ + i] - found.B[(1 - input) * NZ + i]));
        }
        TEST_ASSERT_TRUE(moved > 1e-3);
    }
}

/// The truth has gains that the start has not, in both columns.
static void refined_from(double share, double size, int from_sums, system_t* start) {
    system_t truth;
    make(share, 0, &truth);
    make(share, 1, start);
    for (int i = 0; i < NZ; ++i) truth.B[i] += 0.03 * (1 + i % 3), truth.B[NZ + i] -= 0.05 * (1 + i % 2);
    record(&truth, size);
    refine(start, from_sums);
    TEST_ASSERT_TRUE(found.iterations > 0 && found.gain > 100);
}

static void of_inputs_alike_the_first_is_held(void) {
    for (int from_sums = 0; from_sums < 2; ++from_sums) {
        system_t start;
        refined_from(1, 1, from_sums, &start);
        held(&start, 0);
    }
}

static void the_harder_driving_input_is_held(void) {
    static const struct {
        double share, size;
        int input;
    } cases[] = {{0.9, 1, 0}, {1.1, 1, 1}, {1, 0.9, 0}, {1, 1.1, 1}, {0.5, 3, 1}, {0.5, 1.5, 0}, {3, 0.5, 1}};
    for (size_t k = 0; k < sizeof cases / sizeof *cases; ++k)
        for (int from_sums = 0; from_sums < 2; ++from_sums) {
            system_t start;
            refined_from(cases[k].share, cases[k].size, from_sums, &start);
            held(&start, cases[k].input);
        }
}

int main(void) {
    UNITY_BEGIN();
    RUN_TEST(of_inputs_alike_the_first_is_held);
    RUN_TEST(the_harder_driving_input_is_held);
    return UNITY_END();
}
