// SPDX-License-Identifier: MIT
// The stream of events of a live session: JSON lines for programs, a table for people. Both show the same numbers.
#pragma once
#include "../deviations.hpp"

#include <okid/identify.h>

#include <cstdio>
#include <nlohmann/json.hpp>
#include <string>

namespace okid_host {

/// Where JSON lines go: a file, stdout ("-") or nowhere ("").
class event_stream {
  public:
    explicit event_stream(const std::string& path);
    ~event_stream();
    event_stream(const event_stream&) = delete;
    event_stream& operator=(const event_stream&) = delete;

    /// One line, flushed at once. Throws `failure` (exit 4) when it cannot be written.
    void write(const nlohmann::ordered_json& event);
    bool on_stdout() const { return file_ == stdout; }

  private:
    std::string path_;
    std::FILE* file_ = nullptr;
};

/// What the view shows at an update.
struct live_status {
    double t = 0;
    bool settled = false;
    long long samples = 0, missing = 0, gaps = 0;
    const okid_identified_t* model = nullptr; ///< NULL while there is none
    const deviations* sigma = nullptr;        ///< of the model, NULL while there are none
    std::string waiting;                      ///< why there is none
};

/// On a terminal a table redrawn in place; else one line an update. NO_COLOR and dumb terminals are obeyed.
class live_view {
  public:
    explicit live_view(bool wanted);
    void show(const live_status& status);
    /// Leave the last table standing.
    void end();

  private:
    void show_table(const live_status& status);

    bool wanted_, terminal_, colour_;
    int drawn_ = 0; ///< lines that the next table overwrites
    double shown_at_ = 0;
};

} // namespace okid_host
