// SPDX-License-Identifier: MIT
// PURPOSE  M, K and R of method auto
// METHOD   from the modal model of the confident modes, and the same without a block of the records for standard deviations
#include "record_matrices.hpp"

#include "error.hpp"
#include "record_hold.hpp"
#include "result/hold.hpp"

#include <algorithm>
#include <cmath>

namespace okid_host {
namespace {

/// Numbers of M, K, R's modes count the confident ones: here they count those listed.
void renumber(const std::vector<mode_verdict>& verdicts, mass_matrices& mass) {
    std::vector<int> place;
    for (std::size_t i = 0; i < verdicts.size(); ++i)
        if (verdicts[i].confident) place.push_back(static_cast<int>(i) + 1);
    for (mass_mode& mode : mass.modes)
        if (mode.number >= 1 && static_cast<std::size_t>(mode.number) <= place.size())
            mode.number = place[static_cast<std::size_t>(mode.number) - 1];
}

/// The listed modes without a block, in the model those that are confident.
std::vector<listed_mode> without_block(std::vector<listed_mode> listed, const record_work& work, std::size_t block) {
    std::vector<listed_mode> out;
    for (std::size_t k = 0; k < listed.size(); ++k) {
        listed_mode& mode = listed[k];
        if (!mode.in_model) continue;
        if (block < work.shifts[k].size()) {
            const mode_shift& shift = work.shifts[k][block];
            mode.frequency_hz += shift.frequency_hz;
            mode.damping_ratio += shift.damping_ratio;
            for (std::size_t i = 0; i < mode.shape.size(); ++i) mode.shape[i] += shift.shape[i];
        }
        out.push_back(std::move(mode));
    }
    return out;
}

} // namespace

void find_matrices_agreed(const record_options& options, record_work& work) {
    remarks& said = work.context.warnings;
    said.insert(said.end(), options.said.begin(), options.said.end());
    mass_plan plan = options.mass;
    if (plan.outputs.empty()) plan.outputs.resize(work.set.n_y);
    if (work.set.n_u > 0 && options.hold == "auto")
        work.context.hold = hold_of_data(work.force_is_older ? record_set() : work.set, work.model, plan);
    if (options.hold == "auto" && work.set.n_u == 0) work.context.hold = "zoh";
    plan.hold = work.context.hold;
    if (!options.mass.wanted()) return;
    work.context.modal_masses = modal_masses_of(work.model, plan);
    try {
        work.context.mass = find_mass_matrices(work.model, plan, said);
    } catch (const failure& why) {
        if (!options.modes_without_matrices) throw;
        said.emplace_back("mkr_failed", why.what());
        return;
    }
    renumber(work.context.verdicts, *work.context.mass);
}

void find_matrix_deviations(const std::vector<listed_mode>& listed, const record_options& options, record_work& work) {
    std::size_t blocks = 0;
    for (const auto& shifts : work.shifts) blocks = std::max(blocks, shifts.size());
    if (!options.mass.wanted() || blocks < std::size_t{fewest_blocks} || work.force_is_older) return;
    mass_plan plan = options.mass;
    plan.hold = work.context.hold;
    modal_mass_statistics masses(plan, work.model.dt);
    masses.begin(work.model);
    const bool band = plan.hold == "band";
    if (band) plan.hold = "zoh";
    std::vector<int> sensing;
    for (const mass_channel& channel : plan.outputs) sensing.push_back(channel.sensing);
    const auto as_taken = [&](const okid_identified_t& model, held_model& held) {
        return model_view(band && as_if_held(model, sensing, held) ? held.view : model);
    };
    replicate_statistics statistics(work.model.n_u, work.model.n_y, work.model.n_z, plan, work.model.dt);
    held_model held;
    statistics.begin(as_taken(work.model, held));
    record_work part;
    for (std::size_t b = 0; b < blocks; ++b) {
        part.set = work.set;
        const std::size_t count = part.set.count(), m = part.set.channels();
        for (std::size_t n = b * count / blocks; n < (b + 1) * count / blocks; ++n)
            std::fill_n(part.set.samples.begin() + static_cast<std::ptrdiff_t>(n * m + part.set.n_u), part.set.n_y,
                        NAN);
        part.set.complete = false;
        make_modal_model(without_block(listed, work, b), options.fs_hz, part);
        held_model other;
        const okid_model_t view = as_taken(part.model, other);
        statistics.add(&view, 1.0 / static_cast<double>(blocks));
        masses.add(model_view(part.model), 1.0 / static_cast<double>(blocks));
    }
    work.context.modal_masses = masses.finish();
    if (work.context.mass) add_deviations(statistics.finish(), *work.context.mass, work.context.warnings);
}

} // namespace okid_host
