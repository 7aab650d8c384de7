// SPDX-License-Identifier: MIT
// PURPOSE    state as bytes for every kernel that is written: one walk counts, writes or reads; little endian, CRC-32 (IEEE 802.3)
#ifndef OKID_WALK_H
#define OKID_WALK_H

#include "wide.h"

#include <okid/accumulator.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

static inline uint32_t crc32_of(const uint8_t* at, size_t count) {
    static const uint32_t table[16] = {0x00000000, 0x1DB71064, 0x3B6E20C8, 0x26D930AC, 0x76DC4190, 0x6B6B51F4,
                                       0x4DB26158, 0x5005713C, 0xEDB88320, 0xF00F9344, 0xD6D6A3E8, 0xCB61B38C,
                                       0x9B64C2B0, 0x86D3D2D4, 0xA00AE278, 0xBDBDF21C};
    uint32_t crc = 0xFFFFFFFF;
    for (size_t i = 0; i < count; ++i) {
        crc = (crc >> 4) ^ table[(crc ^ at[i]) & 15];
        crc = (crc >> 4) ^ table[(crc ^ (uint32_t)(at[i] >> 4)) & 15];
    }
    return ~crc;
}

/// Where the walk stands. `to` or `from` or, for counting, neither.
typedef struct walk_t {
    uint8_t* to;
    const uint8_t* from;
    size_t at;
} walk_t;

static inline uint64_t walk_bits(walk_t* w, uint64_t bits, int bytes) {
    uint64_t got = 0;
    for (int i = 0; i < bytes; ++i, ++w->at) {
        if (w->to) w->to[w->at] = (uint8_t)(bits >> 8 * i);
        if (w->from) got |= (uint64_t)w->from[w->at] << 8 * i;
    }
    return w->from ? got : bits;
}

static inline void walk_i64(walk_t* w, int64_t* value) { *value = (int64_t)walk_bits(w, (uint64_t)*value, 8); }
static inline void walk_i32(walk_t* w, int32_t* value) {
    *value = (int32_t)(uint32_t)walk_bits(w, (uint32_t)*value, 4);
}

/// Numbers of 64 bits as they are: doubles or integers.
static inline void walk_numbers(walk_t* w, void* numbers, size_t count) {
    char* at = (char*)numbers;
    for (size_t i = 0; i < count; ++i, at += 8) {
        uint64_t bits;
        memcpy(&bits, at, 8);
        bits = walk_bits(w, bits, 8);
        memcpy(at, &bits, 8);
    }
}

// What is read, before anything is changed: a checksum that is right says nothing of the numbers.

/// The next real number of what is read: is it finite? `least` 0: and not below 0. By its bits, for processors without doubles.
static inline int sane_number(walk_t* w, int least) {
    const uint64_t bits = (uint64_t)walk_bits(w, 0, 8);
    return (bits >> 52 & 0x7FF) != 0x7FF && (least != 0 || bits >> 63 == 0 || bits << 1 == 0);
}

/// A count of samples.
static inline int sane_count(walk_t* w) { return (uint64_t)walk_bits(w, 0, 8) <= (uint64_t)OKID_MOST_SAMPLES; }

/// Whole numbers of a magnitude up to `most`.
static inline int sane_whole(walk_t* w, size_t count, uint64_t most) {
    int sane = 1;
    for (size_t i = 0; i < count; ++i) sane &= (uint64_t)walk_bits(w, 0, 8) + most <= 2 * most;
    return sane;
}

/// Two planes of words as they are left by additions, far enough from their ends to be added to one another.
static inline int sane_wide(walk_t* w, size_t count) {
    int sane = 1;
    for (size_t i = 0; i < count; ++i) sane &= (uint64_t)walk_bits(w, 0, 8) >> WIDE_BITS == 0;
    return sane & sane_whole(w, count, UINT64_C(1) << 54);
}

#endif
