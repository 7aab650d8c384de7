// SPDX-License-Identifier: MIT
// PURPOSE  CAN frames off an adapter on a serial line, and onto one
// METHOD   lines end with CR (bell = the adapter refuses something); one that is no frame is counted and marks the next
//          frame. The adapter's stamps, milliseconds of a minute, are unwrapped with the host's clock
#include "line_link.h"

#include <drv/slcan.h>

#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { BUFFER_BYTES = 4096, COMMAND_BYTES = 64, COMMAND_MS = 1000, READS_A_CALL = 4 };

typedef struct slcan_t {
    line_link_t link;
    char opening[COMMAND_BYTES];
    size_t opening_length;
    int joined;  ///< a line end was seen: what follows is a whole line
    int endless; ///< the line at hand is longer than any frame
    int stamped; ///< the adapter sends stamps
    int64_t device_ms, device_seen_ns, arrived_ns;
    size_t begin, end;
    char bytes[BUFFER_BYTES];
} slcan_t;

static int is_classic(char letter) { return letter == 't' || letter == 'T' || letter == 'r' || letter == 'R'; }

static int opening_of(const drv_line_config_t* config, char* out, char* error, size_t room) {
    const int length = drv_slcan_opening(out, COMMAND_BYTES, config->bitrate, config->dbitrate, config->btr);
    if (length < 0)
        snprintf(error, room,
                 "%.200s: slcan has no command for bitrate %d, dbitrate %d; it has 10, 20, 50, 100, 125, 250, 500, 800 "
                 "and 1000 kbit/s, 2 and 5 Mbit/s for FD data",
                 config->device ? config->device : "", (int)config->bitrate, (int)config->dbitrate);
    return length;
}

static int send_opening(slcan_t* state) {
    return drv_serial_write(&state->link.port, (const uint8_t*)state->opening, state->opening_length, COMMAND_MS);
}

static int slcan_open(drv_source_t* self, const drv_source_config_t* config) {
    memset(&self->counts, 0, sizeof self->counts);
    self->error[0] = '\0';
    self->state = NULL;
    slcan_t* state = calloc(1, sizeof *state);
    if (!state) {
        snprintf(self->error, sizeof self->error, "out of memory");
        return -ENOMEM;
    }
    const int length = opening_of(&config->line, state->opening, self->error, sizeof self->error);
    int status = length < 0 ? -EINVAL : line_link_open(&state->link, self, &config->line);
    if (status == 0 && !state->link.pushed) {
        state->opening_length = (size_t)length;
        status = send_opening(state);
        if (status != 0) {
            snprintf(self->error, sizeof self->error, "%s: %.60s", state->link.path, state->link.port.error);
            drv_serial_close(&state->link.port);
        }
    }
    if (status != 0) {
        free(state);
        return status;
    }
    self->state = state;
    self->counts.stamp = DRV_STAMP_US;
    return 0;
}

static int slcan_fd(const drv_source_t* self) {
    const slcan_t* state = self->state;
    return state ? state->link.port.fd : -1;
}

/// Milliseconds of a minute to a running time; whole minutes of silence are seen by the host's clock.
static int64_t unwrap_stamp(slcan_t* state, int stamp_ms) {
    if (!state->stamped) {
        state->device_ms = stamp_ms + 1; // 0 means no stamp
    } else {
        const int64_t before = (state->device_ms - 1) % DRV_SLCAN_STAMP_MS;
        const int64_t step = (stamp_ms - before + DRV_SLCAN_STAMP_MS) % DRV_SLCAN_STAMP_MS;
        const double pause_ms = (double)(state->arrived_ns - state->device_seen_ns) * 1e-6;
        const double rounds = round((pause_ms - (double)step) / (double)DRV_SLCAN_STAMP_MS);
        state->device_ms += step + (rounds > 0 && rounds < 1e6 ? (int64_t)rounds * DRV_SLCAN_STAMP_MS : 0);
    }
    state->stamped = 1;
    state->device_seen_ns = state->arrived_ns;
    return state->device_ms * 1000000;
}

/// One whole line. @return 1 when it is a data frame
static int take_line(drv_source_t* self, slcan_t* state, const char* line, size_t length, drv_frame_t* frame) {
    int stamp_ms = -1;
    memset(frame, 0, offsetof(drv_frame_t, data));
    const int kind = drv_slcan_parse(line, length, frame, &stamp_ms);
    if (kind < 0) {
        ++self->counts.damaged;
        state->link.loss |= DRV_LOSS_CRC;
    }
    if (kind <= 0) return 0;
    if (stamp_ms >= 0) frame->hw_time_ns = unwrap_stamp(state, stamp_ms);
    if (frame->flags & DRV_FRAME_REMOTE) {
        ++self->counts.remote;
        return 0;
    }
    frame->time_ns = state->arrived_ns;
    frame->loss = state->link.loss;
    state->link.loss = 0;
    ++self->counts.received;
    return 1;
}

/// The next frame out of the bytes at hand. @return 1, or 0 when more are needed
static int next_frame(drv_source_t* self, slcan_t* state, drv_frame_t* frame) {
    while (state->begin < state->end) {
        const char* start = state->bytes + state->begin;
        size_t length = 0;
        const size_t have = state->end - state->begin;
        while (length < have && start[length] != '\r' && start[length] != '\a' && start[length] != '\n') ++length;
        if (length > DRV_SLCAN_BYTES) state->endless = 1;
        if (length == have) {
            if (state->endless) state->begin = state->end;
            return 0;
        }
        // The letters of classic frames are no hexadecimal digits: the rest of a torn line never begins with one.
        const int clear = state->joined || (length > 0 && is_classic(start[0]));
        const int whole = clear && !state->endless, bell = start[length] == '\a';
        if (state->joined && state->endless) {
            ++self->counts.damaged;
            state->link.loss |= DRV_LOSS_CRC;
        }
        state->begin += length + 1;
        state->joined = 1;
        state->endless = 0;
        if (bell) ++self->counts.refused;
        if (whole && take_line(self, state, start, length, frame)) return 1;
    }
    return 0;
}

static int fetch(drv_source_t* self, slcan_t* state) {
    int torn = 0;
    memmove(state->bytes, state->bytes + state->begin, state->end - state->begin);
    state->end -= state->begin;
    state->begin = 0;
    const int got = line_link_read(&state->link, self, (uint8_t*)state->bytes + state->end,
                                   sizeof state->bytes - state->end, &torn);
    if (torn) {
        if (got > 0) memmove(state->bytes, state->bytes + state->end, (size_t)got);
        state->end = 0;
        state->joined = state->endless = 0;
    }
    if (torn && state->link.port.fd >= 0) (void)send_opening(state);
    if (got <= 0) return 0;
    state->arrived_ns = line_link_time(&state->link);
    state->end += (size_t)got;
    return 1;
}

static int slcan_read(drv_source_t* self, drv_frame_t* frames, int capacity) {
    slcan_t* state = self->state;
    if (!state) return -EBADF;
    int count = 0, reads = 0;
    while (count < capacity) {
        if (next_frame(self, state, &frames[count]))
            ++count;
        else if ((reads++ >= READS_A_CALL && state->link.waiting == 0) || !fetch(self, state))
            break;
    }
    return count;
}

static void slcan_stats(drv_source_t* self, drv_stats_t* out) {
    slcan_t* state = self->state;
    if (state) line_link_count(&state->link, self);
    *out = self->counts;
}

static void slcan_close(drv_source_t* self) {
    slcan_t* state = self->state;
    if (!state) return;
    line_link_count(&state->link, self);
    if (state->link.port.fd >= 0) (void)drv_serial_write(&state->link.port, (const uint8_t*)"C\r", 2, COMMAND_MS);
    drv_serial_close(&state->link.port);
    free(state);
    self->state = NULL;
}

const drv_source_ops_t drv_source_slcan = {slcan_open, slcan_fd, slcan_read, slcan_stats, slcan_close};

int drv_slcan_sink_open(drv_slcan_sink_t* self, const drv_line_config_t* config) {
    char opening[COMMAND_BYTES];
    memset(self, 0, sizeof *self);
    self->port.fd = -1;
    const int length = opening_of(config, opening, self->error, sizeof self->error);
    if (length < 0) return -EINVAL;
    int status = drv_serial_open(&self->port, config->device, config->baud);
    if (status == 0) status = drv_serial_write(&self->port, (const uint8_t*)opening, (size_t)length, COMMAND_MS);
    if (status == 0) return 0;
    memcpy(self->error, self->port.error, sizeof self->error);
    drv_serial_close(&self->port);
    return status;
}

int drv_slcan_sink_write(drv_slcan_sink_t* self, const drv_frame_t* frame, int patience_ms) {
    char line[DRV_SLCAN_BYTES + 1];
    uint8_t answers[256];
    const int length = drv_slcan_format(line, sizeof line, frame);
    if (length < 0) return 0;                                         // an error message is nothing to send
    while (drv_serial_read(&self->port, answers, sizeof answers) > 0) // or they fill the queue
        continue;
    const int status = drv_serial_write(&self->port, (const uint8_t*)line, (size_t)length, patience_ms);
    if (status != 0)
        memcpy(self->error, self->port.error, sizeof self->error);
    else
        ++self->sent;
    return status;
}

void drv_slcan_sink_close(drv_slcan_sink_t* self) {
    if (self->port.fd >= 0) (void)drv_serial_write(&self->port, (const uint8_t*)"C\r", 2, COMMAND_MS);
    drv_serial_close(&self->port);
}
