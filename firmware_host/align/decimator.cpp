// SPDX-License-Identifier: MIT
#include "decimator.hpp"

#include "missing.hpp"
#include "ring_mask.hpp"

#include <algorithm>
#include <limits>

namespace okid_host {
decimator::decimator(std::size_t channels, int factor, grid_sink& to)
    : to_(to), kernel_(factor), factor_(factor), half_(static_cast<std::int64_t>(kernel_.half())),
      limit_(std::numeric_limits<std::int64_t>::max()), width_(channels),
      mask_(ring_mask(4 * static_cast<double>(kernel_.half()))), weights_(2 * kernel_.half()),
      rows_((mask_ + 1) * channels, 0.0), out_(channels), nothing_(channels, missing_sample), times_(mask_ + 1, 0),
      gaps_(channels) {
    kernel_.weights(0, weights_.data());
}

/// Behind the length of the filter a pause leaves nothing of what was before: those samples are missing all at once.
void decimator::on_missing(std::int64_t index, std::int64_t count) {
    const std::int64_t end = index + count, empty = index + 2 * half_;
    for (std::int64_t i = index; i < std::min(end, empty); ++i) {
        note_time(i, 0);
        add(i, nothing_.data());
    }
    if (end <= empty) return;
    // Input i completes output (i - 2 half) / factor.
    const std::int64_t first = (empty - 2 * half_ + factor_ - 1) / factor_;
    const std::int64_t behind = std::min(limit_, (end - 1 - 2 * half_) / factor_ + 1);
    for (std::int64_t i = std::max(empty, end - static_cast<std::int64_t>(mask_) - 1); i < end; ++i) {
        note_time(i, 0);
        std::fill_n(&rows_[slot(i) * width_], width_, missing_sample);
    }
    if (behind <= first) return;
    gaps_.missing(behind - first);
    to_.on_missing(first, behind - first);
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
