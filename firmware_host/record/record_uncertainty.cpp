// SPDX-License-Identifier: MIT
// PURPOSE  standard deviations of what is identified from records in memory
// METHOD   the model without each block, from the sums of lagged products: to first order or identified again
//          (okid/uncertainty.h)
#include "record_uncertainty.hpp"

#include "consensus/owned_sums.hpp"
#include "record_work.hpp"

#include "error.hpp"
#include "result/method.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <new>

namespace okid_host {
namespace {

constexpr std::size_t usual_blocks = 10; // of older and newest samples together, at least

/// Equal parts of all regression rows together; what stands before a record's first row is history only.
std::vector<std::vector<record_piece>> cut(const std::vector<record_data>& records, std::size_t history,
                                           std::size_t parts) {
    std::size_t total = 0;
    for (const record_data& record : records) total += record.count - std::min(history, record.count);
    std::vector<std::vector<record_piece>> out(parts);
    std::size_t at = 0;
    for (std::size_t r = 0; r < records.size(); ++r) {
        const std::size_t start = std::min(history, records[r].count), end = at + records[r].count - start;
        for (std::size_t k = 0; k < parts; ++k) {
            const std::size_t low = std::max(at, k * total / parts), high = std::min(end, (k + 1) * total / parts);
            if (low < high) out[k].push_back({r, start + low - at, start + high - at});
        }
        at = end;
    }
    return out;
}

/// Does a block hold so much of the record that the model follows it? Then the change to first order is much smaller than
/// that of the model without it: a free decay is over after a block or two.
bool one_block_rules(const record_set& set, bool constants, const std::vector<std::vector<record_piece>>& parts) {
    const std::size_t n_y = set.n_y;
    std::vector<double> power(parts.size() * n_y), whole(n_y), mean(n_y), there(n_y);
    const auto each = [&](auto&& function) {
        for (std::size_t b = 0; b < parts.size(); ++b)
            for (const record_piece& piece : parts[b]) {
                const double* rows = set.rows(set.records[piece.record]) + set.n_u;
                for (std::size_t n = piece.first; n < piece.last; ++n)
                    for (std::size_t i = 0; i < n_y; ++i)
                        if (const double y = rows[n * set.channels() + i]; !std::isnan(y)) function(b, i, y);
            }
    };
    if (constants) each([&](std::size_t, std::size_t i, double y) { mean[i] += (y - mean[i]) / ++there[i]; });
    each([&](std::size_t b, std::size_t i, double y) { power[b * n_y + i] += (y - mean[i]) * (y - mean[i]); });
    for (std::size_t k = 0; k < power.size(); ++k) whole[k % n_y] += power[k];
    for (std::size_t b = 0; b < parts.size(); ++b) {
        double share = 0;
        for (std::size_t i = 0; i < n_y; ++i)
            if (whole[i] > 0) share += power[b * n_y + i] / whole[i] / static_cast<double>(n_y);
        if (share > most_of_one_block) return true;
    }
    return false;
}

/// The pieces, each behind the samples before it; before a record begins there is silence.
okid_status_t feed_pieces(okid_accumulator_t* to, const record_set& set, const std::vector<record_piece>& pieces,
                          std::size_t lags) {
    okid_accumulator_reset(to);
    const std::vector<double> silence(lags * set.channels());
    for (const record_piece& piece : pieces) {
        const std::size_t before = std::min(lags, piece.first);
        const double* rows = set.rows(set.records[piece.record]) + (piece.first - before) * set.channels();
        okid_accumulator_gap(to, 0);
        okid_status_t status = okid_accumulator_add(to, silence.data(), lags - before);
        if (status >= 0) status = okid_accumulator_add(to, rows, before + piece.last - piece.first);
        if (status < 0) return status;
    }
    return OKID_OK;
}

replicate_model keep(const okid_model_t& model) {
    replicate_model out;
    out.n_u = model.n_u;
    out.n_y = model.n_y;
    out.n_z = model.n_z;
    out.A.assign(model.A, model.A + model.n_z * model.n_z);
    out.B.assign(model.B, model.B + model.n_z * model.n_u);
    out.C.assign(model.C, model.C + model.n_y * model.n_z);
    out.D.assign(model.D, model.D + model.n_y * model.n_u);
    return out;
}

/// The modes that stand elsewhere in `other` by more than two deviations, as text.
std::string moved(const okid_identified_t& model, const std::vector<mode_shift>& other, const deviations& sigma) {
    std::string text;
    for (int k = 0; k < model.mode_count && !other.empty(); ++k) {
        const auto at = static_cast<std::size_t>(k);
        const double f = model.frequency_hz[k], zeta = model.damping_ratio[k];
        if (!(sigma.frequency_hz[at] > 0) || !(sigma.damping_ratio[at] > 0)) continue;
        const auto distance = [f](const mode_shift& mode) { return std::abs(mode.frequency_hz - f); };
        const mode_shift& near = *std::min_element(
            other.begin(), other.end(), [&](const auto& a, const auto& b) { return distance(a) < distance(b); });
        const double df = (near.frequency_hz - f) / sigma.frequency_hz[at];
        const double dz = (near.damping_ratio - zeta) / sigma.damping_ratio[at];
        if (distance(near) > 0.05 * f || std::max(std::abs(df), std::abs(dz)) <= 2) continue;
        text += fmt::format("{}mode {} by {:+.1f} σ in f and {:+.1f} σ in ζ", text.empty() ? "" : ", ", k + 1, df, dz);
    }
    return text;
}

/// @return nullptr: the method, or this identification, has no derivative; or there is no memory
okid_jackknife_t* begin_jackknife(okid_jackknife_config_t shape, int linear, const record_work& work,
                                  okid_accumulator_t* whole, std::unique_ptr<std::byte[]>& block) {
    shape.linear = linear;
    const std::size_t bytes = okid_jackknife_memsize(&shape);
    block.reset(bytes > 0 ? new (std::nothrow) std::byte[bytes] : nullptr);
    okid_jackknife_t* out = nullptr;
    if (!block || okid_jackknife_create(&out, &shape, block.get(), bytes) != OKID_OK) return nullptr;
    const okid_status_t status = linear ? okid_jackknife_begin_linear(out, work.identifier, whole, &work.model)
                                        : okid_jackknife_begin(out, whole, &work.model);
    return status == OKID_OK ? out : nullptr;
}

} // namespace

std::vector<replicate_model> leave_out_blocks(const record_work& work, okid_accumulator_t* whole, int blocks,
                                              bool inputs) {
    okid_jackknife_config_t shape{};
    shape.modes_only = inputs ? 0 : 1;
    shape.identify = work.config;
    shape.identify.order = shape.identify.max_order = work.model.n_z;
    okid_accumulator_config(whole, &shape.sums);
    const auto lags = static_cast<std::size_t>(shape.sums.lags);
    const std::size_t older = work.older ? work.older->blocks() : 0;
    std::size_t parts =
        std::min(static_cast<std::size_t>(blocks), static_cast<std::size_t>(okid_accumulator_rows(whole)) / lags);
    if (older > 0) { // about as long as theirs, and not too few together
        const double alike = static_cast<double>(work.set.count()) / work.older->rows_of_block();
        const double fewest = older < usual_blocks ? static_cast<double>(usual_blocks - older) : 1;
        parts = std::min(parts, static_cast<std::size_t>(std::max(alike, fewest)));
    }
    std::vector<replicate_model> out;
    const owned_sums part(shape.sums);
    if (parts + older < std::size_t{fewest_blocks} || !part.sums) return out;
    std::unique_ptr<std::byte[]> block;
    const auto all_pieces = cut(work.set.records, work.at_rest ? 0 : lags, parts);
    const bool linear = work.analytic &&
                        (older > 0 || !one_block_rules(work.set, work.config.detrend == OKID_DETREND_MEAN, all_pieces));
    okid_jackknife_t* jackknife = linear ? begin_jackknife(shape, 1, work, whole, block) : nullptr;
    if (!jackknife) jackknife = begin_jackknife(shape, 0, work, whole, block);
    if (!jackknife) return out;
    if (okid_accumulator_copy(part.sums, whole) < 0) return out; // its units
    for (std::size_t k = 0; k < older + parts; ++k) {
        okid_accumulator_reset(part.sums);
        if (k < older ? !work.older->take_block(k, part.sums)
                      : feed_pieces(part.sums, work.set, all_pieces[k - older], lags) < 0)
            return {};
        if (okid_accumulator_rows(part.sums) == 0) continue;
        okid_model_t found{};
        double share = 0;
        const okid_status_t status = okid_jackknife_delete(jackknife, part.sums, 1, &found, &share);
        if (!(share > 0)) return {};
        out.push_back(status < 0 ? replicate_model{} : keep(found));
        out.back().share = share;
        if (k >= older) out.back().pieces = all_pieces[k - older];
    }
    return out;
}

deviations deviations_of(const okid_identified_t& model, const std::vector<replicate_model>& replicates,
                         const mass_plan& plan, std::vector<std::vector<mode_shift>>* modes) {
    replicate_statistics statistics(model.n_u, model.n_y, model.n_z, plan, model.dt);
    statistics.begin(model_view(model));
    for (const replicate_model& replicate : replicates) {
        const okid_model_t view = replicate.view();
        statistics.add(replicate.found() ? &view : nullptr, replicate.share);
        if (modes) modes->push_back(statistics.last());
    }
    return statistics.finish();
}

void remark_finite_p(const record_work& work, long long rows, const deviations& sigma, remarks& said) {
    const okid_identify_config_t& config = work.config;
    if (config.n_u == 0 || is_subspace(config.method)) return;
    okid_jackknife_config_t shape{};
    shape.identify = config;
    shape.identify.p = 2 * config.p;
    shape.identify.rows = work.model.rows;
    shape.identify.order = shape.identify.max_order = work.model.n_z;
    if (rows < 10LL * unknowns_of(config.method, config.n_u, config.n_y, shape.identify.p)) return;
    const std::int32_t lags = okid_identify_lags(&shape.identify);
    shape.sums = okid_accumulator_defaults(config.n_u, config.n_y, lags);
    shape.sums.edges = shape.sums.bulk = shape.sums.buffer = 1;
    const owned_sums longer(shape.sums);
    const std::size_t history = work.at_rest ? 0 : static_cast<std::size_t>(lags);
    std::unique_ptr<std::byte[]> block;
    if (!longer.sums ||
        feed_pieces(longer.sums, work.set, cut(work.set.records, history, 1)[0], static_cast<std::size_t>(lags)) < 0)
        return;
    okid_jackknife_t* jackknife = begin_jackknife(shape, 0, work, longer.sums, block);
    okid_model_t found{};
    double share = 0;
    if (!jackknife || okid_jackknife_delete(jackknife, nullptr, 1, &found, &share) < 0) return;
    const std::string text = moved(work.model, modes_in(found, work.model.dt), sigma);
    if (!text.empty())
        said.emplace_back(
            "finite_p_bias",
            fmt::format("p {} instead of {} moves {}: a bias that ± does not show. Use --p {} or more, or "
                        "an n4sid method",
                        shape.identify.p, config.p, text, shape.identify.p));
}

} // namespace okid_host
