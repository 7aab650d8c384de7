// SPDX-License-Identifier: MIT
// PURPOSE  the likeliest modes near those agreed on
// METHOD   okid/refine.h from the modal model; taken as a whole or not at all
#include "modal_refine.hpp"

#include "carrier.hpp"
#include "record_hold.hpp"
#include "record_refine.hpp"

#include <cmath>
#include <fmt/format.h>

namespace okid_host {
namespace {

constexpr double enough_of_all = 0.5; // of all samples, that a refinement has
constexpr double same_frequency = 0.005, same_damping = 1.5,
                 same_shape = 0.95; // a mode that a refinement has not changed
constexpr double known_less =
    3; // times, by a part of the samples: the mode decays before them. Deviations by agreement were up
       // to 2.9 times too small (4 masses, one hit)

/// Is this mode still the one it was?
bool same_mode(const listed_mode& before, const carried_mode& after) {
    const double f = after.frequency_hz / before.frequency_hz, zeta = after.damping_ratio / before.damping_ratio;
    return std::abs(f - 1) < same_frequency && zeta > 1 / same_damping && zeta < same_damping &&
           shape_mac(before.shape, after.shape) > same_shape;
}

/// The refined modes in the place of those in the model, with their deviations.
void take_refined(const std::vector<std::optional<carried_mode>>& found, std::vector<listed_mode>& listed,
                  record_work& work) {
    deviations* sigma = work.context.sigma ? &*work.context.sigma : nullptr;
    std::size_t next = 0;
    for (std::size_t i = 0; i < listed.size(); ++i) {
        listed_mode& mode = listed[i];
        if (!mode.in_model) continue;
        const carried_mode& from = *found[next++];
        mode.frequency_hz = from.frequency_hz;
        mode.damping_ratio = from.damping_ratio;
        mode.mpc = from.mpc;
        mode.shape = from.shape;
        if (!sigma) continue;
        work.shifts[i] = from.shifts;
        sigma->frequency_hz[i] = from.frequency_std_hz;
        sigma->damping_ratio[i] = from.damping_std;
        const auto at = static_cast<std::ptrdiff_t>(i * mode.shape.size());
        std::copy(from.shape_re_std.begin(), from.shape_re_std.end(), sigma->shape_re.begin() + at);
        std::copy(from.shape_im_std.begin(), from.shape_im_std.end(), sigma->shape_im.begin() + at);
    }
}

/// The agreement rests on all samples, a refinement on those that are kept, in long stretches without a missing force. Of half of
/// them its deviations grow by 1.4; those of the agreement were up to 4 times as wide as its own (six masses, 600,000 samples,
/// 2 % noise at the sensors).
bool is_enough(std::size_t samples, const record_work& work) {
    return static_cast<double>(samples) >= enough_of_all * static_cast<double>(work.context.samples);
}

/// The likelihood is that of a force that is held between samples. One behind an anti-alias filter is not: on simulated
/// laboratory records the intervals of the refined values held damping in 76 % instead of 92 %, white as the residuals were.
bool is_held(const record_options& options, const record_set& set) {
    return options.hold == "auto" ? !falls_to_nyquist(set) : options.hold != "band";
}

/// @param by  the samples, with the model of the modes; @param part  they are not all
bool refine_by(const record_work& by, bool part, const record_options& options, std::vector<listed_mode>& listed,
               record_work& work) {
    const bool forced = by.set.n_u > 0;
    const noise_colour colour =
        forced ? noise_colour::any : noise_colour::white; // else vibration is noise of its colour
    const auto reject = [&](const std::string& fault) {
        if (options.refine == "yes")
            work.context.warnings.emplace_back(
                "refine_failed",
                fmt::format("the modes are those of the agreement, the refinement was rejected: {}", fault));
        return false;
    };
    if (work.force_is_older) return reject("the newest samples have too little of the force");
    if (const std::size_t samples = refinable_samples(by); (forced || part) && !is_enough(samples, work))
        return reject(fmt::format("it could use {} of {} samples alone", samples, work.context.samples));
    if (options.stage) options.stage("refining the modes");
    const bool constants = options.detrend != "none";
    if (options.refine == "auto" && whiteness_nearby(constants, by, colour) > 2 * nearly_white) return false;
    std::vector<mode_shift> wanted;
    std::vector<const listed_mode*> before;
    for (const listed_mode& mode : listed) {
        if (!mode.in_model) continue;
        wanted.push_back({mode.frequency_hz, mode.damping_ratio, mode.shape});
        before.push_back(&mode);
    }
    const likeliest_model one = likeliest(constants, by, colour);
    std::string fault = one.status < 0 ? okid_status_text(one.status) : "";
    if (fault.empty() && !one.found.converged) fault = "it did not converge";
    if (fault.empty() && options.refine == "auto" && one.found.whiteness > nearly_white)
        fault = "its residual is not white";
    std::vector<std::optional<carried_mode>> found;
    if (fault.empty()) found = carried_by(one.model, one.replicates, wanted);
    for (std::size_t i = 0; i < found.size() && fault.empty(); ++i)
        if (!found[i] || !same_mode(*before[i], *found[i]))
            fault = fmt::format("the mode at {:.4g} Hz would be another one", before[i]->frequency_hz);
        else if (part && work.context.sigma &&
                 found[i]->damping_std >
                     known_less *
                         work.context.sigma->damping_ratio[static_cast<std::size_t>(before[i] - listed.data())])
            fault = fmt::format("the mode at {:.4g} Hz decays before what is used", before[i]->frequency_hz);
    if (!fault.empty()) return reject(fault);
    take_refined(found, listed, work);
    work.context.refined = one.found;
    return true;
}

} // namespace

bool decay_freely(const std::vector<listed_mode>& modes, record_set set, const record_options& options) {
    const record_work trial = modal_trial(modes, std::move(set), options);
    return trial.model.n_z > 0 &&
           whiteness_nearby(options.detrend != "none", trial, noise_colour::white) <= 2 * nearly_white;
}

bool refine_agreed(const record_options& options, const record_set& decays, std::vector<listed_mode>& listed,
                   record_work& work) {
    if (options.refine == "no" || work.model.n_z == 0 || (work.set.n_u == 0 && work.before)) return false;
    const bool whole = options.refine == "yes" || work.set.n_u == 0 || is_held(options, work.set);
    return (whole && refine_by(work, false, options, listed, work)) || refine_decays(decays, options, listed, work);
}

bool refine_decays(const record_set& decays, const record_options& options, std::vector<listed_mode>& listed,
                   record_work& work) {
    if (options.refine == "no" || decays.records.empty()) return false;
    const record_work trial = modal_trial(listed, decays, options);
    return trial.model.n_z > 0 && refine_by(trial, true, options, listed, work);
}

} // namespace okid_host
