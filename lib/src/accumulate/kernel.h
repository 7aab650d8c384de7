// SPDX-License-Identifier: MIT
// PURPOSE    the inner loop of the library: S += v_n [w_(n-p) .. w_n] over a run of samples
#ifndef OKID_KERNEL_H
#define OKID_KERNEL_H

#include <stdint.h>

/// S(r, c) += sum_n current[n m + r] window[n w + c], r < m, c < w (p+1), n < count. S is row-major, rows of w (p+1).
/// `current` holds m count numbers, `window` w (p + count) that begin p samples earlier, in time order, so that the lag window
/// of a sample is contiguous. Where all m channels are lagged (w = m), current = window + p m unless codes are split.
/// The sums begin with what stands in S and add sample by sample: how a run is cut into calls changes no bit. Samples of the
/// window from `held` on (usually p + count: none) are zeros and may be passed over.
typedef void okid_kernel_fn(double* S, const double* current, const double* window, int m, int w, int p, int count,
                            int held);

/// The fastest kernel this processor runs; a constant choice for one machine.
okid_kernel_fn* okid_kernel_pick(void);

/// The same for codes in 64-bit words: `low` += products; with `high` (32-bit codes) into pairs (wide.h).
void okid_kernel_integer(int64_t* low, int64_t* high, const int64_t* current, const int64_t* window, int m, int w,
                         int p, int count);

#endif
