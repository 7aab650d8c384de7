// SPDX-License-Identifier: MIT
#include "rig_run.hpp"

#include "gaussian.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <fmt/format.h>

namespace okid_host {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

/// Purposes of random streams; a channel number is added.
enum stream : std::uint64_t {
    stream_force = 0,
    stream_noise = 1000,
    stream_start = 2000,
    stream_hammer = 3000,
    stream_strength = 4000
};

constexpr double before_hit = 0.1; // s, where a record holds one hit

/// Full scale stands this far above the largest value, so that nothing saturates.
constexpr double headroom = 1.25;

/// The smallest readable number (1, 1.5, 2, … times a power of ten) that is not below x.
double readable_above(double x) {
    const int decade = static_cast<int>(std::floor(std::log10(x)));
    for (const char* step : {"1", "1.5", "2", "2.5", "3", "4", "5", "6", "8", "10", "15"}) {
        const double value = std::strtod(fmt::format("{}e{}", step, decade).c_str(), nullptr);
        if (value >= x) return value;
    }
    return x;
}

/// Codes of one row of values with a scale that gives them room.
void convert(const Eigen::Ref<const Eigen::RowVectorXd>& values, int bits, rig_channel& channel) {
    const double limit = std::ldexp(1.0, bits - 1) - 1;
    const double largest = values.cwiseAbs().maxCoeff();
    channel.scale = readable_above(largest > 1e-290 ? headroom * largest / limit : 1 / limit);
    channel.codes.resize(static_cast<std::size_t>(values.size()));
    for (Index n = 0; n < values.size(); ++n)
        channel.codes[static_cast<std::size_t>(n)] = static_cast<std::int32_t>(std::llround(values(n) / channel.scale));
}

/// Linear sweeps through all modes and back to the start; each force begins at another place of the sweep.
void chirp(const rig& rig, MatrixXd& u) {
    const rig_modes modes = structure_modes(rig.body);
    const double low = 0.5 * modes.frequency_hz.front();
    const double high = std::max(low * 1.5, std::min(1.5 * modes.frequency_hz.back(), 0.45 * rig.rate_hz));
    const double period = std::min(rig.duration_s, 10.0);
    for (Index k = 0; k < u.rows(); ++k) {
        double phase = 0, where = static_cast<double>(k) / static_cast<double>(u.rows());
        for (Index n = 0; n < u.cols(); ++n) {
            u(k, n) = std::sin(phase);
            phase += 2 * M_PI * (low + (high - low) * where) / rig.rate_hz;
            if (phase > 2 * M_PI) phase -= 2 * M_PI * std::floor(phase / (2 * M_PI));
            where += 1 / (period * rig.rate_hz);
            if (where >= 1) where -= 1;
        }
    }
}

/// Half-sine hits, one force after the other, at slightly irregular times and strengths.
void hammer(const rig& rig, MatrixXd& u) {
    gaussian random(rig.seed, stream_hammer);
    const double highest = structure_modes(rig.body).frequency_hz.back();
    const double width = std::max(2 / rig.rate_hz, 0.5 / highest); // s
    const double pause = std::min(2.0, rig.duration_s / static_cast<double>(3 * u.rows()));
    double at = rig.one_hit ? std::min(before_hit, 0.05 * rig.duration_s) : 0.05 * pause;
    for (Index hit = 0; at < rig.duration_s && !(rig.one_hit && hit); ++hit) {
        const double strength = 0.7 + 0.6 * random.uniform();
        const Index first = static_cast<Index>(std::ceil(at * rig.rate_hz));
        for (Index n = first; n < u.cols(); ++n) {
            const double t = static_cast<double>(n) / rig.rate_hz - at;
            if (t >= width) break;
            u(hit % u.rows(), n) += strength * std::sin(M_PI * t / width);
        }
        at += pause * (0.8 + 0.4 * random.uniform());
    }
}

rig_channel make_channel(const rig& rig, bool force, int dof) {
    rig_channel channel;
    channel.dof = dof;
    channel.role = force ? "force" : rig.sensing;
    const bool acceleration = rig.sensing == "acceleration", velocity = rig.sensing == "velocity";
    channel.unit = force ? "N" : acceleration ? "m/s^2" : velocity ? "m/s" : "m";
    channel.name = fmt::format("{}{}", force ? "force" : acceleration ? "acc" : velocity ? "vel" : "disp", dof);
    channel.signal = fmt::format("{}{}", force ? "Force" : acceleration ? "Accel" : velocity ? "Veloc" : "Displ", dof);
    return channel;
}

VectorXd first_state(const rig& rig) {
    const Index n = rig.body.M.rows();
    VectorXd state = VectorXd::Zero(2 * n);
    if (rig.excitation != "none") return state;
    gaussian random(rig.seed, stream_start);
    for (Index i = 0; i < n; ++i)
        state(n + i) = rig.force_rms * random.next() / rig.body.M(i, i); // a hit of force_rms N s
    return state;
}

/// The response; at each change the motion goes on with the new structure.
MatrixXd respond(const rig& rig, const MatrixXd& u, Index count) {
    MatrixXd y(static_cast<Index>(rig.sense_dofs.size()), count);
    VectorXd state = first_state(rig), next(state.size());
    std::size_t change = 0;
    const auto model_of = [&](const structure& body) {
        return discretise(body, rig.force_dofs, rig.sense_dofs, rig.sensing, rig.hold, rig.rate_hz);
    };
    discrete_model model = model_of(rig.body);
    for (Index n = 0; n < count; ++n) {
        while (change < rig.changes.size() && static_cast<double>(n) >= rig.changes[change].at_s * rig.rate_hz)
            model = model_of(rig.changes[change++].after);
        y.col(n).noalias() = model.C * state + model.D * u.col(n);
        next.noalias() = model.A * state + model.B0 * u.col(n) + model.B1 * u.col(n + 1);
        state.swap(next);
    }
    return y;
}

} // namespace

MatrixXd rig_forces(const rig& rig, std::size_t count) {
    MatrixXd u = MatrixXd::Zero(static_cast<Index>(rig.force_dofs.size()), static_cast<Index>(count));
    if (rig.excitation == "chirp") chirp(rig, u);
    if (rig.excitation == "hammer") hammer(rig, u);
    for (Index k = 0; k < u.rows(); ++k) {
        if (rig.excitation == "white") {
            gaussian random(rig.seed, stream_force + static_cast<std::uint64_t>(k));
            for (Index n = 0; n < u.cols(); ++n) u(k, n) = rig.force_rms * random.next();
        } else {
            const double rms = u.row(k).norm() / std::sqrt(static_cast<double>(count));
            if (rms > 0) u.row(k) *= rig.force_rms / rms;
        }
    }
    return u;
}

rig_run simulate_rig(const rig& rig) {
    rig_run out;
    out.rate_hz = rig.rate_hz;
    out.bits = rig.bits;
    out.count = rig.samples();
    out.forces = rig.force_dofs.size();
    const auto count = static_cast<Index>(out.count);
    MatrixXd u = rig_forces(rig, out.count + 1); // one more: a force linear between samples needs its next value
    for (std::size_t k = 0; k < rig.force_dofs.size(); ++k) {
        const auto row = static_cast<Index>(k);
        out.channels.push_back(make_channel(rig, true, rig.force_dofs[k]));
        rig_channel& channel = out.channels.back();
        convert(u.row(row), rig.bits, channel);
        for (Index n = 0; n <= count; ++n) u(row, n) = channel.value(static_cast<std::size_t>(n));
        channel.codes.pop_back();
    }
    MatrixXd y = respond(rig, u, count);
    for (std::size_t k = 0; k < rig.sense_dofs.size(); ++k) {
        const auto row = static_cast<Index>(k);
        gaussian random(rig.seed, stream_noise + k);
        const double sigma = rig.noise_percent / 100 * y.row(row).norm() / std::sqrt(static_cast<double>(count));
        for (Index n = 0; sigma > 0 && n < count; ++n) y(row, n) += sigma * random.next();
        out.channels.push_back(make_channel(rig, false, rig.sense_dofs[k]));
        convert(y.row(row), rig.bits, out.channels.back());
    }
    return out;
}

rig_run simulate_hit(rig rig, std::size_t place, int number) {
    const std::uint64_t seed = rig.seed + 1000 * (place + 1) + static_cast<std::uint64_t>(number);
    rig.force_dofs = {rig.force_dofs[place]};
    rig.seed = seed;
    rig.one_hit = true;
    rig.force_rms *= 0.7 + 0.6 * gaussian(seed, stream_strength).uniform();
    rig_run out = simulate_rig(rig);
    out.channels.front().name = "hammer";
    return out;
}

} // namespace okid_host
