// SPDX-License-Identifier: MIT
// PURPOSE  bytes off a serial line to packets, whatever the framing
// METHOD   one buffer, scanned from its beginning; what is refused is dropped and the scan goes on behind it. Nothing is
//          counted before the first good packet: a stream may be joined in its middle
#include <drv/decoder.h>

#include <math.h>
#include <string.h>

const drv_framing_info_t drv_framings[] = {
    [DRV_FRAMING_COBS] = {"cobs", drv_scan_cobs, 7, 252, 32, ""},
    [DRV_FRAMING_ASCII] = {"ascii", drv_scan_ascii, 7, 252, 0, ""},
    [DRV_FRAMING_WITMOTION] = {"witmotion", drv_scan_witmotion, 3, 9, 0, "g"},
    [DRV_FRAMING_VECTORNAV] = {"vectornav", drv_scan_vectornav, 7, 6, 0, "m/s^2"},
};
_Static_assert(sizeof drv_framings / sizeof *drv_framings == DRV_FRAMINGS, "every framing has its line");

enum { LINES_TO_AGREE = 3 };

void drv_decoder_init(drv_decoder_t* self, drv_framing_t framing, int32_t counter) {
    memset(self, 0, sizeof *self);
    self->framing = framing;
    self->counter = counter;
    drv_decoder_restart(self);
}

void drv_decoder_restart(drv_decoder_t* self) {
    self->begin = self->end = 0;
    self->synced = self->broken = 0;
    self->in_line = self->framing == DRV_FRAMING_ASCII;
}

size_t drv_decoder_room(drv_decoder_t* self, uint8_t** at) {
    if (self->begin > 0) {
        memmove(self->bytes, self->bytes + self->begin, self->end - self->begin);
        self->end -= self->begin;
        self->begin = 0;
    }
    *at = self->bytes + self->end;
    return sizeof self->bytes - self->end;
}

void drv_decoder_add(drv_decoder_t* self, size_t count) { self->end += count; }

static void refuse(drv_decoder_t* self, int damaged, size_t bytes) {
    if (!self->synced) return;
    self->broken = 1;
    if (damaged)
        ++self->damaged;
    else
        self->skipped += bytes;
}

/// A line must have as many numbers as the ones before: a torn one passes for a line otherwise. @return 1 when it has
static int line_fits(drv_decoder_t* self) {
    drv_packet_t* line = &self->packet;
    if (self->width != line->fields) {
        if (++self->other < LINES_TO_AGREE && self->width != 0) return 0;
        self->width = line->fields;
    }
    self->other = 0;
    if (self->counter == 0) return 1;
    if (self->counter > line->fields) return 0;
    const double count = line->values[self->counter - 1];
    if (!(count >= 0 && count <= 4294967295.0) || count != floor(count)) return 0;
    line->sequence = (uint32_t)count;
    line->counted = 1;
    return 1;
}

int drv_decoder_next(drv_decoder_t* self) {
    while (self->begin < self->end) {
        size_t used = 0;
        drv_scan_t found =
            drv_framings[self->framing].scan(self->bytes + self->begin, self->end - self->begin, &self->packet, &used);
        if (found == DRV_SCAN_MORE) return 0;
        self->begin += used;
        if (self->framing == DRV_FRAMING_ASCII) {
            const int torn = self->in_line;
            self->in_line = found == DRV_SCAN_NOISE; // the rest of an endless line
            if (found == DRV_SCAN_PACKET && (torn || !line_fits(self))) found = DRV_SCAN_DAMAGED;
        }
        if (found == DRV_SCAN_PACKET) {
            const int before = self->broken;
            self->synced = 1;
            self->broken = 0;
            return before ? 2 : 1;
        }
        if (found != DRV_SCAN_IDLE) refuse(self, found == DRV_SCAN_DAMAGED, used);
    }
    return 0;
}
