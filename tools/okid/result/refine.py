# SPDX-License-Identifier: MIT
"""Maximum-likelihood refinement of an identified model: the model whose simulated outputs are the likeliest."""

from __future__ import annotations

import ctypes
import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from okid import abi
from okid._errors import Error
from okid.abi.identifier import Identified
from okid.modal import mpc, poles
from okid.result.model import Model
from okid.result.record_fit import fit_records, stretches
from okid.result.result import Fit, Remark

Real = NDArray[np.float64]
BLOCKS, MOST_RUNS = 20, 32
SAME_PERCENT, LOST_PERCENT = 0.01, 0.5  # fits closer than this are the same; a loss of prediction worth a remark


@dataclass(frozen=True)
class Refinement:
    """What came of it: steps, log-likelihood gained over the start and left (of one more step), the mean of N r^2 over
    the autocorrelations of the residuals at lags 1..20 (1 = white), residual standard deviation of each output.

    `replicates`: models without one of 20 blocks each, for standard deviations.
    """

    iterations: int
    converged: bool
    samples: int
    gain: float
    decrement: float
    whiteness: float
    noise_std: Real
    replicates: list[Model] = field(repr=False, compare=False, default_factory=list)

    def to_dict(self, outputs: Sequence[str]) -> dict[str, Any]:
        """Key "refinement" of okid.result/1."""
        return {
            "iterations": self.iterations,
            "converged": self.converged,
            "samples": self.samples,
            "log_likelihood_gain": self.gain,
            "log_likelihood_left": self.decrement,
            "whiteness": self.whiteness,
            "noise_std": dict(zip(outputs, self.noise_std.tolist(), strict=True)),
        }

    def text(self, outputs: Sequence[str]) -> str:
        """Two lines for a person."""
        end = "converged" if self.converged else "NOT converged"
        noise = ", ".join(f"{name} {sigma:.3g}" for name, sigma in zip(outputs, self.noise_std, strict=True))
        return (
            f"refined: {self.iterations} iterations, log-likelihood {self.gain:+.1f}, {end}; correlation of the "
            f"residuals {self.whiteness:.3g} (white: 1)\nnoise (1 sigma): {noise}"
        )


def refine(start: Model, records: Sequence[Real], *, offset: bool) -> tuple[Model, Refinement]:
    """The likeliest model near `start`, in its states and with its Kalman gain.

    records (N, n_u + n_y), inputs first, NaN = missing; they are cut at missing inputs (the 32 longest stretches are
    used). `offset`: every stretch has an unknown constant in every output. Raises Error with the library's reason.
    """
    n_z, n_u, n_y = len(start.A), start.B.shape[1], len(start.C)
    pieces = [record[piece] for record in records for piece in stretches(record[:, :n_u], max(20, 2 * n_z))]
    runs = sorted(pieces, key=len, reverse=True)[:MOST_RUNS]
    samples, counts = np.ascontiguousarray(np.vstack(runs)), np.array([len(run) for run in runs], dtype=np.int32)
    lib, handle, raw = abi.library(), ctypes.c_void_p(), abi.Refined()
    config = abi.RefineConfig(n_u, n_y, n_z, len(runs), BLOCKS, 0, int(offset))
    block = abi.block(int(lib.okid_refine_memsize(ctypes.byref(config))))
    place = (ctypes.byref(handle), ctypes.byref(config), block.ctypes.data, block.size)
    abi.check(lib.okid_refine_create(*place), "refinement")
    kept = [np.asfortranarray(one, dtype=np.float64) for one in (start.A, start.B, start.C, start.D)]
    view = abi.ModelView(n_u, n_y, n_z, *map(abi.pointer, kept), None)
    abi.check(
        lib.okid_refine_run(
            handle, ctypes.byref(view), counts.ctypes.data_as(abi.int32s), abi.pointer(samples), ctypes.byref(raw)
        ),
        "refinement",
    )

    def model(pointers: Sequence[Any]) -> Model:
        sizes = ((n_z, n_z), (n_z, n_u), (n_y, n_z), (n_y, n_u))
        A, B, C, D = (abi.matrix(one, *size) for one, size in zip(pointers, sizes, strict=True))
        return Model(A, B, C, D, start.K, start.dt)

    result = model([raw.A, raw.B, raw.C, raw.D])
    replicates = []
    for index in range(BLOCKS):
        room = [np.empty(one.shape, order="F") for one in kept]
        abi.check(lib.okid_refine_replicate(handle, index, *map(abi.pointer, room)), "replicate")
        replicates.append(model([abi.pointer(one) for one in room]))
    noise = np.array(np.ctypeslib.as_array(raw.noise_std, (n_y,)))
    return result, Refinement(
        int(raw.iterations), bool(raw.converged), int(raw.samples), float(raw.gain), float(raw.decrement),
        float(raw.whiteness), noise, replicates,
    )  # fmt: skip


class Refined(NamedTuple):
    """What becomes of an identified model; `refinement` None and all else as it was when it could not be bettered."""

    found: Identified
    model: Model
    fit: Fit
    refinement: Refinement | None
    remarks: list[Remark]


def _mean(percent: dict[str, float | None]) -> float:
    """Mean over the outputs; an output that cannot be simulated counts as no fit at all."""
    return float(np.mean([-math.inf if x is None else x for x in percent.values()]))


def _with_best_gain(
    model: Model, before: Fit, records: Sequence[Real], names: Sequence[str]
) -> tuple[Fit, list[Remark]]:
    """The fit with the Kalman gain of the start; with none (the model alone) where that predicts better."""
    fit, x0 = fit_records(model, records, names)
    old, new = _mean(before.prediction_percent), _mean(fit.prediction_percent)
    if not (math.isfinite(new) and new >= old - SAME_PERCENT):
        alone = Model(model.A, model.B, model.C, model.D, np.zeros_like(model.K), model.dt)
        other, _ = fit_records(alone, records, names)
        if not _mean(other.prediction_percent) <= new:
            model.K, fit, new = alone.K, other, _mean(other.prediction_percent)
    model.x0 = x0
    if new >= old - LOST_PERCENT:
        return fit, []
    text = (
        f"the one-step prediction of the refined model is {new:.2f} % on average instead of {old:.2f} %: refinement is "
        "about the simulation. For a predictor, identify without it"
    )
    return fit, [Remark("prediction_lower", text)]


def _seen(found: Identified, model: Model, stable_predictor: bool) -> Identified:
    """`found` with the refined model; a mode keeps the EMAC of the nearest pole of the start."""
    now = poles(model.A, model.C, model.dt)
    was = found.frequency_hz * np.exp(1j * np.arccos(-found.damping_ratio))
    at = now.frequency_hz * np.exp(1j * np.arccos(-now.damping_ratio))
    emac = np.array([found.emac[np.argmin(np.abs(was - pole))] if len(was) else 0.0 for pole in at])
    consistency = np.array([mpc(shape) for shape in now.shapes])
    markov, state = [model.D], model.B
    for _ in range(len(found.markov) - 1):
        markov.append(model.C @ state)
        state = model.A @ state
    return found._replace(
        notes=found.notes & ~abi.NOTE_PREDICTOR_UNSTABLE if stable_predictor else found.notes,
        A=model.A, B=model.B, C=model.C, D=model.D, K=model.K, markov=np.array(markov),
        frequency_hz=now.frequency_hz, damping_ratio=now.damping_ratio, shapes=now.shapes,
        mpc=consistency, emac=emac, cmi=emac * consistency, model_radius=model.radius(),
    )  # fmt: skip


def refined(found: Identified, start: Model, fit: Fit, records: Sequence[Real], names: Sequence[str],
            offset: bool) -> Refined:  # fmt: skip
    """The refined model where it simulates the records (inputs first, detrended) no worse; else the start.

    `offset`: the records are less their means or lines, so that the constants of the outputs are not known exactly.
    """
    reason = "it simulates the record worse"
    for constants in (True, False) if offset else (False,):
        try:
            model, refinement = refine(start, records, offset=constants)
        except Error as fault:
            reason = str(fault).removeprefix("refinement: ")
            break
        better, remarks = _with_best_gain(model, fit, records, names)
        if not _mean(better.simulation_percent) >= _mean(fit.simulation_percent) - SAME_PERCENT:
            continue
        if not refinement.converged:
            text = (
                f"the refinement did not come to an end in {refinement.iterations} steps (log-likelihood "
                f"{refinement.gain:+.1f}, {refinement.decrement:.2g} left): the best model reached is given. Structure "
                "and record do not fit each other well: try another order"
            )
            remarks.append(Remark("refine_unconverged", text))
        stable = any(x is not None for x in better.prediction_percent.values())
        return Refined(_seen(found, model, stable), model, better, refinement, remarks)
    text = f"the model is as identified, the refinement was of no use: {reason}"
    return Refined(found, start, fit, None, [Remark("refine_failed", text)])
