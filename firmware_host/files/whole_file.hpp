// SPDX-License-Identifier: MIT
// A file appears under its final name complete or not at all.
#pragma once
#include <cstddef>
#include <string>
#include <string_view>

namespace okid_host {

/// Throws `failure` (exit 2) when `path` is a folder or its folder is missing or not writable.
void check_writable(const std::string& path);

/// Throws `failure` (exit 2) when the target is the same file as `input`, by whatever name.
void check_other_file(const std::string& target, const std::string& input);

/// One at a time. A device or a pipe is written in place, "-" is stdout.
class whole_file {
  public:
    /// Throws `failure` (exit 2) when it cannot be written; so do the others.
    explicit whole_file(std::string path);
    ~whole_file(); ///< without commit() nothing appears
    whole_file(const whole_file&) = delete;
    whole_file& operator=(const whole_file&) = delete;

    void append(std::string_view bytes);
    void commit();

  private:
    void flush();
    [[noreturn]] void give_up(int reason);

    std::string path_, target_, temporary_, buffer_;
    int fd_ = -1;
};

/// Write `text` to `path` through a temporary file and rename; "-" is stdout.
void write_whole_file(const std::string& path, const std::string& text);

/// For a signal handler: remove the temporary of a write in progress. Async-signal-safe.
void remove_unfinished_file();

} // namespace okid_host
