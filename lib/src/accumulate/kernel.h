// SPDX-License-Identifier: MIT
// PURPOSE    the inner loop of the library: S += v_n [v_(n-p) .. v_n] over a run of samples
#ifndef OKID_KERNEL_H
#define OKID_KERNEL_H

/// S(r, c) += sum_n x[(n + p) m + r] x[n m + c], r < m, c < m (p+1), n < count. S is row-major with rows of m (p+1).
/// The samples x, m (p + count) numbers, stand in time order, so that the lag window of a sample is contiguous.
typedef void okid_kernel_fn(double* S, const double* x, int m, int p, int count);

/// The fastest kernel this processor runs; a constant choice for one machine.
okid_kernel_fn* okid_kernel_pick(void);

#endif
