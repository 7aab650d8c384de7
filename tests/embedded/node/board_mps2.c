// SPDX-License-Identifier: MIT
// PURPOSE  Arm MPS2 with an AN386 (Cortex-M4) or AN500 (Cortex-M7) image: CMSDK UART 0 and timer 0
// METHOD   registers: Arm Cortex-M System Design Kit, technical reference manual (DDI 0479), chapters 4.4 and 4.2. The
//          timer counts down
#include "board.h"

#define REGISTER(address) (*(volatile uint32_t*)(address))
#define TIMER_CTRL REGISTER(0x40000000)
#define TIMER_VALUE REGISTER(0x40000004)
#define TIMER_RELOAD REGISTER(0x40000008)
#define UART_DATA REGISTER(0x40004000)
#define UART_STATE REGISTER(0x40004004)
#define UART_CTRL REGISTER(0x40004008)
#define UART_BAUDDIV REGISTER(0x40004010)

enum { FULL = 1 << 0, RECEIVED = 1 << 1, BOTH_WAYS = 3, CLOCK_HZ = 25000000, BAUD = 921600 };

void board_start(void) {
    UART_BAUDDIV = CLOCK_HZ / BAUD;
    UART_CTRL = BOTH_WAYS;
    TIMER_RELOAD = 0xFFFFFFFF;
    TIMER_VALUE = 0xFFFFFFFF;
    TIMER_CTRL = 1;
}

uint8_t board_read(void) {
    while (!(UART_STATE & RECEIVED)) {
    }
    return (uint8_t)UART_DATA;
}

void board_write(uint8_t byte) {
    while (UART_STATE & FULL) {
    }
    UART_DATA = byte;
}

uint32_t board_ticks(void) { return ~TIMER_VALUE; }

uint32_t board_tick_hz(void) { return CLOCK_HZ; }
