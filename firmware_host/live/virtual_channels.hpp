// SPDX-License-Identifier: MIT
// [virtual]: channels beside those of the grid, what virtual sensors show (virtual_filter.hpp).
#pragma once
#include "config/config.hpp"
#include "virtual_filter.hpp"

#include <cstdint>
#include <vector>

namespace okid_host {

class virtual_channels {
  public:
    /// Reads the file of [virtual]. Throws `failure` (exit 2) where it does not go with the channels.
    explicit virtual_channels(const live_config& config);

    std::size_t size() const { return shown_.size(); }
    /// As entries of `channels` in the event `start`.
    nlohmann::ordered_json described() const;
    /// The sample `index` of the grid, nullptr = it is missing; those before it that were not given are missing too.
    /// @return size() values, then their standard deviations; valid until the next call
    const double* add(std::int64_t index, const double* row);
    /// So many missing samples in a row are bridged one by one.
    std::int64_t longest_bridge() const { return static_cast<std::int64_t>(10 / filter_.model().dt); }

  private:
    struct place {
        std::size_t column; ///< of the grid
        double scale, offset;
    };
    struct shown_channel {
        std::string name, unit;
        int dof;
        bool force;
        Eigen::Index at; ///< among outputs or forces
    };
    void find_places(const live_config& config);
    void choose(const live_config& config);

    virtual_filter filter_;
    std::vector<std::optional<place>> places_; ///< of the filter's [u; y]
    std::vector<shown_channel> shown_;
    std::vector<double> row_, out_;
    std::int64_t next_ = 0;
};

} // namespace okid_host
