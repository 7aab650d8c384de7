// SPDX-License-Identifier: MIT
// PURPOSE    natural frequencies, damping ratios and shapes of a discrete model; which poles count as modes
// METHOD     eigenvectors of A; lambda = log(mu)/dt, f = |lambda|/2pi, zeta = -Re lambda/|lambda|, shape = C psi
// REFERENCE  paper section 3.3; MPC and MAC: Pappa, Elliott, Schenk (1993)
// NUMERICS   the principal logarithm is right only below Nyquist: pairs within 1 % of it and negative real poles are left
//            out, and so is every pair with zeta <= 0 (an unstable pole is not a mode of a passive structure)
// WORKSPACE  2 n_z^2 doubles and the eigensolver's
#include <okid/modal.h>

#include "linalg/arena.hpp"
#include "linalg/linalg.hpp"

#include <algorithm>
#include <cmath>

using std::size_t;

namespace {

constexpr double pi = 3.14159265358979323846, nyquist_margin = 0.99;

struct modal_work {
    double *a, *vectors, *re, *im, *eigen, *sorted;
    int* order;
};

size_t lay_out(int n_z, okid::arena& memory, modal_work* work) {
    const auto n = static_cast<size_t>(n_z);
    modal_work w{};
    w.a = memory.take<double>(n * n);
    w.vectors = memory.take<double>(n * n);
    w.re = memory.take<double>(n);
    w.im = memory.take<double>(n);
    w.eigen = memory.take<double>(okid::linalg::eigen_work(n_z));
    w.sorted = memory.take<double>(n);
    w.order = memory.take<int>(n);
    if (work != nullptr) *work = w;
    return memory.bytes();
}

/// Turn and scale a shape so that its largest entry is 1.
void normalise(int n, double* re, double* im) {
    int best = 0;
    for (int i = 1; i < n; ++i)
        if (std::hypot(re[i], im[i]) > std::hypot(re[best], im[best])) best = i;
    const double a = re[best], b = im[best], square = a * a + b * b;
    if (!(square > 0)) return;
    for (int i = 0; i < n; ++i) {
        const double x = (re[i] * a + im[i] * b) / square, y = (im[i] * a - re[i] * b) / square;
        re[i] = x;
        im[i] = y;
    }
    re[best] = 1;
    im[best] = 0;
}

double collinearity(int n, const double* re, const double* im) {
    double xx = 0, yy = 0, xy = 0;
    for (int i = 0; i < n; ++i) {
        xx += re[i] * re[i];
        yy += im[i] * im[i];
        xy += re[i] * im[i];
    }
    const double sum = xx + yy;
    return sum > 0 ? ((xx - yy) * (xx - yy) + 4 * xy * xy) / (sum * sum) : 0;
}

} // namespace

size_t okid_modal_memsize(int32_t n_y, int32_t n_z) {
    if (n_y < 1 || n_z < 1) return 0;
    okid::arena memory;
    return lay_out(n_z, memory, nullptr);
}

okid_status_t okid_modal_analyse(int32_t n_y, int32_t n_z, double dt, const double* A, const double* C, int32_t* count,
                                 double* frequency_hz, double* damping_ratio, double* mpc, double* shape_re,
                                 double* shape_im, double* mu_re, double* mu_im, double* psi_re, double* psi_im,
                                 double* radius, void* work, size_t bytes) {
    if (A == nullptr || C == nullptr || count == nullptr || frequency_hz == nullptr || damping_ratio == nullptr ||
        mpc == nullptr || shape_re == nullptr || shape_im == nullptr || work == nullptr)
        return OKID_ERR_NULL;
    if (n_y < 1 || n_z < 1 || !(dt > 0)) return OKID_ERR_DIM;
    if (bytes < okid_modal_memsize(n_y, n_z)) return OKID_ERR_MEMORY;
    okid::linalg::warm_up();
    okid::arena memory(work);
    modal_work w;
    lay_out(n_z, memory, &w);
    const auto n = static_cast<size_t>(n_z), ny = static_cast<size_t>(n_y);
    std::copy(A, A + n * n, w.a);
    if (okid::linalg::eigen(n_z, w.a, w.re, w.im, w.vectors, w.eigen) != 0) return OKID_ERR_NUMERIC;
    double largest = 0;
    int found = 0;
    for (int k = 0; k < n_z; ++k) {
        const double size = std::hypot(w.re[k], w.im[k]);
        largest = std::max(largest, size);
        if (!(w.im[k] > 0) || !(size < 1) || !(size > 0)) continue;
        const double angle = std::atan2(w.im[k], w.re[k]);
        const double omega = std::hypot(std::log(size), angle) / dt;
        if (angle > nyquist_margin * pi || omega * dt > pi) continue;
        w.sorted[k] = omega;
        w.order[found++] = k;
    }
    std::sort(w.order, w.order + found, [&](int i, int j) { return w.sorted[i] < w.sorted[j]; });
    *count = found;
    if (radius != nullptr) *radius = largest;
    for (int i = 0; i < found; ++i) {
        const int k = w.order[i];
        const double* re = w.vectors + static_cast<size_t>(k) * n;
        const double* im = re + n;
        double *to_re = shape_re + static_cast<size_t>(i) * ny, *to_im = shape_im + static_cast<size_t>(i) * ny;
        okid::linalg::multiply(false, false, n_y, 1, n_z, 1, C, n_y, re, n_z, 0, to_re, n_y);
        okid::linalg::multiply(false, false, n_y, 1, n_z, 1, C, n_y, im, n_z, 0, to_im, n_y);
        normalise(n_y, to_re, to_im);
        frequency_hz[i] = w.sorted[k] / (2 * pi);
        damping_ratio[i] = -std::log(std::hypot(w.re[k], w.im[k])) / (dt * w.sorted[k]);
        mpc[i] = collinearity(n_y, to_re, to_im);
        if (mu_re != nullptr) mu_re[i] = w.re[k];
        if (mu_im != nullptr) mu_im[i] = w.im[k];
        if (psi_re != nullptr) std::copy(re, re + n, psi_re + static_cast<size_t>(i) * n);
        if (psi_im != nullptr) std::copy(im, im + n, psi_im + static_cast<size_t>(i) * n);
    }
    return OKID_OK;
}

double okid_modal_mac(int32_t n, const double* a_re, const double* a_im, const double* b_re, const double* b_im) {
    double aa = 0, bb = 0, re = 0, im = 0;
    for (int32_t i = 0; i < n; ++i) {
        aa += a_re[i] * a_re[i] + a_im[i] * a_im[i];
        bb += b_re[i] * b_re[i] + b_im[i] * b_im[i];
        re += a_re[i] * b_re[i] + a_im[i] * b_im[i];
        im += a_re[i] * b_im[i] - a_im[i] * b_re[i];
    }
    return aa > 0 && bb > 0 ? (re * re + im * im) / (aa * bb) : 0;
}
