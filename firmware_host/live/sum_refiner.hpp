// SPDX-License-Identifier: MIT
// Maximum likelihood in a stream of a named method: correlation sums beside the accumulator, of the same samples, and each
// model refined from them (okid/refine.h).
//
// How many lags the sums need depends on the slowest mode. So the first samples are kept as they are until a model of so and
// so many of them, the same ones at any speed of a replay, tells it; from then on there are only sums.
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
    /// Choose them. @param model  NULL: there is none yet
    void choose_lags(const okid_identified_t* model);

    /// Refine `model`, in place; it looks into this object then. Nothing where it is of no use: fault() says why.
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
        okid_correlation_t* sums = nullptr;
        explicit operator bool() const { return sums != nullptr; }
    };
    struct taken {
        std::optional<refinement> refined;
        std::unique_ptr<refined_arrays> arrays;
        std::vector<replicate_model> replicates;
    };
    template <class Number> void keep(const Number* row);
    std::int64_t kept() const { return static_cast<std::int64_t>(waiting_.size() / m_); }
    std::int32_t lags_of(const okid_identified_t& model) const;
    owned_correlation make(std::int32_t lags) const;
    void feed(okid_correlation_t* to, const double* rows, std::size_t count) const;
    void feed_waiting(okid_correlation_t* to) const;
    std::string take(const okid_identified_t& start, okid_correlation_t* from, okid_identified_t& model);

    okid_correlation_config_t config_; ///< lags: the most
    std::size_t m_;
    double rate_hz_;
    bool only_where_it_serves_, constants_;
    std::vector<double> scale_;
    std::vector<double> waiting_;      ///< complete rows, raw
    std::vector<std::int64_t> gaps_{}; ///< before which of them something is missing
    std::int64_t next_look_;
    owned_correlation sums_;
    taken found_;
    std::string fault_;
};

} // namespace okid_host
