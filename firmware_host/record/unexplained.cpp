// SPDX-License-Identifier: MIT
// METHOD   Welch spectra of every output and of what the simulation of all listed modes leaves. A peak is the largest of nine lines,
//          ten times the median of the 64 around it, and holds a hundredth of the power of its output. It is explained by a mode that
//          is confident, or named for what it is (tone, pickup, harmonic, split), within three lines or three half-power
//          bandwidths; with a force also where the model leaves less than half of the power there
#include "unexplained.hpp"

#include "consensus/spectrum.hpp"
#include "files/order_statistics.hpp"
#include "modal_answer.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <initializer_list>
#include <utility>

namespace okid_host {
namespace {

constexpr std::size_t smallest = 128, largest = 8192; // samples of a segment
constexpr std::size_t segments = 8;
constexpr std::size_t around = 4, beside = 32; // lines of a peak, of its neighbourhood, on each side
constexpr double above = 10;                   // times the median there
constexpr double least_share = 0.01;           // of the power of the output
constexpr double left_share = 0.5;             // of the power of the peak: less is explained by the model
constexpr std::size_t most_listed = 5;

struct peak {
    double share, frequency_hz;
};

/// Lines k - around … k + around, and what they add up to.
double power_at(const std::vector<double>& power, std::size_t k) {
    double sum = 0;
    for (std::size_t i = k - around; i <= k + around; ++i) sum += power[i];
    return sum;
}

bool is_peak(const std::vector<double>& power, std::size_t k) {
    for (std::size_t i = k - around; i <= k + around; ++i)
        if (power[i] > power[k]) return false;
    const std::size_t first = k > beside ? k - beside : 0, last = std::min(power.size() - 1, k + beside);
    std::vector<double> near(power.begin() + static_cast<std::ptrdiff_t>(first),
                             power.begin() + static_cast<std::ptrdiff_t>(last + 1));
    return power[k] > above * upper_median(near);
}

bool accounted_for(double f, double line_hz, const std::vector<listed_mode>& listed,
                   const std::vector<mode_verdict>& verdicts) {
    for (std::size_t k = 0; k < listed.size(); ++k) {
        const std::vector<std::string>& why = verdicts[k].why;
        const auto is_any = [&](std::initializer_list<const char*> codes) {
            return std::any_of(codes.begin(), codes.end(), [&](const char* code) { return has_code(why, code); });
        };
        const bool known = is_any({"tone", "pickup", "harmonic"}) || !is_any({"few_runs", "noise_shape", "wide_sigma"});
        const double width = 3 * std::max(line_hz, listed[k].damping_ratio * listed[k].frequency_hz);
        if (known && std::abs(listed[k].frequency_hz - f) < width) return true;
    }
    return false;
}

} // namespace

void remark_unexplained(const std::vector<listed_mode>& listed, double fs_hz, record_work& work) {
    const record_set& set = work.set;
    std::size_t longest = 0, size = smallest;
    for (const record_data& record : set.records) longest = std::max(longest, record.count);
    while (2 * size <= largest && 2 * size * segments / 2 <= longest) size *= 2;
    std::vector<std::vector<double>> all;
    for (const record_data& record : set.records) all.push_back(set.outputs(record, 0, record.count));
    std::vector<std::vector<double>> left = all;
    if (set.n_u > 0 && work.context.x0) {
        std::vector<const listed_mode*> in_model;
        for (const listed_mode& mode : listed) in_model.push_back(&mode);
        for (std::size_t r = 0; r < set.records.size(); ++r) left[r] = answer(work, in_model, r).left;
    }
    const auto band = work.context.band_hz.value_or(std::pair{0.0, fs_hz / 2});
    const double line_hz = fs_hz / static_cast<double>(size);
    std::vector<peak> found;
    for (std::size_t o = 0; o < set.n_y; ++o) {
        const std::vector<double> power = power_spectrum(all, set.n_y, o, size),
                                  rest = power_spectrum(left, set.n_y, o, size);
        if (power.empty() || rest.empty()) continue;
        double total = 0;
        for (const double p : power) total += p;
        for (std::size_t k = around; k + around < rest.size(); ++k) {
            const double f = static_cast<double>(k) * line_hz, share = power_at(rest, k) / total;
            if (f < band.first || f > band.second || share < least_share || !is_peak(rest, k) ||
                power_at(rest, k) < left_share * power_at(power, k) ||
                accounted_for(f, line_hz, listed, work.context.verdicts))
                continue;
            const auto same = std::find_if(found.begin(), found.end(), [&](const peak& one) {
                return std::abs(one.frequency_hz - f) < 2.5 * line_hz;
            });
            if (same == found.end())
                found.push_back({share, f});
            else if (share > same->share)
                *same = {share, f};
        }
    }
    if (found.empty()) return;
    std::sort(found.begin(), found.end(), [](const peak& a, const peak& b) { return a.share > b.share; });
    std::vector<std::string> peaks;
    for (std::size_t i = 0; i < std::min(most_listed, found.size()); ++i)
        peaks.push_back(fmt::format("{:.4g} Hz ({:.0f} %)", found[i].frequency_hz, 100 * found[i].share));
    work.context.warnings.emplace_back(
        "unexplained",
        fmt::format("power at {}{} that no mode explains (share of an output's power): a mode the record shows too "
                    "little of, a tone, or an order too low. Look at --all-modes, or at one method: --method n4sid-cva",
                    fmt::join(peaks, ", "), found.size() > most_listed ? " and elsewhere" : ""));
}

} // namespace okid_host
