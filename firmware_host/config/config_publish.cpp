// SPDX-License-Identifier: MIT
#include "config_publish.hpp"

#include "error.hpp"
#include "files/nearest_name.hpp"
#include "secrets.hpp"

#include <algorithm>
#include <arpa/inet.h>
#include <charconv>
#include <filesystem>
#include <fmt/format.h>
#include <sys/stat.h>
#include <sys/un.h>

namespace okid_host {
namespace {

std::optional<int> port_of(std::string_view text) {
    int port = 0;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), port);
    if (error != std::errc{} || end != text.data() + text.size() || port < 1 || port > 65535) return std::nullopt;
    return port;
}

/// "host:port", "[v6]:port", ":port" or "port"; without a host the loopback. `fallback` 0 = a port must be there.
std::optional<net_address> address_of(std::string_view text, int fallback) {
    net_address out;
    std::string_view host, port = text;
    if (!text.empty() && text.front() == '[') {
        const std::size_t close = text.find(']');
        if (close == std::string_view::npos) return std::nullopt;
        host = text.substr(1, close - 1);
        port = text.substr(close + 1);
        if (!port.empty() && port.front() != ':') return std::nullopt;
        if (!port.empty()) port.remove_prefix(1);
    } else if (const std::size_t colon = text.find(':'); colon != std::string_view::npos) {
        host = text.substr(0, colon);
        port = text.substr(colon + 1);
    } else if (fallback != 0) {
        host = text;
        port = {};
    }
    if (host.find_first_of(" \t/@:") != std::string_view::npos && text.front() != '[') return std::nullopt;
    if (!host.empty()) out.host = host;
    const std::optional<int> number = port.empty() && fallback != 0 ? fallback : port_of(port);
    if (!number) return std::nullopt;
    out.port = *number;
    return out;
}

bool numeric(const std::string& host) {
    unsigned char bytes[16];
    return inet_pton(AF_INET, host.c_str(), bytes) == 1 || inet_pton(AF_INET6, host.c_str(), bytes) == 1;
}

[[noreturn]] void refuse_address(const config_place& place, const toml::node& node, const char* key,
                                 const char* expected) {
    std::string found = node.value_or(std::string());
    if (found.find("://") == std::string::npos) found.insert(0, "://"); // a name before the @ without a scheme
    found = without_password(found);
    if (found.rfind("://", 0) == 0) found.erase(0, 3);
    refuse_key(place, &node, key, fmt::format("found \"{}\", expected {}", printable(found), expected));
}

std::string socket_of(const config_place& place, const toml::node& node) {
    const std::filesystem::path given(*node.value<std::string>());
    const std::string path =
        given.is_absolute() ? given.string() : (std::filesystem::path(place.path).parent_path() / given).string();
    if (path.size() >= sizeof(sockaddr_un{}.sun_path))
        refuse_key(place, &node, "socket",
                   fmt::format("the path has {} characters, a socket's has at most {}", path.size(),
                               sizeof(sockaddr_un{}.sun_path) - 1));
    return path;
}

/// mqtt://[user:password@]host[:port][/prefix]
broker_address broker_of(const config_place& place, const toml::node& node) {
    constexpr const char* expected = "mqtt://host, mqtt://host:1883/prefix or mqtt://user:password@host/prefix";
    constexpr std::string_view scheme = "mqtt://";
    std::string text = *node.value<std::string>();
    if (text.compare(0, scheme.size(), scheme) != 0) refuse_address(place, node, "mqtt", expected);
    text.erase(0, scheme.size());
    broker_address out;
    const std::size_t slash = text.find('/'), last_at = text.rfind('@');
    if (slash != std::string::npos && last_at != std::string::npos && last_at > slash)
        refuse_key(place, &node, "mqtt",
                   "found an @ behind a /: a password with a / in it belongs into a password_file");
    if (slash != std::string::npos) {
        if (slash + 1 < text.size()) out.prefix = text.substr(slash + 1);
        text.resize(slash);
    }
    while (!out.prefix.empty() && out.prefix.back() == '/') out.prefix.pop_back();
    if (const std::size_t at = text.rfind('@'); at != std::string::npos) {
        const std::size_t colon = std::min(text.find(':'), at);
        out.user = text.substr(0, colon);
        if (colon < at) out.password = text.substr(colon + 1, at - colon - 1);
        text.erase(0, at + 1);
    }
    const std::optional<net_address> address = text.empty() ? std::nullopt : address_of(text, 1883);
    if (!address || out.prefix.find_first_of("#+") != std::string::npos || out.prefix.size() > 200)
        refuse_address(place, node, "mqtt", expected);
    out.at = *address;
    return out;
}

void read_password_file(const config_place& place, const toml::node& node, publish_config& out) {
    const bool named = out.mqtt && !out.mqtt->user.empty();
    if (!named || !out.mqtt->password.empty())
        refuse_key(place, &node, "password_file",
                   named ? "mqtt has a password too, expected one of the two"
                         : "it is the password of the user of mqtt, expected mqtt = \"mqtt://user@host\" beside it");
    out.mqtt->password_file = *node.value<std::string>();
}

/// udp://host:port, http://host[:port]/path?query, else a file
influx_target influx_of(const config_place& place, const toml::node& node) {
    constexpr const char* expected = "a file (run.lp), udp://host:port or http://host:port/api/v2/write?org=o&bucket=b";
    const std::string text = *node.value<std::string>();
    influx_target out;
    const std::size_t scheme = text.find("://");
    if (scheme == std::string::npos) {
        out.file = (std::filesystem::path(place.path).parent_path() / text).string();
        return out;
    }
    const std::size_t host = scheme + 3, slash = std::min(text.find('/', host), text.size());
    const bool http = text.compare(0, scheme, "http") == 0;
    if (http) out.path = slash < text.size() ? text.substr(slash) : "/api/v2/write";
    for (const char* secret : {"?token=", "&token=", "?p=", "&p="})
        if (out.path.find(secret) != std::string::npos)
            refuse_key(place, &node, "influx", "found a password in the query; it belongs into influx_token_file");
    const std::optional<net_address> at =
        address_of(std::string_view(text).substr(host, slash - host), http ? 8086 : 0);
    const bool plain = std::all_of(out.path.begin(), out.path.end(), [](char c) { return c > ' ' && c < 127; });
    if (!at || !plain || !(http || (text.compare(0, scheme, "udp") == 0 && slash == text.size())))
        refuse_address(place, node, "influx", expected);
    out.at = *at;
    return out;
}

bool everybody_reads(const std::string& path) {
    struct stat status{};
    return stat(path.c_str(), &status) == 0 && (status.st_mode & S_IROTH);
}

/// What a build may leave out.
void require_built(const config_place& place, const toml::table& table, const char* key, bool built,
                   const char* package) {
    if (table.contains(key) && !built)
        refuse_key(place, table.get(key), key,
                   fmt::format("this okid was built without it: install {} and build it again, or leave the key out",
                               package));
}

void read_prometheus(const config_place& place, const toml::node& node, live_config& config) {
    std::optional<net_address> at = address_of(*node.value<std::string>(), 0);
    if (at && at->host == "localhost") at->host = "127.0.0.1";
    if (!at || !numeric(at->host))
        refuse_address(place, node, "prometheus", "a numeric address and a port, such as 127.0.0.1:9273");
    if (!at->loopback())
        config.warnings.push_back(fmt::format(
            "[publish] prometheus listens on {}: anyone who reaches that address can read the modes", at->text()));
    config.publish.prometheus = std::move(at);
}

/// Warnings about passwords that others can read and addresses beyond this computer.
void warn_of_exposure(live_config& config) {
    const publish_config& out = config.publish;
    if (out.mqtt && !out.mqtt->password.empty() && everybody_reads(config.path))
        config.warnings.emplace_back(
            "[publish] mqtt holds a password, and every user of this computer can read the config: "
            "chmod o-r, or use password_file");
    for (const auto& [what, address] :
         {std::pair{"udp", out.udp}, std::pair{"mqtt", out.mqtt ? std::optional(out.mqtt->at) : std::nullopt},
          std::pair{"influx", out.influx && out.influx->file.empty() ? std::optional(out.influx->at) : std::nullopt}})
        if (address && !address->loopback())
            config.warnings.push_back(
                fmt::format("[publish] {} sends to {}, beyond this computer, and unencrypted", what, address->text()));
}

} // namespace

bool net_address::loopback() const { return host == "localhost" || host.compare(0, 4, "127.") == 0 || host == "::1"; }

std::string net_address::text() const {
    return fmt::format(host.find(':') == std::string::npos ? "{}:{}" : "[{}]:{}", host, port);
}

void read_publish(const toml::table& file, live_config& config) {
    const toml::table* table = file["publish"].as_table();
    if (!table) return;
    const config_place place{config.path, "[publish]"};
#ifdef OKID_PROMETHEUS
    constexpr bool prometheus = true;
#else
    constexpr bool prometheus = false;
#endif
#ifdef OKID_MQTT
    constexpr bool mqtt = true;
#else
    constexpr bool mqtt = false;
#endif
    require_built(place, *table, "prometheus", prometheus, "prometheus-cpp-dev");
    require_built(place, *table, "mqtt", mqtt, "libmosquitto-dev");
    publish_config& out = config.publish;
    if (const toml::node* node = table->get("socket")) out.socket = socket_of(place, *node);
    if (const toml::node* node = table->get("samples")) {
        out.samples = *node->value<bool>();
        if (out.samples && out.socket.empty())
            refuse_key(place, node, "samples",
                       "found true, expected socket = \"okid.sock\" beside it: that is where they go");
    }
    if (const toml::node* node = table->get("udp")) {
        out.udp = address_of(*node->value<std::string>(), 0);
        if (!out.udp) refuse_address(place, *node, "udp", "an address and a port, such as 127.0.0.1:9870");
    }
    if (const toml::node* node = table->get("prometheus")) read_prometheus(place, *node, config);
    if (const toml::node* node = table->get("mqtt")) out.mqtt = broker_of(place, *node);
    if (const toml::node* node = table->get("password_file")) read_password_file(place, *node, out);
    if (const toml::node* node = table->get("discovery")) {
        if (!out.mqtt) refuse_key(place, node, "discovery", "it is sent over MQTT, expected mqtt beside it");
        out.mqtt->discovery = *node->value<bool>();
    }
    if (const toml::node* node = table->get("influx")) out.influx = influx_of(place, *node);
    if (const toml::node* node = table->get("influx_token_file")) {
        if (!out.influx || out.influx->path.empty())
            refuse_key(place, node, "influx_token_file", "it is for HTTP, expected influx = \"http://…\" beside it");
        out.influx->token_file = *node->value<std::string>();
    }
    warn_of_exposure(config);
}

void read_virtual(const toml::table& file, live_config& config) {
    const toml::table* table = file["virtual"].as_table();
    if (!table) return;
    const config_place place{config.path, "[virtual]"};
    const toml::node* model = table->get("model");
    if (!model)
        throw failure(exit_usage,
                      fmt::format("{}: line {}, [virtual]: key \"model\" is missing, expected the path of a "
                                  "file of okid.VirtualSensors.save()",
                                  config.path, table->source().begin.line));
    if (!config.publish.samples)
        refuse_key(place, model, "model",
                   "virtual sensors go where the signals go, expected samples = true in [publish]");
    config.virtual_sensors.model =
        (std::filesystem::path(config.path).parent_path() / *model->value<std::string>()).string();
    const toml::array* channels = (*table)["channels"].as_array();
    if (!channels) return;
    for (const toml::node& one : *channels) {
        if (!one.is_string())
            refuse_key(place, &one, "channels", fmt::format("found {}, expected names in quotes", found_value(one)));
        config.virtual_sensors.channels.push_back(*one.value<std::string>());
    }
}

} // namespace okid_host
