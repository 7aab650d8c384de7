// SPDX-License-Identifier: MIT
#include "record.hpp"

#include "error.hpp"
#include "record_check.hpp"
#include "record_fit.hpp"
#include "record_horizon.hpp"
#include "record_refine.hpp"
#include "record_uncertainty.hpp"
#include "result/method.hpp"

#include <okid/subspace.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <fmt/format.h>
#include <new>
#include <optional>
#include <unistd.h>

namespace okid_host {
namespace {

void detrend_linear(std::vector<record_data>& records, const record_options& options) {
    for (record_data& record : records) {
        const record_data before = record;
        remove_lines(record.u.data(), options.inputs.size(), record.count);
        remove_lines(record.y.data(), options.outputs.size(), record.count);
        check_not_a_line(record, before, options);
    }
}

/// Several records: each is centred by its own mean first, so that an offset that moved between them does no harm.
void remove_means(double* samples, std::size_t channels, std::size_t count) {
    for (std::size_t k = 0; k < channels; ++k) {
        double sum = 0;
        std::size_t present = 0;
        for (std::size_t i = 0; i < count; ++i) {
            const double x = samples[i * channels + k];
            if (std::isnan(x)) continue;
            sum += x;
            ++present;
        }
        for (std::size_t i = 0; present && i < count; ++i)
            samples[i * channels + k] -= sum / static_cast<double>(present);
    }
}

void centre_each(std::vector<record_data>& records, const record_options& options) {
    for (record_data& record : records) {
        remove_means(record.u.data(), options.inputs.size(), record.count);
        remove_means(record.y.data(), options.outputs.size(), record.count);
    }
}

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
    if (status < 0) throw failure(exit_no_model, fmt::format("no model: {}: {}", what, okid_status_text(status)));
}

/// Feed all records, a gap between each two, as many samples of silence as lags before each that begins at rest.
template <class Gap, class Add>
void feed(const std::vector<record_data>& records, const okid_identify_config_t& config, bool at_rest, Gap gap,
          Add add) {
    const auto n_u = static_cast<std::size_t>(config.n_u), n_y = static_cast<std::size_t>(config.n_y);
    constexpr std::size_t piece = 4096;
    std::vector<double> v(piece * (n_u + n_y));
    const auto lags = static_cast<std::size_t>(okid_identify_lags(&config));
    const std::vector<double> silence(at_rest ? lags * (n_u + n_y) : 0);
    for (const record_data& record : records) {
        gap();
        if (at_rest) check_status(add(silence.data(), lags), record.path.c_str());
        for (std::size_t first = 0; first < record.count; first += piece) {
            const std::size_t n = std::min(piece, record.count - first);
            interleave(record, n_u, n_y, first, n, v.data());
            check_status(add(v.data(), n), record.path.c_str());
        }
    }
}

/// All records into one accumulator.
std::unique_ptr<std::byte[]> accumulate(const std::vector<record_data>& records, const okid_identify_config_t& config,
                                        bool at_rest, okid_accumulator_t*& accumulator) {
    okid_accumulator_config_t shape{};
    shape.n_u = config.n_u;
    shape.n_y = config.n_y;
    shape.lags = okid_identify_lags(&config);
    shape.sample = OKID_SAMPLE_DOUBLE;
    shape.forgetting = 1;
    shape.edges = 1;
    const std::size_t bytes = okid_accumulator_memsize(&shape);
    auto block = library_memory(bytes, config);
    check_status(okid_accumulator_create(&accumulator, &shape, block.get(), bytes), "accumulator");
    feed(
        records, config, at_rest, [&] { okid_accumulator_gap(accumulator, 0); },
        [&](const double* v, std::size_t n) { return okid_accumulator_add(accumulator, v, n); });
    return block;
}

/// Nearly noise-free data lose half their digits in a Gram matrix: the record is in memory, so its QR factor is taken instead.
/// What the Gram matrix gave stays when that fails. @return the status of the better model
okid_status_t refine_by_factor(const std::vector<record_data>& records, const okid_identify_config_t& config,
                               bool at_rest, okid_identify_t* identifier, okid_accumulator_t* accumulator,
                               okid_status_t status, record_result& result) {
    const bool floor_only = result.model.observer_info.ridge <= 1e-10; // else a ridge decides, not rounding
    if (status < 0 || !(result.model.warnings & OKID_NOTE_ILL_CONDITIONED) || !floor_only) return status;
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
        records, config, at_rest, [&] { okid_square_root_gap(square_root, 0); },
        [&](const double* v, std::size_t n) { return okid_square_root_add(square_root, v, n); });
    okid_identified_t better{};
    const okid_status_t found = okid_identify_run_factor(identifier, square_root, &better);
    if (found < 0) return okid_identify_run(identifier, accumulator, &result.model); // the workspace was shared
    result.model = better;
    result.context.warnings.emplace_back(
        "qr_factor", "nearly noise-free data: solved from the QR factor of the record, not from its Gram matrix");
    return found;
}

/// All records in one block, for okid_subspace_output_error().
struct packed_records {
    std::size_t n_u, n_y;
    std::vector<std::int32_t> counts;
    std::vector<std::size_t> starts; ///< of each record, in numbers
    std::vector<double> samples;

    packed_records(const std::vector<record_data>& records, std::size_t inputs, std::size_t outputs)
        : n_u(inputs), n_y(outputs) {
        for (const record_data& record : records) {
            counts.push_back(static_cast<std::int32_t>(record.count));
            starts.push_back(samples.size());
            samples.resize(samples.size() + record.count * (n_u + n_y));
            interleave(record, n_u, n_y, 0, record.count, samples.data() + starts.back());
        }
    }

    /// B and D that make the simulated outputs of A and C fit best.
    okid_status_t fit(int n_z, const double* A, const double* C, std::vector<double>& B, std::vector<double>& D) const {
        const auto inputs = static_cast<std::int32_t>(n_u), outputs = static_cast<std::int32_t>(n_y);
        const auto count = static_cast<std::int32_t>(counts.size());
        B.resize(static_cast<std::size_t>(n_z) * n_u);
        D.resize(n_y * n_u);
        const std::size_t bytes = okid_subspace_output_error_memsize(inputs, outputs, n_z, count);
        if (bytes == 0) return OKID_ERR_DIM;
        std::vector<std::byte> work(bytes);
        return okid_subspace_output_error(inputs, outputs, n_z, A, C, count, counts.data(), samples.data(), B.data(),
                                          D.data(), nullptr, work.data(), bytes);
    }
};

/// B and D of a subspace model from the records. Where that fails, those of the subspace equations stay.
void fit_inputs(const packed_records& records, okid_identify_t* identifier, record_result& result) {
    okid_identified_t& model = result.model;
    std::vector<double> B, D;
    okid_status_t status = records.fit(model.n_z, model.A, model.C, B, D);
    if (status >= 0) status = okid_identify_set_inputs(identifier, B.data(), D.data(), &model);
    if (status < 0)
        result.context.warnings.emplace_back(
            "inputs_from_subspace",
            fmt::format("B and D could not be fitted to the record ({}): they are those of the subspace equations",
                        okid_status_text(status)));
}

/// The same for the replicates: the outputs of the block that each leaves out are missing.
void fit_inputs(packed_records& records, std::vector<replicate_model>& replicates) {
    const std::size_t m = records.n_u + records.n_y;
    for (replicate_model& replicate : replicates) {
        if (!replicate.found()) continue;
        std::vector<double> taken;
        for (const record_piece& piece : replicate.pieces)
            for (std::size_t n = piece.first; n < piece.last; ++n) {
                double* y = &records.samples[records.starts[piece.record] + n * m + records.n_u];
                taken.insert(taken.end(), y, y + records.n_y);
                std::fill_n(y, records.n_y, NAN);
            }
        std::vector<double> B, D;
        const okid_status_t status = records.fit(replicate.n_z, replicate.A.data(), replicate.C.data(), B, D);
        if (status >= 0) std::swap(replicate.B, B), std::swap(replicate.D, D);
        const double* back = taken.data();
        for (const record_piece& piece : replicate.pieces)
            for (std::size_t n = piece.first; n < piece.last; ++n, back += records.n_y)
                std::copy_n(back, records.n_y, &records.samples[records.starts[piece.record] + n * m + records.n_u]);
    }
}

/// M, K, R, of a refined model without the delays of its outputs.
void find_matrices(const std::vector<replicate_model>& replicates, const record_options& options,
                   record_result& result) {
    remarks& said = result.context.warnings;
    said.insert(said.end(), options.said.begin(), options.said.end());
    if (!options.mass.wanted()) return;
    okid_identified_t structure = result.model;
    if (result.context.refined) structure = without_skew(replicates, options.mass, result);
    result.context.mass = find_mass_matrices(structure, options.mass, said);
}

/// The same records identified with other settings. Throws `failure` where there is no memory for it.
identify_again again_with(const std::vector<record_data>& records, bool at_rest) {
    return [&records, at_rest](const okid_identify_config_t& other,
                               const std::function<void(okid_identify_t*, okid_identified_t&)>& hand_on) {
        okid_accumulator_t* accumulator = nullptr;
        const auto sums = accumulate(records, other, at_rest, accumulator);
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
void find_deviations(const std::vector<record_data>& records, const okid_identify_config_t& config, long long rows,
                     const std::vector<replicate_model>& replicates, const record_options& options,
                     record_result& result) {
    if (options.sigma_blocks == 0) return;
    if (replicates.empty()) {
        result.context.warnings.emplace_back("no_deviation",
                                             "the record is too short to be cut into blocks: no standard deviations");
        return;
    }
    result.context.sigma = deviations_of(result.model, replicates, options.mass);
    if (result.context.mass) add_deviations(*result.context.sigma, *result.context.mass);
    if (!result.context.refined) // the likelihood knows no p
        remark_finite_p(config, rows, result.model, *result.context.sigma, again_with(records, options.start == "rest"),
                        result.context.warnings);
}

result_context describe(const std::vector<record_data>& records, const record_options& options,
                        const missing_count& missing, long long total) {
    result_context context;
    context.method = options.method;
    if (!looks_back_rows(method_of(options.method), options.inputs.size())) context.hankel = options.hankel;
    context.fs_hz = options.fs_hz;
    context.samples = total;
    context.records = static_cast<int>(records.size());
    context.gaps = missing.gaps;
    context.inputs = options.inputs;
    context.outputs = options.outputs;
    context.hold = options.hold;
    context.detrend = options.detrend;
    context.start = options.start;
    if (missing.samples)
        context.warnings.emplace_back("missing_samples",
                                      fmt::format("{} of {} samples are missing in {} gap{}: left out, nothing was "
                                                  "interpolated; the lags start anew after each gap",
                                                  missing.samples, total, missing.gaps, missing.gaps == 1 ? "" : "s"));
    return context;
}

/// What the library is asked for, with the horizon that the records bear.
okid_identify_config_t configure(const std::vector<record_data>& records, const record_options& options,
                                 const missing_count& missing, long long total, result_context& context) {
    okid_identify_config_t config{};
    config.n_u = static_cast<std::int32_t>(options.inputs.size());
    config.n_y = static_cast<std::int32_t>(options.outputs.size());
    config.method = method_of(options.method);
    config.hankel = hankel_of(options.hankel);
    choose_horizon(options, records, total - missing.samples, missing.samples > 0, config, context);
    config.order = options.order;
    config.fs_hz = options.fs_hz;
    const bool at_rest = options.start == "rest";
    config.detrend = options.detrend == "mean" && !at_rest ? OKID_DETREND_MEAN : OKID_DETREND_NONE;
    if (!at_rest) remark_early_hit(records, config.n_u, is_subspace(config.method) ? config.rows : config.p, context);
    return config;
}

void tell(const record_options& options, const char* stage) {
    if (options.stage) options.stage(stage);
}

} // namespace

record_data split_record(const csv_record& record, std::size_t n_u, std::size_t first, std::size_t last) {
    const std::size_t m = record.columns.size(), n_y = m - n_u;
    record_data out;
    out.path = record.path;
    out.count = last - first;
    out.u.resize(out.count * n_u);
    out.y.resize(out.count * n_y);
    for (std::size_t n = 0; n < out.count; ++n) {
        const double* sample = &record.samples[(first + n) * m];
        std::copy_n(sample, n_u, out.u.data() + n * n_u);
        std::copy_n(sample + n_u, n_y, &out.y[n * n_y]);
    }
    return out;
}

void interleave(const record_data& record, std::size_t n_u, std::size_t n_y, std::size_t first, std::size_t count,
                double* out) {
    for (std::size_t i = 0; i < count; ++i, out += n_u + n_y) {
        std::copy_n(record.u.data() + (first + i) * n_u, n_u, out);
        std::copy_n(record.y.data() + (first + i) * n_y, n_y, out + n_u);
    }
}

void remove_lines(double* samples, std::size_t channels, std::size_t count) {
    const double middle = (static_cast<double>(count) - 1) / 2;
    for (std::size_t k = 0; k < channels; ++k) {
        double n = 0, st = 0, stt = 0, sx = 0, stx = 0;
        for (std::size_t i = 0; i < count; ++i) {
            const double x = samples[i * channels + k], t = static_cast<double>(i) - middle;
            if (std::isnan(x)) continue;
            n += 1, st += t, stt += t * t, sx += x, stx += t * x;
        }
        if (n == 0) continue;
        const double spread = stt - st * st / n;
        const double slope = spread > 0 ? (stx - st * sx / n) / spread : 0;
        const double level = (sx - slope * st) / n;
        for (std::size_t i = 0; i < count; ++i)
            samples[i * channels + k] -= level + slope * (static_cast<double>(i) - middle);
    }
}

record_result identify_records(std::vector<record_data> records, const record_options& options) {
    long long total = 0;
    for (const record_data& record : records) total += static_cast<long long>(record.count);
    const missing_count missing = count_missing(records, options.inputs.size(), options.outputs.size());
    record_result result;
    result.context = describe(records, options, missing, total);
    check_moving(records, options);
    check_different_inputs(records, options);
    if (options.detrend == "linear") detrend_linear(records, options);
    const bool at_rest = options.start == "rest";
    const bool own_means_first = options.detrend == "mean" && (records.size() > 1 || at_rest);
    if (own_means_first) centre_each(records, options);

    const okid_identify_config_t config = configure(records, options, missing, total, result.context);
    tell(options, "summing lagged products");
    okid_accumulator_t* accumulator = nullptr;
    const auto sums = accumulate(records, config, at_rest, accumulator);
    const auto rows = static_cast<long long>(okid_accumulator_rows(accumulator));
    tell(options, "identifying");
    const std::size_t bytes = okid_identify_memsize(&config);
    result.memory = library_memory(bytes, config);
    okid_identify_t* identifier = nullptr;
    check_status(okid_identify_create(&identifier, &config, result.memory.get(), bytes), "identifier");
    okid_status_t status = okid_identify_run(identifier, accumulator, &result.model);
    status = refine_by_factor(records, config, at_rest, identifier, accumulator, status, result);
    if (status < 0) throw_identify_failure(status, result.model, config, result.context);
    if (options.stabilization) {
        tell(options, "looking at other orders and horizons");
        result.context.stable = find_stabilization(identifier, config, result.model, again_with(records, at_rest));
    }
    std::vector<replicate_model> replicates;
    const auto leave_out = [&](okid_accumulator_t* whole) {
        tell(options, "leaving out one block after the other");
        replicates = leave_out_blocks(records, config, at_rest, whole, result.model, options.sigma_blocks);
    };
    if (!options.refine) leave_out(accumulator);
    tell(options, "simulating the model");
    if (options.detrend == "mean" && !own_means_first)
        centre_each(records, options); // the fit is about the record's mean
    std::optional<packed_records> packed;
    if (is_subspace(config.method) && config.n_u > 0) {
        packed.emplace(records, options.inputs.size(), options.outputs.size());
        fit_inputs(*packed, identifier, result);
    }
    fit_records(records, result);
    if (options.refine) {
        tell(options, "refining the model");
        replicates = refine_model(records, options.detrend != "none", result);
        if (replicates.empty()) { // as without it: blocks of the records as they stand now
            okid_accumulator_t* centred = nullptr;
            const auto block = accumulate(records, config, at_rest, centred);
            leave_out(centred);
        }
    }
    if (packed && options.mass.wanted() && !result.context.refined) fit_inputs(*packed, replicates);
    check_explains(result.context);
    const bool simulated = result.context.simulation_percent.has_value();
    const auto& percent = simulated ? result.context.simulation_percent : result.context.prediction_percent;
    if (percent) remark_low_fit(*percent, simulated, result.context);
    find_matrices(replicates, options, result);
    find_deviations(records, config, rows, replicates, options, result);
    return result;
}

} // namespace okid_host
