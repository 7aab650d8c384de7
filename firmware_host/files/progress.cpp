// SPDX-License-Identifier: MIT
#include "progress.hpp"

#include "shown_text.hpp"
#include "signals_wait.hpp"

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <fmt/format.h>
#include <unistd.h>

namespace okid_host {
namespace {

constexpr std::chrono::milliseconds shown_after{2000}, redrawn_after{500}, line_after{10000};
constexpr std::size_t width = 78;

double seconds_since(std::chrono::steady_clock::time_point begin) {
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
}

/// OKID_PROGRESS=0: as with --quiet, for whatever this process starts too.
bool asked_for() {
    const char* set = std::getenv("OKID_PROGRESS");
    return set == nullptr || std::strcmp(set, "0") != 0;
}

bool inside_a_letter(char c) { return (static_cast<unsigned char>(c) & 0xC0U) == 0x80U; }

/// At most `room` bytes, without the middle: the end of a path tells more than its begin. No letter is cut in two.
std::string fitted(const std::string& text, std::size_t room) {
    if (text.size() <= room) return text;
    std::size_t head = room / 3, tail = text.size() - (room - head - 2);
    while (head > 0 && inside_a_letter(text[head])) --head;
    while (tail < text.size() && inside_a_letter(text[tail])) ++tail;
    return text.substr(0, head) + ".." + text.substr(tail);
}

/// ", 40 %, 12 s left" after so many seconds of a stage; "": the share is not known.
std::string share_text(double share, double seconds) {
    if (!(share >= 0)) return "";
    share = std::min(share, 1.0);
    const double left = share > 0.05 ? seconds * (1 - share) / share : 0;
    return fmt::format(", {:.0f} %{}", 100 * share, left >= 1 ? fmt::format(", {:.0f} s left", left) : "");
}

} // namespace

progress::progress(bool wanted) : terminal_(isatty(STDERR_FILENO) == 1) {
    const signals_wait the_main_thread_takes_them;
    if (wanted && asked_for()) thread_ = std::thread([this] { show(); });
}

progress::~progress() {
    if (!thread_.joinable()) return;
    {
        const std::lock_guard<std::mutex> lock(mutex_);
        done_ = true;
    }
    wake_.notify_one();
    thread_.join();
    if (shown_ && terminal_) std::fprintf(stderr, "\r%*s\r", static_cast<int>(width), "");
}

void progress::stage(const std::string& text) {
    const std::lock_guard<std::mutex> lock(mutex_);
    text_ = one_line(text);
    since_ = clock::now();
    share_ = -1;
}

void progress::reword(const std::string& text) {
    const std::lock_guard<std::mutex> lock(mutex_);
    text_ = one_line(text);
}

void progress::share(double done) {
    const std::lock_guard<std::mutex> lock(mutex_);
    share_ = done;
}

void progress::show() {
    std::unique_lock<std::mutex> lock(mutex_);
    const auto start = clock::now();
    auto next = start + (terminal_ ? shown_after : line_after);
    while (!wake_.wait_until(lock, next, [this] { return done_; })) {
        const std::string head = fmt::format("okid: {:.0f} s, ", seconds_since(start));
        const std::string tail = share_text(share_, seconds_since(since_));
        if (terminal_)
            std::fprintf(stderr, "\r%-*s", static_cast<int>(width),
                         (head + fitted(text_, width - head.size() - tail.size()) + tail).c_str());
        else
            std::fprintf(stderr, "%s\n", (head + text_ + tail).c_str());
        shown_ = true;
        next += terminal_ ? redrawn_after : line_after;
    }
}

} // namespace okid_host
