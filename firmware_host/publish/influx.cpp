// SPDX-License-Identifier: MIT
// PURPOSE  lines of influx_lines to where they are wanted
// METHOD   file: line_writer. UDP: one datagram an event, cut between lines below 1400 bytes. HTTP: what has gathered is one POST at a
//          time on a non-blocking socket; lines wait in 1 MB, the oldest go first; no answer or status 5xx: again after 2 s.
#include "influx.hpp"

#include "acquire/host_time.hpp"
#include "broker.hpp"
#include "config/secrets.hpp"
#include "error.hpp"
#include "files/nearest_name.hpp"
#include "influx_lines.hpp"
#include "line_writer.hpp"
#include "peer.hpp"

#include <cerrno>
#include <cstring>
#include <fmt/format.h>
#include <unistd.h>

namespace okid_host {
namespace {

class influx_file : public event_sink {
  public:
    influx_file(const live_config& config, bool live)
        : lines_(topic_level(config)),
          out_("[publish] influx " + config.publish.influx->file, config.publish.influx->file, !live) {}
    void take(const publication& one) override {
        if (std::string text = lines_.take(one); !text.empty() && well_) try {
                out_.put(std::make_shared<const std::string>(std::move(text)));
            } catch (const failure& fault) {
                well_ = false;
                say("okid: {}; the run goes on without it\n", fault.what());
            }
    }

  private:
    influx_lines lines_;
    line_writer out_;
    bool well_ = true;
};

class influx_datagrams : public event_sink {
  public:
    explicit influx_datagrams(const live_config& config)
        : lines_(topic_level(config)), fd_(open_datagrams("[publish] influx", config.publish.influx->at)) {}
    ~influx_datagrams() override { close(fd_); }
    influx_datagrams(const influx_datagrams&) = delete;
    influx_datagrams& operator=(const influx_datagrams&) = delete;

    void take(const publication& one) override {
        constexpr std::size_t most = 1400; // one packet of an Ethernet
        const std::string text = lines_.take(one);
        for (std::size_t first = 0; first < text.size();) {
            std::size_t end = text.size();
            if (end - first > most) end = text.rfind('\n', first + most) + 1;
            if (end <= first) end = text.find('\n', first) + 1; // a line longer than that goes alone
            (void)!send(fd_, text.data() + first, end - first, MSG_DONTWAIT | MSG_NOSIGNAL);
            first = end;
        }
    }

  private:
    influx_lines lines_;
    int fd_;
};

class influx_post : public event_sink {
  public:
    explicit influx_post(const live_config& config)
        : lines_(topic_level(config)), to_(*config.publish.influx),
          there_(find_peer("[publish] influx", to_.at, SOCK_STREAM)) {
        if (!to_.token_file.empty())
            authorization_ = "Authorization: Token " + read_password(to_.token_file, config.path) + "\r\n";
    }
    ~influx_post() override { hang_up(); }
    influx_post(const influx_post&) = delete;
    influx_post& operator=(const influx_post&) = delete;

    void take(const publication& one) override {
        waiting_ += lines_.take(one);
        if (waiting_.size() <= most_waiting) return;
        waiting_.erase(0, waiting_.find('\n', waiting_.size() - most_waiting) + 1);
        complain("lines are lost: it is away or too slow");
    }
    void add_polls(std::vector<pollfd>& polls) const override {
        if (fd_ >= 0) polls.push_back({fd_, static_cast<short>(sent_ < request_.size() ? POLLOUT : POLLIN), 0});
    }
    void tick() override {
        if (fd_ < 0 && !(batch_.empty() && waiting_.empty()) && steady_s() >= not_before_) dial();
        if (fd_ >= 0 && sent_ < request_.size()) send_on();
        if (fd_ >= 0 && sent_ == request_.size()) read_on();
        if (fd_ >= 0 && steady_s() > give_up_at_) again("no answer");
    }
    bool finished() override {
        tick();
        return batch_.empty() && waiting_.empty();
    }

  private:
    static constexpr std::size_t most_waiting = 1 << 20;
    static constexpr double patience_s = 5, retry_s = 2;

    void dial() {
        if (batch_.empty()) batch_.swap(waiting_);
        request_ = fmt::format("POST {} HTTP/1.1\r\nHost: {}\r\n{}Content-Type: text/plain; charset=utf-8\r\n"
                               "Content-Length: {}\r\nConnection: close\r\n\r\n{}",
                               to_.path, to_.at.text(), authorization_, batch_.size(), batch_);
        answer_.clear();
        sent_ = 0;
        give_up_at_ = steady_s() + patience_s;
        fd_ = there_.connect_to(SOCK_STREAM);
        if (fd_ < 0) again(std::strerror(-fd_));
    }
    void send_on() {
        const ssize_t put = send(fd_, request_.data() + sent_, request_.size() - sent_, MSG_DONTWAIT | MSG_NOSIGNAL);
        if (put > 0) sent_ += static_cast<std::size_t>(put);
        if (put < 0 && errno != EAGAIN && errno != EINTR && errno != ENOTCONN) again(std::strerror(errno));
    }
    /// Only the first line of the answer counts.
    void read_on() {
        char bytes[512];
        const ssize_t got = recv(fd_, bytes, sizeof bytes, MSG_DONTWAIT);
        if (got < 0 && (errno == EAGAIN || errno == EINTR)) return;
        if (got < 0) return again(std::strerror(errno));
        answer_.append(bytes, static_cast<std::size_t>(got));
        const std::size_t end = answer_.find("\r\n");
        if (end == std::string::npos && got > 0 && answer_.size() < sizeof bytes) return;
        const std::string line = answer_.substr(0, std::min<std::size_t>(end, 80));
        const char kind = line.rfind("HTTP/1.", 0) == 0 && line.size() > 9 ? line[9] : '?';
        if (kind != '2' && kind != '4') return again(("it answered " + printable(line)).c_str());
        if (kind == '4')
            complain(
                ("it refuses the lines: " + printable(line)).c_str()); // once more: the same would be refused again
        batch_.clear();
        hang_up();
    }
    void again(const char* why) {
        complain(why);
        hang_up();
        not_before_ = steady_s() + retry_s;
    }
    void hang_up() {
        if (fd_ >= 0) close(fd_);
        fd_ = -1;
    }
    /// Once is enough.
    void complain(const char* why) {
        if (reported_) return;
        reported_ = true;
        say("okid: [publish] influx {}: {}; the run goes on\n", to_.at.text(), why);
    }

    influx_lines lines_;
    influx_target to_;
    peer there_;
    std::string authorization_, waiting_, batch_, request_, answer_;
    std::size_t sent_ = 0;
    double give_up_at_ = 0, not_before_ = 0;
    int fd_ = -1;
    bool reported_ = false;
};

} // namespace

std::unique_ptr<event_sink> make_influx(const live_config& config, bool live) {
    const influx_target& to = *config.publish.influx;
    if (!to.file.empty()) return std::make_unique<influx_file>(config, live);
    if (to.path.empty()) return std::make_unique<influx_datagrams>(config);
    return std::make_unique<influx_post>(config);
}

} // namespace okid_host
