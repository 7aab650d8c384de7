// SPDX-License-Identifier: MIT
// PURPOSE  no GPIO: compiled where libgpiod is not found (the Python wheel stands on nothing of the system's)
// METHOD   opening a chip fails with -ENOSYS, which gpio.c explains; no line is ever open, so nothing else is reached
#include "gpio_backend.h"

#include <errno.h>

int gpio_backend_chip(drv_gpio_t* self, const char* path, char label[DRV_GPIO_NAME_BYTES]) { return -ENOSYS; }
int gpio_backend_line(drv_gpio_t* self, int32_t offset, gpio_line_info_t* out) { return -ENOSYS; }
int gpio_backend_request(drv_gpio_t* self, const drv_gpio_config_t* config, int output) { return -ENOSYS; }
int gpio_backend_fd(const drv_gpio_t* self) { return -1; }
int gpio_backend_read(drv_gpio_t* self, gpio_edge_t* edges, int capacity) { return -ENOSYS; }
int gpio_backend_get(drv_gpio_t* self) { return -ENOSYS; }
int gpio_backend_set(drv_gpio_t* self, int active) { return -ENOSYS; }
void gpio_backend_close(drv_gpio_t* self) {}
