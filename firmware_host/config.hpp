// SPDX-License-Identifier: MIT
// CONFIG.toml, read and checked whole before any device is opened.
#pragma once
#include "mass_matrices.hpp"

#include <drv/codec.h>
#include <drv/source.h>

#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace okid_host {

struct bus_config {
    std::string name, type = "socketcan", interface, device, file,
                      dbc; ///< paths already relative to the config's folder
    bool fd = false;
    std::optional<double> bitrate, dbitrate;
};

enum class channel_role { force, acceleration, velocity, displacement, aux };

/// Where one number stands: in which frames, at which bits.
struct channel_config {
    std::string name;
    channel_role role = channel_role::aux;
    int dof = 0;      ///< 0 = not given
    std::string unit; ///< as measured
    std::size_t bus = 0;
    std::string message, signal;          ///< names out of the DBC, "" without one
    drv_filter_t frame{};                 ///< identifier
    unsigned length = 0;                  ///< bytes of the message by the DBC, 0 = unknown
    drv_signal_t layout{};                ///< prepared
    std::optional<drv_signal_t> selector; ///< multiplexor of the signal …
    std::uint64_t selector_value = 0;     ///< … and what it must hold
    std::optional<drv_signal_t> sequence; ///< counts samples
    double si_factor() const;             ///< from `unit` to the SI unit, 1 for a unit that is not known
    std::string si_unit() const;          ///< of the decoded channel once si_factor() is applied
};

struct identification_config {
    std::string method = "okid-era", hold = "zoh", detrend = "mean";
    int p = 40, rows = 0, order = 0; ///< rows 0 = 2 p, n4sid 30; order 0 = automatic
    std::optional<double> window_s, forgetting;
    double update_s = 0.5;
    bool mkr = false; ///< M, K and R with the final result
};

struct live_config {
    std::string path;
    double rate_hz = 0;
    std::vector<std::pair<std::string, std::string>> notes; ///< title, operator, structure, …
    std::vector<bus_config> buses;
    std::vector<channel_config> channels; ///< inputs first, then outputs, then aux; each in the order of the file
    std::size_t n_u = 0, n_y = 0;
    identification_config identification;
    std::vector<std::string> warnings; ///< what is accepted but does nothing in this version
};

/// Read and check. Throws `failure` (exit 2) naming file, line, key, what was found and what was expected.
live_config load_config(const std::string& path);

/// Throws `failure` (exit 2) unless there is at least one response channel, and one force for the okid methods.
void require_identifiable(const live_config& config);

/// Where the channels stand, with SI units; nothing is wanted without `mkr`.
mass_plan live_mass_plan(const live_config& config);

/// Identifiers a bus must deliver, each once.
std::vector<drv_filter_t> wanted_frames(const live_config& config, std::size_t bus);

} // namespace okid_host
