// SPDX-License-Identifier: MIT
// PURPOSE  bad samples found before they become modes
// METHOD   clipped: far more samples at the very extreme than just below it; frozen: one value for longer than the channel ever
//          keeps one, while it moves before and after; dropped: the same at zero, between two jumps; spikes: single samples far
//          beyond all neighbours; two or three beyond what the record does about them, too
#include "screening.hpp"

#include "consensus/gap_bridge.hpp"
#include "files/order_statistics.hpp"
#include "record_rest.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <map>
#include <set>
#include <string_view>

namespace okid_host {
namespace {

constexpr double share_lost = 0.3;     // of the samples with clean lags behind them: more, and the output goes
constexpr std::size_t clean_lags = 60; // what a long horizon needs in one piece
constexpr double extreme_bin = 0.01;   // of the range, just below the extreme
constexpr double extreme_ratio = 3;    // at the extreme over just below it; 2.4 for a sampled sine
constexpr std::size_t fewest_extreme = 10;
constexpr std::size_t parts = 16, shortest_part = 500; // samples; of a record, each may have a range of its own
constexpr std::size_t frozen_run = 32, zero_run = 6;
constexpr std::size_t beside_clipped = longest_bridged / 2 + 1; // samples on each side
constexpr double few_clipped = 0.01;                            // of the samples, with those
constexpr double usual_runs = 8;     // times the longest of all but the rarest thousandth of runs
constexpr double moving_share = 0.3; // of the usual spread, before and after a frozen stretch
constexpr double spike_spreads = 15, spike_ratio = 5;
constexpr double spreads_around = 8; // of one of two or three samples: a pulse that runs along a beam is as narrow
constexpr std::size_t spike_reach = 6, beside_spike = about_a_spike;
constexpr std::string_view never_moves = "never moves";
constexpr const char* lost_words =
    ": the whole output is left out, its shape entries are empty. Look at its sensor, range and cable";

struct stretch_of_equal {
    std::size_t first, count;
    double value;
};

/// One channel in rows.
struct samples_view {
    const double* first = nullptr;
    std::size_t stride = 1, count = 0;
    double at(std::size_t i) const { return first[i * stride]; }
    std::size_t size() const { return count; }
};

/// One output of one record.
struct output_view : samples_view {
    const record_data& record;
    double* own;
    output_view(const record_data& of, double* rows, std::size_t channels)
        : samples_view{rows, channels, of.count}, record(of), own(rows) {}
    void drop(std::size_t i) const { own[i * stride] = NAN; }
};

std::vector<stretch_of_equal> equal_stretches(const output_view& y) {
    std::vector<stretch_of_equal> out;
    for (std::size_t i = 0; i < y.size();) {
        std::size_t last = i + 1;
        while (last < y.size() && y.at(last) == y.at(i)) ++last;
        if (!std::isnan(y.at(i))) out.push_back({i, last - i, y.at(i)});
        i = last;
    }
    return out;
}

double spread_of(const output_view& y, std::size_t first, std::size_t last) {
    double sum = 0, square = 0, n = 0;
    for (std::size_t i = first; i < last; ++i)
        if (!std::isnan(y.at(i))) sum += y.at(i), square += y.at(i) * y.at(i), ++n;
    return n > 1 ? std::sqrt(std::max(0.0, square / n - sum * sum / n / n)) : 0;
}

struct fault {
    std::string_view kind;
    std::vector<std::size_t> samples;
    const record_data* record = nullptr;
};

/// Some stretches that follow each other.
struct stretches_view {
    std::vector<stretch_of_equal>::const_iterator first, last;
    auto begin() const { return first; }
    auto end() const { return last; }
};

/// Is an extreme of these stretches a flat top: far more samples than just below it, and than at the next value below it?
bool is_flat(const stretches_view& runs, double extreme, double range) {
    double next = NAN;
    for (const stretch_of_equal& run : runs)
        if (run.value != extreme && !(std::abs(run.value - extreme) > std::abs(next - extreme))) next = run.value;
    std::size_t at = 0, below = 0, at_next = 0;
    for (const stretch_of_equal& run : runs) {
        if (run.value == extreme)
            at += run.count;
        else if (std::abs(run.value - extreme) <= extreme_bin * range)
            below += run.count;
        if (run.value == next) at_next += run.count;
    }
    return at >= fewest_extreme &&
           static_cast<double>(at) >= extreme_ratio * static_cast<double>(std::max(below, at_next));
}

/// Flat tops of a record, and of parts of it in which the channel moves as usual: a range that is changed later leaves them
/// below the extreme. What is at the same value in the parts beside is flat as well.
void find_clipped(const output_view& y, const std::vector<stretch_of_equal>& runs, double usual, fault& found) {
    const auto at = [&](std::size_t sample) {
        return std::lower_bound(runs.begin(), runs.end(), sample,
                                [](const stretch_of_equal& run, std::size_t i) { return run.first < i; });
    };
    const auto look = [&](std::size_t first, std::size_t last, std::size_t beside) {
        const stretches_view part{at(first), at(last)};
        if (part.first == part.last) return;
        const auto lower = [](const stretch_of_equal& a, const stretch_of_equal& b) { return a.value < b.value; };
        const auto [low, high] = std::minmax_element(part.begin(), part.end(), lower);
        const std::size_t from = first - std::min(first, beside), to = std::min(y.size(), last + beside);
        for (const double extreme : {low->value, high->value})
            if (is_flat(part, extreme, high->value - low->value))
                for (std::size_t i = from; i < to; ++i)
                    if (y.at(i) == extreme) found.samples.push_back(i);
    };
    look(0, y.size(), 0);
    const std::size_t length = y.size() / parts;
    for (std::size_t first = 0; length >= shortest_part && first + length <= y.size(); first += length)
        if (spread_of(y, first, first + length) > moving_share * usual) look(first, first + length, length);
}

/// The channel moves beside a stretch as it usually does.
bool moves_beside(const output_view& y, const stretch_of_equal& run, double usual) {
    const std::size_t last = run.first + run.count, width = std::max<std::size_t>(run.count, frozen_run);
    const std::size_t before = run.first > width ? run.first - width : 0, after = std::min(y.size(), last + width);
    const bool any_before = run.first >= frozen_run, any_after = y.size() - last >= frozen_run;
    return (any_before || any_after) && (!any_before || spread_of(y, before, run.first) > moving_share * usual) &&
           (!any_after || spread_of(y, last, after) > moving_share * usual);
}

/// @param resting  samples at the beginning in which nothing acts: zeros there are no fault
void find_frozen(const output_view& y, const std::vector<stretch_of_equal>& runs, std::size_t resting, double usual,
                 double low, double high, fault& frozen, fault& zeros) {
    std::vector<std::size_t> lengths;
    for (const stretch_of_equal& run : runs) lengths.push_back(run.count);
    if (lengths.empty()) return;
    const double long_run = usual_runs * static_cast<double>(quantile(lengths, 0.99));
    for (const stretch_of_equal& run : runs) {
        const bool zero = run.value == 0;
        const bool extreme = run.value == low || run.value == high;
        if (extreme && run.count < frozen_run) continue; // a flat top
        if (zero && run.first == 0 && run.count <= resting + zero_run) continue;
        if (static_cast<double>(run.count) < std::max(long_run, static_cast<double>(zero ? zero_run : frozen_run)) ||
            !moves_beside(y, run, usual))
            continue;
        for (std::size_t i = 0; i < run.count; ++i) (zero ? zeros : frozen).samples.push_back(run.first + i);
    }
}

/// Where the forces of a record act.
struct force_times {
    std::vector<bool> struck; ///< about a pulse, if the force rests otherwise: a sensor near it answers as briefly
    std::size_t resting = 0;  ///< samples before the first force
};

force_times times_of_forces(const record_set& set, const record_data& record) {
    force_times out{std::vector<bool>(record.count, false), set.n_u > 0 ? record.count : 0};
    for (std::size_t k = 0; k < set.n_u; ++k) {
        const samples_view force{set.rows(record) + k, set.channels(), record.count};
        const force_level level = level_of(force.first, force.stride, force.size());
        for (std::size_t i = 0; i < force.size(); ++i) {
            if (!(std::abs(force.at(i)) > level.pulse)) continue;
            out.resting = std::min(out.resting, i);
            if (!level.rests) break;
            for (std::size_t j = i > spike_reach ? i - spike_reach : 0; j < std::min(record.count, i + spike_reach + 1);
                 ++j)
                out.struck[j] = true;
        }
    }
    return out;
}

std::vector<double> measured(const samples_view& y, std::size_t first, std::size_t last) {
    std::vector<double> out;
    for (std::size_t i = first; i < last; ++i)
        if (!std::isnan(y.at(i))) out.push_back(y.at(i));
    return out;
}

/// Centre NaN of none, spread 0 of few.
std::pair<double, double> centre_and_spread(const samples_view& y) {
    std::vector<double> values = measured(y, 0, y.size());
    const double centre = upper_median(values);
    return {centre, usual_distance(std::move(values), centre)};
}

bool is_spike(const samples_view& y, std::size_t i, double centre, double spread) {
    const double here = std::abs(y.at(i) - centre);
    if (!(here > spike_spreads * spread) || i < spike_reach || i + spike_reach >= y.size()) return false;
    double beside = 0;
    for (std::size_t d = 2; d <= spike_reach; ++d)
        beside = std::fmax(beside, std::fmax(std::abs(y.at(i - d) - centre), std::abs(y.at(i + d) - centre)));
    if (!(here > spike_ratio * beside)) return false;
    const double next = std::fmax(std::abs(y.at(i - 1) - centre), std::abs(y.at(i + 1) - centre));
    const std::size_t last = std::min(y.size(), std::max(i + beside_spike, 2 * beside_spike) + 1);
    const std::size_t first = last > 2 * beside_spike ? last - 2 * beside_spike - 1 : 0;
    return here > spike_ratio * next || here > spreads_around * usual_distance(measured(y, first, last), centre);
}

void find_spikes(const output_view& y, const std::vector<bool>& struck, fault& found) {
    const auto [centre, spread] = centre_and_spread(y);
    for (std::size_t i = 0; spread > 0 && i < y.size(); ++i)
        if (!struck[i] && is_spike(y, i, centre, spread)) found.samples.push_back(i);
}

/// Samples with so many complete ones behind them, as if this output stood alone.
std::size_t usable(const output_view& y) {
    std::size_t run = 0, out = 0;
    for (std::size_t i = 0; i < y.size(); ++i) {
        run = std::isnan(y.at(i)) ? 0 : run + 1;
        out += run > clean_lags;
    }
    return out;
}

bool too_few(std::size_t samples, std::size_t of) {
    return static_cast<double>(samples) < (1 - share_lost) * static_cast<double>(of);
}

/// An output that never moves in any record.
bool is_dead(const record_set& set, std::size_t output) {
    double low = INFINITY, high = -INFINITY;
    for (std::size_t i = 0; i < set.count(); ++i) {
        const double x = set.samples[i * set.channels() + set.n_u + output];
        low = std::fmin(low, x), high = std::fmax(high, x);
    }
    return !(high > low);
}

/// Faults of one kind in records, the first of them named.
std::string fault_text(const std::string& output, const std::vector<fault>& found) {
    const fault& first = found.front();
    const std::string& path = first.record->path;
    std::size_t samples = 0;
    for (const fault& one : found) samples += one.samples.size();
    const std::string begin = fmt::format("output \"{}\"{}", output, path.empty() ? "" : " of " + path);
    const std::string more =
        found.size() > 1 ? fmt::format(" and {} more record{}", found.size() - 1, found.size() > 2 ? "s" : "") : "";
    if (first.kind == never_moves) return begin + more + " never moves";
    return fmt::format("{}{}: {} ({} sample{}, the first is number {})", begin, more, first.kind, samples,
                       samples == 1 ? "" : "s", first.samples.front());
}

/// What was lost because it was large is not to be guessed from what was not: its error would come with every hit. Where samples
/// are clipped in few places, those beside them become missing too, so that no gap there is short enough to be bridged.
void widen_clipped(const output_view& y, const std::vector<std::size_t>& clipped) {
    const double most = few_clipped * static_cast<double>(y.size());
    if (static_cast<double>(clipped.size()) > most) return;
    std::set<std::size_t> wide;
    for (const std::size_t i : clipped)
        for (std::size_t k = i - std::min(i, beside_clipped); k <= i + beside_clipped && k < y.size(); ++k)
            wide.insert(k);
    if (static_cast<double>(wide.size()) > most) return;
    for (const std::size_t i : wide) y.drop(i);
}

/// Faults of one output of one record; their samples become missing.
std::vector<fault> screen(const output_view& y, const force_times& forces) {
    std::vector<stretch_of_equal> runs = equal_stretches(y);
    if (runs.size() == 1 && y.size() >= frozen_run) { // of one of several records: is_dead() has seen the others
        for (std::size_t i = 0; i < y.size(); ++i) y.drop(i);
        return {{never_moves, {}, &y.record}};
    }
    if (runs.size() < 3) return {};
    fault clipped{"clipped", {}}, frozen{"frozen at one value", {}}, zeros{"dropped to zero", {}}, spikes{"spikes", {}};
    find_spikes(y, forces.struck, spikes);
    for (const std::size_t i : spikes.samples) y.drop(i); // no flat top is below a spike
    if (!spikes.samples.empty()) runs = equal_stretches(y);
    double low = INFINITY, high = -INFINITY;
    for (const stretch_of_equal& run : runs) low = std::min(low, run.value), high = std::max(high, run.value);
    const double usual = spread_of(y, 0, y.size());
    find_clipped(y, runs, usual, clipped);
    find_frozen(y, runs, forces.resting, usual, low, high, frozen, zeros);
    widen_clipped(y, clipped.samples);
    std::vector<fault> out;
    for (fault* found : {&clipped, &frozen, &zeros, &spikes}) {
        if (found->samples.empty()) continue;
        std::sort(found->samples.begin(), found->samples.end());
        found->samples.erase(std::unique(found->samples.begin(), found->samples.end()), found->samples.end());
        for (const std::size_t i : found->samples) y.drop(i);
        found->record = &y.record;
        out.push_back(std::move(*found));
    }
    return out;
}

/// What is wrong with an output over all records.
struct output_faults {
    bool dead = false;   ///< it never moves
    bool lost = false;   ///< too much of it is faulty
    bool sparse = false; ///< another has far more usable samples
    std::map<std::string_view, std::vector<fault>> of_kind;
    std::size_t usable = 0; ///< samples, as if it stood alone
};

output_faults faults_of(record_set& set, std::size_t output, const std::vector<force_times>& forces) {
    output_faults out;
    out.dead = is_dead(set, output);
    if (out.dead) return out;
    std::size_t before = 0;
    for (std::size_t r = 0; r < set.records.size(); ++r) {
        const record_data& record = set.records[r];
        const output_view view(record, set.rows(record) + set.n_u + output, set.channels());
        before += usable(view);
        for (fault& found : screen(view, forces[r])) out.of_kind[found.kind].push_back(std::move(found));
        out.usable += usable(view);
    }
    out.lost = !out.of_kind.empty() && too_few(out.usable, before);
    return out;
}

} // namespace

usual_values usual_of(const record_set& set) {
    usual_values out;
    for (std::size_t k = 0; k < set.channels(); ++k) {
        const samples_view channel{set.samples.data() + k, set.channels(), set.count()};
        if (k < set.n_u) {
            const force_level level = level_of(channel.first, channel.stride, channel.size());
            out.pulse.push_back(level.rests ? level.pulse : INFINITY);
        } else {
            const auto [centre, spread] = centre_and_spread(channel);
            out.centre.push_back(centre);
            out.spread.push_back(spread);
        }
    }
    return out;
}

void without_spikes(const double* rows, std::size_t count, std::size_t at, const usual_values& usual, double* row) {
    const std::size_t n_u = usual.pulse.size(), m = n_u + usual.centre.size();
    std::copy_n(rows + at * m, m, row);
    for (std::size_t o = 0; o < usual.centre.size(); ++o) {
        const samples_view y{rows + n_u + o, m, count};
        if (!(usual.spread[o] > 0) || !is_spike(y, at, usual.centre[o], usual.spread[o])) continue;
        bool struck = false;
        for (std::size_t i = at - spike_reach; i <= at + spike_reach; ++i)
            for (std::size_t k = 0; k < n_u; ++k) struck = struck || std::abs(rows[i * m + k]) > usual.pulse[k];
        if (!struck) row[n_u + o] = NAN;
    }
}

screened_outputs screen_outputs(record_set& set, const std::vector<std::string>& outputs) {
    screened_outputs out;
    set.complete = false; // what is faulty becomes missing
    std::vector<force_times> forces;
    for (const record_data& record : set.records) forces.push_back(times_of_forces(set, record));
    std::vector<output_faults> found;
    std::size_t best = 0;
    for (std::size_t k = 0; k < outputs.size(); ++k) {
        found.push_back(faults_of(set, k, forces));
        best = std::max(best, found[k].usable);
    }
    for (output_faults& one : found) {
        // only complete rows with complete lags are used: an output with many gaps would cost the others their samples
        one.sparse = !one.dead && !one.lost && too_few(one.usable, best);
        out.kept.push_back(!one.dead && !one.lost && !one.sparse);
    }
    const bool none = std::none_of(out.kept.begin(), out.kept.end(), [](bool kept) { return kept; });
    if (none) out.kept.assign(outputs.size(), true); // nothing else is there: the clean samples have to do
    const auto say = [&out](std::string text) { out.said.emplace_back("screened", std::move(text)); };
    for (std::size_t k = 0; k < outputs.size(); ++k) {
        if (found[k].dead && !none) say(fmt::format("output \"{}\" {}{}", outputs[k], never_moves, lost_words));
        for (const auto& [kind, faults] : found[k].of_kind)
            say(fault_text(outputs[k], faults) + (found[k].lost && !none ? lost_words : ": left out as gaps"));
    }
    for (std::size_t k = 0; k < outputs.size() && !none; ++k)
        if (found[k].sparse)
            say(fmt::format("output \"{}\": samples missing so often that only {} have {} complete ones before them, "
                            "of another output {}{}",
                            outputs[k], found[k].usable, clean_lags, best, lost_words));
    return out;
}

record_set without_outputs(const record_set& set, const std::vector<bool>& kept) {
    record_set out;
    out.n_u = set.n_u;
    out.n_y = static_cast<std::size_t>(std::count(kept.begin(), kept.end(), true));
    out.records = set.records;
    out.samples.reserve(set.count() * out.channels());
    for (std::size_t n = 0; n < set.count(); ++n)
        for (std::size_t k = 0; k < set.channels(); ++k)
            if (k < set.n_u || kept[k - set.n_u]) out.samples.push_back(set.samples[n * set.channels() + k]);
    return out;
}

} // namespace okid_host
