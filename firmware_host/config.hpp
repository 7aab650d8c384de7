// SPDX-License-Identifier: MIT
// CONFIG.toml, read and checked whole before any device is opened.
#pragma once
#include "mass_matrices.hpp"

#include <drv/codec.h>
#include <drv/frame.h>
#include <drv/gpio.h>
#include <drv/source.h>

#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace okid_host {

struct bus_config {
    std::string name, type = "socketcan", interface, device, file,
                      dbc; ///< paths already relative to the config's folder; a line has its name for interface
    bool fd = false;
    std::optional<double> bitrate, dbitrate;
    // What okid sends.
    std::optional<double> sync_hz;
    drv_frame_t sync_frame{};
    std::vector<drv_frame_t> start_frames; ///< once, before the first SYNC
    // Of a serial line.
    int baud = 0;
    drv_framing_t framing = DRV_FRAMING_COBS;
    std::optional<int> counter_field; ///< of lines of text
    int counter_bits = 32;
    std::string btr; ///< slcan: bit timing registers
    bool serial() const { return type == "serial"; }
    bool on_line() const { return serial() || type == "slcan"; }
};

enum class channel_role { force, acceleration, velocity, displacement, aux };

/// A signal that says what a frame carries, and the values, ends included, for which it carries the one asked for.
struct multiplexor {
    drv_signal_t layout{};
    std::vector<std::pair<std::uint64_t, std::uint64_t>> values;
    bool holds(const drv_frame_t& frame) const;
    bool operator==(const multiplexor& other) const;
};

/// Where one number stands: in which frames, at which bits.
struct channel_config {
    std::string name;
    channel_role role = channel_role::aux;
    int dof = 0;      ///< 0 = not given
    std::string unit; ///< as measured
    std::size_t bus = 0;
    std::string message, signal;          ///< names out of the DBC, "" without one
    drv_filter_t frame{};                 ///< identifier, or those alike (a PGN)
    std::optional<unsigned> field;        ///< of a serial bus; frame, layout and sequence are those of line_frame.h
    unsigned length = 0;                  ///< bytes of the message by the DBC, 0 = unknown
    drv_signal_t layout{};                ///< prepared
    std::vector<multiplexor> selectors;   ///< all must hold, or the signal is not in the frame; the innermost first
    std::optional<drv_signal_t> sequence; ///< counts samples
    double si_factor() const;             ///< from `unit` to the SI unit, 1 for a unit that is not known
    std::string si_unit() const;          ///< of the decoded channel once si_factor() is applied
};

struct identification_config {
    std::string method = "okid-era", hankel = "system", hold = "zoh", detrend = "mean";
    int p = 40, rows = 0, order = 0; ///< rows 0 = 2 p, n4sid 30, okid without a force p; order 0 = automatic
    std::optional<double> window_s, forgetting;
    double update_s = 0.5;
    int sigma_blocks = 20; ///< blocks left out for the standard deviations; 0 = none
    bool mkr = false;      ///< M, K and R with the final result
};

/// A GPIO line as the config names it.
struct gpio_place {
    std::string chip, name; ///< name "" = `offset` says which line
    int offset = 0;
    bool active_low = false;
    std::string text() const { return chip + " line " + (name.empty() ? std::to_string(offset) : name); }
    drv_gpio_config_t driver() const; ///< points into this
};

enum class trigger_source { immediate, level, gpio };

struct trigger_config {
    trigger_source source = trigger_source::immediate;
    drv_gpio_edge_t edge = DRV_GPIO_RISING; ///< of the line, or which way the level is crossed
    double pretrigger_s = 0;
    std::size_t channel = 0; ///< level: index in live_config::channels
    double level = 0;        ///< in the channel's own unit
    gpio_place place;        ///< gpio
};

/// Lines that are active while …
struct lamps_config {
    std::optional<gpio_place> armed; ///< … the trigger is waited for; without a trigger while okid runs
    std::optional<gpio_place> go;    ///< … the modal table has come to rest
    std::optional<gpio_place> alarm; ///< … an alarm stands
};

struct live_config {
    std::string path;
    double rate_hz = 0;
    std::vector<std::pair<std::string, std::string>> notes; ///< title, operator, structure, …
    std::vector<bus_config> buses;
    std::vector<channel_config> channels; ///< inputs first, then outputs, then aux; each in the order of the file
    std::size_t n_u = 0, n_y = 0;
    identification_config identification;
    trigger_config trigger;
    lamps_config lamps;
    std::vector<std::string> warnings; ///< what is accepted but does nothing in this version
};

/// Read and check. Throws `failure` (exit 2) naming file, line, key, what was found and what was expected.
live_config load_config(const std::string& path);

/// Throws `failure` (exit 2) unless there is at least one response channel.
void require_identifiable(const live_config& config);

/// Where the channels stand, with SI units; nothing is wanted without `mkr`.
mass_plan live_mass_plan(const live_config& config);

/// Identifiers a bus must deliver, each once.
std::vector<drv_filter_t> wanted_frames(const live_config& config, std::size_t bus);

} // namespace okid_host
