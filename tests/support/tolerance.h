// SPDX-License-Identifier: MIT
// Tolerances for both number types of results (OKID_REAL). Every test file lists its own at the top.
#ifndef OKID_TEST_TOLERANCE_H
#define OKID_TEST_TOLERANCE_H

#include <okid/types.h>

/// A constant expression: the limit for the type the library was built with.
#define TOLERANCE(for_double, for_float) (sizeof(okid_real_t) == sizeof(double) ? (for_double) : (for_float))

#endif
