// SPDX-License-Identifier: MIT
#include "broker.hpp"

#include "config/secrets.hpp"
#include "error.hpp"

#include <algorithm>
#include <fmt/format.h>

#ifdef OKID_MQTT
#include <array>
#include <atomic>
#include <cerrno>
#include <chrono>
#include <condition_variable>
#include <mosquitto.h>
#include <mutex>
#include <poll.h>
#include <set>
#include <sys/eventfd.h>
#include <sys/socket.h>
#include <thread>
#include <tuple>
#include <unistd.h>
#endif

namespace okid_host {

std::string topic_level(const live_config& config) {
    std::string out;
    for (const auto& [key, text] : config.notes) {
        if (key != "title") continue;
        for (const char c : text) {
            const bool plain = (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '-';
            if (plain)
                out += c;
            else if (!out.empty() && out.back() != '_')
                out += '_';
        }
    }
    while (!out.empty() && out.back() == '_') out.pop_back();
    return out.empty() ? "okid" : out.substr(0, 64);
}

#ifndef OKID_MQTT
std::unique_ptr<event_sink> make_broker(const live_config&) {
    throw failure(exit_usage, "[publish] mqtt: this okid was built without libmosquitto-dev");
}
#else
namespace {

/// What is announced of a mode to Home Assistant: two sensors that read the topic of the modes, in a device of the rig.
std::vector<std::pair<std::string, std::string>> discovery_of(const std::string& level, const std::string& modes_topic,
                                                              int track) {
    std::vector<std::pair<std::string, std::string>> out;
    for (const auto& [word, key, unit] :
         {std::tuple{"frequency", "frequency_hz", "Hz"}, {"damping", "damping_ratio", "%"}}) {
        const std::string object = fmt::format("mode{}_{}", track, word);
        const nlohmann::ordered_json config{
            {"name", fmt::format("mode {} {}", track, word)},
            {"unique_id", fmt::format("okid_{}_{}", level, object)},
            {"state_topic", modes_topic},
            {"value_template",
             fmt::format("{{{{ value_json.modes | selectattr('track', 'eq', {}) | map(attribute='{}') | "
                         "map('multiply', {}) | first | default(this.state) }}}}",
                         track, key, *unit == '%' ? 100 : 1)},
            {"unit_of_measurement", unit},
            {"state_class", "measurement"},
            {"device", {{"identifiers", {"okid_" + level}}, {"name", "okid " + level}}}};
        out.emplace_back(fmt::format("homeassistant/sensor/okid_{}/{}/config", level, object), config.dump());
    }
    return out;
}

constexpr int keepalive_s = 10;
constexpr std::chrono::seconds retry(2), farewell(1);

/// The connection, shared with the thread that keeps it up: that one may still look for the host's address when okid ends.
class connection {
  public:
    connection(const broker_address& to, const std::string& password)
        : to_(to), client_(mosquitto_new(nullptr, true, this)) {
        if (!client_) throw failure(exit_device, "[publish] mqtt: no memory for a client");
        (void)mosquitto_threaded_set(client_, true);
        if (!to.user.empty())
            (void)mosquitto_username_pw_set(client_, to.user.c_str(), password.empty() ? nullptr : password.c_str());
        (void)mosquitto_reconnect_delay_set(client_, retry.count(), retry.count(), false);
        mosquitto_connect_callback_set(client_, [](mosquitto*, void* self, int result) {
            if (result != 0) static_cast<connection*>(self)->complain(mosquitto_connack_string(result));
        });
        mosquitto_disconnect_callback_set(client_, [](mosquitto*, void* self, int result) {
            if (result != 0) static_cast<connection*>(self)->complain("the connection was lost");
        });
    }
    ~connection() {
        mosquitto_destroy(client_);
        if (wake_fd_ >= 0) close(wake_fd_);
    }
    connection(const connection&) = delete;
    connection& operator=(const connection&) = delete;

    void keep_up() {
        std::unique_lock<std::mutex> lock(mutex_);
        while (!ending_) {
            lock.unlock();
            const int result = mosquitto_connect_async(client_, to_.at.host.c_str(), to_.at.port, keepalive_s);
            greeted_ = result == MOSQ_ERR_SUCCESS;
            if (greeted_)
                converse();
            else
                complain(mosquitto_strerror(result));
            greeted_ = false;
            lock.lock();
            changed_.wait_for(lock, retry, [&] { return ending_; });
        }
        ended_ = true;
        changed_.notify_all();
    }
    /// @return its thread has ended
    bool end() {
        std::unique_lock<std::mutex> lock(mutex_);
        ending_ = true;
        changed_.notify_all();
        lock.unlock();
        (void)mosquitto_disconnect(client_);
        wake();
        lock.lock();
        return changed_.wait_for(lock, farewell, [&] { return ended_; });
    }
    mosquitto* client() const { return client_; }
    /// Lost where there is no connection. Between the library's socket and its CONNECT a PUBLISH would be the first packet of all.
    /// @return false: lost
    bool send(const std::string& topic, const char* text, std::size_t size, bool keep) {
        return greeted_ && mosquitto_publish(client_, nullptr, topic.c_str(), static_cast<int>(size), text, 0, keep) ==
                               MOSQ_ERR_SUCCESS;
    }
    /// There is something to send.
    void wake() const {
        const std::uint64_t one = 1;
        (void)!write(wake_fd_, &one, sizeof one);
    }

  private:
    enum class incoming { nothing, packet, torn, foreign };

    /// Until the connection ends. Nothing is subscribed to, so a broker has little to say: the library, which takes the room
    /// that a packet announces, is let at the socket only when a whole short packet waits there.
    void converse() {
        incoming waits = incoming::nothing;
        for (int result = MOSQ_ERR_SUCCESS; result == MOSQ_ERR_SUCCESS;) {
            const int fd = mosquitto_socket(client_);
            if (fd < 0) return;
            const bool torn = waits == incoming::torn; // the rest of it cannot be waited for by poll()
            const auto wanted = static_cast<short>((torn ? 0 : POLLIN) | (mosquitto_want_write(client_) ? POLLOUT : 0));
            std::array<pollfd, 2> polls{{{fd, wanted, 0}, {wake_fd_, POLLIN, 0}}};
            (void)poll(polls.data(), polls.size(), torn ? 20 : 1000);
            std::uint64_t count = 0;
            (void)!read(wake_fd_, &count, sizeof count);
            waits = look_at(fd);
            if (waits == incoming::foreign) {
                complain("the broker announced a packet that no publisher is sent; the connection was closed");
                (void)shutdown(fd, SHUT_RDWR);
                (void)mosquitto_disconnect(client_);
                return;
            }
            if (waits == incoming::packet) result = mosquitto_loop_read(client_, 1);
            if (result == MOSQ_ERR_SUCCESS && mosquitto_want_write(client_)) result = mosquitto_loop_write(client_, 1);
            if (result == MOSQ_ERR_SUCCESS) result = mosquitto_loop_misc(client_);
        }
    }

    /// MQTT: a byte of kind and flags, then the length, seven bits a byte. What a publisher is sent is below 128 bytes.
    static incoming look_at(int fd) {
        std::array<unsigned char, 130> bytes{};
        const ssize_t got = recv(fd, bytes.data(), bytes.size(), MSG_PEEK | MSG_DONTWAIT);
        if (got < 0 && (errno == EAGAIN || errno == EWOULDBLOCK || errno == ENOTCONN)) return incoming::nothing;
        if (got <= 0) return incoming::packet; // the end, or an error: the library's to find
        if (got >= 2 && bytes[1] >= 0x80) return incoming::foreign;
        return got >= 2 && got >= 2 + bytes[1] ? incoming::packet : incoming::torn;
    }

    /// Once is enough.
    void complain(const char* why) {
        if (reported_.exchange(true)) return;
        say("okid: [publish] mqtt {}: {}; trying again, the run goes on\n", to_.at.text(), why);
    }

    broker_address to_;
    mosquitto* client_;
    int wake_fd_ = eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK);
    std::atomic<bool> reported_{false}, greeted_{false}; ///< greeted: CONNECT is sent, or waits before all else
    std::mutex mutex_;
    std::condition_variable changed_;
    bool ending_ = false, ended_ = false;
};

class broker : public event_sink {
  public:
    explicit broker(const live_config& config)
        : level_(topic_level(config)), discovery_(config.publish.mqtt->discovery),
          topic_(config.publish.mqtt->prefix + "/" + level_) {
        mosquitto_lib_init();
        const broker_address& to = *config.publish.mqtt;
        link_ = std::make_shared<connection>(
            to, to.password_file.empty() ? to.password : read_password(to.password_file, config.path));
        thread_ = std::thread([link = link_] { link->keep_up(); });
    }
    ~broker() override {
        if (link_->end())
            thread_.join();
        else
            thread_.detach();
    }
    broker(const broker&) = delete;
    broker& operator=(const broker&) = delete;

    void take(const publication& one) override {
        const std::string topic = topic_ + "/" + one.type;
        const bool newest_counts = one.type == "modes" || one.type == "result";
        (void)link_->send(topic, one.line->data(), one.line->size() - 1, newest_counts);
        if (discovery_ && one.type == "modes") tell_of(*one.event, topic);
        link_->wake();
    }
    bool finished() override { return !mosquitto_want_write(link_->client()); }

  private:
    /// Each track once, with the first modes that find a connection; the broker keeps it.
    void tell_of(const nlohmann::ordered_json& event, const std::string& modes_topic) {
        for (const auto& mode : event.at("modes")) {
            if (!mode.at("track").is_number()) continue;
            const int track = mode.at("track").get<int>();
            if (announced_.count(track)) continue;
            bool sent = true;
            for (const auto& [topic, text] : discovery_of(level_, modes_topic, track))
                sent = link_->send(topic, text.data(), text.size(), true) && sent;
            if (sent) announced_.insert(track);
        }
    }

    std::string level_;
    bool discovery_;
    std::set<int> announced_;
    std::string topic_;
    std::shared_ptr<connection> link_;
    std::thread thread_;
};

} // namespace

std::unique_ptr<event_sink> make_broker(const live_config& config) { return std::make_unique<broker>(config); }
#endif

} // namespace okid_host
