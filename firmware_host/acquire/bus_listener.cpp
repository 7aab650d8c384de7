// SPDX-License-Identifier: MIT
#include "bus_listener.hpp"

#include "reader.hpp"

namespace okid_host {

bus_listener::bus_listener(const bus_config& wanted, std::size_t bus) : bus_(static_cast<std::uint8_t>(bus)) {
    source_.ops = &drv_source_socketcan;
    drv_source_config_t config{};
    name_interface(wanted, config);
    open_ = source_.ops->open(&source_, &config) == 0;
}

bus_listener::~bus_listener() { source_.ops->close(&source_); }

void bus_listener::take(stream_check& check) {
    constexpr int most_batches = 8;
    for (int batch = 0; open_ && batch < most_batches; ++batch) {
        const int count = source_.ops->read(&source_, frames_.data(), static_cast<int>(frames_.size()));
        for (int i = 0; i < count; ++i) {
            frames_[static_cast<std::size_t>(i)].bus = bus_;
            check.overhear(frames_[static_cast<std::size_t>(i)]);
        }
        if (count < static_cast<int>(frames_.size())) return;
    }
}

} // namespace okid_host
