// SPDX-License-Identifier: MIT
// PURPOSE    sums over the records at one set of parameters, and the Gauss-Newton step they give
#pragma once
#include "identify/refine_signals.hpp"

namespace okid {

/// What a pass over the records leaves.
struct refine_sums {
    double *gram, *with_e; ///< total x total and total x n_y: signals signals^T, signals residuals^T
    double *square, *mean; ///< n_y, n_y x runs: mean square of the residuals about their constants, and those constants
    double* output;        ///< n_y: mean square of the outputs
    long long used;        ///< samples
    double likelihood;     ///< log of the likelihood, up to a constant

    void lay_out(const refine_layout& l, arena& memory);
};

/// A change of the parameters.
struct refine_change {
    double* linear; ///< linear() x n_y: of D, the shapes and the constants
    double* shaped; ///< shaped(): of the gains, the poles and the initial states

    void lay_out(const refine_layout& l, arena& memory);
    /// out = p + alpha times the change
    void add_to(const refine_layout& l, const refine_parameters& p, double alpha, const refine_parameters& out) const;
};

/// The normal equations: the parameters that are linear in one output are eliminated first, with one matrix for all
/// outputs; what is left has shaped() unknowns however many outputs there are.
struct refine_equations {
    const refine_layout* layout;
    const refine_parameters* at_point;
    bool starts_only;
    double *weight, *scale;              ///< n_y, total
    double *own, *cross, *across;        ///< factor of G_EE, G_EF, G_EE^-1 G_EF
    double *left, *core;                 ///< G_FF less what E explains, the normal matrix made of it
    double *factor, *balance, *gradient; ///< of core, scaled to unit diagonal; shaped() each
    double* residual;                    ///< total x n_y
    std::complex<double>*alike, *mirror; ///< n_z x n_z: sum of weight c_k c_l and of weight c_k conj(c_l)

    void lay_out(const refine_layout& l, arena& memory);
    /// @param only_starts  the initial states alone are free
    bool prepare(const refine_parameters& p, const refine_sums& sums, bool only_starts);
    /// Factor with mu times the diagonal added.
    bool damp(double mu) const;
    /// The step for these sums of signals times residuals. @return without damping twice the log-likelihood it promises
    double step(const double* with_e, const refine_change& out) const;

  private:
    void weigh(const refine_sums& sums) const;
    void expand() const;
    bool stays(int k) const;
    void hold(int k) const;
    void expand_pair(int row, int col, int k, int l) const;
    void reduce(const double* projected, double* out) const;
    void take_from_linear(const refine_change& out) const;
};

} // namespace okid
