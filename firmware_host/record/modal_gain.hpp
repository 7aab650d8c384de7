// SPDX-License-Identifier: MIT
// The Kalman gain of a model whose A, B, C and D are known: what one-step prediction needs beside them.
#pragma once
#include "record_work.hpp"

namespace okid_host {

/// K and the covariance of the innovations of work.model, from what its simulation leaves of the records (less their means).
/// K stays 0 where no gain predicts better.
void find_gain(record_work& work);

} // namespace okid_host
