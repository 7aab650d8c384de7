// SPDX-License-Identifier: MIT
// PURPOSE  which modes of two results are the same, how far they moved, and whether that is more than chance
// METHOD   pairs by MAC and frequency, best first. A shift is more than chance where Student's t of it, Holm (1979) over the
//          shifts of all pairs, frequency and damping together, is below 1 %: Holm's bound holds for shifts that depend on
//          each other. The degrees of freedom are the smaller number of blocks behind the two standard deviations less one,
//          the safe side of Welch (Hsu 1938): the deviation of 20 blocks is itself uncertain by a sixth
#include "comparison.hpp"

#include "consensus/consensus.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <tuple>

namespace okid_host {
namespace {

constexpr double alike = 0.8;            // MAC from which two shapes are one
constexpr double half_alike = 0.5;       // MAC
constexpr double near_sigmas = 3;        // of the shift: the frequencies agree
constexpr double near_frequency = 0.05;  // and no farther than this, however wide the standard deviation
constexpr int usual_blocks = 20;         // behind the deviations of a file that does not say
constexpr int nearly_gaussian = 1000;    // degrees of freedom
constexpr std::size_t fewest_places = 2; // for a MAC that says something

double apart(const known_mode& a, const known_mode& b) { return std::abs(std::log(b.frequency_hz / a.frequency_hz)); }

bool agree(const known_mode& a, const known_mode& b) {
    const double sigma = std::hypot(a.frequency_std_hz, b.frequency_std_hz);
    return std::abs(b.frequency_hz - a.frequency_hz) <= near_sigmas * sigma && apart(a, b) < near_frequency;
}

struct candidate {
    double cost;
    std::size_t a, b;
};

void take_best(std::vector<candidate> from, std::vector<bool>& taken_a, std::vector<bool>& taken_b,
               std::vector<std::pair<std::size_t, std::size_t>>& to) {
    std::sort(from.begin(), from.end(), [](const candidate& x, const candidate& y) {
        return std::tie(x.cost, x.a, x.b) < std::tie(y.cost, y.a, y.b);
    });
    for (const candidate& one : from) {
        if (taken_a[one.a] || taken_b[one.b]) continue;
        taken_a[one.a] = taken_b[one.b] = true;
        to.emplace_back(one.a, one.b);
    }
}

/// Probability that Student's t of so many degrees of freedom is as far from zero. Source: Abramowitz, Stegun 26.7.3, 26.7.4.
double student_tails(double t, int freedom) {
    if (freedom > nearly_gaussian) return std::erfc(std::abs(t) / M_SQRT2);
    const double angle = std::atan(std::abs(t) / std::sqrt(freedom)), c = std::cos(angle), s = std::sin(angle);
    double term = freedom % 2 == 1 ? c : 1, sum = freedom == 1 ? 0 : term;
    for (int k = freedom % 2 == 1 ? 3 : 2; k < freedom; k += 2) {
        term *= c * c * (k - 1) / k;
        sum += term;
    }
    const double inside = freedom % 2 == 1 ? 2 / M_PI * (angle + s * sum) : s * sum;
    return std::max(0.0, 1 - inside);
}

value_shift shift_between(double a, double b, double a_std, double b_std) {
    value_shift out;
    out.before = a;
    out.shift = b - a;
    const double sigma = std::hypot(a_std, b_std);
    out.deviation = sigma > 0 && a_std > 0 && b_std > 0 ? sigma : NAN;
    out.z = out.shift / out.deviation;
    out.p = NAN;
    return out;
}

/// The smallest probabilities first, each times the number of those not below it.
void judge(comparison& found) {
    std::vector<value_shift*> known;
    for (mode_pair& pair : found.pairs)
        for (value_shift* one : {&pair.frequency, &pair.damping})
            if (std::isfinite(one->z)) known.push_back(one);
    found.tests = static_cast<int>(known.size());
    for (value_shift* one : known) one->p = student_tails(one->z, found.freedom);
    std::sort(known.begin(), known.end(), [](const value_shift* x, const value_shift* y) { return x->p < y->p; });
    double least = 0;
    for (std::size_t k = 0; k < known.size(); ++k) {
        least = std::max(least, std::min(1.0, known[k]->p * static_cast<double>(known.size() - k)));
        known[k]->p = least;
        known[k]->beyond = least < false_alarm;
    }
}

std::vector<const known_mode*> chosen(const known_result& from, const std::vector<std::size_t>& places) {
    std::vector<const known_mode*> out;
    for (const std::size_t k : places) out.push_back(&from.modes[k]);
    return out;
}

std::vector<std::size_t> left_over(const std::vector<std::size_t>& all, const std::vector<mode_pair>& pairs,
                                   std::size_t mode_pair::* of) {
    std::vector<std::size_t> out;
    for (const std::size_t k : all)
        if (std::none_of(pairs.begin(), pairs.end(), [&](const mode_pair& pair) { return pair.*of == k; }))
            out.push_back(k);
    return out;
}

void remark(comparison& found) {
    const known_result &a = found.a, &b = found.b;
    if (!found.by_shape)
        found.remarks.emplace_back(
            "frequency_alone",
            fmt::format("{} and {} have {} in common: modes are paired by frequency alone, within 10 %", a.name, b.name,
                        found.places.empty() ? "no output" : "one output"));
    std::vector<std::string> without;
    for (const auto& [result, modes] : {std::pair{&a, &found.modes_a}, std::pair{&b, &found.modes_b}})
        if (std::any_of(modes->begin(), modes->end(), [&, from = result](std::size_t k) {
                return !(from->modes[k].frequency_std_hz > 0) || !(from->modes[k].damping_ratio_std > 0);
            }))
            without.push_back(result->name);
    if (!without.empty())
        found.remarks.emplace_back(
            "no_deviation", fmt::format("no standard deviation of some mode in {}: such a shift has no z and raises no "
                                        "alarm. Identify again without --sigma none",
                                        fmt::join(without, " and ")));
    if (a.method != b.method || a.hold != b.hold)
        found.remarks.emplace_back(
            "methods_differ",
            fmt::format("{} was identified by {} (hold {}), {} by {} (hold {}): a part of a shift can be the method's",
                        a.name, a.method, a.hold, b.name, b.method, b.hold));
}

} // namespace

bool comparison::changed() const {
    return std::any_of(pairs.begin(), pairs.end(),
                       [](const mode_pair& pair) { return pair.frequency.beyond || pair.damping.beyond; });
}

std::vector<std::pair<std::size_t, std::size_t>> common_places(const std::vector<std::string>& a,
                                                               const std::vector<std::string>& b) {
    std::vector<std::pair<std::size_t, std::size_t>> out;
    for (std::size_t i = 0; i < a.size(); ++i) {
        const auto at = std::find(b.begin(), b.end(), a[i]);
        const bool first = std::find(a.begin(), a.begin() + static_cast<std::ptrdiff_t>(i), a[i]) ==
                           a.begin() + static_cast<std::ptrdiff_t>(i);
        if (at != b.end() && first) out.emplace_back(i, static_cast<std::size_t>(at - b.begin()));
    }
    return out;
}

std::vector<std::vector<double>> mac_of(const std::vector<const known_mode*>& a,
                                        const std::vector<const known_mode*>& b,
                                        const std::vector<std::pair<std::size_t, std::size_t>>& common) {
    std::vector<std::vector<double>> out(a.size(), std::vector<double>(b.size()));
    for (std::size_t i = 0; i < a.size(); ++i)
        for (std::size_t j = 0; j < b.size(); ++j) {
            std::vector<std::complex<double>> one, other;
            for (const auto& [at_a, at_b] : common) {
                const std::complex<double> x = a[i]->shape[at_a], y = b[j]->shape[at_b];
                if (std::isfinite(std::abs(x)) && std::isfinite(std::abs(y))) one.push_back(x), other.push_back(y);
            }
            out[i][j] = one.size() < fewest_places ? NAN : shape_mac(one, other);
        }
    return out;
}

std::vector<std::pair<std::size_t, std::size_t>> pair_modes(const std::vector<const known_mode*>& a,
                                                            const std::vector<const known_mode*>& b,
                                                            const std::vector<std::vector<double>>& mac,
                                                            const pair_rule& rule) {
    std::vector<candidate> shapes, frequencies;
    for (std::size_t i = 0; i < a.size(); ++i)
        for (std::size_t j = 0; j < b.size(); ++j) {
            const double difference = apart(*a[i], *b[j]), same = mac.empty() ? NAN : mac[i][j];
            if (same >= alike && difference < rule.of_one_shape)
                shapes.push_back({difference / rule.of_one_shape + (1 - same) / (1 - alike), i, j});
            else if (std::isnan(same) ? difference < rule.without_shape
                                      : agree(*a[i], *b[j]) || (same >= half_alike && difference < rule.of_half_shape))
                frequencies.push_back({difference, i, j});
        }
    std::vector<bool> taken_a(a.size()), taken_b(b.size());
    std::vector<std::pair<std::size_t, std::size_t>> out;
    take_best(std::move(shapes), taken_a, taken_b, out);
    take_best(std::move(frequencies), taken_a, taken_b, out);
    return out;
}

comparison compare_results(known_result before, known_result after) {
    comparison found;
    found.a = std::move(before);
    found.b = std::move(after);
    found.modes_a = found.a.confident();
    found.modes_b = found.b.confident();
    const auto common = common_places(found.a.places, found.b.places);
    for (const auto& [at_a, at_b] : common) found.places.push_back(found.a.places[at_a]);
    found.by_shape = common.size() >= fewest_places;
    const auto a = chosen(found.a, found.modes_a), b = chosen(found.b, found.modes_b);
    if (found.by_shape) found.mac = mac_of(a, b, common);
    for (const auto& [i, j] : pair_modes(a, b, found.mac, of_two_tests)) {
        mode_pair& pair = found.pairs.emplace_back();
        pair.a = found.modes_a[i];
        pair.b = found.modes_b[j];
        pair.mac = found.by_shape ? found.mac[i][j] : NAN;
        pair.frequency =
            shift_between(a[i]->frequency_hz, b[j]->frequency_hz, a[i]->frequency_std_hz, b[j]->frequency_std_hz);
        pair.damping =
            shift_between(a[i]->damping_ratio, b[j]->damping_ratio, a[i]->damping_ratio_std, b[j]->damping_ratio_std);
    }
    std::sort(found.pairs.begin(), found.pairs.end(), [](const mode_pair& x, const mode_pair& y) { return x.a < y.a; });
    found.only_a = left_over(found.modes_a, found.pairs, &mode_pair::a);
    found.only_b = left_over(found.modes_b, found.pairs, &mode_pair::b);
    const auto blocks = [](const known_result& one) { return one.sigma_blocks > 0 ? one.sigma_blocks : usual_blocks; };
    found.freedom = std::max(1, std::min(blocks(found.a), blocks(found.b)) - 1);
    judge(found);
    remark(found);
    return found;
}

} // namespace okid_host
