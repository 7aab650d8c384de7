// SPDX-License-Identifier: MIT
// PURPOSE  rows of a CSV file into samples, with the place of every fault
// METHOD   lines come in blocks of megabytes, cut into pieces whose lines are counted: so each piece has its place in the record
//          and threads fill them side by side; the first fault of the file is reported. A plain number of up to 18
//          digits and 2^53 is one whole number over a power of ten, both exact: their quotient is the nearest double.
//          Longer ones and exponents take from_chars; anything else in a cell takes the slow way
#include "csv_rows.hpp"

#include "error.hpp"
#include "files/memory_bound.hpp"
#include "files/nearest_name.hpp"
#include "files/side_by_side.hpp"
#include "foreign_table.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <fmt/format.h>
#include <limits>
#include <optional>

namespace okid_host {
namespace {

constexpr int skipped = -1;
constexpr int time_stamp = -2;
constexpr double missing_value = std::numeric_limits<double>::quiet_NaN();
constexpr std::size_t piece_bytes = std::size_t{1} << 19;

std::size_t count_lines(std::string_view text) {
    std::size_t lines = 0, at = 0;
    for (; at < text.size(); ++lines) at = std::min(text.find('\n', at), text.size() - 1) + 1;
    return lines;
}

bool digit(char c) { return static_cast<unsigned char>(c - '0') < 10; }

/// A number of digits and a decimal mark; false for all that is not surely the nearest double. `at` moves behind it.
bool plain_number(const char*& at, const char* end, char mark, double& value) {
    static constexpr double tens[] = {1e0,  1e1,  1e2,  1e3,  1e4,  1e5,  1e6,  1e7,  1e8, 1e9,
                                      1e10, 1e11, 1e12, 1e13, 1e14, 1e15, 1e16, 1e17, 1e18};
    const char* p = at;
    const bool negative = p < end && *p == '-';
    const char* const first = p += negative;
    std::uint64_t whole = 0;
    for (; p < end && digit(*p); ++p) whole = whole * 10 + static_cast<std::uint64_t>(*p - '0');
    std::ptrdiff_t digits = p - first, decimals = 0;
    if (p < end && *p == mark) {
        const char* const point = ++p;
        for (; p < end && digit(*p); ++p) whole = whole * 10 + static_cast<std::uint64_t>(*p - '0');
        decimals = p - point;
        digits += decimals;
    }
    if (digits < 1 || digits > 18 || whole > std::uint64_t{1} << 53) return false;
    const double size = static_cast<double>(whole) / tens[decimals];
    value = negative ? -size : size;
    at = p;
    return true;
}

} // namespace

row_parser::row_parser(const std::string& path, const csv_header& header, const csv_request& request, csv_record& out)
    : path_(path), header_(header), out_(out), target_(header.names.size(), skipped), width_(request.columns.size()),
      copy_time_from_(skipped) {
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

void row_parser::want_time(std::size_t column) {
    time_column_ = static_cast<int>(column);
    copy_time_from_ = target_[column];
    if (target_[column] == skipped) target_[column] = time_stamp;
}

void row_parser::take_times(std::size_t column) {
    time_column_ = static_cast<int>(column);
    const auto at = static_cast<std::size_t>(target_[column]);
    times_.resize(out_.count);
    for (std::size_t i = 0; i < out_.count; ++i) take_time(out_.first_line + i, i, out_.samples[i * width_ + at]);
}

void row_parser::bad_row(std::size_t number, const std::string& what) const {
    if (number == header_.line + 1) throw foreign_table(exit_usage, what); // a line of units; a title above the names
    throw failure(exit_usage, what);
}

void row_parser::bad_cell(std::size_t number, std::size_t field, std::string_view found, const char* expected) const {
    bad_row(number, fmt::format("{}, line {}, column {} ({}): found \"{}\", expected {}", path_, number, field + 1,
                                printable(header_.names[field]), printable(std::string(found)), expected));
}

void row_parser::empty_line_between(std::size_t number) const {
    throw failure(exit_usage,
                  fmt::format("{}, line {}: an empty line between rows, expected a row (a missing sample is "
                              "written as nan cells)",
                              path_, number));
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
    bad_row(number, fmt::format("{}, line {}: found {} cell{}, expected {} as in the header (line {}){}", path_, number,
                                cells, cells == 1 ? "" : "s", header_.names.size(), header_.line,
                                halves ? ". Decimal commas need semicolons between the cells" : ""));
}

/// A cell that is not simply a number: blanks, quotes, empty, nan, decimal comma; anything else is an error.
const char* row_parser::odd_cell(piece& one, std::size_t number, std::size_t field, const char* begin, const char* end,
                                 double& value) const {
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
        if (mark && one.decimal && mark != one.decimal)
            bad_cell(number, field, found, "one decimal mark in the whole file, either a point or a comma");
        if (mark) one.decimal = mark;
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

void row_parser::take_time(std::size_t number, std::size_t index, double value) {
    if (std::isnan(value))
        bad_cell(number, static_cast<std::size_t>(time_column_), "", "a time stamp in every row (or give --fs HZ)");
    times_[index] = value;
}

void row_parser::row(piece& one, std::size_t number, std::string_view line, double* to) {
    const char* at = line.data();
    const char* const end = at + line.size();
    const char separator = header_.separator;
    const std::size_t fields = target_.size(), index = one.first + one.rows;
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
        const char* stop = at;
        bool plain = plain_number(stop, end,
                                  separator != ';' ? '.'
                                  : one.decimal    ? one.decimal
                                                   : '\n',
                                  value) &&
                     (stop == end || *stop == separator);
        if (!plain && separator != ';') {
            const auto [last, error] = std::from_chars(at, end, value);
            plain = error == std::errc{} && (last == end || *last == separator) && std::isfinite(value);
            stop = last;
        }
        at = plain ? stop : odd_cell(one, number, field, at, end, value);
        if (slot == time_stamp)
            take_time(number, index, value);
        else
            to[slot] = value;
    }
    if (at != end) ragged(number, line);
    if (copy_time_from_ >= 0) take_time(number, index, to[copy_time_from_]);
}

void row_parser::parse(piece& one) {
    double* const to = out_.samples.data() + one.first * width_;
    const char* at = one.text.data();
    const char* const end = at + one.text.size();
    for (std::size_t number = one.line; at < end; ++number) {
        const auto* newline = static_cast<const char*>(std::memchr(at, '\n', static_cast<std::size_t>(end - at)));
        const char* const stop = newline ? newline : end;
        std::string_view line(at, static_cast<std::size_t>(stop - at));
        at = newline ? newline + 1 : end;
        if (!line.empty() && line.back() == '\r') line.remove_suffix(1);
        if (line.find_first_not_of(' ') == std::string_view::npos) { // tabs are cells
            if (!one.empty_line) one.empty_line = number;
            continue;
        }
        if (one.rows == 0) one.row_line = number;
        if (one.empty_line) empty_line_between(one.empty_line);
        row(one, number, line, to + one.rows * width_);
        ++one.rows;
    }
}

/// A block into pieces of whole lines, one behind the other in the record. @return the number of the line behind it
std::size_t row_parser::cut(std::string_view text, std::size_t line) {
    pieces_.clear();
    std::size_t first = out_.count;
    while (!text.empty()) {
        const std::size_t newline = text.find('\n', std::min(piece_bytes, text.size() - 1));
        piece one;
        one.text = text.substr(0, newline == std::string_view::npos ? text.size() : newline + 1);
        one.line = line;
        one.first = first;
        const std::size_t lines = count_lines(one.text);
        line += lines;
        first += lines;
        text.remove_prefix(one.text.size());
        pieces_.push_back(one);
    }
    require_samples(path_, first, width_);
    out_.samples.resize(first * width_);
    if (time_column_ >= 0) times_.resize(first);
    return line;
}

/// Until the decimal mark of a semicolon file is known, one piece after the other.
void row_parser::parse_pieces() {
    const auto work = [&](std::size_t k) {
        piece& one = pieces_[k];
        one.decimal = decimal_;
        try {
            parse(one);
        } catch (...) {
            one.fault = std::current_exception();
        }
    };
    std::size_t alone = 0;
    for (; header_.separator == ';' && !decimal_ && alone < pieces_.size(); ++alone) {
        work(alone);
        decimal_ = pieces_[alone].decimal;
    }
    side_by_side(pieces_.size() - alone, 0, [&](std::size_t k) { work(alone + k); });
}

/// The pieces in the order of the file: the first fault, and how many rows there are.
void row_parser::collect() {
    for (const piece& one : pieces_) {
        if (empty_line_ && one.row_line) empty_line_between(empty_line_);
        if (one.fault) std::rethrow_exception(one.fault);
        if (out_.count == 0 && one.rows > 0) out_.first_line = one.row_line;
        out_.count += one.rows;
        if (!empty_line_) empty_line_ = one.empty_line;
    }
}

void row_parser::read(line_reader& reader, const csv_request& request) {
    std::size_t line = reader.number() + 1;
    for (std::string_view block; reader.next_lines(block);) {
        if (out_.count == 0 && reader.size()) {
            const double all = static_cast<double>(reader.size()) / static_cast<double>(block.size());
            const auto lines = static_cast<double>(count_lines(block));
            const auto expected = static_cast<std::size_t>(1.1 * all * lines + 16);
            if (samples_fit(expected, width_)) out_.samples.reserve(width_ * expected);
        }
        line = cut(block, line);
        parse_pieces();
        collect();
        if (request.progress && reader.size())
            request.progress(static_cast<double>(reader.bytes()) / static_cast<double>(reader.size()));
    }
    out_.samples.resize(out_.count * width_); // without empty lines at the end
    if (time_column_ >= 0) times_.resize(out_.count);
}

/// The decimal place that holds the last digit of every stamp; 0 where that is none of the first nine.
static double last_place(const std::vector<double>& times) {
    double place = 1;
    for (int digits = 0; digits <= 9; ++digits, place /= 10)
        if (std::all_of(times.begin(), times.end(), [place](double time) {
                return std::abs(time - std::round(time / place) * place) < 1e-3 * place;
            }))
            return place;
    return 0;
}

static bool is_uneven(double found, double mean) { return !(found > 0) || std::abs(found - mean) > 0.05 * mean; }

/// How far stamps stray from a line of this slope, from the lowest to the highest; the first counts from 0.
static double spread_about(const std::vector<double>& times, double step) {
    double low = 0, high = 0;
    for (std::size_t i = 0; i < times.size(); ++i) {
        const double off = times[i] - times[0] - step * static_cast<double>(i);
        low = std::min(low, off), high = std::max(high, off);
    }
    return high - low;
}

/// The rate of even samples whose stamps were rounded: some line holds them all within one of their last digit. A missing row
/// moves all that follow by a step, which 100 rows show; a few of them may by chance look as if rounded, ten do not. The rate has
/// as few digits as the stamps allow.
static std::optional<double> rate_of_rounded(const std::vector<double>& times) {
    const auto steps = static_cast<double>(times.size() - 1);
    const double place = last_place(times), duration = times.back() - times.front(),
                 per_step = place * steps / duration;
    if (place == 0 || !(duration > 0) || steps < 100 * std::max(1.0, per_step * per_step)) return {};
    if (!std::is_sorted(times.begin(), times.end())) return {};
    int uneven = 0;
    for (std::size_t i = 1; i < times.size(); ++i) uneven += is_uneven(times[i] - times[i - 1], duration / steps);
    if (uneven < 10) return {};
    double low = (duration - place) / steps, high = (duration + place) / steps, step = duration / steps;
    const double most = 1.001 * place + 4e-16 * std::abs(times.back());
    while (spread_about(times, step) > most) {                                    // it is convex in the slope
        if (high - low < std::max(1e-9 * place / steps, 1e-15 * step)) return {}; // doubles know no finer
        const double a = low + (high - low) / 3, b = high - (high - low) / 3;
        if (spread_about(times, a) < spread_about(times, b))
            high = b;
        else
            low = a;
        step = (low + high) / 2;
    }
    double rate = 1 / step;
    for (int digits = 2; digits <= 12; ++digits) {
        rate = std::strtod(fmt::format("{:.{}g}", 1 / step, digits).c_str(), nullptr);
        if (spread_about(times, 1 / rate) <= most) break;
    }
    return rate;
}

double row_parser::rate_of_time() const {
    const std::size_t n = times_.size();
    if (n < 2) throw failure(exit_usage, fmt::format("{}: one row has no sample rate; give --fs HZ", path_));
    const std::string& name = header_.names[static_cast<std::size_t>(time_column_)];
    const double step = (times_.back() - times_.front()) / static_cast<double>(n - 1);
    for (std::size_t i = 1; i < n; ++i) {
        const double found = times_[i] - times_[i - 1];
        if (!is_uneven(found, step)) continue;
        if (const auto rate = rate_of_rounded(times_)) return *rate;
        throw foreign_table(
            exit_usage,
            fmt::format("{}, line {}, column {} ({}): found a step of {:.6g} s, expected {:.6g} s as on average: "
                        "the samples are not evenly spaced, or rows are missing. Put a row of empty cells where a "
                        "sample is missing; give --fs HZ if the samples were evenly spaced",
                        path_, out_.first_line + i, time_column_ + 1, printable(name), found, step));
    }
    if (name_of_time(name) == time_name::without_unit && last_place(times_) == 1)
        throw foreign_table(exit_usage,
                            fmt::format("{}, column {} ({}): found whole numbers without a unit, which may be "
                                        "milliseconds or a count; expected --fs HZ, or the name time_s where "
                                        "they are seconds",
                                        path_, time_column_ + 1, printable(name)));
    return std::strtod(fmt::format("{:.9g}", 1.0 / step).c_str(), nullptr); // stamps carry no more digits than that
}

} // namespace okid_host
