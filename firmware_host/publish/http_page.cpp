// SPDX-License-Identifier: MIT
#include "http_page.hpp"

#include "error.hpp"
#include "next_visitor.hpp"

#include <algorithm>
#include <arpa/inet.h>
#include <array>
#include <cerrno>
#include <cstring>
#include <netdb.h>
#include <sys/socket.h>
#include <unistd.h>

namespace okid_host {
namespace {

constexpr auto patience = std::chrono::seconds(5);

/// @return the listening socket, or -errno
int listen_at(const net_address& at) {
    addrinfo hints{}, *found = nullptr;
    hints.ai_socktype = SOCK_STREAM;
    hints.ai_flags = AI_NUMERICSERV | AI_NUMERICHOST | AI_PASSIVE;
    if (getaddrinfo(at.host.c_str(), std::to_string(at.port).c_str(), &hints, &found) != 0) return -EADDRNOTAVAIL;
    const int fd = socket(found->ai_family, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0), on = 1;
    int code = fd < 0 ? errno : 0;
    if (fd >= 0) (void)setsockopt(fd, SOL_SOCKET, SO_REUSEADDR, &on, sizeof on);
    if (!code && (bind(fd, found->ai_addr, found->ai_addrlen) != 0 || listen(fd, 16) != 0)) code = errno;
    freeaddrinfo(found);
    if (code && fd >= 0) close(fd);
    return code ? -code : fd;
}

std::string response(const char* status, const char* type, const std::string& body, bool with_body,
                     const char* more = "") {
    return fmt::format("HTTP/1.1 {}\r\nContent-Type: {}\r\nContent-Length: {}\r\nConnection: close\r\n{}\r\n{}", status,
                       type, body.size(), more, with_body ? body : "");
}

} // namespace

http_page::http_page(const std::string& what, const net_address& at, std::string path, const char* type,
                     std::function<std::string()> text)
    : path_(std::move(path)), type_(type), loopback_(at.loopback()), text_(std::move(text)), fd_(listen_at(at)) {
    if (fd_ < 0)
        throw failure(exit_device, fmt::format("{} {}: cannot listen there ({}); is the port taken, and is the address "
                                               "one of this computer?",
                                               what, at.text(), std::strerror(-fd_)));
}

http_page::~http_page() {
    for (const visitor& each : all_) close(each.fd);
    close(fd_);
}

void http_page::add_polls(std::vector<pollfd>& polls) const {
    polls.push_back({fd_, static_cast<short>(full_ ? 0 : POLLIN), 0});
    for (const visitor& each : all_)
        polls.push_back({each.fd, static_cast<short>(each.sent < each.answer.size() ? POLLOUT : POLLIN), 0});
}

/// The oldest makes room.
void http_page::welcome() {
    for (int fd; (fd = next_visitor(fd_)) >= 0;) {
        if (all_.size() == most) {
            close(all_.front().fd);
            all_.pop_front();
        }
        visitor& fresh = all_.emplace_back();
        fresh.fd = fd;
        fresh.until = clock::now() + patience;
    }
    full_ = errno != EAGAIN &&
            errno != EWOULDBLOCK; // out of descriptors: the next tick looks again, without a busy loop until then
}

/// A page of another site whose name was turned to this address (DNS rebinding) sends that name: an address is not one.
bool http_page::meant_for_us(const std::string& request) const {
    constexpr std::string_view key = "\nhost:";
    const auto lower = [](char c) { return c >= 'A' && c <= 'Z' ? static_cast<char>(c + 32) : c; };
    std::string text;
    std::transform(request.begin(), request.end(), std::back_inserter(text), lower);
    const std::size_t at = text.find(key);
    if (at == std::string::npos) return true; // no browser
    if (text.find(key, at + 1) != std::string::npos) return false;
    std::string host = text.substr(at + key.size(), text.find_first_of("\r\n", at + key.size()) - at - key.size());
    host.erase(0, host.find_first_not_of(" \t"));
    host.erase(host.find_last_not_of(" \t") + 1);
    if (!host.empty() && host.front() == '[')
        host = host.substr(1, host.find(']') - 1);
    else
        host.resize(std::min(host.size(), host.find(':')));
    std::array<unsigned char, 16> bytes{};
    return host == "localhost" || inet_pton(AF_INET, host.c_str(), bytes.data()) == 1 ||
           inet_pton(AF_INET6, host.c_str(), bytes.data()) == 1 || (!loopback_ && !host.empty());
}

std::string http_page::answer_to(const std::string& request) const {
    constexpr const char* plain = "text/plain; charset=utf-8";
    const std::size_t method_end = request.find(' '), target_end = request.find_first_of(" ?\r", method_end + 1);
    if (method_end == std::string::npos || target_end == std::string::npos)
        return response("400 Bad Request", plain, "not HTTP\n", true);
    const std::string method = request.substr(0, method_end);
    const std::string target = request.substr(method_end + 1, target_end - method_end - 1);
    const bool get = method == "GET";
    if (!get && method != "HEAD")
        return response("405 Method Not Allowed", plain, "GET or HEAD\n", true, "Allow: GET, HEAD\r\n");
    if (!meant_for_us(request)) return response("403 Forbidden", plain, "this name does not belong to okid\n", get);
    if (target != path_) return response("404 Not Found", plain, fmt::format("there is only {}\n", path_), get);
    return response("200 OK", type_, text_(), get);
}

/// @return false: done with it
bool http_page::attend(visitor& to) const {
    if (clock::now() > to.until) return false;
    std::array<char, 2048> bytes{};
    for (ssize_t got; (got = recv(to.fd, bytes.data(), bytes.size(), 0)) != 0;) {
        if (got < 0 && errno == EINTR) continue;
        if (got < 0 && (errno == EAGAIN || errno == EWOULDBLOCK)) break;
        if (got < 0) return false;
        if (!to.answer.empty()) return true; // what comes behind the request is passed over, a piece each time
        to.request.append(bytes.data(), static_cast<std::size_t>(got));
        if (to.request.find("\r\n\r\n") != std::string::npos || to.request.find("\n\n") != std::string::npos)
            to.answer = answer_to(to.request);
        else if (to.request.size() > most_request)
            to.answer = response("431 Request Header Fields Too Large", "text/plain", "too long\n", true);
        else
            continue;
        break;
    }
    while (to.sent < to.answer.size()) {
        const ssize_t count = send(to.fd, to.answer.data() + to.sent, to.answer.size() - to.sent, MSG_NOSIGNAL);
        if (count < 0 && errno == EINTR) continue;
        if (count < 0) return errno == EAGAIN || errno == EWOULDBLOCK;
        to.sent += static_cast<std::size_t>(count);
        if (to.sent == to.answer.size()) (void)shutdown(to.fd, SHUT_WR); // it closes, or its time runs out
    }
    char next = 0;
    const ssize_t left = recv(to.fd, &next, 1, MSG_PEEK);
    return left > 0 || (left < 0 && (errno == EAGAIN || errno == EWOULDBLOCK));
}

void http_page::serve() {
    welcome();
    for (auto each = all_.begin(); each != all_.end();) {
        if (attend(*each)) {
            ++each;
            continue;
        }
        close(each->fd);
        each = all_.erase(each);
    }
}

} // namespace okid_host
