// SPDX-License-Identifier: MIT
#include "picks.hpp"

#include "error.hpp"
#include "files/input_file.hpp"
#include "files/nearest_name.hpp"
#include "request.hpp"
#include "result/method.hpp"

#include <algorithm>
#include <charconv>
#include <filesystem>
#include <fmt/format.h>
#include <nlohmann/json.hpp>
#include <set>

namespace okid_host {
namespace {

constexpr double near_pick = 0.01;        // of its frequency
constexpr double weight_of_damping = 0.1; // of a factor of e, beside near_pick
constexpr double weight_of_runs = 0.1;    // of all of them
constexpr std::size_t most_picks = 1000;
constexpr double most_shown_damping = 0.2; // of poles in a diagram

[[noreturn]] void refuse_picks(const std::string& text) { throw failure(exit_usage, "--picks: " + text); }

double number_of(const nlohmann::json& mode, const char* key) {
    const auto at = mode.find(key);
    return at != mode.end() && at->is_number() ? at->get<double>() : NAN;
}

std::vector<picked_pole> picks_of_file(const std::string& path) {
    const auto file = nlohmann::json::parse(read_input(path, "a .json file with modes"), nullptr, false);
    if (!file.is_object() || !file.contains("modes") || !file["modes"].is_array())
        refuse_picks(fmt::format("{}: found no \"modes\", expected an okid.result/1 or "
                                 "{{\"modes\": [{{\"frequency_hz\": 34.3}}]}}",
                                 path));
    const auto says = [&](const char* key) {
        return
            [key](const nlohmann::json& mode) { return mode.is_object() && mode.value(key, nlohmann::json()) == true; };
    };
    const auto& modes = file["modes"];
    const char* which = nullptr;
    for (const char* key : {"confident", "picked"})
        if (std::any_of(modes.begin(), modes.end(), says(key))) which = key;
    std::vector<picked_pole> out;
    for (std::size_t k = 0; k < modes.size(); ++k) {
        if (which && !says(which)(modes[k])) continue;
        if (!modes[k].is_object() || !(number_of(modes[k], "frequency_hz") > 0))
            refuse_picks(fmt::format("{}: mode {} has no \"frequency_hz\" above 0", path, k + 1));
        out.push_back({number_of(modes[k], "frequency_hz"), number_of(modes[k], "damping_ratio")});
    }
    return out;
}

std::vector<picked_pole> picks_of_list(const std::string& list) {
    std::vector<picked_pole> out;
    for (std::size_t at = 0; at <= list.size();) {
        const std::size_t comma = std::min(list.find(',', at), list.size());
        const char *begin = list.data() + at, *end = list.data() + comma;
        while (begin < end && *begin == ' ') ++begin;
        double hz = 0;
        const auto [stop, error] = std::from_chars(begin, end, hz);
        if (error != std::errc{} || stop != end || !(hz > 0) || !std::isfinite(hz))
            refuse_picks(fmt::format("found \"{}\", expected frequencies in Hz with commas between, or a .json file",
                                     printable(list.substr(at, comma - at))));
        out.push_back({hz, NAN});
        at = comma + 1;
    }
    return out;
}

/// How far a pole stands from a pick; infinite: elsewhere.
double distance(const picked_pole& pick, double frequency_hz, double damping_ratio) {
    const double away = std::abs(frequency_hz / pick.frequency_hz - 1);
    if (!(away <= near_pick)) return INFINITY;
    const double ratio = std::log(damping_ratio / pick.damping_ratio);
    return away / near_pick + (std::isfinite(ratio) ? weight_of_damping * std::abs(ratio) : 0);
}

consensus_mode mode_of_pole(const consensus_run& run, const run_pole& pole) {
    consensus_mode out;
    out.frequency_hz = pole.frequency_hz;
    out.damping_ratio = pole.damping_ratio;
    out.mpc = pole.mpc;
    out.emac = pole.emac;
    out.level = run.level;
    out.shape = pole.shape;
    return out;
}

/// The pole of a single model that stands nearest.
consensus_mode lonely_pole(const picked_pole& pick, const std::vector<consensus_run>& runs) {
    consensus_mode out;
    double least = INFINITY, nearest_hz = INFINITY;
    for (const consensus_run& run : runs)
        for (const run_pole& pole : run.poles) {
            if (std::abs(pole.frequency_hz - pick.frequency_hz) < std::abs(nearest_hz - pick.frequency_hz))
                nearest_hz = pole.frequency_hz;
            const double away = distance(pick, pole.frequency_hz, pole.damping_ratio);
            if (!(pole.damping_ratio > 0) || away >= least) continue;
            least = away;
            out = mode_of_pole(run, pole);
        }
    if (least == INFINITY)
        refuse_picks(fmt::format("no model has a pole within {:g} % of {:g} Hz, the nearest is at {:.5g} Hz",
                                 100 * near_pick, pick.frequency_hz, nearest_hz));
    return out;
}

/// The poles of a run in its band.
std::vector<pole_table::pole> poles_in_band(const consensus_run& run, int number) {
    std::vector<pole_table::pole> out;
    for (const run_pole& pole : run.poles)
        if (pole.damping_ratio > 0 && pole.damping_ratio < most_shown_damping && in_band(run, pole.frequency_hz))
            out.push_back({number, pole.order, pole.frequency_hz, pole.damping_ratio, pole.mpc, pole.emac, 0});
    return out;
}

/// Poles of a track become those of a mode: at each of its orders the nearest.
void mark_track(const run_track& track, int mode, std::vector<pole_table::pole>& poles) {
    for (const int order : track.orders) {
        const auto away = [&](const pole_table::pole& pole) {
            return pole.order == order ? std::abs(pole.frequency_hz - track.frequency_hz) : INFINITY;
        };
        const auto nearest = std::min_element(poles.begin(), poles.end(),
                                              [&](const auto& a, const auto& b) { return away(a) < away(b); });
        if (nearest != poles.end() && std::isfinite(away(*nearest))) nearest->mode = mode;
    }
}

/// Of `each` values a mode those of these modes are left; of none nothing.
template <class T> void keep_values(const std::vector<std::size_t>& kept, std::size_t each, std::vector<T>& values) {
    std::vector<T> out;
    for (std::size_t at = 0; at < kept.size() * each && !values.empty(); ++at)
        out.push_back(std::move(values[kept[at / each] * each + at % each]));
    values = std::move(out);
}

} // namespace

std::vector<picked_pole> read_picks(const std::string& given) {
    const bool file = lower_case(std::filesystem::path(given).extension().string()) == ".json";
    std::vector<picked_pole> out = file ? picks_of_file(given) : picks_of_list(given);
    if (out.empty() || out.size() > most_picks)
        refuse_picks(fmt::format("found {} modes, expected 1 to {}", out.size(), most_picks));
    return out;
}

std::vector<consensus_mode> picked_modes(const std::vector<picked_pole>& picks, const std::vector<consensus_run>& runs,
                                         const std::vector<consensus_mode>& modes) {
    std::vector<consensus_mode> out;
    std::set<std::size_t> taken;
    for (const picked_pole& pick : picks) {
        std::size_t best = modes.size();
        double least = INFINITY;
        for (std::size_t k = 0; k < modes.size(); ++k) {
            const double away = distance(pick, modes[k].frequency_hz, modes[k].damping_ratio);
            const double cost = away + weight_of_runs * (1 - modes[k].found_in);
            if (cost < least) least = cost, best = k;
        }
        if (best == modes.size()) {
            out.push_back(lonely_pole(pick, runs));
        } else if (taken.insert(best).second) {
            out.push_back(modes[best]);
        }
    }
    for (consensus_mode& mode : out) {
        mode.why.clear();
        mode.picked = true;
    }
    std::sort(out.begin(), out.end(),
              [](const consensus_mode& a, const consensus_mode& b) { return a.frequency_hz < b.frequency_hz; });
    return out;
}

bool keep_numbers(const std::vector<int>& numbers, std::vector<listed_mode>& listed, record_work& work) {
    if (numbers.empty()) return false;
    check_picked(numbers, listed.size());
    result_context& context = work.context;
    std::vector<int> renumbered(listed.size() + 1);
    std::vector<std::size_t> kept;
    for (std::size_t k = 0; k < listed.size(); ++k) {
        if (std::find(numbers.begin(), numbers.end(), static_cast<int>(k) + 1) == numbers.end()) continue;
        kept.push_back(k);
        renumbered[k + 1] = static_cast<int>(kept.size());
        listed[k].in_model = true;
        context.verdicts[k] = {true, context.verdicts[k].found_in, {}, true};
    }
    const std::size_t n_y = work.set.n_y;
    keep_values(kept, 1, listed);
    keep_values(kept, 1, context.verdicts);
    keep_values(kept, 1, work.carriers);
    keep_values(kept, 1, work.apart);
    keep_values(kept, 1, work.wider);
    keep_values(kept, 1, work.shifts);
    keep_values(kept, 1, work.inputs.residues);
    if (context.sigma) {
        keep_values(kept, 1, context.sigma->frequency_hz);
        keep_values(kept, 1, context.sigma->damping_ratio);
        keep_values(kept, n_y, context.sigma->shape_re);
        keep_values(kept, n_y, context.sigma->shape_im);
    }
    if (context.poles)
        for (pole_table::pole& pole : context.poles->poles) pole.mode = renumbered[static_cast<std::size_t>(pole.mode)];
    return true;
}

pole_table poles_of(const std::vector<consensus_run>& runs, const std::vector<consensus_mode>& modes) {
    pole_table out;
    std::vector<std::vector<pole_table::pole>> of_run;
    for (const consensus_run& run : runs) {
        of_run.push_back(poles_in_band(run, static_cast<int>(out.runs.size())));
        out.runs.push_back({method_names()[static_cast<std::size_t>(run.method)], run.fs_hz, run.rows});
    }
    for (std::size_t k = 0; k < modes.size(); ++k)
        for (const auto& [number, track] : modes[k].members) {
            const auto r = static_cast<std::size_t>(number);
            mark_track(runs[r].tracks[static_cast<std::size_t>(track)], static_cast<int>(k) + 1, of_run[r]);
        }
    for (const auto& poles : of_run) out.poles.insert(out.poles.end(), poles.begin(), poles.end());
    return out;
}

} // namespace okid_host
