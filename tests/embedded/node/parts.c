// SPDX-License-Identifier: MIT
// PURPOSE  deviations without a second record in memory: the sums at the ends of parts, their differences, what leaving one out
//          changes. When there is no room two parts become one, and from then on parts are twice as long
// REFERENCE docs/howto/port-to-a-board.md; infinitesimal jackknife, Efron (1982)
#include "parts.h"

#include <string.h>

#if NODE_PARTS

enum { M = NODE_CHANNELS, P = NODE_P, FIRST_LENGTH = 128 };

void parts_reset(parts_t* self) {
    self->ended = 0;
    self->length = FIRST_LENGTH;
}

static void end_part(parts_t* self, okid_accumulator_t* sums) {
    double head[M * P]; // that of the first part is the whole's
    part_t* end = &self->at[self->ended];
    okid_run_sums_t run = {.S = end->S, .head = head, .tail = end->tail, .sum = end->sum};
    if (okid_accumulator_run(sums, OKID_DETREND_NONE, &run) != OKID_OK) return;
    end->rows = run.rows;
    if (++self->ended < NODE_PARTS) return;
    for (int32_t k = 0; k < NODE_PARTS / 2; ++k) self->at[k] = self->at[2 * k + 1];
    self->ended = NODE_PARTS / 2;
    self->length *= 2;
}

void parts_look(parts_t* self, okid_accumulator_t* sums) {
    const int64_t rows = okid_accumulator_rows(sums);
    if (self->ended > 0 && rows < self->at[self->ended - 1].rows)
        parts_reset(self); // a gap has dropped what was before
    if (rows >= (self->ended > 0 ? self->at[self->ended - 1].rows : 0) + self->length) end_part(self, sums);
}

/// Sums up to each end from those of each part (sign 1), or back (-1).
static void add_up(parts_t* self, int32_t count, int32_t sign) {
    for (int32_t step = 1; step < count; ++step) {
        part_t* to = &self->at[sign > 0 ? step : count - step];
        const part_t* from = to - 1;
        for (size_t i = 0; i < sizeof to->S / sizeof *to->S; ++i) to->S[i] += sign * from->S[i];
        for (int32_t i = 0; i < M; ++i) to->sum[i] += sign * from->sum[i];
        to->rows += sign * from->rows;
    }
}

int32_t parts_count(const parts_t* self) { return self->ended + 1; }

okid_status_t parts_leave_out(parts_t* self, const okid_observer_config_t* config, double ridge,
                              const okid_run_sums_t* whole, const okid_real_t* theta, void* work, size_t bytes) {
    part_t* rest = &self->at[self->ended];
    memcpy(rest->S, whole->S, sizeof rest->S);
    memcpy(rest->tail, whole->tail, sizeof rest->tail);
    memcpy(rest->sum, whole->sum, sizeof rest->sum);
    rest->rows = whole->rows;
    const int32_t count = parts_count(self);
    okid_run_sums_t run[PARTS_MOST];
    add_up(self, count, -1);
    for (int32_t k = 0; k < count; ++k) {
        part_t* at = &self->at[k];
        run[k] = (okid_run_sums_t){at->S, k > 0 ? at[-1].tail : whole->head, at->tail, at->sum, NULL, at->rows};
    }
    const okid_status_t status = okid_structured_leave_out(config, OKID_DETREND_MEAN, whole, ridge, theta, run, count,
                                                           self->change[0], work, bytes);
    add_up(self, count, 1);
    return status;
}

const okid_real_t* parts_theta(parts_t* self, int32_t b, const okid_real_t* theta) {
    okid_real_t* out = self->change[b];
    for (int32_t i = 0; i < NODE_OUTPUTS * PARTS_Q; ++i) out[i] += theta[i];
    return out;
}

double parts_scale(const parts_t* self) {
    const double rows = (double)self->at[self->ended].rows;
    double left = 1;
    for (int32_t k = 0; k <= self->ended; ++k) {
        const double share = (double)(self->at[k].rows - (k > 0 ? self->at[k - 1].rows : 0)) / rows;
        left -= share * share;
    }
    return 1 / left;
}

#endif
