// SPDX-License-Identifier: MIT
// Modes that several methods, horizons, rates and orders agree on: the numerics behind `--method auto`.
#pragma once
#include "owned_sums.hpp"
#include "result/shape_mac.hpp"
#include "zoom.hpp"

#include <okid/identify.h>

#include <complex>
#include <memory>
#include <string>
#include <vector>

namespace okid_host {

/// One pole of one model.
struct run_pole {
    int order;
    double frequency_hz, damping_ratio, mpc, emac;
    std::vector<std::complex<double>> shape; ///< n_y
};

/// The same pole over the orders of one run: medians, and relative spreads over the orders.
struct run_track {
    double frequency_hz = 0, damping_ratio = 0, mpc = 0, emac = 0;
    double frequency_spread = 0, damping_spread = 0;
    int length = 0;                          ///< orders it was found at
    std::vector<std::complex<double>> shape; ///< of the order nearest the medians
    std::vector<int> orders;
};

/// One method with one horizon at one rate, over many orders from one decomposition.
struct consensus_run {
    okid_method_t method{};
    int level = 0;    ///< 0: the record's own rate, k: a 2^k-th of it
    double fs_hz = 0; ///< of this level
    int rows = 0;     ///< samples it looks back on
    int inputs = 0, outputs = 1;
    double top = 0;    ///< modes above this share of fs_hz are not seen
    double bottom = 0; ///< nor below this one
    int band = 0;      ///< of a zoom
    zoom_band zoom() const { return {fs_hz, band}; }
    double horizon_s() const { return rows / fs_hz; }
    std::vector<int> orders;
    int most_order = 64; ///< asked for; lowered where past and future share little
    int states = 0;      ///< that it has room for, of the highest order planned; 0: no limit
    bool full = false;   ///< of modes: too few states
    /// Of the first run of a rate, where no other one asks for more lags: what follows need not sum again.
    std::shared_ptr<const owned_sums> sums;
    std::vector<run_pole> poles;
    std::vector<run_track> tracks;
};

/// A cluster of tracks, at most one of each run.
struct consensus_mode {
    double frequency_hz = 0, damping_ratio = 0, mpc = 0, emac = 0;
    double damping_spread = 0;                            ///< relative, robust, over the runs
    double frequency_scatter_hz = 0, damping_scatter = 0; ///< of the subspace runs of its level about the values
    double frequency_apart_hz = 0, damping_apart = 0;     ///< their median distance from the values
    int hits = 0, could = 0;                              ///< runs that found it, of those that could have seen it
    double found_in = 0;                                  ///< hits / could
    double agreement = 0;                                 ///< 0..1: found_in, consistency, phase and scatter together
    int level = 0;                                        ///< the highest rate that sees it well
    double spacing_hz = 0;                                ///< to the nearest other vibration; infinite: none
    int parted = 0;                                       ///< runs that can tell it from that one
    double resolved_hz = 0;                               ///< three runs cannot separate it from a closer mode
    std::vector<std::complex<double>> shape;
    std::vector<std::pair<int, int>> members; ///< run, track
    std::vector<std::string> why;             ///< codes of why it is doubtful; empty: confident
    bool picked = false;                      ///< by hand
    bool confident() const { return why.empty(); }
};

/// Orders of a run with room for `most` states: every second one up to 24, every fourth up to 64, then every eighth.
std::vector<int> consensus_orders(int most);

/// The poles of all orders of the identifier's last run().
void collect_poles(okid_identify_t* identifier, okid_identified_t& model, consensus_run& run);

/// Link the poles of a run over its orders.
void link_tracks(consensus_run& run);

/// Is the frequency inside the band of this run?
bool in_band(const consensus_run& run, double frequency_hz);

/// Can this run see a mode at f Hz: in its band, and with at least three quarters of a period in its horizon (of more than
/// three outputs together: less)?
bool can_see(const consensus_run& run, double frequency_hz);

/// Clusters over the runs (tracks linked), ascending in frequency, with votes, values and first codes in `why`. Marks the runs
/// that are full of modes.
/// @param turned  in: outputs known to stand a quarter of a turn off the others (quantity.hpp), empty: not known;
///                out: those that do. nullptr: shapes are taken as they are
std::vector<consensus_mode> find_agreement(std::vector<consensus_run>& runs, std::vector<bool>* turned = nullptr);

/// The rule that makes a mode confident, of records, set-ups and responses alike: half of the runs that could see it, three at
/// least, and an agreement of one half. Sets .agreement and the codes few_runs and noise_shape.
void judge_agreement(consensus_mode& mode);

} // namespace okid_host
