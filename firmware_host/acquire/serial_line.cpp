// SPDX-License-Identifier: MIT
#include "serial_line.hpp"

#include "error.hpp"
#include "files/nearest_name.hpp"

#include <algorithm>
#include <cerrno>
#include <drv/serial_port.h>
#include <filesystem>
#include <fmt/format.h>

namespace okid_host {
namespace {

namespace fs = std::filesystem;

std::vector<std::string> entries(const std::string& folder, const std::vector<std::string>& beginnings) {
    std::vector<std::string> out;
    std::error_code ignored;
    for (const auto& entry : fs::directory_iterator(folder, ignored)) {
        const std::string name = entry.path().filename().string();
        for (const std::string& beginning : beginnings)
            if (name.rfind(beginning, 0) == 0) {
                out.push_back(entry.path().string());
                break;
            }
    }
    std::sort(out.begin(), out.end());
    return out;
}

} // namespace

bool is_device(const std::string& target) {
    std::error_code ignored;
    return target.find('/') != std::string::npos || fs::is_character_file(target, ignored);
}

drv_line_config_t line_settings(const bus_config& bus, double rate_hz) {
    drv_line_config_t line{};
    line.device = bus.device.c_str();
    line.baud = bus.baud;
    line.framing = bus.framing;
    line.counter = bus.counter_field ? *bus.counter_field + 1 : 0;
    line.rate_hz = rate_hz;
    line.bitrate = static_cast<std::int32_t>(bus.bitrate.value_or(0));
    line.dbitrate = static_cast<std::int32_t>(bus.dbitrate.value_or(0));
    line.btr = bus.btr.empty() ? nullptr : bus.btr.c_str();
    return line;
}

nlohmann::ordered_json line_json(const drv_stats_t& counts) {
    return {{"damaged", counts.damaged},         {"skipped_bytes", counts.skipped}, {"overruns", counts.line_overruns},
            {"line_errors", counts.line_errors}, {"refused", counts.refused},       {"link_downs", counts.link_down},
            {"reopened", counts.reopened}};
}

std::vector<std::string> serial_devices() {
    std::vector<std::string> named = entries("/dev/serial/by-id", {""});
    return named.empty() ? entries("/dev", {"ttyUSB", "ttyACM", "ttyAMA", "rfcomm"}) : named;
}

std::string line_remedy(int code, const std::string& device) {
    const std::vector<std::string> there = serial_devices();
    if (code == ENOENT)
        return fmt::format("{}. Plug it in, or correct device in the [[bus]]",
                           there.empty() ? "this machine has no serial device that could be meant"
                                         : "serial devices found: " + list_names(there) + did_you_mean(device, there));
    if (code == EACCES)
        return "put yourself into the group of the device: sudo usermod -aG dialout $USER, then log in again";
    if (code == EBUSY)
        return fmt::format("find and end the other program: sudo fuser -v {} (ModemManager takes new devices for half "
                           "a minute)",
                           device);
    if (code == ENOTTY) return "expected a serial device such as /dev/ttyUSB0";
    if (code == EINVAL) return "correct baud or bitrate in the [[bus]]";
    return "look at dmesg for what the kernel says of it";
}

line_finding look_at_line(const bus_config& bus) {
    constexpr int least_latency_ms = 1;
    drv_serial_t port{};
    const int code = drv_serial_open(&port, bus.device.c_str(), bus.baud);
    if (code != 0) return {port.error, line_remedy(-code, bus.device), ""};
    line_finding out;
    out.found = fmt::format("{} at {} baud{}{}", bus.device, port.baud, port.low_latency ? ", low latency" : "",
                            port.counts_errors ? ", counts overruns" : "");
    if (port.latency_ms > least_latency_ms) {
        std::error_code ignored;
        const std::string name = fs::canonical(bus.device, ignored).filename().string();
        out.note = fmt::format("the adapter holds bytes back for up to {} ms: echo 1 | sudo tee "
                               "/sys/class/tty/{}/device/latency_timer",
                               port.latency_ms, name);
    } else if (bus.device.rfind("/dev/ttyUSB", 0) == 0 || bus.device.rfind("/dev/ttyACM", 0) == 0) {
        out.note = "its number may change when it is plugged in again: a name below /dev/serial/by-id stays";
    }
    drv_serial_close(&port);
    return out;
}

void throw_line_failure(int code, const std::string& device, const std::string& reason) {
    throw failure(exit_device, fmt::format("{}; {}", printable(reason, 300), line_remedy(code, device)));
}

} // namespace okid_host
