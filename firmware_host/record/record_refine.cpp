// SPDX-License-Identifier: MIT
// PURPOSE  maximum-likelihood refinement of a model, and the delays of its outputs
// METHOD   okid/refine.h over the longest driven stretches; the better one of start and refined model stays
#include "record_refine.hpp"

#include "record_fit.hpp"
#include "whitening.hpp"

#include <okid/modal.h>
#include <okid/refine.h>
#include <okid/steps/skew.h>

#include <algorithm>
#include <cmath>
#include <complex>
#include <fmt/format.h>

namespace okid_host {
namespace {

constexpr int blocks = 20, draws = 64; ///< of a record; from sums, and of free decays
constexpr std::size_t most_runs = 32;
constexpr double same_percent = 0.01; ///< fits closer than this are the same
constexpr double lost_percent = 0.5;  ///< a loss of prediction worth a remark

std::size_t size_of(int n) { return static_cast<std::size_t>(n); }

/// Samples of the shortest stretch that serves.
std::size_t shortest_run(const record_work& work) { return std::max<std::size_t>(20, 2 * size_of(work.model.n_z)); }

/// Stretches without a missing input, the longest first, where there are too many those alone.
std::vector<std::pair<const record_data*, stretch>> longest_stretches(const record_work& work) {
    std::vector<std::pair<const record_data*, stretch>> all;
    for (const record_data& record : work.set.records)
        for (const stretch& piece : stretches_of(work.set, record, shortest_run(work)))
            all.emplace_back(&record, piece);
    std::sort(all.begin(), all.end(), [](const auto& a, const auto& b) { // then as they came
        if (a.second.count != b.second.count) return a.second.count > b.second.count;
        return a.first != b.first ? a.first < b.first : a.second.first < b.second.first;
    });
    all.resize(std::min(all.size(), most_runs));
    return all;
}

/// These stretches one after the other; `most` samples of them.
struct driven_runs : sample_runs {
    explicit driven_runs(const record_work& work, std::size_t most = SIZE_MAX) {
        const record_set& set = work.set;
        for (const auto& [record, piece] : longest_stretches(work)) {
            const std::size_t count = std::min(piece.count, most);
            if (count < shortest_run(work)) break;
            most -= count;
            counts.push_back(static_cast<std::int32_t>(count));
            const double* rows = set.rows(*record) + piece.first * set.channels();
            samples.insert(samples.end(), rows, rows + count * set.channels());
        }
    }
};

/// Mean over the outputs; an output that cannot be simulated counts as no fit at all.
double mean_of(const std::optional<std::vector<double>>& percent) {
    double sum = 0;
    for (const double value : percent.value_or(std::vector<double>{})) sum += std::isfinite(value) ? value : -INFINITY;
    return percent && !percent->empty() ? sum / static_cast<double>(percent->size()) : -INFINITY;
}

/// The library's refinement and what it made.
class refiner {
  public:
    /// @param iterations  at most, 0 = as many as it takes; others leave no replicates
    refiner(const sample_runs& runs, const okid_identified_t& start, bool constants, int iterations = 0)
        : blocks_(iterations > 0  ? 0
                  : start.n_u > 0 ? blocks
                                  : draws),
          n_u_(start.n_u), n_y_(start.n_y), n_z_(start.n_z) {
        open(static_cast<std::int32_t>(runs.counts.size()), iterations, constants);
        const okid_model_t model = model_view(start);
        if (status >= 0) status = okid_refine_run(refine_, &model, runs.counts.data(), runs.samples.data(), &found);
    }
    refiner(const okid_correlation_sums_t& sums, const okid_identified_t& start, bool constants)
        : blocks_(draws), n_u_(start.n_u), n_y_(start.n_y), n_z_(start.n_z) {
        open(0, 0, constants);
        const okid_model_t model = model_view(start);
        if (status >= 0) status = okid_refine_from_correlation(refine_, &model, &sums, &found);
    }

    std::vector<replicate_model> replicates() {
        std::vector<replicate_model> out;
        for (int b = 0; b < blocks_; ++b) {
            replicate_model one;
            one.share = 1.0 / blocks_;
            one.n_u = n_u_;
            one.n_y = n_y_;
            one.A.resize(size_of(n_z_) * size_of(n_z_));
            one.B.resize(size_of(n_z_) * size_of(n_u_));
            one.C.resize(size_of(n_y_) * size_of(n_z_));
            one.D.resize(size_of(n_y_) * size_of(n_u_));
            double* const B = n_u_ > 0 ? one.B.data() : one.A.data(); // of no inputs no number is written
            double* const D = n_u_ > 0 ? one.D.data() : one.C.data();
            if (okid_refine_replicate(refine_, b, one.A.data(), B, one.C.data(), D) >= 0) one.n_z = n_z_;
            out.push_back(std::move(one));
        }
        return out;
    }

    okid_status_t status = OKID_OK;
    okid_refined_t found{};
    std::vector<double> noise; ///< deviations at the outputs, where `found` has those behind a filter

  private:
    void open(std::int32_t runs, int iterations, bool constants) {
        const okid_refine_config_t config{n_u_, n_y_, n_z_, runs, blocks_, iterations, constants ? 1 : 0};
        block_.resize(okid_refine_memsize(&config));
        status = okid_refine_create(&refine_, &config, block_.data(), block_.size());
    }

    int blocks_, n_u_, n_y_, n_z_;
    std::vector<std::byte> block_;
    okid_refine_t* refine_ = nullptr;
};

std::complex<double> pole_of(double frequency, double damping) {
    return std::polar(frequency, std::acos(-std::clamp(damping, -1.0, 1.0)));
}

/// Modes of the model in `to`; each keeps the EMAC of the nearest pole of `start`. @return false: there are none
bool find_modes(const okid_identified_t& start, refined_arrays& to, okid_identified_t& model) {
    const std::size_t most = size_of(model.n_z / 2);
    for (auto* column : {&to.frequency, &to.damping, &to.mpc, &to.emac, &to.cmi}) column->assign(most, 0);
    for (auto* shape : {&to.shape_re, &to.shape_im}) shape->assign(most * size_of(model.n_y), 0);
    std::vector<std::byte> work(okid_modal_memsize(model.n_y, model.n_z));
    const okid_model_t view{model.n_u, model.n_y, model.n_z, model.A, model.B, model.C, model.D, model.K};
    okid_modes_t modes{};
    modes.frequency_hz = to.frequency.data();
    modes.damping_ratio = to.damping.data();
    modes.mpc = to.mpc.data();
    modes.shape_re = to.shape_re.data();
    modes.shape_im = to.shape_im.data();
    if (okid_modal_analyse(&view, model.dt, &modes, work.data(), work.size()) < 0) return false;
    model.mode_count = modes.count;
    model.model_radius = modes.radius;
    for (std::size_t k = 0; k < size_of(model.mode_count); ++k) {
        double nearest = INFINITY;
        for (int j = 0; j < start.mode_count; ++j) {
            const double distance = std::abs(pole_of(to.frequency[k], to.damping[k]) -
                                             pole_of(start.frequency_hz[j], start.damping_ratio[j]));
            if (distance >= nearest) continue;
            nearest = distance;
            to.emac[k] = start.emac[j];
        }
        to.cmi[k] = to.emac[k] * to.mpc[k];
    }
    return true;
}

/// `start` with the refined model in its place, the arrays in `to`.
bool make_model(const okid_identified_t& start, const okid_refined_t& found, refined_arrays& to,
                okid_identified_t& model) {
    const std::size_t n_z = size_of(start.n_z), n_u = size_of(start.n_u), n_y = size_of(start.n_y);
    to.A.assign(found.A, found.A + n_z * n_z);
    to.B.assign(found.B, found.B + n_z * n_u);
    to.C.assign(found.C, found.C + n_y * n_z);
    to.D.assign(found.D, found.D + n_y * n_u);
    to.K.assign(n_z * n_y, 0);
    if (start.K != nullptr) std::copy_n(start.K, to.K.size(), to.K.data());
    model = start;
    model.A = to.A.data();
    model.B = to.B.data();
    model.C = to.C.data();
    model.D = to.D.data();
    model.K = to.K.data();
    if (!find_modes(start, to, model)) return false;
    to.show_modes(model);
    find_markov(model_view(model), model.markov_count, to.markov);
    model.markov = to.markov.data();
    return true;
}

struct record_trial {
    okid_identified_t model{};
    result_context context;
};

/// The fits with the Kalman gain of the start, or with none (the model alone) where that predicts better.
void choose_gain(const record_set& set, double before, refined_arrays& arrays, record_trial& trial) {
    trial.model.warnings &= ~std::uint32_t{OKID_NOTE_PREDICTOR_UNSTABLE};
    fit_records(set, trial.model, trial.context);
    const double now = mean_of(trial.context.prediction_percent);
    if (std::isfinite(now) && now >= before - same_percent) return;
    std::vector<double> gain(arrays.K.size(), 0.0);
    std::swap(gain, arrays.K);
    trial.model.K = arrays.K.data();
    const result_context with_gain = trial.context;
    fit_records(set, trial.model, trial.context);
    if (mean_of(trial.context.prediction_percent) > now) return;
    std::swap(gain, arrays.K);
    trial.model.K = arrays.K.data();
    trial.context = with_gain;
}

void remark_on(const refinement& found, double before, double after, remarks& said) {
    if (!found.converged) said.push_back(refine_unconverged(found));
    if (after < before - lost_percent)
        said.emplace_back("prediction_lower",
                          fmt::format("the one-step prediction of the refined model is {:.2f} % on average instead of "
                                      "{:.2f} %: refinement minimises the simulation error. For a predictor, identify "
                                      "without --refine",
                                      after, before));
}

refinement report(const okid_refined_t& found, int n_y) {
    refinement out;
    out.iterations = found.iterations;
    out.converged = found.converged != 0;
    out.samples = found.samples;
    out.gain = found.gain;
    out.decrement = found.decrement;
    out.whiteness = found.whiteness;
    out.noise_std.assign(found.noise_std, found.noise_std + n_y);
    return out;
}

/// Refine; where what is left has a colour, again behind the filter that takes it out. Stays that of the whiter residuals.
std::unique_ptr<refiner> refine_runs(driven_runs& runs, const okid_identified_t& start, bool constants, int iterations,
                                     noise_colour colour, std::vector<double>& filter) {
    filter = {1};
    auto plain = std::make_unique<refiner>(runs, start, constants, iterations);
    if (colour == noise_colour::white || plain->status < 0 || plain->found.whiteness <= nearly_white) return plain;
    okid_identified_t from = start;
    from.A = plain->found.A;
    from.B = plain->found.B;
    from.C = plain->found.C;
    from.D = plain->found.D;
    filter = whitening_filter(residual_correlation(model_view(from), plain->found.x0, runs),
                              static_cast<double>(plain->found.samples));
    filter_runs(filter, size_of(start.n_u + start.n_y), std::max<std::size_t>(20, 2 * size_of(start.n_z)), runs);
    auto white = std::make_unique<refiner>(runs, from, constants, iterations);
    if (white->status >= 0 && white->found.whiteness < plain->found.whiteness) {
        white->noise.assign(plain->found.noise_std, plain->found.noise_std + start.n_y);
        return white;
    }
    filter = {1};
    return plain;
}

likeliest_model outcome(refiner& one, const okid_identified_t& start) {
    likeliest_model out;
    out.status = one.status;
    if (one.status < 0) return out;
    out.arrays = std::make_unique<refined_arrays>();
    if (!make_model(start, one.found, *out.arrays, out.model)) out.status = OKID_ERR_NO_MODES;
    out.found = report(one.found, start.n_y);
    out.replicates = one.replicates();
    return out;
}

} // namespace

void find_markov(const okid_model_t& m, int count, std::vector<double>& out) {
    std::vector<double> u(size_of(m.n_u) * size_of(count)), y(size_of(m.n_y) * size_of(count));
    std::vector<double> work(okid_model_workspace(&m));
    const std::size_t block = size_of(m.n_y) * size_of(m.n_u);
    out.assign(block * size_of(count), 0);
    for (int c = 0; c < m.n_u; ++c) { // the answer to a unit impulse at each input
        std::fill(u.begin(), u.end(), 0.0);
        u[size_of(c)] = 1;
        if (okid_model_simulate(&m, u.data(), size_of(count), nullptr, y.data(), work.data()) < 0) return;
        for (std::size_t k = 0; k < size_of(count); ++k)
            std::copy_n(&y[k * size_of(m.n_y)], m.n_y, &out[k * block + size_of(c) * size_of(m.n_y)]);
    }
}

std::size_t refinable_samples(const record_work& work) {
    std::size_t out = 0;
    for (const auto& [record, piece] : longest_stretches(work)) out += piece.count;
    return out;
}

double whiteness_nearby(bool constants, const record_work& work, noise_colour colour) {
    constexpr std::size_t glance = 20000;
    driven_runs runs(work, glance);
    std::vector<double> filter;
    const auto one = refine_runs(runs, work.model, constants, 2, colour, filter);
    return one->status < 0 ? INFINITY : one->found.whiteness;
}

likeliest_model likeliest(bool constants, const record_work& work, noise_colour colour) {
    driven_runs runs(work);
    std::vector<double> filter;
    const auto one = refine_runs(runs, work.model, constants, 0, colour, filter);
    likeliest_model out = outcome(*one, work.model);
    out.found.noise_order = static_cast<int>(filter.size()) - 1;
    if (!one->noise.empty()) out.found.noise_std = one->noise;
    out.filter = std::move(filter);
    return out;
}

likeliest_model likeliest(bool constants, const okid_identified_t& start, const okid_correlation_sums_t& sums) {
    refiner one(sums, start, constants);
    likeliest_model out = outcome(one, start);
    out.found.whiteness = NAN;
    return out;
}

std::vector<replicate_model> refine_model(bool constants, record_work& result) {
    std::string reason = "it simulates the record worse";
    bool coloured = true; // of the last trial
    for (const auto& [with, colour] : {std::pair{true, noise_colour::any}, std::pair{true, noise_colour::white},
                                       std::pair{false, noise_colour::any}, std::pair{false, noise_colour::white}}) {
        if ((with && !constants) || (colour == noise_colour::white && !coloured)) continue;
        likeliest_model one = likeliest(with, result, colour);
        coloured = one.found.noise_order > 0;
        if (one.status == OKID_ERR_NO_MODES) continue;
        if (one.status < 0) {
            reason = okid_status_text(one.status);
            break;
        }
        record_trial trial;
        trial.model = one.model;
        const double predicted = mean_of(result.context.prediction_percent);
        choose_gain(result.set, predicted, *one.arrays, trial);
        if (!(mean_of(trial.context.simulation_percent) >= mean_of(result.context.simulation_percent) - same_percent))
            continue;
        result.model = trial.model;
        result.refined = std::move(one.arrays);
        result.context.x0 = std::move(trial.context.x0);
        result.context.simulation_percent = std::move(trial.context.simulation_percent);
        result.context.prediction_percent = std::move(trial.context.prediction_percent);
        result.context.refined = std::move(one.found);
        remark_on(*result.context.refined, predicted, mean_of(result.context.prediction_percent),
                  result.context.warnings);
        return std::move(one.replicates);
    }
    result.context.warnings.push_back(refine_failed(reason));
    return {};
}

okid_identified_t without_skew(const std::vector<replicate_model>& replicates, const mass_plan& plan,
                               record_work& result) {
    okid_identified_t model = result.model;
    const mkr_arguments given(plan, model.dt);
    const okid_skew_config_t config{model.n_u, model.n_y, model.n_z, static_cast<std::int32_t>(replicates.size()),
                                    &given.config};
    std::vector<std::byte> block(okid_skew_memsize(&config));
    okid_skew_t* skew = nullptr;
    const okid_model_t full = model_view(model);
    okid_status_t status = okid_skew_create(&skew, &config, block.data(), block.size());
    if (status >= 0) status = okid_skew_begin(skew, &full);
    for (std::size_t i = 0; status >= 0 && i < replicates.size(); ++i) {
        const okid_model_t one = replicates[i].view();
        status = okid_skew_add(skew, &one);
    }
    okid_skew_result_t raw{};
    if (status >= 0) status = okid_skew_finish(skew, &raw);
    if (status < 0) return model; // M, K and R say what is wrong with the modes
    channel_skew found;
    for (std::int32_t i = 0; i < raw.n_y; ++i) {
        found.us.push_back(1e6 * raw.delay[i]);
        found.std_us.push_back(1e6 * raw.std[i]);
    }
    found.late.assign(raw.late, raw.late + raw.n_y);
    found.too_large.assign(raw.too_large, raw.too_large + raw.n_y);
    found.undetermined = raw.undetermined != 0;
    found.scatter = raw.scatter;
    const remarks said = skew_remarks(found, result.context.outputs);
    result.context.warnings.insert(result.context.warnings.end(), said.begin(), said.end());
    result.context.skew = std::move(found);
    if (raw.corrected == 0) return model;
    refined_arrays& arrays = *result.refined;
    arrays.C_without_skew.resize(arrays.C.size());
    arrays.D_without_skew.resize(arrays.D.size());
    if (okid_skew_correct(skew, arrays.C_without_skew.data(), arrays.D_without_skew.data()) < 0) return model;
    model.C = arrays.C_without_skew.data();
    model.D = arrays.D_without_skew.data();
    return model;
}

} // namespace okid_host
