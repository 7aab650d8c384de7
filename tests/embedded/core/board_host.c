// SPDX-License-Identifier: MIT
// PURPOSE  this machine as a board of tests/embedded/node/board.h: bytes to the standard output, no counter
#include "board.h"

#include <stdio.h>

void board_start(void) {}
uint8_t board_read(void) { return (uint8_t)getchar(); }
void board_write(uint8_t byte) { putchar(byte); }
uint32_t board_ticks(void) { return 0; }
uint32_t board_tick_hz(void) { return 1; }
