// SPDX-License-Identifier: MIT
// PURPOSE    the per-sample part of the accumulator: samples, gaps, what is missing, what is counted
// METHOD     samples wait in x behind the last p ones until `buffer` are there; then the kernel takes them all. It adds in the
//            order of the samples, so that neither the cut into calls nor the buffer changes a bit
// REFERENCE  paper eq. (36)-(38) without the zero columns
// NUMERICS   codes: exact, bounds in the public header; doubles: plain sums
// WORKSPACE  none; touches the open slot and x only
#include "accumulator.h"
#include "counts.h"
#include "source.h"
#include "wide.h"

/// Rows the kernel may sum before they are folded into pairs (see the public header).
static int64_t fold_rows(okid_sample_t sample) {
#ifdef OKID_INTEGER_KERNEL
    return sample == OKID_SAMPLE_INT16 ? INT64_C(1) << 32 : INT64_C(1) << 16;
#else
    return sample == OKID_SAMPLE_INT16 ? 1 << 22 : sample == OKID_SAMPLE_INT24 ? 1 << 7 : 1 << 20;
#endif
}

/// Move the sums of the kernel into the pairs of the open slot.
static void fold_partial(okid_accumulator_t* a) {
    if (a->partial_rows == 0) return;
    int64_t* low = (int64_t*)acc_slot_data(a, a->open);
    const size_t count = acc_sum_count(a);
    int64_t* high = low + count;
    a->partial_rows = 0;
#ifdef OKID_INTEGER_KERNEL
    for (size_t i = 0; i < count; ++i) {
        high[i] += low[i] >> WIDE_BITS;
        low[i] &= WIDE_MASK;
    }
#else
    double* partial = acc_at(a, a->partial_at);
    if (a->config.sample == OKID_SAMPLE_INT32) {
        for (size_t i = 0; i < count; ++i) {
            wide_add_shifted(high + i, low + i, (int64_t)partial[i], 32);
            wide_add_shifted(high + i, low + i, (int64_t)partial[count + i], 16);
            wide_add_shifted(high + i, low + i, (int64_t)partial[2 * count + i], 0);
        }
        memset(partial, 0, 3 * count * sizeof *partial);
    } else {
        for (size_t i = 0; i < count; ++i) wide_add_shifted(high + i, low + i, (int64_t)partial[i], 0);
        memset(partial, 0, count * sizeof *partial);
    }
#endif
}

#ifdef OKID_INTEGER_KERNEL
static void sum_codes(okid_accumulator_t* a, const double* x, int32_t count) {
    int64_t *low = (int64_t*)acc_slot_data(a, a->open), *high = low + acc_sum_count(a);
    okid_kernel_integer(low, a->config.sample == OKID_SAMPLE_INT32 ? high : NULL, (const int64_t*)x + acc_lag_count(a),
                        (const int64_t*)x, a->m, a->m, a->config.lags, count);
}
#else
/// 32-bit codes: kernel on the high and low halves of the codes, x = high 2^16 + low, 0 <= low < 2^16.
static void sum_codes(okid_accumulator_t* a, const double* x, int32_t count) {
    okid_kernel_fn* const kernel = okid_kernel_pick();
    const int32_t m = a->m, p = a->config.lags;
    double* partial = acc_at(a, a->partial_at);
    if (a->config.sample != OKID_SAMPLE_INT32) {
        kernel(partial, x + acc_lag_count(a), x, m, m, p, count, p + count);
        return;
    }
    const size_t numbers = (size_t)(p + count) * (size_t)m, sums = acc_sum_count(a);
    double *high = acc_at(a, a->split_at), *low = high + (size_t)(p + a->config.buffer) * (size_t)m;
    for (size_t i = 0; i < numbers; ++i) {
        const int32_t code = (int32_t)x[i];
        const int32_t upper = code >> 16;
        high[i] = upper;
        low[i] = code - upper * 65536;
    }
    const double *now_high = high + acc_lag_count(a), *now_low = low + acc_lag_count(a);
    kernel(partial, now_high, high, m, m, p, count, p + count);
    kernel(partial + sums, now_high, low, m, m, p, count, p + count);
    kernel(partial + sums, now_low, high, m, m, p, count, p + count);
    kernel(partial + 2 * sums, now_low, low, m, m, p, count, p + count);
}
#endif

static void run_kernel(okid_accumulator_t* a, const double* x, int32_t count) {
    if (!acc_has_codes(a)) {
        okid_kernel_pick()(acc_slot_data(a, a->open), x + acc_lag_count(a), x, a->m, a->m, a->config.lags, count,
                           a->config.lags + count);
        return;
    }
    const int64_t limit = fold_rows(a->config.sample);
    while (count > 0) {
        if (a->partial_rows == limit) fold_partial(a);
        const int64_t left = limit - a->partial_rows;
        const int32_t piece = count < left ? count : (int32_t)left;
        sum_codes(a, x, piece);
        a->partial_rows += piece;
        x += (size_t)piece * (size_t)a->m;
        count -= piece;
    }
}

/// The slot begins: the p samples before its first row are its head.
static void keep_head(okid_accumulator_t* a, const double* history) {
    if (acc_slot(a, a->open)->rows == 0)
        memcpy(acc_slot_data(a, a->open) + acc_slot_head(a), history, acc_lag_count(a) * sizeof *history);
}

/// sum += rows of m numbers, each channel in the order of its samples; some channels side by side.
static void add_rows(double* sum, const double* rows, size_t m, size_t count) {
    enum { TILE = 4 };
    size_t r = 0;
    for (; r + TILE <= m; r += TILE) {
        double tile[TILE];
        for (size_t k = 0; k < TILE; ++k) tile[k] = sum[r + k];
        for (size_t n = 0; n < count; ++n)
            for (size_t k = 0; k < TILE; ++k) tile[k] += rows[n * m + r + k];
        for (size_t k = 0; k < TILE; ++k) sum[r + k] = tile[k];
    }
    for (; r < m; ++r) {
        double one = sum[r];
        for (size_t n = 0; n < count; ++n) one += rows[n * m + r];
        sum[r] = one;
    }
}

/// Sum `count` rows; x holds the p samples before them and then theirs.
static void sum_rows(okid_accumulator_t* a, const double* x, int32_t count) {
    const int32_t m = a->m;
    keep_head(a, x);
    run_kernel(a, x, count);
    double* sum = acc_slot_data(a, a->open) + acc_slot_sum(a);
    const double* newest = x + acc_lag_count(a);
    if (!acc_has_codes(a)) add_rows(sum, newest, (size_t)m, (size_t)count);
    for (int32_t n = 0; acc_has_codes(a) && n < count; ++n, newest += m)
        for (int32_t r = 0; r < m; ++r) ((int64_t*)sum)[r] += acc_code(newest + r);
    acc_slot(a, a->open)->rows += count;
}

/// Sum the samples that wait and keep the last p of them as the lag window.
static void flush(okid_accumulator_t* a) {
    if (a->pending == 0) return;
    double* x = acc_x(a);
    sum_rows(a, x, a->pending);
    memmove(x, x + (size_t)a->pending * (size_t)a->m, acc_lag_count(a) * sizeof *x);
    a->pending = 0;
}

/// Bring what the spectra hold into the open slot, of codes rounded to integers.
static void flush_spectrum(okid_accumulator_t* a) {
    if (!acc_bulk_on(&a->config) || !(acc_bulk(a)->energy > 0)) return;
    const int codes = acc_has_codes(a);
    fold_partial(a);
    okid_spectrum_pick().flush(&acc_bulk(a)->plan, acc_spectra(a),
                               codes ? acc_at(a, a->partial_at) : acc_slot_data(a, a->open), codes);
    a->partial_rows = codes; // integers far below 2^53: energy < 2^43 is what the error bound allows
    fold_partial(a);
    acc_bulk(a)->energy = 0;
}

/// May this batch of codes go into the spectra, what they hold brought out before where needed?
static int room_for_batch(okid_accumulator_t* a, const int16_t* codes, size_t count) {
    bulk_t* bulk = acc_bulk(a);
    const double energy = okid_spectrum_energy(a->m, codes, (int32_t)count);
    if (okid_spectrum_error(&bulk->plan, bulk->energy + energy) >= 0.5) flush_spectrum(a);
    if (okid_spectrum_error(&bulk->plan, energy) >= 0.5) return 0;
    bulk->energy += energy;
    return 1;
}

/// The FFT path: take a batch where a window can be filled and sums of codes stay exact; returns the samples taken.
static size_t feed_bulk(okid_accumulator_t* a, source_t source, size_t count) {
    bulk_t* bulk = acc_bulk(a);
    const int16_t* codes = source.kind == FROM_INT16 ? (const int16_t*)source.at : NULL;
    const double* numbers = source.kind == FROM_DOUBLE ? (const double*)source.at : NULL;
    const size_t m = (size_t)a->m, most = (size_t)spectrum_samples(&bulk->plan), lags = acc_lag_count(a);
    if ((!codes && !numbers) || count < (size_t)bulk->plan.length) return 0;
    const size_t total = count < most ? count : most;
    flush(a);
    if (codes && !room_for_batch(a, codes, total)) return 0;
    double* x = acc_x(a);
    keep_head(a, x);
    okid_spectrum_pick().absorb(&bulk->plan, acc_spectra(a), x, codes, numbers, (int32_t)total);
    if (!(bulk->energy > 0)) bulk->energy = 1; // silence counts as rows too
    double* sum = acc_slot_data(a, a->open) + acc_slot_sum(a);
    if (numbers) add_rows(sum, numbers, m, total);
    for (size_t i = 0, r = 0; codes && i < total * m; ++i, r = r + 1 < m ? r + 1 : 0) ((int64_t*)sum)[r] += codes[i];
    copy_in(advance(source, (total - (size_t)bulk->plan.p) * m), x, lags);
    acc_slot(a, a->open)->rows += (int64_t)total;
    a->stats.rows += (int64_t)total;
    a->clock += (int64_t)total;
    return total;
}

void okid_accumulator_settle(okid_accumulator_t* self) {
    flush(self);
    flush_spectrum(self);
    fold_partial(self);
}

void okid_accumulator_gap(okid_accumulator_t* self, int64_t count) {
    if (!self || count < 0) return;
    count = gap_within(count, self->clock);
    if (self->have > 0 || self->in_gap == 0) {
        okid_accumulator_close_slot(self, 0);
        self->have = 0;
        self->stats.gaps += count > 0;
    }
    self->in_gap = 1;
    self->stats.missing += count;
    self->clock += count;
    slot_info_t* slot = acc_slot(self, self->open);
    if (slot->rows == 0) slot->start = self->clock;
}

/// A second run begins where there is no room for the ends of the first: the first is dropped, and counted.
static void make_room(okid_accumulator_t* a) {
    const slot_info_t* slot = acc_slot(a, a->open);
    a->stats.dropped += slot->rows;
    a->stats.rows -= slot->rows;
    okid_accumulator_clear_slot(a, a->open, 0);
}

/// Take up to `count` samples of one run through x; returns how many were taken.
static size_t feed(okid_accumulator_t* a, source_t source, size_t count) {
    const int32_t m = a->m, p = a->config.lags;
    const int arming = a->have < p;
    int64_t room = p - a->have;
    if (!arming) {
        const int64_t left = a->config.block > 0 ? a->config.block - acc_slot(a, a->open)->rows : a->config.buffer;
        room = (left < a->config.buffer ? left : a->config.buffer) - a->pending;
    }
    if (count > (size_t)room) count = (size_t)room;
    const int32_t at = arming ? a->have : p + a->pending;
    copy_in(source, acc_x(a) + (size_t)(at * m), count * (size_t)m);
    a->clock += (int64_t)count;
    a->in_gap = 0;
    slot_info_t* slot = acc_slot(a, a->open);
    if (arming) {
        a->have += (int32_t)count;
        if (slot->rows == 0) slot->start = a->clock;
        return count;
    }
    a->pending += (int32_t)count;
    a->stats.rows += (int64_t)count;
    if (a->config.block > 0 && slot->rows + a->pending == a->config.block)
        okid_accumulator_close_slot(a, 1);
    else if (a->pending == a->config.buffer)
        flush(a);
    return count;
}

/// Doubles without a buffer: rows whose whole lag window lies in the caller's memory are summed there. `before` samples of
/// the run stand in front of `samples`. Returns how many were taken.
static size_t feed_in_place(okid_accumulator_t* a, const double* samples, size_t before, size_t count) {
    const size_t m = (size_t)a->m, p = (size_t)a->config.lags;
    if (before < p || a->have < a->config.lags) return 0;
    const int64_t left = a->config.block > 0 ? a->config.block - acc_slot(a, a->open)->rows : 1 << 20;
    if (count > (size_t)left) count = (size_t)left;
    sum_rows(a, samples - p * m, (int32_t)count);
    memcpy(acc_x(a), samples + count * m - p * m, p * m * sizeof *samples);
    a->clock += (int64_t)count;
    a->stats.rows += (int64_t)count;
    if (a->config.block > 0 && acc_slot(a, a->open)->rows == a->config.block) okid_accumulator_close_slot(a, 1);
    return count;
}

static void feed_run(okid_accumulator_t* a, source_t source, size_t count) {
    if (count > 0 && a->in_gap && a->config.slots == 0 && !a->config.edges) make_room(a);
    a->stats.samples += (int64_t)count;
    for (size_t done = 0; done < count;) {
        size_t taken = 0;
        if (acc_bulk_on(&a->config) && a->have == a->config.lags) taken = feed_bulk(a, source, count - done);
        if (taken == 0 && a->config.buffer == 1 && source.kind == FROM_DOUBLE)
            taken = feed_in_place(a, (const double*)source.at, done, count - done);
        if (taken == 0) taken = feed(a, source, count - done);
        source = advance(source, taken * (size_t)a->m);
        done += taken;
    }
}

/// Feed what is usable, make gaps of the rest.
static okid_status_t feed_usable(okid_accumulator_t* a, source_t source, size_t count) {
    okid_status_t status = OKID_OK;
    while (count > 0) {
        const piece_t piece = next_piece(&source, &count, a->config.sample, (size_t)a->m);
        feed_run(a, piece.source, piece.count);
        if (!piece.missing_behind) continue;
        okid_accumulator_gap(a, 1);
        status = OKID_WARN_MISSING;
    }
    return status;
}

okid_status_t okid_accumulator_add(okid_accumulator_t* self, const double* samples, size_t count) {
    if (!self || (!samples && count > 0)) return OKID_ERR_NULL;
    if (acc_has_codes(self) || self->centred) return OKID_ERR_MISMATCH;
    return feed_usable(self, (source_t){FROM_DOUBLE, samples}, count);
}

okid_status_t okid_accumulator_add_f32(okid_accumulator_t* self, const float* samples, size_t count) {
    if (!self || (!samples && count > 0)) return OKID_ERR_NULL;
    if (acc_has_codes(self) || self->centred) return OKID_ERR_MISMATCH;
    return feed_usable(self, (source_t){FROM_FLOAT, samples}, count);
}

/// Codes: saturated ones are counted and, if the configuration says so, make their sample missing.
static okid_status_t add_codes(okid_accumulator_t* a, source_t source, size_t count, int64_t saturated) {
    a->stats.saturated += saturated;
    if (saturated && a->config.saturated_missing) {
        (void)feed_usable(a, source, count);
        return OKID_WARN_SATURATED;
    }
    feed_run(a, source, count);
    return saturated ? OKID_WARN_SATURATED : OKID_OK;
}

static okid_status_t ready_for_codes(const okid_accumulator_t* a, const void* codes, size_t count, int is_int16) {
    if (!a || (!codes && count > 0)) return OKID_ERR_NULL;
    if (!acc_has_codes(a) || is_int16 != (a->config.sample == OKID_SAMPLE_INT16) || a->centred)
        return OKID_ERR_MISMATCH;
    return a->stats.rows + (int64_t)count > row_limit(a->config.sample) ? OKID_ERR_RANGE : OKID_OK;
}

okid_status_t okid_accumulator_add_i16(okid_accumulator_t* self, const int16_t* codes, size_t count) {
    const okid_status_t status = ready_for_codes(self, codes, count, 1);
    if (status != OKID_OK) return status;
    const source_t source = {FROM_INT16, codes};
    return add_codes(self, source, count, look_at_codes(source, OKID_SAMPLE_INT16, count * (size_t)self->m).saturated);
}

okid_status_t okid_accumulator_add_i32(okid_accumulator_t* self, const int32_t* codes, size_t count) {
    const okid_status_t status = ready_for_codes(self, codes, count, 0);
    if (status != OKID_OK) return status;
    const source_t source = {FROM_INT32, codes};
    const codes_seen_t seen = look_at_codes(source, self->config.sample, count * (size_t)self->m);
    return seen.outside ? OKID_ERR_RANGE : add_codes(self, source, count, seen.saturated);
}
