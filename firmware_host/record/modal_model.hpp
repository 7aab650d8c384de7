// SPDX-License-Identifier: MIT
// A state-space model whose poles are given modes: one block of two states each.
#pragma once
#include "record_work.hpp"

#include <complex>
#include <vector>

namespace okid_host {

struct consensus_mode;

/// What the result says of a mode.
mode_verdict verdict_of(const consensus_mode& mode);

/// A mode as it goes into a model and into the result.
struct listed_mode {
    double frequency_hz, damping_ratio, mpc, emac;
    std::vector<std::complex<double>> shape; ///< in units of the outputs, largest entry 1; NaN: not measured
    bool in_model;
};

/// Not believed, for the reason of this code: listed, and in no model.
void doubt(const char* code, mode_verdict& verdict, listed_mode& mode);

constexpr int markov_blocks = 61; // as 30 block rows give

/// exp(lambda dt)
std::complex<double> discrete_pole(const listed_mode& mode, double dt);

/// work.model: the modes of `modes` (ascending), the states of those in the model, B and D from the records, K 0.
void make_modal_model(const std::vector<listed_mode>& modes, double fs_hz, record_work& work);

/// Records less their means, if they are to be, and the model of these modes fitted to them.
record_work modal_trial(const std::vector<listed_mode>& modes, record_set set, const record_options& options);

/// The model and what is known of it with all outputs again: what belongs to one that was left out is NaN.
void put_back_outputs(const std::vector<bool>& kept, record_work& work);

} // namespace okid_host
