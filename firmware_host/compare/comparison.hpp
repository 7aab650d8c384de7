// SPDX-License-Identifier: MIT
// Two results of one structure: which modes are the same, how far they moved, and whether that is more than chance.
#pragma once
#include "known_result.hpp"

#include <cstddef>
#include <nlohmann/json.hpp>
#include <string>
#include <utility>
#include <vector>

namespace okid_host {

/// Of a frequency (Hz) or a damping ratio: after minus before.
struct value_shift {
    double before = 0, shift = 0;
    double deviation = 0, z = 0; ///< one standard deviation of the shift, NaN: one of the two has none
    double p = 0;                ///< probability of so much by chance among all shifts compared (Holm); NaN: no z
    bool beyond = false;         ///< more than chance

    double percent() const { return 100 * shift / before; }
    double deviation_percent() const { return 100 * deviation / before; }
};

struct mode_pair {
    std::size_t a = 0, b = 0; ///< places in the modes of both
    double mac = 0;           ///< NaN where fewer than two places are common
    value_shift frequency, damping;
};

struct comparison {
    known_result a, b;                         ///< earlier, later
    std::vector<std::string> places;           ///< that both have, in the order of `a`
    bool by_shape = false;                     ///< else by frequency alone
    std::vector<std::size_t> modes_a, modes_b; ///< the confident ones
    std::vector<std::vector<double>> mac;      ///< of each of modes_a with each of modes_b; empty without shapes
    std::vector<mode_pair> pairs;              ///< ascending in frequency of `a`
    std::vector<std::size_t> only_a, only_b;
    int tests = 0;                                            ///< shifts with a standard deviation
    int freedom = 0;                                          ///< degrees of freedom of Student's t
    std::vector<std::pair<std::string, std::string>> remarks; ///< code, text

    bool changed() const; ///< some shift is more than chance
};

/// Shares of this rate: one comparison of two results of an unchanged structure in a hundred reports a shift.
constexpr double false_alarm = 0.01;

/// MAC of each mode of `a` with each of `b` over the places in common; an entry that one of the two lacks counts in none.
/// @param common  places of the entries in both shapes
std::vector<std::vector<double>> mac_of(const std::vector<const known_mode*>& a,
                                        const std::vector<const known_mode*>& b,
                                        const std::vector<std::pair<std::size_t, std::size_t>>& common);

/// How far apart in frequency, as a share of it, two modes may be that are one: of one shape, and where no shape is known.
struct pair_rule {
    double of_one_shape, without_shape;
    double of_half_shape; ///< from a MAC of 0.5 on
};
/// Set-ups are of one day: their modes lie near, and a reference or two say less of a shape.
constexpr pair_rule of_two_tests{0.3, 0.1, 0}, of_set_ups{0.1, 0.03, 0.01};

/// Which modes of two lists are one: places in both, the best pair first.
///
/// Modes are one where the MAC is 0.8 or more and the frequencies are as near as the rule asks. Below 0.8 they are one only
/// where the frequencies agree within three standard deviations: a sensor may spoil a shape, but no other mode moves exactly
/// there.
/// @param mac  of each with each; empty: no shapes
std::vector<std::pair<std::size_t, std::size_t>> pair_modes(const std::vector<const known_mode*>& a,
                                                            const std::vector<const known_mode*>& b,
                                                            const std::vector<std::vector<double>>& mac,
                                                            const pair_rule& rule);

/// Names that both lists have, in the order of the first: places in both.
std::vector<std::pair<std::size_t, std::size_t>> common_places(const std::vector<std::string>& a,
                                                               const std::vector<std::string>& b);

comparison compare_results(known_result before, known_result after);

/// okid.comparison/1.
nlohmann::ordered_json comparison_json(const comparison& found);

/// For a person.
std::string comparison_table(const comparison& found);

} // namespace okid_host
