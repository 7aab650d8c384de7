// SPDX-License-Identifier: MIT
#include "journal_header.hpp"

#include "config/toml_parser.hpp"
#include "error.hpp"

#include <cerrno>
#include <charconv>
#include <cstring>
#include <fcntl.h>
#include <fmt/format.h>
#include <memory>
#include <sstream>
#include <unistd.h>

namespace okid_host {
namespace {

constexpr std::size_t most_text_bytes = std::size_t{64} << 20; // of all texts together: a hostile file holds no more
constexpr const char *header_name = "journal", *config_text_name = "config",
                     *dbc_prefix = "dbc:", *preset_prefix = "preset:";

toml::table header_table(const journal_header& header) {
    toml::table out{{"okid", header.version},
                    {"run", fmt::format("{:016x}", header.run)},
                    {"segment", header.segment},
                    {"started", header.started},
                    {"started_real_ns", header.real_ns},
                    {"started_monotonic_ns", header.monotonic_ns},
                    {"config", header.config_name}};
    if (header.duration_s) out.insert("duration_s", *header.duration_s);
    if (header.trigger_ns) out.insert("trigger_ns", *header.trigger_ns);
    toml::array buses;
    for (const journal_header::bus& bus : header.buses)
        buses.push_back(toml::table{{"name", bus.name}, {"interface", bus.interface}});
    out.insert("bus", buses);
    return out;
}

void read_table(const std::string& text, journal_header& out) {
    toml::table table;
    try {
        table = parse_toml(text);
    } catch (const toml::parse_error&) {
        out.whole = false;
        return;
    }
    out.version = table["okid"].value_or(std::string());
    out.started = table["started"].value_or(std::string());
    out.config_name = table["config"].value_or(std::string());
    const std::string run = table["run"].value_or(std::string());
    std::from_chars(run.data(), run.data() + run.size(), out.run, 16);
    out.segment = table["segment"].value_or(1);
    out.real_ns = table["started_real_ns"].value_or(std::int64_t{0});
    out.monotonic_ns = table["started_monotonic_ns"].value_or(std::int64_t{0});
    out.duration_s = table["duration_s"].value<double>();
    out.trigger_ns = table["trigger_ns"].value<std::int64_t>();
    if (out.duration_s && !(*out.duration_s > 0 && *out.duration_s <= 1e9)) out.duration_s.reset();
    const toml::array* buses = table["bus"].as_array();
    for (std::size_t i = 0; buses && i < buses->size() && i < DRV_MAX_BUSES; ++i)
        if (const toml::table* bus = buses->get_as<toml::table>(i))
            out.buses.push_back({(*bus)["name"].value_or(std::string()), (*bus)["interface"].value_or(std::string())});
}

long read_file(void* context, std::uint8_t* bytes, std::size_t count) {
    const ssize_t got = read(*static_cast<int*>(context), bytes, count);
    return got < 0 ? -errno : static_cast<long>(got);
}

/// Pieces of texts, put together in order.
struct text_collector {
    struct entry {
        std::string text;
        std::uint64_t total = 0;
    };
    std::map<std::string, entry> texts;
    std::size_t bytes = 0;
    bool whole = true;

    void add(const drv_journal_text_t& piece) {
        bytes += piece.piece_bytes + piece.name_bytes + sizeof(entry);
        if (bytes > most_text_bytes) {
            whole = false;
            return;
        }
        entry& to = texts[std::string(piece.name, piece.name_bytes)];
        to.total = piece.total;
        if (piece.offset == to.text.size()) to.text.append(piece.piece, piece.piece_bytes);
    }
    /// What is not there to its end is not there at all.
    void sort_into(journal_header& out) {
        for (auto& [name, one] : texts) {
            if (one.text.size() != one.total)
                whole = false;
            else if (name == header_name)
                read_table(one.text, out);
            else if (name == config_text_name)
                out.texts.config = std::move(one.text);
            else if (name.rfind(dbc_prefix, 0) == 0)
                out.texts.dbcs.emplace(name.substr(std::strlen(dbc_prefix)), std::move(one.text));
            else if (name.rfind(preset_prefix, 0) == 0)
                out.texts.presets.emplace(name.substr(std::strlen(preset_prefix)), std::move(one.text));
        }
        out.whole = out.whole && whole;
    }
};

} // namespace

std::vector<journal_header::bus> journal_buses(const live_config& config) {
    std::vector<journal_header::bus> out;
    for (const bus_config& bus : config.buses)
        out.push_back({bus.name, bus.interface.empty() ? bus.name : bus.interface});
    return out;
}

int write_journal_header(drv_journal_writer_t& writer, const journal_header& header, const drv_journal_time_t& now) {
    std::stringstream table;
    table << header_table(header) << '\n';
    int code = 0;
    const auto write = [&](const std::string& name, const std::string& text) {
        if (code == 0) code = drv_journal_text(&writer, name.c_str(), text.data(), text.size(), &now);
    };
    write(header_name, table.str());
    if (!header.texts.config.empty()) write(config_text_name, header.texts.config);
    for (const auto& [name, text] : header.texts.dbcs) write(dbc_prefix + name, text);
    for (const auto& [name, text] : header.texts.presets) write(preset_prefix + name, text);
    return code;
}

journal_header read_journal_header(const std::string& path) {
    drv_source_t source{};
    source.ops = &drv_source_journal; // its open() tells best why a file is no journal
    drv_source_config_t config{};
    config.path = path.c_str();
    if (source.ops->open(&source, &config) != 0) throw failure(exit_usage, source.error);
    source.ops->close(&source);
    int fd = open(path.c_str(), O_RDONLY | O_CLOEXEC);
    const auto reader = std::make_unique<drv_journal_reader_t>();
    drv_journal_reader_begin(reader.get(), read_file, &fd);
    drv_journal_chunk_t chunk{};
    text_collector texts;
    while (drv_journal_next(reader.get(), &chunk) == 1 && chunk.kind != DRV_JOURNAL_FRAMES) {
        drv_journal_text_t piece{};
        if (drv_journal_text_of(&chunk, &piece)) texts.add(piece);
    }
    close(fd);
    journal_header out;
    texts.whole = reader->damaged == 0 && reader->missing == 0;
    texts.sort_into(out);
    return out;
}

} // namespace okid_host
