// SPDX-License-Identifier: MIT
#include "toml_parser.hpp"

#include <algorithm>
#include <fmt/format.h>

namespace okid_host {
namespace {

toml::source_position position_of(std::string_view text, std::size_t at) {
    const std::string_view before = text.substr(0, at);
    const std::size_t line = before.rfind('\n');
    return {static_cast<toml::source_index>(1 + std::count(before.begin(), before.end(), '\n')),
            static_cast<toml::source_index>(line == std::string_view::npos ? at + 1 : at - line)};
}

/// The first byte that is nested too deeply, or npos. Dots count until a key or value ends.
std::size_t too_deep(std::string_view text) {
    int brackets = 0, dots = 0;
    std::size_t found = std::string_view::npos;
    each_toml_piece(text, [&](toml_piece piece, std::size_t first, std::size_t last) {
        for (std::size_t at = first; piece == toml_piece::code && at < last; ++at) {
            const char c = text[at];
            if (c == '[' || c == '{')
                ++brackets;
            else if (c == ']' || c == '}')
                --brackets;
            if (c == '.')
                ++dots;
            else if (std::string_view("[]{},=\n").find(c) != std::string_view::npos)
                dots = 0;
            if ((brackets > deepest_toml || dots >= deepest_toml) && found == std::string_view::npos) found = at;
        }
    });
    return found;
}

} // namespace

std::size_t toml_string_end(std::string_view text, std::size_t at) {
    const char quote = text[at];
    const std::string_view three = text.substr(at, 3);
    const bool many_lines = three.size() == 3 && three[1] == quote && three[2] == quote;
    for (std::size_t i = at + (many_lines ? 3 : 1); i < text.size(); ++i) {
        if (text[i] == '\\' && quote == '"') {
            ++i;
        } else if (!many_lines && text[i] == '\n') {
            return i;
        } else if (text[i] == quote && !many_lines) {
            return i + 1;
        } else if (text[i] == quote && text.substr(i, 3) == three) {
            i += 3;
            for (int more = 0; more < 2 && i < text.size() && text[i] == quote; ++more)
                ++i; // quotes before the last three
            return i;
        }
    }
    return text.size();
}

toml::table parse_toml(const std::string& text, std::string_view path) {
    if (const std::size_t at = too_deep(text); at != std::string_view::npos) {
        const std::string fault = fmt::format("nested deeper than {} levels", deepest_toml);
        throw toml::parse_error(fault.c_str(), position_of(text, at), std::make_shared<const std::string>(path));
    }
    return toml::parse(text, path);
}

} // namespace okid_host
