// SPDX-License-Identifier: MIT
// What a maximum-likelihood refinement did, as people and programs see it.
#pragma once
#include <nlohmann/json.hpp>
#include <string>
#include <utility>
#include <vector>

namespace okid_host {

/// The numbers of okid_refined_t.
struct refinement {
    int iterations = 0;
    bool converged = false;
    long long samples = 0;
    double gain = 0, decrement = 0, whiteness = 0;
    int noise_order = 0;           ///< of the autoregression that the noise was taken for; 0: white
    std::vector<double> noise_std; ///< per output
};

/// Key "refinement" of okid.result/1.
nlohmann::ordered_json refinement_json(const refinement& found, const std::vector<std::string>& outputs);

/// What is to be said when nothing came of it, and when it did not converge: (code, text).
std::pair<std::string, std::string> refine_failed(const std::string& reason);
std::pair<std::string, std::string> refine_unconverged(const refinement& found);

/// Two lines for a person.
std::string refinement_text(const refinement& found, const std::vector<std::string>& outputs);

/// Delays of the outputs against the forces (okid_skew_result_t), for one output after the other.
struct channel_skew {
    std::vector<double> us, std_us;
    std::vector<int> late, too_large; ///< corrected; more than is corrected
    bool undetermined = false;
    double scatter = 0;
};

/// Key "skew" of okid.result/1.
nlohmann::ordered_json skew_json(const channel_skew& found, const std::vector<std::string>& outputs);

/// What is to be said of them: (code, text).
std::vector<std::pair<std::string, std::string>> skew_remarks(const channel_skew& found,
                                                              const std::vector<std::string>& outputs);

} // namespace okid_host
