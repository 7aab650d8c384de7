// SPDX-License-Identifier: MIT
// PURPOSE  the options of an identification as a user gave them, and the one place where they are checked
#pragma once
#include "record.hpp"

#include <string>
#include <vector>

namespace okid_host {

/// What was asked for, as text; "" = not given.
struct record_request {
    std::vector<std::string> inputs, outputs; ///< names of the channels
    std::string method, hankel = "system", order = "auto", hold, detrend = "mean", start = "moving";
    std::string sensing, input_dofs, output_dofs; ///< lists with commas between; no sensing: acceleration
    std::string fs, p, rows, max_order, sigma, sigma_blocks;
    std::string band, decimate, modes, picks, threads; ///< of method auto
    std::string hit_dofs;                              ///< one number a record
    std::string refine;                                ///< auto, yes or no; empty: auto under method auto, else no
    bool stabilization = false;
    bool keep_all = false; ///< of hits: bad ones too
    bool set_ups = false;  ///< sensors were moved between the records
};

/// Throws `failure` (exit 2) naming the option, what was found and what was expected. `fs_hz` stays 0.
record_options check_request(const record_request& given);

/// okid_sensing_t of each output, of `--sensing`: one kind for all, or one each.
std::vector<int> check_sensing(const std::string& sensing, std::size_t outputs);

/// Numbers of `--modes` are those of modes that are listed.
void check_picked(const std::vector<int>& numbers, std::size_t listed);

/// Of `--fs HZ`.
double check_rate(const std::string& text);

/// A whole number from low to high.
long long whole_number(const std::string& option, const std::string& text, long long low, long long high);

/// Remarks on the units of the channels (inputs, then outputs), and what M, K and R make of them.
void take_record_units(const std::vector<std::string>& units, record_options& options);

} // namespace okid_host
