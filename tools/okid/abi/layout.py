# SPDX-License-Identifier: MIT
"""The C ABI of libokid as ctypes: structures and constants exactly as in lib/include/okid/*.h; functions: _signatures.

tests/abi/test_struct_layout.py compiles the headers and compares every size, offset, constant and argument.
"""

from __future__ import annotations

from ctypes import POINTER, Structure, c_double, c_float, c_int, c_int16, c_int32, c_int64, c_uint32
from typing import Any, ClassVar

OK, WARN_MISSING, WARN_SATURATED, WARN_MODEL = 0, 1, 2, 3
ERR_NULL, ERR_DIM, ERR_MEMORY, ERR_MISMATCH, ERR_RANGE = -1, -2, -3, -4, -5
ERR_TOO_SHORT, ERR_INPUT, ERR_OUTPUT, ERR_EXCITATION = -6, -7, -8, -9
ERR_NUMERIC, ERR_UNSTABLE, ERR_NO_MODES, ERR_FORMAT = -10, -11, -12, -13
SAMPLE_DOUBLE, SAMPLE_INT16, SAMPLE_INT24, SAMPLE_INT32 = 0, 1, 2, 3
DETREND_NONE, DETREND_MEAN = 0, 1
METHOD_OKID_ERA, METHOD_OKID_ERA_DC = 0, 1
METHOD_N4SID_MOESP, METHOD_N4SID_CVA, METHOD_N4SID_SSARX = 2, 3, 4
SOLVER_DENSE, SOLVER_STRUCTURED = 0, 1
HANKEL_SYSTEM, HANKEL_INNOVATIONS, HANKEL_LITERAL = 0, 1, 2
SUBSPACE_MOESP, SUBSPACE_CVA, SUBSPACE_SSARX = 0, 1, 2
NOTE_ARX_STABILISED = 1 << 0
NOTE_ILL_CONDITIONED = 1 << 1
NOTE_FEW_ROWS = 1 << 2
NOTE_MODEL_UNSTABLE = 1 << 3
NOTE_PREDICTOR_UNSTABLE = 1 << 4
NOTE_ORDER_REDUCED = 1 << 5
NOTE_ORDER_UNCLEAR = 1 << 6
NOTE_WEAK_EXCITATION = 1 << 7
NOTE_LITERAL_HANKEL = 1 << 8
SENSE_DISPLACEMENT, SENSE_VELOCITY, SENSE_ACCELERATION = 0, 1, 2
HOLD_ZERO, HOLD_FIRST = 0, 1
HOLDS_FREQUENCY, HOLDS_DAMPING, HOLDS_SHAPE = 1 << 0, 1 << 1, 1 << 2
MKR_POLARITY = 1 << 0
MKR_MASS = 1 << 1
MKR_STIFFNESS = 1 << 2
MKR_DAMPING = 1 << 3
MKR_RESIDUAL = 1 << 4
MKR_FEEDTHROUGH = 1 << 5
MKR_COMPLEX = 1 << 6
MKR_SPREAD = 1 << 7
MKR_CLOSE = 1 << 8

ABI = 2

doubles = POINTER(c_double)
int32s = POINTER(c_int32)
int16s = POINTER(c_int16)
floats = POINTER(c_float)


class AccumulatorConfig(Structure):
    """okid_accumulator_config_t."""

    _fields_ = [
        ("n_u", c_int32),
        ("n_y", c_int32),
        ("lags", c_int32),
        ("sample", c_int),
        ("block", c_int32),
        ("slots", c_int32),
        ("forgetting", c_double),
        ("edges", c_int32),
        ("spare_slots", c_int32),
        ("bulk", c_int32),
        ("saturated_missing", c_int32),
        ("buffer", c_int32),
    ]


class AccumulatorStats(Structure):
    """okid_accumulator_stats_t."""

    _fields_ = [(name, c_int64) for name in ("samples", "missing", "gaps", "saturated", "rows", "dropped")]


class EraConfig(Structure):
    """okid_era_config_t."""

    _fields_ = [(name, c_int32) for name in ("n_u", "n_y", "rows", "cols", "xi", "zeta", "tau")]


class IdentifyConfig(Structure):
    """okid_identify_config_t."""

    _fields_ = [
        ("n_u", c_int32),
        ("n_y", c_int32),
        ("p", c_int32),
        ("rows", c_int32),
        ("order", c_int32),
        ("max_order", c_int32),
        ("fs_hz", c_double),
        ("method", c_int),
        ("detrend", c_int),
        ("solver", c_int),
        ("hankel", c_int),
    ]


class ModelView(Structure):
    """okid_model_t."""

    _fields_ = [(name, c_int32) for name in ("n_u", "n_y", "n_z")] + [(name, doubles) for name in "ABCDK"]


class Modes(Structure):
    """okid_modes_t."""

    _fields_ = [
        ("count", c_int32),
        ("radius", c_double),
        ("frequency_hz", doubles),
        ("damping_ratio", doubles),
        ("mpc", doubles),
        ("shape_re", doubles),
        ("shape_im", doubles),
        ("mu_re", doubles),
        ("mu_im", doubles),
        ("psi_re", doubles),
        ("psi_im", doubles),
    ]


class Records(Structure):
    """okid_records_t."""

    _fields_ = [("count", c_int32), ("counts", int32s), ("samples", doubles)]


class RunSums(Structure):
    """okid_run_sums_t."""

    _fields_ = [(name, doubles) for name in ("S", "head", "tail", "sum", "mean")] + [("rows", c_int64)]


class Mechanics(Structure):
    """okid_mechanics_t."""

    _fields_ = [(name, c_int32) for name in ("n_x", "n_u", "n_y")] + [
        (name, doubles) for name in ("M", "R", "K", "B_a", "C_p", "C_v", "C_a")
    ]


class MkrConfig(Structure):
    """okid_mkr_config_t."""

    _fields_ = [
        ("n_x", c_int32),
        ("hold", c_int32),
        ("dt", c_double),
        ("input_dof", int32s),
        ("input_gain", doubles),
        ("output_dof", int32s),
        ("output_gain", doubles),
        ("output_sensing", int32s),
    ]


class Mkr(Structure):
    """okid_mkr_t."""

    _fields_: ClassVar[Any] = [
        ("notes", c_uint32),
        *((name, c_int32) for name in ("n_x", "admissible", "pairs", "dof", "feedthrough_row")),
        *((name, doubles) for name in ("M", "K", "R", "R_normal")),
        *((name, doubles) for name in ("frequency_hz", "damping_ratio", "lambda_re", "lambda_im", "W_re", "W_im")),
        ("mode", int32s),
        *((name, doubles) for name in ("strength", "mpc", "phase", "pair_spread")),
        *((name, c_double) for name in ("margin", "residual", "feedthrough", "gain", "condition")),
    ]


class Pdc(Structure):
    """okid_pdc_t."""

    _fields_ = [(name, c_double) for name in ("alpha", "beta", "residual", "condition")]


class ObserverConfig(Structure):
    """okid_observer_config_t."""

    _fields_ = [("n_u", c_int32), ("n_y", c_int32), ("p", c_int32), ("ridge_min", c_double), ("unstable", c_int32)]


class ObserverInfo(Structure):
    """okid_observer_info_t."""

    _fields_ = [(name, c_double) for name in ("ridge", "radius", "radius_plain", "condition", "input_excitation")] + [
        ("channel", c_int32)
    ]


class SquareRootConfig(Structure):
    """okid_square_root_config_t."""

    _fields_ = [
        *((name, c_int32) for name in ("n_u", "n_y", "lags", "batch", "block", "slots", "spare_slots")),
        ("forgetting", c_double),
    ]


class SubspaceConfig(Structure):
    """okid_subspace_config_t."""

    _fields_ = [
        *((name, c_int32) for name in ("n_u", "n_y", "rows", "method", "max_order", "factor")),
        ("ridge", c_double),
    ]


class SubspaceInfo(Structure):
    """okid_subspace_info_t."""

    _fields_ = [("ridge", c_double), ("input_excitation", c_double), ("channel", c_int32)]


class CorrelationConfig(Structure):
    """okid_correlation_config_t."""

    _fields_ = [
        *((name, c_int32) for name in ("n_u", "n_y", "lags", "own_lags")),
        ("sample", c_int),
        *((name, c_int32) for name in ("block", "slots", "saturated_missing", "buffer")),
        ("forgetting", c_double),
    ]


class CorrelationSums(Structure):
    """okid_correlation_sums_t."""

    _fields_: ClassVar[Any] = [
        *((name, c_int32) for name in ("n_u", "n_y", "lags", "own_lags", "runs", "centred")),
        ("rows", c_double),
        *((name, doubles) for name in ("U", "Y", "T", "sum", "lag_sum", "ends", "weight")),
    ]


class RefineConfig(Structure):
    """okid_refine_config_t."""

    _fields_ = [(name, c_int32) for name in ("n_u", "n_y", "n_z", "runs", "blocks", "iterations", "offset")]


class Refined(Structure):
    """okid_refined_t."""

    _fields_: ClassVar[Any] = [
        ("iterations", c_int32),
        ("converged", c_int32),
        ("samples", c_int64),
        *((name, c_double) for name in ("gain", "decrement", "whiteness")),
        *((name, doubles) for name in ("A", "B", "C", "D", "x0", "noise_std")),
    ]


class StabilizationConfig(Structure):
    """okid_stabilization_config_t."""

    _fields_ = [(name, c_int32) for name in ("n_y", "max_models", "max_poles")] + [
        (name, c_double) for name in ("frequency", "damping", "mac", "share")
    ]


class Pole(Structure):
    """okid_pole_t."""

    _fields_ = [(name, c_double) for name in ("frequency_hz", "damping_ratio", "mpc", "emac")] + [
        (name, c_int32) for name in ("horizon", "order", "holds", "cluster")
    ]


class Cluster(Structure):
    """okid_cluster_t."""

    _fields_ = [
        *((name, c_double) for name in ("frequency_hz", "damping_ratio", "frequency_spread_hz")),
        *((name, c_double) for name in ("damping_ratio_spread", "mpc")),
        *((name, c_int32) for name in ("hits", "pole", "physical")),
    ]


class Stabilized(Structure):
    """okid_stabilized_t."""

    _fields_: ClassVar[Any] = [
        *((name, c_int32) for name in ("model_count", "pole_count", "cluster_count")),
        ("poles", POINTER(Pole)),
        ("clusters", POINTER(Cluster)),
    ]


class TrackConfig(Structure):
    """okid_track_config_t."""

    _fields_ = [
        *((name, c_int32) for name in ("n_y", "max_modes", "max_tracks", "born", "dies")),
        *((name, c_double) for name in ("frequency", "jump", "mac", "close_hz")),
    ]


class Track(Structure):
    """okid_track_t."""

    _fields_ = [
        *((name, c_int32) for name in ("number", "hits", "misses")),
        *((name, c_double) for name in ("frequency_hz", "damping_ratio")),
    ]


class WatchConfig(Structure):
    """okid_watch_config_t."""

    _fields_ = [
        *((name, c_int32) for name in ("n_u", "n_y", "max_order", "lead", "block", "learn", "confirm")),
        ("ratio", c_double),
    ]


class WatchState(Structure):
    """okid_watch_state_t."""

    _fields_ = [*((name, c_int32) for name in ("watching", "learning", "high")), ("ratio", c_double)]


class ChangeConfig(Structure):
    """okid_change_config_t."""

    _fields_ = [
        *((name, c_int32) for name in ("n_u", "n_y", "rows", "order", "blocks")),
        *((name, c_double) for name in ("false_alarm", "fs_hz")),
    ]


class ChangeMode(Structure):
    """okid_change_mode_t."""

    _fields_ = [(name, c_double) for name in ("frequency_hz", "damping_ratio", "shift", "sigma")]


class ChangeVerdict(Structure):
    """okid_change_verdict_t."""

    _fields_ = [
        *((name, c_double) for name in ("statistic", "p_value", "freedom")),
        *((name, c_int32) for name in ("modes", "farthest", "blocks", "alarm")),
    ]


class SkewConfig(Structure):
    """okid_skew_config_t."""

    _fields_ = [*((name, c_int32) for name in ("n_u", "n_y", "n_z", "replicates")), ("mkr", POINTER(MkrConfig))]


class SkewResult(Structure):
    """okid_skew_result_t."""

    _fields_: ClassVar[Any] = [
        *((name, c_int32) for name in ("n_y", "undetermined", "corrected")),
        *((name, doubles) for name in ("delay", "std")),
        *((name, int32s) for name in ("late", "too_large")),
        ("scatter", c_double),
    ]


class Identified(Structure):
    """okid_identified_t."""

    _fields_: ClassVar[Any] = [
        ("warnings", c_uint32),
        *((name, c_int32) for name in ("n_u", "n_y", "n_z", "p", "rows")),
        *((name, c_int32) for name in ("singular_count", "markov_count", "mode_count")),
        ("regression_rows", c_int64),
        ("dt", c_double),
        *((name, doubles) for name in "ABCDK"),
        *((name, doubles) for name in ("singular_values", "markov", "observer", "innovation", "mean")),
        *((name, doubles) for name in ("frequency_hz", "damping_ratio", "mpc", "emac", "cmi", "shape_re", "shape_im")),
        ("model_radius", c_double),
        ("noise_level", c_double),
        ("observer_info", ObserverInfo),
    ]


class ReplicatesConfig(Structure):
    """okid_replicates_config_t."""

    _fields_ = [*((name, c_int32) for name in ("n_u", "n_y", "n_z")), ("mkr", POINTER(MkrConfig))]


class Uncertainty(Structure):
    """okid_uncertainty_t."""

    _fields_: ClassVar[Any] = [
        *((name, c_int32) for name in ("replicates", "models", "mode_count", "n_y", "n_x", "mkr_used")),
        ("used", int32s),
        *((name, doubles) for name in ("frequency_std_hz", "damping_ratio_std", "shape_re_std", "shape_im_std")),
        *((name, doubles) for name in ("M_std", "K_std", "R_std", "R_normal_std")),
        *((name, c_double) for name in ("alpha_std", "beta_std")),
    ]


class JackknifeConfig(Structure):
    """okid_jackknife_config_t."""

    _fields_ = [("identify", IdentifyConfig), ("sums", AccumulatorConfig), ("linear", c_int32), ("modes_only", c_int32)]


STRUCTS: dict[str, type[Structure]] = {
    "okid_accumulator_config_t": AccumulatorConfig,
    "okid_accumulator_stats_t": AccumulatorStats,
    "okid_modes_t": Modes,
    "okid_records_t": Records,
    "okid_run_sums_t": RunSums,
    "okid_cluster_t": Cluster,
    "okid_correlation_config_t": CorrelationConfig,
    "okid_correlation_sums_t": CorrelationSums,
    "okid_era_config_t": EraConfig,
    "okid_identify_config_t": IdentifyConfig,
    "okid_identified_t": Identified,
    "okid_jackknife_config_t": JackknifeConfig,
    "okid_mechanics_t": Mechanics,
    "okid_mkr_config_t": MkrConfig,
    "okid_mkr_t": Mkr,
    "okid_model_t": ModelView,
    "okid_observer_config_t": ObserverConfig,
    "okid_observer_info_t": ObserverInfo,
    "okid_pdc_t": Pdc,
    "okid_pole_t": Pole,
    "okid_refine_config_t": RefineConfig,
    "okid_refined_t": Refined,
    "okid_skew_config_t": SkewConfig,
    "okid_skew_result_t": SkewResult,
    "okid_replicates_config_t": ReplicatesConfig,
    "okid_square_root_config_t": SquareRootConfig,
    "okid_stabilization_config_t": StabilizationConfig,
    "okid_stabilized_t": Stabilized,
    "okid_track_config_t": TrackConfig,
    "okid_track_t": Track,
    "okid_change_config_t": ChangeConfig,
    "okid_change_mode_t": ChangeMode,
    "okid_change_verdict_t": ChangeVerdict,
    "okid_watch_config_t": WatchConfig,
    "okid_watch_state_t": WatchState,
    "okid_subspace_config_t": SubspaceConfig,
    "okid_subspace_info_t": SubspaceInfo,
    "okid_uncertainty_t": Uncertainty,
}

# name -> (result, arguments); a status is c_int
