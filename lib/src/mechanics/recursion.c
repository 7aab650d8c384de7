// SPDX-License-Identifier: MIT
// PURPOSE    what goes from sample to sample along a record, one source for every instruction set
// METHOD     follow: one product a sample, [estimate; next state] = M [u; y; x], its columns summed in two chains so that
//            additions do not wait for each other; simulation and prediction side by side. filters: modes lie across lanes, and
//            stay with the sums of a tile of channels in registers over all samples of a call
// NUMERICS   plain recursions; the predictor is A - K C as one matrix
// WORKSPACE  none
#include "recursion.h"
#include "accumulate/isa.h"

#include <string.h>

#define FOLLOW OKID_FOR_ISA(okid_follow_)
#define FILTERS OKID_FOR_ISA(okid_filters_)

#if defined(__AVX512F__)
#define CHANNELS 8
enum { LANES = 8, VECTORS = 4 };
#elif defined(__AVX2__)
#define CHANNELS 4
enum { LANES = 4, VECTORS = 4 };
#else
#define CHANNELS 4
enum { LANES = 2, VECTORS = 4 };
#endif
typedef double lanes_t __attribute__((vector_size(LANES * sizeof(double))));

static inline lanes_t load(const double* p) {
    lanes_t v;
    memcpy(&v, p, sizeof v);
    return v;
}
static inline void store(double* p, lanes_t v) { memcpy(p, &v, sizeof v); }

/// `vectors` vectors of rows of M [v; x]: v has `given` numbers from column 0 on, x has n_z from column `from` on.
static inline __attribute__((always_inline)) void strip(const double* M, size_t ld, const double* v, size_t given,
                                                        const double* x, size_t from, size_t n_z, double* out,
                                                        const int vectors) {
    lanes_t even[VECTORS] = {{0}}, odd[VECTORS] = {{0}};
    for (size_t c = 0; c < given; ++c)
#pragma GCC unroll 4
        for (int k = 0; k < vectors; ++k) odd[k] += v[c] * load(M + c * ld + (size_t)(k * LANES));
    const double* at = M + from * ld;
    size_t c = 0;
    for (; c + 1 < n_z; c += 2, at += 2 * ld)
#pragma GCC unroll 4
        for (int k = 0; k < vectors; ++k) {
            even[k] += x[c] * load(at + k * LANES);
            odd[k] += x[c + 1] * load(at + ld + k * LANES);
        }
    for (int k = 0; c < n_z && k < vectors; ++k) even[k] += x[c] * load(at + k * LANES);
#pragma GCC unroll 4
    for (int k = 0; k < vectors; ++k) store(out + k * LANES, even[k] + odd[k]);
}

static inline __attribute__((always_inline)) void product(const okid_follow_t* f, const double* M, const double* v,
                                                          size_t given, const double* x, double* out) {
    const size_t from = f->n_u + f->n_y;
    for (size_t r = 0; r < f->ld; r += VECTORS * LANES) switch ((f->ld - r) / LANES) {
        case 1: strip(M + r, f->ld, v, given, x, from, f->n_z, out + r, 1); break;
        case 2: strip(M + r, f->ld, v, given, x, from, f->n_z, out + r, 2); break;
        case 3: strip(M + r, f->ld, v, given, x, from, f->n_z, out + r, 3); break;
        default: strip(M + r, f->ld, v, given, x, from, f->n_z, out + r, VECTORS); break;
        }
}

static int all_finite(const double* v, size_t count) {
    double sum = 0;
    for (size_t i = 0; i < count; ++i) sum += v[i] * 0.0;
    return sum == 0;
}

okid_follow_fn FOLLOW;
void FOLLOW(const okid_follow_t* self, const double* rows, size_t count) {
    const okid_follow_t f = *self;
    const size_t m = f.n_u + f.n_y;
    const int whole = all_finite(rows, count * m);
    double *simulated = f.simulated, *predicted = f.predicted;
    double *next_simulated = simulated + f.ld, *next_predicted = predicted + f.ld;
    double *left = f.sums, *ahead = left + f.n_y, *sum = ahead + f.n_y, *square = sum + f.n_y, *known = square + f.n_y;
    for (size_t n = 0; n < count; ++n, rows += m) {
        const double* y = rows + f.n_u;
        product(&f, f.simulator, rows, f.n_u, simulated + f.n_y, next_simulated);
        const int corrects = whole || all_finite(y, f.n_y);
        if (!f.predictor)
            memcpy(next_predicted, next_simulated, f.ld * sizeof *predicted);
        else
            product(&f, corrects ? f.predictor : f.simulator, rows, corrects ? m : f.n_u, predicted + f.n_y,
                    next_predicted);
        for (size_t o = 0; f.errors && o < f.n_y; ++o) f.errors[n * f.n_y + o] = y[o] - next_simulated[o];
        for (size_t o = 0; o < f.n_y; ++o) {
            if (!corrects && y[o] != y[o]) continue;
            const double simulation = y[o] - next_simulated[o], prediction = y[o] - next_predicted[o];
            left[o] += simulation * simulation;
            ahead[o] += prediction * prediction;
            sum[o] += y[o];
            square[o] += y[o] * y[o];
            known[o] += 1;
        }
        double* swap = simulated;
        simulated = next_simulated, next_simulated = swap;
        swap = predicted;
        predicted = next_predicted, next_predicted = swap;
    }
    if (simulated != f.simulated) memcpy(f.simulated, simulated, f.ld * sizeof *simulated);
    if (predicted != f.predicted) memcpy(f.predicted, predicted, f.ld * sizeof *predicted);
}

/// The states of lane k on, times `channels` numbers of a row from `first` on; `last`: they are left behind where they end.
static inline __attribute__((always_inline)) void filter_tile(const okid_filters_t* f, const double* rows, size_t count,
                                                              size_t k, size_t first, int last, const int channels) {
    const size_t n_u = f->n_u, m = f->m, states = f->states;
    const double* drive = f->drive + k;
    const lanes_t wr = load(f->w_re + k), wi = load(f->w_im + k);
    lanes_t a = load(f->state + k), b = load(f->state + states + k), re[CHANNELS] = {{0}}, im[CHANNELS] = {{0}};
    for (size_t n = 0; n < count; ++n, rows += m) {
#pragma GCC unroll 8
        for (int c = 0; c < channels; ++c) {
            const double v = rows[first + (size_t)c];
            re[c] += v * a;
            im[c] += v * b;
        }
        lanes_t driven = {0};
        for (size_t c = 0; c < n_u; ++c) driven += rows[c] * load(drive + c * states);
        const lanes_t next = wr * a + (driven - wi * b);
        b = wr * b + wi * a;
        a = next;
    }
    double* to = f->sums + first * (n_u + 2 * states) + n_u + k;
    for (int c = 0; c < channels; ++c, to += n_u + 2 * states) {
        store(to, load(to) + re[c]);
        store(to + states, load(to + states) + im[c]);
    }
    if (!last) return;
    store(f->state + k, a);
    store(f->state + states + k, b);
}

static void filter_tiles(const okid_filters_t* f, const double* rows, size_t count, size_t k, size_t first, int last,
                         int channels) {
    switch (channels) {
    case 1: filter_tile(f, rows, count, k, first, last, 1); break;
    case 2: filter_tile(f, rows, count, k, first, last, 2); break;
    case 3: filter_tile(f, rows, count, k, first, last, 3); break;
    case 4: filter_tile(f, rows, count, k, first, last, 4); break;
#if CHANNELS > 4
    case 5: filter_tile(f, rows, count, k, first, last, 5); break;
    case 6: filter_tile(f, rows, count, k, first, last, 6); break;
    case 7: filter_tile(f, rows, count, k, first, last, 7); break;
#endif
    default: filter_tile(f, rows, count, k, first, last, CHANNELS); break;
    }
}

typedef double four_t __attribute__((vector_size(4 * sizeof(double))));

/// An input times 4 numbers of a row from `first` on, in four sums that do not wait for each other.
static void input_tile(const okid_filters_t* f, const double* rows, size_t count, size_t input, size_t first) {
    four_t sums[4] = {{0}};
    size_t n = 0;
    for (; n + 4 <= count; n += 4)
#pragma GCC unroll 4
        for (size_t k = 0; k < 4; ++k) {
            const double* row = rows + (n + k) * f->m;
            four_t v;
            memcpy(&v, row + first, sizeof v);
            sums[k] += row[input] * v;
        }
    for (; n < count; ++n)
        for (size_t k = 0; k < 4; ++k) sums[0][k] += rows[n * f->m + input] * rows[n * f->m + first + k];
    sums[0] = (sums[0] + sums[1]) + (sums[2] + sums[3]);
    for (size_t k = 0; k < 4; ++k) f->sums[(first + k) * (f->n_u + 2 * f->states) + input] += sums[0][k];
}

/// The same of one number.
static void input_number(const okid_filters_t* f, const double* rows, size_t count, size_t input, size_t at) {
    double sum = 0;
    for (size_t n = 0; n < count; ++n) sum += rows[n * f->m + input] * rows[n * f->m + at];
    f->sums[at * (f->n_u + 2 * f->states) + input] += sum;
}

okid_filters_fn FILTERS;
void FILTERS(const okid_filters_t* self, const double* rows, size_t count) {
    const okid_filters_t f = *self;
    const size_t groups = (f.m + CHANNELS - 1) / CHANNELS;
    for (size_t k = 0; k < f.active; k += LANES)
        for (size_t g = 0, first = 0; g < groups; ++g) {
            const size_t channels = (f.m - first + groups - g - 1) / (groups - g);
            filter_tiles(&f, rows, count, k, first, g + 1 == groups, (int)channels);
            first += channels;
        }
    for (size_t c = 0; c < f.n_u; ++c) {
        size_t r = 0;
        for (; r + 4 <= f.m; r += 4) input_tile(&f, rows, count, c, r);
        for (; r < f.m; ++r) input_number(&f, rows, count, c, r);
    }
}

#ifdef OKID_KERNEL_IS_BASE
okid_recursion_t okid_recursion_pick(void) {
#ifdef OKID_KERNEL_DISPATCH
    extern okid_follow_fn okid_follow_avx2, okid_follow_avx512;
    extern okid_filters_fn okid_filters_avx2, okid_filters_avx512;
    if (__builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512dq") && __builtin_cpu_supports("avx512vl"))
        return (okid_recursion_t){okid_follow_avx512, okid_filters_avx512};
    if (__builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma"))
        return (okid_recursion_t){okid_follow_avx2, okid_filters_avx2};
#endif
    return (okid_recursion_t){okid_follow_base, okid_filters_base};
}
#endif
