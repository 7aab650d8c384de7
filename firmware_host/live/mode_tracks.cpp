// SPDX-License-Identifier: MIT
#include "mode_tracks.hpp"

#include "error.hpp"

namespace okid_host {

mode_tracks::mode_tracks(int n_y, int most_modes, double memory_s) {
    okid_track_config_t config{};
    config.n_y = n_y;
    config.max_modes = most_modes;
    config.max_tracks = 2 * most_modes;
    if (memory_s > 0) config.close_hz = 0.15 / memory_s; // a sixth of what a memory resolves
    const std::size_t bytes = okid_track_memsize(&config);
    block_ = std::make_unique<std::byte[]>(bytes);
    if (okid_track_create(&tracks_, &config, block_.get(), bytes) != OKID_OK)
        throw failure(exit_usage, "[identification]: the modes of this order cannot be tracked");
    numbers_.reserve(static_cast<std::size_t>(most_modes));
}

const std::vector<int>& mode_tracks::update(const okid_identified_t& model) {
    numbers_.assign(static_cast<std::size_t>(model.mode_count), 0);
    if (okid_track_update(tracks_, model.mode_count, model.frequency_hz, model.damping_ratio, model.shape_re,
                          model.shape_im, numbers_.data()) != OKID_OK)
        numbers_.assign(numbers_.size(), 0);
    return numbers_;
}

} // namespace okid_host
