// SPDX-License-Identifier: MIT
// PURPOSE    carve arrays out of a caller's block: first without memory to count bytes, then with it
#pragma once
#include <cstddef>
#include <cstdint>

#ifdef __SANITIZE_ADDRESS__
#define OKID_FENCED_ARENA
#elif defined(__has_feature)
#if __has_feature(address_sanitizer)
#define OKID_FENCED_ARENA
#endif
#endif
#ifdef OKID_FENCED_ARENA
#include <sanitizer/asan_interface.h>
#endif

namespace okid {

class arena {
  public:
    explicit arena(void* block = nullptr) : base_(reinterpret_cast<std::uintptr_t>(block)) {
        if (base_ != 0) used_ = (alignment - base_ % alignment) % alignment;
    }

    /// Room for `count` objects, aligned; nullptr while only counting. Under AddressSanitizer what lies between two
    /// arrays must not be touched.
    template <class T> T* take(std::size_t count) {
        const std::size_t at = used_, size = count * sizeof(T);
        used_ += (size + fence + alignment - 1) / alignment * alignment;
        if (base_ == 0) return nullptr;
        T* const out = reinterpret_cast<T*>(base_ + at);
#ifdef OKID_FENCED_ARENA
        ASAN_UNPOISON_MEMORY_REGION(out, size);
        ASAN_POISON_MEMORY_REGION(reinterpret_cast<char*>(out) + size, used_ - at - size);
#endif
        return out;
    }

    /// Bytes to ask for, alignment slack included.
    std::size_t bytes() const { return used_ + alignment; }

  private:
    static constexpr std::size_t alignment = 64;
#ifdef OKID_FENCED_ARENA
    static constexpr std::size_t fence = 64;
#else
    static constexpr std::size_t fence = 0;
#endif
    std::uintptr_t base_;
    std::size_t used_ = 0;
};

} // namespace okid
