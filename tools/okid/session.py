# SPDX-License-Identifier: MIT
"""Modes while samples arrive: blocks in, modes and results out whenever they are wanted."""

from __future__ import annotations

import inspect
import math
from collections.abc import Sequence
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from okid._errors import Error, IdentificationError, InputError
from okid.abi.accumulator import Accumulator
from okid.abi.arguments import choice, frame_names, names, positive, whole, with_name
from okid.abi.identifier import METHODS, Identified, Identifier
from okid.data.records import ROLES, unmasked
from okid.data.stream_blocks import StreamBlocks
from okid.data.sums import Stats
from okid.data.toml_file import read_toml
from okid.result.mkr import Plan, make_plan, mass_matrices
from okid.result.parts import Fit, Mode
from okid.result.parts import Warning as Remark
from okid.result.remarks import remarks_of
from okid.result.result import Result
from okid.result.stream_result import StreamResult, modes_of, put_deviations, with_deviations
from okid.result.uncertainty import FEWEST, GROUPS, MOST

Real = NDArray[np.float64]


def _named(what: str, given: Sequence[str] | int, letter: str, least: int) -> list[str]:
    count = whole(what, given, least) if isinstance(given, int) else len(given)
    if count < least:
        raise InputError(f"{what} is {given!r}, expected at least {least}")
    return names(None if isinstance(given, int) else given, letter, count)


class Session:
    """Recursive identification of a stream, as `okid run` does it: fixed memory, however long it runs.

    `inputs`, `outputs`: names of the channels, or how many; no inputs = ambient. `fs` Hz. `window_s` forgets what is
    older (in blocks of about a twentieth of it), `forgetting` fades by that factor a sample, neither keeps everything.
    `codes` 16, 24 or 32 takes ADC codes with `scale` and `offset` (value = scale code + offset, one for all channels or
    one each), 0 real numbers. `sigma_blocks` 0 or 8 to 100 blocks that are left out in turn for ± (0 = none).
    `input_dofs`, `output_dofs`, `sensing`, `hold`: as in okid.identify(), for M, K and R.
    The other arguments are those of okid.identify(). Raises InputError for arguments that do not go together.

    >>> import numpy as np, okid
    >>> force, acceleration = okid.demo_record()
    >>> with okid.Session(["shaker"], ["a1", "a2", "a3"], fs=1000.0, p=20) as session:
    ...     for start in range(0, len(force), 1000):
    ...         block = slice(start, start + 1000)
    ...         _ = session.feed(np.hstack([force[block], acceleration[block]]))
    ...     [round(mode.frequency_hz, 1) for mode in session.modes() if mode.emac > 0.5]
    [11.0, 31.8, 45.7]
    """

    def __init__(
        self,
        inputs: Sequence[str] | int,
        outputs: Sequence[str] | int,
        *,
        fs: float,
        method: str = "okid-era",
        p: int = 40,
        rows: int | None = None,
        order: int | str = "auto",
        max_order: int | None = None,
        hankel: str = "system",
        detrend: str = "mean",
        hold: str = "zoh",
        window_s: float | None = None,
        forgetting: float | None = None,
        update_s: float = 0.5,
        codes: int = 0,
        scale: ArrayLike = 1.0,
        offset: ArrayLike = 0.0,
        sigma_blocks: int = GROUPS,
        input_dofs: Sequence[int] | None = None,
        output_dofs: Sequence[int] | None = None,
        sensing: str | Sequence[str] = "acceleration",
    ) -> None:
        self.inputs, self.outputs = _named("inputs", inputs, "u", 0), _named("outputs", outputs, "y", 1)
        self.fs = positive("fs", fs, "a sample rate in Hz")
        self.method, self.detrend, self.hold, self.hankel = method, detrend, hold, hankel
        if len(set(self.names)) != len(self.names):
            raise InputError(f"every channel needs a name of its own, got {self.names}")
        if detrend not in ("none", "mean"):
            raise InputError(f"detrend is {detrend!r}, expected 'none' or 'mean': a stream has no line of its own")
        if window_s is not None and forgetting is not None:
            raise InputError("window_s and forgetting exclude each other: give one of them, or neither")
        if whole("sigma_blocks", sigma_blocks, 0) != 0 and not FEWEST <= sigma_blocks <= MOST:
            raise InputError(f"sigma_blocks is {sigma_blocks}, expected 0 or {FEWEST} to {MOST}")
        n_u, n_y = len(self.inputs), len(self.outputs)
        self._plan: Plan | None = make_plan(input_dofs, output_dofs, sensing, hold, (n_u, n_y))
        self._identifier = Identifier(
            n_u, n_y, fs=self.fs, p=whole("p", p, 1), rows=0 if rows is None else whole("rows", rows, 0),
            order=0 if order == "auto" else whole("order", order, 1), detrend=detrend, method=method, hankel=hankel,
            max_order=0 if max_order is None else whole("max_order", max_order, 1),
        )  # fmt: skip
        if window_s is not None and positive("window_s", window_s, "seconds") * self.fs < self._unknowns():
            raise InputError(
                f"window_s is {window_s!r}, {window_s * self.fs:.0f} samples, but there are {self._unknowns()} "
                f"unknowns (p {p}): expected a longer window, or a smaller p"
            )
        self._sums = Accumulator(n_u, n_y, self._identifier.lags, codes=codes,
                                 **_memory(self.fs, window_s, forgetting, update_s))  # fmt: skip
        self._memory_samples = self._sums.arguments["slots"] * self._sums.arguments["block"]
        if forgetting is not None and forgetting < 1.0:
            self._memory_samples = round(min(1.0 / (1.0 - forgetting), 1e15))
        self._blocks = StreamBlocks(self._sums, sigma_blocks) if sigma_blocks else None
        self._sums.set_units(scale, offset)
        if self._blocks is not None:
            self._blocks.set_units(scale, offset)

    @classmethod
    def from_config(cls, path: str | Path, **changes: Any) -> Session:
        """A session with the channels, the rate and [identification] of a CONFIG.toml of `okid run`; `changes` replace
        arguments. Samples are fed in engineering units (accelerations in m/s^2), inputs first.

        Only what a session needs is looked at: `okid check CONFIG.toml` checks the whole file.
        Raises InputError that names the file and the key.
        """
        config = read_toml(path)[0]
        known = list(inspect.signature(cls.__init__).parameters)[1:]
        for name in changes:
            if name not in known:
                raise InputError(f"there is no argument {name!r}, expected one of {', '.join(known)}")
        try:
            arguments = _arguments_of(config)
            return cls(**{**arguments, **changes})
        except InputError as fault:
            raise InputError(f"{path}: {fault}") from None
        except (KeyError, TypeError, ValueError, AttributeError) as fault:
            raise InputError(f"{path}: not a config of okid ({fault!r}): `okid check` tells more") from None

    @property
    def names(self) -> list[str]:
        """Channels in the order of the samples: inputs, then outputs."""
        return self.inputs + self.outputs

    @property
    def stats(self) -> Stats:
        """Counts since the start."""
        return self._sums.stats

    @property
    def samples(self) -> int:
        """Samples taken in, missing ones included."""
        return self.stats.samples + self.stats.missing

    @property
    def rows(self) -> int:
        """Equations that are remembered now."""
        return self._sums.rows

    @property
    def nbytes(self) -> int:
        """Bytes of the sums of the whole."""
        return self._sums.nbytes

    def __repr__(self) -> str:
        return (
            f"<Session of {len(self.inputs)} input(s) and {len(self.outputs)} output(s) at {self.fs:g} Hz, "
            f"{self.method}, {self.samples} samples, {self.rows} equations>"
        )

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, value: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._sums.close()

    def feed(self, samples: ArrayLike) -> int:
        """Take in a block (N, m), inputs first, or a frame with the names of the channels as columns.

        A NaN, infinite or masked number in a channel = the sample is missing. The array is not kept.

        Returns the status of the library: 0, or a warning > 0 (missing samples, saturated codes).
        Raises InputError for a wrong shape or type. Cost: O(m q) a sample, twice that with ± and without a window.
        """
        if type(samples) is not np.ndarray:
            samples = self._in_order(samples)
        if self._blocks is None or self._blocks.window:
            return self._sums.add(samples)
        given = self._sums._samples(samples)
        status = done = 0
        while done < len(given):
            part = given[done : done + self._blocks.room(len(given) - done)]
            status = max(status, self._sums.add(part))
            self._blocks.add(part)
            done += len(part)
        return status

    def _in_order(self, samples: ArrayLike) -> NDArray[Any]:
        """What is no plain array: columns of a frame go by their names, what is masked is missing."""
        columns = frame_names(samples)
        if columns is None:
            return unmasked(samples)
        missing = [name for name in self.names if name not in columns]
        if missing:
            raise InputError(f"the frame has the columns {columns}, but no {missing[0]!r}; expected {self.names}")
        return unmasked(samples[self.names])  # type: ignore[call-overload,index]

    def gap(self, count: int = 0) -> None:
        """`count` samples are missing here; 0 = another record begins."""
        self._sums.gap(count)
        if self._blocks is not None:
            self._blocks.gap(count)

    def reset(self) -> None:
        """Forget all samples."""
        self._sums.reset()
        if self._blocks is not None:
            self._blocks.reset()

    def modes(self) -> list[Mode]:
        """The modes by now, with ± when there are enough blocks; [] while there are too few samples, or no model is to
        be had yet (identify() says why). Cost: one identification, and a short one a block for ±."""
        if self.rows < 2 * self._unknowns():  # fewer only repeat the noise
            return []
        try:
            found = self._identifier.run(self._sums)
        except IdentificationError:
            return []
        modes = modes_of(found)
        sigma = self._deviations(found, None)
        return modes if sigma is None else with_deviations(modes, sigma)

    def identify(self) -> Result:
        """Everything the samples tell by now: model, modes, M, K and R where degrees of freedom are given, remarks.

        The record is not kept: model.x0 and the fits are None. Raises IdentificationError when no model is to be had.
        """
        try:
            found = self._identifier.run(self._sums)
        except IdentificationError as fault:
            raise with_name(fault, self.inputs, self.outputs) from None
        model = found.model()
        remarks = remarks_of(found)
        counts = self.stats
        if counts.missing:
            text = (
                f"{counts.missing} of {counts.samples + counts.missing} samples are missing in {counts.gaps} gap(s): "
                "left out, nothing was interpolated"
            )
            remarks.insert(0, Remark("missing_samples", text))
        mkr, pdc = None, None
        if self._plan is not None:
            try:
                mkr, pdc, said = mass_matrices(model, self._plan, (self.inputs, self.outputs))
                remarks += [Remark(*one) for one in said]
            except Error as fault:
                remarks.append(Remark("mkr_failed", str(fault)))
        modes = modes_of(found)
        sigma = self._deviations(found, self._plan if mkr is not None else None)
        if sigma is not None:
            modes = with_deviations(modes, sigma)
            put_deviations(sigma, mkr, pdc)
        unknown: dict[str, float | None] = dict.fromkeys(self.outputs)
        samples = min(self.samples, self._memory_samples) if self._memory_samples else self.samples
        by_observer = bool(self.inputs) and not self.method.startswith("n4sid")
        made = StreamResult(
            self.method, self.fs, samples, 1, counts.gaps, list(self.inputs), list(self.outputs), found.p, found.rows,
            found.order, self.hold, self.detrend, "moving", found.singular_values, model, found.markov, modes,
            Fit(dict(unknown), dict(unknown)), remarks, found.observer, mkr, pdc,
            hankel=self.hankel if by_observer else None,
            singular_noise=found.noise_level if math.isfinite(found.noise_level) else None,
        )  # fmt: skip
        return made.as_result(self._identifier)

    def _unknowns(self) -> int:
        return len(self.inputs) + self._identifier.lags * len(self.names)

    def _deviations(self, found: Identified, plan: Plan | None) -> Any:
        if self._blocks is None:
            return None
        model = found.model()
        return self._blocks.deviations(self._identifier, model, plan)


def _memory(fs: float, window_s: float | None, forgetting: float | None, update_s: float) -> dict[str, Any]:
    """Block, slots and forgetting of the accumulator, as `okid run` chooses them: a window moves in whole blocks."""
    update = max(1, round(positive("update_s", update_s, "seconds") * fs))
    if window_s is not None:
        window = max(1, round(window_s * fs))
        block = min(max(update, max(1, window // 64)), max(1, window // 20))
        slots = max(1, round(window / block))
        return {"block": block, "slots": slots, "spare_slots": slots // 2 + 8}
    if forgetting is not None and positive("forgetting", forgetting, "a factor") > 1.0:
        raise InputError(f"forgetting is {forgetting!r}, expected a factor above 0 and up to 1")
    if forgetting is not None and forgetting < 1.0:
        return {"block": min(max(1, round(1.0 / (1.0 - forgetting) / 20)), update), "forgetting": forgetting}
    return {}


def _arguments_of(config: dict[str, Any]) -> dict[str, Any]:
    """The arguments of a Session out of a config."""
    channels = config.get("channel") or []
    if not channels:
        raise InputError("no [[channel]]")
    for one in channels:
        choice(f"[[channel]] {one['name']!r}, key \"role\"", one.get("role"), ROLES)
    forces = [one for one in channels if one.get("role") == "force"]
    sensors = [one for one in channels if one.get("role") in ("acceleration", "velocity", "displacement")]
    wanted = dict(config.get("identification") or {})
    method = wanted.get("method", "okid-era")
    if method not in METHODS:
        raise InputError(f"[identification], key \"method\": found {method!r}, expected one of {', '.join(METHODS)}")
    keys = ("method", "p", "rows", "order", "hankel", "detrend", "hold", "window_s", "forgetting", "update_s",
            "sigma_blocks")  # fmt: skip
    arguments: dict[str, Any] = {key: wanted[key] for key in keys if key in wanted}
    if "rate_hz" not in (config.get("acquisition") or {}):
        raise InputError('[acquisition]: key "rate_hz" is missing')
    arguments |= {
        "fs": config["acquisition"]["rate_hz"],
        "inputs": [one["name"] for one in forces],
        "outputs": [one["name"] for one in sensors],
    }
    dofs = [one.get("dof", 0) for one in forces], [one.get("dof", 0) for one in sensors]
    if wanted.get("mkr") and all(dofs[0] + dofs[1]):
        arguments |= {"input_dofs": dofs[0], "output_dofs": dofs[1], "sensing": [one["role"] for one in sensors]}
    return arguments
