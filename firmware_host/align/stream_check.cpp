// SPDX-License-Identifier: MIT
#include "stream_check.hpp"

#include "config/config_channel.hpp"

#include <algorithm>
#include <cstdlib>
#include <fmt/format.h>
#include <limits>
#include <utility>

namespace okid_host {
namespace {

constexpr std::int64_t enough_frames = 2000; // of a message; what is wrong in a config is wrong from the first frame on
constexpr std::int64_t least_frames = 200;   // below it nothing is said
// Frames get lost, but not every second one.
constexpr double counting = 0.5;
// A signal that fits its range as tightly as noise can (a third of full scale, RMS) takes more than half the range in one
// step at 3 % of the samples; codes whose bits are mixed up do at 25 %. One whose sign is misread does whenever it
// crosses zero, and is hardly ever in the middle half of its range.
constexpr double jumping = 0.10;
constexpr std::int64_t crossings = 10;
constexpr std::size_t most_named = 8;

std::string identifier_text(std::uint32_t id, bool extended) {
    return fmt::format("{:#x}{}", id, extended ? " extended" : "");
}

std::string append(const std::string& list, const std::string& more) {
    return list.empty() ? more : list + ", " + more;
}

} // namespace

stream_check::stream_check(const live_config& config)
    : config_(config), message_of_(config.channels.size()), codes_(config.channels.size()),
      crowded_(config.buses.size()) {
    for (std::size_t c = 0; c < config.channels.size(); ++c) {
        const channel_config& channel = config.channels[c];
        const auto same = [&](const message& one) {
            return one.bus == channel.bus && same_frames(one.frame, channel.frame) &&
                   one.selectors == channel.selectors;
        };
        auto found = std::find_if(messages_.begin(), messages_.end(), same);
        if (found == messages_.end()) {
            message fresh;
            fresh.bus = channel.bus;
            fresh.frame = channel.frame;
            fresh.selectors = channel.selectors;
            fresh.sequence = channel.sequence;
            if (!channel.selectors.empty()) fresh.stride = std::numeric_limits<std::uint64_t>::max();
            messages_.push_back(std::move(fresh));
            found = messages_.end() - 1;
        }
        message_of_[c] = static_cast<std::size_t>(found - messages_.begin());
        found->channels.push_back(c);
    }
    left_ = messages_.size();
}

bool stream_check::asked_for(const message& one, const drv_frame_t& frame) const {
    const bool extended = (frame.flags & DRV_FRAME_EXTENDED) != 0;
    const std::uint32_t id = one.frame.mask ? frame.id & one.frame.mask : frame.id;
    return one.bus == frame.bus && one.frame.id == id && (one.frame.extended != 0) == extended;
}

void stream_check::add(const drv_frame_t& frame) {
    if (left_ == 0 || (frame.flags & (DRV_FRAME_ERROR | DRV_FRAME_REMOTE))) return;
    // An exact identifier comes before one that stands for many, a group of one sender before that of all.
    const auto bits = [](const message& one) {
        return one.frame.mask ? std::bitset<32>(one.frame.mask).count() : std::size_t{32};
    };
    std::size_t best = 0;
    for (const message& one : messages_)
        if (asked_for(one, frame)) best = std::max(best, bits(one));
    if (best == 0) return note_other(frame);
    for (message& one : messages_) {
        if (bits(one) != best || !asked_for(one, frame)) continue;
        ++one.frames;
        if (one.judged < enough_frames) judge(one, frame);
    }
}

void stream_check::judge(message& one, const drv_frame_t& frame) {
    if (!std::all_of(one.selectors.begin(), one.selectors.end(), [&](const multiplexor& m) { return m.holds(frame); }))
        return;
    one.senders.set(frame.id & 0xFF);
    std::int64_t raw{};
    if (one.sequence && drv_signal_raw(&*one.sequence, frame.data, frame.len, &raw)) {
        const auto counter = static_cast<std::uint64_t>(raw);
        const std::uint64_t range = one.sequence->length < 64 ? (std::uint64_t{1} << one.sequence->length) - 1 : ~0ull;
        const std::uint64_t step = (counter - one.counter) & range;
        if (one.judged > 0 && step > 0 && step < one.stride) { // of a page: its counter may count the frames of all
            one.stride = step;
            one.counted = 0;
        }
        one.counted += one.judged > 0 && step == one.stride;
        one.counter = counter;
    }
    for (const std::size_t channel : one.channels) {
        const drv_signal_t& layout = config_.channels[channel].layout;
        if (layout.value != DRV_VALUE_INTEGER || layout.length < 6 || layout.length > 62 ||
            !drv_signal_raw(&layout, frame.data, frame.len, &raw))
            continue;
        code& its = codes_[channel];
        const std::int64_t quarter = std::int64_t{1} << (layout.length - 2),
                           low = layout.is_signed ? -quarter : quarter;
        its.middle += raw >= low && raw < low + 2 * quarter;
        its.jumps += one.judged > 0 && std::abs(raw - its.last) > 2 * quarter;
        its.last = raw;
    }
    if (++one.judged == enough_frames) --left_;
}

void stream_check::overhear(const drv_frame_t& frame) {
    if (frame.flags & (DRV_FRAME_ERROR | DRV_FRAME_REMOTE)) return;
    if (std::none_of(messages_.begin(), messages_.end(), [&](const message& one) { return asked_for(one, frame); }))
        note_other(frame);
}

void stream_check::note_other(const drv_frame_t& frame) {
    if (frame.bus >= crowded_.size()) return;
    const std::uint8_t extended = (frame.flags & DRV_FRAME_EXTENDED) != 0;
    stranger* const end = strangers_.data() + stranger_count_;
    stranger* found = std::find_if(strangers_.data(), end, [&](const stranger& each) {
        return each.id == frame.id && each.bus == frame.bus && each.extended == extended;
    });
    if (found == strangers_.data() + strangers_.size()) {
        crowded_[frame.bus] = true;
        return;
    }
    if (found == end) {
        *found = {frame.id, frame.bus, extended, 0};
        ++stranger_count_;
    }
    ++found->frames;
}

std::string stream_check::unheard(std::size_t bus) const {
    std::string out;
    for (const message& one : messages_) {
        if (one.bus != bus || one.frames > 0) continue;
        std::string names;
        for (const std::size_t channel : one.channels) names = append(names, config_.channels[channel].name);
        out = append(out, fmt::format("{} ({}{})", identifier_text(one.frame.id, one.frame.extended != 0), names,
                                      same_group(one).empty() ? "" : "; " + same_group(one)));
    }
    return out;
}

/// An extended identifier that did not come, while another of its parameter group did: a J1939 message taken for one of a
/// fixed sender and priority.
std::string stream_check::same_group(const message& one) const {
    const auto group = [](std::uint32_t id) { return j1939_group(id >> 8 & 0x3FFFF); };
    const stranger* const end = strangers_.data() + stranger_count_;
    const stranger* found = std::find_if(strangers_.data(), end, [&](const stranger& each) {
        return each.extended && each.bus == one.bus && group(each.id) == group(one.frame.id);
    });
    if (!one.frame.extended || found == end) return "";
    if (one.frame.mask)
        return fmt::format("address {:#x} sends this group: is source_address right?", found->id & 0xFF);
    return fmt::format(
        "{:#x} of the same J1939 group was received: give pgn = {}, or mark the message VFrameFormat J1939PG "
        "in the dbc",
        found->id, group(found->id));
}

std::string stream_check::others(std::size_t bus) const {
    std::vector<stranger> there;
    std::copy_if(strangers_.begin(), strangers_.begin() + static_cast<std::ptrdiff_t>(stranger_count_),
                 std::back_inserter(there), [&](const stranger& each) { return each.bus == bus; });
    std::sort(there.begin(), there.end(), [](const stranger& a, const stranger& b) {
        return a.frames != b.frames ? a.frames > b.frames : a.id < b.id;
    });
    std::string out;
    for (std::size_t i = 0; i < std::min(there.size(), most_named); ++i)
        out = append(out, fmt::format("{} ({} frame{})", identifier_text(there[i].id, there[i].extended != 0),
                                      there[i].frames, there[i].frames == 1 ? "" : "s"));
    if (there.size() > most_named || crowded_[bus]) out += " and more";
    return out;
}

void stream_check::remark_counter(const message& one, remarks& out) const {
    const std::int64_t steps = one.judged - 1;
    const bool repeated =
        one.selectors.empty() && std::any_of(messages_.begin(), messages_.end(), [&](const message& other) {
            return !other.selectors.empty() && other.bus == one.bus && same_frames(other.frame, one.frame);
        });
    if (!one.sequence || repeated || steps < least_frames ||
        static_cast<double>(one.counted) >= counting * static_cast<double>(steps))
        return;
    const channel_config& channel = config_.channels[one.channels.front()];
    const std::string where = channel.message.empty()
                                  ? "identifier " + identifier_text(one.frame.id, one.frame.extended != 0)
                                  : "message " + channel.message;
    out.emplace_back(
        "counter_erratic",
        fmt::format("the counter of {} rose by one in only {} of its first {} frames: it has to count the "
                    "samples. Look at \"sequence\" of \"{}\" (start bit {}, {} bits, {} endian); without the key "
                    "frames are placed by their time stamps",
                    where, one.counted, steps, channel.name, one.sequence->start_bit, one.sequence->length,
                    one.sequence->big_endian ? "big" : "little"));
}

void stream_check::remark_code(const message& one, std::size_t channel, remarks& out) const {
    const std::int64_t steps = one.judged - 1, jumps = codes_[channel].jumps;
    const bool split = jumps >= crossings && codes_[channel].middle < jumps;
    if (steps < least_frames || (!split && static_cast<double>(jumps) <= jumping * static_cast<double>(steps))) return;
    const channel_config& its = config_.channels[channel];
    out.emplace_back(
        "code_jumps",
        fmt::format(
            "\"{}\" jumped by more than half the range of its {} bits at {} of its first {} samples, as no signal "
            "does: is it really {}signed, are start bit ({}), length and byte order right{}?",
            its.name, its.layout.length, jumps, steps, its.layout.is_signed ? "" : "un", its.layout.start_bit,
            its.signal.empty() ? "" : fmt::format(" ({} of {})", its.signal, its.message)));
}

/// A parameter group that several nodes send is as many sensors in one channel.
void stream_check::remark_senders(const message& one, remarks& out) const {
    if (one.frame.mask == 0 || (one.frame.mask & 0xFF) || one.senders.count() < 2) return;
    std::string addresses;
    for (std::size_t k = 0; k < one.senders.size(); ++k)
        if (one.senders[k]) addresses = append(addresses, fmt::format("{:#x}", k));
    const channel_config& channel = config_.channels[one.channels.front()];
    out.emplace_back("several_senders",
                     fmt::format("parameter group {} of \"{}\" is sent by the addresses {}: their samples are mixed. "
                                 "Give its channels the source_address of one",
                                 j1939_group(one.frame.id >> 8 & 0x3FFFF), channel.name, addresses));
}

remarks stream_check::doubts() const {
    remarks out;
    for (const message& one : messages_) {
        remark_senders(one, out);
        remark_counter(one, out);
        for (const std::size_t channel : one.channels)
            if (config_.channels[channel].role != channel_role::aux) remark_code(one, channel, out);
    }
    return out;
}

} // namespace okid_host
