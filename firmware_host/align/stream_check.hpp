// SPDX-License-Identifier: MIT
// What the first frames of a stream say against its configuration: identifiers that do not come and others that do in
// their stead, counters that do not count, numbers that cannot be one signal.
//
// Every message is judged by its first 2000 frames. Once all were, a frame costs one comparison.
#pragma once
#include "config/config.hpp"

#include <array>
#include <bitset>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace okid_host {

class stream_check {
  public:
    explicit stream_check(const live_config& config);

    /// A frame as it comes. No heap.
    void add(const drv_frame_t& frame);
    /// A frame that only passed by: asked for are those of add().
    void overhear(const drv_frame_t& frame);

    bool judged() const { return left_ == 0; } ///< nothing is looked at any more
    /// Identifiers of a bus that did not come, each with its channels; "" when all did.
    std::string unheard(std::size_t bus) const;
    /// Identifiers that came and that no channel asks for, with the number of frames; "" when none did.
    std::string others(std::size_t bus) const;
    /// What to write when frames of a silent channel's J1939 group came under another identifier; "" when none did.
    std::string same_group(std::size_t channel) const { return same_group(messages_[message_of_[channel]]); }
    /// Frames that came with the identifier of a channel.
    std::int64_t frames_of(std::size_t channel) const { return messages_[message_of_[channel]].frames; }

    /// Code and text of everything in the stream that contradicts the configuration, for the warnings of the result.
    remarks doubts() const;

  private:
    struct message {
        std::size_t bus = 0;
        drv_filter_t frame{};
        std::vector<multiplexor> selectors;
        std::optional<drv_signal_t> sequence;
        std::vector<std::size_t> channels;
        std::int64_t frames = 0, judged = 0, counted = 0; ///< received; of them looked at; whose counter rose by stride
        std::uint64_t counter = 0, stride = 1;            ///< of a page the least step so far
        std::bitset<256> senders;                         ///< of a J1939 group
    };
    struct code {
        std::int64_t last = 0, jumps = 0, middle = 0; ///< steps of more than half the range; codes in its middle half
    };
    struct stranger {
        std::uint32_t id = 0;
        std::uint8_t bus = 0, extended = 0;
        std::int64_t frames = 0;
    };
    bool asked_for(const message& one, const drv_frame_t& frame) const;
    void note_other(const drv_frame_t& frame);
    void judge(message& one, const drv_frame_t& frame);
    std::string same_group(const message& one) const;
    void remark_counter(const message& one, remarks& out) const;
    void remark_senders(const message& one, remarks& out) const;
    void remark_code(const message& one, std::size_t channel, remarks& out) const;

    const live_config& config_;
    std::vector<message> messages_;
    std::vector<std::size_t> message_of_; ///< of each channel
    std::vector<code> codes_;             ///< of each channel
    std::array<stranger, 32> strangers_{};
    std::size_t stranger_count_ = 0, left_ = 0;
    std::vector<bool> crowded_; ///< buses with identifiers for which the table had no room
};

} // namespace okid_host
