// SPDX-License-Identifier: MIT
// A record as NumPy's save() writes it: an array of samples × channels, its columns called c1, c2, …
#pragma once
#include "csv.hpp"

namespace okid_host {

bool is_npy(const std::string& path); ///< a name that ends in .npy

/// As read_csv(); there is no rate in the file.
csv_record read_npy(const std::string& path, const csv_request& request);
std::vector<std::string> read_npy_columns(const std::string& path);

} // namespace okid_host
