// SPDX-License-Identifier: MIT
// SLICOT's subspace identification (IB01AD, IB01BD), from the Debian package libslicot0 at run time.
#pragma once
#include "commands/bench_record.hpp"

#include <memory>
#include <vector>

namespace okid_host {

enum class slicot_method : char { moesp = 'M', n4sid = 'N' };
enum class slicot_factor : char { cholesky = 'C', qr = 'Q' }; ///< ALG of IB01AD

/// One record and one size: all memory is taken here, run() only works.
class slicot {
  public:
    /// nullptr when the library is not installed.
    static std::unique_ptr<slicot> load(const bench_record& record, int block_rows);

    /// A, B, C, D, K of the record's order. false: SLICOT reported an error (info() says which)
    bool run(slicot_method method, slicot_factor factor);

    const double* A() const { return A_.data(); }
    const double* C() const { return C_.data(); }
    int info() const { return info_; } ///< INFO of IB01AD, or 100 + INFO of IB01BD

  private:
    slicot(void* ib01ad, void* ib01bd, const bench_record& record, int block_rows);

    void *ib01ad_, *ib01bd_;
    int m_, l_, n_, s_, samples_, ldr_, info_ = 0;
    std::vector<double> u_, y_, R_, values_, work_, A_, B_, C_, D_, Q_, Ry_, S_, K_;
    std::vector<int> integers_, logicals_;
};

} // namespace okid_host
