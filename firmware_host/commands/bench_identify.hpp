// SPDX-License-Identifier: MIT
// Whole identifications for okid bench: from samples in memory to A, B, C, D, K and modes.
#pragma once
#include "bench_record.hpp"

#include <cmath>
#include <functional>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

namespace okid_host {

struct bench_size {
    int structure, samples;
    int block_rows; ///< i of the n4sid methods, p of okid
    int era_rows;   ///< of okid
};

/// Time of this thread, s.
double bench_seconds();

/// One way of identifying one record: all memory is taken at construction, run() only works.
class bench_contender {
  public:
    virtual ~bench_contender() = default;
    /// false: no model
    virtual bool run() = 0;

    std::string kernel, sample = "double";
    std::vector<double> seconds, update; ///< of each run; of them what an update of a live model takes
    mode_error error{NAN, NAN};
};

using bench_contenders = std::vector<std::unique_ptr<bench_contender>>;
/// Adds other contenders for a record (tests/bench/bench_slicot.cpp).
using bench_entrants = std::function<void(const bench_record&, const bench_size&, bench_contenders&)>;

/// Rows "identify" of okid.bench/1: one size, noise level and method each.
void bench_identifications(nlohmann::ordered_json& rows, const bench_entrants& others = {});

/// The rows "identify" as tables: time beside accuracy.
void print_identifications(const nlohmann::ordered_json& rows);

} // namespace okid_host
