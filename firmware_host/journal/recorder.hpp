// SPDX-License-Identifier: MIT
// Raw frames into journals, by a thread of its own. Frames come through one ring a bus, whose writer never waits: a
// disk that stalls costs nothing for as long as the ring lasts, then the oldest frames, which the journal says. A
// second thread asks for every chunk to be put onto the disk, so that a slow disk does not hold up the first one.
#pragma once
#include "acquire/ring_merge.hpp"
#include "journal_header.hpp"
#include "segment_file.hpp"

#include <drv/ring.h>

#include <atomic>
#include <condition_variable>
#include <cstddef>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

namespace okid_host {

struct recorder_options {
    std::optional<double> duration_s;      ///< of the run; a journal that begins with it says how long it was
    std::vector<const watermark*> marks{}; ///< of each bus, for the order of frames; empty: they come in order
};

/// Something to be reported: started, segment, lost, deleted, stopped, finished.
struct recording_news {
    std::string kind, text;
};

struct recording_counts {
    std::uint64_t frames = 0, bytes = 0, lost = 0;
    int segments = 0;
};

/// Asks for fdatasync() whenever there is something new.
class background_sync {
  public:
    background_sync();
    ~background_sync();
    void begin(segment_file& file);
    void written();
    /// Wait for what is under way. @return 0 or the first errno since begin()
    int settle();
    int error() const { return error_; }

  private:
    void run();
    std::mutex mutex_;
    std::condition_variable changed_;
    segment_file* file_ = nullptr;
    bool dirty_ = false, busy_ = false, stopping_ = false;
    std::atomic<int> error_{0};
    std::thread thread_;
};

class recorder {
  public:
    /// Makes the folder and, without a trigger to wait for, the first file. Throws `failure` (exit 2).
    recorder(const live_config& config, const recorder_options& options);
    ~recorder();
    recorder(const recorder&) = delete;
    recorder& operator=(const recorder&) = delete;

    /// For the reader of a bus: the ring to push to.
    drv_ring_t* ring(std::size_t bus) { return rings_[bus]; }
    /// For a recorded log: frames of any bus, waits for room. One thread, and no ring() beside it.
    void feed(const drv_frame_t& frame);

    void start();
    /// The trigger came: what waited is written, from pretrigger_s before it on.
    void trigger(std::int64_t time_ns);
    /// Everything the rings hold is written and the file is closed. The writers of the rings have ended.
    void stop();

    bool failed() const { return failed_; }
    /// What happened since the last call.
    std::vector<recording_news> news();
    /// After stop().
    const recording_counts& counts() const { return counts_; }

  private:
    void run();
    bool serve(bool last);
    void begin_late();
    void take(const drv_frame_t& frame);
    void wait_for_trigger(const drv_frame_t& frame);
    void flush();
    void note_lost(std::uint64_t count);
    void next_segment();
    int open_segment();
    int open_file(const journal_header& header, const drv_journal_time_t& now);
    void fail(int reason, const std::string& what);
    void tell(const char* kind, const std::string& text, bool urgent);

    record_config wanted_;
    realtime_config realtime_;
    journal_header header_;
    std::string stem_, base_;
    std::vector<std::unique_ptr<std::byte[]>> blocks_;
    std::vector<drv_ring_t*> rings_;
    ring_merge merge_;
    std::vector<std::uint64_t> missed_; ///< of each ring, as far as it is written
    std::vector<drv_frame_t> batch_;
    // Frames that wait for the trigger.
    std::vector<drv_frame_t> waiting_;
    std::size_t first_ = 0, used_ = 0;
    bool waits_, overran_ = false, too_early_ = false; ///< too_early_: frames older than from_ns_ are left out
    std::int64_t from_ns_ = 0;
    std::atomic<std::int64_t> trigger_ns_;
    // The file at hand.
    std::unique_ptr<drv_journal_writer_t> writer_;
    std::unique_ptr<segment_file> file_;
    background_sync sync_;
    std::int64_t chunk_since_ns_ = 0;
    recording_counts counts_;
    std::uint64_t closed_bytes_ = 0;
    bool saw_loss_ = false;

    std::mutex mutex_;
    std::condition_variable stopped_;
    bool stopping_ = false;
    std::atomic<bool> failed_{false};
    std::vector<recording_news> news_;
    std::thread thread_;
};

} // namespace okid_host
