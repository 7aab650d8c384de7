// SPDX-License-Identifier: MIT
#include "progress.hpp"

#include "files/shown_text.hpp"
#include "files/signals_wait.hpp"

#include <chrono>
#include <cstdio>
#include <unistd.h>

namespace okid_host {

progress::progress(bool wanted) {
    const signals_wait the_main_thread_takes_them;
    if (wanted && isatty(STDERR_FILENO)) thread_ = std::thread([this] { show(); });
}

progress::~progress() {
    if (!thread_.joinable()) return;
    {
        const std::lock_guard<std::mutex> lock(mutex_);
        done_ = true;
    }
    wake_.notify_one();
    thread_.join();
    if (shown_) std::fprintf(stderr, "\r%78s\r", "");
}

void progress::stage(const std::string& text) {
    const std::lock_guard<std::mutex> lock(mutex_);
    text_ = one_line(text);
}

void progress::show() {
    std::unique_lock<std::mutex> lock(mutex_);
    const auto start = std::chrono::steady_clock::now();
    auto pause = std::chrono::milliseconds(2000);
    while (!wake_.wait_for(lock, pause, [this] { return done_; })) {
        const std::chrono::duration<double> elapsed = std::chrono::steady_clock::now() - start;
        std::fprintf(stderr, "\rokid: %-56.56s %6.0f s", text_.c_str(), elapsed.count());
        shown_ = true;
        pause = std::chrono::milliseconds(500);
    }
}

} // namespace okid_host
