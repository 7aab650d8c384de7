// SPDX-License-Identifier: MIT
// The header of a chunk of a journal, and numbers as they stand in one: little-endian on every machine.
#ifndef DRV_JOURNAL_CHUNK_H
#define DRV_JOURNAL_CHUNK_H

#include <drv/journal.h>

#include <stdint.h>
#include <string.h>

/// Place of each number in the header.
enum {
    CHUNK_VERSION = 8,
    CHUNK_KIND = 9,
    CHUNK_FLAGS = 10,
    CHUNK_BYTES = 12,
    CHUNK_RUN = 16,
    CHUNK_SEQUENCE = 24,
    CHUNK_FRAMES = 28,
    CHUNK_REAL = 32,
    CHUNK_MONOTONIC = 40,
    CHUNK_LOST = 48,
    CHUNK_PAYLOAD_CRC = 56,
    CHUNK_HEADER_CRC = 60
};

enum { CHUNK_MORE = 1 };             // of CHUNK_FLAGS
enum { TEXT_PREFIX = 20 };           // bytes before the name: its length, length of the text, offset of the piece
enum { FRAME_PREFIX = 16 };          // bytes of a frame before the controller's stamp and the data
enum { FRAME_FLAGS = (1 << 6) - 1 }; // DRV_FRAME_... bits
enum { FRAME_HAS_HW_TIME = 1 << 7 }; // beside them

#define CHUNK_MAGIC                                                                                                    \
    "\x8F"                                                                                                             \
    "OKJ\r\n\x1A\n"

static inline void put_number(uint8_t* at, int bytes, uint64_t value) {
    for (int i = 0; i < bytes; ++i) at[i] = (uint8_t)(value >> 8 * i);
}

static inline uint64_t get_number(const uint8_t* at, int bytes) {
    uint64_t value = 0;
    for (int i = 0; i < bytes; ++i) value |= (uint64_t)at[i] << 8 * i;
    return value;
}

#endif
