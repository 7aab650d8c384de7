// SPDX-License-Identifier: MIT
// Poles of measured frequency responses over many orders: poly-reference least squares (pLSCF).
#pragma once
#include "consensus/consensus.hpp"
#include "response_set.hpp"

namespace okid_host {

/// Right matrix fractions of several degrees in two normalisations: of the whole band with three weights of the lines, of its
/// halves and quarters (each half over the next) with one. The poles of each of these runs are linked over the degrees.
std::vector<consensus_run> fit_matrix_fractions(const response_set& set);

} // namespace okid_host
