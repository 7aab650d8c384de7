// SPDX-License-Identifier: MIT
// PURPOSE  frames out of a journal, as fast as they are asked for; pacing is the caller's
// METHOD   chunk by chunk; where one is missing the next frame of every bus says so. At the end of a file the next
//          segment is opened when it is there
#include <drv/input_file.h>
#include <drv/journal.h>
#include <drv/source.h>

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

enum { PATH_BYTES = 4096 };

typedef struct journal_t {
    int fd;
    int failed; ///< -errno of a read
    int in_chunk, segments;
    size_t at;
    uint32_t unmarked; ///< buses whose next frame is the first after a gap
    drv_journal_chunk_t chunk;
    drv_journal_reader_t reader;
    char path[PATH_BYTES];
} journal_t;

static long read_file(void* context, uint8_t* bytes, size_t count) {
    const ssize_t got = read(((journal_t*)context)->fd, bytes, count);
    return got < 0 ? -errno : (long)got;
}

int drv_journal_next_name(const char* path, char* out, size_t capacity) {
    const size_t length = strlen(path);
    if (length < 9 || length >= capacity || strcmp(path + length - 4, ".okj") != 0 || path[length - 9] != '-') return 0;
    for (size_t digit = length - 8; digit < length - 4; ++digit)
        if (path[digit] < '0' || path[digit] > '9') return 0;
    memcpy(out, path, length + 1);
    for (size_t digit = length - 5; digit > length - 9; --digit) {
        out[digit] = out[digit] == '9' ? '0' : (char)(out[digit] + 1);
        if (out[digit] != '0') return 1;
    }
    return 0; // 9999 is the last one
}

static int fail(drv_source_t* self, const char* path, int code) {
    snprintf(self->error, sizeof self->error, "%.200s: cannot be read: %s", path, drv_input_fault(code));
    return -code;
}

/// @return 0 or -errno
static int open_file(journal_t* state) {
    const int fd = drv_input_open(state->path);
    if (fd < 0) return fd;
    if (state->fd >= 0) close(state->fd);
    state->fd = fd;
    ++state->segments;
    return 0;
}

/// To the next chunk, in the next segment if need be. @return 1, 0 at the end, -errno
static int next_chunk(journal_t* state) {
    for (;;) {
        const int got = drv_journal_next(&state->reader, &state->chunk);
        if (got != 0) return got;
        char next[PATH_BYTES];
        if (!drv_journal_next_name(state->path, next, sizeof next) || access(next, F_OK) != 0) return 0;
        memcpy(state->path, next, sizeof next);
        const int code = open_file(state);
        if (code) return code;
        drv_journal_reader_continue(&state->reader, read_file, state);
    }
}

/// A file without one valid chunk is no journal.
static int open_first(drv_source_t* self, journal_t* state) {
    int code = open_file(state);
    if (code) return fail(self, state->path, -code);
    drv_journal_reader_begin(&state->reader, read_file, state);
    code = drv_journal_next(&state->reader, &state->chunk);
    if (code < 0) return fail(self, state->path, -code);
    state->in_chunk = code;
    if (code > 0) return 0;
    if (state->reader.newer)
        snprintf(self->error, sizeof self->error, "%.200s: a journal of version %u, expected at most version %d: %s",
                 state->path, state->reader.newer, DRV_JOURNAL_VERSION, "a later okid wrote it");
    else
        snprintf(self->error, sizeof self->error, "%.200s: found no whole chunk of a journal, expected a file of %s",
                 state->path, "okid record");
    return -EBADMSG;
}

static int journal_open(drv_source_t* self, const drv_source_config_t* config) {
    memset(&self->counts, 0, sizeof self->counts);
    self->error[0] = '\0';
    self->state = NULL;
    self->counts.stamp = DRV_STAMP_NS;
    if (strlen(config->path) >= PATH_BYTES) return fail(self, config->path, ENAMETOOLONG);
    journal_t* state = calloc(1, sizeof *state);
    if (!state) return fail(self, config->path, ENOMEM);
    state->fd = -1;
    snprintf(state->path, sizeof state->path, "%s", config->path);
    const int code = open_first(self, state);
    if (code) {
        if (state->fd >= 0) close(state->fd);
        free(state);
        return code;
    }
    self->state = state;
    return 0;
}

static int journal_fd(const drv_source_t* self) {
    const journal_t* state = self->state;
    return state ? state->fd : -1;
}

static void deliver(drv_source_t* self, journal_t* state, drv_frame_t* frame) {
    const uint32_t bus = UINT32_C(1) << frame->bus;
    if (state->unmarked & bus) frame->loss |= DRV_LOSS_DRIVER;
    state->unmarked &= ~bus;
    ++self->counts.received;
}

static int journal_read(drv_source_t* self, drv_frame_t* frames, int capacity) {
    journal_t* state = self->state;
    if (!state) return -EBADF;
    if (state->failed) return state->failed;
    int count = 0;
    while (count < capacity) {
        if (!state->in_chunk) {
            const int got = next_chunk(state);
            if (got < 0) state->failed = fail(self, state->path, -got);
            if (got <= 0) return count > 0 ? count : got == 0 ? DRV_END : got;
            state->in_chunk = 1;
            state->at = 0;
        }
        if (state->at == 0) {
            if (state->chunk.gap) state->unmarked = UINT32_MAX;
            self->counts.lost_driver += state->chunk.lost;
        }
        state->in_chunk =
            state->chunk.kind == DRV_JOURNAL_FRAMES && drv_journal_frame(&state->chunk, &state->at, &frames[count]);
        if (state->in_chunk) deliver(self, state, &frames[count++]);
    }
    return count;
}

static void journal_stats(drv_source_t* self, drv_stats_t* out) {
    const drv_journal_reader_t* reader = drv_source_journal_reader(self);
    if (reader) {
        self->counts.damaged = reader->damaged;
        self->counts.skipped = reader->skipped_bytes;
        self->counts.torn = reader->torn_bytes > 0;
        self->counts.foreign = reader->foreign;
    }
    *out = self->counts;
}

static void journal_close(drv_source_t* self) {
    journal_t* state = self->state;
    if (!state) return;
    drv_stats_t last;
    journal_stats(self, &last);
    close(state->fd);
    free(state);
    self->state = NULL;
}

const drv_journal_reader_t* drv_source_journal_reader(const drv_source_t* source) {
    const journal_t* state = source->state;
    return state ? &state->reader : NULL;
}

int drv_source_journal_segments(const drv_source_t* source) {
    const journal_t* state = source->state;
    return state ? state->segments : 0;
}

const drv_source_ops_t drv_source_journal = {journal_open, journal_fd, journal_read, journal_stats, journal_close};
