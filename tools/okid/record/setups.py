# SPDX-License-Identifier: MIT
"""Several set-ups of one structure as one result: each by itself and merged by modes (PoSER), or all together from
their correlations (PreGER); the host library's work."""

from __future__ import annotations

import ctypes
import warnings
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from okid._errors import InputError
from okid.abi import host
from okid.abi.arguments import channel_names
from okid.data.records import sides
from okid.identification import host_result
from okid.result.comparison import text_and_name
from okid.result.result import Result

_said: list[str] = []  # old names for which a replacement was named already


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
    method: str = "auto",
    input_dofs: Sequence[int] | None = None,
    output_dofs: Sequence[int] | None = None,
) -> Result:
    """Identify several set-ups of one structure: one set of modes, shapes over the sensors of all.

    `y`: of each set-up (N, n_y), with `output_names` of each; one name is one sensor that stays where it is. Set-ups
    with the same names are records of one set-up. `references`: the outputs that scale the shapes (default: all that
    every set-up has). `u` None: ambient, which may excite every set-up another way. With `u` (N, n_u) of each set-up,
    forces at the same places, no reference is needed; hits of one force are identified together, by reciprocity.
    `method`: "auto" or a named one identifies each set-up by itself and merges the modes (PoSER): frequency and damping
    are means weighted by their variances, *_std that of the mean, wider where set-ups contradict; `found_in` is the
    share of set-ups. "plscf" fits all set-ups together from their correlations (PreGER), *_std is the scatter between
    them; then `modes` are numbers of the listed modes that are kept.
    `band` (low, high) in Hz; `detrend` "none", "mean" or "linear"; sigma="none": no *_std. `input_dofs`, `output_dofs`
    (one number for each of the inputs, and for each output once, in the order in which they appear): shapes stand at
    these degrees of freedom, with `modal_mass` where a force and a sensor share one. Inputs, B and D are left out.

    Raises InputError (a wrong argument) or IdentificationError (no reliable mode).

    >>> import okid
    >>> _, y = okid.demo_record()
    >>> found = okid.identify_setups(None, [y[:, [0, 1]], y[:, [0, 2]]], fs=1000.0, output_names=["ab", "ac"])
    >>> found.outputs, [f"{mode.frequency_hz:.0f}" for mode in found.confident_modes]
    (['a', 'b', 'c'], ['11', '32', '46'])
    """
    if len(y) < 2 or len(output_names) != len(y) or (u is not None and len(u) != len(y)):
        forces = "" if u is None else f", {len(u)} in u"
        raise InputError(
            f"{len(y)} set-ups in y, {len(output_names)} lists in output_names{forces}, expected two or more"
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
        "band": None if band is None else ":".join(map(str, band)), "sigma": sigma, "method": method,
        "input_dofs": input_dofs, "output_dofs": output_dofs,
    }  # fmt: skip
    return Result.of_host(host_result.identify_set_ups(options, inputs, outputs))


def merge(
    results: Sequence[Result | Mapping[str, Any] | str | Path], *, references: Sequence[str] | None = None
) -> Result:
    """The modes of several set-ups with some sensors in common as one result, method "poser"; the same as `okid merge`.

    `results`: of each set-up a Result, its to_dict() or the name of its file. Outputs with one name in all of them are
    the references (or those named in `references`). Confident modes are one where the MAC there is 0.8 or more within
    10 % of frequency, or 0.5 within 1 %, or the frequencies agree within three standard deviations (with one reference:
    within 3 % of frequency); each shape is brought to one scale there. frequency_hz and damping_ratio are means with
    the weight 1/std², their _std those of the mean, widened where the set-ups scatter more; found_in the share of the
    set-ups; an output that only a set-up without this mode has is NaN. Inputs, B and D are left out. Raises InputError.

    >>> import okid
    >>> force, y = okid.demo_record()
    >>> parts = [okid.identify(force, y[:, two], fs=1000.0, output_names=names)
    ...          for two, names in (([0, 1], ["a", "b"]), ([0, 2], ["a", "c"]))]
    >>> merged = okid.merge(parts)
    >>> merged.outputs, [f"{mode.frequency_hz:.1f}" for mode in merged.confident_modes]
    (['a', 'b', 'c'], ['11.0', '31.8', '45.7'])
    """
    known = [text_and_name(one, f"result {k}") for k, one in enumerate(results, 1)]
    texts, names = ((ctypes.c_char_p * len(known))(*side) for side in zip(*known, strict=True)) if known else ((), ())
    wanted, handle = "\n".join(references or ()), ctypes.c_void_p()
    host.call("merge", texts or None, names or None, len(known), wanted.encode(), ctypes.byref(handle))
    return Result.of_host(host_result.HostResult(handle))


def merge_setups(results: Sequence[Result], *, references: Sequence[str] | None = None) -> Result:
    """The name of merge() in release 0.1."""
    if not _said:
        _said.append("merge_setups")
        warnings.warn("okid.merge_setups() is okid.merge() now", FutureWarning, stacklevel=2)
    return merge(results, references=references)
