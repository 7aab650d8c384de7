// SPDX-License-Identifier: MIT
// The keys of an okid.result/1 that somebody else may have edited: each is checked when it is read.
#pragma once
#include "error.hpp"
#include "files/nearest_name.hpp"

#include <cmath>
#include <fmt/format.h>
#include <nlohmann/json.hpp>
#include <string>

namespace okid_host {

/// An object of the file, and where it stands in it.
struct keys_of {
    const nlohmann::json& object;
    const std::string& file;
    std::string where; ///< "modes[2]." or ""

    [[noreturn]] void refuse(const std::string& key, const std::string& found, const std::string& expected) const {
        throw failure(exit_usage, fmt::format("{}: {}{}: found {}, expected {}", file, where, key, found, expected));
    }
    [[noreturn]] void refuse_value(const std::string& key, const nlohmann::json& found,
                                   const std::string& expected) const {
        const bool whole = found.is_array() || found.is_object();
        refuse(key,
               whole ? std::string(found.is_array() ? "a list" : "an object")
                     : printable(found.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace)),
               expected);
    }
    /// nullptr: not there, or null.
    const nlohmann::json* find(const char* key) const {
        const auto at = object.find(key);
        return at == object.end() || at->is_null() ? nullptr : &*at;
    }
    const nlohmann::json& need(const char* key, const std::string& expected) const {
        const nlohmann::json* found = find(key);
        if (!found) refuse(key, object.contains(key) ? "null" : "nothing", expected);
        return *found;
    }
    double number(const char* key, const nlohmann::json& from, const char* expected) const {
        if (!from.is_number()) refuse_value(key, from, expected);
        return from.get<double>();
    }
    /// NaN: not there, or null.
    double maybe(const char* key, const char* expected) const {
        const nlohmann::json* found = find(key);
        return found ? number(key, *found, expected) : NAN;
    }
    double above_zero(const char* key, const char* expected) const {
        const double value = number(key, need(key, expected), expected);
        if (!(value > 0)) refuse(key, fmt::format("{:g}", value), expected);
        return value;
    }
    /// A standard deviation: NaN where none is known.
    double deviation(const char* key) const {
        constexpr const char* expected = "a number from 0 on, or null";
        const double value = maybe(key, expected);
        if (value < 0) refuse(key, fmt::format("{:g}", value), expected);
        return value;
    }
    long long count(const char* key, long long otherwise) const {
        constexpr const char* expected = "a whole number from 0 on";
        const nlohmann::json* found = find(key);
        if (!found) return otherwise;
        if (!found->is_number_integer() || found->get<long long>() < 0) refuse_value(key, *found, expected);
        return found->get<long long>();
    }
    std::string text(const char* key) const {
        const nlohmann::json* found = find(key);
        if (found && !found->is_string()) refuse_value(key, *found, "text");
        return found ? found->get<std::string>() : std::string();
    }
    const nlohmann::json& list(const char* key, const std::string& expected) const {
        const nlohmann::json& found = need(key, expected);
        if (!found.is_array()) refuse_value(key, found, expected);
        return found;
    }
};

/// An okid.result/1, parsed: nesting is bounded, numbers are finite. Throws `failure` (exit 2) with line and column.
nlohmann::json parse_known_result(const std::string& text, const std::string& name);

} // namespace okid_host
