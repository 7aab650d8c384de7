// SPDX-License-Identifier: MIT
// PURPOSE    the matrix exponential, and the scaling of states that makes it (and eigenvectors) accurate
#pragma once
#include <okid/types.h>

namespace okid {

/// Powers of two d with D^-1 A D of nearly equal row and column norms; A (n x n) is replaced by it.
/// A mechanical state [x; x'] has entries of 1 and of omega^2 side by side: without this many squarings are lost on them.
void balance(int n, okid_real_t* a, okid_real_t* d);

/// e^X (n x n); X is destroyed. result and spare: n^2 numbers each. @return false if a number is not finite
bool exponential(int n, okid_real_t* x, okid_real_t* result, okid_real_t* spare);

} // namespace okid
