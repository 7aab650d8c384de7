// SPDX-License-Identifier: MIT
// The files of samples that a user named: CSV, .npy, and what okid-convert reads (MAT, universal files, MDF4, HDF5, WAV ...).
#pragma once
#include "record/csv.hpp"

#include <map>
#include <memory>
#include <string>
#include <vector>

namespace okid_host {

/// What okid-convert makes of a file. It has no name, so it ends with this process, however that ends.
class nameless_table {
  public:
    /// @param quiet  without notes on what was taken for what
    nameless_table(const std::string& path, const std::string& group, bool quiet); ///< throws `failure` (exit 2 or 130)
    ~nameless_table();
    nameless_table(const nameless_table&) = delete;
    nameless_table& operator=(const nameless_table&) = delete;

    std::string path() const; ///< of its descriptor
    /// Lines of okid-convert on what it took for what; nothing the second time.
    std::string take_remarks();

  private:
    int fd_ = -1;
    std::string remarks_;
};

/// Reads them; of another format than CSV and .npy, and of a text that another program may have written, the table that
/// okid-convert makes, once for each file. What it remarks goes to stderr. Messages name the file of the user. Throws `failure` (exit 2): that of read_csv(), the reason of okid-convert, or that
/// it is not installed.
class record_files {
  public:
    /// @param group  part of files with several rasters, "" = they have one
    explicit record_files(std::string group) : group_(std::move(group)) {}

    std::vector<std::string> columns(const std::string& path);
    csv_record read(const std::string& path, const csv_request& request);

  private:
    template <class Read> auto as_table(const std::string& path, Read reader);
    template <class Read> auto from_table(const std::string& path, Read reader, bool quiet);

    std::string group_;
    std::map<std::string, std::unique_ptr<nameless_table>> tables_;
};

} // namespace okid_host
