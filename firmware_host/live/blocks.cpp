// SPDX-License-Identifier: MIT
// PURPOSE  standard deviations while a stream runs: the sums of its blocks, each left out in turn
// METHOD   the model without each block (okid/uncertainty.h); blocks of a growing memory are paired up when all are full
#include "blocks.hpp"

#include "error.hpp"
#include "result/method.hpp"
#include "stream_memory.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <new>

namespace okid_host {
namespace {

std::unique_ptr<std::byte[]> allocate(std::size_t bytes, int blocks) {
    std::unique_ptr<std::byte[]> block(bytes > 0 ? new (std::nothrow) std::byte[bytes] : nullptr);
    if (!block)
        throw failure(
            exit_device,
            fmt::format("[identification]: the sums of {} blocks for standard deviations need {:.1f} GB each; "
                        "lower p or rows, or set sigma_blocks = 0",
                        blocks, static_cast<double>(bytes) / 1e9));
    return block;
}

} // namespace

live_blocks::live_blocks(const okid_accumulator_config_t& whole, const okid_identify_config_t& identify, int blocks,
                         bool analytic, bool states_only)
    : whole_(whole), sums_(block_sums(whole)), m_(static_cast<std::size_t>(whole.n_u + whole.n_y)),
      blocks_(static_cast<std::size_t>(blocks)), n_u_(whole.n_u), n_y_(whole.n_y),
      most_states_(okid_identify_max_order(&identify)), dt_(1 / identify.fs_hz) {
    length_ = whole.lags;
    const std::size_t most = window() ? 0 : static_cast<std::size_t>(whole.lags) * m_;
    history_.reserve(most);
    codes_.reserve(whole.sample == OKID_SAMPLE_INT16 ? most : 0);
    wide_codes_.reserve(whole.sample == OKID_SAMPLE_INT24 || whole.sample == OKID_SAMPLE_INT32 ? most : 0);
    if (fading()) { // whole slots, so many that all blocks together cover what is remembered
        const double rows = std::log(1 - remembered) / std::log(whole.forgetting) / (2 * blocks);
        length_ = std::max<std::int64_t>(1, std::llround(rows / whole.block)) * whole.block;
    }
    const std::size_t count = states_only ? 0 : block_sums_held(whole, blocks);
    for (std::size_t k = 0; k < count; ++k) parts_.push_back(make());
    const auto create = [&](const okid_jackknife_config_t& config, auto& memory, okid_jackknife_t*& to) {
        const std::size_t bytes = okid_jackknife_memsize(&config);
        memory = allocate(bytes, blocks);
        if (okid_jackknife_create(&to, &config, memory.get(), bytes) != OKID_OK)
            throw failure(exit_usage, "[identification]: the sums for standard deviations cannot be made");
    };
    linear_mass_ = !is_subspace(identify.method) || identify.method == OKID_METHOD_N4SID_SSARX;
    const live_jackknives needed(identify, sums_, analytic);
    if (needed.linear) create(needed.config(1), linear_block_, linear_);
    create(needed.config(0), again_block_, again_);
    modes_ = std::make_unique<replicate_statistics>(n_u_, n_y_, most_states_, mass_plan{}, dt_);
}

void live_blocks::reset() {
    for (part& each : parts_) okid_accumulator_reset(each.sums);
    open_ = 0;
    history_.clear();
    given_.clear();
    if (!window() && !fading()) length_ = whole_.lags;
}

live_blocks::part live_blocks::make() const {
    const std::size_t bytes = okid_accumulator_memsize(&sums_);
    part out;
    out.block = allocate(bytes, static_cast<int>(blocks_));
    if (okid_accumulator_create(&out.sums, &sums_, out.block.get(), bytes) != OKID_OK)
        throw failure(exit_usage, "[identification]: the sums for standard deviations cannot be made");
    return out;
}

void live_blocks::set_units(const std::vector<double>& scale, const std::vector<double>& offset) {
    for (part& each : parts_) okid_accumulator_set_units(each.sums, scale.data(), offset.data());
}

std::size_t live_blocks::room(const okid_accumulator_t* whole, std::size_t count) const {
    if (window()) return count;
    const std::int64_t left = fading()
                                  ? whole_.block - okid_accumulator_slot_rows(whole, okid_accumulator_slots(whole) - 1)
                                  : length_ - okid_accumulator_rows(parts_[open_].sums);
    return std::min(count, static_cast<std::size_t>(std::max<std::int64_t>(1, left)));
}

template <class Number>
void live_blocks::add(const okid_accumulator_t* whole, const Number* samples, std::size_t count) {
    if (window()) return;
    check_statistics(add_samples(parts_[open_].sums, samples, count));
    const std::size_t most = static_cast<std::size_t>(whole_.lags) * m_, numbers = count * m_;
    const std::size_t kept = numbers >= most ? 0 : std::min(history_.size(), most - numbers);
    history_.erase(history_.begin(), history_.end() - static_cast<std::ptrdiff_t>(kept));
    history_.insert(history_.end(), samples + (numbers - std::min(numbers, most)), samples + numbers);
    turn(whole);
}

template void live_blocks::add(const okid_accumulator_t*, const std::int16_t*, std::size_t);
template void live_blocks::add(const okid_accumulator_t*, const std::int32_t*, std::size_t);
template void live_blocks::add(const okid_accumulator_t*, const float*, std::size_t);
template void live_blocks::add(const okid_accumulator_t*, const double*, std::size_t);

void live_blocks::gap(const okid_accumulator_t* whole, std::int64_t count) {
    if (window()) return;
    okid_accumulator_gap(parts_[open_].sums, count);
    history_.clear();
    turn(whole);
}

/// Begin another part when the open one is full; of a fading memory only where a slot of the whole ended.
void live_blocks::turn(const okid_accumulator_t* whole) {
    const std::int64_t open_rows = okid_accumulator_slot_rows(whole, okid_accumulator_slots(whole) - 1);
    if (okid_accumulator_rows(parts_[open_].sums) < length_ || (fading() && open_rows > 0)) return;
    parts_[open_].closed_at = okid_accumulator_rows(whole) - open_rows;
    if (++open_ == parts_.size()) {
        if (fading()) {
            std::rotate(parts_.begin(), parts_.begin() + 1, parts_.end());
            --open_;
        } else {
            pair_up();
        }
    }
    begin_part();
}

template <class Code> void live_blocks::begin_with(okid_accumulator_t* sums, std::vector<Code>& codes) {
    codes.assign(history_.begin(), history_.end());
    check_statistics(add_samples(sums, codes.data(), codes.size() / m_));
}

void live_blocks::begin_part() {
    okid_accumulator_t* sums = parts_[open_].sums;
    okid_accumulator_reset(sums);
    switch (whole_.sample) {
    case OKID_SAMPLE_INT16: begin_with(sums, codes_); break;
    case OKID_SAMPLE_INT24:
    case OKID_SAMPLE_INT32: begin_with(sums, wide_codes_); break;
    default: check_statistics(okid_accumulator_add(sums, history_.data(), history_.size() / m_));
    }
}

/// All parts are full: neighbours become one, of twice the length.
void live_blocks::pair_up() {
    for (std::size_t k = 0; k < blocks_; ++k) {
        check_statistics(okid_accumulator_merge(parts_[2 * k].sums, parts_[2 * k + 1].sums));
        std::swap(parts_[k], parts_[2 * k]);
    }
    open_ = blocks_;
    length_ *= 2;
}

void live_blocks::leave_out(okid_accumulator_t* one, double weight, replicate_statistics& to) {
    if (okid_accumulator_rows(one) == 0) return;
    okid_model_t found{};
    double share = 0;
    const okid_status_t status = okid_jackknife_delete(jackknife_, one, weight, &found, &share);
    most_of_one_ = std::max(most_of_one_, share);
    if (share > 0) to.add(status < 0 ? nullptr : &found, share);
}

void live_blocks::delete_parts(okid_accumulator_t* whole, replicate_statistics& to) {
    const std::int64_t closed =
        okid_accumulator_rows(whole) - okid_accumulator_slot_rows(whole, okid_accumulator_slots(whole) - 1);
    for (std::size_t k = 0; k <= open_ && k < parts_.size(); ++k) {
        const double age = k < open_ ? static_cast<double>(closed - parts_[k].closed_at) : 0;
        leave_out(parts_[k].sums, fading() ? std::pow(whole_.forgetting, age) : 1, to);
    }
    for (const owned_sums& each : given_) leave_out(each.sums, 1, to);
}

/// Groups of consecutive slots with about equal rows.
void live_blocks::delete_slots(okid_accumulator_t* whole, std::int32_t from, replicate_statistics& to) {
    const std::int32_t slots = okid_accumulator_slots(whole);
    std::int64_t rows = okid_accumulator_rows(whole), seen = 0;
    for (std::int32_t k = 0; k < from; ++k) rows -= okid_accumulator_slot_rows(whole, k);
    for (std::int32_t first = from, group = 1; first < slots; ++group) {
        std::int32_t last = first;
        do seen += okid_accumulator_slot_rows(whole, last++);
        while (last < slots && seen * static_cast<std::int64_t>(blocks_) < group * rows);
        okid_accumulator_reset(parts_[1].sums);
        if (okid_accumulator_take_slots(parts_[1].sums, whole, first, last - first) == OKID_OK)
            leave_out(parts_[1].sums, 1, to);
        first = last;
    }
}

/// The derivative where it serves, else identifications without each block, for which a window becomes one record.
bool live_blocks::begin(okid_accumulator_t* whole, okid_identify_t* by, const okid_identified_t& model, bool mass,
                        std::int32_t first) {
    jackknife_ = linear_;
    if (linear_ && (linear_mass_ || !mass)) {
        if (okid_jackknife_begin_linear(linear_, by, gather(whole, first), &model) == OKID_OK) return true;
    }
    return begin_again(whole, model, first);
}

bool live_blocks::begin_again(okid_accumulator_t* whole, const okid_identified_t& model, std::int32_t first) {
    jackknife_ = again_;
    return okid_jackknife_begin(again_, window() ? together(whole, first) : whole, &model) == OKID_OK;
}

okid_accumulator_t* live_blocks::gather(okid_accumulator_t* whole, std::int32_t first) {
    return first > 0 ? together(whole, first) : whole;
}

/// The slots of a window from one on, together.
okid_accumulator_t* live_blocks::together(okid_accumulator_t* whole, std::int32_t first) {
    okid_accumulator_t* all = parts_[0].sums;
    okid_accumulator_reset(all);
    check_statistics(okid_accumulator_take_slots(all, whole, first, okid_accumulator_slots(whole) - first));
    return all;
}

std::optional<deviations> live_blocks::sigma(okid_accumulator_t* whole, okid_identify_t* by,
                                             const okid_identified_t& model, const mass_plan& plan,
                                             std::int32_t first) {
    if (!begin(whole, by, model, plan.wanted(), first)) return std::nullopt;
    std::unique_ptr<replicate_statistics> with_mass;
    if (plan.wanted()) with_mass = std::make_unique<replicate_statistics>(n_u_, n_y_, most_states_, plan, dt_);
    replicate_statistics& statistics = with_mass ? *with_mass : *modes_;
    const auto without_each = [&] {
        most_of_one_ = 0;
        statistics.begin(model_view(model));
        if (window())
            delete_slots(whole, first, statistics);
        else
            delete_parts(whole, statistics);
        return statistics.finish();
    };
    deviations out = without_each();
    if (jackknife_ == linear_ && linear_ && most_of_one_ > most_of_one_block) {
        if (!begin_again(whole, model, first)) return std::nullopt;
        out = without_each();
    }
    if (out.replicates < fewest_blocks) return std::nullopt;
    return out;
}

} // namespace okid_host
