// SPDX-License-Identifier: MIT
// The modes that auto found in a stream, followed from one of its decisions to the next: the stream at its own rate, half of it,
// a quarter … into sums of fixed size, and out of them the models that carry the modes. An update costs the same however long
// the stream has run.
#pragma once
#include "consensus/owned_sums.hpp"
#include "consensus/rate_chain.hpp"
#include "record/record.hpp"
#include "stream_config.hpp"

#include <okid/accumulator.h>

#include <cstddef>
#include <cstdint>
#include <optional>
#include <utility>
#include <vector>

namespace okid_host {

class followed_modes {
  public:
    /// @param window  samples that count, 0: all. Throws `failure` (exit 3) when memory does not suffice
    followed_modes(const stream_config& config, std::int64_t window);
    static double bytes(const stream_config& config, std::int64_t window);

    void add(const double* row);          ///< in engineering units; NaN: missing
    void add_missing(std::int64_t count); ///< 0: another record begins
    void reset();

    /// Follow these modes; their carriers now define where they are.
    void begin(const record_result& found);
    void stop() { groups_.clear(); } ///< until the next begin()
    bool any() const { return !groups_.empty(); }
    /// Frequencies and damping of the modes that begin() was given, moved as their carriers moved since, and their deviations.
    /// @param kept  share that the samples at begin() are of those of now
    void follow(double kept, kept_model& to, std::optional<deviations>& sigma);

  private:
    struct followed {
        std::size_t mode;                  ///< of begin()
        double frequency = 1, damping = 1; ///< share of the carrier's move that it makes
    };
    /// Modes that one model carries.
    struct group {
        std::size_t rate;
        okid_identify_config_t config;
        std::vector<followed> modes;
        std::vector<mode_shift> wanted;
        std::vector<std::optional<std::pair<double, double>>> then; ///< frequency and damping at begin()
    };
    static okid_accumulator_config_t sums_config(const stream_config& config, double fs_hz, std::int64_t window);
    static double share_of(double deviation, double of_carrier);
    owned_sums shortened(const group& of) const;
    std::vector<std::optional<std::pair<double, double>>> now(const group& of);

    int n_u_, n_y_;
    std::size_t m_;
    rate_chain chain_;
    std::vector<owned_sums> sums_; ///< of each rate
    bool of_part_ = false;         ///< the modes rest on a part of the rows, the sums hold all: they stay
    std::vector<double> missing_, units_;
    std::vector<group> groups_;
};

} // namespace okid_host
