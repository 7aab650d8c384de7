// SPDX-License-Identifier: MIT
#include "memory_bound.hpp"

#include "error.hpp"
#include "nearest_name.hpp"

#include <charconv>
#include <cstdlib>
#include <cstring>
#include <fmt/format.h>

namespace okid_host {
namespace {

constexpr double default_mb = 8192, most_mb = 1e6, samples_of_it = 4; // one part in four
constexpr const char* variable = "OKID_MAX_MEMORY_MB";

double max_memory_mb() {
    const char* text = std::getenv(variable);
    if (!text || *text == '\0') return default_mb;
    double value = 0;
    const char* const end = text + std::strlen(text);
    const auto [stop, error] = std::from_chars(text, end, value);
    if (error != std::errc{} || stop != end || !(value > 0 && value <= most_mb))
        throw failure(exit_usage, fmt::format("{} is \"{}\", expected a number of MB above 0 to {:g}", variable,
                                              printable(std::string(text)), most_mb));
    return value;
}

} // namespace

bool samples_fit(std::size_t rows, std::size_t columns) {
    return 8e-6 * static_cast<double>(rows) * static_cast<double>(columns) <= max_memory_mb() / samples_of_it;
}

void require_samples(const std::string& path, std::size_t rows, std::size_t columns) {
    if (samples_fit(rows, columns)) return;
    const double wanted = 8e-6 * static_cast<double>(rows) * static_cast<double>(columns);
    const double limit = max_memory_mb();
    throw failure(exit_usage, fmt::format("{}: {} samples of {} channels take {:.0f} MB, at most {:.0f} MB are read (a "
                                          "quarter of max_memory_mb = {:g}; {} sets it)",
                                          path, rows, columns, wanted, limit / samples_of_it, limit, variable));
}

} // namespace okid_host
