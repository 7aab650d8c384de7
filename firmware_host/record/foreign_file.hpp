// SPDX-License-Identifier: MIT
// Records in formats that okid-convert reads (MAT, universal files, MDF4, TDMS, HDF5, WAV ...): it makes tables of them.
#pragma once
#include <string>

namespace okid_host {

/// A name that ends like one of those formats: what is neither a CSV nor a .npy.
bool is_foreign(const std::string& path);

/// The samples of such a file as a CSV, whose folder is removed when the program ends; made once for each file and group.
/// What okid-convert remarks goes to stderr.
/// @param group  part of a file with several rasters, "" = it has one
/// Throws `failure` (exit 2) with the reason of okid-convert, or where it is not installed.
std::string table_of(const std::string& path, const std::string& group);

/// `text` with the name of the file in place of the table's.
std::string about_file(std::string text, const std::string& path, const std::string& table);

} // namespace okid_host
