// SPDX-License-Identifier: MIT
// PURPOSE  GPIO lines by libgpiod 1.6 (Debian 12, Ubuntu 24.04); compiled when that is the one installed
// METHOD   its edges carry no numbers: with both edges asked for, two alike in a row show a loss
#include "gpio_backend.h"

#include <errno.h>
#include <gpiod.h>
#include <stdio.h>
#include <string.h>

int gpio_backend_chip(drv_gpio_t* self, const char* path, char label[DRV_GPIO_NAME_BYTES]) {
    struct gpiod_chip* chip = gpiod_chip_open(path);
    if (!chip) return errno ? -errno : -EIO;
    self->chip = chip;
    self->line_count = (int32_t)gpiod_chip_num_lines(chip);
    snprintf(label, DRV_GPIO_NAME_BYTES, "%s", gpiod_chip_label(chip));
    return 0;
}

int gpio_backend_line(drv_gpio_t* self, int32_t offset, gpio_line_info_t* out) {
    struct gpiod_line* line = gpiod_chip_get_line(self->chip, (unsigned)offset);
    if (!line) return -errno;
    const char *name = gpiod_line_name(line), *user = gpiod_line_consumer(line);
    snprintf(out->name, sizeof out->name, "%s", name ? name : "");
    snprintf(out->user, sizeof out->user, "%s", user ? user : "");
    return 0;
}

int gpio_backend_request(drv_gpio_t* self, const drv_gpio_config_t* config, int output) {
    static const int edges[] = {GPIOD_LINE_REQUEST_DIRECTION_INPUT, GPIOD_LINE_REQUEST_EVENT_RISING_EDGE,
                                GPIOD_LINE_REQUEST_EVENT_FALLING_EDGE, GPIOD_LINE_REQUEST_EVENT_BOTH_EDGES};
    static const int biases[] = {0, GPIOD_LINE_REQUEST_FLAG_BIAS_DISABLE, GPIOD_LINE_REQUEST_FLAG_BIAS_PULL_UP,
                                 GPIOD_LINE_REQUEST_FLAG_BIAS_PULL_DOWN};
    if (!output && config->debounce_us > 0) return -EOPNOTSUPP;
    struct gpiod_line* line = gpiod_chip_get_line(self->chip, (unsigned)self->offset);
    if (!line) return -errno;
    struct gpiod_line_request_config wanted = {.consumer = "okid"};
    wanted.request_type = output ? GPIOD_LINE_REQUEST_DIRECTION_OUTPUT : edges[config->edge];
    wanted.flags = (config->active_low ? GPIOD_LINE_REQUEST_FLAG_ACTIVE_LOW : 0) | (output ? 0 : biases[config->bias]);
    if (gpiod_line_request(line, &wanted, config->initial != 0) != 0) return -errno;
    self->line = line;
    self->expected = config->edge == DRV_GPIO_BOTH ? DRV_GPIO_BOTH : 0;
    return 0;
}

int gpio_backend_fd(const drv_gpio_t* self) { return gpiod_line_event_get_fd(self->line); }

int gpio_backend_read(drv_gpio_t* self, gpio_edge_t* edges, int capacity) {
    struct gpiod_line_event events[GPIO_BATCH];
    int count = gpiod_line_event_read_fd_multiple(gpio_backend_fd(self), events, (unsigned)capacity);
    if (count < 0) return -errno;
    for (int i = 0; i < count; ++i) {
        int rising = events[i].event_type == GPIOD_LINE_EVENT_RISING_EDGE;
        edges[i].edge = rising ? DRV_GPIO_RISING : DRV_GPIO_FALLING;
        edges[i].monotonic_ns = (int64_t)events[i].ts.tv_sec * 1000000000 + events[i].ts.tv_nsec;
        edges[i].lost = self->expected && !(self->expected & (int)edges[i].edge);
        if (self->expected) self->expected = DRV_GPIO_BOTH & ~(int)edges[i].edge;
    }
    return count;
}

int gpio_backend_get(drv_gpio_t* self) {
    int level = gpiod_line_get_value(self->line);
    return level < 0 ? -errno : level;
}

int gpio_backend_set(drv_gpio_t* self, int active) {
    return gpiod_line_set_value(self->line, active) != 0 ? -errno : 0;
}

void gpio_backend_close(drv_gpio_t* self) {
    if (self->line) gpiod_line_release(self->line);
    if (self->chip) gpiod_chip_close(self->chip);
    self->line = self->chip = NULL;
}
