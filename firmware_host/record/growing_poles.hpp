// SPDX-License-Identifier: MIT
// Poles of an identified model that no record can have shown.
#pragma once
#include "record_uncertainty.hpp"
#include "record_work.hpp"

namespace okid_host {

/// Reflect the poles of A (n_z x n_z) that grow by more than eps^-1/4 over so many samples: mu becomes 1 / conj(mu). The other
/// poles and their vectors stay. @return how many there were
int reflect_growing(std::size_t samples, int n_z, std::vector<double>& A);

/// The same for the model of the records and its replicates, with a warning; then work.refined holds A and K.
void reflect_growing(record_work& work, std::vector<replicate_model>& replicates);

} // namespace okid_host
