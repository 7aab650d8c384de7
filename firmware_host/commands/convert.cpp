// SPDX-License-Identifier: MIT
// okid convert: a log of frames to a table of samples, and back.
#include "../config.hpp"
#include "../csv.hpp"
#include "../csv_header.hpp"
#include "../error.hpp"
#include "../live/frame_maker.hpp"
#include "../live/grid.hpp"
#include "../live/playback.hpp"
#include "../result.hpp"
#include "../whole_file.hpp"
#include "commands.hpp"

#include <cmath>
#include <cstdio>
#include <filesystem>
#include <fmt/format.h>
#include <fstream>
#include <iterator>
#include <memory>

namespace okid_host {
namespace {

struct convert_arguments {
    std::string from, to, config;
};

/// Rows of the grid as lines of text, in the units that the identification uses.
class csv_writer : public grid_sink {
  public:
    explicit csv_writer(const live_config& config) : config_(config) {
        fmt::format_to(std::back_inserter(text_), "# fs_hz: {}\n# units:", config.rate_hz);
        for (const channel_config& channel : config.channels)
            fmt::format_to(std::back_inserter(text_), " {}={}", channel.name,
                           channel.unit.empty() ? "-" : channel.si_unit());
        text_ += "\n";
        for (std::size_t i = 0; i < config.channels.size(); ++i)
            text_ += (i ? "," : "") + quoted(config.channels[i].name);
        text_ += "\n";
    }
    void on_sample(std::int64_t, const double* row) override {
        for (std::size_t i = 0; i < config_.channels.size(); ++i) {
            const channel_config& channel = config_.channels[i];
            const double value = (row[i] * channel.layout.scale + channel.layout.offset) * channel.si_factor();
            const int digits = channel.layout.length <= 32 && channel.layout.value != DRV_VALUE_FLOAT64 ? 10 : 17;
            if (i) text_ += ',';
            if (std::isnan(value))
                text_ += "nan";
            else
                fmt::format_to(std::back_inserter(text_), "{:.{}g}", value, digits);
        }
        text_ += '\n';
    }
    void on_missing(std::int64_t index, std::int64_t count) override {
        if (count > 100000000)
            throw failure(exit_usage, fmt::format("a gap of {} samples follows sample {}: too many rows for a table",
                                                  count, index));
        std::string row;
        for (std::size_t i = 0; i < config_.channels.size(); ++i) row += i ? ",nan" : "nan";
        for (; count > 0; --count) text_ += row + '\n';
    }
    void on_gap(const grid_gap& gap) override { missing_ += gap.count; }
    const std::string& text() const { return text_; }
    long long missing() const { return missing_; }

  private:
    static std::string quoted(const std::string& name) {
        return name.find_first_of(",;\t ") == std::string::npos ? name : '"' + name + '"';
    }
    const live_config& config_;
    std::string text_;
    long long missing_ = 0;
};

void log_to_csv(const convert_arguments& given, const live_config& config) {
    log_frames frames(given.from, map_interfaces(given.from, config));
    csv_writer table(config);
    grid samples(config, table);
    while (const drv_frame_t* frame = frames.next()) samples.push(*frame);
    samples.finish();
    if (samples.emitted() == 0)
        throw failure(exit_no_model, fmt::format("{}: no sample: the log holds no usable frame of the channels of {}",
                                                 given.from, config.path));
    for (const std::size_t index : samples.silent_channels())
        std::fprintf(stderr, "okid: channel \"%s\" has no frame in %s: its column is all nan\n",
                     config.channels[index].name.c_str(), given.from.c_str());
    write_whole_file(given.to, table.text());
    fmt::print(stderr, "{}: {} samples, {} channels, {} values missing\n", given.to, samples.emitted(),
               config.channels.size(), table.missing());
}

/// What the comment lines of the table say about its rate must agree with the config.
void check_csv_rate(const std::string& path, const live_config& config) {
    std::ifstream input(path);
    std::string line;
    csv_header header;
    for (std::size_t number = 1; std::getline(input, line) && (line.empty() || line[0] == '#'); ++number)
        read_csv_comment(path, number, line, header);
    if (header.fs_hz && std::abs(*header.fs_hz - config.rate_hz) > 1e-6 * config.rate_hz)
        throw failure(exit_usage, fmt::format("{}: found a sample rate of {:g} Hz, expected {:g} Hz as in {}", path,
                                              *header.fs_hz, config.rate_hz, config.path));
}

void csv_to_log(const convert_arguments& given, const live_config& config) {
    check_csv_rate(given.from, config);
    csv_request request;
    for (const channel_config& channel : config.channels) request.columns.push_back(channel.name);
    request.fs_hz = config.rate_hz;
    const csv_record record = read_csv(given.from, request);
    frame_maker maker(config);
    std::string text;
    for (std::size_t n = 0; n < record.count; ++n)
        maker.append_sample(static_cast<std::int64_t>(n), record.samples.data() + n * request.columns.size(), text);
    write_whole_file(given.to, text);
    if (maker.saturated() > 0)
        fmt::print(stderr, "okid: {} values did not fit their signal and stand at its limit\n", maker.saturated());
    fmt::print(stderr, "{}: {} frames of {} samples\n", given.to, maker.frames(), record.count);
}

void convert(const convert_arguments& given) {
    const auto ending = [](const std::string& path) { return std::filesystem::path(path).extension().string(); };
    const std::string from = ending(given.from), to = ending(given.to);
    const bool forth = from == ".log" && to == ".csv", back = from == ".csv" && to == ".log";
    if (!forth && !back)
        throw failure(
            exit_usage,
            fmt::format("\"{}\" to \"{}\" is not available in this version; .log to .csv and .csv to .log are", from,
                        to));
    if (given.config.empty())
        throw failure(exit_usage, "-c CONFIG.toml is missing: it says which bits are which channel");
    const live_config config = load_config(given.config);
    check_writable(given.to);
    if (forth)
        log_to_csv(given, config);
    else
        csv_to_log(given, config);
}

} // namespace

void add_convert(CLI::App& app) {
    auto given = std::make_shared<convert_arguments>();
    CLI::App* command =
        app.add_subcommand("convert", "Convert between logs of frames and tables of samples, by file name extension");
    command->add_option("in", given->from, ".log (candump -L) or .csv")->required()->type_name("IN");
    command->add_option("out", given->to, ".csv or .log")->required()->type_name("OUT");
    command->add_option("-c,--config", given->config, "which bits are which channel")->type_name("CONFIG.toml");
    command->footer("Example:\n  okid convert frame.log frame.csv -c frame.toml");
    command->callback([given] { convert(*given); });
}

} // namespace okid_host
