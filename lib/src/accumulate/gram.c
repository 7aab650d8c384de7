// SPDX-License-Identifier: MIT
// PURPOSE    Gram matrix of [v_n; v_(n-1); ..; v_(n-p)] in engineering units from an accumulator, offsets removed
// METHOD     gram_sums.h off the diagonal, in the numbers of the sums; exact sums take two words an entry: the high ones
//            stand in the upper triangle, the low ones in the lower. The lag-row sums g stand on the diagonal meanwhile; its own
//            entries are walked last. Centring of codes: with c the mean rounded to a code and r = g - N c the small rest,
//            G - g g^T/N = (G - N c c^T - r c^T - c r^T) - r r^T/N, the bracket in integers
// REFERENCE  docs/numerics.md, central idea
// NUMERICS   codes: one rounding an entry; doubles: a few eps of the largest entry of the diagonal
// WORKSPACE  none beside the caller's matrix
#include "accumulator.h"
#include "wide.h"

#include <math.h>

/// The products of an end of a run, column by column; the samples stand in order below the diagonal of the first column meanwhile.
static void add_ends(const okid_accumulator_t* a, double* gram, double sign, const double* ends) {
    const size_t m = (size_t)a->m, n = (size_t)a->width;
    for (size_t i = m, l = 0; i < n; i += m, ++l)
        for (size_t c = 0; c < m; ++c) gram[i + c] = ends[acc_end(a, l, c)];
    for (size_t j = m; j < n; ++j) {
        const double *const sample = gram, number = sign * gram[j];
        double* const column = gram + j * n;
        for (size_t i = m; i < j; ++i) column[i] += sample[i] * number;
    }
}

// Doubles.
#define SUFFIX double
#define ADD_SLOT(i, j, data, k) (gram[(j) * n + (i)] += (data)[k])
#define ADD_BASE(i, j, base, k) (gram[(j) * n + (i)] += (base)[k])
#define ADD_EDGE(i, j, edge, k) (gram[(j) * n + (i)] += (edge)[k])
#define ADD_ENDS add_ends
#define ADD_ENTRY(i, j, i2, j2) (gram[(j) * n + (i)] += gram[(j2) * n + (i2)])
#include "gram_sums.h"

/// The same of one unbroken run alone, the usual case: each entry in one step from the one a lag before. @return 0: it is another case
static int gram_of_run(const okid_accumulator_t* a, double* gram) {
    acc_piece_t run;
    if (a->closed > 0 || a->base_weight > 0 || !acc_piece(a, 0, &run) || !run.head || !run.tail) return 0;
    const size_t m = (size_t)a->m, n = (size_t)a->width, p = (size_t)a->config.lags;
    double *const head = gram, *const tail = gram + n; // in order, below the diagonal meanwhile
    for (size_t b = 0, j = 0; b <= p; ++b)
        for (size_t c = 0; c < m; ++c, ++j)
            for (size_t i = 0; i < m && i < j; ++i) gram[j * n + i] = run.data[i * n + (p - b) * m + c];
    for (size_t i = m, l = 0; i < n; i += m, ++l)
        for (size_t c = 0; c < m; ++c) {
            head[i + c] = run.head[acc_end(a, l, c)];
            tail[i + c] = run.tail[acc_end(a, l, c)];
        }
    for (size_t j = m; j < n; ++j) {
        const double enters = head[j], leaves = tail[j], *before = gram + (j - m) * n;
        double* const column = gram + j * n;
        for (size_t i = m; i < j; ++i) column[i] = head[i] * enters - tail[i] * leaves + before[i - m];
    }
    return 1;
}

// Codes with forgetting: exact slots, a fading base in double.
static double slot_number(const okid_accumulator_t* a, const double* data, size_t k) {
    if (!acc_has_codes(a)) return data[k];
    const int64_t* words = (const int64_t*)data;
    return wide_double(words[acc_sum_count(a) + k], words[k]);
}
#define SUFFIX mixed
#define ADD_SLOT(i, j, data, k) (gram[(j) * n + (i)] += slot_number(a, data, k))
#define ADD_BASE(i, j, base, k) (gram[(j) * n + (i)] += (base)[k])
#define ADD_EDGE(i, j, edge, k) (gram[(j) * n + (i)] += (edge)[k])
#define ADD_PRODUCT(i, j, sign, x, y) (gram[(j) * n + (i)] += (sign) * (acc_number(a, x) * acc_number(a, y)))
#define ADD_ENTRY(i, j, i2, j2) (gram[(j) * n + (i)] += gram[(j2) * n + (i2)])
#include "gram_sums.h"

// Codes, all exact.
#define HIGH(i, j) ((int64_t*)gram + (j) * n + (i))
#define LOW(i, j) ((int64_t*)gram + (i) * n + (j))
#define SUFFIX exact
#define ADD_SLOT(i, j, data, k)                                                                                        \
    wide_add_wide(HIGH(i, j), LOW(i, j), ((const int64_t*)(data))[acc_sum_count(a) + (k)], ((const int64_t*)(data))[k])
#define ADD_BASE(i, j, base, k) ADD_SLOT(i, j, base, k)
#define ADD_EDGE(i, j, edge, k)                                                                                        \
    wide_add_wide(HIGH(i, j), LOW(i, j), ((const int64_t*)(edge))[acc_edge_count(a) + (k)], ((const int64_t*)(edge))[k])
#define ADD_PRODUCT(i, j, sign, x, y) wide_add(HIGH(i, j), LOW(i, j), (sign) * (acc_code(x) * acc_code(y)))
#define ADD_ENTRY(i, j, i2, j2) wide_add_wide(HIGH(i, j), LOW(i, j), *HIGH(i2, j2), *LOW(i2, j2))
#include "gram_sums.h"
#undef HIGH
#undef LOW

// The sums of the lag rows and the diagonal, entry by entry. What a slot's ends add to lag l + 1 of channel c: x(head) - x(tail).

int64_t okid_accumulator_lag_sum_exact(const okid_accumulator_t* a, size_t i, int64_t before) {
    const size_t m = (size_t)a->m, c = i % m, l = i / m - 1;
    int64_t sum = i < m ? 0 : before;
    for (int32_t k = 0; k <= a->closed; ++k) {
        acc_piece_t piece;
        if (!acc_piece(a, k, &piece)) continue;
        if (i < m)
            sum += ((const int64_t*)piece.data)[acc_slot_sum(a) + c];
        else {
            if (piece.head) sum += acc_code(piece.head + acc_end(a, l, c));
            if (piece.tail) sum -= acc_code(piece.tail + acc_end(a, l, c));
        }
    }
    return a->base_weight > 0 ? sum + ((const int64_t*)acc_base(a))[acc_base_sum(a) + i] : sum;
}

double okid_accumulator_lag_sum(const okid_accumulator_t* a, size_t i, double before) {
    const size_t m = (size_t)a->m, c = i % m, l = i / m - 1;
    double sum = i < m ? 0 : before;
    for (int32_t k = 0; k <= a->closed; ++k) {
        acc_piece_t piece;
        if (!acc_piece(a, k, &piece)) continue;
        if (i < m) {
            const double* at = piece.data + acc_slot_sum(a) + c;
            sum += acc_has_codes(a) ? (double)*(const int64_t*)at : *at;
        } else {
            if (piece.head) sum += acc_number(a, piece.head + acc_end(a, l, c));
            if (piece.tail) sum -= acc_number(a, piece.tail + acc_end(a, l, c));
        }
    }
    return a->base_weight > 0 ? sum + acc_base(a)[acc_base_sum(a) + i] : sum;
}

/// Diagonal entry i, given that of the same channel one lag before.
static void diagonal_exact(const okid_accumulator_t* a, size_t i, int64_t* high, int64_t* low) {
    const size_t m = (size_t)a->m, n = (size_t)a->width, p = (size_t)a->config.lags, c = i % m, l = i / m - 1;
    const size_t at = c * n + p * m + c; // S_0(c, c)
    if (i < m) *high = *low = 0;
    for (int32_t k = 0; k <= a->closed; ++k) {
        acc_piece_t piece;
        if (!acc_piece(a, k, &piece)) continue;
        if (i < m) {
            const int64_t* words = (const int64_t*)piece.data;
            wide_add_wide(high, low, words[acc_sum_count(a) + at], words[at]);
            continue;
        }
        const int64_t enters = piece.head ? acc_code(piece.head + acc_end(a, l, c)) : 0,
                      leaves = piece.tail ? acc_code(piece.tail + acc_end(a, l, c)) : 0;
        wide_add(high, low, enters * enters);
        wide_add(high, low, -(leaves * leaves));
    }
    if (!(a->base_weight > 0)) return;
    const int64_t *base = (const int64_t*)acc_base(a), *edge = base + acc_base_edge(a);
    const size_t j = i - m, packed = j * (j + 1) / 2 + j;
    if (i < m)
        wide_add_wide(high, low, base[acc_sum_count(a) + at], base[at]);
    else
        wide_add_wide(high, low, edge[acc_edge_count(a) + packed], edge[packed]);
}

static double diagonal(const okid_accumulator_t* a, size_t i, double before) {
    const size_t m = (size_t)a->m, n = (size_t)a->width, p = (size_t)a->config.lags, c = i % m, l = i / m - 1;
    const size_t at = c * n + p * m + c;
    double sum = i < m ? 0 : before;
    for (int32_t k = 0; k <= a->closed; ++k) {
        acc_piece_t piece;
        if (!acc_piece(a, k, &piece)) continue;
        if (i < m) {
            sum += slot_number(a, piece.data, at);
            continue;
        }
        const double enters = piece.head ? acc_number(a, piece.head + acc_end(a, l, c)) : 0,
                     leaves = piece.tail ? acc_number(a, piece.tail + acc_end(a, l, c)) : 0;
        sum += enters * enters;
        sum -= leaves * leaves;
    }
    if (!(a->base_weight > 0)) return sum;
    const size_t j = i - m;
    return sum + acc_base(a)[i < m ? at : acc_base_edge(a) + j * (j + 1) / 2 + j];
}

/// What turns an entry of the sums into one of the matrix; the lag-row sums stand on its diagonal.
typedef struct finish_t {
    const okid_accumulator_t* a;
    double* gram;
    double unit, rows; ///< unit: of a number in the sums, in codes
    int64_t count;
    okid_detrend_t detrend;
} finish_t;

static double* on_diagonal(const finish_t* f, size_t i) { return f->gram + i * ((size_t)f->a->width + 1); }
static int64_t whole_sum(const finish_t* f, size_t i) { return *(const int64_t*)on_diagonal(f, i); }

/// raw: without detrending as it is, else already centred.
static double in_units(const finish_t* f, double raw, size_t ci, size_t cj, double gi, double gj) {
    const double *scale = acc_scale(f->a), *offset = scale + f->a->m;
    const double si = scale[ci] * f->unit, sj = scale[cj] * f->unit;
    if (f->detrend == OKID_DETREND_MEAN || f->a->centred) return si * sj * raw;
    return si * sj * raw + si * offset[cj] * gi + offset[ci] * sj * gj + f->rows * offset[ci] * offset[cj];
}

/// Are the numbers of the sums already in engineering units, with no offset?
static int plain(const finish_t* f) {
    const double *scale = acc_scale(f->a), *offset = scale + f->a->m;
    for (int32_t c = 0; c < f->a->m; ++c)
        if (scale[c] * f->unit != 1 || offset[c] != 0) return 0;
    return 1;
}

/// What stands above the diagonal to its other side, in squares that stay in the cache.
static void mirror(double* gram, size_t n) {
    enum { SQUARE = 16 };
    for (size_t J = 0; J < n; J += SQUARE)
        for (size_t I = 0; I <= J; I += SQUARE)
            for (size_t j = J; j < n && j < J + SQUARE; ++j)
                for (size_t i = I; i < j && i < I + SQUARE; ++i) gram[i * n + j] = gram[j * n + i];
}

static void finish_double(const finish_t* f) {
    const size_t m = (size_t)f->a->m, n = (size_t)f->a->width;
    const double centre = f->detrend == OKID_DETREND_MEAN ? 1 / f->rows : 0;
    double* g = f->gram; // the sums of the lag rows, below the diagonal of the first column
    for (size_t i = 0; i < n; ++i) g[i] = *on_diagonal(f, i);
    const int as_it_is = plain(f);
    for (size_t j = 1, cj = 1 % m; j < n; ++j, cj = cj + 1 < m ? cj + 1 : 0) {
        double* const column = f->gram + j * n;
        const double* const sums = g;
        if (as_it_is && centre == 0) continue;
        for (size_t i = 0; i < j; ++i) column[i] -= sums[i] * sums[j] * centre;
        for (size_t i = 0, ci = 0; !as_it_is && i < j; ++i, ci = ci + 1 < m ? ci + 1 : 0)
            column[i] = in_units(f, column[i], ci, cj, sums[i], sums[j]);
    }
    for (size_t c = 0; c < m; ++c) {
        double raw = 0;
        for (size_t i = c; i < n; i += m) {
            const double sum = *on_diagonal(f, i);
            raw = diagonal(f->a, i, raw);
            *on_diagonal(f, i) = in_units(f, raw - sum * sum * centre, c, c, sum, sum);
        }
    }
    mirror(f->gram, n);
}

static double entry_exact(const finish_t* f, int64_t high, int64_t low, size_t ci, size_t cj, int64_t gi, int64_t gj,
                          int64_t mean_i, int64_t mean_j) {
    if (f->detrend != OKID_DETREND_MEAN) return in_units(f, wide_double(high, low), ci, cj, (double)gi, (double)gj);
    const int64_t rest_i = gi - f->count * mean_i, rest_j = gj - f->count * mean_j;
    wide_add_product(&high, &low, -gi, mean_j);
    wide_add_product(&high, &low, -mean_i, rest_j);
    return in_units(f, wide_double(high, low) - (double)rest_i * ((double)rest_j / f->rows), ci, cj, 0, 0);
}

static void finish_exact(const finish_t* f) {
    const size_t m = (size_t)f->a->m, n = (size_t)f->a->width;
    int64_t* words = (int64_t*)f->gram;
    for (size_t j = 0; j < n; ++j) {
        const int64_t gj = whole_sum(f, j), mean_j = okid_accumulator_whole_mean(whole_sum(f, j % m), f->count);
        for (size_t ci = 0; ci < m; ++ci) {
            const int64_t mean_i = okid_accumulator_whole_mean(whole_sum(f, ci), f->count);
            for (size_t i = ci; i < j; i += m)
                f->gram[i * n + j] = f->gram[j * n + i] =
                    entry_exact(f, words[j * n + i], words[i * n + j], ci, j % m, whole_sum(f, i), gj, mean_i, mean_j);
        }
    }
    for (size_t c = 0; c < m; ++c) {
        const int64_t mean = okid_accumulator_whole_mean(whole_sum(f, c), f->count);
        int64_t high = 0, low = 0;
        for (size_t i = c; i < n; i += m) {
            const int64_t g = whole_sum(f, i);
            diagonal_exact(f->a, i, &high, &low);
            *on_diagonal(f, i) = entry_exact(f, high, low, c, c, g, g, mean, mean);
        }
    }
}

okid_status_t okid_accumulator_gram(okid_accumulator_t* self, okid_detrend_t detrend, double* gram, double* mean) {
    if (!self || !gram) return OKID_ERR_NULL;
    okid_accumulator_settle(self);
    const finish_t f = {self,   gram, 1.0 / (1 << acc_fraction(self)), okid_accumulator_weight(self), self->stats.rows,
                        detrend};
    if (!(f.rows > 0)) return OKID_ERR_TOO_SHORT;
    const int exact = acc_base_is_exact(self);
    if (exact)
        gram_of_exact(self, gram);
    else if (acc_has_codes(self))
        gram_of_mixed(self, gram);
    else if (!gram_of_run(self, gram))
        gram_of_double(self, gram);
    const size_t m = (size_t)self->m, n = (size_t)self->width;
    for (size_t i = 0; i < n; ++i) {
        const double* before = i < m ? on_diagonal(&f, i) : on_diagonal(&f, i - m);
        if (exact)
            *(int64_t*)on_diagonal(&f, i) = okid_accumulator_lag_sum_exact(self, i, *(const int64_t*)before);
        else
            *on_diagonal(&f, i) = okid_accumulator_lag_sum(self, i, *before);
    }
    for (size_t r = 0; mean && r < m; ++r) {
        const double sum = exact ? (double)whole_sum(&f, r) : *on_diagonal(&f, r);
        mean[r] = acc_scale(self)[r] * f.unit * sum / f.rows + (self->centred ? 0 : acc_scale(self)[m + r]);
    }
    if (exact)
        finish_exact(&f);
    else
        finish_double(&f);
    return OKID_OK;
}

okid_status_t okid_accumulator_energy(okid_accumulator_t* self, okid_detrend_t detrend, double* energy) {
    if (!self || !energy) return OKID_ERR_NULL;
    okid_accumulator_settle(self);
    const finish_t f = {self,   NULL, 1.0 / (1 << acc_fraction(self)), okid_accumulator_weight(self), self->stats.rows,
                        detrend};
    if (!(f.rows > 0)) return OKID_ERR_TOO_SHORT;
    for (size_t c = 0; c < (size_t)self->m; ++c) {
        if (acc_base_is_exact(self)) {
            const int64_t g = okid_accumulator_lag_sum_exact(self, c, 0),
                          mean = okid_accumulator_whole_mean(g, f.count);
            int64_t high = 0, low = 0;
            diagonal_exact(self, c, &high, &low);
            energy[c] = entry_exact(&f, high, low, c, c, g, g, mean, mean);
        } else {
            const double g = okid_accumulator_lag_sum(self, c, 0), raw = diagonal(self, c, 0);
            energy[c] = in_units(&f, detrend == OKID_DETREND_MEAN ? raw - g * g / f.rows : raw, c, c, g, g);
        }
    }
    return OKID_OK;
}
