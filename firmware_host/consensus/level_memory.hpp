// SPDX-License-Identifier: MIT
// The samples of one rate that are no longer kept: their sums, in blocks of time, in memory of fixed size.
#pragma once
#include "files/byte_state.hpp"
#include "owned_sums.hpp"

#include <okid/accumulator.h>

#include <cstddef>
#include <cstdint>
#include <vector>

namespace okid_host {

class level_memory {
  public:
    static constexpr int most_blocks = 20; ///< paired up to half as many when they are full

    /// @param lags  of the longest run; block: rows of a block at first. Throws `failure` (exit 1) when memory does not suffice
    level_memory(int n_u, int n_y, int lags, std::int64_t block);
    static double bytes(int n_u, int n_y, int lags);

    void add(const double* row); ///< NaN in it: a gap
    void gap();                  ///< what comes next does not follow what came
    void silence();              ///< the record begins in it
    void merge(const level_memory& other);
    /// The same without some outputs. @param kept  a flag for each output
    level_memory without_outputs(const std::vector<bool>& kept) const;

    long long samples() const { return samples_; } ///< complete ones
    int lags() const { return lags_; }
    double rows_of_block() const; ///< on average
    /// Blocks that can be taken out of all, oldest first. What a stream full of gaps folds together is the first one.
    std::size_t blocks() const;
    bool take_block(std::size_t k, okid_accumulator_t* to) const;
    /// All of it as further records of `to`, which may have fewer lags. @return false: other channels
    bool take(okid_accumulator_t* to) const;
    /// Nothing waits to be summed: take() may be called by several threads.
    void settle() const { okid_accumulator_serialised_size(newest_.sums); }

    std::vector<std::byte> state() const;
    /// @return false: that is no state of such sums; nothing has changed
    bool put_back(byte_reader& from);

  private:
    bool has_base() const { return okid_accumulator_rows(base_.sums) > 0; }
    void make_room();

    std::size_t m_;
    int lags_;
    long long samples_ = 0;
    owned_sums newest_, base_; ///< a window of blocks; what it had no room for
};

} // namespace okid_host
