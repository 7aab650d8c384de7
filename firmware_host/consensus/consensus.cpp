// SPDX-License-Identifier: MIT
// PURPOSE  what a mode of the structure is, decided by agreement
// METHOD   poles of each run (method, horizon, rate) are linked over the orders by frequency, damping and shape; the tracks of
//          all runs are gathered into clusters by frequency and shape; a cluster's vote counts the runs that could have seen it.
//          agreement = found_in x EMAC x (1 + MPC)/2 / (1 + (scatter of damping / 0.6)^2): a mode is believed from one half on
#include "consensus.hpp"

#include "files/order_statistics.hpp"
#include "quantity.hpp"
#include "result/judgement.hpp"
#include "result/method.hpp"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <numeric>
#include <tuple>

namespace okid_host {
namespace {

constexpr double as_near = 1e-4; // distances from a median, in thousandths of f and 2 % of the damping, that are one

template <class Item, class Of> double median_of(const std::vector<Item>& items, Of of) {
    std::vector<double> values;
    for (const auto& item : items) values.push_back(of(item));
    return median(std::move(values));
}

double relative_spread(const std::vector<double>& values, double about) {
    double mean = 0, square = 0;
    for (const double v : values) mean += v / static_cast<double>(values.size());
    for (const double v : values) square += (v - mean) * (v - mean);
    return std::sqrt(square / static_cast<double>(values.size())) / about;
}

using chain = std::vector<const run_pole*>;

/// Relative distance in frequency that weighs as much as a fifth of the shape: by a hundredth alone, each of a doublet is as near
/// as the other.
double one_apart(double damping_ratio) {
    return std::clamp(judgement::same_widths * damping_ratio, judgement::least_same_frequency,
                      judgement::same_frequency);
}

/// Distance of a pole from the end of a chain; infinite when they are not the same.
double link_cost(const run_pole& pole, const run_pole& last, double most_hz) {
    if (last.order < pole.order - judgement::order_reach) return INFINITY;
    const double e = std::abs(pole.frequency_hz - last.frequency_hz) / std::min(last.frequency_hz, most_hz);
    const double narrow = std::min(pole.damping_ratio, last.damping_ratio),
                 wide = std::max(pole.damping_ratio, last.damping_ratio);
    if (e >= std::max(judgement::same_frequency, narrow) || e >= 3 * judgement::same_frequency) return INFINITY;
    const double dz = std::abs(pole.damping_ratio - last.damping_ratio);
    if (dz >= std::max(judgement::same_damping * wide, 1e-3)) return INFINITY;
    const double mac = shape_mac(pole.shape, last.shape);
    return mac > judgement::same_shape_of_a_run ? e / one_apart(narrow) + 5 * (1 - mac) + dz / wide : INFINITY;
}

/// Continue the chains with the poles of the next order, each by at most one, the nearest first.
void extend(std::vector<chain>& chains, const std::vector<const run_pole*>& next, double most_hz) {
    struct link {
        double cost;
        std::size_t track, pole;
    };
    std::vector<link> links;
    for (std::size_t j = 0; j < next.size(); ++j)
        for (std::size_t t = 0; t < chains.size(); ++t)
            if (const double cost = link_cost(*next[j], *chains[t].back(), most_hz); std::isfinite(cost))
                links.push_back({cost, t, j});
    std::sort(links.begin(), links.end(), [](const link& a, const link& b) {
        return std::tie(a.cost, a.track, a.pole) < std::tie(b.cost, b.track, b.pole);
    });
    std::vector<bool> taken(next.size()), continued(chains.size());
    for (const link& l : links) {
        if (continued[l.track] || taken[l.pole]) continue;
        continued[l.track] = taken[l.pole] = true;
        chains[l.track].push_back(next[l.pole]);
    }
    for (std::size_t j = 0; j < next.size(); ++j)
        if (!taken[j]) chains.push_back({next[j]});
}

run_track track_of(const chain& poles) {
    run_track out;
    const auto med = [&](auto of) { return median_of(poles, of); };
    out.frequency_hz = med([](const run_pole* p) { return p->frequency_hz; });
    out.damping_ratio = med([](const run_pole* p) { return p->damping_ratio; });
    out.mpc = med([](const run_pole* p) { return p->mpc; });
    out.emac = med([](const run_pole* p) { return p->emac; });
    std::vector<double> f, z;
    const run_pole* best = nullptr;
    double nearest = INFINITY;
    for (const run_pole* p : poles) {
        f.push_back(p->frequency_hz);
        z.push_back(p->damping_ratio);
        out.orders.push_back(p->order);
        const double d = std::abs(p->frequency_hz / out.frequency_hz - 1) / 1e-3 +
                         std::abs(p->damping_ratio / out.damping_ratio - 1) / 2e-2;
        // of an even number the two in the middle are as near: the lower order then, not what rounding says
        if (d < nearest - as_near) nearest = d, best = p;
    }
    out.frequency_spread = relative_spread(f, out.frequency_hz);
    out.damping_spread = relative_spread(z, out.damping_ratio);
    out.length = static_cast<int>(poles.size());
    out.shape = best->shape;
    return out;
}

/// Do higher orders resolve it into two, one on either side, of other shapes?
bool is_resolved(const run_track& track, const std::vector<run_track>& tracks, int highest) {
    const run_track *below = nullptr, *above = nullptr;
    for (const run_track& other : tracks) {
        const double apart = other.frequency_hz - track.frequency_hz;
        if (other.orders.front() < track.orders.back() || other.orders.back() < highest ||
            std::abs(apart) > track.damping_ratio * track.frequency_hz)
            continue;
        const run_track*& side = apart < 0 ? below : above;
        if (!side || std::abs(apart) < std::abs(side->frequency_hz - track.frequency_hz)) side = &other;
    }
    return below && above && shape_mac(below->shape, above->shape) < judgement::same_shape;
}

struct member {
    int run, track;
    const run_track* found;
    double rank; // best first
};

/// Every track of every run, those that can be seen first, the steady and long ones before the others.
std::vector<member> ranked(const std::vector<consensus_run>& runs) {
    std::vector<member> out;
    for (std::size_t r = 0; r < runs.size(); ++r)
        for (std::size_t t = 0; t < runs[r].tracks.size(); ++t) {
            const run_track& track = runs[r].tracks[t];
            if (!in_band(runs[r], track.frequency_hz) || track.damping_ratio >= judgement::overdamped) continue;
            const double rank = (can_see(runs[r], track.frequency_hz) ? 0.0 : 1e3) + track.damping_spread +
                                100 * track.frequency_spread - 0.02 * track.length;
            out.push_back({static_cast<int>(r), static_cast<int>(t), &track, rank});
        }
    std::sort(out.begin(), out.end(), [](const member& a, const member& b) {
        return std::tie(a.rank, a.run, a.track) < std::tie(b.rank, b.run, b.track);
    });
    return out;
}

struct cluster {
    std::vector<member> members;
    double frequency_hz = 0, damping_ratio = 0;

    bool holds(int run) const {
        return std::any_of(members.begin(), members.end(), [&](const member& m) { return m.run == run; });
    }
    /// Has the run of a track another one, of this shape and damping, that is much nearer, where the track is a bandwidth off or more?
    bool nearer_in(const consensus_run& run, const run_track& than) const {
        const double apart = std::abs(than.frequency_hz - frequency_hz);
        if (apart < judgement::same_widths * std::min(than.damping_ratio, damping_ratio) * frequency_hz) return false;
        return std::any_of(run.tracks.begin(), run.tracks.end(), [&](const run_track& t) {
            const double wider = t.damping_ratio / damping_ratio;
            return std::abs(t.frequency_hz - frequency_hz) < judgement::much_nearer * apart &&
                   std::max(wider, 1 / wider) < judgement::as_lightly_damped &&
                   shape_mac(t.shape, members.front().found->shape) >= judgement::same_shape;
        });
    }
    double cost(const member& m) const {
        const run_track& t = *m.found;
        const double e = std::abs(t.frequency_hz / frequency_hz - 1);
        if (e > std::max(judgement::same_frequency, 0.5 * std::min(t.damping_ratio, damping_ratio)) || holds(m.run))
            return INFINITY;
        const double mac = shape_mac(t.shape, members.front().found->shape);
        if (mac < judgement::same_shape) return INFINITY;
        return e / one_apart(std::min(t.damping_ratio, damping_ratio)) + 3 * (1 - mac) +
               0.3 * std::abs(std::log(t.damping_ratio / damping_ratio));
    }
    void add(const member& m) {
        members.push_back(m);
        frequency_hz = median_of(members, [](const member& x) { return x.found->frequency_hz; });
        damping_ratio = median_of(members, [](const member& x) { return x.found->damping_ratio; });
    }
};

std::vector<cluster> gather(const std::vector<consensus_run>& runs) {
    std::vector<cluster> clusters;
    for (const member& m : ranked(runs)) {
        cluster* best = nullptr;
        double least = INFINITY;
        for (cluster& c : clusters)
            if (const double cost = c.cost(m);
                cost < least && !c.nearer_in(runs[static_cast<std::size_t>(m.run)], *m.found))
                least = cost, best = &c;
        if (!best) best = &clusters.emplace_back();
        best->add(m);
    }
    return clusters;
}

/// Hz within which two clusters of one shape may be one vibration.
double within(double f, double zeta, double other_f, double other_zeta) {
    return judgement::most_widths * (f * zeta + other_f * other_zeta);
}

/// Can this run tell two modes so far apart from each other? Each output doubles what it knows of a sample.
bool can_part(const consensus_run& run, double apart_hz, std::size_t n_y) {
    return run.horizon_s() * static_cast<double>(n_y) * apart_hz >= judgement::beats_seen;
}

/// Is it a vibration at one rate at least: found by three runs of it, and by half of those that could?
bool at_one_rate(const std::vector<consensus_run>& runs, const cluster& c) {
    int levels = 0;
    for (const consensus_run& run : runs) levels = std::max(levels, run.level + 1);
    std::vector<int> hits(static_cast<std::size_t>(levels)), could(static_cast<std::size_t>(levels));
    for (std::size_t r = 0; r < runs.size(); ++r) {
        if (!can_see(runs[r], c.frequency_hz)) continue;
        const auto level = static_cast<std::size_t>(runs[r].level);
        ++could[level];
        hits[level] += c.holds(static_cast<int>(r));
    }
    for (std::size_t k = 0; k < hits.size(); ++k)
        if (hits[k] >= judgement::fewest_runs && hits[k] >= judgement::least_found_in * could[k]) return true;
    return false;
}

/// To the nearest other vibration that one rate at least supports.
struct neighbour {
    double apart_hz = INFINITY; ///< there is none
    double alike = 1;           ///< MAC of the shapes

    /// As two of one shape would be that are told apart as easily.
    double told_apart_hz() const { return apart_hz / std::max(judgement::least_alike, alike); }
};

std::vector<neighbour> neighbours(const std::vector<consensus_run>& runs, const std::vector<cluster>& clusters) {
    std::vector<neighbour> out(clusters.size());
    for (const cluster& other : clusters) {
        if (!at_one_rate(runs, other)) continue;
        for (std::size_t i = 0; i < clusters.size(); ++i) {
            const cluster& c = clusters[i];
            const double apart = std::abs(c.frequency_hz - other.frequency_hz);
            if (&c == &other || !(apart < out[i].apart_hz)) continue;
            const double one = within(c.frequency_hz, c.damping_ratio, other.frequency_hz, other.damping_ratio);
            const double alike = shape_mac(c.members.front().found->shape, other.members.front().found->shape);
            if (apart >= one || alike <= judgement::same_shape_of_a_run)
                out[i] = {apart, runs.front().inputs == 0 ? alike : 1};
        }
    }
    return out;
}

/// The runs that vote on a mode: those that see it and can tell it from its neighbours, and in any case the six with the
/// longest horizons of those that see it.
std::vector<bool> voters(const std::vector<consensus_run>& runs, double f, double spacing_hz, std::size_t n_y) {
    std::vector<bool> vote(runs.size());
    std::vector<std::size_t> see;
    for (std::size_t r = 0; r < runs.size(); ++r) {
        if (!can_see(runs[r], f)) continue;
        vote[r] = can_part(runs[r], spacing_hz, n_y);
        see.push_back(r);
    }
    std::sort(see.begin(), see.end(), [&](std::size_t a, std::size_t b) {
        const double one = runs[a].horizon_s(), other = runs[b].horizon_s();
        return one > other || (!(other > one) && a < b);
    });
    for (std::size_t i = 0; i < std::min(judgement::fewest_voters, see.size()); ++i) vote[see[i]] = true;
    return vote;
}

bool sharp(const consensus_run& run, double f) {
    return (run.method == OKID_METHOD_N4SID_CVA || run.method == OKID_METHOD_N4SID_MOESP) && in_band(run, f) &&
           f * run.horizon_s() >= judgement::periods_sharp;
}

/// Distances of the subspace runs of the mode's level from its values: root mean square and median.
void set_scatter(const std::vector<consensus_run>& runs, const std::vector<member>& seen, consensus_mode& mode) {
    std::vector<std::pair<double, double>> away;
    double f = 0, zeta = 0;
    for (const member& m : seen) {
        const consensus_run& run = runs[static_cast<std::size_t>(m.run)];
        if (run.level != mode.level || !is_subspace(run.method)) continue;
        away.emplace_back(std::abs(m.found->frequency_hz - mode.frequency_hz),
                          std::abs(m.found->damping_ratio - mode.damping_ratio));
        f += away.back().first * away.back().first;
        zeta += away.back().second * away.back().second;
    }
    if (away.empty()) return;
    const auto count = static_cast<double>(away.size());
    mode.frequency_scatter_hz = std::sqrt(f / count);
    mode.damping_scatter = std::sqrt(zeta / count);
    mode.frequency_apart_hz = median_of(away, [](const auto& one) { return one.first; });
    mode.damping_apart = median_of(away, [](const auto& one) { return one.second; });
}

/// Frequency, damping, shape and level from the runs that are sharp there, else from all that see it.
void set_values(const std::vector<consensus_run>& runs, const std::vector<member>& seen, consensus_mode& mode) {
    std::vector<member> use;
    for (const member& m : seen)
        if (sharp(runs[static_cast<std::size_t>(m.run)], mode.frequency_hz)) use.push_back(m);
    if (use.empty()) use = seen;
    mode.frequency_hz = median_of(use, [](const member& m) { return m.found->frequency_hz; });
    mode.damping_ratio = median_of(use, [](const member& m) { return m.found->damping_ratio; });
    const member* best = &use.front();
    for (const member& m : use)
        if (m.found->damping_spread < best->found->damping_spread) best = &m;
    mode.shape = best->found->shape;
    mode.level = runs[static_cast<std::size_t>(use.front().run)].level;
    for (const member& m : use) mode.level = std::min(mode.level, runs[static_cast<std::size_t>(m.run)].level);
    set_scatter(runs, seen, mode);
}

/// Whose EMAC counts: all that vote; of a mode under a force that has died away by the end of most of their horizons, the runs at
/// whose end it has not. Without a force that end tells a mode from a hump of the excitation, which does not decay as one.
std::vector<member> lasting(const std::vector<consensus_run>& runs, const std::vector<member>& all,
                            const std::vector<member>& seen) {
    const auto lasts = [&](const member& m) {
        const consensus_run& run = runs[static_cast<std::size_t>(m.run)];
        const double decay = 2 * M_PI * m.found->frequency_hz * m.found->damping_ratio;
        return run.inputs == 0 || run.horizon_s() * decay <= judgement::decays_left;
    };
    if (2 * std::count_if(seen.begin(), seen.end(), lasts) >= static_cast<std::ptrdiff_t>(seen.size())) return seen;
    std::vector<member> out;
    std::copy_if(all.begin(), all.end(), std::back_inserter(out), lasts);
    return out.size() < judgement::fewest_runs ? seen : out;
}

consensus_mode mode_of(const std::vector<consensus_run>& runs, const cluster& c, const neighbour& nearest,
                       const std::vector<bool>& turned) {
    consensus_mode mode;
    mode.frequency_hz = c.frequency_hz;
    const std::size_t n_y = c.members.front().found->shape.size();
    const std::vector<bool> votes = voters(runs, mode.frequency_hz, nearest.told_apart_hz(), n_y);
    mode.could = static_cast<int>(std::count(votes.begin(), votes.end(), true));
    mode.spacing_hz = nearest.apart_hz;
    std::vector<double> horizons;
    for (const consensus_run& run : runs) {
        if (!can_see(run, mode.frequency_hz)) continue;
        mode.parted += can_part(run, nearest.apart_hz, n_y);
        horizons.push_back(run.horizon_s());
    }
    std::sort(horizons.rbegin(), horizons.rend());
    const std::size_t third = judgement::fewest_runs - 1;
    mode.resolved_hz =
        third < horizons.size() ? judgement::beats_seen / static_cast<double>(n_y) / horizons[third] : INFINITY;
    std::vector<member> seen;
    for (const member& m : c.members) {
        mode.members.emplace_back(m.run, m.track);
        if (votes[static_cast<std::size_t>(m.run)]) seen.push_back(m);
    }
    mode.hits = static_cast<int>(seen.size());
    mode.found_in = mode.could ? static_cast<double>(mode.hits) / mode.could : 0;
    if (seen.empty()) seen = c.members;
    const auto med = [&](auto of) { return median_of(seen, of); };
    mode.frequency_hz = med([](const member& m) { return m.found->frequency_hz; });
    mode.damping_ratio = med([](const member& m) { return m.found->damping_ratio; });
    mode.mpc = med(
        [&](const member& m) { return turned.empty() ? m.found->mpc : shape_collinearity(m.found->shape, turned); });
    mode.emac = median_of(lasting(runs, c.members, seen), [](const member& m) { return m.found->emac; });
    const double zeta = mode.damping_ratio;
    mode.damping_spread = 1.4826 * med([&](const member& m) { return std::abs(m.found->damping_ratio / zeta - 1); });
    set_values(runs, seen, mode);
    judge_agreement(mode);
    return mode;
}

/// A weaker cluster beside a stronger one of the same shape: one mode of a structure that changes with its amplitude, unless
/// their half-power bands are apart and nearly all runs see both.
bool is_split(const consensus_mode& mode, const consensus_mode& stronger) {
    if (mode.shape.size() < 3) return false; // one or two outputs tell no shapes apart
    const double apart = std::abs(mode.frequency_hz - stronger.frequency_hz);
    const double far = within(mode.frequency_hz, mode.damping_ratio, stronger.frequency_hz, stronger.damping_ratio);
    const double one = mode.found_in < judgement::nearly_all ? far : far / judgement::most_widths;
    // below resolved_hz a shadow: no three runs can tell it from the stronger one
    return apart < std::max({one, judgement::same_frequency * stronger.frequency_hz, mode.resolved_hz}) &&
           shape_mac(mode.shape, stronger.shape) > judgement::same_shape_of_a_run;
}

void mark_split(std::vector<consensus_mode>& modes) {
    std::vector<std::size_t> split;
    for (std::size_t i = 0; i < modes.size(); ++i)
        if (std::any_of(modes.begin(), modes.end(), [&](const consensus_mode& other) {
                return &other != &modes[i] && other.agreement > modes[i].agreement && other.confident() &&
                       is_split(modes[i], other);
            }))
            split.push_back(i);
    for (const std::size_t i : split) modes[i].why.emplace_back("split");
}

/// Mark the runs that have too few states for the vibrations of their band.
void mark_full(const std::vector<cluster>& clusters, const std::vector<consensus_mode>& modes,
               std::vector<consensus_run>& runs) {
    std::vector<double> vibrations;
    for (std::size_t i = 0; i < clusters.size(); ++i)
        if (modes[i].agreement >= judgement::clear_vibration * modes[i].found_in && at_one_rate(runs, clusters[i]))
            vibrations.push_back(clusters[i].frequency_hz);
    for (consensus_run& run : runs) {
        const auto inside = std::count_if(vibrations.begin(), vibrations.end(), [&](double f) {
            const double share = run.zoom().folded(f) / run.fs_hz;
            return share >= 0 && share < 0.5;
        });
        if (run.states > 0 && 2.0 * static_cast<double>(inside) > judgement::most_filled * run.states) run.full = true;
    }
}

} // namespace

void judge_agreement(consensus_mode& mode) {
    const double scatter = mode.damping_spread / judgement::scatter_scale;
    mode.agreement = mode.found_in * mode.emac * (1 + mode.mpc) / 2 / (1 + scatter * scatter);
    const auto ours = [](const std::string& code) { return code == "few_runs" || code == "noise_shape"; };
    mode.why.erase(std::remove_if(mode.why.begin(), mode.why.end(), ours), mode.why.end());
    if (mode.hits < judgement::fewest_runs || mode.found_in < judgement::least_found_in)
        mode.why.emplace_back("few_runs");
    if (mode.agreement < judgement::least_agreement) mode.why.emplace_back("noise_shape");
}

std::vector<int> consensus_orders(int most) {
    std::vector<int> out;
    for (int n = 4; n <= most; n += n < 24 ? 2 : n < 64 ? 4 : 8) out.push_back(n);
    return out;
}

void collect_poles(okid_identify_t* identifier, okid_identified_t& model, consensus_run& run) {
    for (const int order : run.orders) {
        if (okid_identify_poles(identifier, order, &model) < 0) continue;
        for (int k = 0; k < model.mode_count; ++k) {
            run_pole pole{order, model.frequency_hz[k], model.damping_ratio[k], model.mpc[k], model.emac[k], {}};
            run.zoom().unfold(pole.frequency_hz, pole.damping_ratio);
            for (int i = 0; i < model.n_y; ++i) {
                const auto at = i + static_cast<std::ptrdiff_t>(k) * model.n_y;
                pole.shape.push_back(run.zoom().turned({model.shape_re[at], model.shape_im[at]}));
            }
            run.poles.push_back(std::move(pole));
        }
    }
}

void link_tracks(consensus_run& run) {
    std::vector<chain> chains;
    for (const int order : run.orders) {
        std::vector<const run_pole*> next;
        for (const run_pole& pole : run.poles)
            if (pole.order == order && pole.damping_ratio > 1e-7 && pole.damping_ratio < judgement::most_damping)
                next.push_back(&pole);
        extend(chains, next, run.fs_hz / 2); // in a band that is folded, of what stands there
    }
    for (const chain& poles : chains) {
        const auto possible = std::count_if(run.orders.begin(), run.orders.end(),
                                            [&](int order) { return order >= poles.front()->order; });
        if (poles.size() >= judgement::fewest_orders &&
            static_cast<double>(poles.size()) >= judgement::share_of_orders * static_cast<double>(possible))
            run.tracks.push_back(track_of(poles));
    }
    std::vector<run_track> own;
    std::copy_if(run.tracks.begin(), run.tracks.end(), std::back_inserter(own),
                 [&run](const run_track& track) { return !is_resolved(track, run.tracks, run.orders.back()); });
    run.tracks = std::move(own);
}

bool in_band(const consensus_run& run, double frequency_hz) {
    const double share = run.zoom().folded(frequency_hz) / run.fs_hz;
    return share < run.top && share >= run.bottom;
}

bool can_see(const consensus_run& run, double frequency_hz) {
    const double periods =
        std::max(judgement::periods_least, judgement::periods_seen * std::min(1.0, 3.0 / run.outputs));
    return in_band(run, frequency_hz) && frequency_hz * run.horizon_s() >= periods;
}

std::vector<consensus_mode> find_agreement(std::vector<consensus_run>& runs, std::vector<bool>* turned) {
    std::vector<consensus_mode> modes;
    const std::vector<cluster> clusters = gather(runs);
    const std::vector<neighbour> nearest = neighbours(runs, clusters);
    std::vector<bool> quarter = turned ? *turned : std::vector<bool>();
    for (std::size_t i = 0; i < clusters.size(); ++i) modes.push_back(mode_of(runs, clusters[i], nearest[i], quarter));
    if (turned && quarter.empty()) {
        std::vector<mode_shape> shapes; // of what would be believed but for its phases
        for (const consensus_mode& mode : modes)
            if (mode.found_in >= judgement::least_found_in && mode.hits >= judgement::fewest_runs &&
                2 * mode.agreement >= judgement::least_agreement * (1 + mode.mpc))
                shapes.push_back(mode.shape);
        quarter = turned_outputs(shapes);
        *turned = quarter;
        for (std::size_t i = 0; i < clusters.size() && !quarter.empty(); ++i)
            modes[i] = mode_of(runs, clusters[i], nearest[i], quarter);
    }
    mark_full(clusters, modes, runs);
    std::sort(modes.begin(), modes.end(),
              [](const consensus_mode& a, const consensus_mode& b) { return a.frequency_hz < b.frequency_hz; });
    mark_split(modes);
    return modes;
}

} // namespace okid_host
