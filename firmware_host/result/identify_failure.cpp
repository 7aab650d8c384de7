// SPDX-License-Identifier: MIT
// Why no model could be identified, and what to do about it.
#include "error.hpp"
#include "method.hpp"
#include "result.hpp"

#include <fmt/format.h>

namespace okid_host {
namespace {

/// Name of channel number `channel` (inputs first), with its kind.
std::string channel_name(int channel, const result_context& context) {
    const auto at = static_cast<std::size_t>(channel);
    if (channel < 0) return "a channel";
    if (at < context.inputs.size()) return fmt::format("input \"{}\"", context.inputs[at]);
    if (at - context.inputs.size() < context.outputs.size())
        return fmt::format("output \"{}\"", context.outputs[at - context.inputs.size()]);
    return fmt::format("channel {}", channel + 1);
}

/// What to try where no mode was found.
std::string advice(const okid_identify_config_t& config, const std::string& option) {
    const bool subspace = is_subspace(config.method);
    if (config.n_u == 0)
        return fmt::format("{}Otherwise the record shows no vibration that lasts: try another {} or an --order",
                           subspace ? "" : "A free decay (ring-down) needs method n4sid-cva or n4sid-moesp. ", option);
    return fmt::format("Is the record long enough, do the outputs answer the inputs, are the two not exchanged? Try {}"
                       "another {} or an --order",
                       subspace ? "" : "method n4sid-moesp, which needs fewer samples, ", option);
}

std::string reason(okid_status_t status, const okid_identified_t& model, const okid_identify_config_t& config,
                   const result_context& context) {
    const okid_observer_info_t& info = model.observer_info;
    const long long q = config.n_u + static_cast<long long>(okid_identify_lags(&config)) * (config.n_u + config.n_y);
    const std::string horizon = horizon_option(config), option = horizon.substr(0, horizon.find(' '));
    switch (status) {
    case OKID_ERR_TOO_SHORT:
        return fmt::format(
            "too few samples: {} usable rows, but {} has {} unknowns per output and needs more than {} rows in "
            "unbroken stretches (10 times as many are advised). Record longer, lower {}, or fix the gaps",
            model.regression_rows, horizon, q, q + config.n_y, option);
    case OKID_ERR_INPUT:
        return fmt::format(
            "{} is constant: it excites nothing. Leave it out of --inputs, or check the force sensor and its wiring",
            channel_name(info.channel, context));
    case OKID_ERR_OUTPUT:
        return fmt::format(
            "{} is constant: it measures nothing. Leave it out of --outputs, or check the sensor and its wiring",
            channel_name(info.channel, context));
    case OKID_ERR_EXCITATION:
        if (info.channel >= 0)
            return fmt::format(
                "not enough excitation: {} repeats the inputs before it and cannot be told apart from them. "
                "Leave it out, or drive the forces independently",
                channel_name(info.channel, context));
        return fmt::format(
            "not enough excitation: the inputs cannot be told apart over {} lags (smallest over largest {:.1e}). Use "
            "independent broad-band forces or lower {}",
            okid_identify_lags(&config), info.input_excitation, option);
    case OKID_ERR_UNSTABLE:
        return fmt::format("no stable observer: plain least squares has spectral radius {:.6g}, and no ridge of the "
                           "grid makes it stable. "
                           "Try --detrend linear, a smaller --p, or a record without drift",
                           info.radius_plain);
    case OKID_ERR_NO_MODES:
        return fmt::format("no stable mode (underdamped, below {:g} Hz, EMAC above 0.5) was found. {}",
                           context.fs_hz / 2, advice(config, option));
    case OKID_ERR_NUMERIC:
        return fmt::format("a factorisation did not converge. Check the record for extreme values; try a smaller {}",
                           option);
    default: return okid_status_text(status);
    }
}

} // namespace

void throw_identify_failure(okid_status_t status, const okid_identified_t& model, const okid_identify_config_t& config,
                            const result_context& context) {
    std::string text = "no model: " + reason(status, model, config, context);
    for (const auto& [code, adapted] : context.warnings) // what was adapted to the record is a likely reason
        if (code == "p_reduced" || code == "rows_reduced") text += fmt::format(" ({})", adapted);
    throw failure(exit_no_model, text, status);
}

} // namespace okid_host
