// SPDX-License-Identifier: MIT
// An update of a session: identify, follow the modes, tell.
#include "session.hpp"

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

void session::update(std::int64_t samples) {
    if (trigger_.waiting() || hammer_.wanted()) {
        await(samples);
    } else {
        const auto begun = std::chrono::steady_clock::now();
        show_modes(samples);
        publisher_.update_took(std::chrono::duration<double>(std::chrono::steady_clock::now() - begun).count());
    }
    if (samples / stats_samples_ == stats_told_) return;
    stats_told_ = samples / stats_samples_;
    tell(stats_event());
}

/// What is waited for, above the modes of the blows so far.
void session::await(std::int64_t samples) {
    table_state state = shown_;
    state.t = seconds(samples);
    state.waiting = hammer_.wanted() ? hammer_.awaited() : "armed, waiting for " + trigger_.awaited();
    publisher_.table(state);
}

table_state session::table(std::int64_t samples) {
    const okid_accumulator_stats_t stats = identifier_.stats();
    table_state out;
    out.t = seconds(samples);
    out.samples = stats.samples;
    out.missing = stats.missing;
    out.gaps = stats.gaps;
    return out;
}

/// Modes are shown once there are twice as many equations as unknowns: below that they only repeat the noise.
void session::show_modes(std::int64_t samples) {
    if (!hammer_.wanted() && !stream_.due()) return;
    const stream_update found = stream_.update(samples);
    if (found.changed)
        tell({{"type", "change"},
              {"t", seconds(samples)},
              {"sample", found.changed->sample},
              {"restarted", found.changed->restarted}});
    table_state state = table(samples);
    if (found.tracks) {
        follow(samples, found, state);
    } else {
        state.alarm = alarm_.standing();
        state.waiting = found.rows < stream_.needed()
                            ? fmt::format("waiting for samples, {} of {}", found.rows, stream_.needed())
                            : fmt::format("no model yet: {}", okid_status_text(found.status));
    }
    settled_ = state.settled;
    if (hammer_.wanted()) {
        if (!state.modes.empty()) state.waiting = hammer_.awaited();
        shown_ = state;
    }
    publisher_.table(state);
}

/// The modes of a new model: has one left its baseline?
void session::follow(std::int64_t samples, const stream_update& found, table_state& state) {
    const okid_identified_t& model = stream_.model();
    const deviations* sigma = found.sigma ? &*found.sigma : nullptr;
    const std::vector<int>& tracks = *found.tracks;
    state.settled = found.settled;
    observed_.clear();
    for (std::size_t k = 0; k < tracks.size(); ++k)
        observed_.push_back(
            {tracks[k], model.frequency_hz[k], sigma ? sigma->frequency_hz[k] : NAN, stream_.at_rest(k)});
    const bool turned = alarm_.update(observed_, samples - identifier_.basis(), samples);
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
    tell_modes(state, sigma);
    for (std::size_t k = tracks.size(); k-- > 0;)
        if (stream_.doubtful(k)) state.modes.erase(state.modes.begin() + static_cast<std::ptrdiff_t>(k));
    if (turned) tell_alarm(state.t);
}

void session::tell_modes(const table_state& state, const deviations* sigma) {
    ordered_json modes = modes_json(identifier_.model(), sigma);
    const std::vector<mode_verdict> verdicts = stream_.verdicts();
    for (std::size_t k = 0; k < verdicts.size(); ++k) modes[k].update(verdict_json(verdicts[k]));
    for (std::size_t k = 0; k < state.modes.size(); ++k) {
        modes[k]["track"] = state.modes[k].track > 0 ? ordered_json(state.modes[k].track) : ordered_json(nullptr);
        modes[k]["alarm"] = state.modes[k].alarm;
    }
    const std::int64_t basis = identifier_.basis();
    tell({{"type", "modes"},
          {"t", state.t},
          {"modes", std::move(modes)},
          {"window_s", seconds(basis)},
          {"samples", basis},
          {"settled", state.settled}});
}

/// One alarm as long as any mode is away: the farthest has its name on it, the others stand in "modes".
void session::tell_alarm(double t) {
    ordered_json event{{"type", alarm_.standing() ? "alarm" : "alarm_over"}, {"t", t}};
    if (alarm_.standing()) {
        event.update(departure_json(alarm_.away().front()));
        event["modes"] = ordered_json::array();
        for (const departure& each : alarm_.away()) event["modes"].push_back(departure_json(each));
    }
    tell(std::move(event));
}

} // namespace okid_host
