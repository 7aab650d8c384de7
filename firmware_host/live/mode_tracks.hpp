// SPDX-License-Identifier: MIT
// The modes of a stream from update to update (okid/track.h), in memory of the host.
#pragma once
#include <okid/identify.h>
#include <okid/track.h>

#include <cstddef>
#include <memory>
#include <vector>

namespace okid_host {

class mode_tracks {
  public:
    /// @param most_modes  of a model
    mode_tracks(int n_y, int most_modes, double memory_s = 0);
    /// @return the track of every mode, 0 = none yet; valid until the next call
    const std::vector<int>& update(const okid_identified_t& model);
    /// The structure has changed: the modes may be found elsewhere next time.
    void jump() { okid_track_jump(tracks_); }

  private:
    std::unique_ptr<std::byte[]> block_;
    okid_tracks_t* tracks_ = nullptr;
    std::vector<int> numbers_;
};

} // namespace okid_host
