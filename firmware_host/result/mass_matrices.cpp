// SPDX-License-Identifier: MIT
#include "mass_matrices.hpp"

#include "deviations.hpp"
#include "error.hpp"
#include "files/nearest_name.hpp"
#include "files/units.hpp"
#include "hold.hpp"

#include <algorithm>
#include <charconv>
#include <cstddef>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <memory>

namespace okid_host {
namespace {

constexpr int most_dofs = 100000;
constexpr double least_in_sigmas = 2; // a mass or stiffness known to half of itself
constexpr double hardly_moves = 0.1;  // of the largest motion of a shape: a named reason, no criterion
constexpr std::uint32_t doubts =
    OKID_MKR_POLARITY | OKID_MKR_MASS | OKID_MKR_STIFFNESS | OKID_MKR_RESIDUAL | OKID_MKR_FEEDTHROUGH | OKID_MKR_SPREAD;
constexpr const char* kinds[] = {"displacement", "velocity", "acceleration"};
constexpr const char* kind_units[] = {"m", "m/s", "m/s^2"};

/// The arguments and the result of one okid_mkr_identify().
struct attempt {
    okid_mkr_t result{};
    okid_status_t status = OKID_ERR_NULL;
    std::unique_ptr<std::byte[]> work;
};

double gain_of(const mass_channel& channel) { return (channel.reversed ? -1 : 1) * channel.si; }

attempt try_plan(const okid_identified_t& model, const mass_plan& plan) {
    const mkr_arguments given(plan, model.dt);
    held_model held;
    const bool band = plan.hold == "band" && as_if_held(model, given.sensing, held);
    const okid_model_t view = model_view(band ? held.view : model);
    attempt out;
    const std::size_t bytes = okid_mkr_memsize(view.n_u, view.n_y, view.n_z, given.config.n_x);
    out.work = std::make_unique<std::byte[]>(bytes);
    out.status = okid_mkr_identify(&view, &given.config, &out.result, out.work.get(), bytes);
    return out;
}

int nearest_mode(const okid_identified_t& model, double frequency_hz) {
    const auto* end = model.frequency_hz + model.mode_count;
    return static_cast<int>(
        std::min_element(model.frequency_hz, end,
                         [&](double a, double b) { return std::abs(a - frequency_hz) < std::abs(b - frequency_hz); }) -
        model.frequency_hz);
}

/// The plans a slip of the hand away, each with what it changes.
std::vector<std::pair<std::string, mass_plan>> plans_nearby(const mass_plan& plan) {
    std::vector<std::pair<std::string, mass_plan>> out;
    out.emplace_back(fmt::format("hold {}", plan.hold == "foh" ? "zoh" : "foh"), plan);
    out.back().second.hold = plan.hold == "foh" ? "zoh" : "foh";
    for (int kind = OKID_SENSE_DISPLACEMENT; kind <= OKID_SENSE_ACCELERATION; ++kind) {
        mass_plan other = plan;
        for (mass_channel& channel : other.outputs) channel.sensing = kind;
        out.emplace_back(fmt::format("sensing {}", kinds[kind]), std::move(other));
    }
    constexpr std::size_t most_channels = 16; // each costs another decomposition of A
    if (plan.inputs.size() + plan.outputs.size() > most_channels) return out;
    for (auto side : {&mass_plan::inputs, &mass_plan::outputs})
        for (std::size_t i = 0; i < (plan.*side).size(); ++i) {
            mass_plan other = plan;
            (other.*side)[i].reversed = !(other.*side)[i].reversed;
            out.emplace_back(fmt::format("the polarity of \"{}\" reversed", (plan.*side)[i].name), std::move(other));
        }
    for (std::size_t i = 0; i < plan.outputs.size(); ++i)
        for (int kind = OKID_SENSE_DISPLACEMENT; kind <= OKID_SENSE_ACCELERATION; ++kind) {
            if (kind == plan.outputs[i].sensing) continue;
            mass_plan other = plan;
            other.outputs[i].sensing = kind;
            out.emplace_back(fmt::format("\"{}\" sensing {}", plan.outputs[i].name, kinds[kind]), std::move(other));
        }
    return out;
}

/// Which small change of the plan all checks would pass with; "" when none or too many would.
std::string likely_cause(const okid_identified_t& model, const mass_plan& plan) {
    std::vector<std::string> clear;
    for (const auto& [change, other] : plans_nearby(plan)) {
        const attempt tried = try_plan(model, other);
        if (tried.status >= 0 && !(tried.result.notes & (doubts | OKID_MKR_DAMPING))) clear.push_back(change);
    }
    return clear.empty() || clear.size() > 3 ? "" : fmt::format("{}", fmt::join(clear, ", or with "));
}

[[noreturn]] void throw_no_matrices(const attempt& tried, const okid_identified_t& model, const mass_plan& plan) {
    const int found = tried.result.admissible, needed = plan.size();
    if (tried.status == OKID_ERR_NO_MODES)
        throw failure(
            exit_no_model,
            fmt::format("no M, K and R: {} admissible mode{} (underdamped, below {:g} Hz) found in the model of "
                        "order {}, {} needed, one for each degree of freedom. Excite and sample all of them, "
                        "try a larger order, or name fewer degrees of freedom",
                        found, found == 1 ? "" : "s", 0.5 / model.dt, model.n_z, needed),
            tried.status);
    if (tried.status == OKID_ERR_NUMERIC)
        throw failure(exit_no_model,
                      "no M, K and R: the modes cannot be scaled or their sum is singular: a mode does not show at the "
                      "co-located pair, or two sensors repeat each other. Try another order, or a force elsewhere",
                      tried.status);
    throw failure(exit_no_model, fmt::format("no M, K and R: {}", okid_status_text(tried.status)), tried.status);
}

/// Copies, and the proportional damping of the same modes.
mass_matrices take(const okid_mkr_t& result, const mass_plan& plan) {
    mass_matrices out;
    out.n_x = result.n_x;
    out.notes = result.notes;
    const auto n = static_cast<std::size_t>(result.n_x);
    out.M.assign(result.M, result.M + n * n);
    out.K.assign(result.K, result.K + n * n);
    out.R.assign(result.R, result.R + n * n);
    out.R_normal.assign(result.R_normal, result.R_normal + n * n);
    for (std::size_t k = 0; k < n; ++k)
        out.modes.push_back({result.mode[k] + 1,
                             result.frequency_hz[k],
                             result.damping_ratio[k],
                             result.strength[k],
                             result.mpc[k],
                             result.phase[k],
                             result.pair_spread[k],
                             1,
                             {}});
    out.admissible = result.admissible;
    out.pairs = result.pairs;
    if (result.feedthrough_row >= 0)
        out.feedthrough_output = plan.outputs[static_cast<std::size_t>(result.feedthrough_row)].name;
    out.residual = result.residual;
    out.feedthrough = result.feedthrough;
    out.gain = result.gain;
    out.margin = result.margin;
    out.condition = result.condition;
    out.R_pdc.resize(n * n);
    okid_status_t status = okid_pdc_fit(result.n_x, result.frequency_hz, result.damping_ratio, nullptr, &out.pdc);
    if (status >= 0) status = okid_pdc_damping(result.n_x, &out.pdc, out.M.data(), out.K.data(), out.R_pdc.data());
    if (status < 0) throw failure(exit_no_model, fmt::format("no proportional damping: {}", okid_status_text(status)));
    return out;
}

/// Of each mode taken, how much it moves where a force and a sensor stand together.
void find_motion_at_forces(const okid_identified_t& model, const mass_plan& plan, mass_matrices& found) {
    for (mass_mode& mode : found.modes) {
        const int k = mode.number - 1;
        if (k < 0 || k >= model.mode_count) continue;
        const auto size = [&](std::size_t i) {
            const std::size_t at = i + static_cast<std::size_t>(k) * plan.outputs.size();
            return std::hypot(static_cast<double>(model.shape_re[at]), static_cast<double>(model.shape_im[at])) *
                   plan.outputs[i].si;
        };
        double largest = 0, own = -1;
        for (std::size_t i = 0; i < plan.outputs.size(); ++i) {
            if (plan.outputs[i].dof > 0) largest = std::max(largest, size(i));
            for (const mass_channel& force : plan.inputs)
                if (force.dof > 0 && force.dof == plan.outputs[i].dof && size(i) > own)
                    own = size(i), mode.force_name = force.name;
        }
        if (largest > 0 && own >= 0) mode.at_force = own / largest;
    }
}

} // namespace

mkr_arguments::mkr_arguments(const mass_plan& plan, double dt) {
    for (const mass_channel& channel : plan.inputs) {
        input_dof.push_back(channel.dof - 1);
        input_gain.push_back(gain_of(channel));
    }
    for (const mass_channel& channel : plan.outputs) {
        output_dof.push_back(channel.dof - 1);
        output_gain.push_back(1 / gain_of(channel));
        sensing.push_back(channel.sensing);
    }
    config.n_x = plan.size();
    config.hold = plan.hold == "foh" ? OKID_HOLD_FIRST : OKID_HOLD_ZERO;
    config.dt = dt;
    config.input_dof = input_dof.data();
    config.input_gain = input_gain.data();
    config.output_dof = output_dof.data();
    config.output_gain = output_gain.data();
    config.output_sensing = sensing.data();
}

int mass_plan::size() const {
    int largest = 0;
    for (const auto* side : {&inputs, &outputs})
        for (const mass_channel& channel : *side) largest = std::max(largest, channel.dof);
    return largest;
}

int sensing_of(const std::string& kind) {
    return kind == kinds[0]   ? OKID_SENSE_DISPLACEMENT
           : kind == kinds[1] ? OKID_SENSE_VELOCITY
                              : OKID_SENSE_ACCELERATION;
}

std::string plan_fault(const mass_plan& plan) {
    const auto stands = [](const std::vector<mass_channel>& side, int dof) {
        return std::any_of(side.begin(), side.end(), [dof](const mass_channel& c) { return c.dof == dof; });
    };
    const int n_x = plan.size();
    bool pair = false;
    for (int dof = 1; dof <= n_x; ++dof) {
        const bool force = stands(plan.inputs, dof), sensor = stands(plan.outputs, dof);
        pair = pair || (force && sensor);
        if (!force && !sensor)
            return fmt::format("degree of freedom {} has neither a force nor a sensor, expected one at each of 1 to {}",
                               dof, n_x);
    }
    if (n_x == 0) return "no channel stands at a degree of freedom";
    return pair ? ""
                : "no degree of freedom has a force and a sensor, expected at least one co-located pair: it sets the "
                  "scale of M, K and R";
}

void read_dofs(const std::string& option, const std::string& list, const char* noun,
               std::vector<mass_channel>& channels) {
    std::size_t count = 0;
    for (std::size_t at = 0; at <= list.size(); ++count) {
        const std::size_t comma = std::min(list.find(',', at), list.size());
        const std::string text = list.substr(at, comma - at);
        at = comma + 1;
        int dof = 0;
        const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), dof);
        if (error != std::errc{} || end != text.data() + text.size() || dof == 0 || dof < -most_dofs || dof > most_dofs)
            throw failure(exit_usage,
                          fmt::format("{}: found \"{}\", expected the numbers of degrees of freedom, from 1, with "
                                      "commas between (-3: at 3 with reversed polarity)",
                                      option, printable(text)));
        if (count >= channels.size()) continue;
        channels[count].dof = dof < 0 ? -dof : dof;
        channels[count].reversed = dof < 0;
    }
    if (count != channels.size())
        throw failure(exit_usage,
                      fmt::format("{}: found {} number{} for {} {}{}, expected one for each", option, count,
                                  count == 1 ? "" : "s", channels.size(), noun, channels.size() == 1 ? "" : "s"));
}

void take_units(const std::vector<std::string>& units, mass_plan& plan, remarks& said) {
    for (std::size_t i = 0; i < units.size() && i < plan.inputs.size() + plan.outputs.size(); ++i) {
        const bool force = i < plan.inputs.size();
        mass_channel& channel = force ? plan.inputs[i] : plan.outputs[i - plan.inputs.size()];
        const std::string& unit = units[i];
        const char* wanted = force ? "N" : kind_units[channel.sensing];
        const unit_rule* rule = find_unit(unit);
        if (unit.empty() || channel.dof == 0) continue;
        const bool fits = rule && std::string(rule->si) == wanted;
        const std::string tail = "_" + unit; // acc_N may well be the one to the north
        const bool of_the_name = channel.name.size() > tail.size() &&
                                 channel.name.compare(channel.name.size() - tail.size(), tail.size(), tail) == 0;
        if (!fits && of_the_name) continue;
        if (!rule) {
            said.emplace_back("unit_unknown", fmt::format("the unit \"{}\" of \"{}\" is not known: for M, K and R its "
                                                          "numbers are taken as {}",
                                                          printable(unit), channel.name, wanted));
            continue;
        }
        if (!fits)
            throw failure(exit_usage, fmt::format("{}: \"{}\" is in {}, expected a unit of {} ({}), or another {}",
                                                  force ? "--inputs" : "--sensing", channel.name, unit,
                                                  force ? "force" : kinds[channel.sensing], wanted,
                                                  force ? "column" : "kind of sensor"));
        channel.si = rule->factor;
        if (rule->factor != 1)
            said.emplace_back("unit_converted",
                              fmt::format("\"{}\" is in {}: for M, K and R 1 {} is taken as {:.10g} {}", channel.name,
                                          unit, unit, rule->factor, rule->si));
    }
}

bool has_remark(const remarks& said, const char* code) {
    return std::any_of(said.begin(), said.end(), [&](const auto& each) { return each.first == code; });
}

mass_matrices find_mass_matrices(const okid_identified_t& model, const mass_plan& plan, remarks& said) {
    const attempt tried = try_plan(model, plan);
    if (tried.status < 0) throw_no_matrices(tried, model, plan);
    mass_matrices found = take(tried.result, plan);
    if (plan.hold == "band") // the modes of another realization: those of this model by their frequency
        for (mass_mode& mode : found.modes) mode.number = nearest_mode(model, mode.frequency_hz) + 1;
    find_motion_at_forces(model, plan, found);
    const remarks notes = mass_remarks(found);
    said.insert(said.end(), notes.begin(), notes.end());
    if (!(found.notes & doubts)) return found;
    if (has_remark(said, "code_jumps")) return found; // misread numbers are the cause, and no guess finds it
    const std::string cause = likely_cause(model, plan);
    if (!cause.empty()) said.emplace_back("mkr_likely_cause", fmt::format("every check passes with {}", cause));
    return found;
}

void drop_undetermined(mass_matrices& found, remarks& said) {
    const auto n = static_cast<std::size_t>(found.n_x);
    const struct {
        const char* name;
        std::vector<double>&values, &std;
        std::size_t most_open; ///< diagonal entries that may be open
        std::vector<std::string> guesses;
    } all[] = {{"M", found.M, found.M_std, 0, {"mkr_polarity", "mkr_mass_indefinite"}},
               {"K", found.K, found.K_std, 0, {"mkr_stiffness_indefinite"}},
               {"R", found.R, found.R_std, n - 1, {"mkr_damping_indefinite"}},
               {"R of normal modes", found.R_normal, found.R_normal_std, n - 1, {}}};
    std::vector<std::string> names, guesses;
    for (const auto& one : all) {
        std::size_t open = 0;
        double square = 0; // an entry that a slip made small is known, and what the slip is must stand there
        for (std::size_t i = 0; i < n; ++i) square += one.values[i * (n + 1)] * one.values[i * (n + 1)];
        for (std::size_t i = 0; i < n && one.std.size() == n * n; ++i)
            open += std::sqrt(square / static_cast<double>(n)) < least_in_sigmas * one.std[i * (n + 1)];
        if (open <= one.most_open) continue;
        std::fill(one.values.begin(), one.values.end(), NAN);
        std::fill(one.std.begin(), one.std.end(), NAN);
        names.emplace_back(one.name);
        guesses.insert(guesses.end(), one.guesses.begin(), one.guesses.end());
        if (one.most_open == 0) std::fill(found.R_pdc.begin(), found.R_pdc.end(), NAN); // alpha M + beta K
    }
    if (names.empty()) return;
    const auto weakest =
        std::min_element(found.modes.begin(), found.modes.end(),
                         [](const mass_mode& a, const mass_mode& b) { return a.at_force < b.at_force; });
    const bool node = weakest != found.modes.end() && weakest->at_force < hardly_moves;
    if (node) guesses.emplace_back("mkr_likely_cause"); // else a slip may well be why
    said.erase(std::remove_if(said.begin(), said.end(),
                              [&](const auto& one) {
                                  return std::find(guesses.begin(), guesses.end(), one.first) != guesses.end();
                              }),
               said.end());
    std::string reason = "their standard deviations are as large as their diagonal entries";
    if (node)
        reason = fmt::format(
            "mode {} at {:.4g} Hz hardly moves at \"{}\" ({:.2g} % of its largest motion), and nothing else "
            "scales it. Put a force and a sensor where it moves",
            weakest->number, weakest->frequency_hz, weakest->force_name, 100 * weakest->at_force);
    said.emplace_back("mkr_undetermined", fmt::format("{} not determined: {}", fmt::join(names, ", "), reason));
}

} // namespace okid_host
