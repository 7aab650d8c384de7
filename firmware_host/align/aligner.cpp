// SPDX-License-Identifier: MIT
#include "aligner.hpp"

#include "config/config_clock.hpp"
#include "missing.hpp"
#include "ring_mask.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace okid_host {
namespace {

constexpr double begin_patience_s = 30; // a node that is not heard by then is left out

double inner_rate(const live_config& config) { return config.rate_hz * config.decimate; }

double rate_of(const live_config& config, const std::vector<std::size_t>& channels) {
    const bus_config& bus = config.buses[config.channels[channels.front()].bus];
    return bus.free_clock && bus.rate_hz ? *bus.rate_hz : inner_rate(config);
}

/// The configuration with some of its channels only.
live_config part_of(const live_config& config, const std::vector<std::size_t>& channels, double rate_hz) {
    live_config out = config;
    out.channels.clear();
    for (const std::size_t c : channels) out.channels.push_back(config.channels[c]);
    out.rate_hz = rate_hz;
    return out;
}

} // namespace

aligner::aligner(const live_config& config, grid_sink& sink)
    : sink_(sink), width_(config.channels.size()), clock_(inner_rate(config)),
      limit_(std::numeric_limits<std::int64_t>::max()), gaps_(width_) {
    const auto domains = clock_domains(config);
    const double rate_hz = inner_rate(config);
    counted_ = domains.front();
    if (config.decimate > 1) decimator_ = std::make_unique<decimator>(width_, config.decimate, sink);
    reference_.reset(new grid(part_of(config, counted_, rate_hz), *this)); // make_unique cannot see the base
    if (domains.size() == 1) return;
    const double ahead_s = std::max(1.25, 64 / rate_hz); // the reference may be ahead of a node
    const double kept_s =
        (silence_patience_s + ahead_s) / 2; // of it a node keeps four times: the reference may wait, too
    double filter_s = 0;
    for (std::size_t d = 1; d < domains.size(); ++d) {
        const double own_hz = rate_of(config, domains[d]);
        filter_s = std::max(filter_s, 33 * std::max(1 / own_hz, 1 / rate_hz));
        nodes_.push_back(std::make_unique<free_node>(part_of(config, domains[d], own_hz), domains[d], rate_hz, kept_s));
    }
    wait_ = std::llround((ahead_s + filter_s) * rate_hz);
    patience_ = std::llround(begin_patience_s * rate_hz);
    mask_ = ring_mask(2 * static_cast<double>(wait_) + 1);
    waiting_.assign((mask_ + 1) * counted_.size(), missing_sample);
    stamps_.assign(mask_ + 1, 0);
    row_.assign(width_, missing_sample);
    part_.assign(width_, missing_sample);
}

void aligner::push(const drv_frame_t& frame) {
    for (auto& node : nodes_) node->push(frame);
    reference_->push(frame);
    if (!nodes_.empty()) drain();
}

void aligner::on_sample(std::int64_t index, const double* row) {
    const std::int64_t stamp = reference_->time_ns(index);
    if (nodes_.empty()) {
        if (decimator_) decimator_->note_time(index, stamp);
        hand_on(index, row, 1);
        return;
    }
    if (stamp) clock_.add(index, stamp);
    take(index, row, stamp);
}

void aligner::on_missing(std::int64_t index, std::int64_t count) {
    if (nodes_.empty()) {
        hand_on(index, nullptr, count);
        return;
    }
    for (std::int64_t i = 0; i < count; ++i) take(index + i, nullptr, 0);
}

void aligner::on_gap(const grid_gap& gap) {
    if (!nodes_.empty())
        causes_.add(gap);
    else if (decimator_)
        decimator_->on_gap(gap);
    else
        sink_.on_gap(gap);
}

/// To the next stage: the filter of the decimation, or the session.
void aligner::hand_on(std::int64_t index, const double* row, std::int64_t count) {
    grid_sink& to = decimator_ ? static_cast<grid_sink&>(*decimator_) : sink_;
    if (row)
        to.on_sample(index, row);
    else
        to.on_missing(index, count);
}

/// A sample of the reference waits for the nodes.
void aligner::take(std::int64_t index, const double* row, std::int64_t stamp) {
    while (index - next_ > wait_) // after this time no node is waited for
        if (!begin() || !emit(true)) ++next_;
    double* to = &waiting_[slot(index) * counted_.size()];
    if (row)
        std::copy_n(row, counted_.size(), to);
    else
        std::fill_n(to, counted_.size(), missing_sample);
    stamps_[slot(index)] = stamp;
    taken_ = index + 1;
}

/// The output begins when all clocks are known. Samples before that are discarded.
bool aligner::begin() {
    if (origin_ >= 0) return true;
    if (!clock_.settled()) return false;
    const bool all = std::all_of(nodes_.begin(), nodes_.end(), [](const auto& node) { return node->settled(); });
    if (!all && taken_ < patience_) return false;
    origin_ = next_;
    return true;
}

void aligner::drain() {
    while (next_ < taken_ && begin() && emit(false)) {
    }
}

/// The oldest sample that waits, with the nodes' signals at its time. @return false: it goes on waiting
bool aligner::emit(bool force) {
    const std::int64_t number = next_ - origin_;
    if (number >= limit_) return false;
    std::fill(row_.begin(), row_.end(), missing_sample);
    const bool known = clock_.settled(); // not so for a moment after the host's clock was set
    if (!known && !force) return false;
    const std::int64_t time = known ? clock_.time_ns(next_, nullptr) : 0;
    bool ready = true, all = true;
    for (auto& node : nodes_) {
        const auto verdict =
            known ? node->sample(next_, time, clock_.period_s(), force, part_.data()) : free_node::verdict::missing;
        ready &= verdict != free_node::verdict::wait;
        all &= verdict == free_node::verdict::found;
        if (known)
            for (std::size_t i = 0; i < node->channels().size(); ++i) row_[node->channels()[i]] = part_[i];
    }
    if (!ready) return false;
    // The first sample is one that every node has: before it the filters fill.
    if (number == 0 && !all && taken_ < patience_) {
        ++next_;
        ++origin_;
        return true;
    }
    const double* own = &waiting_[slot(next_) * counted_.size()];
    for (std::size_t i = 0; i < counted_.size(); ++i) row_[counted_[i]] = own[i];
    if (decimator_) decimator_->note_time(number, stamps_[slot(next_)]);
    ++next_;
    gaps_.row(row_.data(), *this, decimator_ ? *decimator_ : sink_);
    hand_on(number, row_.data(), 1);
    return true;
}

gap_cause aligner::cause_of(std::size_t channel, std::int64_t first, std::int64_t last) const {
    const auto own = std::find(counted_.begin(), counted_.end(), channel);
    if (own != counted_.end())
        return causes_.find(static_cast<std::size_t>(own - counted_.begin()), first + origin_, last + origin_);
    for (const auto& node : nodes_)
        if (std::find(node->channels().begin(), node->channels().end(), channel) != node->channels().end())
            return node->cause_of(channel, clock_.time_ns(first + origin_, nullptr),
                                  clock_.time_ns(last + origin_, nullptr));
    return gap_cause::stall;
}

void aligner::finish() {
    for (auto& node : nodes_) node->finish();
    reference_->finish();
    if (!nodes_.empty()) {
        drain();
        gaps_.finish(*this, decimator_ ? *decimator_ : sink_);
    }
    if (decimator_) decimator_->finish();
}

void aligner::set_limit(std::int64_t count) {
    if (decimator_)
        decimator_->set_limit(count);
    else if (nodes_.empty())
        reference_->set_limit(count);
    else
        limit_ = count;
}

void aligner::set_link(std::size_t bus, bool down) {
    reference_->set_link(bus, down);
    for (auto& node : nodes_) node->set_link(bus, down);
}

std::int64_t aligner::emitted() const {
    return decimator_ ? decimator_->emitted() : nodes_.empty() ? reference_->emitted() : gaps_.rows();
}

std::int64_t aligner::time_ns(std::int64_t index) const {
    if (decimator_) return decimator_->time_ns(index);
    return nodes_.empty() ? reference_->time_ns(index) : stamps_[slot(index + origin_)];
}

grid_bus_counts aligner::bus(std::size_t index) const {
    grid_bus_counts out = reference_->bus(index);
    for (const auto& node : nodes_) {
        const grid_bus_counts more = node->samples().bus(index);
        out.received += more.received;
        out.out_of_order += more.out_of_order;
        out.too_late += more.too_late;
        out.duplicate += more.duplicate;
        out.decode_errors += more.decode_errors;
        for (std::size_t i = 0; i < out.lost.size(); ++i) out.lost[i] += more.lost[i];
    }
    return out;
}

grid_channel_counts aligner::counted(std::size_t index) const {
    if (decimator_) return decimator_->channel(index);
    return nodes_.empty() ? reference_->channel(index) : gaps_.channel(index);
}

grid_channel_counts aligner::channel(std::size_t index) const {
    grid_channel_counts out = counted(index);
    const auto own = std::find(counted_.begin(), counted_.end(), index);
    if (own == counted_.end()) return out; // on a clock of its own
    const grid_channel_counts its = reference_->channel(static_cast<std::size_t>(own - counted_.begin()));
    out.uncertain = its.uncertain;
    out.place_std_s = its.place_std_s;
    return out;
}

std::vector<std::size_t> aligner::silent_channels() const {
    std::vector<std::size_t> out;
    for (const std::size_t c : reference_->silent_channels()) out.push_back(counted_[c]);
    for (const auto& node : nodes_)
        for (const std::size_t c : node->samples().silent_channels()) out.push_back(node->channels()[c]);
    std::sort(out.begin(), out.end());
    return out;
}

std::vector<clock_skew> aligner::skews() const {
    std::vector<clock_skew> out;
    if (origin_ < 0) return out;
    double own_sigma_s{};
    (void)clock_.time_ns(next_, &own_sigma_s);
    for (const auto& node : nodes_)
        for (const std::size_t c : node->channels())
            out.push_back({c, 1e6 * node->skew_s(), 1e6 * std::hypot(own_sigma_s, node->skew_sigma_s()),
                           node->rate_ppm() - clock_.rate_ppm()});
    std::sort(out.begin(), out.end(), [](const clock_skew& a, const clock_skew& b) { return a.channel < b.channel; });
    return out;
}

} // namespace okid_host
