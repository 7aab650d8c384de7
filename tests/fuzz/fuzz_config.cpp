// SPDX-License-Identifier: MIT
// Any text as CONFIG.toml: a configuration that holds together, or a refusal.
#include "config/config.hpp"
#include "text_file.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    const std::string path = okid_fuzz::file_of(data, size);
    return okid_fuzz::expect_value_or_refusal([&] {
        const okid_host::live_config config = okid_host::load_config(path);
        if (!(config.rate_hz > 0) || config.buses.empty() || config.n_u + config.n_y > config.channels.size())
            std::abort();
        for (const okid_host::channel_config& channel : config.channels)
            if (channel.bus >= config.buses.size()) std::abort();
    });
}
