// SPDX-License-Identifier: MIT
// PURPOSE  records at several rates
// METHOD   halved again and again behind the linear-phase filter of fir_kernel.hpp, the same for forces and responses: what
//          lies between both stays the structure. Short gaps are bridged (gap_bridge.hpp); a sample whose filter meets a
//          missing one is missing
#include "levels.hpp"

#include "fir_kernel.hpp"
#include "gap_bridge.hpp"
#include "spectrum.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

namespace okid_host {
namespace {

constexpr double top_decimated = 0.42; // inside the pass band of the filter
constexpr double top_full = 0.48;      // where the record has no filter of its own
constexpr double edge_power = 0.1;     // of the usual power, above top_decimated: less means an anti-alias filter
constexpr double no_power = 1e-3;      // of the usual power, below: nothing is excited there
constexpr double band_step = 0.02;
constexpr double most_cut_off =
    0.1; // of the energy, at the beginning: a decay that is over by then has no narrow bands
constexpr double edge_of_band = 0.04; // of the rate, on each side of a folded band: (0.5 - 0.42) / 2
constexpr std::size_t spectrum_size = 256;

/// The weights of a kernel; moved up to the middle of a band.
Eigen::VectorXd weights_of(const fir_kernel& kernel, double middle = 0) {
    Eigen::VectorXd out(static_cast<Eigen::Index>(2 * kernel.half()));
    kernel.weights(0, out.data());
    const double centre = static_cast<double>(kernel.half()) - 1; // of the symmetric weights
    for (Eigen::Index i = 0; middle > 0 && i < out.size(); ++i)
        out[i] *= 2 * std::cos(2 * M_PI * middle * (static_cast<double>(i) - centre));
    return out;
}

/// Every factor-th sample behind the filter. Silence, where the record began in it, stands before the first.
sample_rows thinned(const Eigen::VectorXd& weights, std::size_t factor, const sample_rows& rows, std::size_t m,
                    bool at_rest) {
    const auto taps = static_cast<std::size_t>(weights.size());
    const std::size_t lead = at_rest ? taps / 2 : 0, count = lead + rows.size() / m;
    Eigen::VectorXd channel(static_cast<Eigen::Index>(count));
    const std::size_t out_count = count < taps ? 0 : (count - taps) / factor + 1;
    sample_rows out(out_count * m);
    for (std::size_t k = 0; k < m; ++k) {
        channel.head(static_cast<Eigen::Index>(lead)).setZero();
        for (std::size_t i = lead; i < count; ++i) channel[static_cast<Eigen::Index>(i)] = rows[(i - lead) * m + k];
        for (std::size_t i = 0; i < out_count; ++i)
            out[i * m + k] = weights.dot(channel.segment(static_cast<Eigen::Index>(factor * i), weights.size()));
    }
    return out;
}

long long complete(const std::vector<sample_rows>& records, std::size_t m) {
    long long out = 0;
    for (const sample_rows& rows : records)
        for (std::size_t n = 0; n + m <= rows.size(); n += m) {
            double check = 0;
            for (std::size_t k = 0; k < m; ++k) check += rows[n + k] * 0.0;
            out += check == 0;
        }
    return out;
}

/// Each record less its own means, all channels in units of their spread.
void normalise(std::vector<sample_rows>& records, std::size_t m, std::vector<double>& scale) {
    scale.assign(m, 1.0);
    for (std::size_t k = 0; k < m; ++k) {
        double square = 0, total = 0;
        for (sample_rows& rows : records) {
            double sum = 0, count = 0;
            for (std::size_t i = k; i < rows.size(); i += m)
                if (!std::isnan(rows[i])) sum += rows[i], count += 1;
            for (std::size_t i = k; count > 0 && i < rows.size(); i += m) {
                rows[i] -= sum / count;
                if (!std::isnan(rows[i])) square += rows[i] * rows[i];
            }
            total += count;
        }
        if (square > 0) scale[k] = std::sqrt(square / total);
        for (sample_rows& rows : records)
            for (std::size_t i = k; i < rows.size(); i += m) rows[i] /= scale[k];
    }
}

/// The share of the rate up to which the forces, without any the responses, have power.
double top_of(const std::vector<sample_rows>& records, std::size_t n_u, std::size_t m) {
    double top = top_full;
    for (std::size_t k = 0; k < (n_u > 0 ? n_u : m); ++k) {
        const std::vector<double> power = power_spectrum(records, m, k, spectrum_size);
        if (power.empty()) return top_decimated;
        const double usual = median_power(power, 0.05, 0.40);
        for (double low = 0.30; low < top; low += band_step) {
            const double here = mean_power(power, low, low + band_step);
            if (here >= (low < top_decimated - 1e-9 ? no_power : edge_power) * usual) continue;
            top = std::min(top, low);
            break;
        }
    }
    return top;
}

/// Share of the energy of the records that stands before their sample `count`: what a filter that settles so late cuts off.
double share_before(const std::vector<sample_rows>& records, std::size_t m, std::size_t count) {
    double before = 0, all = 0;
    for (const sample_rows& rows : records)
        for (std::size_t i = 0; i < rows.size(); ++i) {
            if (std::isnan(rows[i])) continue;
            all += rows[i] * rows[i];
            if (i < count * m) before += rows[i] * rows[i];
        }
    return all > 0 ? before / all : 1;
}

} // namespace

std::vector<double> decimation_weights(int factor) {
    const Eigen::VectorXd weights = weights_of(fir_kernel(factor, 1));
    return {weights.begin(), weights.end()};
}

std::vector<record_level> make_levels(std::vector<sample_rows> records, std::size_t n_u, std::size_t n_y, double fs_hz,
                                      bool at_rest, int decimate, std::vector<double>& scale) {
    const std::size_t m = n_u + n_y;
    const Eigen::VectorXd half = weights_of(fir_kernel(2, 1));
    std::vector<record_level> out(1);
    out[0].fs_hz = fs_hz;
    out[0].records = std::move(records);
    normalise(out[0].records, m, scale);
    if (std::vector<sample_rows> bridged = bridge_gaps(out[0].records, m); !bridged.empty())
        out[0].records = std::move(bridged);
    if (decimate > 1) {
        const Eigen::VectorXd first = weights_of(fir_kernel(decimate, 1));
        std::vector<sample_rows> slower;
        for (const sample_rows& rows : out[0].records)
            slower.push_back(thinned(first, static_cast<std::size_t>(decimate), rows, m, at_rest));
        out[0].records = std::move(slower);
        out[0].fs_hz /= decimate;
        std::vector<double> again;
        normalise(out[0].records, m, again);
        for (std::size_t k = 0; k < m; ++k) scale[k] *= again[k];
    }
    out[0].top = decimate > 1 ? top_decimated : top_of(out[0].records, n_u, m);
    out[0].samples = complete(out[0].records, m);
    while (out.size() < most_levels) {
        record_level next;
        next.fs_hz = out.back().fs_hz / 2;
        next.top = std::min(top_decimated, 2 * out.back().top);
        for (const sample_rows& rows : out.back().records) next.records.push_back(thinned(half, 2, rows, m, at_rest));
        next.samples = complete(next.records, m);
        if (next.samples < fewest_samples) break;
        out.push_back(std::move(next));
    }
    return out;
}

record_level zoomed_level(const record_level& first, std::size_t m, int factor, double frequency_hz, bool at_rest) {
    record_level out;
    out.zoomed = true;
    out.fs_hz = first.fs_hz / factor;
    out.band = static_cast<int>(frequency_hz / (out.fs_hz / 2));
    const double share = out.zoom().folded(frequency_hz) / out.fs_hz;
    out.bottom = out.band > 0 ? edge_of_band : 0;
    out.top = out.band > 0 ? 0.5 - edge_of_band : top_decimated;
    const double most = first.top * first.fs_hz; // and nothing above what the record shows
    if (share < out.bottom || share > out.top || (out.band + 1) * out.fs_hz / 2 > most + edge_of_band * out.fs_hz)
        return out;
    // half the band on each side of its middle: twice as narrow as that of the rate itself
    const Eigen::VectorXd weights = out.band > 0
                                        ? weights_of(fir_kernel(2.0 * factor, 1), (out.band + 0.5) / (2 * factor))
                                        : weights_of(fir_kernel(factor, 1));
    const auto settles = static_cast<std::size_t>(weights.size()) / 2;
    if (!at_rest && share_before(first.records, m, settles) > most_cut_off) return out;
    for (const sample_rows& rows : first.records)
        out.records.push_back(thinned(weights, static_cast<std::size_t>(factor), rows, m, at_rest));
    out.samples = complete(out.records, m);
    if (out.samples < fewest_samples) out.records.clear();
    return out;
}

} // namespace okid_host
