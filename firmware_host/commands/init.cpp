// SPDX-License-Identifier: MIT
// PURPOSE  okid init: a commented CONFIG.toml to begin with, proposed from a DBC and from what a bus or a log carries,
//          or from the names of the numbers on a serial line
// METHOD   signals whose unit is that of a force or a motion become channels, unsigned ones named like a counter count
//          samples; identifiers that are heard decide which messages, their spacing decides the rate
#include "commands.hpp"
#include "config/config.hpp"
#include "config/dbc.hpp"
#include "error.hpp"
#include "files/nearest_name.hpp"
#include "files/units.hpp"
#include "files/whole_file.hpp"
#include "record/csv_header.hpp"

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <drv/candump.h>
#include <drv/source.h>
#include <filesystem>
#include <fmt/format.h>
#include <map>
#include <memory>
#include <optional>
#include <poll.h>
#include <set>
#include <sys/un.h>

namespace okid_host {
namespace {

struct init_arguments {
    std::string config, dbc, interface = "can0", log, device, fields;
    double rate_hz = 0, listen_s = 0;
    int baud = 115200;
};

/// Frames of one identifier and page: how many, from when to when.
struct heard_frame {
    std::size_t count = 0;
    std::int64_t first_ns = 0, last_ns = 0;
    double rate_hz() const {
        return count > 1 && last_ns > first_ns
                   ? static_cast<double>(count - 1) / (static_cast<double>(last_ns - first_ns) * 1e-9)
                   : 0;
    }
};

struct heard_message {
    std::map<std::int64_t, heard_frame> pages; ///< by the value of the multiplexor, 0 where there is none
    double rate_hz() const {
        double out = 0;
        for (const auto& [page, frames] : pages) out = std::max(out, frames.rate_hz());
        return out;
    }
};

using heard_frames = std::map<std::pair<std::uint32_t, bool>, heard_message>;

/// The number that tells the pages of a message apart.
std::int64_t page_of(const std::vector<dbc_message>& messages, const drv_frame_t& frame) {
    const auto message = std::find_if(messages.begin(), messages.end(), [&](const dbc_message& each) {
        return each.id == frame.id && each.extended == ((frame.flags & DRV_FRAME_EXTENDED) != 0);
    });
    std::int64_t page = 0;
    if (message == messages.end()) return page;
    for (const dbc_signal& signal : message->signals)
        if (signal.multiplexor && signal.mux_values.empty())
            (void)drv_signal_raw(&signal.layout, frame.data, frame.len, &page);
    return page;
}

/// What comes on the interface for so many seconds, or stands in the log.
heard_frames listen(const init_arguments& given, const std::vector<dbc_message>& messages) {
    heard_frames out;
    drv_source_t source{};
    drv_source_config_t config{};
    source.ops = given.log.empty() ? &drv_source_socketcan : &drv_source_replay;
    config.path = given.log.empty() ? nullptr : given.log.c_str();
    config.interfaces[0] = given.interface.c_str();
    config.interface_count = given.log.empty() ? 1 : 0;
    if (source.ops->open(&source, &config) != 0)
        throw failure(given.log.empty() ? exit_device : exit_usage, source.error);
    const auto end = std::chrono::steady_clock::now() + std::chrono::duration<double>(given.listen_s);
    std::array<drv_frame_t, 64> frames{};
    while (!given.log.empty() || (std::chrono::steady_clock::now() < end)) {
        const int count = source.ops->read(&source, frames.data(), static_cast<int>(frames.size()));
        if (count < 0) break;
        for (int i = 0; i < count; ++i) {
            const drv_frame_t& frame = frames[static_cast<std::size_t>(i)];
            heard_frame& one = out[{frame.id, (frame.flags & DRV_FRAME_EXTENDED) != 0}].pages[page_of(messages, frame)];
            if (one.count++ == 0) one.first_ns = frame.time_ns;
            one.last_ns = frame.time_ns;
        }
        pollfd waiting{source.ops->fd(&source), POLLIN, 0};
        if (count == 0 && given.log.empty()) (void)poll(&waiting, 1, 100);
    }
    source.ops->close(&source);
    if (out.empty())
        throw failure(exit_device, fmt::format("{}: no frame came{}", given.log.empty() ? given.interface : given.log,
                                               given.log.empty() ? fmt::format(" within {:g} s", given.listen_s) : ""));
    return out;
}

bool counts_samples(const dbc_signal& signal) {
    const std::string name = lower_case(signal.name);
    const auto has = [&](const char* part) { return name.find(part) != std::string::npos; };
    return signal.unit.empty() && !signal.layout.is_signed && signal.layout.length >= 4 && signal.layout.scale == 1 &&
           (has("count") || has("cnt") || has("seq") || has("number") || has("sample"));
}

std::string quoted_toml(const std::string& text) {
    std::string out = "\"";
    for (const char c : text) out += c == '"' || c == '\\' ? std::string("\\") + c : std::string(1, c);
    return out + '"';
}

/// The sections [[channel]] that a DBC proposes, and what was left out, as comments.
struct proposal {
    std::string channels, left_out;
    std::size_t forces = 0, responses = 0;
    double rate_hz = 0;    ///< of the fastest message with a response; 0 = not heard
    bool flexible = false; ///< there is a message of CAN FD
};

void propose(const dbc_message& message, double rate_hz, std::set<std::string>& names, proposal& out) {
    const auto counter = std::find_if(message.signals.begin(), message.signals.end(), counts_samples);
    for (const dbc_signal& signal : message.signals) {
        const std::string role = role_of_unit(signal.unit);
        if (counter != message.signals.end() && &signal == &*counter) continue;
        if (role.empty()) {
            out.left_out += fmt::format("# left out: {}.{} [{}]\n", message.name, signal.name, signal.unit);
            continue;
        }
        const bool force = role == "force";
        std::string name = signal.name;
        if (!names.insert(name).second) names.insert(name = message.name + "_" + signal.name);
        out.channels +=
            fmt::format("\n[[channel]]\nname = {}\nrole = \"{}\"\ndof = {:<14} # where it {}: number your "
                        "degrees of freedom from 1\nunit = {}\nmessage = {}\nsignal = {}\n",
                        quoted_toml(name), role, ++(force ? out.forces : out.responses), force ? "acts" : "stands",
                        quoted_toml(signal.unit), quoted_toml(message.name), quoted_toml(signal.name));
        if (counter != message.signals.end())
            out.channels += fmt::format("sequence = {:<9} # counts samples\n", quoted_toml(counter->name));
        if (!force) out.rate_hz = std::max(out.rate_hz, rate_hz);
        out.flexible = out.flexible || message.length > 8;
    }
}

proposal from_dbc(const init_arguments& given, bool hears) {
    proposal out;
    std::set<std::string> names;
    const std::vector<dbc_message> messages = read_dbc(given.dbc).messages;
    const heard_frames heard = hears ? listen(given, messages) : heard_frames{};
    for (const dbc_message& message : messages) {
        const auto found = heard.find({message.id, message.extended});
        if (!message.fault.empty() || (!heard.empty() && found == heard.end())) {
            out.left_out += fmt::format("# left out: message {} ({:#x}), {}\n", message.name, message.id,
                                        message.fault.empty() ? "not heard" : "cannot be read");
            continue;
        }
        propose(message, found == heard.end() ? 0 : found->second.rate_hz(), names, out);
    }
    if (out.responses == 0)
        throw failure(exit_usage,
                      fmt::format("{}: no signal with the unit of a motion (g, m/s^2, m/s, mm ...){}; expected one at "
                                  "least. Write the channels by hand: docs/reference/config.md",
                                  given.dbc, heard.empty() ? "" : " in a message that was heard"));
    return out;
}

/// Names of the numbers in a line: what begins like a force is one, all others are accelerations.
proposal from_fields(const init_arguments& given) {
    proposal out;
    int field = 0;
    for (const std::string& name : split_names("--fields", given.fields)) {
        const bool skip = name == "-", counts = name == "count";
        const bool force = !name.empty() && (name[0] == 'f' || name[0] == 'F');
        if (counts || skip) {
            ++field;
            continue;
        }
        out.channels += fmt::format("\n[[channel]]\nname = {}\nrole = \"{}\"\nunit = \"{}\"{:9} # of the number in the "
                                    "line\ndof = {:<14} # where it {}: number your degrees of freedom from 1\nfield = "
                                    "{:<12} # place in the line, from 0\n",
                                    quoted_toml(name), force ? "force" : "acceleration", force ? "N" : "m/s^2", "",
                                    ++(force ? out.forces : out.responses), force ? "acts" : "stands", field++);
    }
    if (out.responses == 0)
        throw failure(exit_usage,
                      fmt::format("--fields {}: no response, expected names such as count,force,a1,a2", given.fields));
    return out;
}

std::string bus_section(const init_arguments& given, bool flexible) {
    if (!given.device.empty()) {
        const std::vector<std::string> names = split_names("--fields", given.fields);
        const auto count = std::find(names.begin(), names.end(), "count");
        return fmt::format("[[bus]]\nname = \"line\"\ntype = \"serial\"\ndevice = {}   # its name below "
                           "/dev/serial/by-id/ stays the same\nbaud = {}\nframing = \"ascii\"\n{}",
                           quoted_toml(given.device), given.baud,
                           count == names.end()
                               ? "# counter_field = 0       # a number that counts samples: lost lines "
                                 "can be seen\n"
                               : fmt::format("counter_field = {}\n", count - names.begin()));
    }
    const std::filesystem::path folder = std::filesystem::absolute(given.config).parent_path();
    return fmt::format(
        "[[bus]]\nname = \"can0\"\ntype = \"socketcan\"\ninterface = {}\n{}# bitrate = 1000000         # "
        "for the load figure: the bit rate of the bus\n{}dbc = {}\n",
        quoted_toml(given.interface), flexible ? "fd = true\n" : "",
        flexible ? "# dbitrate = 5000000        # and that of the data of its FD frames\n" : "",
        quoted_toml(std::filesystem::absolute(given.dbc).lexically_relative(folder).string()));
}

std::string text_of(const init_arguments& given, const proposal& found) {
    const bool measured = given.rate_hz == 0;
    const double rate = measured ? std::round(found.rate_hz) : given.rate_hz;
    std::string out = fmt::format(
        "# Made by okid init. Read every line: roles, units and places are proposals. Then: okid check {}\n\n"
        "[acquisition]\nrate_hz = {:<10.10g} # {}\n# title = \"frame, first test\"\n\n",
        std::filesystem::path(given.config).filename().string(), rate,
        measured ? fmt::format("measured: {:.6g} frames a second", found.rate_hz) : "what the sensors sample with");
    out += bus_section(given, found.flexible) + found.channels + (found.left_out.empty() ? "" : "\n" + found.left_out);
    out += "\n[identification]           # all of it may be left out\nupdate_s = 2.0\n";
    if (found.forces > 0)
        out += "# hold = \"foh\"            # the force is a load cell's; default: determined from the record\n"
               "# mkr = true              # mass, stiffness, damping: a force or sensor at every dof, both at one\n";
    const std::filesystem::path socket = std::filesystem::path(given.config).filename().replace_extension(".sock");
    const std::size_t bytes = std::filesystem::absolute(given.config).replace_filename(socket).string().size();
    const char* const off = bytes < sizeof(sockaddr_un::sun_path) ? "" : "# "; // too long a name for a socket
    return out +
           "# window_s = 20.0          # for a structure that changes; default: everything since the start\n\n"
           "# [record]                 # raw frames onto the disk\n# directory = \"runs\"\n\n" +
           fmt::format("{0}[publish]                  # for okid-live\n{0}socket = {1}\n{0}samples = true\n", off,
                       quoted_toml(socket.string()));
}

void init(const init_arguments& given) {
    if (std::filesystem::exists(given.config))
        throw failure(exit_usage, fmt::format("{}: exists, expected a new name: it is not overwritten", given.config));
    if (given.dbc.empty() == given.device.empty())
        throw failure(exit_usage, "expected either --dbc FILE (CAN) or --device LINE with --fields (serial line)");
    if (!given.device.empty() && given.fields.empty())
        throw failure(exit_usage, "--device: expected --fields with the names of the numbers, such as count,force,a1");
    const bool hears = given.listen_s > 0 || !given.log.empty();
    if (given.rate_hz == 0 && (!hears || given.dbc.empty()))
        throw failure(exit_usage, "no sample rate: expected --rate HZ, or with --dbc --listen SECONDS or --log FILE");
    check_writable(given.config);
    const proposal found = given.dbc.empty() ? from_fields(given) : from_dbc(given, hears);
    if (given.rate_hz == 0 && !(found.rate_hz >= 1))
        throw failure(exit_usage, "the frames that were received give no sample rate; expected --rate HZ");
    const std::string text = text_of(given, found);
    (void)load_config_text(given.config, text); // what is written is right
    write_whole_file(given.config, text);
    say("{}: {} force and {} response channel{}; read it, then okid check {}\n", given.config, found.forces,
        found.responses, found.responses == 1 ? "" : "s", given.config);
}

} // namespace

void add_init(CLI::App& app) {
    auto given = std::make_shared<init_arguments>();
    CLI::App* command =
        app.add_subcommand("init", "Propose a commented CONFIG.toml from a DBC, a bus or a serial line");
    command->add_option("config", given->config, "the file to write; an existing one is not overwritten")
        ->required()
        ->type_name("CONFIG.toml");
    command->add_option("--dbc", given->dbc, "signals with the unit of a force or a motion become channels")
        ->type_name("FILE.dbc");
    command->add_option("--interface", given->interface, "CAN interface (default can0)")->type_name("NAME");
    command
        ->add_option("--listen", given->listen_s,
                     "listen to it for this long: only messages that are received, and their rate")
        ->type_name("SECONDS")
        ->check(CLI::Range(0.1, 600.0).description(""));
    command->add_option("--log", given->log, "the same from a candump log")->type_name("FILE.log");
    command->add_option("--device", given->device, "a serial line of text instead")->type_name("LINE");
    command->add_option("--fields", given->fields, "names of its numbers in order, such as count,force,a1 (- = none)")
        ->type_name("NAMES");
    command->add_option("--baud", given->baud, "of the serial line (default 115200)")
        ->type_name("N")
        ->check(CLI::Range(50, 20000000).description(""));
    command->add_option("--rate", given->rate_hz, "samples a second; with --listen and --log it is measured")
        ->type_name("HZ")
        ->check(CLI::Range(1e-3, 1e6).description(""));
    command->footer("Examples:\n  okid init lab.toml --dbc vendor.dbc --listen 5\n"
                    "  okid init arduino.toml --device /dev/ttyACM0 --fields count,force,a1,a2 --rate 250");
    command->callback([given] { init(*given); });
}

} // namespace okid_host
