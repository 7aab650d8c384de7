# SPDX-License-Identifier: MIT
"""okid.identify: measured inputs and outputs in, a model with its modes out."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from okid import abi
from okid._errors import Error, IdentificationError, InputError
from okid.abi.accumulator import Accumulator
from okid.abi.arguments import choice, frame_names, names, positive, whole, with_name
from okid.abi.identifier import HANKEL, METHODS, Identified, Identifier, usable_p
from okid.abi.square_root import SquareRoot
from okid.data.records import paired
from okid.result.mkr import MassMatrices, Plan, ProportionalDamping, make_plan, mass_matrices
from okid.result.model import Model
from okid.result.output_error import fit_inputs, refitted
from okid.result.record_fit import detrended, fit_records
from okid.result.refine import refined
from okid.result.remarks import remarks_of
from okid.result.result import Fit, Mode, Remark, Result, modes_of, put_deviations, with_deviations
from okid.result.skew import without_skew
from okid.result.uncertainty import FEWEST, GROUPS, MOST, Piece, Replicate, deviations, finite_p_bias, leave_out_blocks

Real = NDArray[np.float64]
Sums = TypeVar("Sums", Accumulator, SquareRoot)


def _check_moving(records: list[Real], names: list[str], n_u: int) -> None:
    for k, name in enumerate(names):
        kind = "input" if k < n_u else "output"
        present = np.concatenate([record[np.isfinite(record[:, k]), k] for record in records])
        if len(present) == 0:
            raise InputError(f"{kind} {name!r} has no sample at all: every value is missing")
        if np.ptp(present) == 0.0:
            reason = "excites nothing" if k < n_u else "measures nothing"
            status = abi.ERR_INPUT if k < n_u else abi.ERR_OUTPUT
            raise IdentificationError(f"no model: {kind} {name!r} is constant ({present[0]:g}): it {reason}", status)


def _gap_count(records: list[Real]) -> tuple[int, int]:
    """Missing samples and the runs they form."""
    missing = gaps = 0
    for record in records:
        broken = ~np.all(np.isfinite(record), axis=1)
        missing += int(np.sum(broken))
        gaps += int(np.sum(broken[1:] & ~broken[:-1])) + int(broken[0]) if len(broken) else 0
    return missing, gaps


def _silent_start(records: list[Real], n_u: int, p: int) -> bool:
    """True when most of the input energy lies in the first p samples of every record: a hit just after the trigger."""
    early = total = 0.0
    for record in records if n_u > 0 else []:
        power = np.nansum((record[:, :n_u] - np.nanmedian(record[:, :n_u], axis=0)) ** 2, axis=1)
        early += float(np.sum(power[:p]))
        total += float(np.sum(power))
    return total > 0.0 and early > 0.5 * total


def _feed(sums: Sums, records: list[Real], lags: int, rest: bool) -> Sums:
    for record in records:
        sums.gap(0)
        if rest:
            sums.add(np.zeros((lags, record.shape[1])))
        sums.add(record)
    return sums


def _better(
    identifier: Identifier, sums: Accumulator, records: list[Real], rest: bool
) -> tuple[Identified, list[Remark]]:
    """From the Gram matrix; nearly noise-free records, which lose half their digits in it, from their QR factor."""
    found = identifier.run(sums)
    floor_only = found.observer.ridge <= 1e-10  # else a ridge decides, not rounding
    if not (found.notes & abi.NOTE_ILL_CONDITIONED and floor_only):
        return found, []
    try:
        better = identifier.run(_feed(SquareRoot(sums.n_u, sums.n_y, sums.lags), records, sums.lags, rest))
    except IdentificationError:
        return identifier.run(sums), []
    text = "nearly noise-free data: solved from the QR factor of the record, not from its Gram matrix"
    return better, [Remark("qr_factor", text)]


def _identify(
    identifier: Identifier, records: list[Real], n_u: int, rest: bool, blocks: int
) -> tuple[Identified, list[Remark], list[Replicate]]:
    """The model, and those of the record less one of so many blocks each."""
    n_y, lags = records[0].shape[1] - n_u, identifier.lags
    with _feed(Accumulator(n_u, n_y, lags), records, lags, rest) as sums:
        found, remarks = _better(identifier, sums, records, rest)
        return found, remarks, leave_out_blocks(identifier, records, sums, blocks, rest)


def _refitting(own: list[Real], n_u: int) -> Callable[[Model, list[Piece]], Model]:
    """B and D of an n4sid replicate as the full model has them: from the records, without what the replicate lacks."""

    def refit(model: Model, pieces: list[Piece]) -> Model:
        less = list(own)
        for r, first, last in pieces:
            less[r] = less[r].copy()
            less[r][first:last, n_u:] = np.nan
        B, D = fit_inputs(model.A, model.C, less, n_u)
        return Model(model.A, B, model.C, D, model.K, model.dt)

    return refit


def _unbroken(records: list[Real]) -> NDArray[np.int64]:
    """Lengths of the runs of complete samples, over all records."""
    lengths = []
    for record in records:
        broken = np.flatnonzero(~np.all(np.isfinite(record), axis=1))
        lengths.append(np.diff(np.concatenate(([-1], broken, [len(record)]))) - 1)
    return np.concatenate(lengths)


def _usable_beside_gaps(runs: NDArray[np.int64], n_u: int, n_y: int, least: int, most: int) -> int:
    """Gaps cost p rows each: the largest p <= `most` with ten rows an unknown, else the one with most."""
    best, best_share = least, 0.0
    for p in range(most, least - 1, -1):
        share = float(np.sum(np.maximum(0, runs - p))) / (n_u + p * (n_u + n_y))
        if share >= 10.0:
            return p
        if share > best_share:
            best, best_share = p, share
    return best


def _usable(p: int, n_u: int, n_y: int, records: list[Real]) -> tuple[int, list[Remark]]:
    """p, or the largest smaller one that leaves ten samples (rows, where samples are missing) for each unknown."""
    runs = _unbroken(records)
    samples, gaps = int(np.sum(runs)), int(np.sum(runs)) < sum(len(record) for record in records)
    least_p = 1 if n_y >= 2 else 2  # p n_y states: two make the first mode
    least = 10 * (n_u + least_p * (n_u + n_y))
    if samples < least:
        raise IdentificationError(
            f"no model: too few samples: {samples} complete ones, even the smallest model of {n_u} inputs and {n_y} "
            f"outputs needs {least} (10 for each unknown)",
            abi.ERR_TOO_SHORT,
        )
    used = usable_p(n_u, n_y, p, samples)
    if gaps:
        used = _usable_beside_gaps(runs, n_u, n_y, min(least_p, used), used)
    if used == p:
        return p, []
    text = f"p is {used} instead of {p}: {samples} samples{' with these gaps' if gaps else ''} bear no more unknowns"
    return used, [Remark("p_reduced", text)]


def _usable_rows(rows: int, method: str, n_u: int, n_y: int, records: list[Real]) -> tuple[int, list[Remark]]:
    """Block rows of a method without observer, or the most that leave ten Hankel columns for each row of past and
    input."""
    runs = _unbroken(records)
    more = {"okid-era": 1, "okid-era-dc": 5}.get(method, 0)  # lags: 2 rows - 1 + more
    least = 2 if n_y >= 2 else 3  # (rows - 1) n_y states: two make the first mode
    for i in range(max(rows, least), least - 1, -1):
        if int(np.sum(np.maximum(0, runs - (2 * i - 1 + more)))) >= 10 * i * (n_y + 2 * n_u):
            text = f"{i} block rows instead of {rows}: {int(np.sum(runs))} samples bear no more unknowns"
            return i, [] if i == rows else [Remark("rows_reduced", text)]
    raise IdentificationError(
        f"no model: too few samples: {int(np.sum(runs))} complete ones, even the smallest model of {n_u} inputs and "
        f"{n_y} outputs needs {10 * least * (n_y + 2 * n_u) + 2 * least - 1} without a gap",
        abi.ERR_TOO_SHORT,
    )


def _horizon(
    method: str, p: int | None, rows: int | None, records: list[Real], n_u: int
) -> tuple[int, int, list[Remark]]:
    """p and the block rows (0 = default) that the records bear, with what there is to say about them."""
    n_y = records[0].shape[1] - n_u
    if n_u > 0 and not method.startswith("n4sid"):
        used, remarks = _usable(40 if p is None else p, n_u, n_y, records)
        return used, rows or 0, remarks
    subspace = method.startswith("n4sid")
    used, remarks = _usable_rows(rows or (30 if subspace else p or 40), method, n_u, n_y, records)
    if p is not None and (subspace or rows is not None):
        text = f"p belongs to the observer of the okid methods: {method} looks back {used} block rows here"
        remarks.append(Remark("p_ignored", text))
    return used, used, remarks


def _with_inputs(
    identifier: Identifier, found: Identified, records: list[Real], n_u: int
) -> tuple[Identified, list[Remark]]:
    """An n4sid model with B and D of the records; where that fails, those of the subspace equations stay."""
    if n_u == 0:
        return found, []
    try:
        return refitted(identifier, found, records, n_u), []
    except Error:
        text = "B and D could not be fitted to the record: they are those of the subspace equations"
        return found, [Remark("inputs_from_subspace", text)]


def _deviate(
    model: Model,
    modes: list[Mode],
    replicates: list[Replicate],
    plan: Plan | None,
    refit: Callable[[Model, list[Piece]], Model] | None,
    masses: tuple[MassMatrices | None, ProportionalDamping | None],
) -> tuple[list[Mode], list[Remark]]:
    """The modes with their standard deviations; those of the matrices are written into `masses`."""
    sigma = deviations(model, replicates, plan, refit)
    if sigma is None:
        return modes, [Remark("no_deviation", "the record is too short to be cut into blocks: no standard deviations")]
    put_deviations(sigma, *masses)
    return with_deviations(modes, sigma), []


def _check_explains(fit: Fit) -> None:
    """Refuse a model that neither simulates nor predicts a twentieth of any output."""
    numbers = [x for part in fit for x in part.values() if x is not None]
    if max(numbers, default=0.0) < 5.0:
        raise IdentificationError(
            f"no model: the best one explains {max(numbers, default=0.0):.1f} % of an output: the outputs do not "
            "answer these inputs, or a sensor was overloaded",
            abi.ERR_NO_MODES,
        )


def _low_fit(fit: Fit) -> list[Remark]:
    """The outputs that the model hardly follows, simulated or else predicted, as a remark."""
    simulated = any(x is not None for x in fit.simulation_percent.values())
    known = fit.simulation_percent if simulated else fit.prediction_percent
    least = 30.0 if simulated else 10.0
    low = [f'{max(x, 0.0):.0f} % of "{name}"' for name, x in known.items() if x is not None and x < least]
    text = (
        f"{'simulated from the inputs' if simulated else 'one sample ahead'} the model explains only {', '.join(low)}: "
        "noise, an overloaded or dead sensor"
    )
    more = ", a force that is not measured, columns exchanged, or an order too low" if simulated else ""
    return [Remark("fit_low", text + more)] if low else []


def _record_remarks(records: list[Real], n_u: int, p: int, start: str, counts: tuple[int, int, int]) -> list[Remark]:
    missing, gaps, samples = counts
    out = []
    if missing:
        text = f"{missing} of {samples} samples are missing in {gaps} gap(s): left out, nothing was interpolated"
        out.append(Remark("missing_samples", text))
    if start == "moving" and _silent_start(records, n_u, p):
        text = f"most of the input energy lies in the first {p} samples, which serve as history only: the hit is lost. "
        out.append(Remark("hit_at_start", text + "If the structure was at rest before, use start='rest'"))
    return out


def _centred(records: list[Real], detrend: str, start: str) -> tuple[list[Real], str]:
    """The records as they go into the sums, and what the sums still have to remove themselves."""
    if detrend == "linear" or (detrend == "mean" and (start == "rest" or len(records) > 1)):
        records = [detrended(record, detrend) for record in records]
    return records, "mean" if detrend == "mean" and start == "moving" else "none"


def identify(
    u: ArrayLike | Sequence[ArrayLike] | None,
    y: ArrayLike | Sequence[ArrayLike],
    *,
    fs: float,
    method: str = "okid-era",
    p: int | None = None,
    rows: int | None = None,
    order: int | str = "auto",
    max_order: int | None = None,
    hankel: str = "system",
    detrend: str = "mean",
    hold: str = "zoh",
    start: str = "moving",
    input_names: Sequence[str] | None = None,
    output_names: Sequence[str] | None = None,
    input_dofs: Sequence[int] | None = None,
    output_dofs: Sequence[int] | None = None,
    sensing: str | Sequence[str] = "acceleration",
    refine: bool = False,
    sigma_blocks: int = GROUPS,
) -> Result:
    """Identify a structure from measured inputs and outputs.

    u (N, n_u) or (N,), y (N, n_y) or (N,) at `fs` Hz, or lists of such arrays: several records, merged exactly, each
    centred by itself. Frames of pandas give the channels their names. NaN (or masked) = missing sample: the regression
    leaves it out and re-arms, nothing is interpolated; the fits and model.x0 are those of the record less its own mean
    (or line) and start anew after missing inputs. The arrays are never modified.
    `method` "okid-era", "okid-era-dc", "n4sid-moesp", "n4sid-cva" or "n4sid-ssarx".
    u None = no measured force (ambient): modes and predictor only, there is no simulation fit; the okid methods then
    realize the covariances of the outputs.
    `p` ARX horizon of the okid methods (default 40), reduced with a warning when there are fewer than 10 samples an
    unknown; `rows` block rows of the Hankel matrices (default 2 p, n4sid 30, okid without u p, or what the record
    bears); `order` a number or "auto" (up to `max_order`); `hankel` what the Hankel matrix of the okid methods holds:
    "system" Markov parameters, those of the "innovations" too (weighted, free of units), or "literal" eq. 42 (warns);
    `detrend` "none", "mean" or "linear"; `hold` "zoh" or "foh": how the force behaved between samples.
    `start` "rest" says that every record begins just before the structure is struck: the silent past is then used
    (paper eq. 38), without it the hit itself would be lost with the first p samples. "moving" assumes nothing.

    `input_dofs`, `output_dofs`: the degree of freedom of each channel, from 1 (-3: at 3 with reversed polarity), turn
    on result.mkr and result.pdc; `sensing` "acceleration", "velocity", "displacement", or one for each output. The
    numbers are then taken as N, m/s^2, m/s, m. Every degree of freedom needs a force or a sensor, one needs both.

    `refine`: improve the model by maximum likelihood, with noise at the sensors to the Cramér-Rao bound
    (result.refinement; a remark refine_failed when nothing was to be had). Needs u. With degrees of freedom also
    the delay of every output (result.skew), which is taken out of M, K and R.

    `sigma_blocks`: blocks of the record that are left out in turn for the standard deviations, 8 to 100; 0 = none. They
    cost some 3 (okid-era) to 20 identifications.

    Raises InputError (a wrong argument) or IdentificationError (no honest model from these data).

    >>> import okid
    >>> force, acceleration = okid.demo_record()
    >>> result = okid.identify(force, acceleration, fs=1000.0, input_dofs=[1], output_dofs=[1, 2, 3])
    >>> [f"{mode.frequency_hz:.2f} Hz {100 * mode.damping_ratio:.2f} %" for mode in result.modes]
    ['10.96 Hz 0.90 %', '31.84 Hz 0.75 %', '45.66 Hz 0.89 %']
    >>> result.mkr.M.diagonal().round(2).tolist()  # kg
    [1.0, 0.8, 1.2]
    """
    choice("method", method, tuple(METHODS))
    choice("detrend", detrend, ("none", "mean", "linear"))
    choice("hold", hold, ("zoh", "foh"))
    choice("start", start, ("moving", "rest"))
    fs = positive("fs", fs, "a sample rate in Hz")
    asked_p, asked_rows = (None if x is None else whole(name, x, least) for name, x, least in
                           (("p", p, 1), ("rows", rows, 2)))  # fmt: skip
    wanted = 0 if order == "auto" else whole("order", order, 1)
    choice("hankel", hankel, tuple(HANKEL))
    if whole("sigma_blocks", sigma_blocks, 0) != 0 and not FEWEST <= sigma_blocks <= MOST:
        raise InputError(f"sigma_blocks is {sigma_blocks}, expected 0 (no standard deviations) or {FEWEST} to {MOST}")
    inputs, outputs = paired(u, y)
    n_u, n_y = inputs[0].shape[1], outputs[0].shape[1]
    by_observer = n_u > 0 and not method.startswith("n4sid")
    if hankel != "system" and not by_observer:
        raise InputError(f"hankel={hankel!r} is for okid-era and okid-era-dc with a measured force")
    in_names = names(frame_names(u) if input_names is None else input_names, "u", n_u)
    out_names = names(frame_names(y) if output_names is None else output_names, "y", n_y)
    if refine and n_u == 0:
        raise InputError("refine needs a measured force: without inputs (ambient) there is nothing to simulate")
    plan = make_plan(input_dofs, output_dofs, sensing, hold, (n_u, n_y))
    records = [np.hstack(pair) for pair in zip(inputs, outputs, strict=True)]
    _check_moving(records, in_names + out_names, n_u)
    missing, gaps = _gap_count(records)
    samples = sum(len(record) for record in records)
    horizon, block_rows, remarks = _horizon(method, asked_p, asked_rows, records, n_u)
    remarks += _record_remarks(records, n_u, horizon, start, (missing, gaps, samples))
    own = [detrended(record, detrend) for record in records]  # what a user can make of the record alone
    records, centre = _centred(records, detrend, start)
    identifier = Identifier(
        n_u, n_y, fs=float(fs), p=horizon, rows=block_rows, order=wanted, method=method, hankel=hankel,
        max_order=0 if max_order is None else whole("max_order", max_order, 1), detrend=centre,
    )  # fmt: skip
    try:
        found, by_factor, replicates = _identify(
            identifier, records, n_u, start == "rest", 0 if refine else sigma_blocks
        )
    except IdentificationError as fault:
        raise with_name(fault, in_names, out_names) from None
    if method.startswith("n4sid"):
        found, by_subspace = _with_inputs(identifier, found, own, n_u)
        remarks += by_subspace
    model = found.model()
    fit, model.x0 = fit_records(model, own, out_names, predict=not found.notes & abi.NOTE_PREDICTOR_UNSTABLE)
    refinement = None
    if refine:
        found, model, fit, refinement, of_refinement = refined(found, model, fit, own, out_names, detrend != "none")
        remarks += of_refinement
    _check_explains(fit)
    remarks += _low_fit(fit)
    structure, skew = model, None
    if plan is not None and refinement is not None:
        structure, skew, of_skew = without_skew(model, refinement.replicates, plan, out_names)
        remarks += of_skew
    mkr, pdc, said = (None, None, []) if plan is None else mass_matrices(structure, plan, (in_names, out_names))
    modes, refit = modes_of(found), None
    if refinement is not None:
        replicates = [Replicate(one, 1.0 / len(refinement.replicates), []) for one in refinement.replicates]
    elif refine:
        replicates = _identify(identifier, records, n_u, start == "rest", sigma_blocks)[2]
    if refinement is None and plan is not None and method.startswith("n4sid"):
        refit = _refitting(own, n_u)
    if sigma_blocks > 0:
        modes, of_sigma = _deviate(model, modes, replicates, plan, refit, (mkr, pdc))
        remarks += of_sigma
    if by_observer and refinement is None and sigma_blocks > 0:
        moved = finite_p_bias(identifier.config, records, start == "rest", modes, found.order)
        remarks += [] if moved is None else [Remark("finite_p_bias", moved)]
    return Result(
        method, float(fs), samples, len(records), gaps, in_names, out_names, found.p, found.rows, found.order, hold,
        detrend, start, found.singular_values, model, found.markov, modes, fit,
        remarks_of(found) + by_factor + remarks + [Remark(*one) for one in said], found.observer,
        identifier, mkr, pdc, hankel=hankel if by_observer else None,
        singular_noise=found.noise_level if math.isfinite(found.noise_level) else None, refinement=refinement,
        skew=skew,
    )  # fmt: skip
