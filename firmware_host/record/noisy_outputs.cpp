// SPDX-License-Identifier: MIT
// PURPOSE  what a failing sensor says is no mode of the structure
// METHOD   a model of time-invariant modes explains good sensors alike. One that clips, changes its gain or polarity, or fails
//          for a while leaves much of itself, and poles of its own beside those of the structure: their shape is that sensor
#include "noisy_outputs.hpp"

#include "files/order_statistics.hpp"
#include "record_fit.hpp"
#include "result/judgement.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <utility>

namespace okid_host {
namespace {

/// Modes in the model that one output shows nearly alone, and that output.
std::vector<std::pair<std::size_t, std::size_t>> shown_by_one(const std::vector<listed_mode>& modes,
                                                              const record_work& work) {
    std::vector<std::pair<std::size_t, std::size_t>> out;
    for (std::size_t k = 0; k < modes.size(); ++k) {
        double all = 0, most = 0;
        std::size_t at = 0;
        for (std::size_t o = 0; o < modes[k].shape.size(); ++o) {
            const double power = std::norm(modes[k].shape[o] / work.scale[work.set.n_u + o]);
            all += power;
            if (power > most) most = power, at = o;
        }
        if (modes[k].in_model && most > judgement::in_a_noisy_output * all) out.emplace_back(k, at);
    }
    return out;
}

} // namespace

noisy_outputs noisy_outputs_of(const result_context& context) {
    noisy_outputs out;
    if (!context.simulation_percent || context.simulation_percent->size() < judgement::fewest_to_compare) return out;
    for (const double percent : *context.simulation_percent) out.left.push_back(1 - percent / 100);
    if (std::any_of(out.left.begin(), out.left.end(), [](double x) { return std::isnan(x); })) return out;
    std::vector<double> sorted = out.left;
    out.middle = in_order(sorted, (sorted.size() - 1) / 2);
    for (std::size_t o = 0; o < out.left.size(); ++o)
        if (out.left[o] > judgement::noisy_left && out.left[o] > judgement::noisier * out.middle)
            out.which.push_back(o);
    return out;
}

void remark_noisy_outputs(result_context& context) {
    const noisy_outputs found = noisy_outputs_of(context);
    for (const std::size_t o : found.which)
        context.warnings.emplace_back("noisy_output",
                                      fmt::format("output \"{}\" is much noisier than the rest: the model leaves "
                                                  "{:.0f} % of it, {:.1f} % of the middle one. Look at its sensor, "
                                                  "range and cable",
                                                  context.outputs[o], 100 * found.left[o], 100 * found.middle));
}

bool mark_of_noisy_outputs(std::vector<listed_mode>& modes, double fs_hz, record_work& work) {
    if (work.set.n_y < judgement::fewest_to_compare) return false;
    std::vector<std::pair<std::size_t, std::size_t>> alone = shown_by_one(modes, work);
    if (alone.empty()) return false;
    std::vector<listed_mode> listed = modes; // what doubtful ones explain is no noise
    for (listed_mode& mode : listed) mode.in_model = true;
    make_modal_model(listed, fs_hz, work);
    result_context trial;
    fit_records(work.set, work.model, trial);
    const std::vector<std::size_t> noisy = noisy_outputs_of(trial).which;
    const auto sound = [&noisy](const auto& one) {
        return std::find(noisy.begin(), noisy.end(), one.second) == noisy.end();
    };
    alone.erase(std::remove_if(alone.begin(), alone.end(), sound), alone.end());
    const auto believed =
        std::count_if(modes.begin(), modes.end(), [](const listed_mode& mode) { return mode.in_model; });
    if (alone.size() == static_cast<std::size_t>(believed)) return true; // there is nothing to compare with
    for (const auto& [k, output] : alone) doubt("noisy_output", work.context.verdicts[k], modes[k]);
    return true;
}

} // namespace okid_host
