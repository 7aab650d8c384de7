// SPDX-License-Identifier: MIT
// PURPOSE    the lagged sums of 16-bit codes and of doubles by FFT, one source for every instruction set
// METHOD     overlap-save with windows of N = p + L samples. z = current + i full (current: the window with its first p
//            samples zero) gives both spectra of a channel from one complex transform; the cross-spectra
//            Current_r conj(Full_c) of all windows are added, one inverse transform at the end gives
//            S_b(r, c) = sum_k current_r[k] full_c[k - b], b = 0..p, without wrap-around. Channels lie across SIMD lanes, so
//            that a butterfly never shuffles; four windows are transformed before the cross-spectra are touched once
// REFERENCE  Stockham radix 4: Van Loan, Computational Frameworks for the FFT (1992), 1.7; error: Higham, Accuracy and
//            Stability of Numerical Algorithms (2002), theorem 24.2
// NUMERICS   the sums are integers: rounding makes them exact while the error stays below 1/2, see okid_spectrum_error().
//            Of doubles that error remains: as that of plain sums a small multiple of eps times the energy
// WORKSPACE  okid_spectrum_doubles(); about 5 m log2 N + 4 m^2 flop a sample
#include "spectrum.h"
#include "isa.h"

#include <math.h>
#include <string.h>

#define ABSORB OKID_FOR_ISA(okid_spectrum_absorb_)
#define FLUSH OKID_FOR_ISA(okid_spectrum_flush_)
#define TRANSFORM OKID_FOR_ISA(okid_spectrum_transform_)

enum { V = SPECTRUM_LANES };
typedef double lanes_t __attribute__((vector_size(V * sizeof(double)), aligned(8)));

/// Memory: twiddles cos, sin (N each); two work arrays of N complex lane vectors; the spectra of a batch (current and full,
/// N/2 + 1 frequencies); the cross-spectra, frequency-major: for each frequency, row and group a complex lane vector.
typedef struct map_t {
    double *cosine, *sine, *work, *spare, *current, *full, *cross;
    size_t window; ///< doubles of one window's spectra of all groups
} map_t;

static map_t map_of(const spectrum_plan_t* plan, double* memory) {
    const size_t n = (size_t)plan->length, half = n / 2 + 1, g = (size_t)plan->groups;
    map_t a;
    a.cosine = memory;
    a.sine = a.cosine + n;
    a.work = a.sine + n;
    a.spare = a.work + 2 * V * n;
    a.window = 2 * V * half * g;
    a.current = a.spare + 2 * V * n;
    a.full = a.current + SPECTRUM_BATCH * a.window;
    a.cross = a.full + SPECTRUM_BATCH * a.window;
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

/// Window `index` of the batch into z = current + i full for one group; @return largest energy of its channels.
static double load_codes(const spectrum_plan_t* plan, const map_t* a, const double* history, const int16_t* codes,
                         int index, int group) {
    const int m = plan->m, p = plan->p, first = group * V, lanes = m - first < V ? m - first : V;
    double energy[V] = {0};
    for (int k = 0; k < plan->length; ++k) {
        const int n = index * plan->fresh + k - p; // sample of this call
        double* z = a->work + 2 * V * (size_t)k;
        for (int c = 0; c < lanes; ++c) {
            const size_t at = (size_t)n * (size_t)m + (size_t)(first + c);
            const double x = n < 0 ? history[(n + p) * m + first + c] : codes[at];
            z[c] = k < p ? 0 : x;
            z[V + c] = x;
            energy[c] += x * x;
        }
        for (int c = lanes; c < V; ++c) z[c] = z[V + c] = 0;
    }
    double most = 0;
    for (int c = 0; c < lanes; ++c) most = energy[c] > most ? energy[c] : most;
    return most;
}

/// The same of numbers, whose energy nobody needs.
static inline __attribute__((always_inline)) void load_numbers(const spectrum_plan_t* plan, const map_t* a,
                                                               const double* history, const double* numbers, int index,
                                                               int first, const int lanes) {
    const int m = plan->m, p = plan->p, before = p - index * plan->fresh; // samples of the window in the history
    for (int k = 0; k < plan->length; ++k) {
        const double* row =
            k < before ? history + (size_t)((index * plan->fresh + k) * m) : numbers + (size_t)(k - before) * (size_t)m;
        double* z = a->work + 2 * V * (size_t)k;
        for (int c = 0; c < lanes; ++c) {
            z[c] = k < p ? 0 : row[first + c];
            z[V + c] = row[first + c];
        }
        for (int c = lanes; c < V; ++c) z[c] = z[V + c] = 0;
    }
}

static void load_group(const spectrum_plan_t* plan, const map_t* a, const double* history, const double* numbers,
                       int index, int group) {
    const int first = group * V, lanes = plan->m - first < V ? plan->m - first : V;
    if (lanes == V)
        load_numbers(plan, a, history, numbers, index, first, V);
    else if (lanes == V / 2)
        load_numbers(plan, a, history, numbers, index, first, V / 2);
    else
        load_numbers(plan, a, history, numbers, index, first, lanes);
}

/// Current = (Z[f] + conj Z[N-f]) / 2, Full = (Z[f] - conj Z[N-f]) / 2i.
static void split_spectra(const spectrum_plan_t* plan, const map_t* a, const double* z, int index, int group) {
    const int total = plan->length;
    const size_t stride = 2 * V * (size_t)plan->groups;
    double* current = a->current + (size_t)index * a->window + 2 * V * (size_t)group;
    double* full = a->full + (size_t)index * a->window + 2 * V * (size_t)group;
    for (int f = 0; f <= total / 2; ++f, current += stride, full += stride) {
        const double *low = z + 2 * V * (size_t)f, *high = z + 2 * V * (size_t)((total - f) % total);
        const lanes_t zr = GET(low), zi = GET(low + V), wr = GET(high), wi = -GET(high + V);
        PUT(current, 0.5 * (zr + wr));
        PUT(current + V, 0.5 * (zi + wi));
        PUT(full, 0.5 * (zi - wi));
        PUT(full + V, 0.5 * (wr - zr));
    }
}

/// cross[f][r][group] += Current_r conj(Full), all windows of the batch at once; Full of a frequency stays in registers.
static void add_cross(const spectrum_plan_t* plan, const map_t* a) {
    const int m = plan->m, groups = plan->groups;
    const size_t row = 2 * V * (size_t)groups;
    for (int f = 0; f <= plan->length / 2; ++f)
        for (int g = 0; g < groups; ++g) {
            const double *full = a->full + (size_t)f * row + 2 * V * (size_t)g, *current = a->current + (size_t)f * row;
            double* cross = a->cross + (size_t)(f * m) * row + 2 * V * (size_t)g;
            lanes_t fr[SPECTRUM_BATCH], fi[SPECTRUM_BATCH];
#pragma GCC unroll 4
            for (int b = 0; b < SPECTRUM_BATCH; ++b) {
                fr[b] = GET(full + (size_t)b * a->window);
                fi[b] = GET(full + (size_t)b * a->window + V);
            }
            for (int r = 0; r < m; ++r, cross += row) {
                const double* mine = current + 2 * V * (size_t)(r / V) + r % V;
                lanes_t re = GET(cross), im = GET(cross + V);
#pragma GCC unroll 4
                for (int b = 0; b < SPECTRUM_BATCH; ++b, mine += a->window) {
                    const double cr = mine[0], ci = mine[V];
                    re += cr * fr[b];
                    im += ci * fr[b];
                    re += ci * fi[b];
                    im -= cr * fi[b];
                }
                PUT(cross, re);
                PUT(cross + V, im);
            }
        }
}

okid_spectrum_transform_fn TRANSFORM;
double* TRANSFORM(const double* cosine, const double* sine, double* work, double* spare, int total) {
    const map_t a = {.cosine = (double*)(size_t)cosine, .sine = (double*)(size_t)sine, .work = work, .spare = spare};
    return transform(&a, total);
}

okid_spectrum_absorb_fn ABSORB;
double ABSORB(const spectrum_plan_t* plan, double* memory, const double* history, const int16_t* codes,
              const double* numbers) {
    const map_t a = map_of(plan, memory);
    double energy = 0;
    for (int b = 0; b < SPECTRUM_BATCH; ++b) {
        double most = 0;
        for (int g = 0; g < plan->groups; ++g) {
            const double e = codes ? load_codes(plan, &a, history, codes, b, g) : 0;
            if (numbers) load_group(plan, &a, history, numbers, b, g);
            most = e > most ? e : most;
            split_spectra(plan, &a, transform(&a, plan->length), b, g);
        }
        energy += most;
    }
    add_cross(plan, &a);
    return energy;
}

/// The spectra of rows r and r + 1 side by side: X = R_r + i R_(r+1) as N points, conjugated for the inverse transform.
static void load_rows(const spectrum_plan_t* plan, const map_t* a, int r, int group) {
    const int m = plan->m, groups = plan->groups, total = plan->length, pair = r + 1 < m;
    for (int f = 0; f <= total / 2; ++f) {
        const double* one = a->cross + 2 * V * (size_t)((f * m + r) * groups + group);
        const double* two = one + 2 * V * (size_t)groups;
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

okid_spectrum_flush_fn FLUSH;
void FLUSH(const spectrum_plan_t* plan, double* memory, double* sums, int of_codes) {
    const map_t a = map_of(plan, memory);
    const int m = plan->m, p = plan->p, width = m * (p + 1);
    const double scale = 1.0 / plan->length;
    for (int r = 0; r < m; r += 2)
        for (int g = 0; g < plan->groups; ++g) {
            load_rows(plan, &a, r, g);
            const double* x = transform(&a, plan->length); // conj of N (row r + i row r+1)
            const int first = g * V, lanes = m - first < V ? m - first : V;
            for (int b = 0; b <= p; ++b)
                for (int c = 0; c < lanes; ++c) {
                    const double* at = x + 2 * V * (size_t)b + c;
                    double* to = sums + r * width + (p - b) * m + first + c;
                    *to = of_codes ? nearbyint(at[0] * scale) : *to + at[0] * scale;
                    if (r + 1 < m) to[width] = of_codes ? nearbyint(-at[V] * scale) : to[width] - at[V] * scale;
                }
        }
    memset(a.cross, 0, 2 * V * (size_t)(plan->length / 2 + 1) * (size_t)(m * plan->groups) * sizeof(double));
}

#ifdef OKID_KERNEL_IS_BASE
spectrum_plan_t okid_spectrum_plan(int32_t m, int32_t p) {
    spectrum_plan_t plan = {m, p, 128, 0, (m + V - 1) / V};
    while (plan.length < 8 * (p + 1)) plan.length *= 2;
    plan.fresh = plan.length - p;
    return plan;
}

int okid_spectrum_pays(int32_t m, int32_t p) {
    const int32_t groups = (m + V - 1) / V, rows = m > V ? m : V;
    return 2 * m * m * (p + 1) >=
           250 * groups * rows; // measured: ties with the direct kernel at m, p = 4, 62; 8, 15; 13, 18
}

size_t okid_spectrum_doubles(const spectrum_plan_t* plan) {
    const size_t n = (size_t)plan->length, half = n / 2 + 1, g = (size_t)plan->groups;
    return 2 * n + 4 * V * n + 2 * SPECTRUM_BATCH * 2 * V * half * g + 2 * V * half * g * (size_t)plan->m;
}

void okid_spectrum_create(const spectrum_plan_t* plan, double* memory) {
    const map_t a = map_of(plan, memory);
    okid_spectrum_tables(plan->length, a.cosine, a.sine);
}

void okid_spectrum_tables(int total, double* cosine, double* sine) {
    for (int k = 0; k < total; ++k) {
        const double angle = 6.283185307179586476925 * k / total;
        cosine[k] = cos(angle);
        sine[k] = sin(angle);
    }
}

double okid_spectrum_error(const spectrum_plan_t* plan, double energy) {
    // Each transform: relative error log2(N) eta in the 2-norm, eta = u + 4 u (sqrt 2 + u) < 7 u, u = 2^-53 (Higham 24.2). Two
    // forward ones and the sums bend an entry by at most (2 log2(N) 7 u + 1e4 u) E, E the sum over windows of
    // |current| |full| <= energy; the inverse one by log2(N) 7 u times the 2-norm of all N entries, <= sqrt(N) E.
    const double u = 1.1102230246251565e-16, stages = log2((double)plan->length);
    return energy * u * (14 * stages + 64 + 7 * stages * sqrt((double)plan->length));
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
