// SPDX-License-Identifier: MIT
#include "line_reader.hpp"

#include "error.hpp"
#include "files/input_file.hpp"
#include "foreign_table.hpp"

#include <cerrno>
#include <cstring>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

namespace okid_host {
namespace {

constexpr std::size_t read_bytes = std::size_t{1} << 22;   // 4 MiB a read
constexpr std::size_t longest_line = std::size_t{1} << 26; // 64 MiB: beyond this it is no CSV

} // namespace

line_reader::line_reader(std::string path) : path_(std::move(path)) {
    if (path_.empty()) throw failure(exit_usage, "the name of the record is empty, expected a CSV file");
    fd_ = open_input(path_, "a CSV file");
    struct stat status{};
    if (fstat(fd_, &status) == 0 && S_ISREG(status.st_mode)) size_ = static_cast<std::size_t>(status.st_size);
    try {
        const bool small = size_ > 0 && size_ < read_bytes;
        buffer_.resize(small ? size_ + 1 : read_bytes); // with one byte more the end is seen without growing
        fill();
        if (end_ == 0) throw failure(exit_usage, fmt::format("{}: the file is empty", path_));
        check_first_bytes();
    } catch (...) {
        close(fd_);
        throw;
    }
}

line_reader::~line_reader() { close(fd_); }

void line_reader::check_first_bytes() {
    const auto starts = [&](const char* bytes, std::size_t n) {
        return end_ >= n && std::memcmp(buffer_.data(), bytes, n) == 0;
    };
    if (starts("\xEF\xBB\xBF", 3)) begin_ = searched_ = 3;
    if (starts("\xFF\xFE", 2) || starts("\xFE\xFF", 2))
        throw foreign_table(exit_usage,
                            fmt::format("{}: is UTF-16 text, expected UTF-8: save it as \"CSV UTF-8\"", path_));
    if (starts("\x1F\x8B", 2) || starts("PK\x03\x04", 4))
        throw failure(exit_usage, fmt::format("{}: is a compressed file or a spreadsheet, expected CSV text", path_));
    const std::size_t look = end_ < 4096 ? end_ : 4096;
    if (const void* zero = std::memchr(buffer_.data(), 0, look))
        throw failure(exit_usage, fmt::format("{}: byte 0x00 at position {}: this is not a text file, expected a CSV",
                                              path_, static_cast<const char*>(zero) - buffer_.data() + 1));
}

bool line_reader::fill() {
    if (at_end_) return false;
    if (begin_ > 0) {
        std::memmove(buffer_.data(), buffer_.data() + begin_, end_ - begin_);
        end_ -= begin_;
        searched_ -= begin_;
        begin_ = 0;
    }
    if (end_ == buffer_.size()) {
        if (end_ >= longest_line)
            throw failure(exit_usage,
                          fmt::format("{}, line {}: longer than 64 MiB, expected rows of a CSV", path_, number_ + 1));
        buffer_.resize(buffer_.size() * 2);
    }
    ssize_t got = 0;
    do got = read(fd_, buffer_.data() + end_, buffer_.size() - end_);
    while (got < 0 && errno == EINTR);
    if (got < 0) throw failure(exit_usage, fmt::format("{}: cannot be read: {}", path_, std::strerror(errno)));
    at_end_ = got == 0;
    end_ += static_cast<std::size_t>(got);
    bytes_ += static_cast<std::size_t>(got);
    return got > 0;
}

bool line_reader::next(std::string_view& line) {
    for (;;) {
        const char* data = buffer_.data();
        const auto* newline = static_cast<const char*>(std::memchr(data + searched_, '\n', end_ - searched_));
        if (newline || at_end_) {
            if (!newline && begin_ == end_) return false;
            const std::size_t stop = newline ? static_cast<std::size_t>(newline - data) : end_;
            line = std::string_view(data + begin_, stop - begin_);
            if (!line.empty() && line.back() == '\r') line.remove_suffix(1);
            begin_ = searched_ = newline ? stop + 1 : end_;
            ++number_;
            return true;
        }
        searched_ = end_;
        fill();
    }
}

bool line_reader::next_lines(std::string_view& lines) {
    for (;;) {
        const std::string_view there(buffer_.data() + begin_, end_ - begin_);
        const std::size_t last = there.rfind('\n');
        if (last != std::string_view::npos || (at_end_ && !there.empty())) {
            lines = there.substr(0, last == std::string_view::npos ? there.size() : last + 1);
            begin_ = searched_ = begin_ + lines.size();
            return true;
        }
        if (at_end_) return false;
        searched_ = end_;
        fill();
    }
}

} // namespace okid_host
