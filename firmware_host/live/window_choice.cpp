// SPDX-License-Identifier: MIT
// PURPOSE  a window as long as the structure stands still
// METHOD   each length twice the one before, from the shortest that gives a model with deviations, until one disagrees with a
//          shorter one. Of nested windows the difference of two estimates has the variance of the shorter one less that of the longer
#include "window_choice.hpp"

#include "consensus/consensus.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>

namespace okid_host {
namespace {

constexpr double longer_by = 2, least_more = 1.2;                           // each length, and the last one at least
constexpr double most_sigmas = 3.5;                                         // of a Gaussian difference
constexpr double clear_sigma = 0.02, most_damping = 0.2, fewest_emac = 0.5; // of modes that are asked
constexpr double near_hz = 0.1, alike = 0.5; // of the same mode in another window: as standard deviations pair theirs
constexpr std::int64_t fewest_slots = 10;    // for standard deviations

/// The mode of another window that is nearest, none where all are far in frequency or shape.
const mode_shift* same_mode(const mode_shift& mode, const std::vector<mode_shift>& among) {
    const mode_shift* best = nullptr;
    double least = 1;
    for (const mode_shift& each : among) {
        const double f = (each.frequency_hz / mode.frequency_hz - 1) / near_hz;
        const double shape = (1 - shape_mac(mode.shape, each.shape)) / (1 - alike);
        if (const double distance = f * f + shape * shape; distance < least) least = distance, best = &each;
    }
    return best;
}

/// The Gaussian deviation that is as improbable as Student's t of so many degrees of freedom (Wallace 1959).
double as_gaussian(double t, double freedom) {
    return (8 * freedom + 1) / (8 * freedom + 3) * std::sqrt(freedom * std::log1p(t * t / freedom));
}

} // namespace

std::string window_reason(const window_choice& chosen, double rate_hz) {
    if (!chosen.against) return "";
    const window_choice::objection& by = *chosen.against;
    return fmt::format(
        "a mode at {:.5g} Hz in the newest {:.4g} s is at {:.5g} Hz in {:.4g} s, {:.1f} times what scatter explains",
        by.shorter_hz, static_cast<double>(by.shorter_rows) / rate_hz, by.longer_hz,
        static_cast<double>(by.longer_rows) / rate_hz, std::abs(by.longer_hz - by.shorter_hz) / by.sigma_hz);
}

window_chooser::window_chooser(const stream_config& config) : fewest_rows_(fewest_rows(config)) {}

std::int64_t window_chooser::fewest_rows(const stream_config& config) {
    const okid_identify_config_t identify = identify_config_of(config);
    const auto lags = static_cast<std::int64_t>(okid_identify_lags(&identify));
    const std::int64_t unknowns = identify.n_u + lags * static_cast<std::int64_t>(config.channels());
    return std::max(4 * unknowns, fewest_slots * sums_config_of(config).block);
}

/// The next longer window. @return false: there is none
bool window_chooser::grow(const okid_accumulator_t* whole, look& to) const {
    const std::int64_t before = to.rows;
    const double all = static_cast<double>(okid_accumulator_rows(whole)),
                 wanted = before == 0 ? static_cast<double>(fewest_rows_) : longer_by * static_cast<double>(before);
    if (before == 0) to.first = okid_accumulator_slots(whole);
    const bool last = all < least_more * wanted;
    while (to.first > 0 && (last || static_cast<double>(to.rows) < wanted))
        to.rows += okid_accumulator_slot_rows(whole, --to.first);
    return to.rows > before;
}

/// The mode of the shorter window that the longer one contradicts most, if any.
std::optional<window_choice::objection> window_chooser::disagreement(const look& shorter, const look& longer) const {
    std::optional<window_choice::objection> out;
    const double share = static_cast<double>(shorter.rows) / static_cast<double>(longer.rows);
    double most = most_sigmas;
    for (std::size_t k = 0; k < shorter.modes.size(); ++k) {
        const double sigma = shorter.sigma_hz[k] * std::sqrt(1 - share);
        const mode_shift* other = std::isfinite(sigma) ? same_mode(shorter.modes[k], longer.modes) : nullptr;
        if (!other) continue;
        const double off = std::abs(other->frequency_hz - shorter.modes[k].frequency_hz) / sigma;
        const double gaussian = as_gaussian(off, shorter.freedom);
        if (!(gaussian > most)) continue;
        most = gaussian;
        out = {shorter.rows, longer.rows, shorter.modes[k].frequency_hz, other->frequency_hz, sigma};
    }
    return out;
}

/// The modes of a model of the window, and their deviations where these can be relied on.
void window_chooser::describe(okid_accumulator_t* whole, okid_identify_t* by, live_blocks& blocks,
                              const okid_identified_t& model, look& to) const {
    to.modes =
        modes_in(model.frequency_hz, model.damping_ratio, model.shape_re, model.shape_im, model.mode_count, model.n_y);
    to.sigma_hz.assign(to.modes.size(), NAN);
    const std::optional<deviations> sigma = blocks.sigma(whole, by, model, {}, to.first);
    if (sigma) to.freedom = sigma->replicates - 1;
    for (std::size_t k = 0; sigma && k < to.modes.size(); ++k)
        if (sigma->frequency_hz[k] < clear_sigma * to.modes[k].frequency_hz &&
            to.modes[k].damping_ratio < most_damping && model.emac[k] > fewest_emac)
            to.sigma_hz[k] = sigma->frequency_hz[k];
}

okid_status_t window_chooser::run(okid_accumulator_t* whole, okid_identify_t* by, live_blocks& blocks,
                                  okid_identified_t& model) {
    chosen_ = {};
    std::vector<look> looks;
    for (look one; grow(whole, one);) {
        if (okid_identify_run(by, blocks.gather(whole, one.first), &model) < 0) continue;
        describe(whole, by, blocks, model, one);
        for (const look& each : looks)
            if (!chosen_.against) chosen_.against = disagreement(each, one);
        if (chosen_.against) break;
        chosen_.first = one.first;
        chosen_.rows = one.rows;
        looks.push_back(one);
    }
    return okid_identify_run(by, blocks.gather(whole, chosen_.first), &model);
}

} // namespace okid_host
