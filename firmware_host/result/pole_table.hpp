// SPDX-License-Identifier: MIT
// The poles of all runs behind an agreement: what a stabilization diagram of method auto shows.
#pragma once
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

namespace okid_host {

struct pole_table {
    struct run {
        std::string method;
        double fs_hz;
        int rows; ///< samples it looks back on
    };
    struct pole {
        int run; ///< from 0
        int order;
        double frequency_hz, damping_ratio, mpc, emac;
        int mode; ///< number in the list of modes, from 1; 0: none of them
    };
    std::vector<run> runs;
    std::vector<pole> poles; ///< ascending in run, order and frequency
};

/// The key "agreement" of okid.result/1: runs, and the poles by columns.
nlohmann::ordered_json pole_table_json(const pole_table& table);

} // namespace okid_host
