// SPDX-License-Identifier: MIT
// PURPOSE  maximum likelihood of a running stream, from correlation sums
// METHOD   lags to where the slowest mode has died away (1e-4 of its amplitude), and the colour of the noise, from the first
//          samples; then every update starts from the model of the method and takes what the likelihood of the sums gives
#include "sum_refiner.hpp"

#include "error.hpp"
#include "record/whitening.hpp"
#include "result/mode_verdict.hpp"

#include <okid/refine.h>

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <new>

namespace okid_host {
namespace {

constexpr std::int32_t most_lags = 8192, fewest_lags = 64, most_runs = 64, window_slots = 20;
constexpr std::int64_t first_look = 8192, last_look = 65536; // samples kept until the lags are known
constexpr double died_away = 1e4, hardly_heard = 200; // amplitudes over what is left of them: of modes, of other poles
constexpr double share_of_memory = 0.25;              // of max_memory_mb
constexpr std::size_t piece = 1024, most_filter = 40; // samples handed over at a time; order of a filter

okid_correlation_config_t shape_of(const stream_config& config, std::int32_t lags) {
    okid_correlation_config_t c = okid_correlation_defaults(static_cast<std::int32_t>(config.inputs.size()),
                                                            static_cast<std::int32_t>(config.outputs.size()), lags);
    const identification_config& wanted = config.wanted;
    c.sample = config.sample;
    c.saturated_missing = config.saturated_missing ? 1 : 0;
    c.slots = most_runs;
    const double memory = wanted.window_s     ? *wanted.window_s * config.rate_hz
                          : wanted.forgetting ? std::min(5 / (1 - std::min(*wanted.forgetting, 1 - 1e-9)), 1e9)
                                              : 0; // five time constants: all but 1 %
    if (memory > 0) {
        c.slots = window_slots;
        c.block = static_cast<std::int32_t>(std::max(1.0, std::round(memory / window_slots)));
        c.forgetting = wanted.forgetting.value_or(1.0);
    }
    return c;
}

/// The same with as many lags as a share of the memory takes.
okid_correlation_config_t largest_shape(const stream_config& config) {
    okid_correlation_config_t c = shape_of(config, most_lags);
    const auto fits = [&] {
        const std::size_t bytes = okid_correlation_memsize(&c);
        return bytes > 0 && static_cast<double>(bytes) <= share_of_memory * 1e6 * config.wanted.max_memory_mb;
    };
    while (c.lags > fewest_lags && !fits()) c.lags /= 2;
    return c;
}

} // namespace

double sum_refiner_bytes(const stream_config& config) {
    const okid_correlation_config_t c = largest_shape(config);
    const okid_watch_config_t watch = watch_config_of(config);
    okid_refine_config_t refine = okid_refine_defaults(c.n_u, c.n_y, watch.max_order);
    refine.runs = 0;
    const double pieces = c.slots + 1, m = c.n_u + c.n_y;
    return static_cast<double>(okid_correlation_memsize(&c)) +
           8 * c.n_u * (c.lags + 1.0) * (m + c.n_u + 2 * pieces) + // read out
           static_cast<double>(okid_refine_memsize(&refine)) + 8 * m * static_cast<double>(last_look);
}

sum_refiner::owned_correlation::owned_correlation(okid_correlation_config_t config) {
    bytes = okid_correlation_memsize(&config);
    config.sample = OKID_SAMPLE_DOUBLE;
    bytes = std::max(bytes, okid_correlation_memsize(&config));
    block.reset(new (std::nothrow) std::byte[bytes]);
    if (!block)
        throw failure(exit_device, fmt::format("[identification]: the sums of a refinement need {:.0f} MB, which this "
                                               "machine does not give; set refine = \"no\"",
                                               static_cast<double>(bytes) / 1e6));
}

sum_refiner::sum_refiner(const stream_config& config)
    : config_(largest_shape(config)), m_(config.channels()), rate_hz_(config.rate_hz),
      only_where_it_serves_(config.wanted.refine == "auto"),
      constants_(config.wanted.detrend != "none" ||
                 std::any_of(config.offset.begin(), config.offset.end(), [](double x) { return x != 0; })),
      scale_(config.scale), offset_(config.offset), next_look_(first_look) {
    if (config_.block > 0) memory_ = std::int64_t{config_.block} * config_.slots;
    if (config_.forgetting < 1) memory_ = std::llround(std::min(2 / (1 - config_.forgetting), 1e15)); // as much weight
    waiting_.reserve(static_cast<std::size_t>(last_look) * m_);
    numbers_.reserve((piece + most_filter) * m_);
    past_.reserve((piece + most_filter) * m_);
    sums_ = owned_correlation(config_);
}

std::size_t sum_refiner::room(std::size_t count) const {
    return sums_ ? count : std::min(count, static_cast<std::size_t>(next_look_ - kept()));
}

okid_status_t sum_refiner::sum(const double* rows, std::size_t count) {
    if (config_.sample == OKID_SAMPLE_DOUBLE || in_units_) return okid_correlation_add(sums_.sums, rows, count);
    if (config_.sample == OKID_SAMPLE_INT16) // codes that waited
        return sum(std::vector<std::int16_t>(rows, rows + count * m_).data(), count);
    return sum(std::vector<std::int32_t>(rows, rows + count * m_).data(), count);
}

okid_status_t sum_refiner::sum(const float* rows, std::size_t count) {
    numbers_.assign(rows, rows + count * m_);
    return okid_correlation_add(sums_.sums, numbers_.data(), count);
}

okid_status_t sum_refiner::sum(const std::int16_t* rows, std::size_t count) {
    return okid_correlation_add_i16(sums_.sums, rows, count);
}

okid_status_t sum_refiner::sum(const std::int32_t* rows, std::size_t count) {
    return okid_correlation_add_i32(sums_.sums, rows, count);
}

/// Numbers in engineering units through the filter; one that is missing takes those with it that look back to it.
template <class Number> void sum_refiner::feed_filtered(const Number* rows, std::size_t count) {
    const double full = config_.sample == OKID_SAMPLE_INT16   ? 32767
                        : config_.sample == OKID_SAMPLE_INT24 ? 8388607
                                                              : 2147483647;
    const bool codes = config_.sample != OKID_SAMPLE_DOUBLE && config_.saturated_missing != 0;
    for (std::size_t i = 0; i < count * m_; ++i) {
        const auto x = static_cast<double>(rows[i]);
        past_.push_back(codes && (x >= full || x < -full) ? NAN : scale_[i % m_] * x + offset_[i % m_]);
    }
    const std::size_t order = filter_.size() - 1;
    if (past_.size() / m_ <= order) return;
    numbers_.clear();
    filter_run(filter_, m_, past_.data(), past_.size() / m_, numbers_);
    past_.erase(past_.begin(), past_.end() - static_cast<std::ptrdiff_t>(order * m_));
    check_statistics(sum(numbers_.data(), numbers_.size() / m_));
}

template <class Number> void sum_refiner::feed(const Number* rows, std::size_t count) {
    for (std::size_t done = 0; done < count; done += piece) {
        const std::size_t n = std::min(piece, count - done);
        if (in_units_)
            feed_filtered(rows + done * m_, n);
        else if (const okid_status_t status = sum(rows + done * m_, n); status < 0)
            throw failure(exit_no_model,
                          fmt::format("the samples cannot be summed for a refinement: {}", okid_status_text(status)));
    }
}

/// The pieces between gaps of what waits, from a sample on.
template <class Function> void sum_refiner::each_run(std::int64_t from, Function&& function) const {
    std::int64_t first = from;
    for (std::size_t k = 0; k <= gaps_.size(); ++k) {
        const std::int64_t last = k < gaps_.size() ? gaps_[k] : kept();
        if (last <= first) continue;
        function(waiting_.data() + static_cast<std::size_t>(first) * m_, static_cast<std::size_t>(last - first));
        first = last;
    }
}

/// A row that waits; one with a missing channel is a gap.
template <class Number> void sum_refiner::keep(const Number* row) {
    const bool there = std::all_of(row, row + m_, [](Number x) { return std::isfinite(static_cast<double>(x)); });
    if (there)
        waiting_.insert(waiting_.end(), row, row + m_);
    else
        gap();
}

template <class Number> void sum_refiner::add(const Number* rows, std::size_t count) {
    if (sums_) return feed(rows, count);
    for (std::size_t k = 0; k < count; ++k) keep(rows + k * m_);
}

template void sum_refiner::add(const double*, std::size_t);
template void sum_refiner::add(const float*, std::size_t);
template void sum_refiner::add(const std::int16_t*, std::size_t);
template void sum_refiner::add(const std::int32_t*, std::size_t);

void sum_refiner::gap() {
    past_.clear();
    if (sums_)
        okid_correlation_gap(sums_.sums, 0);
    else if (kept() > 0 && (gaps_.empty() || gaps_.back() != kept()))
        gaps_.push_back(kept());
}

void sum_refiner::reset() {
    waiting_.clear();
    gaps_.clear();
    next_look_ = first_look;
    past_.clear();
    if (given_lags_ > 0) {
        make(given_lags_);
    } else {
        sums_.sums = nullptr;
        filter_ = {1};
        in_units_ = false;
    }
    found_ = {};
    fault_.clear();
}

/// Empty sums, in memory that was there from the start.
void sum_refiner::make(std::int32_t lags) {
    okid_correlation_config_t c = config_;
    c.lags = lags;
    if (in_units_) c.sample = OKID_SAMPLE_DOUBLE;
    if (sums_.bytes < okid_correlation_memsize(&c)) sums_ = owned_correlation(c);
    if (okid_correlation_create(&sums_.sums, &c, sums_.block.get(), sums_.bytes) != OKID_OK)
        throw failure(exit_device, "[identification]: the sums of a refinement cannot be made; set refine = \"no\"");
    if (!in_units_) okid_correlation_set_units(sums_.sums, scale_.data());
}

/// Where the slowest mode has died away and no other pole is heard any more.
std::int32_t sum_refiner::lags_of(const okid_identified_t& model) const {
    double lags =
        std::log(hardly_heard) / -std::log(std::clamp(static_cast<double>(model.model_radius), 0.01, 0.999999));
    const std::vector<mode_verdict> verdicts = mode_verdicts(model, {});
    for (std::size_t k = 0; k < verdicts.size(); ++k)
        if (verdicts[k].confident)
            lags = std::max(lags, std::log(died_away) * rate_hz_ /
                                      (2 * M_PI * model.damping_ratio[k] * static_cast<double>(model.frequency_hz[k])));
    return static_cast<std::int32_t>(std::clamp(std::ceil(lags), double{fewest_lags}, double(config_.lags)));
}

void sum_refiner::choose_lags(const okid_identified_t* model) {
    found_ = {};
    if (!model && next_look_ < last_look) {
        next_look_ *= 2;
        return;
    }
    if (model) {
        likeliest_model one = of_waiting(*model);
        if (one.status >= 0) filter_ = std::move(one.filter);
        in_units_ = filter_.size() > 1;
        whiteness_ = one.status >= 0 ? one.found.whiteness : INFINITY;
    }
    make(model ? lags_of(*model) : config_.lags);
    sum_waiting();
}

void sum_refiner::sum_waiting() {
    each_run(0, [&](const double* rows, std::size_t count) {
        if (rows != waiting_.data()) gap();
        feed(rows, count);
    });
    if (!gaps_.empty() && gaps_.back() == kept()) gap();
    waiting_.clear();
    gaps_.clear();
}

/// What waits as a record, in engineering units and less its means.
likeliest_model sum_refiner::of_waiting(const okid_identified_t& start) const {
    record_work work;
    work.model = start;
    work.set.n_u = static_cast<std::size_t>(start.n_u);
    work.set.n_y = static_cast<std::size_t>(start.n_y);
    std::vector<double> mean(m_, 0.0), rows;
    const std::int64_t first = std::max<std::int64_t>(0, kept() - memory_);
    for (std::size_t i = static_cast<std::size_t>(first) * m_; constants_ && i < waiting_.size(); ++i)
        mean[i % m_] += waiting_[i] / static_cast<double>(kept() - first);
    each_run(first, [&](const double* from, std::size_t count) {
        rows.assign(from, from + count * m_);
        for (std::size_t i = 0; i < rows.size(); ++i) rows[i] = scale_[i % m_] * (rows[i] - mean[i % m_]);
        work.set.add("", rows.data(), count);
    });
    return likeliest(constants_, work);
}

likeliest_model sum_refiner::of_sums(const okid_identified_t& start) {
    std::vector<std::byte> room(okid_correlation_sums_memsize(sums_.sums));
    okid_correlation_sums_t sums{};
    likeliest_model out;
    out.status = okid_correlation_sums(sums_.sums, constants_ ? OKID_DETREND_MEAN : OKID_DETREND_NONE, &sums,
                                       room.data(), room.size());
    if (out.status < 0) return out;
    out = likeliest(constants_, start, sums);
    if (out.status < 0 || filter_.size() == 1) return out;
    out.found.noise_order = static_cast<int>(filter_.size()) - 1;
    double power = 0;
    std::vector<double> answer(4096, 0.0); // of the noise to what drives it
    for (std::size_t t = 0; t < answer.size(); ++t) {
        answer[t] = t == 0 ? 1 : 0;
        for (std::size_t k = 1; k < filter_.size() && k <= t; ++k) answer[t] -= filter_[k] * answer[t - k];
        power += answer[t] * answer[t];
    }
    for (double& noise : out.found.noise_std) noise *= std::sqrt(power);
    return out;
}

void sum_refiner::refine(okid_identified_t& model) {
    found_ = {};
    fault_.clear();
    likeliest_model one = sums_ ? of_sums(model) : of_waiting(model);
    const double white = sums_ ? whiteness_ : one.found.whiteness;
    if (one.status == OKID_ERR_UNSTABLE && sums_)
        fault_ = "a pole rings longer than the sums look back";
    else if (one.status == OKID_ERR_TOO_SHORT && sums_)
        fault_ = "no piece without a gap was as long as the slowest mode rings";
    else if (one.status < 0)
        fault_ = okid_status_text(one.status);
    else if (only_where_it_serves_ && (!one.found.converged || white > nearly_white))
        fault_ = "it cannot be used";
    if (!fault_.empty()) return;
    model = one.model;
    found_ = {std::move(one.found), std::move(one.arrays), std::move(one.replicates)};
}

} // namespace okid_host
