// SPDX-License-Identifier: MIT
// PURPOSE    passes over the records at one set of parameters: sums for a step, scores of blocks, whiteness of the residuals
#pragma once
#include "identify/refine_step.hpp"

namespace okid {

/// The records as the caller gave them.
struct refine_records {
    const int32_t* counts;
    const double* samples;
};

struct refine_pass {
    static constexpr int lags = 20;
    const refine_layout* layout;
    refine_signals signals;
    double *run_gram, *run_with_e; ///< of_run x of_run, of_run x n_y
    double *history, *correlation; ///< n_y x lags: of the last residuals; sum of their products
    long long products[lags];
    long long seen; ///< residuals in a row

    void lay_out(const refine_layout& l, arena& memory);

    /// Everything a step needs; the mean square of the outputs stands in `sums` already.
    void sum(const refine_parameters& p, const refine_records& records, refine_sums& sums);
    /// scores (total x n_y each): the signals times the residuals of every block. @return the whiteness
    double score(const refine_parameters& p, const refine_records& records, const refine_sums& sums, int blocks,
                 double* scores);

  private:
    template <class Flush> void walk(const refine_parameters& p, const refine_records& records, int run, Flush flush);
    void correlate(const double* e, bool follows);
};

} // namespace okid
