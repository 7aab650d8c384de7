// SPDX-License-Identifier: MIT
// PURPOSE  reads frequency responses
// METHOD   universal file: fixed columns of the 11 header lines of each data set 58 whose function is a frequency response or
//          a coherence; channels are named by node and direction ("12z", "-3x"; node 0: by the place in the file). Lines without
//          coherence are no measurement: NaN
// REFERENCE University of Cincinnati, universal file formats 58 and 58b
#include "response_file.hpp"

#include "error.hpp"
#include "files/input_file.hpp"
#include "files/nearest_name.hpp"
#include "files/order_statistics.hpp"
#include "files/units.hpp"
#include "record/csv.hpp"
#include "record/csv_header.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <complex>
#include <cstring>
#include <fmt/format.h>
#include <string_view>

namespace okid_host {
namespace {

using complex = std::complex<double>;
constexpr std::size_t largest_file = std::size_t{1} << 30;
constexpr int response_function = 4, coherence_function = 6;
constexpr double least_coherence = 0.4; // of the better quarter of the responses: of noise alone, one over the averages
constexpr double upper_quarter = 0.75;
constexpr std::size_t coherent_around = 4; // lines to either side that are judged together
constexpr std::size_t header_lines = 11;

/// One response of a file.
struct response {
    std::string output, input;
    std::vector<double> frequency_hz;
    std::vector<complex> values;
    std::vector<double> coherence; ///< empty: the file has none
    std::string quantity = {};     ///< "": the file does not say
    std::vector<std::string> other_units = {};
};

/// Lines at which even the better responses have no coherence become NaN.
void strike_incoherent(const std::vector<response>& all, Eigen::MatrixXcd& H) {
    const auto lines = static_cast<std::size_t>(H.rows());
    for (std::size_t l = 0; l < lines; ++l) {
        std::vector<double> seen;
        for (const response& one : all) {
            if (one.coherence.size() != lines) continue;
            const std::size_t first = l - std::min(l, coherent_around), last = std::min(lines, l + coherent_around + 1);
            const std::vector<double> around(one.coherence.begin() + static_cast<std::ptrdiff_t>(first),
                                             one.coherence.begin() + static_cast<std::ptrdiff_t>(last));
            seen.push_back(quantile(around, upper_quarter));
        }
        if (!seen.empty() && !(quantile(std::move(seen), upper_quarter) >= least_coherence))
            H.row(static_cast<Eigen::Index>(l)).setConstant(complex(NAN, NAN));
    }
}

response_set set_of(const std::string& path, const std::vector<response>& all) {
    response_set out;
    out.frequency_hz = all.front().frequency_hz;
    out.quantity = all.front().quantity;
    for (const response& one : all) {
        if (one.quantity != out.quantity) out.quantity.clear();
        for (const std::string& unit : one.other_units) (void)place_of(out.other_units, unit);
        (void)place_of(out.outputs, one.output);
        (void)place_of(out.inputs, one.input);
        if (one.frequency_hz.size() != out.frequency_hz.size() ||
            std::abs(one.frequency_hz.back() - out.frequency_hz.back()) > 1e-5 * out.frequency_hz.back())
            throw failure(
                exit_usage,
                fmt::format("{}: {} over {} has {} lines up to {:g} Hz, expected {} up to {:g} Hz as the first "
                            "response",
                            path, one.output, one.input, one.frequency_hz.size(), one.frequency_hz.back(),
                            out.frequency_hz.size(), out.frequency_hz.back()));
    }
    out.H.setConstant(static_cast<Eigen::Index>(out.frequency_hz.size()), out.n_y() * out.n_u(), complex(NAN, NAN));
    for (const response& one : all) {
        const Eigen::Index column = place_of(out.outputs, one.output) + out.n_y() * place_of(out.inputs, one.input);
        if (!out.H.col(column).array().isNaN().all())
            throw failure(exit_usage, fmt::format("{}: {} over {} stands twice, expected each response once", path,
                                                  one.output, one.input));
        for (std::size_t l = 0; l < one.values.size(); ++l) out.H(static_cast<Eigen::Index>(l), column) = one.values[l];
    }
    for (std::size_t l = 1; l < out.frequency_hz.size(); ++l)
        if (!(out.frequency_hz[l] > out.frequency_hz[l - 1]))
            throw failure(exit_usage, fmt::format("{}: line {}: {:g} Hz behind {:g} Hz, expected ascending frequencies",
                                                  path, l + 1, out.frequency_hz[l], out.frequency_hz[l - 1]));
    strike_incoherent(all, out.H);
    return out;
}

/// The text of a universal file, line by line.
class lines_of {
  public:
    lines_of(std::string path, std::string text) : path_(std::move(path)), text_(std::move(text)) {}

    bool next(std::string_view& line) {
        if (at_ >= text_.size()) return false;
        const std::size_t end = std::min(text_.find('\n', at_), text_.size());
        line = std::string_view(text_).substr(at_, end - at_);
        if (!line.empty() && line.back() == '\r') line.remove_suffix(1);
        at_ = end + 1;
        ++number_;
        return true;
    }
    std::string_view bytes(std::size_t count) {
        if (at_ + count > text_.size())
            fail(fmt::format("{} bytes of samples are missing: cut off", at_ + count - text_.size()));
        const std::string_view out = std::string_view(text_).substr(at_, count);
        at_ += count;
        return out;
    }
    [[noreturn]] void fail(const std::string& what) const {
        throw failure(exit_usage, fmt::format("{}: line {}: {}", path_, number_, what));
    }

  private:
    std::string path_, text_;
    std::size_t at_ = 0, number_ = 0;
};

bool is_mark(std::string_view line) {
    return line.substr(0, 6) == "    -1" && line.find_first_not_of(' ', 6) == line.npos;
}

std::string_view trimmed(std::string_view text) {
    const std::size_t first = text.find_first_not_of(' ');
    return first == text.npos ? std::string_view() : text.substr(first, text.find_last_not_of(' ') - first + 1);
}

/// The field from a column on; an empty one is 0.
double number_at(const lines_of& from, std::string_view line, std::size_t first, std::size_t width) {
    std::string text(trimmed(line.substr(std::min(first, line.size()), width)));
    if (text.empty()) return 0;
    std::replace_if(text.begin(), text.end(), [](char c) { return c == 'D' || c == 'd'; }, 'E');
    char* end = nullptr;
    const double value = std::strtod(text.c_str(), &end);
    if (*end != 0) from.fail(fmt::format("found \"{}\", expected a number", printable(text)));
    return value;
}

std::string channel_name(double node, double direction, const char* otherwise) {
    static constexpr std::array<const char*, 7> ways{"", "x", "y", "z", "rx", "ry", "rz"};
    if (node == 0) return otherwise;
    const auto way = static_cast<std::size_t>(std::abs(direction));
    return fmt::format("{}{:g}{}", direction < 0 ? "-" : "", node, way < ways.size() ? ways[way] : "");
}

/// The numbers of a data set that is text, up to its closing mark.
std::vector<double> read_text(lines_of& from, const std::vector<std::size_t>& widths, std::size_t count) {
    std::vector<double> out;
    std::string_view line;
    while (from.next(line) && !is_mark(line))
        for (std::size_t at = 0, k = 0; at < line.size() && !trimmed(line.substr(at)).empty();
             k = (k + 1) % widths.size()) {
            out.push_back(number_at(from, line, at, widths[k]));
            at += widths[k];
        }
    if (out.size() != count) from.fail(fmt::format("the data set has {} numbers, expected {}", out.size(), count));
    return out;
}

std::vector<double> read_binary(lines_of& from, bool wide, bool big, std::size_t count) {
    const std::size_t size = wide ? 8 : 4;
    const std::string_view bytes = from.bytes(size * count);
    std::vector<double> out;
    for (std::size_t k = 0; k < count; ++k) {
        std::array<char, 8> one{};
        std::copy_n(bytes.data() + size * k, size, one.begin());
        if (big) std::reverse(one.begin(), one.begin() + static_cast<std::ptrdiff_t>(size));
        double value = 0;
        float narrow = 0;
        if (wide)
            std::memcpy(&value, one.data(), 8);
        else
            std::memcpy(&narrow, one.data(), 4), value = narrow;
        out.push_back(value);
    }
    std::string_view line;
    while (from.next(line) && !is_mark(line)) {
    }
    return out;
}

/// Into SI units: a response in `upper` over `lower`.
void take_units(const std::string& upper, const std::string& lower, response& to) {
    for (const std::string* name : {&upper, &lower}) {
        const unit_rule* unit = find_unit(*name);
        if (!unit || unit->factor == 1 || role_of_unit(unit->name).empty()) continue;
        for (complex& value : to.values) value *= name == &upper ? unit->factor : 1 / unit->factor;
        to.other_units.push_back(fmt::format("{} = {:.10g} {}", unit->name, unit->factor, unit->si));
    }
}

/// What the axes of a data set say: the quantity, and units that are not those of SI. @param axis  a line of the header
std::string unit_of(const std::string& axis) {
    constexpr std::size_t first = 46, width = 21;
    return std::string(trimmed(std::string_view(axis).substr(std::min(first, axis.size()), width)));
}

void read_axes(const std::string& numerator, const std::string& denominator, int kind, response& to) {
    constexpr int displacement = 8, velocity = 11, acceleration = 12;
    to.quantity = kind == displacement   ? "displacement"
                  : kind == velocity     ? "velocity"
                  : kind == acceleration ? "acceleration"
                                         : "";
    take_units(unit_of(numerator), unit_of(denominator), to);
}

/// A data set 58 behind its first line; nothing for other functions than responses and coherences.
void read_function(lines_of& from, std::string_view head, std::vector<response>& to,
                   std::vector<response>& coherences) {
    std::array<std::string, header_lines> lines;
    for (std::string& line : lines) {
        std::string_view text;
        if (!from.next(text)) from.fail("the data set ends within its header, expected 11 lines");
        line = text;
    }
    const auto at = [&](std::size_t line, std::size_t first, std::size_t width) {
        return number_at(from, lines[line], first, width);
    };
    const int function = static_cast<int>(at(5, 0, 5)), type = static_cast<int>(at(6, 0, 10));
    const auto points = static_cast<std::size_t>(std::max(0.0, at(6, 10, 10)));
    const bool even = at(6, 20, 10) == 1, wide = type == 4 || type == 6,
               binary = head.size() > 6 && (head[6] == 'b' || head[6] == 'B');
    if (points > largest_file / 8) from.fail(fmt::format("{} points, more than the file can hold", points));
    const std::size_t row = (type == 5 || type == 6 ? 2 : 1) + (even ? 0 : 1);
    std::vector<std::size_t> widths(even ? 0 : 1, 13);
    widths.insert(widths.end(), row - widths.size(), wide ? 20 : 13);
    if (binary && number_at(from, head, 13, 6) > 2) from.fail("binary numbers in VMS or IBM form, expected IEEE 754");
    const std::vector<double> all = binary ? read_binary(from, wide, number_at(from, head, 7, 6) == 2, row * points)
                                           : read_text(from, widths, row * points);
    if (function != response_function && function != coherence_function) return;
    const bool complex_ones = type == 5 || type == 6;
    if (function == response_function && !complex_ones)
        from.fail(fmt::format("a response of ordinate type {}, expected 5 or 6 (complex)", type));
    response one{channel_name(at(5, 41, 10), at(5, 51, 4), "output"),
                 channel_name(at(5, 66, 10), at(5, 76, 4), "input"),
                 {},
                 {},
                 {}};
    const double start = at(6, 30, 13), step = at(6, 43, 13);
    for (std::size_t k = 0; k < points; ++k) {
        const double* x = all.data() + k * row;
        one.frequency_hz.push_back(even ? start + step * static_cast<double>(k) : x[0]);
        if (function == coherence_function)
            one.coherence.push_back(x[complex_ones ? row - 2 : row - 1]);
        else
            one.values.emplace_back(x[row - 2], x[row - 1]);
    }
    if (function == response_function) read_axes(lines[8], lines[9], static_cast<int>(at(8, 0, 10)), one);
    (function == coherence_function ? coherences : to).push_back(std::move(one));
}

response_set read_universal(const std::string& path) {
    lines_of from(path, read_input(path, "a universal file", largest_file));
    std::vector<response> found, coherences;
    std::string_view line;
    bool any = false;
    while (from.next(line)) {
        if (!is_mark(line)) continue;
        std::string_view head;
        while (from.next(head) && is_mark(head)) {
        } // written twice by some programs
        if (head.empty() || is_mark(head)) break;
        any = true;
        const std::string first(head);
        if (static_cast<int>(number_at(from, head, 0, 6)) == 58)
            read_function(from, first, found, coherences);
        else
            while (from.next(line) && !is_mark(line)) {
            }
    }
    if (!any) throw failure(exit_usage, fmt::format("{}: no data set, expected a universal file", path));
    if (found.empty() || found.front().values.empty())
        throw failure(exit_usage, fmt::format("{}: no data set 58 with a frequency response (function type 4)", path));
    for (response& one : found)
        for (const response& other : coherences)
            if (other.output == one.output && other.input == one.input) one.coherence = other.coherence;
    return set_of(path, found);
}

enum part_bits : unsigned { part_re = 1, part_im = 2, part_db = 4, part_mag = 8, part_deg = 16, part_coh = 32 };
struct part_name {
    const char* name;
    part_bits part;
};
/// As this program and as analysers write them.
constexpr std::array<part_name, 14> part_names{{{"re", part_re},
                                                {"real", part_re},
                                                {"im", part_im},
                                                {"imag", part_im},
                                                {"imaginary", part_im},
                                                {"db", part_db},
                                                {"mag", part_mag},
                                                {"magnitude", part_mag},
                                                {"amplitude", part_mag},
                                                {"deg", part_deg},
                                                {"phase", part_deg},
                                                {"phase_deg", part_deg},
                                                {"coh", part_coh},
                                                {"coherence", part_coh}}};

/// A column of a table: "OUT/IN:re", or "re" in a file of one response; units behind the names, or behind the part "[g/N]".
struct table_column {
    std::string output = "output", input = "input", upper, lower; ///< names, and units of the two
    unsigned part = 0;                                            ///< 0: it is none
    double factor = 1;                                            ///< to degrees
};

table_column split_column(const std::string& name) {
    table_column out;
    const std::size_t colon = name.rfind(':'), slash = name.find('/');
    const bool named = colon != name.npos && slash != name.npos && slash < colon;
    const std::string last = named ? name.substr(colon + 1) : name, unit = unit_of_name(last);
    const std::string part = lower_case(base_of_name(last));
    const auto at =
        std::find_if(part_names.begin(), part_names.end(), [&](const part_name& one) { return one.name == part; });
    if (at != part_names.end()) out.part = at->part;
    if (named) {
        const std::string upper(trimmed(std::string_view(name).substr(0, slash))),
            lower(trimmed(std::string_view(name).substr(slash + 1, colon - slash - 1)));
        out.output = base_of_name(upper), out.upper = unit_of_name(upper);
        out.input = base_of_name(lower), out.lower = unit_of_name(lower);
    }
    if (const std::size_t over = unit.find('/'); over != unit.npos)
        out.upper = unit.substr(0, over), out.lower = unit.substr(over + 1);
    if (unit == "rad") out.factor = 180 / M_PI;
    return out;
}

response_set read_table(const std::string& path) {
    csv_request request;
    request.whole = true;
    const csv_record table = read_csv(path, request);
    const std::size_t width = table.columns.size();
    const auto fail = [&](const std::string& what) {
        throw failure(
            exit_usage,
            fmt::format("{}: {}; expected a column frequency_hz, then of each response OUT/IN:re and OUT/IN:im, or "
                        "OUT/IN:db (20 log10) or OUT/IN:mag and OUT/IN:deg; OUT/IN:coh where there is a coherence",
                        path, what));
    };
    const std::string first = lower_case(base_of_name(table.columns.front())),
                      unit_of_lines = lower_case(unit_of_name(table.columns.front()));
    if ((first != "frequency_hz" && first != "frequency" && first != "freq") ||
        (!unit_of_lines.empty() && unit_of_lines != "hz"))
        fail(fmt::format("the first column is \"{}\"", printable(table.columns.front())));
    std::vector<response> all;
    std::vector<std::pair<std::string, std::string>> units; // of each
    std::vector<unsigned> given;                            // of each
    for (std::size_t c = 1; c < width; ++c) {
        const table_column own = split_column(table.columns[c]);
        if (own.part == 0) fail(fmt::format("found the column \"{}\"", printable(table.columns[c])));
        const auto same = [&own](const response& x) { return x.output == own.output && x.input == own.input; };
        const auto k = static_cast<std::size_t>(std::find_if(all.begin(), all.end(), same) - all.begin());
        if (k == all.size()) {
            all.push_back({own.output, own.input, {}, std::vector<complex>(table.count), {}});
            units.emplace_back();
            given.push_back(0);
        }
        response& one = all[k];
        if (own.part != part_coh) units[k] = {own.upper, own.lower};
        given[k] |= own.part;
        for (std::size_t l = 0; l < table.count; ++l) {
            const double x = table.samples[l * width + c];
            if (own.part == part_coh)
                one.coherence.push_back(x);
            else if (own.part == part_im || own.part == part_deg)
                one.values[l] += complex(0, own.factor * x);
            else
                one.values[l] += own.part == part_db ? std::pow(10, x / 20) : x;
        }
    }
    if (all.empty() || table.count == 0) fail("no response");
    for (std::size_t k = 0; k < all.size(); ++k)
        if (const unsigned own = given[k] & ~part_coh; own == (part_db | part_deg) || own == (part_mag | part_deg))
            for (complex& x : all[k].values) x = x.real() * std::polar(1.0, x.imag() * M_PI / 180);
        else if (own != (part_re | part_im))
            fail(fmt::format("{}/{} has not both of its two parts", printable(all[k].output), printable(all[k].input)));
    for (std::size_t k = 0; k < all.size(); ++k) {
        take_units(units[k].first, units[k].second, all[k]);
        if (const std::string role = role_of_unit(units[k].first); role != "force") all[k].quantity = role;
    }
    for (response& one : all)
        for (std::size_t l = 0; l < table.count; ++l) one.frequency_hz.push_back(table.samples[l * width]);
    return set_of(path, all);
}

} // namespace

response_set read_responses(const std::string& path) {
    const std::size_t dot = path.rfind('.');
    const std::string ending = dot == path.npos ? "" : lower_case(path.substr(dot));
    return ending == ".uff" || ending == ".unv" ? read_universal(path) : read_table(path);
}

response_set read_set_ups(const std::vector<std::string>& paths) {
    std::vector<response_set> sets;
    for (const std::string& path : paths) sets.push_back(read_responses(path));
    return join_set_ups(sets, paths);
}

} // namespace okid_host
