// SPDX-License-Identifier: MIT
// PURPOSE  options of a caller in another language, a JSON object, as the texts a command line would have
#pragma once
#include "record/request.hpp"

#include <string>
#include <utility>
#include <vector>

namespace okid_host::face {

/// Where the value of each option goes.
struct option_places {
    std::vector<std::pair<const char*, std::string*>> texts; ///< numbers, words, and lists with commas between
    std::vector<std::pair<const char*, bool*>> flags;
    std::vector<std::pair<const char*, std::vector<std::string>*>> lists;
};

/// The options that a record and a stream have in common.
option_places places_of(record_request& request);

/// Every key has its place, null = as if not given; a rate `fs` must be there. Throws `failure` (exit 2).
void read_options(const char* text, const option_places& to);

} // namespace okid_host::face
