// SPDX-License-Identifier: MIT
// Lines to a file or to stdout by a thread of their own: a disk, pipe or terminal that blocks holds up no other output.
#pragma once
#include <condition_variable>
#include <cstdint>
#include <deque>
#include <memory>
#include <mutex>
#include <string>
#include <thread>

namespace okid_host {

class line_writer {
  public:
    /// @param what   how messages name it, such as "--events run.jsonl"
    /// @param path   a file, created or emptied (by a service: gone on with); "-" = stdout
    /// @param patient  true: put() waits while the queue is full, and every line arrives; false: the oldest line is
    /// dropped,
    ///                 and so does one that cannot be written (the next one is tried again); a line
    ///                 {"type":"lost","count":n} stands in the place of those that did
    /// Throws `failure` (exit 2) when it cannot be opened.
    line_writer(std::string what, const std::string& path, bool patient);
    ~line_writer();
    line_writer(const line_writer&) = delete;
    line_writer& operator=(const line_writer&) = delete;

    /// Throws `failure` (exit 4) when a line before could not be written and it is patient.
    void put(std::shared_ptr<const std::string> line);
    /// Every line is written. Throws as put().
    void finish();

  private:
    void run();
    bool write(const std::string& line);
    void give_up(const char* why);
    void reopen();
    void stop();
    void check() const;

    std::string what_, path_;
    bool patient_;
    int fd_ = -1;
    int reopened_ = 0; ///< requests that were followed
    mutable std::mutex mutex_;
    std::condition_variable changed_;
    std::deque<std::shared_ptr<const std::string>> lines_;
    std::size_t bytes_ = 0;
    std::uint64_t lost_ = 0;
    bool ending_ = false;
    bool torn_ = false, reported_ = false; ///< of the thread: a line was cut; the trouble was reported
    std::string error_;
    std::thread thread_;
};

} // namespace okid_host
