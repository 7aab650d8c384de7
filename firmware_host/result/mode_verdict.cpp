// SPDX-License-Identifier: MIT
// PURPOSE  the one table of reasons to doubt a mode, and the judgement as okid.result/1 and the modal table hold it
#include "mode_verdict.hpp"

#include "json_number.hpp"
#include "judgement.hpp"
#include "result.hpp"

#include <algorithm>
#include <array>
#include <fmt/format.h>
#include <utility>

namespace okid_host {
namespace {

constexpr std::array<std::pair<const char*, const char*>, 12> words{{
    {"few_runs", "fewer than half of the runs that could see it found it"},
    {"noise_shape", "short-lived, complex or scattering: probably noise"},
    {"split", "too near to a stronger one of the same shape: probably the same mode"},
    {"tone", "a steady line, not a vibration that decays"},
    {"pickup", "a steady line at a multiple of the mains frequency"},
    {"harmonic", "a multiple, sum or difference of stronger vibrations, or a multiple of the drive"},
    {"undriven", "a structure that is not linear, and no resonance in what the forces drive there"},
    {"noisy_output", "seen nearly alone by an output that the model explains far less than the others"},
    {"wide_sigma", "its standard deviation is too wide"},
    {"band_edge", "too slow for the record, or at the edge of the band or of the force"},
    {"overdamped", "damped too much to vibrate"},
    {"narrow", "narrower than the lines of the responses show: its damping is not known"},
}};

} // namespace

bool judged_by_agreement(const result_context& context) {
    return context.method == "auto" || context.method == "plscf" || context.method == "poser";
}

bool has_code(const std::vector<std::string>& why, const char* code) {
    return std::find(why.begin(), why.end(), code) != why.end();
}

bool is_tone(const std::vector<std::string>& why) { return has_code(why, "tone") || has_code(why, "pickup"); }

std::string why_text(const std::string& code) {
    const auto* at = std::find_if(words.begin(), words.end(), [&](const auto& one) { return code == one.first; });
    return at == words.end() ? code : at->second;
}

std::string why_legend(const std::vector<mode_verdict>& verdicts) {
    std::string out;
    for (const auto& [name, text] : words)
        if (std::any_of(verdicts.begin(), verdicts.end(),
                        [code = name](const mode_verdict& one) { return has_code(one.why, code); }))
            out += fmt::format("   {}: {}\n", name, text);
    return out;
}

std::vector<mode_verdict> mode_verdicts(const okid_identified_t& model, const result_context& context) {
    if (!context.verdicts.empty()) return context.verdicts;
    std::vector<mode_verdict> out;
    for (int k = 0; k < model.mode_count; ++k) {
        mode_verdict& verdict = out.emplace_back();
        verdict.confident = model.emac[k] >= judgement::doubtful_emac;
        if (!verdict.confident) verdict.why.emplace_back("noise_shape");
    }
    return out;
}

nlohmann::ordered_json verdict_json(const mode_verdict& verdict) {
    std::vector<std::string> texts;
    for (const std::string& code : verdict.why) texts.push_back(why_text(code));
    nlohmann::ordered_json out{{"confident", verdict.confident},
                               {"found_in", number_json(verdict.found_in)},
                               {"why", verdict.why},
                               {"why_text", std::move(texts)}};
    if (verdict.picked) out["picked"] = true;
    return out;
}

} // namespace okid_host
