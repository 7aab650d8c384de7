// SPDX-License-Identifier: MIT
#include "slicot.hpp"

#include <algorithm>
#include <cstddef>
#include <dlfcn.h>

namespace okid_host {
namespace {

// Fortran: everything by address, the lengths of the CHARACTER arguments behind all others.
// METH, ALG, JOBD, BATCH, CONCT, CTRL, NOBR, M, L, NSMP, U, LDU, Y, LDY, N (out), R, LDR, SV, RCOND, TOL, IWORK, DWORK,
// LDWORK, IWARN, INFO
using ib01ad_fn = void(const char*, const char*, const char*, const char*, const char*, const char*, const int*,
                       const int*, const int*, const int*, double*, const int*, double*, const int*, int*, double*,
                       const int*, double*, const double*, const double*, int*, double*, const int*, int*, int*,
                       std::size_t, std::size_t, std::size_t, std::size_t, std::size_t, std::size_t);
// METH, JOB, JOBCK, NOBR, N, M, L, NSMPL, R, LDR, A, LDA, C, LDC, B, LDB, D, LDD, Q, LDQ, RY, LDRY, S, LDS, K, LDK, TOL,
// IWORK, DWORK, LDWORK, BWORK, IWARN, INFO
using ib01bd_fn = void(const char*, const char*, const char*, const int*, const int*, const int*, const int*,
                       const int*, double*, const int*, double*, const int*, double*, const int*, double*, const int*,
                       double*, const int*, double*, const int*, double*, const int*, double*, const int*, double*,
                       const int*, const double*, int*, double*, const int*, int*, int*, int*, std::size_t, std::size_t,
                       std::size_t);

std::size_t area(int rows, int cols) { return static_cast<std::size_t>(rows) * static_cast<std::size_t>(cols); }

} // namespace

std::unique_ptr<slicot> slicot::load(const bench_record& record, int block_rows) {
    // Its BLAS and LAPACK names are bound to what this program has already loaded: the same OpenBLAS, one thread.
    static void* const library = dlopen("libslicot.so.0", RTLD_NOW | RTLD_LOCAL);
    if (library == nullptr) return nullptr;
    void *ib01ad = dlsym(library, "ib01ad_"), *ib01bd = dlsym(library, "ib01bd_");
    if (ib01ad == nullptr || ib01bd == nullptr) return nullptr;
    return std::unique_ptr<slicot>(new slicot(ib01ad, ib01bd, record, block_rows));
}

slicot::slicot(void* ib01ad, void* ib01bd, const bench_record& record, int block_rows)
    : ib01ad_(ib01ad), ib01bd_(ib01bd), m_(record.n_u), l_(record.n_y), n_(record.order), s_(block_rows),
      samples_(record.samples) {
    const int width = 2 * (m_ + l_) * s_, unknowns = m_ * (n_ + l_);
    ldr_ = std::max(width, 3 * m_ * s_);
    u_.resize(area(samples_, m_));
    y_.resize(area(samples_, l_));
    for (std::size_t n = 0; n < static_cast<std::size_t>(samples_); ++n) {
        const double* v = record.v.data() + n * static_cast<std::size_t>(m_ + l_);
        for (int c = 0; c < m_; ++c) u_[area(samples_, c) + n] = v[c];
        for (int o = 0; o < l_; ++o) y_[area(samples_, o) + n] = v[m_ + o];
    }
    R_.resize(area(ldr_, width));
    values_.resize(area(l_, s_));
    // More than any of the formulas of the two routines asks for; what QR does not need it takes as room for its batches.
    work_.resize(8 * area(width, width) + 4 * area(m_ * s_ * (n_ + l_), unknowns + 1) + 1000000);
    integers_.resize(area(width, 4) + area(n_, n_) + area(unknowns, 4));
    logicals_.resize(area(2, n_));
    A_.resize(area(n_, n_));
    B_.resize(area(n_, m_));
    C_.resize(area(l_, n_));
    D_.resize(area(l_, m_));
    Q_.resize(area(n_, n_));
    Ry_.resize(area(l_, l_));
    S_.resize(area(n_, l_));
    K_.resize(area(n_, l_));
}

bool slicot::run(slicot_method method, slicot_factor factor) {
    const char meth = static_cast<char>(method), alg = static_cast<char>(factor);
    const double rcond = 0, largest_gap = -1, by_rounding = 0;
    const int room = static_cast<int>(work_.size());
    int found = 0, warning = 0;
    // JOBD 'M': the matrices B and D by MOESP's own equations. BATCH 'O': the record in one batch. CONCT, CTRL 'N': no
    // successive experiments, no question about the order.
    reinterpret_cast<ib01ad_fn*>(ib01ad_)(&meth, &alg, method == slicot_method::moesp ? "M" : "N", "O", "N", "N", &s_,
                                          &m_, &l_, &samples_, u_.data(), &samples_, y_.data(), &samples_, &found,
                                          R_.data(), &ldr_, values_.data(), &rcond, &largest_gap, integers_.data(),
                                          work_.data(), &room, &warning, &info_, 1, 1, 1, 1, 1, 1);
    if (info_ != 0) return false;
    // JOB 'A': all matrices; JOBCK 'K': covariances and the Kalman gain.
    reinterpret_cast<ib01bd_fn*>(ib01bd_)(
        &meth, "A", "K", &s_, &n_, &m_, &l_, &samples_, R_.data(), &ldr_, A_.data(), &n_, C_.data(), &l_, B_.data(),
        &n_, D_.data(), &l_, Q_.data(), &n_, Ry_.data(), &l_, S_.data(), &n_, K_.data(), &n_, &by_rounding,
        integers_.data(), work_.data(), &room, logicals_.data(), &warning, &info_, 1, 1, 1);
    if (info_ == 0) return true;
    info_ += 100;
    return false;
}

} // namespace okid_host
