// SPDX-License-Identifier: MIT
// PURPOSE  has the structure changed, without an identification
// METHOD   sums of a twentieth of a test at a time, each from zero; what is missing shortens its block
#include "change_test.hpp"

#include "error.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <new>

namespace okid_host {
namespace {

using nlohmann::ordered_json;

constexpr int blocks_a_test = 20;
constexpr std::size_t tested_at_once = 256;

/// 160 unknowns, from 4 to 20 rows, and as many as the states need.
int test_rows_of(int wanted, int m, int n_y) {
    if (wanted > 0) return std::max(wanted, n_y == 1 ? 3 : 2);
    return std::max(std::clamp(160 / m, 4, 20), n_y < 3 ? 12 : 4);
}

} // namespace

change_test::change_test(const live_config& config, const stream_config& stream)
    : rate_hz_(config.rate_hz), m_(stream.channels()), scale_(stream.scale), offset_(stream.offset),
      block_(std::max<std::int64_t>(1, std::llround(config.alarm.test_s * config.rate_hz / blocks_a_test))) {
    const auto n_u = static_cast<std::int32_t>(stream.inputs.size()),
               n_y = static_cast<std::int32_t>(stream.outputs.size());
    const int rows = test_rows_of(config.alarm.test_rows, static_cast<int>(m_), n_y);
    okid_change_config_t c = okid_change_defaults(n_u, n_y, rows, rate_hz_);
    c.blocks = blocks_a_test;
    c.false_alarm = config.alarm.false_alarm;
    const std::size_t bytes = okid_change_memsize(&c);
    const double most = config.identification.max_memory_mb * 1e6;
    if (bytes > 0 && static_cast<double>(bytes) <= most) memory_.reset(new (std::nothrow) std::byte[bytes]);
    if (!memory_ || okid_change_create(&test_, &c, memory_.get(), bytes) != OKID_OK)
        throw failure(
            exit_usage,
            fmt::format("{}: [alarm] test_s: the test of {} channels with test_rows = {} needs {:.0f} MB, found "
                        "max_memory_mb = {:g}; lower test_rows or leave test_s out",
                        config.path, m_, rows, static_cast<double>(bytes) / 1e6, config.identification.max_memory_mb));
    okid_accumulator_config_t sums = okid_accumulator_defaults(n_u, n_y, 2 * rows - 1);
    sums.edges = 1; // gaps
    sums_ = owned_sums(sums);
    if (sums_.sums == nullptr) throw failure(exit_device, "[alarm] test_s: out of memory");
    scratch_.resize(m_ * m_ * 4 * static_cast<std::size_t>(rows * rows));
    rows_.reserve(tested_at_once * m_);
}

void change_test::add(const double* row) {
    for (std::size_t i = 0; i < m_; ++i) rows_.push_back(scale_[i] * row[i] + offset_[i]);
    if (rows_.size() == tested_at_once * m_ || in_block_ + 1 == block_) flush();
    pass(1);
}

void change_test::add_missing(std::int64_t count) {
    flush();
    okid_accumulator_gap(sums_.sums, count);
    pass(count);
}

void change_test::flush() {
    check_statistics(okid_accumulator_add(sums_.sums, rows_.data(), rows_.size() / m_));
    rows_.clear();
}

/// A block ends by time, whatever is missing in it.
void change_test::pass(std::int64_t samples) {
    samples_ += samples;
    in_block_ += samples;
    if (in_block_ < block_) return;
    in_block_ = 0;
    end_block();
}

void change_test::end_block() {
    if (okid_accumulator_rows(sums_.sums) > 0) check_statistics(okid_change_add(test_, sums_.sums, scratch_.data()));
    okid_accumulator_reset(sums_.sums);
    if (++blocks_ < blocks_a_test) return;
    blocks_ = 0;
    end_test();
}

ordered_json change_test::modes(bool tested) const {
    ordered_json out = ordered_json::array();
    okid_change_mode_t mode;
    for (int k = 0; okid_change_mode(test_, k, &mode) == OKID_OK; ++k)
        out.push_back({{"frequency_hz", mode.frequency_hz},
                       {"shift_percent", tested ? ordered_json(100 * mode.shift) : ordered_json(nullptr)},
                       {"sigma_percent",
                        std::isfinite(mode.sigma) && tested ? ordered_json(100 * mode.sigma) : ordered_json(nullptr)}});
    return out;
}

/// The first that gives a baseline is it; what cannot be tested says why.
void change_test::end_test() {
    const bool learning = okid_change_order(test_) == 0;
    okid_change_verdict_t found{};
    const okid_status_t status = learning ? okid_change_learn(test_) : okid_change_test(test_, &found);
    const bool tested = !learning && status == OKID_OK && std::isfinite(found.p_value);
    if (status == OKID_OK && !learning) standing_ = found.alarm != 0;
    std::string text;
    if (status < 0)
        text = fmt::format("{}: {}", learning ? "no baseline" : "no test", okid_status_text(status));
    else if (learning)
        text = fmt::format("baseline of {} states", okid_change_order(test_));
    else if (!tested)
        text = "too many blocks without samples for a test";
    else
        text = standing_ ? "the structure has changed" : "no change";
    events_.push_back({{"type", "change_test"},
                       {"t", static_cast<double>(samples_) / rate_hz_},
                       {"baseline", learning},
                       {"alarm", standing_},
                       {"p_value", tested ? ordered_json(found.p_value) : ordered_json(nullptr)},
                       {"statistic", tested ? ordered_json(found.statistic) : ordered_json(nullptr)},
                       {"modes", status < 0 ? ordered_json::array() : modes(!learning)},
                       {"text", text}});
}

} // namespace okid_host
