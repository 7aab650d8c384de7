// SPDX-License-Identifier: MIT
// A force that is recorded late, as behind another filter, logger or clock: the outputs answer a hit before its channel shows it.
#pragma once
#include "record_set.hpp"
#include "result/mass_matrices.hpp"

#include <cstddef>

namespace okid_host {

/// By how many samples the force of hits comes after what it causes; 0: it does not, or nothing tells. Found up to 64 samples, of
/// one force that rests between its hits. Half of the outputs looked at say so (three at most).
/// Cost: a Gram matrix of 146 numbers over 20,000 samples of each.
std::size_t samples_late(const record_set& set);

/// Take such a force as so much earlier, and remark `late_force`. The last samples of a record are as its last one.
void bring_force_forward(record_set& set, double fs_hz, remarks& said);

} // namespace okid_host
