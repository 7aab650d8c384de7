// SPDX-License-Identifier: MIT
// PURPOSE  the options of an identification, each declared once: command line, completions, JSON of other languages, the keys of
//          [identification], checks and messages are made from this table
#pragma once
#include "request.hpp"

#include <variant>

namespace okid_host {

enum class option_kind {
    text,          ///< checked where it is used
    words,         ///< one of those in `shape`
    whole,         ///< a whole number from low to high
    whole_or_auto, ///< the same, or auto
    answer,        ///< one of those in `shape`; yes where it stands alone
    names,         ///< a list
    flag
};

/// Which methods an option belongs to.
enum class option_methods { all, one, agreement, agreement_or_lags };

/// Where an option is known beside records: bits.
enum option_reach : unsigned { of_streams = 1, of_configs = 2, of_responses = 4 };

struct identify_option {
    const char* name; ///< of the command line, without the dashes
    option_kind kind;
    std::variant<std::string record_request::*, bool record_request::*, std::vector<std::string> record_request::*>
        place;
    std::string shape; ///< what a user types for it, alternatives with bars between: N|auto
    option_methods methods;
    unsigned reach; ///< of option_reach
    std::string help;
    long long low = 0, high = 0;

    std::string typed() const { return std::string("--") + name; }
    std::string key() const; ///< of JSON, TOML and Python: max_order
    std::vector<std::string> alternatives() const;
    bool is_given(const record_request& request) const; ///< is it other than where nothing is said?
};

/// In the order of `okid identify --help`.
const std::vector<identify_option>& identify_options();

} // namespace okid_host
