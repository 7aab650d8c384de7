// SPDX-License-Identifier: MIT
// PURPOSE  a CSV file into a record: what its head says, its rows, its rate
// METHOD   the rate asked for comes before that of a comment, that before the column time_s
#include "csv.hpp"

#include "csv_header.hpp"
#include "csv_rows.hpp"
#include "error.hpp"
#include "files/nearest_name.hpp"
#include "foreign_table.hpp"
#include "line_reader.hpp"
#include "npy.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <iterator>

namespace okid_host {
namespace {

/// Comments and names; leaves the reader at the first row.
void read_head(line_reader& reader, const std::string& path, csv_header& header) {
    std::string_view line;
    while (reader.next(line)) {
        const std::size_t start = line.find_first_not_of(" \t");
        if (start == std::string_view::npos) continue;
        if (line[start] == '#') {
            read_csv_comment(path, reader.number(), line, header);
            header.comments.emplace_back(line);
            continue;
        }
        read_csv_names(path, reader.number(), line, header);
        return;
    }
    throw failure(exit_usage,
                  fmt::format("{}: no line of column names, expected names and then rows of numbers", path));
}

} // namespace

std::vector<std::string> read_csv_columns(const std::string& path) {
    if (is_npy(path)) return read_npy_columns(path);
    line_reader reader(path);
    csv_header header;
    read_head(reader, path, header);
    std::string_view row;
    const std::size_t width = header.names.size();
    if (!header.fs_hz && reader.next(row) && (width == 1 || cells_of(row, header.separator) != width))
        throw foreign_table(exit_usage,
                            fmt::format("{}, line {}: found a title, expected column names", path, header.line));
    return header.names;
}

/// The column of the time: one that says it is in seconds before one that has no unit. @param asked  channels
static std::optional<std::size_t> find_time(const std::vector<std::string>& names,
                                            const std::vector<std::string>& asked) {
    for (const time_name wanted : {time_name::in_seconds, time_name::without_unit})
        for (std::size_t i = 0; i < names.size(); ++i)
            if (name_of_time(names[i]) == wanted &&
                (wanted == time_name::in_seconds || std::find(asked.begin(), asked.end(), names[i]) == asked.end()))
                return i;
    return {};
}

/// A column of another name that may be meant as the time.
static std::string time_like(const std::vector<std::string>& names) {
    for (const std::string& name : names) {
        const std::string small = lower_case(name);
        if (small.rfind("time", 0) == 0 && small.find("ms") != std::string::npos)
            return fmt::format(" (\"{}\" is not in seconds: give the rate with --fs)", printable(name));
        if (small.rfind("time", 0) == 0)
            return fmt::format(" (is \"{}\" the time in seconds? Then call it time_s)", printable(name));
    }
    return "";
}

void check_columns(const std::string& path, const std::vector<std::string>& columns, std::size_t checked,
                   const double* rows, std::size_t count) {
    for (std::size_t k = 0; k < checked; ++k) {
        std::size_t i = 0;
        while (i < count && std::isnan(rows[i * columns.size() + k])) ++i;
        if (i == count)
            throw failure(exit_usage, fmt::format("{}: column \"{}\" holds no number in any of its {} rows, expected "
                                                  "measurements",
                                                  path, columns[k], count));
    }
}

/// @param header  becomes that of the file, as far as it goes
static csv_record read_table(const std::string& path, const csv_request& asked, csv_header& header) {
    line_reader reader(path);
    read_head(reader, path, header);
    csv_request request = asked;
    if (asked.whole)
        std::copy_if(header.names.begin(), header.names.end(), std::back_inserter(request.columns),
                     [](const std::string& name) { return !name.empty(); });
    csv_record out;
    out.path = path;
    out.columns = request.columns;
    out.comments = header.comments;
    out.said_fs_hz = header.fs_hz;
    row_parser rows(path, header, request, out);
    const auto time = find_time(header.names, asked.columns);
    const bool use_time = !request.fs_hz && !header.fs_hz && time;
    if (use_time && !request.whole) rows.want_time(*time);
    if (!request.fs_hz && !header.fs_hz && !use_time && !request.whole)
        throw foreign_table(
            exit_usage,
            fmt::format("{}: no sample rate{}{}; expected --fs HZ, a line \"# fs_hz: 1024\" above the column "
                        "names, or a column time_s (exports of loggers: okid-convert {} OUT.csv)",
                        path, header.fs_remark.empty() ? "" : " (" + header.fs_remark + ")", time_like(header.names),
                        path));
    rows.read(reader, request);
    if (out.count == 0)
        throw failure(exit_usage,
                      fmt::format("{}: no rows after the column names (line {}), expected samples", path, header.line));
    if (!request.whole) check_columns(path, out.columns, out.columns.size(), out.samples.data(), out.count);
    out.fs_hz = request.fs_hz.value_or(header.fs_hz.value_or(0));
    if (!use_time) return out;
    if (!request.whole) return out.fs_hz = rows.rate_of_time(), out;
    try { // without a rate a record can still be looked at
        rows.take_times(*time);
        out.fs_hz = rows.rate_of_time();
    } catch (const failure& fault) {
        out.rate_remark = fault.what();
    }
    return out;
}

csv_record read_csv(const std::string& path, const csv_request& asked) {
    if (is_npy(path)) return read_npy(path, asked);
    csv_header header;
    try {
        return read_table(path, asked, header);
    } catch (const foreign_table& fault) {
        if (header.fs_hz) throw failure(fault.code, fault.what());
        throw;
    }
}

} // namespace okid_host
