// SPDX-License-Identifier: MIT
// PURPOSE    Gram matrix of [v_n; v_(n-1); ..; v_(n-p)] in engineering units from an accumulator, offsets removed
// METHOD     gram_sums.h in the type of the sums; centring G - g g^T / N with g the lag-row sums, which follow from the
//            running sums and the same edges; for codes in exact 128-bit integers up to the last division
// REFERENCE  docs/numerics.md, shift structure and offsets
// NUMERICS   codes: one rounding an entry; doubles: a few eps of the largest entry of the diagonal
// WORKSPACE  the caller's matrix only
#include "accumulator.h"

#include <string.h>

/// Tail of a slot: stored for closed ones, the live lag window for the open one.
static const double* acc_tail(const okid_accumulator_t* a, int32_t index) {
    return index == a->open ? acc_x(a) : acc_slot_data(a, index) + a->slot_tail;
}

/// Is the k-th slot of the ring continued without a gap by a slot that holds rows?
static int acc_is_continued(const okid_accumulator_t* a, int32_t k) {
    if (k >= a->closed) return 0;
    const slot_info_t* next = acc_slot(a, (acc_oldest(a) + k + 1) % a->slot_count);
    return next->joined && next->rows > 0;
}

#define SUM double
#define SLOT double
#define BASE double
#define SUFFIX double
#include "gram_sums.h"
#undef SLOT
#undef SUFFIX
#define SLOT int64_t
#define SUFFIX mixed // codes with forgetting: exact slots, a fading base
#include "gram_sums.h"
#undef SUM
#undef BASE
#undef SUFFIX
#define SUM int64_t
#define BASE int64_t
#define SUFFIX int64
#include "gram_sums.h"
#undef SUM
#undef SLOT
#undef BASE
#undef SUFFIX

/// Sum of lag row i = lag*m + channel over all regression rows, in samples' own units; `count` = (possibly faded) rows.
/// g(lag+1) = g(lag) + heads - tails of that lag.
static double lag_sum(const okid_accumulator_t* a, size_t i, double before) {
    const size_t m = (size_t)a->m, n = (size_t)a->width;
    const int32_t p = a->config.lags;
    const double* base = acc_base(a);
    double sum = i < m ? 0 : before;
    for (int32_t k = 0; k <= a->closed; ++k) {
        const int32_t index = (acc_oldest(a) + k) % a->slot_count;
        const slot_info_t* slot = acc_slot(a, index);
        if (slot->rows == 0) continue;
        const double* data = acc_slot_data(a, index);
        if (i < m)
            sum += data[m * n + i];
        else {
            if (!(k > 0 && slot->joined)) sum += acc_lag(data + a->slot_head, i - m, a->m, p);
            if (!acc_is_continued(a, k)) sum -= acc_lag(acc_tail(a, index), i - m, a->m, p);
        }
    }
    if (a->base_weight > 0) sum += i < m ? base[m * n + i] : base[m * n + m + (i - m)];
    return sum;
}

static double row_weight(const okid_accumulator_t* a) {
    double rows = a->base_weight;
    for (int32_t k = 0; k <= a->closed; ++k) rows += (double)acc_slot(a, (acc_oldest(a) + k) % a->slot_count)->rows;
    return rows;
}

/// (rows * e - gi gj) / rows without losing a digit to cancellation.
static double centred_int64(int64_t e, double gi, double gj, double rows) {
#ifdef __SIZEOF_INT128__
    const __int128 numerator = (__int128)(int64_t)rows * e - (__int128)(int64_t)gi * (int64_t)gj;
    return (double)numerator / rows;
#else
    return (double)e - gi * gj / rows;
#endif
}

/// Codes or samples -> engineering units, offsets removed or put in. `sums` holds the lag-row sums.
static double entry_in_units(const okid_accumulator_t* a, double raw, double centred, size_t i, size_t j,
                             const double* sums, double rows, okid_detrend_t detrend) {
    const size_t m = (size_t)a->m;
    const double *scale = acc_scale(a), *offset = scale + m;
    const double si = scale[i % m], sj = scale[j % m], oi = offset[i % m], oj = offset[j % m];
    if (detrend == OKID_DETREND_MEAN) return si * sj * centred;
    return si * sj * raw + si * oj * sums[i] + oi * sj * sums[j] + rows * oi * oj;
}

okid_status_t okid_accumulator_gram(okid_accumulator_t* self, okid_detrend_t detrend, double* gram, double* mean) {
    if (!self || !gram) return OKID_ERR_NULL;
    okid_accumulator_settle(self);
    const double rows = row_weight(self);
    if (!(rows > 0)) return OKID_ERR_TOO_SHORT;
    const size_t m = (size_t)self->m, n = (size_t)self->width;
    const int integer = acc_base_is_integer(self);
    if (integer)
        gram_of_int64(self, (int64_t*)gram);
    else if (self->config.sample == OKID_SAMPLE_INT16)
        gram_of_mixed(self, gram);
    else
        gram_of_double(self, gram);
    double* sums = acc_sums(self);
    for (size_t i = 0; i < n; ++i) sums[i] = lag_sum(self, i, i < m ? 0 : sums[i - m]);
    if (mean)
        for (size_t i = 0; i < m; ++i) mean[i] = acc_scale(self)[i] * sums[i] / rows + acc_scale(self)[m + i];
    for (size_t j = 0; j < n; ++j)
        for (size_t i = 0; i <= j; ++i) {
            double raw = gram[j * n + i], centred;
            if (integer) {
                int64_t e;
                memcpy(&e, &gram[j * n + i], sizeof e);
                raw = (double)e;
                centred = centred_int64(e, sums[i], sums[j], rows);
            } else
                centred = raw - sums[i] * sums[j] / rows;
            gram[j * n + i] = entry_in_units(self, raw, centred, i, j, sums, rows, detrend);
        }
    for (size_t j = 0; j < n; ++j)
        for (size_t i = j + 1; i < n; ++i) gram[j * n + i] = gram[i * n + j];
    return OKID_OK;
}
