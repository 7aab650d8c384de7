// SPDX-License-Identifier: MIT
// What a session publishes, and the interface of what receives it.
#pragma once
#include <memory>
#include <nlohmann/json.hpp>
#include <poll.h>
#include <string>
#include <vector>

namespace okid_host {

/// A line of JSON with its end, shared by all that send it.
using json_line = std::shared_ptr<const std::string>;

/// An event, as it is and as a line (newline included). Shared by all that take it in.
struct publication {
    std::string type;
    std::shared_ptr<const nlohmann::ordered_json> event; ///< nullptr: the line is a block of the signals
    json_line line;
    double wall_s = 0; ///< its time t as seconds since 1970, by the time stamps of the stream
};

/// Something events go to, on the thread of the publisher: nothing in it may block.
class event_sink {
  public:
    virtual ~event_sink() = default;
    virtual void take(const publication& one) = 0;
    /// A block of the signals, where they are asked for: see sample_feed.hpp.
    virtual void take_samples(const json_line&) {}
    /// What to wait for besides events.
    virtual void add_polls(std::vector<pollfd>&) const {}
    /// After each wait, at least ten times a second.
    virtual void tick() {}
    /// No more events come; a little time is left. @return nothing remains to be done
    virtual bool finished() { return true; }
};

} // namespace okid_host
