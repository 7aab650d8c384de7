// SPDX-License-Identifier: MIT
// Band-limited interpolation between samples: a sinc in a Kaiser window of 100 dB. No delay: the filter is symmetric about
// the point asked for, so it is the same for every channel.
//
// Pass band: 0 to 0.45 of the lower of both rates, flat and in phase within 1e-5 there; what lies above 0.55 of the
// output rate is kept out by 100 dB (A. Oppenheim, R. Schafer, Discrete-Time Signal Processing, 7.5: the Kaiser window).
#pragma once
#include <cstddef>
#include <vector>

namespace okid_host {

class fir_kernel {
  public:
    static constexpr double pass_band = 0.45; ///< of the lower rate

    /// @param ratio   input samples for one output sample, any number > 0
    /// @param phases  tabulated between two samples; linear between two of 512 errs by (pi / 512)^2 / 8 = 5e-6. 1 is enough
    ///                where every point is a sample
    explicit fir_kernel(double ratio, std::size_t phases = 512);

    /// Samples used on each side of a point.
    std::size_t half() const { return half_; }

    /// Weights of the 2 half() samples 1 - half … half counted from the sample at or before the point, which lies
    /// `fraction` (0 ≤ fraction < 1) of a sample behind that one. They sum to 1. O(half), no heap.
    void weights(double fraction, double* out) const;

  private:
    std::size_t phases_, half_;
    std::vector<double> table_; ///< (phases + 1) x 2 half
};

} // namespace okid_host
