// SPDX-License-Identifier: MIT
#include "file_kind.hpp"

#include <cstdint>
#include <drv/journal.h>

namespace okid_host {

file_kind kind_of_text(const std::string& text) {
    const auto begins = [&](const char* with) { return text.rfind(with, 0) == 0; };
    if (begins("(") && text.find(") ") < 40) return file_kind::can_log;
    if (begins("VERSION") || begins("NS_") || begins("BU_")) return file_kind::dbc;
    if (begins("{")) return file_kind::json;
    if (text.size() >= DRV_JOURNAL_MAGIC && drv_journal_magic(reinterpret_cast<const std::uint8_t*>(text.data())))
        return file_kind::journal;
    std::size_t at = 0; // past the comments
    while (text.compare(at, 1, "#") == 0 && text.find('\n', at) != std::string::npos) at = text.find('\n', at) + 1;
    const std::string line = text.substr(at, text.find('\n', at) - at);
    const bool separated = line.find_first_of(",;") != std::string::npos;
    if (line.find(" = ") != std::string::npos || (line.rfind('[', 0) == 0 && !separated)) return file_kind::toml;
    return separated && line.find('=') == std::string::npos ? file_kind::csv : file_kind::unknown;
}

const char* file_kind_name(file_kind kind) {
    static const char* const names[] = {
        "a file of no known kind", "a log of CAN frames", "a DBC", "JSON", "a journal", "a TOML file", "a CSV"};
    return names[static_cast<std::size_t>(kind)];
}

} // namespace okid_host
