// SPDX-License-Identifier: MIT
// PURPOSE  the updates of a session as reports
// METHOD   an update that may be left out is, where newer ones wait already (stream::may_skip())
#include "update_maker.hpp"

#include <chrono>
#include <cmath>
#include <fmt/format.h>

namespace okid_host {
namespace {

using nlohmann::ordered_json;

ordered_json departure_json(const departure& from) {
    return {{"mode", from.track},
            {"frequency_hz", from.frequency_hz},
            {"baseline_hz", from.baseline_hz},
            {"sigma_hz", from.sigma_hz}};
}

} // namespace

update_maker::update_maker(const live_config& config)
    : rate_hz_(config.rate_hz), always_(config.hammer.enabled), stream_(stream_of(config)), alarm_(config.alarm) {
    if (config.alarm.test_s > 0) change_test_ = std::make_unique<change_test>(config, stream_.config());
}

update_report update_maker::update(std::int64_t samples, const haste& how) {
    update_report out;
    out.samples = samples;
    out.behind = how.ahead > 0;
    out.settled = settled_;
    out.alarm = alarm_.standing();
    if (change_test_) out.events = change_test_->take();
    if (!always_ && !stream_.due()) return out;
    if (const std::optional<stream_update::change> found = stream_.take_change(samples))
        out.events.push_back(
            {{"type", "change"}, {"t", seconds(samples)}, {"sample", found->sample}, {"restarted", found->restarted}});
    if (stream_.may_skip(how.ahead, how.hurry) || how.give_up) {
        out.fate = stream_.obliged() ? update_report::given_up : update_report::skipped;
        ++steps_;
        stream_.skip();
        return out;
    }
    const auto begun = std::chrono::steady_clock::now();
    make(samples, out);
    out.took_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - begun).count();
    settled_ = out.settled;
    out.alarm = alarm_.standing();
    return out;
}

/// Modes are shown once there are twice as many equations as unknowns: below that they only repeat the noise.
void update_maker::make(std::int64_t samples, update_report& out) {
    const stream_update found = stream_.update(samples);
    if (found.rows >= stream_.needed()) out.fate = update_report::made;
    const okid_accumulator_stats_t stats = stream_.sums().stats();
    table_state& state = out.table.emplace();
    state.t = seconds(samples);
    state.samples = stats.samples;
    state.missing = stats.missing;
    state.gaps = stats.gaps;
    state.changed = change_test_ && change_test_->standing();
    if (found.tracks) {
        follow(found, out);
    } else {
        state.alarm = alarm_.standing();
        state.waiting = found.rows < stream_.needed()
                            ? fmt::format("waiting for samples, {} of {}", found.rows, stream_.needed())
                            : fmt::format("no model yet: {}", okid_status_text(found.status));
    }
    out.settled = state.settled;
}

/// The modes of a new model: has one left its baseline?
void update_maker::follow(const stream_update& found, update_report& out) {
    const okid_identified_t& model = stream_.model();
    const deviations* sigma = found.sigma ? &*found.sigma : nullptr;
    const std::vector<int>& tracks = *found.tracks;
    table_state& state = *out.table;
    state.settled = found.settled;
    observed_.clear();
    for (std::size_t k = 0; k < tracks.size(); ++k)
        observed_.push_back(
            {tracks[k], model.frequency_hz[k], sigma ? sigma->frequency_hz[k] : NAN, stream_.at_rest(k)});
    const bool turned = alarm_.update(observed_, out.samples - stream_.sums().basis(), out.samples, steps_);
    steps_ = 1;
    state.alarm = alarm_.standing();
    for (std::size_t k = 0; k < tracks.size(); ++k) {
        mode_row& row = state.modes.emplace_back();
        row.track = tracks[k];
        row.frequency_hz = model.frequency_hz[k];
        row.damping_ratio = model.damping_ratio[k];
        row.mpc = model.mpc[k];
        row.emac = model.emac[k];
        row.alarm = alarm_.is_away(row.track);
        if (!sigma) continue;
        row.frequency_std_hz = sigma->frequency_hz[k];
        row.damping_ratio_std = sigma->damping_ratio[k];
    }
    tell_modes(sigma, found.since, out);
    for (std::size_t k = tracks.size(); k-- > 0;)
        if (stream_.doubtful(k)) state.modes.erase(state.modes.begin() + static_cast<std::ptrdiff_t>(k));
    if (turned) tell_alarm(out);
}

void update_maker::tell_modes(const deviations* sigma, std::int64_t since, update_report& out) {
    const table_state& state = *out.table;
    ordered_json modes = modes_json(stream_.model(), sigma);
    const std::vector<mode_verdict> verdicts = stream_.verdicts();
    for (std::size_t k = 0; k < verdicts.size(); ++k) modes[k].update(verdict_json(verdicts[k]));
    for (std::size_t k = 0; k < state.modes.size(); ++k) {
        modes[k]["track"] = state.modes[k].track > 0 ? ordered_json(state.modes[k].track) : ordered_json(nullptr);
        modes[k]["alarm"] = state.modes[k].alarm;
    }
    const std::int64_t basis = stream_.sums().basis();
    out.events.push_back({{"type", "modes"},
                          {"t", state.t},
                          {"modes", std::move(modes)},
                          {"window_s", seconds(basis)},
                          {"samples", basis},
                          {"modes_since", seconds(since)},
                          {"settled", state.settled}});
    if (const window_choice* chosen = stream_.sums().window())
        out.events.back()["window_reason"] =
            chosen->against ? ordered_json(window_reason(*chosen, rate_hz_)) : ordered_json(nullptr);
}

/// One alarm as long as any mode is away: the farthest has its name on it, the others stand in "modes".
void update_maker::tell_alarm(update_report& out) const {
    ordered_json event{{"type", alarm_.standing() ? "alarm" : "alarm_over"}, {"t", out.table->t}};
    if (alarm_.standing()) {
        event.update(departure_json(alarm_.away().front()));
        event["modes"] = ordered_json::array();
        for (const departure& each : alarm_.away()) event["modes"].push_back(departure_json(each));
    }
    out.events.push_back(std::move(event));
}

} // namespace okid_host
