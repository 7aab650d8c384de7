// SPDX-License-Identifier: MIT
// PURPOSE    carve arrays out of a caller's block: first without memory to count bytes, then with it
#pragma once
#include <cstddef>
#include <cstdint>

namespace okid {

class arena {
  public:
    explicit arena(void* block = nullptr) : base_(reinterpret_cast<std::uintptr_t>(block)) {
        if (base_ != 0) used_ = (alignment - base_ % alignment) % alignment;
    }

    /// Room for `count` objects, aligned; nullptr while only counting.
    template <class T> T* take(std::size_t count) {
        const std::size_t at = used_;
        used_ += (count * sizeof(T) + alignment - 1) / alignment * alignment;
        return base_ != 0 ? reinterpret_cast<T*>(base_ + at) : nullptr;
    }

    /// Bytes to ask for, alignment slack included.
    std::size_t bytes() const { return used_ + alignment; }

  private:
    static constexpr std::size_t alignment = 64;
    std::uintptr_t base_;
    std::size_t used_ = 0;
};

} // namespace okid
