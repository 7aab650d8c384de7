// SPDX-License-Identifier: MIT
#include "sample_feed.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <iterator>

namespace okid_host {
namespace {

constexpr double block_s = 0.05; // an eye sees no more

} // namespace

sample_feed::sample_feed(const live_config& config)
    : rate_hz_(config.rate_hz), width_(config.channels.size()),
      most_(static_cast<std::size_t>(std::max<long long>(1, std::llround(block_s * config.rate_hz)))) {
    for (const channel_config& channel : config.channels) {
        scale_.push_back(channel.layout.scale * channel.si_factor());
        offset_.push_back(channel.layout.offset * channel.si_factor());
    }
    rows_.resize(most_ * width_);
}

json_line sample_feed::add(std::int64_t index, const double* row) {
    if (count_ == 0) first_ = index;
    double* to = rows_.data() + count_ * width_;
    for (std::size_t i = 0; i < width_; ++i) to[i] = row[i] * scale_[i] + offset_[i];
    return ++count_ == most_ ? end_block() : nullptr;
}

json_line sample_feed::end_block() {
    if (count_ == 0) return nullptr;
    auto out = std::make_shared<std::string>();
    out->reserve(100 + 10 * count_ * width_);
    const double end_s = static_cast<double>(first_ + static_cast<std::int64_t>(count_)) / rate_hz_;
    fmt::format_to(std::back_inserter(*out), R"({{"type":"samples","t":{},"first":{},"count":{},"values":[)", end_s,
                   first_, count_);
    for (std::size_t i = 0; i < width_; ++i) {
        *out += i ? ",[" : "[";
        for (std::size_t n = 0; n < count_; ++n) {
            if (n) *out += ',';
            const double value = rows_[n * width_ + i];
            if (std::isfinite(value))
                fmt::format_to(std::back_inserter(*out), "{:.7g}", value);
            else
                *out += "null";
        }
        *out += ']';
    }
    *out += "]}\n";
    count_ = 0;
    return out;
}

} // namespace okid_host
