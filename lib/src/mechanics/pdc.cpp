// SPDX-License-Identifier: MIT
// PURPOSE    proportional damping coefficients from frequencies and damping ratios
// METHOD     least squares with both columns scaled to unit length a, b. The right singular vectors of [a b] are then
//            (1, 1)/sqrt 2 and (1, -1)/sqrt 2 whatever the angle, its left ones a + b and a - b: the SVD in closed form
// REFERENCE  paper eq. (124)-(131), over n_x modes (trap 20: the text says n_z; both of a pair would change nothing)
// NUMERICS   condition |a + b|/|a - b| instead of 1e4-1e5 of the unscaled columns; nothing is squared. Double in any build
// WORKSPACE  none; 20 flop a mode
#include <okid/mkr.h>

#include <cmath>
#include <limits>

using std::size_t;
using real = okid_real_t;

namespace {

constexpr double pi = 3.14159265358979323846;

struct row {
    double a, b, zeta; // weighted: 1/(2 w), w/2 and the damping ratio
};

struct table {
    const real *frequency_hz, *damping_ratio, *weight;
    row operator()(int32_t k) const {
        const double omega = 2 * pi * double(frequency_hz[k]);
        const double root = weight != nullptr ? std::sqrt(double(weight[k])) : 1;
        return {root / (2 * omega), root * omega / 2, root * double(damping_ratio[k])};
    }
};

bool valid(int32_t count, const real* f, const real* zeta, const real* weight) {
    double total = 0;
    for (int32_t k = 0; k < count; ++k) {
        const double w = weight != nullptr ? double(weight[k]) : 1;
        if (!(f[k] > 0) || !std::isfinite(f[k]) || !std::isfinite(zeta[k]) || !(w >= 0) || !std::isfinite(w))
            return false;
        total += w;
    }
    return total > 0;
}

} // namespace

okid_status_t okid_pdc_fit(int32_t count, const okid_real_t* frequency_hz, const okid_real_t* damping_ratio,
                           const okid_real_t* weight, okid_pdc_t* pdc) {
    if (frequency_hz == nullptr || damping_ratio == nullptr || pdc == nullptr) return OKID_ERR_NULL;
    if (count < 1 || !valid(count, frequency_hz, damping_ratio, weight)) return OKID_ERR_DIM;
    const table rows{frequency_hz, damping_ratio, weight};
    double aa = 0, bb = 0, size = 0;
    for (int32_t k = 0; k < count; ++k) {
        const row r = rows(k);
        aa += r.a * r.a;
        bb += r.b * r.b;
        size += r.zeta * r.zeta;
    }
    const double a = std::sqrt(aa), b = std::sqrt(bb);
    double plus = 0, minus = 0, along_plus = 0, along_minus = 0; // |a + b|^2, |a - b|^2 and the data along them
    for (int32_t k = 0; k < count; ++k) {
        const row r = rows(k);
        const double sum = r.a / a + r.b / b, difference = r.a / a - r.b / b;
        plus += sum * sum;
        minus += difference * difference;
        along_plus += sum * r.zeta;
        along_minus += difference * r.zeta;
    }
    const double floor = 8 * double(std::numeric_limits<real>::epsilon());
    const bool apart = std::sqrt(minus) > floor * std::sqrt(plus);
    const double common = along_plus / plus, contrast = apart ? along_minus / minus : 0;
    const double alpha = (common + contrast) / a, beta = (common - contrast) / b;
    double misfit = 0;
    for (int32_t k = 0; k < count; ++k) {
        const row r = rows(k);
        const double e = r.zeta - alpha * r.a - beta * r.b;
        misfit += e * e;
    }
    pdc->alpha = static_cast<real>(alpha);
    pdc->beta = static_cast<real>(beta);
    pdc->residual = static_cast<real>(size > 0 ? std::sqrt(misfit / size) : 0);
    pdc->condition = static_cast<real>(apart ? std::sqrt(plus / minus) : 1 / floor);
    return OKID_OK;
}

okid_status_t okid_pdc_damping(int32_t n_x, const okid_pdc_t* pdc, const okid_real_t* M, const okid_real_t* K,
                               okid_real_t* R) {
    if (pdc == nullptr || M == nullptr || K == nullptr || R == nullptr) return OKID_ERR_NULL;
    if (n_x < 1) return OKID_ERR_DIM;
    const size_t entries = static_cast<size_t>(n_x) * static_cast<size_t>(n_x);
    for (size_t i = 0; i < entries; ++i) R[i] = pdc->alpha * M[i] + pdc->beta * K[i];
    return OKID_OK;
}
