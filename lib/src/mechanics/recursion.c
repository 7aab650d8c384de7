// SPDX-License-Identifier: MIT
// PURPOSE    what goes from sample to sample along a record, one source for every instruction set
// METHOD     follow: one product a sample, [estimate; next state] = M [u; y; x], its columns summed in two chains so that
//            additions do not wait for each other; simulation and prediction side by side. filters: eight samples at a
//            time by the powers of w, so that no sample waits for the one before and no mode is multiplied once for each input
// NUMERICS   plain recursions; the predictor is A - K C as one matrix
// WORKSPACE  none
#include "recursion.h"
#include "accumulate/isa.h"

#include <string.h>

#define FOLLOW OKID_FOR_ISA(okid_follow_)
#define FILTERS OKID_FOR_ISA(okid_filters_)

#if defined(__AVX512F__)
enum { LANES = 8, VECTORS = 4 };
#elif defined(__AVX2__)
enum { LANES = 4, VECTORS = 4 };
#else
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

typedef double four_t __attribute__((vector_size(4 * sizeof(double)), aligned(8)));
#define FOUR(p) (*(const four_t*)(p))
#define ADD_FOUR(p, v) (*(four_t*)(p) += (v))
enum { BLOCK = OKID_FILTERS_BLOCK, STRETCH = OKID_FILTERS_STRETCH, BLOCKS = STRETCH / BLOCK, MODES = 3, GROUPS = 3 };

/// From the states before a block to those behind its `count` rows; of input g u stands at inputs + g * STRETCH.
static inline __attribute__((always_inline)) void filter_states(const okid_filters_t* f, const double* inputs,
                                                                const double* from, double* to, const size_t count) {
    const size_t K = okid_filters_padded(f->modes);
    for (size_t k = 0; k < K; k += 4) {
        const double *powers = f->powers + okid_filters_power(k, 0), *over = powers + 8 * count, *u = inputs;
        const four_t wr = FOUR(over), wi = FOUR(over + 4);
        for (size_t g = 0, at = k; g <= f->n_u; ++g, at += 2 * K, u += STRETCH) {
            const four_t a = FOUR(from + at), b = FOUR(from + at + K);
            four_t re[2] = {{0}}, im[2] = {{0}};
            if (g < f->n_u)
#pragma GCC unroll 8
                for (size_t j = 0; j < count; ++j) {
                    const double* power = powers + 8 * (count - 1 - j);
                    re[j % 2] += u[j] * FOUR(power);
                    im[j % 2] += u[j] * FOUR(power + 4);
                }
            re[0] = re[0] + re[1] + wr * a; // last: the next block waits for it
            im[0] = im[0] + im[1] + wr * b;
            re[0] -= wi * b;
            im[0] += wi * a;
            memcpy(to + at, re, sizeof *re);
            memcpy(to + at + K, im, sizeof *im);
        }
    }
}

/// Of two blocks of four channels: the sums of w^j v(t0 + j), `modes` modes from k on.
static inline __attribute__((always_inline)) void filter_tile(const okid_filters_t* f, const double* v, size_t k,
                                                              double* to, const int modes) {
    const double* power[MODES];
    four_t sums[2][2 * MODES] = {{{0}}};
    for (int r = 0; r < modes; ++r) power[r] = f->powers + okid_filters_power(k + (size_t)r, 0);
#pragma GCC unroll 8
    for (size_t j = 0; j < BLOCK; ++j) {
        const four_t first = FOUR(v + 4 * j), second = FOUR(v + 4 * (BLOCK + j));
#pragma GCC unroll 3
        for (int r = 0; r < modes; ++r) {
            const double re = power[r][8 * j], im = power[r][8 * j + 4];
            sums[0][2 * r] += re * first;
            sums[0][2 * r + 1] += im * first;
            sums[1][2 * r] += re * second;
            sums[1][2 * r + 1] += im * second;
        }
    }
    for (size_t b = 0; b < 2; ++b)
        for (int r = 0; r < 2 * modes; ++r)
            memcpy(to + 4 * (2 * (b * f->modes + k) + (size_t)r), sums[b] + r, sizeof(four_t));
}

/// The states of mode k at the blocks' beginnings times the sums over the blocks, of `groups` groups from the first on.
static inline __attribute__((always_inline)) void filter_groups(const okid_filters_t* f, const double* products,
                                                                const double* starts, size_t k, size_t first,
                                                                double* sums, const int groups) {
    const size_t K = okid_filters_padded(f->modes), M = okid_filters_padded(f->m), each = 2 * K * (f->n_u + 1);
    four_t re[GROUPS] = {{0}}, im[GROUPS] = {{0}}, minus[GROUPS] = {{0}}, more[GROUPS] = {{0}};
    starts += 2 * K * first + k;
    products += 8 * k;
    for (size_t b = 0; b < BLOCKS; ++b, starts += each, products += 8 * f->modes) {
        const four_t pr = FOUR(products), pi = FOUR(products + 4);
#pragma GCC unroll 3
        for (int g = 0; g < groups; ++g) {
            const double a = starts[2 * K * (size_t)g], i = starts[2 * K * (size_t)g + K];
            re[g] += a * pr;
            minus[g] += i * pi;
            im[g] += a * pi;
            more[g] += i * pr;
        }
    }
    for (int g = 0; g < groups; ++g) {
        double* to = sums + ((first + (size_t)g) * f->modes + k) * 2 * M;
        ADD_FOUR(to, re[g] - minus[g]);
        ADD_FOUR(to + M, im[g] + more[g]);
    }
}

/// Of one number u what it adds to the sums of its pairs with `count` rows of four channels.
static inline __attribute__((always_inline)) void filter_pairs(double u, const double* v, four_t* sums,
                                                               const size_t count) {
#pragma GCC unroll 4
    for (size_t d = 0; d < count; ++d) sums[d] += u * FOUR(v + 4 * d);
}

/// The pairs of an input and four channels within each block, by their distance: up to 3, every second input in sums of its
/// own, so that none waits; then from 4 on.
static void filter_lags(const double* u, const double* v, size_t M, double* to) {
    four_t near[2][4] = {{{0}}}, far[4] = {{0}};
    for (size_t b = 0; b < STRETCH; b += BLOCK) {
        const double *in = u + b, *row = v + 4 * b;
        filter_pairs(in[0], row, near[0], 4);
        filter_pairs(in[1], row + 4, near[1], 4);
        filter_pairs(in[2], row + 8, near[0], 4);
        filter_pairs(in[3], row + 12, near[1], 4);
        filter_pairs(in[4], row + 16, near[0], 4);
        filter_pairs(in[5], row + 20, near[1], 3);
        filter_pairs(in[6], row + 24, near[0], 2);
        filter_pairs(in[7], row + 28, near[1], 1);
        filter_pairs(in[0], row + 16, far, 4);
        filter_pairs(in[1], row + 20, far, 3);
        filter_pairs(in[2], row + 24, far, 2);
        filter_pairs(in[3], row + 28, far, 1);
    }
    for (size_t d = 0; d < 4; ++d) ADD_FOUR(to + d * M, near[0][d] + near[1][d]);
    for (size_t d = 0; d < 4; ++d) ADD_FOUR(to + (4 + d) * M, far[d]);
}

/// Columns first .. of some rows, as wide as they are asked for; behind the last row and column zeros, which add nothing.
static void filter_columns(const double* rows, size_t count, size_t m, size_t first, double* to) {
    const size_t some = m - first < 4 ? m - first : 4;
    rows += first;
    if (some == 4)
        for (size_t n = 0; n < count; ++n) memcpy(to + 4 * n, rows + n * m, sizeof(four_t));
    for (size_t c = 0; some < 4 && c < 4; ++c)
        for (size_t n = 0; n < count; ++n) to[4 * n + c] = c < some ? rows[n * m + c] : 0;
    memset(to + 4 * count, 0, 4 * (STRETCH - count) * sizeof *to);
}

okid_filters_fn FILTERS;
void FILTERS(const okid_filters_t* self, const double* rows, size_t count) {
    const okid_filters_t f = *self;
    const size_t M = okid_filters_padded(f.m), each = 2 * okid_filters_padded(f.modes) * (f.n_u + 1);
    double *inputs = f.work, *four = inputs + STRETCH * f.n_u, *starts = four + 4 * STRETCH;
    double* products = starts + (BLOCKS + 1) * each;
    for (size_t g = 0; g < f.n_u; ++g)
        for (size_t n = 0; n < STRETCH; ++n) inputs[g * STRETCH + n] = n < count ? rows[n * f.m + g] : 0;
    memcpy(starts, f.state, each * sizeof *starts);
    for (size_t b = 0; b < BLOCKS; ++b) {
        double* from = starts + b * each;
        const size_t begin = b * BLOCK, left = count > begin ? count - begin : 0;
        if (left >= BLOCK)
            filter_states(&f, inputs + begin, from, from + each, BLOCK);
        else
            filter_states(&f, inputs + begin, from, from + each, left);
    }
    memcpy(f.state, starts + BLOCKS * each, each * sizeof *starts);
    for (size_t c = 0; c < f.m; c += 4) {
        filter_columns(rows, count, f.m, c, four);
        for (size_t b = 0; b < BLOCKS; b += 2)
            for (size_t k = 0; k < f.modes; k += MODES) {
                const double* v = four + 4 * b * BLOCK;
                double* to = products + 8 * b * f.modes;
                switch (f.modes - k) {
                case 1: filter_tile(&f, v, k, to, 1); break;
                case 2: filter_tile(&f, v, k, to, 2); break;
                default: filter_tile(&f, v, k, to, MODES); break;
                }
            }
        for (size_t k = 0; k < f.modes; ++k) {
            const size_t groups = f.n_u + (k < f.lasting);
            for (size_t g = 0; g < groups; g += GROUPS) switch (groups - g) {
                case 1: filter_groups(&f, products, starts, k, g, f.sums + c, 1); break;
                case 2: filter_groups(&f, products, starts, k, g, f.sums + c, 2); break;
                default: filter_groups(&f, products, starts, k, g, f.sums + c, GROUPS); break;
                }
        }
        for (size_t g = 0; g < f.n_u; ++g) filter_lags(inputs + g * STRETCH, four, M, f.lags + g * BLOCK * M + c);
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
