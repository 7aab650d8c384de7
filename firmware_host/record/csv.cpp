// SPDX-License-Identifier: MIT
// PURPOSE  a CSV file into a record: what its head says, its rows, its rate
// METHOD   the rate asked for comes before that of a comment, that before the column time_s
#include "csv.hpp"

#include "csv_header.hpp"
#include "csv_rows.hpp"
#include "error.hpp"
#include "files/nearest_name.hpp"
#include "line_reader.hpp"
#include "npy.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <iterator>

namespace okid_host {
namespace {

/// Comments and names; leaves the reader at the first row.
csv_header read_head(line_reader& reader, const std::string& path) {
    csv_header header;
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
        return header;
    }
    throw failure(exit_usage,
                  fmt::format("{}: no line of column names, expected names and then rows of numbers", path));
}

} // namespace

std::vector<std::string> read_csv_columns(const std::string& path) {
    if (is_npy(path)) return read_npy_columns(path);
    line_reader reader(path);
    return read_head(reader, path).names;
}

/// "time_s", and what loggers write: "Time [s]", "t (s)".
static bool is_time_in_seconds(const std::string& name) {
    if (name == "time_s") return true;
    std::string small = lower_case(name);
    small.erase(std::remove(small.begin(), small.end(), ' '), small.end());
    return small == "time[s]" || small == "time(s)" || small == "t[s]" || small == "t(s)";
}

/// A column of another name that may be meant as the time.
static std::string time_like(const std::vector<std::string>& names) {
    for (const std::string& name : names) {
        const std::string small = lower_case(name);
        if (small.rfind("time", 0) == 0 && small.find("ms") != std::string::npos)
            return fmt::format(" (\"{}\" is not in seconds: give the rate with --fs)", printable(name));
        if (small == "t" || small.rfind("time", 0) == 0)
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

csv_record read_csv(const std::string& path, const csv_request& asked) {
    if (is_npy(path)) return read_npy(path, asked);
    line_reader reader(path);
    const csv_header header = read_head(reader, path);
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
    const auto time = std::find_if(header.names.begin(), header.names.end(), is_time_in_seconds);
    const bool use_time = !request.fs_hz && !header.fs_hz && time != header.names.end();
    if (use_time && !request.whole) rows.want_time(static_cast<std::size_t>(time - header.names.begin()));
    if (!request.fs_hz && !header.fs_hz && !use_time && !request.whole)
        throw failure(exit_usage,
                      fmt::format("{}: no sample rate{}{}; expected --fs HZ, a line \"# fs_hz: 1024\" above the column "
                                  "names, or a column time_s (exports of loggers: okid-convert {} OUT.csv)",
                                  path, header.fs_remark.empty() ? "" : " (" + header.fs_remark + ")",
                                  time_like(header.names), path));
    rows.read(reader, request);
    if (out.count == 0)
        throw failure(exit_usage,
                      fmt::format("{}: no rows after the column names (line {}), expected samples", path, header.line));
    if (!request.whole) check_columns(path, out.columns, out.columns.size(), out.samples.data(), out.count);
    out.fs_hz = request.fs_hz.value_or(header.fs_hz.value_or(0));
    if (!use_time) return out;
    if (!request.whole) return out.fs_hz = rows.rate_of_time(), out;
    try { // without a rate a record can still be looked at
        rows.take_times(static_cast<std::size_t>(time - header.names.begin()));
        out.fs_hz = rows.rate_of_time();
    } catch (const failure& fault) {
        out.rate_remark = fault.what();
    }
    return out;
}

} // namespace okid_host
