// SPDX-License-Identifier: MIT
// PURPOSE  an okid.result/1 that exists, read back
// METHOD   every key is checked when it is read; nesting and size are bounded; keys that are not needed are ignored
#include "known_result.hpp"

#include "result_keys.hpp"

#include "files/input_file.hpp"
#include "result/judgement.hpp"
#include "result/mode_verdict.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <nlohmann/json.hpp>

namespace okid_host {
namespace {

using nlohmann::json;

constexpr std::size_t largest_result = std::size_t{256} << 20; // bytes; as the Python package reads
constexpr std::size_t most_modes = 5000;                       // pairing two such results takes some seconds

/// Numbers of a list of so many, NaN for null.
std::vector<double> numbers_in(const keys_of& from, const char* key, std::size_t count) {
    const std::string expected = fmt::format("a list of {} numbers or null, one a place", count);
    const json& all = from.list(key, expected);
    if (all.size() != count) from.refuse(key, fmt::format("{} numbers", all.size()), expected);
    std::vector<double> out;
    for (const json& one : all) {
        if (!one.is_number() && !one.is_null()) from.refuse_value(key, one, expected);
        out.push_back(one.is_null() ? NAN : one.get<double>());
    }
    return out;
}

std::vector<std::string> names_in(const keys_of& from, const char* key, const char* expected) {
    std::vector<std::string> out;
    for (const json& one : from.list(key, expected)) {
        if (!one.is_string()) from.refuse_value(key, one, expected);
        out.push_back(one.get<std::string>());
    }
    return out;
}

/// The outputs, or the degrees of freedom where the shapes have entries of their own.
std::vector<std::string> places_in(const keys_of& from, const std::vector<std::string>& outputs) {
    const json* dofs = from.find("shape_dofs");
    if (!dofs) return outputs;
    const char* expected = "a list of numbers of degrees of freedom";
    if (!dofs->is_array()) from.refuse_value("shape_dofs", *dofs, expected);
    std::vector<std::string> out;
    for (const json& one : *dofs) {
        if (!one.is_number_integer()) from.refuse_value("shape_dofs", one, expected);
        out.push_back(std::to_string(one.get<long long>()));
    }
    return out;
}

known_mode read_mode(const keys_of& from, int number, std::size_t places) {
    known_mode out;
    out.number = number;
    out.frequency_hz = from.above_zero("frequency_hz", "Hz above 0");
    out.damping_ratio = from.number("damping_ratio", from.need("damping_ratio", "a number"), "a number");
    out.frequency_std_hz = from.deviation("frequency_std_hz");
    out.damping_ratio_std = from.deviation("damping_ratio_std");
    out.emac = from.maybe("emac", "a number or null");
    const std::vector<double> re = numbers_in(from, "shape_re", places), im = numbers_in(from, "shape_im", places);
    for (std::size_t i = 0; i < places; ++i) out.shape.emplace_back(re[i], im[i]);
    const json* confident = from.find("confident");
    if (confident && !confident->is_boolean()) from.refuse_value("confident", *confident, "true or false");
    // results before release 0.2 judge no mode
    out.confident = confident ? confident->get<bool>() : !(out.emac < judgement::doubtful_emac);
    if (from.find("why")) out.why = names_in(from, "why", "a list of codes");
    return out;
}

void read_warnings(const keys_of& from, known_result& to) {
    if (!from.find("warnings")) return;
    const char* expected = "a list of objects with code and text";
    for (const json& one : from.list("warnings", expected)) {
        if (!one.is_object()) from.refuse_value("warnings", one, expected);
        const keys_of keys{one, from.file, "warnings[]."};
        to.warnings.emplace_back(keys.text("code"), keys.text("text"));
    }
}

} // namespace

std::vector<std::size_t> known_result::confident() const {
    std::vector<std::size_t> out;
    for (std::size_t k = 0; k < modes.size(); ++k)
        if (modes[k].confident) out.push_back(k);
    return out;
}

known_result read_known_result(const std::string& text, const std::string& name) {
    return take_known_result(parse_known_result(text, name), name);
}

known_result take_known_result(const json& raw, const std::string& name) {
    const keys_of top{raw, name, ""};
    known_result out;
    out.name = name;
    out.method = top.text("method");
    out.hold = top.text("hold");
    out.detrend = top.text("detrend");
    out.fs_hz = top.above_zero("fs_hz", "Hz above 0");
    out.samples = top.count("samples", 0);
    out.records = top.count("records", 1);
    out.gaps = top.count("gaps", 0);
    out.sigma_blocks = static_cast<int>(std::min(top.count("sigma_blocks", 0), 1000000LL));
    out.outputs = names_in(top, "outputs", "a list of names");
    out.places = places_in(top, out.outputs);
    const json& modes = top.list("modes", "a list of modes");
    if (modes.size() > most_modes)
        top.refuse("modes", std::to_string(modes.size()), fmt::format("at most {}", most_modes));
    for (std::size_t k = 0; k < modes.size(); ++k) {
        const std::string where = fmt::format("modes[{}].", k);
        if (!modes[k].is_object()) top.refuse_value(fmt::format("modes[{}]", k), modes[k], "an object");
        out.modes.push_back(read_mode({modes[k], name, where}, static_cast<int>(k) + 1, out.places.size()));
    }
    read_warnings(top, out);
    return out;
}

known_result load_known_result(const std::string& path) {
    return read_known_result(read_input(path, "an okid.result/1", largest_result), path);
}

} // namespace okid_host
