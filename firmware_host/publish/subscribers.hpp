// SPDX-License-Identifier: MIT
// Programs that listen on a unix socket: each gets the start event and then every event as a line. One that reads too slowly
// loses whole lines and gets their number; what it sends is never looked at.
#pragma once
#include "publication.hpp"

#include <cstdint>
#include <deque>
#include <list>

namespace okid_host {

class subscribers : public event_sink {
  public:
    static constexpr std::size_t most = 16, most_lines = 1024, most_bytes = 4u << 20; ///< the last two for each

    /// A socket file that no program listens on is replaced. Throws `failure`: exit 2 when the path cannot be a socket, exit 4
    /// when another program listens there.
    explicit subscribers(const std::string& path);
    ~subscribers() override;
    subscribers(const subscribers&) = delete;
    subscribers& operator=(const subscribers&) = delete;

    void take(const publication& one) override;
    void take_samples(const json_line& block) override;
    void add_polls(std::vector<pollfd>& polls) const override;
    void tick() override;
    bool finished() override;

  private:
    struct subscriber {
        int fd = -1;
        json_line now;        ///< on its way, never given up half-way
        std::size_t sent = 0; ///< of it
        std::deque<json_line> lines;
        std::size_t bytes = 0; ///< of those
        std::uint64_t lost = 0;
        bool idle() const { return !now && lines.empty(); }
    };
    void welcome();
    static void append(subscriber& to, const json_line& fresh);
    static bool send(subscriber& to);
    void send_all();

    std::string path_;
    int fd_ = -1;
    bool full_ = false; ///< no descriptor was left for the next one
    json_line start_;
    std::list<subscriber> all_;
};

} // namespace okid_host
