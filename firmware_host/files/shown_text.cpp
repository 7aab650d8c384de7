// SPDX-License-Identifier: MIT
#include "shown_text.hpp"

#include <cstddef>
#include <fmt/format.h>

namespace okid_host {
namespace {

/// Bytes of the letter at `at` and its number; 0 bytes when it is no UTF-8.
std::size_t letter_at(std::string_view text, std::size_t at, unsigned& letter) {
    const auto byte = [&](std::size_t i) { return static_cast<unsigned char>(text[i]); };
    const unsigned first = byte(at);
    if (first < 0x80) return letter = first, 1;
    const std::size_t bytes = first >= 0xF0 && first < 0xF5 ? 4 : first >= 0xE0 ? 3 : first >= 0xC2 ? 2 : 0;
    if (bytes == 0 || first >= 0xF5 || at + bytes > text.size()) return 0;
    letter = first & (0x7Fu >> bytes);
    for (std::size_t i = at + 1; i < at + bytes; ++i) {
        if ((byte(i) & 0xC0u) != 0x80u) return 0;
        letter = letter << 6 | (byte(i) & 0x3Fu);
    }
    const bool overlong = (bytes == 3 && letter < 0x800) || (bytes == 4 && letter < 0x10000);
    return overlong || letter > 0x10FFFF || (letter >= 0xD800 && letter < 0xE000) ? 0 : bytes;
}

/// C0 and C1 controls, and what turns or hides text: U+200E/F, U+2028 to U+202E, U+2066 to U+2069, U+FEFF.
bool hidden(unsigned letter) {
    if (letter == '\n' || letter == '\t') return false;
    return letter < 0x20 || (letter >= 0x7F && letter < 0xA0) || letter == 0x061C || letter == 0x200E ||
           letter == 0x200F || (letter >= 0x2028 && letter <= 0x202E) || (letter >= 0x2066 && letter <= 0x2069) ||
           letter == 0xFEFF;
}

} // namespace

std::string shown(std::string_view text) {
    std::string out;
    out.reserve(text.size());
    for (std::size_t at = 0; at < text.size();) {
        unsigned letter = 0;
        const std::size_t bytes = letter_at(text, at, letter);
        if (bytes == 0)
            out += fmt::format("\\x{:02x}", static_cast<unsigned>(static_cast<unsigned char>(text[at])));
        else if (!hidden(letter))
            out += text.substr(at, bytes);
        else
            out += letter < 0x80 ? fmt::format("\\x{:02x}", letter) : fmt::format("\\u{:04x}", letter);
        at += bytes == 0 ? 1 : bytes;
    }
    return out;
}

std::string one_line(std::string_view text) {
    std::string out = shown(text);
    for (std::size_t at = 0; (at = out.find('\n', at)) != std::string::npos; at += 2) out.replace(at, 1, "\\n");
    return out;
}

} // namespace okid_host
