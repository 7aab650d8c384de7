// SPDX-License-Identifier: MIT
// Channels of several messages onto one sample grid: by sequence counter where a message has one, else by the cadence of
// its time stamps. Nothing is interpolated: a sample that did not arrive is NaN and part of a marked gap.
//
// Frames of one message (and multiplexor value) are a lane. The order in which its frames arrive is the order of its
// samples. Counters of all lanes count the same samples when they stand close together at the start; a lane whose counter
// is unrelated, or that has none, is placed by the line of its earliest arrivals. The grid begins with the first sample
// for which every lane has been heard, so a stream may be joined in the middle. A sample goes out when it is complete, or
// when the newest nine frames of every lane that lacks it lie beyond it, or when the others are silence_patience_s ahead of
// a lane that is silent: then that lane is gone, and the others do not wait for it until it is heard again.
#pragma once
#include "config/config.hpp"

#include <drv/clock_fit.h>
#include <drv/frame.h>

#include <array>
#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <vector>

namespace okid_host {

/// Why samples are missing; exclusive.
enum class gap_cause { socket_overflow, driver, sequence, crc, link_down, stall };
const char* gap_cause_name(gap_cause cause);

/// A run of missing samples of one channel; `first`..`last` count from the first sample of the grid.
struct grid_gap {
    std::size_t channel = 0;
    std::int64_t first = 0, last = 0, count = 0;
    gap_cause cause = gap_cause::sequence;
    std::int64_t within = 0; ///< the gap may lie up to so many samples later: frames without a counter came together
};

/// Where samples go. The row holds one number a channel, raw (before scale and offset), NaN where missing.
class grid_sink {
  public:
    virtual ~grid_sink() = default;
    virtual void on_sample(std::int64_t index, const double* row) = 0;
    /// `count` samples from `index` on are missing on all channels.
    virtual void on_missing(std::int64_t index, std::int64_t count) = 0;
    virtual void on_gap(const grid_gap& gap) = 0;
};

/// A silent lane is waited for this long: an adapter, a sender or this computer may be late by as much, and nothing is
/// lost. Less at high rates with many channels, for which there is no memory (most_rows_bytes).
constexpr double silence_patience_s = 6;
constexpr double most_rows_bytes = 64e6;

/// A stamp further ahead is no time but an error.
constexpr double longest_silence_ns = 400 * 86400e9;

/// Counts of one bus. too_late: of those out of order, the frames whose sample had gone out without them. lost: frames
/// missing on the grid, by cause.
struct grid_bus_counts {
    std::uint64_t received = 0, out_of_order = 0, too_late = 0, duplicate = 0, decode_errors = 0;
    std::array<std::uint64_t, 6> lost{};
};

struct grid_channel_counts {
    std::int64_t expected = 0, received = 0;
    std::int64_t uncertain = 0; ///< places at which samples may be missing, unmarked
    double place_std_s = 0;     ///< by which the place beside channels of other buses is not known
};

/// What the first frames of a lane tell of its place.
struct lane_start {
    const drv_frame_t* frame = nullptr; ///< the first one
    std::size_t family = 0;             ///< the lane whose counter its counter is compared with; its own number if none
    std::int64_t index = 0;             ///< of the first frame, beside those of its family
    std::vector<std::int64_t> before;   ///< frames of each lane that had come
    std::int64_t first_ns = 0, newest_ns = 0, frames = 0;
    std::int64_t close = 0, shared = 0, ends = 0; ///< frames close behind one of the lane, of the bus; bursts
    std::int64_t begins = 0, finishes = 0;        ///< bursts of the bus whose first, whose last frame was of the lane
    double end_ns = 0;
    std::array<double, 2> spread_ns{}; ///< how late the last frames of bursts were behind their numbers: least and most
    std::array<double, 2> least_ns{};  ///< of each half: by how much the earliest arrival was behind its number
    std::array<std::int64_t, 2> count{};

    void add(std::int64_t number, std::int64_t time_ns, std::int64_t middle_ns, double period_ns);
    double earliest_ns(double period_ns) const;
    double due_ns(double period_ns) const;
    bool bursty() const;
};

class grid {
  public:
    grid(const live_config& config, grid_sink& sink);

    /// Decode a frame and place it. O(channels of the message), no heap.
    void push(const drv_frame_t& frame);

    /// The stream ends: everything that waits goes out. A last sample that was cut by the end is left off.
    void finish();

    /// Let no sample from `count` on go out.
    void set_limit(std::int64_t count) { limit_ = count; }
    /// The interface of a bus went down, or is up.
    void set_link(std::size_t bus, bool down) { down_[bus] = down; }
    std::int64_t emitted() const { return next_; } ///< samples given to the sink, missing ones included
    bool started() const { return anchored_; }
    /// The earliest time stamp of a sample the sink was just given.
    std::int64_t time_ns(std::int64_t index) const { return times_[static_cast<std::size_t>(index & mask_)]; }
    grid_bus_counts bus(std::size_t index) const;
    grid_channel_counts channel(std::size_t index) const;
    /// Channels of which no frame was ever received.
    std::vector<std::size_t> silent_channels() const;

  private:
    static constexpr std::int64_t never = std::numeric_limits<std::int64_t>::min() / 2;
    struct cause_mark {
        std::int64_t first = 0, last = -1, within = 0;
        gap_cause cause = gap_cause::sequence;
    };
    /// One that waits; how long the lane was heard until it came, silences left out.
    struct late_frame : drv_frame_t {
        std::int64_t heard_ns = 0;
    };
    struct lane {
        std::uint32_t key = 0, mask = 0; ///< mask: which bits of the identifier are in the key, 0 = all
        int next = -1;                   ///< another lane of the same identifier (multiplexing)
        std::size_t bus = 0;
        std::vector<std::size_t> channels;
        std::optional<drv_signal_t> sequence;
        std::vector<multiplexor> selectors;
        bool pages = false;      ///< counted and multiplexed
        bool repeated = false;   ///< counted, in every page of a multiplexed message
        std::int64_t stride = 1; ///< the counter rises by so much from sample to sample
        std::int64_t page = 0;   ///< so many frames behind the first page of its sample, -1: not known
        // Where the lane stands on the grid.
        bool waiting = false, heard = false;
        bool gone = false;         ///< silent for longer than others wait
        std::uint64_t counter = 0; ///< as last received
        std::int64_t last = 0;     ///< unwrapped place of the newest frame
        std::int64_t time_ns = 0;  ///< its stamp
        std::uint8_t loss = 0;     ///< DRV_LOSS_… reported by the bus since
        // A counter far off is believed when a second frame agrees.
        bool suspected = false;
        std::int64_t suspect_age = 0; ///< frames that came in their places since
        drv_frame_t suspect{};
        // The line of least delays: when the newest frame was due on it.
        double phase_ns = 0;
        // Without a counter: the fit of that line, frames that wait in the order of their arrival, and what is known of
        // how late they are.
        drv_clock_fit_t clock{};
        double beat_ns = 0;
        double early = 0;   ///< of the line the earliest was, of late, periods
        double on_time = 0; ///< of a period; what is later was held up, or a sample before it is missing
        std::vector<late_frame> late;
        std::int64_t heard_ns = 0;        ///< as late_frame has it, of the newest
        std::size_t placed = 0;           ///< of `late`: they are on the grid already
        std::size_t seen = 0, which = 0;  ///< of `late`: looked at; the last one that was about as early as any
        double least = 0;                 ///< how late the earliest of those was, periods
        double patience = 0;              ///< periods for which the oldest waits before a loss is believed
        std::int64_t newest_ns = 0;       ///< stamp of the newest frame that came
        double spread = 0, tail_late = 0; ///< how late the last frame of a burst was, of late and now, periods
        std::array<double, 2> usual{};    ///< how late the least late was, of the decision time before and of this one
        std::int64_t usual_from = 0;      ///< the place at which this one began
        double known = 0;                 ///< bursts of late, and the shares of them that were less late than edges
        std::array<double, 9> share{};
        std::int64_t tail = 0, tail_ns = 0;  ///< place and stamp of the newest frame placed, for the line
        std::int64_t ahead = 0;              ///< frames in a row that came before their time
        std::int64_t in_burst = 0;           ///< frames of the burst at hand
        std::int64_t frames = 0, bursts = 0; ///< of all bursts, for the share of those that hold several
        std::int64_t uncertain = 0; ///< times polls slipped past a sample, or samples are missing: the two look alike
        std::int64_t slips = 0;     ///< by so many places the line is behind the samples for it
        std::int64_t slip_at = never, lost_at = never; ///< places of the newest slip and loss
        // How late the least late of each eighth of the decision time was, less how far the line has moved since.
        std::array<double, 64> floors{};
        std::size_t floor_count = 0;
        double floor_now = 0, moved = 0;
        std::int64_t floor_from = 0;
        // Of a lane of single frames: bursts of two between others on the raster of polls, the places of the newest.
        double silence = 0, inside = 0; ///< before the burst at hand and before its newest, periods
        double pairs = 0, singles = 0;  ///< how many of all bursts
        std::array<std::int64_t, 32> pair_at{};
        std::size_t pair_count = 0;
        std::int64_t newest_pair = never, slips_before = 0;
        bool flickers = false; ///< polls are about to slip, or just have; how many before
        // The newest frames: what lies before all of them does not come any more (a frame may be eight places late).
        std::array<std::int64_t, 9> recent{};
        std::size_t recent_at = 0;
        std::int64_t passed = std::numeric_limits<std::int64_t>::min();
        // The gap that is open.
        std::int64_t gap_first = -1, gap_count = 0;
        std::int64_t gap_alone = 0; ///< of its samples, those that other lanes have
        std::int64_t expected = 0, received = 0;
        std::array<cause_mark, 64> marks{};
        std::size_t mark_count = 0;
    };
    void build_lanes(const live_config& config);
    bool push_to_lanes(const drv_frame_t& frame, std::uint32_t mask);
    void push_to(lane& l, const drv_frame_t& frame);
    bool decode(lane& l, const drv_frame_t& frame);
    static bool one_message(const lane& a, const lane& b);
    static std::int64_t step_of(const lane& l, std::uint64_t from, std::uint64_t to);
    static void find_page(lane& l, std::uint64_t counter, const lane& beside, std::uint64_t its_counter);
    void find_strides();
    bool read_counter(const lane& l, const drv_frame_t& frame, std::uint64_t& counter) const;

    void hold_until_anchored(lane& l, const drv_frame_t& frame);
    bool placed_by_time() const;
    void gather_starts(std::vector<lane_start>& starts);
    std::size_t first_of_sample(const std::vector<lane_start>& starts, std::size_t bus) const;
    std::int64_t start_offset(const std::vector<lane_start>& starts, std::size_t l, std::size_t root) const;
    void settle_start(lane& l, const lane_start& start);
    void anchor();
    void join(lane& l, const drv_frame_t& frame);
    void end_joining(lane& l);
    double gather_ns() const;
    const lane* kin_of(const lane& l, std::uint64_t counter, std::int64_t& index) const;
    void follow_counted(lane& l, std::int64_t time_ns, std::int64_t step);
    void place(lane& l, const drv_frame_t& frame);
    void place_by_counter(lane& l, const drv_frame_t& frame, std::uint64_t counter);
    void move_on(lane& l, const drv_frame_t& frame, std::int64_t index, bool pause, std::int64_t within = 0);
    bool count_rounds(const lane& l, const drv_frame_t& frame, std::int64_t& step) const;
    void doubt_suspect(lane& l);
    void drop_suspect(lane& l);
    void recall_suspect(lane& l);
    void accept_jump(lane& l, const drv_frame_t& frame);
    void end_suspicion(lane& l);
    void judge_jump(lane& l, const drv_frame_t& frame, std::uint64_t counter);
    std::int64_t place_restart(const lane& l, const drv_frame_t& frame, std::uint64_t counter) const;
    void begin_cadence(lane& l, double due_ns);
    void place_by_cadence(lane& l, const drv_frame_t& frame);
    double lateness(const lane& l, const drv_frame_t& frame, std::size_t before) const;
    void settle_overdue(std::int64_t now_ns);
    void settle(lane& l, std::int64_t now_ns, bool all);
    bool together(const lane& l, std::size_t which) const;
    std::size_t burst_end(const lane& l, std::size_t of) const;
    void look_at_late(lane& l);
    void place_late(lane& l, std::size_t count);
    std::array<double, 4> least_late(const lane& l) const;
    bool in_two_steps(const lane& l) const;
    bool catches_up(const lane& l) const;
    bool on_the_move(const lane& l) const;
    bool only_late(const lane& l, bool ended) const;
    double usually_late(const lane& l) const;
    void note_lateness(lane& l, std::int64_t index);
    void judge_late(lane& l, bool ended);
    void judge_shift(lane& l, bool alike, std::int64_t times, double waited, bool ended);
    bool shift_stays(const lane& l, double more, std::int64_t times, bool ended) const;
    std::int64_t floor_periods() const { return hold_ / 8; }
    bool restless(const lane& l) const;
    static double step_over_sigma(const std::vector<double>& values, std::size_t behind, double& by);
    bool floors_apart(const lane& l, double& by, double& sigma) const;
    bool steady(const lane& l, std::size_t begin, std::size_t end, bool ended) const;
    bool loss_reported(const lane& l, std::size_t last) const;
    bool may_slip(const lane& l) const;
    bool flickered(const lane& l) const;
    double silence_before(const lane& l, std::size_t which) const;
    static bool on_raster(double silence);
    static bool is_pair(const lane& l);
    void note_pair(lane& l, double silence_behind);
    bool pairs_gather(const lane& l, double pairs, double behind) const;
    bool bursts_alike(const lane& l, std::int64_t& times) const;
    double place_std_s(const lane& l) const;
    static void slip(lane& l, std::int64_t by);
    void end_burst(lane& l, std::int64_t index);
    void place_after_loss(lane& l, std::int64_t lost);
    void beat(lane& l, const drv_frame_t& frame, std::int64_t step, std::int64_t within = 0);
    void follow_line(lane& l, const drv_frame_t& frame, std::int64_t index, double late_ns);
    bool awaited(const lane& l, std::int64_t index) const;
    void note_loss(lane& l, std::int64_t from, std::int64_t to, bool pause, std::int64_t within);
    void insert(lane& l, std::int64_t index, const drv_frame_t& frame);

    bool may_come(const lane& l) const;
    void leave_behind();
    void drain(bool all);
    void emit_front();
    void skip_to(std::int64_t index);
    void extend_gap(lane& l, std::int64_t first, std::int64_t count);
    bool stalled(const lane& l) const { return static_cast<double>(l.gap_alone) > rate_hz_; }
    gap_cause silent_cause(const lane& l) const;
    void close_gap(lane& l, bool resumed);

    double* row(std::int64_t index) { return values_.data() + static_cast<std::size_t>(index & mask_) * width_; }
    const std::uint8_t* present(std::int64_t index) const {
        return present_.data() + static_cast<std::size_t>(index & mask_) * lanes_.size();
    }
    std::uint8_t* present(std::int64_t index) {
        return present_.data() + static_cast<std::size_t>(index & mask_) * lanes_.size();
    }
    std::int64_t& slot(std::int64_t index) { return slots_[static_cast<std::size_t>(index & mask_)]; }
    void open_rows(std::int64_t upto);

    grid_sink& sink_;
    double rate_hz_, period_ns_;
    std::vector<channel_config> channels_;
    std::vector<lane> lanes_;
    std::vector<int> table_;           ///< hash of identifier to lane
    std::vector<std::uint32_t> masks_; ///< of identifiers that stand for many, the strictest first
    std::size_t width_ = 0;
    std::int64_t reorder_ = 16, window_ = 0, mask_ = 0;
    std::int64_t lag_ = 0;       ///< samples by which a silent lane may be behind
    std::size_t most_held_ = 0;  ///< frames without a counter that may wait: those of a stall that is made up for
    std::int64_t hold_ = 0;      ///< periods a frame without a counter may wait for those that tell its place
    std::size_t late_lanes_ = 0; ///< lanes with such frames
    std::vector<double> values_, decoded_;
    std::vector<std::uint8_t> present_;
    std::vector<std::int64_t> slots_; ///< how many lanes a row has
    std::vector<std::int64_t> times_; ///< the earliest stamp of a row, 0 while it is empty
    std::int64_t limit_ = std::numeric_limits<std::int64_t>::max();
    std::int64_t next_ = 0, opened_ = 0; ///< next row to go out; rows below opened_ are laid out in the ring
    bool anchored_ = false;
    std::size_t heard_ = 0, most_before_ = 0;       ///< lanes heard; frames that may wait before the grid begins
    bool by_time_ = false;                          ///< the place of some lane depends on stamps
    std::int64_t all_heard_ns_ = 0;                 ///< when the last lane was heard for the first time
    std::vector<std::pair<int, drv_frame_t>> held_; ///< frames before the grid begins
    std::vector<grid_bus_counts> buses_;
    std::vector<bool> down_; ///< of each bus
};

} // namespace okid_host
