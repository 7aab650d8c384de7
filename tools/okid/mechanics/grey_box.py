# SPDX-License-Identifier: MIT
"""Masses, springs and dampers of a structure whose pattern is known, fitted to the modes of an identified model."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from okid._errors import IdentificationError, InputError
from okid.mechanics.structure import Structure
from okid.modal import mac
from okid.result.model import Model
from okid.result.parts import Mode
from okid.result.result import Result
from okid.shown.notebook_html import own_fields, short, summary, table

Real = NDArray[np.float64]
Complex = NDArray[np.complex128]
LEAST_F, LEAST_ZETA, LEAST_SHAPE = 1e-4, 0.01, 0.01  # relative standard deviations that are believed at least
UNKNOWN_F, UNKNOWN_ZETA = 1e-3, 0.1  # where the result has none
ROUNDS, STEP, WORST = 8, 1e-6, 1e10  # pairings of modes; of the logarithms; condition of the normal equations


class FittedMode(NamedTuple):
    """A mode of the result (its number from 1) beside that of the fitted structure."""

    number: int
    frequency_hz: float
    fitted_hz: float
    damping_ratio: float
    fitted_ratio: float
    mac: float

    def _repr_html_(self) -> str:
        return own_fields(self)


class GreyBox(NamedTuple):
    """`values` and `std` (one sigma) of the parameters; `structure` with these values; `misfit`: rms of what is left in
    standard deviations of the modes, about 1 where the pattern is right; `correlation` of the parameters."""

    values: dict[str, float]
    std: dict[str, float]
    structure: Structure
    modes: list[FittedMode]
    misfit: float
    correlation: Real

    def _repr_html_(self) -> str:
        parameters = (
            [name, short(value), short(self.std.get(name), form=".2g")] for name, value in self.values.items()
        )
        modes = (
            [f"{one.number}", f"{one.frequency_hz:.5f}", f"{one.fitted_hz:.5f}", f"{100.0 * one.damping_ratio:.4f}",
             f"{100.0 * one.fitted_ratio:.4f}", short(one.mac, form=".4f")]
            for one in self.modes
        )  # fmt: skip
        head = ("mode", "f [Hz]", "fitted [Hz]", "ζ [%]", "fitted [%]", "MAC")
        return summary(f"GreyBox, misfit {short(self.misfit, form='.3g')}") + (
            table(("parameter", "value", "±"), parameters) + table(head, modes)
        )


class _Modes(NamedTuple):
    frequency_hz: Real
    damping_ratio: Real
    residues: Complex  # (modes, n_y, n_u) of x+ = A x + B u; without inputs the shapes, n_u = 1


def _modes_of(model: Model) -> _Modes:
    mu, V = np.linalg.eig(model.A)
    upper = np.flatnonzero(mu.imag > 0.0)
    lam = np.log(mu[upper]) / model.dt
    upper, lam = upper[np.argsort(np.abs(lam))], lam[np.argsort(np.abs(lam))]
    C, B = model.C @ V, np.linalg.solve(V, model.B + 0j)
    residues = np.array([np.outer(C[:, k], B[k]) if model.B.shape[1] else C[:, [k]] for k in upper])
    return _Modes(np.abs(lam) / (2.0 * np.pi), -lam.real / np.abs(lam), residues)


class _Problem:
    def __init__(self, result: Result, build: Callable[..., Structure], names: list[str], places: dict[str, Any],
                 use: Sequence[int]) -> None:  # fmt: skip
        self.result, self.build, self.names, self.places = result, build, names, places
        self.scaled = bool(result.inputs) and bool(places["input_dofs"] or places["ground"] is not None)
        self.wanted = [result.modes[k - 1] for k in use]
        self.numbers = list(use)
        seen = _modes_of(result.model)
        nearest = [int(np.argmin(np.abs(seen.frequency_hz - mode.frequency_hz))) for mode in self.wanted]
        self.residues = [seen.residues[k] if self.scaled else mode.shape[:, None]
                         for k, mode in zip(nearest, self.wanted, strict=True)]  # fmt: skip

    def structure(self, logs: Real) -> Structure:
        made = self.build(**dict(zip(self.names, np.exp(logs).tolist(), strict=True)))
        if not isinstance(made, Structure):
            raise InputError(f"structure returned {type(made).__name__}, expected an okid.Structure")
        return made

    def modes(self, logs: Real) -> _Modes:
        made, at, fs = self.structure(logs), self.places, self.result.fs_hz
        hold = self.result.hold if self.result.hold in ("zoh", "foh") else "zoh"
        forces = at["input_dofs"] or list(range(1, made.n_x + 1))
        model = made.model(fs, forces, at["output_dofs"], at["sensing"], hold)
        if at["ground"] is not None:
            model.B = model.B @ (-made.M @ at["ground"])
        elif not at["input_dofs"]:
            model.B = model.B[:, :0]
        found = _modes_of(model)
        if self.scaled and self.result.hold == "band":  # the residue of a force without steps
            w = 2.0 * np.pi * found.frequency_hz
            lam = -found.damping_ratio * w + 1j * w * np.sqrt(1.0 - found.damping_ratio**2)
            mu = np.exp(lam / fs)
            found = found._replace(residues=found.residues * (lam * mu / fs / (mu - 1.0))[:, None, None])
        return found

    def pair(self, found: _Modes) -> list[int]:
        """The fitted mode of each wanted one: shape before frequency, none twice."""
        left, out = set(range(len(found.frequency_hz))), []
        for k, mode in enumerate(self.wanted):
            if not left:
                raise InputError(f"the structure has {len(found.frequency_hz)} modes, the result {len(self.wanted)}")
            out.append(min(left, key=lambda j: 1.0 - mac(found.residues[j].ravel(), self.residues[k].ravel())
                           + 3.0 * abs(np.log(found.frequency_hz[j] / mode.frequency_hz))))  # fmt: skip
            left.discard(out[-1])
        return out

    def left(self, logs: Real, pairs: Sequence[int]) -> Real:
        """What is left of every mode in its standard deviations."""
        found, out = self.modes(logs), []
        for mode, target, j in zip(self.wanted, self.residues, pairs, strict=True):
            f, z = mode.frequency_hz, mode.damping_ratio
            out.append((found.frequency_hz[j] - f) / max(mode.frequency_std_hz or UNKNOWN_F * f, LEAST_F * f))
            out.append((found.damping_ratio[j] - z) / max(mode.damping_ratio_std or UNKNOWN_ZETA * z, LEAST_ZETA * z))
            there = np.isfinite(target)
            a, b = found.residues[j][there], target[there]
            if not self.scaled:
                a = a * (np.vdot(a, b) / max(float(np.vdot(a, a).real), 1e-300))
            sigma = _shape_sigma(mode) * float(np.max(np.abs(b)))
            out += [*((a - b).real / sigma), *((a - b).imag / sigma)]
        return np.array(out)

    def slopes(self, logs: Real, pairs: Sequence[int]) -> tuple[Real, Real]:
        base = self.left(logs, pairs)
        columns = []
        for k in range(len(logs)):
            step = np.zeros(len(logs))
            step[k] = STEP
            columns.append((self.left(logs + step, pairs) - self.left(logs - step, pairs)) / (2.0 * STEP))
        return base, np.column_stack(columns)


def _shape_sigma(mode: Mode) -> float:
    parts = [one for one in (mode.shape_re_std, mode.shape_im_std) if one is not None]
    values = np.concatenate(parts) if parts else np.array([np.nan])
    return max(LEAST_SHAPE, float(np.nanmedian(values)) if np.any(np.isfinite(values)) else LEAST_SHAPE)


def _descend(problem: _Problem, logs: Real, pairs: Sequence[int]) -> Real:
    """Levenberg-Marquardt on the logarithms of the parameters."""
    damping = 1e-3
    for _ in range(60):
        base, J = problem.slopes(logs, pairs)
        N, g = J.T @ J, J.T @ base
        for _ in range(12):
            step = -np.linalg.solve(N + damping * np.diag(np.maximum(np.diag(N), 1e-12)), g)
            step *= min(1.0, 0.5 / max(float(np.max(np.abs(step))), 1e-12))
            try:
                gained = float(base @ base) - float(np.sum(problem.left(logs + step, pairs) ** 2))
            except InputError:  # no structure there
                gained = -1.0
            if gained > 0.0:
                damping = max(damping / 5.0, 1e-9)
                break
            damping *= 4.0
        else:
            return logs
        logs = logs + step
        if gained < 1e-9 * float(base @ base):
            return logs
    return logs


def fit_structure(
    result: Result,
    structure: Callable[..., Structure],
    start: Mapping[str, float],
    *,
    output_dofs: Sequence[int],
    input_dofs: Sequence[int] | None = None,
    ground: Sequence[float] | None = None,
    sensing: str | Sequence[str] = "acceleration",
    modes: Sequence[int] | None = None,
) -> GreyBox:
    """Fit named parameters of a structure to an identified model: f, zeta, shapes and, with forces, the modal masses.

    `structure(**parameters)` returns an okid.Structure: a chain, a frame with symmetry, matrices of a finite element
    model. `start`: the parameters and where the search begins, all above 0; known ones stay inside `structure`.
    `output_dofs`, `input_dofs`: where the sensors and forces of the result stand, from 1 (-3: at 3, reversed).
    `ground`: the one input is the acceleration of the ground, and these are the displacements of the degrees of freedom
    when it moves by 1 (a frame: all 1); sensors may be absolute or relative accelerations. `modes`: numbers from 1 of
    those fitted, default the confident ones. Without forces only ratios of masses and springs are seen: at least one of
    them has to be known. Each mode weighs by its standard deviations, at least 0.01 % of f, 1 % of zeta and shape.

    Raises InputError; IdentificationError where the modes do not tell a parameter.

    >>> import okid
    >>> force, y = okid.demo_record()
    >>> result = okid.identify(force, y, fs=1000.0)
    >>> def frame(m, k1, k2, k3):
    ...     return okid.Structure.chain([m, 0.8, 1.2], [k1, k2, k3], zeta=(0.009, 0.009))
    >>> found = okid.fit_structure(result, frame, {"m": 2.0, "k1": 2e4, "k2": 2e4, "k3": 2e4},
    ...                            input_dofs=[1], output_dofs=[1, 2, 3])
    >>> {name: float(f"{value:.2g}") for name, value in found.values.items()}  # true: 1, 3e4, 2e4, 2.5e4
    {'m': 1.0, 'k1': 30000.0, 'k2': 20000.0, 'k3': 25000.0}
    """
    names = list(start)
    values = np.array([float(start[name]) for name in names])
    if not names or not np.all(np.isfinite(values)) or np.any(values <= 0.0):
        raise InputError(f"start is {dict(start)}, expected a number above 0 for each parameter")
    if len(output_dofs) != len(result.outputs):
        raise InputError(f"output_dofs has {len(output_dofs)} numbers, the result {len(result.outputs)} outputs")
    if ground is not None and (input_dofs is not None or len(result.inputs) != 1):
        raise InputError(f"ground needs one input and no input_dofs, the result has {len(result.inputs)} inputs")
    if input_dofs is not None and len(input_dofs) != len(result.inputs):
        raise InputError(f"input_dofs has {len(input_dofs)} numbers, the result {len(result.inputs)} inputs")
    use = list(modes) if modes is not None else [k for k, one in enumerate(result.modes, 1) if one.confident]
    if not use or not all(1 <= k <= len(result.modes) for k in use):
        raise InputError(f"modes is {use}, expected numbers of the {len(result.modes)} modes of the result")
    places = {"output_dofs": list(output_dofs), "input_dofs": list(input_dofs or ()), "sensing": sensing,
              "ground": None if ground is None else np.asarray(ground, dtype=np.float64).reshape(-1, 1)}  # fmt: skip
    problem = _Problem(result, structure, names, places, use)
    logs, pairs = np.log(values), [-1]
    for _ in range(ROUNDS):
        now = problem.pair(problem.modes(logs))
        if now == pairs:
            break
        pairs = now
        logs = _descend(problem, logs, pairs)
    return _answer(problem, logs, pairs)


def _answer(problem: _Problem, logs: Real, pairs: Sequence[int]) -> GreyBox:
    base, J = problem.slopes(logs, pairs)
    N = J.T @ J
    weak = int(np.argmin(np.diag(N)))
    unit = 1.0 / np.sqrt(np.maximum(np.diag(N), 1e-300))
    if np.diag(N)[weak] < 1e-6 or np.linalg.cond(N * np.outer(unit, unit)) > WORST:
        held = (
            ""
            if problem.scaled
            else " (without forces only ratios can be identified: one mass or spring has to be known)"
        )
        raise IdentificationError(
            f"the {len(pairs)} modes cannot distinguish {', '.join(problem.names)}{held}; the "
            f"least certain is {problem.names[weak]!r}: leave a parameter out, or give more modes"
        )
    freedom = max(1, len(base) - len(logs))
    covariance = np.linalg.inv(N) * max(1.0, float(base @ base) / freedom)
    sigma = np.sqrt(np.diag(covariance))
    found, made = problem.modes(logs), problem.structure(logs)
    table = [
        FittedMode(number, mode.frequency_hz, float(found.frequency_hz[j]), mode.damping_ratio,
                   float(found.damping_ratio[j]), mac(found.residues[j].ravel(), target.ravel()))
        for number, mode, target, j in zip(problem.numbers, problem.wanted, problem.residues, pairs, strict=True)
    ]  # fmt: skip
    values = np.exp(logs)
    return GreyBox(
        dict(zip(problem.names, values.tolist(), strict=True)),
        dict(zip(problem.names, (values * sigma).tolist(), strict=True)),
        made, table, float(np.sqrt(base @ base / freedom)), covariance / np.outer(sigma, sigma),
    )  # fmt: skip
