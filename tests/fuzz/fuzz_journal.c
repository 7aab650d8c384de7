// SPDX-License-Identifier: MIT
// Any bytes as a journal: no step beyond them, every frame sound, and what is read can be written and read again.
#include <drv/crc.h>
#include <drv/journal.h>

#include <stdlib.h>
#include <string.h>

int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size);

typedef struct tape_t {
    const uint8_t* bytes;
    size_t count, at;
} tape_t;

static long read_tape(void* context, uint8_t* bytes, size_t count) {
    tape_t* self = context;
    size_t take = self->count - self->at;
    if (take > count) take = count;
    if (take > 1000) take = 1000;
    memcpy(bytes, self->bytes + self->at, take);
    self->at += take;
    return (long)take;
}

/// A fuzzer does not guess sums: those of every header that begins like one are put right.
static void mend(uint8_t* bytes, size_t size) {
    for (size_t at = 0; at + DRV_JOURNAL_HEADER <= size; ++at) {
        if (!drv_journal_magic(bytes + at)) continue;
        uint8_t* header = bytes + at;
        const size_t length =
            header[12] | (size_t)header[13] << 8 | (size_t)header[14] << 16 | (size_t)header[15] << 24;
        if (length > size - at - DRV_JOURNAL_HEADER) continue;
        const uint32_t sum = drv_crc32(0, header + DRV_JOURNAL_HEADER, length);
        for (int i = 0; i < 4; ++i) header[56 + i] = (uint8_t)(sum >> 8 * i);
        const uint32_t own = drv_crc32(0, header, 60);
        for (int i = 0; i < 4; ++i) header[60 + i] = (uint8_t)(own >> 8 * i);
        at += DRV_JOURNAL_HEADER - 1;
    }
}

static long append(void* context, const uint8_t* bytes, size_t count) {
    tape_t* self = context;
    memcpy((uint8_t*)self->bytes + self->count, bytes, count);
    self->count += count;
    return (long)count;
}

/// One frame through a journal of its own.
static void check_again(const drv_frame_t* frame) {
    static drv_journal_writer_t writer;
    static drv_journal_reader_t reader;
    static uint8_t space[DRV_JOURNAL_HEADER + DRV_JOURNAL_FRAME_BYTES];
    tape_t tape = {space, 0, 0};
    const drv_journal_sink_t sink = {append, NULL, &tape};
    const drv_journal_time_t now = {1, 2};
    memset(&writer, 0, offsetof(drv_journal_writer_t, buffer));
    drv_journal_begin(&writer, &sink, 1);
    drv_journal_chunk_t chunk;
    drv_frame_t again;
    size_t at = 0;
    if (drv_journal_add(&writer, frame) != 1 || drv_journal_flush(&writer, &now) != 0) abort();
    drv_journal_reader_begin(&reader, read_tape, &tape);
    if (drv_journal_next(&reader, &chunk) != 1 || !drv_journal_frame(&chunk, &at, &again)) abort();
    if (memcmp(frame, &again, sizeof again) != 0) abort();
}

static void check_chunk(const drv_journal_chunk_t* chunk) {
    if (chunk->bytes > DRV_JOURNAL_PAYLOAD) abort();
    drv_journal_text_t text;
    if (drv_journal_text_of(chunk, &text) &&
        text.name_bytes + text.piece_bytes > chunk->bytes) // they lie within the payload
        abort();
    if (chunk->kind != DRV_JOURNAL_FRAMES) return;
    size_t at = 0;
    uint32_t frames = 0;
    drv_frame_t frame;
    for (; drv_journal_frame(chunk, &at, &frame); ++frames) {
        if (frame.len > 64 || frame.bus >= DRV_MAX_BUSES || frame.time_ns < 0 || frame.hw_time_ns < 0) abort();
        if (frames == 0) check_again(&frame);
    }
    if (frames != chunk->frames || at != chunk->bytes) abort();
}

static void check_file(const uint8_t* bytes, size_t size) {
    static drv_journal_reader_t reader;
    tape_t tape = {bytes, size, 0};
    drv_journal_reader_begin(&reader, read_tape, &tape);
    drv_journal_chunk_t chunk;
    uint64_t taken = 0;
    while (drv_journal_next(&reader, &chunk) == 1) {
        taken += DRV_JOURNAL_HEADER + chunk.bytes;
        check_chunk(&chunk);
    }
    if (taken + reader.skipped_bytes + reader.torn_bytes > size) abort(); // every byte is counted once
}

int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
    uint8_t* copy = malloc(size + 1);
    memcpy(copy, data, size);
    check_file(copy, size);
    mend(copy, size);
    check_file(copy, size);
    free(copy);
    return 0;
}
