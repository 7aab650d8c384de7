// SPDX-License-Identifier: MIT
// PURPOSE  shapes over all places that were struck, though few sensors stand there
// METHOD   the residue of a mode from place j to sensor o is c_o b_j, and by reciprocity proportional to phi_o phi_j: b over the
//          places is the shape, one for all sensors together. The sensors' own places come in by the factor between b and c at the
//          drive points, where both are known. There 2 j w_d r = phi^2 / m > 0 too, which gives the modal mass m and shows a
//          polarity that is reversed. Of c only displacements are compared
#include "place_shapes.hpp"

#include "consensus/quantity.hpp"
#include "result/drive_mass.hpp"
#include "result/judgement.hpp"
#include "result/mode_verdict.hpp"
#include "roving.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <map>

namespace okid_host {
namespace {

using complex = std::complex<double>;

constexpr double near_node = 0.1;    // of the largest entry: below, a drive point tells no sign
constexpr double drive_cosine = 0.7; // cosine of the angle of 2 j w_d r

struct place_entry {
    complex value = NAN;
    double std = NAN;
};

/// A sensor at a place that was struck.
struct drive_point {
    std::size_t output, place; ///< of hit_places()
    int dof;
};

complex pole_of(const listed_mode& mode) { return continuous_pole(mode.frequency_hz, mode.damping_ratio); }

/// The shape of a mode at the sensors as displacement, signs as the plan has them.
std::vector<complex> at_sensors(const listed_mode& mode, const std::vector<mass_channel>& outputs) {
    std::vector<complex> out;
    for (std::size_t o = 0; o < outputs.size(); ++o)
        out.push_back((outputs[o].reversed ? -1.0 : 1.0) * mode.shape[o] *
                      to_displacement(pole_of(mode), outputs[o].sensing));
    return out;
}

class placer {
  public:
    placer(const std::vector<listed_mode>& modes, const record_options& options, record_work& work)
        : modes_(modes), outputs_(options.placed.outputs), inputs_(options.placed.inputs), work_(work),
          places_(hit_places(options.hits)), dt_(1 / options.fs_hz), own_(residues_of(modes, options)) {
        shapes_.dofs = places_;
        std::vector<int>& dofs = shapes_.dofs;
        for (std::size_t o = 0; o < outputs_.size(); ++o) {
            const int dof = outputs_[o].dof;
            const auto at = std::lower_bound(places_.begin(), places_.end(), dof);
            if (at != places_.end() && *at == dof)
                points_.push_back({o, static_cast<std::size_t>(at - places_.begin()), dof});
        }
        if (!points_.empty())
            for (const mass_channel& output : outputs_) dofs.push_back(output.dof);
        std::sort(dofs.begin(), dofs.end());
        dofs.erase(std::unique(dofs.begin(), dofs.end()), dofs.end());
    }

    void place() {
        if (shapes_.dofs.size() < 2) return;
        for (std::size_t k = 0; k < modes_.size(); ++k) add(k);
        say_points();
        scale_masses();
        work_.context.placed = std::move(shapes_);
    }

  private:
    /// Of the doubtful modes beside all; then of the confident ones, beside those that are likely: what most runs found takes
    /// its own motion, and noise takes nothing.
    place_residues residues_of(const std::vector<listed_mode>& modes, const record_options& options) const {
        const auto found = [&](const std::vector<listed_mode>& of) {
            return find_residues(of, options.hits, options.fs_hz, work_.set);
        };
        std::vector<listed_mode> all = modes, likely = modes;
        bool every = true;
        for (std::size_t k = 0; k < modes.size(); ++k) {
            const mode_verdict& verdict = work_.context.verdicts[k];
            all[k].in_model = true;
            likely[k].in_model |= verdict.found_in >= judgement::least_found_in && !is_tone(verdict.why);
            every = every && likely[k].in_model;
        }
        place_residues out = found(all);
        if (every) return out;
        const place_residues alone = found(likely);
        Eigen::Index row = 0;
        for (std::size_t k = 0; k < modes.size(); ++k) {
            if (!likely[k].in_model) continue;
            out.b.row(static_cast<Eigen::Index>(k)) = alone.b.row(row);
            out.std.row(static_cast<Eigen::Index>(k)) = alone.std.row(row++);
        }
        return out;
    }

    void add(std::size_t k) {
        const auto row = static_cast<Eigen::Index>(k);
        std::map<int, place_entry> at;
        for (std::size_t j = 0; j < places_.size(); ++j)
            at[places_[j]] = {own_.b(row, static_cast<Eigen::Index>(j)), own_.std(row, static_cast<Eigen::Index>(j))};
        const std::vector<complex> c = at_sensors(modes_[k], outputs_);
        complex both = 0;
        double power = 0;
        for (const drive_point& point : points_) {
            both += std::conj(c[point.output]) * at[point.dof].value;
            power += std::norm(c[point.output]);
        }
        for (std::size_t o = 0; !points_.empty() && o < outputs_.size(); ++o)
            if (!std::binary_search(places_.begin(), places_.end(), outputs_[o].dof))
                at[outputs_[o].dof].value = both / power * c[o];
        const place_entry most = std::max_element(at.begin(), at.end(), [](const auto& a, const auto& b) {
                                     return std::norm(a.second.value) < std::norm(b.second.value);
                                 })->second;
        mode_shape shape;
        for (const auto& [dof, one] : at) {
            const complex value = one.value / most.value;
            const double std = one.value == most.value
                                   ? 0
                                   : std::hypot(one.std, std::abs(value) * most.std) / std::abs(most.value) / M_SQRT2;
            shape.push_back(value);
            shapes_.re.push_back(value.real());
            shapes_.im.push_back(value.imag());
            shapes_.re_std.push_back(std);
            shapes_.im_std.push_back(std);
        }
        refined_arrays& arrays = *work_.refined;
        arrays.mpc[k] = shape_collinearity(shape, {});
        arrays.cmi[k] = arrays.mpc[k] * arrays.emac[k];
        add_modal_mass(k, c, most);
    }

    /// Of a shape divided by `largest`, from the residues at the drive points. NaN: there is none, or they contradict. The mass
    /// is b / (turn c largest^2), and its relative deviation the mean of those of the points by their weight.
    void add_modal_mass(std::size_t k, const std::vector<complex>& c, const place_entry& largest) {
        const complex lambda = pole_of(modes_[k]);
        const complex turn = drive_factor(lambda, dt_, work_.context.hold) / 2.0; // b is of two real states
        drive_mass mass;
        double deviation = 0;
        bool clear = true;
        for (const drive_point& point : points_) {
            const complex b = own_.b(static_cast<Eigen::Index>(k), static_cast<Eigen::Index>(point.place));
            const complex psi = b / largest.value;
            const complex r = turn * c[point.output] * b * outputs_[point.output].si / inputs_[point.place].si;
            mass.add(psi, r);
            const double own =
                own_.std(static_cast<Eigen::Index>(k), static_cast<Eigen::Index>(point.place)) / std::abs(b);
            const double other = b == largest.value ? 0 : 2 * largest.std / std::abs(largest.value);
            deviation += std::norm(psi * psi) * std::hypot(own, other) / M_SQRT2;
            if (!(std::abs(psi) >= near_node)) continue;
            const double cosine = (std::conj(psi * psi) * r).real() / std::abs(psi * psi * r);
            clear = clear && cosine > drive_cosine;
            if (modes_[k].in_model) cosines_[point.output].emplace_back(cosine, modes_[k].frequency_hz);
        }
        shapes_.modal_mass.push_back(clear ? mass.kg() : NAN);
        shapes_.modal_mass_std.push_back(shapes_.modal_mass.back() * deviation / mass.power);
    }

    /// Those that came with M, K and R are of shapes whose largest entry is at a sensor: here it is at a place.
    void scale_masses() {
        for (std::size_t k = 0; k < work_.context.modal_masses.size(); ++k) {
            modal_mass& one = work_.context.modal_masses[k];
            const double factor = shapes_.modal_mass[k] / one.kg;
            for (double* value : {&one.kg, &one.stiffness, &one.damping, &one.stiffness_std, &one.damping_std})
                *value *= factor;
            one.kg_std = shapes_.modal_mass_std[k];
        }
    }

    /// At a drive point every mode moves with the force.
    void say_points() {
        for (const drive_point& point : points_) {
            const auto& found = cosines_[point.output];
            std::vector<std::string> wrong;
            std::size_t against = 0;
            for (const auto& [cosine, f] : found) {
                against += cosine < -drive_cosine;
                if (!(cosine > drive_cosine)) wrong.push_back(fmt::format("{:.4g} Hz", f));
            }
            if (wrong.empty()) continue;
            const std::string name = outputs_[point.output].name;
            if (against == found.size())
                work_.context.warnings.emplace_back(
                    "drive_point_polarity",
                    fmt::format(
                        "\"{}\" at place {} moves against the hits there in every mode: its polarity or that of "
                        "the hammer is reversed. Say -{} in --output-dofs",
                        name, point.dof, point.dof));
            else
                work_.context.warnings.emplace_back(
                    "drive_point_mismatch",
                    fmt::format(
                        "\"{}\" does not move with the hits at place {} at {}: another place, direction or kind "
                        "of sensor? There is no modal mass for these modes",
                        name, point.dof, fmt::join(wrong, ", ")));
        }
    }

    const std::vector<listed_mode>& modes_;
    const std::vector<mass_channel>&outputs_, &inputs_;
    record_work& work_;
    std::vector<int> places_;
    double dt_;
    place_residues own_;
    std::vector<drive_point> points_;
    std::map<std::size_t, std::vector<std::pair<double, double>>> cosines_; ///< of an output: (cosine, Hz) of each mode
    placed_shapes shapes_;
};

} // namespace

mass_plan matrices_of_places(const std::vector<listed_mode>& modes, const record_options& options, remarks& said) {
    const auto found = std::count_if(modes.begin(), modes.end(), [](const listed_mode& mode) { return mode.in_model; });
    if (options.mass.wanted() && found >= options.mass.size()) return options.mass;
    if (options.mass.wanted() && 2 * found >= options.mass.size()) // places for shapes alone are many more than modes
        said.emplace_back(
            "mkr_failed",
            fmt::format("no M, K and R: they need a mode for each of {} degrees of freedom, {} were found",
                        options.mass.size(), found));
    mass_plan none;
    none.outputs = options.placed.outputs;
    return none;
}

void place_shapes(const std::vector<listed_mode>& modes, const record_options& options, record_work& work) {
    placer(modes, options, work).place();
}

} // namespace okid_host
