// SPDX-License-Identifier: MIT
#include "segment_file.hpp"

#include "error.hpp"

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <fcntl.h>
#include <filesystem>
#include <fmt/format.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <unistd.h>

namespace okid_host {
namespace {

namespace fs = std::filesystem;

constexpr const char* unfinished = ".part"; // behind the name until the first chunks are on the disk
constexpr std::size_t longest_stem = 60;

std::string folder_of(const std::string& path) {
    const fs::path parent = fs::path(path).parent_path();
    return parent.empty() ? "." : parent.string();
}

/// A new name is on the disk only when its folder is.
void sync_folder(const std::string& folder) {
    const int fd = open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    if (fd < 0) return;
    (void)fsync(fd);
    close(fd);
}

/// A rename that replaces nothing; some file systems do not know it. The C library has renameat2() from 2.28 on only.
int rename_new(const std::string& from, const std::string& to) {
    constexpr unsigned noreplace = 1; // RENAME_NOREPLACE
    if (syscall(SYS_renameat2, AT_FDCWD, from.c_str(), AT_FDCWD, to.c_str(), noreplace) == 0) return 0;
    if (errno != EINVAL && errno != ENOSYS) return errno;
    if (access(to.c_str(), F_OK) == 0) return EEXIST;
    return std::rename(from.c_str(), to.c_str()) == 0 ? 0 : errno;
}

struct journal_entry {
    std::string path;
    std::uint64_t bytes;
    timespec written;
};

bool is_ours(const std::string& path) {
    const int fd = open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NOFOLLOW | O_NONBLOCK);
    if (fd < 0) return false;
    std::uint8_t first[DRV_JOURNAL_MAGIC];
    const bool ours = read(fd, first, sizeof first) == sizeof first && drv_journal_magic(first);
    close(fd);
    return ours;
}

/// Is no program writing to it?
bool is_idle(const std::string& path) {
    const int fd = open(path.c_str(), O_RDONLY | O_CLOEXEC);
    if (fd < 0) return false;
    const bool idle = flock(fd, LOCK_EX | LOCK_NB) == 0;
    close(fd);
    return idle;
}

/// The journals of okid in a folder, the oldest first.
std::vector<journal_entry> journals_of(const std::string& folder) {
    std::vector<journal_entry> out;
    std::error_code ignored;
    for (const auto& entry : fs::directory_iterator(folder, ignored)) {
        const std::string path = entry.path().string();
        const std::string ending = entry.path().extension().string();
        struct stat status{};
        if ((ending != ".okj" && ending != unfinished) || lstat(path.c_str(), &status) != 0 ||
            !S_ISREG(status.st_mode) || !is_ours(path))
            continue;
        out.push_back({path, static_cast<std::uint64_t>(status.st_blocks) * 512, status.st_mtim});
    }
    std::sort(out.begin(), out.end(), [](const journal_entry& a, const journal_entry& b) {
        if (a.written.tv_sec != b.written.tv_sec) return a.written.tv_sec < b.written.tv_sec;
        if (a.written.tv_nsec != b.written.tv_nsec) return a.written.tv_nsec < b.written.tv_nsec;
        return a.path < b.path;
    });
    return out;
}

} // namespace

int segment_file::create(const std::string& final_path) {
    close();
    path_ = final_path;
    published_ = false;
    fd_ = open((path_ + unfinished).c_str(), O_WRONLY | O_CREAT | O_EXCL | O_APPEND | O_CLOEXEC, 0644);
    if (fd_ < 0) return errno;
    (void)flock(fd_, LOCK_EX | LOCK_NB); // tells others that it is being written
    return 0;
}

int segment_file::publish() {
    if (fsync(fd_) != 0) return errno;
    const int reason = rename_new(path_ + unfinished, path_);
    if (reason) return reason;
    published_ = true;
    sync_folder(folder_of(path_));
    return 0;
}

void segment_file::close() {
    if (fd_ < 0) return;
    ::close(fd_);
    fd_ = -1;
    if (!published_) unlink((path_ + unfinished).c_str());
}

int segment_file::sync() { return fdatasync(fd_) == 0 ? 0 : errno; }

drv_journal_sink_t segment_file::sink() { return {write_bytes, cut, this}; }

long segment_file::write_bytes(void* self, const std::uint8_t* bytes, std::size_t count) {
    const ssize_t wrote = write(static_cast<segment_file*>(self)->fd_, bytes, count);
    return wrote < 0 ? -errno : static_cast<long>(wrote);
}

int segment_file::cut(void* self, std::uint64_t size) {
    return ftruncate(static_cast<segment_file*>(self)->fd_, static_cast<off_t>(size)) == 0 ? 0 : -errno;
}

std::string name_stem(const std::string& title) {
    std::string out;
    for (const char c : title) {
        const bool plain = (c >= '0' && c <= '9') || (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || c == '_';
        if (plain)
            out += c;
        else if (!out.empty() && out.back() != '-')
            out += '-';
    }
    out.resize(std::min(out.size(), longest_stem));
    while (!out.empty() && out.back() == '-') out.pop_back();
    return out.empty() ? "okid" : out;
}

std::vector<std::string> make_room(const std::string& folder, std::uint64_t wanted, std::uint64_t most) {
    std::vector<std::string> deleted;
    const std::vector<journal_entry> journals = journals_of(folder);
    std::uint64_t used = 0;
    for (const journal_entry& one : journals) used += one.bytes;
    for (const journal_entry& one : journals) {
        if (used + wanted <= most) break;
        if (!is_idle(one.path) || unlink(one.path.c_str()) != 0) continue;
        used -= one.bytes;
        deleted.push_back(one.path);
    }
    return deleted;
}

bool has_segments(const std::string& base) {
    std::error_code ignored;
    const std::string beginning = fs::path(base).filename().string() + "-";
    constexpr std::size_t rest = sizeof "0001.okj" - 1;
    for (const auto& entry : fs::directory_iterator(folder_of(base), ignored)) {
        const std::string name = entry.path().filename().string();
        if (name.size() == beginning.size() + rest && name.rfind(beginning, 0) == 0) return true;
    }
    return false;
}

void prepare_folder(const std::string& folder) {
    std::error_code error;
    fs::create_directories(folder, error);
    const int reason = error ? error.value() : access(folder.c_str(), W_OK | X_OK) == 0 ? 0 : errno;
    if (reason)
        throw failure(exit_usage, fmt::format("{}: journals cannot be written there: {}; choose another folder with "
                                              "[record] directory or --directory",
                                              folder, std::strerror(reason)));
}

} // namespace okid_host
