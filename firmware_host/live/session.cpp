// SPDX-License-Identifier: MIT
#include "session.hpp"

#include "acquire/host_time.hpp"
#include "acquire/serial_line.hpp"
#include "acquire/stop_signal.hpp"
#include "error.hpp"
#include "files/whole_file.hpp"
#include "publish/service_notice.hpp"

#include <algorithm>
#include <cmath>
#include <ctime>
#include <drv/bus_load.h>
#include <fmt/format.h>

namespace okid_host {
namespace {

using nlohmann::ordered_json;

constexpr double stats_every_s = 5;

std::int64_t samples_of(double seconds, double rate_hz) {
    return std::max<std::int64_t>(1, std::llround(seconds * rate_hz));
}

ordered_json health_json(const bus_health& health) {
    const drv_stats_t& c = health.counts;
    ordered_json out;
    out["state"] = c.state == DRV_BUS_UNKNOWN ? ordered_json(nullptr) : ordered_json(drv_bus_state_name(c.state));
    out["errors"] = {{"messages", c.error_frames},  {"bus_off", c.bus_off},
                     {"restarted", c.restarts},     {"no_ack", c.no_ack},
                     {"tx_timeout", c.tx_timeouts}, {"rx_overflow", c.rx_overflows},
                     {"bus_error", c.bus_errors},   {"error_passive", c.error_passive},
                     {"link_down", c.link_down}};
    if (health.sync)
        out["sync"] = {{"sent", health.sync->sent},
                       {"missed", health.sync->missed},
                       {"late_mean_us", health.sync->late_mean_us},
                       {"late_sd_us", health.sync->late_sd_us},
                       {"late_worst_us", health.sync->late_worst_us}};
    return out;
}

/// Where a channel is looked for.
std::string place_text(const channel_config& channel) {
    if (channel.field) return fmt::format("field {}", *channel.field);
    return fmt::format("{}identifier {:#x}{}", channel.message.empty() ? "" : "message " + channel.message + ", ",
                       channel.frame.id, channel.frame.extended ? " extended" : "");
}

/// How the clock of a device runs beside the host's; null while that is not known.
ordered_json clock_json(const drv_clock_fit_t& clock) {
    double ppm = 0, sigma_ppm = 0;
    if (drv_clock_fit_rate(&clock, &ppm, &sigma_ppm) != 0) return nullptr;
    return {{"rate_ppm", ppm},
            {"rate_std_ppm", sigma_ppm},
            {"offset_std_us", 1e6 * std::sqrt(clock.variance[0])},
            {"outliers", clock.outliers},
            {"host_steps", clock.host_steps},
            {"restarts", clock.restarts}};
}

} // namespace

session::session(const live_config& config, const session_options& options)
    : config_(config), options_(options),
      publisher_(config, {options.events, options.table && options.events != "-" && options.json != "-", options.live,
                          options.listener && options.listener->wants_events()
                              ? [to = options.listener](const std::string& line) { to->on_event(line); }
                              : std::function<void(const std::string&)>()}),
      grid_(config, *this), silence_(config.channels.size(), config.rate_hz), check_(config), maker_(config),
      stream_(maker_.sums()), trigger_(config), hammer_(config, stream_.sums().lags()), losses_(config.buses.size()),
      health_(config.buses.size()), clocks_(config.buses.size()), busy_s_(config.buses.size(), 0.0),
      update_samples_(samples_of(config.identification.update_s, config.rate_hz)), rate_(config.rate_hz),
      updates_(maker_, options.live && options.identify, config.n_u + config.n_y, options.most_waiting) {
    if (options.live || (!options.events.empty() && options.events != "-")) catch_hangups();
    open_virtual();
    if (config.publish.samples) feed_.emplace(config, virtual_ ? virtual_->size() : 0);
    if (!options.live && !publisher_.watched())
        updates_.hurry(true); // those that the result does not rest on are left out
    stats_samples_ =
        update_samples_ * std::max<std::int64_t>(1, std::llround(stats_every_s / config.identification.update_s));
    if (options.duration_s) {
        limit_ = samples_of(*options.duration_s, config.rate_hz);
        grid_.set_limit(limit_);
    }
    if (options.trigger_ns) trigger_.edge(*options.trigger_ns);
    const drv_clock_config_t nanoseconds{1e9, 64, DRV_CLOCK_LATE, 0, 0};
    for (drv_clock_fit_t& clock : clocks_) (void)drv_clock_fit_init(&clock, &nanoseconds);
}

void session::tell(ordered_json event) {
    const double t = event.value("t", 0.0);
    publisher_.event(std::move(event), static_cast<double>(start_ns_) * 1e-9 + t);
}

void session::send_samples(const json_line& block) {
    if (block) publisher_.samples(block);
}

/// A log may be played where the file of [virtual] is not.
void session::open_virtual() {
    if (config_.virtual_sensors.model.empty() || !options_.identify) return;
    try {
        virtual_.emplace(config_);
    } catch (const failure& why) {
        if (options_.live) throw;
        say("okid: warning: no virtual sensors: {}\n", why.what());
    }
}

/// What the virtual channels show while nothing is measured.
void session::bridge(std::int64_t index, std::int64_t count) {
    if (relief_.stands(overload_step::pictures)) return;
    const std::int64_t end = index + std::min(count, virtual_->longest_bridge());
    for (; index < end; ++index) send_samples(feed_->add(index, nullptr, virtual_->add(index, nullptr)));
    send_samples(feed_->end_block());
}

void session::ready() { notify_service("READY=1"); }

void session::start(std::int64_t time_ns) {
    if (started_) return;
    started_ = true;
    start_ns_ = time_ns;
    ordered_json event{{"type", "start"}, {"t", 0.0}, {"config", config_.path}, {"wall_time", utc_text(time_ns)}};
    event["rate_hz"] = config_.rate_hz;
    for (const channel_config& channel : config_.channels)
        event["channels"].push_back({{"name", channel.name},
                                     {"role", channel_role_name(channel.role)},
                                     {"unit", channel.unit.empty() ? "" : channel.si_unit()},
                                     {"dof", channel.dof == 0 ? ordered_json(nullptr) : ordered_json(channel.dof)}});
    if (virtual_)
        for (ordered_json& one : virtual_->described()) event["channels"].push_back(std::move(one));
    for (const auto& [key, text] : config_.notes) event["notes"][key] = text;
    tell(event);
}

/// Time is taken at microseconds, as a log keeps it: live and replayed streams decide alike.
void session::frame(const drv_frame_t& frame) {
    if (done()) return;
    drv_frame_t stamped = frame;
    stamped.time_ns = frame.time_ns / 1000 * 1000;
    start(stamped.time_ns);
    if (frame.bus < busy_s_.size() && config_.buses[frame.bus].bitrate)
        busy_s_[frame.bus] +=
            drv_wire_seconds(&frame, *config_.buses[frame.bus].bitrate, config_.buses[frame.bus].dbitrate.value_or(0));
    if (frame.hw_time_ns != 0 && frame.bus < clocks_.size())
        (void)drv_clock_fit_add(&clocks_[frame.bus], static_cast<std::uint64_t>(frame.hw_time_ns), frame.time_ns);
    check_.add(stamped);
    if (options_.live && !remarked_ && check_.judged()) tell_remarks();
    grid_.push(stamped);
}

void session::on_sample(std::int64_t index, const double* row) {
    if (limit_ > 0 && index >= limit_) return;
    now_ = index + 1;
    rate_.add(index, grid_.time_ns(index));
    if (options_.listener) options_.listener->on_sample(index, row);
    silence_.add(index, row, [this](std::size_t channel, std::int64_t first) { tell_silent(channel, first); });
    if (!options_.identify) return;
    if (feed_ && !relief_.stands(overload_step::pictures))
        send_samples(feed_->add(index, row, virtual_ ? virtual_->add(index, row) : nullptr));
    if (hammer_.wanted()) {
        if (hammer_.add(index, row, 1)) strike();
    } else if (!trigger_.waiting())
        updates_.add(row);
    else if (trigger_.add(index, row, 1, grid_.time_ns(index)))
        begin(index);
    // While nothing comes there is nothing to update: one is enough, when the next sample is there.
    due_ = due_ || now_ % update_samples_ == 0;
    const double* const end = row + config_.n_u + config_.n_y;
    if (!due_ || std::all_of(row, end, [](double x) { return std::isnan(x); })) return;
    due_ = false;
    update(now_);
}

void session::on_missing(std::int64_t index, std::int64_t count) {
    if (limit_ > 0) count = std::min(count, limit_ - index);
    if (count <= 0) return;
    now_ = index + count;
    if (options_.listener) options_.listener->on_missing(index, count);
    silence_.add_missing(index);
    if (!options_.identify) return;
    if (feed_) send_samples(feed_->end_block());
    if (virtual_) bridge(index, count);
    if (hammer_.wanted()) {
        if (hammer_.add(index, nullptr, count)) strike();
    } else if (!trigger_.waiting())
        updates_.add_missing(count);
    else
        (void)trigger_.add(index, nullptr, count, 0);
    if (now_ / update_samples_ == index / update_samples_) return;
    due_ = false;
    update(now_);
}

void session::trigger_edge(std::int64_t time_ns) {
    trigger_.edge(time_ns);
    if (trigger_.look_back()) begin(now_);
}

/// The trigger has come: the samples that waited for it go in, with the updates up to sample `until` that they would
/// have had if it had been known at its time.
void session::begin(std::int64_t until) {
    const std::int64_t sample = trigger_.sample();
    const std::int64_t time_us = trigger_.time_ns() / 1000;
    tell({{"type", "trigger"},
          {"t", seconds(sample)},
          {"source", config_.trigger.source == trigger_source::gpio ? "gpio" : "level"},
          {"sample", sample},
          {"time_s", static_cast<double>(time_us) / 1e6}});
    trigger_.each_kept([&](std::int64_t first, const double* row, std::int64_t count) {
        if (row)
            updates_.add(row);
        else
            updates_.add_missing(count);
        const std::int64_t end = first + count;
        if (end > sample && end <= until && end / update_samples_ > first / update_samples_) hand_over(end);
    });
}

/// A hit was judged: an accepted one goes in as a record of its own.
void session::strike() {
    const hit_report& hit = hammer_.report();
    ordered_json event{
        {"type", "hit"},          {"t", seconds(now_)},
        {"number", hit.number},   {"sample", hit.sample},
        {"accepted", hit.good()}, {"reason", hit.good() ? ordered_json(nullptr) : ordered_json(hit.fault)},
        {"text", hit.text}};
    if (hit.duration_s > 0)
        event.update({{"peak", hit.peak}, {"duration_s", hit.duration_s}, {"force_band_hz", hit.band_hz}});
    if (hit.point != 0) event["point"] = hit.point;
    event.update({{"accepted_hits", hit.accepted}, {"left", hit.left}});
    tell(std::move(event));
    if (!hit.good()) {
        await(now_);
        return;
    }
    updates_.add_missing(0);
    hammer_.each_row([&](const double* row) { updates_.add(row); });
    hand_over(now_);
}

lamp_state session::lamps() const {
    lamp_state out;
    if (hammer_.wanted()) {
        out.armed = hammer_.armed();
        out.go = hammer_.last_good();
        out.alarm = alarm_;
        return out;
    }
    out.armed = trigger_.waiting() || config_.trigger.source == trigger_source::immediate;
    out.go = settled_;
    out.alarm = alarm_;
    return out;
}

void session::on_gap(const grid_gap& gap) {
    ++gaps_;
    if (options_.listener) options_.listener->on_gap(gap);
    ordered_json event{{"type", "gap"},
                       {"t", seconds(std::max(now_, gap.last + 1))},
                       {"channel", config_.channels[gap.channel].name},
                       {"first", gap.first},
                       {"last", gap.last},
                       {"count", gap.count},
                       {"cause", gap_cause_name(gap.cause)}};
    if (gap.within > 0) event["within"] = gap.within;
    tell(std::move(event));
}

/// Frames missing on the grid are booked under what the devices counted first; the rest was lost before it reached us.
ordered_json session::bus_stats(std::size_t bus) const {
    const grid_bus_counts counts = grid_.bus(bus);
    const auto lost = [&](gap_cause cause) { return counts.lost[static_cast<std::size_t>(cause)]; };
    const auto beyond = [](std::uint64_t seen, std::uint64_t booked) { return seen > booked ? seen - booked : 0; };
    // A controller tells how often it overran, not how many frames that cost: the holes behind it say so.
    const bool overran = health_[bus] && health_[bus]->counts.lost_driver > 0;
    const std::uint64_t overflow = losses_[bus].socket_overflow,
                        driver = std::max(losses_[bus].driver, overran ? lost(gap_cause::driver) : 0);
    const std::uint64_t sequence = lost(gap_cause::sequence) + beyond(lost(gap_cause::socket_overflow), overflow) +
                                   beyond(lost(gap_cause::driver), driver);
    const std::uint64_t link = lost(gap_cause::link_down), stall = lost(gap_cause::stall), crc = lost(gap_cause::crc);
    ordered_json out;
    out["received"] = counts.received;
    out["lost"] = overflow + driver + sequence + crc + link + stall;
    out["lost_by"] = {{"socket_overflow", overflow}, {"driver", driver}, {"sequence", sequence}, {"crc", crc},
                      {"link_down", link},           {"stall", stall}};
    out["out_of_order"] = counts.out_of_order;
    out["too_late"] = counts.too_late;
    out["duplicate"] = counts.duplicate;
    out["decode_errors"] = counts.decode_errors;
    const bool known = config_.buses[bus].bitrate && now_ > 0;
    out["load_percent"] =
        known ? ordered_json(std::round(1e4 * busy_s_[bus] / seconds(now_)) / 100) : ordered_json(nullptr);
    if (health_[bus])
        out.update(config_.buses[bus].on_line() ? line_json(health_[bus]->counts) : health_json(*health_[bus]));
    if (clocks_[bus].started) out["clock"] = clock_json(clocks_[bus]);
    return out;
}

void session::bus_event(std::size_t bus, const char* kind, const std::string& text) {
    if (started_)
        tell(
            {{"type", "bus"}, {"t", seconds(now_)}, {"bus", config_.buses[bus].name}, {"event", kind}, {"text", text}});
}

void session::record_event(const std::string& kind, const std::string& text) {
    tell({{"type", "record"}, {"t", seconds(now_)}, {"event", kind}, {"text", text}});
}

ordered_json session::stats_event() const {
    ordered_json event{
        {"type", "stats"}, {"t", seconds(now_)}, {"bus", ordered_json::object()}, {"channel", ordered_json::object()}};
    for (std::size_t i = 0; i < config_.buses.size(); ++i) event["bus"][config_.buses[i].name] = bus_stats(i);
    for (std::size_t i = 0; i < config_.channels.size(); ++i) {
        const grid_channel_counts counts = grid_.channel(i);
        const double percent =
            counts.expected ? 100.0 * static_cast<double>(counts.received) / static_cast<double>(counts.expected) : 0.0;
        event["channel"][config_.channels[i].name] = {{"expected", counts.expected},
                                                      {"received", counts.received},
                                                      {"missing", counts.expected - counts.received},
                                                      {"completeness_percent", percent}};
        if (counts.uncertain > 0) event["channel"][config_.channels[i].name]["uncertain"] = counts.uncertain;
        if (counts.place_std_s > 0)
            event["channel"][config_.channels[i].name]["place_std_us"] = 1e6 * counts.place_std_s;
    }
    for (const clock_skew& skew : grid_.skews())
        event["channel"][config_.channels[skew.channel].name].update(
            {{"skew_us", skew.us}, {"skew_std_us", skew.std_us}, {"rate_ppm", skew.rate_ppm}});
    const double rate_hz = observed_rate_hz();
    event["rate_hz_by_stamps"] = rate_hz > 0 ? ordered_json(rate_hz) : ordered_json(nullptr);
    if (options_.identify) event["updates"] = {{"made", updates_made_}, {"skipped", updates_skipped_}};
    return event;
}

/// Why nothing of a channel is on the grid, though the stream is.
std::string session::silence(std::size_t index) const {
    const channel_config& channel = config_.channels[index];
    const std::string others = check_.others(channel.bus);
    if (check_.frames_of(index) > 0 && !channel.field)
        return fmt::format("frames of it came, but none {}; are its bits in {} right?",
                           channel.selectors.empty()
                               ? "is long enough for the signal"
                               : "carries the signal (its multiplexor has other values, or the frames are short)",
                           config_.path);
    if (const std::string other = check_.same_group(index); !other.empty()) return other;
    return fmt::format("{}is the sensor on, and are {} and bus right in {}?",
                       others.empty() ? "" : "it carries " + others + "; ", channel.field ? "field" : "identifier",
                       config_.path);
}

/// A channel that never spoke is the likeliest reason for no model: say so before the algebra does.
void session::check_heard() const {
    for (const std::size_t index : grid_.silent_channels()) {
        const channel_config& channel = config_.channels[index];
        if (channel.role == channel_role::aux) continue;
        throw failure(exit_no_model, fmt::format("no usable {} of channel \"{}\" was received ({}, bus \"{}\"): {}",
                                                 channel.field ? "sample" : "frame", channel.name, place_text(channel),
                                                 config_.buses[channel.bus].name, silence(index)));
    }
}

result_context session::context() {
    result_context out = stream_.context(config_.unit_remarks);
    for (auto& remark : check_.doubts()) out.warnings.push_back(std::move(remark));
    return out;
}

/// A rate_hz that is not that of the stamps scales every frequency. Not part of the result, which is the same for every
/// speed a log is played at: it is reported on stderr, and the stats carry the number.
void session::remark_rate() const {
    constexpr double tolerance = 0.02;
    const double observed_hz = observed_rate_hz();
    if (observed_hz == 0) return;
    if (std::abs(observed_hz / config_.rate_hz - 1) <= tolerance + 2.0 / static_cast<double>(now_)) return;
    say("okid: warning: by the time stamps {:.4g} samples came a second, but rate_hz is {:.10g}: every frequency "
        "scales with it. Fix rate_hz in {}, unless the frames were played at another speed\n",
        observed_hz, config_.rate_hz, config_.path);
}

/// What does not fit the configuration is reported at once when it is known, again where it is the likely reason for no
/// model; a result has it among its warnings.
void session::tell_remarks() {
    remarked_ = true;
    for (const auto& [code, text] : check_.doubts()) say("okid: warning: {}\n", text);
}

/// Channels on clocks of their own: how well their time is known, and what that is in phase at each mode.
void session::remark_clocks(result_context& about) const {
    const okid_identified_t& model = stream_.model();
    for (const clock_skew& skew : grid_.skews()) {
        std::string phases;
        for (int k = 0; k < model.mode_count; ++k)
            phases += fmt::format("{}{:.2g}", k ? ", " : "", 360e-6 * skew.std_us * model.frequency_hz[k]);
        about.warnings.emplace_back(
            "resampled",
            fmt::format(
                "{} has a clock of its own ({:+.1f} ppm): resampled onto the grid, good up to {:.4g} Hz. Its time "
                "is known to {:.2g} us (σ, beside a constant delay of its bus), in phase {} degrees at the modes",
                config_.channels[skew.channel].name, skew.rate_ppm, fir_kernel::pass_band * config_.rate_hz,
                skew.std_us, phases.empty() ? "-" : phases));
    }
    if (config_.decimate > 1)
        about.warnings.emplace_back("decimated",
                                    fmt::format("one sample of {} is kept, behind the same anti-alias filter for every "
                                                "channel: good up to {:.4g} Hz",
                                                config_.decimate, fir_kernel::pass_band * config_.rate_hz));
}

/// Channels without a counter whose bursts all end alike: what their arrivals cannot show.
void session::remark_places(result_context& about) const {
    const okid_identified_t& model = stream_.model();
    for (std::size_t c = 0; c < config_.channels.size(); ++c) {
        const grid_channel_counts counts = grid_.channel(c);
        const std::string& name = config_.channels[c].name;
        if (config_.channels[c].role == channel_role::aux) continue;
        if (counts.uncertain > 0)
            about.warnings.emplace_back(
                "place_uncertain",
                fmt::format(
                    "\"{}\" has no counter: at {} place{} its frames began to come later. Polls slipped past a "
                    "sample, or the sender was late to the end of the stream, or samples are missing there and the "
                    "channel is late by them from then on; only a counter tells",
                    name, counts.uncertain, counts.uncertain == 1 ? "" : "s"));
        double worst = 0; // of R: the phase of the delay beside that of the damping
        for (int k = 0; k < model.mode_count; ++k)
            worst = std::max(worst, 3.14159265 * model.frequency_hz[k] * counts.place_std_s / model.damping_ratio[k]);
        if (worst < 0.01) continue;
        about.warnings.emplace_back(
            "burst_delay",
            fmt::format("\"{}\" comes in bursts that all end alike: beside channels of other buses its time "
                        "is known to {:.2g} us (σ) only{}; a counter, or a sensor on the same bus, fixes it",
                        name, 1e6 * counts.place_std_s,
                        config_.identification.mkr
                            ? fmt::format(", by which R may be {:.0f} % wrong (σ): do not trust it", 100 * worst)
                            : ""));
    }
}

void session::remark_converted(result_context& about) const {
    if (!config_.identification.mkr || config_.n_u == 0) return;
    for (const channel_config& channel : config_.channels)
        if (channel.dof > 0 && channel.role != channel_role::aux && channel.unit == "g")
            about.warnings.emplace_back(
                "unit_converted", fmt::format("\"{}\" is in g: all numbers of it are in m/s^2 here", channel.name));
}

void session::finish() {
    if (options_.live) notify_service("STOPPING=1");
    grid_.finish();
    if (feed_) send_samples(feed_->end_block());
    start(std::int64_t{std::time(nullptr)} * 1000000000); // nothing was heard at all
    tell_updates(updates_.finish());
    const okid_status_t status = options_.identify ? stream_.sums().run(stream_.config().mass) : OKID_OK;
    tell(stats_event());
    if (!options_.identify) return publisher_.finish();
    check_heard();
    if (trigger_.waiting()) throw failure(exit_no_model, trigger_.missed());
    if (const std::string lacking = hammer_.shortfall(); !lacking.empty()) {
        if (hammer_.accepted() == 0) throw failure(exit_no_model, lacking);
        say("okid: warning: {}\n", lacking);
    }
    result_context about = context();
    remark_rate();
    if (status < 0) {
        tell_remarks();
        stream_.refuse(status, about);
    }
    stream_.remark_fit(about);
    remark_clocks(about);
    remark_places(about);
    remark_converted(about);
    if (updates_given_up_ > 0)
        about.warnings.emplace_back(
            "updates_given_up",
            fmt::format(
                "the machine was too slow for {} updates whose models are watched for changes of the structure: "
                "a change may not have been noticed, okid replay of the journal looks again",
                updates_given_up_));
    stream_.add_mass(about);
    stream_.add_sigma(about);
    const ordered_json result = result_json(stream_.model(), about);
    tell({{"type", "result"}, {"t", seconds(now_)}, {"result", result}});
    const std::string text = result.dump(-1, ' ', false, ordered_json::error_handler_t::replace) + "\n";
    const bool to_file = !options_.json.empty() && options_.json != "-";
    if (to_file) write_whole_file(options_.json, text); // first: a slow reader may hold up the end of the events
    publisher_.finish();
    if (!options_.json.empty() && !to_file) write_whole_file("-", text);
    if (options_.table && !publisher_.events_on_stdout() && options_.json != "-")
        write_whole_file("-", shown(result_table(stream_.model(), about)));
}

} // namespace okid_host
