// SPDX-License-Identifier: MIT
// PURPOSE  the keys of an okid.result/1 that was read as JSON
// METHOD   the parser is asked to stop where nesting goes beyond what any result has
#include "result_keys.hpp"

#include <algorithm>

namespace okid_host {
namespace {

using nlohmann::json;

constexpr int deepest = 32; // lists and objects within one another

/// "3:17" of a byte.
std::string line_and_column(const std::string& text, std::size_t byte) {
    const std::size_t end = std::min(byte > 0 ? byte - 1 : 0, text.size());
    const auto line = std::count(text.begin(), text.begin() + static_cast<std::ptrdiff_t>(end), '\n');
    const std::size_t before = end == 0 ? std::string::npos : text.rfind('\n', end - 1);
    return fmt::format("{}:{}", line + 1, before == std::string::npos ? end + 1 : end - before);
}

} // namespace

json parse_known_result(const std::string& text, const std::string& name) {
    const auto bounded = [&](int depth, json::parse_event_t, json&) {
        if (depth > deepest)
            throw failure(exit_usage,
                          fmt::format("{}: nested deeper than {} levels, expected an okid.result/1", name, deepest));
        return true;
    };
    try {
        json raw = json::parse(text, bounded);
        if (!raw.is_object()) raw = json::object();
        const keys_of top{raw, name, ""};
        constexpr const char* expected = "\"okid.result/1\", as okid identify --json writes it";
        const json* schema = top.find("schema");
        if (!schema) top.refuse("schema", "nothing", expected);
        if (*schema != "okid.result/1") top.refuse_value("schema", *schema, expected);
        return raw;
    } catch (const json::parse_error& fault) {
        throw failure(exit_usage, fmt::format("{}:{}: not JSON, expected an okid.result/1, as okid identify --json "
                                              "writes it",
                                              name, line_and_column(text, fault.byte)));
    } catch (const json::exception&) {
        throw failure(exit_usage, fmt::format("{}: a number is not finite, expected numbers or null", name));
    }
}

} // namespace okid_host
