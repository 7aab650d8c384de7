// SPDX-License-Identifier: MIT
// PURPOSE  from what is wanted of a stream to the configurations of the library
// METHOD   one place decides the blocks of a window and of a fading memory, for every source of samples
#include "stream_config.hpp"

#include "result/method.hpp"
#include "stream_memory.hpp"
#include "window_choice.hpp"

#include <algorithm>
#include <cmath>

namespace okid_host {
namespace {

constexpr std::int32_t watch_block = 32,
                       watch_blocks = 3; // samples whose errors are averaged; so many high ones are a change

constexpr std::int32_t most_agreed = 128, agreed_lead = 60; // states of a model of auto; samples until it predicts

/// Do the raw numbers of every channel fit int16 as they are?
bool fits_codes(const live_config& config) {
    return !resampled(config) &&
           std::all_of(config.channels.begin(),
                       config.channels.begin() + static_cast<std::ptrdiff_t>(config.n_u + config.n_y),
                       [](const channel_config& channel) {
                           const drv_signal_t& layout = channel.layout;
                           return layout.value == DRV_VALUE_INTEGER && layout.length <= (layout.is_signed ? 16 : 15);
                       });
}

} // namespace

stream_config stream_of(const live_config& config) {
    stream_config out;
    out.where = config.path + ": [identification]: ";
    out.rate_hz = config.rate_hz;
    out.wanted = config.identification;
    out.sample = fits_codes(config) ? OKID_SAMPLE_INT16 : OKID_SAMPLE_DOUBLE;
    for (std::size_t i = 0; i < config.n_u + config.n_y; ++i) {
        const channel_config& channel = config.channels[i];
        (i < config.n_u ? out.inputs : out.outputs).push_back(channel.name);
        out.scale.push_back(channel.layout.scale * channel.si_factor());
        out.offset.push_back(channel.layout.offset * channel.si_factor());
    }
    for (int hit = 0; !config.hammer.points.empty() && hit < config.hammer.total(); ++hit)
        out.hits.push_back(config.hammer.point_of(hit));
    out.mass = live_mass_plan(config);
    fit_memory(out);
    return out;
}

okid_identify_config_t identify_config_of(const stream_config& config) {
    const identification_config& wanted = config.wanted;
    okid_identify_config_t c{};
    c.n_u = static_cast<std::int32_t>(config.inputs.size());
    c.n_y = static_cast<std::int32_t>(config.outputs.size());
    c.p = wanted.p;
    c.rows = wanted.rows;
    c.order = wanted.order;
    c.max_order = config.max_order;
    c.fs_hz = config.rate_hz;
    c.method = method_of(wanted.method);
    c.hankel = hankel_of(wanted.hankel);
    c.detrend = wanted.detrend == "none" ? OKID_DETREND_NONE : OKID_DETREND_MEAN;
    return c;
}

okid_accumulator_config_t sums_config_of(const stream_config& config) {
    const identification_config& wanted = config.wanted;
    const okid_identify_config_t identify = identify_config_of(config);
    const std::int64_t update = std::max<std::int64_t>(1, std::llround(wanted.update_s * config.rate_hz));
    okid_accumulator_config_t a{};
    a.n_u = identify.n_u;
    a.n_y = identify.n_y;
    a.lags = okid_identify_lags(&identify);
    a.sample = config.sample;
    a.saturated_missing = config.saturated_missing ? 1 : 0;
    a.forgetting = wanted.forgetting.value_or(1.0);
    a.edges = 1;
    if (wanted.window_s) {
        const std::int64_t window = std::max<std::int64_t>(1, std::llround(*wanted.window_s * config.rate_hz));
        const std::int64_t finest = wanted.window == "auto" ? window_chooser::slots : 64,
                           coarsest = wanted.window == "auto" ? finest : 20;
        const std::int64_t block = std::clamp(update, std::max<std::int64_t>(1, window / finest),
                                              std::max<std::int64_t>(1, window / coarsest));
        a.block = static_cast<std::int32_t>(std::min<std::int64_t>(block, INT32_MAX));
        a.slots = static_cast<std::int32_t>(
            std::max<std::int64_t>(1, std::llround(static_cast<double>(window) / static_cast<double>(a.block))));
        a.spare_slots = a.slots / 2 + 8;
    } else if (a.forgetting < 1) {
        a.block = static_cast<std::int32_t>(std::clamp<std::int64_t>(std::llround(1 / (1 - a.forgetting) / 20), 1,
                                                                     std::min<std::int64_t>(update, 1 << 20)));
    } else {
        a.bulk = config.bulk && a.sample == OKID_SAMPLE_INT16 ? 1 : 0;
    }
    return a;
}

okid_watch_config_t watch_config_of(const stream_config& config) {
    okid_watch_config_t c{};
    c.block = watch_block;
    c.confirm = watch_blocks;
    if (config.wanted.method == "auto") {
        c.n_u = static_cast<std::int32_t>(config.inputs.size());
        c.n_y = static_cast<std::int32_t>(config.outputs.size());
        c.max_order = most_agreed;
        c.lead = agreed_lead;
        return c;
    }
    const okid_identify_config_t identify = identify_config_of(config);
    c.n_u = identify.n_u;
    c.n_y = identify.n_y;
    c.max_order = okid_identify_max_order(&identify);
    c.lead = okid_identify_lags(&identify);
    return c;
}

} // namespace okid_host
