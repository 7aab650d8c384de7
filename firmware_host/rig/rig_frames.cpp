// SPDX-License-Identifier: MIT
#include "rig_frames.hpp"

#include <algorithm>
#include <cmath>
#include <drv/candump.h>
#include <fmt/format.h>
#include <iterator>

namespace okid_host {
namespace {

constexpr std::uint32_t first_id = 0x100, further_force_id = 0x400;
constexpr double frame_s = 130e-6;                           // 8 bytes with stuffing at 1 Mbit/s
constexpr std::int64_t start_ns = 1'700'000'000'000'000'000; // fixed: the same seed gives the same file
constexpr int counter_bits = 16;

int signal_bits(const rig_run& run) { return run.bits > 16 ? 24 : 16; }

std::int64_t stamp_ns(const rig_run& run, std::size_t n, std::size_t which, double spacing) {
    const double offset = static_cast<double>(n) / run.rate_hz + static_cast<double>(which) * spacing;
    return start_ns + std::llround(offset * 1e6) * 1000;
}

} // namespace

std::vector<rig_message> rig_messages(const rig_run& run) {
    std::vector<rig_message> out;
    const std::size_t most = run.bits > 16 ? 2 : 3;
    const auto add = [&](std::size_t begin, std::size_t end, bool force) {
        std::uint32_t number = 0;
        for (std::size_t first = begin; first < end; first += most, ++number) {
            const std::string& signal = run.channels[first].signal;
            const std::string kind = signal.substr(0, signal.find_first_of("0123456789"));
            rig_message message;
            message.name = !force   ? fmt::format("{}{}", kind, number + 1)
                           : number ? fmt::format("Shaker{}", number + 1)
                                    : "Shaker";
            message.id = !force ? first_id + 1 + number : number ? further_force_id + number : first_id;
            message.first = first;
            message.count = std::min(most, end - first);
            message.signal_bits = signal_bits(run);
            out.push_back(message);
        }
    };
    add(0, run.forces, true);
    add(run.forces, run.channels.size(), false);
    return out;
}

double frame_spacing_s(const rig_run& run, std::size_t messages) {
    return std::min(frame_s, 0.9 / run.rate_hz / static_cast<double>(std::max<std::size_t>(messages, 1)));
}

drv_frame_t rig_frame(const rig_run& run, const rig_message& message, std::size_t n, std::int64_t time_ns) {
    drv_frame_t frame{};
    frame.time_ns = time_ns;
    frame.id = message.id;
    frame.len = static_cast<std::uint8_t>((counter_bits + message.signal_bits * static_cast<int>(message.count)) / 8);
    frame.data[0] = static_cast<std::uint8_t>(n & 0xff);
    frame.data[1] = static_cast<std::uint8_t>(n >> 8 & 0xff);
    std::size_t at = 2;
    for (std::size_t k = 0; k < message.count; ++k) {
        const auto code = static_cast<std::uint32_t>(run.channels[message.first + k].codes[n]);
        for (int shift = 0; shift < message.signal_bits; shift += 8)
            frame.data[at++] = static_cast<std::uint8_t>(code >> shift & 0xff);
    }
    return frame;
}

std::string rig_log(const rig_run& run) {
    const std::vector<rig_message> messages = rig_messages(run);
    const double spacing = frame_spacing_s(run, messages.size());
    std::string out;
    out.reserve(run.count * messages.size() * 56);
    char line[DRV_CANDUMP_BYTES];
    for (std::size_t n = 0; n < run.count; ++n) {
        for (std::size_t i = 0; i < messages.size(); ++i) {
            const drv_frame_t frame = rig_frame(run, messages[i], n, stamp_ns(run, n, i, spacing));
            const int length = drv_candump_format(line, sizeof line, rig_interface, &frame);
            if (length > 0) out.append(line, static_cast<std::size_t>(length)).push_back('\n');
        }
    }
    return out;
}

std::string rig_dbc(const rig_run& run) {
    std::string out = "VERSION \"\"\n\nNS_ :\n\nBS_:\n\nBU_: Rig\n";
    auto text = std::back_inserter(out);
    for (const rig_message& message : rig_messages(run)) {
        const int bytes = (counter_bits + message.signal_bits * static_cast<int>(message.count)) / 8;
        fmt::format_to(text, "\nBO_ {} {}: {} Rig\n SG_ Counter : 0|{}@1+ (1,0) [0|65535] \"\" Vector__XXX\n",
                       message.id, message.name, bytes, counter_bits);
        for (std::size_t k = 0; k < message.count; ++k) {
            const rig_channel& channel = run.channels[message.first + k];
            const double largest = std::ldexp(1.0, message.signal_bits - 1);
            fmt::format_to(text, " SG_ {} : {}|{}@1- ({},0) [{:.12g}|{:.12g}] \"{}\" Vector__XXX\n", channel.signal,
                           counter_bits + static_cast<int>(k) * message.signal_bits, message.signal_bits, channel.scale,
                           -largest * channel.scale, (largest - 1) * channel.scale, channel.unit);
        }
    }
    out += "\nCM_ \"Virtual rig of okid simulate. Counter is the number of the sample, the same in every frame of one "
           "sample; it wraps.\";\n";
    return out;
}

} // namespace okid_host
