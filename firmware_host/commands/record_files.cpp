// SPDX-License-Identifier: MIT
// PURPOSE  records of any format that the Python package reads
// METHOD   okid-convert is started, without a shell, from the folder of this program or from PATH; it writes into a folder that
//          nobody else may enter
#include "record_files.hpp"

#include "error.hpp"
#include "files/nearest_name.hpp"

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <fcntl.h>
#include <filesystem>
#include <fmt/format.h>
#include <spawn.h>
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

/// Where it may stand: beside this program, in the .venv that `make build` makes beside its folder, in PATH.
std::string find_converter() {
    std::error_code fault;
    std::vector<std::filesystem::path> folders;
    if (const auto program = std::filesystem::read_symlink("/proc/self/exe", fault); !fault) {
        folders.push_back(program.parent_path());
        folders.push_back(program.parent_path().parent_path() / ".venv/bin");
    }
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

/// Exit code of a program that was waited for, and what it wrote to stderr.
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
    for (ssize_t n = 0;
         fault == 0 && ((n = read(ends[0], block.data(), block.size())) > 0 || (n < 0 && errno == EINTR));)
        if (n > 0 && said.size() < longest_reason) said.append(block.data(), static_cast<std::size_t>(n));
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

void convert_file(const std::string& path, const std::string& group, const std::string& table) {
    if (access(path.c_str(), R_OK) != 0) throw failure(exit_usage, fmt::format("{}: {}", path, std::strerror(errno)));
    const std::string program = find_converter();
    if (program.empty())
        throw failure(exit_usage, fmt::format("{}: {}, which reads this format, is neither beside okid nor in PATH: "
                                              "pip install okid",
                                              path, converter));
    std::vector<std::string> arguments;
    if (!group.empty()) arguments = {"--group=" + group};
    arguments.insert(arguments.end(), {"--", path, table});
    auto [code, said] = run_program(program, arguments);
    const std::string begin = std::string(converter) + ": ";
    if (code == exit_ok) {
        if (!said.empty()) say("{}", said);
        return;
    }
    while (!said.empty() && said.back() == '\n') said.pop_back();
    if (said.rfind(begin, 0) == 0) said.erase(0, begin.size());
    throw failure(code == exit_interrupted ? exit_interrupted : exit_usage,
                  about_file(said.empty() ? fmt::format("{}: {} gave up", path, converter) : said, path, table));
}

/// A name that ends like a format of okid-convert.
bool is_foreign(const std::string& path) {
    const std::string own = lower_case(std::filesystem::path(path).extension().string());
    return std::find(foreign_endings.begin(), foreign_endings.end(), own) != foreign_endings.end();
}

} // namespace

own_folder::own_folder() : path_((std::filesystem::temp_directory_path() / "okid-XXXXXX").string()) {
    if (!mkdtemp(path_.data()))
        throw failure(exit_usage, fmt::format("{}: {}: a folder for the table of a record is needed; TMPDIR names "
                                              "another place",
                                              path_, std::strerror(errno)));
}

own_folder::~own_folder() {
    std::error_code ignored;
    std::filesystem::remove_all(path_, ignored);
}

std::string record_files::table_of(const std::string& path) {
    const auto [at, fresh] = tables_.try_emplace(path);
    if (fresh) convert_file(path, group_, at->second.table());
    return at->second.table();
}

template <class Read> auto record_files::as_table(const std::string& path, Read reader) {
    if (!is_foreign(path)) return reader(path);
    const std::string table = table_of(path);
    try {
        return reader(table);
    } catch (const failure& fault) {
        throw failure(fault.code, about_file(fault.what(), path, table), fault.status);
    }
}

std::vector<std::string> record_files::columns(const std::string& path) { return as_table(path, read_csv_columns); }

csv_record record_files::read(const std::string& path, const csv_request& request) {
    csv_record out = as_table(path, [&request](const std::string& table) { return read_csv(table, request); });
    out.path = path;
    return out;
}

} // namespace okid_host
