// SPDX-License-Identifier: MIT
// PURPOSE  where the modes of auto are now, between two decisions which they are
// METHOD   the filters of consensus/levels.hpp sample by sample, an accumulator for each rate. The models that carried the modes
//          when they were decided are made anew; a mode moves as far as its carrier did, and keeps what the runs agreed on
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
    const okid_identify_config_t carrier = longest_run(n_u, n_y, fs_hz);
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
      m_(config.channels()), rates_(most_levels), missing_(m_, NAN) {
    double fs_hz = config.rate_hz;
    for (std::size_t k = 0; k < rates_.size(); ++k) {
        rate& mine = rates_[k];
        mine.factor = k > 0 ? 2 : static_cast<std::size_t>(config.wanted.decimate);
        fs_hz /= static_cast<double>(mine.factor);
        mine.fs_hz = fs_hz;
        if (mine.factor > 1) mine.weights = decimation_weights(static_cast<int>(mine.factor));
        mine.waiting.reserve(4 * mine.weights.size() * m_);
        mine.row.resize(m_);
        const okid_accumulator_config_t sums = sums_config(config, fs_hz, window);
        const std::size_t bytes = okid_accumulator_memsize(&sums);
        mine.block = memory(bytes);
        if (!mine.block || okid_accumulator_create(&mine.sums, &sums, mine.block.get(), bytes) != OKID_OK)
            throw failure(exit_device, "out of memory for the sums of method auto");
    }
}

/// A row of rate k, and what it makes of the lower ones.
void followed_modes::push(std::size_t k, const double* row) {
    if (okid_accumulator_add(rates_[k].sums, row, 1) < 0) return; // never: doubles have no range
    if (k + 1 < rates_.size()) into_filter(k + 1, row);
}

void followed_modes::into_filter(std::size_t k, const double* row) {
    rate& mine = rates_[k];
    const std::size_t taps = mine.weights.size();
    if (taps == 0) return push(k, row);
    if (mine.waiting.size() + m_ > mine.waiting.capacity())
        mine.waiting.erase(mine.waiting.begin(),
                           mine.waiting.end() - static_cast<std::ptrdiff_t>((taps - 1) * m_)); // a filter less one row
    mine.waiting.insert(mine.waiting.end(), row, row + m_);
    ++mine.came;
    if (mine.came < taps || (mine.came - taps) % mine.factor != 0) return;
    const double* first = mine.waiting.data() + mine.waiting.size() - taps * m_;
    std::fill(mine.row.begin(), mine.row.end(), 0.0);
    for (std::size_t i = 0; i < taps; ++i)
        for (std::size_t c = 0; c < m_; ++c) mine.row[c] += mine.weights[i] * first[i * m_ + c];
    push(k, mine.row.data());
}

void followed_modes::add(const double* row) { into_filter(0, row); }

void followed_modes::add_missing(std::int64_t count) {
    // Missing rows go through the filters, so that the lower rates keep their step; after a gap that is longer than all
    // filters together look back each rate begins again.
    const auto longest = static_cast<std::int64_t>((most_levels * rates_[1].weights.size()) << most_levels);
    if (count > 0 && count < longest) {
        for (; count > 0; --count) into_filter(0, missing_.data());
        return;
    }
    for (rate& each : rates_) {
        okid_accumulator_gap(each.sums,
                             static_cast<std::int64_t>(static_cast<double>(count) * each.fs_hz / rates_[0].fs_hz));
        each.waiting.clear();
        each.came = 0;
    }
}

void followed_modes::reset() {
    for (rate& each : rates_) {
        okid_accumulator_reset(each.sums);
        each.waiting.clear();
        each.came = 0;
    }
    groups_.clear();
}

/// What the carrier of a group says of its modes.
std::vector<std::optional<std::pair<double, double>>> followed_modes::now(const group& of) {
    std::vector<std::optional<std::pair<double, double>>> out(of.modes.size());
    const std::size_t bytes = okid_identify_memsize(&of.config);
    const auto block = memory(bytes);
    okid_identify_t* identifier = nullptr;
    okid_identified_t model{};
    if (!block || okid_identify_create(&identifier, &of.config, block.get(), bytes) != OKID_OK ||
        okid_identify_run(identifier, rates_[of.rate].sums, &model) < 0)
        return out;
    const auto found = carried_by(model, {}, of.wanted);
    for (std::size_t i = 0; i < found.size(); ++i)
        if (found[i]) out[i] = {found[i]->frequency_hz, found[i]->damping_ratio};
    return out;
}

void followed_modes::begin(const record_result& found) {
    groups_.clear();
    if (found.scale.size() != m_) return; // places of a hammer, or an output that is left out
    std::vector<double> units;
    for (const double spread : found.scale) units.push_back(1 / spread);
    for (rate& each : rates_) okid_accumulator_set_units(each.sums, units.data(), nullptr);
    for (std::size_t i = 0; i < found.carriers.size(); ++i) {
        const mode_carrier& by = found.carriers[i];
        if (by.level < 0) continue;
        const auto k = static_cast<std::size_t>(by.level);
        const okid_identify_config_t full = longest_run(n_u_, n_y_, rates_[k].fs_hz);
        if (by.config.rows != full.rows || by.config.n_u != n_u_ || by.config.n_y != n_y_) continue; // too short as yet
        auto at = std::find_if(groups_.begin(), groups_.end(),
                               [&](const group& one) { return one.rate == k && one.config.order == by.config.order; });
        if (at == groups_.end()) {
            at = groups_.insert(at, {k, by.config, {}, {}, {}});
            at->config.detrend = OKID_DETREND_MEAN;
        }
        at->modes.push_back(i);
        at->wanted.push_back({by.frequency_hz, by.damping_ratio, by.shape});
    }
    for (group& one : groups_) one.then = now(one);
}

void followed_modes::follow(kept_model& to) {
    double *f = to.own(to.view().frequency_hz), *zeta = to.own(to.view().damping_ratio);
    for (const group& one : groups_) {
        const auto found = now(one);
        for (std::size_t i = 0; i < found.size(); ++i) {
            if (!found[i] || !one.then[i]) continue;
            f[one.modes[i]] += found[i]->first - one.then[i]->first;
            zeta[one.modes[i]] = std::max(0.0, zeta[one.modes[i]] + found[i]->second - one.then[i]->second);
        }
    }
}

} // namespace okid_host
