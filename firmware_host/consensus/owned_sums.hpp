// SPDX-License-Identifier: MIT
#pragma once
#include <okid/accumulator.h>

#include <cstddef>
#include <memory>
#include <new>
#include <vector>

namespace okid_host {

/// An accumulator in memory of its own.
struct owned_sums {
    std::unique_ptr<std::byte[]> block;
    okid_accumulator_t* sums = nullptr;

    owned_sums() = default;
    /// `sums` stays NULL when the memory does not suffice.
    explicit owned_sums(const okid_accumulator_config_t& config) {
        const std::size_t bytes = okid_accumulator_memsize(&config);
        block.reset(bytes > 0 ? new (std::nothrow) std::byte[bytes] : nullptr);
        if (block && okid_accumulator_create(&sums, &config, block.get(), bytes) != OKID_OK) sums = nullptr;
    }
};

/// The rows of `from`, a window or not, as sums with fewer lags; none without memory. @param units  of the channels, which are not
/// taken from there; empty: as they are
inline owned_sums with_fewer_lags(okid_accumulator_t* from, int n_u, int n_y, int lags,
                                  const std::vector<double>& units) {
    okid_accumulator_config_t held{}, shape = okid_accumulator_defaults(n_u, n_y, lags);
    okid_accumulator_config(from, &held);
    shape.edges = 1;
    owned_sums out(shape);
    if (!out.sums) return out;
    const okid_status_t status = held.slots > 0
                                     ? okid_accumulator_take_slots(out.sums, from, 0, okid_accumulator_slots(from))
                                     : okid_accumulator_merge(out.sums, from);
    if (status < 0)
        out.sums = nullptr;
    else if (!units.empty())
        okid_accumulator_set_units(out.sums, units.data(), nullptr);
    return out;
}

} // namespace okid_host
