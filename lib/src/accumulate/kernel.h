// SPDX-License-Identifier: MIT
// PURPOSE    the inner loop of the library: S += v_n [v_(n-p) .. v_n] over a run of samples
#ifndef OKID_KERNEL_H
#define OKID_KERNEL_H

#include <stdint.h>

/// S(r, c) += sum_n current[(n + p) m + r] window[n m + c], r < m, c < m (p+1), n < count. S is row-major, rows of m (p+1).
/// Both hold m (p + count) numbers, samples in time order, so that the lag window of a sample is contiguous; they are
/// the same array unless the codes are split into parts.
/// The sums begin with what stands in S and add sample by sample: how a run is cut into calls changes no bit.
typedef void okid_kernel_fn(double* S, const double* current, const double* window, int m, int p, int count);

/// The fastest kernel this processor runs; a constant choice for one machine.
okid_kernel_fn* okid_kernel_pick(void);

/// The same for codes in 64-bit words: `low` += products; with `high` (32-bit codes) into pairs (wide.h).
void okid_kernel_integer(int64_t* low, int64_t* high, const int64_t* x, int m, int p, int count);

#endif
