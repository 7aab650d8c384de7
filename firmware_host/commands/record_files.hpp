// SPDX-License-Identifier: MIT
// The files of samples that a user named: CSV, .npy, and what okid-convert reads (MAT, universal files, MDF4, HDF5, WAV ...).
#pragma once
#include "record/csv.hpp"

#include <map>
#include <string>
#include <vector>

namespace okid_host {

/// A folder of our own that goes with its content.
class own_folder {
  public:
    own_folder(); ///< throws `failure` (exit 2)
    ~own_folder();
    own_folder(const own_folder&) = delete;
    own_folder& operator=(const own_folder&) = delete;

    std::string table() const { return path_ + "/samples.csv"; }

  private:
    std::string path_;
};

/// Reads them; of another format than CSV and .npy the table that okid-convert makes, once for each file. What it remarks goes to
/// stderr. Messages name the file of the user. Throws `failure` (exit 2): that of read_csv(), the reason of okid-convert, or that
/// it is not installed.
class record_files {
  public:
    /// @param group  part of files with several rasters, "" = they have one
    explicit record_files(std::string group) : group_(std::move(group)) {}

    std::vector<std::string> columns(const std::string& path);
    csv_record read(const std::string& path, const csv_request& request);

  private:
    template <class Read> auto as_table(const std::string& path, Read reader);
    std::string table_of(const std::string& path);

    std::string group_;
    std::map<std::string, own_folder> tables_;
};

} // namespace okid_host
