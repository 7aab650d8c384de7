// SPDX-License-Identifier: MIT
// PURPOSE  where the modes of auto are now, between two decisions which they are
// METHOD   the filters of consensus/levels.hpp sample by sample, an accumulator for each rate. The models that carried the modes
//          when they were decided are made again; a mode moves by the share of the move of its carrier that is not the carrier's
//          own noise, and keeps what the runs agreed on. Where the result rests on a part of the rows, as on free decays, it stays:
//          the sums hold all of them
#include "followed_modes.hpp"

#include "consensus/consensus_runs.hpp"
#include "error.hpp"
#include "record/carrier.hpp"

#include <algorithm>
#include <cmath>
#include <new>

namespace okid_host {
namespace {

constexpr int slots_of_window = 40; // a window drops a fortieth of itself at a time

std::unique_ptr<std::byte[]> memory(std::size_t bytes) {
    return std::unique_ptr<std::byte[]>(bytes > 0 ? new (std::nothrow) std::byte[bytes] : nullptr);
}

} // namespace

okid_accumulator_config_t followed_modes::sums_config(const stream_config& config, double fs_hz, std::int64_t window) {
    const auto n_u = static_cast<int>(config.inputs.size()), n_y = static_cast<int>(config.outputs.size());
    const okid_identify_config_t carrier = longest_run(n_u, n_y, fs_hz, true);
    okid_accumulator_config_t out = okid_accumulator_defaults(n_u, n_y, okid_identify_lags(&carrier));
    out.edges = 1;
    if (window > 0) {
        const double samples = static_cast<double>(window) * fs_hz / config.rate_hz;
        out.block = std::max(1, static_cast<int>(std::lround(samples / slots_of_window)));
        out.slots = std::max(1, static_cast<int>(std::lround(samples / out.block)));
        out.spare_slots = out.slots;
    }
    return out;
}

double followed_modes::bytes(const stream_config& config, std::int64_t window) {
    double out = 0, fs_hz = config.rate_hz / config.wanted.decimate;
    for (std::size_t k = 0; k < most_levels; ++k, fs_hz /= 2) {
        const okid_accumulator_config_t sums = sums_config(config, fs_hz, window);
        out += static_cast<double>(okid_accumulator_memsize(&sums));
    }
    return out;
}

followed_modes::followed_modes(const stream_config& config, std::int64_t window)
    : n_u_(static_cast<int>(config.inputs.size())), n_y_(static_cast<int>(config.outputs.size())),
      m_(config.channels()), chain_(m_, config.rate_hz, config.wanted.decimate), missing_(m_, NAN) {
    for (std::size_t k = 0; k < chain_.count(); ++k) {
        sums_.emplace_back(sums_config(config, chain_.fs_hz(k), window));
        if (!sums_.back().sums) throw failure(exit_device, "out of memory for the sums of method auto");
    }
}

void followed_modes::add(const double* row) {
    chain_.add(row, [this](std::size_t k, const double* of_rate) {
        if (okid_accumulator_add(sums_[k].sums, of_rate, 1) < 0) groups_.clear(); // never: doubles have no range
    });
}

void followed_modes::add_missing(std::int64_t count) {
    // Missing rows go through the filters, so that the lower rates keep their step; after a gap that is longer than all
    // filters together look back each rate begins again.
    if (count > 0 && count < chain_.look_back()) {
        for (; count > 0; --count) add(missing_.data());
        return;
    }
    chain_.begin_record(false);
    for (std::size_t k = 0; k < sums_.size(); ++k)
        okid_accumulator_gap(sums_[k].sums,
                             static_cast<std::int64_t>(static_cast<double>(count) * chain_.fs_hz(k) / chain_.fs_hz(0)));
}

void followed_modes::reset() {
    chain_.begin_record(false);
    for (const owned_sums& each : sums_) okid_accumulator_reset(each.sums);
    groups_.clear();
}

/// Sums with as many lags as a run asks for, out of those of its rate; none: they have as many.
owned_sums followed_modes::shortened(const group& of) const {
    okid_accumulator_config_t held{};
    const int lags = okid_identify_lags(&of.config);
    okid_accumulator_config(sums_[of.rate].sums, &held);
    if (held.lags == lags) return {};
    return with_fewer_lags(sums_[of.rate].sums, n_u_, n_y_, lags, units_);
}

/// What the carrier of a group says of its modes.
std::vector<std::optional<std::pair<double, double>>> followed_modes::now(const group& of) {
    std::vector<std::optional<std::pair<double, double>>> out(of.modes.size());
    const std::size_t bytes = okid_identify_memsize(&of.config);
    const auto block = memory(bytes);
    okid_identify_t* identifier = nullptr;
    okid_identified_t model{};
    const owned_sums own = shortened(of);
    if (!block || okid_identify_create(&identifier, &of.config, block.get(), bytes) != OKID_OK ||
        okid_identify_run(identifier, own.sums ? own.sums : sums_[of.rate].sums, &model) < 0)
        return out;
    const auto found = carried_by(model, {}, of.wanted);
    for (std::size_t i = 0; i < found.size(); ++i)
        if (found[i]) out[i] = {found[i]->frequency_hz, found[i]->damping_ratio};
    return out;
}

/// Share of a carrier's move that its mode makes too. A mode known better than its carrier (by maximum likelihood) is an efficient
/// estimate: what the carrier's variance has beyond it is noise of its own. Var(v) / Var(c) is the regression of one move on the other.
double followed_modes::share_of(double deviation, double of_carrier) {
    const double share = deviation / of_carrier;
    return share < 1 ? share * share : 1; // not known: all of it
}

void followed_modes::begin(const record_result& found) {
    groups_.clear();
    if (found.scale.size() != m_) return; // places of a hammer, or an output that is left out
    units_.clear();
    for (const double spread : found.scale) units_.push_back(1 / spread);
    for (const owned_sums& each : sums_) okid_accumulator_set_units(each.sums, units_.data(), nullptr);
    of_part_ = has_remark(found.context.warnings, "free_decays") || has_remark(found.context.warnings, "force_window");
    for (std::size_t i = 0; i < found.carriers.size(); ++i) {
        const mode_carrier& by = found.carriers[i];
        if (by.level < 0) continue;
        const auto k = static_cast<std::size_t>(by.level);
        const int usual = longest_run(n_u_, n_y_, chain_.fs_hz(k), false).rows,
                  crowded = longest_run(n_u_, n_y_, chain_.fs_hz(k), true).rows;
        if (by.config.n_u != n_u_ || by.config.n_y != n_y_) continue;
        if (by.config.rows != usual && by.config.rows != crowded) continue; // too short as yet
        auto at = std::find_if(groups_.begin(), groups_.end(),
                               [&](const group& one) { return one.rate == k && one.config.order == by.config.order; });
        if (at == groups_.end()) {
            at = groups_.insert(at, {k, by.config, {}, {}, {}});
            at->config.detrend = OKID_DETREND_MEAN;
        }
        const std::optional<deviations>& sigma = found.context.sigma;
        at->modes.push_back({i, share_of(sigma ? sigma->frequency_hz[i] : NAN, by.frequency_std_hz),
                             share_of(sigma ? sigma->damping_ratio[i] : NAN, by.damping_std)});
        at->wanted.push_back({by.frequency_hz, by.damping_ratio, by.shape});
    }
    if (of_part_) return;
    for (group& one : groups_) one.then = now(one);
}

void followed_modes::follow(double kept, kept_model& to, std::optional<deviations>& sigma) {
    if (of_part_) return;
    double *f = to.own(to.view().frequency_hz), *zeta = to.own(to.view().damping_ratio);
    for (const group& one : groups_) {
        const auto found = now(one);
        for (std::size_t i = 0; i < found.size(); ++i) {
            if (!found[i] || !one.then[i]) continue;
            const auto& [mode, share_f, share_zeta] = one.modes[i];
            f[mode] += share_f * (found[i]->first - one.then[i]->first);
            zeta[mode] = std::max(0.0, zeta[mode] + share_zeta * (found[i]->second - one.then[i]->second));
            if (!sigma) continue;
            sigma->frequency_hz[mode] *= std::sqrt(1 - share_f * (1 - kept));
            sigma->damping_ratio[mode] *= std::sqrt(1 - share_zeta * (1 - kept));
        }
    }
}

} // namespace okid_host
