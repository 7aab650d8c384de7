// SPDX-License-Identifier: MIT
// An okid.result/1 that exists, read back as far as two of them are compared or merged.
#pragma once
#include <complex>
#include <cstddef>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <utility>
#include <vector>

namespace okid_host {

/// A mode as the file has it; NaN: null or not there.
struct known_mode {
    int number = 0; ///< in the list of the file, from 1
    double frequency_hz = 0, damping_ratio = 0, frequency_std_hz = 0, damping_ratio_std = 0, emac = 0;
    std::vector<std::complex<double>> shape; ///< one entry a place
    bool confident = false;
    std::vector<std::string> why; ///< codes of a doubtful one
    /// At each force, what scales as the shape does: conj(b)/|b|^2 of what a force does to the mode, b. Empty: not known.
    std::vector<std::complex<double>> drive;
};

struct known_result {
    std::string name; ///< of the file, for messages
    std::string method, hold, detrend;
    double fs_hz = 0;
    long long samples = 0, records = 1, gaps = 0;
    int sigma_blocks = 0;             ///< that the standard deviations rest on; 0: the file does not say
    std::vector<std::string> outputs; ///< as the file has them
    std::vector<std::string> places;  ///< of the entries of a shape: the outputs, or the numbers of shape_dofs
    std::vector<known_mode> modes;
    std::vector<std::pair<std::string, std::string>> warnings; ///< code, text

    /// Places in `modes` of the confident ones.
    std::vector<std::size_t> confident() const;
};

/// @param name  of the file, for messages
/// Throws `failure` (exit 2) with file, line and column or key, what was found and what was expected.
known_result read_known_result(const std::string& text, const std::string& name);
known_result take_known_result(const nlohmann::json& raw, const std::string& name); ///< of parse_known_result()

/// The same of a file.
known_result load_known_result(const std::string& path);

} // namespace okid_host
