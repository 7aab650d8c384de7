// SPDX-License-Identifier: MIT
// PURPOSE  the whole way from measured records to a model with its fits, matrices and standard deviations
// METHOD   every step works on one record_work: records, configuration, model and what is known about it
#include "record.hpp"

#include "error.hpp"
#include "growing_poles.hpp"
#include "hit_files.hpp"
#include "record_auto.hpp"
#include "record_check.hpp"
#include "record_fit.hpp"
#include "record_hold.hpp"
#include "record_horizon.hpp"
#include "record_refine.hpp"
#include "record_uncertainty.hpp"
#include "record_work.hpp"
#include "result/method.hpp"
#include "roving.hpp"
#include "shape_quantity.hpp"

#include <okid/steps/square_root.h>

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <new>
#include <unistd.h>

namespace okid_host {
namespace {

/// Bytes for one object of the library; refuses before the machine runs out.
std::unique_ptr<std::byte[]> library_memory(std::size_t bytes, const okid_identify_config_t& config) {
    if (bytes == 0)
        throw failure(exit_usage,
                      fmt::format("{} with these channels, --rows and --order is outside what the library takes",
                                  horizon_option(config)));
    const double machine = static_cast<double>(sysconf(_SC_PHYS_PAGES)) * static_cast<double>(sysconf(_SC_PAGE_SIZE));
    std::unique_ptr<std::byte[]> block(static_cast<double>(bytes) < 0.8 * machine ? new (std::nothrow) std::byte[bytes]
                                                                                  : nullptr);
    if (!block)
        throw failure(
            exit_usage,
            fmt::format("{} with these channels and --rows needs {:.1f} GB of memory, this machine has {:.1f} "
                        "GB: lower --p or --rows, or use fewer channels",
                        horizon_option(config), static_cast<double>(bytes) / 1e9, machine / 1e9));
    return block;
}

void check_status(okid_status_t status, const char* what) {
    if (status < 0)
        throw failure(exit_no_model, fmt::format("no model: {}: {}", what, okid_status_text(status)), status);
}

/// Feed all records, a gap between each two, as many samples of silence as lags before each that begins at rest.
template <class Gap, class Add>
void feed(const record_set& set, const okid_identify_config_t& config, bool at_rest, Gap gap, Add add) {
    const auto lags = static_cast<std::size_t>(okid_identify_lags(&config));
    const std::vector<double> silence(at_rest ? lags * set.channels() : 0);
    for (const record_data& record : set.records) {
        gap();
        if (at_rest) check_status(add(silence.data(), lags), record.path.c_str());
        check_status(add(set.rows(record), record.count), record.path.c_str());
    }
}

/// All records into one accumulator.
std::unique_ptr<std::byte[]> accumulate(const record_set& set, const okid_identify_config_t& config, bool at_rest,
                                        okid_accumulator_t*& accumulator) {
    okid_accumulator_config_t shape{};
    shape.n_u = config.n_u;
    shape.n_y = config.n_y;
    shape.lags = okid_identify_lags(&config);
    shape.sample = OKID_SAMPLE_DOUBLE;
    shape.forgetting = 1;
    shape.edges = 1;
    shape.bulk = 1;
    shape.buffer = 1; // the record is in memory
    const std::size_t bytes = okid_accumulator_memsize(&shape);
    auto block = library_memory(bytes, config);
    check_status(okid_accumulator_create(&accumulator, &shape, block.get(), bytes), "accumulator");
    feed(
        set, config, at_rest, [&] { okid_accumulator_gap(accumulator, 0); },
        [&](const double* v, std::size_t n) { return okid_accumulator_add(accumulator, v, n); });
    return block;
}

/// Nearly noise-free data lose half their digits in a Gram matrix: the record is in memory, so its QR factor is taken instead.
/// What the Gram matrix gave stays when that fails. @return the status of the better model
okid_status_t refine_by_factor(okid_accumulator_t* accumulator, okid_status_t status, record_work& work) {
    const okid_identify_config_t& config = work.config;
    const bool floor_only = work.model.observer_info.ridge <= 1e-10; // else a ridge decides, not rounding
    if (status < 0 || !(work.model.warnings & OKID_NOTE_ILL_CONDITIONED) || !floor_only) return status;
    okid_square_root_config_t shape{};
    shape.n_u = config.n_u;
    shape.n_y = config.n_y;
    shape.lags = okid_identify_lags(&config);
    shape.forgetting = 1;
    const std::size_t bytes = okid_square_root_memsize(&shape);
    const auto block = library_memory(bytes, config);
    okid_square_root_t* square_root = nullptr;
    check_status(okid_square_root_create(&square_root, &shape, block.get(), bytes), "QR factor");
    feed(
        work.set, config, work.at_rest, [&] { okid_square_root_gap(square_root, 0); },
        [&](const double* v, std::size_t n) { return okid_square_root_add(square_root, v, n); });
    okid_identified_t better{};
    const okid_status_t found = okid_identify_run_factor(work.identifier, square_root, &better);
    if (found < 0) return okid_identify_run(work.identifier, accumulator, &work.model); // the workspace was shared
    work.model = better;
    work.context.warnings.emplace_back(
        "qr_factor", "nearly noise-free data: solved from the QR factor of the record, not from its Gram matrix");
    return found;
}

/// B and D of a subspace model from the records. Where that fails, those of the subspace equations stay.
/// @return the initial states that go with them; empty: not known
std::vector<double> fit_inputs(record_work& work) {
    std::vector<double> B, D, x0;
    okid_identified_t& model = work.model;
    okid_status_t status = fit_outputs(work.set, model.n_z, model.A, model.C, B, D, &x0);
    if (status >= 0 && work.refined) { // its A is not that of the identifier
        work.refined->B = std::move(B);
        work.refined->D = std::move(D);
        model.B = work.refined->B.data();
        model.D = work.refined->D.data();
        find_markov(model_view(model), model.markov_count, work.refined->markov);
        model.markov = work.refined->markov.data();
    } else if (status >= 0)
        status = okid_identify_set_inputs(work.identifier, B.data(), D.data(), &model);
    if (status < 0)
        work.context.warnings.emplace_back(
            "inputs_from_subspace",
            fmt::format("B and D could not be fitted to the record ({}): they are those of the subspace equations",
                        okid_status_text(status)));
    return status >= 0 ? x0 : std::vector<double>{};
}

/// The same for the replicates: the outputs of the block that each leaves out are missing.
void fit_inputs(record_set& set, std::vector<replicate_model>& replicates) {
    for (replicate_model& replicate : replicates) {
        if (!replicate.found()) continue;
        std::vector<double> taken;
        const auto outputs_of = [&](const auto& use) {
            for (const record_piece& piece : replicate.pieces)
                for (std::size_t n = piece.first; n < piece.last; ++n)
                    use(set.rows(set.records[piece.record]) + n * set.channels() + set.n_u);
        };
        outputs_of([&](double* y) {
            taken.insert(taken.end(), y, y + set.n_y);
            std::fill_n(y, set.n_y, NAN);
        });
        std::vector<double> B, D;
        if (fit_outputs(set, replicate.n_z, replicate.A.data(), replicate.C.data(), B, D) >= 0)
            std::swap(replicate.B, B), std::swap(replicate.D, D);
        const double* back = taken.data();
        outputs_of([&](double* y) { std::copy_n(back, set.n_y, y), back += set.n_y; });
    }
}

/// M, K, R, of a refined model without the delays of its outputs.
void find_matrices(const std::vector<replicate_model>& replicates, const record_options& options, record_work& work) {
    remarks& said = work.context.warnings;
    said.insert(said.end(), options.said.begin(), options.said.end());
    if (!options.mass.wanted()) return;
    okid_identified_t structure = work.model;
    if (work.context.refined) structure = without_skew(replicates, options.mass, work);
    mass_plan plan = options.mass;
    if (plan.hold == "auto") plan.hold = work.context.hold = hold_of_data(work.set, structure, plan);
    work.context.mass = find_mass_matrices(structure, plan, said);
    modal_mass_statistics masses(plan, structure.dt);
    masses.begin(structure);
    for (const replicate_model& replicate : replicates)
        if (replicate.found()) masses.add(replicate.view(), replicate.share);
    work.context.modal_masses = masses.finish();
}

/// The same records identified with other settings. Throws `failure` where there is no memory for it.
identify_again again_with(const record_set& set, bool at_rest) {
    return [&set, at_rest](const okid_identify_config_t& other,
                           const std::function<void(okid_identify_t*, okid_identified_t&)>& hand_on) {
        okid_accumulator_t* accumulator = nullptr;
        const auto sums = accumulate(set, other, at_rest, accumulator);
        const std::size_t bytes = okid_identify_memsize(&other);
        const auto block = library_memory(bytes, other);
        okid_identify_t* own = nullptr;
        okid_identified_t found{};
        if (okid_identify_create(&own, &other, block.get(), bytes) == OKID_OK &&
            okid_identify_run(own, accumulator, &found) >= 0)
            hand_on(own, found);
    };
}

/// Deviations of everything, and what a longer horizon would say.
void find_deviations(long long rows, const std::vector<replicate_model>& replicates, const record_options& options,
                     record_work& work) {
    if (options.sigma_blocks == 0) return;
    if (replicates.empty()) {
        work.context.warnings.emplace_back("no_deviation",
                                           "the record is too short to be cut into blocks: no standard deviations");
        return;
    }
    work.context.sigma = deviations_of(work.model, replicates, options.mass);
    if (work.context.mass) add_deviations(*work.context.sigma, *work.context.mass, work.context.warnings);
    if (!work.context.refined) // the likelihood knows no p
        remark_finite_p(work, rows, *work.context.sigma, work.context.warnings);
}

/// What the library is asked for, with the horizon that the records bear.
void configure(const record_options& options, const missing_count& missing, record_work& work) {
    okid_identify_config_t& config = work.config;
    config.n_u = static_cast<std::int32_t>(options.inputs.size());
    config.n_y = static_cast<std::int32_t>(options.outputs.size());
    config.method = method_of(options.method);
    config.hankel = hankel_of(options.hankel);
    choose_horizon(options, work.set, missing, config, work.context);
    config.order = options.order;
    config.max_order = options.max_order;
    config.fs_hz = options.fs_hz;
    work.analytic = options.analytic && options.refine != "yes"; // else its sums are not those of `identifier`
    config.detrend = options.detrend == "mean" && !work.at_rest ? OKID_DETREND_MEAN : OKID_DETREND_NONE;
}

void tell(const record_options& options, const char* stage) {
    if (options.stage) options.stage(stage);
}

/// Sums, decomposition, model. @return regression rows; `accumulator` holds the sums
long long find_model(const record_options& options, okid_accumulator_t*& accumulator,
                     std::unique_ptr<std::byte[]>& sums, record_work& work) {
    tell(options, "summing lagged products");
    sums = accumulate(work.set, work.config, work.at_rest, accumulator);
    const auto rows = static_cast<long long>(okid_accumulator_rows(accumulator));
    tell(options, "identifying");
    const std::size_t bytes = okid_identify_memsize(&work.config);
    work.memory = library_memory(bytes, work.config);
    check_status(okid_identify_create(&work.identifier, &work.config, work.memory.get(), bytes), "identifier");
    okid_status_t status = okid_identify_run(work.identifier, accumulator, &work.model);
    status = refine_by_factor(accumulator, status, work);
    if (status == OKID_ERR_NO_MODES && options.order > 0 && work.model.n_z == options.order &&
        work.model.mode_count == 0 && !options.mass.wanted()) {
        work.context.warnings.emplace_back(
            "no_modes",
            fmt::format("the model of order {} as asked for has no vibration mode (0 < ζ < 1)", options.order));
        return rows;
    }
    if (status < 0) throw_identify_failure(status, work.model, work.config, work.context);
    work.realised = work.model;
    return rows;
}

/// May the fits of this n4sid model wait until somebody asks for them? Where its innovations leave 30 % of the amplitude of
/// an output explained it is no model that check_explains() refuses (5 %).
bool fits_can_wait(const record_options& options, okid_accumulator_t* accumulator, const record_work& work) {
    const okid_identified_t& model = work.model;
    if (!work.set.complete || options.refine == "yes" || options.mass.wanted() || !model.K || work.refined ||
        (model.warnings & (OKID_NOTE_PREDICTOR_UNSTABLE | OKID_NOTE_MODEL_UNSTABLE)))
        return false;
    std::vector<double> energy(work.set.channels());
    if (okid_accumulator_energy(accumulator, OKID_DETREND_MEAN, energy.data()) != OKID_OK) return false;
    for (int o = 0; o < model.n_y; ++o)
        if (model.innovation[o * (model.n_y + 1)] * static_cast<double>(okid_accumulator_rows(accumulator)) <
            0.7 * 0.7 * energy[work.set.n_u + static_cast<std::size_t>(o)])
            return true;
    return false;
}

/// B and D of the records, the fits, the refinement: all of it about the records without their means or lines.
/// @return the replicates that stand after it
std::vector<replicate_model> improve(const record_options& options, okid_accumulator_t* accumulator,
                                     std::vector<replicate_model> replicates, record_work& work) {
    const bool from_record = is_subspace(work.config.method) && work.config.n_u > 0;
    tell(options, "simulating the model");
    if (from_record && !(work.model.model_radius < 1)) reflect_growing(work, replicates);
    const std::vector<double> states = from_record ? fit_inputs(work) : std::vector<double>{};
    if (!states.empty() && fits_can_wait(options, accumulator, work)) {
        find_states(work.set, work.model, work.context, &states);
        work.states = states;
        return replicates;
    }
    fit_records(work.set, work.model, work.context, &states);
    if (options.refine == "yes") {
        tell(options, "refining the model");
        replicates = refine_model(options.detrend != "none", work);
        if (replicates.empty()) { // as without it: blocks of the records as they stand now
            okid_accumulator_t* centred = nullptr;
            const auto sums = accumulate(work.set, work.config, work.at_rest, centred);
            replicates = leave_out_blocks(work, centred, options.sigma_blocks, options.mass.wanted());
        }
    }
    if (from_record && options.mass.wanted() && !work.context.refined) fit_inputs(work.set, replicates);
    return replicates;
}

void check_fit(result_context& context) {
    check_explains(context);
    const bool simulated = context.simulation_percent.has_value();
    const auto& percent = simulated ? context.simulation_percent : context.prediction_percent;
    if (percent) remark_low_fit(*percent, simulated, context);
}

/// What is asked and missing is checked, means and trends go, the method gets its sizes.
/// @return the means of each record were removed by itself
bool prepare(record_set records, const record_options& options, record_work& work) {
    work.set = std::move(records);
    work.at_rest = options.start == "rest";
    const missing_count missing = count_missing(work.set);
    work.set.complete = missing.samples == 0;
    work.context = describe_records(work.set, options, missing);
    remark_repeated(work.set, work.context.warnings);
    if (std::string text = repeated_rows(work.set, options.fs_hz); !text.empty())
        work.context.warnings.emplace_back("rows_repeated", std::move(text));
    check_moving(work.set, options);
    check_different_outputs(work.set, options);
    std::vector<input_moments> about = moments_of(work.set);
    check_different_inputs(about, options);
    if (options.detrend == "linear") detrend_linear(work.set, options);
    // Several records are each centred first, so that an offset that moved between them does no harm.
    const bool own_means_first = options.detrend == "mean" && (work.set.records.size() > 1 || work.at_rest);
    if (own_means_first) remove_means(work.set);
    configure(options, missing, work);
    if (options.detrend == "linear" || own_means_first) about = moments_of(work.set);
    if (!work.at_rest)
        remark_early_hit(work.set, about, is_subspace(work.config.method) ? work.config.rows : work.config.p,
                         work.context);
    return own_means_first;
}

} // namespace

void detrend_linear(record_set& set, const record_options& options) {
    for (const record_data& record : set.records) {
        const std::vector<double> before = largest_of(set, record);
        remove_lines(set.rows(record), set.channels(), record.count);
        check_not_a_line(set, record, before, options);
    }
}

void describe_dofs(const record_options& options, result_context& to) {
    const mass_plan& plan = options.placed.wanted() ? options.placed : options.mass;
    const auto numbers = [](const std::vector<mass_channel>& channels) {
        std::vector<int> out;
        for (const mass_channel& one : channels) out.push_back(one.reversed ? -one.dof : one.dof);
        return out;
    };
    to.input_dofs = numbers(plan.inputs);
    to.output_dofs = numbers(plan.outputs);
}

result_context describe_records(const record_set& set, const record_options& options, const missing_count& missing) {
    check_measured(missing, set, options);
    const std::size_t total = set.count();
    result_context context;
    context.method = options.method;
    if (options.method != "auto" && options.method != lag_method &&
        !looks_back_rows(method_of(options.method), options.inputs.size()))
        context.hankel = options.hankel;
    context.fs_hz = options.fs_hz;
    context.samples = static_cast<long long>(total);
    context.records = static_cast<int>(set.records.size());
    context.gaps = missing.gaps;
    context.inputs = options.inputs;
    context.outputs = options.outputs;
    context.hold = options.hold;
    context.detrend = options.detrend;
    context.start = options.start;
    describe_dofs(options, context);
    if (missing.samples)
        context.warnings.push_back(missing_samples(missing, static_cast<long long>(total), options.method == "auto"));
    return context;
}

record_result identify_records(record_set records, const record_options& options, const older_samples* before) {
    check_hits(records, options.hits);
    if (options.judge_hits) {
        record_options good = options;
        good.judge_hits = false;
        cut_at_hits(records, good.hits);
        std::vector<hit_line> hits = choose_hits(records, good);
        record_result out = identify_records(std::move(records), good);
        out.context.hits = std::move(hits);
        return out;
    }
    if (options.method == "auto") return identify_auto(std::move(records), options, before);
    if (!options.hits.empty()) {
        record_options other = options;
        other.inputs = place_names(options.inputs.front(), options.hits);
        other.hits.clear();
        return identify_records(one_column_a_place(records, options.hits), other);
    }
    record_work work;
    const bool own_means_first = prepare(std::move(records), options, work);
    okid_accumulator_t* accumulator = nullptr;
    std::unique_ptr<std::byte[]> sums;
    const long long rows = find_model(options, accumulator, sums, work);
    if (options.stabilization) {
        tell(options, "looking at other orders and horizons");
        work.context.stable =
            find_stabilization(work.identifier, work.config, work.model, again_with(work.set, work.at_rest));
    }
    std::vector<replicate_model> replicates;
    if (options.refine != "yes") {
        tell(options, "leaving out one block after the other");
        replicates = leave_out_blocks(work, accumulator, options.sigma_blocks, options.mass.wanted());
    }
    if (options.detrend == "mean" && !own_means_first) remove_means(work.set); // the fit is about the record's mean
    replicates = improve(options, accumulator, std::move(replicates), work);
    const std::size_t place = work.context.warnings.size();
    if (work.states.empty()) check_fit(work.context);
    remark_contradiction(modes_of(work.model), {}, options.fs_hz, work);
    find_matrices(replicates, options, work);
    find_deviations(rows, replicates, options, work);
    record_result result;
    result.model = kept_model(work.model);
    result.context = std::move(work.context);
    shapes_in_one_quantity(options.sensing, result.model, result.context);
    result.config = work.config;
    result.memory = std::move(work.memory);
    result.identifier = work.identifier;
    result.realised = work.realised;
    if (!work.states.empty())
        result.to_come.reset(new record_result::fits_to_come{std::move(work.set), std::move(work.states), place});
    return result;
}

void finish_fits(record_result& result) {
    const auto later = std::move(result.to_come);
    if (!later) return;
    fit_records(later->set, result.model.view(), result.context, &later->states);
    auto& said = result.context.warnings;
    const auto before = static_cast<std::ptrdiff_t>(said.size());
    remark_low_fit(*result.context.simulation_percent, true, result.context);
    std::rotate(said.begin() + static_cast<std::ptrdiff_t>(later->place), said.begin() + before, said.end());
}

} // namespace okid_host
