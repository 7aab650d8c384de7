// SPDX-License-Identifier: MIT
// What a session gives up when the machine is too slow for it, one step after the other, so that no sample is lost: first the
// blocks of signals for the page's pictures, then updates, then publishing. Readers, journal and grid are no step.
#pragma once
#include <algorithm>

namespace okid_host {

enum class overload_step { pictures, updates, publishing };

class relief {
  public:
    static constexpr double patience_s = 0.25, calm_s = 1;
    static constexpr int steps = 3;

    /// Call this at least once a second.
    /// @param now_s     by a clock that is never set
    /// @param caught_up  no frame waits that could be worked on
    /// @return how many steps stand: one more for each `patience_s` behind, one less for each `calm_s` caught up
    int look(double now_s, bool caught_up) {
        if (caught_up != caught_up_ || since_s_ == 0) since_s_ = now_s;
        caught_up_ = caught_up;
        if (now_s - since_s_ < (caught_up ? calm_s : patience_s)) return standing_;
        since_s_ = now_s;
        return standing_ = std::clamp(standing_ + (caught_up ? -1 : 1), 0, steps);
    }
    int standing() const { return standing_; }
    bool stands(overload_step step) const { return standing_ > static_cast<int>(step); }

  private:
    int standing_ = 0;
    bool caught_up_ = true;
    double since_s_ = 0; ///< caught up or behind, or the newest step
};

} // namespace okid_host
