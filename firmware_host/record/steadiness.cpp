// SPDX-License-Identifier: MIT
// PURPOSE  modes whose frequency depends on the level of vibration or changes while it is recorded
// METHOD   the frequency of a mode in short blocks, as a straight line over the mode's power and over time. With a force: the
//          correction of the pole that explains a block's residual best (one Gauss-Newton step, its own initial state free), of a
//          weight by what it leaves there: errors of the model are loud where the structure is, as after a hit. Without: the
//          turning of the mode's analytic signal; of a linear structure under Gaussian forces its mean does not depend on the
//          envelope (Rice 1945). The deviation of the slopes comes from the scatter about the line, that of all blocks or that
//          where the evidence is (White 1980), whichever is larger; a slope must remain without the blocks that weigh most,
//          those of one gust or one hit
#include "steadiness.hpp"

#include "files/order_statistics.hpp"
#include "modal_answer.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <fmt/ranges.h>

namespace okid_host {
namespace {

using complex = std::complex<double>;
using Eigen::Matrix3d;
using Eigen::Vector3d;

constexpr double block_periods = 10;
constexpr std::size_t least_block = 32; // samples
constexpr double fewest_blocks = 12;    // of equal weight, to speak of a slope
constexpr double sure = 7;              // slope over its deviation; the largest of linear modes is below 5
constexpr double decisive = 0.2;        // of the effective number of blocks: the heaviest
constexpr double borne_out = 5;         // deviations of a slope, at least, without them
constexpr double worth_saying = 0.02;   // change over the half-power bandwidth
constexpr double widest = 0.1;          // damping above: nothing repeats over a block
constexpr double alone = 4;             // bandwidths to the next mode or tone, without a force
constexpr double outstanding = 2;       // a mode over what the model leaves: below, that is mostly something else
constexpr double least_left = 1e-9;     // of what is left in a block, behind its own correction: rounding
constexpr double a_group = 1.0 / 40;    // of the weight: neighbouring blocks of that much scatter together
constexpr double throughout = 0.5;      // of the time, in which the middle 90 % of the evidence on a drift lie

/// The frequency of a mode in one block, relative to that of the model.
struct block_frequency {
    double change, power, motion, time, weight; ///< power: its own; motion: that of all displacements
};

struct slopes {
    double level = 0, level_ratio = 0, drift = 0, drift_ratio = 0; ///< relative changes, each over its deviation
};

/// The share of the time in which the middle 90 % of the weight of blocks, in order of time, lie: little where a mode answers to a
/// part of a sweep only.
double time_covered(const std::vector<block_frequency>& over) {
    double total = 0, sum = 0, first = over.front().time, last = over.back().time;
    for (const block_frequency& b : over) total += b.weight;
    for (const block_frequency& b : over) {
        if (sum <= 0.05 * total) first = b.time;
        if (sum <= 0.95 * total) last = b.time;
        sum += b.weight;
    }
    return (last - first) / (over.back().time - over.front().time);
}

/// How many blocks of equal weight would tell as much.
double effective_number(const std::vector<block_frequency>& over) {
    double total = 0, squares = 0;
    for (const block_frequency& b : over) total += b.weight, squares += b.weight * b.weight;
    return total * total / squares;
}

/// Covariance of the slopes where the scatter is larger in some blocks than in others, neighbours taken together.
Matrix3d where_evidence_is(const std::vector<block_frequency>& over, double block_frequency::* level,
                           const Vector3d& mean, const Vector3d& slope, const Matrix3d& inverse) {
    double total = 0, together = 0;
    for (const block_frequency& b : over) total += b.weight;
    Matrix3d sum = Matrix3d::Zero();
    Vector3d group = Vector3d::Zero();
    for (const block_frequency& b : over) {
        const Vector3d x = Vector3d(1, b.*level, b.time) - mean;
        group += b.weight * (b.change - slope.dot(x)) * x;
        together += b.weight;
        if (together <= a_group * total && &b != &over.back()) continue;
        sum += group * group.transpose();
        group.setZero();
        together = 0;
    }
    const double number = effective_number(over);
    return inverse * sum * inverse * (number / (number - 3));
}

/// Weighted line over a power and time; changes from the quietest to the loudest tenth, and from begin to end.
slopes slopes_of(const std::vector<block_frequency>& over, double block_frequency::* level) {
    slopes out;
    std::vector<double> powers, times;
    Vector3d mean = Vector3d::Zero();
    double total = 0;
    for (const block_frequency& b : over) {
        powers.push_back(b.*level), times.push_back(b.time);
        mean += b.weight * Vector3d(0, b.*level, b.time);
        total += b.weight;
    }
    if (!(effective_number(over) >= fewest_blocks)) return out;
    mean /= total;
    Matrix3d N = Matrix3d::Zero();
    Vector3d h = Vector3d::Zero();
    for (const block_frequency& b : over) {
        const Vector3d x = Vector3d(1, b.*level, b.time) - mean;
        N += b.weight * x * x.transpose();
        h += b.weight * b.change * x;
    }
    const Matrix3d inverse = N.inverse();
    const Vector3d slope = inverse * h;
    double scatter = 0;
    for (const block_frequency& b : over) {
        const double left = b.change - slope.dot(Vector3d(1, b.*level, b.time) - mean);
        scatter += b.weight * left * left;
    }
    scatter /= static_cast<double>(over.size() - 3);
    if (!inverse.allFinite() || !(scatter > 0)) return out;
    out.level = slope[1] * (quantile(powers, 0.9) - quantile(powers, 0.1));
    out.drift = slope[2] * (quantile(times, 1) - quantile(times, 0));
    const Matrix3d uneven = where_evidence_is(over, level, mean, slope, inverse);
    out.level_ratio = std::abs(slope[1]) / std::sqrt(std::max(scatter * inverse(1, 1), uneven(1, 1)));
    out.drift_ratio = std::abs(slope[2]) / std::sqrt(std::max(scatter * inverse(2, 2), uneven(2, 2)));
    return out;
}

/// The blocks without those that weigh most, so many of them as are a fifth of the effective number.
std::vector<block_frequency> without_heaviest(std::vector<block_frequency> over) {
    std::sort(over.begin(), over.end(), [](const auto& a, const auto& b) { return a.weight < b.weight; });
    const double heavy = decisive * effective_number(over);
    over.resize(over.size() - std::min(over.size(), static_cast<std::size_t>(std::ceil(heavy))));
    std::sort(over.begin(), over.end(), [](const auto& a, const auto& b) { return a.time < b.time; });
    return over;
}

/// The slopes; the ratio of one that does not remain without the heaviest blocks is 0.
slopes firm_slopes(const std::vector<block_frequency>& over, double block_frequency::* level) {
    slopes found = slopes_of(over, level);
    if (found.level_ratio < sure && found.drift_ratio < sure) return found;
    const slopes rest = slopes_of(without_heaviest(over), level);
    if (rest.level * found.level <= 0 || rest.level_ratio < borne_out) found.level_ratio = 0;
    if (rest.drift * found.drift <= 0 || rest.drift_ratio < borne_out) found.drift_ratio = 0;
    return found;
}

struct steady_search {
    const record_set& set;
    std::vector<const listed_mode*> modes; ///< those in the model
    std::vector<double> tones;             ///< Hz, of machines and the mains
    std::vector<complex> mu;
    double fs_hz;
    std::vector<double> spread; ///< of each output's residual
    std::vector<double> seen;   ///< each mode over that, in the record and output that show it best
};

/// Of each sample of a record, the power of all displacements.
std::vector<double> motion_of(const steady_search& s, const answered_record& record) {
    std::vector<double> out(record.count);
    for (std::size_t i = 0; i < s.modes.size(); ++i) {
        const double stiffness = std::pow(s.modes[i]->frequency_hz, 4);
        for (std::size_t t = 0; t < record.count; ++t) out[t] += std::norm(record.states[i][t]) / stiffness;
    }
    return out;
}

/// Normal equations of a block for the change a of a pole and its own initial state b: left = Re(c p a) + Re(c s b) in each output,
/// with p the answer to a change and s its free decay. What they share over the outputs is summed first.
struct pole_equations {
    Eigen::Matrix4d N = Eigen::Matrix4d::Zero(); ///< of Re a, Im a, Re b, Im b
    Eigen::Vector4d h = Eigen::Vector4d::Zero();
    double power = 0, values = 0; ///< of left: sum of squares, and of how many

    /// One sample. squares: weighted sum of |c|^2, turned: of c^2, seen: of c left.
    void add(complex p, complex s, double squares, complex turned, complex seen) {
        const complex of[2] = {p, s};
        for (int i = 0; i < 2; ++i) {
            h[2 * i] += (seen * of[i]).real();
            h[2 * i + 1] -= (seen * of[i]).imag();
            for (int j = 0; j < 2; ++j) {
                const complex A = squares * of[i] * std::conj(of[j]), B = turned * of[i] * of[j];
                N(2 * i, 2 * j) += (A + B).real() / 2;
                N(2 * i + 1, 2 * j + 1) += (A - B).real() / 2;
                N(2 * i, 2 * j + 1) += (A - B).imag() / 2;
                N(2 * j + 1, 2 * i) = N(2 * i, 2 * j + 1);
            }
        }
    }
};

/// The correction of one pole over samples first … first + length - 1. @param moved  motion_of() the record
block_frequency corrected(const steady_search& s, const answered_record& record, const std::vector<double>& moved,
                          std::size_t k, std::size_t first, std::size_t length, double time) {
    const complex mu = s.mu[k], turn = complex(0, 1) / s.fs_hz * mu;
    pole_equations sums;
    complex p = 0, start = 1;
    double power = 0, motion = 0;
    const std::size_t n_y = s.set.n_y;
    for (std::size_t t = first; t < first + length; ++t) {
        double squares = 0;
        complex turned = 0, seen = 0;
        for (std::size_t o = 0; o < n_y; ++o) {
            const double left = record.left[t * n_y + o];
            if (std::isnan(left)) continue;
            const complex c = s.modes[k]->shape[o] / s.spread[o];
            squares += std::norm(c);
            turned += c * c;
            seen += c * (left / s.spread[o]);
            sums.power += left * left / s.spread[o] / s.spread[o];
            ++sums.values;
        }
        sums.add(p, start, squares, turned, seen);
        const complex q = record.states[k][t];
        power += std::norm(q) / static_cast<double>(length);
        motion += moved[t];
        p = mu * p + turn * q;
        start *= mu;
    }
    const Eigen::Vector4d size = sums.N.diagonal().cwiseMax(1e-300).cwiseSqrt();
    Eigen::Matrix4d scaled = size.cwiseInverse().asDiagonal() * sums.N * size.cwiseInverse().asDiagonal();
    scaled.diagonal().array() += 1e-9;
    const Eigen::Matrix4d inverse = scaled.inverse();
    const Eigen::Vector4d h = sums.h.cwiseQuotient(size), x = inverse * h;
    const double w = 2 * M_PI * s.modes[k]->frequency_hz;
    const double after = std::max(least_left * sums.power, sums.power - x.dot(h)) / sums.values;
    return {x[0] / size[0] / w, power, motion / static_cast<double>(length), time,
            after > 0 ? size[0] * size[0] / inverse(0, 0) * w * w / after : 0};
}

std::size_t block_length(const listed_mode& mode, double fs_hz) {
    return std::max(least_block, static_cast<std::size_t>(block_periods * fs_hz / mode.frequency_hz));
}

std::vector<std::vector<block_frequency>> with_force(steady_search& s, const record_work& work) {
    std::vector<std::vector<block_frequency>> out(s.modes.size());
    s.seen.assign(s.modes.size(), 0);
    double seconds_before = 0;
    for (std::size_t r = 0; r < s.set.records.size(); ++r) {
        const answered_record record = answer(work, s.modes, r);
        s.spread.assign(s.set.n_y, 1e-300);
        for (std::size_t o = 0; o < s.set.n_y; ++o) {
            double square = 0, n = 0;
            for (std::size_t i = o; i < record.left.size(); i += s.set.n_y)
                if (!std::isnan(record.left[i])) square += record.left[i] * record.left[i], ++n;
            if (n > 0) s.spread[o] = std::max(1e-300, std::sqrt(square / n));
        }
        const std::vector<double> moved = motion_of(s, record);
        for (std::size_t k = 0; k < s.modes.size(); ++k) {
            const std::size_t length = block_length(*s.modes[k], s.fs_hz);
            for (std::size_t first = 0; first + length <= record.count; first += length)
                out[k].push_back(corrected(s, record, moved, k, first, length,
                                           seconds_before + static_cast<double>(first) / s.fs_hz));
            double square = 0;
            for (const complex& q : record.states[k]) square += std::norm(q) / static_cast<double>(record.count);
            for (std::size_t o = 0; o < s.set.n_y; ++o)
                s.seen[k] = std::max(s.seen[k], std::abs(s.modes[k]->shape[o]) * std::sqrt(square) / s.spread[o]);
        }
        seconds_before += static_cast<double>(record.count) / s.fs_hz;
    }
    return out;
}

/// What shows of a change of frequency: the window is as narrow as the mode and pulls what it sees to its middle. The phase of the
/// correlation exp(-decay |s|) behind a Hann window, from one block to `apart` samples later, by the change of frequency.
double share_seen(double decay, std::size_t width, std::size_t apart) {
    const auto w = static_cast<double>(width), lag = static_cast<double>(apart);
    double sum = 0, moment = 0;
    for (double s = 1 - w; s < w; ++s) {
        const double x = std::abs(s), angle = 2 * M_PI * x / w;
        const double window = (w - x) * (1 + std::cos(angle) / 2) + 0.75 * w / M_PI * std::sin(angle);
        const double both = window * std::exp(-decay * std::abs(s + lag));
        sum += both;
        moment += both * (s + lag);
    }
    return moment / sum / lag;
}

/// Analytic signal of a mode: the outputs along its shape, turned back and smoothed over an inverse bandwidth.
std::vector<block_frequency> turning(const steady_search& s, std::size_t k) {
    std::vector<block_frequency> out;
    const listed_mode& mode = *s.modes[k];
    const auto beside = [&mode](double hz) {
        return std::abs(hz - mode.frequency_hz) < alone * 2 * mode.damping_ratio * mode.frequency_hz;
    };
    for (std::size_t i = 0; i < s.modes.size(); ++i)
        if (i != k && beside(s.modes[i]->frequency_hz)) return out;
    if (std::any_of(s.tones.begin(), s.tones.end(), beside)) return out; // its phase runs through the mode's
    const auto width =
        std::max(least_block, static_cast<std::size_t>(s.fs_hz / (2 * mode.damping_ratio * mode.frequency_hz)));
    const std::size_t apart = width / 4;
    const double share = share_seen(2 * M_PI * mode.damping_ratio * mode.frequency_hz / s.fs_hz, width, apart);
    const complex back = std::polar(1.0, -2 * M_PI * mode.frequency_hz / s.fs_hz);
    double seconds_before = 0;
    for (const record_data& record : s.set.records) {
        const auto at = [&](std::size_t first) {
            complex sum = 0, phase = std::pow(back, static_cast<double>(first % (std::size_t{1} << 40)));
            for (std::size_t t = 0; t < width; ++t, phase *= back) {
                const double* y = s.set.rows(record) + (first + t) * s.set.channels();
                complex along = 0;
                for (std::size_t o = 0; o < s.set.n_y; ++o) along += std::conj(mode.shape[o]) * y[o];
                sum += (1 - std::cos(2 * M_PI * (static_cast<double>(t) + 0.5) / static_cast<double>(width))) * along *
                       phase;
            }
            return sum / static_cast<double>(width);
        };
        for (std::size_t first = 0; first + width + apart <= record.count; first += width) {
            const complex a = at(first), b = at(first + apart);
            const double power = std::norm(a) / 2 + std::norm(b) / 2;
            const double angle = std::arg(b * std::conj(a)) / (2 * M_PI * static_cast<double>(apart)) * s.fs_hz;
            if (power > 0)
                out.push_back({angle / mode.frequency_hz / share, power, power,
                               seconds_before + static_cast<double>(first) / s.fs_hz, power});
        }
        seconds_before += static_cast<double>(record.count) / s.fs_hz;
    }
    return out;
}

} // namespace

void remark_unsteady(const std::vector<listed_mode>& modes, double fs_hz, record_work& work) {
    steady_search s{work.set, {}, {}, {}, fs_hz, {}, {}};
    const std::vector<mode_verdict>& verdicts = work.context.verdicts;
    for (std::size_t k = 0; k < modes.size(); ++k) {
        if (!modes[k].in_model) {
            if (k < verdicts.size() && is_tone(verdicts[k].why)) s.tones.push_back(modes[k].frequency_hz);
            continue;
        }
        s.modes.push_back(&modes[k]);
        s.mu.push_back(discrete_pole(modes[k], 1 / fs_hz));
    }
    const bool driven = work.set.n_u > 0;
    if (driven && (!work.context.x0 || work.model.n_u != static_cast<int>(work.set.n_u))) return;
    std::vector<std::vector<block_frequency>> forced;
    if (driven) forced = with_force(s, work);
    std::vector<std::string> levels, drifts;
    for (std::size_t k = 0; k < s.modes.size(); ++k) {
        const listed_mode& mode = *s.modes[k];
        if (mode.damping_ratio > widest || (driven && s.seen[k] < outstanding)) continue;
        const std::vector<block_frequency> over = driven ? forced[k] : turning(s, k);
        slopes found = firm_slopes(over, &block_frequency::power);
        const slopes other = firm_slopes(over, &block_frequency::motion);
        if (other.level_ratio > found.level_ratio) found = other;
        const double least = worth_saying * 2 * mode.damping_ratio;
        const auto text = [&](double change, double ratio) {
            return fmt::format("{:+.2g} % at {:.4g} Hz ({:.0f} σ)", 100 * change, mode.frequency_hz, ratio);
        };
        if (found.level_ratio > sure && std::abs(found.level) > least)
            levels.push_back(text(found.level, found.level_ratio));
        if (found.drift_ratio > std::max(sure, found.level_ratio) && std::abs(found.drift) > least &&
            time_covered(over) >= throughout)
            drifts.push_back(text(found.drift, found.drift_ratio));
    }
    if (!levels.empty())
        work.context.warnings.emplace_back(
            "level_dependent",
            fmt::format("frequencies move with the level of vibration: {}, from the quietest to the loudest "
                        "tenth. The structure is not linear: the model holds for the level of this record",
                        fmt::join(levels, ", ")));
    if (!drifts.empty())
        work.context.warnings.emplace_back(
            "time_varying",
            fmt::format("frequencies drift while they are recorded: {}, from beginning to end. Identify shorter "
                        "parts, with --range",
                        fmt::join(drifts, ", ")));
}

} // namespace okid_host
