// SPDX-License-Identifier: MIT
#include "stabilization.hpp"

#include "error.hpp"
#include "method.hpp"

#include <algorithm>
#include <fmt/format.h>
#include <memory>

namespace okid_host {
namespace {

using nlohmann::ordered_json;

/// p, or the block rows of a method without observer.
int horizon_of(const okid_identify_config_t& config) {
    const auto n_u = static_cast<std::size_t>(config.n_u);
    return looks_back_rows(config.method, n_u) ? rows_used(config.method, n_u, config.p, config.rows) : config.p;
}

/// Near the rank that the past can have at most noise looks consistent too: half of it is where the orders end.
int largest_order(const okid_identify_config_t& config) {
    return std::max(2, std::min(okid_identify_max_order(&config), horizon_of(config) * config.n_y / 2) / 2 * 2);
}

/// The configurations of the horizons, ascending; the given one is the last.
std::vector<okid_identify_config_t> horizons(const okid_identify_config_t& config) {
    const int whole = horizon_of(config);
    const bool by_rows = looks_back_rows(config.method, static_cast<std::size_t>(config.n_u));
    std::vector<okid_identify_config_t> out;
    for (const int horizon : {whole / 2, 3 * whole / 4, whole}) {
        if (horizon < 2 || (!out.empty() && horizon == horizon_of(out.back()))) continue;
        out.push_back(config);
        (by_rows ? out.back().rows : out.back().p) = horizon;
        out.back().order = 0;
        if (okid_identify_max_order(&out.back()) == 0) out.pop_back();
    }
    if (!out.empty()) out.back() = config;
    return out;
}

} // namespace

stabilization find_stabilization(okid_identify_t* identifier, const okid_identify_config_t& config,
                                 okid_identified_t& model, const identify_again& again) {
    const auto wanted = horizons(config);
    okid_stabilization_config_t shape{};
    shape.n_y = config.n_y;
    for (const auto& one : wanted) shape.max_models += largest_order(one) / 2;
    shape.max_poles = largest_order(config) / 2;
    shape.frequency = 0.01;
    shape.damping = 0.05;
    shape.mac = 0.98;
    shape.share = 0.5;
    const std::size_t bytes = okid_stabilization_memsize(&shape);
    const std::unique_ptr<std::byte[]> block(new std::byte[bytes]);
    okid_stabilization_t* collector = nullptr;
    if (bytes == 0 || okid_stabilization_create(&collector, &shape, block.get(), bytes) != OKID_OK)
        throw failure(exit_usage,
                      "--stabilization: more orders and horizons than the library takes, lower --p or --rows");
    stabilization found;
    found.criteria = shape;
    const auto add_orders = [&](okid_identify_t* from, okid_identified_t& one, int largest) {
        for (int order = 2; order <= largest; order += 2)
            if (okid_identify_poles(from, order, &one) >= 0 && okid_stabilization_add(collector, &one) == OKID_OK)
                found.models.emplace_back(one.p, order);
    };
    const int order = model.n_z;
    for (const auto& one : wanted)
        if (horizon_of(one) != horizon_of(config))
            again(one, [&](okid_identify_t* from, okid_identified_t& other) {
                add_orders(from, other, largest_order(one));
            });
    add_orders(identifier, model, largest_order(config));
    okid_stabilized_t view{};
    if (okid_stabilization_find(collector, &view) == OKID_OK) {
        found.poles.assign(view.poles, view.poles + view.pole_count);
        found.clusters.assign(view.clusters, view.clusters + view.cluster_count);
    }
    const okid_status_t status = okid_identify_order(identifier, order, &model);
    if (status < 0) throw failure(exit_no_model, fmt::format("no model: {}", okid_status_text(status)));
    return found;
}

nlohmann::ordered_json stabilization_json(const stabilization& found) {
    const okid_stabilization_config_t& c = found.criteria;
    ordered_json out;
    out["criteria"] = {{"frequency", c.frequency}, {"damping", c.damping}, {"mac", c.mac}, {"share", c.share}};
    out["models"] = found.models;
    out["poles"] = ordered_json::array();
    for (const okid_pole_t& pole : found.poles)
        out["poles"].push_back({{"horizon", pole.horizon},
                                {"order", pole.order},
                                {"frequency_hz", pole.frequency_hz},
                                {"damping_ratio", pole.damping_ratio},
                                {"stable_frequency", (pole.holds & OKID_HOLDS_FREQUENCY) != 0},
                                {"stable_damping", (pole.holds & OKID_HOLDS_DAMPING) != 0},
                                {"stable_shape", (pole.holds & OKID_HOLDS_SHAPE) != 0},
                                {"cluster", pole.cluster}});
    out["clusters"] = ordered_json::array();
    for (const okid_cluster_t& cluster : found.clusters) {
        const okid_pole_t& pole = found.poles[static_cast<std::size_t>(cluster.pole)];
        out["clusters"].push_back({{"frequency_hz", cluster.frequency_hz},
                                   {"damping_ratio", cluster.damping_ratio},
                                   {"frequency_spread_hz", cluster.frequency_spread_hz},
                                   {"damping_ratio_spread", cluster.damping_ratio_spread},
                                   {"mpc", cluster.mpc},
                                   {"hits", cluster.hits},
                                   {"models", found.models.size()},
                                   {"physical", cluster.physical != 0},
                                   {"horizon", pole.horizon},
                                   {"order", pole.order}});
    }
    return out;
}

std::string stabilization_text(const stabilization& found) {
    std::string out = fmt::format("\nstable modes over {} models (orders and horizons), each in {:.0f} % of them or "
                                  "more; spread over the models:\n      f [Hz]    spread     ζ [%]    spread     MPC   "
                                  "found in\n",
                                  found.models.size(), 100 * found.criteria.share);
    bool any = false;
    for (const okid_cluster_t& cluster : found.clusters) {
        if (!cluster.physical) continue;
        any = true;
        out += fmt::format("{:>12.5f} {:>9.2g} {:>9.4f} {:>9.2g} {:>7.4f} {:>8.0f} %\n", cluster.frequency_hz,
                           cluster.frequency_spread_hz, 100 * cluster.damping_ratio, 100 * cluster.damping_ratio_spread,
                           cluster.mpc, 100.0 * cluster.hits / static_cast<double>(found.models.size()));
    }
    return any ? out : out + "  none\n";
}

} // namespace okid_host
