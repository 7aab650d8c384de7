// SPDX-License-Identifier: MIT
// Samples of the grid into the accumulator, and a model out of it whenever it is asked for. All memory at the start.
#pragma once
#include "agreement.hpp"
#include "blocks.hpp"
#include "stream_config.hpp"
#include "sum_refiner.hpp"
#include "window_choice.hpp"

#include <okid/accumulator.h>
#include <okid/identify.h>
#include <okid/watch.h>

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

namespace okid_host {

class identifier {
  public:
    /// Throws `failure` (exit 2) when p, rows or the window ask for more than the library or the memory can give.
    explicit identifier(const stream_config& config);

    /// One row of raw numbers of the grid (inputs, outputs, then whatever); a NaN among the first two makes it missing.
    void add(const double* row);
    /// Rows as the stream was made for: double or float, int16_t, int32_t. @return the worst status of the library, >= 0.
    /// Throws `failure` (exit 2) for another type, and for a word that is no code.
    template <class Number> okid_status_t add_rows(const Number* rows, std::size_t count);
    void add_missing(std::int64_t count); ///< 0: another record begins
    void reset();                         ///< forget all samples

    /// The sums as bytes (okid_accumulator_serialise()): any release reads them. Of a stream that refines its correlation sums
    /// stand before them. Throws `failure` (exit 2) when no model has shown yet how many lags these need.
    std::vector<std::byte> state();
    /// Go on where state() stood. Throws `failure` (exit 2) for bytes of another shape.
    void restore(const void* state, std::size_t bytes);
    /// Add all of a state as further records, and as one block for standard deviations. Not with a window or forgetting.
    void merge(const void* state, std::size_t bytes);

    /// Identify from what is there, auto with M, K, R of the plan. @return status of okid_identify_run(); the model stays
    /// valid until the next call
    okid_status_t run(const mass_plan& mass = {});
    /// The same for an update: auto decides which modes there are when that is due, else it follows them.
    okid_status_t update();
    /// Would update() decide which modes there are? A named method does so each time.
    bool decides() const { return !agreed_ || change_at_ || agreed_->due(); }
    /// Method auto of a stream, else none.
    const agreement* agreed() const { return agreed_.get(); }
    /// Is there something to update? With a named method always.
    bool due() const { return decides() || agreed_->follows(); }
    /// Will the next one be due after so many more samples?
    bool due_after(std::int64_t samples) const {
        return agreed_ && decides() ? agreed_->due_after(samples) : samples > 0;
    }
    /// Leave an update out that was due.
    void pass() {
        if (agreed_ && decides()) agreed_->pass();
    }
    const okid_identified_t& model() const { return model_; }
    const okid_identified_t& realised() const { return realised_; } ///< the model before it was refined
    okid_identify_t* decomposition() { return identify_; }          ///< of the last run()
    /// Maximum likelihood of a named method, else none.
    const sum_refiner* refiner() const { return refiner_.get(); }
    /// Standard deviations for the model of the last run(), of its modes and what the plan wants; none when sigma_blocks is
    /// 0 or there is too little to cut into blocks.
    std::optional<deviations> sigma(const mass_plan& plan) {
        if (agreed_) return agreed_->sigma();
        if (refiner_ && refiner_->refined()) return refiner_->sigma(model_, plan);
        return blocks_ && samples_ >= blind_until_
                   ? blocks_->sigma(accumulator_, identify_, model_, plan, chooser_ ? chooser_->chosen().first : 0)
                   : std::nullopt;
    }
    /// The part of the window that the model of the last run() rests on; none where that is not chosen.
    const window_choice* window() const { return chooser_ ? &chooser_->chosen() : nullptr; }
    /// Of each output 100 (1 - innovation / spread), both RMS: how well the model of the last run() predicts the next
    /// sample.
    std::vector<double> predicted_percent();
    const okid_identify_config_t& config() const { return identify_config_; }
    int most_modes() const { return most_order_ / 2; }

    /// Is there no model to compare with, or one as old as the memory?
    bool wants_model() const;
    /// Compare what comes with the model of the last run(), which is at rest.
    void watch_model();
    /// Has the structure changed since the last call? @return how many samples ago that began. A window and a fading memory
    /// have forgotten then what was before (restart_on_change).
    std::optional<std::int64_t> take_change();
    std::int64_t restarts() const { return restarts_; }

    bool exact() const { return !agreed_ && sums_config_.sample != OKID_SAMPLE_DOUBLE; } ///< codes, summed exactly
    std::int64_t lags() const { return lags_; }
    std::int64_t unknowns() const { return q_; }      ///< regressors q = n_u + lags m
    std::int64_t rows();                              ///< regression rows now in the sums
    std::int64_t samples() const { return samples_; } ///< that ever came
    std::int64_t basis();                             ///< samples the model rests on
    okid_accumulator_stats_t stats();                 ///< since the start, restarts or not
    std::size_t sums_bytes() const { return agreed_ ? agreed_->bytes() : sums_bytes_; } ///< of the sums of the whole

  private:
    void flush();
    void reset_counts();
    void create_watch(const stream_config& config);
    bool watch(const double* row);
    template <class Number> std::size_t rows_until_change(const Number* rows, std::size_t count);
    void restart();
    okid_accumulator_stats_t held();
    void create_accumulator(const stream_config& config);
    void create_identifier(const stream_config& config);
    void choose_lags();
    std::size_t refinement_in(const void* state, std::size_t bytes) const;
    template <class Number> okid_status_t absorb(const Number* samples, std::size_t count);
    template <class Number> okid_status_t keep(const Number* row);
    owned_sums read_state(const void* state, std::size_t bytes, const okid_accumulator_config_t& shape) const;

    std::string where_;
    std::size_t m_;
    bool states_only_, saturated_missing_;
    okid_sample_t sample_;
    std::int64_t lags_ = 0;
    int most_order_ = 0;
    std::unique_ptr<agreement> agreed_;
    std::int64_t q_ = 0, memory_samples_ = 0; ///< 0 = everything is kept
    std::vector<double> scale_, offset_, doubles_;
    std::vector<std::int16_t> codes_;
    std::size_t pending_ = 0;
    okid_accumulator_config_t sums_config_{};
    owned_sums whole_;
    std::unique_ptr<std::byte[]> identify_block_;
    std::size_t sums_bytes_ = 0;
    okid_accumulator_t* accumulator_ = nullptr; ///< of whole_
    okid_identify_t* identify_ = nullptr;
    okid_identify_config_t identify_config_{};
    okid_identified_t model_{}, realised_{};
    std::unique_ptr<live_blocks> blocks_;
    std::unique_ptr<sum_refiner> refiner_;
    std::unique_ptr<window_chooser> chooser_;

    bool restart_on_change_ = false, watched_ = false; ///< the watch has a model
    std::unique_ptr<std::byte[]> watch_block_;
    okid_watch_t* watch_ = nullptr;
    std::vector<double> row_;            ///< in engineering units
    std::int64_t samples_ = 0, due_ = 0; ///< ever; when the watch gets a newer model
    std::int64_t blind_until_ = 0;       ///< a fading memory was restored: no blocks of it before
    std::int64_t change_samples_ = 0;    ///< what a change takes to be noticed
    std::optional<std::int64_t> change_at_;
    std::int64_t restarts_ = 0;
    okid_accumulator_stats_t before_{}; ///< counts of what restarts dropped
};

} // namespace okid_host
