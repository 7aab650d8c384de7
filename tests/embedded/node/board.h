// SPDX-License-Identifier: MIT
/// @file board.h
/// What a board gives the node: bytes in, bytes out, a counter. One file a board (board_*.c), everything else is the same.
#ifndef NODE_BOARD_H
#define NODE_BOARD_H

#include <stdint.h>

/// Clocks, pins, UART and counter. Called once, before anything else of this header.
void board_start(void);

/// The next byte of the line; waits for it.
uint8_t board_read(void);

/// Send a byte; waits for room.
void board_write(uint8_t byte);

/// A free-running counter, modulo 2^32, counting up.
uint32_t board_ticks(void);

/// Ticks of that counter a second. In QEMU with -icount shift=0 an instruction takes one nanosecond, so that
/// 1e9 / board_tick_hz() instructions make a tick.
uint32_t board_tick_hz(void);

#endif
