// SPDX-License-Identifier: MIT
#pragma once
#include <okid/accumulator.h>

#include <cstddef>
#include <memory>
#include <new>

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

} // namespace okid_host
