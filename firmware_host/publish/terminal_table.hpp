// SPDX-License-Identifier: MIT
// The modal table as text: redrawn in place on a terminal, one line an update elsewhere.
#pragma once
#include <cmath>
#include <cstddef>
#include <string>
#include <vector>

namespace okid_host {

struct mode_row {
    int track = 0; ///< 0 = not tracked yet
    double frequency_hz = 0, damping_ratio = 0, mpc = 0, emac = 0;
    double frequency_std_hz = NAN, damping_ratio_std = NAN;
    bool alarm = false; ///< away from its baseline
};

/// What there is to show at an update.
struct table_state {
    double t = 0;
    bool settled = false, alarm = false;
    bool changed = false; ///< by the newest change test
    long long samples = 0, missing = 0, gaps = 0;
    std::string waiting; ///< why there is no model; "" = there is one
    std::vector<mode_row> modes;
};

/// One line for a log, newline included.
std::string table_line(const table_state& state);

/// Draws on a terminal. Each draw asks how large the terminal is now.
class terminal_table {
  public:
    /// @param fd  of the terminal; it is opened again, so that non-blocking writes do not affect other users of it
    explicit terminal_table(int fd);
    ~terminal_table();
    terminal_table(const terminal_table&) = delete;
    terminal_table& operator=(const terminal_table&) = delete;
    /// Is it a terminal that can redraw?
    static bool fits(int fd);
    /// Never waits. @return false: the terminal takes nothing now (Ctrl-S)
    bool draw(const table_state& state);
    /// Leave the last table standing.
    void end();

    /// The table as text, at most `width` x `height`: lines without newlines, in colour where asked for.
    static std::vector<std::string> render(const table_state& state, bool colour, std::size_t width,
                                           std::size_t height);

  private:
    bool flush();

    int fd_;
    std::string pending_; ///< what the terminal has not taken yet
    bool colour_;
    std::vector<std::size_t> drawn_; ///< widths of the lines that stand there
};

} // namespace okid_host
