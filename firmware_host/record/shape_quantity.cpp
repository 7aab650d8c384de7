// SPDX-License-Identifier: MIT
#include "shape_quantity.hpp"

#include "consensus/quantity.hpp"
#include "result/hold.hpp"

#include <okid/mkr.h>

#include <algorithm>
#include <cmath>

namespace okid_host {

namespace {

/// Deviations of re and im of an entry multiplied by a number.
void scale_deviations(std::complex<double> factor, double& re_std, double& im_std) {
    const double re = std::hypot(factor.real() * re_std, factor.imag() * im_std);
    im_std = std::hypot(factor.imag() * re_std, factor.real() * im_std);
    re_std = re;
}

/// The factors of all entries of a mode, so that the largest becomes 1.
mode_shape factors(const std::vector<int>& sensing, std::complex<double> pole, const mode_shape& shape) {
    mode_shape out;
    std::complex<double> largest = 0;
    for (std::size_t i = 0; i < shape.size(); ++i) {
        out.push_back(to_displacement(pole, sensing[i]));
        if (std::isfinite(shape[i].real()) && std::abs(out[i] * shape[i]) > std::abs(largest))
            largest = out[i] * shape[i];
    }
    for (std::complex<double>& one : out) one /= largest;
    return out;
}

} // namespace

void shapes_in_one_quantity(const std::vector<int>& sensing, kept_model& model, result_context& context) {
    if (std::adjacent_find(sensing.begin(), sensing.end(), std::not_equal_to<>()) == sensing.end()) return;
    const okid_identified_t& view = model.view();
    const auto n_y = static_cast<std::size_t>(view.n_y);
    double *re = model.own(view.shape_re), *im = model.own(view.shape_im);
    for (std::size_t k = 0; k < static_cast<std::size_t>(view.mode_count); ++k) {
        const double w = 2 * M_PI * view.frequency_hz[k], zeta = view.damping_ratio[k];
        mode_shape shape, known;
        for (std::size_t i = 0; i < n_y; ++i) shape.emplace_back(re[k * n_y + i], im[k * n_y + i]);
        const mode_shape by = factors(sensing, {-zeta * w, w * std::sqrt(std::max(0.0, 1 - zeta * zeta))}, shape);
        for (std::size_t i = 0; i < n_y; ++i) {
            shape[i] *= by[i];
            re[k * n_y + i] = shape[i].real();
            im[k * n_y + i] = shape[i].imag();
            if (std::isfinite(shape[i].real())) known.push_back(shape[i]);
            if (context.sigma)
                scale_deviations(by[i], context.sigma->shape_re[k * n_y + i], context.sigma->shape_im[k * n_y + i]);
        }
        model.own(view.mpc)[k] = shape_collinearity(known, {});
        if (view.cmi) model.own(view.cmi)[k] = view.mpc[k] * view.emac[k];
    }
    context.shape_quantity = "displacement";
}

} // namespace okid_host
