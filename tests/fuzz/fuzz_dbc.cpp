// SPDX-License-Identifier: MIT
// Any text as a DBC.
#include "config/dbc.hpp"
#include "text_file.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    const std::string path = okid_fuzz::file_of(data, size);
    return okid_fuzz::expect_value_or_refusal([&] { (void)okid_host::read_dbc(path); });
}
