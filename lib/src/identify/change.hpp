// SPDX-License-Identifier: MIT
// PURPOSE    what the two halves of the change test share: the object, and the estimate both of them make
#pragma once
#include <okid/change.h>

#include <complex>
#include <cstddef>

namespace okid {

/// A direction in which the column space can move: that of the frequency of one mode of the baseline.
struct change_direction {
    double *left_re, *left_im;   ///< i n_y each: what looks at the residual
    double *right_re, *right_im; ///< n each: what the states are multiplied with
};

constexpr int fewest_change_blocks = 4;

} // namespace okid

/// Rows of a block: [future inputs; future outputs; past], oldest first, w = n_f + h + k of them.
struct okid_change {
    okid_change_config_t config;
    int m, n_f, h, k, w;        ///< channels; rows of the three kinds, and together
    int most_order, most_modes; ///< room
    int order, modes;           ///< of the baseline; 0 = none
    int added;                  ///< blocks at hand
    double rows, baseline_rows; ///< regression rows in them
    okid::change_direction* direction;
    okid_change_mode_t* mode;
    double *sums, *total; ///< w x w each
    double* block_rows;
    double* scale;         ///< 1 / rms of each channel in the baseline
    double *own, *outside; ///< i n_y x n and i n_y x (i n_y - n): bases of the column space and of its complement
    double *at_baseline, *spread; ///< frequency estimates of the baseline and their covariance, modes and modes^2
    int baseline_blocks;
    // Of one estimate.
    double *free_inputs, *regression; ///< factor of the future inputs' sums; coefficients on them, n_f x (h + k)
    double *cross, *past, *future;    ///< h x k, k x k (factor), h x h: sums less what the future inputs explain
    double *seen, *instrument, *core; ///< k x n, k x n, n x n
    double* residual;                 ///< i n_y x n: the column space of the data in the coordinates of the baseline
    double *left, *right, *half;      ///< (n_f + h) and (n_f + k) numbers, and what a block makes of one
    double *estimate, *deviation, *covariance, *solved, *weights; ///< modes; modes x blocks; modes^2 each
    // Of learning.
    double *projected, *explained, *values, *vectors, *spare; ///< k x h, h x h, h, h x h
    double *noise, *jacobian, *whitened, *normal, *target;    ///< factor of the residual's covariance; one mode's fit
    okid_real_t *transition, *re, *im, *eigenvectors, *work;
    std::complex<double>*shape, *powers, *derivative; ///< of a mode at the first block row; lambda^j and its derivative
};

namespace okid {

/// total <- the scaled sums of all blocks; cross, past (factor), future: less what the future inputs explain.
okid_status_t change_reduce(okid_change& s);
/// estimate, covariance <- how far the frequencies are from where the chart of the baseline begins.
okid_status_t change_estimate(okid_change& s);
/// Column space, complement, directions from the blocks at hand. config.order = 0: chooses the order.
okid_status_t change_space(okid_change& s);
/// Nothing is known of the units yet.
void change_unscaled(okid_change& s);

} // namespace okid
