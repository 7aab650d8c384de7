// SPDX-License-Identifier: MIT
// PURPOSE  method auto of a stream
// METHOD   rows in one vector, the oldest dropped at its front: of a growing memory into sums (record/older_samples.hpp);
//          identify_records() over what is there
#include "agreement.hpp"

#include "record/roving.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>

namespace okid_host {
namespace {

constexpr double most_numbers = 1e7;   // of hits at several places: 80 MB
constexpr double numbers_a_number = 8; // an identification holds the record, its lower rates and copies of both

record_options options_of(const stream_config& config) {
    record_options out;
    out.threads = 1; // the others are the readers'
    out.inputs = config.inputs;
    out.outputs = config.outputs;
    out.fs_hz = config.rate_hz;
    out.method = config.wanted.method;
    out.refine = config.wanted.refine;
    out.hold = config.wanted.hold;
    out.detrend = config.wanted.detrend;
    out.sigma_blocks = config.wanted.sigma_blocks;
    out.analytic = config.wanted.analytic;
    out.band = config.wanted.band;
    out.decimate = config.wanted.decimate;
    out.modes_without_matrices = true;
    for (const mass_channel& channel : config.mass.outputs) out.sensing.push_back(channel.sensing);
    return out;
}

/// Samples of the window, 0: there is none.
std::int64_t window_of(const stream_config& config) {
    return config.wanted.window_s ? kept_samples(config) : std::int64_t{0};
}

/// A window ends; and where hits are at several places the samples after each are needed.
bool keeps_sums(const stream_config& config) { return !config.wanted.window_s && config.hits.empty(); }

} // namespace

std::int64_t kept_samples(const stream_config& config) {
    if (config.wanted.window_s)
        return std::max<std::int64_t>(1, std::llround(*config.wanted.window_s * config.rate_hz));
    if (config.hits.empty()) return static_cast<std::int64_t>(newest_samples(config.channels()));
    const okid_watch_config_t watch = watch_config_of(config);
    const double left = config.wanted.max_memory_mb * 1e6 - static_cast<double>(okid_watch_memsize(&watch)) -
                        followed_modes::bytes(config, 0);
    const double numbers = std::min(most_numbers, std::max(0.0, left) / 8 / numbers_a_number);
    return std::max<std::int64_t>(1, static_cast<std::int64_t>(numbers / static_cast<double>(config.channels())));
}

double agreement_bytes(const stream_config& config) {
    return 8 * numbers_a_number * static_cast<double>(kept_samples(config)) * static_cast<double>(config.channels()) +
           followed_modes::bytes(config, window_of(config)) +
           (keeps_sums(config) ? older_samples::bytes(config.inputs.size(), config.outputs.size()) : 0);
}

agreement::agreement(const stream_config& config)
    : where_(config.where), m_(config.channels()), options_(options_of(config)),
      window_(config.wanted.window_s.has_value()), most_(kept_samples(config)), starts_{0}, hits_(config.hits),
      missing_(m_, NAN), followed_(config, window_of(config)), usual_(usual_of(records())), next_(m_) {
    if (keeps_sums(config)) older_ = std::make_unique<older_samples>(options_);
    rows_.reserve(static_cast<std::size_t>(window_ ? most_ + most_ / 4 + 1 : older_ ? most_ : 0) * m_);
}

void agreement::push(const double* row) {
    if (came_ - begin_ == most_) {
        feed_to(begin_ + 1); // of a window shorter than what judges a spike
        begin_ += older_ ? static_cast<std::int64_t>(older_->take(records())) : 1;
        while (starts_.size() > 1 && starts_[1] <= begin_) starts_.erase(starts_.begin()), ++gone_;
        if (older_ || begin_ - base_ > most_ / 4) {
            rows_.erase(rows_.begin(), rows_.begin() + static_cast<std::ptrdiff_t>((begin_ - base_)) *
                                                           static_cast<std::ptrdiff_t>(m_));
            base_ = begin_;
        }
    }
    rows_.insert(rows_.end(), row, row + m_);
    ++came_;
}

void agreement::add(const double* row) {
    if (std::all_of(row, row + m_, [](double x) { return std::isfinite(x); })) {
        ++counts_.samples;
        in_gap_ = false;
    } else {
        ++counts_.missing;
        counts_.gaps += !in_gap_;
        in_gap_ = true;
    }
    push(row);
    if (came_ == judge_after_) {
        usual_ = usual_of(records());
        judge_after_ *= 2;
    }
    feed_to(came_ - static_cast<std::int64_t>(about_a_spike));
}

/// Samples before this one go to the followed modes, which nothing else screens.
void agreement::feed_to(std::int64_t sample) {
    for (fed_ = std::max(fed_, begin_); fed_ < sample; ++fed_) {
        const std::int64_t first = std::max(starts_.back(), begin_);
        without_spikes(at(first), static_cast<std::size_t>(came_ - first), static_cast<std::size_t>(fed_ - first),
                       usual_, next_.data());
        followed_.add(next_.data());
    }
}

void agreement::add_missing(std::int64_t count) {
    const std::int64_t end = came_;
    if (count > 0) {
        counts_.missing += count;
        counts_.gaps += !in_gap_;
    }
    for (std::int64_t k = std::min(count, most_); k > 0; --k) push(missing_.data());
    feed_to(end);
    if (const std::int64_t left = count - (fed_ - end); count == 0 || left > 0) // else they went through a short window
        followed_.add_missing(left);
    fed_ = came_;
    in_gap_ = count > 0;
    if (count == 0 && starts_.back() < came_) starts_.push_back(came_);
}

void agreement::forget() {
    rows_.clear();
    base_ = begin_ = forgotten_ = came_;
    starts_ = {came_};
    run_at_ = fed_ = came_;
    in_gap_ = false;
    followed_.reset();
    if (older_) older_ = std::make_unique<older_samples>(options_);
}

void agreement::reset() {
    forget();
    counts_ = {};
    run_of_.reset();
}

std::int64_t agreement::rows() const {
    std::int64_t out = older_ ? older_->samples() - older_->missing() : 0;
    for (std::int64_t k = begin_; k < came_; ++k)
        out += std::all_of(at(k), at(k) + m_, [](double x) { return std::isfinite(x); });
    return out;
}

std::size_t agreement::bytes() const {
    const double sums = older_ ? older_samples::bytes(options_.inputs.size(), options_.outputs.size()) : 0;
    return rows_.capacity() * sizeof(double) + static_cast<std::size_t>(sums);
}

std::int64_t agreement::basis() const {
    return came_ - begin_ + (older_ ? static_cast<std::int64_t>(older_->samples()) : 0);
}

record_set agreement::records() const {
    record_set out;
    out.n_u = options_.inputs.size();
    out.n_y = options_.outputs.size();
    for (std::size_t i = 0; i < starts_.size(); ++i) {
        const std::int64_t first = std::max(starts_[i], begin_), last = i + 1 < starts_.size() ? starts_[i + 1] : came_;
        if (first < last)
            out.add(starts_.size() == 1 ? "the stream" : fmt::format("record {} of the stream", i + 1), at(first),
                    static_cast<std::size_t>(last - first));
    }
    return out;
}

/// Where the records were struck, and with them the forces of M, K and R.
void agreement::place_hits(const record_set& set, const mass_plan& mass) {
    options_.mass = mass;
    if (hits_.size() < gone_ + set.records.size()) return;
    const auto first = hits_.begin() + static_cast<std::ptrdiff_t>(gone_);
    options_.hits.assign(first, first + static_cast<std::ptrdiff_t>(set.records.size()));
    if (!mass.wanted()) return;
    const std::vector<int> places = hit_places(options_.hits);
    const std::vector<std::string> names = place_names(options_.inputs.front(), options_.hits);
    options_.mass.inputs.assign(places.size(), mass.inputs.front());
    for (std::size_t k = 0; k < places.size(); ++k)
        options_.mass.inputs[k].name = names[k], options_.mass.inputs[k].dof = places[k];
}

okid_status_t agreement::run(const mass_plan& mass) {
    const std::pair<std::int64_t, bool> now{came_, mass.wanted()};
    if (run_of_ == now) return fault_ ? OKID_ERR_NO_MODES : OKID_OK;
    run_of_ = now;
    pass();
    fault_.reset();
    try {
        record_set set = records();
        place_hits(set, mass);
        usual_ = usual_of(set);
        found_ = identify_records(std::move(set), options_, older_.get());
        found_.context.x0.reset(); // a stream's samples give no more of the result than its sums
        found_.context.simulation_percent.reset();
    } catch (const failure& why) {
        fault_ = why;
        found_ = {};
    }
    decided_on_ = basis();
    followed_.begin(found_);
    model_ = kept_model(found_.model.view());
    sigma_ = found_.context.sigma;
    return fault_ ? OKID_ERR_NO_MODES : OKID_OK;
}

bool agreement::follow() {
    if (!followed_.any()) return false;
    model_ = kept_model(found_.model.view());
    sigma_ = found_.context.sigma;
    followed_.follow(static_cast<double>(decided_on_) / static_cast<double>(std::max(decided_on_, basis())), model_,
                     sigma_);
    return true;
}

std::vector<std::byte> agreement::state() const {
    record_set set = records();
    saved_samples out;
    for (const record_data& record : set.records)
        out.ends.push_back(static_cast<std::int64_t>(record.first + record.count));
    out.rows = std::move(set.samples);
    if (older_ && older_->samples() > 0) out.older = older_->state();
    return samples_body(set.n_u, set.n_y, out);
}

/// The sums in a state; none: nullptr.
std::unique_ptr<older_samples> agreement::older_in(const saved_samples& from) const {
    if (from.older.empty()) return nullptr;
    if (!older_)
        throw failure(exit_usage, where_ + "the state keeps sums of older samples, expected one of a window or of "
                                           "hits at several places, which keep samples alone");
    return std::make_unique<older_samples>(options_, where_, from.older);
}

/// @param older  those before them, merged or put back by now
void agreement::take(const saved_samples& from, const older_samples* older) {
    if (older) {
        counts_.samples += older->samples() - older->missing();
        counts_.missing += older->missing();
        counts_.gaps += older->gaps();
    }
    asked_ = true;
    std::size_t first = 0;
    for (const std::int64_t end : from.ends) {
        add_missing(0);
        for (; first < static_cast<std::size_t>(end); ++first) add(from.rows.data() + first * m_);
    }
}

saved_samples agreement::read(const void* state, std::size_t bytes) const {
    return read_samples(where_, options_.inputs.size(), options_.outputs.size(), state, bytes);
}

void agreement::restore(const void* state, std::size_t bytes) {
    const saved_samples from = read(state, bytes);
    std::unique_ptr<older_samples> older = older_in(from);
    reset();
    if (older) older_ = std::move(older);
    take(from, from.older.empty() ? nullptr : older_.get());
}

void agreement::merge(const void* state, std::size_t bytes) {
    if (window_) throw failure(exit_usage, where_ + "a window takes no further records, only a growing memory");
    const saved_samples from = read(state, bytes);
    const std::unique_ptr<older_samples> older = older_in(from);
    if (older) older_->merge(*older);
    take(from, older.get());
}

} // namespace okid_host
