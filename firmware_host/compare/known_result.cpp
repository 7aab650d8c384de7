// SPDX-License-Identifier: MIT
// PURPOSE  an okid.result/1 that exists, read back
// METHOD   every key is checked when it is read; nesting and size are bounded; keys that are not needed are ignored
#include "known_result.hpp"

#include "error.hpp"
#include "files/input_file.hpp"
#include "files/nearest_name.hpp"
#include "result/mode_verdict.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <nlohmann/json.hpp>

namespace okid_host {
namespace {

using nlohmann::json;

constexpr int deepest = 32;                                    // lists and objects within one another
constexpr std::size_t largest_result = std::size_t{256} << 20; // bytes; as the Python package reads

/// An object of the file, and where it stands in it.
struct keys_of {
    const json& object;
    const std::string& file;
    std::string where; ///< "modes[2]." or ""

    [[noreturn]] void refuse(const std::string& key, const std::string& found, const std::string& expected) const {
        throw failure(exit_usage, fmt::format("{}: {}{}: found {}, expected {}", file, where, key, found, expected));
    }
    [[noreturn]] void refuse_value(const std::string& key, const json& found, const std::string& expected) const {
        const bool whole = found.is_array() || found.is_object();
        refuse(key,
               whole ? std::string(found.is_array() ? "a list" : "an object")
                     : printable(found.dump(-1, ' ', false, json::error_handler_t::replace)),
               expected);
    }
    /// nullptr: not there, or null.
    const json* find(const char* key) const {
        const auto at = object.find(key);
        return at == object.end() || at->is_null() ? nullptr : &*at;
    }
    const json& need(const char* key, const std::string& expected) const {
        const json* found = find(key);
        if (!found) refuse(key, object.contains(key) ? "null" : "nothing", expected);
        return *found;
    }
    double number(const char* key, const json& from, const char* expected) const {
        if (!from.is_number()) refuse_value(key, from, expected);
        return from.get<double>();
    }
    /// NaN: not there, or null.
    double maybe(const char* key, const char* expected) const {
        const json* found = find(key);
        return found ? number(key, *found, expected) : NAN;
    }
    double above_zero(const char* key, const char* expected) const {
        const double value = number(key, need(key, expected), expected);
        if (!(value > 0)) refuse(key, fmt::format("{:g}", value), expected);
        return value;
    }
    /// A standard deviation: NaN where none is known.
    double deviation(const char* key) const {
        constexpr const char* expected = "a number from 0 on, or null";
        const double value = maybe(key, expected);
        if (value < 0) refuse(key, fmt::format("{:g}", value), expected);
        return value;
    }
    long long count(const char* key, long long otherwise) const {
        constexpr const char* expected = "a whole number from 0 on";
        const json* found = find(key);
        if (!found) return otherwise;
        if (!found->is_number_integer() || found->get<long long>() < 0) refuse_value(key, *found, expected);
        return found->get<long long>();
    }
    std::string text(const char* key) const {
        const json* found = find(key);
        if (found && !found->is_string()) refuse_value(key, *found, "text");
        return found ? found->get<std::string>() : std::string();
    }
    const json& list(const char* key, const std::string& expected) const {
        const json& found = need(key, expected);
        if (!found.is_array()) refuse_value(key, found, expected);
        return found;
    }
};

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

std::vector<std::string> names_in(const keys_of& from, const char* key) {
    const char* expected = "a list of names";
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
        out.push_back(fmt::format("dof {}", one.get<long long>()));
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
    out.confident = confident ? confident->get<bool>() : !(out.emac < doubtful_emac);
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

/// "3:17" of a byte.
std::string line_and_column(const std::string& text, std::size_t byte) {
    const std::size_t end = std::min(byte > 0 ? byte - 1 : 0, text.size());
    const auto line = std::count(text.begin(), text.begin() + static_cast<std::ptrdiff_t>(end), '\n');
    const std::size_t before = end == 0 ? std::string::npos : text.rfind('\n', end - 1);
    return fmt::format("{}:{}", line + 1, before == std::string::npos ? end + 1 : end - before);
}

json parse_result(const std::string& text, const std::string& name) {
    const auto bounded = [&](int depth, json::parse_event_t, json&) {
        if (depth > deepest)
            throw failure(exit_usage,
                          fmt::format("{}: nested deeper than {} levels, expected an okid.result/1", name, deepest));
        return true;
    };
    try {
        return json::parse(text, bounded);
    } catch (const json::parse_error& fault) {
        throw failure(exit_usage, fmt::format("{}:{}: not JSON, expected an okid.result/1, as okid identify --json "
                                              "writes it",
                                              name, line_and_column(text, fault.byte)));
    } catch (const json::exception&) {
        throw failure(exit_usage, fmt::format("{}: a number is not finite, expected numbers or null", name));
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
    const json raw = parse_result(text, name);
    const json none = json::object();
    const keys_of top{raw.is_object() ? raw : none, name, ""};
    const json* schema = top.find("schema");
    constexpr const char* expected = "\"okid.result/1\", as okid identify --json writes it";
    if (!schema) top.refuse("schema", "nothing", expected);
    if (*schema != "okid.result/1") top.refuse_value("schema", *schema, expected);
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
    out.outputs = names_in(top, "outputs");
    out.places = places_in(top, out.outputs);
    const json& modes = top.list("modes", "a list of modes");
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
