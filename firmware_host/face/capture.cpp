// SPDX-License-Identifier: MIT
// PURPOSE  okid_host/capture.h: a session fed by somebody else's reader
// METHOD   a session and what stands around it in `okid run` (journal, GPIO lines, health of the buses), without the readers.
//          Bytes of a line go through the source that reads such a line, opened without a device. Samples and events that
//          were not taken yet wait in arrays, runs of missing samples as one entry
#include "acquire/bus_watch.hpp"
#include "acquire/serial_line.hpp"
#include "files.hpp"
#include "guard.hpp"
#include "live/gpio_lines.hpp"
#include "live/playback.hpp"
#include "live/recording_link.hpp"
#include "live/session.hpp"

#include <drv/can_error.h>
#include <drv/stream.h>
#include <fmt/format.h>
#include <mutex>
#include <okid_host/capture.h>

namespace okid_host::face {
namespace {

live_config config_of(const okid_host_config_t& given, const okid_host_capture_options_t& options) {
    if (options.size != sizeof options)
        throw failure(exit_usage, fmt::format("okid_host_capture_options_t: found size {}, expected {}: call "
                                              "okid_host_capture_defaults() first, and compile against this library",
                                              options.size, sizeof options));
    live_config config = given.config;
    require_identifiable(config);
    if (!options.identify) {
        config.publish = {};
        config.trigger = {};
        config.hammer = {};
    }
    return config;
}

} // namespace

/// What is known of one bus beside its samples.
struct pushed_bus {
    explicit pushed_bus(const std::string& name) : watch(name) {}
    ~pushed_bus() {
        if (line.ops) line.ops->close(&line);
    }
    pushed_bus(const pushed_bus&) = delete;
    pushed_bus& operator=(const pushed_bus&) = delete;

    bus_watch watch;
    drv_source_t line{};    ///< of bytes, once there were any
    drv_stats_t counts{};   ///< of frames and link
    std::uint8_t loss = 0;  ///< for the next frame
    device_losses losses{}; ///< by the source's own count
};

/// Samples on their way out: rows in one array, silences as their length.
class waiting_rows {
  public:
    void add(std::int64_t first, const double* row, std::int64_t count, std::size_t width) {
        const bool missing = row == nullptr;
        if (runs_.empty() || runs_.back().missing != missing || runs_.back().first + runs_.back().count != first)
            runs_.push_back({first, 0, values_.size(), missing});
        runs_.back().count += count;
        if (row) values_.insert(values_.end(), row, row + width);
    }
    /// The oldest run; the pointer holds until the next add().
    okid_host_rows_t take() {
        if (next_ == runs_.size()) {
            runs_.clear();
            values_.clear();
            next_ = 0;
            return {};
        }
        const run& one = runs_[next_++];
        return {one.first, one.count, one.missing ? nullptr : values_.data() + one.at};
    }

  private:
    struct run {
        std::int64_t first, count;
        std::size_t at;
        bool missing;
    };
    std::vector<double> values_;
    std::vector<run> runs_;
    std::size_t next_ = 0;
};

} // namespace okid_host::face

using namespace okid_host;

struct okid_host_capture_t final : private session_listener {
    okid_host_capture_t(const okid_host_config_t& config, const okid_host_capture_options_t& given);
    void push(const drv_frame_t& frame);
    void push_bytes(std::size_t bus, const std::uint8_t* bytes, std::size_t count, std::int64_t time_ns);
    void link(std::size_t bus, bool up);
    void lost(std::size_t bus, const device_losses& losses);
    void serve();
    void open(const char* log);
    std::size_t play(std::size_t frames);
    okid_host_rows_t rows(bool raw);
    void finish();

    session& stream() {
        if (finished_) throw failure(exit_usage, "this capture has been finished: make another one");
        return *session_;
    }
    face::pushed_bus& bus(std::size_t index) {
        if (index >= buses_.size())
            throw failure(exit_usage, fmt::format("there is no bus {}: {} has {}", index, config_.path, buses_.size()));
        return *buses_[index];
    }
    bool done() const { return finished_ || session_->done(); }
    const session& state() const { return *session_; }
    const char* take_events();
    const char* keep(std::string text) { return (returned_ = std::move(text)).c_str(); }

  private:
    void on_sample(std::int64_t index, const double* row) override {
        if (keep_samples_) waiting_.add(index, row, 1, config_.channels.size());
    }
    void on_missing(std::int64_t index, std::int64_t count) override {
        if (keep_samples_) waiting_.add(index, nullptr, count, 0);
    }
    void on_gap(const grid_gap&) override {}
    void on_event(const std::string& line) override;
    bool wants_events() const override { return keep_events_; }
    void tell_health();

    const live_config config_;
    const bool keep_samples_, keep_events_;
    bool live_, finished_ = false;
    face::waiting_rows waiting_;
    std::vector<double> scaled_;
    std::mutex mutex_; ///< of events_: another thread may report an update
    std::string events_, returned_;
    std::vector<std::unique_ptr<face::pushed_bus>> buses_;
    std::unique_ptr<log_frames> log_;
    std::unique_ptr<gpio_lines> lines_;
    std::unique_ptr<session> session_;
    std::unique_ptr<recording_link> recording_;
};

okid_host_capture_t::okid_host_capture_t(const okid_host_config_t& config, const okid_host_capture_options_t& given)
    : config_(face::config_of(config, given)), keep_samples_(given.keep_samples != 0),
      keep_events_(given.keep_events != 0), live_(given.live != 0) {
    session_options options;
    if (given.duration_s > 0) options.duration_s = given.duration_s;
    if (given.trigger_ns != 0) options.trigger_ns = given.trigger_ns;
    options.events = given.events ? given.events : "";
    options.json = given.json ? given.json : "";
    options.live = live_;
    options.identify = given.identify != 0;
    options.table = given.table != 0;
    options.listener = this;
    for (const bus_config& one : config_.buses)
        buses_.push_back(std::make_unique<face::pushed_bus>(one.on_line() ? one.device : one.interface));
    if (live_) lines_ = std::make_unique<gpio_lines>(config_);
    session_ = std::make_unique<session>(config_, options);
    std::optional<recorder_options> recording;
    if (given.record && options.identify && config_.record.wanted) recording = recorder_options{options.duration_s};
    recording_ = std::make_unique<recording_link>(config_, recording);
}

void okid_host_capture_t::on_event(const std::string& line) {
    const std::lock_guard<std::mutex> hold(mutex_);
    events_ += line;
}

const char* okid_host_capture_t::take_events() {
    const std::lock_guard<std::mutex> hold(mutex_);
    returned_.clear();
    returned_.swap(events_);
    return returned_.c_str();
}

void okid_host_capture_t::push(const drv_frame_t& frame) {
    face::pushed_bus& from = bus(frame.bus);
    if (frame.flags & DRV_FRAME_ERROR) return drv_can_error_count(&from.counts, frame.id, frame.data);
    if (frame.flags & DRV_FRAME_REMOTE) {
        ++from.counts.remote;
        return;
    }
    if (frame.len > sizeof frame.data)
        throw failure(exit_usage, fmt::format("a frame of bus \"{}\" has {} bytes, expected at most {}",
                                              config_.buses[frame.bus].name, frame.len, sizeof frame.data));
    drv_frame_t marked = frame;
    marked.loss |= std::exchange(from.loss, std::uint8_t{0});
    from.counts.link_is_down = 0;
    ++from.counts.received;
    if (recording_->get()) recording_->get()->feed(marked);
    session_->frame(marked);
}

void okid_host_capture_t::push_bytes(std::size_t index, const std::uint8_t* bytes, std::size_t count,
                                     std::int64_t time_ns) {
    face::pushed_bus& from = bus(index);
    const bus_config& wanted = config_.buses[index];
    if (!wanted.on_line())
        throw failure(exit_usage,
                      fmt::format("{}: bus \"{}\" is of type {}, expected serial or slcan for bytes of a line",
                                  config_.path, wanted.name, wanted.type));
    if (!from.line.ops) {
        drv_source_config_t line{};
        line.line = line_settings(wanted, config_.rate_hz);
        line.line.device = nullptr;
        from.line.ops = wanted.serial() ? &drv_source_serial : &drv_source_slcan;
        if (from.line.ops->open(&from.line, &line) != 0) throw failure(exit_usage, from.line.error);
    }
    if (count == 0) return;
    drv_line_push(&from.line, bytes, count, time_ns);
    drv_frame_t frames[64];
    for (int got; (got = from.line.ops->read(&from.line, frames, 64)) > 0;)
        for (int i = 0; i < got; ++i) {
            if (session_->done()) continue;
            frames[i].bus = static_cast<std::uint8_t>(index);
            push(frames[i]);
        }
}

void okid_host_capture_t::link(std::size_t index, bool up) {
    face::pushed_bus& from = bus(index);
    if (up) {
        from.counts.link_is_down = 0;
    } else if (!from.counts.link_is_down) {
        from.counts.link_is_down = 1;
        ++from.counts.link_down;
        from.loss |= DRV_LOSS_LINK;
        if (from.line.ops) drv_line_break(&from.line);
    }
    tell_health();
}

void okid_host_capture_t::lost(std::size_t index, const device_losses& losses) {
    face::pushed_bus& from = bus(index);
    if (losses.socket_overflow > from.losses.socket_overflow) from.loss |= DRV_LOSS_OVERFLOW;
    if (losses.driver > from.losses.driver) from.loss |= DRV_LOSS_DRIVER;
    from.losses = losses;
    from.counts.lost_overflow = losses.socket_overflow;
    from.counts.lost_driver = losses.driver;
    session_->set_losses(index, losses);
}

/// Counts of the source for the stats, and what they tell of the bus. A log without errors has nothing to tell.
void okid_host_capture_t::tell_health() {
    for (std::size_t i = 0; i < buses_.size(); ++i) {
        face::pushed_bus& from = *buses_[i];
        if (!live_ && !from.line.ops && from.counts.error_frames + from.counts.link_down == 0) continue;
        bus_health health{from.counts, std::nullopt};
        if (from.line.ops) {
            from.line.ops->stats(&from.line, &health.counts);
            health.counts.link_down = from.counts.link_down;
            health.counts.link_is_down = from.counts.link_is_down;
        }
        session_->set_health(i, health);
        for (const bus_event& event : from.watch.look(health.counts)) {
            session_->bus_event(i, event.kind, event.text);
            if (event.urgent && live_) say("okid: interface {}: {}\n", from.watch.interface(), event.text);
        }
    }
}

void okid_host_capture_t::serve() {
    if (live_) session_->alive(true);
    if (lines_) lines_->serve(*session_);
    recording_->serve(*session_);
    tell_health();
}

void okid_host_capture_t::open(const char* log) { log_ = std::make_unique<log_frames>(log, config_); }

std::size_t okid_host_capture_t::play(std::size_t frames) {
    if (!log_) throw failure(exit_usage, "no log is open: call okid_host_capture_open() first");
    std::size_t played = 0;
    while (played < frames && !session_->done()) {
        const drv_frame_t* frame = log_->next();
        if (!frame) break;
        ++played;
        if (recording_->get()) recording_->get()->feed(*frame);
        session_->frame(*frame);
    }
    recording_->serve(*session_);
    return played;
}

okid_host_rows_t okid_host_capture_t::rows(bool raw) {
    okid_host_rows_t out = waiting_.take();
    if (raw || !out.rows) return out;
    const std::size_t width = config_.channels.size();
    scaled_.resize(static_cast<std::size_t>(out.count) * width);
    for (std::size_t i = 0; i < width; ++i) {
        const channel_config& channel = config_.channels[i];
        const double scale = channel.layout.scale, offset = channel.layout.offset, factor = channel.si_factor();
        for (std::size_t k = i; k < scaled_.size(); k += width) scaled_[k] = (out.rows[k] * scale + offset) * factor;
    }
    out.rows = scaled_.data();
    return out;
}

void okid_host_capture_t::finish() {
    session& ending = stream();
    if (config_.trigger.source == trigger_source::gpio && !live_ && !ending.triggered())
        require_edge_time(config_, false);
    finished_ = true;
    recording_->finish(ending);
    ending.finish();
}

void okid_host_capture_defaults(okid_host_capture_options_t* options) {
    if (!options) return;
    *options = {};
    options->size = sizeof *options;
    options->identify = 1;
}

int okid_host_capture_create(const okid_host_config_t* config, const okid_host_capture_options_t* options,
                             okid_host_capture_t** out) {
    if (out) *out = nullptr;
    return face::guard([&] {
        face::given(out, config, options);
        *out = new okid_host_capture_t(*config, *options);
    });
}

void okid_host_capture_delete(okid_host_capture_t* self) { delete self; }

int okid_host_capture_frames(okid_host_capture_t* self, const drv_frame_t* frames, size_t count) {
    return face::guard([&] {
        face::given(self);
        face::given_where(count > 0, frames);
        const session& stream = self->stream();
        for (size_t i = 0; i < count && !stream.done(); ++i) self->push(frames[i]);
        self->serve();
    });
}

int okid_host_capture_bytes(okid_host_capture_t* self, size_t bus, const uint8_t* bytes, size_t count,
                            int64_t time_ns) {
    return face::guard([&] {
        face::given(self);
        face::given_where(count > 0, bytes);
        (void)self->stream();
        self->push_bytes(bus, bytes, count, time_ns);
        self->serve();
    });
}

int okid_host_capture_link(okid_host_capture_t* self, size_t bus, int32_t up) {
    return face::guard([&] {
        face::given(self);
        (void)self->stream();
        self->link(bus, up != 0);
    });
}

int okid_host_capture_lost(okid_host_capture_t* self, size_t bus, uint64_t socket_overflow, uint64_t driver) {
    return face::guard([&] {
        face::given(self);
        (void)self->stream();
        self->lost(bus, {socket_overflow, driver});
    });
}

int okid_host_capture_edge(okid_host_capture_t* self, int64_t time_ns) {
    return face::guard([&] {
        face::given(self);
        self->stream().trigger_edge(time_ns);
    });
}

int okid_host_capture_serve(okid_host_capture_t* self) {
    return face::guard([&] {
        face::given(self);
        (void)self->stream();
        self->serve();
    });
}

int okid_host_capture_open(okid_host_capture_t* self, const char* log) {
    return face::guard([&] {
        face::given(self, log);
        self->open(log);
    });
}

int okid_host_capture_play(okid_host_capture_t* self, size_t frames, size_t* played) {
    if (played) *played = 0;
    return face::guard([&] {
        face::given(played, self);
        (void)self->stream();
        *played = self->play(frames);
    });
}

int32_t okid_host_capture_done(const okid_host_capture_t* self) { return self && self->done() ? 1 : 0; }

int okid_host_capture_rows(okid_host_capture_t* self, int32_t raw, okid_host_rows_t* out) {
    if (out) *out = {};
    return face::guard([&] {
        face::given(out, self);
        *out = self->rows(raw != 0);
    });
}

const char* okid_host_capture_events(okid_host_capture_t* self) { return self ? self->take_events() : ""; }

const char* okid_host_capture_stats(okid_host_capture_t* self) {
    const char* out = nullptr;
    (void)face::guard([&] {
        face::given(self);
        out = self->keep(self->state().stats_event().dump() + "\n");
    });
    return out;
}

int okid_host_capture_finish(okid_host_capture_t* self) {
    return face::guard([&] {
        face::given(self);
        self->finish();
    });
}

size_t okid_host_packet_encode(int32_t format, size_t channels, size_t samples, uint32_t sequence, uint32_t time_us,
                               const double* values, uint8_t* out, size_t capacity) {
    const bool fits = format >= DRV_STREAM_INT16 && format <= DRV_STREAM_FLOAT32 && channels > 0 && channels < 256 &&
                      samples > 0 && samples < 256;
    const drv_stream_header_t header{static_cast<drv_stream_format_t>(fits ? format : 0),
                                     static_cast<uint8_t>(channels), static_cast<uint8_t>(samples), sequence, time_us};
    if (!fits || !values || !out || drv_stream_bytes(&header) == 0) return 0;
    size_t written = 0;
    (void)face::guard([&] {
        const double* const end = values + channels * samples;
        if (format == DRV_STREAM_FLOAT32)
            written = drv_stream_encode_floats(&header, std::vector<float>(values, end).data(), out, capacity);
        else
            written = drv_stream_encode_codes(&header, std::vector<std::int32_t>(values, end).data(), out, capacity);
    });
    return written;
}
