// SPDX-License-Identifier: MIT
// What sensors that are missing would show, and which forces act: a Kalman filter of an identified model, sample by sample.
#pragma once
#include "virtual_model.hpp"

#include <cstddef>
#include <cstdint>
#include <vector>

namespace okid_host {

class virtual_filter {
  public:
    explicit virtual_filter(virtual_model model);

    const virtual_model& model() const { return model_; }
    /// Means, noise and deviations from a record: rows [u; y], NaN = missing; starts again. Throws `failure` (exit 2).
    void learn(std::size_t count, const double* rows);
    /// What comes next begins at rest.
    void reset();

    /// One sample [u; y], only measured inputs, NaN = missing: what every output shows, the forces where they are
    /// estimated. Valid until the next call.
    struct estimate {
        Eigen::VectorXd y, y_std, force, force_std; ///< measured: std 0
    };
    const estimate& step(const double* row);
    /// So many samples of which nothing was measured, faster than step() when they are many: the deviations stop growing.
    void pass(std::int64_t count);

  private:
    void augment();
    void find_gains();
    void learn_noise(std::size_t count, const double* rows);
    void try_deviations(std::size_t count, const double* rows);

    virtual_model model_;
    Eigen::Index n_ = 0, forces_ = 0; ///< states of the structure; estimated inputs, behind them
    Eigen::MatrixXd A_, B_, C_, D_, Q_, S_;
    Eigen::VectorXd x_;
    Eigen::MatrixXd P_;                 ///< of x_ before the sample
    std::vector<char> there_, pattern_; ///< of [u; y]: now, and what the gains were found for
    std::vector<Eigen::Index> seen_;    ///< outputs that are there
    bool settled_ = false;
    Eigen::MatrixXd gain_, to_y_, to_force_;
    Eigen::VectorXd u_, e_; ///< of the sample
    estimate now_;
};

} // namespace okid_host
