// SPDX-License-Identifier: MIT
// PURPOSE  a GPIO line as input with time stamps or as output, whichever libgpiod is there
// METHOD   chip by path, name or label, line by name or number; edges stamped CLOCK_MONOTONIC by the kernel are carried
//          to host time by the tightest of three paired clock reads
#include "gpio_backend.h"

#include <drv/host_clock.h>

#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

enum { PATH_BYTES = 288 };

static int explain(drv_gpio_t* self, int code, const char* format, const char* detail) {
    int at = snprintf(self->error, sizeof self->error, "GPIO chip %s, line %s: ", self->chip_name, self->line_name);
    if (at > 0 && (size_t)at < sizeof self->error)
        snprintf(self->error + at, sizeof self->error - (size_t)at, format, detail);
    return -code;
}

/// Append to text, cut at its end.
static void append(char* text, size_t bytes, const char* more) {
    size_t used = strlen(text);
    if (used + 1 < bytes) snprintf(text + used, bytes - used, "%s", more);
}

/// Look at every /dev/gpiochip*: list them into `text`, or find the path of the one with a label. @return chips seen
static int scan_chips(const char* label, char path[PATH_BYTES], char* text, size_t bytes) {
    DIR* folder = opendir("/dev");
    int seen = 0;
    for (struct dirent* entry; folder && (entry = readdir(folder));) {
        if (strncmp(entry->d_name, "gpiochip", 8) != 0) continue;
        ++seen;
        char one[PATH_BYTES], found[DRV_GPIO_NAME_BYTES] = "";
        snprintf(one, sizeof one, "/dev/%s", entry->d_name);
        drv_gpio_t chip;
        memset(&chip, 0, sizeof chip);
        int code = gpio_backend_chip(&chip, one, found);
        if (code == 0 && label && strcmp(found, label) == 0) memcpy(path, one, PATH_BYTES);
        if (text) {
            char words[2 * PATH_BYTES];
            if (code)
                snprintf(words, sizeof words, "%s%s (%s)", seen > 1 ? ", " : "", entry->d_name, strerror(-code));
            else
                snprintf(words, sizeof words, "%s%s (%s, %d lines)", seen > 1 ? ", " : "", entry->d_name, found,
                         (int)chip.line_count);
            append(text, bytes, words);
        }
        gpio_backend_close(&chip);
    }
    if (folder) closedir(folder);
    return seen;
}

static int open_chip(drv_gpio_t* self, const char* name) {
    char path[PATH_BYTES] = "", label[DRV_GPIO_NAME_BYTES];
    snprintf(path, sizeof path, "%s%s", strchr(name, '/') ? "" : "/dev/", name);
    if (access(path, F_OK) != 0) {
        path[0] = '\0';
        if (!strchr(name, '/')) (void)scan_chips(name, path, NULL, 0);
    }
    if (path[0] == '\0') {
        char there[DRV_ERROR_BYTES / 2] = "";
        if (scan_chips(NULL, path, there, sizeof there) == 0)
            return explain(self, ENOTTY, "this machine has no GPIO chip (no /dev/gpiochip*)%s", "");
        return explain(self, ENOENT, "there is no such chip, found: %s", there);
    }
    int code = gpio_backend_chip(self, path, label);
    if (code == -EACCES || code == -EPERM) return explain(self, EACCES, "no permission to open %s", path);
    if (code == -ENOSYS)
        return explain(self, ENOSYS, "this build has no GPIO: install libgpiod-dev and build okid again%s", "");
    if (code) return explain(self, ENOTTY, "it is no GPIO chip that can be opened (%s)", strerror(-code));
    return 0;
}

static int unknown_line(drv_gpio_t* self) {
    char names[DRV_ERROR_BYTES / 2] = "";
    gpio_line_info_t info;
    for (int32_t i = 0; i < self->line_count; ++i) {
        if (gpio_backend_line(self, i, &info) != 0 || info.name[0] == '\0') continue;
        if (names[0]) append(names, sizeof names, ", ");
        append(names, sizeof names, info.name);
    }
    return explain(self, ENOENT, names[0] ? "no line has this name, names found: %s" : "no line of it has a name%s",
                   names);
}

/// self->offset from name or number.
static int find_line(drv_gpio_t* self, const drv_gpio_config_t* config) {
    gpio_line_info_t info;
    if (!config->line) {
        if (config->offset >= 0 && config->offset < self->line_count) {
            self->offset = config->offset;
            return 0;
        }
        char range[48];
        snprintf(range, sizeof range, "lines 0 to %d", (int)self->line_count - 1);
        return explain(self, ENOENT, "the chip has %s", range);
    }
    for (int32_t i = 0; i < self->line_count; ++i)
        if (gpio_backend_line(self, i, &info) == 0 && strcmp(info.name, config->line) == 0) {
            self->offset = i;
            return 0;
        }
    return unknown_line(self);
}

static int request_failed(drv_gpio_t* self, int code, const drv_gpio_config_t* config) {
    gpio_line_info_t info;
    if (code == EBUSY) {
        int known = gpio_backend_line(self, self->offset, &info) == 0 && info.user[0];
        return explain(self, code, "it is in use by %s", known ? info.user : "the kernel");
    }
    if (code == EOPNOTSUPP && config->debounce_us > 0) return explain(self, code, "libgpiod 1.6 has no debounce%s", "");
    if ((code == ENODEV || code == ENXIO || code == EINVAL) && config->edge != DRV_GPIO_NO_EDGE)
        return explain(self, ENODEV, "the chip cannot tell its edges (%s)", strerror(code));
    return explain(self, code, "%s", strerror(code));
}

static int open_line(drv_gpio_t* self, const drv_gpio_config_t* config, int output) {
    memset(self, 0, sizeof *self);
    const char* chip = config->chip ? config->chip : "";
    snprintf(self->chip_name, sizeof self->chip_name, "%s", chip);
    if (config->line)
        snprintf(self->line_name, sizeof self->line_name, "%s", config->line);
    else
        snprintf(self->line_name, sizeof self->line_name, "%d", (int)config->offset);
    if (chip[0] == '\0' || strlen(chip) >= sizeof self->chip_name)
        return explain(self, EINVAL, "a chip is named by 1 to 63 characters%s", "");
    if (config->line && (config->line[0] == '\0' || strlen(config->line) >= sizeof self->line_name))
        return explain(self, EINVAL, "a line is named by 1 to 63 characters%s", "");
    int code = open_chip(self, chip);
    if (code == 0) code = find_line(self, config);
    if (code == 0) {
        code = gpio_backend_request(self, config, output);
        if (code) code = request_failed(self, -code, config);
    }
    if (code) gpio_backend_close(self);
    return code;
}

int drv_gpio_open_input(drv_gpio_t* self, const drv_gpio_config_t* config) {
    int code = open_line(self, config, 0);
    int fd = code ? -1 : drv_gpio_fd(self);
    if (fd >= 0) (void)fcntl(fd, F_SETFL, fcntl(fd, F_GETFL) | O_NONBLOCK);
    return code;
}

int drv_gpio_open_output(drv_gpio_t* self, const drv_gpio_config_t* config) { return open_line(self, config, 1); }

int drv_gpio_fd(const drv_gpio_t* self) { return self->line ? gpio_backend_fd(self) : -1; }

/// Host time - CLOCK_MONOTONIC; *error bounds it.
static int64_t host_offset_ns(int64_t* error) {
    const drv_clock_pair_t pair = drv_clock_pair(CLOCK_MONOTONIC, 3);
    const int64_t half = (pair.after_ns - pair.before_ns) / 2;
    *error = half + 1;
    return drv_host_time_of(pair.before_ns + half) - pair.reference_ns;
}

int drv_gpio_read(drv_gpio_t* self, drv_gpio_event_t* events, int capacity) {
    gpio_edge_t edges[GPIO_BATCH];
    if (drv_gpio_fd(self) < 0) return -EBADF;
    int count = gpio_backend_read(self, edges, capacity < GPIO_BATCH ? capacity : GPIO_BATCH);
    if (count == -EAGAIN || count == -EINTR) return 0;
    if (count < 0) return explain(self, -count, "its edges cannot be read: %s", strerror(-count));
    int64_t offset = host_offset_ns(&self->clock_error_ns);
    for (int i = 0; i < count; ++i) {
        events[i].monotonic_ns = edges[i].monotonic_ns;
        events[i].time_ns = edges[i].monotonic_ns + offset;
        events[i].edge = edges[i].edge;
        events[i].lost = edges[i].lost;
        self->lost += edges[i].lost;
    }
    self->events += (uint64_t)count;
    return count;
}

int drv_gpio_get(drv_gpio_t* self) {
    if (!self->line) return -EBADF;
    int level = gpio_backend_get(self);
    return level < 0 ? explain(self, -level, "its level cannot be read: %s", strerror(-level)) : level;
}

int drv_gpio_set(drv_gpio_t* self, int active) {
    if (!self->line) return -EBADF;
    int code = gpio_backend_set(self, active != 0);
    return code < 0 ? explain(self, -code, "it cannot be set: %s", strerror(-code)) : 0;
}

void drv_gpio_close(drv_gpio_t* self) { gpio_backend_close(self); }

int drv_gpio_list_chips(char* text, size_t bytes) {
    char path[PATH_BYTES] = "";
    if (bytes > 0) text[0] = '\0';
    return scan_chips(NULL, path, text, bytes);
}
