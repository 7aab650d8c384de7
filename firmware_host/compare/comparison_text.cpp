// SPDX-License-Identifier: MIT
// PURPOSE  a comparison of two results as JSON and as a table
// METHOD   one sentence a shift; numbers of modes are those of the tables of both results
#include "comparison.hpp"

#include "result/json_number.hpp"

#include <cmath>
#include <fmt/format.h>
#include <okid/types.h>
#include <tuple>

namespace okid_host {
namespace {

using nlohmann::ordered_json;

constexpr std::size_t most_columns = 16; // of the matrix of MAC that stand side by side on a screen

/// "lower by 1.2 %, more than chance (z -8.1)".
std::string verdict(const value_shift& of) {
    const std::string moved = fmt::format("{} by {:.2g} %", of.shift < 0 ? "lower" : "higher", std::abs(of.percent()));
    if (!std::isfinite(of.z)) return moved + ", no standard deviation";
    return of.beyond ? fmt::format("{}, more than chance (z {:.1f})", moved, of.z) : "no change beyond chance";
}

ordered_json mode_json(const known_mode& mode) {
    return {{"mode", mode.number},
            {"frequency_hz", number_json(mode.frequency_hz)},
            {"frequency_std_hz", number_json(mode.frequency_std_hz)},
            {"damping_ratio", number_json(mode.damping_ratio)},
            {"damping_ratio_std", number_json(mode.damping_ratio_std)}};
}

/// The keys of a shift, with `before` in front of all but its unit.
void put_shift(const std::string& before, const std::string& unit, const value_shift& of, ordered_json& to) {
    to[before + "shift" + unit] = number_json(of.shift);
    to[before + "shift_std" + unit] = number_json(of.deviation);
    to[before + "shift_percent"] = number_json(of.percent());
    to[before + "shift_std_percent"] = number_json(of.deviation_percent());
    to[before + "z"] = number_json(of.z);
    to[before + "p_value"] = number_json(of.p);
    to[before + "more_than_chance"] = std::isfinite(of.z) ? ordered_json(of.beyond) : ordered_json(nullptr);
    to[before + "verdict"] = verdict(of);
}

ordered_json side_json(const known_result& of, const std::vector<std::size_t>& modes) {
    ordered_json numbers = ordered_json::array();
    for (const std::size_t k : modes) numbers.push_back(of.modes[k].number);
    return {{"name", of.name},
            {"method", of.method},
            {"sigma_blocks", of.sigma_blocks > 0 ? ordered_json(of.sigma_blocks) : ordered_json(nullptr)},
            {"modes", numbers}};
}

ordered_json modes_left(const known_result& of, const std::vector<std::size_t>& modes) {
    ordered_json out = ordered_json::array();
    for (const std::size_t k : modes) out.push_back(mode_json(of.modes[k]));
    return out;
}

std::string cell(double value, const char* form, int width) {
    const std::string text = std::isfinite(value) ? fmt::format(fmt::runtime(form), value) : "-";
    return fmt::format("{:>{}}", text, width);
}

std::string shift_cells(const value_shift& of) {
    return cell(of.percent(), "{:+.4f}", 11) + cell(of.deviation_percent(), "±{:.2g}", 10) +
           cell(of.z, std::abs(of.z) < 1e4 ? "{:+.1f}" : "{:+.0e}", 8);
}

std::string only_text(const char* where, const known_result& of, const std::vector<std::size_t>& modes) {
    std::string out;
    for (const std::size_t k : modes)
        out += fmt::format("{} {} ({:.5g} Hz)", out.empty() ? "" : ",", of.modes[k].number, of.modes[k].frequency_hz);
    return out.empty() ? out : fmt::format("only in {}: mode{}\n", where, out);
}

std::string mac_text(const comparison& found) {
    if (found.mac.empty() || found.modes_a.empty() || found.modes_b.empty()) return "";
    if (found.modes_b.size() > most_columns)
        return fmt::format("\nMAC: more than {} columns, they are in the JSON (--json)\n", most_columns);
    std::string out = "\nMAC, rows modes of A, columns modes of B\n      ";
    for (const std::size_t k : found.modes_b) out += fmt::format("{:>7}", found.b.modes[k].number);
    for (std::size_t i = 0; i < found.mac.size(); ++i) {
        out += fmt::format("\n{:>6}", found.a.modes[found.modes_a[i]].number);
        for (const double mac : found.mac[i]) out += cell(mac, "{:.3f}", 7);
    }
    return out + "\n";
}

} // namespace

ordered_json comparison_json(const comparison& found) {
    ordered_json out;
    out["schema"] = "okid.comparison/1";
    out["version"] = okid_version();
    out["a"] = side_json(found.a, found.modes_a);
    out["b"] = side_json(found.b, found.modes_b);
    out["channels"] = found.places;
    out["paired_by"] = found.by_shape ? "mac_and_frequency" : "frequency";
    out["false_alarm"] = false_alarm;
    out["tests"] = found.tests;
    out["degrees_of_freedom"] = found.freedom;
    out["changed"] = found.changed();
    out["pairs"] = ordered_json::array();
    for (const mode_pair& pair : found.pairs) {
        ordered_json one;
        one["a"] = mode_json(found.a.modes[pair.a]);
        one["b"] = mode_json(found.b.modes[pair.b]);
        one["mac"] = number_json(pair.mac);
        put_shift("", "_hz", pair.frequency, one);
        put_shift("damping_", "", pair.damping, one);
        out["pairs"].push_back(std::move(one));
    }
    out["only_a"] = modes_left(found.a, found.only_a);
    out["only_b"] = modes_left(found.b, found.only_b);
    out["cross_mac"] = ordered_json::array();
    for (const auto& row : found.mac) {
        ordered_json& to = out["cross_mac"].emplace_back(ordered_json::array());
        for (const double mac : row) to.push_back(number_json(mac));
    }
    out["warnings"] = ordered_json::array();
    for (const auto& [code, text] : found.remarks) out["warnings"].push_back({{"code", code}, {"text", text}});
    return out;
}

std::string comparison_table(const comparison& found) {
    std::string out;
    for (const auto& [letter, of, modes] : {std::tuple{'A', &found.a, &found.modes_a}, {'B', &found.b, &found.modes_b}})
        out += fmt::format("{}: {}, {}, {} confident mode{}\n", letter, of->name, of->method, modes->size(),
                           modes->size() == 1 ? "" : "s");
    out += "shift = B - A, ± one standard deviation\n\n   A   B        f A [Hz]    f B [Hz]  shift [%]       ± σ"
           "       z    MAC  verdict\n";
    for (const mode_pair& pair : found.pairs) {
        const known_mode &a = found.a.modes[pair.a], &b = found.b.modes[pair.b];
        out += fmt::format("{:>4}{:>4}   f {:>12.5f}{:>12.5f}", a.number, b.number, a.frequency_hz, b.frequency_hz) +
               shift_cells(pair.frequency) + cell(pair.mac, "{:.3f}", 7) + "  " + verdict(pair.frequency) + "\n";
        out += fmt::format("{:>8}   ζ {:>11.4f}%{:>11.4f}%", "", 100 * a.damping_ratio, 100 * b.damping_ratio) +
               shift_cells(pair.damping) + fmt::format("{:>7}  ", "") + verdict(pair.damping) + "\n";
    }
    if (found.pairs.empty()) out += "   no mode of A is a mode of B\n";
    out += only_text("A", found.a, found.only_a) + only_text("B", found.b, found.only_b);
    if (found.tests > 0)
        out += fmt::format("more than chance: a false alarm in {:g} % of comparisons, over all {} shifts together "
                           "(Holm; Student's t, {} degrees of freedom)\n",
                           100 * false_alarm, found.tests, found.freedom);
    out += mac_text(found);
    for (const auto& [code, text] : found.remarks) out += fmt::format("warning {}: {}\n", code, text);
    return out;
}

} // namespace okid_host
