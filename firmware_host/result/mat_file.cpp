// SPDX-License-Identifier: MIT
#include "mat_file.hpp"

#include <cstdint>
#include <cstring>

namespace okid_host {
namespace {

void put_int32(std::string& out, std::int32_t value) {
    for (int byte = 0; byte < 4; ++byte)
        out += static_cast<char>(static_cast<std::uint32_t>(value) >> (8 * byte) & 0xff);
}

void put_double(std::string& out, double value) {
    std::uint64_t bits = 0;
    std::memcpy(&bits, &value, sizeof bits);
    for (int byte = 0; byte < 8; ++byte) out += static_cast<char>(bits >> (8 * byte) & 0xff);
}

/// Header of five integers (type 0: little-endian, double, full), the name with its NUL, the numbers column by column.
void put_matrix(std::string& out, const char* name, const double* values, int rows, int columns) {
    if (!values) rows = columns = 0;
    put_int32(out, 0);
    put_int32(out, rows);
    put_int32(out, columns);
    put_int32(out, 0);
    put_int32(out, static_cast<std::int32_t>(std::strlen(name) + 1));
    out.append(name, std::strlen(name) + 1);
    for (std::ptrdiff_t i = 0; i < static_cast<std::ptrdiff_t>(rows) * columns; ++i) put_double(out, values[i]);
}

} // namespace

std::string mat_file(const okid_identified_t& model) {
    std::string out;
    put_matrix(out, "A", model.A, model.n_z, model.n_z);
    put_matrix(out, "B", model.B, model.n_z, model.n_u);
    put_matrix(out, "C", model.C, model.n_y, model.n_z);
    put_matrix(out, "D", model.D, model.n_y, model.n_u);
    put_matrix(out, "K", model.K, model.n_z, model.n_y);
    put_matrix(out, "dt", &model.dt, 1, 1);
    return out;
}

} // namespace okid_host
