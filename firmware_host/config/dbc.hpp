// SPDX-License-Identifier: MIT
// The part of a DBC file that says where signals stand in frames: messages, signals, multiplexing, float types.
#pragma once
#include <drv/codec.h>

#include <cstdint>
#include <string>
#include <utility>
#include <vector>

namespace okid_host {

struct dbc_signal {
    std::string name, unit;
    std::string long_name;    ///< names are cut at 32 letters; the attribute System…LongSymbol has the whole one, or ""
    drv_signal_t layout{};    ///< prepared
    bool multiplexor = false; ///< selects which of the others are present
    std::string mux_switch;   ///< the multiplexor, "" = the only one of the message
    std::vector<std::pair<std::uint64_t, std::uint64_t>> mux_values; ///< present only while it holds one of these
    std::size_t line = 0;
};

struct dbc_message {
    std::string name, long_name;
    std::uint32_t id = 0; ///< without the extended bit
    bool extended = false;
    bool j1939 = false;  ///< the identifier stands for a parameter group (VFrameFormat J1939PG)
    unsigned length = 0; ///< bytes
    std::size_t line = 0;
    std::vector<dbc_signal> signals;
    std::string fault; ///< file, line and what is wrong: the message cannot be used; "" = it can
};

struct dbc_file {
    std::string path;
    std::vector<dbc_message> messages;
    std::vector<std::string> faults; ///< lines that could not be read, each with what it costs
};

/// Read a DBC. Sections that do not place signals are skipped; a line that cannot be read costs its message. Throws
/// `failure` (exit 2) naming file, line, what was found and what was expected when no message is left.
dbc_file read_dbc(const std::string& path);
/// The two halves of it: the text of the file, and what it says. @param path  for messages
std::string read_dbc_text(const std::string& path);
dbc_file read_dbc(const std::string& path, const std::string& text);

} // namespace okid_host
