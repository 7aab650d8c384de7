// SPDX-License-Identifier: MIT
// CONFIG.toml, read and checked whole before any device is opened.
#pragma once
#include "result/mass_matrices.hpp"

#include <drv/codec.h>
#include <drv/frame.h>
#include <drv/gpio.h>
#include <drv/source.h>

#include <algorithm>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace okid_host {

struct bus_config {
    std::string name, type = "socketcan", interface, device, file,
                      dbc; ///< paths already relative to the config's folder; a line has its name for interface
    std::string dbc_name;  ///< as the config has it
    bool fd = false;
    std::optional<double> bitrate, dbitrate;
    std::string adapter;     ///< serial number or port of a USB adapter in place of an interface
    int adapter_channel = 0; ///< which interface of it
    // What okid sends.
    std::optional<double> sync_hz;
    drv_frame_t sync_frame{};
    std::vector<drv_frame_t> start_frames; ///< once, before the first SYNC
    // Of a serial line.
    int baud = 0;
    drv_framing_t framing = DRV_FRAMING_COBS;
    std::optional<int> counter_field; ///< of lines of text
    int counter_bits = 32;
    bool free_clock = false;       ///< its nodes sample by clocks of their own
    std::optional<double> rate_hz; ///< of those nodes; that of the grid when not given
    std::string btr;               ///< slcan: bit timing registers
    bool serial() const { return type == "serial"; }
    bool on_line() const { return serial() || type == "slcan"; }
};

enum class channel_role { force, acceleration, velocity, displacement, aux };
const char* channel_role_name(channel_role role);

/// Do two channels come in the same frames?
bool same_frames(const drv_filter_t& a, const drv_filter_t& b);
/// Do two signals stand at the same bits?
bool same_bits(const drv_signal_t& a, const drv_signal_t& b);

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
    int dof = 0;          ///< 0 = not given
    std::string unit;     ///< as measured
    std::string dbc_unit; ///< what the DBC says of the signal, "" = nothing
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
    std::string method = "auto", hankel = "system", hold = "auto", detrend = "mean", refine = "no";
    int p = 40, rows = 0, order = 0; ///< rows 0 = 2 p, n4sid 30, okid without a force p; order 0 = automatic
    std::optional<double> window_s, forgetting;
    std::string window = "fixed"; ///< "auto": each update chooses how much of window_s it rests on
    double update_s = 0.5;
    std::optional<std::pair<double, double>> band; ///< Hz, of the modes wanted (auto)
    int decimate = 1;                              ///< auto looks at no higher rate than a so many-th
    int sigma_blocks = 20;                         ///< blocks left out for the standard deviations; 0 = none
    bool analytic = true;                          ///< by the method's derivative, where it has one
    bool restart_on_change = true; ///< window and forgetting: samples from before a change of the structure are dropped
    bool mkr = false;              ///< M, K and R with the final result
    double max_memory_mb = 8192;   ///< of the identification
    bool horizon_given = false;    ///< the config names p or rows, whichever decides how far the method looks back
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

/// A hammer test: hits are waited for, accepted or rejected, and averaged.
struct hammer_config {
    bool enabled = false;
    std::size_t channel = 0; ///< the force, index in live_config::channels
    double level = 0;        ///< in its unit; negative: a hit is negative
    int hits = 5;            ///< accepted hits wanted, at every point
    std::vector<int> points; ///< places struck one after the other (-3: at 3, reversed); empty: one that is not named
    double length_s = 2;     ///< of a hit's ring-down
    double pretrigger_s = 0; ///< at least; as long as the lags in any case
    double double_percent = 10; ///< of the peak: a second hit this strong is one
    double spectrum_hz = 0;     ///< the force must reach so far

    int total() const { return hits * std::max(1, static_cast<int>(points.size())); }
    int point_of(int hit) const { return points[static_cast<std::size_t>(hit / hits)]; } ///< of an accepted hit, from 0
};

/// Lines that are active while …
struct lamps_config {
    std::optional<gpio_place> armed; ///< … the trigger is waited for; without a trigger while okid runs
    std::optional<gpio_place> go;    ///< … the modal table has settled
    std::optional<gpio_place> alarm; ///< … an alarm stands
};

/// [alarm]: a tracked mode has left its baseline.
struct alarm_config {
    bool enabled = true;
    double k_sigma = 6;
    int baseline_updates = 20;  ///< settled updates that make the baseline
    double test_s = 0;          ///< length of a change test, 0 = none
    int test_rows = 0;          ///< its block rows, 0 = chosen
    double false_alarm = 0.001; ///< of one change test
    std::string command;        ///< run live at an alarm, already relative to the config's folder; "" = none
};

/// Where to listen or to send to.
struct net_address {
    std::string host = "127.0.0.1";
    int port = 0;
    bool loopback() const;
    std::string text() const;
};

struct broker_address {
    net_address at;
    std::string user, password, prefix = "okid";
    std::string password_file; ///< read_password() finds it
    bool discovery = false;    ///< announce the modes to Home Assistant
};

/// Where lines for InfluxDB go: a file, else by HTTP with a path, else by UDP.
struct influx_target {
    std::string file; ///< already relative to the config's folder
    net_address at;
    std::string path;       ///< and query of the URL
    std::string token_file; ///< read_password() finds it
};

/// [publish]: where events and modes go besides the events file and the terminal.
struct publish_config {
    std::string socket; ///< path of a unix socket, already relative to the config's folder; "" = none
    std::optional<net_address> udp, prometheus;
    std::optional<broker_address> mqtt;
    std::optional<influx_target> influx;
    bool samples = false; ///< the signals too go to the unix socket
};

/// [virtual]: what sensors that are missing would show, to subscribers of the samples.
struct virtual_config {
    std::string model;                 ///< file, already relative to the config's folder; "" = none
    std::vector<std::string> channels; ///< of the model; empty = what is not measured
};

/// [record]: raw frames onto the disk.
struct record_config {
    bool wanted = false;
    std::string directory = "runs"; ///< already relative to the config's folder
    double segment_mb = 64, max_mb = 4096;
    double pretrigger_s = 2;           ///< with a trigger: frames this long before it are kept
    std::size_t pretrigger_frames = 0; ///< room for them; 0 = nothing waits for a trigger
};

/// [realtime]: what the threads that serve devices and disk claim of the computer.
struct realtime_config {
    int priority = 10; ///< SCHED_FIFO of the threads that read and send; half of it for the recorder; 0 = none
    bool priority_asked = false; ///< the config has the key
    bool lock_memory = false;    ///< mlockall
    std::vector<int> cpus;       ///< those threads stay on these; empty = anywhere
};

/// The files a config was made of, word for word: a journal keeps them, and a config is read from them again.
struct config_texts {
    std::string config;
    std::map<std::string, std::string> dbcs;    ///< by the name the config has for them
    std::map<std::string, std::string> presets; ///< those it asks for, by name
};

struct live_config {
    std::string path;
    double rate_hz = 0;                                     ///< of the grid
    int decimate = 1;                                       ///< the nodes send so many samples for one of the grid
    std::vector<std::pair<std::string, std::string>> notes; ///< title, operator, structure, …
    std::vector<bus_config> buses;
    std::vector<channel_config> channels; ///< inputs first, then outputs, then aux; each in the order of the file
    std::size_t n_u = 0, n_y = 0;
    identification_config identification;
    trigger_config trigger;
    lamps_config lamps;
    hammer_config hammer;
    alarm_config alarm;
    publish_config publish;
    virtual_config virtual_sensors;
    record_config record;
    realtime_config realtime;
    config_texts texts;
    std::vector<std::string> warnings; ///< what is accepted, and worth a remark
    remarks unit_remarks;              ///< of them those that bear on the numbers of the result
};

/// Read and check. Throws `failure` (exit 2) naming file, line, key, what was found and what was expected.
live_config load_config(const std::string& path);

/// The same with the text of the file at hand; what it names is read from the files beside `path`.
live_config load_config_text(const std::string& path, const std::string& text);

/// The same out of texts instead of files. @param path  where they come from, for messages
live_config load_config(const std::string& path, const config_texts& texts);

/// Are there samples that come out of a filter, no codes of a converter any more?
bool resampled(const live_config& config);

/// Throws `failure` (exit 2) unless there is at least one response channel.
void require_identifiable(const live_config& config);

/// Where the channels stand, with SI units; nothing is wanted without `mkr`.
mass_plan live_mass_plan(const live_config& config);

/// Identifiers a bus must deliver, each once.
std::vector<drv_filter_t> wanted_frames(const live_config& config, std::size_t bus);

} // namespace okid_host
