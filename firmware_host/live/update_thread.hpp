// SPDX-License-Identifier: MIT
// Mathematics beside the stream: rows of the grid and the places of the updates go into a queue, a thread sums and identifies
// in the order of the stream, reports come back. Threads that read, record, grid and publish never wait for it.
//
// An update that newer ones have caught up with is left out; one that the result depends on never (stream::obliged()). So
// the sums, and with them the result, are those of the stream, however late the thread is. Rows wait as long as one update
// takes. The bound: beyond half of `most_waiting` numbers obliged updates are left out, too; at the whole, add() waits.
#pragma once
#include "update_maker.hpp"

#include <condition_variable>
#include <cstdint>
#include <deque>
#include <exception>
#include <mutex>
#include <thread>
#include <vector>

namespace okid_host {

class update_thread {
  public:
    static constexpr std::size_t most_waiting = 8000000; ///< numbers, 64 MB

    /// @param beside  on a thread of its own; else everything happens at once
    /// @param width   numbers of a row
    /// @param most    numbers that may wait
    update_thread(update_maker& maker, bool beside, std::size_t width, std::size_t most = most_waiting);
    ~update_thread();
    update_thread(const update_thread&) = delete;
    update_thread& operator=(const update_thread&) = delete;

    void add(const double* row);
    void add_missing(std::int64_t count); ///< 0: another record begins
    void update(std::int64_t samples);
    void hurry(bool on); ///< too slow, or no output shows updates: only what the result depends on

    /// What was found since the last call. Throws what the sums threw.
    std::vector<update_report> take();
    /// Finish all that waits. The sums are the caller's from then on. Throws as take().
    std::vector<update_report> finish();

  private:
    struct work {
        std::vector<double> rows;
        std::int64_t missing = -1, update = -1; ///< behind the rows, -1 = none
    };
    void hand_over();
    void run();
    void stop(bool leave);
    void do_work(const work& one, const update_maker::haste& how);

    update_maker& maker_;
    bool beside_;
    std::size_t width_, most_;
    work open_;

    std::mutex mutex_;
    std::condition_variable changed_;
    std::deque<work> waiting_;
    std::size_t numbers_ = 0; ///< in waiting_, and in what is being done
    std::int64_t newest_ = 0; ///< update in waiting_
    bool hurry_ = false, ending_ = false, leaving_ = false;
    std::vector<update_report> reports_;
    std::exception_ptr error_;
    std::thread thread_;
};

} // namespace okid_host
