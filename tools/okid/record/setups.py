# SPDX-License-Identifier: MIT
"""Several set-ups of one structure as one result: identified together (PreGER, the host library's work), or merged by
their modes (PoSER)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from okid import abi
from okid._errors import InputError
from okid.abi.arguments import channel_names
from okid.data.records import sides
from okid.identification import host_result
from okid.modal import mac, mpc, normalised
from okid.result.parts import Mode
from okid.result.result import Result

Complex = NDArray[np.complex128]
SAME_FREQUENCY, SAME_SHAPE = 0.03, 0.8  # relative; MAC at the common outputs
WHY = {"few_runs": "fewer than half of the set-ups found it"}


def _common(results: Sequence[Result], references: Sequence[str] | None) -> list[str]:
    shared = [name for name in results[0].shape_places if all(name in one.shape_places for one in results)]
    missing = [name for name in references or () if name not in shared]
    if missing:
        raise InputError(f"references has {missing[0]!r}, which is not an output of every set-up")
    if not shared:
        raise InputError("the set-ups have no output in common: shapes need a reference that stays where it is, with "
                         "the same name in every set-up")  # fmt: skip
    return list(references or shared)


def _entries(mode: Mode, result: Result, names: Sequence[str]) -> Complex:
    return np.array([mode.shape[result.shape_places.index(name)] for name in names], dtype=np.complex128)


def _gathered(results: Sequence[Result], references: Sequence[str]) -> list[dict[int, Mode]]:
    """Modes that are one, at most one of each set-up, ascending in frequency."""
    groups: list[dict[int, Mode]] = []
    for place, result in enumerate(results):
        pairs = []
        for k, mode in enumerate(result.confident_modes):
            for g, group in enumerate(groups):
                first = min(group)
                near = abs(mode.frequency_hz / np.mean([one.frequency_hz for one in group.values()]) - 1.0)
                same = mac(_entries(mode, result, references), _entries(group[first], results[first], references))
                if near < SAME_FREQUENCY and (len(references) < 2 or same > SAME_SHAPE):
                    pairs.append((near + (0.1 * (1.0 - same) if len(references) > 1 else 0.0), k, g))
        taken: dict[int, int] = {}
        for _, k, g in sorted(pairs):
            if k not in taken and g not in taken.values():
                taken[k] = g
        for k, mode in enumerate(result.confident_modes):
            if k in taken:
                groups[taken[k]][place] = mode
            else:
                groups.append({place: mode})
    return sorted(groups, key=lambda group: float(np.mean([one.frequency_hz for one in group.values()])))


def _shape(group: dict[int, Mode], results: Sequence[Result], references: Sequence[str], names: list[str]) -> Complex:
    """Every set-up scaled to the others at the references; outputs of several set-ups are averaged, others NaN."""
    scaled: dict[str, list[complex]] = {}
    first = _entries(group[min(group)], results[min(group)], references)
    for place, mode in group.items():
        own = _entries(mode, results[place], references)
        power = float(np.vdot(own, own).real)
        factor = complex(np.vdot(own, first)) / power if power > 0.0 else 0.0
        for name, value in zip(results[place].shape_places, mode.shape, strict=True):
            scaled.setdefault(name, []).append(factor * value)
    return normalised([complex(np.mean(scaled[name])) if name in scaled else complex(np.nan) for name in names])


def _mode(group: dict[int, Mode], shape: Complex, set_ups: int) -> dict[str, Any]:
    def spread(values: list[float]) -> float | None:
        return float(np.std(values, ddof=1)) if len(values) > 1 else None

    f, z = [one.frequency_hz for one in group.values()], [one.damping_ratio for one in group.values()]
    why = ["few_runs"] if 2 * len(group) < set_ups else []
    emac = [one.emac for one in group.values() if np.isfinite(one.emac)]
    entries = {part: [None if np.isnan(x) else float(x) for x in getattr(shape, kind)]
               for part, kind in (("shape_re", "real"), ("shape_im", "imag"))}  # fmt: skip
    return {
        "frequency_hz": float(np.mean(f)), "damping_ratio": float(np.mean(z)), **entries,
        "frequency_std_hz": spread(f), "damping_ratio_std": spread(z), "shape_re_std": None, "shape_im_std": None,
        "mpc": mpc(shape), "emac": float(np.median(emac)) if emac else None, "cmi": None,
        "confident": not why, "found_in": len(group) / set_ups, "why": why, "why_text": [WHY[one] for one in why],
    }  # fmt: skip


def _states(modes: Sequence[dict[str, Any]], dt: float) -> tuple[list[list[float]], list[list[float]]]:
    """A and C of the modes; a missing entry of a shape counts 0."""
    n, n_y = len(modes), len(modes[0]["shape_re"])
    A, C = np.zeros((2 * n, 2 * n)), np.zeros((n_y, 2 * n))
    for k, mode in enumerate(modes):
        w, zeta = 2.0 * np.pi * mode["frequency_hz"], mode["damping_ratio"]
        mu = np.exp(complex(-zeta * w, w * np.sqrt(1.0 - zeta**2)) * dt)
        A[2 * k : 2 * k + 2, 2 * k : 2 * k + 2] = [[mu.real, mu.imag], [-mu.imag, mu.real]]
        C[:, 2 * k] = [x or 0.0 for x in mode["shape_re"]]
        C[:, 2 * k + 1] = [x or 0.0 for x in mode["shape_im"]]
    return A.tolist(), C.tolist()


def identify_setups(
    u: Sequence[ArrayLike] | None,
    y: Sequence[ArrayLike],
    *,
    fs: float,
    output_names: Sequence[Sequence[str]],
    references: Sequence[str] | None = None,
    input_names: Sequence[str] | None = None,
    band: tuple[float, float] | None = None,
    modes: Sequence[int] | None = None,
    detrend: str = "mean",
    sigma: str | None = None,
) -> Result:
    """Identify several set-ups of one structure together, from their correlations (PreGER): one set of modes.

    `y`: of each set-up (N, n_y), with `output_names` of each; one name is one sensor that stays where it is.
    `references`: those that scale the shapes (default: all that every set-up has). `u` None: ambient, which may excite
    every set-up another way. With `u` (N, n_u) of each set-up, forces at the same places, no reference is needed.
    `band` (low, high) in Hz; `modes` numbers of the listed modes that are kept; `detrend` "none", "mean" or "linear".

    Frequencies and damping are those of all set-ups, *_std the scatter between them, each fitted alone from the common
    poles (sigma="none": not computed). Method "plscf". Inputs, B and D are left out.

    Raises InputError (a wrong argument) or IdentificationError (no reliable mode).

    >>> import okid
    >>> _, y = okid.demo_record()
    >>> found = okid.identify_setups(None, [y[:, [0, 1]], y[:, [0, 2]]], fs=1000.0, output_names=["ab", "ac"])
    >>> found.outputs, [f"{mode.frequency_hz:.0f}" for mode in found.confident_modes]
    (['a', 'b', 'c'], ['11', '32', '46'])
    """
    if len(y) < 2 or len(output_names) != len(y) or (u is not None and len(u) != len(y)):
        told = "" if u is None else f", {len(u)} in u"
        raise InputError(
            f"{len(y)} set-ups in y, {len(output_names)} lists in output_names{told}, expected two or more"
        )
    inputs, outputs = [], []
    for k, one in enumerate(y):
        (drive,), (response,) = sides(None if u is None else [np.asarray(u[k])], [np.asarray(one)], host_result.TYPES)
        if response.shape[1] != len(output_names[k]):
            raise InputError(
                f"output_names[{k}] has {len(output_names[k])} names for {response.shape[1]} columns of y[{k}]"
            )
        inputs.append(drive)
        outputs.append(response)
    options = {
        "inputs": channel_names(input_names, None, "u", inputs[0].shape[1]),
        "outputs": [name for names in output_names for name in names],
        "references": None if references is None else list(references), "fs": fs, "modes": modes, "detrend": detrend,
        "band": None if band is None else ":".join(map(str, band)), "sigma": sigma,
    }  # fmt: skip
    return Result.of_host(host_result.identify_set_ups(options, inputs, outputs))


def merge_setups(results: Sequence[Result], *, references: Sequence[str] | None = None) -> Result:
    """The modes of several set-ups with some sensors in common as one result: PoSER merging.

    Outputs with one name in all set-ups are the references (or those named in `references`). Confident modes are one
    where they lie within 3 % and, with two references or more, agree in shape there (MAC above 0.8); each set-up's
    shape is scaled to the first one's at the references. frequency_hz and damping_ratio are means over the set-ups,
    their _std the scatter between set-ups (not the error of the mean), found_in the share of the set-ups; an output
    that only a set-up without this mode has is NaN. Inputs, B and D are left out: the forces of the set-ups are not
    those of one test. InputError when there is no common output or fewer than two results.

    >>> import okid
    >>> force, y = okid.demo_record()
    >>> parts = [okid.identify(force, y[:, two], fs=1000.0, output_names=names)
    ...          for two, names in (([0, 1], ["a", "b"]), ([0, 2], ["a", "c"]))]
    >>> merged = okid.merge_setups(parts)
    >>> merged.outputs, [f"{mode.frequency_hz:.1f}" for mode in merged.modes]
    (['a', 'b', 'c'], ['11.0', '31.8', '45.7'])
    """
    if len(results) < 2:
        raise InputError(f"{len(results)} results to merge, expected at least two set-ups")
    common = _common(results, references)
    names = list(dict.fromkeys(name for one in results for name in one.shape_places))
    modes = [_mode(group, _shape(group, results, common, names), len(results)) for group in _gathered(results, common)]
    if not modes:
        raise InputError("no set-up has a confident mode: there is nothing to merge")
    fs = max(one.fs_hz for one in results)
    A, C = _states(modes, 1.0 / fs)
    n_z, n_y = len(A), len(names)
    warnings = {(w.code, f"set-up {k}: {w.text}") for k, one in enumerate(results, 1) for w in one.warnings}
    return Result.from_dict({
        "schema": "okid.result/1", "version": abi.library().okid_version().decode(), "method": "poser", "fs_hz": fs,
        "samples": sum(one.samples for one in results), "records": len(results), "gaps": sum(r.gaps for r in results),
        "inputs": [], "outputs": names, "p": None, "rows": None, "hankel": None, "order": n_z,
        "hold": results[0].hold, "detrend": results[0].detrend, "start": results[0].start, "singular_values": None,
        "singular_noise": None,
        "model": {"dt": 1.0 / fs, "A": A, "B": [[] for _ in A], "C": C, "D": [[] for _ in names],
                  "K": np.zeros((n_z, n_y)).tolist(), "x0": None},
        "markov": {"Y": []}, "modes": modes, "fit": {"simulation_percent": None, "prediction_percent": None},
        "warnings": [{"code": code, "text": text} for code, text in sorted(warnings)],
    })  # fmt: skip
