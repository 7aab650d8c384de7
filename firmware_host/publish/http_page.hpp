// SPDX-License-Identifier: MIT
// One page over HTTP/1.1, for any client: GET and HEAD, one answer a connection. On the thread of the publisher;
// a peer that is slow, silent or hostile costs 4 KiB for five seconds.
#pragma once
#include "config/config.hpp"

#include <chrono>
#include <functional>
#include <list>
#include <poll.h>
#include <string>
#include <vector>

namespace okid_host {

class http_page {
  public:
    static constexpr std::size_t most = 16, most_request = 4096;

    /// @param what  how messages name it; @param text  the page, made for each request
    /// Throws `failure` (exit 4) when the address cannot be listened on.
    http_page(const std::string& what, const net_address& at, std::string path, const char* type,
              std::function<std::string()> text);
    ~http_page();
    http_page(const http_page&) = delete;
    http_page& operator=(const http_page&) = delete;

    void add_polls(std::vector<pollfd>& polls) const;
    /// Does what can be done now, without waiting.
    void serve();

  private:
    using clock = std::chrono::steady_clock;
    struct visitor {
        int fd = -1;
        std::string request, answer;
        std::size_t sent = 0;
        clock::time_point until;
    };
    void welcome();
    bool attend(visitor& to) const;
    std::string answer_to(const std::string& request) const;
    bool meant_for_us(const std::string& request) const;

    std::string path_;
    const char* type_;
    bool loopback_, full_ = false;
    std::function<std::string()> text_;
    int fd_ = -1;
    std::list<visitor> all_;
};

} // namespace okid_host
