// SPDX-License-Identifier: MIT
#include "events.hpp"

#include "../error.hpp"

#include <cerrno>
#include <chrono>
#include <cstdlib>
#include <cstring>
#include <fmt/format.h>
#include <unistd.h>

namespace okid_host {
namespace {

constexpr double redraw_s = 0.1; // a replay at full speed updates faster than an eye

double now_s() { return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count(); }

std::string state_text(const live_status& status) {
    std::string text = status.model ? (status.settled ? "settled" : "settling") : status.waiting;
    if (status.gaps)
        text += fmt::format(", {} missing in {} gap{}", status.missing, status.gaps, status.gaps == 1 ? "" : "s");
    return text;
}

/// "±0.0001" of mode k in the unit it is shown in.
std::string deviation(const live_status& status, std::vector<double> deviations::* of, int k, double unit,
                      const char* unknown) {
    const double value = status.sigma ? unit * (status.sigma->*of)[static_cast<std::size_t>(k)] : NAN;
    return std::isfinite(value) ? plus_minus(value) : unknown;
}

} // namespace

event_stream::event_stream(const std::string& path) : path_(path) {
    if (path.empty()) return;
    file_ = path == "-" ? stdout : std::fopen(path.c_str(), "we");
    if (!file_)
        throw failure(exit_usage, fmt::format("--events {}: cannot be written: {}", path, std::strerror(errno)));
}

event_stream::~event_stream() {
    if (file_ && file_ != stdout) std::fclose(file_);
}

void event_stream::write(const nlohmann::ordered_json& event) {
    if (!file_) return;
    const std::string text = event.dump(-1, ' ', false, nlohmann::ordered_json::error_handler_t::replace) + "\n";
    if (std::fwrite(text.data(), 1, text.size(), file_) != text.size() || std::fflush(file_) != 0)
        throw failure(exit_device, fmt::format("--events {}: cannot be written: {}", path_, std::strerror(errno)));
}

live_view::live_view(bool wanted) : wanted_(wanted), terminal_(isatty(STDOUT_FILENO) == 1), colour_(false) {
    const char *kind = std::getenv("TERM"), *no_colour = std::getenv("NO_COLOR");
    if (kind && std::strcmp(kind, "dumb") == 0) terminal_ = false;
    colour_ = terminal_ && !(no_colour && *no_colour);
}

void live_view::show(const live_status& status) {
    if (!wanted_) return;
    if (terminal_) {
        show_table(status);
        return;
    }
    std::string line = fmt::format("t {:.3f} s", status.t);
    for (int k = 0; status.model && k < status.model->mode_count; ++k)
        line +=
            fmt::format("{} {:.4f}{} Hz {:.3f}{} %", k ? "," : ":", status.model->frequency_hz[k],
                        deviation(status, &deviations::frequency_hz, k, 1, ""), 100 * status.model->damping_ratio[k],
                        deviation(status, &deviations::damping_ratio, k, 100, ""));
    fmt::print("{}; {}\n", line, state_text(status));
    std::fflush(stdout);
}

void live_view::show_table(const live_status& status) {
    const double now = now_s();
    if (now - shown_at_ < redraw_s) return;
    shown_at_ = now;
    std::string text = drawn_ ? fmt::format("\x1b[{}A\x1b[J", drawn_) : "";
    const char *on = colour_ ? (status.settled ? "\x1b[32m" : "\x1b[33m") : "", *off = colour_ ? "\x1b[0m" : "";
    text += fmt::format("t {:10.3f} s   {} samples   {}{}{}\n", status.t, status.samples, on, state_text(status), off);
    drawn_ = 1;
    if (status.model) {
        text += "   #       f [Hz]       ± σ     ζ [%]       ± σ     MPC    EMAC\n";
        ++drawn_;
        for (int k = 0; k < status.model->mode_count; ++k, ++drawn_)
            text += fmt::format("{:>4} {:>12.5f} {:>9} {:>9.4f} {:>9} {:>7.4f} {:>7.4f}\n", k + 1,
                                status.model->frequency_hz[k], deviation(status, &deviations::frequency_hz, k, 1, "-"),
                                100 * status.model->damping_ratio[k],
                                deviation(status, &deviations::damping_ratio, k, 100, "-"), status.model->mpc[k],
                                status.model->emac[k]);
    }
    std::fwrite(text.data(), 1, text.size(), stdout);
    std::fflush(stdout);
}

void live_view::end() {
    if (wanted_ && terminal_ && drawn_) std::fwrite("\n", 1, 1, stdout);
    drawn_ = 0;
}

} // namespace okid_host
