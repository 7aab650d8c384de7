// SPDX-License-Identifier: MIT
// PURPOSE  set-ups of a hammer that stays while the sensors rove
// METHOD   reciprocity: what a sensor shows of a hit elsewhere, a sensor there would show of the same hit at its place. So each
//          output of each hit is a record of one sensor, where the hammer stays, struck at the place of the output, and all
//          together are those of a hammer that roves (record_auto.cpp, place_shapes.cpp)
#include "struck_set_ups.hpp"

#include "error.hpp"
#include "files/nearest_name.hpp"
#include "files/order_statistics.hpp"
#include "record/hit_files.hpp"
#include "record/hit_verdict.hpp"
#include "record/modal_model.hpp"
#include "record/roving.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <functional>
#include <set>
#include <utility>

namespace okid_host {
namespace {

constexpr double dead_energy = 1e-4; // of the median of all outputs: a hundredth of its motion
constexpr double answers = 4;        // times the mean square before the hit

/// Mean squares of an output, summed over its hits.
struct output_energy {
    double before = 0, after = 0;
    int hits = 0;
};

double mean_square(const double* from, std::size_t count, std::size_t stride) {
    double sum = 0, squares = 0, n = 0;
    for (std::size_t i = 0; i < count; ++i)
        if (const double x = from[i * stride]; !std::isnan(x)) sum += x, squares += x * x, ++n;
    return n > 0 ? std::max(0.0, squares / n - sum / n * (sum / n)) : 0;
}

class struck_merger {
  public:
    explicit struck_merger(const record_options& options)
        : options_(options), sensors_(options.placed.outputs), energy_(options.outputs.size()), said_(options.said) {
        all_.n_u = all_.n_y = 1;
        if (sensors_.empty()) sensors_.resize(options.outputs.size());
        if (!options.placed.inputs.empty()) force_ = options.placed.inputs.front();
        std::set<int> dofs;
        for (const mass_channel& sensor : sensors_)
            if (sensor.dof > 0) dofs.insert(sensor.dof);
        for (std::size_t o = 0; o < sensors_.size(); ++o)
            place_.push_back(dofs.size() == sensors_.size() ? sensors_[o].dof : static_cast<int>(o) + 1);
    }

    record_result run(std::vector<set_up> set_ups) {
        for (set_up& one : set_ups) add(one);
        const std::vector<bool> dead = dead_outputs();
        record_options own = options_of_all();
        record_set records;
        records.n_u = records.n_y = 1;
        for (std::size_t r = 0; r < output_.size(); ++r) {
            if (dead[output_[r]]) continue;
            records.add(all_.records[r].path, all_.rows(all_.records[r]), all_.records[r].count);
            own.hits.push_back(place_[output_[r]]);
        }
        if (hit_places(own.hits).size() < 2) refuse();
        for (const int place : hit_places(own.hits))
            own.placed.inputs.push_back({own.inputs.front(), place, false, OKID_SENSE_ACCELERATION, force_.si});
        own.said = said_;
        if (!are_blows(records))
            throw failure(exit_no_model,
                          "no model: the force of a hit that --keep-all takes never rests. Leave it out");
        return over_outputs(identify_records(std::move(records), own));
    }

  private:
    /// The good hits of a set-up, an output a record.
    void add(set_up& one) {
        std::vector<std::size_t> at;
        for (const std::string& name : one.outputs)
            at.push_back(static_cast<std::size_t>(std::find(options_.outputs.begin(), options_.outputs.end(), name) -
                                                  options_.outputs.begin()));
        record_options own = options_;
        own.outputs = one.outputs;
        own.placed = own.mass = {};
        own.said.clear();
        if (const std::vector<std::string>& units = options_.hit_units; !units.empty()) {
            own.hit_units = {units.front()};
            for (const std::size_t o : at) own.hit_units.push_back(units[1 + o]);
        }
        own.hits.assign(one.set.records.size(), force_.dof > 0 ? force_.dof : 1);
        const std::string path = one.set.records.front().path;
        set_ups_.push_back({file_name(path), one.outputs});
        cut_at_hits(one.set, own.hits);
        try {
            const std::vector<hit_line> hits = choose_hits(one.set, own);
            hits_.insert(hits_.end(), hits.begin(), hits.end());
        } catch (const failure& fault) {
            if (fault.code != exit_no_model) throw;
            said_.emplace_back("set_up_without_modes", fmt::format("{}: {}", path, fault.what()));
            return;
        }
        said_.insert(said_.end(), own.said.begin(), own.said.end());
        for (const record_data& record : one.set.records)
            for (std::size_t k = 0; k < at.size(); ++k) add(one.set, record, k, at[k]);
    }

    void add(const record_set& set, const record_data& record, std::size_t k, std::size_t o) {
        const double* row = set.rows(record);
        const std::size_t m = set.channels();
        std::vector<double> rows;
        for (std::size_t i = 0; i < record.count; ++i) {
            rows.push_back(row[i * m]);
            rows.push_back(row[i * m + 1 + k]);
        }
        all_.add(record.path, rows.data(), record.count);
        output_.push_back(o);
        samples_ += k == 0 ? static_cast<long long>(record.count) : 0;
        const hit_span span = find_hit(row, record.count, m);
        energy_[o].before += mean_square(row + 1 + k, span.begin, m);
        energy_[o].after += mean_square(row + span.end * m + 1 + k, record.count - span.end, m);
        ++energy_[o].hits;
    }

    /// Those that hardly move beside the others, and no more after a hit than before it.
    std::vector<bool> dead_outputs() {
        std::vector<double> about;
        for (const output_energy& one : energy_)
            if (one.hits > 0) about.push_back(one.after / one.hits);
        std::vector<bool> out(energy_.size());
        for (std::size_t o = 0; o < energy_.size(); ++o) {
            const output_energy& one = energy_[o];
            if (one.hits == 0 || one.after / one.hits >= dead_energy * upper_median(about) ||
                one.after >= answers * one.before)
                continue;
            out[o] = true;
            said_.emplace_back("screened",
                               fmt::format("output \"{}\" hardly moves beside the others and does not answer to the "
                                           "hits: not measured. Look at its sensor and cable",
                                           options_.outputs[o]));
        }
        return out;
    }

    [[noreturn]] void refuse() const {
        std::string why;
        for (const auto& [code, text] : said_)
            if (code == "set_up_without_modes" || code == "screened") why += (why.empty() ? "" : "; ") + text;
        throw failure(exit_no_model, fmt::format("no model: fewer than two outputs have a good hit. {}", why));
    }

    /// One sensor where the hammer is; a drive point where an output is, too.
    record_options options_of_all() const {
        record_options own = options_;
        mass_channel there;
        there.name = fmt::format("{} place", options_.inputs.front());
        for (std::size_t o = 0; force_.dof > 0 && o < sensors_.size(); ++o)
            if (sensors_[o].dof == force_.dof) {
                there = sensors_[o];
                there.name = options_.outputs[o];
                there.dof = place_[o];
                there.reversed = sensors_[o].reversed != force_.reversed;
            }
        own.outputs = {there.name};
        if (!own.sensing.empty()) own.sensing.resize(1), there.sensing = own.sensing.front();
        own.hit_units.clear();
        own.mass = own.placed = {};
        own.placed.outputs = {std::move(there)};
        own.placed.hold = options_.hold;
        return own;
    }

    /// The same with shapes over the outputs, as a result of set-ups has it: without forces.
    record_result over_outputs(record_result found) const {
        const okid_identified_t& model = found.model.view();
        const placed_shapes shapes = std::exchange(found.context.placed, std::nullopt).value();
        const auto count = static_cast<std::size_t>(model.mode_count);
        const std::size_t n = sensors_.size(), places = shapes.dofs.size();
        record_work work;
        work.set.n_y = n;
        work.context = std::move(found.context);
        deviations none, &sigma = work.context.sigma ? *work.context.sigma : none;
        sigma.shape_re.assign(n * count, NAN);
        sigma.shape_im.assign(n * count, NAN);
        std::vector<std::vector<std::complex<double>>> over(count, std::vector<std::complex<double>>(n, NAN));
        std::vector<listed_mode> listed;
        for (std::size_t k = 0; k < count; ++k) {
            for (std::size_t o = 0; o < n; ++o) {
                const auto at = std::lower_bound(shapes.dofs.begin(), shapes.dofs.end(), place_[o]);
                if (at == shapes.dofs.end() || *at != place_[o]) continue;
                const auto j = k * places + static_cast<std::size_t>(at - shapes.dofs.begin());
                over[k][o] = {shapes.re[j], shapes.im[j]};
                sigma.shape_re[k * n + o] = shapes.re_std[j];
                sigma.shape_im[k * n + o] = shapes.im_std[j];
            }
            listed.push_back(
                {model.frequency_hz[k], model.damping_ratio[k], model.mpc[k], model.emac[k], over[k], true});
        }
        make_modal_model(listed, options_.fs_hz, work);
        describe(work.context);
        if (options_.placed.wanted()) place(over, shapes, work.context);
        record_result out;
        out.model = kept_model(work.model);
        out.context = std::move(work.context);
        return out;
    }

    void describe(result_context& to) const {
        to.outputs = options_.outputs;
        to.inputs.clear();
        to.input_dofs.clear();
        to.output_dofs.clear();
        to.samples = samples_;
        to.records = static_cast<int>(set_ups_.size());
        to.set_ups = set_ups_;
        to.hits = hits_;
        to.x0.reset();
        to.simulation_percent.reset();
        to.prediction_percent.reset();
        to.modal_masses.clear();
    }

    /// The modal masses of `from` are those of the shapes over the outputs.
    void place(const std::vector<std::vector<std::complex<double>>>& over_outputs, const placed_shapes& from,
               result_context& to) const {
        std::vector<std::complex<double>> largest;
        const deviations* sigma = to.sigma ? &*to.sigma : nullptr;
        placed_shapes placed = over_dofs(sensors_, over_outputs, sigma, largest);
        const auto drive = std::find_if(sensors_.begin(), sensors_.end(),
                                        [&](const mass_channel& one) { return one.dof == force_.dof; });
        for (std::size_t k = 0; k < largest.size(); ++k) {
            const double unit = drive == sensors_.end() ? NAN : std::norm(drive->si / largest[k]);
            placed.modal_mass.push_back(unit * from.modal_mass[k]);
            placed.modal_mass_std.push_back(unit * from.modal_mass_std[k]);
        }
        to.placed = std::move(placed);
    }

    const record_options& options_;
    std::vector<mass_channel> sensors_;
    mass_channel force_;
    std::vector<int> place_; ///< of each output: its degree of freedom, or its number
    record_set all_;         ///< an output of a hit each
    std::vector<std::size_t> output_;
    std::vector<output_energy> energy_;
    std::vector<set_up_line> set_ups_;
    std::vector<hit_line> hits_;
    remarks said_;
    long long samples_ = 0;
};

} // namespace

bool are_struck(const std::vector<set_up>& set_ups, const record_options& options) {
    const std::vector<int>& kinds = options.sensing;
    return options.method == "auto" && options.inputs.size() == 1 && options.outputs.size() > 1 &&
           std::adjacent_find(kinds.begin(), kinds.end(), std::not_equal_to<>()) == kinds.end() &&
           std::all_of(set_ups.begin(), set_ups.end(), [](const set_up& one) { return are_hits(one.set); });
}

record_result identify_struck(std::vector<set_up> set_ups, const record_options& options) {
    return struck_merger(options).run(std::move(set_ups));
}

} // namespace okid_host
