// SPDX-License-Identifier: MIT
// PURPOSE  frames and texts to chunks of a journal
// METHOD   one buffer, filled frame by frame behind room for the header; the header is made when the chunk is written.
//          A write that does not get through is undone by cutting the file back to the last whole chunk
#include "journal_chunk.h"

#include <drv/crc.h>

#include <errno.h>

void drv_journal_begin(drv_journal_writer_t* self, const drv_journal_sink_t* sink, uint64_t run) {
    self->sink = *sink;
    self->run = run;
    self->bytes = 0;
}

/// All bytes or none. @return 0 or -errno
static int write_whole(drv_journal_writer_t* self, size_t count) {
    for (size_t at = 0; at < count;) {
        const long wrote = self->sink.write(self->sink.context, self->buffer + at, count - at);
        if (wrote == -EINTR) continue;
        if (wrote <= 0) {
            self->error = wrote < 0 ? (int)wrote : -ENOSPC;
            if (at > 0) (void)self->sink.truncate(self->sink.context, self->bytes); // else a reader skips the torn one
            return self->error;
        }
        at += (size_t)wrote;
    }
    self->bytes += count;
    ++self->chunks;
    ++self->sequence;
    return 0;
}

/// The payload stands behind the header already.
static int write_chunk(drv_journal_writer_t* self, drv_journal_kind_t kind, unsigned flags, size_t bytes,
                       const drv_journal_time_t* now) {
    if (self->error) return self->error;
    uint8_t* header = self->buffer;
    memcpy(header, CHUNK_MAGIC, DRV_JOURNAL_MAGIC);
    put_number(header + CHUNK_VERSION, 1, DRV_JOURNAL_VERSION);
    put_number(header + CHUNK_KIND, 1, (uint64_t)kind);
    put_number(header + CHUNK_FLAGS, 2, flags);
    put_number(header + CHUNK_BYTES, 4, bytes);
    put_number(header + CHUNK_RUN, 8, self->run);
    put_number(header + CHUNK_SEQUENCE, 4, self->sequence);
    put_number(header + CHUNK_FRAMES, 4, self->frames);
    put_number(header + CHUNK_REAL, 8, (uint64_t)now->real_ns);
    put_number(header + CHUNK_MONOTONIC, 8, (uint64_t)now->monotonic_ns);
    put_number(header + CHUNK_LOST, 8, self->lost);
    put_number(header + CHUNK_PAYLOAD_CRC, 4, drv_crc32(0, header + DRV_JOURNAL_HEADER, bytes));
    put_number(header + CHUNK_HEADER_CRC, 4, drv_crc32(0, header, CHUNK_HEADER_CRC));
    const int code = write_whole(self, DRV_JOURNAL_HEADER + bytes);
    if (code == 0) self->lost = 0;
    return code;
}

int drv_journal_text(drv_journal_writer_t* self, const char* name, const char* text, size_t bytes,
                     const drv_journal_time_t* now) {
    const size_t name_bytes = strnlen(name, DRV_JOURNAL_NAME_BYTES + 1);
    if (name_bytes == 0 || name_bytes > DRV_JOURNAL_NAME_BYTES || self->frames > 0) return -EINVAL;
    const uint64_t lost = self->lost; // stays for the frames that follow
    const size_t room = DRV_JOURNAL_PAYLOAD - TEXT_PREFIX - name_bytes;
    size_t at = 0;
    do {
        const size_t piece = bytes - at < room ? bytes - at : room;
        uint8_t* payload = self->buffer + DRV_JOURNAL_HEADER;
        put_number(payload, 4, name_bytes);
        put_number(payload + 4, 8, bytes);
        put_number(payload + 12, 8, at);
        memcpy(payload + TEXT_PREFIX, name, name_bytes);
        if (piece > 0) memcpy(payload + TEXT_PREFIX + name_bytes, text + at, piece);
        self->lost = 0;
        const int code = write_chunk(self, DRV_JOURNAL_TEXT, 0, TEXT_PREFIX + name_bytes + piece, now);
        self->lost = lost;
        if (code) return code;
        at += piece;
    } while (at < bytes);
    return 0;
}

int drv_journal_add(drv_journal_writer_t* self, const drv_frame_t* frame) {
    const unsigned data = frame->flags & DRV_FRAME_REMOTE ? 0 : frame->len;
    const int stamped = frame->hw_time_ns != 0;
    const size_t bytes = FRAME_PREFIX + (stamped ? 8u : 0u) + data;
    if (frame->len > sizeof frame->data) return -EINVAL;
    if (self->used + bytes > DRV_JOURNAL_PAYLOAD) return 0;
    uint8_t* at = self->buffer + DRV_JOURNAL_HEADER + self->used;
    at[0] = frame->bus;
    at[1] = (uint8_t)((frame->flags & FRAME_FLAGS) | (stamped ? FRAME_HAS_HW_TIME : 0));
    at[2] = frame->loss;
    at[3] = frame->len;
    put_number(at + 4, 4, frame->id);
    put_number(at + 8, 8, (uint64_t)frame->time_ns);
    if (stamped) put_number(at + FRAME_PREFIX, 8, (uint64_t)frame->hw_time_ns);
    memcpy(at + bytes - data, frame->data, data);
    self->used += bytes;
    ++self->frames;
    return 1;
}

void drv_journal_lost(drv_journal_writer_t* self, uint64_t count) { self->lost += count; }

uint32_t drv_journal_waiting(const drv_journal_writer_t* self) { return self->frames; }

int drv_journal_flush(drv_journal_writer_t* self, const drv_journal_time_t* now) {
    if (self->frames == 0) return self->error;
    const int code = write_chunk(self, DRV_JOURNAL_FRAMES, 0, self->used, now);
    self->frames = 0;
    self->used = 0;
    return code;
}

int drv_journal_end(drv_journal_writer_t* self, int more, const drv_journal_time_t* now) {
    const int code = drv_journal_flush(self, now);
    return code ? code : write_chunk(self, DRV_JOURNAL_END, more ? CHUNK_MORE : 0, 0, now);
}
