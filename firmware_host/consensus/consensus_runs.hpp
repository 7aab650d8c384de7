// SPDX-License-Identifier: MIT
// The runs behind `--method auto`: which methods, horizons and rates look at a record, and what each of them finds.
#pragma once
#include "consensus.hpp"
#include "levels.hpp"
#include "owned_sums.hpp"

#include <okid/accumulator.h>

#include <cstddef>

namespace okid_host {

/// The runs that a level bears, without poles. @param crowded  with room for twice as many modes
std::vector<consensus_run> plan_runs(int n_u, int n_y, int number, const record_level& level, bool crowded);

/// What the library is asked for by a run.
okid_identify_config_t run_config(const consensus_run& run, int n_u, int n_y);

/// What carries the modes of a level with all samples that its longest horizon asks for; without order.
okid_identify_config_t longest_run(int n_u, int n_y, double fs_hz, bool crowded);

/// The most lags that any run of so many channels asks for, however many samples there are.
int longest_lags(int n_u, int n_y);

/// Sums of a level for runs with so many lags; none without memory.
owned_sums level_sums(const record_level& level, int n_u, int n_y, int lags, bool at_rest);

/// Those for a run of the level, which may have kept its own; none without memory.
std::shared_ptr<const owned_sums> sums_of(const consensus_run& run, const record_level& level, int n_u, int n_y,
                                          bool at_rest);

/// All runs of the levels from `first` on with their poles linked. Runs that find no model are left out.
/// @param threads  at a time, 0: all processors; the result is the same for any number
std::vector<consensus_run> look_at(const std::vector<record_level>& levels, std::size_t first, int n_u, int n_y,
                                   bool at_rest, int threads);

/// Levels of which a run is full of modes have longer horizons and higher orders, in place of their runs.
/// @return false: none is
bool look_closer(const std::vector<record_level>& levels, int n_u, int n_y, bool at_rest, int threads,
                 std::vector<consensus_run>& runs);

/// Streams of bands in which modes stand closer to each other than the runs can tell apart.
std::vector<record_level> zoomed_levels(const std::vector<record_level>& levels,
                                        const std::vector<consensus_mode>& modes, int n_u, int n_y, bool at_rest);

} // namespace okid_host
