// SPDX-License-Identifier: MIT
// Records that cannot give a reliable model are refused before anything is computed, with the channel named (exit 3).
#pragma once
#include "record.hpp"

#include <Eigen/Core>
#include <vector>

namespace okid_host {

/// What some inputs are about: complete samples, their mean, the products of what is left of them.
struct input_moments {
    double count = 0;
    Eigen::VectorXd mean;
    Eigen::MatrixXd products;
};

/// Of each record, over its samples that have all inputs.
std::vector<input_moments> moments_of(const record_set& set);

/// Refuses a number that no sensor gives.
void check_measured(const missing_count& missing, const record_set& set, const record_options& options);

/// A channel that never moves makes any model a guess. `screened`: some samples were left out for their looks.
/// @param moved  of each channel, did it in samples before the records; empty: there are none
void check_moving(const record_set& set, const record_options& options, bool screened = false,
                  const std::vector<bool>& moved = {});

/// Inputs that repeat each other share their effect in any proportion; `about`: moments_of() the records.
void check_different_inputs(const std::vector<input_moments>& about, const record_options& options);

/// Outputs that hold the same numbers leave a model directions that nothing was measured of.
void check_different_outputs(const record_set& set, const record_options& options);

/// Are two records the same numbers?
bool same_samples(const record_set& set, const record_data& one, const record_data& other);

/// A record that is there twice counts twice, and the result looks surer than it is.
void remark_repeated(const record_set& set, remarks& said);

/// What is to be said of a sensor that is read more often than it samples, regularly: rows repeat the ones before them, and
/// every mode has images about multiples of the sensor's own rate. Empty: there is nothing to say.
std::string repeated_rows(const record_set& set, double fs_hz);

/// Of an output over all records: samples, and the sum of their squares about their mean.
struct output_spread {
    double count = 0, mean = 0, squares = 0;
};
std::vector<output_spread> spreads_of(const record_set& set);

/// Largest magnitude in each channel of a record.
std::vector<double> largest_of(const record_set& set, const record_data& record);

/// A straight line is removed by --detrend linear and leaves rounding noise only; that is no excitation either.
/// @param before  largest_of() the record as it was
void check_not_a_line(const record_set& set, const record_data& record, const std::vector<double>& before,
                      const record_options& options);

/// A model that neither simulates nor predicts a twentieth of any output says nothing about the structure.
void check_explains(const result_context& context);

/// Outputs that the model hardly follows, simulated or predicted one sample ahead: adds the remark fit_low.
void remark_low_fit(const std::vector<double>& percent, bool simulated, result_context& context);

/// A force among the outputs and another quantity among the inputs, by unit or name: adds the remark exchanged.
void remark_exchanged(const std::vector<std::string>& units, const record_options& options, remarks& said);

/// A hit within the first p samples of every record serves as history only, and is lost: adds the remark hit_at_start.
/// `about`: moments_of() the records.
void remark_early_hit(const record_set& set, const std::vector<input_moments>& about, int p, result_context& context);

} // namespace okid_host
