// SPDX-License-Identifier: MIT
// okid doctor: what a live measurement needs of this machine, what is missing, and the command that fixes it.
#include "acquire/can_link.hpp"
#include "acquire/reader.hpp"
#include "acquire/serial_line.hpp"
#include "blas_kernels.hpp"
#include "commands.hpp"
#include "config/config.hpp"
#include "error.hpp"
#include "files/nearest_name.hpp"
#include "findings.hpp"
#include "live/gpio_lines.hpp"

#include <algorithm>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <fmt/format.h>
#include <fstream>
#include <memory>
#include <optional>
#include <sstream>
#include <sys/resource.h>
#include <sys/socket.h>
#include <unistd.h>

namespace okid_host {
namespace {

constexpr long long wanted_buffer = DRV_RECEIVE_BUFFER;
constexpr int cap_net_admin = 12, cap_sys_nice = 23;
constexpr int cap_ipc_lock = 14;

std::string first_line(const std::string& path) {
    std::ifstream input(path);
    std::string line;
    std::getline(input, line);
    return line;
}

bool in_path(const std::string& program) {
    const char* path = std::getenv("PATH");
    std::stringstream folders(path ? path : "");
    std::string folder;
    while (std::getline(folders, folder, ':'))
        if (access((folder + "/" + program).c_str(), X_OK) == 0) return true;
    return false;
}

bool has_capability(int number) {
    std::ifstream input("/proc/self/status");
    std::string line;
    while (std::getline(input, line))
        if (line.rfind("CapEff:", 0) == 0) return (std::strtoull(line.c_str() + 7, nullptr, 16) >> number & 1) != 0;
    return false;
}

bool check_kernel(findings& out) {
    const int fd = socket(PF_CAN, SOCK_RAW | SOCK_CLOEXEC, 1);
    if (fd >= 0) {
        close(fd);
        out.well("CAN in the kernel", "AF_CAN and can-raw answer");
        return true;
    }
    if (errno == EPERM || errno == EACCES) {
        out.missing("CAN in the kernel", std::strerror(errno), "run with sudo, or with CAP_NET_RAW");
        return false;
    }
    out.missing("CAN in the kernel", fmt::format("no CAN sockets ({})", std::strerror(errno)),
                "sudo modprobe -a can can-raw vcan (Debian: they are in linux-image; Ubuntu: apt-get install "
                "linux-modules-extra-$(uname -r)); "
                "without CAN: okid replay LOG -c CONFIG.toml");
    return false;
}

void check_interface(findings& out, const bus_config& config) {
    bus_config bus = config;
    bus.interface = interface_of(config);
    if (bus.interface.empty()) {
        const std::vector<std::string> there = usb_adapters();
        out.missing(fmt::format("bus {} (adapter {})", bus.name, bus.adapter),
                    "no such USB adapter; with CAN there are: " + (there.empty() ? "none" : list_names(there)),
                    "plug it in; several with one serial number are told apart by their port");
        return;
    }
    const std::string what = fmt::format("bus {} ({})", bus.name, bus.interface);
    drv_link_t link{};
    const int code = drv_link_read(bus.interface.c_str(), &link);
    if (code == -ENODEV) {
        const std::vector<std::string> there = can_interfaces();
        out.missing(what, "no such interface; CAN interfaces: " + (there.empty() ? "none" : list_names(there)),
                    fmt::format("plug the adapter in, or sudo ip link add {0} type vcan && sudo ip link set {0} up",
                                bus.interface));
        return;
    }
    if (code != 0) {
        out.note(what, fmt::format("netlink reports nothing about it ({})", std::strerror(-code)));
        return;
    }
    bool first = true;
    for (const link_finding& each : judge_link(bus, link)) {
        if (each.missing)
            out.missing(what, each.found, each.remedy);
        else if (first)
            out.well(what, each.found);
        else
            out.note(what, each.found + (each.remedy.empty() ? "" : "; " + each.remedy));
        first = false;
    }
}

void check_line(findings& out, const bus_config& bus) {
    const std::string what = fmt::format("bus {} ({})", bus.name, bus.type);
    const line_finding seen = look_at_line(bus);
    if (!seen.remedy.empty())
        out.missing(what, seen.found, seen.remedy);
    else
        out.well(what, seen.found);
    if (!seen.note.empty()) out.note(what, seen.note);
}

void check_buses(findings& out, const std::optional<live_config>& config, bool kernel_has_can) {
    if (!config) {
        const std::vector<std::string> there = can_interfaces(), usb = usb_adapters();
        if (!there.empty())
            out.well("CAN interfaces", list_names(there));
        else if (kernel_has_can)
            out.missing("CAN interfaces", "none",
                        "plug an adapter in, or sudo ip link add vcan0 type vcan && sudo ip link set vcan0 up");
        if (!usb.empty()) out.well("USB adapters with CAN", list_names(usb));
        return;
    }
    for (const bus_config& bus : config->buses) {
        if (bus.type == "socketcan" && kernel_has_can) check_interface(out, bus);
        if (bus.on_line()) check_line(out, bus);
        if (bus.type != "replay") continue;
        const std::string what = fmt::format("bus {} (replay)", bus.name);
        if (access(bus.file.c_str(), R_OK) == 0)
            out.well(what, bus.file);
        else
            out.missing(what, fmt::format("{}: {}", bus.file, std::strerror(errno)),
                        "put the log there, or correct file in the [[bus]]");
    }
}

/// Trigger and lamps; without a config only whether there are chips.
void check_lines(findings& out, const std::optional<live_config>& config) {
    if (!config) {
        char chips[512];
        if (drv_gpio_list_chips(chips, sizeof chips) > 0) out.note("GPIO chips", chips);
        return;
    }
    const auto check = [&](const std::string& what, const gpio_place& place, bool output, drv_gpio_edge_t edge) {
        std::string remedy;
        const std::string fault = gpio_fault(place, output, edge, remedy);
        if (fault.empty())
            out.well(what, place.text());
        else
            out.missing(what, fault, remedy);
    };
    if (config->trigger.source == trigger_source::gpio)
        check("trigger line", config->trigger.place, false, config->trigger.edge);
    if (config->lamps.armed) check("lamp armed", *config->lamps.armed, true, DRV_GPIO_NO_EDGE);
    if (config->lamps.go) check("lamp go", *config->lamps.go, true, DRV_GPIO_NO_EDGE);
    if (config->lamps.alarm) check("lamp alarm", *config->lamps.alarm, true, DRV_GPIO_NO_EDGE);
}

void check_buffers(findings& out) {
    const bool admin = has_capability(cap_net_admin);
    const long long limit = std::atoll(first_line("/proc/sys/net/core/rmem_max").c_str());
    if (limit >= wanted_buffer)
        out.well("receive buffer", fmt::format("net.core.rmem_max is {} bytes", limit));
    else if (admin)
        out.well("receive buffer",
                 fmt::format("rmem_max is {} bytes, but CAP_NET_ADMIN lets okid take {}", limit, wanted_buffer));
    else
        out.missing("receive buffer",
                    fmt::format("net.core.rmem_max is {} bytes, expected {}: bursts may be lost", limit, wanted_buffer),
                    fmt::format("sudo sysctl -w net.core.rmem_max={0} (keep it: echo net.core.rmem_max={0} | sudo tee "
                                "/etc/sysctl.d/60-okid.conf)",
                                wanted_buffer));
    if (in_path("candump") && in_path("canplayer"))
        out.well("can-utils", "candump and canplayer are there");
    else
        out.missing("can-utils", "candump and canplayer were not found (recording and playing logs)",
                    "sudo apt-get install can-utils");
}

void check_clock(findings& out) {
    const std::string clock = first_line("/sys/devices/system/clocksource/clocksource0/current_clocksource");
    const std::string others = first_line("/sys/devices/system/clocksource/clocksource0/available_clocksource");
    const bool slow = clock == "hpet" || clock == "acpi_pm" || clock == "jiffies";
    const std::string found = clock + " is slow to read; time stamps of the kernel are coarser than with tsc";
    if (clock.empty())
        out.note("clock", "the kernel does not report its clock source");
    else if (slow && (" " + others + " ").find(" tsc ") != std::string::npos)
        out.note("clock", found,
                 "echo tsc | sudo tee /sys/devices/system/clocksource/clocksource0/current_clocksource");
    else if (slow)
        out.note("clock", found + "; the kernel found tsc unstable, dmesg | grep -i tsc shows why");
    else
        out.well("clock", clock);
}

/// The reader comes before everything that computes, where it may.
void check_priority(findings& out, const realtime_config& wanted) {
    const auto reader_priority = static_cast<rlim_t>(wanted.priority);
    if (reader_priority == 0) return;
    rlimit limit{};
    const bool allowed = getrlimit(RLIMIT_RTPRIO, &limit) == 0 && limit.rlim_cur >= reader_priority;
    if (allowed || has_capability(cap_sys_nice))
        out.well("real-time priority", fmt::format("the reader may run at {}", reader_priority));
    else
        out.note("real-time priority",
                 fmt::format("RLIMIT_RTPRIO is {}, expected {}: under load the reader waits for others", limit.rlim_cur,
                             reader_priority),
                 "echo \"$USER - rtprio 20\" | sudo tee /etc/security/limits.d/60-okid.conf, then log in again (a "
                 "service: LimitRTPRIO=20)");
}

/// As much memory may be locked as [realtime] lock_memory asks for.
void check_memory(findings& out, const realtime_config& wanted) {
    if (!wanted.lock_memory) return;
    rlimit limit{};
    const bool allowed = getrlimit(RLIMIT_MEMLOCK, &limit) == 0 && limit.rlim_cur == RLIM_INFINITY;
    if (allowed || has_capability(cap_ipc_lock))
        out.well("locked memory", "without limit");
    else
        out.missing("locked memory", fmt::format("RLIMIT_MEMLOCK is {} bytes, expected no limit", limit.rlim_cur),
                    "echo \"$USER - memlock unlimited\" | sudo tee -a /etc/security/limits.d/60-okid.conf, then log in "
                    "again (a service: LimitMEMLOCK=infinity)");
}

void check_governor(findings& out) {
    const std::string governor = first_line("/sys/devices/system/cpu/cpu0/cpufreq/scaling_governor");
    if (governor == "powersave" && first_line("/sys/devices/system/cpu/cpu0/cpufreq/scaling_driver") != "intel_pstate")
        out.note("CPU governor", "powersave keeps the processor at its lowest clock",
                 "echo performance | sudo tee /sys/devices/system/cpu/cpu*/cpufreq/scaling_governor");
    else if (!governor.empty())
        out.well("CPU governor", governor);
}

} // namespace

std::string left_out() {
    std::string out;
#ifdef OKID_PORTABLE
    out += ", without GPIO lines, okid bench";
#endif
#ifndef OKID_MQTT
    out += out.empty() ? ", without MQTT" : ", MQTT";
#endif
#ifndef OKID_PROMETHEUS
    out += out.empty() ? ", without Prometheus" : ", Prometheus";
#endif
    return out;
}

findings examine(const std::optional<live_config>& config) {
    findings out;
    const std::string lacks = left_out();
    if (!lacks.empty())
        out.note("build", "this okid is" + lacks.substr(1), "the Debian packages and make build have them");
    const bool wants_can = !config || std::any_of(config->buses.begin(), config->buses.end(),
                                                  [](const bus_config& b) { return b.type == "socketcan"; });
    const bool kernel_has_can = wants_can && check_kernel(out);
    check_buses(out, config, kernel_has_can);
    check_lines(out, config);
    if (wants_can) check_buffers(out);
    const realtime_config realtime = config ? config->realtime : realtime_config{};
    check_priority(out, realtime);
    check_processors(out, realtime);
    check_memory(out, realtime);
    if (config) check_outputs(out, *config);
    check_clock(out);
    check_governor(out);
    check_blas(out);
    return out;
}

void add_doctor(CLI::App& app) {
    auto path = std::make_shared<std::string>();
    CLI::App* command =
        app.add_subcommand("doctor", "Check this machine for a live measurement: what is missing, and how to fix it");
    command->add_option("config", *path, "also look at the buses of this file")->type_name("CONFIG.toml");
    command->footer(
        "Exit 0: all well. 2: the config is wrong. 4: something is missing.\n\nExample:\n  okid doctor frame.toml");
    command->callback([path] {
        std::optional<live_config> config;
        if (!path->empty()) config = load_config(*path);
        const findings found = examine(config);
        fmt::print("{}", found.text());
        if (found.count() > 0)
            throw failure(exit_device,
                          fmt::format("{} thing{} missing, see above", found.count(), found.count() == 1 ? "" : "s"));
    });
}

} // namespace okid_host
