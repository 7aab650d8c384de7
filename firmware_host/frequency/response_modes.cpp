// SPDX-License-Identifier: MIT
// PURPOSE  the modes that are in frequency responses
// METHOD   poles of matrix fractions over degrees, weights of the lines and normalisations, of every set-up, are gathered by the
//          agreement that method auto uses for records; those of the candidates are refined with the residues of all set-ups
//          (modal_fit), and judged by the rule of records with the refined shape; the fit strikes out what it does not know, and
//          of measured responses believes what it knows well. Shapes: the first singular vector of the residues at the
//          references, the other entries by least squares on what each set-up has there
// REFERENCE Mevel, Basseville, Benveniste, Goursat (2002), several set-ups with references
#include "response_modes.hpp"

#include "consensus/quantity.hpp"
#include "error.hpp"
#include "matrix_fraction.hpp"
#include "record/request.hpp"
#include "response_diagram.hpp"
#include "result/hold.hpp"
#include "result/judgement.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <tuple>

namespace okid_host {
namespace {

using complex = std::complex<double>;
using Eigen::Index;
using Eigen::MatrixXcd;
using Eigen::MatrixXd;

constexpr int first_steps = 2, window_steps = 5, last_steps = 12; // of the poles
constexpr std::ptrdiff_t lines_about = 2;                         // a frequency, to either side
constexpr double neighbours = 0.02;                               // in frequency: poles that compete for one resonance

/// The columns of all set-ups side by side, each an output of its own.
response_set side_by_side_columns(const joint_responses& from, std::vector<Index>& places) {
    response_set out;
    out.frequency_hz = from.sets.front().frequency_hz;
    out.inputs = {"all"};
    Index columns = 0;
    for (const response_set& set : from.sets) columns += set.H.cols();
    out.H.resize(from.sets.front().lines(), columns);
    columns = 0;
    for (const response_set& set : from.sets) {
        out.H.middleCols(columns, set.H.cols()) = set.H;
        columns += set.H.cols();
        for (Index c = 0; c < set.H.cols(); ++c) {
            const std::string& name = set.outputs[static_cast<std::size_t>(c % set.n_y())];
            out.outputs.push_back(name);
            places.push_back(place_in(from.outputs, name));
        }
    }
    return out;
}

/// Of the lines about a frequency: stepped sines have finer ones where the structure rings.
double spacing_at(const std::vector<double>& line, double hz) {
    const auto at = std::lower_bound(line.begin(), line.end(), hz) - line.begin();
    const auto last = static_cast<std::ptrdiff_t>(line.size()) - 1;
    const std::ptrdiff_t low = std::clamp<std::ptrdiff_t>(at - lines_about, 0, last - 1),
                         high = std::clamp<std::ptrdiff_t>(at + lines_about - 1, low + 1, last);
    return (line[static_cast<std::size_t>(high)] - line[static_cast<std::size_t>(low)]) /
           static_cast<double>(high - low);
}

/// What the numbers of a mode say against it, whatever the runs agree on.
void mark_doubtful(const response_set& set, std::vector<consensus_mode>& modes) {
    const std::vector<double>& f = set.frequency_hz;
    for (consensus_mode& mode : modes) {
        if (mode.frequency_hz * mode.damping_ratio < judgement::narrowest * spacing_at(f, mode.frequency_hz))
            mode.why.emplace_back("narrow");
        if (mode.damping_ratio > judgement::overdamped) mode.why.emplace_back("overdamped");
        if (mode.frequency_hz < f.front() + judgement::edge_lines * spacing_at(f, f.front()) ||
            mode.frequency_hz > f.back() - judgement::edge_lines * spacing_at(f, f.back()))
            mode.why.emplace_back("band_edge");
    }
}

/// Residues of a mode in one set-up: a row an output.
struct residue_matrix {
    MatrixXcd R;
    MatrixXd variance;
    Eigen::VectorXcd drive; ///< R = shape drive^H
};

std::vector<residue_matrix> residues_of(const joint_responses& from, const modal_fit& fit, Index k) {
    std::vector<residue_matrix> out;
    Index first = 0;
    for (const response_set& set : from.sets) {
        residue_matrix one{MatrixXcd(set.n_y(), set.n_u()), MatrixXd(set.n_y(), set.n_u()), {}};
        for (Index c = 0; c < set.H.cols(); ++c) {
            one.R(c % set.n_y(), c / set.n_y()) = fit.residues(k, first + c);
            one.variance(c % set.n_y(), c / set.n_y()) =
                fit.variance[first + c] * fit.unit_variance[k] * fit.more_noise[k];
        }
        first += set.H.cols();
        out.push_back(std::move(one));
    }
    return out;
}

/// What moves each set-up, in units of the shape at the references, which has norm 1.
void find_drives(const joint_responses& from, std::vector<residue_matrix>& all) {
    std::vector<MatrixXcd> seen;
    Index columns = 0;
    for (std::size_t j = 0; j < all.size(); ++j) {
        MatrixXcd& own = seen.emplace_back(from.references.size(), all[j].R.cols());
        for (std::size_t r = 0; r < from.references.size(); ++r)
            own.row(static_cast<Index>(r)) = all[j].R.row(place_in(from.sets[j].outputs, from.references[r]));
        columns += own.cols();
    }
    MatrixXcd together(from.references.size(), columns);
    columns = 0;
    for (const MatrixXcd& own : seen) {
        together.middleCols(columns, own.cols()) = own;
        columns += own.cols();
    }
    const Eigen::JacobiSVD<MatrixXcd> svd(together, Eigen::ComputeThinU);
    for (std::size_t j = 0; j < all.size(); ++j) all[j].drive = seen[j].adjoint() * svd.matrixU().col(0);
}

residue_shape shape_of(const joint_responses& from, const modal_fit& fit, Index k) {
    std::vector<residue_matrix> all = residues_of(from, fit, k);
    find_drives(from, all);
    const auto n_y = static_cast<Index>(from.outputs.size());
    Eigen::VectorXcd sum = Eigen::VectorXcd::Zero(n_y);
    Eigen::VectorXd weight = Eigen::VectorXd::Zero(n_y);
    double power = 0, noise = 0;
    for (std::size_t j = 0; j < all.size(); ++j) {
        const residue_matrix& one = all[j];
        power += one.R.squaredNorm();
        noise += 2 * one.variance.sum() / fit.more_noise[k];
        const double drive = std::max(one.drive.squaredNorm(), 1e-300);
        for (Index o = 0; o < one.R.rows(); ++o) {
            const Index to = place_in(from.outputs, from.sets[j].outputs[static_cast<std::size_t>(o)]);
            const double variance = std::max(
                (one.variance.row(o).transpose().array() * one.drive.array().abs2()).sum() / (drive * drive), 1e-300);
            sum[to] += (one.R.row(o) * one.drive).value() / drive / variance;
            weight[to] += 1 / variance;
        }
    }
    residue_shape out;
    out.strength = std::sqrt(power / noise);
    out.residues = all.front().R;
    out.variance = all.front().variance;
    Index largest = 0;
    (void)(sum.cwiseAbs().array() / weight.array().max(1e-300)).maxCoeff(&largest);
    const complex unit = sum[largest] / weight[largest];
    for (Index o = 0; o < n_y; ++o) { // an output of none of these set-ups is NaN
        out.shape.push_back(weight[o] > 0 ? sum[o] / weight[o] / unit : complex(NAN, NAN));
        out.scatter.push_back(weight[o] > 0 ? 1 / std::sqrt(weight[o]) / std::abs(unit) : NAN);
    }
    return out;
}

/// Standard deviations of frequency and damping from that of the pole's parts.
std::pair<double, double> spread_of(const modal_fit& fit, std::size_t k) {
    if (fit.covariance.empty()) return {NAN, NAN};
    const complex pole = fit.poles[k];
    const double size = std::abs(pole), re = pole.real(), im = pole.imag();
    const Eigen::Vector2d f(re / size / (2 * M_PI), im / size / (2 * M_PI)),
        zeta(-im * im / (size * size * size), re * im / (size * size * size));
    const auto along = [&](const Eigen::Vector2d& v) { return std::sqrt(v.dot(fit.covariance[k] * v)); };
    return {along(f), along(zeta)};
}

/// Residues, shapes and deviations of all set-ups together.
std::pair<modal_fit, refined_modes> fit_all(const joint_responses& from, const std::vector<complex>& poles, int steps) {
    std::vector<Index> places;
    const response_set columns = side_by_side_columns(from, places);
    std::pair<modal_fit, refined_modes> out{fit_modes(columns, places, poles, steps, from.window_s, from.sample_s), {}};
    out.second.poles = out.first.poles;
    for (std::size_t k = 0; k < poles.size(); ++k) {
        out.second.shapes.push_back(shape_of(from, out.first, static_cast<Index>(k)));
        out.second.sigma.push_back(spread_of(out.first, k));
    }
    return out;
}

/// Fitted: what the runs agree on, and what few of them found, lest it stand in the others' residues.
bool is_candidate(const consensus_mode& mode) {
    return std::all_of(mode.why.begin(), mode.why.end(),
                       [](const std::string& why) { return why == "few_runs" || why == "noise_shape"; });
}

/// Chance, or a second pole within the resonance of a mode that the runs agree on: fitted, both would share one shape.
bool is_none(const consensus_mode& mode, const std::vector<consensus_mode>& all) {
    const double width = mode.frequency_hz * mode.damping_ratio;
    return mode.found_in < judgement::worth_listing ||
           (!mode.confident() && std::any_of(
                                     all.begin(), all.end(),
                                     [&](const consensus_mode& other) {
                                         return other.confident() &&
                                                std::abs(other.frequency_hz - mode.frequency_hz) <
                                                    width + other.frequency_hz * other.damping_ratio;
                                     }));
}

/// A candidate with what the fit says of it.
struct fitted_mode {
    std::size_t at;      ///< in the list of modes
    double found_in = 0; ///< share of the runs
    complex pole;
    residue_shape shape;
    std::pair<double, double> sigma; ///< of frequency and damping
    std::string why;                 ///< it is none
};

/// Found by more of the runs, or as many and stronger.
bool better(const fitted_mode& a, const fitted_mode& b) {
    return a.found_in != b.found_in ? a.found_in > b.found_in : a.shape.strength > b.shape.strength;
}

bool close(const fitted_mode& a, const fitted_mode& b, double share) {
    const double widths = -judgement::most_widths * (a.pole.real() + b.pole.real());
    return std::abs(a.pole.imag() - b.pole.imag()) < std::max(widths, share * a.pole.imag());
}

/// The worse of two poles of one mode: near each other, with proportional residues.
bool repeats(const modal_fit& fit, const std::vector<fitted_mode>& all, std::size_t k) {
    if (fit.residues.cols() < 3) return false;
    for (std::size_t j = 0; j < all.size(); ++j) {
        if (j == k || !better(all[j], all[k]) || !close(all[j], all[k], judgement::same_frequency)) continue;
        const Eigen::RowVectorXcd x = fit.residues.row(static_cast<Index>(k)),
                                  y = fit.residues.row(static_cast<Index>(j));
        if (std::norm(x.dot(y)) > judgement::same_residues * x.squaredNorm() * y.squaredNorm()) return true;
    }
    return false;
}

/// Leave out what the last fit judged to be none, of neighbours only the worst: without it the others look different.
bool leave_worst_out(std::vector<fitted_mode>& candidates, std::vector<consensus_mode>& modes) {
    std::vector<fitted_mode> left;
    for (const fitted_mode& one : candidates) {
        const bool worst =
            !one.why.empty() && std::none_of(candidates.begin(), candidates.end(), [&](const fitted_mode& other) {
                return !other.why.empty() && other.at != one.at && close(one, other, neighbours) && better(one, other);
            });
        if (!worst) {
            left.push_back(one);
            continue;
        }
        std::vector<std::string>& why = modes[one.at].why;
        if (std::find(why.begin(), why.end(), one.why) == why.end()) why.push_back(one.why);
    }
    const bool any = left.size() < candidates.size();
    candidates = std::move(left);
    return any;
}

/// One round: candidates at their refined poles, each judged.
std::vector<fitted_mode> fit_candidates(const joint_responses& from, std::vector<fitted_mode> all, int steps) {
    const std::vector<double>& line = from.sets.front().frequency_hz;
    std::vector<complex> poles;
    for (const fitted_mode& one : all) poles.push_back(one.pole);
    if (poles.empty()) return all;
    const auto [fit, found] = fit_all(from, poles, steps);
    for (std::size_t k = 0; k < all.size(); ++k) {
        all[k].pole = fit.poles[k];
        all[k].why.clear();
        all[k].shape = found.shapes[k];
        all[k].sigma = found.sigma[k];
    }
    for (std::size_t k = 0; k < all.size(); ++k) {
        const double f = std::abs(all[k].pole) / (2 * M_PI), zeta = -all[k].pole.real() / std::abs(all[k].pole);
        if (all[k].shape.strength < judgement::least_strength)
            all[k].why = "noise_shape";
        else if (!(all[k].sigma.first < judgement::widest_frequency * f &&
                   all[k].sigma.second < judgement::widest_damping * zeta))
            all[k].why = "wide_sigma";
        else if (zeta > judgement::overdamped)
            all[k].why = "overdamped";
        else if (f < line.front() || f > line.back())
            all[k].why = "band_edge";
        else if (repeats(fit, all, k))
            all[k].why = "split";
    }
    return all;
}

/// No file says whether there was a window: the likelier of both.
void choose_window(const std::vector<fitted_mode>& candidates, joint_responses& from) {
    std::vector<complex> poles;
    for (const fitted_mode& one : candidates) poles.push_back(one.pole);
    joint_responses plain = from;
    plain.window_s = 0;
    if (from.window_s == 0 || poles.empty() ||
        fit_all(plain, poles, window_steps).first.unlikeliness <= fit_all(from, poles, window_steps).first.unlikeliness)
        from.window_s = 0;
}

/// Runs that scatter say little of a mode whose values and shape the fit of all responses knows.
void believe_known(const fitted_mode& one, consensus_mode& mode) {
    const double half_hz = mode.damping_ratio * mode.frequency_hz;
    if (one.shape.shape.size() < judgement::fewest_outputs_known || mode.mpc < judgement::real_shape ||
        one.shape.strength < judgement::known_strength || one.sigma.first > judgement::known_share * half_hz ||
        one.sigma.second > judgement::known_share * mode.damping_ratio)
        return;
    mode.why.erase(std::remove(mode.why.begin(), mode.why.end(), "noise_shape"), mode.why.end());
}

/// The candidates at their refined values, with shapes and deviations; what turns out to be none is said.
void refine_modes(joint_responses from, const std::vector<bool>& turned, response_modes& found) {
    auto& [modes, shapes, sigma, stable] = found;
    std::vector<fitted_mode> candidates;
    for (std::size_t k = 0; k < modes.size(); ++k)
        if (is_candidate(modes[k])) candidates.push_back({k, modes[k].found_in, pole_of(modes[k]), {}, {}, ""});
    choose_window(candidates, from);
    do { // few steps while there is noise among them
        do candidates = fit_candidates(from, std::move(candidates), first_steps);
        while (leave_worst_out(candidates, modes));
        candidates = fit_candidates(from, std::move(candidates), last_steps);
    } while (leave_worst_out(candidates, modes));
    for (fitted_mode& one : candidates) {
        consensus_mode& mode = modes[one.at];
        mode.frequency_hz = std::abs(one.pole) / (2 * M_PI);
        mode.damping_ratio = -one.pole.real() / std::abs(one.pole);
        mode.mpc = shape_collinearity(one.shape.shape, turned);
        judge_agreement(mode);
        if (from.sample_s == 0) believe_known(one, mode); // measured responses
        std::tie(sigma.frequency_hz[one.at], sigma.damping_ratio[one.at]) = one.sigma;
        shapes[one.at] = std::move(one.shape);
    }
}

/// Ascending; without what few runs found or lies beyond the lines, or only the modes picked by their numbers, which then count as confident.
void leave_out(const std::vector<double>& line, bool all, const std::vector<int>& numbers, response_modes& found) {
    auto& [modes, shapes, sigma, stable] = found;
    std::vector<std::size_t> order;
    for (std::size_t k = 0; k < modes.size(); ++k)
        if (modes[k].frequency_hz >= line.front() && modes[k].frequency_hz <= line.back() &&
            (modes[k].confident() || all || modes[k].found_in >= judgement::doubtful_share))
            order.push_back(k);
    std::sort(order.begin(), order.end(),
              [&own = modes](std::size_t a, std::size_t b) { return own[a].frequency_hz < own[b].frequency_hz; });
    if (!numbers.empty()) {
        std::vector<std::size_t> picked;
        for (std::size_t k = 0; k < order.size(); ++k)
            if (std::find(numbers.begin(), numbers.end(), static_cast<int>(k) + 1) != numbers.end()) {
                picked.push_back(order[k]);
                modes[order[k]].why.clear();
                modes[order[k]].picked = true;
            }
        check_picked(numbers, order.size());
        order = std::move(picked);
    }
    const auto taken = [&](auto& values) {
        auto out = values;
        out.clear();
        for (const std::size_t k : order) out.push_back(values[k]);
        values = std::move(out);
    };
    taken(modes);
    taken(shapes);
    taken(sigma.frequency_hz);
    taken(sigma.damping_ratio);
}

[[noreturn]] void throw_no_modes(const std::vector<consensus_mode>& modes, std::size_t runs) {
    std::string seen;
    for (const consensus_mode& mode : modes)
        seen += fmt::format("{}{:.4g} Hz ({})", seen.empty() ? "" : ", ", mode.frequency_hz, fmt::join(mode.why, ", "));
    throw failure(exit_no_model, fmt::format("no model: none of {} runs over the responses agree on a mode{}. Choose a "
                                             "band with --band, or measure with finer lines",
                                             runs, seen.empty() ? std::string() : "; doubtful: " + seen));
}

/// Runs of the matrix fractions of every set-up, shapes at the references.
std::vector<consensus_run> runs_of(const joint_responses& from) {
    std::vector<consensus_run> out;
    for (const response_set& set : from.sets)
        for (consensus_run& run : fit_matrix_fractions(set)) {
            const auto seen = [&](auto& one) {
                std::vector<complex> shape;
                for (const std::string& name : from.references)
                    shape.push_back(one.shape[static_cast<std::size_t>(place_in(set.outputs, name))]);
                one.shape = std::move(shape);
            };
            std::for_each(run.tracks.begin(), run.tracks.end(), seen);
            std::for_each(run.poles.begin(), run.poles.end(), seen);
            out.push_back(std::move(run));
        }
    return out;
}

/// Shapes of what was not refined: those of the matrix fractions, where it was not in the responses NaN.
void fill_shapes(const joint_responses& from, response_modes& found) {
    for (std::size_t k = 0; k < found.modes.size(); ++k) {
        residue_shape& own = found.shapes[k];
        if (!own.shape.empty()) continue;
        const std::vector<complex>& shape = found.modes[k].shape;
        const auto largest = *std::max_element(shape.begin(), shape.end(),
                                               [](complex a, complex b) { return std::abs(a) < std::abs(b); });
        own.shape.assign(from.outputs.size(), complex(NAN, NAN));
        own.scatter.assign(from.outputs.size(), NAN);
        for (std::size_t r = 0; r < shape.size(); ++r)
            own.shape[static_cast<std::size_t>(place_in(from.outputs, from.references[r]))] = shape[r] / largest;
    }
}

} // namespace

std::vector<std::string> common_outputs(const std::vector<response_set>& sets) {
    std::vector<std::string> out;
    for (const std::string& name : sets.front().outputs)
        if (std::all_of(sets.begin(), sets.end(), [&](const response_set& set) {
                return std::find(set.outputs.begin(), set.outputs.end(), name) != set.outputs.end();
            }))
            out.push_back(name);
    return out;
}

complex pole_of(const consensus_mode& mode) { return continuous_pole(mode.frequency_hz, mode.damping_ratio); }

void take_window_out(double constant_s, const char* nothing_left, consensus_mode& mode) {
    if (!(constant_s > 0)) return;
    const complex pole = pole_of(mode) + 1 / constant_s;
    mode.frequency_hz = std::abs(pole) / (2 * M_PI);
    mode.damping_ratio = -pole.real() / std::abs(pole);
    if (!(mode.damping_ratio > 0)) {
        mode.damping_ratio = 1e-9;
        mode.why = {nothing_left};
    }
}

refined_modes fit_response_modes(const joint_responses& from, const std::vector<complex>& poles, int steps) {
    return fit_all(from, poles, steps).second;
}

response_modes find_response_modes(const joint_responses& from, bool all, const std::vector<int>& numbers,
                                   bool diagram) {
    auto runs = runs_of(from);
    response_modes out;
    if (diagram) out.stable = diagram_of(from, runs);
    std::vector<bool>
        turned; // sensors of another quantity: their entries in the references are not those of all outputs
    out.modes = find_agreement(runs, from.references == from.outputs ? &turned : nullptr);
    mark_doubtful(from.sets.front(), out.modes);
    const std::vector<consensus_mode> gathered = out.modes;
    const auto none = [&](const consensus_mode& mode) { return is_none(mode, gathered); };
    out.modes.erase(std::remove_if(out.modes.begin(), out.modes.end(), none), out.modes.end());
    out.shapes.resize(out.modes.size());
    out.sigma.frequency_hz.assign(out.modes.size(), NAN);
    out.sigma.damping_ratio.assign(out.modes.size(), NAN);
    refine_modes(from, turned, out);
    leave_out(from.sets.front().frequency_hz, all, numbers, out);
    if (std::none_of(out.modes.begin(), out.modes.end(), [](const consensus_mode& mode) { return mode.confident(); }))
        throw_no_modes(out.modes, runs.size());
    fill_shapes(from, out);
    return out;
}

} // namespace okid_host
