// SPDX-License-Identifier: MIT
#include "recorder.hpp"

#include "acquire/host_time.hpp"
#include "acquire/threads.hpp"
#include "error.hpp"

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <csignal>
#include <cstdio>
#include <cstring>
#include <ctime>
#include <filesystem>
#include <fmt/format.h>
#include <limits>
#include <okid/types.h>
#include <random>

namespace okid_host {
namespace {

constexpr std::size_t ring_frames = 1 << 16; // 8 s of 8,000 frames a second
constexpr auto look_every = std::chrono::milliseconds(20);
constexpr std::int64_t chunk_ns = 100000000; // a chunk is written so long after its first frame came
constexpr std::int64_t patience_ns =
    2000000000; // a frame waits for the reader of another bus: no more is lost by a kill
constexpr int last_segment = 9999;
constexpr std::uint64_t megabyte = 1000000;
constexpr std::int64_t no_trigger = std::numeric_limits<std::int64_t>::min();

std::int64_t clock_ns(clockid_t clock) {
    timespec now{};
    clock_gettime(clock, &now);
    return std::int64_t{now.tv_sec} * 1000000000 + now.tv_nsec;
}

drv_journal_time_t time_now() { return {clock_ns(CLOCK_REALTIME), clock_ns(CLOCK_MONOTONIC)}; }

std::uint64_t random_run() {
    std::random_device device;
    return std::uint64_t{device()} << 32 | device();
}

std::string title_of(const live_config& config) {
    for (const auto& [key, text] : config.notes)
        if (key == "title") return text;
    return std::filesystem::path(config.path).stem().string();
}

} // namespace

background_sync::background_sync() : thread_(quiet_thread([this] { run(); })) {}

background_sync::~background_sync() {
    {
        const std::lock_guard<std::mutex> hold(mutex_);
        stopping_ = true;
    }
    changed_.notify_all();
    thread_.join();
}

void background_sync::begin(segment_file& file) {
    const std::lock_guard<std::mutex> hold(mutex_);
    file_ = &file;
    dirty_ = false;
    error_ = 0;
}

void background_sync::written() {
    {
        const std::lock_guard<std::mutex> hold(mutex_);
        dirty_ = true;
    }
    changed_.notify_all();
}

int background_sync::settle() {
    std::unique_lock<std::mutex> hold(mutex_);
    changed_.wait(hold, [this] { return !dirty_ && !busy_; });
    return error_;
}

void background_sync::run() {
    std::unique_lock<std::mutex> hold(mutex_);
    for (;;) {
        changed_.wait(hold, [this] { return dirty_ || stopping_; });
        if (!dirty_) return;
        dirty_ = false;
        busy_ = true;
        hold.unlock();
        const int reason = file_->sync();
        hold.lock();
        busy_ = false;
        if (reason && !error_) error_ = reason;
        changed_.notify_all();
    }
}

recorder::recorder(const live_config& config, const recorder_options& options)
    : wanted_(config.record), realtime_(config.realtime), stem_(name_stem(title_of(config))), merge_(patience_ns),
      missed_(config.buses.size(), 0), batch_(256), waits_(config.trigger.source != trigger_source::immediate),
      trigger_ns_(no_trigger), writer_(std::make_unique<drv_journal_writer_t>()) {
    prepare_folder(wanted_.directory);
    std::signal(SIGXFSZ, SIG_IGN); // a file beyond its limit is an error of write(), not the end of the program
    for (std::size_t i = 0; i < config.buses.size(); ++i) {
        blocks_.emplace_back(new std::byte[drv_ring_memsize(ring_frames)]());
        rings_.push_back(drv_ring_create(ring_frames, blocks_.back().get(), drv_ring_memsize(ring_frames)));
        merge_.add(rings_.back(), ring_frames / 4 * 3, options.marks.empty() ? nullptr : options.marks[i]);
    }
    if (waits_) waiting_.resize(config.record.pretrigger_frames);
    header_.version = OKID_VERSION;
    header_.config_name = config.path;
    header_.run = random_run();
    header_.buses = journal_buses(config);
    if (!waits_) header_.duration_s = options.duration_s;
    header_.texts = config.texts;
    if (waits_) return;
    if (const int reason = open_segment())
        throw failure(exit_usage,
                      fmt::format("{}: no journal can be begun there: {}", wanted_.directory, std::strerror(reason)));
}

recorder::~recorder() { stop(); }

void recorder::start() {
    thread_ = quiet_thread([this] { run(); });
    put_first(thread_, realtime_, 0.5); // it needs little, but a quarter of a second is all it may lose
}

void recorder::trigger(std::int64_t time_ns) { trigger_ns_ = time_ns; }

void recorder::stop() {
    if (!thread_.joinable()) return;
    {
        const std::lock_guard<std::mutex> hold(mutex_);
        stopping_ = true;
    }
    stopped_.notify_all();
    thread_.join();
}

void recorder::feed(const drv_frame_t& frame) {
    while (!failed_ && drv_ring_used(rings_[0]) >= ring_frames)
        std::this_thread::sleep_for(std::chrono::milliseconds(1));
    drv_ring_push(rings_[0], &frame, 1);
}

std::vector<recording_news> recorder::news() {
    const std::lock_guard<std::mutex> hold(mutex_);
    return std::exchange(news_, {});
}

void recorder::tell(const char* kind, const std::string& text, bool urgent) {
    if (urgent) say("okid: {}\n", text);
    const std::lock_guard<std::mutex> hold(mutex_);
    news_.push_back({kind, text});
}

/// The file keeps what it has; the run goes on without a journal.
void recorder::fail(int reason, const std::string& what) {
    if (failed_) return;
    failed_ = true;
    tell("stopped",
         fmt::format(
             "recording stopped: {} cannot be written: {}; the {} frames recorded so far stay, what comes now is "
             "not recorded",
             what, std::strerror(reason), counts_.frames),
         true);
}

/// A file with the header in it, under a name that was free. @return 0 or a positive errno
int recorder::open_file(const journal_header& header, const drv_journal_time_t& now) {
    for (int twin = 1;; ++twin) { // another run may have begun within the same second
        const std::string base = header.segment > 1
                                     ? base_
                                     : fmt::format("{}/{}-{}{}", wanted_.directory, stem_, utc_compact(header.real_ns),
                                                   twin > 1 ? fmt::format("-{}", twin) : "");
        if (header.segment == 1 && has_segments(base)) continue;
        auto file = std::make_unique<segment_file>();
        int reason = file->create(fmt::format("{}-{:04}.okj", base, header.segment));
        if (reason == 0) {
            const drv_journal_sink_t sink = file->sink();
            const std::uint32_t sequence = writer_->sequence;
            drv_journal_begin(writer_.get(), &sink, header.run);
            reason = -write_journal_header(*writer_, header, now);
            if (reason == 0) reason = file->publish();
            if (reason == EEXIST) writer_->sequence = sequence;
        }
        if (reason == EEXIST && header.segment == 1) continue;
        if (reason) return reason;
        base_ = base;
        file_ = std::move(file);
        return 0;
    }
}

/// @return 0 or a positive errno
int recorder::open_segment() {
    const drv_journal_time_t now = time_now();
    if (header_.real_ns == 0 || header_.segment > last_segment) {
        header_.segment = 1;
        header_.real_ns = now.real_ns;
        header_.monotonic_ns = now.monotonic_ns;
        header_.started = utc_text(now.real_ns);
    }
    const auto size = static_cast<std::uint64_t>(wanted_.segment_mb * megabyte);
    for (const std::string& gone :
         make_room(wanted_.directory, size, static_cast<std::uint64_t>(wanted_.max_mb * megabyte)))
        tell("deleted", fmt::format("{} deleted: max_mb = {:g} is reached", gone, wanted_.max_mb), false);
    if (const int reason = open_file(header_, now)) return reason;
    sync_.begin(*file_);
    ++counts_.segments;
    tell(header_.segment > 1 ? "segment" : "started", file_->path(), false);
    return 0;
}

void recorder::next_segment() {
    const drv_journal_time_t now = time_now();
    int reason = sync_.settle();
    if (!reason) reason = -drv_journal_end(writer_.get(), 1, &now);
    if (!reason) reason = file_->sync();
    if (reason) return fail(reason, file_->path());
    closed_bytes_ += writer_->bytes;
    ++header_.segment;
    if ((reason = open_segment())) fail(reason, wanted_.directory);
}

void recorder::flush() {
    const std::uint32_t frames = drv_journal_waiting(writer_.get());
    if (frames == 0 || failed_) return;
    const drv_journal_time_t now = time_now();
    if (const int code = drv_journal_flush(writer_.get(), &now)) return fail(-code, file_->path());
    counts_.frames += frames;
    sync_.written();
    constexpr std::uint64_t largest_chunk = DRV_JOURNAL_HEADER + DRV_JOURNAL_PAYLOAD;
    if (static_cast<double>(writer_->bytes + largest_chunk) > wanted_.segment_mb * megabyte) next_segment();
}

void recorder::note_lost(std::uint64_t count) {
    flush();
    drv_journal_lost(writer_.get(), count);
    counts_.lost += count;
    tell("lost", fmt::format("{} frames were not recorded: the disk was too slow", count), !saw_loss_);
    saw_loss_ = true;
}

void recorder::take(const drv_frame_t& frame) {
    if (too_early_ && frame.time_ns < from_ns_) return;
    too_early_ = false; // from the first one on all of them, should the clock be set back
    if (drv_journal_waiting(writer_.get()) == 0) chunk_since_ns_ = clock_ns(CLOCK_MONOTONIC);
    if (drv_journal_add(writer_.get(), &frame) != 0) return;
    flush();
    chunk_since_ns_ = clock_ns(CLOCK_MONOTONIC);
    (void)drv_journal_add(writer_.get(), &frame);
}

void recorder::wait_for_trigger(const drv_frame_t& frame) {
    if (used_ == waiting_.size()) {
        first_ = (first_ + 1) % waiting_.size();
        overran_ = true;
    } else {
        ++used_;
    }
    waiting_[(first_ + used_ - 1) % waiting_.size()] = frame;
}

/// The trigger has come: the file, then the frames from pretrigger_s before it on.
void recorder::begin_late() {
    waits_ = false;
    header_.trigger_ns = trigger_ns_;
    from_ns_ = trigger_ns_ - std::llround(wanted_.pretrigger_s * 1e9);
    too_early_ = true;
    if (const int reason = open_segment()) return fail(reason, wanted_.directory);
    if (overran_ && waiting_[first_].time_ns > from_ns_)
        tell("lost", "more frames came than were expected: less than pretrigger_s is there", true);
    for (std::size_t k = 0; k < used_ && !failed_; ++k) take(waiting_[(first_ + k) % waiting_.size()]);
    waiting_ = {};
}

/// What the rings hold. @return false when they were empty
bool recorder::serve(bool last) {
    bool any = false;
    while (!failed_) {
        if (waits_ && trigger_ns_ != no_trigger) begin_late();
        const std::size_t count = merge_.take(batch_.data(), batch_.size());
        for (std::size_t bus = 0; bus < rings_.size(); ++bus) {
            const std::uint64_t missed = drv_ring_missed(rings_[bus]);
            if (missed != missed_[bus] && !waits_) note_lost(missed - missed_[bus]);
            missed_[bus] = missed;
        }
        for (std::size_t i = 0; i < count; ++i) waits_ ? wait_for_trigger(batch_[i]) : take(batch_[i]);
        any |= count > 0;
        if (count == 0) break;
    }
    if (waits_ || failed_) return any;
    if (last || clock_ns(CLOCK_MONOTONIC) - chunk_since_ns_ >= chunk_ns) flush();
    if (const int reason = sync_.error()) fail(reason, file_->path());
    return any;
}

void recorder::run() try {
    for (bool stopping = false; !failed_ && !stopping;) {
        {
            std::unique_lock<std::mutex> hold(mutex_);
            stopping = stopped_.wait_for(hold, look_every, [this] { return stopping_; });
        }
        (void)serve(false);
    }
    while (!failed_ && serve(true)) {
    }
    if (!file_) return;
    int reason = sync_.settle();
    const drv_journal_time_t now = time_now();
    if (!failed_) reason = reason ? reason : -drv_journal_end(writer_.get(), 0, &now);
    if (!failed_) reason = reason ? reason : file_->sync();
    if (reason) fail(reason, file_->path());
    counts_.bytes = closed_bytes_ + writer_->bytes;
    file_->close();
    if (!failed_)
        tell("finished",
             fmt::format("{} frames recorded into {}{}, {:.1f} MB{}", counts_.frames, file_->path(),
                         counts_.segments > 1 ? fmt::format(" and {} before it", counts_.segments - 1) : "",
                         static_cast<double>(counts_.bytes) / 1e6,
                         counts_.lost ? fmt::format("; {} lost because the disk was too slow", counts_.lost) : ""),
             true);
} catch (const std::exception& why) { // no memory, or a folder that fails while it is listed
    failed_ = true;
    tell("stopped", fmt::format("recording stopped: {}", why.what()), true);
}

} // namespace okid_host
