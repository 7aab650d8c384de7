// SPDX-License-Identifier: MIT
// PURPOSE  measured records in, one identified model out: detrending, exact merging, initial states, fit
#pragma once
#include "record_set.hpp"
#include "result/kept_model.hpp"
#include "result/result.hpp"

#include <complex>
#include <cstddef>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace okid_host {

/// Where a mode was picked by hand.
struct picked_pole {
    double frequency_hz = 0;
    double damping_ratio = NAN; ///< NaN: not said
};

struct record_options {
    std::vector<std::string> inputs, outputs;
    double fs_hz = 0;
    int p = 40, rows = 0, order = 0; ///< rows 0 = 2 p, n4sid 30, okid without inputs p; order 0 = automatic
    int max_order = 0;               ///< bound of the automatic order; 0 = the library's own
    bool p_given = false;
    std::string method = "okid-era", hankel = "system", hold = "zoh", detrend = "mean";
    std::string start =
        "moving"; ///< "rest": each record begins before the structure was struck, its silent past is used
    std::string refine =
        "no";       ///< maximum likelihood after the identification: yes, no, or (method auto) where it applies
    mass_plan mass; ///< where the channels stand, when M, K and R are wanted
    remarks said;   ///< known before the data are seen
    bool stabilization = false;                    ///< look at all orders and some horizons too
    int sigma_blocks = 20;                         ///< blocks left out in turn for the standard deviations; 0 = none
    bool analytic = true;                          ///< by the method's derivative, where it has one
    std::optional<std::pair<double, double>> band; ///< Hz, of the modes wanted (auto)
    int decimate = 1;                              ///< auto uses no rate above the record's divided by this
    int threads = 0;                               ///< of auto, at a time; 0: all processors
    bool all_modes = false;                        ///< auto lists also what few runs found
    bool modes_without_matrices = false;           ///< auto: what stands in the way of M, K, R is a remark
    std::vector<int> modes;                        ///< numbers of the modes picked by hand (auto); empty: all
    std::vector<picked_pole> picks;                ///< where modes were picked by hand (auto); empty: all
    bool by_hand() const { return !modes.empty() || !picks.empty(); }
    std::vector<int> sensing;                       ///< okid_sensing_t of each output; empty: all are accelerations
    bool judge_hits = false, keep_all_hits = false; ///< are bad hits sought; are they used nevertheless
    std::vector<std::string> hit_units;             ///< of the channels, the force first; empty: not known
    mass_plan placed;      ///< of hits: the places struck and those of the sensors, when these are given
    std::vector<int> hits; ///< where each record was struck, from 1 (-3: at 3, reversed); empty: not given
    std::function<void(const char* stage)> stage; ///< called with what begins; may be empty
};

/// Of auto: the model that carries a mode at its rate. Made again when the record has grown, it shows where the mode
/// is.
struct mode_carrier {
    int level = -1;                  ///< of record_level; -1: none, or a zoomed band
    okid_identify_config_t config{}; ///< with its order
    double frequency_hz = 0, damping_ratio = 0;
    std::vector<std::complex<double>> shape;          ///< of channels in units of `scale`
    double frequency_std_hz = NAN, damping_std = NAN; ///< of what the carrier says; NAN: not known
};

class older_samples;

/// A model with what is known about it, and the decomposition it was realised from.
struct record_result {
    kept_model model;
    result_context context;
    okid_identify_config_t config{};
    std::unique_ptr<std::byte[]> memory;   ///< of `identifier`
    okid_identify_t* identifier = nullptr; ///< for the poles of other orders; `model` does not look into it
    okid_identified_t realised{};          ///< what it gave, in its own memory
    std::vector<mode_carrier> carriers;    ///< of auto, of each mode
    std::vector<double> scale;             ///< of auto, of each channel: its spread

    /// Fits that were not asked for yet.
    struct fits_to_come {
        record_set set;             ///< the records less their means
        std::vector<double> states; ///< initial ones, a record after the other
        std::size_t place;          ///< of their remarks among the warnings
    };
    std::unique_ptr<fits_to_come> to_come;
};

/// Identify from all records together. Throws `failure`: exit 3 when no reliable model is possible.
/// Fits of an n4sid model that surely explains its record may be left for finish_fits().
/// @param before  of auto: what is known of samples before these
record_result identify_records(record_set records, const record_options& options,
                               const older_samples* before = nullptr);

/// The fits and what is to be said of them, if they were left for later.
void finish_fits(record_result& result);

} // namespace okid_host
