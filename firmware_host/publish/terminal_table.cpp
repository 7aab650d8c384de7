// SPDX-License-Identifier: MIT
#include "terminal_table.hpp"

#include "result/judgement.hpp"
#include "result/result.hpp"

#include <algorithm>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <fcntl.h>
#include <fmt/format.h>
#include <sys/ioctl.h>
#include <unistd.h>

namespace okid_host {
namespace {

std::string state_text(const table_state& state) {
    std::string text = !state.waiting.empty() ? state.waiting : state.settled ? "settled" : "settling";
    if (state.changed) text = "CHANGED, " + text;
    if (state.alarm) text = "ALARM, " + text;
    if (state.gaps)
        text += fmt::format(", {} missing in {} gap{}", state.missing, state.gaps, state.gaps == 1 ? "" : "s");
    return text;
}

std::string deviation(double value, const char* unknown) { return std::isfinite(value) ? plus_minus(value) : unknown; }

/// Characters, not bytes.
std::size_t width_of(const std::string& text) {
    return static_cast<std::size_t>(
        std::count_if(text.begin(), text.end(), [](char c) { return (static_cast<unsigned char>(c) & 0xC0) != 0x80; }));
}

std::string cut(const std::string& text, std::size_t width) {
    std::size_t at = 0;
    for (std::size_t seen = 0; at < text.size(); ++at) {
        if ((static_cast<unsigned char>(text[at]) & 0xC0) == 0x80) continue;
        if (seen++ == width) break;
    }
    return text.substr(0, at);
}

/// The terminal once more, so that it can be written to without waiting. @return -1 when it cannot be opened
int open_terminal(int fd) {
    char name[128];
    return ttyname_r(fd, name, sizeof name) == 0 ? open(name, O_WRONLY | O_NONBLOCK | O_NOCTTY | O_CLOEXEC) : -1;
}

std::string row_text(const mode_row& row) {
    return fmt::format("{:>5} {:>12.5f} {:>9} {:>9.4f} {:>9} {:>7.4f} {:>7.4f}",
                       row.track > 0 ? std::to_string(row.track) : "-", row.frequency_hz,
                       deviation(row.frequency_std_hz, "-"), 100 * row.damping_ratio,
                       deviation(100 * row.damping_ratio_std, "-"), row.mpc, row.emac);
}

} // namespace

std::string table_line(const table_state& state) {
    std::string line = fmt::format("t {:.3f} s", state.t);
    std::size_t listed = 0; // doubtful modes are only counted: the table and the events have them
    for (const mode_row& row : state.modes)
        if (row.alarm || row.emac >= judgement::doubtful_emac)
            line += fmt::format("{} {:.4f}{} Hz {:.3f}{} %", listed++ ? "," : ":", row.frequency_hz,
                                deviation(row.frequency_std_hz, ""), 100 * row.damping_ratio,
                                deviation(100 * row.damping_ratio_std, ""));
    if (const std::size_t weak = state.modes.size() - listed; weak > 0)
        line += fmt::format("{} {} of EMAC below {}", listed ? " and" : ":", weak, judgement::doubtful_emac);
    return line + "; " + state_text(state) + "\n";
}

terminal_table::terminal_table(int fd) {
    fd_ = open_terminal(fd);
    const char* no_colour = std::getenv("NO_COLOR");
    colour_ = !(no_colour && *no_colour);
}

terminal_table::~terminal_table() {
    if (fd_ >= 0) close(fd_);
}

bool terminal_table::fits(int fd) {
    const char* kind = std::getenv("TERM");
    if (!isatty(fd) || (kind && std::strcmp(kind, "dumb") == 0)) return false;
    const int own = open_terminal(fd); // not so for the terminal of another user, or in a container
    if (own >= 0) close(own);
    return own >= 0;
}

std::vector<std::string> terminal_table::render(const table_state& state, bool colour, std::size_t width,
                                                std::size_t height) {
    std::vector<std::string> lines;
    const auto add = [&](const std::string& text, const char* tint) {
        std::string line = cut(text, width);
        lines.push_back(colour && *tint ? tint + line + "\x1b[0m" : std::move(line));
    };
    add(fmt::format("t {:10.3f} s   {} samples   {}", state.t, state.samples, state_text(state)),
        state.alarm || state.changed ? "\x1b[31m"
        : state.settled              ? "\x1b[32m"
                                     : "\x1b[33m");
    if (state.modes.empty()) return lines;
    if (height > 2) add("track       f [Hz]       ± σ     ζ [%]       ± σ     MPC    EMAC", "");
    const std::size_t room = height > lines.size() ? height - lines.size() : 0;
    const bool all = state.modes.size() <= room;
    const std::size_t shown = all ? state.modes.size() : room > 0 ? room - 1 : 0;
    for (std::size_t k = 0; k < shown; ++k) add(row_text(state.modes[k]), state.modes[k].alarm ? "\x1b[31m" : "");
    if (!all && room > 0) add(fmt::format("… {} more", state.modes.size() - shown), "");
    return lines;
}

bool terminal_table::draw(const table_state& state) {
    if (fd_ < 0 || !flush()) return false;
    winsize size{};
    if (ioctl(fd_, TIOCGWINSZ, &size) != 0 || size.ws_col == 0 || size.ws_row == 0) size.ws_col = 80, size.ws_row = 24;
    const std::size_t width = size.ws_col;
    std::size_t rows = 0; // the terminal wraps what it was too wide for
    for (const std::size_t each : drawn_) rows += std::max<std::size_t>(1, (each + width - 1) / width);
    rows = std::min<std::size_t>(rows, size.ws_row);
    pending_ = rows ? fmt::format("\r\x1b[{}A\x1b[J", rows) : "";
    drawn_.clear();
    for (const std::string& line : render(state, false, width, size.ws_row - 1u)) drawn_.push_back(width_of(line));
    for (const std::string& line : render(state, colour_, width, size.ws_row - 1u)) pending_ += line + "\n";
    (void)flush();
    return true;
}

bool terminal_table::flush() {
    while (!pending_.empty()) {
        const ssize_t count = write(fd_, pending_.data(), pending_.size());
        if (count < 0 && errno == EINTR) continue;
        if (count < 0 && errno == EAGAIN) return false;
        if (count <= 0) { // the terminal is gone: no reason to end a measurement
            pending_.clear();
            return true;
        }
        pending_.erase(0, static_cast<std::size_t>(count));
    }
    return true;
}

void terminal_table::end() {
    if (!drawn_.empty()) pending_ += "\n";
    (void)flush();
    drawn_.clear();
}

} // namespace okid_host
