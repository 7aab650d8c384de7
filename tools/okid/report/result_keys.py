# SPDX-License-Identifier: MIT
"""The keys of an okid.result/1 and what each must hold: a damaged value is named before anything is made of it."""

from __future__ import annotations

import math
from typing import Any

from okid._errors import InputError
from okid.result.parts import MODE_NUMBERS

NEEDED = (
    "fs_hz", "samples", "inputs", "outputs", "p", "rows", "order", "singular_values", "model", "modes", "warnings",
)  # fmt: skip
# Key -> kind; "?" behind a kind: null and absent are fine too.
_TOP = {
    "fs_hz": "rate", "samples": "count", "records": "count?", "gaps": "count?", "inputs": "names", "outputs": "names",
    "judged_samples": "count?", "p": "count?", "rows": "count?", "order": "count", "method": "text?", "hold": "text?",
    "shape_dofs": "numbers?", "hits": "objects?", "input_dofs": "numbers?", "output_dofs": "numbers?",
    "set_ups": "objects?", "agreement": "object?",
    "detrend": "text?", "start": "text?", "version": "text?", "singular_values": "numbers?", "model": "object",
    "markov": "object?", "modes": "objects", "fit": "object?", "mkr": "object?", "pdc": "object?", "warnings": "list",
}  # fmt: skip
_MODEL = {"dt": "rate", "A": "matrix", "B": "matrix", "C": "loose matrix", "D": "loose matrix", "K": "loose matrix?"}
_MODE = dict.fromkeys(MODE_NUMBERS, "number?") | {
    "frequency_hz": "number", "damping_ratio": "number", "shape_re": "maybe", "shape_im": "maybe",
    "why": "list?", "why_text": "list?", "confident": "flag?",
}  # fmt: skip
_HIT = {
    "file": "text", "place": "number", "accepted": "flag", "reason": "text?", "text": "text?", "peak": "number?",
    "duration_s": "number?", "band_hz": "number?", "range": "numbers?",
}  # fmt: skip
_SET_UP = {"name": "text", "outputs": "names"}
_FIT = {"simulation_percent": "by name?", "prediction_percent": "by name?"}
_MKR = {
    "checks": "object", **{name: "loose matrix" for name in ("M", "K", "R", "R_normal_modes")},  # null: not determined
    **{f"{name}_std": "loose matrix?" for name in ("M", "K", "R", "R_normal_modes")},
}  # fmt: skip
_PDC = {"alpha": "number", "beta": "number", "R": "loose matrix", "alpha_std": "number?", "beta_std": "number?"}
_AGREEMENT = {"runs": "objects", "poles": "object"}
_RUN = {"method": "text", "fs_hz": "rate", "rows": "count"}
_POLES = dict.fromkeys(("run", "order", "frequency_hz", "damping_ratio", "mpc", "mode"), "numbers")
_CHECKS = {
    "m_positive_definite": "flag?", "k_positive_definite": "flag?", "r_positive_definite": "flag?",
    "ww_residual": "number?", "feedthrough_misfit": "number?", "feedthrough_gain": "number?",
    "selection_margin": "number?", "eigenvector_condition": "number?", "modes_used": "list?",
}  # fmt: skip
_WORDS = {
    "rate": "a number above 0", "count": "a whole number from 0 on", "number": "a number", "text": "text",
    "flag": "true or false", "names": "a list of names", "numbers": "a list of numbers",
    "maybe": "a list of numbers or null", "list": "a list",
    "matrix": "a list of rows of finite numbers", "loose matrix": "a list of rows of numbers or null",
    "object": "an object", "objects": "a list of objects", "by name": "an object of numbers by output",
}  # fmt: skip


def _number(value: Any) -> bool:
    try:
        return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)
    except OverflowError:  # a whole number beyond 1e308
        return False


def _all(value: Any, kind: str) -> bool:
    return isinstance(value, list) and all(_holds(one, kind) for one in value)


def _holds(value: Any, kind: str) -> bool:
    """Is the value of this kind?"""
    if kind.endswith("?"):
        return value is None or _holds(value, kind[:-1])
    simple = {"text": str, "flag": bool, "list": list, "object": dict}
    if kind in simple:
        return isinstance(value, simple[kind])
    if kind == "rate":
        return _number(value) and value > 0
    if kind == "count":
        return _number(value) and value >= 0 and float(value).is_integer()
    if kind == "by name":
        return isinstance(value, dict) and all(one is None or _number(one) for one in value.values())
    inner = {"names": "text", "numbers": "number", "objects": "object", "matrix": "numbers", "maybe": "number?"}
    inner["loose matrix"] = "maybe"
    return _all(value, inner[kind]) if kind in inner else _number(value)


def _check(given: dict[str, Any], kinds: dict[str, str], where: str, source: str) -> None:
    for key, kind in kinds.items():
        value = given.get(key)
        if key not in given and not kind.endswith("?"):
            raise InputError(f"{source}: key {where + key!r} is missing, expected {_WORDS[kind]}")
        if not _holds(value, kind):
            raise InputError(f"{source}: {where}{key} is {value!r:.60}, expected {_WORDS[kind.rstrip('?')]}")


def _check_agreement(given: dict[str, Any], source: str) -> None:
    """Poles of all runs: columns of one length, each in one of the runs."""
    _check(given, _AGREEMENT, "agreement.", source)
    for number, run in enumerate(given["runs"]):
        _check(run, _RUN, f"agreement.runs[{number}].", source)
    poles, runs = given["poles"], len(given["runs"])
    _check(poles, _POLES, "agreement.poles.", source)
    for key in _POLES:
        if len(poles[key]) != len(poles["run"]):
            text = f"has {len(poles[key])} numbers, expected {len(poles['run'])}, one for each pole"
            raise InputError(f"{source}: agreement.poles.{key} {text}")
    wrong = next((one for one in poles["run"] if one not in range(runs)), None)
    if wrong is not None:
        raise InputError(f"{source}: agreement.poles.run has {wrong!r:.60}, expected a place in runs, from 0")


def check_keys(raw: Any, source: str) -> None:
    """InputError names `source`, the key, what was found and what was expected. Keys that are not known are free."""
    schema = raw.get("schema") if isinstance(raw, dict) else None
    if schema != "okid.result/1":
        raise InputError(f"{source}: schema is {schema!r:.60}, expected 'okid.result/1'")
    missing = [key for key in NEEDED if key not in raw]
    if missing:
        raise InputError(f"{source}: key {missing[0]!r} is missing")
    _check(raw, _TOP, "", source)
    if not raw["outputs"] or raw["singular_values"] == []:
        empty = "singular_values" if raw["outputs"] else "outputs"
        raise InputError(f"{source}: {empty} is [], expected at least one")
    model = dict(raw["model"])
    if not raw["inputs"]:  # of an ambient result: empty or null
        model.update(B=[], D=[])
    _check(model, _MODEL, "model.", source)
    for number, mode in enumerate(raw["modes"]):
        _check(mode, _MODE, f"modes[{number}].", source)
        for key in ("shape_re", "shape_im"):
            places = raw.get("shape_dofs") or raw["outputs"]
            if len(mode[key]) != len(places):
                whose = "a place of shape_dofs" if raw.get("shape_dofs") else "an output"
                text = f"has {len(mode[key])} numbers, expected {len(places)}, one {whose}"
                raise InputError(f"{source}: modes[{number}].{key} {text}")
        if mode["frequency_hz"] <= 0:
            raise InputError(f"{source}: modes[{number}].frequency_hz is {mode['frequency_hz']!r}, expected Hz above 0")
    for key, kinds in (("hits", _HIT), ("set_ups", _SET_UP)):
        for number, one in enumerate(raw.get(key) or []):
            _check(one, kinds, f"{key}[{number}].", source)
    for key, of in (("input_dofs", "inputs"), ("output_dofs", "outputs")):
        if raw.get(key) and len(raw[key]) != len(raw[of]):
            raise InputError(
                f"{source}: {key} has {len(raw[key])} numbers, expected {len(raw[of])}, one for each of {of}"
            )
    _check(raw.get("fit") or {}, _FIT, "fit.", source)
    if raw.get("agreement") is not None:
        _check_agreement(raw["agreement"], source)
    if raw.get("mkr") and raw.get("pdc"):
        _check(raw["mkr"], _MKR, "mkr.", source)
        _check(raw["mkr"]["checks"], _CHECKS, "mkr.checks.", source)
        _check(raw["pdc"], _PDC, "pdc.", source)
