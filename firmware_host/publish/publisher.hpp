// SPDX-License-Identifier: MIT
// From a session to files, terminals, sockets and programs. The session hands over and goes on: it never waits for any of
// them, but for a file in a replay, which is there to be complete.
#pragma once
#include "config/config.hpp"
#include "line_writer.hpp"
#include "metrics.hpp"
#include "publication.hpp"
#include "terminal_table.hpp"

#include <atomic>
#include <condition_variable>
#include <cstdint>
#include <deque>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

namespace okid_host {

struct publisher_options {
    std::string events;                               ///< file, "-" = stdout, "" = none
    bool show_table = false;                          ///< on stdout
    bool live = false;                                ///< the clock does not wait: what is behind loses events instead
    std::function<void(const std::string&)> listener; ///< gets every event as a line, on the thread of event()
};

class publisher {
  public:
    /// Opens everything. Throws `failure`.
    publisher(const live_config& config, const publisher_options& options);
    ~publisher();
    publisher(const publisher&) = delete;
    publisher& operator=(const publisher&) = delete;

    /// @param wall_s  time of the event as seconds since 1970. Throws `failure` (exit 4) when the events file is broken
    void event(nlohmann::ordered_json event, double wall_s);
    /// A block of the signals, for subscribers of the unix socket.
    void samples(json_line block);
    void table(const table_state& state);
    void update_took(double seconds);
    void update_skipped() { ++skipped_; }
    /// To sinks and screens alarms and what happened only; the file of --events gets everything.
    void only_urgent(bool on) { only_urgent_ = on; }
    /// The session lives; for the watchdog.
    void beat() { beats_.fetch_add(1, std::memory_order_relaxed); }

    /// Everything that is to arrive has arrived, or had its time. Throws as event().
    void finish();
    bool events_on_stdout() const { return options_.events == "-"; }
    /// Does anything that is handed over have a receiver? stdout may be /dev/null.
    bool watched() const { return events_ || lines_ || terminal_ || !sinks_.empty() || options_.listener; }

  private:
    static constexpr std::size_t most_waiting = 1024;
    void hand_over(publication one);
    void open_sinks(const live_config& config);
    void run();
    void wait_for_work();
    void take_all();
    void draw();
    void wake() const;
    void stop();
    publisher_figures figures() const;

    publisher_options options_;
    bool only_urgent_ = false;
    std::unique_ptr<line_writer> events_, lines_; ///< lines_: the table where there is no terminal
    std::unique_ptr<terminal_table> terminal_;
    std::vector<std::unique_ptr<event_sink>> sinks_;
    std::atomic<std::uint64_t> beats_{0}, updates_{0}, skipped_{0}, dropped_{0};
    std::atomic<double> update_s_{0}, worst_s_{0};

    mutable std::mutex mutex_;
    std::condition_variable room_;
    std::deque<publication> waiting_;
    std::optional<table_state> to_draw_;
    bool ending_ = false;
    double drawn_at_ = 0;
    int wake_fd_ = -1;
    std::thread thread_;
};

} // namespace okid_host
