// SPDX-License-Identifier: MIT
// PURPOSE  modes and a modal model from measured frequency responses
// METHOD   response_modes.hpp; modal masses: the residues at drive points; model: these modes in discrete time at 2.56 times the
//          highest line, B and D by least squares on the responses
#include "identify_responses.hpp"

#include "error.hpp"
#include "files/nearest_name.hpp"
#include "record/identify_options.hpp"
#include "record/modal_model.hpp"
#include "record/noisy_outputs.hpp"
#include "record/record_refine.hpp"
#include "response_modes.hpp"
#include "result/drive_mass.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <fmt/format.h>

namespace okid_host {
namespace {

using complex = std::complex<double>;
using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double rate_over_band = 2.56; // of the model, as analysers sample
constexpr double far_off = 45;          // degrees, of a residue at a drive point: what does not move with its force

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
    set.quantity = from.quantity;
    for (const Index i : in) set.inputs.push_back(from.inputs[static_cast<std::size_t>(i)]);
    for (const Index o : out) set.outputs.push_back(from.outputs[static_cast<std::size_t>(o)]);
    set.H.resize(from.lines(), set.n_y() * set.n_u());
    for (Index i = 0; i < set.n_u(); ++i)
        for (Index o = 0; o < set.n_y(); ++o)
            set.H.col(o + set.n_y() * i) =
                from.H.col(out[static_cast<std::size_t>(o)] + from.n_y() * in[static_cast<std::size_t>(i)]);
    return set;
}

/// One over the length of the blocks, where lines were left out as well.
double finest_spacing(const std::vector<double>& f) {
    double out = f.back();
    for (std::size_t l = 1; l < f.size(); ++l) out = std::min(out, f[l] - f[l - 1]);
    return out;
}

void check_options(const record_request& given) {
    for (const identify_option& option : identify_options())
        if (!(option.reach & of_responses) && option.is_given(given))
            throw failure(exit_usage, fmt::format("{} is an option of records, found with --frf", option.typed()));
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

/// Of each line and output: the power of an acceleration over that of what is measured. Where a structure is free, receptances
/// are all rigid motion at the lowest lines.
MatrixXd acceleration_powers(const response_set& set, const std::vector<int>& sensing) {
    MatrixXd out(set.lines(), set.n_y());
    for (Index l = 0; l < set.lines(); ++l)
        for (Index o = 0; o < set.n_y(); ++o)
            out(l, o) = std::pow(set.frequency_hz[static_cast<std::size_t>(l)] / set.frequency_hz.back(),
                                 2 * (OKID_SENSE_ACCELERATION - sensing[static_cast<std::size_t>(o)]));
    return out;
}

/// B and D of the model by least squares on the responses, and how much of them it explains.
void fit_responses(const response_set& set, const std::vector<int>& sensing, record_work& work) {
    const Index n = work.model.n_z, n_y = set.n_y(), n_u = set.n_u(), lines = set.lines();
    const Eigen::Map<const MatrixXd> A(work.model.A, n, n), C(work.model.C, n_y, n);
    const MatrixXd powers = acceleration_powers(set, sensing);
    VectorXd weight(n_y), energy = VectorXd::Zero(n_y), left = VectorXd::Zero(n_y);
    for (Index o = 0; o < n_y; ++o) {
        for (Index i = 0; i < n_u; ++i) energy[o] += powers.col(o).dot(set.H.col(o + n_y * i).cwiseAbs2());
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
        const Eigen::MatrixXcd scaled = weight.cwiseProduct(powers.row(l).transpose()).asDiagonal() * x;
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
                        .cwiseAbs2()
                        .cwiseProduct(powers.row(l).transpose());
    }
    put_inputs(n_u, std::move(B), std::move(D), work);
    std::vector<double> percent;
    for (Index o = 0; o < n_y; ++o) percent.push_back(energy[o] > 0 ? 100 * (1 - std::sqrt(left[o] / energy[o])) : NAN);
    work.context.simulation_percent = percent;
}

/// Forces and sensors at one place, where no places are given: by their names, "3z" beside "-3z" too.
mass_plan places_by_name(const response_set& set, const std::vector<int>& sensing) {
    const auto place = [](const std::string& name) { return name.substr(name[0] == '-' || name[0] == '+'); };
    mass_plan out;
    for (const std::string& name : set.inputs)
        out.inputs.push_back(
            {name, static_cast<int>(out.inputs.size()) + 1, name[0] == '-', OKID_SENSE_ACCELERATION, 1});
    for (std::size_t o = 0; o < set.outputs.size(); ++o) {
        mass_channel& one = out.outputs.emplace_back();
        one.name = set.outputs[o];
        one.reversed = one.name[0] == '-';
        if (!sensing.empty()) one.sensing = sensing[o];
        for (const mass_channel& input : out.inputs)
            if (place(input.name) == place(one.name)) one.dof = input.dof;
    }
    return out;
}

/// Modal mass, stiffness and damping from the residues at drive points, with what their noise and that of the damping ratio,
/// which goes with their size, leave open. @param zeta_share  deviation of the damping ratio over it
modal_mass mass_of(const residue_shape& mode, const mass_plan& plan, const std::vector<drive_pair>& pairs, complex pole,
                   double zeta_share) {
    if (mode.residues.size() == 0) return {}; // not refined
    std::vector<complex> shape;
    for (std::size_t o = 0; o < mode.shape.size(); ++o)
        shape.push_back(mode.shape[o] * plan.outputs[o].si * to_displacement(pole, plan.outputs[o].sensing));
    const std::size_t top = largest_entry(shape);
    const auto share = [&](std::size_t output, std::size_t input) {
        const auto o = static_cast<Index>(output), i = static_cast<Index>(input);
        return mode.variance(o, i) / std::norm(mode.residues(o, i));
    };
    drive_mass found;
    double variance = 0;
    for (const auto& [o, i, sign] : pairs) {
        const mass_channel &output = plan.outputs[o], &input = plan.inputs[i];
        const complex psi = shape[o] / shape[top],
                      residue = mode.residues(static_cast<Index>(o), static_cast<Index>(i)) * output.si / input.si *
                                to_displacement(pole, output.sensing);
        found.add(psi, sign * complex(0, 2 * pole.imag()) * residue);
        variance += std::pow(std::norm(psi), 4) * (share(o, i) + (o == top ? 0 : 4 * share(top, i)));
    }
    modal_mass out = mass_of_pole(pole, found.complex_kg());
    if (std::abs(out.phase_deg) > far_off)
        out.kg = out.stiffness = out.damping = NAN; // another quantity, or a polarity
    const double noise = std::sqrt(variance) / found.power;
    out.kg_std = out.kg * std::hypot(noise, zeta_share);
    out.stiffness_std = out.stiffness * std::hypot(noise, zeta_share);
    out.damping_std = out.damping * noise; // residue over damping ratio is the height of the peak
    return out;
}

/// Said where every drive point moves against its force, or a quarter of a period beside it. @param of_file  the quantity that the file tells
void remark_turned(const std::vector<modal_mass>& masses, const std::string& sensing, const std::string& of_file,
                   remarks& said) {
    const auto known = [](const modal_mass& one) { return std::isfinite(one.phase_deg); };
    const auto together = [](const modal_mass& one) { return std::abs(one.phase_deg) <= far_off; };
    if (std::any_of(masses.begin(), masses.end(), known) && std::none_of(masses.begin(), masses.end(), together))
        said.emplace_back(
            "drive_point_polarity",
            fmt::format("where a force and a sensor share a place, they do not move together in any mode: "
                        "one of them is reversed (-3z instead of 3z), or the responses are not of the "
                        "quantity \"{}\" (--sensing{}). There is no modal mass",
                        sensing, of_file.empty() ? "" : "; the file says " + of_file));
}

/// Of modes with the poles of the structure, without those of a window.
std::vector<modal_mass> masses_of(const response_set& set, const record_options& options,
                                  const std::vector<listed_mode>& modes, const std::vector<residue_shape>& shapes,
                                  const deviations& sigma) {
    const mass_plan plan = options.mass.wanted() ? options.mass : places_by_name(set, options.sensing);
    std::vector<modal_mass> out;
    const std::vector<drive_pair> pairs = drive_pairs(plan);
    if (pairs.empty()) return out;
    for (std::size_t k = 0; k < modes.size(); ++k)
        out.push_back(mass_of(shapes[k], plan, pairs, continuous_pole(modes[k].frequency_hz, modes[k].damping_ratio),
                              sigma.damping_ratio[k] / modes[k].damping_ratio));
    return out;
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
    out.responses = true;
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
    given.stabilization = false; // of the fits there are, no other method
    return check_request(given);
}

/// Modes, deviations and model into the result; the window's decay goes out of the poles last.
void make_result(const response_set& set, const record_options& options, double constant_s, response_modes&& found,
                 record_work& work) {
    auto& [modes, shapes, sigma, stable] = found;
    work.context.stable = std::move(stable);
    std::vector<listed_mode> listed;
    for (std::size_t k = 0; k < modes.size(); ++k) {
        const residue_shape& own = shapes[k];
        listed.push_back(
            {modes[k].frequency_hz, modes[k].damping_ratio, modes[k].mpc, NAN, own.shape, modes[k].confident()});
        sigma.shape_re.insert(sigma.shape_re.end(), own.scatter.begin(), own.scatter.end());
    }
    sigma.shape_im = sigma.shape_re;
    work.context.sigma = std::move(sigma);
    work.set.n_y = set.outputs.size();
    make_modal_model(listed, work.context.fs_hz, work);
    fit_responses(set, options.sensing, work);
    remark_noisy_outputs(work.context);
    for (std::size_t k = 0; k < modes.size(); ++k) {
        take_window_out(constant_s, "narrow", modes[k]);
        listed[k].frequency_hz = modes[k].frequency_hz;
        listed[k].damping_ratio = modes[k].damping_ratio;
        work.context.verdicts.push_back(verdict_of(modes[k]));
    }
    work.context.modal_masses = masses_of(set, options, listed, shapes, *work.context.sigma);
    if (!(constant_s > 0)) return;
    std::vector<double> B = work.refined->B, D = work.refined->D; // they go with the windowed poles as well
    make_modal_model(listed, work.context.fs_hz, work);
    put_inputs(set.n_u(), std::move(B), std::move(D), work);
}

} // namespace

record_result identify_responses(const response_set& measured, const response_request& asked) {
    response_set set = choose(measured, asked.wanted);
    record_request wanted = asked.wanted;
    if (wanted.sensing.empty()) wanted.sensing = set.quantity.empty() ? "acceleration" : set.quantity;
    const bool turned = set.n_u() > set.n_y() && wanted.sensing.find(',') == std::string::npos;
    if (turned) set = exchanged(set);
    const record_options options = options_of(set, wanted, turned);
    const double constant_s = time_constant(asked.exponential);
    set = options.band ? cut_band(set, options.band->first, options.band->second)
                       : without_noise_lines(cut_band(set, 0, INFINITY));
    record_work work;
    work.context = describe(set);
    const auto left_out = measured.lines() - set.lines();
    if (!options.band && left_out > measured.lines() / 20)
        work.context.warnings.emplace_back(
            "lines_left_out",
            fmt::format("{} of {} lines are no more than noise or have no coherence: lines of {:g} to {:g} Hz "
                        "are used. --band LO:HI takes lines as they are",
                        left_out, measured.lines(), set.frequency_hz.front(), set.frequency_hz.back()));
    work.context.all_modes = asked.all_modes;
    if (turned)
        work.context.warnings.emplace_back(
            "reciprocity", "more inputs than outputs: by reciprocity the outputs of this result are the places that "
                           "were struck, its inputs the sensors");
    const joint_responses all{{set}, set.outputs, set.outputs, 1 / finest_spacing(measured.frequency_hz)};
    make_result(set, options, constant_s,
                find_response_modes(all, asked.all_modes, options.modes, asked.wanted.stabilization), work);
    remark_turned(work.context.modal_masses, wanted.sensing, set.quantity, work.context.warnings);
    for (const std::string& unit : measured.other_units)
        work.context.warnings.emplace_back("unit_converted", fmt::format("{}: all numbers are in SI units here", unit));
    find_matrices(options, work);
    describe_dofs(options, work.context);
    record_result result;
    result.model = kept_model(work.model);
    result.context = std::move(work.context);
    return result;
}

} // namespace okid_host
