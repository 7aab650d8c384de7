// SPDX-License-Identifier: MIT
// PURPOSE  open, set up, read and write a serial line
// METHOD   termios2 with BOTHER takes any baud rate; flock and TIOCEXCL keep others off; ASYNC_LOW_LATENCY and the
//          latency_timer of USB adapters make bytes arrive at once. What a device does not know of these is no error
#include <drv/serial_port.h>

#include <asm/termbits.h>

#include <errno.h>
#include <fcntl.h>
#include <linux/serial.h>
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <sys/ioctl.h>
#include <time.h>
#include <unistd.h>

enum { BAUD_TOLERANCE_PERCENT = 3, DRAIN_MS = 100 };

static int explain(drv_serial_t* self, int code, const char* path, const char* text) {
    snprintf(self->error, sizeof self->error, "%s: %s", path, text);
    return -code;
}

static int refuse_open(drv_serial_t* self, int code, const char* path) {
    if (code == ENOENT || code == ENXIO || code == ENODEV || code == EIO)
        return explain(self, ENOENT, path, "there is no such device");
    if (code == EACCES || code == EPERM) return explain(self, EACCES, path, "no permission to open it");
    if (code == EBUSY) return explain(self, EBUSY, path, "another program has it open");
    return explain(self, code, path, strerror(code));
}

static int set_line(drv_serial_t* self, const char* path, int32_t baud) {
    struct termios2 line;
    if (ioctl(self->fd, TCGETS2, &line) != 0) return explain(self, ENOTTY, path, "is no serial device");
    line.c_iflag = IGNBRK;
    line.c_oflag = 0;
    line.c_lflag = 0;
    line.c_cflag = CS8 | CREAD | CLOCAL | BOTHER | (BOTHER << IBSHIFT);
    line.c_ispeed = line.c_ospeed = (speed_t)baud;
    line.c_cc[VMIN] = 1;
    line.c_cc[VTIME] = 0;
    if (ioctl(self->fd, TCSETS2, &line) != 0 || ioctl(self->fd, TCGETS2, &line) != 0) {
        const int code = errno;
        return explain(self, code, path, strerror(code));
    }
    self->baud = (int32_t)line.c_ospeed;
    const int64_t apart = (int64_t)self->baud - baud;
    if (100 * (apart < 0 ? -apart : apart) > (int64_t)BAUD_TOLERANCE_PERCENT * baud) {
        snprintf(self->error, sizeof self->error, "%s: cannot do %d baud, the nearest it can is %d", path, (int)baud,
                 (int)self->baud);
        return -EINVAL;
    }
    return 0;
}

/// The number in /sys/class/tty/NAME/device/latency_timer; -1 without one. Made 1 where that is allowed.
static int least_latency(const char* path) {
    char resolved[4096], knob[DRV_PATH_BYTES]; // realpath() wants PATH_MAX
    if (!realpath(path, resolved)) return -1;
    const char* name = strrchr(resolved, '/');
    if (!name || strlen(name) > 64) return -1;
    snprintf(knob, sizeof knob, "/sys/class/tty%s/device/latency_timer", name);
    int ms = -1;
    FILE* file = fopen(knob, "r+e");
    if (file) {
        (void)fputs("1", file);
        fclose(file);
    }
    file = fopen(knob, "re");
    if (!file) return -1;
    if (fscanf(file, "%d", &ms) != 1) ms = -1;
    fclose(file);
    return ms;
}

static int take_counters(const drv_serial_t* self, uint32_t out[4]) {
    struct serial_icounter_struct counts;
    memset(&counts, 0, sizeof counts);
    if (ioctl(self->fd, TIOCGICOUNT, &counts) != 0) return 0;
    out[0] = (uint32_t)counts.overrun;
    out[1] = (uint32_t)counts.buf_overrun;
    out[2] = (uint32_t)counts.frame;
    out[3] = (uint32_t)counts.parity;
    return 1;
}

static void ask_for_speed(drv_serial_t* self, const char* path) {
    struct serial_struct settings;
    memset(&settings, 0, sizeof settings);
    if (ioctl(self->fd, TIOCGSERIAL, &settings) == 0) {
        settings.flags |= (int)ASYNC_LOW_LATENCY;
        self->low_latency = ioctl(self->fd, TIOCSSERIAL, &settings) == 0;
    }
    self->latency_ms = least_latency(path);
}

int drv_serial_open(drv_serial_t* self, const char* path, int32_t baud) {
    memset(self, 0, sizeof *self);
    self->latency_ms = -1;
    self->fd = open(path, O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC);
    if (self->fd < 0) {
        const int code = errno;
        return refuse_open(self, code, path);
    }
    int status = 0;
    if (!isatty(self->fd))
        status = explain(self, ENOTTY, path, "is no serial device");
    else if (flock(self->fd, LOCK_EX | LOCK_NB) != 0)
        status = refuse_open(self, EBUSY, path);
    if (status == 0) {
        (void)ioctl(self->fd, TIOCEXCL);
        status = set_line(self, path, baud);
    }
    if (status != 0) {
        drv_serial_close(self);
        return status;
    }
    ask_for_speed(self, path);
    self->counts_errors = take_counters(self, self->counted);
    return 0;
}

int drv_serial_read(drv_serial_t* self, uint8_t* bytes, size_t capacity) {
    const ssize_t got = read(self->fd, bytes, capacity);
    if (got > 0) return (int)got;
    if (got < 0 && (errno == EAGAIN || errno == EWOULDBLOCK || errno == EINTR)) return 0;
    return -ENODEV; // end of file and EIO alike: the line hung up
}

static int64_t monotonic_ms(void) {
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (int64_t)now.tv_sec * 1000 + now.tv_nsec / 1000000;
}

int drv_serial_write(drv_serial_t* self, const uint8_t* bytes, size_t count, int patience_ms) {
    const int64_t deadline = monotonic_ms() + patience_ms;
    while (count > 0) {
        const ssize_t sent = write(self->fd, bytes, count);
        if (sent > 0) {
            bytes += sent;
            count -= (size_t)sent;
            continue;
        }
        const int code = errno;
        if (sent < 0 && code != EAGAIN && code != EWOULDBLOCK && code != EINTR) {
            snprintf(self->error, sizeof self->error, "cannot be written: %s", strerror(code));
            return -code;
        }
        const int64_t left = deadline - monotonic_ms();
        if (left <= 0) {
            snprintf(self->error, sizeof self->error,
                     "takes no more bytes: no program reads them at the other end, "
                     "or the baud rate is too low");
            return -ETIMEDOUT;
        }
        struct pollfd writable = {self->fd, POLLOUT, 0};
        (void)poll(&writable, 1, left < 100 ? (int)left : 100);
    }
    return 0;
}

void drv_serial_errors(drv_serial_t* self, drv_serial_errors_t* out) {
    uint32_t now[4];
    memset(out, 0, sizeof *out);
    if (self->fd < 0 || !self->counts_errors || !take_counters(self, now)) return;
    out->overrun = now[0] - self->counted[0] + now[1] - self->counted[1];
    out->frame = now[2] - self->counted[2];
    out->parity = now[3] - self->counted[3];
}

void drv_serial_close(drv_serial_t* self) {
    if (self->fd < 0) return;
    int waiting = 0;
    const int64_t deadline = monotonic_ms() + DRAIN_MS;
    while (ioctl(self->fd, TIOCOUTQ, &waiting) == 0 && waiting > 0 && monotonic_ms() < deadline) {
        const struct timespec piece = {0, 1000000};
        nanosleep(&piece, NULL);
    }
    close(self->fd);
    self->fd = -1;
}
