// SPDX-License-Identifier: MIT
// PURPOSE    the correlation sums to many lags by FFT: of 16-bit codes the integers of the direct kernel, of doubles to a few eps of
//            the energy
// METHOD     overlap-save: N >= 2 L points take N - L rows. Rows of v and the oldest input of each row, zero before the first
//            row, beside the inputs of the whole window, two signals in a complex transform, 16 in a vector of it. The
//            cross-spectra of codes gather until rounding could fail, those of doubles go out after each block: it then
//            depends on the place in the run alone which rows are summed together
// REFERENCE  spectrum.h (transform, error bound)
// NUMERICS   codes: rounded to integers while okid_spectrum_error() stays below 1/2; a block that is too loud is summed directly
// WORKSPACE  34 N + (2 n_u (m + n_u) + 2 (m + 2 n_u)) (N/2 + 1) doubles; some 5 log2 N (m + 2 n_u) + 8 n_u (m + n_u) flop a sample
#include "correlation.h"
#include "spectrum.h"

#include <math.h>

#ifndef OKID_INTEGER_KERNEL

enum { V = SPECTRUM_LANES, REALS = 2 * V };

static int32_t rows_of(const okid_correlation_config_t* c) { return c->n_y + 2 * c->n_u; } ///< with the oldest inputs
static int32_t signals_of(const okid_correlation_config_t* c) { return rows_of(c) + c->n_u; }

/// Work of the direct kernel on so many rows, and of a block of transforms, in the same unit (measured).
static double direct_work(const okid_correlation_config_t* c, double rows) {
    return (c->sample == OKID_SAMPLE_DOUBLE ? 2 : 16) * rows * rows_of(c) * c->n_u * (c->lags + 1.0);
}
static double block_work(const okid_correlation_config_t* c, double points) {
    const int32_t forward = (signals_of(c) + REALS - 1) / REALS, back = (rows_of(c) * c->n_u + REALS - 1) / REALS;
    const int32_t lanes = (forward + back) * V;
    return points * (20.0 * lanes * log2(points) + 8.0 * rows_of(c) * c->n_u);
}

int32_t okid_correlation_points(const okid_correlation_config_t* c) {
    if (c->buffer > 0 || (c->sample != OKID_SAMPLE_DOUBLE && c->sample != OKID_SAMPLE_INT16)) return 0;
    int32_t points = 128;
    while (points < 2 * c->lags) points *= 2;
    return block_work(c, points) < direct_work(c, points - c->lags) ? points : 0;
}

/// Memory: work and spare of the transforms; real and imaginary parts of the spectra and of the cross-spectra, frequency-major.
typedef struct place_t {
    double *work, *spare, *re, *im, *cross_re, *cross_im;
} place_t;

static size_t frequencies(const okid_correlation_t* s) { return (size_t)s->points / 2 + 1; }
static size_t crosses(const okid_correlation_t* s) { return (size_t)(rows_of(&s->config) * s->config.n_u); }

size_t okid_correlation_spectrum_numbers(const okid_correlation_t* s) {
    if (s->points == 0) return 0;
    return 4 * V * (size_t)s->points + 2 * frequencies(s) * ((size_t)signals_of(&s->config) + crosses(s));
}

static place_t place_of(const okid_correlation_t* s) {
    place_t a;
    a.work = &cor_at(s, s->spectrum_at)->real;
    a.spare = a.work + 2 * V * (size_t)s->points;
    a.re = a.spare + 2 * V * (size_t)s->points;
    a.im = a.re + frequencies(s) * (size_t)signals_of(&s->config);
    a.cross_re = a.im + frequencies(s) * (size_t)signals_of(&s->config);
    a.cross_im = a.cross_re + frequencies(s) * crosses(s);
    return a;
}

static double* transform(const okid_correlation_t* s, const place_t* a) {
    const double* tables = &cor_at(s, s->tables_at)->real;
    return okid_spectrum_pick().transform(tables, tables + s->points, a->work, a->spare, s->points);
}

static double number(const okid_correlation_t* s, cor_number_t x) { return cor_codes(s) ? (double)x.code : x.real; }

/// Signal `i` (rows of v, oldest inputs, inputs) into its lane. @return sum of its squares
static double load(const okid_correlation_t* s, int32_t i, double* lane) {
    const okid_correlation_config_t* c = &s->config;
    const int32_t rows = rows_of(c), whole = i >= rows, before = c->lags;
    const cor_number_t* from = i < s->m ? cor_at(s, s->now_at) + i : cor_at(s, s->u_at) + (i - (whole ? rows : s->m));
    const int32_t stride = i < s->m ? s->m : c->n_u;
    double energy = 0, *to = lane + (whole ? 0 : 2 * V * (size_t)before);
    for (int32_t n = 0; n < s->pending + (whole ? before : 0); ++n, from += stride, to += 2 * V) {
        *to = number(s, *from);
        energy += *to * *to;
    }
    return energy;
}

/// Spectra of all signals. @return the largest energy
static double find_spectra(const okid_correlation_t* s, const place_t* a) {
    const int32_t signals = signals_of(&s->config), points = s->points;
    double most = 0;
    for (int32_t first = 0; first < signals; first += REALS) {
        const int32_t count = signals - first < REALS ? signals - first : REALS;
        memset(a->work, 0, 2 * V * (size_t)points * sizeof(double));
        for (int32_t i = 0; i < count; ++i) {
            const double energy = load(s, first + i, a->work + i / 2 + V * (i % 2));
            most = energy > most ? energy : most;
        }
        const double* z = transform(s, a);
        for (int32_t f = 0; f <= points / 2; ++f) {
            const double *low = z + 2 * V * (size_t)f, *high = z + 2 * V * (size_t)((points - f) % points);
            double* re = a->re + (size_t)f * (size_t)signals + first;
            double* im = a->im + (size_t)f * (size_t)signals + first;
            for (int32_t i = 0; i < count; ++i) { // (Z[f] + conj Z[N-f])/2, (Z[f] - conj Z[N-f])/2i
                const int32_t at = i / 2, sum = i % 2 == 0;
                re[i] = 0.5 * (sum ? low[at] + high[at] : low[V + at] + high[V + at]);
                im[i] = 0.5 * (sum ? low[V + at] - high[V + at] : high[at] - low[at]);
            }
        }
    }
    return most;
}

static void add_cross(const okid_correlation_t* s, const place_t* a) {
    const int32_t rows = rows_of(&s->config), signals = signals_of(&s->config);
    for (size_t f = 0; f < frequencies(s); ++f)
        for (int32_t c = 0; c < s->config.n_u; ++c) {
            const double *re = a->re + f * (size_t)signals, *im = a->im + f * (size_t)signals;
            const double fr = re[rows + c], fi = im[rows + c];
            double* to_re = a->cross_re + (f * (size_t)s->config.n_u + (size_t)c) * (size_t)rows;
            double* to_im = a->cross_im + (f * (size_t)s->config.n_u + (size_t)c) * (size_t)rows;
            for (int32_t r = 0; r < rows; ++r) {
                to_re[r] += re[r] * fr + im[r] * fi;
                to_im[r] += im[r] * fr - re[r] * fi;
            }
        }
}

int okid_correlation_gather(okid_correlation_t* s) {
    if (s->points == 0 || block_work(&s->config, s->points) >= direct_work(&s->config, s->pending)) return 0;
    const place_t a = place_of(s);
    const double energy = find_spectra(s, &a);
    if (cor_codes(s)) {
        const spectrum_plan_t plan = {s->m, s->config.lags, s->points, 0, 0, 0};
        if (okid_spectrum_error(&plan, s->energy + energy) >= 0.5) okid_correlation_bring_out(s);
        if (okid_spectrum_error(&plan, energy) >= 0.5) return 0;
    }
    add_cross(s, &a);
    s->energy += energy;
    s->gathered += s->pending;
    return 1;
}

/// Sequences `first` and its neighbours, two a lane, as the spectrum of one complex signal, conjugated for the way back.
static void load_cross(const okid_correlation_t* s, const place_t* a, size_t first, size_t count) {
    const size_t all = crosses(s), points = (size_t)s->points;
    for (size_t f = 0; f < frequencies(s); ++f) {
        const double *re = a->cross_re + f * all + first, *im = a->cross_im + f * all + first;
        double *low = a->work + 2 * V * f, *high = a->work + 2 * V * (points - f);
        for (size_t k = 0; k < V; ++k) {
            const int one = 2 * k < count, two = 2 * k + 1 < count;
            const double ar = one ? re[2 * k] : 0, ai = one ? im[2 * k] : 0;
            const double br = two ? re[2 * k + 1] : 0, bi = two ? im[2 * k + 1] : 0;
            low[k] = ar - bi;
            low[V + k] = -(ai + br);
            if (f == 0 || 2 * f == points) continue;
            high[k] = ar + bi;
            high[V + k] = ai - br;
        }
    }
}

void okid_correlation_bring_out(okid_correlation_t* s) {
    if (s->gathered == 0) return;
    const place_t a = place_of(s);
    const int32_t rows = rows_of(&s->config), n_u = s->config.n_u, lags = s->config.lags, width = n_u * (lags + 1);
    const double scale = 1.0 / s->points;
    cor_number_t* sums = cor_sums(s, s->closed);
    for (size_t first = 0; first < crosses(s); first += REALS) {
        const size_t count = crosses(s) - first < REALS ? crosses(s) - first : REALS;
        load_cross(s, &a, first, count);
        const double* x = transform(s, &a);
        for (size_t i = 0; i < count; ++i) {
            const int32_t c = (int32_t)(first + i) / rows, r = (int32_t)(first + i) % rows;
            cor_number_t* row =
                sums + (r < s->m ? (size_t)r * (size_t)width : cor_t_at(s) + (size_t)(r - s->m) * (size_t)width);
            const double* at = x + i / 2 + (i % 2 == 0 ? 0 : V);
            for (int32_t d = 0; d <= lags; ++d, at += 2 * V) {
                const double value = (i % 2 == 0 ? scale : -scale) * *at;
                cor_number_t* to = row + (size_t)((lags - d) * n_u + c);
                if (cor_codes(s))
                    to->code += (int64_t)nearbyint(value);
                else
                    to->real += value;
            }
        }
    }
    memset(a.cross_re, 0, 2 * frequencies(s) * crosses(s) * sizeof(double));
    s->gathered = 0;
    s->energy = 0;
}

#endif
