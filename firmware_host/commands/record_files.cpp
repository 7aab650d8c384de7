// SPDX-License-Identifier: MIT
// PURPOSE  records of any format that the Python package reads
// METHOD   okid-convert is started, without a shell, from the folder of this program or from PATH; it writes into a folder that
//          no other user may enter and that is gone when it ends: the table lives on without a name. A signal to stop ends it first
#include "record_files.hpp"

#include "acquire/stop_signal.hpp"
#include "error.hpp"
#include "files/input_file.hpp"
#include "files/nearest_name.hpp"
#include "record/csv_header.hpp"
#include "record/foreign_table.hpp"

#include <algorithm>
#include <array>
#include <cerrno>
#include <csignal>
#include <cstdlib>
#include <cstring>
#include <fcntl.h>
#include <filesystem>
#include <fmt/format.h>
#include <poll.h>
#include <spawn.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>
#include <utility>
#include <vector>

extern char** environ;

namespace okid_host {
namespace {

constexpr std::array foreign_endings{".mat",  ".uff",     ".unv", ".mf4",  ".tdms", ".h5",
                                     ".hdf5", ".parquet", ".wav", ".flac", ".mcap", ".lvm"};
constexpr const char* converter = "okid-convert";
constexpr std::size_t longest_reason = 65536;

/// Of the owner of this program, of root or of this user: a program in a folder for all has strangers beside it.
bool of_a_known_owner(const std::filesystem::path& path) {
    struct stat here{}, own{};
    return lstat(path.c_str(), &here) == 0 && stat("/proc/self/exe", &own) == 0 &&
           (here.st_uid == 0 || here.st_uid == geteuid() || here.st_uid == own.st_uid);
}

/// Where it may stand: beside this program, in the .venv that `make build` makes beside its folder, in PATH.
std::string find_converter() {
    std::error_code fault;
    std::vector<std::filesystem::path> folders;
    if (const auto program = std::filesystem::read_symlink("/proc/self/exe", fault); !fault)
        for (const auto& folder : {program.parent_path(), program.parent_path().parent_path() / ".venv/bin"})
            if (of_a_known_owner(folder) && of_a_known_owner(folder / converter)) folders.push_back(folder);
    const char* set = std::getenv("PATH");
    const std::string list = set ? set : "";
    for (std::size_t at = 0; at <= list.size();) {
        const std::size_t end = std::min(list.find(':', at), list.size());
        if (end > at && list[at] == '/') folders.emplace_back(list.substr(at, end - at));
        at = end + 1;
    }
    for (const auto& folder : folders)
        if (const std::string path = (folder / converter).string(); access(path.c_str(), X_OK) == 0) return path;
    return "";
}

/// While it lives, a signal that asks to stop is noted: a program and a folder have to go first.
class stop_waits {
  public:
    stop_waits() {
        for (std::size_t i = 0; i < signals.size(); ++i) sigaction(signals[i], nullptr, &before_[i]);
        catch_stop_signals();
        struct sigaction stop{};
        sigaction(SIGINT, nullptr, &stop);
        if (before_[0].sa_handler != SIG_IGN) sigaction(SIGHUP, &stop, nullptr);
    }
    ~stop_waits() {
        for (std::size_t i = 0; i < signals.size(); ++i) sigaction(signals[i], &before_[i], nullptr);
    }
    stop_waits(const stop_waits&) = delete;
    stop_waits& operator=(const stop_waits&) = delete;

  private:
    static constexpr std::array signals{SIGHUP, SIGINT, SIGTERM, SIGPIPE, SIGCHLD};
    std::array<struct sigaction, signals.size()> before_{};
};

/// Exit code of a program that was waited for, and what it wrote to stderr. It is killed when a stop is asked for.
std::pair<int, std::string> run_program(const std::string& program, const std::vector<std::string>& arguments) {
    int ends[2];
    if (pipe2(ends, O_CLOEXEC) != 0) throw failure(exit_usage, fmt::format("{}: {}", program, std::strerror(errno)));
    posix_spawn_file_actions_t files;
    posix_spawn_file_actions_init(&files);
    posix_spawn_file_actions_addopen(&files, STDIN_FILENO, "/dev/null", O_RDONLY, 0);
    posix_spawn_file_actions_addopen(&files, STDOUT_FILENO, "/dev/null", O_WRONLY, 0);
    posix_spawn_file_actions_adddup2(&files, ends[1], STDERR_FILENO);
    std::vector<char*> words{const_cast<char*>(program.c_str())};
    for (const std::string& word : arguments) words.push_back(const_cast<char*>(word.c_str()));
    words.push_back(nullptr);
    pid_t child = 0;
    const int fault = posix_spawn(&child, program.c_str(), &files, nullptr, words.data(), environ);
    posix_spawn_file_actions_destroy(&files);
    close(ends[1]);
    std::string said;
    std::array<char, 4096> block;
    for (ssize_t n = 1; fault == 0 && n != 0;) {
        std::array<pollfd, 2> waiting{{{ends[0], POLLIN, 0}, {stop_fd(), POLLIN, 0}}};
        if (poll(waiting.data(), waiting.size(), -1) < 0 && errno != EINTR) break;
        if (stop_requested()) {
            kill(child, SIGKILL);
            break;
        }
        n = waiting[0].revents ? read(ends[0], block.data(), block.size()) : -1;
        if (n > 0 && said.size() < longest_reason) said.append(block.data(), static_cast<std::size_t>(n));
    }
    close(ends[0]);
    if (fault != 0) throw failure(exit_usage, fmt::format("{}: {}", program, std::strerror(fault)));
    int status = 0;
    while (waitpid(child, &status, 0) < 0 && errno == EINTR) {
    }
    return {WIFEXITED(status) ? WEXITSTATUS(status) : exit_interrupted, said};
}

/// `text` with the name of the file in place of the table's.
std::string about_file(std::string text, const std::string& path, const std::string& table) {
    for (std::size_t at = text.find(table); at != std::string::npos; at = text.find(table, at + path.size()))
        text.replace(at, table.size(), path);
    return text;
}

/// @param quiet  without notes on what was taken for what. @return what it remarked
std::string convert_file(const std::string& path, const std::string& group, const std::string& table, bool quiet) {
    if (access(path.c_str(), R_OK) != 0) throw failure(exit_usage, fmt::format("{}: {}", path, std::strerror(errno)));
    const std::string program = find_converter();
    if (program.empty())
        throw failure(exit_usage, fmt::format("{}: {}, which reads this format, is neither beside okid nor in PATH: "
                                              "pip install okid",
                                              path, converter));
    std::vector<std::string> arguments;
    if (quiet) arguments.emplace_back("--quiet");
    if (!group.empty()) arguments.push_back("--group=" + group);
    arguments.insert(arguments.end(), {"--", path, table});
    auto [code, said] = run_program(program, arguments);
    if (stop_requested()) throw failure(exit_interrupted, "interrupted; no file is left half-written");
    const std::string begin = std::string(converter) + ": ";
    if (code == exit_ok) return about_file(said, path, table);
    while (!said.empty() && said.back() == '\n') said.pop_back();
    if (said.rfind(begin, 0) == 0) said.erase(0, begin.size());
    throw failure(code == exit_interrupted ? exit_interrupted : exit_usage,
                  about_file(said.empty() ? fmt::format("{}: {} gave up", path, converter) : said, path, table));
}

/// A folder of our own that goes with its content.
class own_folder {
  public:
    own_folder() : path_((std::filesystem::temp_directory_path() / "okid-XXXXXX").string()) {
        if (!mkdtemp(path_.data()))
            throw failure(exit_usage, fmt::format("{}: {}: a folder for the table of a record is needed; TMPDIR names "
                                                  "another place",
                                                  path_, std::strerror(errno)));
    }
    ~own_folder() {
        std::error_code ignored;
        std::filesystem::remove_all(path_, ignored);
    }
    own_folder(const own_folder&) = delete;
    own_folder& operator=(const own_folder&) = delete;

    std::string table() const { return path_ + "/samples.csv"; }

  private:
    std::string path_;
};

/// A name that ends like a format of okid-convert.
bool is_foreign(const std::string& path) {
    const std::string own = lower_case(std::filesystem::path(path).extension().string());
    return std::find(foreign_endings.begin(), foreign_endings.end(), own) != foreign_endings.end();
}

/// Does the table that a file was converted to have a column that its own first line lacks? Then that line is no head.
bool has_other_columns(const std::string& path, const std::string& table) {
    std::vector<std::string> own;
    try {
        own = read_csv_columns(path);
    } catch (const failure&) {
        return true;
    }
    const std::vector<std::string> found = read_csv_columns(table);
    return std::any_of(found.begin(), found.end(), [&own](const std::string& name) { return !has_column(own, name); });
}

} // namespace

nameless_table::nameless_table(const std::string& path, const std::string& group, bool quiet) {
    const stop_waits until_it_has_no_name;
    const own_folder folder;
    remarks_ = convert_file(path, group, folder.table(), quiet);
    fd_ = open_input(folder.table(), "a table");
}

nameless_table::~nameless_table() { close(fd_); }

std::string nameless_table::take_remarks() { return std::exchange(remarks_, {}); }

std::string nameless_table::path() const { return fmt::format("/proc/self/fd/{}", fd_); }

template <class Read> auto record_files::from_table(const std::string& path, Read reader, bool quiet) {
    auto& kept = tables_[path];
    if (!kept) kept = std::make_unique<nameless_table>(path, group_, quiet);
    const std::string table = kept->path();
    try {
        auto read = reader(table);
        if (const std::string notes = kept->take_remarks(); !notes.empty()) say("{}", notes);
        return read;
    } catch (const failure& fault) {
        throw failure(fault.code, about_file(fault.what(), path, table), fault.status);
    }
}

template <class Read> auto record_files::as_table(const std::string& path, Read reader) {
    if (is_foreign(path) || tables_.count(path) > 0) return from_table(path, reader, true);
    try {
        return reader(path);
    } catch (const foreign_table& own) {
        std::error_code ignored;
        if (find_converter().empty() || !std::filesystem::is_regular_file(path, ignored)) throw;
        try {
            return from_table(path, reader, false);
        } catch (const failure& fault) {
            const bool read = tables_[path] && has_other_columns(path, tables_[path]->path());
            tables_.erase(path);
            if (read || fault.code == exit_interrupted) throw;
        }
        throw;
    }
}

std::vector<std::string> record_files::columns(const std::string& path) { return as_table(path, read_csv_columns); }

csv_record record_files::read(const std::string& path, const csv_request& request) {
    csv_record out = as_table(path, [&request](const std::string& table) { return read_csv(table, request); });
    out.path = path;
    return out;
}

} // namespace okid_host
