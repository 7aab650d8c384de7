# SPDX-License-Identifier: MIT
"""okid.identify: measured inputs and outputs in, a model with its modes out. The work is the host library's."""

from __future__ import annotations

import sys
from collections.abc import Iterable, Sequence
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from okid._errors import InputError

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from okid.result.result import Result
    from okid.result.stabilization import Criteria, Stabilization


@lru_cache(maxsize=1)
def _rooms() -> tuple[Any, ...]:
    """What identify() works with, brought in by its first call: `import okid` stays short."""
    from okid.abi.arguments import channel_names
    from okid.data.records import sides
    from okid.identification import host_result
    from okid.result.result import Result

    return channel_names, sides, host_result, Result.of_host


def _picks_text(picks: Sequence[float] | str | Path | None) -> str | None:
    """As --picks has it."""
    try:
        text = str(picks) if isinstance(picks, str | Path) else ",".join(map(repr, map(float, picks or ()))) or ","
    except (TypeError, ValueError, OverflowError):
        text = "\0"
    if "\0" in text:
        raise InputError(f"picks is {picks!r:.80}, expected frequencies in Hz or the name of a .json file")
    return None if picks is None else text


def identify(
    u: ArrayLike | Sequence[ArrayLike] | None,
    y: ArrayLike | Sequence[ArrayLike],
    *,
    fs: float,
    method: str | None = None,
    p: int | None = None,
    rows: int | None = None,
    order: int | str = "auto",
    max_order: int | None = None,
    hankel: str = "system",
    detrend: str = "mean",
    hold: str | None = None,
    start: str = "moving",
    input_names: Sequence[str] | None = None,
    output_names: Sequence[str] | None = None,
    input_dofs: Sequence[int] | None = None,
    output_dofs: Sequence[int] | None = None,
    sensing: str | Sequence[str] = "acceleration",
    refine: bool | str | None = None,
    sigma: str | None = None,
    sigma_blocks: int | None = None,
    units: Sequence[str] | None = None,
    band: tuple[float, float] | None = None,
    decimate: int | None = None,
    modes: Sequence[int] | None = None,
    picks: Sequence[float] | str | Path | None = None,
    stabilization: bool = False,
    hit_dofs: Sequence[int] | None = None,
    keep_all: bool = False,
    threads: int | None = None,
) -> Result:
    """Identify a structure from measured inputs and outputs.

    u (N, n_u) or (N,), y (N, n_y) or (N,) at `fs` Hz, or lists of such arrays: several records, merged exactly, each
    centred by itself. float64, float32, int16 and int32 are read where they stand, with any strides. Frames of pandas
    give the channels their names. NaN (or masked) = missing sample: the regression leaves it out and re-arms, nothing
    is interpolated; the fits and model.x0 are those of the record less its own mean (or line) and start again after
    missing inputs. The arrays are never modified.
    `method` "auto": the modes that several methods, horizons and rates agree on, each with mode.confident, .found_in
    and .why (docs/how-okid-decides.md); the doubtful ones are listed with them. Or one method: "okid-era",
    "okid-era-dc", "n4sid-moesp", "n4sid-cva", "n4sid-ssarx", or "plscf": modes from correlations through
    frequency responses, no M, K, R. Default: "auto"; "okid-era" when an option of one method is given (p, rows, order,
    max_order, hankel, refine=True).
    u None = no measured force (ambient): modes and predictor only, there is no simulation fit; the okid methods then
    realize the covariances of the outputs.
    `p` ARX horizon of the okid methods (default 40), reduced with a warning when there are fewer than 10 samples an
    unknown; `rows` block rows of the Hankel matrices (default 2 p, n4sid 30, okid without u p, or what the record
    bears); `order` a number or "auto" (up to `max_order`); `hankel` what the Hankel matrix of the okid methods holds:
    "system" Markov parameters, those of the "innovations" too (weighted, free of units), or "literal" eq. 42 (warns);
    `detrend` "none", "mean" or "linear"; `hold` "zoh", "foh", "band" (band-limited) or "auto": how the force behaved
    between samples; default "auto" of method "auto", else "zoh".
    `start` "rest" says that every record begins just before the structure is struck: the silent past is then used
    (paper eq. 38), without it the hit itself would be lost with the first p samples. "moving" assumes nothing.

    `input_dofs`, `output_dofs`: the degree of freedom of each channel, from 1 (-3: at 3 with reversed polarity), turn
    on result.mkr and result.pdc; `sensing` "acceleration", "velocity", "displacement", or one for each output. The
    numbers are then taken as N, m/s^2, m/s, m, unless a name says otherwise ("acc1 [g]", "acc1_g") or `units` does
    (one a channel, inputs first). Every degree of freedom needs a force or a sensor, one needs both.

    `refine` True ("yes"): improve the model by maximum likelihood, with noise at the sensors to the Cramér-Rao bound
    (result.refinement; a warning refine_failed when it was rejected). Needs u. Of a named method with degrees of
    freedom also the delay of every output (result.skew), which is taken out of M, K and R. "auto", the default of
    method "auto": where the residuals are nearly white and all modes keep their identity. "no" (False): not.

    `sigma`: standard deviations, "analytic" (default: the derivative of the method along each of `sigma_blocks` blocks
    of the record, 8 to 100, default 20), "jackknife" (identified again without each block, 3 to 20 identifications;
    also where a method has no derivative: docs/numerics.md) or "none". `sigma_blocks` alone: jackknife, 0 = none.

    Of "auto" and "plscf": `band` (low, high) in Hz where modes are sought; `modes` the numbers, from 1, of the listed
    modes that are kept: picked by hand they count as confident. Of "auto": `picks` the same by frequencies in Hz or a
    .json file with modes (those that stand nearest); `stabilization` the poles of all runs
    (to_dict()["agreement"]); `decimate` the largest factor of the lower rates; `threads` the processors used (default
    all; the result is the same for any number).

    `hit_dofs`: where each record was struck (roving hammer), one number a record: each place becomes an input of its
    own, and shapes cover the places (result.shape_dofs), with `output_dofs` those of the sensors too. Bad hits (a
    double hit, an overload ..) are left out: result.hits; `keep_all` uses them. M, K, R where each place has a mode.

    Raises InputError (a wrong argument) or IdentificationError (no reliable model from these data).

    >>> import okid
    >>> force, acceleration = okid.demo_record()
    >>> result = okid.identify(force, acceleration, fs=1000.0, input_dofs=[1], output_dofs=[1, 2, 3])
    >>> [f"{mode.frequency_hz:.2f} Hz {100 * mode.damping_ratio:.2f} %" for mode in result.modes if mode.confident]
    ['10.96 Hz 0.90 %', '31.84 Hz 0.75 %', '45.66 Hz 0.89 %']
    >>> result.mkr.M.diagonal().round(1).tolist()  # kg; true: 1, 0.8, 1.2
    [1.0, 0.8, 1.2]
    """
    channel_names, sides, host_result, of_host = _rooms()
    inputs, outputs = sides(u, y, host_result.TYPES)
    options = {
        "inputs": channel_names(input_names, u, "u", inputs[0].shape[1]),
        "outputs": channel_names(output_names, y, "y", outputs[0].shape[1]),
        "fs": fs, "method": method, "p": p, "rows": rows, "order": order, "max_order": max_order, "hankel": hankel,
        "detrend": detrend, "hold": hold, "start": start, "input_dofs": input_dofs, "output_dofs": output_dofs,
        "sensing": sensing, "refine": ("no", "yes")[refine] if isinstance(refine, bool) else refine,
        "sigma": sigma, "sigma_blocks": sigma_blocks, "units": units,
        "band": None if band is None else ":".join(map(str, band)), "decimate": decimate, "modes": modes,
        "picks": _picks_text(picks), "stabilization": stabilization,
        "hit_dofs": hit_dofs, "keep_all": keep_all, "threads": threads,
    }  # fmt: skip
    said = {key: value for key, value in options.items() if value is not _UNSAID.get(key)}
    if "ipykernel" not in sys.modules:
        return of_host(host_result.identify(said, inputs, outputs))  # type: ignore[no-any-return]
    from okid.data.notebook_progress import cell_progress

    with cell_progress() as shown:
        return of_host(host_result.identify(said, inputs, outputs, shown.stage))  # type: ignore[no-any-return]


_UNSAID: dict[str, Any] = identify.__kwdefaults__ or {}  # what the library takes where nothing is said


def stabilization(
    u: ArrayLike | Sequence[ArrayLike] | None,
    y: ArrayLike | Sequence[ArrayLike],
    *,
    fs: float,
    horizons: Sequence[int] | None = None,
    orders: Iterable[int] | None = None,
    criteria: Criteria | None = None,
    **options: Any,
) -> Stabilization:
    """Identify at several horizons and orders and gather the poles into modes: no order has to be chosen.

    `horizons`: values of p, or of the block rows for methods without observer (default: a half, three quarters and all
    of what okid.identify() would take); `orders` default: all even ones the data carry. Other arguments are those of
    okid.identify(), u and y too; `method` one method, default "okid-era". Result: `modes`, `clusters`, and the rows of
    the diagram.

    >>> import okid
    >>> found = okid.stabilization(*okid.demo_record(), fs=1000.0)
    >>> [round(mode.frequency_hz, 1) for mode in found.modes]
    [11.0, 31.8, 45.7]
    """
    from okid.result.stabilization import of_identifiers

    if "order" in options:
        raise InputError("order is not an argument of stabilization(): it looks at many, give orders=[...]")
    options["method"] = options.get("method") or "okid-era"
    if options["method"] == "auto":
        raise InputError('method is "auto", which has no orders to look at: name one method, such as "okid-era"')
    subspace = str(options["method"]).startswith("n4sid")
    key = "rows" if u is None or subspace else "p"
    asked = None if orders is None else sorted(set(orders))
    if asked:
        options.setdefault("max_order", max(asked))
    if horizons is None:
        first = identify(u, y, fs=fs, **options)
        reach = first.p or 0
        results = [first] + [
            identify(u, y, fs=fs, **{**options, key: n}) for n in sorted({reach // 2, 3 * reach // 4} - {0, 1, reach})
        ]
    else:
        results = [identify(u, y, fs=fs, **{**options, key: int(n)}) for n in sorted(set(horizons))]
    results.sort(key=lambda result: result.p or 0)
    return of_identifiers([result.identifier for result in results if result.identifier is not None], asked, criteria)
