# SPDX-License-Identifier: MIT
"""An okid.result/1 as the report needs it: checked once, so that no picture meets a surprise."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from okid._errors import InputError
from okid.report.other_kinds import MADE_BY, check_kind
from okid.report.result_keys import check_keys
from okid.result.left_out import without_left_out
from okid.result.model import Model
from okid.result.result_file import read_result

Real = NDArray[np.float64]
Complex = NDArray[np.complex128]
LEAST_EMAC = 0.5


@dataclass
class Loaded:
    """The parts of a result file as arrays: shapes (modes, places), singular_values (s,), markov (count, n_y, n_u).

    Of method "auto" there are no singular values. Outputs that were left out (warning "screened") are in `left_out` and
    in `whole`, the result as it came, alone.
    """

    raw: dict[str, Any]
    matrices: dict[str, Real]
    shapes: Complex
    frequency_hz: Real
    singular_values: Real
    markov: Real
    left_out: list[str]
    whole: dict[str, Any]

    @property
    def confident(self) -> list[int]:
        """Which modes, from 0, an expert would sign: as the result says, of one before release 0.2 by EMAC."""
        return [k for k, mode in enumerate(self.raw["modes"]) if mode.get("confident", _consistent(mode))]

    @property
    def fs(self) -> float:
        """Sample rate, Hz."""
        return float(self.raw["fs_hz"])

    @property
    def inputs(self) -> list[str]:
        """Names of the forces; none = ambient."""
        return list(self.raw["inputs"])

    @property
    def outputs(self) -> list[str]:
        """Names of the responses."""
        return list(self.raw["outputs"])

    @property
    def places(self) -> list[str]:
        """Names of the entries of a shape: the outputs, or the degrees of freedom of a roving hammer."""
        return _places(self.raw)

    @property
    def shown_hz(self) -> float:
        """Upper end of the frequency axes: Nyquist, or well above the highest mode when the modes are all low."""
        highest = 2.0 * float(np.max(self.frequency_hz, initial=0.0))
        return min(self.fs / 2.0, highest) if highest > 0.0 else self.fs / 2.0

    def model(self) -> tuple[Model, bool]:
        """The model, and whether it has a stable predictor; without one its K is zero."""
        m = self.matrices
        n_z, n_y = len(m["A"]), len(m["C"])
        rows = self.raw["model"].get("K") or []
        fits = len(rows) == n_z and all(len(row) == n_y for row in rows)
        gain = np.array(rows if fits else [], dtype=np.float64)
        usable = gain.shape == (n_z, n_y) and bool(np.all(np.isfinite(gain)))
        usable = usable and float(np.max(np.abs(np.linalg.eigvals(m["A"] - gain @ m["C"])))) < 1.0
        return Model(m["A"], m["B"], m["C"], m["D"], gain if usable else np.zeros((n_z, n_y)), 1.0 / self.fs), usable


def _places(raw: dict[str, Any]) -> list[str]:
    """What the entries of a shape belong to: degrees of freedom (a roving hammer), else the outputs."""
    return [str(dof) for dof in raw.get("shape_dofs") or raw["outputs"]]


def _consistent(mode: dict[str, Any]) -> bool:
    return mode.get("emac") is None or float(mode["emac"]) >= LEAST_EMAC


def load_result(path: str | Path) -> Loaded:
    """Read and check an okid.result/1 file. InputError names file and key, and what the file is when it is none."""
    check_kind(path, "result")
    try:
        raw = read_result(path)
    except InputError as fault:
        text = str(fault)
        if ": not JSON" in text and ":1:1:" not in text:
            text += " (cut off, or edited?)"
        if "expected" not in text:
            text += "; expected an okid.result/1"
        raise InputError(f"{text}, {MADE_BY}") from None
    return loaded_from(raw, str(path))


def loaded_from(raw: Any, source: str) -> Loaded:
    """An okid.result/1 that is already parsed. InputError names `source` and the key."""
    check_keys(raw, source)
    whole, (raw, left) = raw, without_left_out(raw)
    n_y, n_u = len(raw["outputs"]), len(raw["inputs"])
    model = _matrices(raw, source)
    shapes = np.array(
        [np.array(m["shape_re"], float) + 1j * np.array(m["shape_im"], float) for m in raw["modes"]], np.complex128
    ).reshape(len(raw["modes"]), len(_places(raw)))
    frequency = np.array([float(m["frequency_hz"]) for m in raw["modes"]], dtype=np.float64)
    values = np.array(raw["singular_values"] or [], dtype=np.float64)
    return Loaded(raw, model, shapes, frequency, values, _markov(raw, n_y, n_u, source), left, whole)


def _matrices(raw: dict[str, Any], source: str) -> dict[str, Real]:
    n_y, n_u, n_z = len(raw["outputs"]), len(raw["inputs"]), len(raw["model"]["A"])
    model = {}
    for name, shape in (("A", (n_z, n_z)), ("B", (n_z, n_u)), ("C", (n_y, n_z)), ("D", (n_y, n_u))):
        if n_u == 0 and name in "BD":
            model[name] = np.zeros(shape)
            continue
        rows = raw["model"][name]
        found = (len(rows), *sorted({len(row) for row in rows}))
        if found != shape:
            raise InputError(f"{source}: model.{name} has shape {found}, expected {shape}")
        model[name] = np.array(rows, dtype=np.float64)
    return model


def _markov(raw: dict[str, Any], n_y: int, n_u: int, source: str) -> Real:
    """Markov parameters (count, n_y, n_u); none without inputs."""
    given = ((raw.get("markov") or {}).get("Y") or []) if n_u else []
    try:
        markov = np.array(given, dtype=np.float64)
    except (TypeError, ValueError, ArithmeticError):
        markov = np.zeros(0)
    if given and markov.shape[1:] != (n_y, n_u):
        raise InputError(f"{source}: markov.Y is {given!r:.60}, expected matrices of {n_y} rows of {n_u} numbers")
    return markov.reshape(len(given), n_y, n_u)


def known_fit(raw: dict[str, Any], key: str) -> list[float | None]:
    """The fits of the result in the order of its outputs."""
    values = (raw.get("fit") or {}).get(key) or {}
    return [values.get(name) for name in raw["outputs"]]
