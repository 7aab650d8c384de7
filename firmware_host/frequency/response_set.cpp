// SPDX-License-Identifier: MIT
// PURPOSE  the bookkeeping of measured frequency responses: joined, cut to a band, turned round
#include "response_set.hpp"

#include "error.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>

namespace okid_host {
namespace {

constexpr Eigen::Index fewest_lines = 32;

using Eigen::Index;

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
    for (std::size_t k = 0; k < sets.size(); ++k) {
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
    for (Index l = 0; l < from.lines(); ++l)
        if (const double f = from.frequency_hz[static_cast<std::size_t>(l)]; f > 0 && f >= low_hz && f <= high_hz)
            kept.push_back(l);
    const auto count = static_cast<Index>(kept.size());
    if (count < fewest_lines)
        throw failure(exit_usage, fmt::format("{} lines between {:g} and {:g} Hz, expected at least {}", count, low_hz,
                                              high_hz, fewest_lines));
    response_set out = from;
    out.frequency_hz.clear();
    out.H.resize(count, from.H.cols());
    for (Index k = 0; k < count; ++k) {
        const Index l = kept[static_cast<std::size_t>(k)];
        out.frequency_hz.push_back(from.frequency_hz[static_cast<std::size_t>(l)]);
        out.H.row(k) = from.H.row(l);
        if (!out.H.row(k).allFinite())
            throw failure(exit_usage, fmt::format("a response is no number at {:g} Hz; --band leaves lines out",
                                                  out.frequency_hz.back()));
    }
    return out;
}

response_set exchanged(const response_set& from) {
    response_set out = from;
    std::swap(out.inputs, out.outputs);
    for (Index i = 0; i < from.n_u(); ++i)
        for (Index o = 0; o < from.n_y(); ++o) out.H.col(i + from.n_u() * o) = from.H.col(o + from.n_y() * i);
    return out;
}

} // namespace okid_host
