// SPDX-License-Identifier: MIT
// PURPOSE  M, K and R of forces that are neither held nor linear between samples, and which of the three a force is
// METHOD   below the edge of the band the sampled response of band-limited signals is the continuous one: residues r_k of
//          H(s) = sum s^b (r_k / (s - lambda_k) + conj), b = 2 for accelerations, by least squares to the model's response from
//          below the first mode to 0.36 fs. Held and linear forces: the same with the sampled terms. Of normal modes
//          2 j w_d r_k is real: the wrong hold turns it
#include "hold.hpp"

#include "deviations.hpp"
#include "files/order_statistics.hpp"

#include <okid/mechanics.h>
#include <okid/modal.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <complex>

namespace okid_host {
namespace {

using complex = std::complex<double>;
using Eigen::Index;
using Eigen::MatrixXcd;
using Eigen::MatrixXd;
using Eigen::VectorXcd;

constexpr int grid_points = 300;
constexpr double grid_low = 0.3;   // of the first mode
constexpr double grid_high = 0.36; // of the sample rate
constexpr double beyond = 1.05;    // of the last mode, where that lies higher
constexpr double grid_end = 0.42;
constexpr double vibration = 0.3;  // damping above is none
constexpr double explained = 0.2;  // misfit above: the modes are not what makes the response
constexpr double far_better = 0.5; // misfit or phase of one hold over that of another

/// Poles and shapes of a model, its response over the grid.
struct response {
    double dt = 0;
    VectorXcd lambda;
    MatrixXcd shape;           ///< n_y x modes
    Eigen::VectorXd frequency; ///< Hz
    MatrixXcd H;               ///< points x (n_y n_u), outputs first
};

bool find_poles(const okid_identified_t& model, response& out) {
    std::vector<mode_shift> kept = modes_in(model_view(model), model.dt);
    kept.erase(std::remove_if(kept.begin(), kept.end(),
                              [&](const mode_shift& mode) {
                                  return !(mode.damping_ratio < vibration && mode.frequency_hz * model.dt < grid_end);
                              }),
               kept.end());
    out.dt = model.dt;
    out.lambda.resize(static_cast<Index>(kept.size()));
    out.shape.resize(model.n_y, out.lambda.size());
    for (Index j = 0; j < out.lambda.size(); ++j) {
        const mode_shift& mode = kept[static_cast<std::size_t>(j)];
        out.lambda[j] = continuous_pole(mode.frequency_hz, mode.damping_ratio);
        out.shape.col(j) = Eigen::Map<const VectorXcd>(mode.shape.data(), model.n_y);
    }
    return !kept.empty();
}

bool find_response(const okid_identified_t& model, response& out) {
    if (model.n_u == 0 || !model.B || !model.D || !find_poles(model, out)) return false;
    const double first = std::abs(out.lambda[0]) / (2 * M_PI);
    const double last = std::abs(out.lambda[out.lambda.size() - 1]) / (2 * M_PI);
    const double high = std::min(grid_end, std::max(grid_high, beyond * last * out.dt)) / out.dt;
    out.frequency = Eigen::VectorXd::LinSpaced(grid_points, grid_low * first, high);
    const Eigen::Map<const MatrixXd> A(model.A, model.n_z, model.n_z), B(model.B, model.n_z, model.n_u),
        C(model.C, model.n_y, model.n_z), D(model.D, model.n_y, model.n_u);
    out.H.resize(grid_points, Index{model.n_y} * model.n_u);
    for (Index p = 0; p < grid_points; ++p) {
        MatrixXcd M = -A.cast<complex>();
        M.diagonal().array() += std::polar(1.0, 2 * M_PI * out.frequency[p] * out.dt);
        const MatrixXcd H = C.cast<complex>() * M.partialPivLu().solve(B.cast<complex>()) + D.cast<complex>();
        out.H.row(p) = H.reshaped().transpose();
    }
    return out.H.allFinite();
}

/// What one pole with residue 1 adds to the response at s, z = exp(s dt), differentiated b times.
complex term(complex lambda, complex s, complex z, double dt, int b, const std::string& hold) {
    if (hold == "band") return std::pow(s, b) / (s - lambda);
    const complex mu = std::exp(lambda * dt);
    const complex direct = b == 2 ? lambda : complex(0); // of velocities it cancels in the sum over normal modes
    return std::pow(lambda, b) * held_force(lambda, z, dt, hold) / (z - mu) + direct;
}

/// Columns for real and imaginary part of each residue.
MatrixXd basis(const response& r, int b, const std::string& hold) {
    const Index n = r.lambda.size(), points = r.frequency.size();
    MatrixXd out(2 * points, 2 * n);
    for (Index p = 0; p < points; ++p) {
        const complex s(0, 2 * M_PI * r.frequency[p]), z = std::exp(s * r.dt);
        for (Index k = 0; k < n; ++k) {
            const complex a = term(r.lambda[k], s, z, r.dt, b, hold),
                          c = term(std::conj(r.lambda[k]), s, z, r.dt, b, hold);
            const complex sum = a + c, difference = complex(0, 1) * (a - c);
            out(p, 2 * k) = sum.real(), out(points + p, 2 * k) = sum.imag();
            out(p, 2 * k + 1) = difference.real(), out(points + p, 2 * k + 1) = difference.imag();
        }
    }
    return out;
}

/// Of the sensor of an output; without `sensing` all are accelerations.
int times_differentiated(const std::vector<int>& sensing, int output) {
    return okid_host::times_differentiated(static_cast<std::size_t>(output) < sensing.size()
                                               ? sensing[static_cast<std::size_t>(output)]
                                               : static_cast<int>(OKID_SENSE_ACCELERATION));
}

/// Residues of displacement, modes x (n_y n_u). @return relative misfit
double fit_residues(const response& r, int n_y, const std::vector<int>& sensing, const std::string& hold,
                    MatrixXcd& residues) {
    const Index points = r.frequency.size(), n = r.lambda.size();
    residues.resize(n, r.H.cols());
    double error = 0;
    for (const int b : {0, 1, 2}) {
        std::vector<Index> columns;
        for (Index c = 0; c < r.H.cols(); ++c)
            if (times_differentiated(sensing, static_cast<int>(c % n_y)) == b) columns.push_back(c);
        if (columns.empty()) continue;
        MatrixXd Y(2 * points, static_cast<Index>(columns.size()));
        for (std::size_t c = 0; c < columns.size(); ++c)
            Y.col(static_cast<Index>(c)) << r.H.col(columns[c]).real(), r.H.col(columns[c]).imag();
        MatrixXd G = basis(r, b, hold);
        const Eigen::VectorXd scale = G.colwise().norm().transpose();
        G.array().rowwise() /= scale.transpose().array();
        const MatrixXd x = G.colPivHouseholderQr().solve(Y);
        error += (G * x - Y).squaredNorm();
        for (std::size_t c = 0; c < columns.size(); ++c)
            for (Index k = 0; k < n; ++k)
                residues(k, columns[c]) = complex(x(2 * k, static_cast<Index>(c)) / scale[2 * k],
                                                  x(2 * k + 1, static_cast<Index>(c)) / scale[2 * k + 1]);
    }
    return std::sqrt(error / r.H.squaredNorm());
}

hold_fit fit_of(const response& r, int n_y, const std::vector<int>& sensing, const std::string& hold) {
    MatrixXcd residues;
    hold_fit out;
    out.misfit = fit_residues(r, n_y, sensing, hold, residues);
    std::vector<double> phases;
    for (Index k = 0; k < residues.rows(); ++k) {
        const VectorXcd turned = residues.row(k).transpose() * complex(0, 1);
        phases.push_back(turned.imag().norm() / std::max(turned.norm(), 1e-300));
    }
    out.phase = upper_median(phases);
    return out;
}

} // namespace

complex continuous_pole(double frequency_hz, double damping_ratio) {
    const double w = 2 * M_PI * frequency_hz;
    return {-damping_ratio * w, w * std::sqrt(1 - damping_ratio * damping_ratio)};
}

complex held_force(complex pole, complex z, double dt, const std::string& hold) {
    const complex mu = std::exp(pole * dt);
    const complex g1 = (mu - 1.0) / pole, g2 = (mu - 1.0 - pole * dt) / (pole * pole * dt);
    return hold == "foh" ? g1 - g2 + g2 * z : g1;
}

int times_differentiated(int kind) { return kind == OKID_SENSE_ACCELERATION ? 2 : kind == OKID_SENSE_VELOCITY ? 1 : 0; }

hold_fit fit_hold(const okid_identified_t& model, const std::vector<int>& sensing, const std::string& hold) {
    response r;
    return find_response(model, r) ? fit_of(r, model.n_y, sensing, hold) : hold_fit{};
}

std::string tell_hold(const okid_identified_t& model, const std::vector<int>& sensing, bool falls) {
    response r;
    if (!find_response(model, r)) return "zoh";
    const hold_fit held = fit_of(r, model.n_y, sensing, "zoh"), linear = fit_of(r, model.n_y, sensing, "foh"),
                   band = fit_of(r, model.n_y, sensing, "band");
    if (held.phase <= std::min(linear.phase, band.phase)) return "zoh";
    // Behind a filter the spectrum falls; that of short pulses does too, and those can be straight between samples.
    if (falls && linear.phase > far_better * band.phase) return "band";
    return linear.misfit < far_better * band.misfit ? "foh" : "band";
}

bool as_if_held(const okid_identified_t& model, const std::vector<int>& sensing, held_model& out) {
    response r;
    MatrixXcd residues;
    if (!find_response(model, r) || !(fit_residues(r, model.n_y, sensing, "band", residues) < explained)) return false;
    const Index n = r.lambda.size(), n_y = model.n_y, n_u = model.n_u;
    MatrixXd A = MatrixXd::Zero(2 * n, 2 * n), B(2 * n, n_u), C(n_y, 2 * n), D = MatrixXd::Zero(n_y, n_u);
    for (Index k = 0; k < n; ++k) {
        const complex lambda = r.lambda[k], mu = std::exp(lambda * r.dt);
        A.block<2, 2>(2 * k, 2 * k) << mu.real(), -mu.imag(), mu.imag(), mu.real();
        C.col(2 * k) = r.shape.col(k).real();
        C.col(2 * k + 1) = -r.shape.col(k).imag();
        for (Index j = 0; j < n_u; ++j) {
            complex b = 0; // input vector of the pole, by least squares over the outputs
            for (Index i = 0; i < n_y; ++i) {
                const int times = times_differentiated(sensing, static_cast<int>(i));
                const complex residue = residues(k, i + j * n_y);
                b += std::conj(r.shape(i, k)) * std::pow(lambda, times) * residue;
                if (times == 2) D(i, j) += 2 * (lambda * residue).real();
            }
            b *= 2.0 * (mu - 1.0) / lambda / r.shape.col(k).squaredNorm(); // 2: y is the real part
            B(2 * k, j) = b.real();
            B(2 * k + 1, j) = b.imag();
        }
    }
    out.A.assign(A.data(), A.data() + A.size());
    out.B.assign(B.data(), B.data() + B.size());
    out.C.assign(C.data(), C.data() + C.size());
    out.D.assign(D.data(), D.data() + D.size());
    out.view = model;
    out.view.n_z = static_cast<std::int32_t>(2 * n);
    out.view.A = out.A.data();
    out.view.B = out.B.data();
    out.view.C = out.C.data();
    out.view.D = out.D.data();
    return true;
}

} // namespace okid_host
