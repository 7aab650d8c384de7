// SPDX-License-Identifier: MIT
// Journals as files: segments, gaps, what is no journal.
#include <drv/crc.h>
#include <drv/journal.h>
#include <drv/source.h>

#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include <unity.h>

static char folder[] = "/tmp/okid-journal-XXXXXX";
static drv_source_t source = {.ops = &drv_source_journal};
static drv_journal_writer_t writer;
static drv_frame_t frames[64];
static int file = -1;

static const char* name(int segment) {
    static char path[64];
    snprintf(path, sizeof path, "%s/run-%04d.okj", folder, segment);
    return path;
}

static long put(void* context, const uint8_t* bytes, size_t count) { return (long)write(*(int*)context, bytes, count); }
static int cut(void* context, uint64_t size) { return ftruncate(*(int*)context, (off_t)size); }

static const drv_journal_sink_t sink = {put, cut, &file};
static const drv_journal_time_t now = {1700000000000000000, 1};

void setUp(void) {
    strcpy(folder + strlen(folder) - 6, "XXXXXX");
    TEST_ASSERT_NOT_NULL(mkdtemp(folder));
    memset(&writer, 0, sizeof writer);
}

void tearDown(void) {
    source.ops->close(&source);
    for (int i = 0; i < 12; ++i) unlink(name(i));
    unlink(name(9998));
    unlink(name(9999));
    rmdir(folder);
}

/// A segment of `count` frames, two a chunk, on buses 0 and 1 in turn; identifiers go on from `first`.
static void segment(int number, uint32_t first, uint32_t count, int more) {
    file = open(name(number), O_WRONLY | O_CREAT | O_TRUNC, 0600);
    TEST_ASSERT_TRUE(file >= 0);
    drv_journal_begin(&writer, &sink, 5);
    drv_journal_text(&writer, "t", "text", 4, &now);
    for (uint32_t i = 0; i < count; ++i) {
        drv_frame_t frame = {.id = first + i, .time_ns = now.real_ns + i, .bus = i % 2};
        drv_journal_add(&writer, &frame);
        if (i % 2) drv_journal_flush(&writer, &now);
    }
    drv_journal_end(&writer, more, &now);
    close(file);
}

static int start(const char* path) {
    drv_source_config_t config = {.path = path};
    return source.ops->open(&source, &config);
}

static void test_segments_in_a_row(void) {
    segment(9, 0, 6, 1);
    segment(10, 6, 6, 1);
    segment(11, 12, 5, 0);
    TEST_ASSERT_EQUAL_INT(0, start(name(9)));
    int next = 0, count;
    while ((count = source.ops->read(&source, frames, 1 + next % 5)) > 0)
        for (int i = 0; i < count; ++i, ++next) {
            TEST_ASSERT_EQUAL_UINT32(next, frames[i].id);
            TEST_ASSERT_EQUAL_INT(0, frames[i].loss);
        }
    TEST_ASSERT_EQUAL_INT(DRV_END, count);
    TEST_ASSERT_EQUAL_INT(17, next);
    TEST_ASSERT_EQUAL_INT(3, drv_source_journal_segments(&source));
    TEST_ASSERT_EQUAL_INT(1, drv_source_journal_reader(&source)->ended);
    drv_stats_t stats;
    source.ops->stats(&source, &stats);
    TEST_ASSERT_EQUAL_UINT64(17, stats.received);
    TEST_ASSERT_EQUAL_UINT64(0, stats.torn + stats.damaged + stats.foreign + stats.lost_driver);
}

/// A chunk is hit: the next frame of each bus says that something is missing, and no other does.
static void test_a_damaged_chunk_is_marked(void) {
    segment(1, 0, 10, 0);
    file = open(name(1), O_RDWR);
    const size_t chunk = 64 + 2 * 16, at = 64 + 20 + 1 + 4 + 2 * chunk + 70;
    TEST_ASSERT_EQUAL_INT(1, pwrite(file, "\x55", 1, (off_t)at));
    close(file);
    TEST_ASSERT_EQUAL_INT(0, start(name(1)));
    TEST_ASSERT_EQUAL_INT(8, source.ops->read(&source, frames, 64));
    for (int i = 0; i < 8; ++i) {
        TEST_ASSERT_EQUAL_UINT32(i < 4 ? i : i + 2, frames[i].id);
        TEST_ASSERT_EQUAL_INT(i == 4 || i == 5 ? DRV_LOSS_DRIVER : 0, frames[i].loss);
    }
    drv_stats_t stats;
    source.ops->stats(&source, &stats);
    TEST_ASSERT_EQUAL_UINT64(1, stats.damaged);
    TEST_ASSERT_EQUAL_UINT64(chunk, stats.skipped);
    TEST_ASSERT_EQUAL_UINT64(1, drv_source_journal_reader(&source)->missing);
}

/// The second segment was torn by a kill, the third one goes on: what is missing is marked across the files.
static void test_a_torn_segment(void) {
    segment(1, 0, 4, 1);
    segment(2, 4, 4, 1);
    segment(3, 8, 4, 0);
    TEST_ASSERT_EQUAL_INT(0, truncate(name(2), 64 + 25 + 64 + 2 * 16 + 30));
    TEST_ASSERT_EQUAL_INT(0, start(name(1)));
    TEST_ASSERT_EQUAL_INT(10, source.ops->read(&source, frames, 64));
    TEST_ASSERT_EQUAL_UINT32(5, frames[5].id);
    TEST_ASSERT_EQUAL_UINT32(8, frames[6].id);
    TEST_ASSERT_EQUAL_INT(DRV_LOSS_DRIVER, frames[6].loss);
    TEST_ASSERT_EQUAL_INT(DRV_LOSS_DRIVER, frames[7].loss);
    TEST_ASSERT_EQUAL_INT(0, frames[8].loss);
    TEST_ASSERT_EQUAL_INT(DRV_END, source.ops->read(&source, frames, 64));
    drv_stats_t stats;
    source.ops->close(&source);
    source.ops->stats(&source, &stats);
    TEST_ASSERT_EQUAL_UINT64(1, stats.torn);
}

static void test_frames_the_recorder_lost(void) {
    file = open(name(1), O_WRONLY | O_CREAT, 0600);
    drv_journal_begin(&writer, &sink, 5);
    drv_frame_t frame = {.id = 1, .loss = DRV_LOSS_DRIVER};
    drv_journal_lost(&writer, 12345);
    drv_journal_add(&writer, &frame);
    drv_journal_end(&writer, 0, &now);
    close(file);
    TEST_ASSERT_EQUAL_INT(0, start(name(1)));
    TEST_ASSERT_EQUAL_INT(1, source.ops->read(&source, frames, 64));
    TEST_ASSERT_EQUAL_INT(DRV_LOSS_DRIVER, frames[0].loss);
    drv_stats_t stats;
    source.ops->stats(&source, &stats);
    TEST_ASSERT_EQUAL_UINT64(12345, stats.lost_driver);
}

static void test_names(void) {
    char next[32];
    TEST_ASSERT_EQUAL_INT(1, drv_journal_next_name("a-0001.okj", next, sizeof next));
    TEST_ASSERT_EQUAL_STRING("a-0002.okj", next);
    TEST_ASSERT_EQUAL_INT(1, drv_journal_next_name("-0999.okj", next, sizeof next));
    TEST_ASSERT_EQUAL_STRING("-1000.okj", next);
    TEST_ASSERT_EQUAL_INT(0, drv_journal_next_name("a-9999.okj", next, sizeof next));
    TEST_ASSERT_EQUAL_INT(0, drv_journal_next_name("a-00x1.okj", next, sizeof next));
    TEST_ASSERT_EQUAL_INT(0, drv_journal_next_name("a0001.okj", next, sizeof next));
    TEST_ASSERT_EQUAL_INT(0, drv_journal_next_name("a-0001.log", next, sizeof next));
    TEST_ASSERT_EQUAL_INT(0, drv_journal_next_name("okj", next, sizeof next));
    TEST_ASSERT_EQUAL_INT(0, drv_journal_next_name("a-0001.okj", next, 10));
}

static void test_what_is_no_journal(void) {
    TEST_ASSERT_EQUAL_INT(-ENOENT, start("/nonexistent/a.okj"));
    TEST_ASSERT_NOT_NULL(strstr(source.error, "/nonexistent/a.okj"));
    TEST_ASSERT_EQUAL_INT(-EISDIR, start("/tmp"));
    TEST_ASSERT_EQUAL_INT(-ENOTSUP, start("/dev/null"));
    TEST_ASSERT_NOT_NULL(strstr(source.error, "it is a device or a named pipe"));
    char empty[] = "/tmp/okid-no-journal-XXXXXX";
    const int made = mkstemp(empty);
    TEST_ASSERT_TRUE(made >= 0);
    close(made);
    TEST_ASSERT_EQUAL_INT(-EBADMSG, start(empty));
    TEST_ASSERT_NOT_NULL(strstr(source.error, "found no whole chunk of a journal"));
    unlink(empty);
    TEST_ASSERT_EQUAL_INT(-EBADF, source.ops->read(&source, frames, 64));
    char path[5000];
    memset(path, 'x', sizeof path);
    path[sizeof path - 1] = '\0';
    TEST_ASSERT_EQUAL_INT(-ENAMETOOLONG, start(path));
    TEST_ASSERT_EQUAL_INT(-1, source.ops->fd(&source));
}

static void test_a_journal_of_a_later_version_is_named(void) {
    uint8_t header[DRV_JOURNAL_HEADER];
    segment(0, 0, 2, 0);
    file = open(name(0), O_RDWR);
    for (int at = 0; pread(file, header, sizeof header, at) == (ssize_t)sizeof header;) { // its number in every chunk
        uint32_t bytes = 0;
        memcpy(&bytes, header + 12, sizeof bytes);
        header[8] = DRV_JOURNAL_VERSION + 1;
        const uint32_t seal = drv_crc32(0, header, 60);
        memcpy(header + 60, &seal, sizeof seal);
        TEST_ASSERT_EQUAL_INT(sizeof header, pwrite(file, header, sizeof header, at));
        at += (int)(DRV_JOURNAL_HEADER + bytes);
    }
    close(file);
    TEST_ASSERT_EQUAL_INT(-EBADMSG, start(name(0)));
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(source.error, "a journal of version 2, expected at most version 1"),
                                 source.error);
}

int main(void) {
    UNITY_BEGIN();
    RUN_TEST(test_segments_in_a_row);
    RUN_TEST(test_a_damaged_chunk_is_marked);
    RUN_TEST(test_a_torn_segment);
    RUN_TEST(test_frames_the_recorder_lost);
    RUN_TEST(test_names);
    RUN_TEST(test_what_is_no_journal);
    RUN_TEST(test_a_journal_of_a_later_version_is_named);
    return UNITY_END();
}
