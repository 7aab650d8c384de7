// SPDX-License-Identifier: MIT
// PURPOSE  records to modes by way of their correlations
// METHOD   responses or half-spectra of each set-up from its sums (lag_responses), over as many lags as the slowest mode found
//          asks for; modes from all set-ups together (response_modes). Standard deviations: the sums without one part each;
//          of several set-ups the scatter between them, each fitted alone from the common poles. Model of one record: these modes,
//          B and D by output error, the gain of its innovations
#include "identify_lags.hpp"

#include "consensus/lines.hpp"
#include "error.hpp"
#include "files/nearest_name.hpp"
#include "lag_responses.hpp"
#include "matrix_fraction.hpp"
#include "record/ambient_bound.hpp"
#include "record/modal_gain.hpp"
#include "record/modal_model.hpp"
#include "record/record_check.hpp"
#include "record/record_fit.hpp"
#include "record/record_rest.hpp"
#include "record/roving.hpp"
#include "response_modes.hpp"
#include "result/method.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <fmt/ranges.h>

namespace okid_host {
namespace {

constexpr std::size_t first_lags = 1024, least_lags = 128, most_lags = 8192; // powers of two
constexpr long long rows_per_lag = 8;
constexpr double periods_wanted = 10;        // of the slowest mode
constexpr double decays_wanted = 2;          // with a force: of the mode that rings longest
constexpr std::size_t record_references = 6; // of one record; more say the same again
constexpr std::size_t parts_of_record = 10;
constexpr int refined_steps = 4, most_rounds = 3;
constexpr double steady_frequency = 0.02, steady_damping = 0.5; // deviations over f and zeta: noise has no steady poles

struct lag_work {
    std::vector<set_up> set_ups;
    record_options options;
    std::vector<std::string> references;
    joint_responses joint;
    double constant_s = 0, top_hz = 0;
};

bool struck(const lag_work& work) { return !work.options.inputs.empty(); }

std::vector<std::string> channels_of(const lag_work& work, const set_up& one) {
    std::vector<std::string> out = work.options.inputs;
    out.insert(out.end(), one.outputs.begin(), one.outputs.end());
    return out;
}

/// The channels that every other one is correlated with.
std::vector<std::size_t> reference_channels(const lag_work& work, const set_up& one) {
    std::vector<std::size_t> out;
    if (struck(work)) {
        for (std::size_t i = 0; i < one.set.n_u; ++i) out.push_back(i);
        return out;
    }
    const std::size_t n = work.references.size(), count = std::min(n, record_references);
    for (std::size_t k = 0; k < count; ++k)
        out.push_back(static_cast<std::size_t>(place_in(one.outputs, work.references[k * n / count])));
    return out;
}

std::vector<response_set> respond(lag_work& work, const std::vector<lag_sums>& sums) {
    std::vector<response_set> out;
    double top = 0;
    for (std::size_t j = 0; j < sums.size(); ++j) {
        lag_responses one = responses_of(sums[j], work.options.fs_hz, channels_of(work, work.set_ups[j]));
        work.constant_s = one.constant_s;
        top = std::max(top, one.top_hz);
        out.push_back(std::move(one.set));
    }
    if (work.top_hz == 0) work.top_hz = top; // the same lines whatever is left out
    const auto band = work.options.band.value_or(std::pair{0.0, work.top_hz});
    for (response_set& set : out) set = cut_band(set, band.first, band.second);
    return out;
}

/// Set-ups under the same measured forces are one set of responses; others keep columns of their own.
joint_responses join(const lag_work& work, std::vector<response_set> sets) {
    joint_responses out;
    out.sample_s = 1 / work.options.fs_hz;
    out.outputs = work.options.outputs;
    out.references = work.references;
    std::vector<std::string> names;
    for (const set_up& one : work.set_ups) names.push_back(one.set.records.front().path);
    if (struck(work)) {
        sets = {join_set_ups(sets, names)};
        out.references = sets.front().outputs;
    }
    out.sets = std::move(sets);
    return out;
}

std::size_t bounded(double lags, std::size_t most) {
    std::size_t out = least_lags;
    while (static_cast<double>(out) < lags && 2 * out <= most) out *= 2;
    return out;
}

/// As many lags as the modes ask for.
std::size_t wanted_lags(const lag_work& work, const response_modes& found, std::size_t most) {
    double wanted = 0;
    for (const consensus_mode& mode : found.modes) {
        if (!mode.confident()) continue;
        wanted = std::max(wanted, periods_wanted * work.options.fs_hz / mode.frequency_hz);
        if (struck(work))
            wanted = std::max(wanted,
                              decays_wanted * work.options.fs_hz / (2 * M_PI * mode.frequency_hz * mode.damping_ratio));
    }
    return bounded(wanted, most);
}

void take_window_out(double constant_s, response_modes& found) {
    for (consensus_mode& mode : found.modes) take_window_out(constant_s, "tone", mode);
}

std::vector<lag_sums> sums_of(const lag_work& work, std::size_t lags) {
    std::vector<lag_sums> out;
    for (const set_up& one : work.set_ups)
        out.push_back(sum_lags(one.set, reference_channels(work, one), lags, 1).front());
    return out;
}

/// Modes at the lags that they ask for; poles with the window in them.
response_modes find_modes(lag_work& work, std::size_t& lags) {
    std::size_t rows = SIZE_MAX;
    for (const set_up& one : work.set_ups) rows = std::min(rows, one.set.count());
    const std::size_t fit = rows / rows_per_lag;
    const std::size_t most = std::min(most_lags, bounded(static_cast<double>(fit), fit));
    lags = std::min(first_lags, most);
    response_modes out;
    for (int round = 0; round < most_rounds; ++round) {
        work.joint = join(work, respond(work, sums_of(work, lags)));
        std::size_t next = most;
        try {
            out =
                find_response_modes(work.joint, work.options.all_modes, work.options.modes, work.options.stabilization);
            response_modes own = out;
            take_window_out(work.constant_s, own);
            next = wanted_lags(work, own, most);
        } catch (const failure&) {
            if (lags == most || round + 1 == most_rounds) throw;
        }
        if (next == lags) break;
        if (round + 1 < most_rounds) lags = next;
    }
    return out;
}

/// What other sums of the same structure say, from the poles of all.
struct replicate {
    std::vector<consensus_mode> modes;
    std::vector<residue_shape> shapes;
};

/// By the factor that brings a shape nearest to another, over the entries that it has.
void scale_to(const std::vector<std::complex<double>>& to, std::vector<std::complex<double>>& shape) {
    std::complex<double> along = 0;
    double power = 0;
    for (std::size_t o = 0; o < to.size(); ++o)
        if (std::isfinite(shape[o].real()) && std::isfinite(to[o].real()))
            along += std::conj(shape[o]) * to[o], power += std::norm(shape[o]);
    for (auto& entry : shape) entry *= along / std::max(power, 1e-300);
}

replicate refit(const lag_work& work, const joint_responses& from, const response_modes& whole) {
    std::vector<std::complex<double>> poles;
    for (const consensus_mode& mode : whole.modes) poles.push_back(pole_of(mode));
    refined_modes found = fit_response_modes(from, poles, refined_steps);
    replicate out{whole.modes, std::move(found.shapes)};
    for (std::size_t k = 0; k < out.modes.size(); ++k) {
        scale_to(whole.shapes[k].shape, out.shapes[k].shape);
        const std::complex<double> pole = found.poles[k];
        out.modes[k].frequency_hz = std::abs(pole) / (2 * M_PI);
        out.modes[k].damping_ratio = -pole.real() / std::abs(pole);
        take_window_out(work.constant_s, "tone", out.modes[k]);
    }
    return out;
}

double spread(const std::vector<double>& values, double factor) {
    double mean = 0, square = 0;
    for (const double x : values) mean += x / static_cast<double>(values.size());
    for (const double x : values) square += (x - mean) * (x - mean);
    return std::sqrt(factor * square);
}

/// @param factor  of the sum of squares about the mean
void put_spread(const std::vector<replicate>& all, double factor, response_modes& to) {
    to.sigma.replicates = static_cast<int>(all.size());
    const auto over = [&](auto of) {
        std::vector<double> values;
        for (const replicate& one : all) values.push_back(of(one));
        return spread(values, factor);
    };
    for (std::size_t k = 0; k < to.modes.size(); ++k) {
        to.sigma.frequency_hz[k] = over([&](const replicate& one) { return one.modes[k].frequency_hz; });
        to.sigma.damping_ratio[k] = over([&](const replicate& one) { return one.modes[k].damping_ratio; });
        for (std::size_t o = 0; o < to.shapes[k].shape.size(); ++o) {
            to.sigma.shape_re.push_back(over([&](const replicate& one) { return one.shapes[k].shape[o].real(); }));
            to.sigma.shape_im.push_back(over([&](const replicate& one) { return one.shapes[k].shape[o].imag(); }));
        }
    }
}

/// Scatter between the set-ups, or of the sums without one part of the record each.
void find_deviations(lag_work& work, std::size_t lags, response_modes& found) {
    std::vector<replicate> all;
    if (work.set_ups.size() > 1) {
        for (const set_up& one : work.set_ups) {
            lag_work alone{{one}, work.options, work.references, {}, 0, work.top_hz};
            all.push_back(refit(work, join(alone, respond(alone, sums_of(alone, lags))), found));
        }
        return put_spread(all, 1.0 / (static_cast<double>(all.size()) - 1), found);
    }
    const auto parts =
        sum_lags(work.set_ups.front().set, reference_channels(work, work.set_ups.front()), lags, parts_of_record);
    lag_sums whole = parts.front();
    for (std::size_t b = 1; b < parts.size(); ++b) whole = whole + parts[b];
    for (const lag_sums& part : parts) {
        if ((whole.pairs - part.pairs).minCoeff() < 1) continue; // it holds all there is
        all.push_back(refit(work, join(work, respond(work, {whole - part})), found));
    }
    const auto n = static_cast<double>(all.size());
    if (all.size() > 1) put_spread(all, (n - 1) / n, found);
}

/// The modes that are lines of machines in this set-up, by the rule of the default; their codes.
std::vector<consensus_mode> lines_in(const lag_work& work, const set_up& one, const response_modes& found) {
    const record_set& set = one.set;
    bool at_rest = struck(work);
    for (const record_data& record : set.records) at_rest = at_rest && begins_at_rest(set, record);
    std::vector<double> scale;
    const auto levels = make_levels(set.rows_of_each(), set.n_u, set.n_y, work.options.fs_hz, at_rest, 1, scale);
    std::vector<consensus_mode> out = found.modes;
    for (std::size_t k = 0; k < out.size(); ++k) {
        out[k].why.clear();
        out[k].shape.assign(set.n_y, 0);
        for (std::size_t o = 0; o < set.n_y; ++o) {
            const auto place = static_cast<std::size_t>(place_in(work.options.outputs, one.outputs[o]));
            const std::complex<double> entry = found.shapes[k].shape[place] / scale[set.n_u + o];
            if (std::isfinite(entry.real()) && std::isfinite(entry.imag())) out[k].shape[o] = entry;
        }
    }
    mark_lines(levels, set.n_u, set.n_y, at_rest, out);
    return out;
}

/// A line in every set-up is no mode, unless it was picked by hand.
void mark_lines_of_machines(const lag_work& work, response_modes& found) {
    if (!work.options.modes.empty()) return;
    std::vector<std::size_t> times(found.modes.size());
    for (const set_up& one : work.set_ups) {
        const auto here = lines_in(work, one, found);
        for (std::size_t k = 0; k < here.size(); ++k)
            if (!here[k].why.empty() && ++times[k] == work.set_ups.size() && found.modes[k].confident())
                found.modes[k].why.push_back(here[k].why.front());
    }
}

/// The window makes noise look like modes of its own decay; without a part of the sums they lie elsewhere.
void mark_unsteady(const lag_work& work, response_modes& found) {
    const double top = work.joint.sets.front().frequency_hz.back();
    std::string seen;
    for (std::size_t k = 0; k < found.modes.size(); ++k) {
        consensus_mode& mode = found.modes[k];
        const bool steady = found.sigma.frequency_hz[k] < steady_frequency * mode.frequency_hz &&
                            found.sigma.damping_ratio[k] < steady_damping * mode.damping_ratio;
        const bool listed = has_code(mode.why, "wide_sigma");
        if (!steady && !listed && work.options.modes.empty()) mode.why.emplace_back("wide_sigma");
        if (mode.frequency_hz > top) mode.why.emplace_back("band_edge");
        seen += fmt::format("{}{:.4g} Hz ({})", seen.empty() ? "" : ", ", mode.frequency_hz, fmt::join(mode.why, ", "));
    }
    if (std::none_of(found.modes.begin(), found.modes.end(), [](const auto& mode) { return mode.confident(); }))
        throw failure(exit_no_model,
                      fmt::format("no model: no mode of the correlations is stable when a part of the record is left "
                                  "out; doubtful: {}. Record longer, or choose a band with --band",
                                  seen));
}

/// The model of one record, or of the shapes alone.
void make_model(lag_work& work, const response_modes& found, record_work& to) {
    std::vector<listed_mode> listed;
    for (std::size_t k = 0; k < found.modes.size(); ++k) {
        const consensus_mode& mode = found.modes[k];
        listed.push_back(
            {mode.frequency_hz, mode.damping_ratio, mode.mpc, NAN, found.shapes[k].shape, mode.confident()});
        to.context.verdicts.push_back(verdict_of(mode));
    }
    if (work.options.sigma_blocks > 0 && !found.sigma.shape_re.empty()) to.context.sigma = found.sigma;
    to.context.stable = found.stable;
    to.set.n_y = work.options.outputs.size();
    if (work.set_ups.size() == 1) to.set = std::move(work.set_ups.front().set);
    make_modal_model(listed, work.options.fs_hz, to);
    if (work.set_ups.size() > 1) return;
    if (!struck(work) && to.context.sigma)
        keep_to_ambient_bound(to.set, work.options.fs_hz, listed, {}, *to.context.sigma);
    if (struck(work)) fit_records(to.set, to.model, to.context);
    find_gain(to);
    fit_records(to.set, to.model, to.context);
    remark_low_fit(*to.context.prediction_percent, false, to.context);
}

/// Each set-up less its means or lines, checked. @return what is known before anything is computed
result_context prepare(lag_work& work) {
    if (work.options.mass.wanted() || work.options.placed.wanted())
        throw failure(exit_usage,
                      "--input-dofs: M, K and R belong to --method auto or okid-era, found with plscf: it gives "
                      "modes");
    result_context out;
    missing_count missing;
    long long samples = 0;
    for (set_up& one : work.set_ups) {
        record_options own = work.options;
        own.outputs = one.outputs;
        const missing_count here = count_missing(one.set);
        check_measured(here, one.set, own);
        check_moving(one.set, own);
        check_different_outputs(one.set, own);
        check_different_inputs(moments_of(one.set), own);
        missing.samples += here.samples;
        missing.gaps += here.gaps;
        one.set.complete = here.samples == 0;
        samples += static_cast<long long>(one.set.count());
        if (own.detrend == "linear") detrend_linear(one.set, own);
        remove_means(one.set);
        const std::size_t whole = one.set.count() - static_cast<std::size_t>(here.samples);
        if (whole < least_lags * static_cast<std::size_t>(rows_per_lag))
            throw failure(exit_no_model, fmt::format("no model: {} has {} samples{}, method plscf takes {}",
                                                     one.set.records.front().path, whole,
                                                     here.samples > 0 ? " of which no channel is missing" : "",
                                                     least_lags * static_cast<std::size_t>(rows_per_lag)));
    }
    out = describe_records(work.set_ups.front().set, work.options, missing);
    out.samples = samples;
    if (work.set_ups.size() > 1) {
        out.records = static_cast<int>(work.set_ups.size());
        out.inputs.clear();
        for (const set_up& one : work.set_ups)
            out.set_ups.push_back({file_name(one.set.records.front().path), one.outputs});
    }
    return out;
}

} // namespace

record_result identify_set_ups_together(std::vector<set_up> set_ups, const record_options& options,
                                        const std::vector<std::string>& references) {
    lag_work work{std::move(set_ups), options, {}, {}, 0, 0};
    work.options.method = lag_method;
    record_work to;
    to.context = prepare(work);
    to.context.all_modes = options.all_modes;
    if (options.stage) options.stage("summing lagged products");
    std::vector<response_set> sets(work.set_ups.size());
    for (std::size_t j = 0; j < sets.size(); ++j) sets[j].outputs = work.set_ups[j].outputs;
    work.references = references.empty() ? common_outputs(sets) : references;
    std::size_t lags = 0;
    response_modes found = find_modes(work, lags);
    if (options.stage) options.stage("leaving out one part after the other");
    find_deviations(work, lags, found);
    take_window_out(work.constant_s, found);
    mark_lines_of_machines(work, found);
    mark_unsteady(work, found);
    to.context.band_hz = {work.joint.sets.front().frequency_hz.front(), work.joint.sets.front().frequency_hz.back()};
    make_model(work, found, to);
    record_result result;
    result.model = kept_model(to.model);
    result.context = std::move(to.context);
    return result;
}

record_result identify_by_method(record_set records, const record_options& options) {
    if (options.method != lag_method) return identify_records(std::move(records), options);
    check_hits(records, options.hits);
    if (!options.hits.empty()) throw failure(exit_usage, "--hit-dofs belongs to --method auto, found with plscf");
    std::vector<set_up> one;
    one.push_back({std::move(records), options.outputs});
    return identify_set_ups_together(std::move(one), options, {});
}

} // namespace okid_host
