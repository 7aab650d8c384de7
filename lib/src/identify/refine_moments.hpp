// SPDX-License-Identifier: MIT
// PURPOSE    the sums a step of the refinement needs, from correlation sums instead of a record
#pragma once
#include "identify/refine_step.hpp"

#include <okid/correlation.h>

namespace okid {

/// Of each pole w and input c two signals: phi(t) = sum_i w^i u_c(t-1-i), i < L, and its derivative by w; 2 n_u a pole.
struct refine_moments {
    using complex = std::complex<double>;
    const refine_layout* layout;
    complex* with;           ///< m x base(): sums of v times the signals
    complex* late;           ///< n_u x base(): of the inputs L samples before
    complex *alike, *mirror; ///< base() x base(): sums over the ends, heads less tails, of z z^T and z conj(z)^T
    complex *end, *total;    ///< base(): the signals at an end; their sums over the rows
    complex *block, *turned; ///< 2 n_u x 2 n_u: sums of products of the signals of two poles; the same with a conjugate
    double* horner;          ///< 4 m n_u: polynomials at a pole, and their derivatives
    double* one;             ///< total(): sums of the real signals over the rows; then the weights of an output

    int base() const { return 2 * layout->n_u * layout->n_z; }
    void lay_out(const refine_layout& l, arena& memory);
    /// Everything a step needs; the mean square of the outputs stands in `sums` already.
    void sum(const refine_parameters& p, const okid_correlation_sums_t& record, refine_sums& sums);

  private:
    void evaluate(const double* columns, int width, int lags, complex w, complex* value, complex* slope) const;
    void look_at_record(const refine_parameters& p, const okid_correlation_sums_t& record);
    void multiply_poles(const refine_parameters& p, const okid_correlation_sums_t& record, int j, int k, bool conjugate,
                        complex* out) const;
    int place(int k, int i) const;
    complex weight(const refine_parameters& p, int k, int i, int c) const;
    void expand(const refine_parameters& p, int j, int k, double* gram) const;
    void correlate(const refine_parameters& p, const okid_correlation_sums_t& record, const refine_sums& sums) const;
    void centre(const refine_parameters& p, const okid_correlation_sums_t& record, const refine_sums& sums) const;
};

} // namespace okid
