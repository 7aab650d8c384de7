// SPDX-License-Identifier: MIT
// PURPOSE  results of set-ups of one structure as one result
// METHOD   PoSER: confident modes are paired over the set-ups by frequency and MAC at the references, each shape is brought to
//          one scale there (least squares), f and damping are means with the weight 1/sigma^2. The deviation of a mean is
//          1/sqrt(sum of weights), widened where the set-ups scatter by more than their own deviations say (Birge 1932)
#include "merge.hpp"

#include "comparison.hpp"
#include "consensus/quantity.hpp"
#include "error.hpp"
#include "files/nearest_name.hpp"
#include "record/modal_model.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <utility>

namespace okid_host {
namespace {

using places_t = std::vector<std::pair<std::size_t, std::size_t>>;

/// A mode over the set-ups: at most one of each; nullptr: a set-up lacks it.
struct merged_mode {
    std::vector<const known_mode*> of;
    known_mode mean; ///< shape at the references

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
    merger(const std::vector<known_result>& results, const std::vector<std::string>& references) : results_(results) {
        if (results.size() < 2)
            throw failure(exit_usage,
                          fmt::format("found {} result to merge, expected two set-ups or more", results.size()));
        for (const known_result& one : results)
            for (const std::string& name : one.places)
                if (std::find(names_.begin(), names_.end(), name) == names_.end()) names_.push_back(name);
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
        if (common.empty())
            throw failure(exit_usage, "the set-ups have no output in common, expected a reference that stays where it "
                                      "is, with the same name in every result");
        references_ = wanted.empty() ? common : wanted;
    }

    mode_shape at_references(const known_mode& mode, const known_result& of) const {
        mode_shape out;
        for (const std::string& name : references_)
            out.push_back(mode.shape[static_cast<std::size_t>(std::find(of.places.begin(), of.places.end(), name) -
                                                              of.places.begin())]);
        return out;
    }

    /// Means over the set-ups, as far as the pairing needs them.
    void renew(merged_mode& mode) const {
        std::vector<std::pair<double, double>> f, zeta;
        mode_shape sum(references_.size());
        std::vector<double> count(references_.size());
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
    std::vector<std::pair<std::size_t, std::size_t>> pairs(const std::vector<const known_mode*>& a,
                                                           const std::vector<const known_mode*>& b) const {
        places_t common;
        for (std::size_t i = 0; i < references_.size(); ++i) common.emplace_back(i, i);
        return pair_modes(a, b, references_.size() < 2 ? std::vector<std::vector<double>>() : mac_of(a, b, common),
                          of_set_ups);
    }

    void add_set_up(std::size_t k) {
        const std::vector<std::size_t> confident = results_[k].confident();
        std::vector<known_mode> own;
        for (const std::size_t m : confident) {
            own.push_back(results_[k].modes[m]);
            own.back().shape = at_references(own.back(), results_[k]);
        }
        std::vector<const known_mode*> known, fresh;
        for (const merged_mode& mode : modes_) known.push_back(&mode.mean);
        for (const known_mode& mode : own) fresh.push_back(&mode);
        std::vector<bool> placed(own.size());
        for (const auto& [g, m] : pairs(known, fresh)) {
            modes_[g].of[k] = &results_[k].modes[confident[m]];
            placed[m] = true;
        }
        for (std::size_t m = 0; m < own.size(); ++m) {
            if (placed[m]) continue;
            modes_.emplace_back().of.resize(results_.size());
            modes_.back().of[k] = &results_[k].modes[confident[m]];
        }
        for (merged_mode& mode : modes_) renew(mode);
    }

    /// Two lines of set-ups that turned out to be one mode: the order of the files does not decide.
    bool join_two() {
        for (std::size_t g = 0; g < modes_.size(); ++g)
            for (std::size_t h = g + 1; h < modes_.size(); ++h) {
                bool apart = true;
                for (std::size_t k = 0; k < results_.size(); ++k)
                    apart = apart && !(modes_[g].of[k] && modes_[h].of[k]);
                if (!apart || pairs({&modes_[g].mean}, {&modes_[h].mean}).empty()) continue;
                for (std::size_t k = 0; k < results_.size(); ++k)
                    if (modes_[h].of[k]) modes_[g].of[k] = modes_[h].of[k];
                modes_.erase(modes_.begin() + static_cast<std::ptrdiff_t>(h));
                renew(modes_[g]);
                return true;
            }
        return false;
    }

    void gather() {
        for (std::size_t k = 0; k < results_.size(); ++k) add_set_up(k);
        while (join_two()) {
        }
        std::sort(modes_.begin(), modes_.end(),
                  [](const merged_mode& a, const merged_mode& b) { return a.mean.frequency_hz < b.mean.frequency_hz; });
    }

    /// Over all places, largest entry 1; NaN where only set-ups without the mode have been.
    mode_shape whole_shape(const merged_mode& mode) const {
        mode_shape sum(names_.size());
        std::vector<double> count(names_.size());
        for (std::size_t k = 0; k < results_.size(); ++k) {
            if (!mode.of[k]) continue;
            const std::complex<double> factor = scale_to(at_references(*mode.of[k], results_[k]), mode.mean.shape);
            for (const auto& [at, own] : common_places(names_, results_[k].places))
                if (there(mode.of[k]->shape[own])) sum[at] += factor * mode.of[k]->shape[own], ++count[at];
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
        if (known.empty()) return NAN;
        const auto middle = known.begin() + static_cast<std::ptrdiff_t>(known.size() / 2);
        std::nth_element(known.begin(), middle, known.end());
        return *middle;
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
            for (const auto& [code, text] : one.warnings)
                to.warnings.emplace_back(code, fmt::format("set-up {}: {}", k + 1, text));
        }
    }

    record_result describe() {
        record_work work;
        describe_set_ups(work.context);
        work.set.n_y = names_.size();
        std::vector<listed_mode> listed;
        std::vector<mode_shape> shapes;
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
            shapes.push_back(whole_shape(mode));
            mode_shape states = shapes.back();
            for (auto& entry : states)
                if (!there(entry)) entry = 0;
            listed.push_back({frequency.value, damping.value, shape_collinearity(states, {}), median_emac(mode),
                              std::move(states), true});
            mode_verdict& verdict = work.context.verdicts.emplace_back();
            verdict.found_in = static_cast<double>(mode.count()) / static_cast<double>(results_.size());
            verdict.confident = 2 * mode.count() >= results_.size();
            if (!verdict.confident) verdict.why.emplace_back("few_runs");
        }
        sigma.shape_im = sigma.shape_re;
        sigma.replicates = blocks;
        if (std::any_of(sigma.frequency_hz.begin(), sigma.frequency_hz.end(), [](double one) { return one > 0; }))
            work.context.sigma = std::move(sigma);
        make_modal_model(listed, work.context.fs_hz, work);
        for (std::size_t k = 0; k < shapes.size(); ++k)
            for (std::size_t i = 0; i < names_.size(); ++i)
                if (!there(shapes[k][i]))
                    work.refined->shape_re[k * names_.size() + i] = work.refined->shape_im[k * names_.size() + i] = NAN;
        record_result out;
        out.model = kept_model(work.model);
        out.context = std::move(work.context);
        return out;
    }

    const std::vector<known_result>& results_;
    std::vector<std::string> names_, references_;
    std::vector<merged_mode> modes_;
};

} // namespace

record_result merge_results(const std::vector<known_result>& results, const std::vector<std::string>& references) {
    return merger(results, references).merge();
}

} // namespace okid_host
