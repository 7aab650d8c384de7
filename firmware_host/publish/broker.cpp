// SPDX-License-Identifier: MIT
#include "broker.hpp"

#include "error.hpp"

#include <algorithm>
#include <fmt/format.h>

#ifdef OKID_MQTT
#include <atomic>
#include <chrono>
#include <condition_variable>
#include <mosquitto.h>
#include <mutex>
#include <thread>
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

constexpr int keepalive_s = 10;
constexpr std::chrono::seconds retry(2), farewell(1);

/// The connection, shared with the thread that keeps it up: that one may still look for the host's address when okid ends.
class connection {
  public:
    explicit connection(const broker_address& to) : to_(to), client_(mosquitto_new(nullptr, true, this)) {
        if (!client_) throw failure(exit_device, "[publish] mqtt: no memory for a client");
        (void)mosquitto_threaded_set(client_, true);
        if (!to.user.empty())
            (void)mosquitto_username_pw_set(client_, to.user.c_str(),
                                            to.password.empty() ? nullptr : to.password.c_str());
        (void)mosquitto_reconnect_delay_set(client_, retry.count(), retry.count(), false);
        mosquitto_connect_callback_set(client_, [](mosquitto*, void* self, int result) {
            if (result != 0) static_cast<connection*>(self)->complain(mosquitto_connack_string(result));
        });
        mosquitto_disconnect_callback_set(client_, [](mosquitto*, void* self, int result) {
            if (result != 0) static_cast<connection*>(self)->complain("the connection was lost");
        });
    }
    ~connection() { mosquitto_destroy(client_); }
    connection(const connection&) = delete;
    connection& operator=(const connection&) = delete;

    void keep_up() {
        std::unique_lock<std::mutex> lock(mutex_);
        while (!ending_) {
            lock.unlock();
            const int result = mosquitto_connect_async(client_, to_.at.host.c_str(), to_.at.port, keepalive_s);
            if (result != MOSQ_ERR_SUCCESS)
                complain(mosquitto_strerror(result));
            else
                (void)mosquitto_loop_forever(client_, -1, 1); // comes back when it is hopeless, or at the end
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
        lock.lock();
        return changed_.wait_for(lock, farewell, [&] { return ended_; });
    }
    mosquitto* client() const { return client_; }

  private:
    /// Once is enough.
    void complain(const char* why) {
        if (told_.exchange(true)) return;
        say("okid: [publish] mqtt {}: {}; trying again, the run goes on\n", to_.at.text(), why);
    }

    broker_address to_;
    mosquitto* client_;
    std::atomic<bool> told_{false};
    std::mutex mutex_;
    std::condition_variable changed_;
    bool ending_ = false, ended_ = false;
};

class broker : public event_sink {
  public:
    explicit broker(const live_config& config) : topic_(config.publish.mqtt->prefix + "/" + topic_level(config)) {
        mosquitto_lib_init();
        link_ = std::make_shared<connection>(*config.publish.mqtt);
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
        (void)mosquitto_publish(link_->client(), nullptr, topic.c_str(), static_cast<int>(one.line->size()) - 1,
                                one.line->data(), 0, newest_counts);
    }
    bool finished() override { return !mosquitto_want_write(link_->client()); }

  private:
    std::string topic_;
    std::shared_ptr<connection> link_;
    std::thread thread_;
};

} // namespace

std::unique_ptr<event_sink> make_broker(const live_config& config) { return std::make_unique<broker>(config); }
#endif

} // namespace okid_host
