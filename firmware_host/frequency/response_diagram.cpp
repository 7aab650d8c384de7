// SPDX-License-Identifier: MIT
// PURPOSE  the stabilization diagram of frequency responses
// METHOD   the poles over the whole band with the middle weight and the normalisation that keeps noise unstable, of every set-up:
//          its number in the place of a horizon
#include "response_diagram.hpp"

#include "record/record_work.hpp"

#include <algorithm>
#include <complex>
#include <cstddef>
#include <memory>
#include <okid/stabilization.h>

namespace okid_host {
namespace {

constexpr std::size_t middle_of_whole_band = 2; // among the runs of fit_matrix_fractions()

/// The poles of one order as the collector takes them.
void add_model(const consensus_run& run, int order, int set_up, okid_stabilization_t* to, stabilization& out) {
    refined_arrays poles;
    for (const run_pole& pole : run.poles) {
        if (pole.order != order) continue;
        poles.frequency.push_back(pole.frequency_hz);
        poles.damping.push_back(pole.damping_ratio);
        poles.mpc.push_back(pole.mpc);
        poles.emac.push_back(pole.emac);
        for (const std::complex<double>& entry : pole.shape)
            poles.shape_re.push_back(entry.real()), poles.shape_im.push_back(entry.imag());
    }
    okid_identified_t model{};
    model.n_y = out.criteria.n_y;
    model.n_z = order;
    model.p = set_up;
    model.mode_count = static_cast<std::int32_t>(poles.frequency.size());
    poles.show_modes(model);
    if (okid_stabilization_add(to, &model) == OKID_OK) out.models.emplace_back(set_up, order);
}

} // namespace

stabilization diagram_of(const joint_responses& from, const std::vector<consensus_run>& runs) {
    const std::size_t of_each = runs.size() / from.sets.size();
    stabilization out;
    out.criteria = okid_stabilization_defaults(static_cast<std::int32_t>(from.references.size()), 0, 1);
    out.criteria.frequency = 0.01, out.criteria.damping = 0.05, out.criteria.mac = 0.98, out.criteria.share = 0.5;
    std::vector<const consensus_run*> shown;
    for (std::size_t j = 0; j < from.sets.size(); ++j) {
        shown.push_back(&runs[j * of_each + middle_of_whole_band]);
        out.criteria.max_models += static_cast<std::int32_t>(shown.back()->orders.size());
        out.criteria.max_poles =
            std::max(out.criteria.max_poles, static_cast<std::int32_t>(shown.back()->poles.size()));
    }
    const std::size_t bytes = okid_stabilization_memsize(&out.criteria);
    const std::unique_ptr<std::byte[]> block(new std::byte[bytes]);
    okid_stabilization_t* collector = nullptr;
    if (bytes == 0 || okid_stabilization_create(&collector, &out.criteria, block.get(), bytes) != OKID_OK) return out;
    for (std::size_t j = 0; j < shown.size(); ++j)
        for (const int order : shown[j]->orders) add_model(*shown[j], order, static_cast<int>(j) + 1, collector, out);
    okid_stabilized_t view{};
    if (okid_stabilization_find(collector, &view) == OKID_OK) {
        out.poles.assign(view.poles, view.poles + view.pole_count);
        out.clusters.assign(view.clusters, view.clusters + view.cluster_count);
    }
    return out;
}

} // namespace okid_host
