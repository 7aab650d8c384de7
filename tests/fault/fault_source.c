// SPDX-License-Identifier: MIT
#include "fault_source.h"

#include <errno.h>
#include <string.h>

enum { QUIET_FIRST = 20, QUIET_LAST = 40, CLOCK_APART = 64, FLIP_APART = 12 };

static const int64_t begin_ns = INT64_C(1700000000000000000), hour_ns = INT64_C(3600000000000);

const char* fault_name(fault_kind_t kind) {
    static const char* const names[FAULT_KINDS] = {"drop",         "overflow", "duplicate", "reorder", "flip data",
                                                   "flip counter", "truncate", "oversize",  "foreign", "error frame",
                                                   "down",         "gone",     "interrupt", "again",   "fail",
                                                   "short",        "clock",    "stamp wrap"};
    return names[kind];
}

static uint32_t draw(fault_source_t* self, uint32_t below) {
    self->random ^= self->random << 13;
    self->random ^= self->random >> 7;
    self->random ^= self->random << 17;
    return (uint32_t)(self->random >> 32) % below;
}

static int happens(fault_source_t* self, fault_kind_t kind) {
    return self->plan.per_mille[kind] > 0 && draw(self, 1000) < self->plan.per_mille[kind];
}

static void put_frame(fault_source_t* self, const drv_frame_t* frame, int64_t late) {
    self->queue[self->queued] = *frame;
    self->due[self->queued++] = 2 * self->sent + late;
    ++self->sent;
}

static drv_frame_t next_true_frame(fault_source_t* self) {
    drv_frame_t frame;
    memset(&frame, 0, sizeof frame);
    const uint32_t counter = self->plan.first_counter + (uint32_t)self->sample;
    frame.id = 0x100 + (uint32_t)self->lane;
    frame.len = 8;
    frame.time_ns = begin_ns + self->sample * self->plan.period_ns + self->lane * 20000 + self->clock_ns;
    frame.hw_time_ns = self->sample * self->plan.period_ns + self->lane * 20000 + 1 - self->wrap_ns;
    frame.data[0] = (uint8_t)counter;
    frame.data[1] = (uint8_t)(counter >> 8);
    for (int i = 0; i < 4; ++i) frame.data[4 + i] = (uint8_t)(self->sample >> 8 * i);
    if (++self->lane == self->plan.lanes) {
        self->lane = 0;
        if (++self->sample == self->plan.samples) self->at_end = 1;
    }
    return frame;
}

static void begin_outage(fault_source_t* self, fault_kind_t kind, uint8_t loss) {
    ++self->done[kind];
    self->missing = 1 + (int32_t)draw(self, 200);
    self->missing_by = kind;
    self->loss = loss;
}

static void lose(fault_source_t* self, fault_kind_t kind) { ++self->lost[kind]; }

/// What befalls the stream as a whole before this frame.
static void disturb_stream(fault_source_t* self) {
    if (happens(self, FAULT_OVERFLOW)) begin_outage(self, FAULT_OVERFLOW, DRV_LOSS_OVERFLOW);
    if (happens(self, FAULT_DOWN)) {
        begin_outage(self, FAULT_DOWN, DRV_LOSS_LINK);
        self->pending_error = ENETDOWN;
        self->pending_reads = 1;
    }
    if (happens(self, FAULT_GONE)) {
        begin_outage(self, FAULT_GONE, DRV_LOSS_LINK);
        self->pending_error = ENODEV;
        self->pending_reads = 1 + (int)draw(self, 5);
    }
    if (happens(self, FAULT_CLOCK) && self->sample - self->last_clock_at > CLOCK_APART &&
        self->sent - self->last_clock_sent > CLOCK_APART) { // none is on its way any more that was stamped before
        ++self->done[FAULT_CLOCK];
        self->clock_ns += draw(self, 2) ? hour_ns : -hour_ns;
        self->clock_just_set = 1;
        self->last_clock_at = self->sample;
        self->last_clock_sent = self->sent;
    }
    if (happens(self, FAULT_STAMP_WRAP)) {
        ++self->done[FAULT_STAMP_WRAP];
        self->wrap_ns = self->sample * self->plan.period_ns;
    }
    if (happens(self, FAULT_ERROR_FRAME)) {
        drv_frame_t frame;
        memset(&frame, 0, sizeof frame);
        frame.id = 0x100 + draw(self, FAULT_LANES); // "restarted" has the number of a lane
        frame.flags = draw(self, 2) ? DRV_FRAME_ERROR : DRV_FRAME_REMOTE;
        frame.len = 8;
        ++self->done[FAULT_ERROR_FRAME];
        put_frame(self, &frame, 0);
    }
}

/// What befalls one frame. @return 1 when it is still one that the grid can place
static int damage(fault_source_t* self, drv_frame_t* frame) {
    if (happens(self, FAULT_FLIP_DATA)) {
        ++self->done[FAULT_FLIP_DATA];
        frame->data[2 + draw(self, 2)] ^= (uint8_t)(1u << draw(self, 8));
    }
    if (happens(self, FAULT_OVERSIZE)) {
        ++self->done[FAULT_OVERSIZE];
        frame->len = (uint8_t)(9 + draw(self, 247));
    }
    if (self->sample - self->last_flip_at >= FLIP_APART && happens(self, FAULT_FLIP_COUNTER)) {
        self->last_flip_at = self->sample; // two in a row that agree would be a sender that began anew
        ++self->done[FAULT_FLIP_COUNTER];
        frame->data[draw(self, 2)] ^= (uint8_t)(1u << draw(self, 8));
        lose(self, FAULT_FLIP_COUNTER);
        return 0;
    }
    if (happens(self, FAULT_TRUNCATE)) {
        ++self->done[FAULT_TRUNCATE];
        frame->len = (uint8_t)draw(self, 8);
        lose(self, FAULT_TRUNCATE);
        return 0;
    }
    if (happens(self, FAULT_FOREIGN)) {
        ++self->done[FAULT_FOREIGN];
        frame->id = 0x200 + draw(self, 0x600);
        lose(self, FAULT_FOREIGN);
        return 0;
    }
    return 1;
}

static void produce(fault_source_t* self) {
    const int quiet = self->sample < QUIET_FIRST || self->sample >= self->plan.samples - QUIET_LAST;
    // In a log a pause and a set clock look alike.
    const int clock_near = self->plan.raw_stamps && self->sample - self->last_clock_at < 4;
    if (!quiet && self->missing == 0) disturb_stream(self);
    drv_frame_t frame = next_true_frame(self);
    if (quiet) self->missing = 0;
    if (self->missing > 0 && !clock_near) {
        --self->missing;
        lose(self, self->missing_by);
        return;
    }
    if (!quiet && !clock_near && happens(self, FAULT_DROP)) {
        ++self->done[FAULT_DROP];
        lose(self, FAULT_DROP);
        return;
    }
    frame.loss = self->loss;
    self->loss = 0;
    const int good = quiet || damage(self, &frame);
    self->good += (uint64_t)good;
    int64_t late = 0;
    if (!quiet && happens(self, FAULT_REORDER)) {
        ++self->done[FAULT_REORDER];
        late = 2 * (1 + (int64_t)draw(self, FAULT_REORDER_MOST)) + 1;
    }
    put_frame(self, &frame, late);
    if (good && !quiet && happens(self, FAULT_DUPLICATE)) {
        ++self->done[FAULT_DUPLICATE];
        frame.loss = 0;
        put_frame(self, &frame, 2 * (int64_t)draw(self, FAULT_REORDER_MOST));
    }
}

/// The queued frame whose turn it is, -1 when later frames may still come before it.
static int32_t next_due(const fault_source_t* self) {
    int32_t best = -1;
    for (int32_t i = 0; i < self->queued; ++i)
        if (best < 0 || self->due[i] < self->due[best]) best = i;
    if (best >= 0 && !self->at_end && self->due[best] >= 2 * self->sent) return -1;
    return best;
}

static void look_at_clock(fault_source_t* self) {
    const int64_t now = begin_ns + (self->sample + 1) * self->plan.period_ns;
    const drv_clock_pair_t real = {now - 1000, now + self->clock_ns, now + 1000};
    (void)drv_host_clock_look(&self->clock, &real);
}

/// As a socket does: the clock may be set after the frames were stamped and before it is looked at.
static void carry_stamps(fault_source_t* self, drv_frame_t* frames, int count) {
    look_at_clock(self);
    for (int i = 0; i < count; ++i)
        if (frames[i].time_ns) frames[i].time_ns = drv_host_clock_carry(&self->clock, frames[i].time_ns);
}

static int fault_read(drv_source_t* source, drv_frame_t* frames, int capacity) {
    fault_source_t* self = source->state;
    if (self->pending_reads > 0) {
        --self->pending_reads;
        return -self->pending_error;
    }
    static const int failures[] = {EIO, ENOMEM, ENOBUFS};
    static const struct {
        fault_kind_t kind;
        int error;
    } passing[] = {{FAULT_INTERRUPT, EINTR}, {FAULT_AGAIN, EAGAIN}, {FAULT_FAIL, 0}};
    for (int i = 0; i < 3; ++i) {
        if (!happens(self, passing[i].kind)) continue;
        ++self->done[passing[i].kind];
        self->pending_error = passing[i].error ? passing[i].error : failures[draw(self, 3)];
        self->pending_reads = (int)draw(self, 20);
        return -self->pending_error;
    }
    if (happens(self, FAULT_SHORT)) {
        ++self->done[FAULT_SHORT];
        capacity = (int)draw(self, 3);
    }
    int count = 0;
    while (count < capacity) {
        const int32_t at = next_due(self);
        if (at >= 0) {
            frames[count++] = self->queue[at];
            self->queue[at] = self->queue[--self->queued];
            self->due[at] = self->due[self->queued];
        } else if (self->at_end) {
            if (count == 0) return DRV_END;
            break;
        } else {
            produce(self);
            if (self->pending_reads > 0 || self->clock_just_set) break;
        }
    }
    self->clock_just_set = 0;
    if (!self->plan.raw_stamps) carry_stamps(self, frames, count);
    return count;
}

static int fault_open(drv_source_t* source, const drv_source_config_t* config) {
    (void)source;
    (void)config;
    return 0;
}
static int fault_fd(const drv_source_t* source) {
    (void)source;
    return -1;
}
static void fault_stats(drv_source_t* source, drv_stats_t* out) { *out = source->counts; }
static void fault_close(drv_source_t* source) { (void)source; }

void fault_source_make(fault_source_t* self, const fault_plan_t* plan) {
    static const drv_source_ops_t ops = {fault_open, fault_fd, fault_read, fault_stats, fault_close};
    memset(self, 0, sizeof *self);
    self->plan = *plan;
    self->random = UINT64_C(0x9E3779B97F4A7C15) * (plan->seed + UINT64_C(1));
    self->last_clock_at = self->last_clock_sent = -CLOCK_APART;
    self->source.ops = &ops;
    self->source.state = self;
    look_at_clock(self);
    for (int i = 0; i < 8; ++i) (void)draw(self, 2);
}
