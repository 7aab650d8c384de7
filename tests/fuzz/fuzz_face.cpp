// SPDX-License-Identifier: MIT
// The C face of libokid_host on any text: a configuration, a CSV record, names with units. A call gives 0 or 2, a handle or
// none, and a sentence where it refuses; what it gives can be asked for and deleted.
#include "error.hpp"
#include "text_file.hpp"

#include <array>
#include <nlohmann/json.hpp>
#include <okid_host/files.h>

namespace {

void expect(bool that) {
    if (!that) std::abort();
}

void expect_answer(std::int32_t code, const void* handle) {
    expect(code == okid_host::exit_ok || code == okid_host::exit_usage);
    expect((handle != nullptr) == (code == okid_host::exit_ok));
    expect(code == okid_host::exit_ok || okid_host_error()[0] != '\0');
}

void config(const std::string& text) {
    okid_host_config_t* made = nullptr;
    expect_answer(okid_host_config_load("c.toml", text.c_str(), &made), made);
    if (made) expect(nlohmann::json::parse(okid_host_config_json(made)).is_object());
    okid_host_config_delete(made);
}

void record(const std::string& text) {
    okid_host_csv_t* made = nullptr;
    const std::string path = okid_fuzz::file_of(reinterpret_cast<const std::uint8_t*>(text.data()), text.size());
    expect_answer(okid_host_csv_read(path.c_str(), &made), made);
    if (made) {
        std::size_t rows = 0, columns = 0;
        const double* samples = okid_host_csv_samples(made, &rows, &columns);
        double sum = 0;
        for (std::size_t k = 0; k < rows * columns; ++k) sum += samples[k]; // every one of them is there
        volatile double kept = sum;
        (void)kept;
        expect(nlohmann::json::parse(okid_host_csv_json(made))["names"].size() == columns);
    }
    okid_host_csv_delete(made);
}

void unit(const std::string& text) {
    std::array<char, 8> found{};
    const std::size_t length = okid_host_unit_of_name(text.c_str(), found.data(), found.size());
    expect(std::strlen(found.data()) <= std::min(length, found.size() - 1));
    double factor = 0;
    const char* si = nullptr;
    expect(okid_host_unit(text.c_str(), &factor, &si) == 0 || (factor > 0 && si != nullptr));
}

} // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    if (size == 0) return 0;
    const std::string text(reinterpret_cast<const char*>(data + 1), size - 1);
    switch (data[0] % 3) {
    case 0: config(text); break;
    case 1: record(text); break;
    default: unit(text);
    }
    return 0;
}
