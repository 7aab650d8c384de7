// SPDX-License-Identifier: MIT
// PURPOSE  every valid chunk of a journal, however damaged the file is
// METHOD   look for the magic, check the header, then the payload; what fails is stepped over one byte at a time to the
//          next magic. Sizes are checked before they are used, and a chunk is given only when all of it makes sense
#include "journal_chunk.h"

#include <drv/crc.h>
#include <drv/source.h>

#include <errno.h>

static const int64_t LATEST_NS = INT64_C(9000000000) * 1000000000; // as in a candump log

void drv_journal_reader_begin(drv_journal_reader_t* self, drv_journal_read_t read, void* context) {
    memset(self, 0, offsetof(drv_journal_reader_t, buffer));
    drv_journal_reader_continue(self, read, context);
}

void drv_journal_reader_continue(drv_journal_reader_t* self, drv_journal_read_t read, void* context) {
    self->read = read;
    self->context = context;
    self->begin = self->end = 0;
    self->lost_sync = 0;
    self->at_end = self->ended = self->more = 0;
}

int drv_journal_magic(const uint8_t* bytes) { return memcmp(bytes, CHUNK_MAGIC, DRV_JOURNAL_MAGIC) == 0; }

/// At least `count` bytes at hand, fewer at the end of the file. @return 0 or -errno
static int fill(drv_journal_reader_t* self, size_t count) {
    if (self->end - self->begin >= count) return 0;
    memmove(self->buffer, self->buffer + self->begin, self->end - self->begin);
    self->end -= self->begin;
    self->begin = 0;
    while (self->end < count && !self->at_end) {
        const long got = self->read(self->context, self->buffer + self->end, sizeof self->buffer - self->end);
        if (got < 0 && got != -EINTR) return (int)got;
        if (got == 0) self->at_end = 1;
        if (got > 0) self->end += (size_t)got;
    }
    return 0;
}

/// Bytes of the frame at `at`, 0 when there is none that makes sense.
static size_t frame_bytes(const uint8_t* at, size_t left) {
    if (left < FRAME_PREFIX) return 0;
    const size_t stamp = at[1] & FRAME_HAS_HW_TIME ? 8 : 0, data = at[1] & DRV_FRAME_REMOTE ? 0 : at[3];
    const size_t bytes = FRAME_PREFIX + stamp + data;
    const uint64_t time_ns = get_number(at + 8, 8);
    const int sound = bytes <= left && at[0] < DRV_MAX_BUSES && at[3] <= 64 && time_ns <= (uint64_t)LATEST_NS &&
                      get_number(at + 4, 4) < 1u << 29 && (at[1] & ~(FRAME_FLAGS | FRAME_HAS_HW_TIME)) == 0;
    if (!sound || (stamp && get_number(at + FRAME_PREFIX, 8) > (uint64_t)INT64_MAX)) return 0;
    return bytes;
}

static int frames_make_sense(const drv_journal_chunk_t* chunk) {
    size_t at = 0;
    for (uint32_t i = 0; i < chunk->frames; ++i) {
        const size_t bytes = frame_bytes(chunk->payload + at, chunk->bytes - at);
        if (bytes == 0) return 0;
        at += bytes;
    }
    return at == chunk->bytes;
}

static drv_journal_kind_t kind_of(uint8_t byte) {
    return byte >= DRV_JOURNAL_TEXT && byte <= DRV_JOURNAL_END ? (drv_journal_kind_t)byte : DRV_JOURNAL_OTHER;
}

/// What stands at `begin`. @return bytes of the chunk, 0 when it is none, -errno
static long look(drv_journal_reader_t* self, drv_journal_chunk_t* chunk) {
    int code = fill(self, DRV_JOURNAL_HEADER);
    if (code) return code;
    const uint8_t* header = self->buffer + self->begin;
    if (self->end - self->begin < DRV_JOURNAL_HEADER || !drv_journal_magic(header) ||
        get_number(header + CHUNK_HEADER_CRC, 4) != drv_crc32(0, header, CHUNK_HEADER_CRC))
        return 0;
    if (header[CHUNK_VERSION] > DRV_JOURNAL_VERSION) self->newer = header[CHUNK_VERSION];
    chunk->bytes = (size_t)get_number(header + CHUNK_BYTES, 4);
    if (header[CHUNK_VERSION] != DRV_JOURNAL_VERSION || chunk->bytes > DRV_JOURNAL_PAYLOAD) return 0;
    code = fill(self, DRV_JOURNAL_HEADER + chunk->bytes);
    if (code) return code;
    header = self->buffer + self->begin;
    chunk->payload = header + DRV_JOURNAL_HEADER;
    if (self->end - self->begin < DRV_JOURNAL_HEADER + chunk->bytes ||
        get_number(header + CHUNK_PAYLOAD_CRC, 4) != drv_crc32(0, chunk->payload, chunk->bytes))
        return 0;
    chunk->kind = kind_of(header[CHUNK_KIND]);
    chunk->more = (get_number(header + CHUNK_FLAGS, 2) & CHUNK_MORE) != 0;
    chunk->run = get_number(header + CHUNK_RUN, 8);
    chunk->sequence = (uint32_t)get_number(header + CHUNK_SEQUENCE, 4);
    chunk->frames = (uint32_t)get_number(header + CHUNK_FRAMES, 4);
    chunk->time.real_ns = (int64_t)get_number(header + CHUNK_REAL, 8);
    chunk->time.monotonic_ns = (int64_t)get_number(header + CHUNK_MONOTONIC, 8);
    chunk->lost = get_number(header + CHUNK_LOST, 8);
    if (chunk->kind == DRV_JOURNAL_FRAMES && !frames_make_sense(chunk)) return 0;
    return (long)(DRV_JOURNAL_HEADER + chunk->bytes);
}

/// To the next byte that could begin a chunk.
static void step_over(drv_journal_reader_t* self) {
    const uint8_t* from = self->buffer + self->begin + 1;
    const size_t left = self->end - self->begin - 1;
    const uint8_t* next = left > 0 ? memchr(from, (uint8_t)CHUNK_MAGIC[0], left) : NULL;
    const size_t skipped = 1 + (next ? (size_t)(next - from) : left);
    self->begin += skipped;
    self->lost_sync += skipped;
}

/// Does the chunk belong here? @return 0 when it is to be left out
static int place(drv_journal_reader_t* self, drv_journal_chunk_t* chunk) {
    if (!self->started) {
        self->started = 1;
        self->run = chunk->run;
        self->expected = chunk->sequence;
    }
    if (chunk->run != self->run || chunk->sequence < self->expected) {
        ++self->foreign;
        return 0;
    }
    chunk->gap = chunk->sequence != self->expected;
    self->missing += chunk->sequence - self->expected;
    self->expected = chunk->sequence + 1;
    self->ended = chunk->kind == DRV_JOURNAL_END;
    self->more = self->ended && chunk->more;
    ++self->chunks;
    return 1;
}

int drv_journal_next(drv_journal_reader_t* self, drv_journal_chunk_t* chunk) {
    for (;;) {
        const long bytes = look(self, chunk);
        if (bytes < 0) return (int)bytes;
        if (bytes > 0) {
            self->begin += (size_t)bytes;
            self->damaged += self->lost_sync > 0;
            self->skipped_bytes += self->lost_sync;
            self->lost_sync = 0;
            if (place(self, chunk)) return 1;
        } else if (self->begin == self->end) { // look() found no byte: the end
            self->torn_bytes += self->lost_sync;
            self->lost_sync = 0;
            return 0;
        } else {
            step_over(self);
        }
    }
}

int drv_journal_frame(const drv_journal_chunk_t* chunk, size_t* at, drv_frame_t* frame) {
    const uint8_t* from = chunk->payload + *at;
    const size_t bytes = frame_bytes(from, chunk->bytes - *at);
    if (bytes == 0) return 0;
    memset(frame, 0, sizeof *frame);
    frame->bus = from[0];
    frame->flags = from[1] & FRAME_FLAGS;
    frame->loss = from[2];
    frame->len = from[3];
    frame->id = (uint32_t)get_number(from + 4, 4);
    frame->time_ns = (int64_t)get_number(from + 8, 8);
    const size_t data = frame->flags & DRV_FRAME_REMOTE ? 0 : frame->len;
    if (from[1] & FRAME_HAS_HW_TIME) frame->hw_time_ns = (int64_t)get_number(from + FRAME_PREFIX, 8);
    memcpy(frame->data, from + bytes - data, data);
    *at += bytes;
    return 1;
}

int drv_journal_text_of(const drv_journal_chunk_t* chunk, drv_journal_text_t* out) {
    if (chunk->kind != DRV_JOURNAL_TEXT || chunk->bytes < TEXT_PREFIX) return 0;
    out->name_bytes = (size_t)get_number(chunk->payload, 4);
    out->total = get_number(chunk->payload + 4, 8);
    out->offset = get_number(chunk->payload + 12, 8);
    if (out->name_bytes == 0 || out->name_bytes > DRV_JOURNAL_NAME_BYTES ||
        out->name_bytes > chunk->bytes - TEXT_PREFIX)
        return 0;
    out->name = (const char*)chunk->payload + TEXT_PREFIX;
    out->piece = out->name + out->name_bytes;
    out->piece_bytes = chunk->bytes - TEXT_PREFIX - out->name_bytes;
    return out->offset <= out->total && out->piece_bytes <= out->total - out->offset;
}
