// SPDX-License-Identifier: MIT
// PURPOSE  stands in for toml++ where its headers are not found (a wheel built on a machine without them)
// METHOD   the names that the library uses; toml::parse() refuses every text with what to install, so no table ever has an
//          entry and nothing else here is reached with one
#pragma once
#include "error.hpp"

#include <memory>
#include <optional>
#include <ostream>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace toml {

using source_index = unsigned;
struct source_position {
    source_index line = 0, column = 0;
    bool operator<(const source_position& other) const { return line < other.line; }
};
struct region {
    source_position begin;
};
struct parse_error : std::runtime_error {
    using std::runtime_error::runtime_error;
    parse_error(const char* what, source_position, std::shared_ptr<const std::string>) : std::runtime_error(what) {}
    region source() const { return {}; }
    std::string_view description() const { return what(); }
};
enum class node_type { table };
struct table;
struct array;
struct node_view;
template <class T> struct box {
    T content{};
    const T& get() const { return content; }
};

struct node {
    template <class T> std::optional<T> value() const { return std::nullopt; }
    template <class T> std::optional<T> value_exact() const { return std::nullopt; }
    template <class T> T value_or(T otherwise) const { return otherwise; }
    node_view operator[](std::string_view) const;
    region source() const { return {}; }
    explicit operator bool() const { return false; }
    const toml::table* as_table() const { return nullptr; }
    toml::table* as_table() { return nullptr; }
    const toml::array* as_array() const { return nullptr; }
    toml::array* as_array() { return nullptr; }
    const box<bool>* as_boolean() const { return nullptr; }
    const box<std::int64_t>* as_integer() const { return nullptr; }
    const box<double>* as_floating_point() const { return nullptr; }
    const box<std::string>* as_string() const { return nullptr; }
    bool is_table() const { return false; }
    bool is_array() const { return false; }
    bool is_string() const { return false; }
    bool is_boolean() const { return false; }
    bool is_integer() const { return false; }
    bool is_number() const { return false; }
};
/// What table["key"] gives.
struct node_view : node {
    toml::node* node() const { return nullptr; }
};
inline node_view node::operator[](std::string_view) const { return {}; }
struct key {
    std::string_view str() const { return {}; }
    region source() const { return {}; }
};
struct any { ///< a value that is written
    template <class T> any(T&&) {}
};
struct table : node {
    table() = default;
    table(std::initializer_list<std::pair<const char*, any>>) {}
    using entries = std::vector<std::pair<key, node>>;
    entries::const_iterator begin() const { return none().begin(); }
    entries::const_iterator end() const { return none().end(); }
    const node* get(std::string_view) const { return nullptr; }
    bool contains(std::string_view) const { return false; }
    bool empty() const { return true; }
    template <class K, class T> void insert(K&&, T&&) {}
    template <class K, class T> void insert_or_assign(K&&, T&&) {}

  private:
    static const entries& none() {
        static const entries nothing;
        return nothing;
    }
};
struct array : node {
    std::size_t size() const { return 0; }
    bool empty() const { return true; }
    bool is_homogeneous(node_type) const { return true; }
    const node* get(std::size_t) const { return nullptr; }
    template <class T> T* get_as(std::size_t) const { return nullptr; }
    template <class T> void push_back(T&&) {}
    const node* begin() const { return nullptr; }
    const node* end() const { return nullptr; }
};
inline std::ostream& operator<<(std::ostream& out, const table&) { return out; }

struct json_formatter {
    explicit json_formatter(const table&) {}
};
inline std::ostream& operator<<(std::ostream& out, const json_formatter&) { return out; }

inline table parse(std::string_view, std::string_view path = "TOML text") {
    throw okid_host::failure(
        okid_host::exit_usage,
        fmt::format(
            "{}: this build of okid reads no TOML, because it was built without the headers of toml++. What to do: "
            "install them (Debian: libtomlplusplus-dev) and build okid again (Python: pip install "
            "--force-reinstall --no-deps ./tools)",
            path));
}

} // namespace toml
