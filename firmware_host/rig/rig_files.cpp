// SPDX-License-Identifier: MIT
#include "rig_files.hpp"

#include "rig_frames.hpp"

#include <algorithm>
#include <charconv>
#include <fmt/format.h>
#include <iterator>
#include <nlohmann/json.hpp>

namespace okid_host {
namespace {

using nlohmann::ordered_json;

ordered_json matrix_json(const Eigen::MatrixXd& matrix) {
    ordered_json out = ordered_json::array();
    for (Eigen::Index i = 0; i < matrix.rows(); ++i) {
        ordered_json row = ordered_json::array();
        for (Eigen::Index j = 0; j < matrix.cols(); ++j) row.push_back(matrix(i, j));
        out.push_back(std::move(row));
    }
    return out;
}

void describe(const structure& body, ordered_json& out) {
    const rig_modes modes = structure_modes(body);
    out["frequency_hz"] = modes.frequency_hz;
    out["damping_ratio"] = modes.damping_ratio;
    out["M"] = matrix_json(body.M);
    out["K"] = matrix_json(body.K);
    out["R"] = matrix_json(body.R);
}

void put_number(std::string& out, double value) {
    char text[32];
    const auto [end, error] = std::to_chars(text, text + sizeof text, value);
    out.append(text, error == std::errc{} ? end : text);
}

/// A TOML basic string.
std::string quoted(const std::string& text) {
    std::string out = "\"";
    for (const char c : text) {
        if (c == '"' || c == '\\') out += '\\';
        if (static_cast<unsigned char>(c) < 0x20 || c == 0x7f)
            out += fmt::format("\\u{:04x}", static_cast<unsigned>(c));
        else
            out += c;
    }
    return out + "\"";
}

/// Does every mass have a force or a sensor, and one both?
bool mass_is_seen(const rig& rig) {
    const auto in = [](const std::vector<int>& dofs, int dof) {
        return std::find(dofs.begin(), dofs.end(), dof) != dofs.end();
    };
    bool pair = false;
    for (int dof = 1; dof <= static_cast<int>(rig.body.M.rows()); ++dof) {
        const bool force = in(rig.force_dofs, dof), sensor = in(rig.sense_dofs, dof);
        if (!force && !sensor) return false;
        pair = pair || (force && sensor);
    }
    return pair;
}

std::string config_head(const rig& rig, const rig_run& run) {
    // TOML takes a whole number for a rate as well; "250." it does not take
    std::string title;
    for (char c : rig.title) title += c == '"' || c == '\\' ? std::string{'\\', c} : std::string{c};
    return fmt::format("# written by okid simulate\n[acquisition]\nrate_hz = {}\ntitle = \"{}\"\n\n", run.rate_hz,
                       title);
}

std::string config_tail(const rig& rig) {
    return fmt::format("\n[identification]\nhold = \"{}\"\nupdate_s = 1.0\nmkr = {}\n", rig.hold, mass_is_seen(rig));
}

} // namespace

std::string rig_truth(const rig& rig) {
    ordered_json out;
    out["schema"] = "okid.truth/1";
    describe(rig.body, out);
    out["alpha"] = rig.alpha ? ordered_json(*rig.alpha) : ordered_json(nullptr);
    out["beta"] = rig.beta ? ordered_json(*rig.beta) : ordered_json(nullptr);
    out["fs_hz"] = rig.rate_hz;
    for (const rig_change& change : rig.changes) {
        ordered_json after;
        after["at_s"] = change.at_s;
        describe(change.after, after);
        out["changes"].push_back(std::move(after));
    }
    std::string text = "{\n";
    std::size_t left = out.size();
    for (const auto& [key, value] : out.items())
        text += fmt::format("\"{}\": {}{}\n", key, value.dump(), --left ? "," : "");
    return text + "}\n";
}

std::string rig_csv(const rig_run& run) {
    std::string out = fmt::format("# fs_hz: {}\n# units:", run.rate_hz);
    for (const rig_channel& channel : run.channels) out += fmt::format(" {} {},", channel.name, channel.unit);
    out.back() = '\n';
    for (std::size_t k = 0; k < run.channels.size(); ++k) out += (k ? "," : "") + run.channels[k].name;
    out += '\n';
    out.reserve(out.size() + run.count * run.channels.size() * 12);
    for (std::size_t n = 0; n < run.count; ++n) {
        for (std::size_t k = 0; k < run.channels.size(); ++k) {
            if (k) out += ',';
            put_number(out, run.channels[k].value(n));
        }
        out += '\n';
    }
    return out;
}

std::string rig_config(const rig& rig, const rig_run& run, const std::string& dbc) {
    std::string out = config_head(rig, run);
    auto text = std::back_inserter(out);
    fmt::format_to(text,
                   "[[bus]]\nname = \"can0\"\ntype = \"socketcan\"\ninterface = \"{}\"\nbitrate = 1000000\ndbc = {}\n",
                   rig_interface, quoted(dbc));
    for (const rig_message& message : rig_messages(run)) {
        for (std::size_t k = 0; k < message.count; ++k) {
            const rig_channel& channel = run.channels[message.first + k];
            fmt::format_to(text,
                           "\n[[channel]]\nname = \"{}\"\nrole = \"{}\"\ndof = {}\nunit = \"{}\"\nbus = "
                           "\"can0\"\nmessage = \"{}\"\n"
                           "signal = \"{}\"\nsequence = \"Counter\"\n",
                           channel.name, channel.role, channel.dof, channel.unit, message.name, channel.signal);
        }
    }
    return out + config_tail(rig);
}

std::string rig_line_config(const rig& rig, const rig_run& run, const std::string& device, int baud) {
    std::string out = config_head(rig, run);
    auto text = std::back_inserter(out);
    fmt::format_to(text,
                   "[[bus]]\nname = \"node\"\ntype = \"serial\"\n"
                   "device = {} # okid simulate sends on this one; put the other end of the line here\nbaud = {}\n"
                   "framing = \"cobs\"\n",
                   quoted(device), baud);
    for (std::size_t k = 0; k < run.channels.size(); ++k) {
        const rig_channel& channel = run.channels[k];
        fmt::format_to(text,
                       "\n[[channel]]\nname = \"{}\"\nrole = \"{}\"\ndof = {}\nunit = \"{}\"\nbus = \"node\"\n"
                       "field = {}\nscale = {}\n",
                       channel.name, channel.role, channel.dof, channel.unit, k, channel.scale);
    }
    return out + config_tail(rig);
}

} // namespace okid_host
