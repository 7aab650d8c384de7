// SPDX-License-Identifier: MIT
// PURPOSE  the head of a CSV record: comment lines, separator, column names with their units, the stated sample rate.
#pragma once
#include <cstddef>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace okid_host {

struct csv_header {
    std::size_t line = 0;           ///< line number of the names, from 1
    char separator = ',';           ///< ',' ';' or tab
    std::vector<std::string> names; ///< as written, quotes removed
    std::optional<double> fs_hz;    ///< from `# fs_hz: …` or `# sample_rate_hz = …`
    std::vector<std::string> comments;
    std::string fs_remark;           ///< a rate line that holds no number, for the message
    bool looks_like_numbers = false; ///< the line holds numbers: the file has no header
};

/// Take in one `#` line. Throws when two lines state different rates or a rate is not positive.
void read_csv_comment(const std::string& path, std::size_t number, std::string_view line, csv_header& header);

/// Take in the line of names. Throws on duplicate names, an open quote or bytes that are not text.
void read_csv_names(const std::string& path, std::size_t number, std::string_view line, csv_header& header);

/// How many cells a line has.
std::size_t cells_of(std::string_view line, char separator);

/// Index of a column by its name, or by its name without the unit (`acc1` for `acc1 [g]`); throws with the nearest name.
std::size_t find_csv_column(const std::string& path, const csv_header& header, const std::string& name);

/// Is one of these columns called so, with or without its unit?
bool has_column(const std::vector<std::string>& columns, const std::string& name);

/// "acc1" of `acc1 [g]` and `acc1 (g)`.
std::string base_of_name(const std::string& name);

/// "g" of `acc1 [g]`, `acc1 (g)` and `acc1_g`; "" when the name carries no known unit.
std::string unit_of_name(const std::string& name);

/// The names of an option, `a,b,"c,d"`; throws on an empty one.
std::vector<std::string> split_names(const std::string& option, const std::string& list);

enum class time_name { none, without_unit, in_seconds };

/// Does a column of this name hold the time? "time_s" and "Time [s]" say so, with their unit; "t" and "time" without one.
time_name name_of_time(const std::string& name);

} // namespace okid_host
