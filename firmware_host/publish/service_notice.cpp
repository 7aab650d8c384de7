// SPDX-License-Identifier: MIT
#include "service_notice.hpp"

#include <cstddef>
#include <cstdlib>
#include <cstring>
#include <fmt/format.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

namespace okid_host {

void notify_service(const std::string& text) {
    const char* path = std::getenv("NOTIFY_SOCKET");
    sockaddr_un to{};
    if (!path || (path[0] != '/' && path[0] != '@') || std::strlen(path) >= sizeof to.sun_path) return;
    to.sun_family = AF_UNIX;
    std::strcpy(to.sun_path, path);
    const std::size_t length = offsetof(sockaddr_un, sun_path) + std::strlen(path);
    if (path[0] == '@') to.sun_path[0] = '\0'; // the abstract name space
    const int fd = socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0);
    if (fd < 0) return;
    (void)!sendto(fd, text.data(), text.size(), MSG_NOSIGNAL | MSG_DONTWAIT, reinterpret_cast<const sockaddr*>(&to),
                  static_cast<socklen_t>(length));
    close(fd);
}

bool service_notice::wanted() { return std::getenv("NOTIFY_SOCKET") != nullptr; }

service_notice::service_notice(const std::atomic<std::uint64_t>& beats)
    : beats_(beats), notified_(std::chrono::steady_clock::now()) {
    const char *limit = std::getenv("WATCHDOG_USEC"), *whom = std::getenv("WATCHDOG_PID");
    if (limit && (!whom || std::strtoll(whom, nullptr, 10) == getpid()))
        half_ = std::chrono::microseconds(std::strtoll(limit, nullptr, 10) / 2);
}

void service_notice::take(const publication& one) {
    if (one.type != "modes") return;
    std::string modes;
    std::size_t count = 0;
    for (const auto& each : one.event->at("modes"))
        if (count++ < 6) modes += fmt::format("{}{:.4g}", count > 1 ? ", " : " (", each.value("frequency_hz", 0.0));
    if (count > 0) modes += count > 6 ? ", … Hz)" : " Hz)";
    notify_service(fmt::format("STATUS=t {:.1f} s, {} modes{}, {}", one.event->value("t", 0.0), count, modes,
                               one.event->value("settled", false) ? "settled" : "settling"));
}

void service_notice::tick() {
    const auto now = std::chrono::steady_clock::now();
    const std::uint64_t beats = beats_.load(std::memory_order_relaxed);
    if (half_.count() <= 0 || now - notified_ < half_ || beats == seen_) return;
    notify_service("WATCHDOG=1");
    notified_ = now;
    seen_ = beats;
}

} // namespace okid_host
