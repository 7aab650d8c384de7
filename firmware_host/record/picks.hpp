// SPDX-License-Identifier: MIT
// Modes picked by hand, in a diagram or from an earlier result (--picks), and the poles to pick from.
#pragma once
#include "consensus/consensus.hpp"
#include "modal_model.hpp"
#include "record.hpp"
#include "result/pole_table.hpp"

#include <string>
#include <vector>

namespace okid_host {

/// "34.3,101" in Hz, or the name of a .json file with "modes", as okid.result/1 has them: those that were picked, else those that
/// are confident, else all. Throws `failure` (exit 2).
std::vector<picked_pole> read_picks(const std::string& given);

/// For each pick the cluster that stands nearest, within 1 %, of two alike the one that more runs found; where there is none,
/// the nearest pole of a single model. Ascending, each once, all confident. Throws `failure` (exit 2).
std::vector<consensus_mode> picked_modes(const std::vector<picked_pole>& picks, const std::vector<consensus_run>& runs,
                                         const std::vector<consensus_mode>& modes);

/// Of all modes those of these numbers, from 1, are left, with all that is known of them, and believed. @return are some named?
bool keep_numbers(const std::vector<int>& numbers, std::vector<listed_mode>& listed, record_work& work);

/// What a stabilization diagram shows: the poles of every run, and to which of the modes each belongs.
pole_table poles_of(const std::vector<consensus_run>& runs, const std::vector<consensus_mode>& modes);

} // namespace okid_host
