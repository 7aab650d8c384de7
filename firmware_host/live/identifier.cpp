// SPDX-License-Identifier: MIT
// PURPOSE  a stream of samples into sums, and out of them a model whenever it is asked for
// METHOD   rows go to the accumulator as they come, one by one through a small buffer; a watch compares them with the last
//          model at rest and tells of a change, from which on a memory that forgets starts again
#include "identifier.hpp"

#include "error.hpp"
#include "result/method.hpp"
#include "stream_memory.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <new>
#include <type_traits>
#include <utility>

namespace okid_host {
namespace {

constexpr std::size_t chunk = 256; // samples handed over at a time

std::unique_ptr<std::byte[]> allocate(const stream_config& config, std::size_t bytes, const char* what) {
    std::unique_ptr<std::byte[]> block(new (std::nothrow) std::byte[bytes]);
    if (!block)
        throw failure(exit_device,
                      fmt::format("{}{} needs {:.0f} MB, which this machine does not give; lower p, rows or window_s",
                                  config.where, what, static_cast<double>(bytes) / 1e6));
    return block;
}

/// Numbers of the type can be added to such sums as they are.
template <class Number> bool takes(okid_sample_t sample) {
    if (std::is_floating_point_v<Number>) return sample == OKID_SAMPLE_DOUBLE;
    return sizeof(Number) == 2 ? sample == OKID_SAMPLE_INT16
                               : sample == OKID_SAMPLE_INT24 || sample == OKID_SAMPLE_INT32;
}

const char* sample_text(okid_sample_t sample) {
    switch (sample) {
    case OKID_SAMPLE_INT16: return "16-bit codes as int16";
    case OKID_SAMPLE_INT24: return "24-bit codes as int32";
    case OKID_SAMPLE_INT32: return "32-bit codes as int32";
    default: return "real numbers";
    }
}

} // namespace

identifier::identifier(const stream_config& config)
    : where_(config.where), m_(config.channels()), states_only_(config.states_only),
      saturated_missing_(config.saturated_missing), sample_(config.sample), scale_(config.scale),
      offset_(config.offset) {
    require_memory(config);
    if (config.wanted.method == "auto") {
        agreed_ = std::make_unique<agreement>(config);
        q_ = fewest_of_auto(config.inputs.size(), config.outputs.size()) / 2;
        if (config.wanted.window_s) memory_samples_ = kept_samples(config);
    } else {
        create_identifier(config);
        create_accumulator(config);
    }
    create_watch(config);
    if (agreed_) return;
    if (sums_config_.sample == OKID_SAMPLE_INT16)
        codes_.resize(chunk * m_);
    else
        doubles_.resize(chunk * m_);
}

void identifier::create_accumulator(const stream_config& config) {
    sums_config_ = sums_config_of(config);
    if (config.wanted.window_s)
        memory_samples_ = std::int64_t{sums_config_.slots} * sums_config_.block;
    else if (sums_config_.forgetting < 1)
        memory_samples_ = std::llround(std::min(1 / (1 - sums_config_.forgetting), 1e15));
    sums_bytes_ = okid_accumulator_memsize(&sums_config_);
    whole_.block = allocate(config, sums_bytes_, "the accumulator");
    if (okid_accumulator_create(&accumulator_, &sums_config_, whole_.block.get(), sums_bytes_) != OKID_OK)
        throw failure(exit_usage, where_ + "the accumulator cannot be made");
    okid_accumulator_set_units(accumulator_, scale_.data(), offset_.data());
    if (config.wanted.refine != "no") refiner_ = std::make_unique<sum_refiner>(config);
    if (config.wanted.sigma_blocks == 0) return;
    blocks_ = std::make_unique<live_blocks>(sums_config_, identify_config_, config.wanted.sigma_blocks,
                                            config.wanted.analytic, config.states_only);
    blocks_->set_units(scale_, offset_);
    if (config.wanted.window == "auto") chooser_ = std::make_unique<window_chooser>(config);
}

void identifier::create_identifier(const stream_config& config) {
    identify_config_ = identify_config_of(config);
    q_ = identify_config_.n_u + okid_identify_lags(&identify_config_) * static_cast<std::int64_t>(m_);
    const std::size_t bytes = okid_identify_memsize(&identify_config_);
    identify_block_ = allocate(config, bytes, "the identification");
    if (okid_identify_create(&identify_, &identify_config_, identify_block_.get(), bytes) != OKID_OK)
        throw failure(exit_usage, where_ + "the identification cannot be made");
}

/// A growing memory keeps everything, as it was asked for: of a change it only tells.
void identifier::create_watch(const stream_config& config) {
    const identification_config& wanted = config.wanted;
    restart_on_change_ = wanted.restart_on_change && (wanted.window_s || wanted.forgetting);
    const okid_watch_config_t c = watch_config_of(config);
    lags_ = c.lead;
    most_order_ = c.max_order;
    change_samples_ = std::int64_t{c.block} * c.confirm;
    const std::size_t bytes = okid_watch_memsize(&c);
    watch_block_ = allocate(config, bytes, "the watch over the model");
    if (okid_watch_create(&watch_, &c, watch_block_.get(), bytes) != OKID_OK)
        throw failure(exit_usage, where_ + "the watch cannot be made");
    row_.resize(m_);
}

bool identifier::wants_model() const {
    okid_watch_state_t now{};
    okid_watch_state(watch_, &now);
    return !now.learning && (!now.watching || samples_ >= due_);
}

void identifier::watch_model() {
    if (okid_watch_set_model(watch_, agreed_ ? &model_ : &realised_) != OKID_OK)
        return; // a model without a predictor is not watched
    watched_ = true;
    const std::int64_t age = memory_samples_ > 0 ? memory_samples_ : basis();
    due_ = samples_ + age;
}

/// A row in engineering units through the watch. @return the structure has changed
bool identifier::watch(const double* row) {
    if (!okid_watch_add(watch_, row)) return false;
    change_at_ = samples_ - change_samples_;
    watched_ = false;
    return true;
}

/// The rows up to a change, its last one with them, through the watch; they count as seen.
template <class Number> std::size_t identifier::rows_until_change(const Number* rows, std::size_t count) {
    for (std::size_t k = 0; k < count; ++k) {
        bool there = true;
        for (std::size_t i = 0; i < m_; ++i) {
            const auto number = static_cast<double>(rows[k * m_ + i]);
            there = there && std::isfinite(number);
            row_[i] = scale_[i] * number + offset_[i];
        }
        ++samples_;
        if (!there)
            okid_watch_gap(watch_);
        else if (watch(row_.data()))
            return k + 1;
    }
    return count;
}

std::optional<std::int64_t> identifier::take_change() {
    if (!change_at_) return std::nullopt;
    if (agreed_) agreed_->ask();
    return samples_ - *std::exchange(change_at_, std::nullopt);
}

std::vector<double> identifier::predicted_percent() {
    if (agreed_) return agreed_->found().context.prediction_percent.value_or(std::vector<double>());
    const std::size_t size = m_ * static_cast<std::size_t>(lags() + 1), n_u = m_ - static_cast<std::size_t>(model_.n_y);
    std::vector<double> gram(size * size), out;
    okid_accumulator_t* sums = chooser_ ? blocks_->gather(accumulator_, chooser_->chosen().first) : accumulator_;
    const std::int64_t rows = okid_accumulator_rows(sums);
    if (okid_accumulator_gram(sums, identify_config_.detrend, gram.data(), nullptr) < 0) return out;
    for (std::size_t i = 0; i < m_ - n_u; ++i) {
        const double variance = gram[(n_u + i) * (size + 1)] / static_cast<double>(rows);
        const auto innovation = static_cast<double>(model_.innovation[i * (m_ - n_u + 1)]);
        out.push_back(100 * (1 - std::sqrt(std::max(innovation, 0.0) / variance)));
    }
    return out;
}

void identifier::restart() {
    if (!restart_on_change_) return;
    if (agreed_) {
        ++restarts_;
        agreed_->forget();
        return;
    }
    before_ = stats();
    ++restarts_;
    okid_accumulator_reset(accumulator_);
    if (blocks_) blocks_->reset();
    if (refiner_) refiner_->reset();
    if (chooser_) chooser_->reset();
}

/// A row of raw numbers to those kept for auto, with the watch over it.
template <class Number> okid_status_t identifier::keep(const Number* row) {
    const double most = sample_ == OKID_SAMPLE_INT16 ? 32767 : sample_ == OKID_SAMPLE_INT24 ? 8388607 : 2147483647;
    bool there = true, full = false;
    for (std::size_t i = 0; i < m_; ++i) {
        const auto number = static_cast<double>(row[i]);
        full = full || (sample_ != OKID_SAMPLE_DOUBLE && (number >= most || number < -most));
        there = there && std::isfinite(number);
        row_[i] = scale_[i] * number + offset_[i];
    }
    if (full) agreed_->saturated();
    if (full && saturated_missing_) there = false, row_.assign(m_, NAN);
    agreed_->add(row_.data());
    ++samples_;
    if (!there)
        okid_watch_gap(watch_);
    else if (watched_ && watch(row_.data()))
        restart();
    return !there ? OKID_WARN_MISSING : full ? OKID_WARN_SATURATED : OKID_OK;
}

/// Samples into the sums, and into those of the blocks beside them.
template <class Number> okid_status_t identifier::absorb(const Number* samples, std::size_t count) {
    okid_status_t worst = OKID_OK;
    for (std::size_t done = 0; done < count;) {
        std::size_t n = blocks_ ? blocks_->room(accumulator_, count - done) : count - done;
        if (refiner_) n = refiner_->room(n);
        const okid_status_t status = add_samples(accumulator_, samples + done * m_, n);
        if (status < 0)
            throw failure(status == OKID_ERR_RANGE && sizeof(Number) > 2 ? exit_usage : exit_no_model,
                          fmt::format("the samples cannot be summed any further: {}", okid_status_text(status)));
        if (blocks_) blocks_->add(accumulator_, samples + done * m_, n);
        if (refiner_) {
            refiner_->add(samples + done * m_, n);
            if (refiner_->wants_model()) choose_lags();
        }
        worst = std::max(worst, status);
        done += n;
    }
    return worst;
}

/// A model of what has come so far, for the lags of the refinement.
void identifier::choose_lags() {
    const bool found = okid_identify_run(identify_, accumulator_, &realised_) >= 0;
    model_ = realised_;
    refiner_->choose_lags(found ? &realised_ : nullptr);
}

void identifier::flush() {
    const std::size_t count = std::exchange(pending_, 0);
    if (count == 0) return;
    if (sums_config_.sample == OKID_SAMPLE_INT16)
        absorb(codes_.data(), count);
    else
        absorb(doubles_.data(), count);
}

void identifier::add(const double* row) {
    if (agreed_) return (void)keep(row);
    double check = 0;
    for (std::size_t i = 0; i < m_; ++i) check += row[i] * 0.0;
    if (check != 0) { // NaN
        add_missing(1);
        return;
    }
    if (sums_config_.sample == OKID_SAMPLE_INT16) {
        std::int16_t* to = codes_.data() + pending_ * m_;
        for (std::size_t i = 0; i < m_; ++i) to[i] = static_cast<std::int16_t>(row[i]);
    } else {
        double* to = doubles_.data() + pending_ * m_;
        std::copy_n(row, m_, to);
    }
    if (++pending_ == chunk) flush();
    if (!watched_)
        ++samples_;
    else if (rows_until_change(row, 1), !watched_)
        restart();
}

template <class Number> okid_status_t identifier::add_rows(const Number* rows, std::size_t count) {
    if (!takes<Number>(sample_))
        throw failure(exit_usage,
                      fmt::format("the stream takes {}, found {} of {} bytes", sample_text(sample_),
                                  std::is_floating_point_v<Number> ? "real numbers" : "codes", sizeof(Number)));
    if (states_only_) throw failure(exit_usage, "the stream takes states only, found samples");
    flush();
    okid_status_t worst = OKID_OK;
    for (; agreed_ && count > 0; --count, rows += m_) worst = std::max(worst, keep(rows));
    while (count > 0) {
        const bool watching = watched_;
        const std::size_t n = watching ? rows_until_change(rows, count) : count;
        if (!watching) samples_ += static_cast<std::int64_t>(n);
        worst = std::max(worst, absorb(rows, n));
        if (watching && !watched_) restart();
        rows += n * m_;
        count -= n;
    }
    return worst;
}

template okid_status_t identifier::add_rows(const double*, std::size_t);
template okid_status_t identifier::add_rows(const float*, std::size_t);
template okid_status_t identifier::add_rows(const std::int16_t*, std::size_t);
template okid_status_t identifier::add_rows(const std::int32_t*, std::size_t);

void identifier::add_missing(std::int64_t count) {
    if (states_only_) throw failure(exit_usage, "the stream takes states only, found a gap");
    flush();
    samples_ += count;
    okid_watch_gap(watch_);
    if (agreed_) return agreed_->add_missing(count);
    okid_accumulator_gap(accumulator_, count);
    if (blocks_) blocks_->gap(accumulator_, count);
    if (refiner_) refiner_->gap();
}

void identifier::reset() {
    pending_ = 0;
    if (agreed_)
        agreed_->reset();
    else
        okid_accumulator_reset(accumulator_);
    if (blocks_) blocks_->reset();
    if (refiner_) refiner_->reset();
    reset_counts();
}

void identifier::reset_counts() {
    okid_watch_reset(watch_);
    watched_ = false;
    samples_ = due_ = blind_until_ = restarts_ = 0;
    change_at_.reset();
    before_ = {};
    if (chooser_) chooser_->reset();
}

/// The first bytes of a state, those of its correlation sums.
std::size_t identifier::refinement_in(const void* state, std::size_t bytes) const {
    const std::size_t own = sum_refiner::bytes_in(state, bytes);
    if (refiner_ && own == 0 && !states_only_)
        throw failure(exit_usage, where_ +
                                      "the state has no sums for a refinement, expected one of a stream that refines; "
                                      "or set refine = \"no\"");
    return own;
}

std::vector<std::byte> identifier::state() {
    if (agreed_) return agreed_->state();
    flush();
    if (refiner_ && !refiner_->summing() && okid_identify_run(identify_, accumulator_, &realised_) >= 0)
        refiner_->choose_lags(&realised_);
    if (refiner_ && !refiner_->summing())
        throw failure(exit_usage, where_ +
                                      "the samples give no model yet, which must tell how far the sums of a refinement "
                                      "look back; expected a longer record, or refine = \"no\"");
    std::vector<std::byte> out = refiner_ ? refiner_->state() : std::vector<std::byte>();
    const std::size_t at = out.size(), bytes = okid_accumulator_serialised_size(accumulator_);
    out.resize(at + bytes);
    if (okid_accumulator_serialise(accumulator_, out.data() + at, bytes) != OKID_OK)
        throw failure(exit_device, where_ + "the state cannot be written");
    return out;
}

/// The sums of a state, of these channels, lags and kind of samples.
owned_sums identifier::read_state(const void* state, std::size_t bytes, const okid_accumulator_config_t& shape) const {
    okid_accumulator_config_t found{};
    if (const okid_status_t status = okid_accumulator_peek(state, bytes, &found); status != OKID_OK)
        throw failure(exit_usage, fmt::format("{}the state is damaged: {}", where_, okid_status_text(status)));
    owned_sums out(found);
    if (!out.sums) throw failure(exit_device, where_ + "out of memory for a state");
    const bool fits = found.n_u == shape.n_u && found.n_y == shape.n_y && found.lags == shape.lags &&
                      found.sample == shape.sample && found.slots == shape.slots && found.block == shape.block &&
                      found.forgetting == shape.forgetting;
    if (!fits || okid_accumulator_deserialise(out.sums, state, bytes) != OKID_OK)
        throw failure(exit_usage,
                      fmt::format("{}the state is of {} inputs and {} outputs, {} lags, {}, window of {} x {} samples, "
                                  "forgetting {:g}; expected {}, {}, {}, {}, {} x {}, {:g}",
                                  where_, found.n_u, found.n_y, found.lags, sample_text(found.sample), found.slots,
                                  found.block, found.forgetting, shape.n_u, shape.n_y, shape.lags,
                                  sample_text(shape.sample), shape.slots, shape.block, shape.forgetting));
    return out;
}

void identifier::restore(const void* state, std::size_t bytes) {
    if (agreed_) {
        agreed_->restore(state, bytes);
        reset_counts();
        samples_ = agreed_->basis();
        return;
    }
    const std::size_t refinement = refinement_in(state, bytes);
    const void* const sums = static_cast<const std::byte*>(state) + refinement;
    owned_sums from = read_state(sums, bytes - refinement, sums_config_);
    if (refiner_ && refinement > 0) refiner_->put_back(state, refinement);
    pending_ = 0;
    if (blocks_) blocks_->reset();
    reset_counts();
    if (const okid_status_t status = okid_accumulator_deserialise(accumulator_, sums, bytes - refinement);
        status != OKID_OK)
        throw failure(exit_usage, fmt::format("{}the state: {}", where_, okid_status_text(status)));
    const okid_accumulator_stats_t counts = held();
    samples_ = counts.samples + counts.missing;
    if (!blocks_) return;
    if (memory_samples_ == 0)
        blocks_->take(std::move(from)); // all that was is one block
    else if (sums_config_.slots == 0)   // fading: its blocks must begin where slots do
        blind_until_ =
            samples_ + std::llround(std::log(1 - live_blocks::remembered) / std::log(sums_config_.forgetting));
}

void identifier::merge(const void* state, std::size_t bytes) {
    if (agreed_) {
        agreed_->merge(state, bytes);
        samples_ = agreed_->basis();
        return;
    }
    if (memory_samples_ > 0)
        throw failure(exit_usage, where_ + "a window and a fading memory take no further records, only a growing one");
    const std::size_t refinement = refinement_in(state, bytes);
    flush();
    if (refiner_ && refinement == bytes) return refiner_->merge(state, refinement);
    owned_sums from = read_state(static_cast<const std::byte*>(state) + refinement, bytes - refinement, sums_config_);
    if (refiner_ && refinement > 0) refiner_->merge(state, refinement);
    if (const okid_status_t status = okid_accumulator_merge(accumulator_, from.sums); status != OKID_OK)
        throw failure(exit_usage, fmt::format("{}the state: {}", where_, okid_status_text(status)));
    const okid_accumulator_stats_t counts = held();
    samples_ = counts.samples + counts.missing;
    if (blocks_) blocks_->take(std::move(from));
}

okid_status_t identifier::run(const mass_plan& mass) {
    if (agreed_) {
        const okid_status_t status = agreed_->run(mass);
        model_ = agreed_->model();
        return status;
    }
    flush();
    const okid_status_t status = chooser_ ? chooser_->run(accumulator_, identify_, *blocks_, realised_)
                                          : okid_identify_run(identify_, accumulator_, &realised_);
    model_ = realised_;
    if (status >= 0 && refiner_) refiner_->refine(model_);
    return status;
}

okid_status_t identifier::update() {
    if (decides() || !agreed_->follow()) return run();
    model_ = agreed_->model();
    return OKID_OK;
}

std::int64_t identifier::rows() {
    if (agreed_) return agreed_->rows();
    flush();
    return okid_accumulator_rows(accumulator_);
}

okid_accumulator_stats_t identifier::stats() {
    if (agreed_) {
        okid_accumulator_stats_t out = agreed_->stats();
        out.rows = agreed_->rows();
        return out;
    }
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
    if (agreed_) return agreed_->basis();
    const okid_accumulator_stats_t counts = held();
    const std::int64_t all = counts.samples + counts.missing; // as in a file: missing samples are samples of the record
    if (chooser_ && chooser_->chosen().first > 0) return chooser_->chosen().rows;
    return memory_samples_ > 0 ? std::min(all, memory_samples_) : all;
}

} // namespace okid_host
