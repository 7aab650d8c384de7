// SPDX-License-Identifier: MIT
// Words and numbers of a saved state as bytes, little endian on every machine, and back.
#pragma once
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <vector>

namespace okid_host {

constexpr std::size_t word_bytes = 8;

inline void put_word(std::vector<std::byte>& to, std::uint64_t value) {
    for (std::size_t k = 0; k < word_bytes; ++k) to.push_back(static_cast<std::byte>(value >> (8 * k)));
}

inline void put_number(std::vector<std::byte>& to, double value) {
    std::uint64_t bits = 0;
    std::memcpy(&bits, &value, word_bytes);
    put_word(to, bits);
}

/// One after the other what was put; zeros, and failed(), once the bytes have ended early.
class byte_reader {
  public:
    byte_reader(const void* from, std::size_t bytes) : at_(static_cast<const std::byte*>(from)), left_(bytes) {}

    /// So many bytes as they are; NULL: there are fewer.
    const std::byte* bytes(std::uint64_t count) {
        failed_ = failed_ || count > left_;
        if (failed_) return nullptr;
        left_ -= static_cast<std::size_t>(count);
        at_ += count;
        return at_ - count;
    }
    std::uint64_t word() {
        const std::byte* const from = bytes(word_bytes);
        std::uint64_t value = 0;
        for (std::size_t k = 0; from && k < word_bytes; ++k)
            value |= std::to_integer<std::uint64_t>(from[k]) << (8 * k);
        return value;
    }
    double number() {
        const std::uint64_t bits = word();
        double value = 0;
        std::memcpy(&value, &bits, word_bytes);
        return value;
    }
    std::size_t left() const { return left_; }
    bool failed() const { return failed_; }

  private:
    const std::byte* at_;
    std::size_t left_;
    bool failed_ = false;
};

} // namespace okid_host
