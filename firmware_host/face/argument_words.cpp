// SPDX-License-Identifier: MIT
// PURPOSE  one text for each message, for the user of the program and the caller of the library
// METHOD   texts name options as the program has them; a known option becomes its argument, with "=" before a value
#include "argument_words.hpp"

#include "record/identify_options.hpp"

#include <algorithm>
#include <cctype>
#include <string_view>

namespace okid_host::face {
namespace {

struct argument {
    std::string option, name;
    std::vector<std::string> values; // words that can follow as a value; a number always can
};

std::vector<argument> make_arguments() {
    std::vector<argument> out{{"--exponential", "exponential", {"S"}}, {"--json", "to_dict()", {}}};
    for (const identify_option& option : identify_options())
        out.push_back({option.typed(), option.key(), option.alternatives()});
    return out;
}

bool is_word(char c) { return std::isalnum(static_cast<unsigned char>(c)) != 0 || c == '_' || c == '-'; }

std::string_view word_at(std::string_view text, std::size_t at) {
    std::size_t end = at;
    while (end < text.size() && is_word(text[end])) ++end;
    return text.substr(at, end - at);
}

bool is_value(std::string_view word, const std::vector<std::string>& values) {
    if (word.empty()) return false;
    return std::isdigit(static_cast<unsigned char>(word.front())) != 0 ||
           std::find(values.begin(), values.end(), word) != values.end();
}

} // namespace

std::string argument_words(const std::string& text) {
    static const std::vector<argument> arguments = make_arguments();
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
