# SPDX-License-Identifier: MIT
"""okid.identify_frf: measured frequency responses in, a model with its modes out. The work is the host library's."""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from okid._errors import InputError

if TYPE_CHECKING:
    from okid.frf import Frf
    from okid.result.result import Result


def identify_frf(
    responses: Frf | str | Path | Sequence[str | Path],
    *,
    band: tuple[float, float] | None = None,
    sensing: str | Sequence[str] | None = None,
    input_dofs: Sequence[int] | None = None,
    output_dofs: Sequence[int] | None = None,
    modes: Sequence[int] | None = None,
    all_modes: bool = False,
    exponential: float | None = None,
    stabilization: bool = False,
) -> Result:
    """Identify a structure from measured frequency responses: pLSCF over many orders, residues by LSFD.

    `responses`: an okid.frf.Frf (of okid.read_frf(), okid.frf.h1() or Frf.of(frequency_hz, response)), or files, read
    by okid.read_frf(). Several set-ups of one structure are one set of responses. `band` (low, high) in Hz; `sensing`:
    by default what the files say, else acceleration; `input_dofs`, `output_dofs`, `modes`: as in okid.identify().
    `exponential`: time constant in s of an exponential window in the responses; its damping is taken out of the modes.
    `stabilization`: keep the poles of all orders, for result.stabilization().

    The result is one as of okid.identify(): method "plscf", mode.confident, .found_in and .why by the agreement of six
    fits, deviations by what the fit leaves, emac NaN. With more inputs than outputs (a roving hammer) both are
    exchanged by reciprocity: the shapes have an entry for every place that was struck (remark "reciprocity").

    Raises InputError (a wrong argument) or IdentificationError (no reliable mode).

    >>> import okid
    >>> force, acceleration = okid.demo_record()
    >>> result = okid.identify_frf(okid.frf.h1(force, acceleration, 1000.0, nperseg=8192), band=(5.0, 80.0))
    >>> [f"{mode.frequency_hz:.1f} Hz" for mode in result.confident_modes]
    ['11.0 Hz', '31.8 Hz', '45.7 Hz']
    """
    import numpy as np

    from okid.abi import host
    from okid.frf import Frf
    from okid.identification.host_result import HostResult, options_text
    from okid.result.result import Result

    if not isinstance(responses, Frf):
        from okid.formats.frf_file import read_frf

        paths = [responses] if isinstance(responses, str | Path) else list(responses)
        if not paths:
            raise InputError("no file of responses was given")
        responses = read_frf(*paths)
    f, h = (np.asarray(responses.frequency_hz, dtype=np.float64), np.asarray(responses.response, dtype=np.complex128))
    inputs, outputs = responses.names()
    options = {
        "inputs": inputs, "outputs": outputs, "sensing": sensing, "input_dofs": input_dofs, "output_dofs": output_dofs,
        "band": None if band is None else ":".join(map(str, band)), "modes": modes, "all_modes": all_modes,
        "exponential": exponential, "set_ups": responses.set_ups, "stabilization": stabilization,
        "quantity": responses.quantity or None, "other_units": list(responses.other_units) or None,
    }  # fmt: skip
    handle, rows = ctypes.c_void_p(), np.ascontiguousarray(h.transpose(0, 2, 1))
    f = np.ascontiguousarray(f)
    arrays = len(f), f.ctypes.data, rows.ctypes.data
    host.call("identify_responses", options_text(options), *arrays, ctypes.byref(handle))
    return Result.of_host(HostResult(handle))
