// SPDX-License-Identifier: MIT
// PURPOSE  samples off a serial line as frames, every loss counted and placed
// METHOD   bytes go straight into the decoder; a packet is handed out frame by frame. Packets read together are
//          stamped in their order, microseconds apart (a baud rate may be nominal and tells no more), the samples of a
//          packet back from its arrival at the sample rate; the device's clock, unwrapped, goes along
#include "line_link.h"

#include <drv/line_frame.h>

#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { READS_A_CALL = 4, READS_BETWEEN_COUNTS = 64 };

static const int64_t byte_ns = 250;          // apart, so that packets read together differ
static const int64_t clock_set = 1000000000; // ns: so far back is no order of packets but a clock that was set

typedef struct serial_t {
    line_link_t link;
    drv_decoder_t decoder;
    double period_ns;
    int64_t arrived_ns;     ///< of the bytes in the decoder
    int64_t stamped_ns;     ///< the newest stamp handed out
    unsigned sample, field; ///< of the packet at hand, next to go out
    int open_packet;
    unsigned reads;
    uint16_t kind;           ///< first field of the packets that count the samples of a line without any time
    uint64_t passed, before; ///< samples so far; before the packet at hand
    // the device's clock, unwrapped
    int timed;
    uint64_t device_ns, device_wrapped_ns;
    int64_t device_seen_ns; ///< host time then
} serial_t;

static int serial_open(drv_source_t* self, const drv_source_config_t* config) {
    memset(&self->counts, 0, sizeof self->counts);
    self->error[0] = '\0';
    self->state = NULL;
    if (!(config->line.rate_hz > 0) || config->line.framing >= DRV_FRAMINGS) {
        snprintf(self->error, sizeof self->error, "%.200s: a serial line needs a framing and a sample rate above 0",
                 config->line.device ? config->line.device : "");
        return -EINVAL;
    }
    serial_t* state = calloc(1, sizeof *state);
    if (!state) {
        snprintf(self->error, sizeof self->error, "out of memory");
        return -ENOMEM;
    }
    const int status = line_link_open(&state->link, self, &config->line);
    if (status != 0) {
        free(state);
        return status;
    }
    drv_decoder_init(&state->decoder, config->line.framing, config->line.counter);
    state->period_ns = 1e9 / config->line.rate_hz;
    self->state = state;
    self->counts.stamp = DRV_STAMP_US;
    return 0;
}

static int serial_fd(const drv_source_t* self) {
    const serial_t* state = self->state;
    return state ? state->link.port.fd : -1;
}

/// The device's clock without its wraps; how often it went round during a silence the host's clock tells.
static void unwrap_time(serial_t* state, const drv_packet_t* packet) {
    if (!packet->timed) return;
    if (!state->timed || packet->time_bits >= 64) {
        state->device_ns = packet->time_ns;
    } else {
        const uint64_t range_ns = ((uint64_t)1 << packet->time_bits) * 1000;
        const uint64_t step = (packet->time_ns + range_ns - state->device_wrapped_ns) % range_ns;
        const double pause = (double)(state->arrived_ns - state->device_seen_ns);
        const double rounds = round((pause - (double)step) / (double)range_ns);
        state->device_ns += step + (rounds > 0 && rounds < 1000 ? (uint64_t)rounds * range_ns : 0);
    }
    state->timed = 1;
    state->device_wrapped_ns = packet->time_ns;
    state->device_seen_ns = state->arrived_ns;
}

/// Host time of the sample at hand. Bytes without a stamp (a file of them) begin at 1 s.
static int64_t stamp(const serial_t* state, const drv_packet_t* packet) {
    const unsigned behind = packet->samples - 1U - state->sample;
    if (state->arrived_ns != 0) {
        const size_t unread = state->decoder.end - state->decoder.begin + state->link.waiting;
        return state->arrived_ns - (int64_t)unread * byte_ns - (int64_t)((double)behind * state->period_ns);
    }
    if (packet->timed) return 1000000000 + (int64_t)state->device_ns + (int64_t)(state->sample * state->period_ns);
    return 1000000000 + (int64_t)((double)(state->before + state->sample) * state->period_ns);
}

/// The next frame of the packet at hand.
static void next_frame(drv_source_t* self, serial_t* state, drv_frame_t* frame) {
    const drv_packet_t* packet = &state->decoder.packet;
    const unsigned together = drv_framings[state->decoder.framing].fields;
    const unsigned left = packet->fields - state->field;
    memset(frame, 0, offsetof(drv_frame_t, data));
    drv_line_frame_fill(
        frame, (packet->first_field + state->field) / together, packet->counted ? packet->sequence + state->sample : 0,
        packet->values + (size_t)state->sample * packet->fields + state->field, left < together ? left : together);
    frame->time_ns = stamp(state, packet);
    if (frame->time_ns < state->stamped_ns && state->stamped_ns - frame->time_ns < clock_set)
        frame->time_ns = state->stamped_ns; // bytes that waited through two reads are not earlier for it
    state->stamped_ns = frame->time_ns;
    if (packet->timed) {
        frame->hw_time_ns = (int64_t)(state->device_ns + (uint64_t)((double)state->sample * state->period_ns));
        if (frame->hw_time_ns == 0) frame->hw_time_ns = 1; // 0 means none
    }
    frame->loss = state->link.loss;
    state->link.loss = 0;
    ++self->counts.received;
    state->field += together;
    if (state->field < packet->fields) return;
    state->field = 0;
    if (++state->sample == packet->samples) state->open_packet = 0;
}

/// Devices that send one packet for each quantity send all of them once a sample: those of the first kind count.
static void count_samples(serial_t* state, const drv_packet_t* packet) {
    if (state->passed == 0) state->kind = packet->first_field;
    if (packet->first_field != state->kind) return;
    state->before = state->passed;
    state->passed += packet->samples;
}

static int next_packet(drv_source_t* self, serial_t* state) {
    const int found = drv_decoder_next(&state->decoder);
    self->counts.damaged = state->decoder.damaged;
    self->counts.skipped = state->decoder.skipped;
    if (!found) return 0;
    if (found == 2) state->link.loss |= DRV_LOSS_CRC;
    state->open_packet = 1;
    state->sample = state->field = 0;
    unwrap_time(state, &state->decoder.packet);
    count_samples(state, &state->decoder.packet);
    return 1;
}

/// @return 1 when more bytes came
static int fetch(drv_source_t* self, serial_t* state) {
    uint8_t* at = NULL;
    int torn = 0;
    const size_t room = drv_decoder_room(&state->decoder, &at);
    const int got = line_link_read(&state->link, self, at, room, &torn);
    if (torn) { // what was begun is never finished
        if (got > 0) memmove(state->decoder.bytes, at, (size_t)got);
        drv_decoder_restart(&state->decoder);
    }
    if (got <= 0) return 0;
    state->arrived_ns = line_link_time(&state->link);
    drv_decoder_add(&state->decoder, (size_t)got);
    if (++state->reads % READS_BETWEEN_COUNTS == 0) line_link_count(&state->link, self);
    return 1;
}

static int serial_read(drv_source_t* self, drv_frame_t* frames, int capacity) {
    serial_t* state = self->state;
    if (!state) return -EBADF;
    int count = 0, reads = 0;
    while (count < capacity) {
        if (state->open_packet || next_packet(self, state))
            next_frame(self, state, &frames[count++]);
        else if ((reads++ >= READS_A_CALL && state->link.waiting == 0) || !fetch(self, state))
            break;
    }
    return count;
}

static void serial_stats(drv_source_t* self, drv_stats_t* out) {
    serial_t* state = self->state;
    if (state) line_link_count(&state->link, self);
    *out = self->counts;
}

static void serial_close(drv_source_t* self) {
    serial_t* state = self->state;
    if (!state) return;
    line_link_count(&state->link, self);
    drv_serial_close(&state->link.port);
    free(state);
    self->state = NULL;
}

const drv_source_ops_t drv_source_serial = {serial_open, serial_fd, serial_read, serial_stats, serial_close};
