// SPDX-License-Identifier: MIT
// Several records of one structure: struck at different places (`--hit-dofs`), or contradicting each other.
#pragma once
#include "modal_model.hpp"
#include "record_work.hpp"

#include <Eigen/Core>
#include <vector>

namespace okid_host {

/// Throws `failure` (exit 2) where the numbers do not match the records.
void check_hits(const record_set& set, const std::vector<int>& hits);

/// The places without repetition, ascending; `-3` is place 3.
std::vector<int> hit_places(const std::vector<int>& hits);

/// One input a place: the force of each record in its column, zeros in the others.
record_set one_column_a_place(const record_set& set, const std::vector<int>& hits);

/// Their names: "force@3".
std::vector<std::string> place_names(const std::string& force, const std::vector<int>& hits);

/// Every record is one hit and what follows it: then nothing moves before, however short the time before the hit.
bool are_blows(const record_set& set);

/// The force of each is zero where it does not act: the mean of a pulse is no offset.
void rest_forces(record_set& blows);

/// What follows the last sample of each hit, outputs alone.
record_set free_decays(const record_set& set);

/// B, D and fits of a modal model of which each place has its own records.
void fit_places(const std::vector<listed_mode>& modes, const std::vector<int>& hits, double fs_hz, record_work& work);

/// Of each mode in the model (rows) and place (columns): what a hit does to it, and one standard deviation.
struct place_residues {
    Eigen::MatrixXcd b;
    Eigen::MatrixXd std; ///< from the scatter of the hits of one place, one for all places; NaN: one hit each
};
place_residues find_residues(const std::vector<listed_mode>& modes, const std::vector<int>& hits, double fs_hz,
                             const record_set& set);

/// A mode is doubtful (`noise_shape`) whose residues over all places are below twice what hits of one place scatter: a hum, say,
/// is in every hit, with another phase. None is where records contradict each other.
void doubt_scattered(const std::vector<int>& hits, double fs_hz, const record_set& blows,
                     std::vector<listed_mode>& modes, std::vector<mode_verdict>& verdicts);

/// The modes of a model, those of little EMAC not in it.
std::vector<listed_mode> modes_of(const okid_identified_t& model);

/// A remark `records_contradict` where one B and D cannot explain all records, though each has one of its own.
void remark_contradiction(const std::vector<listed_mode>& modes, const std::vector<int>& hits, double fs_hz,
                          record_work& work);

} // namespace okid_host
