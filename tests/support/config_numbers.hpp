// SPDX-License-Identifier: MIT
// A CONFIG.toml with one number replaced: every numeric key at its documented ends and beyond.
#pragma once
#include "config/number_keys.hpp"

#include <array>
#include <cmath>
#include <fmt/format.h>
#include <limits>
#include <string>
#include <string_view>

namespace okid_test {

constexpr std::size_t number_values = 22;

/// The `choice`-th number to try for a key, as TOML.
inline std::string number_text(const okid_host::number_key& key, std::size_t choice) {
    constexpr double inf = std::numeric_limits<double>::infinity();
    const double low = key.low, high = key.high;
    const std::array<double, 16> reals{low,
                                       std::nextafter(low, inf),
                                       std::nextafter(low, -inf),
                                       low - 1,
                                       low + 1,
                                       high,
                                       std::nextafter(high, inf),
                                       std::nextafter(high, -inf),
                                       high + 1,
                                       high - 1,
                                       0.5 * (low + high),
                                       std::sqrt(std::abs(low * high)) + 1e-5,
                                       1e-300,
                                       1e300,
                                       5e-324,
                                       -0.0};
    const std::array<const char*, number_values - 16> others{"nan", "inf", "-inf", "9223372036854775807", "0", "1"};
    if (choice % number_values >= reals.size()) return others[choice % number_values - reals.size()];
    const double value = reals[choice % number_values];
    if (std::abs(value) < 1e15 && value == std::floor(value)) return fmt::format("{}", static_cast<long long>(value));
    const std::string text = fmt::format("{}", value);
    return text.find_first_of(".en") == std::string::npos ? text + ".0" : text;
}

/// The key in the file as its section needs it; other sections as far as they are always there.
inline std::string config_with_number(const okid_host::number_key& key, const std::string& value,
                                      std::string_view more = {}) {
    struct section {
        const char* name;
        bool many, always;
        std::string text;
    };
    std::array<section, 12> sections{
        section{"acquisition", false, true, "rate_hz = 100.0\n"},
        {"bus", true, true, "name = \"can0\"\ninterface = \"vcan0\"\n"},
        {"channel", true, true,
         "name = \"f\"\nrole = \"force\"\ncan_id = 256\nstart_bit = 0\nlength = 16\n[[channel]]\n"
         "name = \"a\"\nrole = \"acceleration\"\ncan_id = 257\nstart_bit = 0\nlength = 16\n"},
        {"identification", false, false, ""},
        {"alarm", false, false, ""},
        {"trigger", false, false, "source = \"level\"\nchannel = \"a\"\nlevel = 1.0\n"},
        {"hammer", false, false, "level = 1.0\n"},
        {"lamps", false, false, ""},
        {"record", false, false, ""},
        {"publish", false, false, ""},
        {"realtime", false, false, ""},
        {"geometry", false, false, ""}};
    std::string out;
    for (section& each : sections) {
        const bool here = std::string_view(key.section) == each.name;
        if (!each.always && !here) continue;
        if (here) { // in the place of what stands there, else behind it: in the last table of an array
            const std::string name = fmt::format("\n{} = ", key.key);
            const std::size_t at = ("\n" + each.text).rfind(name);
            if (at != std::string::npos) each.text.erase(at, each.text.find('\n', at) + 1 - at);
            each.text += fmt::format("{} = {}\n", key.key, value);
        }
        out += fmt::format(each.many ? "[[{}]]\n{}" : "[{}]\n{}", each.name, each.text);
        if (std::string_view(each.name) == "identification") out += more;
    }
    return out;
}

} // namespace okid_test
