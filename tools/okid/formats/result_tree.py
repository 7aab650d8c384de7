# SPDX-License-Identifier: MIT
"""An identified model as named arrays, the form in which .mat and HDF5 hold it."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from okid._errors import InputError
from okid.result.parts import MODE_NUMBERS
from okid.result.result import Result
from okid.result.result_file import read_result


def result_dict(result: Result | Mapping[str, Any]) -> dict[str, Any]:
    """The okid.result/1 dictionary of a Result; a dictionary is checked. InputError names what is wrong with it."""
    raw = result.to_dict() if isinstance(result, Result) else dict(result)
    if raw.get("schema") != "okid.result/1":
        raise InputError(f"schema is {raw.get('schema')!r}, expected 'okid.result/1'")
    missing = [key for key in ("fs_hz", "inputs", "outputs", "model", "modes") if key not in raw]
    if missing:
        raise InputError(f"key {missing[0]!r} is missing in the okid.result/1")
    return raw


def load_result(path: str | Path) -> dict[str, Any]:
    """Read an okid.result/1 file. InputError of one line names file and key, or line and column."""
    raw = read_result(path)
    try:
        return result_dict(raw)
    except InputError as fault:
        raise InputError(f"{path}: {fault}") from None


def _array(value: Any) -> Any:
    """Numbers as float64 arrays with NaN for a missing one; texts and mixed things stay."""
    try:
        return np.array(value, dtype=np.float64) if value is not None else np.empty(0)
    except (TypeError, ValueError):
        return value


def _matrices(part: Mapping[str, Any] | None) -> dict[str, Any]:
    """The numeric entries of a part of the result, one level deep."""
    found = {key: _array(value) for key, value in (part or {}).items() if not isinstance(value, dict | str | bool)}
    return {key: value for key, value in found.items() if isinstance(value, np.ndarray) and value.dtype.kind == "f"}


def mode_arrays(raw: Mapping[str, Any]) -> dict[str, Any]:
    """The numbers of MODE_NUMBERS (n,), confident as 1 or 0, NaN for what is not known; shapes (outputs or shape_dofs,
    n)."""
    modes = raw["modes"]
    out: dict[str, Any] = {key: np.array([_float(mode.get(key)) for mode in modes]) for key in MODE_NUMBERS}
    shapes = [np.array(mode["shape_re"], float) + 1j * np.array(mode["shape_im"], float) for mode in modes]
    out["shapes"] = np.array(shapes, np.complex128).reshape(len(modes), -1 if modes else 0).T
    return out


def _float(value: Any) -> float:
    return float("nan") if value is None else float(value)


def result_tree(raw: Mapping[str, Any]) -> dict[str, Any]:
    """{"model": {A, B, C, D, K, dt, x0}, "modes": .., "mkr": .., "pdc": .., "singular_values", "markov", "json"}.

    mkr and pdc only when the result has them. json: the whole okid.result/1 as text, so that nothing is lost.
    InputError when the result is not complete.
    """
    try:
        tree: dict[str, Any] = {
            "fs_hz": float(raw["fs_hz"]),
            "inputs": [str(name) for name in raw["inputs"]],
            "outputs": [str(name) for name in raw["outputs"]],
            "model": {**{name: _array(raw["model"].get(name)) for name in ("A", "B", "C", "D", "K", "x0")},
                      "dt": float(raw["model"]["dt"])},
            "modes": mode_arrays(raw),
            "singular_values": _array(raw.get("singular_values")),
            "markov": _array((raw.get("markov") or {}).get("Y")),
            **{key: _matrices(raw[key]) for key in ("mkr", "pdc") if raw.get(key)},
            "json": json.dumps(raw, allow_nan=False),
        }  # fmt: skip
    except (KeyError, TypeError, ValueError, AttributeError, ArithmeticError) as fault:
        raise InputError(f"not a complete okid.result/1: {type(fault).__name__}: {fault}") from None
    return tree
