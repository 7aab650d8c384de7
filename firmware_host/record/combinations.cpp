// SPDX-License-Identifier: MIT
// PURPOSE  tell modes of a nonlinear structure from the distortion it makes
// METHOD   a spring that is not straight answers motions at f1, f2 with forces at 2 f1, f1 + f2, 2 f1 + f2 ..., whose amplitude
//          in a short block is the product of theirs, phase included (higher-order coherence: Kim & Powers 1979). Of a linear
//          structure under chance forces the phases have nothing to do with each other. With a force it is what the model
//          leaves that is looked at, and a frequency at which the force drives a resonance is a mode all the same
#include "combinations.hpp"

#include "consensus/consensus.hpp"
#include "consensus/demodulation.hpp"
#include "consensus/spectrum.hpp"
#include "modal_answer.hpp"
#include "result/judgement.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <functional>
#include <map>
#include <numeric>
#include <tuple>

namespace okid_host {
namespace {

using complex = std::complex<double>;
using series = std::vector<double>;

constexpr std::size_t most_bases = 5,
                      most_mixed = 3; ///< the strongest vibrations, to explain a mode and to look for more
constexpr std::size_t most_outputs = 8;
constexpr double resolved = 2;          ///< beats in a block under a Hann window: fewer, and one leaks into the other
constexpr double endless = 1e12;        ///< samples of a block that no record holds
constexpr double highest = 0.45;        ///< of the rate
constexpr double two_vibrations = 0.03; ///< two vibrations
constexpr double wandering = 0.15,
                 one_shape = 0.8;             ///< one vibration whose frequency moves: that close, of one shape (MAC)
constexpr double next_to = 0.1;               ///< of a mode of the model its own residual is looked at
constexpr std::size_t shortest_spectrum = 64; ///< samples of a spectrum

/// One mode along its shape: all of it, and what the forces do not explain.
struct strand {
    std::vector<series> all, left;              ///< a record each
    double power = 0, share_left = 1, peak = 0; ///< at its frequency; peak: of what the forces drive, over beside it
    double strength = 0;                        ///< amplitude as a displacement
    bool rings = false;                         ///< down between hits that were not measured
    bool line = false;                          ///< of a machine or the mains: its multiples are its own, no distortion
};

/// Factors and how often each: {base, n}; n < 0: the conjugate.
using product = std::vector<std::pair<std::size_t, int>>;

struct product_search {
    const std::vector<listed_mode>& modes;
    double fs_hz;
    bool driven;
    std::vector<strand> strands;
    std::vector<std::vector<series>> outputs; ///< some of them, a record each: what the forces do not explain
    std::map<std::pair<std::size_t, std::size_t>, std::vector<complex>> known; ///< amplitudes: mode, block

    const std::vector<complex>& amplitudes(std::size_t mode, std::size_t block);
};

std::vector<complex> demodulated(const std::vector<series>& records, double cycles, std::size_t block) {
    std::vector<complex> out;
    for (const series& x : records) demodulate(x.size(), cycles, block, [&](std::size_t t) { return x[t]; }, out);
    return out;
}

const std::vector<complex>& product_search::amplitudes(std::size_t mode, std::size_t block) {
    auto [at, fresh] = known.try_emplace({mode, block});
    if (fresh) at->second = demodulated(strands[mode].all, modes[mode].frequency_hz / fs_hz, block);
    return at->second;
}

/// Mean length of the steps between phases, loud blocks counting more; NaN: missing.
double coherence(const std::vector<complex>& b, const std::vector<complex>& of) {
    complex sum = 0;
    double total = 0, squares = 0;
    for (std::size_t i = 0; i < b.size(); ++i) {
        const complex p = b[i] * std::conj(of[i]);
        const double size = std::sqrt(std::abs(p));
        if (!(size > 0)) continue;
        sum += p / size;
        total += size;
        squares += size * size;
    }
    const double length = total > 0 ? std::abs(sum) / total : 0;
    return total * total * length * length > judgement::by_chance * squares ? length : 0;
}

/// Every product of the bases with these numbers of factors.
void each_product(const std::vector<std::size_t>& bases, const std::function<void(const product&)>& see) {
    std::vector<int> n(bases.size(), -judgement::most_factors);
    const auto next = [&n] {
        for (int& one : n) {
            if (++one <= judgement::most_factors) return true;
            one = -judgement::most_factors;
        }
        return false;
    };
    do {
        const int factors =
            std::accumulate(n.begin(), n.end(), 0, [](int sum, int one) { return sum + std::abs(one); });
        if (factors < 2 || factors > judgement::most_factors) continue;
        product out;
        for (std::size_t i = 0; i < n.size(); ++i)
            if (n[i] != 0) out.emplace_back(bases[i], n[i]);
        see(out);
    } while (next());
    for (const std::size_t base : bases)
        for (int multiple = judgement::most_factors + 1; multiple <= judgement::most_multiple; ++multiple)
            see({{base, multiple}});
}

std::string words_of(const product& of, const std::vector<listed_mode>& modes) {
    std::string out;
    for (const auto& [mode, n] : of) {
        if (!out.empty() || n < 0) out += n < 0 ? (out.empty() ? "−" : " − ") : " + ";
        if (std::abs(n) > 1) out += fmt::format("{} × ", std::abs(n));
        out += fmt::format("{:.4g}", modes[mode].frequency_hz);
    }
    return out;
}

/// The strongest vibrations, those that are signed first; of a mode k those that are stronger and not its neighbours.
std::vector<std::size_t> bases_of(const product_search& s, std::size_t k, std::size_t most) {
    std::vector<std::size_t> order(s.modes.size()), out;
    std::iota(order.begin(), order.end(), std::size_t{0});
    std::sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
        return std::make_tuple(!s.modes[a].in_model, -s.strands[a].strength, a) <
               std::make_tuple(!s.modes[b].in_model, -s.strands[b].strength, b);
    });
    const bool any = k == order.size();
    const auto near = [&](std::size_t a, std::size_t b) {
        const double e = std::abs(s.modes[a].frequency_hz / s.modes[b].frequency_hz - 1);
        return e < two_vibrations ||
               (any && e < wandering && shape_mac(s.modes[a].shape, s.modes[b].shape) > one_shape);
    };
    for (const std::size_t i : order)
        if (out.size() < most && !s.strands[i].line &&
            (any || (i != k && s.strands[i].strength > s.strands[k].strength && !near(i, k))) &&
            std::none_of(out.begin(), out.end(), [&](std::size_t j) { return near(i, j); }))
            out.push_back(i);
    return out;
}

double frequency_of(const product& of, const std::vector<listed_mode>& modes) {
    return std::accumulate(of.begin(), of.end(), 0.0, [&](double sum, const auto& factor) {
        return sum + factor.second * modes[factor.first].frequency_hz;
    });
}

/// Distance from the nearest of the first multiples of a line: those of one machine are in phase by themselves.
double beside_lines(const product_search& s, double frequency_hz, double multiples) {
    double closest = INFINITY;
    for (std::size_t k = 0; k < s.modes.size(); ++k) {
        if (!s.strands[k].line) continue;
        const double base = s.modes[k].frequency_hz, n = std::clamp(std::round(frequency_hz / base), 1.0, multiples);
        closest = std::min(closest, std::abs(frequency_hz - n * base));
    }
    return closest;
}

/// Samples of a block that holds six periods of the slowest factor, and in which no factor looks like another, like their
/// product or like a line: what leaks from one into the other moves in phase by itself.
std::size_t block_of(const product_search& s, const product& of) {
    std::vector<double> apart{frequency_of(of, s.modes)};
    double slowest = INFINITY, closest = beside_lines(s, apart.front(), judgement::most_multiple);
    for (const auto& factor : of) {
        const double f = s.modes[factor.first].frequency_hz;
        slowest = std::min(slowest, f);
        closest = std::min(closest, beside_lines(s, f, judgement::most_multiple));
        for (const double other : apart) closest = std::min(closest, std::abs(f - other));
        apart.push_back(f);
    }
    const double seconds = std::max(judgement::product_periods / slowest, resolved / closest);
    return static_cast<std::size_t>(std::min(seconds * s.fs_hz, endless)) + 1;
}

/// How much records follow a product of vibrations; 0 where that is not known.
double following(product_search& s, const std::vector<series>& records, const product& of) {
    const std::size_t block = block_of(s, of);
    std::size_t count = 0;
    for (const series& x : records) count += x.size() / block;
    if (count < judgement::product_blocks) return 0;
    const std::vector<complex> b = demodulated(records, frequency_of(of, s.modes) / s.fs_hz, block);
    std::vector<complex> together(b.size(), 1);
    for (const auto& [i, n] : of) {
        const std::vector<complex>& a = s.amplitudes(i, block);
        if (!lasts(a) || s.strands[i].rings) return 0; // the phases of a decay are those of its hit
        for (std::size_t t = 0; t < b.size(); ++t) together[t] *= std::pow(n > 0 ? a[t] : std::conj(a[t]), std::abs(n));
    }
    return coherence(b, together);
}

/// The product that mode k follows, in phase more than so much; empty: none.
product followed(product_search& s, std::size_t k, double most, double tolerance) {
    product best;
    const listed_mode& mode = s.modes[k];
    each_product(bases_of(s, k, most_bases), [&](const product& of) {
        const double f = frequency_of(of, s.modes);
        if (std::abs(f / mode.frequency_hz - 1) > std::max(tolerance, mode.damping_ratio)) return;
        if (const double found = following(s, s.strands[k].left, of); found > most) most = found, best = of;
    });
    return best;
}

/// The multiples and sums of the strongest vibrations at which some output moves in phase, listed as a mode or not.
std::vector<product> distortions(product_search& s) {
    std::vector<product> out;
    const std::vector<std::size_t> bases = bases_of(s, s.modes.size(), most_mixed);
    each_product(bases, [&](const product& of) {
        const double f = frequency_of(of, s.modes);
        if (f > highest * s.fs_hz || beside_lines(s, f, INFINITY) < judgement::mains_tolerance * f ||
            of.front().second > judgement::most_factors ||
            std::any_of(of.begin(), of.end(), [](const auto& factor) { return factor.second < 0; }) ||
            std::any_of(s.modes.begin(), s.modes.end(), [f](const listed_mode& mode) {
                return mode.in_model && std::abs(mode.frequency_hz / f - 1) < next_to;
            }))
            return;
        for (const std::vector<series>& output : s.outputs)
            if (following(s, output, of) > judgement::surely_in_phase) {
                out.push_back(of);
                return;
            }
    });
    return out;
}

/// Power spectra of a strand, and those that the forces give it.
struct strand_powers {
    std::vector<double> all, left, of_force;
};

strand_powers powers_of(const strand& one, bool driven, std::size_t size) {
    strand_powers out{power_spectrum(one.all, 1, 0, size), {}, {}};
    if (!driven) return out;
    std::vector<series> by_force = one.all;
    for (std::size_t r = 0; r < by_force.size(); ++r)
        for (std::size_t t = 0; t < by_force[r].size(); ++t) by_force[r][t] -= one.left[r][t];
    out.left = power_spectrum(one.left, 1, 0, size);
    out.of_force = power_spectrum(by_force, 1, 0, size);
    return out;
}

/// Powers at a mode's frequency of all of it and of what is left; is there a resonance in what the forces drive?
/// @param known  spectra of this strand by their size
void weigh(const listed_mode& mode, const product_search& s, std::map<std::size_t, strand_powers>& known, strand& one) {
    std::size_t longest = 0, size = shortest_spectrum;
    for (const series& x : one.all) longest = std::max(longest, x.size());
    const double f = mode.frequency_hz / s.fs_hz;
    while (8 * size <= longest && mode.damping_ratio * f * static_cast<double>(size) < 2) size *= 2;
    const double width = std::max(mode.damping_ratio * f, 2 / static_cast<double>(size));
    const auto [at, fresh] = known.try_emplace(size);
    if (fresh) at->second = powers_of(one, s.driven, size);
    const auto& [all, left, of_force] = at->second;
    if (all.empty() || (s.driven && (left.empty() || of_force.empty()))) return;
    one.power = mean_power(all, f - width, f + width);
    one.strength = std::sqrt(one.power * width) / (mode.frequency_hz * mode.frequency_hz);
    if (!s.driven) return;
    one.share_left = mean_power(left, f - width, f + width) / std::max(one.power, 1e-300);
    one.peak = mean_power(of_force, f - width, f + width) /
               std::max({mean_power(of_force, f - 4 * width, f - 2 * width),
                         mean_power(of_force, f + 2 * width, f + 4 * width), 1e-300});
}

std::vector<double> weights_of_outputs(const record_set& set) {
    std::vector<double> out;
    for (std::size_t o = set.n_u; o < set.channels(); ++o) {
        double square = 0, count = 0;
        for (std::size_t i = o; i < set.samples.size(); i += set.channels())
            if (!std::isnan(set.samples[i])) square += set.samples[i] * set.samples[i], ++count;
        out.push_back(square > 0 ? count / square : 0);
    }
    return out;
}

/// Residuals of a record, sample by sample, of all outputs; without forces the outputs themselves.
std::vector<double> left_of(const std::vector<const listed_mode*>& in_model, const record_work& work, std::size_t r) {
    const record_set& set = work.set;
    if (set.n_u > 0) return answer(work, in_model, r).left;
    const double* rows = set.rows(set.records[r]);
    return {rows, rows + set.records[r].count * set.n_y};
}

void fill(const record_work& work, product_search& s) {
    const record_set& set = work.set;
    const std::vector<double> weights = weights_of_outputs(set);
    std::vector<const listed_mode*> in_model;
    for (const listed_mode& mode : s.modes)
        if (mode.in_model) in_model.push_back(&mode);
    s.strands.resize(s.modes.size());
    s.outputs.resize(std::min(most_outputs, set.n_y));
    for (std::size_t r = 0; r < set.records.size(); ++r) {
        const std::vector<double> residual = left_of(in_model, work, r);
        const std::size_t count = residual.size() / set.n_y;
        const double* outputs = set.rows(set.records[r]) + set.n_u;
        for (std::size_t k = 0; k < s.modes.size(); ++k) {
            series all(count), left(count);
            for (std::size_t o = 0; o < set.n_y; ++o) {
                const double weight = s.modes[k].shape[o].real() * weights[o];
                for (std::size_t t = 0; t < count; ++t) all[t] += weight * outputs[t * set.channels() + o];
                for (std::size_t t = 0; t < count; ++t) left[t] += weight * residual[t * set.n_y + o];
            }
            s.strands[k].left.push_back(std::move(left));
            s.strands[k].all.push_back(std::move(all));
        }
        for (std::size_t i = 0; i < s.outputs.size(); ++i) {
            series& left = s.outputs[i].emplace_back(count);
            const std::size_t o = i * set.n_y / s.outputs.size();
            for (std::size_t t = 0; t < count; ++t) left[t] = residual[t * set.n_y + o];
        }
    }
    std::map<std::size_t, strand_powers> known; // of one output all strands are the same
    for (std::size_t k = 0; k < s.modes.size(); ++k) {
        if (set.n_y > 1) known.clear();
        s.strands[k].line = is_tone(work.context.verdicts[k].why);
        const double cycles = s.modes[k].frequency_hz / s.fs_hz;
        const auto ring = static_cast<std::size_t>(judgement::ring_periods / cycles) + 1;
        weigh(s.modes[k], s, known, s.strands[k]);
        s.strands[k].rings = !s.driven && rings_down(demodulated(s.strands[k].all, cycles, ring));
    }
}

} // namespace

bool mark_combinations(std::vector<listed_mode>& modes, double fs_hz, record_work& work) {
    const bool driven = work.set.n_u > 0;
    if (driven && (!work.context.x0 || work.model.n_u != static_cast<int>(work.set.n_u))) return false;
    product_search s{modes, fs_hz, driven, {}, {}, {}};
    fill(work, s);
    const auto before =
        std::count_if(modes.begin(), modes.end(), [](const listed_mode& mode) { return mode.in_model; });
    std::vector<std::string> products;
    const auto tell = [&](double f, const product& of) {
        products.push_back(fmt::format("{:.4g} Hz = {}", f, words_of(of, modes)));
    };
    const std::vector<product> more = distortions(s);
    const std::vector<std::size_t> first = bases_of(s, modes.size(), 1); // the strongest stays
    if (first.empty()) return false;
    const auto look = [&](double least, double tolerance) {
        for (std::size_t k = 0; k < modes.size(); ++k) {
            const std::vector<std::string>& why = work.context.verdicts[k].why;
            if (k == first.front() || s.strands[k].line || has_code(why, "harmonic") ||
                (driven && s.strands[k].peak > judgement::resonance_peak &&
                 s.strands[k].share_left < judgement::left_alone))
                continue;
            const product of = followed(s, k, least, tolerance);
            if (of.empty()) continue;
            tell(modes[k].frequency_hz, of);
            doubt("harmonic", work.context.verdicts[k], modes[k]);
        }
    };
    look(judgement::in_phase, judgement::multiple_frequency);
    if (products.empty())
        for (const product& of : more) tell(frequency_of(of, modes), of);
    if (products.empty()) return false;
    look(judgement::nonlinear_in_phase, judgement::nonlinear_frequency);
    for (std::size_t k = 0; k < modes.size(); ++k)
        if (driven && k != first.front() && modes[k].in_model && s.strands[k].peak < judgement::resonance_peak &&
            s.strands[k].share_left > judgement::undriven)
            doubt("undriven", work.context.verdicts[k], modes[k]);
    work.context.warnings.emplace_back(
        "nonlinear",
        fmt::format("the structure is not linear{}: what it does at {} moves in phase with the product of "
                    "these vibrations. The model holds for the level of this record",
                    driven ? "" : ", or an unmeasured force is periodic, as steps are", fmt::join(products, ", ")));
    return std::count_if(modes.begin(), modes.end(), [](const listed_mode& mode) { return mode.in_model; }) != before;
}

} // namespace okid_host
