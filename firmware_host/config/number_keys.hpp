// SPDX-License-Identifier: MIT
// Which keys of a CONFIG.toml hold a number, and its range: what tests and fuzzers try the ends of.
#pragma once
#include <vector>

namespace okid_host {

struct number_key {
    const char *section, *key;
    bool many;        ///< of [[section]]
    double low, high; ///< the ends that are documented; -1 and 1 where any number is taken
};

/// All of them, in the order of the documentation.
std::vector<number_key> number_keys();

} // namespace okid_host
