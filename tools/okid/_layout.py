# SPDX-License-Identifier: MIT
"""The C ABI of libokid as ctypes: structures, constants and signatures exactly as in lib/include/okid/*.h.

tests/abi/test_struct_layout.py compiles the headers and compares every size, offset, constant and argument.
"""

from __future__ import annotations

from ctypes import POINTER, Structure, c_char_p, c_double, c_float, c_int, c_int16, c_int32, c_int64, c_size_t, c_uint32
from ctypes import c_void_p as opaque
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

    _fields_ = [("identify", IdentifyConfig), ("sums", AccumulatorConfig)]


_model = POINTER(ModelView)

STRUCTS: dict[str, type[Structure]] = {
    "okid_accumulator_config_t": AccumulatorConfig,
    "okid_accumulator_stats_t": AccumulatorStats,
    "okid_cluster_t": Cluster,
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
    "okid_subspace_config_t": SubspaceConfig,
    "okid_subspace_info_t": SubspaceInfo,
    "okid_uncertainty_t": Uncertainty,
}

# name -> (result, arguments); a status is c_int
SIGNATURES: dict[str, tuple[Any, list[Any]]] = {
    "okid_status_text": (c_char_p, [c_int]),
    "okid_version": (c_char_p, []),
    "okid_backend": (c_char_p, []),
    "okid_accumulator_memsize": (c_size_t, [POINTER(AccumulatorConfig)]),
    "okid_accumulator_create": (c_int, [POINTER(opaque), POINTER(AccumulatorConfig), opaque, c_size_t]),
    "okid_accumulator_reset": (None, [opaque]),
    "okid_accumulator_set_units": (None, [opaque, doubles, doubles]),
    "okid_accumulator_add": (c_int, [opaque, doubles, c_size_t]),
    "okid_accumulator_add_f32": (c_int, [opaque, floats, c_size_t]),
    "okid_accumulator_add_i16": (c_int, [opaque, int16s, c_size_t]),
    "okid_accumulator_add_i32": (c_int, [opaque, int32s, c_size_t]),
    "okid_accumulator_gap": (None, [opaque, c_int64]),
    "okid_accumulator_merge": (c_int, [opaque, opaque]),
    "okid_accumulator_remove": (c_int, [opaque, opaque, c_double]),
    "okid_accumulator_copy": (c_int, [opaque, opaque]),
    "okid_accumulator_slots": (c_int32, [opaque]),
    "okid_accumulator_slot_rows": (c_int64, [opaque, c_int32]),
    "okid_accumulator_take_slots": (c_int, [opaque, opaque, c_int32, c_int32]),
    "okid_accumulator_energy": (c_int, [opaque, c_int, doubles]),
    "okid_accumulator_centre": (c_int, [opaque]),
    "okid_accumulator_run": (c_int, [opaque, c_int] + [doubles] * 5),
    "okid_accumulator_serialised_size": (c_size_t, [opaque]),
    "okid_accumulator_serialise": (c_int, [opaque, opaque, c_size_t]),
    "okid_accumulator_peek": (c_int, [opaque, c_size_t, POINTER(AccumulatorConfig)]),
    "okid_accumulator_deserialise": (c_int, [opaque, opaque, c_size_t]),
    "okid_accumulator_stats": (None, [opaque, POINTER(AccumulatorStats)]),
    "okid_accumulator_config": (None, [opaque, POINTER(AccumulatorConfig)]),
    "okid_accumulator_rows": (c_int64, [opaque]),
    "okid_accumulator_gram": (c_int, [opaque, c_int, doubles, doubles]),
    "okid_observer_memsize": (c_size_t, [POINTER(ObserverConfig)]),
    "okid_observer_solve": (
        c_int,
        [POINTER(ObserverConfig), doubles, c_int64, doubles, doubles, POINTER(ObserverInfo), opaque, c_size_t],
    ),
    "okid_square_root_memsize": (c_size_t, [POINTER(SquareRootConfig)]),
    "okid_square_root_create": (c_int, [POINTER(opaque), POINTER(SquareRootConfig), opaque, c_size_t]),
    "okid_square_root_reset": (None, [opaque]),
    "okid_square_root_set_units": (None, [opaque, doubles, doubles]),
    "okid_square_root_add": (c_int, [opaque, doubles, c_size_t]),
    "okid_square_root_add_f32": (c_int, [opaque, floats, c_size_t]),
    "okid_square_root_add_i16": (c_int, [opaque, int16s, c_size_t]),
    "okid_square_root_add_i32": (c_int, [opaque, int32s, c_size_t]),
    "okid_square_root_gap": (None, [opaque, c_int64]),
    "okid_square_root_merge": (c_int, [opaque, opaque]),
    "okid_square_root_stats": (None, [opaque, POINTER(AccumulatorStats)]),
    "okid_square_root_config": (None, [opaque, POINTER(SquareRootConfig)]),
    "okid_square_root_rows": (c_int64, [opaque]),
    "okid_square_root_gram": (c_int, [opaque, c_int, doubles, doubles]),
    "okid_square_root_factor": (c_int, [opaque, c_int, doubles, doubles]),
    "okid_observer_factor_memsize": (c_size_t, [POINTER(ObserverConfig)]),
    "okid_observer_solve_factor": (
        c_int,
        [POINTER(ObserverConfig), doubles, c_int64, doubles, doubles, POINTER(ObserverInfo), opaque, c_size_t],
    ),
    "okid_structured_memsize": (c_size_t, [POINTER(ObserverConfig)]),
    "okid_structured_solve": (
        c_int,
        [POINTER(ObserverConfig), c_int, doubles, doubles, doubles, doubles, c_int64, doubles, doubles]
        + [POINTER(ObserverInfo), opaque, c_size_t],
    ),
    "okid_markov_recursion": (c_int, [c_int32, c_int32, c_int32, doubles, c_int32, doubles, doubles]),
    "okid_era_memsize": (c_size_t, [POINTER(EraConfig)]),
    "okid_era_create": (c_int, [POINTER(opaque), POINTER(EraConfig), opaque, c_size_t]),
    "okid_era_decompose": (c_int, [opaque, doubles]),
    "okid_era_singular_values": (doubles, [opaque, int32s]),
    "okid_era_max_order": (c_int32, [POINTER(EraConfig)]),
    "okid_era_markov_last": (c_int32, [POINTER(EraConfig)]),
    "okid_era_realize": (c_int, [opaque, c_int32, doubles, doubles, doubles, doubles, doubles]),
    "okid_era_emac": (c_int, [opaque, c_int32, c_int32, doubles, doubles, doubles, doubles, doubles]),
    "okid_subspace_max_order": (c_int32, [POINTER(SubspaceConfig)]),
    "okid_subspace_memsize": (c_size_t, [POINTER(SubspaceConfig)]),
    "okid_subspace_create": (c_int, [POINTER(opaque), POINTER(SubspaceConfig), opaque, c_size_t]),
    "okid_subspace_decompose": (c_int, [opaque, doubles, c_int64, POINTER(SubspaceInfo)]),
    "okid_subspace_decompose_factor": (c_int, [opaque, doubles, c_int64, POINTER(SubspaceInfo)]),
    "okid_subspace_singular_values": (doubles, [opaque, int32s]),
    "okid_subspace_realize": (c_int, [opaque, c_int32] + [doubles] * 6),
    "okid_subspace_emac": (c_int, [opaque, c_int32, c_int32] + [doubles] * 6),
    "okid_subspace_output_error_memsize": (c_size_t, [c_int32] * 4),
    "okid_subspace_output_error": (
        c_int,
        [c_int32] * 3 + [doubles, doubles, c_int32, int32s] + [doubles] * 4 + [opaque, c_size_t],
    ),
    "okid_modal_memsize": (c_size_t, [c_int32, c_int32]),
    "okid_modal_analyse": (
        c_int,
        [c_int32, c_int32, c_double, doubles, doubles, int32s] + [doubles] * 10 + [opaque, c_size_t],
    ),
    "okid_modal_mac": (c_double, [c_int32, doubles, doubles, doubles, doubles]),
    "okid_mechanics_inputs": (c_int, [c_int32, c_int32, int32s, doubles, doubles]),
    "okid_mechanics_outputs": (c_int, [c_int32, c_int32, int32s, doubles, int32s, doubles, doubles, doubles]),
    "okid_mechanics_memsize": (c_size_t, [c_int32, c_int32]),
    "okid_mechanics_continuous": (c_int, [POINTER(Mechanics), *[doubles] * 4, opaque, c_size_t]),
    "okid_mechanics_modes": (c_int, [c_int32, *[doubles] * 3, int32s, *[doubles] * 4, opaque, c_size_t]),
    "okid_mechanics_hold_memsize": (c_size_t, [c_int32, c_int32, c_int32]),
    "okid_mechanics_c2d": (c_int, [_model, c_double, c_int32, *[doubles] * 3, opaque, c_size_t]),
    "okid_mechanics_d2c": (c_int, [_model, c_double, c_int32, *[doubles] * 3, opaque, c_size_t]),
    "okid_mkr_memsize": (c_size_t, [c_int32, c_int32, c_int32, c_int32]),
    "okid_mkr_identify": (c_int, [_model, POINTER(MkrConfig), POINTER(Mkr), opaque, c_size_t]),
    "okid_mkr_note": (c_char_p, [c_uint32]),
    "okid_pdc_fit": (c_int, [c_int32, doubles, doubles, doubles, POINTER(Pdc)]),
    "okid_pdc_damping": (c_int, [c_int32, POINTER(Pdc), doubles, doubles, doubles]),
    "okid_refine_memsize": (c_size_t, [POINTER(RefineConfig)]),
    "okid_refine_create": (c_int, [POINTER(opaque), POINTER(RefineConfig), opaque, c_size_t]),
    "okid_refine_run": (c_int, [opaque, _model, int32s, doubles, POINTER(Refined)]),
    "okid_refine_replicate": (c_int, [opaque, c_int32, *[doubles] * 4]),
    "okid_skew_memsize": (c_size_t, [POINTER(SkewConfig)]),
    "okid_skew_create": (c_int, [POINTER(opaque), POINTER(SkewConfig), opaque, c_size_t]),
    "okid_skew_begin": (c_int, [opaque, _model]),
    "okid_skew_add": (c_int, [opaque, _model]),
    "okid_skew_finish": (c_int, [opaque, POINTER(SkewResult)]),
    "okid_skew_correct": (c_int, [opaque, doubles, doubles]),
    "okid_model_workspace": (c_size_t, [_model]),
    "okid_model_simulate": (c_int, [_model, doubles, c_size_t, doubles, doubles, doubles]),
    "okid_model_predict": (c_int, [_model, doubles, doubles, c_size_t, doubles, doubles, doubles]),
    "okid_model_initial_state": (c_int, [_model, doubles, doubles, c_size_t, doubles, doubles]),
    "okid_warning_code": (c_char_p, [c_uint32]),
    "okid_identify_usable_p": (c_int32, [c_int32, c_int32, c_int32, c_int64]),
    "okid_identify_lags": (c_int32, [POINTER(IdentifyConfig)]),
    "okid_identify_max_order": (c_int32, [POINTER(IdentifyConfig)]),
    "okid_identify_memsize": (c_size_t, [POINTER(IdentifyConfig)]),
    "okid_identify_create": (c_int, [POINTER(opaque), POINTER(IdentifyConfig), opaque, c_size_t]),
    "okid_identify_run": (c_int, [opaque, opaque, POINTER(Identified)]),
    "okid_identify_run_factor": (c_int, [opaque, opaque, POINTER(Identified)]),
    "okid_identify_poles": (c_int, [opaque, c_int32, POINTER(Identified)]),
    "okid_stabilization_memsize": (c_size_t, [POINTER(StabilizationConfig)]),
    "okid_stabilization_create": (c_int, [POINTER(opaque), POINTER(StabilizationConfig), opaque, c_size_t]),
    "okid_stabilization_add": (c_int, [opaque, POINTER(Identified)]),
    "okid_stabilization_find": (c_int, [opaque, POINTER(Stabilized)]),
    "okid_identify_order": (c_int, [opaque, c_int32, POINTER(Identified)]),
    "okid_identify_set_inputs": (c_int, [opaque, doubles, doubles, POINTER(Identified)]),
    "okid_replicates_memsize": (c_size_t, [POINTER(ReplicatesConfig)]),
    "okid_replicates_create": (c_int, [POINTER(opaque), POINTER(ReplicatesConfig), opaque, c_size_t]),
    "okid_replicates_begin": (c_int, [opaque, _model, c_double]),
    "okid_replicates_add": (c_int, [opaque, _model, c_double]),
    "okid_replicates_finish": (c_int, [opaque, POINTER(Uncertainty)]),
    "okid_jackknife_memsize": (c_size_t, [POINTER(JackknifeConfig)]),
    "okid_jackknife_create": (c_int, [POINTER(opaque), POINTER(JackknifeConfig), opaque, c_size_t]),
    "okid_jackknife_begin": (c_int, [opaque, opaque, POINTER(Identified)]),
    "okid_jackknife_delete": (c_int, [opaque, opaque, c_double, _model, doubles]),
}
