// SPDX-License-Identifier: MIT
// Has the modal table settled? Yes when every tracked mode of the newest update stayed within 0.1 % in frequency and
// 20 % in damping ratio over the last three. Modes that come and go are no tracks and do not count.
#pragma once
#include <okid/identify.h>

#include <array>
#include <cmath>
#include <cstddef>
#include <vector>

namespace okid_host {

class settling {
  public:
    /// Take in an update.
    /// @param tracks  of its modes, 0 = none; sigma_hz: standard deviations of the frequencies, may be empty
    /// @return the table has settled
    bool add(const okid_identified_t& model, const std::vector<int>& tracks, const std::vector<double>& sigma_hz) {
        update& to = last_[count_++ % last_.size()];
        const std::size_t modes = tracks.size();
        to.frequency.assign(model.frequency_hz, model.frequency_hz + modes);
        to.damping.assign(model.damping_ratio, model.damping_ratio + modes);
        at_rest_.assign(modes, false);
        bool any = false, all = count_ >= last_.size();
        for (std::size_t k = 0; k < modes && count_ >= last_.size(); ++k) {
            if (tracks[k] <= 0) continue;
            any = true;
            const bool strict = stays(to, k, 0.001 * to.frequency[k], 0.2 * to.damping[k]);
            const double sigma = k < sigma_hz.size() && std::isfinite(sigma_hz[k]) ? sigma_hz[k] : 0;
            at_rest_[k] = strict || stays(to, k, 3 * sigma, HUGE_VAL);
            all = all && strict;
        }
        return any && all;
    }
    /// Mode k of the newest update is at rest, or moves no more than its standard deviation explains.
    bool at_rest(std::size_t k) const { return at_rest_[k]; }
    /// An update without a model.
    void reset() { count_ = 0; }

  private:
    struct update {
        std::vector<double> frequency, damping;
    };
    /// Each of the last updates has a mode that near.
    bool stays(const update& newest, std::size_t k, double hz, double damping) const {
        for (const update& each : last_) {
            bool found = false;
            for (std::size_t j = 0; j < each.frequency.size() && !found; ++j)
                found = std::abs(each.frequency[j] - newest.frequency[k]) <= hz &&
                        std::abs(each.damping[j] - newest.damping[k]) <= damping;
            if (!found) return false;
        }
        return true;
    }
    std::array<update, 3> last_;
    std::vector<bool> at_rest_;
    std::size_t count_ = 0;
};

} // namespace okid_host
