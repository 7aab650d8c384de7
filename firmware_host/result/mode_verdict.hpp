// SPDX-License-Identifier: MIT
// Would an expert sign a mode? The judgement, its codes and their words, which every other language reads from okid.result/1.
#pragma once
#include <okid/identify.h>

#include <cmath>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

namespace okid_host {

struct result_context;

struct mode_verdict {
    bool confident = false;
    double found_in = NAN;        ///< share of the runs that could have seen it and did; NaN for a named method
    std::vector<std::string> why; ///< codes of why it is doubtful
    bool picked = false;          ///< by hand
};

bool has_code(const std::vector<std::string>& why, const char* code);

/// A line of a machine or of the mains, no resonance?
bool is_tone(const std::vector<std::string>& why);

/// What a code of `why` says, as a part of a sentence.
std::string why_text(const std::string& code);

/// A line for each code among these modes.
std::string why_legend(const std::vector<mode_verdict>& verdicts);

/// Did several runs have to agree? Else each mode stands by itself.
bool judged_by_agreement(const result_context& context);

/// Of every mode: those of the context, or by EMAC for a named method.
std::vector<mode_verdict> mode_verdicts(const okid_identified_t& model, const result_context& context);

/// {"confident": …, "found_in": …, "why": […], "why_text": […]}, of a mode that was picked "picked": true.
nlohmann::ordered_json verdict_json(const mode_verdict& verdict);

} // namespace okid_host
