// SPDX-License-Identifier: MIT
// Standard deviations of a result from replicate models (okid/uncertainty.h), in memory of the host.
#pragma once
#include "mass_matrices.hpp"

#include <okid/uncertainty.h>

#include <cmath>
#include <complex>
#include <cstddef>
#include <memory>
#include <string>
#include <vector>

namespace okid_host {

constexpr int fewest_blocks = 8, most_blocks = 100; ///< below 8, a standard deviation says little

/// One standard deviation of each number; NaN where nothing can be said. Laid out as what they belong to.
struct deviations {
    int replicates = 0, models = 0; ///< blocks left out; of these, such that left a model
    std::vector<double> frequency_hz, damping_ratio, shape_re, shape_im;
    std::vector<double> M, K, R, R_normal; ///< empty without degrees of freedom
    double alpha = NAN, beta = NAN;
};

/// A mode, or how far it moves without one block; shapes with the largest entry of the whole's held.
struct mode_shift {
    double frequency_hz = 0, damping_ratio = 0;
    std::vector<std::complex<double>> shape;
};

/// Collects replicates of one model after the other. All memory at the start.
class replicate_statistics {
  public:
    /// @param plan  M, K, R too when it wants them
    replicate_statistics(int n_u, int n_y, int most_states, const mass_plan& plan, double dt);

    void begin(const okid_model_t& full);
    void add(const okid_model_t* replicate, double share);
    std::vector<mode_shift> last() const; ///< modes of what was added last
    deviations finish();

  private:
    double dt_;
    int n_y_;
    std::unique_ptr<mkr_arguments> mkr_;
    std::unique_ptr<std::byte[]> block_;
    okid_replicates_t* replicates_ = nullptr;
};

/// Share of the outputs' power (mean over the outputs) that a block may have for its derivative to hold: 20 even blocks have
/// 0.05 each. Beyond it, as of a free decay, the change to first order is much smaller than that of the model without the block.
constexpr double most_of_one_block = 0.2;

/// Throws `failure` (exit 3) for an error of the sums behind standard deviations.
void check_statistics(okid_status_t status);

/// The model alone.
okid_model_t model_view(const okid_identified_t& model);

/// The modes of a model of any method; none where it has none.
std::vector<mode_shift> modes_in(const double* frequency, const double* damping, const double* re, const double* im,
                                 int count, int n_y);
std::vector<mode_shift> modes_in(const okid_model_t& model, double dt);

/// "±0.00012", or "-" where nothing is known.
std::string plus_minus(double deviation);

/// The deviations of M, K, R, alpha and beta to where the matrices are.
void add_deviations(const deviations& found, mass_matrices& to, remarks& said);

} // namespace okid_host
