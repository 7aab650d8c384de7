// SPDX-License-Identifier: MIT
#include "influx_lines.hpp"

#include <cmath>
#include <fmt/format.h>

namespace okid_host {
namespace {

/// Commas, equals signs and blanks of a tag stand behind a backslash; a backslash at the end would reach over its own end.
std::string escaped(const std::string& text) {
    std::string out;
    for (const char c : text) {
        if (c == ',' || c == '=' || c == ' ') out += '\\';
        out += c == '\n' || c == '\r' ? '_' : c;
    }
    if (!out.empty() && out.back() == '\\') out += '_';
    return out.empty() ? "_" : out;
}

/// Fields of a line; what is not finite is left out.
class fields {
  public:
    void number(const char* name, double value) {
        if (std::isfinite(value)) add(name, fmt::format("{}", value));
    }
    void whole(const char* name, std::uint64_t value) { add(name, fmt::format("{}i", value)); }
    void flag(const char* name, bool value) { add(name, value ? "true" : "false"); }
    /// The line behind `head`; "" without a field, which no reader would take.
    std::string line(const std::string& head, double wall_s) const {
        return text_.empty() ? "" : fmt::format("{} {} {}\n", head, text_, std::llround(wall_s * 1e6) * 1000);
    }

  private:
    void add(const char* name, const std::string& value) {
        text_ += fmt::format("{}{}={}", text_.empty() ? "" : ",", name, value);
    }
    std::string text_;
};

} // namespace

std::string influx_lines::head(const char* measurement, const std::string& tag, const std::string& value) const {
    return fmt::format("{},rig={}{}", measurement, escaped(rig_), tag.empty() ? "" : "," + tag + "=" + escaped(value));
}

std::string influx_lines::take(const publication& one) {
    numbers_.take(one);
    std::string out;
    if (one.type == "modes") {
        for (const live_numbers::mode& each : numbers_.modes) {
            fields of;
            of.number("frequency_hz", each.frequency_hz);
            of.number("frequency_std_hz", each.frequency_std_hz);
            of.number("damping_ratio", each.damping_ratio);
            of.number("damping_ratio_std", each.damping_ratio_std);
            out += of.line(head("okid_mode", "mode", std::to_string(each.track)), one.wall_s);
        }
        fields of;
        of.number("t", numbers_.t);
        of.whole("samples", static_cast<std::uint64_t>(numbers_.samples));
        of.flag("settled", numbers_.settled);
        of.flag("alarm", numbers_.alarm);
        of.whole("alarms", numbers_.alarms);
        of.whole("changes", numbers_.changes);
        of.whole("gaps", numbers_.gaps);
        out += of.line(head("okid"), one.wall_s);
    } else if (one.type == "stats") {
        for (const auto& [name, counts] : numbers_.bus.items()) {
            fields of;
            of.number("received", number_of(counts, "received"));
            of.number("lost", number_of(counts, "lost"));
            of.number("load_percent", number_of(counts, "load_percent"));
            out += of.line(head("okid_bus", "bus", name), one.wall_s);
        }
        for (const auto& [name, counts] : numbers_.channel.items()) {
            fields of;
            of.number("missing", number_of(counts, "missing"));
            of.number("completeness_percent", number_of(counts, "completeness_percent"));
            out += of.line(head("okid_channel", "channel", name), one.wall_s);
        }
    } else if (one.type == "alarm" || one.type == "alarm_over" || one.type == "change") {
        fields of;
        of.number("t", number_of(*one.event, "t"));
        of.number("mode", number_of(*one.event, "mode"));
        of.number("frequency_hz", number_of(*one.event, "frequency_hz"));
        of.number("baseline_hz", number_of(*one.event, "baseline_hz"));
        out += of.line(head("okid_event", "type", one.type), one.wall_s);
    }
    return out;
}

} // namespace okid_host
