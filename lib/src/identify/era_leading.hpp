// SPDX-License-Identifier: MIT
#pragma once
#include <okid/types.h>

#include <cstddef>

namespace okid {

/// Is it worth it to look for the leading `count` triplets alone, and do so many bytes of work memory suffice?
bool has_leading(int height, int breadth, int count, std::size_t work_bytes);

/// The leading triplets of H (height x breadth), which stays. values: height numbers, all of them; left: height x count; right:
/// count x breadth, leading dimension ld_right. @return false: they cannot be had so without losing digits; H as it was
bool leading_triplets(int height, int breadth, int count, const okid_real_t* hankel, okid_real_t* left,
                      okid_real_t* values, okid_real_t* right, int ld_right, void* work);

} // namespace okid
