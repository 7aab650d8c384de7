// SPDX-License-Identifier: MIT
// PURPOSE  TOML of files that somebody else may have written
// METHOD   toml++ without its assertions: on some malformed files ("[#") they would end a debug build by abort() where the
//          parser goes on to refuse the file by itself. The nesting is bounded before the parser sees the text, because
//          tables are built, visited and freed by recursion
#pragma once
#ifndef TOML_ASSERT
#define TOML_ASSERT(expr) static_assert(true)
#endif
#include <string>
#include <string_view>
#include <toml++/toml.h>

namespace okid_host {

constexpr int deepest_toml = 32; ///< brackets within one another, and names of a dotted key

/// toml::parse(); throws toml::parse_error also where the nesting is deeper than deepest_toml.
toml::table parse_toml(const std::string& text, std::string_view path = {});

/// What a piece of TOML text is.
enum class toml_piece { code, string, comment };

/// Cut the text: `visit(piece, first, last)` for each run of bytes, in order, without a gap.
template <class Visit> void each_toml_piece(std::string_view text, Visit&& visit);

/// Where the string that begins at `at` ends: behind its quotes, at the end of the line for one that is not closed.
std::size_t toml_string_end(std::string_view text, std::size_t at);

template <class Visit> void each_toml_piece(std::string_view text, Visit&& visit) {
    std::size_t begun = 0;
    for (std::size_t at = 0; at < text.size();) {
        const char c = text[at];
        const bool comment = c == '#';
        if (!comment && c != '"' && c != '\'') {
            ++at;
            continue;
        }
        if (at > begun) visit(toml_piece::code, begun, at);
        const std::size_t end = comment ? std::min(text.find('\n', at), text.size()) : toml_string_end(text, at);
        visit(comment ? toml_piece::comment : toml_piece::string, at, end);
        begun = at = end;
    }
    if (begun < text.size()) visit(toml_piece::code, begun, text.size());
}

} // namespace okid_host
