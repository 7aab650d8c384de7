// SPDX-License-Identifier: MIT
// Lines of a file of any size, read in large pieces; a pipe is as good as a file.
#pragma once
#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

namespace okid_host {

class line_reader {
  public:
    /// Opens the file. Throws `failure` (exit 2) when it is missing, a directory, unreadable or evidently not UTF-8 text.
    explicit line_reader(std::string path);
    ~line_reader();
    line_reader(const line_reader&) = delete;
    line_reader& operator=(const line_reader&) = delete;

    /// The next line without its end (LF or CR LF), valid until the next call; false at the end of the file.
    bool next(std::string_view& line);

    /// Whole lines, as many as were read at once, valid until the next call; false at the end of the file. number() does
    /// not count them.
    bool next_lines(std::string_view& lines);

    std::size_t number() const { return number_; } ///< of the line given last, from 1
    std::size_t bytes() const { return bytes_; }   ///< read so far
    std::size_t size() const { return size_; }     ///< of the file, 0 for a pipe

  private:
    bool fill();
    void check_first_bytes();

    std::string path_;
    int fd_ = -1;
    std::vector<char> buffer_;
    std::size_t begin_ = 0, end_ = 0, searched_ = 0, number_ = 0, bytes_ = 0, size_ = 0;
    bool at_end_ = false;
};

} // namespace okid_host
