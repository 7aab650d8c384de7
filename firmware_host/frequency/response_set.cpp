// SPDX-License-Identifier: MIT
// PURPOSE  the bookkeeping of measured frequency responses: joined, cut to a band, turned round
#include "response_set.hpp"

#include "error.hpp"
#include "files/order_statistics.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>

namespace okid_host {
namespace {

using Eigen::Index;

constexpr Index fewest_lines = 32;
constexpr Index lines_apart = 2;       // lines: windows make neighbours alike, and their noise too
constexpr Index judging_reach = 8;     // lines to either side that judge one
constexpr double least_over_noise = 3; // power of a line over that of its noise: of noise alone 1, under windows 1.2

/// The value that this share of the numbers is below.
double share_of(const Eigen::VectorXd& from, double share) {
    return quantile(std::vector<double>(from.data(), from.data() + from.size()), share);
}

response_set chosen_lines(const response_set& from, const std::vector<Index>& kept) {
    response_set out = from;
    out.frequency_hz.clear();
    out.H.resize(static_cast<Index>(kept.size()), from.H.cols());
    for (const Index l : kept) {
        out.H.row(static_cast<Index>(out.frequency_hz.size())) = from.H.row(l);
        out.frequency_hz.push_back(from.frequency_hz[static_cast<std::size_t>(l)]);
    }
    return out;
}

void check_lines(const response_set& first, const response_set& other, const std::string& a, const std::string& b) {
    const bool same = first.frequency_hz.size() == other.frequency_hz.size() &&
                      std::equal(first.frequency_hz.begin(), first.frequency_hz.end(), other.frequency_hz.begin(),
                                 [](double x, double y) { return std::abs(x - y) <= 1e-5 * (x + y); });
    if (!same)
        throw failure(exit_usage,
                      fmt::format("{}: found {} lines up to {:g} Hz, expected the {} lines up to {:g} Hz of {}: only "
                                  "responses at the same lines can be joined",
                                  b, other.lines(), other.frequency_hz.back(), first.lines(), first.frequency_hz.back(),
                                  a));
}

} // namespace

Index place_in(const std::vector<std::string>& names, const std::string& name) {
    return std::find(names.begin(), names.end(), name) - names.begin();
}

Index place_of(std::vector<std::string>& names, const std::string& name) {
    const Index at = place_in(names, name);
    if (at == static_cast<Index>(names.size())) names.push_back(name);
    return at;
}

response_set join_set_ups(const std::vector<response_set>& sets, const std::vector<std::string>& names) {
    response_set out;
    out.frequency_hz = sets.front().frequency_hz;
    out.set_ups = static_cast<int>(sets.size());
    out.quantity = sets.front().quantity;
    for (std::size_t k = 0; k < sets.size(); ++k) {
        if (sets[k].quantity != out.quantity) out.quantity.clear();
        for (const std::string& unit : sets[k].other_units) (void)place_of(out.other_units, unit);
        check_lines(sets.front(), sets[k], names.front(), names[k]);
        for (const std::string& name : sets[k].inputs) (void)place_of(out.inputs, name);
        for (const std::string& name : sets[k].outputs) (void)place_of(out.outputs, name);
    }
    out.H.setZero(sets.front().lines(), out.n_y() * out.n_u());
    Eigen::VectorXd times = Eigen::VectorXd::Zero(out.H.cols());
    for (const response_set& set : sets)
        for (Index i = 0; i < set.n_u(); ++i)
            for (Index o = 0; o < set.n_y(); ++o) {
                const Index to = place_of(out.outputs, set.outputs[static_cast<std::size_t>(o)]) +
                                 out.n_y() * place_of(out.inputs, set.inputs[static_cast<std::size_t>(i)]);
                const auto from = set.H.col(o + set.n_y() * i);
                if (from.array().isNaN().all()) continue; // not measured in this set-up
                out.H.col(to) += from;
                ++times[to];
            }
    for (Index c = 0; c < out.H.cols(); ++c) {
        if (times[c] == 0)
            throw failure(exit_usage, fmt::format("{}: no response of {} to {}, expected one of every output to every "
                                                  "input",
                                                  names.front(), out.outputs[static_cast<std::size_t>(c % out.n_y())],
                                                  out.inputs[static_cast<std::size_t>(c / out.n_y())]));
        out.H.col(c) /= times[c];
    }
    return out;
}

response_set cut_band(const response_set& from, double low_hz, double high_hz) {
    std::vector<Index> kept;
    Index unmeasured = 0;
    for (Index l = 0; l < from.lines(); ++l) {
        const double f = from.frequency_hz[static_cast<std::size_t>(l)];
        if (!(f > 0 && f >= low_hz && f <= high_hz)) continue;
        if (from.H.row(l).allFinite())
            kept.push_back(l);
        else
            ++unmeasured;
    }
    if (static_cast<Index>(kept.size()) < fewest_lines)
        throw failure(
            exit_usage,
            fmt::format("{} lines between {:g} and {:g} Hz, expected at least {}{}. Choose a wider --band, or measure "
                        "with finer lines",
                        kept.size(), low_hz, high_hz, fewest_lines,
                        unmeasured > 0 ? fmt::format("; {} more hold no number or have no coherence", unmeasured)
                                       : ""));
    return chosen_lines(from, kept);
}

namespace {

/// Power of each response that does not follow from the lines beside, as if all of it were noise.
Eigen::MatrixXd noise_of(const response_set& from) {
    const Index lines = from.lines();
    Eigen::MatrixXd noise(lines, from.H.cols());
    for (Index l = 0; l < lines; ++l) {
        const Index at = std::clamp(l, lines_apart, lines - 1 - lines_apart);
        const auto f = [&](Index line) { return from.frequency_hz[static_cast<std::size_t>(line)]; };
        const double share = (f(at) - f(at - lines_apart)) / (f(at + lines_apart) - f(at - lines_apart));
        noise.row(l) =
            (from.H.row(at) - (1 - share) * from.H.row(at - lines_apart) - share * from.H.row(at + lines_apart))
                .cwiseAbs2() /
            (1 + (1 - share) * (1 - share) + share * share);
    }
    return noise;
}

} // namespace

Eigen::VectorXd noise_shares(const response_set& from) {
    const Eigen::MatrixXd signal = from.H.cwiseAbs2(), noise = noise_of(from);
    Eigen::VectorXd out = Eigen::VectorXd::Zero(from.n_y());
    for (Index c = 0; c < from.H.cols(); ++c)
        out[c % from.n_y()] +=
            std::min(1.0, share_of(noise.col(c), 0.5) / std::max(share_of(signal.col(c), 0.5), 1e-300)) /
            static_cast<double>(from.n_u());
    return out;
}

response_set without_noise_lines(const response_set& from) {
    const Index lines = from.lines(), reach = std::max(judging_reach, lines / 50);
    const Eigen::MatrixXd signal = from.H.cwiseAbs2(), noise = noise_of(from);
    std::vector<Index> kept;
    for (Index l = 0; l < lines; ++l) {
        const Index first = std::max<Index>(0, l - reach), count = std::min(lines, l + reach + 1) - first;
        std::vector<double> over;
        for (Index c = 0; c < from.H.cols(); ++c)
            over.push_back(share_of(signal.col(c).segment(first, count), 0.5) /
                           std::max(share_of(noise.col(c).segment(first, count), 0.5), 1e-300));
        if (share_of(Eigen::VectorXd::Map(over.data(), from.H.cols()), 0.75) >= least_over_noise) kept.push_back(l);
    }
    if (static_cast<Index>(kept.size()) < fewest_lines)
        throw failure(
            exit_no_model,
            fmt::format("no model: at {} of {} lines from {:g} to {:g} Hz the responses are more than noise, "
                        "expected at least {}. Average more, or say with --band which lines to take as they are",
                        kept.size(), lines, from.frequency_hz.front(), from.frequency_hz.back(), fewest_lines));
    return chosen_lines(from, kept);
}

response_set exchanged(const response_set& from) {
    response_set out = from;
    std::swap(out.inputs, out.outputs);
    for (Index i = 0; i < from.n_u(); ++i)
        for (Index o = 0; o < from.n_y(); ++o) out.H.col(i + from.n_u() * o) = from.H.col(o + from.n_y() * i);
    return out;
}

} // namespace okid_host
