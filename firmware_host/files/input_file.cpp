// SPDX-License-Identifier: MIT
#include "input_file.hpp"

#include "error.hpp"

#include <array>
#include <cerrno>
#include <cstring>
#include <drv/input_file.h>
#include <fmt/format.h>
#include <unistd.h>

namespace okid_host {

int open_input(const std::string& path, const char* expected) {
    const int fd = drv_input_open(path.c_str());
    if (fd >= 0) return fd;
    if (fd == -EISDIR) throw failure(exit_usage, fmt::format("{}: is a folder, expected {}", path, expected));
    throw failure(exit_usage, fmt::format("{}: cannot be read: {}", path, drv_input_fault(fd)));
}

std::string read_input(const std::string& path, const char* expected, std::size_t most) {
    const int fd = open_input(path, expected);
    std::string text;
    std::array<char, 65536> bytes{};
    ssize_t got = 0;
    while ((got = read(fd, bytes.data(), bytes.size())) > 0 || (got < 0 && errno == EINTR)) {
        if (got > 0) text.append(bytes.data(), static_cast<std::size_t>(got));
        if (text.size() > most) break;
    }
    const int reason = errno;
    close(fd);
    if (got < 0) throw failure(exit_usage, fmt::format("{}: cannot be read: {}", path, std::strerror(reason)));
    if (text.size() > most)
        throw failure(exit_usage, fmt::format("{}: longer than {} bytes, expected {}", path, most, expected));
    return text;
}

} // namespace okid_host
