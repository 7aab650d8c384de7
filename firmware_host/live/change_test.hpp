// SPDX-License-Identifier: MIT
// The change test beside the frequency alarm: the first `test_s` of a stream are the baseline, each further `test_s` are
// tested against it (okid/change.h). No update, model or track takes part in it.
#pragma once
#include "blocks.hpp"
#include "config/config.hpp"
#include "stream_config.hpp"

#include <okid/change.h>

#include <cstdint>
#include <memory>
#include <nlohmann/json.hpp>
#include <vector>

namespace okid_host {

class change_test {
  public:
    /// Throws `failure` (exit 2) when its blocks need more than max_memory_mb.
    change_test(const live_config& config, const stream_config& stream);

    void add(const double* row); ///< raw numbers of the grid
    void add_missing(std::int64_t count);
    /// What was tested since the last call, as events.
    std::vector<nlohmann::ordered_json> take() { return std::exchange(events_, {}); }
    bool standing() const { return standing_; } ///< the newest test was an alarm

  private:
    void pass(std::int64_t samples);
    void flush();
    void end_block();
    void end_test();
    nlohmann::ordered_json modes(bool tested) const;

    double rate_hz_;
    std::size_t m_;
    std::vector<double> scale_, offset_, rows_, scratch_;
    std::int64_t block_; ///< samples
    std::int64_t samples_ = 0, in_block_ = 0;
    int blocks_ = 0;
    owned_sums sums_;
    std::unique_ptr<std::byte[]> memory_;
    okid_change_t* test_ = nullptr;
    std::vector<nlohmann::ordered_json> events_;
    bool standing_ = false;
};

} // namespace okid_host
