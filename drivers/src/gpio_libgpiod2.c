// SPDX-License-Identifier: MIT
// PURPOSE  GPIO lines by libgpiod 2.x (Debian 13 on); compiled when that is the one installed
// METHOD   the kernel numbers the edges of a line: a number that is missing is an edge that was lost
#include "gpio_backend.h"

#include <errno.h>
#include <gpiod.h>
#include <stdio.h>

enum { KERNEL_BUFFER = 1024 }; // edges the kernel keeps unread; the most it grants

int gpio_backend_chip(drv_gpio_t* self, const char* path, char label[DRV_GPIO_NAME_BYTES]) {
    struct gpiod_chip* chip = gpiod_chip_open(path);
    if (!chip) return -errno;
    struct gpiod_chip_info* info = gpiod_chip_get_info(chip);
    if (!info) {
        int code = errno;
        gpiod_chip_close(chip);
        return -code;
    }
    self->chip = chip;
    self->line_count = (int32_t)gpiod_chip_info_get_num_lines(info);
    snprintf(label, DRV_GPIO_NAME_BYTES, "%s", gpiod_chip_info_get_label(info));
    gpiod_chip_info_free(info);
    return 0;
}

int gpio_backend_line(drv_gpio_t* self, int32_t offset, gpio_line_info_t* out) {
    struct gpiod_line_info* info = gpiod_chip_get_line_info(self->chip, (unsigned)offset);
    if (!info) return -errno;
    const char *name = gpiod_line_info_get_name(info), *user = gpiod_line_info_get_consumer(info);
    snprintf(out->name, sizeof out->name, "%s", name ? name : "");
    snprintf(out->user, sizeof out->user, "%s", user ? user : "");
    gpiod_line_info_free(info);
    return 0;
}

static int fill_settings(struct gpiod_line_settings* settings, const drv_gpio_config_t* config, int output) {
    static const enum gpiod_line_edge edges[] = {GPIOD_LINE_EDGE_NONE, GPIOD_LINE_EDGE_RISING, GPIOD_LINE_EDGE_FALLING,
                                                 GPIOD_LINE_EDGE_BOTH};
    static const enum gpiod_line_bias biases[] = {GPIOD_LINE_BIAS_AS_IS, GPIOD_LINE_BIAS_DISABLED,
                                                  GPIOD_LINE_BIAS_PULL_UP, GPIOD_LINE_BIAS_PULL_DOWN};
    int bad =
        gpiod_line_settings_set_direction(settings, output ? GPIOD_LINE_DIRECTION_OUTPUT : GPIOD_LINE_DIRECTION_INPUT);
    gpiod_line_settings_set_active_low(settings, config->active_low != 0);
    if (output)
        return bad | gpiod_line_settings_set_output_value(settings, config->initial ? GPIOD_LINE_VALUE_ACTIVE
                                                                                    : GPIOD_LINE_VALUE_INACTIVE);
    bad |= gpiod_line_settings_set_edge_detection(settings, edges[config->edge]);
    bad |= gpiod_line_settings_set_bias(settings, biases[config->bias]);
    gpiod_line_settings_set_debounce_period_us(settings, config->debounce_us);
    return bad;
}

int gpio_backend_request(drv_gpio_t* self, const drv_gpio_config_t* config, int output) {
    struct gpiod_line_settings* settings = gpiod_line_settings_new();
    struct gpiod_line_config* lines = gpiod_line_config_new();
    struct gpiod_request_config* request = gpiod_request_config_new();
    unsigned offset = (unsigned)self->offset;
    int code = -ENOMEM;
    if (settings && lines && request) {
        gpiod_request_config_set_consumer(request, "okid");
        gpiod_request_config_set_event_buffer_size(request, KERNEL_BUFFER);
        code = fill_settings(settings, config, output) ? -EINVAL : 0;
        if (code == 0 && gpiod_line_config_add_line_settings(lines, &offset, 1, settings) != 0) code = -errno;
    }
    if (code == 0) {
        self->line = gpiod_chip_request_lines(self->chip, request, lines);
        if (!self->line) code = -errno;
    }
    if (code == 0 && !output && config->edge != DRV_GPIO_NO_EDGE) {
        self->buffer = gpiod_edge_event_buffer_new(GPIO_BATCH);
        if (!self->buffer) code = -ENOMEM; // gpio.c closes
    }
    self->expected = 1; // the kernel numbers from 1
    if (request) gpiod_request_config_free(request);
    if (lines) gpiod_line_config_free(lines);
    if (settings) gpiod_line_settings_free(settings);
    return code;
}

int gpio_backend_fd(const drv_gpio_t* self) { return self->buffer ? gpiod_line_request_get_fd(self->line) : -1; }

int gpio_backend_read(drv_gpio_t* self, gpio_edge_t* edges, int capacity) {
    int count = gpiod_line_request_read_edge_events(self->line, self->buffer, (size_t)capacity);
    if (count < 0) return -errno;
    for (int i = 0; i < count; ++i) {
        struct gpiod_edge_event* event = gpiod_edge_event_buffer_get_event(self->buffer, (unsigned long)i);
        int rising = gpiod_edge_event_get_event_type(event) == GPIOD_EDGE_EVENT_RISING_EDGE;
        uint32_t number = (uint32_t)gpiod_edge_event_get_line_seqno(event);
        edges[i].edge = rising ? DRV_GPIO_RISING : DRV_GPIO_FALLING;
        edges[i].monotonic_ns = (int64_t)gpiod_edge_event_get_timestamp_ns(event);
        edges[i].lost = number - (uint32_t)self->expected;
        self->expected = (int32_t)(number + 1);
    }
    return count;
}

int gpio_backend_get(drv_gpio_t* self) {
    enum gpiod_line_value level = gpiod_line_request_get_value(self->line, (unsigned)self->offset);
    return level == GPIOD_LINE_VALUE_ERROR ? -errno : level == GPIOD_LINE_VALUE_ACTIVE;
}

int gpio_backend_set(drv_gpio_t* self, int active) {
    enum gpiod_line_value level = active ? GPIOD_LINE_VALUE_ACTIVE : GPIOD_LINE_VALUE_INACTIVE;
    return gpiod_line_request_set_value(self->line, (unsigned)self->offset, level) != 0 ? -errno : 0;
}

void gpio_backend_close(drv_gpio_t* self) {
    if (self->buffer) gpiod_edge_event_buffer_free(self->buffer);
    if (self->line) gpiod_line_request_release(self->line);
    if (self->chip) gpiod_chip_close(self->chip);
    self->buffer = self->line = self->chip = NULL;
}
