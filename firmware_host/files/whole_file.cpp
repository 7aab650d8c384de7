// SPDX-License-Identifier: MIT
// A file appears under its final name complete or not at all: temporary beside it, fsync, rename.
#include "whole_file.hpp"

#include "error.hpp"
#include "signals_wait.hpp"

#include <cerrno>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <fcntl.h>
#include <filesystem>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>
#include <utility>

namespace okid_host {
namespace {

// Name of the temporary being written, for a signal handler; empty when there is none.
char unfinished[4096];
volatile std::sig_atomic_t writing = 0;

[[noreturn]] void cannot_write(const std::string& path, int reason) {
    throw failure(exit_usage, fmt::format("{}: cannot be written: {}", path, std::strerror(reason)));
}

constexpr std::size_t buffer_bytes = std::size_t{1} << 20;

/// A link that somebody else put into a folder where many may write: what it leads to is not meant.
bool planted_link(const std::string& path) {
    struct stat link{}, folder{};
    const std::string parent = std::filesystem::path(path).parent_path().string();
    return lstat(path.c_str(), &link) == 0 && S_ISLNK(link.st_mode) && link.st_uid != geteuid() &&
           stat(parent.empty() ? "." : parent.c_str(), &folder) == 0 && link.st_uid != folder.st_uid &&
           (folder.st_mode & (S_IWGRP | S_IWOTH));
}

/// The file a symbolic link leads to, so that the link stays.
std::string resolved(const std::string& path) {
    char* real = realpath(path.c_str(), nullptr);
    const std::string target = real ? real : path;
    std::free(real);
    return target;
}

} // namespace

void remove_unfinished_file() {
    if (writing) unlink(unfinished);
}

void check_writable(const std::string& path) {
    if (path == "-") return;
    struct stat status{};
    const std::size_t slash = path.find_last_of('/');
    const std::string folder = slash == std::string::npos ? "." : path.substr(0, slash + 1);
    if (path.empty()) throw failure(exit_usage, "the name of a file to write is empty");
    if (stat(path.c_str(), &status) == 0) {
        if (S_ISDIR(status.st_mode)) cannot_write(path, EISDIR);
        if (access(path.c_str(), W_OK) != 0) cannot_write(path, errno);
        if (!S_ISREG(status.st_mode)) return;
    }
    if (access(folder.c_str(), W_OK) != 0) cannot_write(path, errno);
}

void check_other_file(const std::string& target, const std::string& input) {
    std::error_code ignored;
    if (std::filesystem::equivalent(target, input, ignored))
        throw failure(exit_usage, fmt::format("{}: is a file to be read, a result does not overwrite it", target));
}

whole_file::whole_file(std::string path) : path_(std::move(path)) {
    if (path_ == "-") {
        fd_ = fcntl(STDOUT_FILENO, F_DUPFD_CLOEXEC, 3);
        if (fd_ < 0) cannot_write("stdout", errno);
        return;
    }
    if (path_.empty()) throw failure(exit_usage, "the name of a file to write is empty");
    if (planted_link(path_))
        throw failure(
            exit_usage,
            fmt::format(
                "{}: is a link of another user in a folder that everyone can write to, expected a file or nothing",
                path_));
    struct stat status{};
    const bool exists = stat(path_.c_str(), &status) == 0;
    if (exists && S_ISDIR(status.st_mode)) cannot_write(path_, EISDIR);
    if (exists && !S_ISREG(status.st_mode)) { // has no other name to be renamed from
        fd_ = open(path_.c_str(), O_WRONLY | O_CLOEXEC);
        if (fd_ < 0) cannot_write(path_, errno);
        return;
    }
    if (exists && access(path_.c_str(), W_OK) != 0) cannot_write(path_, errno);
    target_ = resolved(path_);
    temporary_ = target_ + ".XXXXXX";
    {
        const signals_wait until_it_is_known{SIGINT, SIGTERM};
        fd_ = mkostemp(temporary_.data(), O_CLOEXEC);
        if (fd_ < 0) cannot_write(path_, errno);
        if (temporary_.size() < sizeof unfinished) {
            std::memcpy(unfinished, temporary_.c_str(), temporary_.size() + 1);
            writing = 1;
        }
    }
    const mode_t mask = umask(0);
    umask(mask);
    if (fchmod(fd_, exists ? status.st_mode & 07777 : 0666 & ~mask) != 0) give_up(errno);
}

whole_file::~whole_file() {
    if (fd_ < 0) return;
    close(fd_);
    if (temporary_.empty()) return;
    unlink(temporary_.c_str());
    writing = 0;
}

void whole_file::give_up(int reason) {
    if (fd_ >= 0) close(fd_);
    fd_ = -1;
    if (!temporary_.empty()) unlink(temporary_.c_str());
    writing = 0;
    cannot_write(path_ == "-" ? "stdout" : path_, reason);
}

void whole_file::flush() {
    for (std::size_t at = 0; at < buffer_.size();) {
        const ssize_t wrote = write(fd_, buffer_.data() + at, buffer_.size() - at);
        if (wrote < 0 && errno == EPIPE && path_ == "-") break; // its reader is gone
        if (wrote < 0 && errno != EINTR) give_up(errno);
        if (wrote > 0) at += static_cast<std::size_t>(wrote);
    }
    buffer_.clear();
}

void whole_file::append(std::string_view bytes) {
    buffer_.append(bytes);
    if (buffer_.size() >= buffer_bytes) flush();
}

void whole_file::commit() {
    flush();
    if (!temporary_.empty() && fsync(fd_) != 0 && errno != EINVAL) give_up(errno);
    const int closed = close(std::exchange(fd_, -1));
    if (closed != 0) give_up(errno);
    if (!temporary_.empty() && std::rename(temporary_.c_str(), target_.c_str()) != 0) give_up(errno);
    writing = 0;
}

void write_whole_file(const std::string& path, const std::string& text) {
    if (path == "-") std::fflush(stdout); // what stands before it comes before it
    whole_file file(path);
    file.append(text);
    file.commit();
}

} // namespace okid_host
