// SPDX-License-Identifier: MIT
// PURPOSE  standard deviations of the modes of a consensus
// METHOD   CVA with the long horizon at one rate, at the order whose poles lie nearest to what the runs agree on; the same without
//          one block each. A mode that this order lacks, or holds by half, is looked at in up to two others
#include "carrier.hpp"

#include "files/side_by_side.hpp"
#include "record_work.hpp"
#include "result/judgement.hpp"
#include "result/method.hpp"

#include <okid/modal.h>
#include <okid/steps/square_root.h>

#include <algorithm>
#include <cmath>
#include <new>

namespace okid_host {
namespace {

constexpr double carried_shape = 0.8, carried_frequency = 0.01;
constexpr double farthest = 1;  // half-power bandwidths of a pole from a mode: beyond, it is none
constexpr int most_orders = 3;  // looked at for the deviations of a mode
constexpr double doubted = 0.5; // deviation of damping over damping: look at another order

std::unique_ptr<std::byte[]> carrier_memory(std::size_t bytes) {
    return std::unique_ptr<std::byte[]>(bytes ? new (std::nothrow) std::byte[bytes] : nullptr);
}

/// The records of a level, in units of the channels where the sums of older samples are.
record_set set_of(const record_level& level, std::size_t n_u, std::size_t n_y) {
    record_set out;
    out.n_u = n_u;
    out.n_y = n_y;
    for (const sample_rows& rows : level.records) out.add({}, rows.data(), rows.size() / out.channels());
    for (std::size_t i = 0; level.older && i < out.samples.size(); ++i)
        out.samples[i] *= level.scale[i % out.channels()];
    return out;
}

/// The model from the QR factor of the level: nearly noise-free data lose half their digits in a Gram matrix.
bool run_factor(const record_level& level, const okid_identify_config_t& config, bool at_rest,
                okid_identify_t* identifier, okid_identified_t& model) {
    okid_square_root_config_t shape{};
    shape.n_u = config.n_u;
    shape.n_y = config.n_y;
    shape.lags = okid_identify_lags(&config);
    shape.forgetting = 1;
    const std::size_t bytes = okid_square_root_memsize(&shape), m = static_cast<std::size_t>(config.n_u + config.n_y);
    const auto block = carrier_memory(bytes);
    okid_square_root_t* factor = nullptr;
    if (!block || okid_square_root_create(&factor, &shape, block.get(), bytes) != OKID_OK) return false;
    const auto lags = static_cast<std::size_t>(shape.lags);
    const std::vector<double> silence(at_rest ? lags * m : 0);
    for (const sample_rows& rows : level.records) {
        okid_square_root_gap(factor, 0);
        if (at_rest && okid_square_root_add(factor, silence.data(), lags) < 0) return false;
        if (okid_square_root_add(factor, rows.data(), rows.size() / m) < 0) return false;
    }
    return okid_identify_run_factor(identifier, factor, &model) >= 0;
}

/// Place of a mode among those of a model, or -1.
template <class Mode> int place_of(const std::vector<mode_shift>& all, const Mode& mode) {
    int best = -1;
    double least = INFINITY;
    for (int k = 0; k < static_cast<int>(all.size()); ++k) {
        const mode_shift& one = all[static_cast<std::size_t>(k)];
        const double e = std::abs(one.frequency_hz / mode.frequency_hz - 1);
        if (e > std::max(carried_frequency, mode.damping_ratio)) continue;
        const double mac = shape_mac(one.shape, mode.shape);
        const double cost =
            e / carried_frequency + 3 * (1 - mac) + 0.3 * std::abs(std::log(one.damping_ratio / mode.damping_ratio));
        if (mac > carried_shape && cost < least) least = cost, best = k;
    }
    return best;
}

/// How a mode moves from block to block; empty where a replicate lacks it.
std::vector<mode_shift> shifts_of(const mode_shift& whole, const std::vector<std::vector<mode_shift>>& replicates) {
    std::vector<mode_shift> out;
    const auto largest = static_cast<std::size_t>(
        std::max_element(whole.shape.begin(), whole.shape.end(),
                         [](const auto& a, const auto& b) { return std::norm(a) < std::norm(b); }) -
        whole.shape.begin());
    for (const auto& modes : replicates) {
        const int k = place_of(modes, whole);
        if (k < 0) return {};
        mode_shift& shift = out.emplace_back(modes[static_cast<std::size_t>(k)]);
        const std::complex<double> unit = shift.shape[largest] / whole.shape[largest];
        shift.frequency_hz -= whole.frequency_hz;
        shift.damping_ratio -= whole.damping_ratio;
        for (std::size_t i = 0; i < shift.shape.size(); ++i) shift.shape[i] = shift.shape[i] / unit - whole.shape[i];
    }
    return out;
}

carried_mode carried(const okid_identified_t& model, const std::optional<deviations>& sigma, int k) {
    carried_mode out;
    const auto at = static_cast<std::size_t>(k), n_y = static_cast<std::size_t>(model.n_y);
    out.frequency_hz = model.frequency_hz[k];
    out.damping_ratio = model.damping_ratio[k];
    for (std::size_t i = 0; i < n_y; ++i)
        out.shape.emplace_back(model.shape_re[at * n_y + i], model.shape_im[at * n_y + i]);
    if (!sigma) return out;
    out.frequency_std_hz = sigma->frequency_hz[at];
    out.damping_std = sigma->damping_ratio[at];
    const auto first = static_cast<std::ptrdiff_t>(at * n_y), last = static_cast<std::ptrdiff_t>((at + 1) * n_y);
    out.shape_re_std.assign(sigma->shape_re.begin() + first, sigma->shape_re.begin() + last);
    out.shape_im_std.assign(sigma->shape_im.begin() + first, sigma->shape_im.begin() + last);
    return out;
}

} // namespace

const consensus_run* long_run(const std::vector<consensus_run>& runs, int level) {
    const consensus_run* out = nullptr;
    for (const consensus_run& run : runs)
        if (run.level == level && run.method == OKID_METHOD_N4SID_CVA && (!out || run.rows > out->rows)) out = &run;
    return out;
}

std::vector<int> carrying_orders(const consensus_run& run, const std::vector<mode_shift>& wanted) {
    std::vector<std::pair<double, int>> order;
    for (const int n : run.orders) {
        double away = 0;
        for (const mode_shift& mode : wanted) {
            double least = farthest;
            for (const run_pole& pole : run.poles) {
                if (pole.order != n || shape_mac(pole.shape, mode.shape) < carried_shape) continue;
                const double f = (pole.frequency_hz / mode.frequency_hz - 1) / mode.damping_ratio;
                least = std::min(least, std::hypot(f, pole.damping_ratio / mode.damping_ratio - 1));
            }
            away += least * least;
        }
        if (away < static_cast<double>(wanted.size()) * farthest * farthest) order.emplace_back(away, n);
    }
    std::sort(order.begin(), order.end());
    std::vector<int> out;
    for (const auto& [away, n] : order) out.push_back(n);
    return out;
}

std::vector<std::optional<carried_mode>> carried_by(const okid_identified_t& model,
                                                    const std::vector<replicate_model>& replicates,
                                                    const std::vector<mode_shift>& wanted) {
    std::vector<std::optional<carried_mode>> out(wanted.size());
    std::optional<deviations> sigma;
    std::vector<std::vector<mode_shift>> moved;
    if (!replicates.empty()) sigma = deviations_of(model, replicates, {}, &moved);
    const auto here =
        modes_in(model.frequency_hz, model.damping_ratio, model.shape_re, model.shape_im, model.mode_count, model.n_y);
    std::vector<double> shares; // of what no force moves
    if (model.n_u == 0)
        for (const replicate_model& one : replicates) shares.push_back(one.share);
    for (std::size_t i = 0; i < wanted.size(); ++i) {
        const int k = place_of(here, wanted[i]);
        if (k < 0) continue;
        out[i] = carried(model, sigma, k);
        out[i]->mpc = model.mpc[k];
        out[i]->shifts = shifts_of(here[static_cast<std::size_t>(k)], moved);
        out[i]->wider = widening_of(out[i]->shifts, shares);
    }
    return out;
}

namespace {

/// One level, its sums, and what is asked of it.
struct carrier_task {
    const record_level& level;
    const consensus_run& run;
    const owned_sums& sums;
    int n_u, n_y, blocks;
    bool at_rest, analytic;
};

/// A mode as the record has it, of a stream that has its band folded. The decay is the same in both.
void unfold(const zoom_band& zoom, carried_mode& mode) {
    if (zoom.number == 0) return;
    const double frequency = mode.frequency_hz;
    zoom.unfold(mode.frequency_hz, mode.damping_ratio);
    const double share = frequency / mode.frequency_hz; // of a damping ratio
    mode.damping_std *= share;
    for (auto& entry : mode.shape) entry = zoom.turned(entry);
    for (mode_shift& shift : mode.shifts) {
        if (zoom.number % 2) shift.frequency_hz = -shift.frequency_hz;
        shift.damping_ratio *= share;
        for (auto& entry : shift.shape) entry = zoom.turned(entry);
    }
}

/// The modes wanted as the model of one order has them.
std::vector<std::optional<carried_mode>> carry_at(const carrier_task& task, int order, std::vector<mode_shift> wanted) {
    const zoom_band zoom = task.level.zoom();
    std::vector<std::optional<carried_mode>> out(wanted.size());
    okid_identify_config_t config = run_config(task.run, task.n_u, task.n_y);
    config.order = config.max_order = order;
    const std::size_t bytes = okid_identify_memsize(&config);
    const auto block = carrier_memory(bytes);
    okid_identify_t* identifier = nullptr;
    okid_identified_t model{};
    const auto find_poles = [&] { // neither B nor D nor K is asked for
        return okid_identify_decompose(identifier, task.sums.sums, &model) >= 0 &&
               okid_identify_poles(identifier, std::min(order, okid_identify_max_order(&config)), &model) >= 0;
    };
    if (!block || okid_identify_create(&identifier, &config, block.get(), bytes) != OKID_OK || !find_poles())
        return out;
    const bool nearly_singular = (model.warnings & OKID_NOTE_ILL_CONDITIONED) && model.observer_info.ridge <= 1e-10;
    const bool exact = nearly_singular && run_factor(task.level, config, task.at_rest, identifier, model);
    if (nearly_singular && !exact && !find_poles()) return out;
    std::vector<replicate_model> replicates;
    if (task.blocks > 0) {
        record_work work;
        work.set = set_of(task.level, static_cast<std::size_t>(task.n_u), static_cast<std::size_t>(task.n_y));
        work.at_rest = task.at_rest;
        work.config = config;
        work.model = model;
        work.identifier = identifier;
        work.analytic = task.analytic;
        work.older = task.level.older;
        replicates = leave_out_blocks(work, task.sums.sums, task.blocks, false);
    }
    for (mode_shift& mode : wanted) {
        zoom.fold(mode.frequency_hz, mode.damping_ratio);
        for (auto& entry : mode.shape) entry = zoom.turned(entry);
    }
    out = carried_by(model, replicates, wanted);
    for (auto& one : out) {
        if (!one) continue;
        one->exact = exact;
        unfold(zoom, *one);
        if (!task.level.zoomed)
            one->by = {task.run.level,        config,          one->frequency_hz, one->damping_ratio, one->shape,
                       one->frequency_std_hz, one->damping_std};
    }
    return out;
}

/// Is there a deviation, and one to be believed at once?
bool surely(const carried_mode& one) { return one.damping_std < doubted * one.damping_ratio; }

/// Of what several orders say of a mode, the one whose deviation of damping is the middle one of those known.
std::optional<carried_mode> middle(std::vector<carried_mode> all) {
    if (all.empty()) return std::nullopt;
    std::vector<std::pair<double, std::size_t>> known;
    for (std::size_t i = 0; i < all.size(); ++i)
        if (std::isfinite(all[i].damping_std)) known.emplace_back(all[i].damping_std, i);
    std::sort(known.begin(), known.end());
    return std::move(all[known.empty() ? 0 : known[(known.size() - 1) / 2].second]);
}

} // namespace

std::vector<std::optional<carried_mode>> carry(const record_level& level, int number,
                                               const std::vector<consensus_run>& runs,
                                               const std::vector<consensus_mode>& modes, int n_u, int n_y, bool at_rest,
                                               int blocks, bool analytic) {
    std::vector<std::optional<carried_mode>> out(modes.size());
    std::vector<std::size_t> left; // modes that want an order
    for (std::size_t i = 0; i < modes.size(); ++i)
        if (modes[i].level == number && modes[i].confident()) left.push_back(i);
    const consensus_run* run = long_run(runs, number);
    if (!run || left.empty()) return out;
    const auto sums = sums_of(*run, level, n_u, n_y, at_rest);
    if (!sums->sums) return out;
    const carrier_task task{level, *run, *sums, n_u, n_y, blocks, at_rest, analytic};
    std::vector<std::vector<carried_mode>> said(modes.size());
    std::vector<int> used;
    while (!left.empty() && used.size() < most_orders) {
        std::vector<mode_shift> wanted;
        for (const std::size_t i : left)
            wanted.push_back({modes[i].frequency_hz, modes[i].damping_ratio, modes[i].shape});
        const std::vector<int> orders = carrying_orders(*run, wanted);
        const auto next = std::find_if(orders.begin(), orders.end(),
                                       [&](int n) { return std::find(used.begin(), used.end(), n) == used.end(); });
        if (next == orders.end()) break;
        used.push_back(*next);
        auto found = carry_at(task, *next, wanted);
        std::vector<std::size_t> still;
        for (std::size_t k = 0; k < left.size(); ++k) {
            if (found[k]) said[left[k]].push_back(std::move(*found[k]));
            if (blocks > 0 && (said[left[k]].empty() || !surely(said[left[k]].back()))) still.push_back(left[k]);
        }
        left = std::move(still);
    }
    for (std::size_t i = 0; i < modes.size(); ++i) out[i] = middle(std::move(said[i]));
    return out;
}

namespace {

/// A force that is held over a sample is not held over two: the shapes of a lower rate are bent by a percent or so. Those
/// of modes that the record's own rate sees are taken there, of nearly noise-free records frequency and damping too.
void shapes_at_own_rate(const std::vector<record_level>& levels, const std::vector<consensus_run>& runs,
                        std::vector<consensus_mode> modes, const record_options& options, bool rest,
                        std::vector<listed_pair>& carried) {
    if (std::none_of(modes.begin(), modes.end(), [](const consensus_mode& mode) { return mode.level > 0; })) return;
    for (consensus_mode& mode : modes) mode.level = 0; // one order for all of them
    const auto found = carry(levels[0], 0, runs, modes, static_cast<int>(options.inputs.size()),
                             static_cast<int>(options.outputs.size()), rest,
                             options.mass.wanted() ? options.sigma_blocks : 0, options.analytic);
    for (std::size_t i = 0; i < found.size(); ++i) {
        auto& to = carried[i].second;
        if (!found[i] || !to || carried[i].first.level == 0) continue;
        to->shape = found[i]->shape;
        if (found[i]->exact) {
            to->exact = true;
            to->frequency_hz = found[i]->frequency_hz;
            to->damping_ratio = found[i]->damping_ratio;
        }
        if (to->shifts.size() != found[i]->shifts.size()) continue;
        for (std::size_t b = 0; b < to->shifts.size(); ++b) to->shifts[b].shape = found[i]->shifts[b].shape;
    }
}

/// Two clusters that one model of all modes of their rate has as a single pole are one mode: the weaker is doubtful.
void mark_doubles(std::vector<listed_pair>& found) {
    for (auto& [mode, carried] : found)
        for (const auto& [other, its] : found)
            if (carried && its && other.level == mode.level && other.agreement > mode.agreement &&
                carried->frequency_hz == its->frequency_hz && carried->damping_ratio == its->damping_ratio) {
                mode.why.emplace_back("split");
                carried.reset();
            }
}

} // namespace

std::vector<listed_pair> carry_all(const std::vector<record_level>& levels, const std::vector<consensus_run>& runs,
                                   const std::vector<consensus_mode>& modes, const record_options& options, bool rest) {
    std::vector<listed_pair> out;
    for (const consensus_mode& mode : modes) out.emplace_back(mode, std::nullopt);
    std::vector<std::vector<std::optional<carried_mode>>> found(levels.size());
    side_by_side(levels.size(), options.threads, [&](std::size_t k) {
        const bool any = std::any_of(modes.begin(), modes.end(), [&](const consensus_mode& mode) {
            return mode.confident() && mode.level == static_cast<int>(k);
        });
        if (any)
            found[k] = carry(levels[k], static_cast<int>(k), runs, modes, static_cast<int>(options.inputs.size()),
                             static_cast<int>(options.outputs.size()), rest, options.sigma_blocks, options.analytic);
    });
    for (const auto& of_level : found)
        for (std::size_t i = 0; i < of_level.size(); ++i)
            if (of_level[i]) out[i].second = of_level[i];
    mark_doubles(out);
    if (!options.inputs.empty()) shapes_at_own_rate(levels, runs, modes, options, rest, out);
    for (auto& [mode, carried] : out) {
        if (!carried) continue;
        if (carried->exact) {
            mode.frequency_hz = carried->frequency_hz;
            mode.damping_ratio = carried->damping_ratio;
        }
        mode.shape = carried->shape;
        // without a force, and without a shape or most of the runs, noise agrees by chance, but not from block to block
        if (options.inputs.empty() && (options.outputs.size() == 1 || mode.agreement < judgement::agreed_by_chance) &&
            carried->damping_std > judgement::widest_damping * mode.damping_ratio)
            mode.why.emplace_back("wide_sigma");
        if (carried->exact) continue;
        // what a model leaves out moves each method elsewhere, and no block of the record shows it
        carried->frequency_std_hz = std::hypot(carried->frequency_std_hz, mode.frequency_scatter_hz);
        carried->damping_std = std::hypot(carried->damping_std, mode.damping_scatter);
    }
    return out;
}

} // namespace okid_host
