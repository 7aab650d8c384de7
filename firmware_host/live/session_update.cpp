// SPDX-License-Identifier: MIT
// Updates of a session: handed over to the thread that makes them, reported when they come back.
#include "session.hpp"

#include "acquire/host_time.hpp"
#include "error.hpp"

#include <algorithm>
#include <fmt/format.h>
#include <utility>

namespace okid_host {

void session::update(std::int64_t samples) {
    if (trigger_.waiting() || hammer_.wanted())
        await(samples);
    else
        hand_over(samples);
    if (samples / stats_samples_ == stats_sent_) return;
    stats_sent_ = samples / stats_samples_;
    tell(stats_event());
}

/// What is waited for, above the modes of the hits so far.
void session::await(std::int64_t samples) {
    table_state state = shown_;
    state.t = seconds(samples);
    state.waiting = hammer_.wanted() ? hammer_.awaited() : "armed, waiting for " + trigger_.awaited();
    publisher_.table(state);
}

void session::hand_over(std::int64_t samples) {
    updates_.update(samples);
    if (options_.listener) options_.listener->on_handed_over(samples);
    tell_updates(updates_.take());
}

void session::tell_updates(std::vector<update_report> reports) {
    for (update_report& report : reports) {
        for (nlohmann::ordered_json& event : report.events) tell(std::move(event));
        settled_ = report.settled;
        alarm_ = report.alarm;
        count_update(report);
        if (!report.table) continue;
        if (hammer_.wanted()) {
            if (!report.table->modes.empty()) report.table->waiting = hammer_.awaited();
            shown_ = *report.table;
        }
        publisher_.table(*report.table);
    }
}

void session::count_update(const update_report& report) {
    if (report.fate == update_report::made) {
        ++updates_made_;
        publisher_.update_took(report.took_s);
        if (!report.behind && !relief_.stands(overload_step::updates)) overload(overload_step::updates, false);
    } else if (report.fate != update_report::none) {
        ++updates_skipped_;
        updates_given_up_ += report.fate == update_report::given_up;
        publisher_.update_skipped();
        overload(overload_step::updates, true);
    }
}

void session::alive(bool caught_up) {
    publisher_.beat();
    tell_updates(updates_.take());
    const int before = relief_.standing(), now = relief_.look(steady_s(), caught_up);
    if (now == before) return;
    const auto step = static_cast<overload_step>(std::min(before, now));
    switch (step) {
    case overload_step::pictures:
        if (feed_) send_samples(feed_->end_block());
        break;
    case overload_step::updates: updates_.hurry(now > before); break;
    case overload_step::publishing: publisher_.only_urgent(now > before); break;
    }
    if (now > before || step != overload_step::updates) overload(step, now > before); // updates: when one was in time
}

/// Its gap is reported when it ends, which may be never. Where the interface is down, that has been said.
void session::tell_silent(std::size_t channel, std::int64_t first) {
    const channel_config& its = config_.channels[channel];
    if (health_[its.bus] && health_[its.bus]->counts.link_is_down) return;
    const std::string text = fmt::format("nothing of \"{}\" since {:.3f} s", its.name, seconds(first));
    tell({{"type", "bus"},
          {"t", seconds(now_)},
          {"bus", config_.buses[its.bus].name},
          {"event", "silent"},
          {"channel", its.name},
          {"first", first},
          {"text", text}});
    if (options_.live) say("okid: warning: {}\n", text);
}

/// A step of relief.hpp, or back. Updates are left out besides when mathematics alone is too slow.
void session::overload(overload_step step, bool on) {
    const auto which = static_cast<std::size_t>(step);
    if (std::exchange(overloaded_[which], on) == on) return;
    static constexpr const char* names[] = {"pictures", "updates", "publishing"};
    static constexpr const char* given_up[] = {"blocks of the signals are not published", "updates are left out",
                                               "only what is urgent is published"};
    tell({{"type", "overload"},
          {"t", seconds(now_)},
          {"step", names[which]},
          {"on", on},
          {"updates_skipped", updates_skipped_},
          {"text",
           fmt::format(
               on ? "the machine is too slow: {} until it has caught up; samples, journal and result are complete"
                  : "caught up; no longer: {}",
               given_up[which])}});
}

} // namespace okid_host
