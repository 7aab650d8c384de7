// SPDX-License-Identifier: MIT
// What an update of a session computes: identify, follow the modes, look for those that left their baseline. Nothing is
// published here: a report says what to publish, so that updates may be made on a thread of their own.
#pragma once
#include "alarm.hpp"
#include "change_test.hpp"
#include "publish/terminal_table.hpp"
#include "stream.hpp"

#include <cstdint>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <vector>

namespace okid_host {

struct update_report {
    std::int64_t samples = 0;                           ///< of the stream, when it was due
    enum { none, made, skipped, given_up } fate = none; ///< none: not due, or too few samples; given_up: an obliged one
    bool behind = false;                                ///< newer updates were waiting already
    std::vector<nlohmann::ordered_json> events;         ///< in their order
    std::optional<table_state> table;
    bool settled = false, alarm = false;
    double took_s = 0;
};

class update_maker {
  public:
    explicit update_maker(const live_config& config);

    stream& sums() { return stream_; }
    void add(const double* row) {
        stream_.sums().add(row);
        if (change_test_) change_test_->add(row);
    }
    void add_missing(std::int64_t count) {
        stream_.sums().add_missing(count);
        if (change_test_) change_test_->add_missing(count);
    }

    /// How urgent it is to finish an update.
    struct haste {
        std::int64_t ahead = 0; ///< samples that wait behind it, up to the newest update
        bool hurry = false;     ///< only what is obliged
        bool give_up = false;   ///< not even that
    };
    update_report update(std::int64_t samples, const haste& how);

  private:
    void make(std::int64_t samples, update_report& out);
    void follow(const stream_update& found, update_report& out);
    void tell_modes(const deviations* sigma, std::int64_t since, update_report& out);
    void tell_alarm(update_report& out) const;
    double seconds(std::int64_t samples) const { return static_cast<double>(samples) / rate_hz_; }

    double rate_hz_;
    bool always_; ///< a hammer test: an update for each hit
    stream stream_;
    alarm_watch alarm_;
    std::unique_ptr<change_test> change_test_; ///< where [alarm] test_s asks for it
    std::vector<observed_mode> observed_;      ///< of the newest update
    bool settled_ = false;
    int steps_ = 1; ///< since the last update that was made
};

} // namespace okid_host
