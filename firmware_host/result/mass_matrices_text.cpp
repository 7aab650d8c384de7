// SPDX-License-Identifier: MIT
// Mass, stiffness and damping matrices as JSON and as words.
#include "deviations.hpp"
#include "json_number.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>

namespace okid_host {
namespace {

using nlohmann::ordered_json;

constexpr int widest = 12;                                        // columns that stand side by side on a screen
constexpr double not_proportional = 0.2, indistinguishable = 1e3; // of okid_pdc_t residual and condition

ordered_json square_json(const std::vector<double>& values, int n) {
    ordered_json out = ordered_json::array();
    for (int i = 0; i < n; ++i) {
        ordered_json row = ordered_json::array();
        for (int j = 0; j < n; ++j) row.push_back(number_json(values[static_cast<std::size_t>(j * n + i)]));
        out.push_back(std::move(row));
    }
    return out;
}

bool clear_of(const mass_matrices& found, std::uint32_t bits) { return !(found.notes & bits); }

ordered_json checks_json(const mass_matrices& found) {
    ordered_json out;
    out["m_positive_definite"] = clear_of(found, OKID_MKR_POLARITY | OKID_MKR_MASS);
    out["k_positive_definite"] = clear_of(found, OKID_MKR_STIFFNESS);
    out["r_positive_definite"] = clear_of(found, OKID_MKR_DAMPING);
    out["ww_residual"] = number_json(found.residual);
    out["feedthrough_misfit"] = number_json(found.feedthrough);
    out["feedthrough_output"] =
        found.feedthrough_output.empty() ? ordered_json(nullptr) : ordered_json(found.feedthrough_output);
    out["feedthrough_gain"] = found.gain != 0 ? number_json(found.gain) : ordered_json(nullptr);
    out["selection_margin"] = found.margin > 0 ? number_json(found.margin) : ordered_json(nullptr);
    out["eigenvector_condition"] = number_json(found.condition);
    out["admissible_modes"] = found.admissible;
    out["collocated_pairs"] = found.pairs;
    out["modes_used"] = ordered_json::array();
    for (const mass_mode& mode : found.modes) out["modes_used"].push_back(mode.number);
    out["notes"] = ordered_json::array();
    for (std::uint32_t bit = 1; bit; bit <<= 1)
        if (found.notes & bit)
            if (const char* name = okid_mkr_note(bit)) out["notes"].push_back(name);
    return out;
}

/// With a row of standard deviations below each row of values, where there are any.
std::string square_text(const std::string& title, const std::vector<double>& values, const std::vector<double>& std,
                        int n) {
    if (n > 0 && std::isnan(values[0])) return fmt::format("{}: not determined\n", title);
    std::string out = fmt::format("{}{}\n  dof", title, std.empty() ? "" : ", ± one standard deviation");
    for (int j = 0; j < n; ++j) out += fmt::format(" {:>12}", j + 1);
    out += "\n";
    double largest = 0;
    for (const double value : values) largest = std::max(largest, std::abs(value));
    const int digits = largest > 0 ? std::clamp(5 - static_cast<int>(std::floor(std::log10(largest))), 0, 12) : 0;
    const bool fixed = largest < 1e7 && largest >= 1e-6;
    for (int i = 0; i < n; ++i) {
        out += fmt::format("{:>5}", i + 1);
        for (int j = 0; j < n; ++j) {
            const double value = values[static_cast<std::size_t>(j * n + i)];
            out += fixed ? fmt::format(" {:>12.{}f}", value, digits) : fmt::format(" {:>12.4e}", value);
        }
        out += "\n";
        if (std.empty()) continue;
        out += "     ";
        for (int j = 0; j < n; ++j) out += fmt::format(" {:>12}", plus_minus(std[static_cast<std::size_t>(j * n + i)]));
        out += "\n";
    }
    return out;
}

/// "(0.51 ±0.02) 1/s M + (1.2e-05 ±3e-07) s K", without brackets where no deviation is known.
std::string proportional_text(const mass_matrices& found) {
    const auto with = [](double value, double std) {
        return std::isfinite(std) ? fmt::format("({:.5g} {})", value, plus_minus(std)) : fmt::format("{:.5g}", value);
    };
    return fmt::format("{} 1/s M + {} s K", with(found.pdc.alpha, found.alpha_std),
                       with(found.pdc.beta, found.beta_std));
}

const char* yes_or_no(bool holds) { return holds ? "yes" : "NO"; }

std::string checks_text(const mass_matrices& found) {
    std::string out = fmt::format(
        "positive definite: M {}, K {}, R {}\n", yes_or_no(clear_of(found, OKID_MKR_POLARITY | OKID_MKR_MASS)),
        yes_or_no(clear_of(found, OKID_MKR_STIFFNESS)), yes_or_no(clear_of(found, OKID_MKR_DAMPING)));
    out += fmt::format(
        "residual of W W^T = 0: {:.2g} (doubtful above 0.03); misfit of D to M: {:.2g}{} (doubtful above "
        "0.1)\n",
        found.residual, found.feedthrough, found.feedthrough_output.empty() ? "" : " at " + found.feedthrough_output);
    out += fmt::format("{} of {} admissible modes used", found.n_x, found.admissible);
    if (found.margin > 0)
        out += fmt::format(", the weakest {:.3g} times stronger than the best left out", found.margin);
    out += fmt::format("; {} co-located pair{}\n", found.pairs, found.pairs == 1 ? "" : "s");
    return out;
}

std::string note_words(const mass_matrices& found, std::uint32_t bit) {
    const auto by = [](double mass_mode::* member) {
        return [member](const mass_mode& a, const mass_mode& b) { return a.*member < b.*member; };
    };
    const auto least = std::min_element(found.modes.begin(), found.modes.end(), by(&mass_mode::mpc));
    const auto most = std::max_element(found.modes.begin(), found.modes.end(), by(&mass_mode::pair_spread));
    switch (bit) {
    case OKID_MKR_POLARITY:
        return "M has the wrong sign: the polarity of a force or of its sensor is swapped, or the kind of sensor is "
               "wrong by two (displacement taken for acceleration)";
    case OKID_MKR_MASS:
        return "M is not positive definite, nor is -M: wrong numbers of degrees of freedom, one polarity of several "
               "swapped, a wrong kind of sensor or hold, or modes that do not belong to the structure";
    case OKID_MKR_STIFFNESS:
        return "K is not positive definite: a rigid-body mode is missing, a kind of sensor or the hold is wrong, or a "
               "mode is not one of the structure";
    case OKID_MKR_DAMPING:
        return "R is not positive definite: it is the least certain of the three (a channel late by 1 % of a sample "
               "distorts it); use R_normal_modes or R of pdc";
    case OKID_MKR_RESIDUAL:
        return fmt::format("the residual of W W^T = 0 is {:.3g} (doubtful above 0.03): the kind of sensor is wrong by "
                           "one (velocity taken for acceleration), the hold is wrong, channels are late, or noise",
                           found.residual);
    case OKID_MKR_FEEDTHROUGH:
        return fmt::format("at \"{}\" the direct feed-through D does not fit M (misfit {:.3g}, doubtful above 0.1): a "
                           "wrong kind of sensor, a wrong hold (a force that is not held called zoh), an output that "
                           "comes one sample late, or modes outside the band",
                           found.feedthrough_output, found.feedthrough);
    case OKID_MKR_COMPLEX:
        return fmt::format(
            "mode {} at {:.4g} Hz is complex (MPC {:.3g}, doubtful below 0.9): its points do not move in "
            "phase; R_normal_modes and pdc assume that they do",
            least->number, least->frequency_hz, least->mpc);
    case OKID_MKR_SPREAD:
        return fmt::format(
            "the co-located pairs contradict each other by {:.3g} in mode {} at {:.4g} Hz (doubtful above "
            "0.1): gain, unit or polarity of one of them, or of its place",
            most->pair_spread, most->number, most->frequency_hz);
    case OKID_MKR_CLOSE:
        return fmt::format("the choice of modes was close: the weakest one taken is only {:.3g} times as strong "
                           "as the best left out (doubtful below 2). Compare with another order",
                           found.margin);
    default: return "";
    }
}

} // namespace

void put_mass_json(const mass_matrices& found, ordered_json& result) {
    const int n = found.n_x;
    ordered_json mkr, pdc;
    mkr["M"] = square_json(found.M, n);
    mkr["K"] = square_json(found.K, n);
    mkr["R"] = square_json(found.R, n);
    mkr["R_normal_modes"] = square_json(found.R_normal, n);
    for (const auto& [key, std] :
         {std::pair{"M_std", &found.M_std}, std::pair{"K_std", &found.K_std}, std::pair{"R_std", &found.R_std},
          std::pair{"R_normal_modes_std", &found.R_normal_std}})
        mkr[key] = std->empty() ? ordered_json(nullptr) : square_json(*std, n);
    mkr["checks"] = checks_json(found);
    mkr["modes"] = ordered_json::array();
    for (const mass_mode& mode : found.modes)
        mkr["modes"].push_back({{"mode", mode.number},
                                {"frequency_hz", number_json(mode.frequency_hz)},
                                {"damping_ratio", number_json(mode.damping_ratio)},
                                {"strength", number_json(mode.strength)},
                                {"mpc", number_json(mode.mpc)},
                                {"phase_rad", number_json(mode.phase)},
                                {"pair_spread", number_json(mode.pair_spread)}});
    pdc["alpha"] = number_json(found.pdc.alpha);
    pdc["beta"] = number_json(found.pdc.beta);
    pdc["R"] = square_json(found.R_pdc, n);
    pdc["alpha_std"] = number_json(found.alpha_std);
    pdc["beta_std"] = number_json(found.beta_std);
    pdc["residual"] = number_json(found.pdc.residual);
    pdc["condition"] = number_json(found.pdc.condition);
    result["mkr"] = std::move(mkr);
    result["pdc"] = std::move(pdc);
}

std::string mass_text(const mass_matrices& found) {
    const int n = found.n_x;
    std::string out = fmt::format("\nmass, stiffness and damping of {} degree{} of freedom\n", n, n == 1 ? "" : "s");
    if (n <= widest) {
        out += square_text("M [kg]", found.M, found.M_std, n) + square_text("K [N/m]", found.K, found.K_std, n);
        out += square_text("R [N s/m]", found.R, found.R_std, n);
        out += square_text("R [N s/m] of normal modes", found.R_normal, found.R_normal_std, n);
        out += square_text(fmt::format("R [N s/m] proportional: {} (damping ratios fit within {:.2g} %)",
                                       proportional_text(found), 100 * found.pdc.residual),
                           found.R_pdc, {}, n);
    } else {
        out += fmt::format("more than {} columns: the matrices are in the result file (--json)\n", widest);
        out += fmt::format("R proportional: {}\n", proportional_text(found));
    }
    return out + checks_text(found);
}

remarks mass_remarks(const mass_matrices& found) {
    remarks out;
    for (std::uint32_t bit = 1; bit; bit <<= 1) {
        const char* name = (found.notes & bit) ? okid_mkr_note(bit) : nullptr;
        if (name) out.emplace_back(fmt::format("mkr_{}", name), note_words(found, bit));
    }
    if (!(found.pdc.condition < indistinguishable))
        out.emplace_back("pdc_undetermined",
                         "one frequency cannot tell alpha from beta: they share the damping evenly; their R is right "
                         "for these modes");
    if (found.pdc.residual > not_proportional)
        out.emplace_back("pdc_residual", fmt::format("the damping is not proportional: alpha M + beta K misses the "
                                                     "damping ratios by {:.3g} %",
                                                     100 * found.pdc.residual));
    return out;
}

} // namespace okid_host
