// SPDX-License-Identifier: MIT
// PURPOSE  how much memory an identification needs, computed before any is taken
// METHOD   the sizes that the library gives for each object, added up; nothing depends on how much memory the machine
//          has or how much of it is free, so that a config means the same on every machine
#pragma once
#include "stream_config.hpp"

#include <okid/uncertainty.h>

#include <cstddef>

namespace okid_host {

/// The sums of one block that is left out for the standard deviations, and how many of them are held at once.
okid_accumulator_config_t block_sums(const okid_accumulator_config_t& whole);
std::size_t block_sums_held(const okid_accumulator_config_t& whole, int blocks);

/// What standard deviations of a stream are made with: identifications without each block, and where the method has one its
/// derivative, where that applies.
struct live_jackknives {
    live_jackknives(const okid_identify_config_t& identify, const okid_accumulator_config_t& sums, bool analytic);
    okid_jackknife_config_t config(int linear_form) const { return {identify, sums, linear_form, 0}; }
    double bytes() const;

    okid_identify_config_t identify;
    okid_accumulator_config_t sums;
    bool linear;
};

/// Bytes of all of it; 0 when p, rows, order or window are outside what the library takes.
double stream_bytes(const stream_config& stream);

/// Where neither p nor rows is named and the defaults take more than max_memory_mb: the longest horizon that fits, with
/// a remark.
void fit_memory(stream_config& stream);

/// Throws `failure` (exit 2) when the identification takes more than max_memory_mb: says what would fit.
void require_memory(const stream_config& stream);

} // namespace okid_host
