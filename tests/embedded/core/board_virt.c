// SPDX-License-Identifier: MIT
// PURPOSE  QEMU's RISC-V machine `virt`: UART at 0x10000000 (16550), cycle counter of the processor
// METHOD   registers: PC16550D data sheet, chapter 8; the counter: The RISC-V Instruction Set Manual I, Zicntr. Start-up code is
//          picolibc's
#include "board.h"

#define REGISTER(offset) (*(volatile uint8_t*)(uintptr_t)(0x10000000 + (offset)))

enum { DATA = 0, LINE_STATUS = 5, RECEIVED = 1, EMPTY = 32 };

void board_start(void) {}

uint8_t board_read(void) {
    while (!(REGISTER(LINE_STATUS) & RECEIVED)) {
    }
    return REGISTER(DATA);
}

void board_write(uint8_t byte) {
    while (!(REGISTER(LINE_STATUS) & EMPTY)) {
    }
    REGISTER(DATA) = byte;
}

uint32_t board_ticks(void) {
    uint32_t count;
    __asm volatile(".option push\n.option arch, +zicsr\ncsrr %0, instret\n.option pop" : "=r"(count));
    return count;
}

uint32_t board_tick_hz(void) { return 1000000000; } // an instruction of QEMU with -icount shift=0
