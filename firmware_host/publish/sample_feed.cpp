// SPDX-License-Identifier: MIT
#include "sample_feed.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <iterator>

namespace okid_host {
namespace {

constexpr double block_s = 0.05; // an eye sees no more

/// As short as it may be; JSON has no NaN.
void append_number(std::string& out, double value) {
    if (std::isfinite(value))
        fmt::format_to(std::back_inserter(out), "{:.7g}", value);
    else
        out += "null";
}

} // namespace

sample_feed::sample_feed(const live_config& config, std::size_t extra)
    : rate_hz_(config.rate_hz), extra_(extra), width_(config.channels.size() + extra),
      most_(static_cast<std::size_t>(std::max<long long>(1, std::llround(block_s * config.rate_hz)))),
      std_(extra, 0.0) {
    for (const channel_config& channel : config.channels) {
        scale_.push_back(channel.layout.scale * channel.si_factor());
        offset_.push_back(channel.layout.offset * channel.si_factor());
    }
    rows_.resize(most_ * width_);
}

json_line sample_feed::add(std::int64_t index, const double* row, const double* extra) {
    if (count_ == 0) first_ = index;
    double* to = rows_.data() + count_ * width_;
    for (std::size_t i = 0; i < scale_.size(); ++i) to[i] = row ? row[i] * scale_[i] + offset_[i] : NAN;
    for (std::size_t i = 0; i < extra_; ++i) {
        to[scale_.size() + i] = extra[i];
        std_[i] = std::max(std_[i], extra[extra_ + i]);
    }
    return ++count_ == most_ ? end_block() : nullptr;
}

/// The block of one channel.
void sample_feed::append(std::string& out, std::size_t column) const {
    for (std::size_t n = 0; n < count_; ++n) {
        out += n ? ',' : '[';
        append_number(out, rows_[n * width_ + column]);
    }
    out += ']';
}

json_line sample_feed::end_block() {
    if (count_ == 0) return nullptr;
    auto out = std::make_shared<std::string>();
    out->reserve(100 + 10 * count_ * width_);
    const double end_s = static_cast<double>(first_ + static_cast<std::int64_t>(count_)) / rate_hz_;
    fmt::format_to(std::back_inserter(*out), R"({{"type":"samples","t":{},"first":{},"count":{},"values":[)", end_s,
                   first_, count_);
    for (std::size_t i = 0; i < width_; ++i) {
        if (i) *out += ',';
        append(*out, i);
    }
    *out += ']';
    for (std::size_t i = 0; i < extra_; ++i) {
        *out += i ? "," : ",\"std\":[";
        append_number(*out, std_[i]);
        std_[i] = 0;
    }
    *out += extra_ > 0 ? "]}\n" : "}\n";
    count_ = 0;
    return out;
}

} // namespace okid_host
