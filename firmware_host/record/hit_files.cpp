// SPDX-License-Identifier: MIT
#include "hit_files.hpp"

#include "error.hpp"
#include "files/nearest_name.hpp"
#include "hit_verdict.hpp"
#include "record_check.hpp"
#include "request.hpp"
#include "roving.hpp"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <map>
#include <regex>

namespace okid_host {
namespace {

constexpr std::size_t most_hits_named = 8;
constexpr std::size_t longest_name = 256;                 // of a file, that a regular expression looks at
constexpr double same_peak = 1e-3;                        // peaks of different hits closer than this are one number
constexpr std::size_t fewest_alike = 3, share_alike = 10; // hits, and one of so many, with it: by chance hardly any
constexpr double same_pulse = 0.95;      // of the sum of a pulse: closer, and it is one force again and again
constexpr double weaker = 0.9;           // of the limit: a hit below does not reach it
constexpr double belongs_to_pulse = 0.1; // of the peak

hit_line line_of(const record_set& set, const record_data& record, const std::vector<hit_channel>& channels,
                 const hit_span& span, const record_options& options) {
    hit_window window;
    window.rows = set.rows(record);
    window.count = record.count;
    window.width = set.channels();
    window.before = span.begin;
    window.rate_hz = options.fs_hz;
    window.channels = &channels;
    window.sign = span.sign;
    window.unit = channels[0].unit.empty() ? "" : " " + channels[0].unit;
    if (options.band) window.spectrum_hz = std::min(options.band->second, options.fs_hz / 2);
    const hit_verdict found = judge_hit(window);
    hit_line out;
    out.file = file_name(record.path);
    if (record.part) {
        out.first = static_cast<long long>(record.from);
        out.end = static_cast<long long>(record.from + record.count);
    }
    out.fault = found.fault;
    out.text = found.text + (found.note.empty() ? "" : "; " + found.note);
    out.peak = found.peak;
    out.duration_s = found.duration_s;
    out.band_hz = found.band_hz;
    out.accepted = found.good() || options.keep_all_hits;
    return out;
}

std::vector<hit_channel> channels_of_hit(const record_options& options) {
    std::vector<hit_channel> out;
    for (const std::string& name : options.inputs) out.push_back({name, true, "", 1, true});
    for (const std::string& name : options.outputs) out.push_back({name, false, "", 1, false}); // a gap is left out
    for (std::size_t c = 0; c < std::min(out.size(), options.hit_units.size()); ++c) out[c].unit = options.hit_units[c];
    return out;
}

/// Largest force of a hit, and the sum of its samples beyond 10 % of it.
struct pulse_size {
    double peak = 0, sum = 0;
};

pulse_size size_of(const record_set& set, const record_data& record, double sign) {
    pulse_size out;
    const auto force = [&](std::size_t i) { return sign * set.rows(record)[i * set.channels()]; };
    for (std::size_t i = 0; i < record.count; ++i) out.peak = std::fmax(out.peak, force(i));
    for (std::size_t i = 0; i < record.count; ++i)
        if (force(i) > belongs_to_pulse * out.peak) out.sum += force(i);
    return out;
}

/// A force that no hit exceeds.
struct force_limit {
    double at = INFINITY; ///< infinity: none is seen
    bool sure = false;    ///< there are weaker hits, too: it is the limit of an amplifier
};

/// Several hits reach it, though they are not the same force again. Copies of a record count once.
force_limit limit_of(const record_set& set, const std::vector<hit_span>& spans) {
    std::vector<pulse_size> pulses;
    std::vector<std::size_t> counted;
    for (std::size_t r = 0; r < spans.size(); ++r) {
        const record_data& record = set.records[r];
        if (std::any_of(counted.begin(), counted.end(),
                        [&](std::size_t other) { return same_samples(set, record, set.records[other]); }))
            continue;
        counted.push_back(r);
        pulses.push_back(size_of(set, record, spans[r].sign));
    }
    std::sort(pulses.begin(), pulses.end(),
              [](const pulse_size& one, const pulse_size& other) { return one.peak > other.peak; });
    const double limit = (1 - same_peak) * pulses.front().peak;
    std::size_t alike = 0;
    double least = INFINITY, most = 0;
    for (; alike < pulses.size() && pulses[alike].peak >= limit; ++alike)
        least = std::fmin(least, pulses[alike].sum), most = std::fmax(most, pulses[alike].sum);
    if (alike < std::max(fewest_alike, (pulses.size() + share_alike - 1) / share_alike) || least > same_pulse * most)
        return {};
    return {limit, pulses.back().peak < weaker * limit};
}

void say_left_out(const std::vector<hit_line>& hits, remarks& said) {
    std::vector<std::string> names;
    std::size_t count = 0;
    for (const hit_line& hit : hits)
        if (!hit.accepted && ++count <= most_hits_named)
            names.push_back(fmt::format("{}: {}, {}", hit.name(), hit.fault, hit.text));
    if (count == 0) return;
    said.emplace_back(
        "hits_left_out",
        fmt::format("{} of {} hits: {}{}; --keep-all takes them", count, hits.size(), fmt::join(names, "; "),
                    count > most_hits_named ? fmt::format("; and {} more", count - most_hits_named) : std::string()));
    std::map<int, bool> places;
    for (const hit_line& hit : hits) places[std::abs(hit.place)] |= hit.accepted;
    std::vector<int> missing;
    for (const auto& [place, any] : places)
        if (!any) missing.push_back(place);
    if (!missing.empty())
        said.emplace_back("place_missing", fmt::format("no good hit at place {}: the shapes are without {}",
                                                       fmt::join(missing, ", "), missing.size() == 1 ? "it" : "them"));
}

[[noreturn]] void throw_no_hit(const std::vector<hit_line>& hits) {
    std::map<std::string, int> faults;
    for (const hit_line& hit : hits) ++faults[hit.fault];
    std::vector<std::string> counted;
    for (const auto& [fault, count] : faults) counted.push_back(fmt::format("{} {}", count, fault));
    throw failure(exit_no_model, fmt::format("no hit was accepted: {}; of {}: {}. --keep-all takes them",
                                             fmt::join(counted, ", "), hits.front().name(), hits.front().text));
}

/// The places that are left, and M, K and R if they still have a force or a sensor each.
void keep_places(record_options& options) {
    const std::vector<int> left = hit_places(options.hits);
    for (mass_plan* plan : {&options.placed, &options.mass})
        plan->inputs.erase(std::remove_if(plan->inputs.begin(), plan->inputs.end(),
                                          [&](const mass_channel& one) {
                                              return !std::binary_search(left.begin(), left.end(), one.dof);
                                          }),
                           plan->inputs.end());
    if (options.mass.wanted() && !plan_fault(options.mass).empty()) options.mass = {};
}

bool most_rest(const std::vector<hit_span>& spans) {
    const auto resting =
        std::count_if(spans.begin(), spans.end(), [](const hit_span& one) { return one.free >= least_free; });
    return 2 * static_cast<std::size_t>(resting) >= spans.size();
}

} // namespace

bool are_hits(const record_set& records) {
    std::vector<hit_span> spans;
    for (const record_data& record : records.records) {
        const double* force = records.rows(record);
        spans.push_back(find_hit(force, record.count, records.channels()));
        if (!find_cuts(force, record.count, records.channels()).empty()) spans.back().free = 1;
    }
    return most_rest(spans);
}

void cut_at_hits(record_set& records, std::vector<int>& places) {
    std::vector<std::vector<std::size_t>> cuts;
    std::size_t more = 0;
    for (const record_data& record : records.records) {
        cuts.push_back(find_cuts(records.rows(record), record.count, records.channels()));
        more += cuts.back().size();
    }
    if (more == 0) return;
    std::vector<record_data> parts;
    std::vector<int> of_parts;
    for (std::size_t r = 0; r < cuts.size(); ++r) {
        const record_data& whole = records.records[r];
        std::size_t from = 0;
        cuts[r].push_back(whole.count);
        for (const std::size_t end : cuts[r]) {
            parts.push_back({whole.path, whole.first + from, end - from, from, cuts[r].size() > 1});
            of_parts.push_back(places[r]);
            from = end;
        }
    }
    records.records = std::move(parts);
    places = std::move(of_parts);
}

std::vector<hit_line> choose_hits(record_set& records, record_options& options) {
    std::vector<hit_channel> channels = channels_of_hit(options);
    std::vector<hit_span> spans;
    for (const record_data& record : records.records)
        spans.push_back(find_hit(records.rows(record), record.count, records.channels()));
    if (!most_rest(spans)) return {};
    const force_limit limit = limit_of(records, spans);
    if (limit.sure) channels.front().high = limit.at, channels.front().low = -limit.at;
    std::vector<hit_line> hits;
    record_set kept;
    kept.n_u = records.n_u;
    kept.n_y = records.n_y;
    kept.complete = records.complete;
    std::vector<int> places;
    for (std::size_t r = 0; r < spans.size(); ++r) {
        const record_data& record = records.records[r];
        hits.push_back(line_of(records, record, channels, spans[r], options));
        hits.back().place = options.hits[r];
        if (hits.back().accepted && !limit.sure && std::abs(hits.back().peak) >= limit.at)
            hits.back().text += "; the peak of other hits, too: was the amplifier at its limit?";
        if (!hits.back().accepted) continue;
        kept.add(record.path, records.rows(record), record.count);
        places.push_back(options.hits[r]);
    }
    if (places.empty()) throw_no_hit(hits);
    say_left_out(hits, options.said);
    records = std::move(kept);
    options.hits = std::move(places);
    keep_places(options);
    return hits;
}

std::string places_of_names(const std::string& expression, const std::vector<std::string>& paths) {
    std::regex wanted;
    try {
        wanted.assign(expression);
    } catch (const std::regex_error& fault) {
        throw failure(exit_usage, fmt::format("--places: \"{}\" is no regular expression", printable(expression)));
    }
    if (wanted.mark_count() != 1 && wanted.mark_count() != 2)
        throw failure(exit_usage,
                      fmt::format("--places: \"{}\" has {} groups, expected one, around the number of the place, as in "
                                  "P(\\d+)_, or a second for its sign, as in P(\\d+)[XYZ]([+-]?)_",
                                  printable(expression), wanted.mark_count()));
    std::map<std::string, std::string> directions; // of each place
    std::vector<std::string> out;
    for (const std::string& path : paths) {
        if (!std::filesystem::is_regular_file(path))
            throw failure(exit_usage, fmt::format("{}: {}", path,
                                                  std::filesystem::is_directory(path)
                                                      ? "is a folder, expected the files in it: give them as " +
                                                            (std::filesystem::path(path) / "*.csv").string()
                                                      : "no such file, expected the records of the hits"));
        const std::string name = file_name(path).substr(0, longest_name);
        std::smatch found;
        if (!std::regex_search(name, found, wanted))
            throw failure(exit_usage,
                          fmt::format("--places: \"{}\" does not match the file name {}", printable(expression), path));
        const std::string place = found[1], sign = wanted.mark_count() > 1 ? found[2].str() : "";
        if (whole_number(fmt::format("--places, {}", path), place, -10000, 10000) == 0)
            throw failure(exit_usage,
                          fmt::format("--places, {}: found \"{}\", expected a number from 1", path, printable(place)));
        if (!sign.empty() && sign != "+" && sign != "-")
            throw failure(exit_usage, fmt::format("--places, {}: found \"{}\" for the sign, expected + or - or nothing",
                                                  path, printable(sign)));
        out.push_back(sign == "-" ? "-" + place : place);
        static const std::regex direction("^([XYZxyz])([+-]?)[_.]");
        const std::string behind(found[1].second, name.cend());
        std::smatch seen;
        if (!std::regex_search(behind, seen, direction)) continue;
        if (seen[2] == "-" && wanted.mark_count() == 1)
            throw failure(
                exit_usage,
                fmt::format("--places, {}: a direction with a sign stands behind place {}: take the sign into "
                            "a second group, as in P(\\d+)[XYZ]([+-]?)_",
                            path, place));
        const auto [known, first] = directions.emplace(place, seen[1]);
        if (known->second != seen[1])
            throw failure(exit_usage,
                          fmt::format("--places, {}: place {} is struck in {}, in an earlier file in {}: each "
                                      "direction needs a number of its own, give them with --hit-dofs",
                                      path, place, seen[1].str(), known->second));
    }
    return fmt::format("{}", fmt::join(out, ","));
}

} // namespace okid_host
