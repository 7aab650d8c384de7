// SPDX-License-Identifier: MIT
// The rates of levels.hpp sample by sample: the same filters, so that a row of a rate is that of the whole record.
#pragma once
#include "levels.hpp"

#include <cstddef>
#include <cstdint>
#include <vector>

namespace okid_host {

class rate_chain {
  public:
    /// @param m  channels; decimate: the first rate is so many times lower than fs_hz
    rate_chain(std::size_t m, double fs_hz, int decimate);

    std::size_t count() const { return rates_.size(); }
    double fs_hz(std::size_t k) const { return rates_[k].fs_hz; }
    /// Samples after which no filter remembers what came before.
    std::int64_t look_back() const {
        return static_cast<std::int64_t>((rates_.size() * rates_[1].weights.size()) << rates_.size());
    }

    /// A row of m numbers, NaN = missing. Calls use(k, row) for every rate k that has a row with it.
    template <class Use> void add(const double* row, Use&& use) {
        for (std::size_t k = 0; k < rates_.size(); ++k) {
            row = into_filter(rates_[k], row);
            if (!row) return;
            use(k, row);
        }
    }
    /// Another record begins, behind as much silence as each filter looks back, or behind nothing.
    void begin_record(bool in_silence);

    /// What the filters look back on, to go on there: a number of rows and the rows of each rate.
    std::vector<double> state() const;
    /// @return false: such numbers are no state of this chain; nothing has changed
    bool put_back(const std::vector<double>& state);

  private:
    struct rate {
        double fs_hz = 0;
        std::size_t factor = 1;      ///< of the rate before it
        std::vector<double> weights; ///< of the filter before it; empty: none
        std::vector<double> waiting; ///< the newest rows that the filter looks at
        std::size_t came = 0;        ///< rows of the rate before, of this record
        std::vector<double> row;
    };
    const double* into_filter(rate& mine, const double* row) const;

    std::size_t m_;
    std::vector<rate> rates_;
};

} // namespace okid_host
