// SPDX-License-Identifier: MIT
// PURPOSE  frames out of a candump -L text log, as fast as they are asked for; pacing is the caller's
// METHOD   large reads into one buffer, lines cut in place; a line that does not parse ends the replay and names itself
#include <drv/can_error.h>
#include <drv/candump.h>
#include <drv/input_file.h>
#include <drv/source.h>

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

enum { BUFFER_BYTES = 1 << 18, LONGEST_LINE = 1024 };

typedef struct replay_t {
    int fd;
    int at_end;
    int torn;          ///< the last line has no end
    size_t begin, end; ///< unread part of the buffer
    uint64_t line;     ///< number of the line given last
    int32_t interface_count;
    char interfaces[DRV_MAX_BUSES][DRV_NAME_BYTES];
    char path[200];
    char buffer[BUFFER_BYTES];
} replay_t;

static int replay_open(drv_source_t* self, const drv_source_config_t* config) {
    memset(&self->counts, 0, sizeof self->counts);
    self->error[0] = '\0';
    self->state = NULL;
    const int fd = drv_input_open(config->path);
    int code = fd < 0 ? -fd : 0;
    replay_t* state = code == 0 ? malloc(sizeof *state) : NULL;
    if (code == 0 && !state) code = ENOMEM;
    if (code) {
        snprintf(self->error, sizeof self->error, "%s: cannot be read: %s", config->path, drv_input_fault(code));
        if (fd >= 0) close(fd);
        return -code;
    }
    memset(state, 0, offsetof(replay_t, buffer));
    state->fd = fd;
    state->interface_count = config->interface_count < DRV_MAX_BUSES ? config->interface_count : DRV_MAX_BUSES;
    for (int32_t i = 0; i < state->interface_count; ++i)
        snprintf(state->interfaces[i], DRV_NAME_BYTES, "%s", config->interfaces[i]);
    snprintf(state->path, sizeof state->path, "%s", config->path);
    self->state = state;
    self->counts.stamp = DRV_STAMP_US;
    return 0;
}

static int replay_fd(const drv_source_t* self) {
    const replay_t* state = self->state;
    return state ? state->fd : -1;
}

/// More bytes behind the unread ones. @return 0, or -errno
static int fill(drv_source_t* self, replay_t* state) {
    memmove(state->buffer, state->buffer + state->begin, state->end - state->begin);
    state->end -= state->begin;
    state->begin = 0;
    ssize_t got;
    do got = read(state->fd, state->buffer + state->end, BUFFER_BYTES - state->end);
    while (got < 0 && errno == EINTR);
    if (got < 0) {
        int code = errno;
        snprintf(self->error, sizeof self->error, "%s: cannot be read: %s", state->path, strerror(code));
        return -code;
    }
    if (got == 0) state->at_end = 1;
    state->end += (size_t)got;
    return 0;
}

/// The next line. @return 1; 0 at the end; -errno
static int next_line(drv_source_t* self, replay_t* state, const char** line, size_t* length) {
    for (;;) {
        const char* start = state->buffer + state->begin;
        size_t have = state->end - state->begin;
        const char* stop = memchr(start, '\n', have);
        if (stop || (state->at_end && have > 0)) {
            *line = start;
            *length = stop ? (size_t)(stop - start) : have;
            state->torn = stop == NULL;
            state->begin += *length + (stop ? 1 : 0);
            ++state->line;
            return 1;
        }
        if (state->at_end) return 0;
        if (have > LONGEST_LINE) {
            snprintf(self->error, sizeof self->error,
                     "%s: line %llu: found more than %d characters, expected a candump -L log such as "
                     "\"(1700000000.123456) can0 123#0011\"",
                     state->path, (unsigned long long)state->line + 1, LONGEST_LINE);
            return -EBADMSG;
        }
        int code = fill(self, state);
        if (code) return code;
    }
}

/// Index of the interface to deliver, -1 when it is not wanted.
static int wanted(const replay_t* state, const char* interface) {
    if (state->interface_count == 0) return 0;
    for (int i = 0; i < state->interface_count; ++i)
        if (strcmp(state->interfaces[i], interface) == 0) return i;
    return -1;
}

static int refuse(drv_source_t* self, const replay_t* state, const drv_candump_error_t* why) {
    snprintf(self->error, sizeof self->error, "%s: line %llu, column %d: found \"%s\", expected %s", state->path,
             (unsigned long long)state->line, why->column, why->found, why->expected);
    return -EBADMSG;
}

static int replay_read(drv_source_t* self, drv_frame_t* frames, int capacity) {
    replay_t* state = self->state;
    if (!state) return -EBADF;
    if (self->error[0]) return -EBADMSG; // the frames before a bad line were delivered first
    int count = 0;
    while (count < capacity) {
        const char* line = NULL;
        size_t length = 0;
        int got = next_line(self, state, &line, &length);
        if (got <= 0) return count > 0 ? count : got == 0 ? DRV_END : got;
        if (length == 0 || (length == 1 && line[0] == '\r')) continue;
        char interface[DRV_NAME_BYTES];
        drv_candump_error_t why = {0};
        drv_frame_t* frame = &frames[count];
        if (drv_candump_parse(line, length, frame, interface, &why)) {
            if (state->torn) { // the writer was killed within its last line
                ++self->counts.torn;
                continue;
            }
            int code = refuse(self, state, &why);
            return count > 0 ? count : code;
        }
        int bus = wanted(state, interface);
        if (bus < 0) {
            ++self->counts.foreign;
        } else if (frame->flags & DRV_FRAME_ERROR) {
            drv_can_error_count(&self->counts, frame->id, frame->data);
        } else if (frame->flags & DRV_FRAME_REMOTE) {
            ++self->counts.remote;
        } else {
            frame->bus = (uint8_t)bus;
            ++self->counts.received;
            ++count;
        }
    }
    return count;
}

static void replay_stats(drv_source_t* self, drv_stats_t* out) { *out = self->counts; }

static void replay_close(drv_source_t* self) {
    replay_t* state = self->state;
    if (!state) return;
    close(state->fd);
    free(state);
    self->state = NULL;
}

const drv_source_ops_t drv_source_replay = {replay_open, replay_fd, replay_read, replay_stats, replay_close};
