// SPDX-License-Identifier: MIT
// Has the modal table come to rest? Yes when the last three updates have the same number of modes and each mode stays
// within 0.1 % in frequency and 20 % in damping ratio of the newest update.
#pragma once
#include <okid/identify.h>

#include <array>
#include <cmath>
#include <cstddef>
#include <vector>

namespace okid_host {

class settling {
  public:
    /// Take in an update. @return the table has come to rest
    bool add(const okid_identified_t& model) {
        update& to = last_[count_++ % last_.size()];
        const auto modes = static_cast<std::size_t>(model.mode_count);
        to.frequency.assign(model.frequency_hz, model.frequency_hz + modes);
        to.damping.assign(model.damping_ratio, model.damping_ratio + modes);
        if (count_ < last_.size() || modes == 0) return false;
        for (const update& each : last_)
            if (!near(each, to)) return false;
        return true;
    }
    /// An update without a model.
    void reset() { count_ = 0; }

  private:
    struct update {
        std::vector<double> frequency, damping;
    };
    static bool near(const update& a, const update& b) {
        if (a.frequency.size() != b.frequency.size()) return false;
        for (std::size_t k = 0; k < a.frequency.size(); ++k)
            if (std::abs(a.frequency[k] - b.frequency[k]) > 0.001 * b.frequency[k] ||
                std::abs(a.damping[k] - b.damping[k]) > 0.2 * b.damping[k])
                return false;
        return true;
    }
    std::array<update, 3> last_;
    std::size_t count_ = 0;
};

} // namespace okid_host
