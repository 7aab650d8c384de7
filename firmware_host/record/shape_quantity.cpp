// SPDX-License-Identifier: MIT
#include "shape_quantity.hpp"

#include "consensus/quantity.hpp"
#include "late_outputs.hpp"
#include "result/hold.hpp"

#include <okid/mkr.h>

#include <algorithm>
#include <cmath>
#include <complex>
#include <fmt/format.h>
#include <functional>

namespace okid_host {

namespace {

using complex = std::complex<double>;

/// Deviations of re and im of an entry multiplied by a number.
void scale_deviations(std::complex<double> factor, double& re_std, double& im_std) {
    const double re = std::hypot(factor.real() * re_std, factor.imag() * im_std);
    im_std = std::hypot(factor.imag() * re_std, factor.real() * im_std);
    re_std = re;
}

/// Multiply the entries of every shape by factors that depend on the pole, and by one more that makes the largest 1: shapes, their
/// deviations, MPC and CMI.
void multiply_shapes(const std::function<complex(complex pole, std::size_t output)>& by, kept_model& model,
                     result_context& context) {
    const okid_identified_t& view = model.view();
    const auto n_y = static_cast<std::size_t>(view.n_y);
    double *re = model.own(view.shape_re), *im = model.own(view.shape_im);
    for (std::size_t k = 0; k < static_cast<std::size_t>(view.mode_count); ++k) {
        const double w = 2 * M_PI * view.frequency_hz[k], zeta = view.damping_ratio[k];
        const complex pole(-zeta * w, w * std::sqrt(std::max(0.0, 1 - zeta * zeta)));
        mode_shape factors, known;
        complex largest = 0;
        for (std::size_t i = 0; i < n_y; ++i) {
            factors.push_back(by(pole, i));
            const complex entry = factors[i] * complex(re[k * n_y + i], im[k * n_y + i]);
            if (std::isfinite(entry.real()) && std::abs(entry) > std::abs(largest)) largest = entry;
        }
        for (std::size_t i = 0; i < n_y; ++i) {
            const complex factor = factors[i] / largest, entry = factor * complex(re[k * n_y + i], im[k * n_y + i]);
            re[k * n_y + i] = entry.real();
            im[k * n_y + i] = entry.imag();
            if (std::isfinite(entry.real())) known.push_back(entry);
            if (context.sigma)
                scale_deviations(factor, context.sigma->shape_re[k * n_y + i], context.sigma->shape_im[k * n_y + i]);
        }
        model.own(view.mpc)[k] = shape_collinearity(known, {});
        if (view.cmi) model.own(view.cmi)[k] = view.mpc[k] * view.emac[k];
    }
}

/// Of the confident modes, with their deviations; none without.
std::vector<seen_shape> confident_shapes(const okid_identified_t& model, const result_context& context) {
    std::vector<seen_shape> out;
    if (!context.sigma) return out;
    const std::vector<mode_verdict> verdicts = mode_verdicts(model, context);
    const auto n_y = static_cast<std::size_t>(model.n_y);
    for (std::size_t k = 0; k < verdicts.size(); ++k) {
        if (!verdicts[k].confident) continue;
        seen_shape one{double(model.frequency_hz[k]), {}, {}};
        for (std::size_t i = k * n_y; i < (k + 1) * n_y; ++i) {
            one.shape.emplace_back(model.shape_re[i], model.shape_im[i]);
            one.variance.push_back(std::pow(context.sigma->shape_re[i], 2) + std::pow(context.sigma->shape_im[i], 2));
        }
        out.push_back(std::move(one));
    }
    return out;
}

} // namespace

void shapes_in_one_quantity(const std::vector<int>& sensing, kept_model& model, result_context& context) {
    if (std::adjacent_find(sensing.begin(), sensing.end(), std::not_equal_to<>()) == sensing.end()) return;
    multiply_shapes([&](complex pole, std::size_t output) { return to_displacement(pole, sensing[output]); }, model,
                    context);
    context.shape_quantity = "displacement";
}

void shapes_without_delays(kept_model& model, result_context& context) {
    if (context.placed || has_remark(context.warnings, "mixed_quantities")) return;
    const std::vector<late_output> late = late_outputs(confident_shapes(model.view(), context));
    if (late.empty()) return;
    std::vector<double> seconds(context.outputs.size());
    for (const late_output& one : late) seconds[one.output] = one.seconds;
    multiply_shapes([&](complex pole, std::size_t output) { return std::exp(pole * seconds[output]); }, model, context);
    context.warnings.emplace_back(
        "late_output",
        fmt::format("later than the other outputs: {}, by the phases of the modes. The shapes are without "
                    "these delays; frequencies and damping do not depend on them. Look for a filter, a "
                    "logger or a clock of its own",
                    late_text(late, context.outputs)));
}

} // namespace okid_host
