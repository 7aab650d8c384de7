// SPDX-License-Identifier: MIT
// PURPOSE  modes and a modal model from measured frequency responses
// METHOD   poles of matrix fractions over degrees, weights of the lines and normalisations are gathered by the agreement that
//          method auto uses for records; those of the confident modes are refined with their residues (modal_fit); shapes
//          from the singular vectors of the residues. Model: these modes in discrete time at 2.56 times the highest line,
//          B and D by least squares on the responses
#include "identify_responses.hpp"

#include "consensus/consensus.hpp"
#include "error.hpp"
#include "files/nearest_name.hpp"
#include "matrix_fraction.hpp"
#include "modal_fit.hpp"
#include "record/modal_model.hpp"
#include "record/record_refine.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <fmt/format.h>
#include <fmt/ranges.h>

namespace okid_host {
namespace {

using complex = std::complex<double>;
using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double rate_over_band = 2.56; // of the model, as analysers sample
constexpr double widest_damping = 0.5;  // sigma of damping over damping
constexpr double widest_frequency = 0.05;
constexpr double least_strength = 4;            // of a residue matrix over its noise
constexpr int fewest_hits = 2;                  // of the runs: candidates, which the fit judges
constexpr int first_steps = 2, last_steps = 12; // of the poles
constexpr double neighbours = 0.02;             // in frequency: poles that compete for one resonance
constexpr double one_mode = 2.5;                // widths between two resonances of one shape: one mode
constexpr double same_residues = 0.95;          // MAC of the residues of two poles that are one mode
constexpr double narrowest = 0.25;              // half a resonance's width in lines: below it is a line
constexpr double edge_lines = 2;                // from the ends of the band
constexpr double broadest = 0.2;                // damping of a vibration
constexpr double worth_listing = 0.25;          // share of the runs below which a cluster is chance
constexpr double doubtful_share = 0.5;          // of the runs: a doubtful mode that fewer found is not listed by itself

/// The columns of the outputs and inputs chosen by name, all by default.
response_set choose(const response_set& from, const record_request& wanted) {
    const auto pick = [](const std::vector<std::string>& names, const std::vector<std::string>& chosen,
                         const char* option) {
        std::vector<Index> out;
        for (const std::string& name : chosen.empty() ? names : chosen) {
            const auto at = std::find(names.begin(), names.end(), name);
            if (at == names.end())
                throw failure(exit_usage, fmt::format("{}: found \"{}\"{}, expected one of: {}", option,
                                                      printable(name), did_you_mean(name, names), list_names(names)));
            out.push_back(at - names.begin());
        }
        return out;
    };
    const std::vector<Index> in = pick(from.inputs, wanted.inputs, "--inputs"),
                             out = pick(from.outputs, wanted.outputs, "--outputs");
    response_set set;
    set.frequency_hz = from.frequency_hz;
    set.set_ups = from.set_ups;
    for (const Index i : in) set.inputs.push_back(from.inputs[static_cast<std::size_t>(i)]);
    for (const Index o : out) set.outputs.push_back(from.outputs[static_cast<std::size_t>(o)]);
    set.H.resize(from.lines(), set.n_y() * set.n_u());
    for (Index i = 0; i < set.n_u(); ++i)
        for (Index o = 0; o < set.n_y(); ++o)
            set.H.col(o + set.n_y() * i) =
                from.H.col(out[static_cast<std::size_t>(o)] + from.n_y() * in[static_cast<std::size_t>(i)]);
    return set;
}

void check_options(const record_request& given) {
    for (const auto& [option, there] :
         {std::pair{"--fs", !given.fs.empty()}, std::pair{"--method", !given.method.empty()},
          std::pair{"--p", !given.p.empty()}, std::pair{"--rows", !given.rows.empty()},
          std::pair{"--order", given.order != "auto"}, std::pair{"--max-order", !given.max_order.empty()},
          std::pair{"--hankel", given.hankel != "system"}, std::pair{"--stabilization", given.stabilization},
          std::pair{"--hold", !given.hold.empty()}, std::pair{"--detrend", given.detrend != "mean"},
          std::pair{"--start", given.start != "moving"}, std::pair{"--decimate", !given.decimate.empty()},
          std::pair{"--sigma", !given.sigma.empty()}, std::pair{"--sigma-blocks", !given.sigma_blocks.empty()},
          std::pair{"--threads", !given.threads.empty()}, std::pair{"--hit-dofs", !given.hit_dofs.empty()},
          std::pair{"--refine", !given.refine.empty()}})
        if (there) throw failure(exit_usage, fmt::format("{} is an option of records, found with --frf", option));
}

double time_constant(const std::string& text) {
    double value = 0;
    if (text.empty()) return value;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
    if (error != std::errc{} || end != text.data() + text.size() || !(value > 0) || !std::isfinite(value))
        throw failure(exit_usage, fmt::format("--exponential: found \"{}\", expected the time constant of the window "
                                              "in s, above 0",
                                              printable(text)));
    return value;
}

complex pole_of(const consensus_mode& mode) {
    const double w = 2 * M_PI * mode.frequency_hz, zeta = mode.damping_ratio;
    return {-zeta * w, w * std::sqrt(1 - zeta * zeta)};
}

/// What the numbers of a mode say against it, whatever the runs agree on.
void mark_doubtful(const response_set& set, std::vector<consensus_mode>& modes) {
    const std::vector<double>& f = set.frequency_hz;
    const double line = (f.back() - f.front()) / static_cast<double>(set.lines() - 1);
    for (consensus_mode& mode : modes) {
        if (mode.frequency_hz * mode.damping_ratio < narrowest * line) mode.why.emplace_back("tone");
        if (mode.damping_ratio > broadest) mode.why.emplace_back("overdamped");
        if (mode.frequency_hz < f.front() + edge_lines * line || mode.frequency_hz > f.back() - edge_lines * line)
            mode.why.emplace_back("band_edge");
    }
}

/// Shape of a residue matrix with the scatter of its entries.
struct residue_shape {
    std::vector<complex> shape;
    std::vector<double> scatter;
    double strength = 0; ///< over the noise
};

residue_shape shape_of(const modal_fit& fit, Index k, Index n_y) {
    const Index n_u = fit.residues.cols() / n_y;
    Eigen::MatrixXcd R(n_y, n_u);
    MatrixXd noise(n_y, n_u);
    for (Index i = 0; i < n_u; ++i)
        for (Index o = 0; o < n_y; ++o) {
            R(o, i) = fit.residues(k, o + n_y * i);
            noise(o, i) = fit.variance[o + n_y * i] * fit.unit_variance(k, o + n_y * i);
        }
    const Eigen::JacobiSVD<Eigen::MatrixXcd> svd(R, Eigen::ComputeThinU | Eigen::ComputeThinV);
    const Eigen::VectorXcd u = svd.matrixU().col(0), v = svd.matrixV().col(0);
    Index largest = 0;
    (void)u.cwiseAbs().maxCoeff(&largest);
    residue_shape out;
    out.strength = R.norm() / std::sqrt(2 * noise.sum());
    for (Index o = 0; o < n_y; ++o) {
        out.shape.push_back(u[o] / u[largest]);
        const double variance = (noise.row(o).transpose().array() * v.array().abs2()).sum();
        out.scatter.push_back(std::sqrt(variance) / (svd.singularValues()[0] * std::abs(u[largest])));
    }
    return out;
}

/// Standard deviations of frequency and damping from that of the pole's parts.
std::pair<double, double> spread_of(complex pole, const MatrixXd& covariance, Index k) {
    if (covariance.size() == 0) return {NAN, NAN};
    const Eigen::Matrix2d part = covariance.block<2, 2>(2 * k, 2 * k);
    const double size = std::abs(pole), re = pole.real(), im = pole.imag();
    const Eigen::Vector2d f(re / size / (2 * M_PI), im / size / (2 * M_PI)),
        zeta(-im * im / (size * size * size), re * im / (size * size * size));
    return {std::sqrt(f.dot(part * f)), std::sqrt(zeta.dot(part * zeta))};
}

/// What many runs agree on and what few found: the fit of the residues tells which of it is in the responses.
bool is_candidate(const consensus_mode& mode) {
    return mode.confident() ||
           (mode.hits >= fewest_hits && std::all_of(mode.why.begin(), mode.why.end(), [](const std::string& why) {
                return why == "few_runs" || why == "noise_shape";
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
    const double widths = one_mode * std::max(-a.pole.real(), -b.pole.real());
    return std::abs(a.pole.imag() - b.pole.imag()) < std::max(widths, share * a.pole.imag());
}

/// The worse of two poles of one mode: near each other, with proportional residues.
bool repeats(const modal_fit& fit, const std::vector<fitted_mode>& all, std::size_t k) {
    if (fit.residues.cols() < 3) return false;
    for (std::size_t j = 0; j < all.size(); ++j) {
        if (j == k || !better(all[j], all[k]) || !close(all[j], all[k], 0)) continue;
        const Eigen::RowVectorXcd x = fit.residues.row(static_cast<Index>(k)),
                                  y = fit.residues.row(static_cast<Index>(j));
        if (std::norm(x.dot(y)) > same_residues * x.squaredNorm() * y.squaredNorm()) return true;
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
std::vector<fitted_mode> fit_candidates(const response_set& set, const std::vector<int>& sensing,
                                        std::vector<fitted_mode> all, int steps) {
    std::vector<complex> poles;
    for (const fitted_mode& one : all) poles.push_back(one.pole);
    if (poles.empty()) return all;
    const modal_fit fit = fit_modes(set, sensing, poles, steps);
    for (std::size_t k = 0; k < all.size(); ++k) {
        all[k].pole = fit.poles[k];
        all[k].why.clear();
        all[k].shape = shape_of(fit, static_cast<Index>(k), set.n_y());
        all[k].sigma = spread_of(fit.poles[k], fit.covariance, static_cast<Index>(k));
    }
    for (std::size_t k = 0; k < all.size(); ++k) {
        const double f = std::abs(all[k].pole) / (2 * M_PI), zeta = -all[k].pole.real() / std::abs(all[k].pole);
        if (all[k].shape.strength < least_strength)
            all[k].why = "noise_shape";
        else if (!(all[k].sigma.first < widest_frequency * f && all[k].sigma.second < widest_damping * zeta))
            all[k].why = "wide_sigma";
        else if (zeta > broadest)
            all[k].why = "overdamped";
        else if (repeats(fit, all, k))
            all[k].why = "split";
    }
    return all;
}

/// The candidates at their refined values, with shapes and deviations; what turns out to be none is said.
void refine_modes(const response_set& set, const std::vector<int>& sensing, std::vector<consensus_mode>& modes,
                  std::vector<residue_shape>& shapes, deviations& sigma) {
    std::vector<fitted_mode> candidates;
    for (std::size_t k = 0; k < modes.size(); ++k)
        if (is_candidate(modes[k])) candidates.push_back({k, modes[k].found_in, pole_of(modes[k]), {}, {}, ""});
    do { // few steps while there is noise among them
        do candidates = fit_candidates(set, sensing, std::move(candidates), first_steps);
        while (leave_worst_out(candidates, modes));
        candidates = fit_candidates(set, sensing, std::move(candidates), last_steps);
    } while (leave_worst_out(candidates, modes));
    for (fitted_mode& one : candidates) {
        consensus_mode& mode = modes[one.at];
        mode.why.clear();
        mode.frequency_hz = std::abs(one.pole) / (2 * M_PI);
        mode.damping_ratio = -one.pole.real() / std::abs(one.pole);
        mode.mpc = shape_mpc(one.shape.shape);
        std::tie(sigma.frequency_hz[one.at], sigma.damping_ratio[one.at]) = one.sigma;
        shapes[one.at] = std::move(one.shape);
    }
}

/// Ascending; without what few runs found, or only the modes picked by their numbers, which then count as confident.
void leave_out(bool all, const std::vector<int>& numbers, std::vector<consensus_mode>& modes,
               std::vector<residue_shape>& shapes, deviations& sigma) {
    std::vector<std::size_t> order;
    for (std::size_t k = 0; k < modes.size(); ++k)
        if (modes[k].confident() || all || modes[k].found_in >= doubtful_share) order.push_back(k);
    std::sort(order.begin(), order.end(),
              [&](std::size_t a, std::size_t b) { return modes[a].frequency_hz < modes[b].frequency_hz; });
    if (!numbers.empty()) {
        std::vector<std::size_t> picked;
        for (std::size_t k = 0; k < order.size(); ++k)
            if (std::find(numbers.begin(), numbers.end(), static_cast<int>(k) + 1) != numbers.end()) {
                picked.push_back(order[k]);
                modes[order[k]].why.clear();
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

/// What an exponential window added to the decay rates is taken away.
void take_window_out(double constant_s, consensus_mode& mode) {
    if (!(constant_s > 0)) return;
    const complex pole = pole_of(mode) + 1 / constant_s;
    mode.frequency_hz = std::abs(pole) / (2 * M_PI);
    mode.damping_ratio = -pole.real() / std::abs(pole);
    if (!(mode.damping_ratio > 0)) {
        mode.damping_ratio = 1e-9;
        mode.why.emplace_back("tone");
    }
}

/// B and D into the model.
void put_inputs(Index n_u, std::vector<double> B, std::vector<double> D, record_work& work) {
    refined_arrays& arrays = *work.refined;
    okid_identified_t& model = work.model;
    arrays.B = std::move(B);
    arrays.D = std::move(D);
    model.n_u = static_cast<std::int32_t>(n_u);
    model.B = arrays.B.data();
    model.D = arrays.D.data();
    model.markov_count = markov_blocks;
    find_markov(model_view(model), markov_blocks, arrays.markov);
    model.markov = arrays.markov.data();
}

/// B and D of the model by least squares on the responses, and how much of them it explains.
void fit_responses(const response_set& set, record_work& work) {
    const Index n = work.model.n_z, n_y = set.n_y(), n_u = set.n_u(), lines = set.lines();
    const Eigen::Map<const MatrixXd> A(work.model.A, n, n), C(work.model.C, n_y, n);
    VectorXd weight(n_y), energy = VectorXd::Zero(n_y), left = VectorXd::Zero(n_y);
    for (Index o = 0; o < n_y; ++o) {
        for (Index i = 0; i < n_u; ++i) energy[o] += set.H.col(o + n_y * i).squaredNorm();
        weight[o] = energy[o] > 0 ? 1 / energy[o] : 0;
    }
    std::vector<Eigen::MatrixXcd> X; // C (z I - A)^-1 at each line
    MatrixXd N = MatrixXd::Zero(n + n_y, n + n_y), b = MatrixXd::Zero(n + n_y, n_u);
    for (Index l = 0; l < lines; ++l) {
        const complex z = std::polar(1.0, 2 * M_PI * set.frequency_hz[static_cast<std::size_t>(l)] * work.model.dt);
        Eigen::MatrixXcd x(n_y, n + n_y);
        for (Index k = 0; k < n; k += 2) {
            const complex d = z - A(k, k);
            Eigen::Matrix2cd inverse;
            inverse << d, A(k, k + 1), A(k + 1, k), d;
            x.middleCols<2>(k) = C.middleCols<2>(k) * inverse / (d * d - A(k, k + 1) * A(k + 1, k));
        }
        x.rightCols(n_y).setIdentity();
        const Eigen::MatrixXcd scaled = weight.asDiagonal() * x;
        N += (x.adjoint() * scaled).real();
        for (Index i = 0; i < n_u; ++i)
            b.col(i) += (scaled.adjoint() * set.H.row(l).segment(n_y * i, n_y).transpose()).real();
        X.push_back(std::move(x));
    }
    const VectorXd unit = N.diagonal().cwiseMax(1e-300).cwiseSqrt().cwiseInverse();
    const MatrixXd found =
        unit.asDiagonal() * MatrixXd((unit.asDiagonal() * N * unit.asDiagonal()).ldlt().solve(unit.asDiagonal() * b));
    std::vector<double> B, D;
    for (Index i = 0; i < n_u; ++i) {
        B.insert(B.end(), found.col(i).data(), found.col(i).data() + n);
        D.insert(D.end(), found.col(i).data() + n, found.col(i).data() + n + n_y);
        for (Index l = 0; l < lines; ++l)
            left += (set.H.row(l).segment(n_y * i, n_y).transpose() - X[static_cast<std::size_t>(l)] * found.col(i))
                        .cwiseAbs2();
    }
    put_inputs(n_u, std::move(B), std::move(D), work);
    std::vector<double> percent;
    for (Index o = 0; o < n_y; ++o) percent.push_back(energy[o] > 0 ? 100 * (1 - std::sqrt(left[o] / energy[o])) : NAN);
    work.context.simulation_percent = percent;
}

[[noreturn]] void throw_no_modes(const std::vector<consensus_mode>& modes, std::size_t runs) {
    std::string seen;
    for (const consensus_mode& mode : modes)
        seen += fmt::format("{}{:.4g} Hz ({})", seen.empty() ? "" : ", ", mode.frequency_hz, fmt::join(mode.why, ", "));
    throw failure(exit_no_model, fmt::format("no model: none of {} runs over the responses agree on a mode{}. Choose a "
                                             "band with --band, or measure with finer lines",
                                             runs, seen.empty() ? std::string() : "; doubtful: " + seen));
}

void find_matrices(const record_options& options, record_work& work) {
    work.context.warnings.insert(work.context.warnings.end(), options.said.begin(), options.said.end());
    if (!options.mass.wanted()) return;
    mass_plan plan = options.mass;
    plan.hold = "band";
    work.context.mass = find_mass_matrices(work.model, plan, work.context.warnings);
}

result_context describe(const response_set& set) {
    result_context out;
    out.method = "plscf";
    out.fs_hz = rate_over_band * set.frequency_hz.back();
    out.samples = set.lines();
    out.records = set.set_ups;
    out.inputs = set.inputs;
    out.outputs = set.outputs;
    out.hold = "band";
    out.detrend = "none";
    out.band_hz = {set.frequency_hz.front(), set.frequency_hz.back()};
    return out;
}

/// The options of the responses as they are taken: names of the file, roles exchanged where that was done.
record_options options_of(const response_set& set, record_request given, bool turned) {
    check_options(given);
    if (turned) std::swap(given.input_dofs, given.output_dofs);
    given.inputs = set.inputs;
    given.outputs = set.outputs;
    return check_request(given);
}

/// Modes, deviations and model into the result; the window's decay goes out of the poles last.
void make_result(const response_set& set, double constant_s, std::vector<consensus_mode> modes,
                 std::vector<residue_shape> shapes, deviations sigma, record_work& work) {
    std::vector<listed_mode> listed;
    for (std::size_t k = 0; k < modes.size(); ++k) {
        residue_shape& own = shapes[k];
        if (own.shape.empty()) { // not refined: that of the matrix fractions
            const auto largest = *std::max_element(modes[k].shape.begin(), modes[k].shape.end(),
                                                   [](complex a, complex b) { return std::abs(a) < std::abs(b); });
            for (const complex& entry : modes[k].shape) own.shape.push_back(entry / largest);
            own.scatter.assign(own.shape.size(), NAN);
        }
        listed.push_back({modes[k].frequency_hz, modes[k].damping_ratio, modes[k].mpc, NAN, std::move(own.shape),
                          modes[k].confident()});
        sigma.shape_re.insert(sigma.shape_re.end(), own.scatter.begin(), own.scatter.end());
    }
    sigma.shape_im = sigma.shape_re;
    work.context.sigma = std::move(sigma);
    work.set.n_y = set.outputs.size();
    make_modal_model(listed, work.context.fs_hz, work);
    fit_responses(set, work);
    for (std::size_t k = 0; k < modes.size(); ++k) {
        take_window_out(constant_s, modes[k]);
        listed[k].frequency_hz = modes[k].frequency_hz;
        listed[k].damping_ratio = modes[k].damping_ratio;
        work.context.verdicts.push_back({modes[k].confident(), modes[k].found_in, modes[k].why});
    }
    if (!(constant_s > 0)) return;
    std::vector<double> B = work.refined->B, D = work.refined->D; // they go with the windowed poles as well
    make_modal_model(listed, work.context.fs_hz, work);
    put_inputs(set.n_u(), std::move(B), std::move(D), work);
}

} // namespace

record_result identify_responses(const response_set& measured, const response_request& asked) {
    response_set set = choose(measured, asked.wanted);
    const bool turned = set.n_u() > set.n_y() && asked.wanted.sensing.find(',') == std::string::npos;
    if (turned) set = exchanged(set);
    const record_options options = options_of(set, asked.wanted, turned);
    const double constant_s = time_constant(asked.exponential);
    set = cut_band(set, options.band ? options.band->first : 0, options.band ? options.band->second : INFINITY);
    record_work work;
    work.context = describe(set);
    work.context.all_modes = asked.all_modes;
    if (turned)
        work.context.warnings.emplace_back(
            "reciprocity", "more inputs than outputs: by reciprocity the outputs of this result are the places that "
                           "were struck, its inputs the sensors");
    const auto runs = fit_matrix_fractions(set);
    auto modes = find_agreement(runs);
    mark_doubtful(set, modes);
    const auto chance = [](const consensus_mode& mode) { return !is_candidate(mode) && mode.found_in < worth_listing; };
    modes.erase(std::remove_if(modes.begin(), modes.end(), chance), modes.end());
    std::vector<residue_shape> shapes(modes.size());
    deviations sigma;
    sigma.frequency_hz.assign(modes.size(), NAN);
    sigma.damping_ratio.assign(modes.size(), NAN);
    refine_modes(set, check_sensing(asked.wanted.sensing, set.outputs.size()), modes, shapes, sigma);
    leave_out(asked.all_modes, options.modes, modes, shapes, sigma);
    if (std::none_of(modes.begin(), modes.end(), [](const consensus_mode& mode) { return mode.confident(); }))
        throw_no_modes(modes, runs.size());
    make_result(set, constant_s, std::move(modes), std::move(shapes), std::move(sigma), work);
    find_matrices(options, work);
    record_result result;
    result.model = kept_model(work.model);
    result.context = std::move(work.context);
    return result;
}

} // namespace okid_host
