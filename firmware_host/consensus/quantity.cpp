// SPDX-License-Identifier: MIT
// METHOD   entries i, j of a shape of normal modes are in phase or opposite: (s_i conj s_j)^2 > 0; those of a velocity and an
//          acceleration stand at 90 degrees: < 0. The mean over the shapes, weighted by size, is a matrix of signs whose
//          leading eigenvector parts the outputs in two groups
#include "quantity.hpp"

#include <okid/mkr.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

namespace okid_host {
namespace {

constexpr std::size_t fewest_shapes = 2;
constexpr double real_shape = 0.85; // mean collinearity of the shapes turned back, at least …
constexpr double gained = 0.25;     // … and so much above what it was

double mean_collinearity(const std::vector<mode_shape>& shapes, const std::vector<bool>& turned) {
    double sum = 0;
    for (const mode_shape& shape : shapes) sum += shape_collinearity(shape, turned);
    return sum / static_cast<double>(shapes.size());
}

} // namespace

double shape_collinearity(const mode_shape& shape, const std::vector<bool>& turned) {
    double xx = 0, yy = 0, xy = 0;
    for (std::size_t i = 0; i < shape.size(); ++i) {
        double re = shape[i].real(), im = shape[i].imag();
        if (i < turned.size() && turned[i]) std::swap(re, im), re = -re;
        xx += re * re;
        yy += im * im;
        xy += re * im;
    }
    const double sum = xx + yy;
    return sum > 0 ? ((xx - yy) * (xx - yy) + 4 * xy * xy) / (sum * sum) : 0;
}

std::vector<bool> turned_by(const std::vector<int>& sensing) {
    std::vector<bool> out;
    for (const int kind : sensing) out.push_back(kind == OKID_SENSE_VELOCITY);
    if (std::adjacent_find(out.begin(), out.end(), std::not_equal_to<>()) == out.end()) out.clear();
    return out;
}

std::vector<bool> turned_outputs(const std::vector<mode_shape>& shapes) {
    if (shapes.size() < fewest_shapes) return {};
    const auto n = static_cast<Eigen::Index>(shapes.front().size());
    Eigen::MatrixXd alike = Eigen::MatrixXd::Zero(n, n);
    for (const mode_shape& shape : shapes)
        for (Eigen::Index i = 0; i < n; ++i)
            for (Eigen::Index j = 0; j < n; ++j) {
                const std::complex<double> both =
                    shape[static_cast<std::size_t>(i)] * std::conj(shape[static_cast<std::size_t>(j)]);
                if (std::abs(both) > 0) alike(i, j) += (both * both).real() / std::abs(both);
            }
    const Eigen::VectorXd scale = alike.diagonal().cwiseSqrt().cwiseInverse();
    if (!scale.allFinite()) return {};
    alike = scale.asDiagonal() * alike * scale.asDiagonal();
    const Eigen::VectorXd side = Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(alike).eigenvectors().col(n - 1);
    std::vector<bool> turned;
    for (Eigen::Index i = 0; i < n; ++i) turned.push_back(side[i] * side[0] < 0);
    if (std::find(turned.begin(), turned.end(), true) == turned.end()) return {};
    const double before = mean_collinearity(shapes, {}), after = mean_collinearity(shapes, turned);
    return after >= real_shape && after >= before + gained ? turned : std::vector<bool>();
}

} // namespace okid_host
