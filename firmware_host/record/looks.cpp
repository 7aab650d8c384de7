// SPDX-License-Identifier: MIT
// PURPOSE  which of two looks at the same records is believed: the one that knows its modes better, or explains the outputs better
#include "looks.hpp"

#include "record_fit.hpp"
#include "result/judgement.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>

namespace okid_host {
namespace {

bool one_resonance(const listed_mode& a, const listed_mode& b) {
    return std::abs(a.frequency_hz - b.frequency_hz) <
           std::max(a.damping_ratio * a.frequency_hz, b.damping_ratio * b.frequency_hz);
}

} // namespace

std::size_t one_look::believed() const {
    std::size_t out = 0;
    for (std::size_t k = 0; k < listed.size(); ++k)
        out += listed[k].in_model && !(work.context.sigma && work.context.sigma->damping_ratio[k] >
                                                                 judgement::widest_damping * listed[k].damping_ratio);
    return out;
}

double deviations_over(const one_look& part, const one_look& whole, std::vector<std::string>& alone) {
    if (!part.work.context.sigma || !whole.work.context.sigma) return 1;
    const deviations &of_part = *part.work.context.sigma, &of_whole = *whole.work.context.sigma;
    double logs = 0, count = 0, all = 0;
    for (std::size_t i = 0; i < whole.listed.size(); ++i) {
        if (!whole.listed[i].in_model) continue;
        ++all;
        std::size_t k = 0;
        while (k < part.listed.size() && !(part.listed[k].in_model && one_resonance(part.listed[k], whole.listed[i])))
            ++k;
        if (k == part.listed.size()) {
            alone.push_back(fmt::format("{:.4g} Hz", whole.listed[i].frequency_hz));
            continue;
        }
        const double ratio =
            of_part.frequency_hz[k] / of_whole.frequency_hz[i] * of_part.damping_ratio[k] / of_whole.damping_ratio[i];
        if (ratio > 0) logs += std::log(ratio), ++count; // of NaN nothing is known
    }
    return count > 0 && count >= judgement::shared_modes * all ? std::exp(logs / 2 / count) : 1;
}

double power_left(const std::vector<listed_mode>& listed, record_set set, const record_options& options) {
    record_work trial = modal_trial(listed, std::move(set), options);
    fit_records(trial.set, trial.model, trial.context, &trial.states);
    double sum = 0, count = 0;
    for (const double percent : trial.context.simulation_percent.value_or(std::vector<double>()))
        if (percent == percent) sum += std::pow(1 - percent / 100, 2), ++count;
    return sum / count;
}

} // namespace okid_host
