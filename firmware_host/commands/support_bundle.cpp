// SPDX-License-Identifier: MIT
// PURPOSE  okid support-bundle: what a bug report needs, as one text
// METHOD   version, system, findings of okid doctor, the config without passwords, the end of an events file; what a file that
//          cannot be read says stands in its place
#include "commands.hpp"
#include "config/secrets.hpp"
#include "error.hpp"
#include "files/input_file.hpp"
#include "files/shown_text.hpp"
#include "files/whole_file.hpp"
#include "findings.hpp"

#include <algorithm>
#include <memory>
#include <okid/types.h>
#include <optional>
#include <sys/utsname.h>
#include <unistd.h>
#include <vector>

namespace okid_host {
namespace {

constexpr std::size_t last_bytes = 256 << 10; // of an events file
constexpr std::size_t longest_line = 2000;    // of an event: shapes of many channels are long

std::string system_text() {
    std::string name;
    try {
        const std::string text = read_input("/etc/os-release", "the name of the system");
        const std::size_t at = text.find("PRETTY_NAME=");
        name = at != std::string::npos ? text.substr(at + 12, text.find('\n', at) - at - 12) : "without a name";
    } catch (const failure&) {
        name = "not known";
    }
    utsname kernel{};
    (void)uname(&kernel);
    return fmt::format("okid {} ({}){}\nsystem {}\nkernel {} {} {}\n", okid_version(), okid_backend(), left_out(), name,
                       kernel.sysname, kernel.release, kernel.machine);
}

/// The config and its findings.
std::string config_text(const std::string& path) {
    std::string out;
    std::optional<live_config> config;
    if (!path.empty()) try {
            config = load_config(path);
        } catch (const failure& fault) {
            out = fmt::format("{}\n\n", fault.what());
        }
    out += "## okid doctor\n" + examine(config).text();
    if (path.empty()) return out;
    out += fmt::format("\n## {} (without passwords)\n", path);
    try {
        out += without_passwords(read_input(path, "a CONFIG.toml"));
    } catch (const failure& fault) {
        out += fmt::format("{}\n", fault.what());
    }
    return out;
}

/// The last `count` whole lines.
std::string last_lines(const std::string& path, std::size_t count) {
    const int fd = open_input(path, "events as okid run --events writes them");
    const off_t size = lseek(fd, 0, SEEK_END), from = std::max<off_t>(0, size - static_cast<off_t>(last_bytes));
    std::string text(static_cast<std::size_t>(size - from), '\0');
    const ssize_t got = pread(fd, text.data(), text.size(), from);
    close(fd);
    text.resize(got > 0 ? static_cast<std::size_t>(got) : 0);
    if (from > 0) text.erase(0, text.find('\n') + 1);
    std::vector<std::string> lines;
    for (std::size_t at = 0; at < text.size();) {
        const std::size_t end = std::min(text.find('\n', at), text.size());
        const std::string line = text.substr(at, end - at);
        lines.push_back(line.size() <= longest_line ? line
                                                    : fmt::format("{} … ({} more bytes)", line.substr(0, longest_line),
                                                                  line.size() - longest_line));
        at = end + 1;
    }
    std::string out;
    for (std::size_t i = lines.size() > count ? lines.size() - count : 0; i < lines.size(); ++i) out += lines[i] + "\n";
    return out;
}

} // namespace

void add_support_bundle(CLI::App& app) {
    struct arguments {
        std::string config, events, out = "-";
        std::size_t lines = 50;
    };
    auto given = std::make_shared<arguments>();
    CLI::App* command = app.add_subcommand("support-bundle", "What a bug report needs, as one text: version, system, "
                                                             "okid doctor, the config without passwords, last events");
    command->add_option("config", given->config, "the config of the run, wrong or right")->type_name("CONFIG.toml");
    command->add_option("--events", given->events, "the events of the run: their end")->type_name("FILE");
    command->add_option("--lines", given->lines, "how many events (50)")
        ->check(CLI::Range(1, 1000).description(""))
        ->type_name("N");
    command->add_option("--out", given->out, "write it there; - = stdout, the default")->type_name("FILE|-");
    command->footer("Read it before you send it: names of channels, notes and paths are in it.\n\n"
                    "Example:\n  okid support-bundle frame.toml --events events.jsonl --out bundle.txt");
    command->callback([given] {
        std::string text = "# okid support bundle\n" + system_text() + "\n" + config_text(given->config);
        if (!given->events.empty())
            text += fmt::format("\n## end of {}\n{}", given->events, last_lines(given->events, given->lines));
        write_whole_file(given->out, shown(text));
    });
}

} // namespace okid_host
