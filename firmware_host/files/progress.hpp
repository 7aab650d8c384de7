// SPDX-License-Identifier: MIT
// PURPOSE  what a long command does and how long it goes on, on stderr; nothing for what takes less than 2 s
// METHOD   a terminal has one line that is drawn again; anything else gets a line every 10 s. A thread writes: a stage that reports
//          nothing for a minute is seen to go on. tools/okid/data/progress.py is the same for Python
#pragma once
#include <chrono>
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
    /// The same work, in other words.
    void reword(const std::string& text);
    /// How much of it is done, 0 to 1; below 0 = not known.
    void share(double done);

  private:
    using clock = std::chrono::steady_clock;
    void show();

    std::mutex mutex_;
    std::condition_variable wake_;
    std::string text_ = "working";
    clock::time_point since_ = clock::now(); ///< of the stage
    double share_ = -1;
    bool terminal_, done_ = false, shown_ = false;
    std::thread thread_;
};

} // namespace okid_host
