// SPDX-License-Identifier: MIT
// PURPOSE    exact sums beyond 64 bits in plain C, as two planes of 64-bit integers: value = high 2^48 + low
// METHOD     additions go into `low`, carries are moved by a shift and a mask: no branch, so that loops vectorise
#ifndef OKID_WIDE_H
#define OKID_WIDE_H

#include <stdint.h>

enum { WIDE_BITS = 48 };
static const int64_t WIDE_MASK = (INT64_C(1) << WIDE_BITS) - 1;

/// (high, low) += value 2^shift, shift 0, 16 or 32, |value| <= 2^53; afterwards 0 <= low < 2^48.
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

/// Nearest double (one rounding where the compiler has 128-bit integers, else at most two).
static inline double wide_double(int64_t high, int64_t low) {
#ifdef __SIZEOF_INT128__
    return (double)(((__int128)high * (INT64_C(1) << WIDE_BITS)) + low);
#else
    return (double)high * 281474976710656.0 + (double)low;
#endif
}

/// (rows * value - gi gj) / rows with one rounding before the division while everything fits 127 bits.
static inline double wide_centred(int64_t high, int64_t low, int64_t gi, int64_t gj, int64_t rows) {
#ifdef __SIZEOF_INT128__
    if (rows < (INT64_C(1) << 32)) {
        const __int128 value = (__int128)high * (INT64_C(1) << WIDE_BITS) + low;
        return (double)(rows * value - (__int128)gi * gj) / (double)rows;
    }
#endif
    return wide_double(high, low) - (double)gi * ((double)gj / (double)rows);
}

#endif
