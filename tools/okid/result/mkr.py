# SPDX-License-Identifier: MIT
"""Mass, stiffness and damping matrices from an identified model, and the proportional fit of its damping."""

from __future__ import annotations

import ctypes
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from okid import abi
from okid._errors import IdentificationError, InputError
from okid.result.model import Model
from okid.result.parts import MassMatrices, ProportionalDamping

Real = NDArray[np.float64]
SENSING = ("displacement", "velocity", "acceleration")  # in the order of okid_sensing_t
_DOUBTS = abi.MKR_POLARITY | abi.MKR_MASS | abi.MKR_STIFFNESS | abi.MKR_RESIDUAL | abi.MKR_FEEDTHROUGH | abi.MKR_SPREAD
_MOST_CHANNELS = 16  # a look at every channel for itself costs a decomposition of A each


def _number(value: float) -> float | None:
    return float(value) if math.isfinite(value) else None


def mkr_dict(found: MassMatrices) -> dict[str, Any]:
    """The key "mkr" of okid.result/1."""
    out: dict[str, Any] = {name: getattr(found, name).tolist() for name in ("M", "K", "R", "R_normal_modes")}
    for name in ("M_std", "K_std", "R_std", "R_normal_modes_std"):
        value = getattr(found, name)
        out[name] = None if value is None else [[_number(x) for x in row] for row in value.tolist()]
    return {**out, "checks": dict(found.checks), "modes": [dict(mode) for mode in found.modes]}


def pdc_dict(found: ProportionalDamping) -> dict[str, Any]:
    """The key "pdc" of okid.result/1."""
    return {
        "alpha": found.alpha, "beta": found.beta, "R": found.R.tolist(), "alpha_std": found.alpha_std,
        "beta_std": found.beta_std, "residual": _number(found.residual), "condition": _number(found.condition),
    }  # fmt: skip


@dataclass(frozen=True)
class Plan:
    """Where the channels stand: degrees of freedom from 1 (-3: at 3 with reversed polarity), kinds of the sensors."""

    inputs: tuple[int, ...]
    outputs: tuple[int, ...]
    sensing: tuple[str, ...]
    hold: str

    @property
    def size(self) -> int:
        """n_x."""
        return max(abs(dof) for dof in self.inputs + self.outputs)


def _dofs(name: str, given: Sequence[int], count: int) -> tuple[int, ...]:
    numbers: list[object] = [given] if isinstance(given, int | np.integer) else list(given)
    out = []
    for dof in numbers:
        if isinstance(dof, bool) or not isinstance(dof, int | np.integer) or dof == 0:
            raise InputError(f"{name}: found {dof!r}, expected degrees of freedom from 1 (-3: polarity reversed)")
        out.append(int(dof))
    if len(numbers) != count:
        raise InputError(f"{name}: found {len(numbers)} number(s) for {count} channel(s), expected one for each")
    return tuple(out)


def make_plan(
    input_dofs: Sequence[int] | None,
    output_dofs: Sequence[int] | None,
    sensing: str | Sequence[str],
    hold: str,
    sizes: tuple[int, int],
) -> Plan | None:
    """The plan of these arguments, checked against (n_u, n_y); None without degrees of freedom. Raises InputError."""
    kinds = [sensing] if isinstance(sensing, str) else list(sensing)
    for kind in kinds:
        if kind not in SENSING:
            raise InputError(f"sensing is {kind!r}, expected one of {', '.join(map(repr, reversed(SENSING)))}")
    if len(kinds) not in (1, sizes[1]):
        raise InputError(f"sensing: found {len(kinds)} kinds for {sizes[1]} outputs, expected one for all or for each")
    if input_dofs is None and output_dofs is None:
        return None
    if input_dofs is None or output_dofs is None:
        raise InputError(f"{'input' if input_dofs is None else 'output'}_dofs is missing: M, K and R need both")
    inputs, outputs = _dofs("input_dofs", input_dofs, sizes[0]), _dofs("output_dofs", output_dofs, sizes[1])
    plan = Plan(inputs, outputs, tuple(kinds * sizes[1] if len(kinds) == 1 else kinds), hold)
    forced, sensed = {abs(dof) for dof in inputs}, {abs(dof) for dof in outputs}
    for dof in range(1, plan.size + 1):
        if dof not in forced | sensed:
            raise InputError(
                f"input_dofs, output_dofs: degree of freedom {dof} has neither a force nor a sensor, expected one at "
                f"each of 1 to {plan.size}"
            )
    if not forced & sensed:
        raise InputError("input_dofs, output_dofs: no degree of freedom has both, expected a co-located pair")
    return plan


def raw_plan(plan: Plan, dt: float) -> tuple[Any, list[NDArray[Any]]]:
    """okid_mkr_config_t, and the arrays it points to."""
    places = [np.abs(np.array(dofs, np.int32)) - np.int32(1) for dofs in (plan.inputs, plan.outputs)]
    kinds = np.array([SENSING.index(kind) for kind in plan.sensing], np.int32)
    gains = [np.sign(np.array(dofs, np.float64)) for dofs in (plan.inputs, plan.outputs)]
    whole = [x.ctypes.data_as(abi.int32s) for x in (*places, kinds)]
    hold = abi.HOLD_FIRST if plan.hold == "foh" else abi.HOLD_ZERO
    config = abi.MkrConfig(
        plan.size, hold, dt, whole[0], abi.pointer(gains[0]), whole[1], abi.pointer(gains[1]), whole[2]
    )
    return config, [*places, kinds, *gains]


class _Attempt:
    """One okid_mkr_identify(); `raw` points into `work`."""

    def __init__(self, model: Model, plan: Plan) -> None:
        library = abi.library()
        kept = [np.asfortranarray(one, dtype=np.float64) for one in (model.A, model.B, model.C, model.D)]
        n_u, n_y, n_z, n_x = kept[1].shape[1], len(kept[2]), len(kept[0]), plan.size
        view = abi.ModelView(n_u, n_y, n_z, *map(abi.pointer, kept), None)
        config, pointed = raw_plan(plan, model.dt)
        self.work = abi.block(int(library.okid_mkr_memsize(n_u, n_y, n_z, n_x)))
        self.raw = abi.Mkr()
        self.status = int(
            library.okid_mkr_identify(
                ctypes.byref(view), ctypes.byref(config), ctypes.byref(self.raw), self.work.ctypes.data, self.work.size
            )
        )
        del pointed

    def square(self, name: str) -> Real:
        n = int(self.raw.n_x)
        return abi.matrix(getattr(self.raw, name), n, n)

    def column(self, name: str) -> NDArray[Any]:
        return np.array(np.ctypeslib.as_array(getattr(self.raw, name), (int(self.raw.n_x),)))


def _flipped(dofs: tuple[int, ...], at: int) -> tuple[int, ...]:
    return tuple(-dof if k == at else dof for k, dof in enumerate(dofs))


def _nearby(plan: Plan, names: tuple[Sequence[str], Sequence[str]]) -> list[tuple[str, Plan]]:
    """The plans a slip of the hand away, each with what it changes."""
    hold = "zoh" if plan.hold == "foh" else "foh"
    out = [(f"hold {hold}", replace(plan, hold=hold))]
    out += [(f"sensing {kind}", replace(plan, sensing=(kind,) * len(plan.outputs))) for kind in SENSING]
    if len(plan.inputs) + len(plan.outputs) > _MOST_CHANNELS:
        return out
    for k, name in enumerate(names[0]):
        out.append((f'the polarity of "{name}" reversed', replace(plan, inputs=_flipped(plan.inputs, k))))
    for k, name in enumerate(names[1]):
        out.append((f'the polarity of "{name}" reversed', replace(plan, outputs=_flipped(plan.outputs, k))))
    for k, name in enumerate(names[1]):
        for kind in SENSING:
            if kind != plan.sensing[k]:
                mixed = (*plan.sensing[:k], kind, *plan.sensing[k + 1 :])
                out.append((f'"{name}" sensing {kind}', replace(plan, sensing=mixed)))
    return out


def _note_text(code: str, checks: dict[str, Any], modes: list[dict[str, Any]]) -> str:
    bent, torn = min(modes, key=lambda m: float(m["mpc"])), max(modes, key=lambda m: float(m["pair_spread"]))
    margin = checks["selection_margin"]
    texts = {
        "polarity": "M has the wrong sign: the polarity of a force or of its sensor is swapped, or the kind of sensor "
        "is wrong by two (displacement taken for acceleration)",
        "mass_indefinite": "M is not positive definite, nor is -M: wrong degrees of freedom, polarity, kind of sensor "
        "or hold, or modes that do not belong to the structure",
        "stiffness_indefinite": "K is not positive definite: a rigid-body mode is missing, a kind of sensor or the "
        "hold is wrong, or a mode is not one of the structure",
        "damping_indefinite": "R is not positive definite: it is the hardest of the three; R_normal_modes and R of pdc "
        "are the better ones",
        "residual": f"the residual of W W^T = 0 is {checks['ww_residual']:.3g} (doubtful above 0.03): the kind of "
        "sensor is wrong by one (velocity taken for acceleration), the hold is wrong, channels are late, or noise",
        "feedthrough_misfit": f"at {checks['feedthrough_output']!r} the direct feed-through D does not fit M (misfit "
        f"{checks['feedthrough_misfit']:.3g}, doubtful above 0.1): a wrong kind of sensor, a wrong hold, an output "
        "that comes one sample late, or modes outside the band",
        "complex_modes": f"mode {bent['mode']} at {bent['frequency_hz']:.4g} Hz is complex (MPC {bent['mpc']:.3g}, "
        "doubtful below 0.9); R_normal_modes and pdc assume that its points move in phase",
        "pairs_disagree": f"the co-located pairs contradict each other by {torn['pair_spread']:.3g} in mode "
        f"{torn['mode']} at {torn['frequency_hz']:.4g} Hz (doubtful above 0.1): gain, unit, polarity or place",
        "choice_unclear": f"the weakest mode taken is only {0.0 if margin is None else margin:.3g} times as strong as "
        "the best left out (doubtful below 2): compare with another order",
    }
    return texts.get(code, code)


def _refuse(tried: _Attempt, model: Model, plan: Plan) -> None:
    if tried.status >= 0:
        return
    if tried.status == abi.ERR_NO_MODES:
        raise IdentificationError(
            f"no M, K and R: {int(tried.raw.admissible)} admissible mode(s) (underdamped, below {0.5 / model.dt:g} Hz) "
            f"found in the model of order {model.order}, {plan.size} needed, one for each degree of freedom",
            tried.status,
        )
    raise IdentificationError(f"no M, K and R: {abi.status_text(tried.status)}", tried.status)


def _checks(raw: Any, outputs: Sequence[str], used: list[int], notes: list[str]) -> dict[str, Any]:
    row, flags, gain, margin = int(raw.feedthrough_row), int(raw.notes), float(raw.gain), float(raw.margin)
    return {
        "m_positive_definite": not flags & (abi.MKR_POLARITY | abi.MKR_MASS),
        "k_positive_definite": not flags & abi.MKR_STIFFNESS,
        "r_positive_definite": not flags & abi.MKR_DAMPING,
        "ww_residual": _number(raw.residual),
        "feedthrough_misfit": _number(raw.feedthrough),
        "feedthrough_output": outputs[row] if row >= 0 else None,
        "feedthrough_gain": _number(gain) if gain != 0.0 else None,
        "selection_margin": _number(margin) if margin > 0.0 else None,
        "eigenvector_condition": _number(raw.condition),
        "admissible_modes": int(raw.admissible),
        "collocated_pairs": int(raw.pairs),
        "modes_used": used,
        "notes": notes,
    }


def _proportional(modes: list[dict[str, Any]], mass: Real, stiffness: Real) -> ProportionalDamping:
    library, raw = abi.library(), abi.Pdc()
    pair = [np.array([mode[name] for mode in modes]) for name in ("frequency_hz", "damping_ratio")]
    status = library.okid_pdc_fit(len(modes), *map(abi.pointer, pair), None, ctypes.byref(raw))
    abi.check(status, "proportional damping")
    alpha, beta = float(raw.alpha), float(raw.beta)
    damping = alpha * mass + beta * stiffness  # eq. 131
    return ProportionalDamping(alpha, beta, damping, float(raw.residual), float(raw.condition))


def mass_matrices(
    model: Model, plan: Plan, names: tuple[Sequence[str], Sequence[str]]
) -> tuple[MassMatrices, ProportionalDamping, list[tuple[str, str]]]:
    """M, K, R of a model whose channels (names: inputs, outputs) stand as `plan` says, and what the checks find.

    The last part: (code, text), with the change of hold, polarity or sensing that every check would pass with.
    Raises IdentificationError when there are fewer admissible modes than degrees of freedom.
    """
    tried = _Attempt(model, plan)
    _refuse(tried, model, plan)
    columns = {name: tried.column(name) for name in ("frequency_hz", "damping_ratio", "strength", "mpc", "phase")}
    spread, place = tried.column("pair_spread"), tried.column("mode")
    modes = [
        {
            "mode": int(place[k]) + 1,
            **{("phase_rad" if name == "phase" else name): float(x[k]) for name, x in columns.items()},
            "pair_spread": float(spread[k]),
        }
        for k in range(plan.size)
    ]
    flags = int(tried.raw.notes)
    named = [abi.library().okid_mkr_note(1 << bit) for bit in range(32) if flags >> bit & 1]
    notes = [name.decode() for name in named if name]
    checks = _checks(tried.raw, names[1], [int(mode["mode"]) for mode in modes], notes)
    found = MassMatrices(
        tried.square("M"), tried.square("K"), tried.square("R"), tried.square("R_normal"), checks, modes
    )
    said = [(f"mkr_{code}", _note_text(code, checks, modes)) for code in notes]
    if flags & _DOUBTS:
        passing = []
        for change, other in _nearby(plan, names):
            again = _Attempt(model, other)
            if again.status >= 0 and not int(again.raw.notes) & (_DOUBTS | abi.MKR_DAMPING):
                passing.append(change)
        if 1 <= len(passing) <= 3:
            said.append(("mkr_likely_cause", f"every check passes with {', or with '.join(passing)}"))
    pdc = _proportional(modes, found.M, found.K)
    if not pdc.condition < 1e3:
        said.append(("pdc_undetermined", "one frequency cannot tell alpha from beta: they share the damping evenly"))
    if pdc.residual > 0.2:
        text = f"the damping is not proportional: alpha M + beta K misses the ratios by {100.0 * pdc.residual:.3g} %"
        said.append(("pdc_residual", text))
    return found, pdc, said


def _plus_minus(value: float | None) -> str:
    return f"±{value:.2g}" if value is not None and math.isfinite(value) else "-"


def square_text(title: str, matrix: Real, std: Real | None = None) -> str:
    """A matrix with its degrees of freedom for a person; below each row its standard deviations, if there are any."""
    largest = float(np.max(np.abs(matrix)))
    exponent = math.floor(math.log10(largest)) if largest > 0.0 else 0
    style = f"12.{min(max(5 - exponent, 0), 12)}f" if -6 <= exponent < 7 else "12.4e"
    said = "" if std is None else ", ± one standard deviation"
    lines = [title + said, "  dof" + "".join(f" {k:>12d}" for k in range(1, len(matrix) + 1))]
    for k, row in enumerate(matrix.tolist()):
        lines.append(f"{k + 1:>5d}" + "".join(f" {x:{style}}" for x in row))
        if std is not None:
            lines.append("     " + "".join(f" {_plus_minus(x):>12}" for x in std[k].tolist()))
    return "\n".join(lines)


def proportional_text(pdc: ProportionalDamping) -> str:
    """R = alpha M + beta K with its deviations."""
    parts = [(pdc.alpha, pdc.alpha_std), (pdc.beta, pdc.beta_std)]
    alpha, beta = (f"{x:.5g}" if std is None else f"({x:.5g} {_plus_minus(std)})" for x, std in parts)
    return f"{alpha} 1/s M + {beta} s K"


def mass_table(mkr: MassMatrices, pdc: ProportionalDamping) -> str:
    """The matrices with units and checks for a person."""
    checks = mkr.checks
    signs = ", ".join(f"{x} {'yes' if checks[f'{x.lower()}_positive_definite'] else 'NO'}" for x in "MKR")
    margin = checks["selection_margin"]
    chosen = f"{len(mkr.M)} of {checks['admissible_modes']} admissible modes used"
    chosen += "" if margin is None else f", the weakest {margin:.3g} times stronger than the best left out"
    return "\n".join(
        [
            square_text("M [kg]", mkr.M, mkr.M_std),
            square_text("K [N/m]", mkr.K, mkr.K_std),
            square_text("R [N s/m]", mkr.R, mkr.R_std),
            square_text("R [N s/m] of normal modes", mkr.R_normal_modes, mkr.R_normal_modes_std),
            square_text(f"R [N s/m] proportional: {proportional_text(pdc)}", pdc.R),
            f"positive definite: {signs}",
            f"residual of W W^T = 0: {checks['ww_residual']:.2g} (doubtful above 0.03); misfit of D to M: "
            f"{checks['feedthrough_misfit']:.2g} (doubtful above 0.1)",
            f"{chosen}; {checks['collocated_pairs']} co-located pair(s)",
        ]
    )
