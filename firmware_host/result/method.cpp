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

long long fewest_of_auto(std::size_t n_u, std::size_t n_y) { return 100LL * static_cast<long long>(n_y + 2 * n_u); }

bool is_subspace(okid_method_t method) { return method >= OKID_METHOD_N4SID_MOESP; }

bool looks_back_rows(okid_method_t method, std::size_t n_u) { return is_subspace(method) || n_u == 0; }

int rows_used(okid_method_t method, std::size_t n_u, int p, int rows) {
    if (rows > 0) return rows;
    return is_subspace(method) ? 30 : n_u == 0 ? p : 2 * p;
}

const std::vector<std::string>& hankel_names() {
    static const std::vector<std::string> names = {"system", "innovations", "literal"};
    return names;
}

okid_hankel_t hankel_of(const std::string& name) {
    const auto& names = hankel_names();
    return static_cast<okid_hankel_t>(std::find(names.begin(), names.end(), name) - names.begin());
}

std::string hankel_fault(const std::string& hankel, const std::string& method, std::size_t n_u) {
    if (hankel == "system") return "";
    if (is_subspace(method_of(method)))
        return fmt::format("\"{}\" is for okid-era and okid-era-dc, {} has no Markov parameters in its matrix", hankel,
                           method);
    if (n_u == 0)
        return fmt::format("\"{}\" needs a force: without one there are no Markov parameters, the matrix holds "
                           "covariances of the responses",
                           hankel);
    return "";
}

std::string horizon_option(const okid_identify_config_t& config) {
    const auto n_u = static_cast<std::size_t>(config.n_u);
    return looks_back_rows(config.method, n_u)
               ? fmt::format("--rows {}", rows_used(config.method, n_u, config.p, config.rows))
               : fmt::format("--p {}", config.p);
}

long long unknowns_of(okid_method_t method, int n_u, int n_y, int horizon) {
    const long long m = n_u + n_y, h = horizon;
    return is_subspace(method) ? h * (m + n_u) : n_u + h * m;
}

} // namespace okid_host
