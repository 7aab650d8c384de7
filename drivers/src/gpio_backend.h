// SPDX-License-Identifier: MIT
// What gpio.c needs of libgpiod; gpio_libgpiod1.c and gpio_libgpiod2.c each give it for their API. All return 0 or
// -errno and leave the words to gpio.c.
#ifndef GPIO_BACKEND_H
#define GPIO_BACKEND_H

#include <drv/gpio.h>

enum { GPIO_BATCH = 16 };

typedef struct gpio_edge_t {
    int64_t monotonic_ns;
    drv_gpio_edge_t edge;
    uint32_t lost;
} gpio_edge_t;

typedef struct gpio_line_info_t {
    char name[DRV_GPIO_NAME_BYTES];
    char user[DRV_GPIO_NAME_BYTES]; ///< who has it, "" when free
} gpio_line_info_t;

/// Open the chip: self->chip and line_count, and its label into `label`.
int gpio_backend_chip(drv_gpio_t* self, const char* path, char label[DRV_GPIO_NAME_BYTES]);
int gpio_backend_line(drv_gpio_t* self, int32_t offset, gpio_line_info_t* out);
int gpio_backend_request(drv_gpio_t* self, const drv_gpio_config_t* config, int output);
int gpio_backend_fd(const drv_gpio_t* self);
/// Up to GPIO_BATCH edges. @return how many or -errno (-EAGAIN = none now)
int gpio_backend_read(drv_gpio_t* self, gpio_edge_t* edges, int capacity);
int gpio_backend_get(drv_gpio_t* self);
int gpio_backend_set(drv_gpio_t* self, int active);
void gpio_backend_close(drv_gpio_t* self);

#endif
