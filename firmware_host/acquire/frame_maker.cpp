// SPDX-License-Identifier: MIT
#include "frame_maker.hpp"

#include <algorithm>
#include <cmath>
#include <drv/candump.h>
#include <utility>

namespace okid_host {
namespace {

constexpr std::int64_t begin_ns = std::int64_t{1700000000} * 1000000000; // logs need a date: a fixed one
constexpr double frame_ns = 120e3;                                       // a classic frame on 1 Mbit/s

/// The length FD can send, at least `bytes`.
unsigned sendable(unsigned bytes) {
    for (const unsigned length : {8u, 12u, 16u, 20u, 24u, 32u, 48u})
        if (bytes <= length) return bytes < 8 ? bytes : length;
    return 64;
}

bool same_message(const channel_config& a, const channel_config& b) {
    return a.bus == b.bus && a.frame.id == b.frame.id && a.frame.extended == b.frame.extended &&
           a.frame.mask == b.frame.mask;
}

bool same_page(const channel_config& a, const channel_config& b) {
    return same_message(a, b) && a.selectors == b.selectors;
}

} // namespace

frame_maker::frame_maker(const live_config& config) : config_(config), period_ns_(1e9 / config.rate_hz) {
    for (std::size_t i = 0; i < config.channels.size(); ++i) {
        const channel_config& channel = config.channels[i];
        auto found = std::find_if(messages_.begin(), messages_.end(), [&](const message& each) {
            return same_page(config.channels[each.channels.front()], channel);
        });
        if (found == messages_.end()) {
            messages_.emplace_back();
            found = messages_.end() - 1;
            const bus_config& bus = config.buses[channel.bus];
            found->interface = bus.interface.empty() ? "can0" : bus.interface;
            found->frame.id = channel.frame.id;
            found->frame.flags = channel.frame.extended ? DRV_FRAME_EXTENDED : 0;
        }
        found->channels.push_back(i);
        std::size_t bytes =
            std::max<std::size_t>({found->frame.len, channel.length, drv_signal_bytes(&channel.layout)});
        if (channel.sequence) bytes = std::max(bytes, drv_signal_bytes(&*channel.sequence));
        found->frame.len = static_cast<std::uint8_t>(sendable(static_cast<unsigned>(std::min<std::size_t>(bytes, 64))));
        if (found->frame.len > 8) found->frame.flags |= DRV_FRAME_FD;
        if (found->frame.len > 8 && config.buses[channel.bus].dbitrate) found->frame.flags |= DRV_FRAME_BRS;
    }
    put_into_pages();
    between_ns_ = std::min(frame_ns, period_ns_ / static_cast<double>(messages_.size() + 1));
}

/// What is not multiplexed stands in every page of its message.
void frame_maker::put_into_pages() {
    const auto first = [&](const message& each) -> const channel_config& {
        return config_.channels[each.channels.front()];
    };
    const auto filled = [&](const message& plain) {
        if (!first(plain).selectors.empty()) return false;
        bool out = false;
        for (message& page : messages_) {
            if (!same_message(first(page), first(plain)) || first(page).selectors.empty()) continue;
            page.channels.insert(page.channels.end(), plain.channels.begin(), plain.channels.end());
            page.frame.len = std::max(page.frame.len, plain.frame.len);
            page.frame.flags |= plain.frame.flags;
            out = true;
        }
        return out;
    };
    std::vector<bool> spare;
    for (const message& each : messages_) spare.push_back(filled(each));
    std::vector<message> kept;
    for (std::size_t k = 0; k < messages_.size(); ++k)
        if (!spare[k]) kept.push_back(std::move(messages_[k]));
    messages_ = std::move(kept);
}

bool frame_maker::fill(const message& from, std::int64_t index, const double* row, drv_frame_t& frame) {
    for (const std::size_t i : from.channels) {
        const channel_config& channel = config_.channels[i];
        if (!std::isfinite(row[i])) return false;
        const int verdict = drv_signal_encode(&channel.layout, frame.data, frame.len, row[i] / channel.si_factor());
        saturated_ += verdict == 2;
        for (const multiplexor& each : channel.selectors)
            drv_signal_put(&each.layout, frame.data, frame.len, static_cast<std::int64_t>(each.values.front().first));
        if (channel.sequence) drv_signal_put(&*channel.sequence, frame.data, frame.len, index);
    }
    return true;
}

void frame_maker::append_sample(std::int64_t index, const double* row, std::string& text) {
    char line[DRV_CANDUMP_BYTES];
    for (std::size_t k = 0; k < messages_.size(); ++k) {
        drv_frame_t frame = messages_[k].frame;
        if (!fill(messages_[k], index, row, frame)) continue;
        frame.time_ns =
            begin_ns + std::llround(static_cast<double>(index) * period_ns_ + static_cast<double>(k) * between_ns_);
        const int count = drv_candump_format(line, sizeof line, messages_[k].interface.c_str(), &frame);
        if (count <= 0) continue;
        text.append(line, static_cast<std::size_t>(count));
        text += '\n';
        ++frames_;
    }
}

} // namespace okid_host
