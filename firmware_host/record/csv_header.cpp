// SPDX-License-Identifier: MIT
#include "csv_header.hpp"

#include "error.hpp"
#include "files/file_kind.hpp"
#include "files/nearest_name.hpp"
#include "foreign_table.hpp"

#include <algorithm>
#include <array>
#include <cctype>
#include <charconv>
#include <cmath>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <unordered_set>

namespace okid_host {
namespace {

bool is_space(char c) { return c == ' ' || c == '\t' || c == '\r'; }

std::string_view trim(std::string_view text) {
    while (!text.empty() && is_space(text.front())) text.remove_prefix(1);
    while (!text.empty() && is_space(text.back())) text.remove_suffix(1);
    return text;
}

bool is_word(char c) { return std::isalnum(static_cast<unsigned char>(c)) || c == '_'; }

/// The text behind `key` and `:` or `=` when the line has it as a word of its own.
std::optional<std::string_view> value_of(std::string_view line, std::string_view key) {
    for (std::size_t at = line.find(key); at != std::string_view::npos; at = line.find(key, at + 1)) {
        if (at > 0 && is_word(line[at - 1])) continue;
        const std::string_view rest = trim(line.substr(at + key.size()));
        if (!rest.empty() && (rest.front() == ':' || rest.front() == '=')) return trim(rest.substr(1));
    }
    return std::nullopt;
}

char find_separator(std::string_view line) {
    std::array<std::size_t, 3> counts{};
    constexpr std::array<char, 3> marks{'\t', ';', ','};
    bool quoted = false;
    for (const char c : line) {
        if (c == '"') quoted = !quoted;
        for (std::size_t k = 0; k < marks.size(); ++k) counts[k] += !quoted && c == marks[k] ? 1u : 0u;
    }
    const auto most = static_cast<std::size_t>(std::max_element(counts.begin(), counts.end()) - counts.begin());
    return counts[most] ? marks[most] : ',';
}

/// Split at the separator; a field that begins with a quote ends at its closing one, "" inside stands for ".
std::vector<std::string> split_quoted(std::string_view line, char separator, bool& open_quote) {
    std::vector<std::string> fields(1);
    bool quoted = false;
    for (std::size_t i = 0; i < line.size(); ++i) {
        const char c = line[i];
        if (quoted && c == '"' && i + 1 < line.size() && line[i + 1] == '"') {
            fields.back() += line[++i];
        } else if (c == '"' && (quoted || trim(fields.back()).empty())) {
            quoted = !quoted;
        } else if (c == separator && !quoted) {
            fields.emplace_back();
        } else {
            fields.back() += c;
        }
    }
    open_quote = quoted;
    for (std::string& field : fields) field = std::string(trim(field));
    return fields;
}

bool is_number(const std::string& text) {
    double value = 0;
    const char* begin = text.data() + (!text.empty() && text[0] == '+' ? 1 : 0);
    const auto [end, error] = std::from_chars(begin, text.data() + text.size(), value);
    return error == std::errc{} && end == text.data() + text.size();
}

} // namespace

std::string base_of_name(const std::string& name) {
    const std::size_t at = name.find_first_of("[(");
    return at == std::string::npos ? name : std::string(trim(std::string_view(name).substr(0, at)));
}

void read_csv_comment(const std::string& path, std::size_t number, std::string_view line, csv_header& header) {
    const std::string text = lower_case(std::string(line));
    auto value = value_of(text, "fs_hz");
    if (!value) value = value_of(text, "sample_rate_hz");
    if (!value) return;
    const bool negative = !value->empty() && value->front() == '-';
    const std::string_view digits = value->substr(negative || (!value->empty() && value->front() == '+') ? 1 : 0);
    const bool number_first = !digits.empty() && (std::isdigit(static_cast<unsigned char>(digits.front())) ||
                                                  (digits.front() == '.' && digits.size() > 1));
    double rate = 0;
    const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), rate);
    if (!number_first || error != std::errc{}) {
        header.fs_remark =
            fmt::format("line {} says \"{}\", which is no number", number, printable(std::string(*value)));
        return;
    }
    if (digits.data() + digits.size() - end >= 2 && end[0] == ',' && std::isdigit(static_cast<unsigned char>(end[1])))
        throw failure(exit_usage,
                      fmt::format("{}, line {}: sample rate \"{}\" is ambiguous, expected a decimal point as "
                                  "in \"512.5\"",
                                  path, number, printable(std::string(*value))));
    if (negative || !(rate > 0))
        throw failure(exit_usage, fmt::format("{}, line {}: sample rate \"{}\", expected a number of Hz above 0", path,
                                              number, printable(std::string(*value))));
    if (header.fs_hz && *header.fs_hz != rate)
        throw failure(exit_usage, fmt::format("{}, line {}: sample rate {} Hz, but an earlier line says {} Hz", path,
                                              number, rate, *header.fs_hz));
    header.fs_hz = rate;
}

void read_csv_names(const std::string& path, std::size_t number, std::string_view line, csv_header& header) {
    for (std::size_t i = 0; i < line.size(); ++i) {
        const auto byte = static_cast<unsigned char>(line[i]);
        if ((byte < 0x20 && byte != '\t' && byte != '\r') || byte == 0x7f)
            throw foreign_table(exit_usage,
                                fmt::format("{}, line {}: byte 0x{:02x} at position {}: this is not a text file; "
                                            "expected a CSV with a line of column names",
                                            path, number, byte, i + 1));
    }
    header.line = number;
    header.separator = find_separator(line);
    bool open_quote = false;
    header.names = split_quoted(line, header.separator, open_quote);
    if (open_quote)
        throw foreign_table(exit_usage,
                            fmt::format("{}, line {}: a quoted column name has no closing quote", path, number));
    std::unordered_set<std::string> seen;
    for (std::size_t i = 0; i < header.names.size(); ++i) {
        const std::string& name = header.names[i];
        if (!name.empty() && !seen.insert(name).second)
            throw foreign_table(exit_usage,
                                fmt::format("{}, line {}, column {}: the name \"{}\" stands twice, expected a "
                                            "different name for each column",
                                            path, number, i + 1, printable(name)));
    }
    header.looks_like_numbers = std::any_of(header.names.begin(), header.names.end(), is_number) &&
                                std::all_of(header.names.begin(), header.names.end(),
                                            [](const std::string& n) { return n.empty() || is_number(n); });
}

std::size_t cells_of(std::string_view line, char separator) {
    bool open_quote = false;
    return split_quoted(line, separator, open_quote).size();
}

std::size_t find_csv_column(const std::string& path, const csv_header& header, const std::string& name) {
    const auto exact = std::find(header.names.begin(), header.names.end(), name);
    if (exact != header.names.end() && !name.empty()) return static_cast<std::size_t>(exact - header.names.begin());
    std::vector<std::size_t> by_base;
    for (std::size_t i = 0; i < header.names.size(); ++i)
        if (!name.empty() && base_of_name(header.names[i]) == name) by_base.push_back(i);
    if (by_base.size() == 1) return by_base[0];
    std::string text = fmt::format("{}, line {}: no column \"{}\"{}; the columns are: {}", path, header.line,
                                   printable(name), did_you_mean(name, header.names), list_names(header.names));
    const file_kind kind = kind_of_text(fmt::format("{}", fmt::join(header.names, ",")));
    if (kind == file_kind::can_log)
        throw failure(exit_usage,
                      fmt::format("{}: it looks like a log of CAN frames, expected a CSV: okid convert {} "
                                  "FILE.csv -c CONFIG.toml makes one, okid replay identifies the log itself",
                                  path, path));
    if (kind != file_kind::unknown && kind != file_kind::csv)
        throw failure(exit_usage, fmt::format("{}: it looks like {}, expected a CSV: comment lines with #, a line of "
                                              "column names, numbers",
                                              path, file_kind_name(kind)));
    if (header.looks_like_numbers) text += ". That line holds numbers: the file needs a line of column names first";
    throw foreign_table(exit_usage, text);
}

bool has_column(const std::vector<std::string>& columns, const std::string& name) {
    return std::any_of(columns.begin(), columns.end(),
                       [&](const std::string& one) { return one == name || base_of_name(one) == name; });
}

std::string unit_of_name(const std::string& name) {
    const std::size_t open = name.find_first_of("[(");
    if (open != std::string::npos) {
        const std::size_t close = name.find(name[open] == '[' ? ']' : ')', open);
        if (close != std::string::npos)
            return std::string(trim(std::string_view(name).substr(open + 1, close - open - 1)));
    }
    const std::size_t bar = name.rfind('_');
    if (bar == std::string::npos || bar == 0) return "";
    const std::string tail = name.substr(bar + 1);
    static const std::array<const char*, 12> known{"g",  "N",  "kN", "m/s2", "m/s^2", "m/s",
                                                   "mm", "um", "m",  "V",    "Nm",    "mps2"};
    return std::find(known.begin(), known.end(), tail) != known.end() ? tail : "";
}

std::vector<std::string> split_names(const std::string& option, const std::string& list) {
    bool open_quote = false;
    std::vector<std::string> names = split_quoted(list, ',', open_quote);
    if (open_quote) throw failure(exit_usage, fmt::format("{}: a quoted name has no closing quote", option));
    for (const std::string& name : names)
        if (name.empty())
            throw failure(exit_usage,
                          fmt::format("{}: found an empty name in \"{}\", expected names with commas between", option,
                                      printable(list, 80)));
    return names;
}

time_name name_of_time(const std::string& name) {
    std::string small = lower_case(name);
    small.erase(std::remove(small.begin(), small.end(), ' '), small.end());
    if (small == "t" || small == "time") return time_name::without_unit;
    const bool seconds = small == "time_s" || small == "t_s" || small == "time[s]" || small == "time(s)" ||
                         small == "t[s]" || small == "t(s)";
    return seconds ? time_name::in_seconds : time_name::none;
}

} // namespace okid_host
