// SPDX-License-Identifier: MIT
// Method auto of a stream: the samples of its memory, and what identify_records() finds in them.
//
// Lines, clipping and rest are not visible in any sum. So the newest samples themselves are kept: those of the window,
// or of a growing memory a fixed number, with sums of what came before. The result is that of the same samples in a
// file. Between two such decisions the modes are followed in sums (followed_modes.hpp).
#pragma once
#include "error.hpp"
#include "followed_modes.hpp"
#include "record/older_samples.hpp"
#include "record/record.hpp"
#include "record/screening.hpp"
#include "stream_config.hpp"
#include "stream_state.hpp"

#include <okid/accumulator.h>

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace okid_host {

/// Samples that a stream keeps for auto: the window, or the bound of a growing memory.
std::int64_t kept_samples(const stream_config& config);

/// Bytes that an identification from so many samples takes.
double agreement_bytes(const stream_config& config);

class agreement {
    static constexpr std::int64_t first_judged = 256; ///< samples after which spikes show

  public:
    explicit agreement(const stream_config& config);

    void add(const double* row);              ///< in engineering units; NaN: missing
    void add_missing(std::int64_t count);     ///< 0: another record begins
    void forget();                            ///< all samples; the counts stay
    void reset();                             ///< counts too
    void saturated() { ++counts_.saturated; } ///< the row to come has a code at full scale

    /// Identify what is kept, once for the same samples and plan. @return OKID_OK, or a status < 0 and refuse() says why
    okid_status_t run(const mass_plan& mass);
    const record_result& found() const { return found_; }
    /// The modes of the last run() where they are now; false: there are none to follow.
    bool follow();
    bool follows() const { return followed_.any(); }
    const okid_identified_t& model() const { return model_.view(); } ///< of the last run() or follow()
    const std::optional<deviations>& sigma() const { return sigma_; }
    [[noreturn]] void refuse() const { throw failure(*fault_); } ///< of the last run()
    /// Is an eighth of all samples new since the last run() (a quarter once the oldest are only in sums)? So the number
    /// of runs grows with the logarithm of the stream's length. Counts of samples decide: a slow machine decides alike.
    bool due() const { return asked_ || due_after(came_ - run_at_); }
    bool due_after(std::int64_t samples) const {
        return (older_ && older_->samples() > 0 ? 4 : 8) * samples >= basis();
    }
    void ask() { asked_ = true; } ///< the next run() is due now
    /// Skip this decision: the next one is due as if it had been made, and no mode is followed until then.
    void pass() {
        run_at_ = came_;
        asked_ = false;
        followed_.stop();
    }

    std::int64_t basis() const; ///< samples that the result rests on
    std::int64_t rows() const;  ///< complete ones
    okid_accumulator_stats_t stats() const { return counts_; }
    bool overflowed() const { return !window_ && !older_ && begin_ > forgotten_; } ///< hits were dropped
    std::size_t bytes() const;                                                     ///< of samples and sums

    std::vector<std::byte> state() const;
    void restore(const void* state, std::size_t bytes);
    void merge(const void* state, std::size_t bytes); ///< as further records

  private:
    saved_samples read(const void* state, std::size_t bytes) const;
    std::unique_ptr<older_samples> older_in(const saved_samples& from) const;
    void take(const saved_samples& from, const older_samples* older);
    void push(const double* row);
    const double* at(std::int64_t sample) const { return rows_.data() + static_cast<std::size_t>(sample - base_) * m_; }
    record_set records() const;
    void feed_to(std::int64_t sample);
    void place_hits(const record_set& set, const mass_plan& mass);

    std::string where_;
    std::size_t m_;
    record_options options_;
    bool window_, in_gap_ = false;
    std::int64_t most_;
    std::unique_ptr<older_samples> older_;                         ///< of a growing memory
    std::vector<double> rows_;                                     ///< samples base_ … came_ - 1
    std::int64_t base_ = 0, begin_ = 0, came_ = 0, forgotten_ = 0; ///< kept: begin_ … came_ - 1
    std::vector<std::int64_t> starts_;                             ///< of records
    std::vector<int> hits_;                                        ///< of the stream's plan
    std::size_t gone_ = 0;                                         ///< records that are forgotten
    std::vector<double> missing_;                                  ///< one row
    okid_accumulator_stats_t counts_{};
    std::int64_t run_at_ = 0, decided_on_ = 0; ///< samples that had come, that were kept, at the last run()
    bool asked_ = false;
    followed_modes followed_;
    std::int64_t fed_ = 0; ///< samples that followed_ has, behind those that came by what judges a spike
    usual_values usual_;   ///< of the samples kept, at the last run() or when twice as many had come
    std::int64_t judge_after_ = first_judged;
    std::vector<double> next_; ///< one row, for followed_
    kept_model model_;
    std::optional<deviations> sigma_;
    std::optional<std::pair<std::int64_t, bool>> run_of_; ///< samples and whether M, K, R were wanted
    record_result found_;
    std::optional<failure> fault_;
};

} // namespace okid_host
