// SPDX-License-Identifier: MIT
// PURPOSE  updates and results of a running stream, for the live program and for other languages
// METHOD   an update identifies, gives the modes their tracks and looks whether they rest. A model at rest is watched, and a
//          change of the structure comes with the next update; which updates may give that model depends on the samples
//          alone, and these are never left out, so that a slow machine comes to the same result
#include "stream.hpp"

#include "error.hpp"
#include "record/record_check.hpp"
#include "result/method.hpp"
#include "stream_state.hpp"

#include <fmt/format.h>
#include <utility>

namespace okid_host {
namespace {

/// What a model rests on at least, s; 0 where nothing is forgotten.
double memory_s(const stream_config& config) {
    if (config.wanted.window == "auto")
        return static_cast<double>(window_chooser::fewest_rows(config)) / config.rate_hz;
    if (config.wanted.window_s) return *config.wanted.window_s;
    const double lambda = config.wanted.forgetting.value_or(1.0);
    return lambda < 1 ? 1 / ((1 - lambda) * config.rate_hz) : 0;
}

} // namespace

stream::stream(stream_config config)
    : config_(std::move(config)), identifier_(config_),
      tracks_(static_cast<int>(config_.outputs.size()), identifier_.most_modes(), memory_s(config_)),
      baseline_tracks_(static_cast<int>(config_.outputs.size()), identifier_.most_modes(), memory_s(config_)) {}

void stream::reset() {
    identifier_.reset();
    forget_updates();
}

std::vector<std::byte> stream::state() { return with_head(config_, identifier_.state()); }

void stream::restore(const void* state, std::size_t bytes) {
    const state_body body = behind_head(config_, state, bytes);
    identifier_.restore(body.from, body.bytes);
    forget_updates();
}

void stream::merge(const void* state, std::size_t bytes) {
    const state_body body = behind_head(config_, state, bytes);
    identifier_.merge(body.from, body.bytes);
}

void stream::forget_updates() {
    settling_.reset();
    baseline_settling_.reset();
    settled_ = false;
    tracks_.jump();
    baseline_tracks_.jump();
    looks_ = 0;
    look_at_ = 0;
    changed_at_ = restarted_at_ = restarts_reported_ = 0;
}

std::optional<stream_update::change> stream::take_change(std::int64_t now) {
    const std::optional<std::int64_t> ago = identifier_.take_change();
    if (!ago) return std::nullopt;
    changed_at_ = now - *ago;
    looks_ = 0;
    look_at_ = 0;
    const bool restarted = identifier_.restarts() > restarts_reported_;
    restarts_reported_ = identifier_.restarts();
    if (restarted) {
        restarted_at_ = now - identifier_.basis();
        for (mode_tracks* each : {&tracks_, &baseline_tracks_}) each->jump();
        for (settling* each : {&settling_, &baseline_settling_}) each->reset();
    }
    return stream_update::change{changed_at_, restarted};
}

void stream::give_tracks(mode_tracks& by, std::vector<int>& to) {
    to = by.update(model());
    for (std::size_t k = 0; k < to.size(); ++k)
        if (doubtful(k)) to[k] = 0;
}

/// The model of an obliged update, if there is one: is it at rest beside those of the others?
void stream::look_for_baseline(const stream_update& found) {
    static const std::vector<double> unknown;
    if (found.status < 0) {
        baseline_settling_.reset();
    } else {
        give_tracks(baseline_tracks_, baseline_signed_);
        if (baseline_settling_.add(model(), baseline_signed_, found.sigma ? found.sigma->frequency_hz : unknown))
            identifier_.watch_model();
    }
    if (++looks_ < 3) return;
    looks_ = 0;
    look_at_ = identifier_.samples() + identifier_.basis() / 2;
}

stream_update stream::update(std::int64_t now) {
    stream_update out;
    out.changed = take_change(now);
    out.rows = identifier_.rows();
    const std::int64_t samples = identifier_.stats().samples;
    const bool fed = std::exchange(samples_seen_, samples) != samples;
    settled_ = false;
    if (out.rows < needed()) {
        settling_.reset();
        return out;
    }
    const bool baseline = obliged();
    if (identifier_.decides()) since_ = now;
    out.since = since_;
    out.status = identifier_.update();
    if (out.status < 0) {
        settling_.reset();
    } else {
        static const std::vector<double> unknown;
        out.sigma = identifier_.sigma({});
        give_tracks(tracks_, signed_tracks_);
        out.tracks = &signed_tracks_;
        const bool rests = settling_.add(model(), *out.tracks, out.sigma ? out.sigma->frequency_hz : unknown);
        out.settled = settled_ = rests && fed; // without a complete sample since the last update it only repeats itself
    }
    if (baseline) look_for_baseline(out);
    return out;
}

void stream::identify() {
    const okid_status_t status = identifier_.run(config_.mass);
    if (status < 0) refuse(status, context());
}

void stream::refuse(okid_status_t status, const result_context& about) const {
    if (identifier_.agreed()) identifier_.agreed()->refuse();
    throw_identify_failure(status, model(), identifier_.config(), about);
}

result_context stream::context(remarks said) {
    const okid_accumulator_stats_t stats = identifier_.stats();
    const agreement* agreed = identifier_.agreed();
    result_context out;
    if (agreed) {
        out = agreed->found().context;
        out.warnings.insert(out.warnings.begin(), said.begin(), said.end());
        if (agreed->overflowed())
            out.warnings.emplace_back(
                "memory_full", fmt::format("the result rests on the newest {} samples: max_memory_mb holds no more "
                                           "of the hits at several places",
                                           identifier_.basis()));
    } else {
        out.warnings = std::move(said);
        out.warnings.insert(out.warnings.end(), config_.said.begin(), config_.said.end());
        out.method = config_.wanted.method;
        if (!looks_back_rows(method_of(out.method), config_.inputs.size())) out.hankel = config_.wanted.hankel;
        out.fs_hz = config_.rate_hz;
        out.samples = identifier_.basis();
        out.gaps = stats.gaps;
        out.hold = config_.wanted.hold;
        out.detrend = config_.wanted.detrend;
        out.inputs = config_.inputs;
        out.outputs = config_.outputs;
        if (const sum_refiner* refiner = identifier_.refiner()) {
            out.refined = refiner->refined();
            if (!refiner->fault().empty() && config_.wanted.refine == "yes")
                out.warnings.push_back(refine_failed(refiner->fault()));
            if (out.refined && !out.refined->converged) out.warnings.push_back(refine_unconverged(*out.refined));
        }
    }
    if (const window_choice* chosen = identifier_.window(); chosen && chosen->against)
        out.warnings.emplace_back("window_shortened",
                                  fmt::format("the result rests on the newest {:.4g} s of the window: {}",
                                              static_cast<double>(chosen->rows) / config_.rate_hz,
                                              window_reason(*chosen, config_.rate_hz)));
    if (stats.missing > 0 && !agreed)
        out.warnings.push_back(missing_samples({stats.missing, stats.gaps}, stats.samples + stats.missing));
    if (identifier_.restarts() > 0)
        out.warnings.emplace_back(
            "restarted", fmt::format("the structure changed: the result rests on the {} samples after sample {}",
                                     out.samples, restarted_at_));
    else if (changed_at_ > 0)
        out.warnings.emplace_back(
            "changed", fmt::format("the structure changed near t = {:.4g} s, and the result mixes what was before with "
                                   "what came after: set window_s or forgetting",
                                   static_cast<double>(changed_at_) / config_.rate_hz));
    if (stats.saturated > 0)
        out.warnings.emplace_back(
            "saturated",
            fmt::format("{} codes stood at full scale: taken as they are, but a clipped signal bends every mode; lower "
                        "the gain or the force",
                        stats.saturated));
    return out;
}

void stream::remark_fit(result_context& about) {
    if (!identifier_.agreed()) remark_low_fit(identifier_.predicted_percent(), false, about);
}

void stream::add_mass(result_context& about) const {
    if (!config_.mass.wanted() || identifier_.agreed()) return;
    about.modal_masses = modal_masses_of(model(), config_.mass);
    try {
        about.mass = find_mass_matrices(model(), config_.mass, about.warnings);
    } catch (const failure& why) {
        about.warnings.emplace_back("mkr_failed", why.what());
    }
}

void stream::add_sigma(result_context& about) {
    if (identifier_.agreed()) return;
    about.sigma = identifier_.sigma(about.mass ? config_.mass : mass_plan{});
    if (about.mass && about.sigma) add_deviations(*about.sigma, *about.mass, about.warnings);
}

} // namespace okid_host
