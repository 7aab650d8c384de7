// SPDX-License-Identifier: MIT
#include "method.hpp"

#include <algorithm>
#include <fmt/format.h>

namespace okid_host {

const std::vector<std::string>& method_names() {
    static const std::vector<std::string> names = {"okid-era", "okid-era-dc", "n4sid-moesp", "n4sid-cva",
                                                   "n4sid-ssarx"};
    return names;
}

okid_method_t method_of(const std::string& name) {
    const auto& names = method_names();
    return static_cast<okid_method_t>(std::find(names.begin(), names.end(), name) - names.begin());
}

bool is_subspace(okid_method_t method) { return method >= OKID_METHOD_N4SID_MOESP; }

std::string horizon_option(const okid_identify_config_t& config) {
    return is_subspace(config.method) ? fmt::format("--rows {}", (okid_identify_lags(&config) + 1) / 2)
                                      : fmt::format("--p {}", config.p);
}

long long unknowns_of(okid_method_t method, int n_u, int n_y, int horizon) {
    const long long m = n_u + n_y, h = horizon;
    return is_subspace(method) ? h * (m + n_u) : n_u + h * m;
}

} // namespace okid_host
