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
#include <optional>
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
    std::vector<std::uint32_t> named; ///< messages it names, as numbered in the file
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
    /// As refuse(), of what stands `letters` before.
    [[noreturn]] void refuse_word(std::size_t letters, const std::string& expected) {
        at_ -= letters;
        refuse(expected);
    }
    /// A number that is not used: one beyond the range of a double will do.
    void bound(const char* expected) {
        blanks();
        double value = 0;
        const auto [end, error] = std::from_chars(text_.data() + at_, text_.data() + text_.size(), value);
        boundless_ = boundless_ || error == std::errc::result_out_of_range;
        if (error == std::errc::result_out_of_range)
            at_ = static_cast<std::size_t>(end - text_.data());
        else
            number(expected);
    }
    bool boundless() const { return boundless_; } ///< it had such a number
    std::uint32_t message_id() {
        id_ = static_cast<std::uint32_t>(whole("the identifier of the message", 0xFFFFFFFFu));
        return *id_;
    }
    std::optional<std::uint32_t> id() const { return id_; } ///< of the message the line is about, once it was read
    std::size_t number_of_line() const { return number_; }
    std::size_t at() const { return at_; }

  private:
    const std::string& path_;
    std::size_t number_;
    std::string_view text_;
    std::size_t at_ = 0;
    std::optional<std::uint32_t> id_;
    bool boundless_ = false;
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

/// `BO_ 256 Name: 8 Sender`. @return false: its signals belong to no frame
bool read_message(dbc_line& line, dbc_message& message) {
    const std::uint32_t id = line.message_id();
    const std::size_t behind = line.at();
    message.name = line.name("the name of the message");
    message.extended = (id & extended_bit) != 0;
    message.id = id & ~extended_bit;
    message.line = line.number_of_line();
    if (id == no_message_id) return false;
    const std::size_t back = line.at() - behind + fmt::formatted_size("{}", id);
    if (message.id > 0x1FFFFFFFu) line.refuse_word(back, "an identifier of 29 bits, with 2147483648 added");
    if (!message.extended && message.id > 0x7FF)
        line.refuse_word(back, fmt::format("an identifier of 11 bits; as an extended one (29 bits) it is written {}",
                                           id | extended_bit));
    line.need(':', "after the name of the message");
    message.length = static_cast<unsigned>(line.whole("the length of the message in bytes", 65535));
    return true;
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
        line.refuse_word(text.size(), "M, m<number> or ':' after the name of the signal");
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
    line.bound("the minimum, a number");
    line.need('|', "between minimum and maximum");
    line.bound("the maximum, a number");
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
    formats.named.push_back(id);
    if (line.whole("the number of a frame format", 255) != formats.j1939) return;
    for (dbc_message& message : file.messages)
        if (message.extended && has_id(message, id)) message.j1939 = true;
}

/// Messages without a format have the default one.
void apply_default_format(const frame_formats& formats, dbc_file& file) {
    if (!formats.j1939_by_default) return;
    for (dbc_message& message : file.messages)
        if (message.extended &&
            std::find(formats.named.begin(), formats.named.end(), message.id | extended_bit) == formats.named.end())
            message.j1939 = true;
}

/// Does the line leave a string open?
bool toggles_string(std::string_view text) {
    bool odd = false;
    for (std::size_t i = 0; i < text.size(); ++i)
        if (text[i] == '"' && (i == 0 || text[i - 1] != '\\')) odd = !odd;
    return odd;
}

/// The file, line by line.
class dbc_reading {
  public:
    explicit dbc_reading(const std::string& path) { file_.path = path; }

    void take(std::size_t number, std::string_view text) {
        dbc_line line(file_.path, number, text);
        const std::string_view keyword = line.word();
        try {
            read(line, keyword);
        } catch (const failure& fault) {
            set_aside(line, keyword, fault.what());
        }
    }

    dbc_file finish() {
        apply_default_format(formats_, file_);
        const auto usable = [](const dbc_message& message) { return message.fault.empty(); };
        if (std::none_of(file_.messages.begin(), file_.messages.end(), usable))
            throw failure(exit_usage, first_fault_.empty() ? fmt::format("{}: found no message, expected a DBC file "
                                                                         "with lines that begin with BO_",
                                                                         file_.path)
                                                           : first_fault_);
        return std::move(file_);
    }

  private:
    void read(dbc_line& line, std::string_view keyword) {
        if (keyword == "BO_") {
            in_message_ = true;
            kept_ = false;
            fresh_ = {};
            kept_ = read_message(line, fresh_);
            if (kept_) file_.messages.push_back(fresh_);
        } else if (keyword == "SG_") {
            if (!in_message_) line.refuse("a message (BO_) before its first signal");
            dbc_signal signal = read_signal(line);
            if (line.boundless())
                file_.faults.push_back(
                    fmt::format("{}: line {}: the range of signal {} is beyond any number; it is not "
                                "used",
                                file_.path, signal.line, printable(signal.name)));
            if (kept_) file_.messages.back().signals.push_back(std::move(signal));
        } else if (!keyword.empty() && line.done()) {
            in_message_ = false; // the section NS_ lists keywords, one a line
        } else if (keyword == "SIG_VALTYPE_") {
            read_value_type(line, file_);
        } else if (keyword == "SG_MUL_VAL_") {
            read_extended_multiplexing(line, file_);
        } else if (!keyword.empty()) {
            in_message_ = false;
            if (keyword.substr(0, 3) == "BA_") read_attribute(line, keyword, file_, formats_);
        }
    }

    /// The message of a line that cannot be read is left out, the rest of the file is not.
    void set_aside(const dbc_line& line, std::string_view keyword, const std::string& fault) {
        if (first_fault_.empty()) first_fault_ = fault;
        std::string names;
        const auto leave_out = [&](dbc_message& message) {
            message.fault = fault;
            if (!message.name.empty()) names = message.name;
        };
        if (keyword == "BO_") {
            leave_out(fresh_);
            file_.messages.push_back(fresh_);
        } else if (keyword == "SG_" && kept_) {
            leave_out(file_.messages.back());
        } else if (line.id()) {
            for (dbc_message& message : file_.messages)
                if (has_id(message, *line.id())) leave_out(message);
        }
        file_.faults.push_back(names.empty() ? fault + "; the line is left out"
                                             : fmt::format("{}; message {} is left out", fault, printable(names)));
    }

    dbc_file file_;
    dbc_message fresh_; ///< the one read last
    frame_formats formats_;
    std::string first_fault_;
    bool in_message_ = false, kept_ = false; ///< signals that come belong to the last message of the file
};

} // namespace

std::string read_dbc_text(const std::string& path) { return read_input(path, "a DBC"); }

dbc_file read_dbc(const std::string& path) { return read_dbc(path, read_dbc_text(path)); }

dbc_file read_dbc(const std::string& path, const std::string& text_of_file) {
    dbc_reading reading(path);
    std::istringstream input(text_of_file);
    std::string whole_line;
    bool in_string = false;
    for (std::size_t number = 1; std::getline(input, whole_line); ++number) {
        std::string_view text = whole_line;
        if (number == 1 && text.substr(0, 3) == "\xEF\xBB\xBF") text.remove_prefix(3);
        if (!text.empty() && text.back() == '\r') text.remove_suffix(1);
        const bool continued = in_string;
        if (toggles_string(text)) in_string = !in_string;
        if (!continued) reading.take(number, text);
    }
    return reading.finish();
}

} // namespace okid_host
