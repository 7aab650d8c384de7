// SPDX-License-Identifier: MIT
// Two numeric keys of a CONFIG.toml at their documented ends and beyond: a configuration, or a refusal in one line.
#include "config/config.hpp"
#include "config_numbers.hpp"
#include "text_file.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    if (size < 4) return 0;
    static const std::vector<okid_host::number_key> keys = okid_host::number_keys();
    const okid_host::number_key& first = keys[data[0] % keys.size()];
    const okid_host::number_key& second = keys[data[2] % keys.size()];
    const std::string value = okid_test::number_text(second, data[3]);
    std::string text = okid_test::config_with_number(first, okid_test::number_text(first, data[1]));
    const std::string head =
        second.many ? fmt::format("[[{}]]\n", second.section) : fmt::format("[{}]\n", second.section);
    const std::size_t at = text.find(head);
    const std::string line = fmt::format("{} = {}\n", second.key, value);
    text = at == std::string::npos ? text + head + line : text.insert(at + head.size(), line);
    const std::string path = okid_fuzz::file_of(reinterpret_cast<const std::uint8_t*>(text.data()), text.size());
    return okid_fuzz::expect_value_or_refusal([&] {
        const okid_host::live_config config = okid_host::load_config(path);
        if (!(config.rate_hz > 0) || !(config.identification.update_s > 0)) std::abort();
    });
}
