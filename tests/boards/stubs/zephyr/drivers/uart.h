// SPDX-License-Identifier: MIT
/// @file uart.h
/// As much of Zephyr's UART interface as the sample calls: bytes to the standard output.
#ifndef STUB_UART_H
#define STUB_UART_H

#include <stdio.h>

struct device {
    int unused;
};
#define DT_CHOSEN(name) 0
#define DEVICE_DT_GET(node) NULL
static inline void uart_poll_out(const struct device* device, unsigned char byte) {
    (void)device;
    putchar(byte);
}

#endif
