// SPDX-License-Identifier: MIT
// PURPOSE    offsets of a whole record, and the record's sums as they stand: centring before a merge, export of a run
// METHOD     samples less a constant c keep the shift structure: S_b - g_0 c^T - c g_b^T + N c c^T, edge Gram
//            E - e c^T - c e^T, edge sums as they are. Codes: everything is counted in 2^-8 codes from then on, c is the
//            mean rounded to that, so that nothing is rounded again
// REFERENCE  docs/numerics.md, central idea: offsets
// NUMERICS   codes: exact; what is left of a mean is below 2^-9 code
// WORKSPACE  none; O((m p)^2)
#include "accumulator.h"
#include "lag_means.h"
#include "wide.h"

/// The mean in 2^-8 codes, rounded, and the sum that is left of the lag row with sum g (codes) when it is taken off.
static int64_t fine_mean(int64_t sum, int64_t rows) {
    const int64_t whole = okid_accumulator_whole_mean(sum, rows), rest = sum - whole * rows; // |rest| <= rows / 2
    return (whole * (1 << ACC_CENTRED_BITS)) + okid_accumulator_whole_mean(rest * (1 << ACC_CENTRED_BITS), rows);
}

/// (high, low) -= rows c d + (left_i) d + c (left_j), left: 2^8 g - rows c. Written as 2^8 g_i d + c left_j.
static void take_off(int64_t* high, int64_t* low, int64_t gi, int64_t gj, int64_t c, int64_t d, int64_t rows) {
    const int64_t whole = gj / rows, rest = gj % rows; // left_j = 2^8 gj - rows d without leaving 64 bits
    const int64_t left = rest * (1 << ACC_CENTRED_BITS) + rows * (whole * (1 << ACC_CENTRED_BITS) - d);
    int64_t h = 0, l = 0;
    wide_add_product(&h, &l, -gi, d);
    wide_shift(&h, &l, ACC_CENTRED_BITS);
    wide_add_wide(high, low, h, l);
    wide_add_product(high, low, -c, left);
}

static void centre_exact(okid_accumulator_t* a) {
    const size_t m = (size_t)a->m, p = (size_t)a->config.lags, n = (size_t)a->width, sums = acc_sum_count(a);
    int64_t *base = (int64_t*)acc_base(a), *sum = base + acc_base_sum(a), *edge_sum = base + acc_base_edge_sum(a);
    const int64_t rows = a->stats.rows;
    for (size_t r = 0; r < m; ++r)
        for (size_t c = 0; c < m; ++c) {
            const int64_t mean_r = fine_mean(sum[r], rows), mean_c = fine_mean(sum[c], rows);
            int64_t g = sum[c];
            for (size_t b = 0; b <= p; ++b) {
                if (b > 0) g += edge_sum[(b - 1) * m + c];
                int64_t *low = base + r * n + (p - b) * m + c, *high = low + sums;
                wide_shift(high, low, ACC_CENTRED_BITS);
                wide_shift(high, low, ACC_CENTRED_BITS);
                take_off(high, low, sum[r], g, mean_r, mean_c, rows);
            }
        }
    int64_t *low = base + acc_base_edge(a), *high = low + acc_edge_count(a);
    for (size_t j = 0, k = 0; j < p * m; ++j)
        for (size_t i = 0; i <= j; ++i, ++k) {
            const int64_t mean_i = fine_mean(sum[i % m], rows), mean_j = fine_mean(sum[j % m], rows);
            wide_shift(high + k, low + k, ACC_CENTRED_BITS);
            int64_t h = 0, l = 0;
            wide_add_product(&h, &l, -edge_sum[i], mean_j);
            wide_add_product(&h, &l, -mean_i, edge_sum[j]);
            wide_add_wide(high + k, low + k, h, l);
            wide_shift(high + k, low + k, ACC_CENTRED_BITS);
        }
    for (size_t i = 0; i < p * m; ++i) edge_sum[i] *= 1 << ACC_CENTRED_BITS;
    for (size_t r = 0; r < m; ++r) {
        const int64_t mean = fine_mean(sum[r], rows);
        sum[r] = (sum[r] % rows) * (1 << ACC_CENTRED_BITS) + rows * ((sum[r] / rows) * (1 << ACC_CENTRED_BITS) - mean);
    }
}

static void centre_double(okid_accumulator_t* a) {
    const size_t m = (size_t)a->m, p = (size_t)a->config.lags, n = (size_t)a->width;
    double *base = acc_base(a), *sum = base + acc_base_sum(a), *edge_sum = base + acc_base_edge_sum(a);
    const double rows = a->base_weight;
    for (size_t r = 0; r < m; ++r)
        for (size_t c = 0; c < m; ++c) {
            double g = sum[c];
            for (size_t b = 0; b <= p; ++b) {
                if (b > 0) g += edge_sum[(b - 1) * m + c];
                base[r * n + (p - b) * m + c] -= sum[r] / rows * g; // g_0 c^T + c g_b^T - N c c^T with N c = g_0
            }
        }
    double* edge = base + acc_base_edge(a);
    for (size_t j = 0, k = 0; j < p * m; ++j)
        for (size_t i = 0; i <= j; ++i, ++k) edge[k] -= (edge_sum[i] * sum[j % m] + sum[i % m] * edge_sum[j]) / rows;
    for (size_t r = 0; r < m; ++r) sum[r] = 0;
}

okid_status_t okid_accumulator_centre(okid_accumulator_t* self) {
    if (!self) return OKID_ERR_NULL;
    const okid_accumulator_config_t* c = &self->config;
    if (!c->edges || c->slots > 0 || c->forgetting < 1) return OKID_ERR_MISMATCH;
    if (self->centred) return OKID_OK;
    if (self->stats.rows >= INT64_C(1) << 32) return OKID_ERR_RANGE;
    okid_accumulator_close_slot(self, 0);
    if (self->stats.rows > 0 && acc_has_codes(self))
        centre_exact(self);
    else if (self->stats.rows > 0)
        centre_double(self);
    self->have = 0;
    self->in_gap = 1;
    self->centred = 1;
    return OKID_OK;
}

/// The one run in the sums: its first slot in the ring, -1 when there are several.
static int only_run(const okid_accumulator_t* a) {
    if (a->base_weight > 0) return 0;
    for (int32_t k = 1; k <= a->closed; ++k) {
        const slot_info_t* slot = acc_slot(a, acc_ring(a, k));
        if (slot->rows > 0 && !slot->joined) return 0;
    }
    return 1;
}

/// One number of the sums of S over the ring, less what the constants take off: codes in integers before they are rounded.
static double sum_less(const okid_accumulator_t* a, size_t at, int64_t gi, int64_t gj, int64_t ci, int64_t cj) {
    int64_t high = 0, low = 0;
    double sum = 0;
    for (int32_t k = 0; k <= a->closed; ++k) {
        const int32_t index = acc_ring(a, k);
        const double* data = acc_slot_data(a, index);
        const int64_t* words = (const int64_t*)data;
        if (acc_has_codes(a))
            wide_add_wide(&high, &low, words[acc_sum_count(a) + at], words[at]);
        else
            sum += data[at];
    }
    if (!acc_has_codes(a)) return sum;
    wide_add_product(&high, &low, -gi, cj);
    wide_add_product(&high, &low, -ci, gj - a->stats.rows * cj);
    return wide_double(high, low);
}

/// The record less its means (codes: less whole codes), or as it is, in engineering units: what the exported sums speak of.
typedef struct run_t {
    const okid_accumulator_t* a;
    const double *first, *last; ///< head and tail of the run
    int64_t rows;
    int codes, centred;
} run_t;

static double engineering(const run_t* f, size_t c, double number, double mean) {
    const double *scale = acc_scale(f->a), *offset = scale + f->a->m;
    return f->centred ? scale[c] * (number - mean) : scale[c] * number + offset[c];
}

/// S_0(i, j) .. S_p(i, j) into `out`, m^2 numbers apart.
static void run_sums(const run_t* f, size_t i, size_t j, double* out) {
    const okid_accumulator_t* a = f->a;
    const size_t m = (size_t)a->m, p = (size_t)a->config.lags, n = (size_t)a->width;
    const double *scale = acc_scale(a), *offset = scale + m, rows = (double)f->rows;
    const int64_t whole_i = f->codes ? okid_accumulator_lag_sum_exact(a, i, 0) : 0;
    const int64_t ci = f->codes && f->centred ? okid_accumulator_whole_mean(whole_i, f->rows) : 0;
    const double gi = f->codes ? (double)(whole_i - f->rows * ci) : okid_accumulator_lag_sum(a, i, 0);
    int64_t whole = f->codes ? okid_accumulator_lag_sum_exact(a, j, 0) : 0;
    const int64_t cj = f->codes && f->centred ? okid_accumulator_whole_mean(whole, f->rows) : 0;
    double g = f->codes ? 0 : okid_accumulator_lag_sum(a, j, 0);
    for (size_t b = 0; b <= p; ++b, out += m * m) {
        if (b > 0 && f->codes)
            whole += acc_code(f->first + acc_end(a, b - 1, j)) - acc_code(f->last + acc_end(a, b - 1, j));
        else if (b > 0)
            g += f->first[acc_end(a, b - 1, j)] - f->last[acc_end(a, b - 1, j)];
        const double gj = f->codes ? (double)(whole - f->rows * cj) : g;
        const double raw = sum_less(a, i * n + (p - b) * m + j, whole_i, whole, ci, cj);
        *out = scale[i] * scale[j] * (f->centred && !f->codes ? raw - gi * gj / rows : raw);
        if (!f->centred) *out += scale[i] * offset[j] * gi + offset[i] * scale[j] * gj + rows * offset[i] * offset[j];
    }
}

okid_status_t okid_accumulator_run(okid_accumulator_t* self, okid_detrend_t detrend, okid_run_sums_t* sums) {
    if (!self || !sums || !sums->S || !sums->head || !sums->tail || !sums->sum) return OKID_ERR_NULL;
    okid_accumulator_settle(self);
    if (self->stats.rows == 0) return OKID_ERR_TOO_SHORT;
    if (!only_run(self)) return OKID_ERR_MISMATCH;
    const okid_accumulator_t* a = self;
    const size_t m = (size_t)a->m, p = (size_t)a->config.lags;
    const int32_t newest = acc_slot(a, a->open)->rows > 0 ? a->open : acc_ring(a, a->closed - 1);
    const run_t f = {a,
                     acc_slot_data(a, acc_oldest(a)) + acc_slot_head(a),
                     acc_tail(a, newest),
                     a->stats.rows,
                     acc_has_codes(a),
                     detrend == OKID_DETREND_MEAN};
    const double rows = (double)f.rows;
    sums->rows = f.rows;
    for (size_t j = 0; j < m; ++j) {
        for (size_t i = 0; i < m; ++i) run_sums(&f, i, j, sums->S + j * m + i);
        const double total =
            f.codes ? (double)okid_accumulator_lag_sum_exact(a, j, 0) : okid_accumulator_lag_sum(a, j, 0);
        const double centre = f.codes ? (double)okid_accumulator_whole_mean((int64_t)total, f.rows) : total / rows;
        for (size_t l = 0; l < p; ++l) {
            sums->head[l * m + j] = engineering(&f, j, acc_number(a, f.first + acc_end(a, l, j)), centre);
            sums->tail[l * m + j] = engineering(&f, j, acc_number(a, f.last + acc_end(a, l, j)), centre);
        }
        const double *scale = acc_scale(a), *offset = scale + m;
        if (!f.centred)
            sums->sum[j] = scale[j] * total + rows * offset[j];
        else
            sums->sum[j] = f.codes ? scale[j] * (total - rows * centre) : 0;
        if (sums->mean) sums->mean[j] = scale[j] * total / rows + offset[j];
    }
    return OKID_OK;
}

double okid_accumulator_lag_means(okid_accumulator_t* self, double* mean) {
    okid_accumulator_settle(self);
    const double rows = okid_accumulator_weight(self), unit = 1.0 / (1 << acc_fraction(self));
    const size_t m = (size_t)self->m, n = (size_t)self->width;
    if (!(rows > 0)) return 0;
    if (acc_base_is_exact(self)) // codes: the sums are whole numbers below 2^53 in all but the longest records
        for (size_t i = 0; i < n; ++i)
            mean[i] = (double)okid_accumulator_lag_sum_exact(self, i, i < m ? 0 : (int64_t)mean[i - m]);
    else
        for (size_t i = 0; i < n; ++i) mean[i] = okid_accumulator_lag_sum(self, i, i < m ? 0 : mean[i - m]);
    for (size_t i = 0; i < n; ++i)
        mean[i] = acc_scale(self)[i % m] * unit * mean[i] / rows + (self->centred ? 0 : acc_scale(self)[m + i % m]);
    return rows;
}
