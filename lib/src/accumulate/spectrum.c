// SPDX-License-Identifier: MIT
// PURPOSE    the lagged sums of 16-bit codes and of doubles by FFT, one source for every instruction set
// METHOD     the record in windows of N samples, each transformed once: two windows as one complex signal z = a + i b. The real part
//            of its circular correlation with itself is the sum of both, so that P_rc(f) = Z_r conj(Z_c) and what -f mirrors is
//            added without taking a and b apart; one inverse transform at the end gives S_b(r, c) at b and S_b(c, r) at N - b.
//            What wraps around the end of a window, and what the samples before it give instead, are the products of its first p
//            samples alone: the direct kernel adds them. Channels lie across SIMD lanes, so that a butterfly never shuffles (up
//            to 4 channels: two windows side by side); pairs of channels by turning the lanes of one side, half of all pairs
// REFERENCE  Stockham radix 4: Van Loan, Computational Frameworks for the FFT (1992), 1.7; error: Higham, Accuracy and
//            Stability of Numerical Algorithms (2002), theorem 24.2
// NUMERICS   the sums are integers: rounding makes them exact while the error stays below 1/2, see okid_spectrum_error().
//            Of doubles that error remains: as that of plain sums a small multiple of eps times the energy
// WORKSPACE  okid_spectrum_doubles(); about 2.5 m log2 N + 2 m^2 (1 + p^2/N) flop a sample
#include "spectrum.h"
#include "isa.h"
#include "kernel.h"

#include <math.h>
#include <string.h>

#define ABSORB OKID_FOR_ISA(okid_spectrum_absorb_)
#define FLUSH OKID_FOR_ISA(okid_spectrum_flush_)
#define TRANSFORM OKID_FOR_ISA(okid_spectrum_transform_)
#define OKID_KERNEL OKID_FOR_ISA(okid_kernel_)

okid_kernel_fn OKID_KERNEL;
enum { V = SPECTRUM_LANES };
typedef double lanes_t __attribute__((vector_size(V * sizeof(double)), aligned(8)));

enum { TRANSFORMS = 2, MOST_SPECTRA = 4 };

/// Memory: twiddles cos, sin (N each); one array of N complex lane vectors for each transform of a call, and a spare one; the
/// cross-spectra, frequency-major: for each of N/2 + 1 frequencies a complex lane vector a turn; what the ends of the windows
/// give (m x m(p+1), as the sums); 2 p samples of differences and p of codes for it.
typedef struct map_t {
    double *cosine, *sine, *work, *spare, *cross, *ends, *differences, *first;
    size_t array; ///< doubles of one
} map_t;

static map_t map_of(const spectrum_plan_t* plan, double* memory) {
    const size_t n = (size_t)plan->length, lags = (size_t)plan->m * (size_t)plan->p;
    map_t a;
    a.array = 2 * V * n;
    a.cosine = memory;
    a.sine = a.cosine + n;
    a.spare = a.sine + n;
    a.work = a.spare + a.array;
    a.cross = a.work + a.array * (size_t)(TRANSFORMS * plan->groups);
    a.ends = a.cross + 2 * V * (n / 2 + 1) * (size_t)plan->turns;
    a.differences = a.ends + (size_t)plan->m * ((size_t)plan->m + lags);
    a.first = a.differences + 2 * lags;
    return a;
}

// No functions: of vectors that a processor does not have a call would depend on the compiler's version.
#define GET(p) (*(const lanes_t*)(p))
#define PUT(p, v) (*(lanes_t*)(p) = (v))

/// Forward transform (exp(-i)) of N complex lane vectors [re lanes, im lanes]; the result is in the returned array.
static double* transform(const map_t* a, int total) {
    double *x = a->work, *y = a->spare;
    int n = total, s = 1;
    for (; n >= 4; n /= 4, s *= 4) {
        const int quarter = n / 4;
        for (int k = 0; k < quarter; ++k) {
            const int t = k * s; // the twiddle exp(-2 pi i k / n)
            const double c1 = a->cosine[t], s1 = -a->sine[t], c2 = a->cosine[2 * t], s2 = -a->sine[2 * t];
            const double c3 = a->cosine[3 * t], s3 = -a->sine[3 * t];
            for (int q = 0; q < s; ++q) {
                const double* from = x + 2 * V * (size_t)(q + s * k);
                const size_t step = 2 * V * (size_t)(s * quarter);
                const lanes_t ar = GET(from), ai = GET(from + V), br = GET(from + step), bi = GET(from + step + V);
                const lanes_t cr = GET(from + 2 * step), ci = GET(from + 2 * step + V);
                const lanes_t dr = GET(from + 3 * step), di = GET(from + 3 * step + V);
                const lanes_t acr = ar + cr, aci = ai + ci, amr = ar - cr, ami = ai - ci;
                const lanes_t bdr = br + dr, bdi = bi + di, jr = di - bi, ji = br - dr; // i (b - d)
                const lanes_t u1r = amr - jr, u1i = ami - ji, u2r = acr - bdr, u2i = aci - bdi;
                const lanes_t u3r = amr + jr, u3i = ami + ji;
                double* to = y + 2 * V * (size_t)(q + s * 4 * k);
                const size_t next = 2 * V * (size_t)s;
                PUT(to, acr + bdr);
                PUT(to + V, aci + bdi);
                PUT(to + next, u1r * c1 - u1i * s1);
                PUT(to + next + V, u1r * s1 + u1i * c1);
                PUT(to + 2 * next, u2r * c2 - u2i * s2);
                PUT(to + 2 * next + V, u2r * s2 + u2i * c2);
                PUT(to + 3 * next, u3r * c3 - u3i * s3);
                PUT(to + 3 * next + V, u3r * s3 + u3i * c3);
            }
        }
        double* swap = x;
        x = y;
        y = swap;
    }
    if (n == 2) {
        for (int q = 0; q < s; ++q) {
            double *low = x + 2 * V * (size_t)q, *high = low + 2 * V * (size_t)s;
            for (int part = 0; part < 2 * V; part += V) {
                const lanes_t u = GET(low + part), v = GET(high + part);
                PUT(low + part, u + v);
                PUT(high + part, u - v);
            }
        }
    }
    return x;
}

/// The samples of a call, whichever they are.
typedef struct given_t {
    const int16_t* codes;
    const double* numbers;
    int32_t count;
} given_t;

static double sample_of(const given_t* given, size_t at) {
    return given->codes ? given->codes[at] : given->numbers[at];
}

/// Channels of `count` rows into lanes of the rows of z, zeros behind them up to `total`.
static inline __attribute__((always_inline)) void load_rows_of(double* z, const int16_t* codes, const double* numbers,
                                                               int m, int count, int total, const int lanes) {
    for (int k = 0; k < count; ++k, z += 2 * V)
        for (int c = 0; c < lanes; ++c) z[c] = codes ? codes[k * m + c] : numbers[k * m + c];
    for (int k = count; k < total; ++k, z += 2 * V)
        for (int c = 0; c < lanes; ++c) z[c] = 0;
}

/// One window of one group of channels.
static void load_window(const spectrum_plan_t* plan, const given_t* given, double* z, int index, int group) {
    const int m = plan->m, first = group * V, left = m - first < V ? m - first : V, total = plan->length;
    const int64_t behind = (int64_t)given->count - (int64_t)index * total;
    const int count = behind < 0 ? 0 : behind < total ? (int)behind : total;
    const size_t at = count > 0 ? (size_t)index * (size_t)total * (size_t)m + (size_t)first : 0;
    if (given->codes)
        load_rows_of(z, given->codes + at, given->numbers, m, count, total, left);
    else if (left == V)
        load_rows_of(z, NULL, given->numbers + at, m, count, total, V);
    else if (left == V / 2)
        load_rows_of(z, NULL, given->numbers + at, m, count, total, V / 2);
    else
        load_rows_of(z, NULL, given->numbers + at, m, count, total, left);
}

/// ends += the first samples of a window times what stands before them, less what the circular correlation takes for it.
static void add_ends(const spectrum_plan_t* plan, const map_t* a, const given_t* given, const double* history,
                     int index) {
    const int m = plan->m, p = plan->p, total = plan->length, start = index * total;
    const int count = given->count - start < total ? given->count - start : total, rows = count < p ? count : p;
    const size_t lags = (size_t)(m * p), from = (size_t)start * (size_t)m;
    const double* first = given->codes ? a->first : given->numbers + from;
    for (size_t i = 0; given->codes && i < (size_t)(rows * m); ++i) a->first[i] = given->codes[from + i];
    for (int j = 0; j < p; ++j)
        for (int c = 0; c < m; ++c) {
            const size_t to = (size_t)(j * m + c), wrapped = from + (size_t)(total - p) * (size_t)m + to;
            const double known = index == 0 ? history[to] : sample_of(given, from - lags + to);
            a->differences[to] = known - (total - p + j < count ? sample_of(given, wrapped) : 0);
        }
    OKID_KERNEL(a->ends, first, a->differences, m, m, p, rows, p);
}

#if defined(__AVX2__) || defined(__AVX512F__)
#define ADD_CROSS static inline __attribute__((always_inline)) void
#define TURN(v, a, b, c, d, e, f, g, h) __builtin_shufflevector(v, v, a, b, c, d, e, f, g, h)
#define TURN_0(v) (v)
#define TURN_1(v) TURN(v, 1, 2, 3, 4, 5, 6, 7, 0)
#define TURN_2(v) TURN(v, 2, 3, 4, 5, 6, 7, 0, 1)
#define TURN_3(v) TURN(v, 3, 4, 5, 6, 7, 0, 1, 2)
#define TURN_4(v) TURN(v, 4, 5, 6, 7, 0, 1, 2, 3)
#define TURN_5(v) TURN(v, 5, 6, 7, 0, 1, 2, 3, 4)
#define TURN_6(v) TURN(v, 6, 7, 0, 1, 2, 3, 4, 5)
#define TURN_7(v) TURN(v, 7, 0, 1, 2, 3, 4, 5, 6)
#define HALF_1(v) TURN(v, 1, 2, 3, 0, 5, 6, 7, 4)
#define HALF_2(v) TURN(v, 2, 3, 0, 1, 6, 7, 4, 5)
/// cross += Z_r conj(Z_c), lane r of one side against lane r + turn of the other, all spectra at once.
#define ADD_TURN(turn)                                                                                                 \
    do {                                                                                                               \
        lanes_t re = GET(to), im = GET(to + V);                                                                        \
        _Pragma("GCC unroll 4") for (int k = 0; k < spectra; ++k) {                                                    \
            const lanes_t cr = turn(o[2 * k]), ci = turn(o[2 * k + 1]);                                                \
            re += z[2 * k] * cr;                                                                                       \
            im += z[2 * k + 1] * cr;                                                                                   \
            re += z[2 * k + 1] * ci;                                                                                   \
            im -= z[2 * k] * ci;                                                                                       \
        }                                                                                                              \
        PUT(to, re);                                                                                                   \
        PUT(to + V, im);                                                                                               \
        to += 2 * V;                                                                                                   \
    } while (0)
#else // few registers: lane by lane, or the compiler fills the stack with vectors; nor do those lie below a transform
#define ADD_CROSS static __attribute__((noinline)) void
enum { TURN_0 = 16 * V, TURN_1, TURN_2, TURN_3, TURN_4, TURN_5, TURN_6, TURN_7, HALF_0 = 8 * V, HALF_1, HALF_2 };
static __attribute__((noinline)) void add_turn(double* to, const lanes_t* a, const lanes_t* b, int turn, int spectra) {
    const double *z = (const double*)a, *o = (const double*)b;
    const int by = turn % 16, per = turn / 16;
    for (int k = 0; k < spectra; ++k, z += 2 * V, o += 2 * V)
        for (int l = 0; l < V; ++l) {
            const int c = l / per * per + (l % per + by) % per;
            to[l] += z[l] * o[c] + z[V + l] * o[V + c];
            to[V + l] += z[V + l] * o[c] - z[l] * o[V + c];
        }
}
#define ADD_TURN(turn) (add_turn(to, z, o, turn, spectra), to += 2 * V)
#endif

/// Z and the mirrored conj(Z) of frequency f of each transform.
#define GET_SPECTRA(into, group)                                                                                       \
    _Pragma("GCC unroll 2") for (int k = 0; k < spectra; k += 2) {                                                     \
        const double* x = arrays + a->array * done[k / 2 * groups + (group)];                                          \
        const double *low = x + 2 * V * (size_t)f, *high = x + 2 * V * (size_t)((total - f) & (total - 1));            \
        (into)[2 * k] = GET(low);                                                                                      \
        (into)[2 * k + 1] = GET(low + V);                                                                              \
        (into)[2 * k + 2] = GET(high);                                                                                 \
        (into)[2 * k + 3] = -GET(high + V);                                                                            \
    }

ADD_CROSS add_cross(const spectrum_plan_t* plan, const map_t* a, const double* arrays, const uint8_t* done,
                    const int spectra) {
    const int groups = plan->groups, total = plan->length;
    double* to = a->cross;
    for (int f = 0; f <= total / 2; ++f)
        for (int g = 0; g < groups; ++g) {
            lanes_t z[2 * MOST_SPECTRA], other[2 * MOST_SPECTRA];
            const lanes_t* o = z;
            GET_SPECTRA(z, g)
            ADD_TURN(TURN_0);
            if (plan->share == 2) {
                ADD_TURN(HALF_1);
                ADD_TURN(HALF_2);
                continue;
            }
            ADD_TURN(TURN_1);
            ADD_TURN(TURN_2);
            ADD_TURN(TURN_3);
            ADD_TURN(TURN_4);
            o = other;
            for (int h = g + 1; h < groups; ++h) {
                GET_SPECTRA(other, h)
                ADD_TURN(TURN_0);
                ADD_TURN(TURN_1);
                ADD_TURN(TURN_2);
                ADD_TURN(TURN_3);
                ADD_TURN(TURN_4);
                ADD_TURN(TURN_5);
                ADD_TURN(TURN_6);
                ADD_TURN(TURN_7);
            }
        }
}

okid_spectrum_transform_fn TRANSFORM;
double* TRANSFORM(const double* cosine, const double* sine, double* work, double* spare, int total) {
    const map_t a = {.cosine = (double*)(size_t)cosine, .sine = (double*)(size_t)sine, .work = work, .spare = spare};
    return transform(&a, total);
}

okid_spectrum_absorb_fn ABSORB;
void ABSORB(const spectrum_plan_t* plan, double* memory, const double* history, const int16_t* codes,
            const double* numbers, int32_t count) {
    map_t a = map_of(plan, memory);
    const given_t given = {codes, numbers, count};
    const int share = plan->share, total = plan->length, groups = plan->groups;
    const double* const arrays = a.spare;
    double* next = a.work;
    uint8_t done[TRANSFORMS * SPECTRUM_GROUPS] = {0}; // the array each result is in
    int transforms = 0;
    for (int64_t from = 0; from < count; from += 2 * share * total, ++transforms)
        for (int g = 0; g < groups; ++g, next += a.array) {
            a.work = next;
            for (int part = 0; part < 2; ++part)
                for (int half = 0; half < share; ++half)
                    load_window(plan, &given, next + part * V + half * (V / 2),
                                2 * share * transforms + share * part + half, g);
            const double* result = transform(&a, total);
            done[transforms * groups + g] = (uint8_t)((size_t)(result - arrays) / a.array);
            if (result == a.spare) a.spare = next; // of no one any more
        }
    if (transforms == 1)
        add_cross(plan, &a, arrays, done, 2);
    else
        add_cross(plan, &a, arrays, done, 4);
    for (int index = 0; index * total < count; ++index) add_ends(plan, &a, &given, history, index);
}

/// Two cross-spectra of the flush side by side: X = A + iB as N points, conjugated for the inverse transform.
static void load_turns(const spectrum_plan_t* plan, const map_t* a, int k) {
    const int turns = plan->turns, total = plan->length, pair = k + 1 < turns;
    for (int f = 0; f <= total / 2; ++f) {
        const double *one = a->cross + 2 * V * (size_t)(f * turns + k), *two = one + 2 * V;
        const lanes_t none = {0};
        const lanes_t ar = GET(one), ai = GET(one + V), br = pair ? GET(two) : none, bi = pair ? GET(two + V) : none;
        double* low = a->work + 2 * V * (size_t)f;
        PUT(low, ar - bi); // X[f] = A + iB
        PUT(low + V, -(ai + br));
        if (f == 0 || f == total / 2) continue;
        double* high = a->work + 2 * V * (size_t)(total - f); // X[N-f] = conj A + i conj B
        PUT(high, ar + bi);
        PUT(high + V, ai - br);
    }
}

/// Where the numbers of the k-th cross-spectrum belong: channels of the two sides, how far one is turned.
typedef struct turn_t {
    int row, column, by;
} turn_t;

static turn_t turn_of(const spectrum_plan_t* plan, int k) {
    for (int g = 0; g < plan->groups; ++g)
        for (int h = g; h < plan->groups; ++h) {
            const int count = h > g ? V : plan->share == 2 ? 3 : V / 2 + 1;
            if (k < count) return (turn_t){g * V, h * V, k};
            k -= count;
        }
    return (turn_t){0, 0, 0};
}

/// The sums of one pair of channels: `at` the lane of a correlation, lag b at b, lag -b at N - b; sign and scale taken out.
static void put_pair(const spectrum_plan_t* plan, const double* at, double scale, int r, int c, double* sums) {
    const int m = plan->m, p = plan->p, width = m * (p + 1), total = plan->length;
    for (int b = 0; b <= p; ++b) {
        const double forward = at[2 * V * (size_t)b] * scale;
        const double back = at[2 * V * (size_t)((total - b) & (total - 1))] * scale;
        sums[r * width + (p - b) * m + c] += forward;
        if (r != c) sums[c * width + (p - b) * m + r] += back;
    }
}

okid_spectrum_flush_fn FLUSH;
void FLUSH(const spectrum_plan_t* plan, double* memory, double* sums, int of_codes) {
    const map_t a = map_of(plan, memory);
    const int m = plan->m, per = V / plan->share;
    const size_t count = (size_t)(m * m) * (size_t)(plan->p + 1);
    const double scale = 0.5 / plan->length; // each frequency was counted with its mirror
    if (of_codes) memset(sums, 0, count * sizeof *sums);
    for (int k = 0; k < plan->turns; k += 2) {
        load_turns(plan, &a, k);
        const double* x = transform(&a, plan->length); // conj of N (one + i two)
        for (int part = 0; part < 2 && k + part < plan->turns; ++part) {
            const turn_t turn = turn_of(plan, k + part);
            for (int l = 0; l < V; ++l) {
                const int own = l % per, r = turn.row + own, c = turn.column + (own + turn.by) % per;
                const int again = turn.row == turn.column && 2 * turn.by == per && 2 * own >= per; // (c, r) was there
                if (r < m && c < m && !again) put_pair(plan, x + l + V * part, part ? -scale : scale, r, c, sums);
            }
        }
    }
    for (size_t i = 0; i < count; ++i) sums[i] = (of_codes ? nearbyint(sums[i]) : sums[i]) + a.ends[i];
    memset(a.cross, 0, (size_t)(a.differences - a.cross) * sizeof(double)); // and the ends
}

#ifdef OKID_KERNEL_IS_BASE
spectrum_plan_t okid_spectrum_plan(int32_t m, int32_t p) {
    spectrum_plan_t plan = {m, p, 128, m <= V / 2 ? 2 : 1, (m + V - 1) / V, 0};
    const int32_t apart = plan.groups * (plan.groups - 1) / 2 * V;
    plan.turns = plan.share == 2 ? V / 4 + 1 : plan.groups * (V / 2 + 1) + apart;
    while (plan.length < (plan.share == 2 ? 6 : 10) * (p + 1))
        plan.length *= 2; // measured: ends against work at the flush
    return plan;
}

int okid_spectrum_pays(int32_t m, int32_t p) {
    const spectrum_plan_t plan = okid_spectrum_plan(m, p);
    return 2 * m * m * (p + 1) * plan.share >=
           500 * plan.groups + 150 * plan.turns; // measured: ties with the direct kernel at m, p = 4, 13; 8, 9; 13, 10
}

size_t okid_spectrum_doubles(const spectrum_plan_t* plan) {
    const size_t n = (size_t)plan->length, m = (size_t)plan->m, lags = m * (size_t)plan->p;
    return 2 * n + 2 * V * n * (size_t)(1 + TRANSFORMS * plan->groups) + 2 * V * (n / 2 + 1) * (size_t)plan->turns +
           m * (m + lags) + 3 * lags;
}

double okid_spectrum_energy(int32_t m, const int16_t* codes, int32_t count) {
    int64_t most = 0;
    for (int32_t c = 0; c < m; ++c) {
        int64_t sum = 0;
        for (const int16_t* x = codes + c; x < codes + (size_t)count * (size_t)m; x += m) sum += (int64_t)*x * *x;
        if (sum > most) most = sum;
    }
    return (double)most;
}

void okid_spectrum_create(const spectrum_plan_t* plan, double* memory) {
    const map_t a = map_of(plan, memory);
    okid_spectrum_tables(plan->length, a.cosine, a.sine);
}

void okid_spectrum_tables(int total, double* cosine, double* sine) {
    const int quarter = total / 4;
    for (int k = 0; k <= quarter / 2; ++k) { // the first eighth; the rest repeats it
        const double angle = 6.283185307179586476925 * k / total, c = cos(angle), s = sin(angle);
        cosine[k] = sine[quarter - k] = c;
        sine[k] = cosine[quarter - k] = s;
    }
    for (int k = quarter; k < total; ++k) {
        cosine[k] = -sine[k - quarter];
        sine[k] = cosine[k - quarter];
    }
}

double okid_spectrum_error(const spectrum_plan_t* plan, double energy) {
    // Each transform: relative error log2(N) eta in the 2-norm, eta = u + 4 u (sqrt 2 + u) < 7 u, u = 2^-53 (Higham 24.2). Two
    // windows in one transform and the sums bend an entry by at most (2 log2(N) 7 u + 1e4 u) E, E the sum over windows of
    // |z_r| |z_c| <= energy; the inverse one, of two sequences, by log2(N) 7 u times the 2-norm of all entries, <= sqrt(2 N) E.
    const double u = 1.1102230246251565e-16, stages = log2((double)plan->length);
    return energy * u * (14 * stages + 64 + 10 * stages * sqrt((double)plan->length));
}

spectrum_kernels_t okid_spectrum_pick(void) {
#ifdef OKID_KERNEL_DISPATCH
    extern okid_spectrum_absorb_fn okid_spectrum_absorb_avx2, okid_spectrum_absorb_avx512;
    extern okid_spectrum_flush_fn okid_spectrum_flush_avx2, okid_spectrum_flush_avx512;
    extern okid_spectrum_transform_fn okid_spectrum_transform_avx2, okid_spectrum_transform_avx512;
    if (__builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512dq") && __builtin_cpu_supports("avx512vl"))
        return (spectrum_kernels_t){okid_spectrum_absorb_avx512, okid_spectrum_flush_avx512,
                                    okid_spectrum_transform_avx512};
    if (__builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma"))
        return (spectrum_kernels_t){okid_spectrum_absorb_avx2, okid_spectrum_flush_avx2, okid_spectrum_transform_avx2};
#endif
    return (spectrum_kernels_t){okid_spectrum_absorb_base, okid_spectrum_flush_base, okid_spectrum_transform_base};
}
#endif
