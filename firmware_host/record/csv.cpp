// SPDX-License-Identifier: MIT
// PURPOSE  rows of a CSV file into samples, with the place of every fault
// METHOD   plain numbers by from_chars where they stand; anything else in a cell takes the slow way
#include "csv.hpp"

#include "csv_header.hpp"
#include "error.hpp"
#include "files/nearest_name.hpp"
#include "line_reader.hpp"

#include <algorithm>
#include <cctype>
#include <charconv>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <fmt/format.h>
#include <iterator>
#include <limits>

namespace okid_host {
namespace {

constexpr int skipped = -1;
constexpr int time_stamp = -2;
constexpr double missing_value = std::numeric_limits<double>::quiet_NaN();

/// Rows of one file on their way into a record.
class row_parser {
  public:
    row_parser(const std::string& path, const csv_header& header, const csv_request& request, csv_record& out)
        : path_(path), header_(header), out_(out), target_(header.names.size(), skipped), row_(request.columns.size()) {
        for (std::size_t k = 0; k < request.columns.size(); ++k) {
            const std::size_t at = find_csv_column(path, header, request.columns[k]);
            if (target_[at] != skipped)
                throw failure(exit_usage,
                              fmt::format("{}, line {}: \"{}\" and \"{}\" are the same column", path, header.line,
                                          request.columns[static_cast<std::size_t>(target_[at])], request.columns[k]));
            target_[at] = static_cast<int>(k);
            out.units.push_back(unit_of_name(header.names[at]));
        }
    }

    /// Read the time stamps too; the column is time_s.
    void want_time(std::size_t column) {
        time_column_ = static_cast<int>(column);
        copy_time_from_ = target_[column];
        if (target_[column] == skipped) target_[column] = time_stamp;
    }

    /// The time stamps of a column that was read as samples.
    void take_times(std::size_t column) {
        time_column_ = static_cast<int>(column);
        const auto at = static_cast<std::size_t>(target_[column]);
        for (std::size_t i = 0; i < out_.count; ++i) take_time(out_.first_line + i, out_.samples[i * row_.size() + at]);
    }

    void add(std::size_t number, std::string_view line);
    double rate_of_time() const;

  private:
    const char* odd_cell(std::size_t number, std::size_t field, const char* begin, const char* end, double& value);
    [[noreturn]] void bad_cell(std::size_t number, std::size_t field, std::string_view found,
                               const char* expected) const;
    [[noreturn]] void ragged(std::size_t number, std::string_view line) const;
    const char* end_of_field(const char* at, const char* end) const;
    void take_time(std::size_t number, double value);

    const std::string& path_;
    const csv_header& header_;
    csv_record& out_;
    std::vector<int> target_;
    std::vector<double> row_;
    std::vector<double> times_;
    int time_column_ = -1, copy_time_from_ = skipped;
    char decimal_ = 0; // '.' or ',' once seen in a semicolon file
};

void row_parser::bad_cell(std::size_t number, std::size_t field, std::string_view found, const char* expected) const {
    throw failure(exit_usage,
                  fmt::format("{}, line {}, column {} ({}): found \"{}\", expected {}", path_, number, field + 1,
                              printable(header_.names[field]), printable(std::string(found)), expected));
}

const char* row_parser::end_of_field(const char* at, const char* end) const {
    const char* first = at;
    while (first < end && *first == ' ') ++first;
    if (first < end && *first == '"') {
        for (at = first + 1; at < end; ++at) {
            if (*at != '"') continue;
            if (at + 1 < end && at[1] == '"')
                ++at;
            else
                break;
        }
        if (at < end) ++at;
    }
    const auto* stop = static_cast<const char*>(std::memchr(at, header_.separator, static_cast<std::size_t>(end - at)));
    return stop ? stop : end;
}

void row_parser::ragged(std::size_t number, std::string_view line) const {
    std::size_t cells = 1;
    const char* const begin = line.data();
    const char* const end = begin + line.size();
    for (const char* at = end_of_field(begin, end); at < end; at = end_of_field(at + 1, end)) ++cells;
    const bool halves = header_.separator == ',' && header_.names.size() > 1 && cells == 2 * header_.names.size();
    throw failure(exit_usage,
                  fmt::format("{}, line {}: found {} cell{}, expected {} as in the header (line {}){}", path_, number,
                              cells, cells == 1 ? "" : "s", header_.names.size(), header_.line,
                              halves ? ". Decimal commas need semicolons between the cells" : ""));
}

/// A cell that is not simply a number: blanks, quotes, empty, nan, decimal comma; anything else is an error.
const char* row_parser::odd_cell(std::size_t number, std::size_t field, const char* begin, const char* end,
                                 double& value) {
    const char* stop = end_of_field(begin, end);
    std::string text(begin, stop);
    const auto blank = [](char c) { return c == ' ' || c == '\t'; };
    const auto strip = [&](std::string& s) {
        while (!s.empty() && blank(s.back())) s.pop_back();
        s.erase(0, static_cast<std::size_t>(std::find_if_not(s.begin(), s.end(), blank) - s.begin()));
    };
    strip(text);
    if (text.size() >= 2 && text.front() == '"' && text.back() == '"') {
        text = text.substr(1, text.size() - 2);
        strip(text);
    }
    const std::string found = text;
    value = missing_value;
    if (text.empty()) return stop;
    if (text.front() == '+' && text.size() > 1 && text[1] != '-') text.erase(0, 1);
    if (header_.separator == ';') {
        const std::size_t comma = text.find(',');
        const char mark = comma != std::string::npos ? ',' : text.find('.') != std::string::npos ? '.' : char{0};
        if (mark && decimal_ && mark != decimal_)
            bad_cell(number, field, found, "one decimal mark in the whole file, either a point or a comma");
        if (mark) decimal_ = mark;
        if (comma != std::string::npos && text.find('.') == std::string::npos) text[comma] = '.';
    }
    const auto [last, error] = std::from_chars(text.data(), text.data() + text.size(), value);
    if (last != text.data() + text.size() || error == std::errc::invalid_argument)
        bad_cell(number, field, found, "a number, nan or an empty cell");
    if (error == std::errc::result_out_of_range) value = std::strtod(text.c_str(), nullptr); // tiny -> 0, huge -> inf
    if (std::isinf(value))
        bad_cell(number, field, found, "a finite number (an overrange sample is no measurement; mark it nan)");
    return stop;
}

void row_parser::take_time(std::size_t number, double value) {
    if (std::isnan(value))
        bad_cell(number, static_cast<std::size_t>(time_column_), "", "a time stamp in every row (or give --fs HZ)");
    times_.push_back(value);
}

void row_parser::add(std::size_t number, std::string_view line) {
    const char* at = line.data();
    const char* const end = at + line.size();
    const char separator = header_.separator;
    const std::size_t fields = target_.size();
    for (std::size_t field = 0; field < fields; ++field) {
        if (field > 0) {
            if (at == end) ragged(number, line);
            ++at;
        }
        const int slot = target_[field];
        if (slot == skipped) {
            at = end_of_field(at, end);
            continue;
        }
        while (at < end && *at == ' ') ++at;
        double value = 0;
        const auto [stop, error] = std::from_chars(at, end, value);
        const bool plain =
            error == std::errc{} && (stop == end || *stop == separator) && std::isfinite(value) && separator != ';';
        at = plain ? stop : odd_cell(number, field, at, end, value);
        if (slot == time_stamp) {
            take_time(number, value);
        } else {
            row_[static_cast<std::size_t>(slot)] = value;
        }
    }
    if (at != end) ragged(number, line);
    if (copy_time_from_ >= 0) take_time(number, row_[static_cast<std::size_t>(copy_time_from_)]);
    out_.samples.insert(out_.samples.end(), row_.begin(), row_.end());
    ++out_.count;
}

double row_parser::rate_of_time() const {
    const std::size_t n = times_.size();
    if (n < 2) throw failure(exit_usage, fmt::format("{}: one row has no sample rate; give --fs HZ", path_));
    const double step = (times_.back() - times_.front()) / static_cast<double>(n - 1);
    for (std::size_t i = 1; i < n; ++i) {
        const double found = times_[i] - times_[i - 1];
        if (found > 0 && std::abs(found - step) <= 0.05 * step) continue;
        throw failure(
            exit_usage,
            fmt::format("{}, line {}, column {} (time_s): found a step of {:.6g} s, expected {:.6g} s as on average: "
                        "the samples are not evenly spaced, or rows are missing, or the stamps are rounded. Put a row "
                        "of empty cells where a sample is missing; give --fs HZ if the samples were evenly spaced",
                        path_, out_.first_line + i, time_column_ + 1, found, step));
    }
    return std::strtod(fmt::format("{:.9g}", 1.0 / step).c_str(), nullptr); // stamps carry no more digits than that
}

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

void read_rows(line_reader& reader, row_parser& rows, csv_record& out, const csv_request& request) {
    std::string_view line;
    std::size_t empty_line = 0, next_report = 0;
    while (reader.next(line)) {
        if (line.find_first_not_of(" \t") == std::string_view::npos &&
            (line.empty() || line.find('\t') == std::string_view::npos)) {
            if (!empty_line) empty_line = reader.number();
            continue;
        }
        if (empty_line)
            throw failure(exit_usage,
                          fmt::format("{}, line {}: an empty line between rows, expected a row (a missing sample is "
                                      "written as nan cells)",
                                      out.path, empty_line));
        if (out.count == 0) {
            out.first_line = reader.number();
            if (reader.size())
                out.samples.reserve(request.columns.size() * (reader.size() / (line.size() + 1) * 11 / 10 + 16));
        }
        rows.add(reader.number(), line);
        if (request.progress && reader.bytes() > next_report) {
            request.progress(static_cast<double>(reader.bytes()) / 1e6);
            next_report = reader.bytes() + (std::size_t{1} << 24);
        }
    }
}

} // namespace

std::vector<std::string> read_csv_columns(const std::string& path) {
    line_reader reader(path);
    return read_head(reader, path).names;
}

/// A column of another name that may be meant as the time.
static std::string time_like(const std::vector<std::string>& names) {
    for (const std::string& name : names) {
        std::string small;
        for (const char c : name) small += static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
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
    const auto time = std::find(header.names.begin(), header.names.end(), "time_s");
    const bool use_time = !request.fs_hz && !header.fs_hz && time != header.names.end();
    if (use_time && !request.whole) rows.want_time(static_cast<std::size_t>(time - header.names.begin()));
    if (!request.fs_hz && !header.fs_hz && !use_time && !request.whole)
        throw failure(exit_usage,
                      fmt::format("{}: no sample rate{}{}; expected --fs HZ, a line \"# fs_hz: 1024\" above the column "
                                  "names, or a column time_s",
                                  path, header.fs_remark.empty() ? "" : " (" + header.fs_remark + ")",
                                  time_like(header.names)));
    read_rows(reader, rows, out, request);
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
