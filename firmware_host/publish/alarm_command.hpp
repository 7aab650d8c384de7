// SPDX-License-Identifier: MIT
// [alarm] command: a program that is run at an alarm, with the alarm as JSON on its standard input. One at a time; it is
// ended after a while, and the run does not wait for it.
#pragma once
#include "publication.hpp"

#include <chrono>
#include <optional>
#include <sys/types.h>

namespace okid_host {

class alarm_command : public event_sink {
  public:
    static constexpr double limit_s = 10;

    /// Throws `failure` (exit 2) when the program cannot be run.
    explicit alarm_command(const std::string& path);
    void take(const publication& one) override;
    void tick() override;
    bool finished() override;

  private:
    void start(const std::string& text);

    std::string path_;
    pid_t child_ = 0; ///< 0 = none
    bool ended_ = false;
    std::chrono::steady_clock::time_point started_;
    std::shared_ptr<const std::string> waiting_; ///< the newest alarm that came meanwhile
};

} // namespace okid_host
