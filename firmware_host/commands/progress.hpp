// SPDX-License-Identifier: MIT
// What a long command is doing, on one line of a terminal; silent for short work and when stderr is no terminal.
#pragma once
#include <condition_variable>
#include <mutex>
#include <string>
#include <thread>

namespace okid_host {

class progress {
  public:
    explicit progress(bool wanted);
    ~progress();
    progress(const progress&) = delete;
    progress& operator=(const progress&) = delete;

    /// The work that begins now.
    void stage(const std::string& text);

  private:
    void show();

    std::mutex mutex_;
    std::condition_variable wake_;
    std::string text_;
    bool done_ = false, shown_ = false;
    std::thread thread_;
};

} // namespace okid_host
