// SPDX-License-Identifier: MIT
// Measured records in, one identified model out: detrending, exact merging, initial states, fit.
#pragma once
#include "csv.hpp"
#include "result/result.hpp"

#include <cstddef>
#include <functional>
#include <memory>
#include <string>
#include <vector>

namespace okid_host {

/// A record split for the model: u is n_u x count, y n_y x count, column-major, NaN = missing.
struct record_data {
    std::string path;
    std::size_t count = 0;
    std::vector<double> u, y;
};

struct record_options {
    std::vector<std::string> inputs, outputs;
    double fs_hz = 0;
    int p = 40, rows = 0, order = 0; ///< rows 0 = 2 p, n4sid 30, okid without inputs p; order 0 = automatic
    bool p_given = false;
    std::string method = "okid-era", hankel = "system", hold = "zoh", detrend = "mean";
    std::string start =
        "moving";               ///< "rest": each record begins before the structure was struck, its silent past is used
    bool refine = false;        ///< maximum likelihood after the identification
    mass_plan mass;             ///< where the channels stand, when M, K and R are wanted
    remarks said;               ///< known before the data are seen
    bool stabilization = false; ///< look at all orders and some horizons too
    int sigma_blocks = 20;      ///< blocks left out in turn for the standard deviations; 0 = none
    std::function<void(const char* stage)> stage; ///< told what begins; may be empty
};

/// The memory of a refined model.
struct refined_arrays {
    std::vector<double> A, B, C, D, K, markov, frequency, damping, mpc, emac, cmi, shape_re, shape_im;
    std::vector<double> C_without_skew, D_without_skew; ///< where outputs come late
};

/// The model looks into the memory kept beside it.
struct record_result {
    okid_identified_t model{};
    result_context context;
    std::unique_ptr<std::byte[]> memory;
    std::shared_ptr<refined_arrays> refined; ///< of a model that was refined
};

/// Split the samples of a CSV record (columns: inputs, then outputs), optionally only samples first .. last-1.
record_data split_record(const csv_record& record, std::size_t n_u, std::size_t first, std::size_t last);

/// Samples first .. first + count - 1 of a record as the library takes them: inputs, then outputs, sample by sample.
void interleave(const record_data& record, std::size_t n_u, std::size_t n_y, std::size_t first, std::size_t count,
                double* out);

/// Remove the least-squares line of each channel, fitted to its present samples.
void remove_lines(double* samples, std::size_t channels, std::size_t count);

/// Identify from all records together. Throws `failure`: exit 3 when no honest model can be had.
record_result identify_records(std::vector<record_data> records, const record_options& options);

} // namespace okid_host
