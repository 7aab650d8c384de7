// SPDX-License-Identifier: MIT
// Poles over orders and horizons, and the modes that hold: okid identify --stabilization.
#pragma once
#include <okid/identify.h>
#include <okid/stabilization.h>

#include <functional>
#include <nlohmann/json.hpp>
#include <string>
#include <utility>
#include <vector>

namespace okid_host {

struct stabilization {
    okid_stabilization_config_t criteria{};
    std::vector<std::pair<int, int>> models; ///< horizon and order
    std::vector<okid_pole_t> poles;
    std::vector<okid_cluster_t> clusters;
};

/// Identify the same records with this configuration, and hand identifier and model on; nothing when that fails.
using identify_again = std::function<void(const okid_identify_config_t&,
                                          const std::function<void(okid_identify_t*, okid_identified_t&)>&)>;

/// All even orders the data carry, at the horizon of the model and at a half and three quarters of it. Afterwards `model`
/// is what it was.
stabilization find_stabilization(okid_identify_t* identifier, const okid_identify_config_t& config,
                                 okid_identified_t& model, const identify_again& again);

/// The key "stabilization" of okid.result/1.
nlohmann::ordered_json stabilization_json(const stabilization& found);

/// The modes found, as a table.
std::string stabilization_text(const stabilization& found);

} // namespace okid_host
