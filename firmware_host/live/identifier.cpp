// SPDX-License-Identifier: MIT
#include "identifier.hpp"

#include "error.hpp"
#include "result/method.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <new>
#include <utility>

namespace okid_host {
namespace {

constexpr std::size_t chunk = 256; // samples handed over at a time
constexpr std::int32_t watch_block = 32,
                       watch_blocks = 3; // samples whose errors are averaged; so many high ones are a change

/// Do the raw numbers of every channel fit int16 as they are?
bool fits_codes(const live_config& config) {
    return !resampled(config) &&
           std::all_of(config.channels.begin(),
                       config.channels.begin() + static_cast<std::ptrdiff_t>(config.n_u + config.n_y),
                       [](const channel_config& channel) {
                           const drv_signal_t& layout = channel.layout;
                           return layout.value == DRV_VALUE_INTEGER && layout.length <= (layout.is_signed ? 16 : 15);
                       });
}

std::unique_ptr<std::byte[]> allocate(const live_config& config, std::size_t bytes, const char* what) {
    if (bytes == 0)
        throw failure(
            exit_usage,
            fmt::format("{}: [identification]: p, rows, order or window_s do not go together with {} channels ({})",
                        config.path, config.n_u + config.n_y, what));
    std::unique_ptr<std::byte[]> block(new (std::nothrow) std::byte[bytes]);
    if (!block)
        throw failure(exit_usage, fmt::format("{}: [identification]: {} needs {:.1f} GB; lower p, rows or window_s",
                                              config.path, what, static_cast<double>(bytes) / 1e9));
    return block;
}

} // namespace

identifier::identifier(const live_config& config) : m_(config.n_u + config.n_y), exact_(fits_codes(config)) {
    for (std::size_t i = 0; i < m_; ++i) {
        scale_.push_back(config.channels[i].layout.scale * config.channels[i].si_factor());
        offset_.push_back(config.channels[i].layout.offset * config.channels[i].si_factor());
    }
    if (exact_)
        codes_.resize(chunk * m_);
    else
        doubles_.resize(chunk * m_);
    create_identifier(config);
    create_accumulator(config);
    create_watch(config);
}

/// The window moves in whole blocks: about a twentieth of it, or one update where that is finer.
void identifier::create_accumulator(const live_config& config) {
    const identification_config& wanted = config.identification;
    const std::int64_t update = std::max<std::int64_t>(1, std::llround(wanted.update_s * config.rate_hz));
    okid_accumulator_config_t a{};
    a.n_u = static_cast<std::int32_t>(config.n_u);
    a.n_y = static_cast<std::int32_t>(config.n_y);
    a.lags = okid_identify_lags(&identify_config_);
    a.sample = exact_ ? OKID_SAMPLE_INT16 : OKID_SAMPLE_DOUBLE;
    a.forgetting = wanted.forgetting.value_or(1.0);
    a.edges = 1;
    if (wanted.window_s) {
        const std::int64_t window = std::max<std::int64_t>(1, std::llround(*wanted.window_s * config.rate_hz));
        const std::int64_t block =
            std::clamp(update, std::max<std::int64_t>(1, window / 64), std::max<std::int64_t>(1, window / 20));
        a.block = static_cast<std::int32_t>(std::min<std::int64_t>(block, INT32_MAX));
        a.slots = static_cast<std::int32_t>(
            std::max<std::int64_t>(1, std::llround(static_cast<double>(window) / static_cast<double>(a.block))));
        a.spare_slots = a.slots / 2 + 8;
        memory_samples_ = std::int64_t{a.slots} * a.block;
    } else if (a.forgetting < 1) {
        const double memory = 1 / (1 - a.forgetting);
        a.block = static_cast<std::int32_t>(
            std::clamp<std::int64_t>(std::llround(memory / 20), 1, std::min<std::int64_t>(update, 1 << 20)));
        memory_samples_ = std::llround(std::min(memory, 1e15));
    }
    const std::size_t bytes = okid_accumulator_memsize(&a);
    accumulator_block_ = allocate(config, bytes, "the accumulator");
    if (okid_accumulator_create(&accumulator_, &a, accumulator_block_.get(), bytes) != OKID_OK)
        throw failure(exit_usage, fmt::format("{}: [identification]: the accumulator cannot be made", config.path));
    okid_accumulator_set_units(accumulator_, scale_.data(), offset_.data());
    if (wanted.sigma_blocks == 0) return;
    blocks_ = std::make_unique<live_blocks>(a, identify_config_, wanted.sigma_blocks);
    blocks_->set_units(scale_, offset_);
}

void identifier::create_identifier(const live_config& config) {
    const identification_config& wanted = config.identification;
    okid_identify_config_t& c = identify_config_;
    c.n_u = static_cast<std::int32_t>(config.n_u);
    c.n_y = static_cast<std::int32_t>(config.n_y);
    c.p = wanted.p;
    c.rows = wanted.rows;
    c.order = wanted.order;
    c.fs_hz = config.rate_hz;
    c.method = method_of(wanted.method);
    c.hankel = hankel_of(wanted.hankel);
    c.detrend = wanted.detrend == "none" ? OKID_DETREND_NONE : OKID_DETREND_MEAN;
    q_ = c.n_u + std::int64_t{okid_identify_lags(&c)} * (c.n_u + c.n_y);
    const std::size_t bytes = okid_identify_memsize(&c);
    identify_block_ = allocate(config, bytes, "the identification");
    if (okid_identify_create(&identify_, &c, identify_block_.get(), bytes) != OKID_OK)
        throw failure(exit_usage, fmt::format("{}: [identification]: the identification cannot be made", config.path));
}

/// A growing memory keeps everything, as it was asked for: of a change it only tells.
void identifier::create_watch(const live_config& config) {
    const identification_config& wanted = config.identification;
    restart_on_change_ = wanted.restart_on_change && (wanted.window_s || wanted.forgetting);
    okid_watch_config_t c{};
    c.n_u = identify_config_.n_u;
    c.n_y = identify_config_.n_y;
    c.max_order = okid_identify_max_order(&identify_config_);
    c.lead = okid_identify_lags(&identify_config_);
    c.block = watch_block;
    c.confirm = watch_blocks;
    change_samples_ = std::int64_t{c.block} * c.confirm;
    const std::size_t bytes = okid_watch_memsize(&c);
    watch_block_ = allocate(config, bytes, "the watch over the model");
    if (okid_watch_create(&watch_, &c, watch_block_.get(), bytes) != OKID_OK)
        throw failure(exit_usage, fmt::format("{}: [identification]: the watch cannot be made", config.path));
    row_.resize(m_);
}

void identifier::watch_model() {
    okid_watch_state_t now{};
    okid_watch_state(watch_, &now);
    if (now.learning || (now.watching && samples_ < due_)) return;
    if (okid_watch_set_model(watch_, &model_) != OKID_OK) return; // a model without a predictor is not watched
    const std::int64_t age = memory_samples_ > 0 ? memory_samples_ : basis();
    due_ = samples_ + age;
}

/// The row in engineering units through the watch.
void identifier::watch(const double* row) {
    for (std::size_t i = 0; i < m_; ++i) row_[i] = scale_[i] * row[i] + offset_[i];
    if (!okid_watch_add(watch_, row_.data())) return;
    change_at_ = samples_ - change_samples_;
    if (restart_on_change_) restart();
}

std::optional<std::int64_t> identifier::take_change() {
    if (!change_at_) return std::nullopt;
    return samples_ - *std::exchange(change_at_, std::nullopt);
}

std::vector<double> identifier::predicted_percent() {
    const std::size_t size = m_ * static_cast<std::size_t>(lags() + 1), n_u = m_ - static_cast<std::size_t>(model_.n_y);
    std::vector<double> gram(size * size), out;
    const std::int64_t rows = okid_accumulator_rows(accumulator_);
    if (okid_accumulator_gram(accumulator_, identify_config_.detrend, gram.data(), nullptr) < 0) return out;
    for (std::size_t i = 0; i < m_ - n_u; ++i) {
        const double variance = gram[(n_u + i) * (size + 1)] / static_cast<double>(rows);
        const auto innovation = static_cast<double>(model_.innovation[i * (m_ - n_u + 1)]);
        out.push_back(100 * (1 - std::sqrt(std::max(innovation, 0.0) / variance)));
    }
    return out;
}

void identifier::restart() {
    before_ = stats();
    ++restarts_;
    okid_accumulator_reset(accumulator_);
    if (blocks_) blocks_->reset();
}

/// What waits into the sums, and into those of the blocks beside them.
template <class Number> void identifier::absorb(const Number* samples) {
    for (std::size_t done = 0; done < pending_;) {
        const std::size_t n = blocks_ ? blocks_->room(accumulator_, pending_ - done) : pending_ - done;
        const okid_status_t status = add_samples(accumulator_, samples + done * m_, n);
        if (status < 0)
            throw failure(exit_no_model,
                          fmt::format("the samples cannot be summed any further: {}", okid_status_text(status)));
        if (blocks_) blocks_->add(accumulator_, samples + done * m_, n);
        done += n;
    }
    pending_ = 0;
}

void identifier::flush() {
    if (exact_)
        absorb(codes_.data());
    else
        absorb(doubles_.data());
}

void identifier::add(const double* row) {
    double check = 0;
    for (std::size_t i = 0; i < m_; ++i) check += row[i] * 0.0;
    if (check != 0) { // NaN
        add_missing(1);
        return;
    }
    if (exact_) {
        std::int16_t* to = codes_.data() + pending_ * m_;
        for (std::size_t i = 0; i < m_; ++i) to[i] = static_cast<std::int16_t>(row[i]);
    } else {
        double* to = doubles_.data() + pending_ * m_;
        std::copy_n(row, m_, to);
    }
    ++samples_;
    if (++pending_ == chunk) flush();
    watch(row);
}

void identifier::add_missing(std::int64_t count) {
    flush();
    samples_ += count;
    okid_watch_gap(watch_);
    okid_accumulator_gap(accumulator_, count);
    if (blocks_) blocks_->gap(accumulator_, count);
}

okid_status_t identifier::run() {
    flush();
    return okid_identify_run(identify_, accumulator_, &model_);
}

std::int64_t identifier::rows() {
    flush();
    return okid_accumulator_rows(accumulator_);
}

okid_accumulator_stats_t identifier::stats() {
    okid_accumulator_stats_t out = held();
    out.samples += before_.samples;
    out.missing += before_.missing;
    out.gaps += before_.gaps;
    out.saturated += before_.saturated;
    return out;
}

okid_accumulator_stats_t identifier::held() {
    flush();
    okid_accumulator_stats_t out{};
    okid_accumulator_stats(accumulator_, &out);
    return out;
}

std::int64_t identifier::basis() {
    const okid_accumulator_stats_t counts = held();
    const std::int64_t all = counts.samples + counts.missing; // as in a file: missing samples are samples of the record
    return memory_samples_ > 0 ? std::min(all, memory_samples_) : all;
}

} // namespace okid_host
