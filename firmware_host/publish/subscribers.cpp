// SPDX-License-Identifier: MIT
#include "subscribers.hpp"

#include "error.hpp"
#include "files/nearest_name.hpp"
#include "next_visitor.hpp"

#include <array>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <fcntl.h>
#include <fmt/format.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <sys/un.h>
#include <unistd.h>

namespace okid_host {
namespace {

[[noreturn]] void refuse(int code, const std::string& path, const std::string& text) {
    throw failure(code, fmt::format("[publish] socket {}: {}", printable(path), text));
}

sockaddr_un address_of(const std::string& path) {
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    std::strncpy(address.sun_path, path.c_str(), sizeof address.sun_path - 1);
    return address;
}

/// Never in the place of a file that came there meanwhile, where the file system can tell.
bool rename_alone(const std::string& from, const std::string& to) {
    constexpr unsigned no_replace = 1; // RENAME_NOREPLACE; the call is younger than glibc 2.17
    if (syscall(SYS_renameat2, AT_FDCWD, from.c_str(), AT_FDCWD, to.c_str(), no_replace) == 0) return true;
    return (errno == ENOSYS || errno == EINVAL) && rename(from.c_str(), to.c_str()) == 0;
}

/// Out of the way with what a program that died left behind.
void remove_stale(const std::string& path) {
    struct stat found{};
    if (lstat(path.c_str(), &found) != 0) return;
    if (!S_ISSOCK(found.st_mode)) refuse(exit_usage, path, "found another file there, expected a socket or nothing");
    const int probe = socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
    const sockaddr_un address = address_of(path);
    const int result = connect(probe, reinterpret_cast<const sockaddr*>(&address), sizeof address);
    const int why = errno;
    close(probe);
    if (result == 0 || why != ECONNREFUSED)
        refuse(exit_device, path,
               result == 0 || why == EAGAIN ? "another program listens there; end it or choose another path"
                                            : std::strerror(why));
    unlink(path.c_str());
}

} // namespace

subscribers::subscribers(const std::string& path) : path_(path) {
    remove_stale(path);
    // Who waits for the file may connect at once: it gets its name when it is listened to. A name as long as its own fits too.
    std::string before = path;
    before.back() = before.back() == '~' ? '-' : '~';
    const sockaddr_un address = address_of(before);
    remove_stale(before);
    fd_ = socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
    const bool bound = fd_ >= 0 && bind(fd_, reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0;
    const bool named = bound && chmod(before.c_str(), 0660) == 0 && listen(fd_, static_cast<int>(most)) == 0 &&
                       rename_alone(before, path);
    const int why = errno;
    if (named) return;
    if (bound) unlink(before.c_str());
    if (fd_ >= 0) close(fd_);
    refuse(exit_usage, path, fmt::format("cannot be made: {}", std::strerror(why)));
}

subscribers::~subscribers() {
    for (const subscriber& each : all_) close(each.fd);
    close(fd_);
    unlink(path_.c_str());
}

void subscribers::append(subscriber& to, const json_line& fresh) {
    while (!to.lines.empty() && (to.lines.size() >= most_lines || to.bytes + fresh->size() > most_bytes)) {
        to.bytes -= to.lines.front()->size();
        to.lines.pop_front();
        ++to.lost;
    }
    to.bytes += fresh->size();
    to.lines.push_back(fresh);
}

void subscribers::take(const publication& one) {
    if (one.type == "start") start_ = one.line;
    for (subscriber& each : all_) append(each, one.line);
    send_all();
}

/// Signals never push an event out: who is behind goes without them.
void subscribers::take_samples(const json_line& block) {
    for (subscriber& each : all_)
        if (each.lines.size() < most_lines / 2 && each.bytes + block->size() < most_bytes / 2)
            append(each, block);
        else
            ++each.lost;
    send_all();
}

void subscribers::welcome() {
    for (int fd; (fd = next_visitor(fd_)) >= 0;) {
        if (all_.size() >= most) {
            close(fd);
            continue;
        }
        subscriber& fresh = all_.emplace_back();
        fresh.fd = fd;
        if (start_) append(fresh, start_);
    }
    full_ = errno != EAGAIN && errno != EWOULDBLOCK; // out of descriptors: the next tick looks again
}

/// As much as it takes now. @return false: it is gone
bool subscribers::send(subscriber& to) {
    while (!to.idle()) {
        if (!to.now && to.lost > 0) {
            to.now = std::make_shared<const std::string>(
                fmt::format("{{\"type\":\"lost\",\"count\":{}}}\n", std::exchange(to.lost, 0)));
        } else if (!to.now) {
            to.now = std::move(to.lines.front());
            to.lines.pop_front();
            to.bytes -= to.now->size();
        }
        const ssize_t count =
            ::send(to.fd, to.now->data() + to.sent, to.now->size() - to.sent, MSG_NOSIGNAL | MSG_DONTWAIT);
        if (count < 0 && errno == EINTR) continue;
        if (count < 0) return errno == EAGAIN || errno == EWOULDBLOCK;
        to.sent += static_cast<std::size_t>(count);
        if (to.sent < to.now->size()) continue;
        to.now = nullptr;
        to.sent = 0;
    }
    return true;
}

void subscribers::send_all() {
    std::array<char, 16384> unread{};
    for (auto each = all_.begin(); each != all_.end();) {
        (void)recv(each->fd, unread.data(), unread.size(), MSG_DONTWAIT); // what it sends is discarded
        pollfd gone{each->fd, 0, 0};                                      // only poll shows that an idle one hung up
        if (send(*each) && !(poll(&gone, 1, 0) > 0 && (gone.revents & (POLLHUP | POLLERR)))) {
            ++each;
            continue;
        }
        close(each->fd);
        each = all_.erase(each);
    }
}

void subscribers::add_polls(std::vector<pollfd>& polls) const {
    polls.push_back({fd_, static_cast<short>(full_ ? 0 : POLLIN), 0});
    for (const subscriber& each : all_) polls.push_back({each.fd, static_cast<short>(each.idle() ? 0 : POLLOUT), 0});
}

void subscribers::tick() {
    welcome();
    send_all();
}

bool subscribers::finished() {
    send_all();
    for (const subscriber& each : all_)
        if (!each.idle()) return false;
    return true;
}

} // namespace okid_host
