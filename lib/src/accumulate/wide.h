// SPDX-License-Identifier: MIT
// PURPOSE    exact sums beyond 64 bits in plain C, as two planes of 64-bit integers: value = high 2^48 + low
// METHOD     additions go into `low`, carries are moved by a shift and a mask: no branch, so that loops vectorise
#ifndef OKID_WIDE_H
#define OKID_WIDE_H

#include <stdint.h>

enum { WIDE_BITS = 48 };
static const int64_t WIDE_MASK = (INT64_C(1) << WIDE_BITS) - 1;

/// (high, low) += value 2^shift, shift 0, 16 or 32; afterwards 0 <= low < 2^48.
static inline void wide_add_shifted(int64_t* high, int64_t* low, int64_t value, int shift) {
    const int64_t upper = value >> (WIDE_BITS - shift);
    const int64_t rest = value & ((INT64_C(1) << (WIDE_BITS - shift)) - 1);
    const int64_t sum = *low + rest * (INT64_C(1) << shift);
    *high += upper + (sum >> WIDE_BITS);
    *low = sum & WIDE_MASK;
}

/// (high, low) += any 64-bit value.
static inline void wide_add(int64_t* high, int64_t* low, int64_t value) { wide_add_shifted(high, low, value, 0); }

/// (high, low) += (h, l), both normalised.
static inline void wide_add_wide(int64_t* high, int64_t* low, int64_t h, int64_t l) {
    const int64_t sum = *low + l;
    *high += h + (sum >> WIDE_BITS);
    *low = sum & WIDE_MASK;
}

/// (high, low) += a b exactly; the sum must stay below 2^111. Three parts of a, two of b: no product leaves 64 bits.
static inline void wide_add_product(int64_t* high, int64_t* low, int64_t a, int64_t b) {
    const int64_t b0 = b & 0xFFFFFFFF, b1 = b >> 32; // b = b1 2^32 + b0
    const int64_t a0 = a & 0xFFFF, a1 = (a >> 16) & 0xFFFF, a2 = a >> 32;
    wide_add_shifted(high, low, a0 * b0, 0);
    wide_add_shifted(high, low, a1 * b0, 16);
    wide_add_shifted(high, low, a0 * b1, 32);
    const int64_t top = a2 * (b0 >> 16); // a2 b0 = top 2^16 + ...
    wide_add_shifted(high, low, a2 * (b0 & 0xFFFF), 32);
    *high += top + a1 * b1;                  // both carry 2^48
    *high += (a2 * b1) * (INT64_C(1) << 16); // 2^64
}

/// (high, low) *= 2^shift, 0 <= shift <= 15.
static inline void wide_shift(int64_t* high, int64_t* low, int shift) {
    const int64_t sum = *low * (INT64_C(1) << shift);
    *high = *high * (INT64_C(1) << shift) + (sum >> WIDE_BITS);
    *low = sum & WIDE_MASK;
}

/// Nearest double; one rounding while |value| < 2^101.
static inline double wide_double(int64_t high, int64_t low) { return (double)high * 281474976710656.0 + (double)low; }

#endif
