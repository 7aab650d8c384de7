// SPDX-License-Identifier: MIT
// Standard deviations of what is identified from records in memory: the same again without one block of them each.
#pragma once
#include "record.hpp"
#include "result/deviations.hpp"

#include <okid/accumulator.h>

#include <complex>
#include <optional>
#include <vector>

namespace okid_host {

/// Samples first .. last-1 of one record.
struct record_piece {
    std::size_t record, first, last;
};

/// The model without one block; none when the block was indispensable.
struct replicate_model {
    std::vector<record_piece> pieces;
    double share = 0;
    int n_u = 0, n_y = 0, n_z = 0;
    std::vector<double> A, B, C, D;
    bool found() const { return n_z > 0; }
    okid_model_t view() const { return {n_u, n_y, n_z, A.data(), B.data(), C.data(), D.data(), nullptr}; }
};

struct record_work;

/// Leave out each of so many equal blocks in turn. The records of `work` are what `whole` was fed with. Analytic: to first
/// order, where the method has a derivative and its identifier was given `whole` last. Inputs: B and D too. Empty: too short.
std::vector<replicate_model> leave_out_blocks(const record_work& work, okid_accumulator_t* whole, int blocks,
                                              bool inputs);

/// Deviations of the modes, and of M, K, R where the plan wants them.
/// @param modes  out, of each replicate; may be nullptr
deviations deviations_of(const okid_identified_t& model, const std::vector<replicate_model>& replicates,
                         const mass_plan& plan, std::vector<std::vector<mode_shift>>* modes = nullptr);

/// Does a horizon of 2 p, at the order and the ridge of the model, say something else than p by more than two standard
/// deviations? Then a remark names the modes: the bias of a finite p, which no deviation sees. Nothing when `rows` regression
/// rows are too few for 2 p, or memory is.
void remark_finite_p(const record_work& work, long long rows, const deviations& sigma, remarks& said);

} // namespace okid_host
