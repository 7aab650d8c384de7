// SPDX-License-Identifier: MIT
// PURPOSE  sums of a growing memory in blocks of time
// METHOD   blocks are the slots of a window; neighbours without a gap between them become one when most of them are full, and where
//          gaps leave too many short ones the oldest half is folded into one
#include "level_memory.hpp"

#include "error.hpp"

#include <algorithm>
#include <cmath>

namespace okid_host {
namespace {

constexpr int room =
    level_memory::most_blocks / 2; // slots beside: a block ends early at a gap, which the window counts as time

okid_accumulator_config_t base_config(int n_u, int n_y, int lags) {
    okid_accumulator_config_t out = okid_accumulator_defaults(n_u, n_y, lags);
    out.edges = 1;
    out.buffer = 1;
    return out;
}

okid_accumulator_config_t window_config(int n_u, int n_y, int lags, std::int64_t block) {
    okid_accumulator_config_t out = okid_accumulator_defaults(n_u, n_y, lags);
    out.block = static_cast<std::int32_t>(std::clamp<std::int64_t>(block, 2LL * lags, 1 << 24));
    out.slots = level_memory::most_blocks + room;
    return out;
}

void check(okid_status_t status) {
    if (status < 0) throw failure(exit_device, std::string("sums of older samples: ") + okid_status_text(status));
}

void put_sums(std::vector<std::byte>& to, okid_accumulator_t* sums) {
    const std::size_t bytes = okid_accumulator_serialised_size(sums), at = to.size() + word_bytes;
    put_word(to, bytes);
    to.resize(at + bytes);
    check(okid_accumulator_serialise(sums, to.data() + at, bytes));
}

/// Sums of the same channels and lags as `other` out of what put_sums() wrote; else none.
owned_sums sums_in(byte_reader& from, okid_accumulator_t* other) {
    okid_accumulator_config_t found{}, like{};
    okid_accumulator_config(other, &like);
    const std::uint64_t bytes = from.word();
    const std::byte* const sums = from.bytes(bytes);
    if (!sums || okid_accumulator_peek(sums, bytes, &found) != OKID_OK || found.n_u != like.n_u ||
        found.n_y != like.n_y || found.lags != like.lags || found.sample != like.sample || found.slots != like.slots ||
        found.spare_slots != like.spare_slots || found.edges != like.edges || found.forgetting != like.forgetting)
        return {};
    found.buffer = like.buffer;
    owned_sums out(found);
    if (out.sums && okid_accumulator_deserialise(out.sums, sums, bytes) != OKID_OK) out.sums = nullptr;
    return out;
}

} // namespace

double level_memory::bytes(int n_u, int n_y, int lags) {
    const okid_accumulator_config_t window = window_config(n_u, n_y, lags, 1), base = base_config(n_u, n_y, lags);
    return static_cast<double>(okid_accumulator_memsize(&window)) +
           static_cast<double>(okid_accumulator_memsize(&base));
}

level_memory::level_memory(int n_u, int n_y, int lags, std::int64_t block)
    : m_(static_cast<std::size_t>(n_u + n_y)), lags_(lags), newest_(window_config(n_u, n_y, lags, block)),
      base_(base_config(n_u, n_y, lags)) {
    if (!newest_.sums || !base_.sums) throw failure(exit_device, "out of memory for the sums of method auto");
}

void level_memory::add(const double* row) {
    double check_nan = 0;
    for (std::size_t c = 0; c < m_; ++c) check_nan += row[c] * 0.0;
    if (check_nan != 0) return gap(); // NaN
    check(okid_accumulator_add(newest_.sums, row, 1));
    ++samples_;
    make_room();
}

void level_memory::gap() {
    okid_accumulator_gap(newest_.sums, 0);
    make_room();
}

void level_memory::silence() {
    const std::vector<double> zeros(m_);
    for (int k = 0; k < lags_; ++k) check(okid_accumulator_add(newest_.sums, zeros.data(), 1));
}

void level_memory::make_room() {
    const auto closed = [this] { return okid_accumulator_slots(newest_.sums) - 1; };
    if (closed() < most_blocks) return;
    const bool paired = okid_accumulator_pair_slots(newest_.sums) >= 0;
    const std::int32_t oldest = closed() / 2;
    if (paired && closed() <= most_blocks - room / 2) return;
    check(okid_accumulator_take_slots(base_.sums, newest_.sums, 0, oldest));
    check(okid_accumulator_drop_slots(newest_.sums, oldest));
}

void level_memory::merge(const level_memory& other) {
    if (!other.take(base_.sums)) throw failure(exit_usage, "the state is of other channels");
    samples_ += other.samples_;
}

level_memory level_memory::without_outputs(const std::vector<bool>& kept) const {
    const auto n_u = static_cast<std::int32_t>(m_ - kept.size());
    std::vector<std::int32_t> channels;
    for (std::int32_t c = 0; c < static_cast<std::int32_t>(m_); ++c)
        if (c < n_u || kept[static_cast<std::size_t>(c - n_u)]) channels.push_back(c);
    okid_accumulator_config_t window{};
    okid_accumulator_config(newest_.sums, &window);
    level_memory out(n_u, static_cast<int>(channels.size()) - n_u, lags_, window.block);
    check(okid_accumulator_take_channels(out.newest_.sums, newest_.sums, channels.data()));
    check(okid_accumulator_take_channels(out.base_.sums, base_.sums, channels.data()));
    out.samples_ = samples_;
    return out;
}

double level_memory::rows_of_block() const {
    const double rows = static_cast<double>(okid_accumulator_rows(newest_.sums) + okid_accumulator_rows(base_.sums));
    return rows / static_cast<double>(std::max<std::size_t>(1, blocks()));
}

std::size_t level_memory::blocks() const {
    return static_cast<std::size_t>(okid_accumulator_slots(newest_.sums)) + (has_base() ? 1 : 0);
}

bool level_memory::take_block(std::size_t k, okid_accumulator_t* to) const {
    if (has_base() && k == 0) return okid_accumulator_merge(to, base_.sums) >= 0;
    return okid_accumulator_take_slots(to, newest_.sums, static_cast<std::int32_t>(k) - (has_base() ? 1 : 0), 1) >= 0;
}

bool level_memory::take(okid_accumulator_t* to) const {
    return okid_accumulator_take_slots(to, newest_.sums, 0, okid_accumulator_slots(newest_.sums)) >= 0 &&
           (!has_base() || okid_accumulator_merge(to, base_.sums) >= 0);
}

std::vector<std::byte> level_memory::state() const {
    std::vector<std::byte> out;
    put_word(out, static_cast<std::uint64_t>(samples_));
    put_sums(out, newest_.sums);
    put_sums(out, base_.sums);
    return out;
}

bool level_memory::put_back(byte_reader& from) {
    const auto samples = static_cast<long long>(from.word());
    owned_sums newest = sums_in(from, newest_.sums), base = sums_in(from, base_.sums);
    if (!newest.sums || !base.sums || samples < 0) return false;
    samples_ = samples;
    newest_ = std::move(newest);
    base_ = std::move(base);
    return true;
}

} // namespace okid_host
