// SPDX-License-Identifier: MIT
#include "decimator.hpp"

#include <algorithm>
#include <limits>

namespace okid_host {
namespace {

constexpr double missing = std::numeric_limits<double>::quiet_NaN();

std::size_t ring_mask(std::size_t least) {
    std::size_t size = 1;
    while (size < least) size *= 2;
    return size - 1;
}

} // namespace

decimator::decimator(std::size_t channels, int factor, grid_sink& to)
    : to_(to), kernel_(factor), factor_(factor), half_(static_cast<std::int64_t>(kernel_.half())),
      limit_(std::numeric_limits<std::int64_t>::max()), width_(channels), mask_(ring_mask(4 * kernel_.half())),
      weights_(2 * kernel_.half()), rows_((mask_ + 1) * channels, 0.0), out_(channels), nothing_(channels, missing),
      times_(mask_ + 1, 0), gaps_(channels) {
    kernel_.weights(0, weights_.data());
}

/// A pause longer than the filter leaves nothing of what was before: the samples between need no filter.
void decimator::on_missing(std::int64_t index, std::int64_t count) {
    for (std::int64_t i = 0; i < count; ++i) add(index + i, nothing_.data());
}

/// The output begins with the first input on whose both sides the filter has samples.
void decimator::add(std::int64_t index, const double* row) {
    std::copy_n(row, width_, &rows_[slot(index) * width_]);
    const std::int64_t centre = index - half_, number = (centre - half_) / factor_;
    if (centre < half_ || centre % factor_ != 0 || number >= limit_) return;
    std::fill(out_.begin(), out_.end(), 0.0);
    for (std::int64_t i = 0; i < 2 * half_; ++i) {
        const double* in = &rows_[slot(centre - half_ + 1 + i) * width_];
        const double weight = weights_[static_cast<std::size_t>(i)];
        for (std::size_t c = 0; c < width_; ++c) out_[c] += weight * in[c];
    }
    gaps_.row(out_.data(), *this, to_);
    to_.on_sample(number, out_.data());
}

gap_cause decimator::cause_of(std::size_t channel, std::int64_t first, std::int64_t last) const {
    return causes_.find(channel, source_index(first) - half_, source_index(last) + half_);
}

} // namespace okid_host
