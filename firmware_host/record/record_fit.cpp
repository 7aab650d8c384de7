// SPDX-License-Identifier: MIT
// PURPOSE  how well a model reproduces the records it came from
// METHOD   records are cut where an input is missing; each stretch has its own least-squares initial state
#include "record_fit.hpp"

#include "error.hpp"

#include <okid/model.h>
#include <okid/steps/subspace.h>

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <limits>

namespace okid_host {
namespace {

/// Sums over all records of one output: residual, and what is needed for the spread about the mean.
struct output_sums {
    double residual = 0, sum = 0, square = 0;
    std::size_t count = 0;
};

/// Samples after which the initial state has died away to rounding; the rest of the record cannot inform it.
std::size_t initial_state_samples(double radius, std::size_t count) {
    if (!(radius > 0 && radius < 1)) return count;
    const double needed = std::log(1e-16) / std::log(radius);
    return needed < static_cast<double>(count) ? std::max<std::size_t>(static_cast<std::size_t>(needed), 1) : count;
}

void pool(const double* y, const std::vector<double>& estimate, std::size_t n_y, std::vector<output_sums>& sums) {
    for (std::size_t i = 0; i < estimate.size(); ++i) {
        if (std::isnan(y[i])) continue;
        output_sums& s = sums[i % n_y];
        const double error = y[i] - estimate[i];
        s.residual += error * error;
        s.sum += y[i];
        s.square += y[i] * y[i];
        ++s.count;
    }
}

/// 100 (1 - |y - yhat| / |y - mean(y)|), NaN when it has no meaning.
std::vector<double> percent(const std::vector<output_sums>& sums) {
    std::vector<double> out;
    for (const output_sums& s : sums) {
        const double spread = s.square - s.sum * s.sum / static_cast<double>(std::max<std::size_t>(s.count, 1));
        const double value = 100 * (1 - std::sqrt(s.residual / spread));
        out.push_back(spread > 0 && std::isfinite(value) ? value : std::numeric_limits<double>::quiet_NaN());
    }
    return out;
}

struct fit_run {
    const okid_model_t& model;
    double radius;
    bool predict;
    std::vector<double> work;
    std::vector<output_sums> simulated, predicted;

    fit_run(const okid_model_t& of, double spectral_radius, bool with_prediction)
        : model(of), radius(spectral_radius), predict(with_prediction), work(okid_model_workspace(&of)),
          simulated(static_cast<std::size_t>(of.n_y)), predicted(static_cast<std::size_t>(of.n_y)) {}

    /// Take a stretch. @return its least-squares initial state; without inputs it begins at rest
    std::vector<double> begin(const record_set& set, const record_data& record, const stretch& piece) {
        const double* row = set.rows(record) + piece.first * set.channels();
        u_.clear(), y_.clear();
        for (std::size_t i = 0; i < piece.count; ++i, row += set.channels()) {
            u_.insert(u_.end(), row, row + set.n_u);
            y_.insert(y_.end(), row + set.n_u, row + set.channels());
        }
        std::vector<double> x0(static_cast<std::size_t>(model.n_z));
        const std::size_t used = initial_state_samples(radius, piece.count);
        if (set.n_u == 0 || okid_model_initial_state(&model, u_.data(), y_.data(), used, x0.data(), work.data()) < 0)
            std::fill(x0.begin(), x0.end(), 0.0);
        return x0;
    }

    /// What one-step prediction leaves of the stretch taken last.
    void left(const std::vector<double>& x0, double* out) {
        const std::size_t count = y_.size() / static_cast<std::size_t>(model.n_y);
        const double* u = u_.empty() ? y_.data() : u_.data(); // of no inputs no number is read
        if (okid_model_predict(&model, u, y_.data(), count, x0.data(), out, work.data()) < 0)
            std::fill_n(out, y_.size(), std::numeric_limits<double>::quiet_NaN());
        for (std::size_t i = 0; i < y_.size(); ++i) out[i] = y_[i] - out[i];
    }

    /// One stretch from its own least-squares initial state, which is returned.
    std::vector<double> add(const record_set& set, const record_data& record, const stretch& piece) {
        std::vector<double> x0 = begin(set, record, piece), estimate(piece.count * set.n_y);
        const double *u = u_.data(), *y = y_.data();
        if (okid_model_simulate(&model, u, piece.count, x0.data(), estimate.data(), work.data()) < 0)
            throw failure(exit_no_model,
                          fmt::format("{}: the model cannot be simulated over this record", record.path));
        pool(y, estimate, set.n_y, simulated);
        if (predict) {
            if (okid_model_predict(&model, u, y, piece.count, x0.data(), estimate.data(), work.data()) < 0)
                std::fill(estimate.begin(), estimate.end(), std::numeric_limits<double>::quiet_NaN());
            pool(y, estimate, set.n_y, predicted);
        }
        return x0;
    }

  private:
    std::vector<double> u_, y_; // of the stretch
};

/// Samples of a stretch that tells its initial state.
std::size_t shortest_of(int n_z) { return std::max<std::size_t>(20, 2 * static_cast<std::size_t>(n_z)); }

/// Without inputs there is nothing to simulate: prediction from rest.
void fit_ambient(const record_set& set, fit_run& run, result_context& context) {
    const std::vector<double> rest(static_cast<std::size_t>(run.model.n_z));
    for (const record_data& record : set.records) {
        if (!run.predict) break;
        const double* y = set.rows(record);
        std::vector<double> estimate(record.count * set.n_y);
        if (okid_model_predict(&run.model, y, y, record.count, rest.data(), estimate.data(), run.work.data()) < 0)
            std::fill(estimate.begin(), estimate.end(), std::numeric_limits<double>::quiet_NaN());
        pool(y, estimate, set.n_y, run.predicted);
    }
    context.prediction_percent =
        run.predict ? percent(run.predicted)
                    : std::vector<double>(run.predicted.size(), std::numeric_limits<double>::quiet_NaN());
}

} // namespace

okid_status_t fit_outputs(const record_set& set, int n_z, const double* A, const double* C, std::vector<double>& B,
                          std::vector<double>& D) {
    const auto n_u = static_cast<std::int32_t>(set.n_u), n_y = static_cast<std::int32_t>(set.n_y);
    std::vector<std::int32_t> counts;
    for (const record_data& record : set.records) counts.push_back(static_cast<std::int32_t>(record.count));
    const auto count = static_cast<std::int32_t>(counts.size());
    B.resize(static_cast<std::size_t>(n_z) * set.n_u);
    D.resize(set.n_y * set.n_u);
    const std::size_t bytes = okid_subspace_output_error_memsize(n_u, n_y, n_z, count);
    if (bytes == 0) return OKID_ERR_DIM;
    std::vector<std::byte> block(bytes);
    const okid_model_t model{n_u, n_y, n_z, A, nullptr, C, nullptr, nullptr};
    const okid_records_t given{count, counts.data(), set.samples.data()};
    return okid_subspace_output_error(&model, &given, B.data(), D.data(), nullptr, block.data(), bytes);
}

std::vector<stretch> stretches_of(const record_set& set, const record_data& record, std::size_t least) {
    std::vector<stretch> out;
    std::size_t first = 0;
    for (std::size_t i = 0; i <= record.count; ++i) {
        const double* u = set.rows(record) + i * set.channels();
        if (i < record.count && std::none_of(u, u + set.n_u, [](double x) { return std::isnan(x); })) continue;
        if (i - first >= least || (first == 0 && i == record.count)) out.push_back({first, i - first});
        first = i + 1;
    }
    return out;
}

std::vector<double> residuals(const record_set& set, const okid_identified_t& found) {
    const okid_model_t model{found.n_u, found.n_y, found.n_z, found.A, found.B, found.C, found.D, found.K};
    fit_run run(model, found.model_radius, true);
    std::vector<double> out(set.count() * set.n_y, std::numeric_limits<double>::quiet_NaN());
    for (const record_data& record : set.records)
        for (const stretch& piece : stretches_of(set, record, shortest_of(found.n_z)))
            run.left(run.begin(set, record, piece), out.data() + (record.first + piece.first) * set.n_y);
    return out;
}

void fit_records(const record_set& set, const okid_identified_t& found, result_context& context) {
    const okid_model_t model{found.n_u, found.n_y, found.n_z, found.A, found.B, found.C, found.D, found.K};
    const bool predict = found.K && !(found.warnings & OKID_NOTE_PREDICTOR_UNSTABLE);
    fit_run run(model, found.model_radius, predict);
    if (found.n_u == 0) return fit_ambient(set, run, context);
    const std::size_t least = shortest_of(found.n_z);
    std::vector<std::vector<double>> states;
    for (const record_data& record : set.records) {
        std::vector<double> first(static_cast<std::size_t>(found.n_z), 0.0);
        bool begun = false;
        for (const stretch& piece : stretches_of(set, record, least)) {
            const std::vector<double> x0 = run.add(set, record, piece);
            if (!begun) first = x0;
            begun = true;
        }
        states.push_back(std::move(first));
    }
    context.x0 = std::move(states);
    context.simulation_percent = percent(run.simulated);
    context.prediction_percent =
        predict ? percent(run.predicted) : std::vector<double>(set.n_y, std::numeric_limits<double>::quiet_NaN());
}

} // namespace okid_host
