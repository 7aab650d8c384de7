// SPDX-License-Identifier: MIT
// Maximum likelihood in a stream of a named method: correlation sums beside the accumulator, of the same samples, and each
// model refined from them (okid/refine.h).
//
// How many lags the sums need depends on the slowest mode, and noise that has a colour goes through a filter before it
// is summed. So the first samples are kept and refined as a record, until a model of a fixed number of them gives both;
// from then on there are only sums. The number does not depend on the speed of a replay. A state that is put back or
// merged into a stream without sums brings its lags and its filter along; streams can be merged that have both in
// common.
#pragma once
#include "record/record_refine.hpp"
#include "stream_config.hpp"

#include <okid/correlation.h>

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace okid_host {

/// Most bytes of it.
double sum_refiner_bytes(const stream_config& config);

class sum_refiner {
  public:
    explicit sum_refiner(const stream_config& config);

    /// How many of `count` samples may come before the next look at wants_model().
    std::size_t room(std::size_t count) const;
    /// The samples that the accumulator takes, and what is missing.
    template <class Number> void add(const Number* rows, std::size_t count);
    void gap();
    void reset();

    /// Is it time to choose the lags?
    bool wants_model() const { return !sums_ && kept() == next_look_; }
    /// Choose them, and the filter. @param model  NULL: there is none yet
    void choose_lags(const okid_identified_t* model);

    /// Lags, filter and sums as bytes, for put_back() and merge(); how many of a longer state they are, 0: it has none.
    std::vector<std::byte> state();
    static std::size_t bytes_in(const void* state, std::size_t bytes);
    /// Are there sums, to take a state of?
    bool summing() const { return static_cast<bool>(sums_); }
    /// Throw `failure` (exit 2) for bytes of another shape, of other lags or another filter; then nothing has changed.
    void put_back(const void* state, std::size_t bytes);
    void merge(const void* state, std::size_t bytes);

    /// Refine `model`, in place; it looks into this object then. Nothing where the refinement is rejected: fault() says
    /// why.
    void refine(okid_identified_t& model);
    const std::optional<refinement>& refined() const { return found_.refined; } ///< of the last refine()
    const std::string& fault() const { return fault_; }
    /// Of a refined model.
    deviations sigma(const okid_identified_t& model, const mass_plan& plan) const {
        return deviations_of(model, found_.replicates, plan);
    }

  private:
    struct owned_correlation {
        std::unique_ptr<std::byte[]> block;
        std::size_t bytes = 0;
        okid_correlation_t* sums = nullptr;
        owned_correlation() = default;
        /// Room for such sums, and as much for those of numbers behind a filter. Throws `failure` (exit 1).
        explicit owned_correlation(okid_correlation_config_t config);
        explicit operator bool() const { return sums != nullptr; }
    };
    struct taken {
        std::optional<refinement> refined;
        std::unique_ptr<refined_arrays> arrays;
        std::vector<replicate_model> replicates;
    };
    /// What a state holds.
    struct carried {
        double whiteness = 0;
        std::vector<double> filter;
        owned_correlation sums;
    };
    carried read(const void* state, std::size_t bytes) const;
    void take_in(carried&& other);
    template <class Number> void keep(const Number* row);
    std::int64_t kept() const { return static_cast<std::int64_t>(waiting_.size() / m_); }
    std::int32_t lags_of(const okid_identified_t& model) const;
    void make(std::int32_t lags);
    void sum_waiting();
    template <class Number> void feed(const Number* rows, std::size_t count);
    template <class Number> void feed_filtered(const Number* rows, std::size_t count);
    okid_status_t sum(const double* rows, std::size_t count);
    okid_status_t sum(const float* rows, std::size_t count);
    okid_status_t sum(const std::int16_t* rows, std::size_t count);
    okid_status_t sum(const std::int32_t* rows, std::size_t count);
    template <class Function> void each_run(std::int64_t from, Function&& function) const;
    likeliest_model of_waiting(const okid_identified_t& start) const;
    likeliest_model of_sums(const okid_identified_t& start);

    okid_correlation_config_t config_; ///< lags: the most
    std::size_t m_;
    double rate_hz_;
    bool only_where_it_serves_, constants_;
    std::vector<double> scale_, offset_;
    std::vector<double> waiting_;                 ///< complete rows, raw
    std::vector<std::int64_t> gaps_{};            ///< before which of them something is missing
    std::int64_t next_look_, memory_ = INT64_MAX; ///< memory: samples that waiting ones may be old
    owned_correlation sums_;
    bool in_units_ = false;                ///< numbers in engineering units are summed, not what came
    std::int32_t given_lags_ = 0;          ///< of a state that was put back: they and the filter outlast reset()
    std::vector<double> filter_{1}, past_; ///< of the noise; the samples in engineering units that it goes back to
    std::vector<double> numbers_;          ///< a piece of them as the sums take it
    double whiteness_ = 0;                 ///< of the first samples behind it
    taken found_;
    std::string fault_;
};

} // namespace okid_host
