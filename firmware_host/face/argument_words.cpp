// SPDX-License-Identifier: MIT
// PURPOSE  one text for each message, for the user of the program and the caller of the library
// METHOD   texts name options as the program has them; a known option becomes its argument, with "=" before a value
#include "argument_words.hpp"

#include <array>
#include <cctype>
#include <string_view>

namespace okid_host::face {
namespace {

struct argument {
    std::string_view option, name;
    std::string_view values; // words that can follow as a value, with blanks around; a number always can
};

constexpr std::array arguments{argument{"--inputs", "inputs", ""},
                               argument{"--outputs", "outputs", ""},
                               argument{"--fs", "fs", " HZ "},
                               argument{"--method", "method", " auto "},
                               argument{"--p", "p", " N "},
                               argument{"--rows", "rows", " N "},
                               argument{"--order", "order", " N "},
                               argument{"--max-order", "max_order", " N "},
                               argument{"--hankel", "hankel", " system innovations literal "},
                               argument{"--hold", "hold", " auto zoh foh band "},
                               argument{"--detrend", "detrend", " none mean linear "},
                               argument{"--start", "start", " moving rest "},
                               argument{"--sensing", "sensing", ""},
                               argument{"--input-dofs", "input_dofs", ""},
                               argument{"--output-dofs", "output_dofs", ""},
                               argument{"--refine", "refine", ""},
                               argument{"--stabilization", "stabilization", ""},
                               argument{"--sigma", "sigma", " analytic jackknife none "},
                               argument{"--sigma-blocks", "sigma_blocks", " N "},
                               argument{"--band", "band", ""},
                               argument{"--decimate", "decimate", " N "},
                               argument{"--picks", "picks", " "},
                               argument{"--modes", "modes", ""},
                               argument{"--threads", "threads", " N "},
                               argument{"--hit-dofs", "hit_dofs", ""},
                               argument{"--keep-all", "keep_all", ""},
                               argument{"--exponential", "exponential", " S "},
                               argument{"--json", "to_dict()", ""}};

bool is_word(char c) { return std::isalnum(static_cast<unsigned char>(c)) != 0 || c == '_' || c == '-'; }

std::string_view word_at(std::string_view text, std::size_t at) {
    std::size_t end = at;
    while (end < text.size() && is_word(text[end])) ++end;
    return text.substr(at, end - at);
}

bool is_value(std::string_view word, std::string_view values) {
    if (word.empty()) return false;
    return std::isdigit(static_cast<unsigned char>(word.front())) != 0 ||
           values.find(" " + std::string(word) + " ") != std::string_view::npos;
}

} // namespace

std::string argument_words(const std::string& text) {
    std::string out;
    for (std::size_t at = 0; at < text.size();) {
        const bool begins = text.compare(at, 2, "--") == 0 && (at == 0 || !is_word(text[at - 1]));
        const std::string_view word = begins ? word_at(text, at) : std::string_view();
        const argument* known = nullptr;
        for (const argument& one : arguments)
            if (one.option == word) known = &one;
        if (!known) {
            out += text[at++];
            continue;
        }
        out += known->name;
        at += word.size();
        if (at < text.size() && text[at] == ' ' && is_value(word_at(text, at + 1), known->values)) {
            out += '=';
            ++at;
        }
    }
    return out;
}

} // namespace okid_host::face
