// SPDX-License-Identifier: MIT
#include "refinement.hpp"

#include "json_number.hpp"

#include <cmath>
#include <fmt/format.h>

namespace okid_host {
namespace {

/// "acc1 +12.3 ± 0.4, acc3 …" of the outputs chosen.
std::string delays_text(const channel_skew& found, const std::vector<std::string>& outputs,
                        const std::vector<int>& chosen) {
    std::string out;
    for (std::size_t i = 0; i < outputs.size(); ++i)
        if (chosen[i] != 0)
            out +=
                fmt::format("{}{} {:+.3g} ± {:.2g}", out.empty() ? "" : ", ", outputs[i], found.us[i], found.std_us[i]);
    return out;
}

} // namespace

nlohmann::ordered_json refinement_json(const refinement& found, const std::vector<std::string>& outputs) {
    nlohmann::ordered_json out;
    out["iterations"] = found.iterations;
    out["converged"] = found.converged;
    out["samples"] = found.samples;
    out["log_likelihood_gain"] = number_json(found.gain);
    out["log_likelihood_left"] = number_json(found.decrement);
    out["whiteness"] = number_json(found.whiteness);
    out["noise_order"] = found.noise_order;
    out["noise_std"] = nlohmann::ordered_json::object();
    for (std::size_t i = 0; i < outputs.size(); ++i) out["noise_std"][outputs[i]] = number_json(found.noise_std[i]);
    return out;
}

std::pair<std::string, std::string> refine_failed(const std::string& reason) {
    return {"refine_failed", fmt::format("the model is as identified, the refinement was rejected: {}", reason)};
}

std::pair<std::string, std::string> refine_unconverged(const refinement& found) {
    return {"refine_unconverged",
            fmt::format("the refinement did not converge in {} steps (log-likelihood {:+.1f}, {:.2g} left): the "
                        "best model reached is given. Structure and record do not fit each other well: try another "
                        "--order",
                        found.iterations, found.gain, found.decrement)};
}

std::string refinement_text(const refinement& found, const std::vector<std::string>& outputs) {
    std::string out =
        fmt::format("\nrefined: {} iterations, log-likelihood {:+.1f}, {}{}{}\nnoise (1 sigma):", found.iterations,
                    found.gain, found.converged ? "converged" : "NOT converged",
                    std::isfinite(found.whiteness)
                        ? fmt::format("; correlation of the residuals {:.3g} (white: 1)", found.whiteness)
                        : fmt::format(", from sums over {} samples", found.samples),
                    found.noise_order > 0 ? fmt::format(", noise of order {}", found.noise_order) : "");
    for (std::size_t i = 0; i < outputs.size(); ++i)
        out += std::isfinite(found.noise_std[i])
                   ? fmt::format("{} {} {:.3g}", i == 0 ? "" : ",", outputs[i], found.noise_std[i])
                   : fmt::format("{} {} -", i == 0 ? "" : ",", outputs[i]); // of an output that was left out
    return out + "\n";
}

nlohmann::ordered_json skew_json(const channel_skew& found, const std::vector<std::string>& outputs) {
    nlohmann::ordered_json out;
    out["us"] = out["std_us"] = nlohmann::ordered_json::object();
    out["corrected"] = false;
    out["outputs_corrected"] = nlohmann::ordered_json::array();
    for (std::size_t i = 0; i < outputs.size(); ++i) {
        out["us"][outputs[i]] = number_json(found.us[i]);
        out["std_us"][outputs[i]] = number_json(found.std_us[i]);
        if (found.late[i] == 0) continue;
        out["corrected"] = true;
        out["outputs_corrected"].push_back(outputs[i]);
    }
    out["undetermined"] = found.undetermined;
    out["scatter"] = number_json(found.scatter);
    return out;
}

std::vector<std::pair<std::string, std::string>> skew_remarks(const channel_skew& found,
                                                              const std::vector<std::string>& outputs) {
    std::vector<std::pair<std::string, std::string>> out;
    if (found.undetermined)
        out.emplace_back(
            "skew_undetermined",
            fmt::format(
                "no delays of the outputs explain the phases of the modes (the rest is {:.3g} times its standard "
                "deviation): complex modes, or a wrong kind of sensor or hold. Nothing "
                "was corrected: R of normal modes does not hold for complex modes, and R counts such delays as damping",
                found.scatter));
    if (const std::string late = delays_text(found, outputs, found.late); !late.empty())
        out.emplace_back("channel_skew",
                         fmt::format("outputs come late against the forces (µs, negative: early): {}. M, K and R are "
                                     "those without these delays; the model is as recorded",
                                     late));
    if (const std::string large = delays_text(found, outputs, found.too_large); !large.empty())
        out.emplace_back("skew_large",
                         fmt::format("the phases of the modes ask for delays above 0.3 samples (µs): {}. Not "
                                     "corrected: a wrong --hold or a shift by a sample is likelier",
                                     large));
    return out;
}

} // namespace okid_host
