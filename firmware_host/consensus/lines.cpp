// SPDX-License-Identifier: MIT
// PURPOSE  tell lines from modes
// METHOD   the amplitude along the mode's shape at its frequency, block by block: that of a randomly driven vibration
//          scatters (its spread is half its mean), that of a line stays. A record silent before its force has no line
//          louder than that silence. A multiple of a stronger vibration moves in phase with the power of that vibration
//          (Kim & Powers 1979, in the time domain). A line of the force, a harmonic of a drive say, is in the responses
//          too: where the force has a narrow peak, or its band ends, and the responses over the force have no peak, there
//          is no mode
#include "lines.hpp"

#include "demodulation.hpp"
#include "explained_by_forces.hpp"
#include "files/order_statistics.hpp"
#include "result/judgement.hpp"
#include "result/mode_verdict.hpp"
#include "spectrum.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <optional>
#include <tuple>

namespace okid_host {
namespace {

using complex = std::complex<double>;

constexpr std::size_t averaged = 4;   // segments of a spectrum, at least
constexpr std::size_t shortest = 128; // samples of a segment

/// Amplitudes at a frequency, block by block from a sample on, of channels with these weights from the first on; one record,
/// whole blocks. NaN where a sample is missing.
std::vector<complex> amplitudes(const sample_rows& rows, double share, std::size_t m, std::size_t first_channel,
                                const std::vector<complex>& weights, std::size_t block, std::size_t from = 0) {
    std::vector<complex> out;
    const auto along = [&](std::size_t t) {
        complex sum = 0;
        for (std::size_t c = 0; c < weights.size(); ++c) sum += weights[c] * rows[(from + t) * m + first_channel + c];
        return sum;
    };
    demodulate(rows.size() / m - std::min(from, rows.size() / m), share, block, along, out);
    return out;
}

std::vector<complex> complete(std::vector<complex> a) {
    a.erase(std::remove_if(a.begin(), a.end(), [](const complex& x) { return std::isnan(x.real()); }), a.end());
    return a;
}

/// The same of all records, one behind the other, without the blocks that miss a sample.
std::vector<complex> amplitudes(const record_level& level, std::size_t m, std::size_t first_channel,
                                const std::vector<complex>& weights, double frequency_hz, std::size_t block) {
    std::vector<complex> out;
    for (const sample_rows& rows : level.records) {
        const auto of_record = complete(amplitudes(rows, frequency_hz / level.fs_hz, m, first_channel, weights, block));
        out.insert(out.end(), of_record.begin(), of_record.end());
    }
    return out;
}

/// Where the power that blocks show is, beside a frequency: its mean distance and how it scatters, in cycles of a block.
struct track {
    double away, scatter;
};

track track_beside(const record_level& level, std::size_t m, std::size_t first_channel,
                   const std::vector<complex>& weights, double frequency_hz, std::size_t block) {
    const double share = frequency_hz / level.fs_hz;
    const std::size_t half = block / 2;
    complex turned = 0;
    double all = 0;
    for (const sample_rows& rows : level.records) {
        const auto first = amplitudes(rows, share, m, first_channel, weights, block),
                   later = amplitudes(rows, share, m, first_channel, weights, block, half);
        for (std::size_t i = 0; i < later.size(); ++i)
            if (const complex step = later[i] * std::conj(first[i]); !std::isnan(step.real())) {
                turned += step;
                all += std::abs(step);
            }
    }
    const double mean = std::arg(turned * std::polar(1.0, -2 * M_PI * share * static_cast<double>(half)));
    return {std::abs(mean) / M_PI,
            std::sqrt(2 * std::max(0.0, std::log(all / std::abs(turned)))) / M_PI}; // of a circular normal
}

double spread_over_mean(const std::vector<complex>& a) {
    double mean = 0, square = 0;
    for (const complex& x : a) mean += std::abs(x) / static_cast<double>(a.size());
    for (const complex& x : a) square += (std::abs(x) - mean) * (std::abs(x) - mean);
    return std::sqrt(square / static_cast<double>(a.size())) / mean;
}

/// Does an amplitude know two levels, on and off? That of a random vibration has all between them.
bool switched(const std::vector<complex>& a) {
    if (a.size() < judgement::fewest_blocks) return false;
    std::vector<complex> on;
    std::vector<double> sizes;
    for (const complex& x : a) sizes.push_back(std::abs(x));
    std::nth_element(sizes.begin(), sizes.end() - sizes.size() / 10 - 1, sizes.end());
    const double level = sizes[sizes.size() - sizes.size() / 10 - 1];
    std::size_t off = 0;
    for (const complex& x : a) {
        if (std::abs(x) > judgement::on * level) on.push_back(x);
        off += std::abs(x) < judgement::off * level;
    }
    return on.size() >= judgement::fewest_blocks && spread_over_mean(on) < judgement::steady_on &&
           static_cast<double>(on.size() + off) >= judgement::on_or_off * static_cast<double>(a.size());
}

double strength(const std::vector<complex>& a) {
    double square = 0;
    for (const complex& x : a) square += std::norm(x);
    return std::sqrt(square / static_cast<double>(std::max<std::size_t>(a.size(), 1)));
}

/// The median of its sizes: at a hit all modes answer in the blocks of any.
double usual(const std::vector<complex>& a) {
    std::vector<double> sizes;
    for (const complex& x : a) sizes.push_back(std::abs(x));
    return sizes.empty() ? 0 : median(std::move(sizes));
}

std::size_t largest(const std::vector<complex>& shape) {
    const auto at = std::max_element(shape.begin(), shape.end(),
                                     [](const complex& a, const complex& b) { return std::norm(a) < std::norm(b); });
    return static_cast<std::size_t>(at - shape.begin());
}

bool near_multiple(double frequency_hz, double base, double tolerance) {
    const double n = std::round(frequency_hz / base);
    return n >= 1 && std::abs(frequency_hz - n * base) < tolerance * base;
}

/// Is b in phase with the n-th power of a?
bool in_phase(const std::vector<complex>& a, const std::vector<complex>& b, int n) {
    complex sum = 0;
    double both = 0;
    for (std::size_t i = 0; i < a.size(); ++i) {
        const complex power = std::pow(a[i], n);
        sum += b[i] * std::conj(power);
        both += std::abs(b[i]) * std::abs(power);
    }
    return both > 0 && std::abs(sum) > judgement::in_phase * both;
}

/// What the outputs are multiplied with to give the amplitude where the mode is largest.
std::vector<complex> weights_along(std::vector<complex> shape) {
    double square = 0;
    for (const complex& entry : shape) square += std::norm(entry);
    const double most = std::abs(shape[largest(shape)]);
    for (complex& entry : shape) entry = std::conj(entry) * (most / square);
    return shape;
}

/// See explained_by_forces(); 0 without a force.
double explained(const record_level& level, std::size_t m, std::size_t n_u, bool rings_on, const consensus_mode& mode,
                 const std::vector<consensus_mode>& modes, std::size_t block) {
    if (n_u == 0) return 0;
    std::vector<complex> seen;
    for (const sample_rows& rows : level.records) {
        const auto more = amplitudes(rows, mode.frequency_hz / level.fs_hz, m, n_u, weights_along(mode.shape), block);
        seen.insert(seen.end(), more.begin(), more.end());
    }
    return explained_by_forces(level, m, n_u, rings_on, mode, modes, block, seen);
}

/// Does the response at n f follow the n-th power of that at f?
bool follows(const record_level& level, std::size_t m, std::size_t n_u, const consensus_mode& mode,
             const std::vector<consensus_mode>& modes, double base, int n) {
    const std::size_t channel = n_u + largest(mode.shape);
    const auto block = static_cast<std::size_t>(judgement::product_periods * level.fs_hz / base) + 1;
    const std::vector<complex> a = amplitudes(level, m, channel, {1}, base, block),
                               b = amplitudes(level, m, channel, {1}, n * base, block);
    if (a.size() < 2 * judgement::fewest_blocks || b.size() != a.size() ||
        strength(a) < judgement::stronger * strength(b) || !lasts(a))
        return false; // the phases of a decay are those of its hit
    const auto ring = static_cast<std::size_t>(judgement::ring_periods * level.fs_hz / base) + 1;
    return !rings_down(amplitudes(level, m, channel, {1}, base, ring)) && in_phase(a, b, n) &&
           explained(level, m, n_u, false, mode, modes, block) < judgement::explained;
}

/// Samples of the longest record.
std::size_t longest_of(const record_level& level, std::size_t m) {
    std::size_t out = 0;
    for (const sample_rows& rows : level.records) out = std::max(out, rows.size() / m);
    return out;
}

const record_level& seen_by(const std::vector<record_level>& levels, double frequency_hz) {
    std::size_t k = 0; // the lowest rate that shows it: fewest samples
    while (k + 1 < levels.size() && !levels[k + 1].zoomed && frequency_hz < levels[k + 1].top * levels[k + 1].fs_hz)
        ++k;
    return levels[k];
}

/// Is a vibration the n-th multiple of another of the same machine, one of both a tone? As strong as it may be, and however
/// the machine wanders.
bool of_machine(const std::vector<record_level>& levels, std::size_t m, std::size_t n_u, const consensus_mode& base,
                const consensus_mode& over, int n) {
    if (!near_multiple(over.frequency_hz, n * base.frequency_hz, judgement::mains_tolerance)) return false;
    const record_level& level = seen_by(levels, over.frequency_hz);
    const double period = level.fs_hz / base.frequency_hz, most = judgement::machine_periods * period,
                 every = static_cast<double>(longest_of(level, m)) / (2 * judgement::fewest_blocks);
    const auto block = static_cast<std::size_t>(std::clamp(every, judgement::line_periods * period, most));
    const auto along = [&](const consensus_mode& one, double frequency_hz) {
        return amplitudes(level, m, n_u, weights_along(one.shape), frequency_hz, block);
    };
    const std::vector<complex> a = along(base, base.frequency_hz), b = along(over, n * base.frequency_hz);
    return a.size() >= 2 * judgement::fewest_blocks && a.size() == b.size() && in_phase(a, b, n);
}

/// Does a vibration answer hits, measured or not? Then it is in phase with whatever else answers them.
bool answers_hits(const record_level& level, std::size_t m, std::size_t n_u, const consensus_mode& mode,
                  const std::vector<consensus_mode>& modes) {
    const auto of_periods = [&](double periods) {
        return static_cast<std::size_t>(periods * level.fs_hz / mode.frequency_hz) + 1;
    };
    return rings_down(amplitudes(level, m, n_u, weights_along(mode.shape), mode.frequency_hz,
                                 of_periods(judgement::ring_periods))) ||
           explained(level, m, n_u, false, mode, modes, of_periods(judgement::machine_periods)) >= judgement::explained;
}

/// Is it a multiple of a tone, or a tone a multiple of it?
bool of_tone(const std::vector<record_level>& levels, std::size_t m, std::size_t n_u, const consensus_mode& mode,
             const consensus_mode& tone, const std::vector<consensus_mode>& modes) {
    if (mode.damping_ratio > judgement::line_damping || !has_code(tone.why, "tone")) return false;
    const bool above = mode.frequency_hz > tone.frequency_hz;
    const consensus_mode &base = above ? tone : mode, &over = above ? mode : tone;
    const int n = static_cast<int>(std::lround(over.frequency_hz / base.frequency_hz));
    return n >= 2 && n <= judgement::most_multiple && of_machine(levels, m, n_u, base, over, n) &&
           !answers_hits(seen_by(levels, mode.frequency_hz), m, n_u, mode, modes);
}

/// Does the amplitude fall as a free vibration of this damping does? One of a line stays, whatever the record's length. None:
/// there are too few blocks to say.
/// @param records  blocks under a Hann window, of each record; they have one slope, each its own height
/// @param decay    of the amplitude from one block to the next, by the mode's damping (natural logarithm)
std::optional<bool> decays(const std::vector<std::vector<complex>>& records, double decay) {
    double sxx = 0, sxy = 0, syy = 0, free = -1; // degrees of freedom
    for (const std::vector<complex>& a : records) {
        const auto n = static_cast<double>(a.size());
        double mean = 0;
        for (const complex& x : a) mean += std::log(std::abs(x)) / n;
        for (std::size_t i = 0; i < a.size(); ++i) {
            const double at = static_cast<double>(i) - (n - 1) / 2, height = std::log(std::abs(a[i])) - mean;
            sxx += at * at;
            sxy += at * height;
            syy += height * height;
        }
        if (!a.empty()) free += n - 1;
    }
    if (free < 2) return std::nullopt;
    const double slope = sxy / sxx, sigma = std::sqrt(std::max(0.0, syy - slope * sxy) / free / sxx);
    return -slope > judgement::falls * sigma && -slope > decay / judgement::as_damped &&
           -slope < decay * judgement::as_damped;
}

/// Samples of a record before its force sets in.
std::size_t quiet_samples(const sample_rows& rows, std::size_t m, std::size_t n_u) {
    std::size_t out = rows.size() / m;
    for (std::size_t c = 0; c < n_u; ++c) {
        double largest = 0;
        for (std::size_t i = c; i < rows.size(); i += m) largest = std::fmax(largest, std::abs(rows[i]));
        for (std::size_t i = 0; i < out; ++i)
            if (std::abs(rows[i * m + c]) > judgement::begun * largest) out = i;
    }
    return out;
}

/// Is its amplitude less before the hits than in most of the blocks? That of a line is the same. Half a period of quiet at
/// least.
bool quieter_before(const record_level& level, std::size_t m, std::size_t n_u, const std::vector<complex>& weights,
                    double frequency_hz, double usual_size) {
    const double half_period = level.fs_hz / frequency_hz / 2;
    if (n_u == 0) return false;
    double square = 0, records = 0;
    for (const sample_rows& rows : level.records) {
        const double halves = std::floor(static_cast<double>(quiet_samples(rows, m, n_u)) / half_period);
        if (halves < 1) continue;
        const auto count = static_cast<std::size_t>(halves * half_period);
        complex sum = 0;
        for (std::size_t i = 0; i < count; ++i) {
            complex along = 0;
            for (std::size_t c = 0; c < weights.size(); ++c) along += weights[c] * rows[i * m + n_u + c];
            sum += along * std::polar(1.0, -2 * M_PI * frequency_hz / level.fs_hz * static_cast<double>(i));
        }
        if (std::isnan(sum.real())) continue;
        square += std::norm(sum / static_cast<double>(count));
        ++records;
    }
    return records > 0 && std::sqrt(square / records) < judgement::quieter * usual_size;
}

/// Of the force that scatters least.
double spread_of_force(const record_level& level, std::size_t m, std::size_t n_u, double frequency_hz,
                       std::size_t block) {
    double least = HUGE_VAL;
    for (std::size_t k = 0; k < n_u; ++k)
        least = std::min(least, spread_over_mean(amplitudes(level, m, k, {1}, frequency_hz, block)));
    return least;
}

bool is_line(const record_level& level, std::size_t m, std::size_t n_u, bool at_rest, const consensus_mode& mode,
             const std::vector<consensus_mode>& modes) {
    const std::size_t longest = longest_of(level, m);
    const double seconds = static_cast<double>(longest) / level.fs_hz;
    const double rate = 2 * M_PI * mode.damping_ratio * mode.frequency_hz;
    const bool endless = rate * seconds < judgement::unresolved_decays;
    if (!endless && mode.damping_ratio > judgement::line_damping) return false;
    const auto periods = static_cast<std::size_t>(judgement::line_periods * level.fs_hz / mode.frequency_hz) + 1;
    const std::size_t block = std::max(periods, longest / judgement::line_blocks);
    const std::vector<complex> weights = weights_along(mode.shape),
                               a = amplitudes(level, m, n_u, weights, mode.frequency_hz, block);
    if (at_rest &&
        (usual(a) > judgement::loudest_silence || quieter_before(level, m, n_u, weights, mode.frequency_hz, usual(a))))
        return false;
    bool keeps_up = a.size() >= judgement::fewest_blocks && spread_over_mean(a) < judgement::steady;
    if (!keeps_up && n_u == 0) keeps_up = switched(a); // a force may go on and off too
    for (const std::size_t part : {2, 4})
        if (!keeps_up && n_u == 0 && block / part >= periods)
            keeps_up = switched(amplitudes(level, m, n_u, weights, mode.frequency_hz, block / part));
    if (!endless)
        return keeps_up &&
               track_beside(level, m, n_u, weights, mode.frequency_hz, block).away < judgement::off_its_frequency &&
               explained(level, m, n_u, false, mode, modes, block) < judgement::explained;
    // Few periods: shorter blocks show whether it falls.
    const std::size_t step =
        a.size() >= judgement::fewest_blocks * level.records.size()
            ? block
            : std::max<std::size_t>(
                  static_cast<std::size_t>(judgement::fall_periods * level.fs_hz / mode.frequency_hz) + 1,
                  longest / judgement::fewest_blocks);
    std::vector<std::vector<complex>> falling;
    for (const sample_rows& rows : level.records)
        falling.push_back(complete(amplitudes(rows, mode.frequency_hz / level.fs_hz, m, n_u, weights, step)));
    const std::optional<bool> falls = decays(falling, rate * static_cast<double>(step) / level.fs_hz);
    return !falls.value_or(mode.damping_ratio > judgement::line_damping) &&
           explained(level, m, n_u, true, mode, modes, step) < judgement::explained;
}

/// A tone that wanders is as wide as a mode, and runs give it a damping, or two modes at the ends of its way. But in blocks as
/// short as the reciprocal of that width its amplitude stays. Only where what blocks show is at the mode's frequency, and no tone
/// stands beside it, or comes by there: a tone that does not wander stays away from a mode beside it.
/// @param tones_hz  lines
bool wanders(const record_level& level, std::size_t m, const consensus_mode& mode,
             const std::vector<double>& tones_hz) {
    const std::vector<complex> weights = weights_along(mode.shape);
    for (const double widths : {0.25, 0.5, 1.0}) {
        const double periods = std::max(widths / (M_PI * mode.damping_ratio), judgement::line_periods);
        const double seconds = periods / mode.frequency_hz, most = static_cast<double>(level.samples) / level.fs_hz;
        if (!(seconds * judgement::fewest_blocks < most)) return false;
        const auto block = static_cast<std::size_t>(seconds * level.fs_hz) + 1;
        const auto a = amplitudes(level, m, 0, weights, mode.frequency_hz, block);
        // Of a vibration as wide as this one, blocks that are shorter are not independent.
        const double independent = std::min(1.0, 2 * widths) * static_cast<double>(a.size());
        const double chance = judgement::of_chance - judgement::surely_steady / std::sqrt(independent);
        if (a.size() < judgement::fewest_blocks ||
            !(spread_over_mean(a) < std::min(judgement::steady_wandering, chance)))
            continue;
        const track way = track_beside(level, m, 0, weights, mode.frequency_hz, block);
        const double width = seconds * mode.damping_ratio * mode.frequency_hz;
        const bool alone = std::none_of(tones_hz.begin(), tones_hz.end(), [&](double tone) {
            return std::abs(tone - mode.frequency_hz) * seconds < 2; // what a Hann window of the block lets in
        });
        if ((alone && way.away < width) || way.away < judgement::wanders_as_far * way.scatter) return true;
    }
    return false;
}

/// A line that the converter makes: at a simple part of the record's rate, in one output alone. Of one that is narrow the
/// runs may disagree by more than its width: it is then as near as they tell.
bool is_of_the_rate(double fs_hz, const consensus_mode& mode) {
    double all = 0, most = 0;
    for (const complex& x : mode.shape) all += std::norm(x), most = std::max(most, std::norm(x));
    if (mode.shape.size() < 2 || most < judgement::in_one_output * all) return false;
    const bool narrow = mode.damping_ratio < judgement::line_damping;
    const double near_hz = std::max(judgement::on_the_rate * mode.frequency_hz, narrow ? mode.frequency_scatter_hz : 0);
    for (int parts = 3; parts <= judgement::rate_parts; ++parts)
        for (int k = 1; 2 * k < parts; ++k)
            if (std::abs(mode.frequency_hz - fs_hz * k / parts) < near_hz) return true;
    return false;
}

/// Powers of a range of channels, each in units of its spread, added up.
struct band_powers {
    double at = 0, below = 0, above = 0;
};

/// The spectra of levels that were asked for: modes of one level ask for the same ones.
class level_spectra {
  public:
    explicit level_spectra(std::size_t m) : m_(m) {}
    const std::vector<double>& of(const record_level& level, std::size_t channel, std::size_t size) {
        const auto [at, made] = known_.try_emplace({&level, channel, size});
        if (made) at->second = power_spectrum(level.records, m_, channel, size);
        return at->second;
    }

  private:
    std::size_t m_;
    std::map<std::tuple<const record_level*, std::size_t, std::size_t>, std::vector<double>> known_;
};

/// @param beside  how many widths off the powers beside it begin; they are as wide
band_powers powers_around(level_spectra& spectra, const record_level& level, std::size_t first, std::size_t last,
                          std::size_t size, double f, double width, double beside) {
    const double near = beside * width, far = 2 * near;
    band_powers out;
    for (std::size_t k = first; k < last; ++k) {
        const std::vector<double>& power = spectra.of(level, k, size);
        if (power.empty()) continue;
        out.at += mean_power(power, f - width, f + width);
        out.below += mean_power(power, f - far, f - near);
        out.above += mean_power(power, f + near, f + far);
    }
    return out;
}

/// What the force alone explains at a mode: a peak of its own, or the edge of its band, and the structure shows no peak there.
enum class of_force { nothing, peak, edge };

of_force shown_by_force(level_spectra& spectra, const record_level& level, std::size_t m, std::size_t n_u,
                        const consensus_mode& mode) {
    const std::size_t longest = longest_of(level, m);
    std::size_t size = shortest;
    const double f = mode.frequency_hz / level.fs_hz;
    while (2 * averaged * size <= longest && mode.damping_ratio * f * static_cast<double>(size) < 2) size *= 2;
    const double width = std::max(mode.damping_ratio * f, 2 / static_cast<double>(size));
    if (n_u == 0 || longest < averaged * size || f < 4 * width) return of_force::nothing;
    const auto powers = [&](std::size_t first, std::size_t last, double beside) {
        return powers_around(spectra, level, first, last, size, f, width, beside);
    };
    const auto flat = [](double at, double beside) { return at < judgement::resonance_peak * beside; }; // never of NaN
    const band_powers force = powers(0, n_u, 2);
    if (force.at >= judgement::force_line * std::max(force.below, force.above)) {
        const band_powers response = powers(n_u, m, 2);
        const double beside = std::max(response.below / force.below, response.above / force.above);
        const auto block =
            std::max(static_cast<std::size_t>(judgement::line_periods * level.fs_hz / mode.frequency_hz) + 1,
                     longest / judgement::line_blocks);
        const bool runs = spread_of_force(level, m, n_u, mode.frequency_hz, block) < judgement::of_hits; // no dwell
        return runs && flat(response.at / force.at, beside) ? of_force::peak : of_force::nothing;
    }
    if (f + 4 * width > level.top) return of_force::nothing; // where a filter ends the band of all channels
    const band_powers close = powers(0, n_u, 1);
    const bool drops = close.below > close.above; // and stays so
    const double most = drops ? std::min(close.below, force.below) : std::min(close.above, force.above);
    const double least = drops ? std::max(close.above, force.above) : std::max(close.below, force.below);
    if (most < judgement::force_ends * least) return of_force::nothing;
    const band_powers response = powers(n_u, m, 1); // of the side with the force: beyond the edge is noise over noise
    const double beside = drops ? response.below / close.below : response.above / close.above;
    return flat(response.at / close.at, beside) ? of_force::edge : of_force::nothing;
}

} // namespace

void mark_lines(const std::vector<record_level>& levels, std::size_t n_u, std::size_t n_y, bool at_rest,
                std::vector<consensus_mode>& modes) {
    const std::size_t m = n_u + n_y;
    level_spectra spectra(m);
    for (consensus_mode& mode : modes) {
        const bool mains = near_multiple(mode.frequency_hz, 50, judgement::mains_tolerance) ||
                           near_multiple(mode.frequency_hz, 60, judgement::mains_tolerance);
        if (is_of_the_rate(levels[0].fs_hz, mode))
            mode.why.emplace_back("pickup");
        else if (is_line(seen_by(levels, mode.frequency_hz), m, n_u, at_rest, mode, modes))
            mode.why.emplace_back(mains ? "pickup" : "tone");
    }
    std::vector<double> tones_hz;
    for (const consensus_mode& mode : modes)
        if (is_tone(mode.why)) tones_hz.push_back(mode.frequency_hz);
    for (consensus_mode& mode : modes)
        if (n_u == 0 && !is_tone(mode.why) && wanders(seen_by(levels, mode.frequency_hz), m, mode, tones_hz))
            mode.why.emplace_back("tone");
    for (consensus_mode& mode : modes) {
        if (is_tone(mode.why)) continue;
        const record_level& level = seen_by(levels, mode.frequency_hz);
        if (const of_force shown = shown_by_force(spectra, level, m, n_u, mode); shown != of_force::nothing) {
            mode.why.emplace_back(shown == of_force::peak ? "harmonic" : "band_edge");
            continue;
        }
        for (const consensus_mode& base : modes) {
            const int n = static_cast<int>(std::lround(mode.frequency_hz / base.frequency_hz));
            if (!of_tone(levels, m, n_u, mode, base, modes) &&
                (n < 2 || n > judgement::most_multiple || base.agreement < judgement::least_agreement ||
                 std::abs(mode.frequency_hz / (n * base.frequency_hz) - 1) > judgement::multiple_frequency ||
                 !follows(level, m, n_u, mode, modes, base.frequency_hz, n)))
                continue;
            mode.why.emplace_back("harmonic");
            break;
        }
    }
}

} // namespace okid_host
