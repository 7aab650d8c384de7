// SPDX-License-Identifier: MIT
#include "gpio_lines.hpp"

#include "error.hpp"
#include "files/nearest_name.hpp"

#include <cerrno>
#include <fmt/format.h>

namespace okid_host {
namespace {

std::string remedy_for(int code) {
    switch (code) {
    case EACCES:
        return "run with sudo, or for good: sudo groupadd -f -r gpio && sudo usermod -aG gpio $USER, put "
               "packaging/60-okid-gpio.rules into /etc/udev/rules.d, sudo udevadm control --reload, sudo udevadm "
               "trigger --subsystem-match=gpio, and log in again";
    case EBUSY: return "end the program that has it (gpioinfo names it), or choose another line";
    case ENOTTY: return "plug the GPIO adapter in or load its driver (gpiodetect lists the chips)";
    case ENODEV: return "choose a line of a chip with interrupts, or [trigger] source = \"level\"";
    default: return "correct chip and line (gpiodetect and gpioinfo list them)";
    }
}

/// Take a line. @return 0 or -errno with line.error
int open_line(drv_gpio_t& line, const gpio_place& place, bool output, drv_gpio_edge_t edge) {
    drv_gpio_config_t config = place.driver();
    config.edge = edge;
    return output ? drv_gpio_open_output(&line, &config) : drv_gpio_open_input(&line, &config);
}

void release(drv_gpio_t* line) {
    drv_gpio_close(line);
    delete line;
}

} // namespace

gpio_lines::gpio_lines(const live_config& config)
    : trigger_(nullptr, release), armed_(nullptr, release), go_(nullptr, release), alarm_(nullptr, release) {
    const auto take = [&](line& to, const gpio_place& place, bool output, drv_gpio_edge_t edge) {
        line fresh(new drv_gpio_t{}, release);
        const int code = open_line(*fresh, place, output, edge);
        if (code != 0)
            throw failure(exit_device, fmt::format("{}. What to do: {}", printable(fresh->error, DRV_ERROR_BYTES),
                                                   remedy_for(-code)));
        to = std::move(fresh);
    };
    const trigger_config& wanted = config.trigger;
    if (wanted.source == trigger_source::gpio) take(trigger_, wanted.place, false, wanted.edge);
    if (config.lamps.armed) take(armed_, *config.lamps.armed, true, DRV_GPIO_NO_EDGE);
    if (config.lamps.go) take(go_, *config.lamps.go, true, DRV_GPIO_NO_EDGE);
    if (config.lamps.alarm) take(alarm_, *config.lamps.alarm, true, DRV_GPIO_NO_EDGE);
}

gpio_lines::~gpio_lines() { show({}); }

void gpio_lines::read_edges(stream_target& live) {
    drv_gpio_event_t events[16];
    const int count = drv_gpio_read(trigger_.get(), events, 16);
    if (count < 0) throw failure(exit_device, printable(trigger_->error, DRV_ERROR_BYTES));
    if (count > 0) live.trigger_edge(events[0].time_ns);
}

void gpio_lines::show(const lamp_state& state) {
    const auto set = [](const line& lamp, bool shown, bool wanted) {
        if (lamp && shown != wanted) (void)drv_gpio_set(lamp.get(), wanted); // a lamp that broke ends no measurement
    };
    set(armed_, shown_.armed, state.armed);
    set(go_, shown_.go, state.go);
    set(alarm_, shown_.alarm, state.alarm);
    shown_ = state;
}

void gpio_lines::serve(stream_target& live) {
    if (trigger_ && !live.triggered()) read_edges(live);
    show(live.lamps());
}

std::string gpio_fault(const gpio_place& place, bool output, drv_gpio_edge_t edge, std::string& remedy) {
    drv_gpio_t line{};
    const int code = open_line(line, place, output, edge);
    const std::string found = code ? printable(line.error, DRV_ERROR_BYTES) : "";
    if (code) remedy = remedy_for(-code);
    drv_gpio_close(&line);
    return found;
}

} // namespace okid_host
