// SPDX-License-Identifier: MIT
// PURPOSE  results of set-ups of one structure as one result
// METHOD   PoSER: confident modes are paired over the set-ups by frequency and MAC at the references, each shape is brought to
//          one scale there (least squares), f and damping are means with the weight 1/sigma^2. The deviation of a mean is
//          1/sqrt(sum of weights), widened where the set-ups scatter by more than their own deviations say (Birge 1932).
//          A set-up that doubts such a mode gives its shape there and nothing else; what most set-ups list as doubtful at one
//          frequency is listed as doubtful. Without references the forces scale the shapes: they act where they acted before
#include "merge.hpp"

#include "comparison.hpp"
#include "consensus/quantity.hpp"
#include "error.hpp"
#include "files/nearest_name.hpp"
#include "files/order_statistics.hpp"
#include "record/modal_model.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <map>
#include <utility>

namespace okid_host {
namespace {

using places_t = std::vector<std::pair<std::size_t, std::size_t>>;

/// Doubtful modes are one where most would call two peaks of a spectrum one.
constexpr pair_rule of_doubtful{0.01, 0.01, 0.01};

/// A mode over the set-ups: at most one of each; nullptr: a set-up lacks it.
struct merged_mode {
    std::vector<const known_mode*> of;   ///< that know f and damping
    std::vector<const known_mode*> also; ///< that doubt it: for the shape
    known_mode mean;                     ///< shape at the references
    bool doubtful = false;

    /// More than half of the set-ups are sure of it, or half, and the others list it with a shape that is none of noise.
    bool most_have_it() const {
        const auto listed = static_cast<std::size_t>(std::count_if(
            also.begin(), also.end(), [](const known_mode* one) { return one && !has_code(one->why, "noise_shape"); }));
        return 2 * count() > of.size() || (2 * count() == of.size() && count() + listed == of.size());
    }

    explicit merged_mode(std::size_t set_ups) : of(set_ups), also(set_ups) {}

    std::size_t count() const {
        return of.size() - static_cast<std::size_t>(std::count(of.begin(), of.end(), nullptr));
    }
};

struct mean_value {
    double value = 0, deviation = NAN;
    bool by_scatter = false; ///< the deviation rests on the set-ups, not on what each says of itself
};

mean_value mean_of(const std::vector<std::pair<double, double>>& known) {
    mean_value out;
    double weights = 0, sum = 0, square = 0;
    const bool weighted = std::all_of(known.begin(), known.end(),
                                      [](const auto& one) { return one.second > 0 && one.second < INFINITY; });
    for (const auto& [value, sigma] : known) {
        const double weight = weighted ? 1 / (sigma * sigma) : 1;
        weights += weight;
        sum += weight * value;
    }
    out.value = sum / weights;
    for (const auto& [value, sigma] : known)
        square += (weighted ? 1 / (sigma * sigma) : 1) * (value - out.value) * (value - out.value);
    const double spare = static_cast<double>(known.size()) - 1;
    const double scatter = spare > 0 ? square / spare : NAN;
    out.by_scatter = spare > 0 && (!weighted || scatter > 1);
    if (weighted)
        out.deviation = std::sqrt((out.by_scatter ? scatter : 1.0) / weights);
    else
        out.deviation = std::sqrt(scatter / weights);
    return out;
}

bool there(const std::complex<double>& entry) { return std::isfinite(std::abs(entry)); }

/// The factor that brings `own` nearest to `to`, over the entries that both have.
std::complex<double> scale_to(const mode_shape& own, const mode_shape& to) {
    std::complex<double> cross = 0;
    double power = 0;
    for (std::size_t i = 0; i < own.size(); ++i)
        if (there(own[i]) && there(to[i])) cross += std::conj(own[i]) * to[i], power += std::norm(own[i]);
    return power > 0 ? cross / power : 0;
}

class merger {
  public:
    merger(const std::vector<known_result>& results, const std::vector<std::string>& references,
           const std::vector<std::string>& order)
        : results_(results) {
        if (results.size() < 2)
            throw failure(exit_usage,
                          fmt::format("found {} result to merge, expected two set-ups or more", results.size()));
        std::vector<std::string> found;
        for (const known_result& one : results) found.insert(found.end(), one.places.begin(), one.places.end());
        const auto has = [](const std::vector<std::string>& names, const std::string& name) {
            return std::find(names.begin(), names.end(), name) != names.end();
        };
        for (const std::string& name : order)
            if (has(found, name)) names_.push_back(name);
        for (const std::string& name : found)
            if (!has(names_, name)) names_.push_back(name);
        choose_references(references);
    }

    record_result merge() {
        gather();
        if (modes_.empty()) throw failure(exit_usage, "no set-up has a confident mode: there is nothing to merge");
        return describe();
    }

  private:
    void choose_references(const std::vector<std::string>& wanted) {
        std::vector<std::string> common;
        for (const std::string& name : names_)
            if (std::all_of(results_.begin(), results_.end(), [&](const known_result& one) {
                    return std::find(one.places.begin(), one.places.end(), name) != one.places.end();
                }))
                common.push_back(name);
        for (const std::string& name : wanted)
            if (std::find(common.begin(), common.end(), name) == common.end())
                throw failure(exit_usage,
                              fmt::format("references: found \"{}\"{}, expected outputs that every set-up has: {}",
                                          printable(name), did_you_mean(name, common), list_names(common)));
        if (common.empty() && !(by_force_ = forces_known()))
            throw failure(exit_usage, "the set-ups have no output in common, expected a reference that stays where it "
                                      "is, with the same name in every result");
        references_ = wanted.empty() ? common : wanted;
    }

    bool forces_known() const {
        return std::all_of(results_.begin(), results_.end(), [](const known_result& one) {
            return std::none_of(one.modes.begin(), one.modes.end(),
                                [](const known_mode& mode) { return mode.confident && mode.drive.empty(); });
        });
    }

    mode_shape at_references(const known_mode& mode, const known_result& of) const {
        if (by_force_) return mode.drive;
        mode_shape out;
        for (const std::string& name : references_)
            out.push_back(mode.shape[static_cast<std::size_t>(std::find(of.places.begin(), of.places.end(), name) -
                                                              of.places.begin())]);
        return out;
    }

    std::size_t reference_count() const {
        if (!by_force_) return references_.size();
        for (const known_result& one : results_)
            for (const known_mode& mode : one.modes)
                if (!mode.drive.empty()) return mode.drive.size();
        return 0;
    }

    /// Means over the set-ups, as far as the pairing needs them.
    void renew(merged_mode& mode) const {
        std::vector<std::pair<double, double>> f;
        mode_shape sum(reference_count());
        std::vector<double> count(sum.size());
        mode_shape first;
        for (std::size_t k = 0; k < results_.size(); ++k) {
            if (!mode.of[k]) continue;
            f.emplace_back(mode.of[k]->frequency_hz, mode.of[k]->frequency_std_hz);
            const mode_shape own = at_references(*mode.of[k], results_[k]);
            if (first.empty()) first = own;
            const std::complex<double> factor = scale_to(own, first);
            for (std::size_t i = 0; i < own.size(); ++i)
                if (there(own[i])) sum[i] += factor * own[i], ++count[i];
        }
        const mean_value mean = mean_of(f);
        mode.mean.frequency_hz = mean.value;
        mode.mean.frequency_std_hz = mean.deviation;
        mode.mean.shape.clear();
        for (std::size_t i = 0; i < sum.size(); ++i)
            mode.mean.shape.push_back(count[i] > 0 ? sum[i] / count[i] : std::complex<double>(NAN, NAN));
    }

    /// Pairs of two lists by their shapes at the references; with one reference by frequency alone.
    places_t pairs(const std::vector<const known_mode*>& a, const std::vector<const known_mode*>& b,
                   const pair_rule& rule) const {
        places_t common;
        for (std::size_t i = 0; i < reference_count(); ++i) common.emplace_back(i, i);
        return pair_modes(a, b, common.size() < 2 ? std::vector<std::vector<double>>() : mac_of(a, b, common), rule);
    }

    /// Pairs of modes that are known over the set-ups (a) with those of one at these places (b).
    places_t pairs_with(const std::vector<merged_mode>& modes, std::size_t k, const std::vector<std::size_t>& which,
                        const pair_rule& rule) const {
        std::vector<known_mode> own;
        for (const std::size_t m : which) {
            own.push_back(results_[k].modes[m]);
            own.back().shape = at_references(own.back(), results_[k]);
        }
        std::vector<const known_mode*> known, fresh;
        for (const merged_mode& mode : modes) known.push_back(&mode.mean);
        for (const known_mode& mode : own) fresh.push_back(&mode);
        return pairs(known, fresh, rule);
    }

    void add_set_up(std::size_t k, const std::vector<std::size_t>& which, const pair_rule& rule,
                    std::vector<merged_mode>& to) const {
        std::vector<bool> placed(which.size());
        for (const auto& [g, m] : pairs_with(to, k, which, rule)) {
            to[g].of[k] = &results_[k].modes[which[m]];
            placed[m] = true;
        }
        for (std::size_t m = 0; m < which.size(); ++m)
            if (!placed[m]) to.emplace_back(results_.size()).of[k] = &results_[k].modes[which[m]];
        for (merged_mode& mode : to) renew(mode);
    }

    /// Two lines of set-ups that turned out to be one mode: the order of the files does not decide.
    bool join_two(std::vector<merged_mode>& modes, const pair_rule& rule) const {
        for (std::size_t g = 0; g < modes.size(); ++g)
            for (std::size_t h = g + 1; h < modes.size(); ++h) {
                bool apart = true;
                for (std::size_t k = 0; k < results_.size(); ++k) apart = apart && !(modes[g].of[k] && modes[h].of[k]);
                if (!apart || pairs({&modes[g].mean}, {&modes[h].mean}, rule).empty()) continue;
                for (std::size_t k = 0; k < results_.size(); ++k)
                    if (modes[h].of[k]) modes[g].of[k] = modes[h].of[k];
                modes.erase(modes.begin() + static_cast<std::ptrdiff_t>(h));
                renew(modes[g]);
                return true;
            }
        return false;
    }

    /// Doubtful modes of a set-up that no mode of all of them has yet; those that it knows otherwise lend their shape.
    std::vector<std::size_t> lend_shapes(std::size_t k) {
        std::vector<std::size_t> doubtful;
        for (std::size_t m = 0; m < results_[k].modes.size(); ++m) {
            const known_mode& mode = results_[k].modes[m];
            if (!mode.confident && !at_references(mode, results_[k]).empty()) doubtful.push_back(m);
        }
        std::vector<bool> lent(doubtful.size());
        for (const auto& [g, m] : pairs_with(modes_, k, doubtful, of_doubtful)) {
            lent[m] = true;
            if (!modes_[g].of[k]) modes_[g].also[k] = &results_[k].modes[doubtful[m]];
        }
        std::vector<std::size_t> left;
        for (std::size_t m = 0; m < doubtful.size(); ++m)
            if (!lent[m]) left.push_back(doubtful[m]);
        return left;
    }

    void gather() {
        for (std::size_t k = 0; k < results_.size(); ++k) add_set_up(k, results_[k].confident(), of_set_ups, modes_);
        while (join_two(modes_, of_set_ups)) {
        }
        if (modes_.empty()) return;
        std::vector<merged_mode> doubtful;
        for (std::size_t k = 0; k < results_.size(); ++k) add_set_up(k, lend_shapes(k), of_doubtful, doubtful);
        while (join_two(doubtful, of_doubtful)) {
        }
        for (merged_mode& mode : doubtful) {
            mode.doubtful = true;
            if (2 * mode.count() >= results_.size()) modes_.push_back(std::move(mode));
        }
        std::sort(modes_.begin(), modes_.end(),
                  [](const merged_mode& a, const merged_mode& b) { return a.mean.frequency_hz < b.mean.frequency_hz; });
    }

    /// Over all places, largest entry 1; NaN where only set-ups without the mode have been.
    mode_shape whole_shape(const merged_mode& mode) const {
        mode_shape sum(names_.size());
        std::vector<double> count(names_.size());
        for (std::size_t k = 0; k < results_.size(); ++k) {
            const known_mode* one = mode.of[k] ? mode.of[k] : mode.also[k];
            if (!one) continue;
            const std::complex<double> factor = scale_to(at_references(*one, results_[k]), mode.mean.shape);
            for (const auto& [at, own] : common_places(names_, results_[k].places))
                if (there(one->shape[own])) sum[at] += factor * one->shape[own], ++count[at];
        }
        std::complex<double> largest = 0;
        for (std::size_t i = 0; i < sum.size(); ++i) {
            sum[i] = count[i] > 0 ? sum[i] / count[i] : std::complex<double>(NAN, NAN);
            if (there(sum[i]) && std::abs(sum[i]) > std::abs(largest)) largest = sum[i];
        }
        if (largest != 0.0)
            for (auto& entry : sum) entry /= largest;
        return sum;
    }

    double median_emac(const merged_mode& mode) const {
        std::vector<double> known;
        for (const known_mode* one : mode.of)
            if (one && std::isfinite(one->emac)) known.push_back(one->emac);
        return upper_median(known);
    }

    void describe_set_ups(result_context& to) const {
        to.method = "poser";
        to.records = static_cast<int>(results_.size());
        to.outputs = names_;
        to.hold = results_.front().hold;
        to.detrend = results_.front().detrend;
        for (std::size_t k = 0; k < results_.size(); ++k) {
            const known_result& one = results_[k];
            to.set_ups.push_back({file_name(one.name), one.outputs});
            to.fs_hz = std::max(to.fs_hz, one.fs_hz);
            to.samples += one.samples;
            to.gaps += one.gaps;
        }
        for (const auto& [code, said] : remarks_by_code())
            to.warnings.emplace_back(code, fmt::format("set-up{} {}: {}", said.first.size() > 1 ? "s" : "",
                                                       fmt::join(said.first, ", "), said.second));
    }

    /// Of each code the set-ups that say it, and what the first of them says.
    std::vector<std::pair<std::string, std::pair<std::vector<std::size_t>, std::string>>> remarks_by_code() const {
        std::vector<std::pair<std::string, std::pair<std::vector<std::size_t>, std::string>>> out;
        for (std::size_t k = 0; k < results_.size(); ++k)
            for (const auto& [code, text] : results_[k].warnings) {
                auto at = std::find_if(out.begin(), out.end(),
                                       [&, wanted = code](const auto& one) { return one.first == wanted; });
                if (at == out.end()) at = out.insert(out.end(), {code, {{}, text}});
                std::vector<std::size_t>& set_ups = at->second.first;
                if (set_ups.empty() || set_ups.back() != k + 1) set_ups.push_back(k + 1);
            }
        return out;
    }

    /// Codes of at least half of the set-ups that list a doubtful mode.
    static std::vector<std::string> reasons(const merged_mode& mode) {
        std::map<std::string, std::size_t> count;
        for (const known_mode* one : mode.of)
            for (const std::string& code : one ? one->why : std::vector<std::string>()) ++count[code];
        std::vector<std::string> out;
        for (const auto& [code, times] : count)
            if (2 * times >= mode.count()) out.push_back(code);
        if (out.empty()) out.emplace_back("few_runs");
        return out;
    }

    record_result describe() {
        record_work work;
        describe_set_ups(work.context);
        work.set.n_y = names_.size();
        std::vector<listed_mode> listed;
        deviations sigma;
        int blocks = 0;
        for (const known_result& one : results_)
            if (one.sigma_blocks > 0) blocks = blocks == 0 ? one.sigma_blocks : std::min(blocks, one.sigma_blocks);
        for (const merged_mode& mode : modes_) {
            std::vector<std::pair<double, double>> f, zeta;
            for (const known_mode* one : mode.of)
                if (one)
                    f.emplace_back(one->frequency_hz, one->frequency_std_hz),
                        zeta.emplace_back(one->damping_ratio, one->damping_ratio_std);
            const mean_value frequency = mean_of(f), damping = mean_of(zeta);
            if (frequency.by_scatter || damping.by_scatter)
                blocks = blocks == 0 ? static_cast<int>(f.size()) : std::min(blocks, static_cast<int>(f.size()));
            sigma.frequency_hz.push_back(frequency.deviation);
            sigma.damping_ratio.push_back(damping.deviation);
            sigma.shape_re.insert(sigma.shape_re.end(), names_.size(), NAN);
            mode_shape shape = whole_shape(mode);
            mode_shape states = shape;
            for (auto& entry : states)
                if (!there(entry)) entry = 0;
            listed.push_back({frequency.value, damping.value, shape_collinearity(states, {}), median_emac(mode),
                              std::move(shape), !mode.doubtful});
            mode_verdict& verdict = work.context.verdicts.emplace_back();
            verdict.found_in = static_cast<double>(mode.count()) / static_cast<double>(results_.size());
            verdict.confident = !mode.doubtful && mode.most_have_it();
            if (!verdict.confident) verdict.why = mode.doubtful ? reasons(mode) : std::vector<std::string>{"few_runs"};
        }
        sigma.shape_im = sigma.shape_re;
        sigma.replicates = blocks;
        if (std::any_of(sigma.frequency_hz.begin(), sigma.frequency_hz.end(), [](double one) { return one > 0; }))
            work.context.sigma = std::move(sigma);
        make_modal_model(listed, work.context.fs_hz, work);
        record_result out;
        out.model = kept_model(work.model);
        out.context = std::move(work.context);
        return out;
    }

    const std::vector<known_result>& results_;
    std::vector<std::string> names_, references_;
    bool by_force_ = false; ///< no output is in common
    std::vector<merged_mode> modes_;
};

} // namespace

record_result merge_results(const std::vector<known_result>& results, const std::vector<std::string>& references,
                            const std::vector<std::string>& order) {
    return merger(results, references, order).merge();
}

} // namespace okid_host
