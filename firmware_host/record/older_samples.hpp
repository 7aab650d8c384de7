// SPDX-License-Identifier: MIT
// Method auto keeps the newest samples, which judge the modes, and of those before them the sums, which they are estimated
// from: the memory of a stream is fixed, and so is the work of an identification. A file is a stream that ends.
#pragma once
#include "consensus/level_memory.hpp"
#include "consensus/rate_chain.hpp"
#include "record_set.hpp"
#include "result/result.hpp"

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

namespace okid_host {

struct record_options;

/// Samples that are kept of so many channels: half a million numbers, but not below 32,768 samples.
std::size_t newest_samples(std::size_t channels);

class older_samples {
  public:
    /// Of the options the channels, their rate, decimate, detrend and start. Throws `failure` (exit 1) without memory
    explicit older_samples(const record_options& options);
    /// Those of state(). Throws `failure` (exit 2), where `where` begins the message, for bytes that are none
    older_samples(const record_options& options, const std::string& where, const std::vector<std::byte>& state);
    static double bytes(std::size_t n_u, std::size_t n_y);

    /// The oldest of the samples kept are screened, then summed and dropped.
    /// @param newest  all that are kept. @return how many went: a quarter, or up to the end of the record that ends next
    std::size_t take(const record_set& newest);
    void merge(const older_samples& other); ///< as further records
    /// Without some outputs, and of the options without them; it takes no more samples. @param kept  a flag for each output
    older_samples without_outputs(const record_options& fewer, const std::vector<bool>& kept) const;

    const level_memory& level(std::size_t k) const { return levels_[k]; }
    long long samples() const { return counts_.samples; } ///< those missing with them
    long long missing() const { return counts_.missing; }
    long long gaps() const { return counts_.gaps; }
    long long records() const { return counts_.records - (counts_.within ? 1 : 0); } ///< that are older as a whole
    /// Samples of the longest record, and of the one that goes on among the newest (0: none does).
    long long longest() const { return counts_.longest; }
    long long begun() const { return counts_.within ? counts_.length : 0; }

    /// Of each channel, does it move?
    std::vector<bool> moved() const;
    /// Sums for the levels of the newest samples; scale: what one unit of a level is in each channel.
    void lend_sums(const std::vector<double>& scale, std::vector<record_level>& levels) const;
    /// Counts, and what is to be said of missing and faulty samples, with those of the newest. newest: missing as they came
    void add_counts(const missing_count& newest, std::size_t judged, result_context& to) const;

    std::vector<std::byte> state() const;

  private:
    void begin_record(bool at_rest);
    void add(const double* row, const double* bridged);

    std::size_t n_u_, n_y_;
    std::vector<std::string> outputs_;
    bool begins_at_rest_, lines_;
    rate_chain chain_;
    std::vector<level_memory> levels_;
    struct {
        long long samples = 0, missing = 0, gaps = 0, length = 0, longest = 0, records = 0;
        long long screened = 0;              ///< of those missing
        bool within = false, in_gap = false; ///< the newest samples go on with the last record taken
    } counts_;
};

/// Of more samples than are kept the older ones go, as in a stream. @return them; none went: nullptr
std::unique_ptr<older_samples> split_older(record_set& set, const record_options& options);

} // namespace okid_host
