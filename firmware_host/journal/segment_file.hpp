// SPDX-License-Identifier: MIT
// A segment of a recording as a file: its name appears when its first chunks are on the disk, never over another file;
// the folder is kept below its limit by giving up the oldest journals in it.
#pragma once
#include <drv/journal.h>

#include <cstdint>
#include <string>
#include <vector>

namespace okid_host {

class segment_file {
  public:
    ~segment_file() { close(); }
    segment_file() = default;
    segment_file(const segment_file&) = delete;
    segment_file& operator=(const segment_file&) = delete;

    /// A nameless beginning in the folder, to be written to. @return 0 or a positive errno
    int create(const std::string& final_path);
    /// Everything so far onto the disk, then the name. @return 0, EEXIST when there is such a file, another errno
    int publish();
    void close();
    /// What has been written so far is to be on the disk. @return 0 or a positive errno
    int sync();

    int fd() const { return fd_; }
    const std::string& path() const { return path_; }
    drv_journal_sink_t sink();

  private:
    static long write_bytes(void* self, const std::uint8_t* bytes, std::size_t count);
    static int cut(void* self, std::uint64_t size);

    int fd_ = -1;
    bool published_ = false;
    std::string path_;
};

/// Letters, digits, '-' and '_' of a title, for a file name.
std::string name_stem(const std::string& title);

/// Does BASE-NNNN.okj exist for any number?
bool has_segments(const std::string& base);

/// Delete the oldest journals of okid in a folder, none that is being written, until `wanted` bytes more are below
/// `most`.
/// @return the files deleted
std::vector<std::string> make_room(const std::string& folder, std::uint64_t wanted, std::uint64_t most);

/// Make the folder if need be. Throws `failure` (exit 2) when it cannot be written to.
void prepare_folder(const std::string& folder);

} // namespace okid_host
