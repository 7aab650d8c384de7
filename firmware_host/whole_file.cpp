// SPDX-License-Identifier: MIT
// A file appears under its final name complete or not at all: temporary beside it, fsync, rename.
#include "whole_file.hpp"

#include "error.hpp"
#include "result.hpp"

#include <cerrno>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

namespace okid_host {
namespace {

// Name of the temporary being written, for a signal handler; empty when there is none.
char unfinished[4096];
volatile std::sig_atomic_t writing = 0;

[[noreturn]] void cannot_write(const std::string& path, int reason) {
    throw failure(exit_usage, fmt::format("{}: cannot be written: {}", path, std::strerror(reason)));
}

/// All of the text, in as many writes as it takes; errno or 0.
int write_all(int fd, const std::string& text) {
    for (std::size_t at = 0; at < text.size();) {
        const ssize_t wrote = write(fd, text.data() + at, text.size() - at);
        if (wrote < 0 && errno != EINTR) return errno;
        if (wrote > 0) at += static_cast<std::size_t>(wrote);
    }
    return 0;
}

/// Devices and pipes have no other name to be renamed from.
void write_in_place(const std::string& path, const std::string& text) {
    const int fd = open(path.c_str(), O_WRONLY | O_CLOEXEC);
    if (fd < 0) cannot_write(path, errno);
    const int reason = write_all(fd, text);
    close(fd);
    if (reason) cannot_write(path, reason);
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

void write_whole_file(const std::string& path, const std::string& text) {
    if (path == "-") {
        if (std::fwrite(text.data(), 1, text.size(), stdout) != text.size() || std::fflush(stdout) != 0)
            cannot_write("stdout", errno);
        return;
    }
    if (path.empty()) throw failure(exit_usage, "the name of a file to write is empty");
    struct stat status{};
    const bool exists = stat(path.c_str(), &status) == 0;
    if (exists && S_ISDIR(status.st_mode)) cannot_write(path, EISDIR);
    if (exists && !S_ISREG(status.st_mode)) return write_in_place(path, text);
    if (exists && access(path.c_str(), W_OK) != 0) cannot_write(path, errno);
    const std::string target = resolved(path);
    std::string temporary = target + ".XXXXXX";
    const int fd = mkostemp(temporary.data(), O_CLOEXEC);
    if (fd < 0) cannot_write(path, errno);
    if (temporary.size() < sizeof unfinished) {
        std::memcpy(unfinished, temporary.c_str(), temporary.size() + 1);
        writing = 1;
    }
    const mode_t mask = umask(0);
    umask(mask);
    int reason = fchmod(fd, exists ? status.st_mode & 07777 : 0666 & ~mask) == 0 ? 0 : errno;
    if (!reason) reason = write_all(fd, text);
    if (!reason && fsync(fd) != 0 && errno != EINVAL) reason = errno;
    if (close(fd) != 0 && !reason) reason = errno;
    if (!reason && std::rename(temporary.c_str(), target.c_str()) != 0) reason = errno;
    writing = 0;
    if (!reason) return;
    unlink(temporary.c_str());
    cannot_write(path, reason);
}

} // namespace okid_host
