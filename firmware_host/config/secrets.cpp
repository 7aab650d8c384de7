// SPDX-License-Identifier: MIT
#include "secrets.hpp"

#include "error.hpp"
#include "files/input_file.hpp"
#include "toml_parser.hpp"

#include <cstdlib>
#include <filesystem>
#include <fmt/format.h>
#include <sstream>
#include <sys/stat.h>

namespace okid_host {
namespace {

constexpr std::string_view scheme_end = "://", hidden_part = "…";
constexpr std::size_t longest_password = 4096;

std::filesystem::path place_of_password(const std::string& name, const std::string& config) {
    std::error_code ignored;
    const char* credentials = std::getenv("CREDENTIALS_DIRECTORY");
    if (credentials && name.find('/') == std::string::npos) {
        const std::filesystem::path given = std::filesystem::path(credentials) / name;
        if (std::filesystem::exists(given, ignored)) return given;
    }
    return std::filesystem::path(config).parent_path() / name; // an absolute name stays one
}

} // namespace

std::string without_password(const std::string& address) {
    const std::size_t begin = address.find(scheme_end), at = address.rfind('@');
    if (begin == std::string::npos || at == std::string::npos || at < begin) return address;
    return address.substr(0, begin + scheme_end.size()).append(hidden_part) + address.substr(at);
}

std::string without_passwords(const std::string& toml) {
    std::string out;
    each_toml_piece(toml, [&](toml_piece piece, std::size_t first, std::size_t last) {
        const std::string text = toml.substr(first, last - first);
        out += piece == toml_piece::code ? text : without_password(text);
    });
    if (out.find('\\') == std::string::npos) return out;
    toml::table table; // an address whose :// or @ are written as escapes stands behind none of these
    try {
        table = parse_toml(out);
    } catch (const toml::parse_error&) {
        return out;
    }
    toml::node* mqtt = table["publish"]["mqtt"].node();
    const std::string address = mqtt ? mqtt->value_or(std::string()) : "", clean = without_password(address);
    if (clean == address) return out;
    table["publish"].as_table()->insert_or_assign("mqtt", clean);
    std::ostringstream again;
    again << table << '\n';
    return again.str();
}

std::string read_password(const std::string& name, const std::string& config) {
    const std::string path = place_of_password(name, config).string();
    std::string text = read_input(path, "one line, a password", longest_password);
    while (!text.empty() && (text.back() == '\n' || text.back() == '\r')) text.pop_back();
    if (text.empty() || text.find_first_of(std::string_view("\n\r\0", 3)) != std::string::npos)
        throw failure(exit_usage, fmt::format("{}: expected one line, a password", path));
    struct stat status{};
    if (stat(path.c_str(), &status) == 0 && (status.st_mode & S_IROTH))
        say("okid: warning: {}: every user of this computer can read the password in it: chmod o-r\n", path);
    return text;
}

} // namespace okid_host
