// SPDX-License-Identifier: MIT
// PURPOSE  one CSV record in memory: the columns asked for, NaN where a sample is missing.
#pragma once
#include <cstddef>
#include <functional>
#include <optional>
#include <string>
#include <vector>

namespace okid_host {

struct csv_request {
    std::vector<std::string> columns; ///< names, in the order wanted
    bool whole = false;               ///< instead: every column that has a name, empty ones and an unknown rate too
    std::optional<double> fs_hz;      ///< overrides what the file says
    std::function<void(double share)> progress; ///< called now and then while reading, 0 to 1; may be empty
};

struct csv_record {
    std::string path;
    std::vector<std::string> columns, units; ///< as asked for; unit "" when the header names none
    double fs_hz = 0;                        ///< 0: not known (`whole` only)
    std::optional<double> said_fs_hz;        ///< what the file itself says above its column names
    std::size_t count = 0;                   ///< samples
    std::vector<double> samples;             ///< columns x count, column-major: one sample after the other
    std::size_t first_line = 0;              ///< line number of the first sample
    std::vector<std::string> comments;       ///< the lines above the names, as they stand
    std::string rate_remark;                 ///< why the time gives no rate (`whole` only)
};

/// Read a record. Throws `failure` (exit 2; foreign_table.hpp is a kind of it) naming file, line, column, what was found and what
/// was expected. Columns that were not asked for are skipped unread. A name that ends in .npy is an array (npy.hpp).
csv_record read_csv(const std::string& path, const csv_request& request);

/// Throws (exit 2) where one of the first `checked` columns of `count` rows is missing throughout.
void check_columns(const std::string& path, const std::vector<std::string>& columns, std::size_t checked,
                   const double* rows, std::size_t count);

/// Only the column names, for messages.
std::vector<std::string> read_csv_columns(const std::string& path);

} // namespace okid_host
