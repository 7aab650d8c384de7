// SPDX-License-Identifier: MIT
#include "result.hpp"

#include "error.hpp"
#include "json_number.hpp"
#include "judgement.hpp"
#include "method.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <functional>

namespace okid_host {
namespace {

using nlohmann::ordered_json;

ordered_json vector_json(const double* values, int count) {
    ordered_json out = ordered_json::array();
    for (int i = 0; i < count; ++i) out.push_back(number_json(values[i]));
    return out;
}

/// Column-major in, rows of rows out; without columns (ambient B and D) as many empty rows.
ordered_json matrix_json(const double* values, int rows, int columns) {
    if (!values && columns > 0) return nullptr;
    ordered_json out = ordered_json::array();
    for (int i = 0; i < rows; ++i) {
        ordered_json row = ordered_json::array();
        for (int j = 0; j < columns; ++j) row.push_back(number_json(values[i + static_cast<std::ptrdiff_t>(j) * rows]));
        out.push_back(std::move(row));
    }
    return out;
}

ordered_json model_json(const okid_identified_t& model, const result_context& context) {
    const int n_u = model.n_u, n_y = model.n_y, n_z = model.n_z;
    ordered_json out;
    out["dt"] = number_json(model.dt);
    out["A"] = matrix_json(model.A, n_z, n_z);
    out["B"] = matrix_json(model.B, n_z, n_u);
    out["C"] = matrix_json(model.C, n_y, n_z);
    out["D"] = matrix_json(model.D, n_y, n_u);
    out["K"] = matrix_json(model.K, n_z, n_y);
    out["x0"] = nullptr;
    if (!context.x0) return out;
    out["x0"] = ordered_json::array();
    for (const auto& state : *context.x0)
        out["x0"].push_back(vector_json(state.data(), static_cast<int>(state.size())));
    return out;
}

ordered_json percent_json(const std::optional<std::vector<double>>& percent, const std::vector<std::string>& outputs) {
    if (!percent) return nullptr;
    ordered_json out = ordered_json::object();
    for (std::size_t i = 0; i < outputs.size() && i < percent->size(); ++i)
        out[outputs[i]] = number_json((*percent)[i]);
    return out;
}

void put_arrays_json(const okid_identified_t& model, const result_context& context, ordered_json& out) {
    out["model"] = model_json(model, context);
    ordered_json blocks = ordered_json::array();
    const std::ptrdiff_t block = static_cast<std::ptrdiff_t>(model.n_y) * model.n_u;
    for (int k = 0; k < model.markov_count; ++k)
        blocks.push_back(matrix_json(model.markov + k * block, model.n_y, model.n_u));
    out["markov"]["Y"] = std::move(blocks);
}

std::string counted(long long count, const char* noun) {
    return fmt::format("{} {}{}", count, noun, count == 1 ? "" : "s");
}

std::string note_text(const okid_identified_t& model, std::uint32_t bit) {
    const okid_observer_info_t& info = model.observer_info;
    const auto kind = model.observer ? OKID_METHOD_OKID_ERA : OKID_METHOD_N4SID_MOESP;
    const long long q = unknowns_of(kind, model.n_u, model.n_y, model.p);
    switch (bit) {
    case OKID_NOTE_ARX_STABILISED:
        return fmt::format(
            "plain least squares gave an unstable observer (spectral radius {:.6g}); a ridge of {:.1e} brought "
            "it to {:.6g}. Damping may be slightly high: a longer record or another --p needs no ridge",
            info.radius_plain, info.ridge, info.radius);
    case OKID_NOTE_ILL_CONDITIONED:
        return fmt::format(
            "the regression is ill-conditioned ({:.1e}): nearly noise-free data or channels that repeat each "
            "other. Frequencies stay good; check damping with a smaller --p or without the redundant channel",
            info.condition);
    case OKID_NOTE_FEW_ROWS:
        return fmt::format(
            "{} usable samples for {} unknowns per output, 10 for each are advised: scatter is large. Record "
            "longer or lower --p",
            model.regression_rows, q);
    case OKID_NOTE_MODEL_UNSTABLE:
        return fmt::format(
            "the model has a pole on or outside the unit circle (spectral radius {:.6g}): no simulation can be "
            "trusted. Try a lower --order or --detrend mean",
            model.model_radius);
    case OKID_NOTE_PREDICTOR_UNSTABLE:
        return "the predictor A - K C is unstable: no prediction fit is given. Try another --p, --rows or --order";
    case OKID_NOTE_ORDER_REDUCED:
        return fmt::format(
            "the order asked for is more than the data support; {} is used. A larger --p and --rows support more",
            model.n_z);
    case OKID_NOTE_ORDER_UNCLEAR:
        return fmt::format(
            "no clear gap in the singular values: {} is the smallest order that keeps every stable mode{}. Compare a "
            "few orders with --order N",
            model.n_z,
            std::any_of(model.emac, model.emac + model.mode_count,
                        [](auto emac) { return emac < judgement::doubtful_emac; })
                ? "; it holds noise modes too (EMAC below 0.5)"
                : "");
    case OKID_NOTE_WEAK_EXCITATION:
        return fmt::format("the inputs hardly excite some directions (smallest over largest {:.1e}): modes there are "
                           "uncertain. Use a broader-band force",
                           info.input_excitation);
    case OKID_NOTE_LITERAL_HANKEL:
        return "the Hankel matrix holds [Y_k Y0_k] unscaled, as eq. 42 is printed: the result depends on the units of "
               "the inputs, and the observer's own modes mix into those of the structure, so that damping can be wrong "
               "by half. Use --hankel system or innovations for results";
    default: return "";
    }
}

std::string fit_cell(const std::optional<std::vector<double>>& values, std::size_t i) {
    const bool known = values && i < values->size() && std::isfinite((*values)[i]);
    return known ? fmt::format("{:.2f}", (*values)[i]) : "-";
}

std::string fit_text(const result_context& context) {
    if (!context.simulation_percent && !context.prediction_percent) return "";
    std::size_t width = 6;
    for (const auto& name : context.outputs) width = std::max(width, name.size());
    if (context.responses && context.simulation_percent) {
        std::string out = fmt::format("\n{:<{}}  explained [%]\n", "output", width);
        for (std::size_t i = 0; i < context.outputs.size(); ++i)
            out += fmt::format("{:<{}}  {:>13}\n", context.outputs[i], width, fit_cell(context.simulation_percent, i));
        return out;
    }
    std::string out = fmt::format("\n{:<{}}  simulated [%]  predicted [%]\n", "output", width);
    for (std::size_t i = 0; i < context.outputs.size(); ++i)
        out += fmt::format("{:<{}}  {:>13}  {:>13}\n", context.outputs[i], width,
                           fit_cell(context.simulation_percent, i), fit_cell(context.prediction_percent, i));
    return out;
}

/// An indicator with four digits; "-" where it is not known.
std::string indicator(double value) { return std::isfinite(value) ? fmt::format("{:.4f}", value) : "-"; }

constexpr int most_shape_columns = 6; // more would not stand side by side on a screen

std::string mode_rows(const okid_identified_t& model, const result_context& context) {
    const bool agreed = !context.verdicts.empty();
    const bool shapes = model.n_y > 1 && model.n_y <= most_shape_columns && !context.placed;
    const std::vector<mode_verdict> verdicts = mode_verdicts(model, context);
    std::vector<std::string> left_out;
    std::vector<std::size_t> width;
    std::string out = fmt::format("   #       f [Hz]       ± σ     ζ [%]       ± σ     MPC    EMAC     CMI{}",
                                  agreed ? "  found in" : "");
    for (int i = 0; shapes && i < model.n_y; ++i) {
        const auto at = static_cast<std::size_t>(i);
        const std::string name = at < context.outputs.size() ? context.outputs[at] : fmt::format("y{}", i + 1);
        width.push_back(std::max<std::size_t>(6, name.size()));
        out += fmt::format("  {:>{}}", name, width.back());
    }
    out += "\n";
    for (int k = 0; k < model.mode_count; ++k) {
        const auto at_mode = static_cast<std::size_t>(k);
        const mode_verdict& verdict = verdicts[at_mode];
        const bool hidden = agreed && !verdict.confident && !context.all_modes;
        if (hidden)
            left_out.push_back(fmt::format("{:.4g} Hz ({})", model.frequency_hz[k], fmt::join(verdict.why, ", ")));
        if (hidden) continue;
        const double std_f = context.sigma ? context.sigma->frequency_hz[at_mode] : NAN,
                     std_zeta = context.sigma ? context.sigma->damping_ratio[at_mode] : NAN;
        out += fmt::format("{:>4}{}{:>12.5f} {:>9} {:>9.4f} {:>9} {:>7} {:>7} {:>7}", k + 1,
                           verdict.confident ? ' ' : '?', model.frequency_hz[k], plus_minus(std_f),
                           100 * model.damping_ratio[k], plus_minus(100 * std_zeta), indicator(model.mpc[k]),
                           indicator(model.emac[k]), indicator(model.cmi[k]));
        if (agreed) out += fmt::format(" {:>7.0f} %", 100 * verdict.found_in);
        for (int i = 0; shapes && i < model.n_y; ++i)
            out += fmt::format("  {:>{}.3f}", model.shape_re[i + static_cast<std::ptrdiff_t>(k) * model.n_y],
                               width[static_cast<std::size_t>(i)]);
        if (!verdict.confident) out += fmt::format("  {}", fmt::join(verdict.why, ", "));
        out += "\n";
    }
    if (!left_out.empty())
        out +=
            fmt::format("   {}, listed with --all-modes: {}\n",
                        counted(static_cast<long long>(left_out.size()), "doubtful mode"), fmt::join(left_out, ", "));
    out += why_legend(verdicts);
    if (model.n_y > most_shape_columns && !context.placed && model.mode_count > 0)
        out +=
            fmt::format("   shapes of {}: the JSON has them, okid-report draws them\n", counted(model.n_y, "output"));
    if (!judged_by_agreement(context) && model.mode_count > 0)
        out += "   not judged by a named method: EMAC from 0.5 on, which noise reaches too; method auto judges\n";
    return out;
}

/// Which modes the table lists.
std::vector<bool> shown_modes(const okid_identified_t& model, const result_context& context) {
    std::vector<bool> out;
    for (const mode_verdict& verdict : mode_verdicts(model, context))
        out.push_back(verdict.confident || context.all_modes);
    return out;
}

/// "12.3 Hz, 45.6 Hz": confident modes of whose values and standard deviations something holds.
std::string confident_modes(
    const okid_identified_t& model, const result_context& context,
    const std::function<bool(double frequency, double frequency_std, double damping, double damping_std)>& of) {
    std::string out;
    if (!context.sigma) return out;
    const std::vector<mode_verdict> verdicts = mode_verdicts(model, context);
    for (std::size_t k = 0; k < verdicts.size(); ++k)
        if (verdicts[k].confident && of(model.frequency_hz[k], context.sigma->frequency_hz[k], model.damping_ratio[k],
                                        context.sigma->damping_ratio[k]))
            out += fmt::format("{}{:.4g} Hz", out.empty() ? "" : ", ", model.frequency_hz[k]);
    return out;
}

} // namespace

nlohmann::ordered_json modes_json(const okid_identified_t& model, const deviations* sigma,
                                  const placed_shapes* placed) {
    ordered_json out = ordered_json::array();
    const auto deviation = [&](std::vector<double> deviations::* of, int k) {
        return sigma ? number_json((sigma->*of)[static_cast<std::size_t>(k)]) : ordered_json(nullptr);
    };
    const auto of_shape = [&](std::vector<double> deviations::* of, std::ptrdiff_t at) {
        return sigma ? vector_json((sigma->*of).data() + at, model.n_y) : ordered_json(nullptr);
    };
    for (int k = 0; k < model.mode_count; ++k) {
        const auto at = static_cast<std::ptrdiff_t>(k) * model.n_y;
        ordered_json mode;
        mode["frequency_hz"] = number_json(model.frequency_hz[k]);
        mode["damping_ratio"] = number_json(model.damping_ratio[k]);
        mode["shape_re"] = vector_json(model.shape_re + at, model.n_y);
        mode["shape_im"] = vector_json(model.shape_im + at, model.n_y);
        mode["frequency_std_hz"] = deviation(&deviations::frequency_hz, k);
        mode["damping_ratio_std"] = deviation(&deviations::damping_ratio, k);
        mode["shape_re_std"] = of_shape(&deviations::shape_re, at);
        mode["shape_im_std"] = of_shape(&deviations::shape_im, at);
        mode["mpc"] = number_json(model.mpc[k]);
        mode["emac"] = number_json(model.emac[k]);
        mode["cmi"] = number_json(model.cmi[k]);
        if (placed) put_shape_json(*placed, static_cast<std::size_t>(k), mode);
        out.push_back(std::move(mode));
    }
    return out;
}

nlohmann::ordered_json result_json(const okid_identified_t& model, const result_context& context, bool arrays) {
    ordered_json out;
    out["schema"] = "okid.result/1";
    out["version"] = okid_version();
    out["method"] = context.method;
    out["fs_hz"] = number_json(context.fs_hz);
    out["samples"] = context.samples;
    if (context.responses) out["responses"] = true;
    if (context.judged_samples > 0) out["judged_samples"] = context.judged_samples;
    out["records"] = context.records;
    out["gaps"] = context.gaps;
    out["inputs"] = context.inputs;
    out["outputs"] = context.outputs;
    if (!context.input_dofs.empty()) out["input_dofs"] = context.input_dofs;
    if (!context.output_dofs.empty()) out["output_dofs"] = context.output_dofs;
    for (const set_up_line& one : context.set_ups)
        out["set_ups"].push_back(ordered_json{{"name", one.name}, {"outputs", one.outputs}});
    const bool agreed = judged_by_agreement(context); // of many horizons, without a Hankel matrix of its own
    out["p"] = agreed ? ordered_json(nullptr) : ordered_json(model.p);
    out["rows"] = agreed ? ordered_json(nullptr) : ordered_json(model.rows);
    out["hankel"] = context.hankel ? ordered_json(*context.hankel) : ordered_json(nullptr);
    out["order"] = model.n_z;
    out["hold"] = context.hold;
    out["detrend"] = context.detrend;
    out["start"] = context.start;
    if (arrays)
        out["singular_values"] =
            agreed ? ordered_json(nullptr) : vector_json(model.singular_values, model.singular_count);
    out["singular_noise"] = number_json(model.noise_level);
    if (arrays) put_arrays_json(model, context, out);
    out["judged_by"] = judged_by_agreement(context) ? "agreement" : "emac";
    out["sigma_blocks"] = context.sigma && context.sigma->replicates > 0 ? ordered_json(context.sigma->replicates)
                                                                         : ordered_json(nullptr);
    out["modes"] =
        modes_json(model, context.sigma ? &*context.sigma : nullptr, context.placed ? &*context.placed : nullptr);
    for (std::size_t k = 0; k < context.modal_masses.size(); ++k)
        put_modal_mass_json(context.modal_masses[k], out["modes"][k]);
    if (context.placed) out["shape_dofs"] = context.placed->dofs;
    if (!context.shape_quantity.empty()) out["shape_quantity"] = context.shape_quantity;
    if (agreed) {
        out["band_hz"] = context.band_hz
                             ? ordered_json{number_json(context.band_hz->first), number_json(context.band_hz->second)}
                             : ordered_json(nullptr);
        out["rates_hz"] = context.rates_hz;
    }
    const std::vector<mode_verdict> verdicts = mode_verdicts(model, context);
    for (std::size_t k = 0; k < verdicts.size(); ++k) out["modes"][k].update(verdict_json(verdicts[k]));
    out["fit"]["simulation_percent"] = percent_json(context.simulation_percent, context.outputs);
    out["fit"]["prediction_percent"] = percent_json(context.prediction_percent, context.outputs);
    if (context.stable) out["stabilization"] = stabilization_json(*context.stable);
    if (context.poles) out["agreement"] = pole_table_json(*context.poles);
    if (context.refined) out["refinement"] = refinement_json(*context.refined, context.outputs);
    if (context.skew) out["skew"] = skew_json(*context.skew, context.outputs);
    if (context.mass) put_mass_json(*context.mass, out);
    if (!context.hits.empty()) out["hits"] = hits_json(context.hits);
    out["warnings"] = ordered_json::array();
    for (const auto& [code, text] : result_warnings(model, context))
        out["warnings"].push_back(ordered_json{{"code", code}, {"text", text}});
    return out;
}

std::string result_text(const nlohmann::ordered_json& result) {
    std::string out = "{\n";
    std::size_t left = result.size();
    for (const auto& [key, value] : result.items())
        out += fmt::format("\"{}\":{}{}\n", key, value.dump(-1, ' ', false, ordered_json::error_handler_t::replace),
                           --left ? "," : "");
    return out + "}\n";
}

std::string result_table(const okid_identified_t& model, const result_context& context) {
    const bool fractions = context.method == "plscf", merged = context.method == "poser";
    const std::string what = context.responses
                                 ? fmt::format("responses at {}", counted(context.samples, "line"))
                                 : fmt::format("{} at {:g} Hz ({:.4g} s)", counted(context.samples, "sample"),
                                               context.fs_hz, static_cast<double>(context.samples) / context.fs_hz);
    std::string out = fmt::format("{}: {} to {}, {}", context.method, counted(model.n_u, "input"),
                                  counted(model.n_y, "output"), what);
    const bool set_ups = merged || !context.set_ups.empty() || (fractions && context.records > 1);
    if (set_ups || !context.responses) out += ", " + counted(context.records, set_ups ? "set-up" : "record");
    if (context.gaps) out += ", " + counted(context.gaps, "gap");
    const std::string horizon = merged      ? "modes of the set-ups paired by frequency and shape"
                                : fractions ? "agreement of several degrees, weights and normalisations"
                                : judged_by_agreement(context) ? "agreement of several methods, horizons and rates"
                                : model.observer               ? fmt::format("p {}, {} block rows", model.p, model.rows)
                                                               : fmt::format("{} block rows", model.rows);
    if (context.band_hz)
        out +=
            fmt::format("\nmodes sought between {:.3g} and {:.4g} Hz", context.band_hz->first, context.band_hz->second);
    if (!context.rates_hz.empty()) out += fmt::format(", at rates down to {:.4g} Hz", context.rates_hz.back());
    out += fmt::format("\n{}, order {}", horizon, model.n_z);
    out += context.responses ? "\n\n" : fmt::format(", detrend {}\n\n", context.detrend);
    out += mode_rows(model, context);
    if (context.placed) out += shapes_text(*context.placed, model.frequency_hz, shown_modes(model, context));
    out += fit_text(context);
    if (context.stable) out += stabilization_text(*context.stable);
    if (context.refined) out += refinement_text(*context.refined, context.outputs);
    if (context.mass) out += mass_text(*context.mass);
    if (!context.hits.empty()) out += hits_text(context.hits);
    const auto warnings = result_warnings(model, context);
    if (!warnings.empty()) out += "\n";
    for (const auto& [code, text] : warnings) out += fmt::format("warning {}: {}\n", code, text);
    return out;
}

std::vector<std::pair<std::string, std::string>> result_warnings(const okid_identified_t& model,
                                                                 const result_context& context) {
    std::vector<std::pair<std::string, std::string>> out;
    for (std::uint32_t bit = 1; bit; bit <<= 1) {
        const char* code = (model.warnings & bit) ? okid_warning_code(bit) : nullptr;
        if (code) out.emplace_back(code, note_text(model, bit));
    }
    out.insert(out.end(), context.warnings.begin(), context.warnings.end());
    const std::string without = confident_modes(model, context, [](double, double f_std, double, double zeta_std) {
        return !std::isfinite(f_std) || !std::isfinite(zeta_std);
    });
    if (!without.empty() && !has_remark(out, "no_deviation") && context.method != "poser")
        out.emplace_back(
            "no_deviation",
            fmt::format("no ± for {}: with some block of the record left out, the model does not hold it. {}", without,
                        context.detrend == "linear" ? "Record longer, or ask for another --order"
                                                    : "If a channel drifts, --detrend linear; else record longer, or "
                                                      "ask for another --order"));
    const std::string wide = confident_modes(model, context, [](double f, double f_std, double zeta, double zeta_std) {
        return f_std > judgement::widest_frequency * f || zeta_std > judgement::wide_damping * zeta;
    });
    if (!wide.empty() && judged_by_agreement(context) && !has_remark(out, "wide_sigma"))
        out.emplace_back("wide_sigma", fmt::format("one standard deviation is as large as the damping, or {:.0f} % of "
                                                   "the frequency, at {}: with some block of the record left out, the "
                                                   "model has it elsewhere",
                                                   100 * judgement::widest_frequency, wide));
    return out;
}

} // namespace okid_host
