// SPDX-License-Identifier: MIT
// PURPOSE  set-ups of one structure to one result
// METHOD   each is identified as a record of its own: its drift, its tones, its dead channels, its blocks. The result is that
//          of merge.hpp. A force that acts in all of them scales their shapes where no sensor stays: what it does to a mode, b,
//          times the shape is the residue, which no set-up changes. Modal mass: 2 j w_d r = phi_o phi_i / m at a drive point
#include "set_ups.hpp"

#include "error.hpp"
#include "files/nearest_name.hpp"
#include "files/order_statistics.hpp"
#include "merge.hpp"
#include "record/modal_model.hpp"
#include "record/record_check.hpp"
#include "result/drive_mass.hpp"
#include "result/hold.hpp"
#include "result/method.hpp"
#include "struck_set_ups.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <functional>

namespace okid_host {
namespace {

using complex = std::complex<double>;

constexpr double dead_spread = 0.01; // of the usual spread of sensors of a kind
constexpr double dead_percent = 10;  // explained one sample ahead
constexpr double same_mode = 0.01;   // of its frequency: a mode in one set-up and in all of them

/// A set-up by itself, and what its model says of its forces.
struct one_set_up {
    std::vector<std::size_t> at; ///< its outputs, among all of them
    known_result known;
    std::string hold;
    /// What each force does to each mode: times the shape, the residue of the displacement. Empty: not known.
    std::vector<std::vector<complex>> b;
};

/// Of `values`, one for all outputs, those of this set-up.
std::vector<int> those_at(const std::vector<std::size_t>& at, const std::vector<int>& values) {
    if (values.empty()) return values;
    std::vector<int> out;
    for (const std::size_t o : at) out.push_back(values[o]);
    return out;
}

record_options options_of_one(const record_options& all, const set_up& one, const std::vector<std::size_t>& at) {
    record_options out = all;
    out.outputs = one.outputs;
    out.sensing = those_at(at, all.sensing);
    out.placed = {};
    out.said.clear();
    out.all_modes = true;
    return out;
}

/// What each force does to each mode of the list, by the eigenvectors of the model.
void find_forces(const record_result& found, const record_options& options, one_set_up& to) {
    const okid_identified_t& model = found.model.view();
    to.b.resize(to.known.modes.size());
    if (model.n_u == 0 || !model.B) return;
    const Eigen::Map<const Eigen::MatrixXd> A(model.A, model.n_z, model.n_z), B(model.B, model.n_z, model.n_u),
        C(model.C, model.n_y, model.n_z);
    const Eigen::EigenSolver<Eigen::MatrixXd> solver(A);
    const Eigen::MatrixXcd right = solver.eigenvectors(), left = right.partialPivLu().inverse();
    if (!left.allFinite()) return;
    for (std::size_t k = 0; k < to.known.modes.size(); ++k) {
        known_mode& mode = to.known.modes[k];
        const complex lambda = continuous_pole(mode.frequency_hz, mode.damping_ratio), mu = std::exp(lambda * model.dt);
        Eigen::Index near = 0;
        (solver.eigenvalues().array() - mu).abs().minCoeff(&near);
        if (std::abs(solver.eigenvalues()[near] - mu) > 1e-3 * std::abs(1.0 - mu)) continue; // it is not in the model
        const Eigen::VectorXcd seen = C.cast<complex>() * right.col(near);
        complex along = 0;
        double power = 0, square = 0;
        for (std::size_t o = 0; o < mode.shape.size(); ++o) {
            if (!std::isfinite(std::abs(mode.shape[o]))) continue;
            const int kind = options.sensing.empty() ? OKID_SENSE_ACCELERATION : options.sensing[o];
            along += std::conj(mode.shape[o]) * seen[static_cast<Eigen::Index>(o)] * to_displacement(lambda, kind);
            power += std::norm(mode.shape[o]);
        }
        std::vector<complex> b;
        for (Eigen::Index i = 0; i < B.cols(); ++i) {
            b.push_back(along / power * (left.row(near) * B.col(i).cast<complex>())(0));
            square += std::norm(b.back());
        }
        if (!(square > 0) || !std::isfinite(square)) continue;
        for (const complex one : b) mode.drive.push_back(std::conj(one) / square);
        to.b[k] = std::move(b);
    }
}

/// Where each of the outputs stands in the list of all.
std::vector<std::size_t> places_of_outputs(const set_up& one, const std::vector<std::string>& all) {
    std::vector<std::size_t> out;
    for (const std::string& name : one.outputs)
        out.push_back(static_cast<std::size_t>(std::find(all.begin(), all.end(), name) - all.begin()));
    return out;
}

/// Files of the same sensors are records of one set-up.
std::vector<set_up> joined(std::vector<set_up> all) {
    std::vector<set_up> out;
    for (set_up& one : all) {
        const auto same = std::find_if(out.begin(), out.end(), [&](const set_up& known) {
            return known.outputs == one.outputs && known.set.n_u == one.set.n_u;
        });
        if (same == out.end()) {
            out.push_back(std::move(one));
            continue;
        }
        for (const record_data& record : one.set.records)
            same->set.add(record.path, one.set.rows(record), record.count);
        same->set.complete = same->set.complete && one.set.complete;
    }
    return out;
}

/// Outputs that hardly move beside the others of their kind, and not as the modes do: a dead sensor gives its own noise.
std::vector<std::size_t> dead_outputs(const std::vector<output_spread>& about, const std::vector<int>& sensing,
                                      const std::optional<std::vector<double>>& explained) {
    std::vector<std::size_t> out;
    std::vector<double> spreads;
    for (const output_spread& one : about) spreads.push_back(one.count > 0 ? std::sqrt(one.squares / one.count) : 0);
    for (std::size_t o = 0; explained && o < spreads.size(); ++o) {
        std::vector<double> of_kind;
        for (std::size_t other = 0; other < spreads.size(); ++other)
            if (sensing.empty() || sensing[other] == sensing[o]) of_kind.push_back(spreads[other]);
        if (of_kind.size() >= 3 && spreads[o] < dead_spread * upper_median(of_kind) &&
            !((*explained)[o] >= dead_percent))
            out.push_back(o);
    }
    return out;
}

class set_up_merger {
  public:
    set_up_merger(const record_options& options, const std::vector<std::string>& references)
        : options_(options), references_(references) {}

    record_result run(std::vector<set_up> set_ups) {
        for (std::size_t k = 0; k < set_ups.size(); ++k) identify(std::move(set_ups[k]), k, set_ups.size());
        if (found_.size() < 2) refuse();
        std::vector<known_result> known;
        known.reserve(found_.size());
        for (const one_set_up& one : found_) known.push_back(one.known);
        record_result out = merge_results(known, references_, options_.outputs);
        result_context& context = out.context;
        context.method = options_.method;
        context.band_hz = band_;
        context.all_modes = options_.all_modes;
        context.warnings.insert(context.warnings.begin(), options_.said.begin(), options_.said.end());
        context.warnings.insert(context.warnings.end(), failed_.begin(), failed_.end());
        if (options_.sigma_blocks == 0) context.sigma.reset();
        const std::vector<int>& kinds = options_.sensing;
        if (std::adjacent_find(kinds.begin(), kinds.end(), std::not_equal_to<>()) != kinds.end())
            context.shape_quantity = "displacement";
        if (options_.placed.wanted()) place(out);
        return out;
    }

  private:
    void identify(set_up one, std::size_t k, std::size_t count) {
        one_set_up out;
        out.at = places_of_outputs(one, options_.outputs);
        record_options own = options_of_one(options_, one, out.at);
        const std::string path = one.set.records.front().path;
        const std::vector<output_spread> spreads = spreads_of(one.set);
        if (options_.stage)
            own.stage = [&, k, count](const char* text) {
                options_.stage(fmt::format("set-up {} of {} ({}): {}", k + 1, count, path, text).c_str());
            };
        try {
            const record_result found = identify_records(std::move(one.set), own);
            out.known = take_known_result(result_json(found.model.view(), found.context, false), path);
            for (const std::size_t o : dead_outputs(spreads, own.sensing, found.context.prediction_percent)) {
                for (known_mode& mode : out.known.modes) mode.shape[o] = {NAN, NAN};
                failed_.emplace_back(
                    "screened", fmt::format("{}: output \"{}\" hardly moves beside the others and not as the modes do: "
                                            "not measured. Look at its sensor and cable",
                                            path, one.outputs[o]));
            }
            out.hold = found.context.hold;
            if (!band_) band_ = found.context.band_hz;
            find_forces(found, own, out);
            found_.push_back(std::move(out));
        } catch (const failure& fault) {
            if (fault.code != exit_no_model) throw;
            failed_.emplace_back("set_up_without_modes", fmt::format("{}: {}", path, fault.what()));
        }
    }

    [[noreturn]] void refuse() const {
        std::string why;
        for (const auto& one : failed_) why += (why.empty() ? "" : "; ") + one.second;
        throw failure(exit_no_model,
                      fmt::format("no model: modes were found in {} of {} set-ups, expected two or more. {}",
                                  found_.size(), found_.size() + failed_.size(), why));
    }

    /// Shapes at the degrees of freedom, in their order; modal masses from the drive points. Whatever its sensors measure, a
    /// set-up has its shapes in one quantity.
    void place(record_result& out) const {
        const okid_identified_t& model = out.model.view();
        std::vector<std::vector<complex>> shapes;
        for (int k = 0; k < model.mode_count; ++k) {
            shapes.emplace_back(options_.outputs.size(), NAN);
            for (int o = 0; o < model.n_y; ++o) {
                const auto at = std::find(options_.outputs.begin(), options_.outputs.end(),
                                          out.context.outputs[static_cast<std::size_t>(o)]);
                shapes.back()[static_cast<std::size_t>(at - options_.outputs.begin())] = {
                    model.shape_re[k * model.n_y + o], model.shape_im[k * model.n_y + o]};
            }
        }
        std::vector<complex> largest;
        placed_shapes placed = over_dofs(options_.placed.outputs, shapes, nullptr, largest);
        for (std::size_t k = 0; k < shapes.size(); ++k)
            placed.modal_mass.push_back(mass_of(model.frequency_hz[k], shapes[k], largest[k]));
        out.context.placed = std::move(placed);
    }

    /// Of a shape over the outputs whose largest entry in SI units is given, from all set-ups with a sensor at a force.
    double mass_of(double frequency_hz, const std::vector<complex>& shape, complex largest) const {
        const mass_plan& plan = options_.placed;
        drive_mass mass;
        for (const one_set_up& one : found_)
            for (std::size_t k = 0; k < one.b.size(); ++k) {
                const known_mode& mode = one.known.modes[k];
                if (one.b[k].empty() || std::abs(mode.frequency_hz / frequency_hz - 1) > same_mode) continue;
                const complex lambda = continuous_pole(mode.frequency_hz, mode.damping_ratio);
                for (std::size_t i = 0; i < plan.inputs.size(); ++i)
                    for (std::size_t o = 0; o < one.at.size(); ++o) {
                        const mass_channel &force = plan.inputs[i], &sensor = plan.outputs[one.at[o]];
                        if (force.dof == 0 || force.dof != sensor.dof) continue;
                        mass.add(in_si(sensor, shape[one.at[o]]) / largest,
                                 in_si(sensor, mode.shape[o]) * one.b[k][i] / in_si(force, 1) *
                                     drive_factor(lambda, 1 / options_.fs_hz, one.hold));
                    }
            }
        return mass.kg();
    }

    const record_options& options_;
    const std::vector<std::string>& references_;
    std::vector<one_set_up> found_;
    std::optional<std::pair<double, double>> band_;
    std::vector<std::pair<std::string, std::string>> failed_;
};

void check_references(const std::vector<set_up>& set_ups, const record_options& options,
                      const std::vector<std::string>& wanted) {
    std::vector<std::string> common;
    for (const std::string& name : options.outputs)
        if (std::all_of(set_ups.begin(), set_ups.end(), [&](const set_up& one) {
                return std::find(one.outputs.begin(), one.outputs.end(), name) != one.outputs.end();
            }))
            common.push_back(name);
    for (const std::string& name : wanted)
        if (std::find(common.begin(), common.end(), name) == common.end())
            throw failure(exit_usage,
                          fmt::format("--references: found \"{}\"{}, expected outputs that every set-up has: {}",
                                      printable(name), did_you_mean(name, common), list_names(common)));
    if (common.empty() && options.inputs.empty())
        throw failure(exit_usage, "the set-ups have no output in common, expected a reference that stays where it is, "
                                  "with the same name in every set-up");
}

} // namespace

record_result identify_set_ups(std::vector<set_up> set_ups, const record_options& options,
                               const std::vector<std::string>& references) {
    check_references(set_ups, options, references);
    if (options.method == lag_method) return identify_set_ups_together(std::move(set_ups), options, references);
    if (!options.modes.empty()) throw failure(exit_usage, "--modes of set-ups belongs to --method plscf");
    set_ups = joined(std::move(set_ups));
    if (references.empty() && are_struck(set_ups, options)) return identify_struck(std::move(set_ups), options);
    if (set_ups.size() > 1) return set_up_merger(options, references).run(std::move(set_ups));
    return identify_records(std::move(set_ups.front().set), options);
}

} // namespace okid_host
