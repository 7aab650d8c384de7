// SPDX-License-Identifier: MIT
// PURPOSE  numbers to text of ten significant digits
// METHOD   the number times a power of ten is a whole number of ten digits and a rest. That product is off by less than 2e-6:
//          where the rest is farther than that from one half, and the whole number not at an edge, its rounding is certain;
//          fmt writes the others, one in 50,000, and all that need an exponent
#include "decimal_text.hpp"

#include <array>
#include <cmath>
#include <cstdint>
#include <fmt/format.h>
#include <iterator>

namespace okid_host {
namespace {

constexpr int digits = 10;
constexpr double powers[] = {1e0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e10, 1e11, 1e12, 1e13};
constexpr double uncertain = 1e-5;

/// The ten digits of a size from 1e-4 to below 1e10 and how many of them stand before the point; false: not certain.
bool ten_digits(double size, std::uint64_t& whole, int& before) {
    before = size >= 1 ? 1 : size >= 1e-1 ? 0 : size >= 1e-2 ? -1 : size >= 1e-3 ? -2 : -3;
    while (before > 0 && before < digits && size >= powers[before]) ++before;
    const double product = size * powers[digits - before], floor = std::floor(product), rest = product - floor;
    whole = static_cast<std::uint64_t>(floor) + (rest > 0.5);
    return std::abs(rest - 0.5) > uncertain && whole >= 1000000000 && whole <= 9999999999;
}

} // namespace

void append_ten_digits(std::string& text, double value) {
    const double size = std::abs(value);
    std::uint64_t whole = 0;
    int before = 0;
    if (!(size >= 1e-4 && size < 1e10) || !ten_digits(size, whole, before)) {
        fmt::format_to(std::back_inserter(text), "{:.10g}", value);
        return;
    }
    std::array<char, digits + 8> out{}; // sign, "0.000", digits
    char* at = out.data();
    if (value < 0) *at++ = '-';
    if (before <= 0) {
        *at++ = '0';
        *at++ = '.';
        for (int k = before; k < 0; ++k) *at++ = '0';
    }
    std::array<char, digits> figures{};
    for (int k = digits; k-- > 0; whole /= 10)
        figures[static_cast<std::size_t>(k)] = static_cast<char>('0' + whole % 10);
    int count = digits;
    while (count > 1 && count > before && figures[static_cast<std::size_t>(count - 1)] == '0') --count;
    for (int k = 0; k < count; ++k) {
        if (k == before && before > 0) *at++ = '.';
        *at++ = figures[static_cast<std::size_t>(k)];
    }
    text.append(out.data(), static_cast<std::size_t>(at - out.data()));
}

} // namespace okid_host
