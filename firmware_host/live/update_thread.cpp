// SPDX-License-Identifier: MIT
// PURPOSE  updates on a thread of their own
// METHOD   a queue of pieces of at most `rows_at_once` rows; an update ends its piece, so it comes where it stands in the stream
#include "update_thread.hpp"

#include "acquire/threads.hpp"

#include <algorithm>
#include <utility>

namespace okid_host {
namespace {

constexpr std::size_t rows_at_once = 256;

} // namespace

update_thread::update_thread(update_maker& maker, bool beside, std::size_t width, std::size_t most)
    : maker_(maker), beside_(beside), width_(width), most_(most) {
    if (beside_) thread_ = quiet_thread([this] { run(); });
}

update_thread::~update_thread() { stop(true); }

void update_thread::add(const double* row) {
    if (!beside_) return maker_.add(row);
    open_.rows.insert(open_.rows.end(), row, row + width_);
    if (open_.rows.size() >= std::min(rows_at_once * width_, most_ / 4)) hand_over();
}

void update_thread::add_missing(std::int64_t count) {
    if (!beside_) return maker_.add_missing(count);
    open_.missing = count;
    hand_over();
}

void update_thread::update(std::int64_t samples) {
    if (!beside_) return reports_.push_back(maker_.update(samples, {0, hurry_, false}));
    open_.update = samples;
    hand_over();
}

void update_thread::hurry(bool on) {
    const std::lock_guard<std::mutex> lock(mutex_);
    hurry_ = on;
}

void update_thread::hand_over() {
    std::unique_lock<std::mutex> lock(mutex_);
    changed_.wait(lock, [this] { return numbers_ < most_ || error_; });
    numbers_ += open_.rows.size();
    if (open_.update >= 0) newest_ = open_.update;
    waiting_.push_back(std::exchange(open_, work{}));
    changed_.notify_all();
}

void update_thread::do_work(const work& one, const update_maker::haste& how) {
    for (std::size_t at = 0; at < one.rows.size(); at += width_) maker_.add(one.rows.data() + at);
    if (one.missing >= 0) maker_.add_missing(one.missing);
    if (one.update < 0) return;
    update_report report = maker_.update(one.update, how);
    const std::lock_guard<std::mutex> lock(mutex_);
    reports_.push_back(std::move(report));
}

void update_thread::run() {
    std::unique_lock<std::mutex> lock(mutex_);
    for (;;) {
        changed_.wait(lock, [this] { return !waiting_.empty() || ending_; });
        if (waiting_.empty() || leaving_) return;
        const work one = std::move(waiting_.front());
        waiting_.pop_front();
        const update_maker::haste how{newest_ - one.update, hurry_, numbers_ > most_ / 2};
        lock.unlock();
        try {
            do_work(one, how);
            lock.lock();
        } catch (...) {
            lock.lock();
            error_ = std::current_exception();
            changed_.notify_all();
            return;
        }
        numbers_ -= one.rows.size();
        changed_.notify_all();
    }
}

void update_thread::stop(bool leave) {
    {
        const std::lock_guard<std::mutex> lock(mutex_);
        ending_ = true;
        leaving_ = leave;
        changed_.notify_all();
    }
    if (thread_.joinable()) thread_.join();
}

std::vector<update_report> update_thread::take() {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (error_) std::rethrow_exception(error_);
    return std::exchange(reports_, {});
}

std::vector<update_report> update_thread::finish() {
    if (beside_) {
        hand_over();
        stop(false);
    }
    return take();
}

} // namespace okid_host
