// SPDX-License-Identifier: MIT
#include "rate_chain.hpp"

#include <algorithm>
#include <cmath>

namespace okid_host {

rate_chain::rate_chain(std::size_t m, double fs_hz, int decimate) : m_(m), rates_(most_levels) {
    for (std::size_t k = 0; k < rates_.size(); ++k) {
        rate& mine = rates_[k];
        mine.factor = k > 0 ? 2 : static_cast<std::size_t>(decimate);
        fs_hz /= static_cast<double>(mine.factor);
        mine.fs_hz = fs_hz;
        if (mine.factor > 1) mine.weights = decimation_weights(static_cast<int>(mine.factor));
        mine.waiting.reserve(4 * mine.weights.size() * m_);
        mine.row.resize(m_);
    }
}

/// @return the row that the rate has with this one, NULL: none
const double* rate_chain::into_filter(rate& mine, const double* row) const {
    const std::size_t taps = mine.weights.size();
    if (taps == 0) return row;
    if (mine.waiting.size() + m_ > mine.waiting.capacity())
        mine.waiting.erase(mine.waiting.begin(),
                           mine.waiting.end() - static_cast<std::ptrdiff_t>((taps - 1) * m_)); // a filter less one row
    mine.waiting.insert(mine.waiting.end(), row, row + m_);
    ++mine.came;
    if (mine.came < taps || (mine.came - taps) % mine.factor != 0) return nullptr;
    const double* first = mine.waiting.data() + mine.waiting.size() - taps * m_;
    std::fill(mine.row.begin(), mine.row.end(), 0.0);
    for (std::size_t i = 0; i < taps; ++i)
        for (std::size_t c = 0; c < m_; ++c) mine.row[c] += mine.weights[i] * first[i * m_ + c];
    return mine.row.data();
}

void rate_chain::begin_record(bool in_silence) {
    for (rate& each : rates_) {
        each.came = in_silence ? each.weights.size() / 2 : 0;
        each.waiting.assign(each.came * m_, 0.0);
    }
}

std::vector<double> rate_chain::state() const {
    std::vector<double> out;
    for (const rate& each : rates_) {
        const std::size_t kept = std::min(each.waiting.size(), each.weights.size() * m_);
        const std::size_t rows = kept / m_;
        out.push_back(static_cast<double>(each.came));
        out.push_back(static_cast<double>(rows));
        out.insert(out.end(), each.waiting.end() - static_cast<std::ptrdiff_t>(kept), each.waiting.end());
    }
    return out;
}

bool rate_chain::put_back(const std::vector<double>& state) {
    std::vector<rate> to = rates_;
    std::size_t at = 0;
    for (rate& each : to) {
        if (at + 2 > state.size()) return false;
        const double came = state[at++], rows = state[at++], taps = static_cast<double>(each.weights.size());
        if (!(came >= 0 && came < 9e15 && rows >= 0 && rows <= taps && rows <= came) || came != std::floor(came) ||
            rows != std::floor(rows) || static_cast<std::size_t>(rows) * m_ > state.size() - at)
            return false;
        each.came = static_cast<std::size_t>(came);
        each.waiting.assign(state.begin() + static_cast<std::ptrdiff_t>(at),
                            state.begin() + static_cast<std::ptrdiff_t>(at + static_cast<std::size_t>(rows) * m_));
        each.waiting.reserve(4 * each.weights.size() * m_);
        at += static_cast<std::size_t>(rows) * m_;
    }
    if (at != state.size()) return false;
    rates_ = std::move(to);
    return true;
}

} // namespace okid_host
