// SPDX-License-Identifier: MIT
// PURPOSE  the correlation sums of a stream as bytes, and sums of other streams added to them
// METHOD   "OKIDREF\n", uint64 bytes of all, double whiteness, uint64 length of the filter and its doubles, then the bytes of
//          okid_correlation_serialise(), which end with a CRC-32; little endian
#include "sum_refiner.hpp"

#include "error.hpp"
#include "files/byte_state.hpp"

#include <algorithm>
#include <cstring>
#include <fmt/format.h>

namespace okid_host {
namespace {

constexpr char sums_magic[] = "OKIDREF\n";
constexpr std::size_t word = word_bytes, fixed_words = 4; // magic, bytes, whiteness, length of the filter
constexpr std::size_t most_taps = 41;
constexpr std::int32_t most_pieces = 4096; // of the library

[[noreturn]] void damaged() { throw failure(exit_usage, "the state is damaged: its sums of a refinement are cut off"); }

} // namespace

std::vector<std::byte> sum_refiner::state() {
    const std::size_t bytes = okid_correlation_serialised_size(sums_.sums);
    std::vector<std::byte> out;
    for (std::size_t k = 0; k < word; ++k) out.push_back(static_cast<std::byte>(sums_magic[k]));
    put_word(out, word * (fixed_words + filter_.size()) + bytes);
    put_number(out, whiteness_);
    put_word(out, filter_.size());
    for (const double x : filter_) put_number(out, x);
    const std::size_t at = out.size();
    out.resize(at + bytes);
    check_statistics(okid_correlation_serialise(sums_.sums, out.data() + at, bytes));
    return out;
}

std::size_t sum_refiner::bytes_in(const void* state, std::size_t bytes) {
    if (bytes < word * fixed_words || std::memcmp(state, sums_magic, word) != 0) return 0;
    const std::uint64_t own = byte_reader(static_cast<const std::byte*>(state) + word, word).word();
    if (own > bytes) damaged();
    return static_cast<std::size_t>(own);
}

sum_refiner::carried sum_refiner::read(const void* state, std::size_t bytes) const {
    byte_reader in(state, bytes);
    in.bytes(2 * word); // magic, bytes of all
    carried out;
    out.whiteness = in.number();
    const std::uint64_t taps = in.word();
    if (taps < 1 || taps > most_taps) damaged();
    for (std::size_t k = 0; k < taps; ++k) out.filter.push_back(in.number());
    if (in.failed()) damaged();
    const std::size_t size = in.left();
    const std::byte* const sums = in.bytes(size);
    okid_correlation_config_t found{};
    if (const okid_status_t status = okid_correlation_peek(sums, size, &found); status != OKID_OK)
        throw failure(exit_usage, fmt::format("the state is damaged: {}", okid_status_text(status)));
    const bool units = found.sample == OKID_SAMPLE_DOUBLE, codes = taps == 1 && found.sample == config_.sample;
    if (found.n_u != config_.n_u || found.n_y != config_.n_y || !(units || codes) || found.block != config_.block ||
        found.lags > config_.lags || found.own_lags != config_.own_lags)
        throw failure(exit_usage,
                      fmt::format("the state has sums for a refinement of {} inputs and {} outputs to {} lags, in "
                                  "slots of {} samples; expected {} and {}, at most {} lags, {}",
                                  found.n_u, found.n_y, found.lags, found.block, config_.n_u, config_.n_y, config_.lags,
                                  config_.block));
    out.sums = owned_correlation(found);
    okid_status_t status = okid_correlation_create(&out.sums.sums, &found, out.sums.block.get(), out.sums.bytes);
    if (status == OKID_OK) status = okid_correlation_deserialise(out.sums.sums, sums, size);
    if (status != OKID_OK) throw failure(exit_usage, fmt::format("the state is damaged: {}", okid_status_text(status)));
    return out;
}

/// The sums of another stream instead of the own ones.
void sum_refiner::take_in(carried&& other) {
    okid_correlation_config_t config{};
    okid_correlation_config(other.sums.sums, &config);
    sums_ = std::move(other.sums);
    filter_ = std::move(other.filter);
    whiteness_ = other.whiteness;
    in_units_ = filter_.size() > 1 || config.sample != config_.sample;
    given_lags_ = config.lags;
    config_.slots = config.slots;
}

void sum_refiner::put_back(const void* state, std::size_t bytes) {
    carried from = read(state, bytes);
    waiting_.clear();
    gaps_.clear();
    past_.clear();
    take_in(std::move(from));
}

void sum_refiner::merge(const void* state, std::size_t bytes) {
    carried from = read(state, bytes);
    if (!sums_) {
        take_in(std::move(from));
        sum_waiting();
        return;
    }
    okid_correlation_config_t own{}, other{};
    okid_correlation_config(sums_.sums, &own);
    okid_correlation_config(from.sums.sums, &other);
    if (own.lags != other.lags || filter_ != from.filter || own.sample != other.sample)
        throw failure(exit_usage,
                      fmt::format("the state has sums to {} lags behind a filter of order {}, these are to {} lags "
                                  "behind {} of order {}: expected those of streams that began with restore() of one "
                                  "state and reset(), which leaves lags and filter",
                                  other.lags, from.filter.size() - 1, own.lags,
                                  filter_.size() == from.filter.size() ? "another one" : "one", filter_.size() - 1));
    gap();
    okid_status_t status = okid_correlation_merge(sums_.sums, from.sums.sums);
    for (; status == OKID_ERR_RANGE && own.slots < most_pieces;
         status = okid_correlation_merge(sums_.sums, from.sums.sums)) {
        own.slots = std::min(2 * own.slots, most_pieces);
        owned_correlation larger(own);
        check_statistics(okid_correlation_create(&larger.sums, &own, larger.block.get(), larger.bytes));
        if (!in_units_) okid_correlation_set_units(larger.sums, scale_.data());
        check_statistics(okid_correlation_merge(larger.sums, sums_.sums));
        sums_ = std::move(larger);
        config_.slots = own.slots;
    }
    if (status == OKID_ERR_RANGE)
        throw failure(exit_usage,
                      fmt::format("the sums of a refinement are of {} unbroken pieces at most", most_pieces));
    check_statistics(status);
}

} // namespace okid_host
