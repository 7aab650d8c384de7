// SPDX-License-Identifier: MIT
// PURPOSE  how long a sample takes from the line to the thread that identifies, and its update to the event, at W2's size:
//          2 forces and 6 accelerations at 1 kHz on a pseudo terminal, an update every 0.1 s, calm and beside two busy
//          processors
// METHOD   the same packets go to okid and to a bare reader (epoll_wait, read, nothing else) on a second line: what the
//          machine itself takes away is in both, the ratio of their p99 is judged. Without recording
// usage: bench_latency BENCH.json [SECONDS]   ratios go into the file of `okid bench --save`
#include "acquire/stop_signal.hpp"
#include "live/capture.hpp"
#include "live/session.hpp"

#include <atomic>
#include <cmath>
#include <csignal>
#include <drv/stream.h>
#include <fcntl.h>
#include <fmt/format.h>
#include <fstream>
#include <map>
#include <pty.h>
#include <random>
#include <sys/epoll.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <termios.h>
#include <thread>
#include <unistd.h>

using namespace okid_host;
using clock_type = std::chrono::steady_clock;

namespace {

constexpr int rate = 1000, in_packet = 4, channels = 8;

struct line {
    int near_fd = -1, far_fd = -1;
    std::string path;
    line() {
        char name[128];
        if (openpty(&near_fd, &far_fd, name, nullptr, nullptr) != 0) throw std::runtime_error("no pseudo terminal");
        termios raw{};
        tcgetattr(far_fd, &raw);
        cfmakeraw(&raw);
        tcsetattr(far_fd, TCSANOW, &raw);
        path = name;
    }
    ~line() {
        close(near_fd);
        close(far_fd);
    }
    line(const line&) = delete;
    line& operator=(const line&) = delete;
};

/// Packets of white noise through two resonances.
std::vector<std::vector<std::uint8_t>> packets(int seconds) {
    std::mt19937 random(1);
    std::normal_distribution<double> normal(0, 2000);
    std::vector<std::vector<std::uint8_t>> out;
    double a[3] = {}, b[3] = {};
    for (int first = 0; first < seconds * rate; first += in_packet) {
        std::int32_t codes[in_packet * channels];
        for (int n = 0; n < in_packet; ++n) {
            const double force[2] = {normal(random), normal(random)};
            a[0] = 1.95 * a[1] - 0.98 * a[2] + 0.05 * force[0];
            b[0] = 1.50 * b[1] - 0.97 * b[2] + 0.1 * force[1];
            for (double* each : {a, b}) each[2] = each[1], each[1] = each[0];
            for (int c = 0; c < channels; ++c)
                codes[n * channels + c] = static_cast<std::int32_t>(
                    c < 2 ? force[c] : std::cos(c) * a[0] + std::sin(2.0 * c) * b[0] + 0.01 * normal(random));
        }
        const drv_stream_header_t head{DRV_STREAM_INT16, channels, in_packet, static_cast<std::uint32_t>(first), 0};
        std::vector<std::uint8_t>& one = out.emplace_back(DRV_STREAM_ENCODED);
        one.resize(drv_stream_encode_codes(&head, codes, one.data(), one.size()));
    }
    return out;
}

live_config config_of(const std::string& device, bool by_default) {
    const std::string path = "bench_latency.toml";
    std::ofstream file(path);
    file << fmt::format("[acquisition]\nrate_hz = {}\n[[bus]]\nname = \"node\"\ntype = \"serial\"\nframing = \"cobs\"\n"
                        "device = \"{}\"\n",
                        rate, device);
    for (int c = 0; c < channels; ++c)
        file << fmt::format("[[channel]]\nname = \"c{}\"\nrole = \"{}\"\nfield = {}\n", c,
                            c < 2 ? "force" : "acceleration", c);
    file << "[identification]\nwindow_s = 4.0\nupdate_s = 0.1\n" << (by_default ? "" : "p = 40\n");
    file.close();
    live_config out = load_config(path);
    std::remove(path.c_str());
    return out;
}

struct stamps : session_listener {
    std::map<std::int64_t, clock_type::time_point> handed_over, told; ///< by samples
    void on_sample(std::int64_t, const double*) override {}
    void on_missing(std::int64_t, std::int64_t) override {}
    void on_gap(const grid_gap&) override {}
    void on_handed_over(std::int64_t samples) override { handed_over[samples] = clock_type::now(); }
    void on_event(const std::string& text) override {
        const auto event = nlohmann::json::parse(text);
        if (event["type"] == "modes") told[std::llround(event["t"].get<double>() * rate)] = clock_type::now();
    }
};

struct outcome {
    std::vector<double> bare_ms, handed_over_ms, told_ms;
};

double ms(clock_type::duration d) { return std::chrono::duration<double, std::milli>(d).count(); }

outcome measure(int seconds, bool by_default) {
    const auto sent = packets(seconds);
    line to_okid, to_bare;
    std::vector<clock_type::time_point> written(sent.size()), also_written(sent.size());
    outcome out;
    std::thread bare([&] {
        const int poll_fd = epoll_create1(0);
        epoll_event event{EPOLLIN, {}};
        epoll_ctl(poll_fd, EPOLL_CTL_ADD, to_bare.far_fd, &event);
        std::uint8_t bytes[4096];
        for (std::size_t k = 0; k < sent.size();) {
            (void)epoll_wait(poll_fd, &event, 1, -1);
            const ssize_t got = read(to_bare.far_fd, bytes, sizeof bytes);
            const auto now = clock_type::now();
            for (ssize_t i = 0; i < got; ++i)
                if (bytes[i] == 0) out.bare_ms.push_back(ms(now - also_written[k++]));
        }
        close(poll_fd);
    });
    const live_config config = config_of(to_okid.path, by_default);
    stamps seen;
    session_options options;
    options.duration_s = seconds;
    options.live = true;
    options.table = false;
    options.listener = &seen;
    session live(config, options);
    std::thread writer([&] {
        const auto begin = clock_type::now() + std::chrono::milliseconds(500);
        for (std::size_t k = 0; k < sent.size(); ++k) {
            std::this_thread::sleep_until(begin + k * std::chrono::microseconds(1000000 * in_packet / rate));
            written[k] = clock_type::now();
            (void)!write(to_okid.near_fd, sent[k].data(), sent[k].size());
            also_written[k] = clock_type::now();
            (void)!write(to_bare.near_fd, sent[k].data(), sent[k].size());
        }
    });
    capture(config, live, options.duration_s, std::nullopt);
    writer.join();
    bare.join();
    live.finish();
    const auto since = [&](const auto& at, std::vector<double>& to) {
        for (const auto& [samples, when] : at)
            to.push_back(ms(when - written[static_cast<std::size_t>(samples - 1) / in_packet]));
    };
    since(seen.handed_over, out.handed_over_ms);
    since(seen.told, out.told_ms);
    return out;
}

double quantile(std::vector<double> values, double share) {
    std::sort(values.begin(), values.end());
    return values.empty() ? NAN : values[static_cast<std::size_t>(share * static_cast<double>(values.size() - 1))];
}

/// Times a quarter of an octave wide, [from ms, how many], for the picture in docs.
nlohmann::ordered_json histogram(const std::vector<double>& values) {
    std::map<int, std::size_t> bars;
    for (const double value : values) ++bars[static_cast<int>(std::floor(4 * std::log2(value)))];
    auto out = nlohmann::ordered_json::array();
    for (const auto& [quarter, count] : bars) out.push_back({std::exp2(quarter / 4.0), count});
    return out;
}

/// One bar for every factor of two.
void print(const char* what, const std::vector<double>& values) {
    fmt::print("  {}: {} times, median {:.2f} ms, p99 {:.2f} ms, worst {:.2f} ms\n", what, values.size(),
               quantile(values, 0.5), quantile(values, 0.99), quantile(values, 1));
    std::map<int, std::size_t> bars;
    for (const double value : values) ++bars[static_cast<int>(std::floor(std::log2(value)))];
    for (const auto& [power, count] : bars)
        fmt::print("    {:8.4g} to {:8.4g} ms {:6} {}\n", std::exp2(power), std::exp2(power + 1), count,
                   std::string(50 * count / values.size(), '#'));
}

std::vector<pid_t> busy(int count) {
    std::vector<pid_t> out;
    for (int k = 0; k < count; ++k) {
        const pid_t pid = fork();
        if (pid == 0) {
            prctl(PR_SET_PDEATHSIG, SIGKILL);
            for (volatile unsigned spin = 0;; spin = spin + 1) {
            }
        }
        if (pid > 0) out.push_back(pid);
    }
    return out;
}

} // namespace

int main(int argc, char** argv) try {
    if (argc < 2) {
        fmt::print(stderr, "usage: bench_latency BENCH.json [SECONDS]   (of okid bench --save)\n");
        return 2;
    }
    const int seconds = argc > 2 ? std::atoi(argv[2]) : 30;
    nlohmann::ordered_json bench;
    std::ifstream(argv[1]) >> bench;
    catch_stop_signals();
    for (const auto& [hogs, by_default] : {std::pair{0, false}, {2, false}, {0, true}, {2, true}}) {
        const std::vector<pid_t> there = busy(hogs);
        const outcome found = measure(seconds, by_default);
        for (const pid_t pid : there) {
            kill(pid, SIGKILL);
            waitpid(pid, nullptr, 0);
        }
        const std::string name = fmt::format("{}{}", by_default ? "auto " : "", hogs ? "busy" : "calm");
        fmt::print("W2 at {} Hz, {} s live, {}, {} busy processes beside it\n", rate, seconds,
                   by_default ? "the default method" : "okid-era", hogs);
        print("a bare reader", found.bare_ms);
        print("frame in to snapshot handed over", found.handed_over_ms);
        print("frame in to modes with deviations", found.told_ms);
        bench["rows"].push_back({{"name", "latency"},
                                 {"case", name},
                                 {"bare_p99_ms", quantile(found.bare_ms, 0.99)},
                                 {"handed_over_p99_ms", quantile(found.handed_over_ms, 0.99)},
                                 {"modes_p99_ms", quantile(found.told_ms, 0.99)},
                                 {"histograms_ms",
                                  {{"bare", histogram(found.bare_ms)},
                                   {"handed_over", histogram(found.handed_over_ms)},
                                   {"modes", histogram(found.told_ms)}}}});
        if (by_default) continue;
        bench["ratios"][fmt::format("handed_over_over_bare_{}", name)] =
            quantile(found.handed_over_ms, 0.99) / quantile(found.bare_ms, 0.99);
    }
    std::ofstream(argv[1]) << bench.dump(1) << "\n";
    return 0;
} catch (const std::exception& error) {
    fmt::print(stderr, "bench_latency: {}\n", error.what());
    return 4;
}
