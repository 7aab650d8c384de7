// SPDX-License-Identifier: MIT
// PURPOSE    Gram matrix of [v_n; v_(n-1); ..; v_(n-p)] in engineering units from an accumulator, offsets removed
// METHOD     gram_sums.h in the numbers of the sums; centring G - g g^T / N with g the lag-row sums, which follow from the
//            running sums and the same edges. Exact sums take two words an entry: the high ones stand in the upper
//            triangle, the low ones in the lower, those of the diagonal in the scratch
// REFERENCE  docs/numerics.md, shift structure and offsets
// NUMERICS   codes: one rounding an entry; doubles: a few eps of the largest entry of the diagonal
// WORKSPACE  the caller's matrix and two rows of scratch in the block
#include "accumulator.h"
#include "wide.h"

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

// Doubles.
#define SUFFIX double
#define ADD_SLOT(i, j, data, k) (gram[(j) * n + (i)] += (data)[k])
#define ADD_BASE(i, j, base, k) (gram[(j) * n + (i)] += (base)[k])
#define ADD_EDGE(i, j, edge, k) (gram[(j) * n + (i)] += (edge)[k])
#define ADD_PRODUCT(i, j, x, y) (gram[(j) * n + (i)] += (x) * (y))
#define ADD_ENTRY(i, j, i2, j2) (gram[(j) * n + (i)] += gram[(j2) * n + (i2)])
#include "gram_sums.h"

// Codes with forgetting: exact slots, a fading base in double.
static double slot_double(const okid_accumulator_t* a, const double* data, size_t k) {
    const int64_t* words = (const int64_t*)data;
    return wide_double(words[acc_sum_count(a) + k], words[k]);
}
#define SUFFIX mixed
#define ADD_SLOT(i, j, data, k) (gram[(j) * n + (i)] += slot_double(a, data, k))
#define ADD_BASE(i, j, base, k) (gram[(j) * n + (i)] += (base)[k])
#define ADD_EDGE(i, j, edge, k) (gram[(j) * n + (i)] += (edge)[k])
#define ADD_PRODUCT(i, j, x, y) (gram[(j) * n + (i)] += (x) * (y))
#define ADD_ENTRY(i, j, i2, j2) (gram[(j) * n + (i)] += gram[(j2) * n + (i2)])
#include "gram_sums.h"

// Codes, all exact.
static inline int64_t* low_word(const okid_accumulator_t* a, double* gram, size_t i, size_t j) {
    return (int64_t*)(i == j ? acc_scratch(a) + i : gram + i * (size_t)a->width + j);
}
#define HIGH(i, j) ((int64_t*)gram + (j) * n + (i))
#define SUFFIX exact
#define ADD_SLOT(i, j, data, k)                                                                                        \
    wide_add_wide(HIGH(i, j), low_word(a, gram, i, j), ((const int64_t*)(data))[acc_sum_count(a) + (k)],               \
                  ((const int64_t*)(data))[k])
#define ADD_BASE(i, j, base, k) ADD_SLOT(i, j, base, k)
#define ADD_EDGE(i, j, edge, k)                                                                                        \
    wide_add_wide(HIGH(i, j), low_word(a, gram, i, j), ((const int64_t*)(edge))[pm * (pm + 1) / 2 + (k)],              \
                  ((const int64_t*)(edge))[k])
#define ADD_PRODUCT(i, j, x, y) wide_add(HIGH(i, j), low_word(a, gram, i, j), (int64_t)(x) * (int64_t)(y))
#define ADD_ENTRY(i, j, i2, j2)                                                                                        \
    wide_add_wide(HIGH(i, j), low_word(a, gram, i, j), *HIGH(i2, j2), *low_word(a, gram, i2, j2))
#include "gram_sums.h"

/// Sums of the lag rows over all regression rows, n of them: g(lag + 1) = g(lag) + heads - tails of that lag. `exact`
/// chooses 64-bit integers, else doubles.
static void lag_sums(const okid_accumulator_t* a, int exact, double* out) {
    const size_t m = (size_t)a->m, n = (size_t)a->width;
    const double* base = a->base_weight > 0 ? acc_base(a) : NULL;
    int64_t* integers = (int64_t*)out;
    for (size_t i = 0; i < n; ++i) {
        double sum = 0;
        int64_t whole = 0;
        if (i >= m) {
            sum = exact ? 0 : out[i - m];
            whole = exact ? integers[i - m] : 0;
        }
        for (int32_t k = 0; k <= a->closed; ++k) {
            const int32_t index = (acc_oldest(a) + k) % a->slot_count;
            const slot_info_t* slot = acc_slot(a, index);
            if (slot->rows == 0) continue;
            const double* data = acc_slot_data(a, index);
            if (i < m) {
                const double* mean = data + a->slot_mean + i;
                if (exact)
                    whole += *(const int64_t*)mean;
                else
                    sum += acc_has_codes(a) ? (double)*(const int64_t*)mean : *mean;
                continue;
            }
            const size_t at = ((size_t)a->config.lags - i / m) * m + i % m; // entry of lag i/m - 1 in time order
            const double enters = k > 0 && slot->joined ? 0 : data[a->slot_head + at];
            const double leaves = acc_is_continued(a, k) ? 0 : acc_tail(a, index)[at];
            sum += enters - leaves;
            whole += (int64_t)enters - (int64_t)leaves;
        }
        if (base) {
            const double* part = base + a->base_mean + i; // the edge sums stand behind the sums
            if (exact)
                whole += *(const int64_t*)part;
            else
                sum += *part;
        }
        if (exact)
            integers[i] = whole;
        else
            out[i] = sum;
    }
}

static double row_weight(const okid_accumulator_t* a) {
    double rows = a->base_weight;
    for (int32_t k = 0; k <= a->closed; ++k) rows += (double)acc_slot(a, (acc_oldest(a) + k) % a->slot_count)->rows;
    return rows;
}

/// Codes or samples -> engineering units, offsets removed or put in; gi, gj are the lag-row sums.
static double entry_in_units(const okid_accumulator_t* a, double raw, double centred, size_t i, size_t j, double gi,
                             double gj, double rows, okid_detrend_t detrend) {
    const size_t m = (size_t)a->m;
    const double *scale = acc_scale(a), *offset = scale + m;
    const double si = scale[i % m], sj = scale[j % m], oi = offset[i % m], oj = offset[j % m];
    if (detrend == OKID_DETREND_MEAN) return si * sj * centred;
    return si * sj * raw + si * oj * gi + oi * sj * gj + rows * oi * oj;
}

static void finish_double(const okid_accumulator_t* a, okid_detrend_t detrend, double rows, const double* sums,
                          double* gram) {
    const size_t n = (size_t)a->width;
    for (size_t j = 0; j < n; ++j)
        for (size_t i = 0; i <= j; ++i) {
            const double raw = gram[j * n + i], centred = raw - sums[i] * sums[j] / rows;
            gram[j * n + i] = gram[i * n + j] = entry_in_units(a, raw, centred, i, j, sums[i], sums[j], rows, detrend);
        }
}

static void finish_exact(const okid_accumulator_t* a, okid_detrend_t detrend, double rows, const int64_t* sums,
                         double* gram) {
    const size_t n = (size_t)a->width;
    for (size_t j = 0; j < n; ++j)
        for (size_t i = 0; i <= j; ++i) {
            const int64_t high = ((const int64_t*)gram)[j * n + i], low = *low_word(a, gram, i, j);
            const double raw = wide_double(high, low),
                         centred = wide_centred(high, low, sums[i], sums[j], (int64_t)rows);
            gram[j * n + i] = gram[i * n + j] =
                entry_in_units(a, raw, centred, i, j, (double)sums[i], (double)sums[j], rows, detrend);
        }
}

okid_status_t okid_accumulator_gram(okid_accumulator_t* self, okid_detrend_t detrend, double* gram, double* mean) {
    if (!self || !gram) return OKID_ERR_NULL;
    okid_accumulator_settle(self);
    const double rows = row_weight(self);
    if (!(rows > 0)) return OKID_ERR_TOO_SHORT;
    const int exact = acc_base_is_exact(self);
    if (exact)
        gram_of_exact(self, gram);
    else if (acc_has_codes(self))
        gram_of_mixed(self, gram);
    else
        gram_of_double(self, gram);
    double* sums = acc_scratch(self) + self->width; // the first half may hold low words of the diagonal
    lag_sums(self, exact, sums);
    for (int32_t r = 0; mean && r < self->m; ++r) {
        const double sum = exact ? (double)((const int64_t*)sums)[r] : sums[r];
        mean[r] = acc_scale(self)[r] * sum / rows + acc_scale(self)[self->m + r];
    }
    if (exact)
        finish_exact(self, detrend, rows, (const int64_t*)sums, gram);
    else
        finish_double(self, detrend, rows, sums, gram);
    return OKID_OK;
}
