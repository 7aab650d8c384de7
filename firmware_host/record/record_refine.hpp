// SPDX-License-Identifier: MIT
// Maximum-likelihood refinement of a model identified from records in memory, or from sums (okid/refine.h).
#pragma once
#include "record_uncertainty.hpp"
#include "record_work.hpp"

#include <okid/correlation.h>

namespace okid_host {

constexpr double nearly_white = 3; ///< residuals of a refinement, 1 = white

/// The likeliest model near a start, and models without one of twenty blocks each.
struct likeliest_model {
    okid_status_t status = OKID_OK; ///< >= 0: there is one
    okid_identified_t model{};      ///< in `arrays`
    std::unique_ptr<refined_arrays> arrays;
    refinement found;
    std::vector<replicate_model> replicates;
    std::vector<double> filter{1}; ///< that the samples went through (whitening.hpp)
};

/// Samples that a refinement has: of the 32 longest stretches in which no force is missing.
std::size_t refinable_samples(const record_work& work);

enum class noise_colour { white, any };

/// How white the residuals of a likelier model are, their colour taken out where they may have one, from two steps over 20,000
/// samples; infinite where there is none.
double whiteness_nearby(bool constants, const record_work& work, noise_colour colour = noise_colour::any);

/// @param constants  as for refine_model(). @param colour  any: noise that is not white is made so first (whitening.hpp)
likeliest_model likeliest(bool constants, const record_work& work, noise_colour colour = noise_colour::any);
/// The same from correlation sums; `replicates`: 64 draws from the Cramér-Rao bound instead.
likeliest_model likeliest(bool constants, const okid_identified_t& start, const okid_correlation_sums_t& sums);

/// Put the refined model, its modes and its fits into `result` where it simulates the records no worse than the model that
/// stands there with its fits; else a remark refine_failed. The records are in the model's own terms.
/// @param constants  the records are less their means or lines: the constants of the outputs are not known exactly
/// @return models without one of twenty blocks each, of the refined model; none when nothing was refined
std::vector<replicate_model> refine_model(bool constants, record_work& result);

/// The first `count` Markov parameters D, C B, C A B … of a model.
void find_markov(const okid_model_t& model, int count, std::vector<double>& out);

/// The model as M, K and R want it: without the delays of its outputs, where they are known. What is found goes into
/// result.context, the new C and D into result.refined.
okid_identified_t without_skew(const std::vector<replicate_model>& replicates, const mass_plan& plan,
                               record_work& result);

} // namespace okid_host
