// SPDX-License-Identifier: MIT
// Normally distributed numbers, the same on every machine: std::mt19937_64 (its sequence is fixed by the standard) and
// the Box-Muller transform (that of std::normal_distribution is not).
#pragma once
#include <cmath>
#include <cstdint>
#include <random>

namespace okid_host {

/// The generator of one purpose; streams of one seed are independent of each other and of how many there are.
class gaussian {
  public:
    gaussian(std::uint64_t seed, std::uint64_t stream) : engine_(mix(seed + mix(stream + 1))) {}

    /// In (0, 1].
    double uniform() { return (static_cast<double>(engine_() >> 11) + 1) * 0x1p-53; }

    double next() {
        if (ready_) {
            ready_ = false;
            return spare_;
        }
        const double radius = std::sqrt(-2 * std::log(uniform())), angle = 6.283185307179586 * uniform();
        spare_ = radius * std::sin(angle);
        ready_ = true;
        return radius * std::cos(angle);
    }

  private:
    /// Finaliser of a 64-bit hash: neighbouring seeds become unrelated ones.
    static std::uint64_t mix(std::uint64_t x) {
        x += 0x9e3779b97f4a7c15u;
        x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9u;
        x = (x ^ (x >> 27)) * 0x94d049bb133111ebu;
        return x ^ (x >> 31);
    }

    std::mt19937_64 engine_;
    double spare_ = 0;
    bool ready_ = false;
};

} // namespace okid_host
