// SPDX-License-Identifier: MIT
// PURPOSE  records struck at different places, and records that contradict each other
// METHOD   poles and sensor shapes are common to all records; B and D are those of each place
//          (residue_fit). Records contradict when B and D of all together leave far more of one than its own do
#include "roving.hpp"

#include "error.hpp"
#include "hit_verdict.hpp"
#include "moved_outputs.hpp"
#include "record_check.hpp"
#include "record_fit.hpp"
#include "record_refine.hpp"
#include "residue_fit.hpp"
#include "result/judgement.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <fmt/ranges.h>

namespace okid_host {
namespace {

using Eigen::VectorXd;

constexpr double explained = 0.5;     // of a record's energy that its own B and D must not leave: the modes are its own
constexpr double contradiction = 0.1; // more of the energy left by the others' B and D: a third of the amplitude
constexpr std::size_t most_named = 8;
constexpr int most_beside = 4; // samples of the force before and after an output's that it may follow at once

std::size_t index_of(const std::vector<int>& places, int hit) {
    return static_cast<std::size_t>(std::find(places.begin(), places.end(), std::abs(hit)) - places.begin());
}

hit_span span_of(const record_set& set, const record_data& record) {
    return find_hit(set.rows(record), record.count, set.channels());
}

/// The records of one place, with the force's sign as the place has it.
record_set records_at(const record_set& set, const std::vector<int>& hits, int place) {
    record_set out;
    out.n_u = set.n_u;
    out.n_y = set.n_y;
    for (std::size_t r = 0; r < hits.size(); ++r) {
        if (std::abs(hits[r]) != place) continue;
        const std::size_t first = out.samples.size();
        out.add(set.records[r].path, set.rows(set.records[r]), set.records[r].count);
        if (hits[r] < 0)
            for (std::size_t i = first; i < out.samples.size(); i += out.channels()) out.samples[i] *= -1;
    }
    return out;
}

/// Records that the B and D of one of them explain, the largest group first.
std::vector<std::vector<std::size_t>> groups_of(const std::vector<residue_sums>& sums,
                                                std::vector<std::size_t> records) {
    std::vector<std::vector<std::size_t>> out;
    while (!records.empty()) {
        const VectorXd x = fit_residues({&sums[records.front()]});
        std::vector<std::size_t> alike, others;
        for (const std::size_t r : records) {
            const bool same =
                residue_left(sums[r], x) < residue_left(sums[r], fit_residues({&sums[r]})) + contradiction;
            (same || r == records.front() ? alike : others).push_back(r);
        }
        out.push_back(std::move(alike));
        records = std::move(others);
    }
    std::sort(out.begin(), out.end(), [](const auto& a, const auto& b) {
        return a.size() != b.size() ? a.size() > b.size() : a.front() < b.front();
    });
    return out;
}

std::string names_of(const record_set& set, const std::vector<std::size_t>& records) {
    std::vector<std::string> names;
    for (const std::size_t r : records)
        if (names.size() < most_named) names.push_back(set.records[r].path);
    const std::size_t more = records.size() - names.size();
    return fmt::format("{}{}", fmt::join(names, ", "), more ? fmt::format(" and {} more", more) : std::string());
}

std::string contradiction_text(const record_set& set, const std::vector<residue_sums>& sums,
                               const std::vector<std::size_t>& records) {
    std::vector<const residue_sums*> all;
    for (const std::size_t r : records) all.push_back(&sums[r]);
    const VectorXd x = fit_residues(all);
    double worst = 0, own = 0;
    for (const std::size_t r : records) {
        const double alone = residue_left(sums[r], fit_residues({&sums[r]})), together = residue_left(sums[r], x);
        if (alone < explained && together - alone > std::max(worst - own, contradiction)) worst = together, own = alone;
    }
    if (worst == 0) return "";
    const auto groups = groups_of(sums, records);
    std::string text;
    for (std::size_t g = 0; g < groups.size() && g < most_named; ++g)
        text += fmt::format("{}{}", g ? "; otherwise " : "", names_of(set, groups[g]));
    if (groups.size() > most_named) text += fmt::format("; and {} more kinds", groups.size() - most_named);
    return fmt::format(
        "answering alike: {}. One force column for all leaves {:.0f} % of the energy of a record of which "
        "its own leaves {:.0f} %: were they struck at different places? --hit-dofs says where",
        text, 100 * std::min(worst, 1.0), 100 * own);
}

/// What one B and D cannot explain of the records of each place, or of all.
std::vector<std::string> contradictions(const std::vector<listed_mode>& modes, const std::vector<int>& hits,
                                        double fs_hz, const record_set& set, bool at_rest) {
    std::vector<std::string> out;
    if (set.records.size() < 2 || set.n_u == 0) return out;
    const auto sums = sum_residues(modes, fs_hz, set, at_rest || are_blows(set));
    for (const int place : hits.empty() ? std::vector<int>{0} : hit_places(hits)) {
        std::vector<std::size_t> records;
        for (std::size_t r = 0; r < sums.size(); ++r)
            if (hits.empty() || hits[r] == place) records.push_back(r);
        std::string text = records.size() < 2 ? "" : contradiction_text(set, sums, records);
        if (!text.empty()) out.push_back(std::move(text));
    }
    return out;
}

} // namespace

bool are_blows(const record_set& set) {
    return set.n_u == 1 && std::all_of(set.records.begin(), set.records.end(), [&](const record_data& record) {
               return span_of(set, record).free >= least_free;
           });
}

std::vector<int> hit_places(const std::vector<int>& hits) {
    std::vector<int> out;
    for (const int hit : hits) out.push_back(std::abs(hit));
    std::sort(out.begin(), out.end());
    out.erase(std::unique(out.begin(), out.end()), out.end());
    return out;
}

std::vector<std::string> place_names(const std::string& force, const std::vector<int>& hits) {
    std::vector<std::string> out;
    for (const int place : hit_places(hits)) out.push_back(fmt::format("{}@{}", force, place));
    return out;
}

record_set one_column_a_place(const record_set& set, const std::vector<int>& hits) {
    const std::vector<int> places = hit_places(hits);
    record_set out;
    out.n_u = places.size();
    out.n_y = set.n_y;
    out.records = set.records;
    out.samples.assign(set.count() * out.channels(), 0.0);
    for (std::size_t r = 0; r < hits.size(); ++r) {
        const double* from = set.rows(set.records[r]);
        double* to = out.rows(out.records[r]);
        for (std::size_t i = 0; i < set.records[r].count; ++i, from += set.channels(), to += out.channels()) {
            to[index_of(places, hits[r])] = hits[r] < 0 ? -from[0] : from[0];
            std::copy_n(from + 1, set.n_y, to + out.n_u);
        }
    }
    return out;
}

void rest_forces(record_set& blows) {
    for (const record_data& record : blows.records) {
        const hit_span span = span_of(blows, record);
        const std::size_t length = span.end - span.begin, m = blows.channels();
        double* force = blows.rows(record);
        double sum = 0, count = 0;
        for (std::size_t i = 0; i < record.count; ++i)
            if ((i + length < span.begin || i >= span.end + length) && !std::isnan(force[i * m]))
                sum += force[i * m], ++count;
        for (std::size_t i = 0; count > 0 && i < record.count; ++i) force[i * m] -= sum / count;
    }
}

record_set free_decays(const record_set& set) {
    record_set out;
    out.n_y = set.n_y;
    for (const record_data& record : set.records) {
        const std::size_t first = span_of(set, record).end;
        out.add(record.path, set.outputs(record, first, record.count).data(), record.count - first);
    }
    return out;
}

void fit_places(const std::vector<listed_mode>& modes, const std::vector<int>& hits, double fs_hz, record_work& work) {
    const std::vector<int> places = hit_places(hits);
    refined_arrays& arrays = *work.refined;
    okid_identified_t& model = work.model;
    const auto n_z = static_cast<std::size_t>(model.n_z), n_y = work.set.n_y;
    arrays.B.assign(n_z * places.size(), 0.0);
    arrays.D.assign(n_y * places.size(), 0.0);
    std::vector<double> residual(n_y), spread(n_y);
    std::vector<std::vector<double>> states(hits.size(), std::vector<double>(n_z));
    for (std::size_t j = 0; j < places.size(); ++j) {
        const record_set own = records_at(work.set, hits, places[j]);
        const auto sums = sum_residues(modes, fs_hz, own, true);
        std::vector<const residue_sums*> all;
        for (const residue_sums& one : sums) all.push_back(&one);
        const VectorXd x = fit_residues(all);
        std::copy_n(x.data(), n_z, arrays.B.data() + j * n_z);
        std::copy_n(x.data() + n_z, n_y, arrays.D.data() + j * n_y);
        okid_identified_t one = model;
        one.n_u = 1;
        one.B = arrays.B.data() + j * n_z;
        one.D = arrays.D.data() + j * n_y;
        result_context context;
        fit_records(own, one, context);
        const std::vector<output_spread> about = spreads_of(own);
        for (std::size_t o = 0; o < n_y; ++o) {
            const double left = 1 - (*context.simulation_percent)[o] / 100;
            residual[o] += left * left * about[o].squares;
            spread[o] += about[o].squares;
        }
        std::size_t k = 0;
        for (std::size_t r = 0; r < hits.size(); ++r)
            if (std::abs(hits[r]) == places[j]) states[r] = (*context.x0)[k++];
    }
    std::vector<double> percent;
    for (std::size_t o = 0; o < n_y; ++o) percent.push_back(100 * (1 - std::sqrt(residual[o] / spread[o])));
    model.n_u = static_cast<std::int32_t>(places.size());
    model.B = arrays.B.data();
    model.D = arrays.D.data();
    model.markov_count = markov_blocks;
    find_markov(model_view(model), model.markov_count, arrays.markov);
    model.markov = arrays.markov.data();
    work.context.simulation_percent = work.context.prediction_percent = percent;
    work.context.x0 = std::move(states);
}

place_residues find_residues(const std::vector<listed_mode>& modes, const std::vector<int>& hits, double fs_hz,
                             const record_set& set) {
    const std::vector<int> places = hit_places(hits);
    const auto n = std::count_if(modes.begin(), modes.end(), [](const listed_mode& mode) { return mode.in_model; });
    const auto count = static_cast<Eigen::Index>(places.size());
    place_residues out{Eigen::MatrixXcd(n, count), Eigen::MatrixXd(n, count)};
    const auto b_of = [n](const std::vector<const residue_sums*>& records) {
        const VectorXd x = fit_residues(records);
        return Eigen::VectorXcd(Eigen::Map<const Eigen::VectorXcd>(
            reinterpret_cast<const std::complex<double>*>(x.data()), n)); // real and imaginary parts alternate
    };
    Eigen::ArrayXd squares = Eigen::ArrayXd::Zero(n);
    Eigen::ArrayXd hits_there(count);
    double free = 0;
    for (Eigen::Index j = 0; j < count; ++j) {
        auto sums =
            sum_residues(modes, fs_hz, records_at(set, hits, places[static_cast<std::size_t>(j)]), true, most_beside);
        keep_samples_beside(sums, most_beside, set.n_y);
        std::vector<const residue_sums*> all;
        for (const residue_sums& one : sums) all.push_back(&one);
        out.b.col(j) = b_of(all);
        for (const residue_sums& one : sums) squares += (b_of({&one}) - out.b.col(j)).array().abs2();
        hits_there[j] = static_cast<double>(sums.size());
        free += hits_there[j] - 1;
    }
    for (Eigen::Index j = 0; j < count; ++j) // 0 / 0: nothing to be said
        out.std.col(j) = (squares * (free > 0 ? 1 / free : NAN) / hits_there[j]).sqrt();
    return out;
}

void doubt_scattered(const std::vector<int>& hits, double fs_hz, const record_set& blows,
                     std::vector<listed_mode>& modes, std::vector<mode_verdict>& verdicts) {
    if (!contradictions(modes, hits, fs_hz, blows, true).empty()) return; // struck elsewhere than is said: no noise
    const place_residues found = find_residues(modes, hits, fs_hz, blows);
    Eigen::Index row = 0;
    for (std::size_t k = 0; k < modes.size(); ++k) {
        if (!modes[k].in_model) continue;
        if (found.b.row(row).norm() < judgement::least_strength * found.std.row(row).norm())
            doubt("noise_shape", verdicts[k], modes[k]);
        ++row;
    }
}

void check_hits(const record_set& set, const std::vector<int>& hits) {
    if (!hits.empty() && hits.size() != set.records.size())
        throw failure(exit_usage, fmt::format("--hit-dofs: found {} numbers for {} records, expected one for each",
                                              hits.size(), set.records.size()));
}

std::vector<listed_mode> modes_of(const okid_identified_t& model) {
    std::vector<listed_mode> out;
    for (int k = 0; k < model.mode_count; ++k) {
        const auto at = static_cast<std::ptrdiff_t>(k) * model.n_y;
        std::vector<std::complex<double>> shape;
        for (int i = 0; i < model.n_y; ++i) shape.emplace_back(model.shape_re[at + i], model.shape_im[at + i]);
        out.push_back({model.frequency_hz[k], model.damping_ratio[k], model.mpc[k], model.emac[k], std::move(shape),
                       model.emac[k] >= judgement::doubtful_emac});
    }
    return out;
}

void remark_contradiction(const std::vector<listed_mode>& modes, const std::vector<int>& hits, double fs_hz,
                          record_work& work) {
    if (const std::string text = moved_outputs_text(modes, work.context.sigma, fs_hz, work.set); !text.empty())
        work.context.warnings.emplace_back("records_contradict", text);
    for (const std::string& text : contradictions(modes, hits, fs_hz, work.set, work.at_rest))
        work.context.warnings.emplace_back("records_contradict", text);
}

} // namespace okid_host
