// SPDX-License-Identifier: MIT
// PURPOSE  the default identification of measured records
// METHOD   docs/how-okid-decides.md: levels, runs and clusters (consensus/), lines, standard deviations from one carrier a rate,
//          then the modal model of what is confident
#include "record_auto.hpp"

#include "ambient_bound.hpp"
#include "carrier.hpp"
#include "changed_output.hpp"
#include "combinations.hpp"
#include "consensus/lines.hpp"
#include "consensus/quantity.hpp"
#include "error.hpp"
#include "fit_deviation.hpp"
#include "late_force.hpp"
#include "looks.hpp"
#include "modal_gain.hpp"
#include "modal_model.hpp"
#include "modal_refine.hpp"
#include "noisy_outputs.hpp"
#include "older_samples.hpp"
#include "picks.hpp"
#include "place_shapes.hpp"
#include "quiet_pieces.hpp"
#include "record_check.hpp"
#include "record_fit.hpp"
#include "record_matrices.hpp"
#include "record_rest.hpp"
#include "request.hpp"
#include "result/hold.hpp"
#include "result/judgement.hpp"
#include "roving.hpp"
#include "screening.hpp"
#include "shape_quantity.hpp"
#include "steadiness.hpp"
#include "unexplained.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/ranges.h>

namespace okid_host {
namespace {

constexpr double periods_of_horizon = 0.025; // 0.75 of a period in 30 samples

std::vector<consensus_mode> worth_telling(std::vector<consensus_mode> modes, bool all) {
    const auto chance = [all](const consensus_mode& mode) {
        return !mode.confident() && (all ? std::max(mode.agreement, mode.found_in) < judgement::worth_listing
                                         : mode.found_in < judgement::doubtful_share);
    };
    modes.erase(std::remove_if(modes.begin(), modes.end(), chance), modes.end());
    return modes;
}

/// The shape in the units of the outputs; `largest` is what its entries were divided by.
std::vector<std::complex<double>> in_units(const std::vector<std::complex<double>>& shape, const double* scale,
                                           std::complex<double>& largest) {
    std::vector<std::complex<double>> out;
    largest = 0;
    for (std::size_t i = 0; i < shape.size(); ++i) {
        out.push_back(shape[i] * scale[i]);
        if (std::abs(out.back()) > std::abs(largest)) largest = out.back();
    }
    for (auto& entry : out) entry /= largest;
    return out;
}

void describe_modes(const std::vector<listed_pair>& found, const std::vector<double>& scale, std::size_t n_u,
                    int sigma_blocks, std::vector<listed_mode>& modes, record_work& work) {
    result_context& context = work.context;
    deviations sigma;
    sigma.replicates = sigma_blocks;
    for (const auto& [mode, carried] : found) {
        std::complex<double> largest;
        auto shape = in_units(mode.shape, scale.data() + n_u, largest);
        const std::size_t n_y = shape.size();
        modes.push_back(
            {mode.frequency_hz, mode.damping_ratio, mode.mpc, mode.emac, std::move(shape), mode.confident()});
        context.verdicts.push_back(verdict_of(mode));
        work.apart.emplace_back(mode.frequency_apart_hz, mode.damping_apart);
        work.carriers.push_back(carried ? carried->by : mode_carrier());
        work.wider.push_back(carried ? carried->wider : widening());
        auto& shifts = work.shifts.emplace_back(carried ? carried->shifts : std::vector<mode_shift>());
        for (mode_shift& shift : shifts)
            for (std::size_t i = 0; i < n_y; ++i) shift.shape[i] *= scale[n_u + i] / largest;
        sigma.frequency_hz.push_back(carried ? carried->frequency_std_hz : NAN);
        sigma.damping_ratio.push_back(carried ? carried->damping_std : NAN);
        for (std::size_t i = 0; i < n_y; ++i) {
            const bool known = carried && !carried->shape_re_std.empty();
            const double unit = scale[n_u + i] / std::abs(largest);
            sigma.shape_re.push_back(known ? carried->shape_re_std[i] * unit : NAN);
            sigma.shape_im.push_back(known ? carried->shape_im_std[i] * unit : NAN);
        }
    }
    if (sigma_blocks > 0) context.sigma = std::move(sigma);
}

[[noreturn]] void throw_no_modes(const std::vector<listed_pair>& found, std::size_t runs) {
    if (runs == 0)
        throw failure(
            exit_no_model,
            "no model: no run of any method was possible: too few samples follow one another without a missing or "
            "screened one, or a force has too few frequencies, as a sine. Record longer, fix the gaps, set sensors to "
            "a range that they do not leave, or see what --method n4sid-cva says");
    std::string seen;
    for (const auto& [mode, carried] : found)
        if (mode.agreement > judgement::worth_listing)
            seen +=
                fmt::format("{}{:.4g} Hz ({})", seen.empty() ? "" : ", ", mode.frequency_hz, fmt::join(mode.why, ", "));
    throw failure(
        exit_no_model,
        fmt::format("no model: none of {} runs of several methods, horizons and rates agree on a mode{}. Record "
                    "longer, excite more, or look at one method with --method n4sid-cva",
                    runs, seen.empty() ? std::string() : "; doubtful: " + seen));
}

/// The band and the modes picked by hand.
void keep_wanted(const record_options& options, std::vector<consensus_mode>& modes) {
    if (!options.band) return;
    modes.erase(std::remove_if(modes.begin(), modes.end(),
                               [&band = *options.band](const consensus_mode& mode) {
                                   return mode.frequency_hz < band.first || mode.frequency_hz > band.second;
                               }),
                modes.end());
}

/// Modes of these numbers are believed; the others stay until all are refined, see keep_numbers().
void believe(const std::vector<int>& numbers, std::vector<listed_pair>& found) {
    for (const int number : numbers) {
        if (number > static_cast<int>(found.size())) continue;
        consensus_mode& mode = found[static_cast<std::size_t>(number) - 1].first;
        mode.picked = true;
        mode.why.clear();
    }
}

/// At the ends of what a record shows: a vibration that it holds only a few times, and one whose half-power band reaches
/// beyond the highest frequency, where what a converter folds back looks like a mode.
void mark_ends(const record_work& work, double fs_hz, double top, std::vector<consensus_mode>& modes) {
    auto longest = static_cast<double>(work.before ? work.before->longest() : 0);
    double begun = static_cast<double>(work.before ? work.before->begun() : 0);
    for (const record_data& record : work.set.records) {
        longest = std::max(longest, begun + static_cast<double>(record.count));
        begun = 0;
    }
    const double seconds = longest / fs_hz;
    for (consensus_mode& mode : modes)
        if (mode.frequency_hz * seconds < judgement::fewest_periods || mode.could == 0 ||
            mode.frequency_hz * (1 + mode.damping_ratio) > top * fs_hz)
            mode.why.emplace_back("band_edge");
}

/// Two groups of outputs stand at 90 degrees in all modes: velocities beside accelerations, say, whose units are not given.
void remark_mixed(const std::vector<bool>& turned, const record_options& options, result_context& context) {
    std::vector<std::string> groups[2];
    for (std::size_t i = 0; i < turned.size(); ++i) groups[turned[i]].push_back(options.outputs[i]);
    context.warnings.emplace_back(
        "mixed_quantities",
        fmt::format("{} and {} stand a quarter of a turn apart in every mode, as velocities and "
                    "accelerations do. Say with --sensing what each measures, for shapes in one quantity",
                    fmt::join(groups[0], ", "), fmt::join(groups[1], ", ")));
}

/// The newest samples fit B and D and show the fits; a force that has ended before them does so in sums alone.
void take_inputs_from_sums(const std::vector<listed_pair>& found, const record_level& level,
                           const std::vector<consensus_run>& runs, record_work& work) {
    std::vector<mode_shift> wanted;
    for (const auto& [mode, carried] : found)
        if (mode.confident()) wanted.push_back({mode.frequency_hz, mode.damping_ratio, mode.shape});
    mode_inputs of_wanted = summed_inputs(level, runs, wanted, static_cast<int>(work.set.n_u),
                                          static_cast<int>(work.set.n_y), work.at_rest);
    work.force_is_older = true;
    work.context.warnings.emplace_back(
        "force_earlier",
        fmt::format("the newest {} samples have less than a twentieth of the energy of a force: {}", work.set.count(),
                    of_wanted.residues.empty()
                        ? "what it does to the modes is not known. End the record with the force"
                        : "what it does to the modes (B, D, M, K, R) comes from the sums of all samples, without "
                          "standard deviations, and no fit is given"));
    if (of_wanted.residues.empty()) return;
    work.inputs.D = std::move(of_wanted.D);
    std::size_t next = 0;
    for (const auto& [mode, carried] : found)
        work.inputs.residues.push_back(mode.confident() ? std::move(of_wanted.residues[next++]) : Eigen::MatrixXcd());
}

/// Of what follows hits: a line is one only where the same records with their force and the silence before it say so, too.
void keep_lines_of(const record_set& struck, const record_options& options, const std::vector<consensus_mode>& unmarked,
                   std::vector<consensus_mode>& modes) {
    const auto same = [](const consensus_mode& a, const consensus_mode& b) { return a.why == b.why; };
    if (std::equal(modes.begin(), modes.end(), unmarked.begin(), same)) return;
    std::vector<double> scale;
    std::vector<consensus_mode> other = unmarked;
    const bool at_rest = struck.n_u > 0;
    mark_lines(
        make_levels(struck.rows_of_each(), struck.n_u, struck.n_y, options.fs_hz, at_rest, options.decimate, scale),
        struck.n_u, struck.n_y, at_rest, other);
    for (std::size_t k = 0; k < modes.size(); ++k)
        if (same(other[k], unmarked[k])) modes[k].why = unmarked[k].why;
}

/// Everything up to the modes, their standard deviations and the shapes.
std::vector<listed_mode> find_modes_agreed(const record_options& options, record_work& work) {
    const auto tell = [&](const char* stage) {
        if (options.stage) options.stage(stage);
    };
    const record_set& set = work.set;
    const auto n_u = static_cast<int>(set.n_u), n_y = static_cast<int>(set.n_y);
    tell("making streams of lower rates");
    std::vector<double> scale;
    auto levels =
        make_levels(set.rows_of_each(), set.n_u, set.n_y, options.fs_hz, work.at_rest, options.decimate, scale);
    if (work.before) work.before->lend_sums(scale, levels);
    const double lowest_hz = periods_of_horizon * levels.back().fs_hz;
    tell("looking with several methods, horizons and rates");
    auto runs = look_at(levels, 0, n_u, n_y, work.at_rest, options.threads);
    std::vector<bool> turned = turned_by(options.sensing);
    const bool known = std::any_of(options.sensing.begin(), options.sensing.end(),
                                   [](int kind) { return kind != OKID_SENSE_ACCELERATION; });
    auto modes = find_agreement(runs, &turned);
    if (look_closer(levels, n_u, n_y, work.at_rest, options.threads, runs)) modes = find_agreement(runs, &turned);
    if (auto zoomed = zoomed_levels(levels, modes, n_u, n_y, work.at_rest); !zoomed.empty()) {
        tell("looking into bands with many modes");
        const std::size_t before = levels.size();
        for (record_level& level : zoomed) levels.push_back(std::move(level));
        auto more = look_at(levels, before, n_u, n_y, work.at_rest, options.threads);
        for (consensus_run& run : more) runs.push_back(std::move(run));
        modes = find_agreement(runs, &turned);
    }
    if (!known && !turned.empty()) remark_mixed(turned, options, work.context);
    const std::vector<consensus_mode> unmarked = modes;
    mark_lines(levels, set.n_u, set.n_y, work.at_rest, modes);
    if (work.struck) keep_lines_of(*work.struck, options, unmarked, modes);
    mark_ends(work, options.fs_hz, levels.front().top, modes);
    keep_wanted(options, modes);
    modes = options.picks.empty() ? worth_telling(std::move(modes), options.all_modes)
                                  : picked_modes(options.picks, runs, modes);
    tell("leaving out one block after the other");
    auto found = carry_all(levels, runs, modes, options, work.at_rest);
    believe(options.modes, found);
    if (options.stabilization) {
        std::vector<consensus_mode> seen;
        for (const listed_pair& one : found) seen.push_back(one.first);
        work.context.poles = poles_of(runs, seen);
    }
    if (std::none_of(found.begin(), found.end(), [](const listed_pair& one) { return one.first.confident(); }))
        throw_no_modes(found, runs.size());
    work.context.band_hz = {found.empty() ? 0.0 : lowest_hz, levels[0].top * levels[0].fs_hz};
    if (options.band) work.context.band_hz = *options.band;
    for (const record_level& level : levels) work.context.rates_hz.push_back(level.fs_hz);
    std::vector<listed_mode> listed;
    describe_modes(found, scale, set.n_u, options.sigma_blocks, listed, work);
    if (work.before && force_is_older(levels[0], n_u, n_y, work.at_rest))
        take_inputs_from_sums(found, levels[0], runs, work);
    work.scale = std::move(scale);
    return listed;
}

/// M, K, R from the model of the modes that are confident; then the model of all listed, its gain and fits.
void make_models(std::vector<listed_mode> listed, const record_options& options, const record_set& decays,
                 record_work& work) {
    std::vector<double> means(work.set.channels(), 0.0);
    if (options.detrend != "none") {
        means = means_of(work.set);
        remove_means(work.set);
    }
    const auto make_model = [&] { // with a force the steps behind need the states it begins with
        make_modal_model(listed, options.fs_hz, work);
        if (work.set.n_u > 0) find_states(work.set, work.model, work.context, &work.states);
    };
    make_model();
    if (options.picks.empty() && mark_combinations(listed, options.fs_hz, work)) make_model();
    if (options.picks.empty() && work.set.n_u > 0 && !work.force_is_older &&
        mark_of_noisy_outputs(listed, options.fs_hz, work))
        make_model();
    deviations_by_fit(listed, work); // with which a refinement by a part is compared
    if (refine_agreed(options, decays, listed, work)) make_model();
    if (options.picks.empty() && doubt_wide(listed, work)) make_model();
    if (keep_numbers(options.modes, listed, work)) make_model();
    remark_unsteady(listed, options.fs_hz, work);
    find_matrices_agreed(options, work);
    find_matrix_deviations(listed, options, work);
    const bool all = std::all_of(listed.begin(), listed.end(), [](const listed_mode& mode) { return mode.in_model; });
    for (listed_mode& mode : listed) mode.in_model = true;
    if (!all) make_modal_model(listed, options.fs_hz, work);
    work.refined->mean = std::move(means);
    work.model.mean = work.refined->mean.data();
    find_gain(work);
    fit_records(work.set, work.model, work.context, &work.states);
    if (!options.by_hand()) remark_unexplained(listed, options.fs_hz, work);
    if (work.force_is_older) {
        work.context.simulation_percent.reset();
        work.context.prediction_percent.reset();
        return;
    }
    remark_noisy_outputs(work.context);
    remark_low_fit(*work.context.prediction_percent, false, work.context); // a simulation has only the modes listed
}

/// The options without the outputs that are left out.
record_options without_outputs(record_options options, const std::vector<bool>& kept) {
    std::vector<std::string> outputs;
    std::vector<mass_channel> places;
    std::vector<int> sensing;
    for (std::size_t k = 0; k < kept.size(); ++k) {
        if (!kept[k]) continue;
        outputs.push_back(options.outputs[k]);
        if (!options.mass.outputs.empty()) places.push_back(options.mass.outputs[k]);
        if (!options.sensing.empty()) sensing.push_back(options.sensing[k]);
    }
    options.sensing = std::move(sensing);
    options.outputs = std::move(outputs);
    options.mass.outputs = std::move(places);
    std::vector<mass_channel> standing;
    for (std::size_t k = 0; k < kept.size() && !options.placed.outputs.empty(); ++k)
        if (kept[k]) standing.push_back(options.placed.outputs[k]);
    options.placed.outputs = std::move(standing);
    return options;
}

/// @param struck  the records of which `set` is what follows a blow, or nothing
one_look look_once(record_set set, bool at_rest, record_options options, const record_work& about,
                   const record_set* struck) {
    one_look out;
    if (set.n_u == 0) options.inputs.clear();
    out.work.struck = struck;
    out.work.before = struck ? nullptr : about.before;
    out.work.at_rest = at_rest;
    out.work.context = about.context;
    out.work.set = std::move(set);
    try {
        out.listed = find_modes_agreed(options, out.work);
    } catch (const failure& why) {
        if (why.code != exit_no_model) throw;
        out.fault = std::current_exception();
    }
    return out;
}

/// The options by which two sets of records are compared: no frequencies are picked.
record_options unpicked(record_options options) {
    options.picks.clear();
    return options;
}

/// The same look again, its modes by their numbers.
one_look picked_in(record_work seen, const record_options& options, const record_work& about) {
    return look_once(std::move(seen.set), seen.at_rest, options, about, seen.struck);
}

/// The look that is believed, as the result: frequencies that were picked are looked for in it.
std::vector<listed_mode> take_look(one_look best, const record_options& options, record_work& work) {
    if (!options.picks.empty()) best = picked_in(std::move(best.work), options, work);
    if (best.listed.empty()) std::rethrow_exception(best.fault);
    work = std::move(best.work);
    work.struck = nullptr;
    return best.listed;
}

/// Of records struck at different places: poles and shapes from all together, B and D from those of each place. What follows hits
/// needs no input a place; with it modes are seen that die away soon, and the silence before. Who believes more modes counts.
std::vector<listed_mode> find_struck(const record_options& options, const record_set& decays, record_work& work) {
    record_options seen = options;
    seen.inputs = work.context.inputs = place_names(options.inputs.front(), options.hits);
    record_set struck = std::exchange(work.set, one_column_a_place(work.set, options.hits));
    if (!are_blows(struck)) return find_modes_agreed(seen, work);
    one_look best = look_once(free_decays(struck), false, unpicked(seen), work, &work.set),
             forced = look_once(work.set, true, unpicked(seen), work, nullptr); // nothing moved before
    if (forced.believed() > best.believed()) best = std::move(forced);
    const bool at_rest = work.at_rest;
    std::vector<listed_mode> listed = take_look(std::move(best), seen, work);
    refine_decays(decays, options, listed, work);
    if (options.detrend != "none") {
        remove_means(struck);
        rest_forces(struck);
    }
    if (options.picks.empty()) doubt_scattered(options.hits, options.fs_hz, struck, listed, work.context.verdicts);
    keep_numbers(options.modes, listed, work);
    work.set = {};
    work.set.n_y = struck.n_y;
    make_modal_model(listed, options.fs_hz, work);
    work.set = std::move(struck);
    work.at_rest = at_rest;
    fit_places(listed, options.hits, options.fs_hz, work);
    remark_low_fit(*work.context.simulation_percent, true, work.context);
    return listed;
}

/// Without a force: a train drives the structure at frequencies of its own, what follows it is a free decay, as after a release.
std::vector<listed_mode> find_after_events(const record_set& pieces, const record_options& options, record_work& work) {
    one_look whole = look_once(work.set, work.at_rest, unpicked(options), work, nullptr);
    if (decay_freely(whole.listed, work.set, options)) return take_look(std::move(whole), options, work);
    one_look part = look_once(pieces, false, unpicked(options), work, &work.set);
    std::vector<std::string> alone;
    const double ratio = deviations_over(part, whole, alone);
    if (pieces.records.size() == 1 ? !decay_freely(part.listed, pieces, options) : !(ratio < judgement::sharper))
        return take_look(std::move(whole), options, work);
    part.work.context.warnings.push_back(remark_pieces(pieces, work.set, options.fs_hz, ratio, alone));
    return take_look(std::move(part), options, work);
}

/// With a force that rests between its hits: what its channel says there is noise where the outputs do not follow it.
std::vector<listed_mode> find_with_rest(const record_options& options, record_work& work) {
    record_set quiet = work.set.n_u > 0 && !work.before ? work.set : record_set();
    if (!rest_between_hits(quiet)) return find_modes_agreed(options, work);
    one_look whole = look_once(work.set, work.at_rest, unpicked(options), work, nullptr);
    const auto left = [&](const record_set& set) { return power_left(whole.listed, set, options); };
    const double ratio = whole.listed.empty() ? 1 : left(quiet) / left(work.set);
    if (!(ratio < judgement::explains_better)) return take_look(std::move(whole), options, work);
    one_look part = look_once(std::move(quiet), work.at_rest, unpicked(options), work, nullptr);
    if (part.believed() < whole.believed()) return take_look(std::move(whole), options, work);
    part.work.context.warnings.emplace_back(
        "force_window",
        fmt::format("the force rests between its hits, and the result is of the record without the noise of "
                    "its channel there: that leaves {:.2g} times as much of the outputs unexplained",
                    ratio));
    return take_look(std::move(part), options, work);
}

std::vector<listed_mode> find_modes(const record_options& options, record_work& work) {
    const record_set pieces = after_events(work.set);
    return pieces.records.empty() ? find_with_rest(options, work) : find_after_events(pieces, options, work);
}

/// Of records struck at different places: M, K and R where there is a mode for each, and shapes over the places.
void find_placed(const std::vector<listed_mode>& listed, const record_options& options, record_work& work) {
    record_options wanted = options;
    wanted.modes_without_matrices = true; // the places were given for the shapes
    wanted.mass = matrices_of_places(listed, options, work.context.warnings);
    find_matrices_agreed(wanted, work);
    if (work.set.n_u == 1) place_shapes(listed, options, work); // else the force never rests
}

} // namespace

record_result identify_auto(record_set records, const record_options& given, const older_samples* before) {
    record_work work;
    work.set = std::move(records);
    remarks repeated;
    remark_repeated(work.set, repeated);
    if (const std::string text = repeated_rows(work.set, given.fs_hz); !text.empty())
        throw failure(exit_no_model, fmt::format("no model: {}. Or look at one method with --method n4sid-cva", text));
    std::unique_ptr<older_samples> split;
    if (!before && given.hits.empty()) split = split_older(work.set, given);
    work.before = before && before->samples() > 0 ? before : split.get();
    const missing_count asked = count_missing(work.set);
    check_measured(asked, work.set, given);
    screened_outputs screened = screen_outputs(work.set, given.outputs);
    const bool all = std::all_of(screened.kept.begin(), screened.kept.end(), [](bool kept) { return kept; });
    if (!all) work.set = without_outputs(work.set, screened.kept);
    const record_options options = all ? given : without_outputs(given, screened.kept);
    if (work.before && !all) {
        split = std::make_unique<older_samples>(work.before->without_outputs(options, screened.kept));
        work.before = split.get();
    }
    const std::vector<bool> moved = work.before ? work.before->moved() : std::vector<bool>();
    check_moving(work.set, options, !screened.said.empty(), moved);
    if (std::find(moved.begin(), moved.end(), true) == moved.end())
        check_different_inputs(moments_of(work.set), options); // else they need not have been alike before
    const missing_count missing = count_missing(work.set);
    work.context = describe_records(work.set, options, missing);
    if (asked.gaps == 0) work.context.warnings.clear(); // the gaps are those screened
    work.context.warnings.insert(work.context.warnings.end(), repeated.begin(), repeated.end());
    if (work.before)
        work.before->add_counts(asked.gaps > 0 ? missing : missing_count(), work.set.count(), work.context);
    work.context.warnings.insert(work.context.warnings.end(), screened.said.begin(), screened.said.end());
    remark_changed_output(work.set, work.context);
    if (!work.before) bring_force_forward(work.set, options.fs_hz, work.context.warnings);
    work.at_rest = begin_at_rest(work.set, options);
    if (work.at_rest) work.context.start = "rest";
    if (options.detrend == "linear") detrend_linear(work.set, options);
    const bool roving = !options.hits.empty();
    const record_set decays = after_hits(work.set);
    const std::vector<listed_mode> listed = roving ? find_struck(options, decays, work) : find_modes(options, work);
    if (work.set.n_u == 0 && work.context.sigma)
        keep_to_ambient_bound(
            work.set, options.fs_hz * static_cast<double>(work.set.count()) / static_cast<double>(work.context.samples),
            listed, work.wider, *work.context.sigma);
    if (options.stage) options.stage("simulating the model");
    const bool placed = work.model.n_u > 0; // by find_struck
    if (!placed) make_models(listed, options, decays, work);
    remark_contradiction(listed, options.hits, options.fs_hz, work);
    if (placed) find_placed(listed, options, work);
    if (!all) put_back_outputs(screened.kept, work);
    work.context.outputs = given.outputs;
    describe_dofs(given, work.context);
    record_result result;
    result.model = kept_model(work.model);
    result.context = std::move(work.context);
    result.carriers = std::move(work.carriers);
    result.scale = std::move(work.scale);
    shapes_in_one_quantity(given.sensing, result.model, result.context);
    shapes_without_delays(result.model, result.context);
    return result;
}

} // namespace okid_host
