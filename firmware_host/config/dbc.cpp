// SPDX-License-Identifier: MIT
// A cursor walks each line that begins with BO_, SG_ or SIG_VALTYPE_; everything else is skipped, strings over several
// lines included, so that a comment that holds the text "SG_" is no signal.
#include "dbc.hpp"

#include "error.hpp"
#include "files/input_file.hpp"
#include "files/nearest_name.hpp"

#include <algorithm>
#include <cerrno>
#include <charconv>
#include <cmath>
#include <cstring>
#include <fmt/format.h>
#include <sstream>
#include <string_view>

namespace okid_host {
namespace {

constexpr std::uint32_t extended_bit = 0x80000000u;
constexpr std::uint32_t no_message_id = 0xC0000000u; // VECTOR__INDEPENDENT_SIG_MSG: signals that belong to no frame

/// What the attribute VFrameFormat says.
struct frame_formats {
    std::uint64_t j1939 = 3; ///< its number
    bool j1939_by_default = false;
    std::vector<std::uint32_t> told; ///< messages it names, as numbered in the file
};

/// One line under inspection; every refusal names file, line and column.
class dbc_line {
  public:
    dbc_line(const std::string& path, std::size_t number, std::string_view text)
        : path_(path), number_(number), text_(text) {}

    [[noreturn]] void refuse(const std::string& expected) const {
        const std::string found =
            at_ < text_.size() ? '"' + printable(std::string(text_.substr(at_)), 24) + '"' : "end of line";
        throw failure(exit_usage, fmt::format("{}: line {}, column {}: found {}, expected {}", path_, number_, at_ + 1,
                                              found, expected));
    }
    void blanks() {
        while (at_ < text_.size() && (text_[at_] == ' ' || text_[at_] == '\t')) ++at_;
    }
    bool take(char wanted) {
        blanks();
        if (at_ >= text_.size() || text_[at_] != wanted) return false;
        ++at_;
        return true;
    }
    void need(char wanted, const char* where) {
        if (!take(wanted)) refuse(fmt::format("'{}' {}", wanted, where));
    }
    bool done() {
        blanks();
        return at_ == text_.size();
    }
    std::string_view word() {
        blanks();
        const std::size_t begin = at_;
        while (at_ < text_.size() && (std::isalnum(static_cast<unsigned char>(text_[at_])) || text_[at_] == '_')) ++at_;
        return text_.substr(begin, at_ - begin);
    }
    std::string name(const char* expected) {
        const std::string_view found = word();
        if (found.empty()) refuse(expected);
        return std::string(found);
    }
    std::uint64_t whole(const char* expected, std::uint64_t most) {
        blanks();
        std::uint64_t value = 0;
        const char* begin = text_.data() + at_;
        const auto [end, error] = std::from_chars(begin, text_.data() + text_.size(), value);
        if (error != std::errc{} || value > most) refuse(fmt::format("{}, 0 to {}", expected, most));
        at_ += static_cast<std::size_t>(end - begin);
        return value;
    }
    double number(const char* expected) {
        blanks();
        if (at_ < text_.size() && text_[at_] == '+') ++at_;
        double value = 0;
        const char* begin = text_.data() + at_;
        const auto [end, error] = std::from_chars(begin, text_.data() + text_.size(), value);
        if (error != std::errc{} || !std::isfinite(value)) refuse(expected);
        at_ += static_cast<std::size_t>(end - begin);
        return value;
    }
    std::string quoted() {
        need('"', "before the unit");
        const std::size_t begin = at_;
        while (at_ < text_.size() && text_[at_] != '"') ++at_;
        if (at_ == text_.size()) refuse("'\"' after the unit");
        return std::string(text_.substr(begin, at_++ - begin));
    }
    std::uint32_t message_id() {
        return static_cast<std::uint32_t>(whole("the identifier of the message", 0xFFFFFFFFu));
    }
    std::size_t number_of_line() const { return number_; }

  private:
    const std::string& path_;
    std::size_t number_;
    std::string_view text_;
    std::size_t at_ = 0;
};

bool is_utf8(const std::string& text) {
    for (std::size_t i = 0; i < text.size();) {
        const auto byte = static_cast<unsigned char>(text[i]);
        const std::size_t more = byte < 0x80   ? 0
                                 : byte < 0xC2 ? 9
                                 : byte < 0xE0 ? 1
                                 : byte < 0xF0 ? 2
                                 : byte < 0xF5 ? 3
                                               : 9;
        if (more > 3 || i + more >= text.size()) return false;
        for (std::size_t k = 1; k <= more; ++k)
            if ((static_cast<unsigned char>(text[i + k]) & 0xC0) != 0x80) return false;
        i += more + 1;
    }
    return true;
}

/// DBC files are often Latin-1; results are UTF-8.
std::string to_utf8(const std::string& text) {
    if (is_utf8(text)) return text;
    std::string out;
    for (const char c : text) {
        const auto byte = static_cast<unsigned char>(c);
        if (byte < 0x80)
            out += c;
        else
            out += {static_cast<char>(0xC0 | byte >> 6), static_cast<char>(0x80 | (byte & 0x3F))};
    }
    return out;
}

/// `BO_ 256 Name: 8 Sender`
void read_message(dbc_line& line, dbc_file& file, bool& kept) {
    dbc_message message;
    const std::uint32_t id = line.message_id();
    message.name = line.name("the name of the message");
    line.need(':', "after the name of the message");
    message.length = static_cast<unsigned>(line.whole("the length of the message in bytes", 65535));
    message.extended = (id & extended_bit) != 0;
    message.id = id & ~extended_bit;
    message.line = line.number_of_line();
    kept = id != no_message_id;
    if (!kept) return;
    if (message.id > (message.extended ? 0x1FFFFFFFu : 0x7FFu))
        line.refuse(fmt::format("an identifier that fits {} bits (extended ones have 2147483648 added), found {}",
                                message.extended ? 29 : 11, id));
    file.messages.push_back(std::move(message));
}

/// The optional `M`, `m3` or `m3M` between name and colon.
void read_multiplexing(dbc_line& line, dbc_signal& signal) {
    const std::string_view text = line.word();
    if (text.empty()) return;
    if (text == "M") {
        signal.multiplexor = true;
        return;
    }
    std::uint64_t value = 0;
    const auto [end, error] = std::from_chars(text.data() + 1, text.data() + text.size(), value);
    const std::string_view rest(end, static_cast<std::size_t>(text.data() + text.size() - end));
    if (text[0] != 'm' || error != std::errc{} || (!rest.empty() && rest != "M"))
        line.refuse(fmt::format("M, m<number> or ':' after the name of the signal, found \"{}\"",
                                printable(std::string(text))));
    signal.mux_values = {{value, value}};
    signal.multiplexor = !rest.empty();
}

/// `SG_ Name m0 : 16|12@1- (0.1,0) [0|0] "N" Receiver`
dbc_signal read_signal(dbc_line& line) {
    dbc_signal signal;
    signal.line = line.number_of_line();
    signal.name = line.name("the name of the signal");
    read_multiplexing(line, signal);
    line.need(':', "after the name of the signal");
    signal.layout.start_bit = static_cast<std::uint16_t>(line.whole("the start bit", 65535));
    line.need('|', "after the start bit");
    signal.layout.length = static_cast<std::uint16_t>(line.whole("the length in bits", 65535));
    line.need('@', "after the length");
    if (line.take('0'))
        signal.layout.big_endian = 1;
    else
        line.need('1', "or '0' (byte order) after '@'");
    if (line.take('-'))
        signal.layout.is_signed = 1;
    else
        line.need('+', "or '-' (sign) after the byte order");
    line.need('(', "before the factor");
    signal.layout.scale = line.number("the factor, a number");
    line.need(',', "between factor and offset");
    signal.layout.offset = line.number("the offset, a number");
    line.need(')', "after the offset");
    line.need('[', "before the range");
    line.number("the minimum, a number");
    line.need('|', "between minimum and maximum");
    line.number("the maximum, a number");
    line.need(']', "after the range");
    signal.unit = to_utf8(line.quoted());
    // What does not fit a frame of 64 bytes may still be carried by another transport: refused only when it is used.
    (void)drv_signal_prepare(&signal.layout);
    return signal;
}

bool has_id(const dbc_message& message, std::uint32_t id) {
    return message.id == (id & ~extended_bit) && message.extended == ((id & extended_bit) != 0);
}

template <class action> void for_signal(dbc_file& file, std::uint32_t id, const std::string& name, const action& act) {
    for (dbc_message& message : file.messages)
        for (dbc_signal& signal : message.signals)
            if (has_id(message, id) && signal.name == name) act(signal);
}

/// `SIG_VALTYPE_ 256 Name : 1;`
void read_value_type(dbc_line& line, dbc_file& file) {
    const std::uint32_t id = line.message_id();
    const std::string name = line.name("the name of the signal");
    (void)line.take(':');
    const auto type = line.whole("the value type", 2);
    for_signal(file, id, name, [&](dbc_signal& signal) {
        signal.layout.value = type == 1 ? DRV_VALUE_FLOAT32 : type == 2 ? DRV_VALUE_FLOAT64 : DRV_VALUE_INTEGER;
        (void)drv_signal_prepare(&signal.layout);
    });
}

/// `SG_MUL_VAL_ 256 Signal Multiplexor 1-3, 7-7;`: which multiplexor, and more values than one.
void read_extended_multiplexing(dbc_line& line, dbc_file& file) {
    const std::uint32_t id = line.message_id();
    const std::string name = line.name("the name of the signal"), outer = line.name("the name of the multiplexor");
    std::vector<std::pair<std::uint64_t, std::uint64_t>> values;
    do {
        const std::uint64_t low = line.whole("the first value", UINT64_MAX);
        line.need('-', "between first and last value");
        values.emplace_back(low, line.whole("the last value", UINT64_MAX));
    } while (line.take(','));
    for_signal(file, id, name, [&](dbc_signal& signal) {
        signal.mux_switch = outer;
        signal.mux_values = values;
    });
}

/// `BA_DEF_ BO_ "VFrameFormat" ENUM "StandardCAN","ExtendedCAN","reserved","J1939PG";`: which number means J1939.
void read_format_names(dbc_line& line, frame_formats& formats) {
    if (line.word() != "BO_" || !line.take('"') || line.word() != "VFrameFormat" || !line.take('"')) return;
    if (line.word() != "ENUM") return;
    for (std::uint64_t number = 0; line.take('"'); ++number) {
        if (line.word() == "J1939PG") formats.j1939 = number;
        if (!line.take('"') || !line.take(',')) return;
    }
}

/// `BA_ "SystemSignalLongSymbol" SG_ 256 Short "The_long_name";`, and the same of a message with BO_.
void read_long_name(dbc_line& line, dbc_file& file) {
    const bool of_signal = line.word() == "SG_";
    const std::uint32_t id = line.message_id();
    const std::string name = of_signal ? line.name("the name of the signal") : "";
    const std::string text = line.quoted();
    if (of_signal) {
        for_signal(file, id, name, [&](dbc_signal& signal) { signal.long_name = text; });
        return;
    }
    for (dbc_message& message : file.messages)
        if (has_id(message, id)) message.long_name = text;
}

/// Attributes that matter here: `BA_DEF_DEF_ "VFrameFormat" "J1939PG";` and `BA_ "VFrameFormat" BO_ 2566844926 3;` tell
/// which identifiers stand for a parameter group.
void read_attribute(dbc_line& line, std::string_view keyword, dbc_file& file, frame_formats& formats) {
    if (keyword == "BA_DEF_") {
        read_format_names(line, formats);
        return;
    }
    if (!line.take('"')) return;
    const std::string_view attribute = line.word();
    if (!line.take('"')) return;
    if (keyword == "BA_" && (attribute == "SystemSignalLongSymbol" || attribute == "SystemMessageLongSymbol"))
        read_long_name(line, file);
    if (attribute != "VFrameFormat") return;
    if (keyword == "BA_DEF_DEF_") {
        formats.j1939_by_default = line.take('"') ? line.word() == "J1939PG" : line.word() == "3";
        return;
    }
    if (line.word() != "BO_") return;
    const std::uint32_t id = line.message_id();
    formats.told.push_back(id);
    if (line.whole("the number of a frame format", 255) != formats.j1939) return;
    for (dbc_message& message : file.messages)
        if (message.extended && has_id(message, id)) message.j1939 = true;
}

/// Messages whose format is not told have that of the default.
void apply_default_format(const frame_formats& formats, dbc_file& file) {
    if (!formats.j1939_by_default) return;
    for (dbc_message& message : file.messages)
        if (message.extended &&
            std::find(formats.told.begin(), formats.told.end(), message.id | extended_bit) == formats.told.end())
            message.j1939 = true;
}

/// Does the line leave a string open?
bool toggles_string(std::string_view text) {
    bool odd = false;
    for (std::size_t i = 0; i < text.size(); ++i)
        if (text[i] == '"' && (i == 0 || text[i - 1] != '\\')) odd = !odd;
    return odd;
}

} // namespace

std::string read_dbc_text(const std::string& path) { return read_input(path, "a DBC"); }

dbc_file read_dbc(const std::string& path) { return read_dbc(path, read_dbc_text(path)); }

dbc_file read_dbc(const std::string& path, const std::string& text_of_file) {
    dbc_file file;
    file.path = path;
    std::istringstream input(text_of_file);
    std::string whole_line;
    frame_formats formats;
    bool in_string = false, in_message = false, message_kept = false;
    for (std::size_t number = 1; std::getline(input, whole_line); ++number) {
        std::string_view text = whole_line;
        if (number == 1 && text.substr(0, 3) == "\xEF\xBB\xBF") text.remove_prefix(3);
        if (!text.empty() && text.back() == '\r') text.remove_suffix(1);
        const bool continued = in_string;
        if (toggles_string(text)) in_string = !in_string;
        if (continued) continue;
        dbc_line line(path, number, text);
        const std::string_view keyword = line.word();
        if (keyword == "BO_") {
            read_message(line, file, message_kept);
            in_message = true;
        } else if (keyword == "SG_") {
            if (!in_message) line.refuse("a message (BO_) before its first signal");
            dbc_signal signal = read_signal(line);
            if (message_kept) file.messages.back().signals.push_back(std::move(signal));
        } else if (!keyword.empty() && line.done()) {
            in_message = false; // the section NS_ lists keywords, one a line
        } else if (keyword == "SIG_VALTYPE_") {
            read_value_type(line, file);
        } else if (keyword == "SG_MUL_VAL_") {
            read_extended_multiplexing(line, file);
        } else if (!keyword.empty()) {
            in_message = false;
            if (keyword.substr(0, 3) == "BA_") read_attribute(line, keyword, file, formats);
        }
    }
    apply_default_format(formats, file);
    if (file.messages.empty())
        throw failure(exit_usage,
                      fmt::format("{}: found no message, expected a DBC file with lines that begin with BO_", path));
    return file;
}

} // namespace okid_host
