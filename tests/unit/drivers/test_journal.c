// SPDX-License-Identifier: MIT
// The journal in memory: what was written is read, and whatever happens to the bytes, what is read was written.
#include <drv/crc.h>
#include <drv/journal.h>

#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include <unity.h>

enum { SPACE = 1 << 20, FRAMES = 60, CHUNKS = 14, NONE = -1 };

/// A disk: so many bytes fit, calls fail as told.
typedef struct disk_t {
    uint8_t bytes[SPACE];
    size_t used, room;
    long interrupted; ///< calls that fail with EINTR first
    long error;       ///< what a full disk says; 0 = a short write
    int stays_torn;   ///< it cannot be truncated
} disk_t;

static disk_t disk;
static drv_journal_writer_t writer;
static drv_journal_reader_t reader;
static drv_frame_t sent[FRAMES], got[FRAMES];
static size_t ends[CHUNKS];      ///< byte behind each chunk
static size_t frames_to[CHUNKS]; ///< frames in all chunks up to this one
static int chunks;
static uint32_t dice;

static uint32_t roll(uint32_t below) {
    dice = dice * 1664525u + 1013904223u;
    return (uint32_t)(((uint64_t)dice * below) >> 32);
}

static long disk_write(void* context, const uint8_t* bytes, size_t count) {
    disk_t* self = context;
    if (self->interrupted > 0) {
        --self->interrupted;
        return -EINTR;
    }
    size_t fits = self->room - self->used;
    if (fits == 0) return self->error;
    if (fits > count) fits = count;
    memcpy(self->bytes + self->used, bytes, fits);
    self->used += fits;
    return (long)fits;
}

static int disk_truncate(void* context, uint64_t size) {
    disk_t* self = context;
    if (self->stays_torn) return -EIO;
    self->used = (size_t)size;
    return 0;
}

static const drv_journal_sink_t sink = {disk_write, disk_truncate, &disk};
static const drv_journal_time_t now = {1700000000123456789, 42};

/// Bytes to be read, in pieces of any size.
typedef struct tape_t {
    const uint8_t* bytes;
    size_t count, at, piece;
} tape_t;

static long tape_read(void* context, uint8_t* bytes, size_t count) {
    tape_t* self = context;
    size_t take = self->count - self->at < count ? self->count - self->at : count;
    if (take > self->piece) take = self->piece;
    memcpy(bytes, self->bytes + self->at, take);
    self->at += take;
    return (long)take;
}

static drv_frame_t random_frame(uint32_t number) {
    drv_frame_t frame;
    memset(&frame, 0, sizeof frame);
    frame.time_ns = 1700000000000000000 + (int64_t)number * 125001;
    frame.hw_time_ns = number % 3 == 0 ? (int64_t)number * 125000 + 1 : 0;
    frame.flags = (uint8_t)roll(64) & (uint8_t)~DRV_FRAME_REMOTE;
    if (number % 11 == 0) frame.flags |= DRV_FRAME_REMOTE;
    frame.id = frame.flags & DRV_FRAME_EXTENDED ? roll(1u << 29) : roll(1u << 11);
    frame.loss = number % 7 == 0 ? (uint8_t)roll(16) : 0;
    frame.bus = (uint8_t)roll(DRV_MAX_BUSES);
    frame.len = (uint8_t)(frame.flags & DRV_FRAME_REMOTE ? roll(9) : roll(65));
    for (unsigned i = 0; i < frame.len && !(frame.flags & DRV_FRAME_REMOTE); ++i) frame.data[i] = (uint8_t)roll(256);
    return frame;
}

static void note_chunk(void) {
    ends[chunks] = disk.used;
    frames_to[chunks] = chunks ? frames_to[chunks - 1] : 0;
    ++chunks;
}

/// Two texts, then frames in chunks of uneven size, then the end.
static void write_journal(void) {
    TEST_ASSERT_EQUAL_INT(0, drv_journal_text(&writer, "config", "rate_hz = 1", 11, &now));
    note_chunk();
    TEST_ASSERT_EQUAL_INT(0, drv_journal_text(&writer, "empty", "", 0, &now));
    note_chunk();
    for (uint32_t i = 0; i < FRAMES;) {
        const uint32_t count = 1 + (i * 5 + 3) % 9;
        for (uint32_t k = 0; k < count && i < FRAMES; ++k, ++i)
            TEST_ASSERT_EQUAL_INT(1, drv_journal_add(&writer, &sent[i]));
        TEST_ASSERT_EQUAL_INT(0, drv_journal_flush(&writer, &now));
        TEST_ASSERT_TRUE(chunks < CHUNKS - 1);
        note_chunk();
        frames_to[chunks - 1] = i;
    }
    TEST_ASSERT_EQUAL_INT(0, drv_journal_end(&writer, 0, &now));
    note_chunk();
}

void setUp(void) {
    memset(&disk, 0, sizeof disk);
    memset(&writer, 0, sizeof writer);
    disk.room = SPACE;
    disk.error = -ENOSPC;
    dice = 1;
    chunks = 0;
    for (uint32_t i = 0; i < FRAMES; ++i) sent[i] = random_frame(i);
    drv_journal_begin(&writer, &sink, 0x1122334455667788u);
}
void tearDown(void) {}

/// Read all of it. Every frame must be one of those sent, in their order; got[] holds them, found[] says which.
/// @return frames read
static uint32_t found[FRAMES];
static size_t read_back(const uint8_t* bytes, size_t count, size_t piece) {
    tape_t tape = {bytes, count, 0, piece};
    drv_journal_reader_begin(&reader, tape_read, &tape);
    drv_journal_chunk_t chunk;
    size_t frames = 0;
    uint32_t next = 0;
    int more;
    while ((more = drv_journal_next(&reader, &chunk)) == 1) {
        size_t at = 0, here = 0;
        drv_frame_t frame;
        for (; chunk.kind == DRV_JOURNAL_FRAMES && drv_journal_frame(&chunk, &at, &frame); ++here) {
            while (next < FRAMES && memcmp(&frame, &sent[next], sizeof frame) != 0) ++next;
            TEST_ASSERT_TRUE_MESSAGE(next < FRAMES, "a frame that was never sent, or out of order");
            found[frames] = next++;
            got[frames++] = frame;
        }
        TEST_ASSERT_EQUAL_UINT32(chunk.kind == DRV_JOURNAL_FRAMES ? chunk.frames : 0, here);
    }
    TEST_ASSERT_EQUAL_INT(0, more);
    return frames;
}

static void test_what_is_written_is_read(void) {
    write_journal();
    for (size_t piece = 1; piece < 300; piece += 7) {
        TEST_ASSERT_EQUAL_UINT64(FRAMES, read_back(disk.bytes, disk.used, piece));
        TEST_ASSERT_EQUAL_MEMORY(sent, got, sizeof sent);
        TEST_ASSERT_EQUAL_UINT64(chunks, reader.chunks);
        TEST_ASSERT_EQUAL_INT(1, reader.ended);
        TEST_ASSERT_EQUAL_UINT64(0, reader.missing + reader.damaged + reader.skipped_bytes + reader.torn_bytes +
                                        reader.foreign);
    }
}

/// The power goes off after every byte of every write: what was whole is read, the rest is told as torn.
static void test_every_prefix(void) {
    write_journal();
    int whole = 0;
    for (size_t cut = 0; cut <= disk.used; ++cut) {
        while (whole < chunks && ends[whole] <= cut) ++whole;
        const size_t expected = whole ? frames_to[whole - 1] : 0, kept = whole ? ends[whole - 1] : 0;
        TEST_ASSERT_EQUAL_UINT64(expected, read_back(disk.bytes, cut, SPACE));
        TEST_ASSERT_EQUAL_UINT64(cut - kept, reader.torn_bytes);
        TEST_ASSERT_EQUAL_INT(whole == chunks, reader.ended);
        TEST_ASSERT_EQUAL_UINT64(0, reader.missing + reader.damaged + reader.foreign);
    }
}

/// The same on a file system that gives the file its new size before its bytes: zeros, or what stood there before.
static void test_power_cut_with_stale_blocks(void) {
    write_journal();
    static uint8_t after[SPACE];
    for (int stale = 0; stale < 2; ++stale)
        for (int last = 1; last < chunks; ++last)
            for (size_t cut = ends[last - 1]; cut < ends[last]; cut += 3) {
                memset(after, 0, ends[last]);
                if (stale) // chunks of the same run that stood elsewhere on the disk
                    for (size_t i = 0; i < ends[last]; ++i) after[i] = disk.bytes[(i + ends[0]) % ends[last - 1]];
                memcpy(after, disk.bytes, cut);
                TEST_ASSERT_EQUAL_UINT64(frames_to[last - 1], read_back(after, ends[last], SPACE));
                TEST_ASSERT_EQUAL_UINT64(0, reader.missing);
            }
}

/// Each bit of the file once: the chunk that was hit is missing, nothing else.
static void test_every_flipped_bit(void) {
    write_journal();
    int hit = 0;
    for (size_t at = 0; at < disk.used; ++at) {
        while (ends[hit] <= at) ++hit;
        const size_t before = hit ? frames_to[hit - 1] : 0, lost = frames_to[hit] - before;
        const int bit = 1 << roll(8);
        disk.bytes[at] ^= (uint8_t)bit;
        TEST_ASSERT_EQUAL_UINT64(FRAMES - lost, read_back(disk.bytes, disk.used, SPACE));
        if (hit + 1 < chunks) TEST_ASSERT_EQUAL_UINT64(1, reader.damaged);
        TEST_ASSERT_EQUAL_UINT64(hit > 0 && hit + 1 < chunks, reader.missing);
        TEST_ASSERT_EQUAL_UINT64(ends[hit] - (hit ? ends[hit - 1] : 0), reader.skipped_bytes + reader.torn_bytes);
        for (size_t i = before; i < FRAMES - lost; ++i) TEST_ASSERT_EQUAL_UINT32(i + lost, found[i]);
        disk.bytes[at] ^= (uint8_t)bit;
    }
}

/// Bytes gone or come: only the chunk they fall into is lost.
static void test_every_missing_and_every_extra_byte(void) {
    write_journal();
    static uint8_t bent[SPACE];
    int hit = 0;
    for (size_t at = 0; at < disk.used; ++at) {
        while (ends[hit] <= at) ++hit;
        const size_t lost = frames_to[hit] - (hit ? frames_to[hit - 1] : 0);
        const size_t gone = 1 + roll(20) < ends[hit] - at ? 1 + roll(20) % (ends[hit] - at) : 1;
        memcpy(bent, disk.bytes, at);
        memcpy(bent + at, disk.bytes + at + gone, disk.used - at - gone);
        TEST_ASSERT_EQUAL_UINT64(FRAMES - lost, read_back(bent, disk.used - gone, SPACE));
        const size_t start = hit ? ends[hit - 1] : 0, extra = 1 + roll(200);
        memcpy(bent, disk.bytes, at);
        for (size_t i = 0; i < extra; ++i) bent[at + i] = roll(3) ? (uint8_t)roll(256) : disk.bytes[roll(64)];
        memcpy(bent + at + extra, disk.bytes + at, disk.used - at);
        TEST_ASSERT_EQUAL_UINT64(FRAMES - (at > start ? lost : 0), read_back(bent, disk.used + extra, SPACE));
        if (at == start) TEST_ASSERT_EQUAL_UINT64(0, reader.missing); // rubbish between chunks costs nothing
    }
}

static void test_chunks_gone_doubled_and_swapped(void) {
    write_journal();
    static uint8_t bent[SPACE];
    for (int k = 1; k + 1 < chunks; ++k) {
        const size_t start = ends[k - 1], bytes = ends[k] - start, lost = frames_to[k] - frames_to[k - 1];
        memcpy(bent, disk.bytes, start);
        memcpy(bent + start, disk.bytes + ends[k], disk.used - ends[k]);
        TEST_ASSERT_EQUAL_UINT64(FRAMES - lost, read_back(bent, disk.used - bytes, SPACE));
        TEST_ASSERT_EQUAL_UINT64(1, reader.missing);
        TEST_ASSERT_EQUAL_UINT64(0, reader.damaged);
        memcpy(bent, disk.bytes, ends[k]); // twice, as `cat a b b c` makes it
        memcpy(bent + ends[k], disk.bytes + start, disk.used - start);
        TEST_ASSERT_EQUAL_UINT64(FRAMES, read_back(bent, disk.used + bytes, SPACE));
        TEST_ASSERT_EQUAL_UINT64(1, reader.foreign);
        TEST_ASSERT_EQUAL_UINT64(0, reader.missing);
    }
}

static void test_chunks_of_another_run_are_left_out(void) {
    write_journal();
    static disk_t other;
    other = disk;
    setUp();
    drv_journal_begin(&writer, &sink, 99);
    write_journal();
    static uint8_t bent[2 * SPACE];
    for (int k = 0; k < chunks; ++k) {
        memcpy(bent, other.bytes, ends[k]);
        memcpy(bent + ends[k], disk.bytes, disk.used);
        memcpy(bent + ends[k] + disk.used, other.bytes + ends[k], other.used - ends[k]);
        TEST_ASSERT_EQUAL_UINT64(FRAMES, read_back(bent, disk.used + other.used, SPACE));
        TEST_ASSERT_EQUAL_UINT64(chunks, reader.foreign);
    }
}

/// A disk that is full at every byte: the file ends with a whole chunk, the error stays.
static void test_disk_full_at_every_byte(void) {
    write_journal();
    const size_t all = disk.used;
    size_t last[CHUNKS];
    memcpy(last, ends, sizeof last);
    for (size_t room = 0; room < all; ++room) {
        setUp();
        disk.room = room;
        disk.error = room % 2 ? -EIO : 0;
        int code = drv_journal_text(&writer, "config", "rate_hz = 1", 11, &now);
        if (code == 0) code = drv_journal_text(&writer, "empty", "", 0, &now);
        for (uint32_t i = 0; i < FRAMES && code == 0;) {
            const uint32_t count = 1 + (i * 5 + 3) % 9;
            for (uint32_t k = 0; k < count && i < FRAMES; ++k, ++i)
                TEST_ASSERT_EQUAL_INT(1, drv_journal_add(&writer, &sent[i]));
            code = drv_journal_flush(&writer, &now);
        }
        if (code == 0) code = drv_journal_end(&writer, 0, &now);
        TEST_ASSERT_EQUAL_INT(room % 2 ? -EIO : -ENOSPC, code);
        size_t whole = 0;
        for (int k = 0; k < CHUNKS && last[k] <= room && last[k] > whole; ++k) whole = last[k];
        TEST_ASSERT_EQUAL_UINT64(whole, disk.used);
        TEST_ASSERT_EQUAL_UINT64(whole, writer.bytes);
        read_back(disk.bytes, disk.used, SPACE);
        TEST_ASSERT_EQUAL_UINT64(0, reader.torn_bytes + reader.damaged + reader.missing);
        disk.room = SPACE;
        TEST_ASSERT_EQUAL_INT(1, drv_journal_add(&writer, &sent[0]));
        TEST_ASSERT_EQUAL_INT(code, drv_journal_flush(&writer, &now));
        TEST_ASSERT_EQUAL_INT(code, drv_journal_end(&writer, 0, &now));
        TEST_ASSERT_EQUAL_UINT64(whole, disk.used);
    }
}

static void test_interrupted_and_torn(void) {
    disk.interrupted = 5;
    TEST_ASSERT_EQUAL_INT(0, drv_journal_text(&writer, "a", "b", 1, &now));
    TEST_ASSERT_EQUAL_INT(1, drv_journal_add(&writer, &sent[0]));
    disk.room = disk.used + 70;
    disk.stays_torn = 1;
    TEST_ASSERT_EQUAL_INT(-ENOSPC, drv_journal_flush(&writer, &now));
    TEST_ASSERT_EQUAL_UINT64(0, read_back(disk.bytes, disk.used, SPACE));
    TEST_ASSERT_EQUAL_UINT64(1, reader.chunks);
    TEST_ASSERT_EQUAL_UINT64(70, reader.torn_bytes);
}

/// The count stands on the chunk behind the loss, and survives a change of segment.
static void test_losses_and_segments(void) {
    drv_journal_chunk_t chunk;
    drv_journal_add(&writer, &sent[0]);
    TEST_ASSERT_EQUAL_UINT32(1, drv_journal_waiting(&writer));
    TEST_ASSERT_EQUAL_INT(0, drv_journal_end(&writer, 1, &now));
    TEST_ASSERT_EQUAL_UINT32(0, drv_journal_waiting(&writer));
    const size_t first = disk.used;
    drv_journal_lost(&writer, 7);
    drv_journal_begin(&writer, &sink, writer.run);
    drv_journal_text(&writer, "a", "b", 1, &now);
    drv_journal_add(&writer, &sent[1]);
    drv_journal_flush(&writer, &now);
    drv_journal_add(&writer, &sent[2]);
    drv_journal_flush(&writer, &now);
    TEST_ASSERT_EQUAL_UINT64(disk.used - first, writer.bytes);
    tape_t one = {disk.bytes, first, 0, SPACE}, two = {disk.bytes + first, disk.used - first, 0, SPACE};
    drv_journal_reader_begin(&reader, tape_read, &one);
    TEST_ASSERT_EQUAL_INT(1, drv_journal_next(&reader, &chunk));
    TEST_ASSERT_EQUAL_INT64(now.real_ns, chunk.time.real_ns);
    TEST_ASSERT_EQUAL_INT64(42, chunk.time.monotonic_ns);
    TEST_ASSERT_EQUAL_INT(1, drv_journal_next(&reader, &chunk));
    TEST_ASSERT_TRUE(chunk.kind == DRV_JOURNAL_END && chunk.more && reader.ended);
    TEST_ASSERT_EQUAL_INT(0, drv_journal_next(&reader, &chunk));
    drv_journal_reader_continue(&reader, tape_read, &two);
    const uint64_t lost[] = {0, 7, 0};
    for (int i = 0; i < 3; ++i) {
        TEST_ASSERT_EQUAL_INT(1, drv_journal_next(&reader, &chunk));
        TEST_ASSERT_EQUAL_UINT64(lost[i], chunk.lost);
        TEST_ASSERT_EQUAL_INT(0, chunk.gap);
    }
    TEST_ASSERT_EQUAL_INT(0, reader.ended);
    TEST_ASSERT_EQUAL_UINT64(0, reader.missing);
}

static void test_a_long_text(void) {
    enum { LONG = 200000 };
    char* text = malloc(LONG);
    for (int i = 0; i < LONG; ++i) text[i] = (char)roll(256);
    TEST_ASSERT_EQUAL_INT(0, drv_journal_text(&writer, "frame.dbc", text, LONG, &now));
    char name[DRV_JOURNAL_NAME_BYTES + 2];
    memset(name, 'n', sizeof name);
    name[sizeof name - 1] = '\0';
    TEST_ASSERT_EQUAL_INT(-EINVAL, drv_journal_text(&writer, name, "", 0, &now));
    TEST_ASSERT_EQUAL_INT(-EINVAL, drv_journal_text(&writer, "", "", 0, &now));
    tape_t tape = {disk.bytes, disk.used, 0, 1000};
    drv_journal_reader_begin(&reader, tape_read, &tape);
    drv_journal_chunk_t chunk;
    size_t at = 0;
    while (drv_journal_next(&reader, &chunk) == 1) {
        drv_journal_text_t piece;
        TEST_ASSERT_EQUAL_INT(1, drv_journal_text_of(&chunk, &piece));
        TEST_ASSERT_EQUAL_MEMORY("frame.dbc", piece.name, piece.name_bytes);
        TEST_ASSERT_EQUAL_UINT64(LONG, piece.total);
        TEST_ASSERT_EQUAL_UINT64(at, piece.offset);
        TEST_ASSERT_EQUAL_MEMORY(text + at, piece.piece, piece.piece_bytes);
        at += piece.piece_bytes;
    }
    TEST_ASSERT_EQUAL_UINT64(LONG, at);
    free(text);
}

/// No more than 64 KiB a chunk, whatever the frames.
static void test_a_full_chunk(void) {
    drv_frame_t frame = random_frame(3);
    frame.flags = DRV_FRAME_FD;
    frame.len = 64;
    frame.hw_time_ns = 5;
    uint32_t count = 0;
    while (drv_journal_add(&writer, &frame) == 1) ++count;
    TEST_ASSERT_EQUAL_UINT32(DRV_JOURNAL_PAYLOAD / DRV_JOURNAL_FRAME_BYTES, count);
    TEST_ASSERT_EQUAL_INT(0, drv_journal_flush(&writer, &now));
    TEST_ASSERT_EQUAL_INT(1, drv_journal_add(&writer, &frame));
    frame.len = 65;
    TEST_ASSERT_EQUAL_INT(-EINVAL, drv_journal_add(&writer, &frame));
}

static void seal(uint8_t* chunk, size_t bytes) {
    for (int i = 0; i < 4; ++i) chunk[56 + i] = (uint8_t)(drv_crc32(0, chunk + 64, bytes) >> 8 * i);
    for (int i = 0; i < 4; ++i) chunk[60 + i] = (uint8_t)(drv_crc32(0, chunk, 60) >> 8 * i);
}

/// Chunks with right sums and wrong contents give no frame at all.
static void test_hostile_chunks(void) {
    drv_frame_t frame = random_frame(1);
    frame.flags = 0;
    frame.len = 8;
    drv_journal_add(&writer, &frame);
    drv_journal_flush(&writer, &now);
    const struct {
        size_t at;
        int bytes;
        uint64_t value;
    } evil[] = {{12, 4, 0xFFFFFFFF},
                {12, 4, 65537},
                {28, 4, 2},
                {28, 4, 0},
                {28, 4, 0xFFFFFFFF},
                {64 + 0, 1, 32},
                {64 + 1, 1, 0x40},
                {64 + 1, 1, 0x80},
                {64 + 3, 1, 65},
                {64 + 3, 1, 9},
                {64 + 3, 1, 7},
                {64 + 4, 4, 1 << 29},
                {64 + 8, 8, 1ull << 63},
                {64 + 8, 8, 9000000000000000001u}};
    for (size_t k = 0; k < sizeof evil / sizeof evil[0]; ++k) {
        uint8_t bent[64 + 24];
        TEST_ASSERT_EQUAL_UINT64(sizeof bent, disk.used);
        memcpy(bent, disk.bytes, sizeof bent);
        for (int i = 0; i < evil[k].bytes; ++i) bent[evil[k].at + (size_t)i] = (uint8_t)(evil[k].value >> 8 * i);
        seal(bent, 24);
        tape_t tape = {bent, sizeof bent, 0, SPACE};
        drv_journal_chunk_t chunk;
        drv_journal_reader_begin(&reader, tape_read, &tape);
        TEST_ASSERT_EQUAL_INT(0, drv_journal_next(&reader, &chunk));
        TEST_ASSERT_EQUAL_UINT64(sizeof bent, reader.torn_bytes);
    }
    disk.bytes[8] = 2; // a version of tomorrow
    seal(disk.bytes, 24);
    read_back(disk.bytes, disk.used, SPACE);
    TEST_ASSERT_EQUAL_UINT(2, reader.newer);
}

/// The example of docs/reference/journal-format.md, byte for byte.
static void test_the_bytes(void) {
    static const uint8_t expected[] = {
        0x8F, 'O',  'K',  'J',  0x0D, 0x0A, 0x1A, 0x0A,                                     // magic
        0x01, 0x02, 0x00, 0x00, 0x13, 0x00, 0x00, 0x00,                                     // version, frames, 19 bytes
        0x88, 0x77, 0x66, 0x55, 0x44, 0x33, 0x22, 0x11,                                     // run
        0x00, 0x00, 0x00, 0x00, 0x01, 0x00, 0x00, 0x00,                                     // sequence, frames
        0x15, 0xCD, 0x85, 0x3D, 0xFE, 0x9C, 0x97, 0x17, 0x2A, 0x00, 0x00, 0x00, 0, 0, 0, 0, // clocks
        0x05, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00                                      // lost
    };
    static const uint8_t payload[] = {0x01, 0x01, 0x02, 0x03, 0xFF, 0x2D, 0xF0, 0x18, 0x00, 0x2A,
                                      0x2A, 0x36, 0xFE, 0x9C, 0x97, 0x17, 0xAA, 0xBB, 0xCC};
    drv_frame_t frame = {.time_ns = 1700000000000010752, .id = 0x18F02DFF, .flags = DRV_FRAME_EXTENDED};
    frame.loss = DRV_LOSS_DRIVER;
    frame.bus = 1;
    frame.len = 3;
    memcpy(frame.data, "\xAA\xBB\xCC", 3);
    drv_journal_lost(&writer, 5);
    drv_journal_add(&writer, &frame);
    drv_journal_flush(&writer, &now);
    TEST_ASSERT_EQUAL_UINT64(64 + sizeof payload, disk.used);
    TEST_ASSERT_EQUAL_HEX8_ARRAY(expected, disk.bytes, sizeof expected);
    TEST_ASSERT_EQUAL_HEX8_ARRAY(payload, disk.bytes + 64, sizeof payload);
}

int main(void) {
    UNITY_BEGIN();
    RUN_TEST(test_what_is_written_is_read);
    RUN_TEST(test_every_prefix);
    RUN_TEST(test_power_cut_with_stale_blocks);
    RUN_TEST(test_every_flipped_bit);
    RUN_TEST(test_every_missing_and_every_extra_byte);
    RUN_TEST(test_chunks_gone_doubled_and_swapped);
    RUN_TEST(test_chunks_of_another_run_are_left_out);
    RUN_TEST(test_disk_full_at_every_byte);
    RUN_TEST(test_interrupted_and_torn);
    RUN_TEST(test_losses_and_segments);
    RUN_TEST(test_a_long_text);
    RUN_TEST(test_a_full_chunk);
    RUN_TEST(test_hostile_chunks);
    RUN_TEST(test_the_bytes);
    return UNITY_END();
}
