// SPDX-License-Identifier: MIT
// okid convert: journals, logs of frames and tables of samples into one another.
#include "acquire/frame_maker.hpp"
#include "acquire/host_time.hpp"
#include "align/aligner.hpp"
#include "commands.hpp"
#include "config/config.hpp"
#include "error.hpp"
#include "files/decimal_text.hpp"
#include "files/progress.hpp"
#include "files/whole_file.hpp"
#include "journal/journal_header.hpp"
#include "live/playback.hpp"
#include "record/csv.hpp"
#include "record/csv_header.hpp"
#include "record/line_reader.hpp"
#include "result/result.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <drv/candump.h>
#include <filesystem>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <iterator>
#include <memory>
#include <okid/types.h>
#include <random>

namespace okid_host {
namespace {

struct convert_arguments {
    std::string from, to, config;
    bool quiet = false;
};

/// What was written, unless it was asked to be quiet.
template <class... Words> void report(const convert_arguments& given, Words&&... words) {
    if (!given.quiet) say(std::forward<Words>(words)...);
}

/// The frames of a log, with the progress of reading them.
class shown_frames {
  public:
    template <class... Wanted>
    explicit shown_frames(const convert_arguments& given, const Wanted&... wanted)
        : frames_(given.from, wanted...), display_(std::make_unique<progress>(!given.quiet)) {
        display_->stage("reading " + given.from);
        frames_.on_share([this](double share) { display_->share(share); });
    }
    const drv_frame_t* next() {
        const drv_frame_t* frame = frames_.next();
        if (!frame) display_.reset();
        return frame;
    }

  private:
    log_frames frames_;
    std::unique_ptr<progress> display_;
};

/// Rows of the grid as lines of text, in the units that the identification uses.
class csv_writer : public grid_sink {
  public:
    csv_writer(const live_config& config, whole_file& out) : out_(out) {
        fmt::format_to(std::back_inserter(text_), "# fs_hz: {}\n# units:", config.rate_hz);
        for (const channel_config& channel : config.channels)
            fmt::format_to(std::back_inserter(text_), " {}={}", channel.name,
                           channel.unit.empty() ? "-" : channel.si_unit());
        text_ += "\n";
        for (std::size_t i = 0; i < config.channels.size(); ++i)
            text_ += (i ? "," : "") + quoted(config.channels[i].name);
        text_ += "\n";
        for (const channel_config& channel : config.channels)
            columns_.push_back({channel.layout.scale, channel.layout.offset, channel.si_factor(),
                                channel.layout.length <= 32 && channel.layout.value != DRV_VALUE_FLOAT64});
    }
    void on_sample(std::int64_t, const double* row) override {
        for (std::size_t i = 0; i < columns_.size(); ++i) {
            const column& its = columns_[i];
            const double value = (row[i] * its.scale + its.offset) * its.factor;
            if (i) text_ += ',';
            if (std::isnan(value))
                text_ += "nan";
            else if (its.short_text)
                append_ten_digits(text_, value);
            else
                fmt::format_to(std::back_inserter(text_), "{:.17g}", value);
        }
        text_ += '\n';
        write();
    }
    void on_missing(std::int64_t index, std::int64_t count) override {
        if (count > 100000000)
            throw failure(exit_usage, fmt::format("a gap of {} samples follows sample {}: too many rows for a table",
                                                  count, index));
        std::string row;
        for (std::size_t i = 0; i < columns_.size(); ++i) row += i ? ",nan" : "nan";
        for (; count > 0; --count) {
            text_ += row + '\n';
            write();
        }
    }
    void on_gap(const grid_gap& gap) override { missing_ += gap.count; }
    long long missing() const { return missing_; }

  private:
    static std::string quoted(const std::string& name) {
        return name.find_first_of(",;\t ") == std::string::npos ? name : '"' + name + '"';
    }
    void write() {
        out_.append(text_);
        text_.clear();
    }
    struct column {
        double scale, offset, factor;
        bool short_text; ///< ten digits hold every code
    };
    std::vector<column> columns_;
    whole_file& out_;
    std::string text_;
    long long missing_ = 0;
};

void frames_to_csv(const convert_arguments& given, const live_config& config) {
    shown_frames frames(given, config);
    whole_file out(given.to);
    csv_writer table(config, out);
    aligner samples(config, table);
    while (const drv_frame_t* frame = frames.next()) samples.push(*frame);
    samples.finish();
    if (samples.emitted() == 0)
        throw failure(exit_no_model, fmt::format("{}: no sample: it holds no usable frame of the channels of {}",
                                                 given.from, config.path));
    for (const std::size_t index : samples.silent_channels())
        say("okid: channel \"{}\" has no frame in {}: its column is all nan\n", config.channels[index].name,
            given.from);
    out.commit();
    report(given, "{}: {} samples, {} channels, {} values missing\n", given.to, samples.emitted(),
           config.channels.size(), table.missing());
}

/// What the comment lines of the table say about its rate must agree with the config.
void check_csv_rate(const std::string& path, const live_config& config) {
    line_reader lines(path);
    csv_header header;
    std::string_view line;
    for (std::size_t number = 1; lines.next(line) && (line.empty() || line[0] == '#'); ++number)
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
    std::optional<progress> display(!given.quiet);
    display->stage("reading " + given.from);
    request.progress = [&display](double share) { display->share(share); };
    const csv_record record = read_csv(given.from, request);
    frame_maker maker(config);
    std::string text;
    display->stage("writing " + given.to);
    for (std::size_t n = 0; n < record.count; ++n) {
        if (n % 256 == 0) display->share(static_cast<double>(n) / static_cast<double>(record.count));
        maker.append_sample(static_cast<std::int64_t>(n), record.samples.data() + n * request.columns.size(), text);
    }
    write_whole_file(given.to, text);
    display.reset();
    if (maker.saturated() > 0)
        say("okid: {} values did not fit their signal and stand at its limit\n", maker.saturated());
    report(given, "{}: {} frames of {} samples\n", given.to, maker.frames(), record.count);
}

/// Name of a bus of a journal as a log can have it.
std::string log_name(const journal_header& header, std::size_t bus) {
    if (bus >= header.buses.size()) return fmt::format("can{}", bus);
    std::string out = header.buses[bus].interface.substr(0, DRV_NAME_BYTES - 1);
    std::replace_if(out.begin(), out.end(), [](unsigned char c) { return c <= ' ' || c > 126; }, '_');
    return out.empty() ? fmt::format("can{}", bus) : out;
}

void journal_to_log(const convert_arguments& given) {
    const journal_header header = read_journal_header(given.from);
    shown_frames frames(given);
    whole_file out(given.to);
    std::vector<std::string> names;
    for (std::size_t i = 0; i < DRV_MAX_BUSES; ++i) names.push_back(log_name(header, i));
    long long count = 0, stamps = 0, losses = 0;
    char line[DRV_CANDUMP_BYTES + 1];
    while (const drv_frame_t* frame = frames.next()) {
        int length = drv_candump_format(line, DRV_CANDUMP_BYTES, names[frame->bus].c_str(), frame);
        if (length <= 0) continue;
        line[length++] = '\n';
        out.append({line, static_cast<std::size_t>(length)});
        ++count;
        stamps += frame->hw_time_ns != 0;
        losses += frame->loss != 0;
    }
    out.commit();
    report(given, "{}: {} frames\n", given.to, count);
    if (stamps + losses > 0)
        say("okid: a log has no place for the stamps of the devices ({}), for marks of losses ({}) and for "
            "times below a microsecond; the journal keeps them\n",
            stamps, losses);
    if (!header.texts.config.empty())
        say("okid: a log holds no config: keep the journal, or CONFIG.toml and its DBC files\n");
}

/// A journal in memory, handed on chunk by chunk.
class journal_text {
  public:
    explicit journal_text(whole_file& out) : out_(out), writer_(std::make_unique<drv_journal_writer_t>()) {
        const drv_journal_sink_t sink{append, nullptr, &bytes_};
        drv_journal_begin(writer_.get(), &sink, std::uint64_t{std::random_device{}()} << 32 | std::random_device{}());
    }
    void begin(journal_header header, std::int64_t time_ns) {
        now_.real_ns = since_ns_ = header.real_ns = time_ns;
        header.version = OKID_VERSION;
        header.run = writer_->run;
        header.started = utc_text(time_ns);
        check(write_journal_header(*writer_, header, now_));
    }
    void add(const drv_frame_t& frame) {
        constexpr std::int64_t chunk_ns = 250000000;
        now_.real_ns = frame.time_ns;
        if (frame.time_ns - since_ns_ < chunk_ns && frame.time_ns >= since_ns_ &&
            drv_journal_add(writer_.get(), &frame) == 1)
            return;
        check(drv_journal_flush(writer_.get(), &now_));
        since_ns_ = frame.time_ns;
        (void)drv_journal_add(writer_.get(), &frame);
    }
    void end() { check(drv_journal_end(writer_.get(), 0, &now_)); }

  private:
    static long append(void* to, const std::uint8_t* bytes, std::size_t count) {
        static_cast<std::string*>(to)->append(reinterpret_cast<const char*>(bytes), count);
        return static_cast<long>(count);
    }
    void check(int code) {
        if (code != 0)
            throw failure(exit_usage, fmt::format("a name in the config is too long for a journal: {}", -code));
        out_.append(bytes_);
        bytes_.clear();
    }
    whole_file& out_;
    std::string bytes_;
    std::unique_ptr<drv_journal_writer_t> writer_;
    drv_journal_time_t now_{};
    std::int64_t since_ns_ = 0;
};

void log_to_journal(const convert_arguments& given, const std::optional<live_config>& config) {
    journal_header header;
    if (config) {
        header.config_name = config->path;
        header.texts = config->texts;
        header.buses = journal_buses(*config);
    } else {
        for (const std::string& name : interfaces_of(given.from)) header.buses.push_back({name, name});
        if (header.buses.empty()) throw failure(exit_usage, fmt::format("{}: found no frame", given.from));
        if (header.buses.size() > DRV_MAX_BUSES)
            throw failure(exit_usage, fmt::format("{}: found {} interfaces, at most {} go into a journal", given.from,
                                                  header.buses.size(), int{DRV_MAX_BUSES}));
    }
    std::vector<std::string> interfaces;
    for (const journal_header::bus& bus : header.buses) interfaces.push_back(bus.interface);
    const auto frames =
        config ? std::make_unique<shown_frames>(given, *config) : std::make_unique<shown_frames>(given, interfaces);
    whole_file out(given.to);
    journal_text journal(out);
    long long count = 0;
    for (const drv_frame_t* frame; (frame = frames->next()); ++count) {
        if (count == 0) journal.begin(header, frame->time_ns);
        journal.add(*frame);
    }
    if (count == 0)
        throw failure(exit_no_model, fmt::format("{}: no frame{}", given.from,
                                                 config ? fmt::format(" of the buses of {}", config->path) : ""));
    journal.end();
    out.commit();
    report(given, "{}: {} frames{}\n", given.to, count, config ? "" : "; without -c it holds no config");
}

/// The config given, or that of the journal; none where it is not needed.
std::optional<live_config> config_for(const convert_arguments& given, bool from_journal) {
    if (!given.config.empty()) return load_config(given.config);
    if (!from_journal) return std::nullopt;
    const journal_header header = read_journal_header(given.from);
    if (header.texts.config.empty()) return std::nullopt;
    return load_config(given.from, header.texts);
}

void convert(const convert_arguments& given) {
    const auto extension_of = [](const std::string& path) { return std::filesystem::path(path).extension().string(); };
    const std::string from = extension_of(given.from), to = extension_of(given.to), way = from + " to " + to;
    const char* ways[] = {".okj to .log", ".okj to .csv", ".log to .csv", ".log to .okj", ".csv to .log"};
    if (std::find(std::begin(ways), std::end(ways), way) == std::end(ways))
        throw failure(
            exit_usage,
            fmt::format("{} to {}: found \"{}\" to \"{}\", expected {}. Files of other programs (MDF4, UFF, HDF5, "
                        ".mat, BLF, ASC) are converted by okid-convert, of the Python package",
                        given.from, given.to, from, to, fmt::join(ways, ", ")));
    check_writable(given.to);
    if (way == ways[0]) return journal_to_log(given);
    const std::optional<live_config> config = config_for(given, from == ".okj");
    if (way == ways[3]) return log_to_journal(given, config);
    if (!config)
        throw failure(exit_usage, from == ".okj" ? given.from + ": it holds no complete config: give -c CONFIG.toml"
                                                 : "-c CONFIG.toml is missing: it says which bits are which channel");
    if (to == ".csv")
        frames_to_csv(given, *config);
    else
        csv_to_log(given, *config);
}

} // namespace

void add_convert(CLI::App& app) {
    auto given = std::make_shared<convert_arguments>();
    CLI::App* command = app.add_subcommand(
        "convert", "Convert between journals, logs of frames and tables of samples, by file name extension");
    command
        ->add_option("in", given->from,
                     "a journal and the segments behind it, a log of candump -L, or a table of samples")
        ->required()
        ->type_name("IN.okj|IN.log|IN.csv");
    command->add_option("out", given->to, "the file to write")->required()->type_name("OUT.csv|OUT.log|OUT.okj");
    command->add_option("-c,--config", given->config, "which bits are which channel; a journal holds its own")
        ->type_name("CONFIG.toml");
    command->add_flag("--quiet", given->quiet, "no summary, no progress");
    command->footer(
        "Files of other programs (MDF4, UFF, HDF5, .mat, BLF, ASC): okid-convert, of the Python package.\n\n"
        "Examples:\n  okid convert frame.log frame.csv -c frame.toml\n  okid convert "
        "runs/frame-20261121T120000Z-0001.okj frame.log");
    command->callback([given] { convert(*given); });
}

} // namespace okid_host
