// SPDX-License-Identifier: MIT
// The part of a DBC file that says where signals stand in frames: messages, signals, multiplexing, float types.
#pragma once
#include <drv/codec.h>

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace okid_host {

struct dbc_signal {
    std::string name, unit;
    drv_signal_t layout{};                  ///< prepared
    bool multiplexor = false;               ///< selects which of the others are present
    std::optional<std::uint64_t> mux_value; ///< present only when the multiplexor holds this
    std::size_t line = 0;
};

struct dbc_message {
    std::string name;
    std::uint32_t id = 0; ///< without the extended bit
    bool extended = false;
    unsigned length = 0; ///< bytes
    std::size_t line = 0;
    std::vector<dbc_signal> signals;
};

struct dbc_file {
    std::string path;
    std::vector<dbc_message> messages;
};

/// Read a DBC. Sections that do not place signals are skipped. Throws `failure` (exit 2) naming file, line, what was
/// found and what was expected.
dbc_file read_dbc(const std::string& path);

} // namespace okid_host
