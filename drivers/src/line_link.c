// SPDX-License-Identifier: MIT
// PURPOSE  keep a serial line open across unplugging
// METHOD   a read that says "hung up" closes the device, because its number may change; the path finds it again
#include "line_link.h"

#include <drv/host_clock.h>

#include <errno.h>
#include <stdio.h>
#include <string.h>
#include <time.h>

static const int64_t retry_ns = 100000000;

static int64_t monotonic_ns(void) {
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (int64_t)now.tv_sec * 1000000000 + now.tv_nsec;
}

int line_link_open(line_link_t* self, drv_source_t* source, const drv_line_config_t* config) {
    const char* path = config->device ? config->device : "";
    memset(self, 0, sizeof *self);
    self->port.fd = -1;
    self->pushed = config->device == NULL;
    if (self->pushed) return 0;
    if (path[0] == '\0' || strlen(path) >= sizeof self->path) {
        snprintf(source->error, sizeof source->error, "%.40s: a device has a path of 1 to %d characters", path,
                 DRV_PATH_BYTES - 1);
        return -EINVAL;
    }
    memcpy(self->path, path, strlen(path) + 1);
    self->baud = config->baud;
    const int status = drv_serial_open(&self->port, path, config->baud);
    if (status != 0) memcpy(source->error, self->port.error, sizeof source->error);
    return status;
}

static void lose(line_link_t* self, drv_source_t* source) {
    line_link_count(self, source);
    self->overruns_before = source->counts.line_overruns;
    self->errors_before = source->counts.line_errors;
    memset(&self->seen, 0, sizeof self->seen);
    drv_serial_close(&self->port);
    ++source->counts.link_down;
    source->counts.link_is_down = 1;
    self->loss |= DRV_LOSS_LINK;
    self->next_try_ns = monotonic_ns() + retry_ns;
}

static int try_again(line_link_t* self, drv_source_t* source) {
    const int64_t now = monotonic_ns();
    if (now < self->next_try_ns) return 0;
    self->next_try_ns = now + retry_ns;
    if (drv_serial_open(&self->port, self->path, self->baud) != 0) return 0;
    ++source->counts.reopened;
    return 1;
}

/// The pushed bytes, in their order. Nothing is lost: what has no room waits.
static int take_pushed(line_link_t* self, drv_source_t* source, uint8_t* bytes, size_t capacity, int* torn) {
    const size_t count = self->waiting < capacity ? self->waiting : capacity;
    *torn = self->broken;
    self->broken = 0;
    if (count == 0) return 0;
    memcpy(bytes, self->bytes, count);
    self->bytes += count;
    self->waiting -= count;
    source->counts.bytes += (uint64_t)count;
    return (int)count;
}

int line_link_read(line_link_t* self, drv_source_t* source, uint8_t* bytes, size_t capacity, int* torn) {
    if (self->pushed) return take_pushed(self, source, bytes, capacity, torn);
    *torn = self->port.fd < 0;
    if (*torn && !try_again(self, source)) return 0;
    const int got = drv_serial_read(&self->port, bytes, capacity);
    if (got < 0) {
        lose(self, source);
        *torn = 1;
        return 0;
    }
    if (got == 0) return 0;
    source->counts.link_is_down = 0;
    source->counts.bytes += (uint64_t)got;
    return got;
}

int64_t line_link_time(const line_link_t* self) { return self->pushed ? self->pushed_ns : drv_host_time_ns(); }

void drv_line_push(drv_source_t* self, const uint8_t* bytes, size_t count, int64_t arrived_ns) {
    line_link_t* link = self->state;
    self->counts.link_is_down = 0;
    link->bytes = bytes;
    link->waiting = count;
    link->pushed_ns = arrived_ns;
}

void drv_line_break(drv_source_t* self) {
    line_link_t* link = self->state;
    link->waiting = 0;
    link->broken = 1;
    link->loss |= DRV_LOSS_LINK;
    ++self->counts.link_down;
    self->counts.link_is_down = 1;
}

void line_link_count(line_link_t* self, drv_source_t* source) {
    drv_serial_errors_t now;
    if (self->port.fd < 0) return;
    drv_serial_errors(&self->port, &now);
    if (now.overrun != self->seen.overrun) {
        source->counts.lost_driver += now.overrun - self->seen.overrun;
        self->loss |= DRV_LOSS_DRIVER;
    }
    self->seen = now;
    source->counts.line_overruns = self->overruns_before + now.overrun;
    source->counts.line_errors = self->errors_before + now.frame + now.parity;
}
