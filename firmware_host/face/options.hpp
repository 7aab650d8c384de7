// SPDX-License-Identifier: MIT
// PURPOSE  options of a caller in another language, a JSON object, as the texts a command line would have
#pragma once
#include "record/identify_options.hpp"

#include <string>
#include <utility>
#include <vector>

namespace okid_host::face {

/// Where the value of each option goes.
struct option_places {
    std::vector<std::pair<std::string, std::string*>> texts; ///< numbers, words, and lists with commas between
    std::vector<std::pair<std::string, bool*>> flags;
    std::vector<std::pair<std::string, std::vector<std::string>*>> lists;
};

/// Of the options that a record has; `reach`: of those alone that have these bits of option_reach.
option_places places_of(record_request& request, unsigned reach = 0);

/// Every key has its place, null = as if not given; a rate `fs` must be there. Throws `failure` (exit 2).
void read_options(const char* text, const option_places& to);

} // namespace okid_host::face
