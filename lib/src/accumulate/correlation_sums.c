// SPDX-License-Identifier: MIT
// PURPOSE    the correlation sums in engineering units, slots weighted, means removed
// METHOD     sum (v - c)(u - c)^T = S - s c^T - c g_d^T + N c c^T with s the sum of v and g_d that of u_(t-d), which follows from
//            g_(d+1) = g_d + heads - tails
// REFERENCE  docs/numerics.md, refinement from sums
// NUMERICS   codes: c is a whole code and the bracket an integer, so that an offset costs no digit; one rounding an entry
// WORKSPACE  O(m n_u L slots) flop
#include "correlation.h"

#include <math.h>

/// A band of the sums: rows (of v, or of the inputs `late` samples before) with the lags of w channels. `first` is the first of
/// these, `end` their place among the numbers of an end.
typedef struct band_t {
    int32_t rows, w, p, first, late;
    size_t at, end;
} band_t;

static band_t input_band(const okid_correlation_t* s) {
    return (band_t){s->m, s->config.n_u, s->config.lags, 0, 0, 0, 0};
}
static band_t output_band(const okid_correlation_t* s) {
    return (band_t){s->m, s->config.n_y, s->config.own_lags, s->config.n_u, 0, cor_u_count(s), cor_u_window(s)};
}
static band_t oldest_band(const okid_correlation_t* s) {
    return (band_t){s->config.n_u, s->config.n_u, s->config.lags, 0, s->config.lags, cor_t_at(s), 0};
}

/// The block: results, then lag sums of the set at hand and what is taken off each channel.
typedef struct room_t {
    double *U, *Y, *T, *sum, *lag_sum, *ends, *weight;
    cor_number_t *lag, *centre;
    size_t bytes;
} room_t;

static double* take(double* block, size_t* at, size_t numbers) {
    double* here = block ? block + *at : NULL;
    *at += numbers;
    return here;
}

static room_t lay_out(const okid_correlation_t* s, double* block, int32_t pieces) {
    const size_t m = (size_t)s->m, u = cor_u_window(s) + (size_t)s->config.n_u;
    const size_t y = cor_y_window(s) + (size_t)s->config.n_y;
    size_t at = 0;
    room_t r;
    r.U = take(block, &at, m * u);
    r.Y = take(block, &at, m * y);
    r.T = take(block, &at, (size_t)s->config.n_u * u);
    r.sum = take(block, &at, m);
    r.lag_sum = take(block, &at, u);
    r.ends = take(block, &at, 2 * cor_u_window(s) * (size_t)pieces);
    r.weight = take(block, &at, (size_t)pieces);
    r.lag = (cor_number_t*)take(block, &at, u > y ? u : y);
    r.centre = (cor_number_t*)take(block, &at, m);
    r.bytes = at * sizeof(double);
    return r;
}

size_t okid_correlation_sums_memsize(const okid_correlation_t* self) {
    return self ? lay_out(self, NULL, self->closed + 1).bytes + sizeof(double) : 0;
}

static double number(const okid_correlation_t* s, cor_number_t x) { return cor_codes(s) ? (double)x.code : x.real; }

static const cor_number_t* channel_sums(const okid_correlation_t* s, int32_t k) {
    return cor_sums(s, k) + cor_sum_count(s) * (size_t)cor_planes(s);
}

/// lag[d w + c] = sum over the rows of pieces first .. last of channel c, d samples before.
static void find_lag_sums(const okid_correlation_t* s, band_t b, int32_t first, int32_t last, cor_number_t* lag) {
    const cor_number_t* sum = channel_sums(s, first) + b.first;
    memcpy(lag, sum, (size_t)b.w * sizeof *lag);
    for (int32_t d = 0; d < b.p; ++d)
        for (int32_t c = 0; c < b.w; ++c) {
            cor_number_t x = lag[d * b.w + c];
            for (int32_t k = first; k <= last; ++k) {
                const size_t place = b.end + (size_t)((b.p - 1 - d) * b.w + c);
                const cor_number_t in = cor_head(s, k)[place], out = cor_tail(s, k)[place];
                if (cor_codes(s))
                    x.code += in.code - out.code;
                else
                    x.real += in.real - out.real;
            }
            lag[(d + 1) * b.w + c] = x;
        }
}

/// An entry of the sums less the constants a (of the row) and b (of the column).
static double centred(const okid_correlation_t* s, const cor_number_t* at, int64_t rows, cor_number_t row_sum,
                      cor_number_t lag_sum, cor_number_t a, cor_number_t b) {
    if (!cor_codes(s)) return at->real - row_sum.real * b.real - a.real * (lag_sum.real - (double)rows * b.real);
    int64_t low = at->code, high = at[cor_sum_count(s)].code;
    wide_add_product(&high, &low, -row_sum.code, b.code);
    wide_add_product(&high, &low, -(lag_sum.code - rows * b.code), a.code);
    return wide_double(high, low);
}

/// One band of the set that pieces first .. last stand in, times `weight`, to `out` (column-major, nearest lag first).
static void add_band(const okid_correlation_t* s, band_t b, int32_t first, int64_t rows, double weight,
                     const room_t* room, double* out) {
    const cor_number_t *S = cor_sums(s, first) + b.at, *sum = channel_sums(s, first);
    if (b.late > 0) sum = room->lag + b.late * b.w;
    const double* scale = cor_scale(s);
    const int32_t m = b.rows, width = b.w * (b.p + 1);
    for (int32_t d = 0; d <= b.p; ++d)
        for (int32_t c = 0; c < b.w; ++c)
            for (int32_t r = 0; r < m; ++r) {
                const double x = centred(s, S + (size_t)r * (size_t)width + (size_t)((b.p - d) * b.w + c), rows, sum[r],
                                         room->lag[d * b.w + c], room->centre[r], room->centre[b.first + c]);
                out[(size_t)(d * b.w + c) * (size_t)m + (size_t)r] += weight * scale[r] * scale[b.first + c] * x;
            }
}

static double less(const okid_correlation_t* s, cor_number_t x, int64_t times, cor_number_t centre) {
    return cor_codes(s) ? (double)(x.code - times * centre.code) : x.real - (double)times * centre.real;
}

/// Everything of the set that pieces first .. last stand in.
static void add_set(const okid_correlation_t* s, int32_t first, int32_t last, double weight, const room_t* room) {
    int64_t rows = 0;
    for (int32_t k = first; k <= last; ++k) rows += cor_slot(s, k)->rows;
    const double* scale = cor_scale(s);
    const cor_number_t* sum = channel_sums(s, first);
    for (int32_t r = 0; r < s->m; ++r) room->sum[r] += weight * scale[r] * less(s, sum[r], rows, room->centre[r]);
    find_lag_sums(s, output_band(s), first, last, room->lag);
    add_band(s, output_band(s), first, rows, weight, room, room->Y);
    find_lag_sums(s, input_band(s), first, last, room->lag);
    add_band(s, input_band(s), first, rows, weight, room, room->U);
    add_band(s, oldest_band(s), first, rows, weight, room, room->T);
    for (int32_t d = 0; d <= s->config.lags; ++d)
        for (int32_t c = 0; c < s->config.n_u; ++c)
            room->lag_sum[d * s->config.n_u + c] +=
                weight * scale[c] * less(s, room->lag[d * s->config.n_u + c], rows, room->centre[c]);
}

/// The ends of piece k, nearest sample first.
static void put_ends(const okid_correlation_t* s, int32_t k, const room_t* room) {
    const int32_t n_u = s->config.n_u, L = s->config.lags;
    double* out = room->ends + 2 * cor_u_window(s) * (size_t)k;
    const cor_number_t* const both[2] = {cor_head(s, k), cor_tail(s, k)};
    for (int end = 0; end < 2; ++end)
        for (int32_t a = 0; a < L; ++a)
            for (int32_t c = 0; c < n_u; ++c)
                *out++ = cor_scale(s)[c] * less(s, both[end][(L - 1 - a) * n_u + c], 1, room->centre[c]);
}

/// Weights of the pieces, their total, and what is taken off each channel.
static double weigh(const okid_correlation_t* s, int32_t pieces, okid_detrend_t detrend, const room_t* room) {
    double total = 0, fade = 1;
    for (int32_t k = pieces - 1; k >= 0; --k) {
        room->weight[k] = fade;
        total += fade * (double)cor_slot(s, k)->rows;
        fade *= pow(s->config.forgetting, (double)cor_slot(s, k)->rows);
    }
    memset(room->centre, 0, (size_t)s->m * sizeof *room->centre);
    for (int32_t r = 0; r < s->m && detrend == OKID_DETREND_MEAN; ++r) {
        double mean = 0;
        const int32_t sets = s->config.block > 0 ? pieces : 1;
        for (int32_t k = 0; k < sets; ++k) mean += room->weight[k] * number(s, channel_sums(s, k)[r]) / total;
        if (cor_codes(s))
            room->centre[r].code = (int64_t)floor(mean + 0.5);
        else
            room->centre[r].real = mean;
    }
    return total;
}

okid_status_t okid_correlation_sums(okid_correlation_t* self, okid_detrend_t detrend, okid_correlation_sums_t* out,
                                    void* block, size_t bytes) {
    if (!self || !out || !block) return OKID_ERR_NULL;
    if (bytes < okid_correlation_sums_memsize(self)) return OKID_ERR_MEMORY;
    okid_correlation_begin_look(self);
    const int32_t pieces = cor_pieces(self);
    if (pieces == 0) return OKID_ERR_TOO_SHORT;
    double* start = (double*)(((size_t)block + sizeof(double) - 1) & ~(sizeof(double) - 1));
    const room_t room = lay_out(self, start, pieces);
    memset(start, 0, room.bytes);
    const double rows = weigh(self, pieces, detrend, &room);
    if (self->config.block > 0)
        for (int32_t k = 0; k < pieces; ++k) add_set(self, k, k, room.weight[k], &room);
    else
        add_set(self, 0, pieces - 1, 1, &room);
    for (int32_t k = 0; k < pieces; ++k) put_ends(self, k, &room);
    okid_correlation_end_look(self);
    const okid_correlation_config_t* c = &self->config;
    *out = (okid_correlation_sums_t){
        c->n_u, c->n_y,   c->lags,      c->own_lags, pieces,     detrend == OKID_DETREND_MEAN, rows, room.U, room.Y,
        room.T, room.sum, room.lag_sum, room.ends,   room.weight};
    return OKID_OK;
}
