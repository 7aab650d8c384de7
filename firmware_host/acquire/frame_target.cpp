// SPDX-License-Identifier: MIT
#include "frame_target.hpp"

#include "error.hpp"
#include "reader.hpp"
#include "serial_line.hpp"

#include <fmt/format.h>

namespace okid_host {
namespace {

constexpr int patience_ms = 2000;
constexpr int adapter_baud = 115200; // adapters on USB do not care

} // namespace

frame_target::frame_target(const std::string& name) : name_(name), device_(is_device(name)) {
    if (device_) {
        drv_line_config_t line{};
        line.device = name_.c_str();
        line.baud = adapter_baud;
        const int code = drv_slcan_sink_open(&adapter_, &line);
        if (code != 0) throw_line_failure(-code, name, adapter_.error);
        return;
    }
    const int code = drv_sink_open(&interface_, name_.c_str());
    if (code != 0) throw_interface_failure(-code, name, interface_.error);
}

frame_target::~frame_target() {
    if (device_)
        drv_slcan_sink_close(&adapter_);
    else
        drv_sink_close(&interface_);
}

void frame_target::write(const drv_frame_t& frame) {
    const int code = device_ ? drv_slcan_sink_write(&adapter_, &frame, patience_ms)
                             : drv_sink_write(&interface_, &frame, patience_ms);
    if (code != 0)
        throw failure(exit_device, fmt::format("{} {}: {}", device_ ? "device" : "interface", name_,
                                               device_ ? adapter_.error : interface_.error));
}

} // namespace okid_host
