// SPDX-License-Identifier: MIT
// An identified model as people and programs see it: okid.result/1 and the modal table.
#pragma once
#include "deviations.hpp"
#include "hit_table.hpp"
#include "modal_masses.hpp"
#include "mode_verdict.hpp"
#include "placed_shapes.hpp"
#include "pole_table.hpp"
#include "refinement.hpp"
#include "stabilization.hpp"

#include <okid/identify.h>

#include <cmath>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

namespace okid_host {

/// Which sensors a set-up has.
struct set_up_line {
    std::string name; ///< of its file
    std::vector<std::string> outputs;
};

/// What the library does not know about a result.
struct result_context {
    std::string method = "okid-era";
    std::optional<std::string> hankel; ///< of methods with an observer
    double fs_hz = 0;
    long long samples = 0;
    int records = 1;
    bool responses = false;       ///< the samples are lines of frequency responses, the records set-ups
    long long judged_samples = 0; ///< auto: the newest, that the modes are judged from; 0: all of them
    long long gaps = 0;
    std::vector<std::string> inputs, outputs;
    std::vector<int> input_dofs, output_dofs; ///< where they are, from 1 (-3: at 3, reversed); empty: not said
    std::vector<set_up_line> set_ups;         ///< of several
    std::string hold = "zoh", detrend = "mean", start = "moving";
    std::optional<std::vector<std::vector<double>>> x0;        ///< one initial state per record; absent live (null)
    std::optional<std::vector<double>> simulation_percent;     ///< per output; absent live (null)
    std::optional<std::vector<double>> prediction_percent;     ///< per output; absent = null
    std::optional<deviations> sigma;                           ///< of the modes; absent = null
    std::string shape_quantity;                                ///< of the shapes; empty: what the sensors measure
    std::optional<std::pair<double, double>> band_hz;          ///< where auto looked for modes
    std::vector<double> rates_hz;                              ///< at which rates
    bool all_modes = false;                                    ///< the table lists the doubtful modes of auto too
    std::vector<mode_verdict> verdicts;                        ///< of the modes, of method auto; else by EMAC
    std::optional<stabilization> stable;                       ///< where it was asked for
    std::optional<pole_table> poles;                           ///< of method auto, where it was asked for
    std::optional<refinement> refined;                         ///< of a model that was refined
    std::optional<channel_skew> skew;                          ///< delays of the outputs, of a refined model
    std::vector<hit_line> hits;                                ///< of a hammer test in files
    std::optional<placed_shapes> placed;                       ///< of a hammer that roves: shapes over its places
    std::optional<mass_matrices> mass;                         ///< M, K, R where the channels have degrees of freedom
    std::vector<modal_mass> modal_masses;                      ///< of each mode; empty: no drive point is known
    std::vector<std::pair<std::string, std::string>> warnings; ///< further (code, text)
};

/// {"frequency_hz": …, "damping_ratio": …, "shape_re": […], "shape_im": […], "mpc": …, "emac": …, "cmi": …} of every mode.
/// @param sigma  their standard deviations, or nullptr (null)
/// @param placed  shapes over other places than those of the outputs, or nullptr
nlohmann::ordered_json modes_json(const okid_identified_t& model, const deviations* sigma,
                                  const placed_shapes* placed = nullptr);

/// The whole okid.result/1 object. @param arrays  false: without singular_values, model and markov
nlohmann::ordered_json result_json(const okid_identified_t& model, const result_context& context, bool arrays = true);

/// Its text: one key a line, so that a person can look into it; matrices stay compact.
std::string result_text(const nlohmann::ordered_json& result);

/// The modal table and the remarks, as text for a person (no escape codes).
std::string result_table(const okid_identified_t& model, const result_context& context);

/// The warnings of the model in words, with their numbers, then those of the context.
std::vector<std::pair<std::string, std::string>> result_warnings(const okid_identified_t& model,
                                                                 const result_context& context);

/// Turn a failed okid_identify_run() into the failure to throw: exit 3 and what to do about it.
[[noreturn]] void throw_identify_failure(okid_status_t status, const okid_identified_t& model,
                                         const okid_identify_config_t& config, const result_context& context);

} // namespace okid_host
