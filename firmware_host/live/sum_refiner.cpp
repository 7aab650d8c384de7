// SPDX-License-Identifier: MIT
// PURPOSE  maximum likelihood of a running stream, from correlation sums
// METHOD   lags to where the slowest mode has died away (1e-4 of its amplitude), from a model of the first samples; then every
//          update starts from the model of the method and takes what the likelihood gives
#include "sum_refiner.hpp"

#include "error.hpp"
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

sum_refiner::sum_refiner(const stream_config& config)
    : config_(largest_shape(config)), m_(config.channels()), rate_hz_(config.rate_hz),
      only_where_it_serves_(config.wanted.refine == "auto"),
      constants_(config.wanted.detrend != "none" ||
                 std::any_of(config.offset.begin(), config.offset.end(), [](double x) { return x != 0; })),
      scale_(config.scale), next_look_(first_look) {
    waiting_.reserve(static_cast<std::size_t>(first_look) * m_);
}

std::size_t sum_refiner::room(std::size_t count) const {
    return sums_ ? count : std::min(count, static_cast<std::size_t>(next_look_ - kept()));
}

void sum_refiner::feed(okid_correlation_t* to, const double* rows, std::size_t count) const {
    okid_status_t status = OKID_OK;
    if (config_.sample == OKID_SAMPLE_DOUBLE) {
        status = okid_correlation_add(to, rows, count);
    } else if (config_.sample == OKID_SAMPLE_INT16) {
        const std::vector<std::int16_t> codes(rows, rows + count * m_);
        status = okid_correlation_add_i16(to, codes.data(), count);
    } else {
        const std::vector<std::int32_t> codes(rows, rows + count * m_);
        status = okid_correlation_add_i32(to, codes.data(), count);
    }
    if (status < 0)
        throw failure(exit_no_model,
                      fmt::format("the samples cannot be summed for a refinement: {}", okid_status_text(status)));
}

void sum_refiner::feed_waiting(okid_correlation_t* to) const {
    std::int64_t first = 0;
    for (std::size_t k = 0; k <= gaps_.size(); ++k) {
        const std::int64_t last = k < gaps_.size() ? gaps_[k] : kept();
        feed(to, waiting_.data() + static_cast<std::size_t>(first) * m_, static_cast<std::size_t>(last - first));
        if (k < gaps_.size()) okid_correlation_gap(to, 0);
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
    if (!sums_) {
        for (std::size_t k = 0; k < count; ++k) keep(rows + k * m_);
        return;
    }
    constexpr std::size_t piece = 1024;
    std::vector<double> numbers;
    for (std::size_t done = 0; done < count; done += piece) {
        const std::size_t n = std::min(piece, count - done);
        numbers.assign(rows + done * m_, rows + (done + n) * m_);
        feed(sums_.sums, numbers.data(), n);
    }
}

template void sum_refiner::add(const double*, std::size_t);
template void sum_refiner::add(const float*, std::size_t);
template void sum_refiner::add(const std::int16_t*, std::size_t);
template void sum_refiner::add(const std::int32_t*, std::size_t);

void sum_refiner::gap() {
    if (sums_)
        okid_correlation_gap(sums_.sums, 0);
    else if (kept() > 0 && (gaps_.empty() || gaps_.back() != kept()))
        gaps_.push_back(kept());
}

void sum_refiner::reset() {
    sums_ = {};
    waiting_.clear();
    gaps_.clear();
    next_look_ = first_look;
    found_ = {};
    fault_.clear();
}

sum_refiner::owned_correlation sum_refiner::make(std::int32_t lags) const {
    okid_correlation_config_t c = config_;
    c.lags = lags;
    const std::size_t bytes = okid_correlation_memsize(&c);
    owned_correlation out;
    out.block.reset(new (std::nothrow) std::byte[bytes]);
    if (!out.block || okid_correlation_create(&out.sums, &c, out.block.get(), bytes) != OKID_OK)
        throw failure(exit_device, fmt::format("[identification]: the sums of a refinement need {:.0f} MB, which this "
                                               "machine does not give; set refine = \"no\"",
                                               static_cast<double>(bytes) / 1e6));
    okid_correlation_set_units(out.sums, scale_.data());
    return out;
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
    sums_ = make(model ? lags_of(*model) : config_.lags);
    feed_waiting(sums_.sums);
    waiting_ = {};
    gaps_ = {};
}

std::string sum_refiner::take(const okid_identified_t& start, okid_correlation_t* from, okid_identified_t& model) {
    std::vector<std::byte> room(okid_correlation_sums_memsize(from));
    okid_correlation_sums_t sums{};
    okid_status_t status = okid_correlation_sums(from, constants_ ? OKID_DETREND_MEAN : OKID_DETREND_NONE, &sums,
                                                 room.data(), room.size());
    if (status < 0)
        return fmt::format("no {} samples without a gap have come, so long does the slowest mode ring", config_.lags);
    likeliest_model one = likeliest(constants_, start, sums);
    if (one.status == OKID_ERR_UNSTABLE)
        return fmt::format("a pole rings longer than the {} samples that the sums look back", sums.lags);
    if (one.status < 0) return okid_status_text(one.status);
    if (only_where_it_serves_ && !one.found.converged) return "it did not come to an end";
    model = one.model;
    found_ = {std::move(one.found), std::move(one.arrays), std::move(one.replicates)};
    return "";
}

void sum_refiner::refine(okid_identified_t& model) {
    found_ = {};
    const okid_identified_t start = model;
    if (sums_) {
        fault_ = take(start, sums_.sums, model);
        return;
    }
    const owned_correlation now = make(lags_of(start));
    feed_waiting(now.sums);
    fault_ = take(start, now.sums, model);
}

} // namespace okid_host
