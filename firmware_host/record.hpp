// SPDX-License-Identifier: MIT
// Measured records in, one identified model out: detrending, exact merging, initial states, fit.
#pragma once
#include "csv.hpp"
#include "result.hpp"

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
    int p = 40, rows = 0, order = 0; ///< rows 0 = 2 p, n4sid 30; order 0 = automatic
    bool p_given = false;
    std::string method = "okid-era", hold = "zoh", detrend = "mean";
    std::string start =
        "moving";   ///< "rest": each record begins before the structure was struck, its silent past is used
    mass_plan mass; ///< where the channels stand, when M, K and R are wanted
    remarks said;   ///< known before the data are seen
    std::function<void(const char* stage)> stage; ///< told what begins; may be empty
};

/// The model looks into the memory kept beside it.
struct record_result {
    okid_identified_t model{};
    result_context context;
    std::unique_ptr<std::byte[]> memory;
};

/// Split the samples of a CSV record (columns: inputs, then outputs), optionally only samples first .. last-1.
record_data split_record(const csv_record& record, std::size_t n_u, std::size_t first, std::size_t last);

/// Remove the least-squares line of each channel, fitted to its present samples.
void remove_lines(double* samples, std::size_t channels, std::size_t count);

/// Identify from all records together. Throws `failure`: exit 3 when no honest model can be had.
record_result identify_records(std::vector<record_data> records, const record_options& options);

} // namespace okid_host
