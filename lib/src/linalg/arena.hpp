// SPDX-License-Identifier: MIT
// PURPOSE    carve arrays out of a caller's block: first without memory to count bytes, then with it
#pragma once
#include <cstddef>
#include <cstdint>
#ifdef OKID_FENCES // tests under AddressSanitizer: what lies between two arrays is touched by none
#include <sanitizer/asan_interface.h>
#endif

namespace okid {

class arena {
  public:
    /// `alone`: the block holds nothing else while these arrays are used; else there are no fences.
    explicit arena(void* block = nullptr, bool alone = true)
        : base_(reinterpret_cast<std::uintptr_t>(block)), fence_(alone ? fence : 0) {
        if (base_ != 0) used_ = (alignment - base_ % alignment) % alignment;
    }

    /// Room for `count` objects, aligned; nullptr while only counting.
    template <class T> T* take(std::size_t count) {
        const std::size_t at = used_, size = count * sizeof(T);
        used_ += (size + fence_ + alignment - 1) / alignment * alignment;
        if (base_ == 0) return nullptr;
        T* const out = reinterpret_cast<T*>(base_ + at);
#ifdef OKID_FENCES
        ASAN_UNPOISON_MEMORY_REGION(out, size);
        if (fence_ > 0) ASAN_POISON_MEMORY_REGION(reinterpret_cast<char*>(out) + size, used_ - at - size);
#endif
        return out;
    }

    /// Bytes to ask for, alignment slack included.
    std::size_t bytes() const { return used_ + alignment; }

  private:
    static constexpr std::size_t alignment = 64;
#ifdef OKID_FENCES
    static constexpr std::size_t fence = alignment;
#else
    static constexpr std::size_t fence = 0;
#endif
    std::uintptr_t base_;
    std::size_t fence_, used_ = 0;
};

} // namespace okid
