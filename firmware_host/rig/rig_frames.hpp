// SPDX-License-Identifier: MIT
// The rig's samples on a CAN bus: which signal stands in which frame, and the frames themselves.
#pragma once
#include "rig_run.hpp"

#include <drv/frame.h>
#include <string>
#include <vector>

namespace okid_host {

/// One message: a 16-bit counter, then up to three 16-bit or two 24-bit signals, little-endian.
struct rig_message {
    std::string name;
    std::uint32_t id = 0;
    std::size_t first = 0, count = 0; ///< channels
    int signal_bits = 16;
};

inline constexpr const char* rig_interface = "vcan0";

/// "Shaker" at 0x100 and the sensor messages ("Accel1", …) from 0x101 on.
std::vector<rig_message> rig_messages(const rig_run& run);

/// Seconds between the frames of one sample: those of a 1 Mbit/s bus, closer when they would not fit into a sample.
double frame_spacing_s(const rig_run& run, std::size_t messages);

/// Message `which` of sample n. The stamp is start_ns + n/rate + which * spacing.
drv_frame_t rig_frame(const rig_run& run, const rig_message& message, std::size_t n, std::int64_t time_ns);

/// The whole log in the format of `candump -L`, beginning at 1700000000 s.
std::string rig_log(const rig_run& run);

/// The DBC that describes the frames.
std::string rig_dbc(const rig_run& run);

} // namespace okid_host
