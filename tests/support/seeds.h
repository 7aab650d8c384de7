// SPDX-License-Identifier: MIT
// PURPOSE: how many seeds a test draws. What it asserts of each holds for any number of them; a sanitizer takes eight times
// as long and looks for faults that any seed shows: it gets a third.
#ifndef OKID_TEST_SEEDS_H
#define OKID_TEST_SEEDS_H

#include <stdlib.h>

static inline unsigned draw_seeds(unsigned usual, unsigned slow) {
    if (getenv("OKID_SLOW")) return slow;
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
    return usual / 3;
#else
    return usual;
#endif
}

#endif
