// SPDX-License-Identifier: MIT
#include "line_writer.hpp"

#include "acquire/stop_signal.hpp"
#include "error.hpp"
#include "service_notice.hpp"

#include <cerrno>
#include <chrono>
#include <cstdio>
#include <cstring>
#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>
#include <utility>

namespace okid_host {
namespace {

constexpr std::size_t most_lines = 4096, most_bytes = 32u << 20;

int open_file(const std::string& path, int how) {
    return open(path.c_str(), O_WRONLY | O_CREAT | O_CLOEXEC | how, 0666);
}

} // namespace

line_writer::line_writer(std::string what, const std::string& path, bool patient)
    : what_(std::move(what)), path_(path), patient_(patient), reopened_(reopen_requests()) {
    fd_ = path == "-" ? STDOUT_FILENO : open_file(path, service_notice::wanted() ? O_APPEND : O_TRUNC);
    if (fd_ < 0) throw failure(exit_usage, fmt::format("{}: cannot be written: {}", what_, std::strerror(errno)));
    thread_ = std::thread([this] { run(); });
}

line_writer::~line_writer() {
    stop();
    if (fd_ >= 0 && fd_ != STDOUT_FILENO) close(fd_);
}

void line_writer::check() const {
    if (!error_.empty()) throw failure(exit_device, error_);
}

void line_writer::put(std::shared_ptr<const std::string> line) {
    std::unique_lock<std::mutex> lock(mutex_);
    const auto full = [&] {
        return !lines_.empty() && (lines_.size() >= most_lines || bytes_ + line->size() > most_bytes);
    };
    if (patient_) changed_.wait(lock, [&] { return !full() || !error_.empty(); });
    check();
    while (full()) {
        bytes_ -= lines_.front()->size();
        lines_.pop_front();
        ++lost_;
    }
    bytes_ += line->size();
    lines_.push_back(std::move(line));
    changed_.notify_all();
}

void line_writer::stop() {
    {
        const std::lock_guard<std::mutex> lock(mutex_);
        ending_ = true;
        changed_.notify_all();
    }
    if (thread_.joinable()) thread_.join();
}

void line_writer::finish() {
    stop();
    check();
}

void line_writer::run() {
    std::unique_lock<std::mutex> lock(mutex_);
    for (;;) {
        changed_.wait_for(lock, std::chrono::milliseconds(200), [&] { return !lines_.empty() || ending_; });
        if (lines_.empty() && ending_) return;
        const std::uint64_t lost = lines_.empty() ? 0 : std::exchange(lost_, 0); // reported with the next line
        const std::shared_ptr<const std::string> line = lines_.empty() ? nullptr : lines_.front();
        if (line) {
            bytes_ -= line->size();
            lines_.pop_front();
            changed_.notify_all();
        }
        const bool broken = !error_.empty();
        lock.unlock();
        reopen();
        const bool counted = !broken && (lost == 0 || write(fmt::format("{{\"type\":\"lost\",\"count\":{}}}\n", lost)));
        if (counted && line) (void)write(*line);
        lock.lock();
        if (!counted && line) lost_ += lost; // and the line itself was counted by give_up()
    }
}

/// A line that was cut ends before the next one begins.
bool line_writer::write(const std::string& line) {
    const std::string text = torn_ ? "\n" + line : line;
    for (std::size_t done = 0; done < text.size();) {
        const ssize_t count = ::write(fd_, text.data() + done, text.size() - done);
        if (count < 0 && errno == EINTR) continue;
        if (count < 0 && errno == EAGAIN) { // someone made stdout non-blocking
            std::this_thread::sleep_for(std::chrono::milliseconds(5));
            continue;
        }
        if (count <= 0) {
            torn_ = done > 0 || torn_;
            give_up(std::strerror(count < 0 ? errno : EIO));
            return false;
        }
        done += static_cast<std::size_t>(count);
    }
    torn_ = false;
    return true;
}

/// A replay ends; a measurement goes on, and tries again with the next line.
void line_writer::give_up(const char* why) {
    const std::string text = fmt::format("{}: cannot be written: {}", what_, why);
    if (!patient_ && !std::exchange(reported_, true)) say("okid: {}; the run goes on, these lines are lost\n", text);
    const std::lock_guard<std::mutex> lock(mutex_);
    ++lost_;
    if (patient_) error_ = text;
    changed_.notify_all();
}

/// After SIGHUP: the file of the name, whatever became of the one before.
void line_writer::reopen() {
    const int requests = reopen_requests();
    if (requests == reopened_ || fd_ == STDOUT_FILENO) return;
    reopened_ = requests;
    const int fresh = open_file(path_, O_APPEND);
    if (fresh < 0) {
        say("okid: {}: cannot be opened again, going on with the old file: {}\n", what_, std::strerror(errno));
        return;
    }
    close(fd_);
    fd_ = fresh;
}

} // namespace okid_host
