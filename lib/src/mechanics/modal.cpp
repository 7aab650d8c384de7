// SPDX-License-Identifier: MIT
// PURPOSE    natural frequencies, damping ratios and shapes of a discrete model; which poles count as modes
// METHOD     eigenvectors of A; lambda = log(mu)/dt, f = |lambda|/2pi, zeta = -Re lambda/|lambda|, shape = C psi
// REFERENCE  paper section 3.3; MPC and MAC: Pappa, Elliott, Schenk (1993)
// NUMERICS   the principal logarithm is right only below Nyquist: pairs within 1 % of it and negative real poles are left
//            out, and so is every pair with zeta <= 0 (an unstable pole is not a mode of a passive structure). The
//            logarithm is taken in double: next to the unit circle it magnifies every rounding of |mu|
// WORKSPACE  2 n_z^2 numbers and the eigensolver's
#include <okid/modal.h>

#include "linalg/arena.hpp"
#include "linalg/linalg.hpp"

#include <algorithm>
#include <cmath>

using std::size_t;

namespace {

constexpr double pi = 3.14159265358979323846, nyquist_margin = 0.99;

struct modal_work {
    okid_real_t *a, *vectors, *re, *im, *eigen;
    double* sorted;
    int* order;
};

size_t lay_out(int n_z, okid::arena& memory, modal_work* work) {
    const auto n = static_cast<size_t>(n_z);
    modal_work w{};
    w.a = memory.take<okid_real_t>(n * n);
    w.vectors = memory.take<okid_real_t>(n * n);
    w.re = memory.take<okid_real_t>(n);
    w.im = memory.take<okid_real_t>(n);
    w.eigen = memory.take<okid_real_t>(okid::linalg::eigen_work(n_z));
    w.sorted = memory.take<double>(n);
    w.order = memory.take<int>(n);
    if (work != nullptr) *work = w;
    return memory.bytes();
}

/// Turn and scale a shape so that its largest entry is 1.
void normalise(int n, okid_real_t* re, okid_real_t* im) {
    int best = 0;
    for (int i = 1; i < n; ++i)
        if (std::hypot(re[i], im[i]) > std::hypot(re[best], im[best])) best = i;
    const okid_real_t a = re[best], b = im[best], square = a * a + b * b;
    if (!(square > 0)) return;
    for (int i = 0; i < n; ++i) {
        const okid_real_t x = (re[i] * a + im[i] * b) / square, y = (im[i] * a - re[i] * b) / square;
        re[i] = x;
        im[i] = y;
    }
    re[best] = 1;
    im[best] = 0;
}

okid_real_t collinearity(int n, const okid_real_t* re, const okid_real_t* im) {
    okid_real_t xx = 0, yy = 0, xy = 0;
    for (int i = 0; i < n; ++i) {
        xx += re[i] * re[i];
        yy += im[i] * im[i];
        xy += re[i] * im[i];
    }
    const okid_real_t sum = xx + yy;
    return sum > 0 ? ((xx - yy) * (xx - yy) + 4 * xy * xy) / (sum * sum) : 0;
}

/// May a pole of the upper half plane be a mode: damped, and below Nyquist?
bool is_candidate(okid_real_t re, okid_real_t im) {
    const double a = re, b = im, size = std::hypot(a, b), angle = std::atan2(b, a);
    return b > 0 && size < 1 && angle <= nyquist_margin * pi && std::hypot(std::log(size), angle) <= pi;
}

void put(okid_real_t* array, int i, double value) {
    if (array != nullptr) array[i] = static_cast<okid_real_t>(value);
}

} // namespace

size_t okid_modal_memsize(int32_t n_y, int32_t n_z) {
    if (n_y < 1 || n_z < 1) return 0;
    okid::arena memory;
    return lay_out(n_z, memory, nullptr);
}

okid_status_t okid_modal_analyse(const okid_model_t* model, double dt, okid_modes_t* modes, void* work, size_t bytes) {
    if (model == nullptr || model->A == nullptr || model->C == nullptr || modes == nullptr || work == nullptr ||
        (modes->shape_re == nullptr) != (modes->shape_im == nullptr) ||
        (modes->mpc != nullptr && modes->shape_re == nullptr))
        return OKID_ERR_NULL;
    const int n_y = model->n_y, n_z = model->n_z;
    const okid_real_t *A = model->A, *C = model->C;
    okid_modes_t& to = *modes;
    if (n_y < 1 || n_z < 1 || !(dt > 0)) return OKID_ERR_DIM;
    if (bytes < okid_modal_memsize(n_y, n_z)) return OKID_ERR_MEMORY;
    okid::linalg::warm_up();
    okid::arena memory(work);
    modal_work w;
    lay_out(n_z, memory, &w);
    const auto n = static_cast<size_t>(n_z), ny = static_cast<size_t>(n_y);
    std::copy(A, A + n * n, w.a);
    if (okid::linalg::eigen(n_z, w.a, w.re, w.im, w.vectors, w.eigen, is_candidate) != 0) return OKID_ERR_NUMERIC;
    double largest = 0;
    int found = 0;
    for (int k = 0; k < n_z; ++k) {
        const double re = w.re[k], im = w.im[k], size = std::hypot(re, im);
        largest = std::max(largest, size);
        if (!is_candidate(w.re[k], w.im[k])) continue;
        w.sorted[k] = std::hypot(std::log(size), std::atan2(im, re)) / dt;
        w.order[found++] = k;
    }
    for (int i = 1; i < found; ++i) // insertion: std::sort calls itself, and a stack has a bound here
        for (int j = i; j > 0 && w.sorted[w.order[j]] < w.sorted[w.order[j - 1]]; --j)
            std::swap(w.order[j], w.order[j - 1]);
    to.count = found;
    to.radius = largest;
    for (int i = 0; i < found; ++i) {
        const int k = w.order[i];
        const okid_real_t *re = w.vectors + static_cast<size_t>(k) * n, *im = re + n;
        const double size = std::hypot(static_cast<double>(w.re[k]), static_cast<double>(w.im[k]));
        put(to.frequency_hz, i, w.sorted[k] / (2 * pi));
        put(to.damping_ratio, i, -std::log(size) / (dt * w.sorted[k]));
        put(to.mu_re, i, w.re[k]);
        put(to.mu_im, i, w.im[k]);
        if (to.psi_re != nullptr) std::copy(re, re + n, to.psi_re + static_cast<size_t>(i) * n);
        if (to.psi_im != nullptr) std::copy(im, im + n, to.psi_im + static_cast<size_t>(i) * n);
        if (to.shape_re == nullptr) continue;
        okid_real_t *to_re = to.shape_re + static_cast<size_t>(i) * ny,
                    *to_im = to.shape_im + static_cast<size_t>(i) * ny;
        okid::linalg::multiply(false, false, n_y, 1, n_z, 1, C, n_y, re, n_z, 0, to_re, n_y);
        okid::linalg::multiply(false, false, n_y, 1, n_z, 1, C, n_y, im, n_z, 0, to_im, n_y);
        normalise(n_y, to_re, to_im);
        put(to.mpc, i, collinearity(n_y, to_re, to_im));
    }
    return OKID_OK;
}

double okid_modal_mac(int32_t n, const okid_real_t* a_re, const okid_real_t* a_im, const okid_real_t* b_re,
                      const okid_real_t* b_im) {
    if (a_re == nullptr || a_im == nullptr || b_re == nullptr || b_im == nullptr) return 0;
    okid_real_t aa = 0, bb = 0, re = 0, im = 0;
    for (int32_t i = 0; i < n; ++i) {
        aa += a_re[i] * a_re[i] + a_im[i] * a_im[i];
        bb += b_re[i] * b_re[i] + b_im[i] * b_im[i];
        re += a_re[i] * b_re[i] + a_im[i] * b_im[i];
        im += a_re[i] * b_im[i] - a_im[i] * b_re[i];
    }
    return aa > 0 && bb > 0 ? (re * re + im * im) / (aa * bb) : 0;
}
