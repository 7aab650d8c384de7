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
#include <memory>

namespace okid_host {
namespace {

/// Samples after which the initial state has died away to rounding; the rest of the record cannot inform it.
std::size_t initial_state_samples(double radius, std::size_t count) {
    if (!(radius > 0 && radius < 1)) return count;
    const double needed = std::log(1e-16) / std::log(radius);
    return needed < static_cast<double>(count) ? std::max<std::size_t>(static_cast<std::size_t>(needed), 1) : count;
}

/// 100 (1 - |y - yhat| / |y - mean(y)|), NaN when it has no meaning.
std::vector<double> percent(const std::vector<double>& sums, std::size_t n_y, std::size_t residual) {
    std::vector<double> out;
    for (std::size_t o = 0; o < n_y; ++o) {
        const double sum = sums[2 * n_y + o], count = sums[4 * n_y + o];
        const double spread = sums[3 * n_y + o] - sum * sum / std::max(count, 1.0);
        const double value = 100 * (1 - std::sqrt(sums[residual * n_y + o] / spread));
        out.push_back(spread > 0 && std::isfinite(value) ? value : std::numeric_limits<double>::quiet_NaN());
    }
    return out;
}

struct fit_run {
    okid_model_t model;
    double radius;
    const std::vector<double>* known; ///< initial states, n_z numbers a record, or nullptr
    std::vector<double> work, sums;   ///< of okid_model_fit()

    fit_run(const okid_identified_t& of, bool predict, const std::vector<double>* states)
        : model{of.n_u, of.n_y, of.n_z, of.A, of.B, of.C, of.D, predict ? of.K : nullptr}, radius(of.model_radius),
          known(states && !states->empty() ? states : nullptr),
          work(std::max(okid_model_workspace(&model), okid_model_fit_memsize(&model) / sizeof(double) + 1)),
          sums(5 * static_cast<std::size_t>(of.n_y)) {}

    /// Inputs and outputs of the first `count` samples of a stretch.
    void take(const record_set& set, const double* row, std::size_t count) {
        u_.resize(count * set.n_u), y_.resize(count * set.n_y);
        double *u = u_.data(), *y = y_.data();
        for (std::size_t i = 0; i < count; ++i, row += set.channels()) {
            u = std::copy_n(row, set.n_u, u);
            y = std::copy_n(row + set.n_u, set.n_y, y);
        }
    }

    /// The least-squares initial state of a stretch of record r; without inputs it begins at rest.
    std::vector<double> begin(const record_set& set, std::size_t r, const stretch& piece) {
        const record_data& record = set.records[r];
        std::vector<double> x0(static_cast<std::size_t>(model.n_z));
        if (set.n_u == 0) return x0;
        if (known && piece.count == record.count) {
            std::copy_n(known->data() + r * x0.size(), x0.size(), x0.data());
            return x0;
        }
        const std::size_t used = initial_state_samples(radius, piece.count);
        take(set, set.rows(record) + piece.first * set.channels(), used);
        if (okid_model_initial_state(&model, u_.data(), y_.data(), used, x0.data(), work.data()) < 0)
            std::fill(x0.begin(), x0.end(), 0.0);
        return x0;
    }

    /// What one-step prediction leaves of a stretch.
    void left(const record_set& set, std::size_t r, const stretch& piece, double* out) {
        const std::vector<double> x0 = begin(set, r, piece);
        take(set, set.rows(set.records[r]) + piece.first * set.channels(), piece.count);
        const double* u = u_.empty() ? y_.data() : u_.data(); // of no inputs no number is read
        if (okid_model_predict(&model, u, y_.data(), piece.count, x0.data(), out, work.data()) < 0)
            std::fill_n(out, y_.size(), std::numeric_limits<double>::quiet_NaN());
        for (std::size_t i = 0; i < y_.size(); ++i) out[i] = y_[i] - out[i];
    }

    /// Add what the model leaves of a stretch.
    void add(const record_set& set, const record_data& record, const stretch& piece, const std::vector<double>& x0) {
        if (okid_model_fit(&model, set.rows(record) + piece.first * set.channels(), piece.count, x0.data(), sums.data(),
                           work.data(), work.size() * sizeof(double)) < 0)
            throw failure(exit_no_model,
                          fmt::format("{}: the model cannot be simulated over this record", record.path));
    }

  private:
    std::vector<double> u_, y_; // of the stretch
};

/// Samples of a stretch that tells its initial state.
std::size_t shortest_of(int n_z) { return std::max<std::size_t>(20, 2 * static_cast<std::size_t>(n_z)); }

} // namespace

okid_status_t fit_outputs(const record_set& set, int n_z, const double* A, const double* C, std::vector<double>& B,
                          std::vector<double>& D, std::vector<double>* x0) {
    const auto n_u = static_cast<std::int32_t>(set.n_u), n_y = static_cast<std::int32_t>(set.n_y);
    std::vector<std::int32_t> counts;
    for (const record_data& record : set.records) counts.push_back(static_cast<std::int32_t>(record.count));
    const auto count = static_cast<std::int32_t>(counts.size());
    B.resize(static_cast<std::size_t>(n_z) * set.n_u);
    D.resize(set.n_y * set.n_u);
    const std::size_t bytes = okid_subspace_output_error_memsize(n_u, n_y, n_z, count);
    if (bytes == 0) return OKID_ERR_DIM;
    const std::unique_ptr<std::byte[]> block(new std::byte[bytes]);
    if (x0) x0->resize(static_cast<std::size_t>(n_z) * counts.size());
    const okid_model_t model{n_u, n_y, n_z, A, nullptr, C, nullptr, nullptr};
    const okid_records_t given{count, counts.data(), set.samples.data()};
    return okid_subspace_output_error(&model, &given, B.data(), D.data(), x0 ? x0->data() : nullptr, block.get(),
                                      bytes);
}

std::vector<stretch> stretches_of(const record_set& set, const record_data& record, std::size_t least) {
    if (set.complete) return {{0, record.count}};
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

void find_states(const record_set& set, const okid_identified_t& found, result_context& context,
                 const std::vector<double>* known) {
    fit_run run(found, false, known);
    context.x0.emplace();
    for (std::size_t r = 0; r < set.records.size(); ++r) {
        const std::vector<stretch> pieces = stretches_of(set, set.records[r], shortest_of(found.n_z));
        context.x0->push_back(pieces.empty() ? std::vector<double>(static_cast<std::size_t>(found.n_z))
                                             : run.begin(set, r, pieces.front()));
    }
}

std::vector<double> residuals(const record_set& set, const okid_identified_t& found, const std::vector<double>* known) {
    fit_run run(found, true, known);
    std::vector<double> out(set.count() * set.n_y, std::numeric_limits<double>::quiet_NaN());
    for (std::size_t r = 0; r < set.records.size(); ++r)
        for (const stretch& piece : stretches_of(set, set.records[r], shortest_of(found.n_z)))
            run.left(set, r, piece, out.data() + (set.records[r].first + piece.first) * set.n_y);
    return out;
}

void fit_records(const record_set& set, const okid_identified_t& found, result_context& context,
                 const std::vector<double>* known) {
    const bool predict = found.K && !(found.warnings & OKID_NOTE_PREDICTOR_UNSTABLE);
    const auto n_y = static_cast<std::size_t>(found.n_y), n_z = static_cast<std::size_t>(found.n_z);
    fit_run run(found, predict, known);
    std::vector<std::vector<double>> states;
    for (const record_data& record : set.records) {
        std::vector<double> first(n_z, 0.0);
        bool begun = false;
        for (const stretch& piece : stretches_of(set, record, shortest_of(found.n_z))) {
            const std::vector<double> x0 = run.begin(set, states.size(), piece);
            run.add(set, record, piece, x0);
            if (!begun) first = x0;
            begun = true;
        }
        states.push_back(std::move(first));
    }
    context.prediction_percent =
        predict ? percent(run.sums, n_y, 1) : std::vector<double>(n_y, std::numeric_limits<double>::quiet_NaN());
    if (found.n_u == 0) return; // there is nothing to simulate
    context.x0 = std::move(states);
    context.simulation_percent = percent(run.sums, n_y, 0);
}

} // namespace okid_host
