# SPDX-License-Identifier: MIT
"""Modes while samples arrive: blocks in, modes and results out whenever they are wanted."""

from __future__ import annotations

import inspect
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from okid._errors import InputError
from okid.abi.arguments import MOST_SAMPLES, frame_names, names, state_bytes, unmasked, whole
from okid.abi.sums import Stats
from okid.identification.stream import HostStream
from okid.result.parts import Mode
from okid.result.result import Result

if TYPE_CHECKING:
    from okid.notebook import LiveView


_MOST_CHANNELS = 65536


def _named(what: str, given: Sequence[str] | int, letter: str, least: int) -> list[str]:
    count = whole(what, given, least, _MOST_CHANNELS) if isinstance(given, int) else len(given)
    if count < least:
        raise InputError(f"{what} is {given!r}, expected at least {least}")
    return names(None if isinstance(given, int) else given, letter, count)


class Session:
    """Recursive identification of a stream, the same as in `okid run`: fixed memory, however long it runs.

    `method` as in okid.identify(): "auto" by default, "okid-era" when an option of one method is given (p, rows, order,
    hankel, forgetting). Named methods keep sums of lagged products; "auto" keeps the samples of the window, without one
    the newest 500,000 numbers and sums of those before, and finds what okid.identify() finds in the same samples.
    `inputs`, `outputs`: names of the channels, or how many; no inputs = ambient. `fs` Hz. `window_s` forgets what is
    older (in blocks of about a twentieth of it); with `window="auto"` each modes() or identify() chooses how much of
    it, as far as the structure stands still. `forgetting` fades by that factor a sample, neither keeps everything.
    `codes` 16, 24 or 32 takes ADC codes with `scale` and `offset` (value = scale code + offset, one for all channels or
    one each), 0 real numbers. `sigma`, `sigma_blocks`: ± as in okid.identify().
    `restart_on_change`: once the modes have settled at three calls of modes() in a row, a change of the structure
    makes a window or a fading memory forget what was before. `input_dofs`, `output_dofs`, `sensing`, `hold`: as in
    okid.identify(), for M, K and R.
    `refine`: maximum likelihood, "auto" of method "auto". Of a named method True or "auto" (where the search ends):
    each model is refined from correlation sums kept beside the others (result.refinement).
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
        method: str | None = None,
        p: int | None = None,
        rows: int | None = None,
        order: int | str = "auto",
        max_order: int | None = None,
        hankel: str = "system",
        detrend: str = "mean",
        hold: str | None = None,
        band: tuple[float, float] | None = None,
        decimate: int | None = None,
        window_s: float | None = None,
        window: str | None = None,
        forgetting: float | None = None,
        update_s: float = 0.5,
        codes: int = 0,
        scale: ArrayLike = 1.0,
        offset: ArrayLike = 0.0,
        sigma: str | None = None,
        sigma_blocks: int | None = None,
        refine: bool | str | None = None,
        input_dofs: Sequence[int] | None = None,
        output_dofs: Sequence[int] | None = None,
        sensing: str | Sequence[str] = "acceleration",
        restart_on_change: bool = True,
    ) -> None:
        given = dict(locals())
        del given["self"]
        self._open(given, None)

    def _open(self, options: Mapping[str, Any], config: str | Path | None) -> None:
        named: dict[str, Any] = {
            what: _named(what, options[what], letter, least)
            for what, letter, least in (("inputs", "u", 0), ("outputs", "y", 1))
            if what in options
        }
        band = options.get("band")
        if band is not None:
            named["band"] = ":".join(map(str, band))
        self._stream = HostStream({**options, **named}, config)
        self._basis = 0
        self._views: list[LiveView] = []  # what shows the samples as they come
        used = self._stream.options
        self.inputs, self.outputs = list(used["inputs"]), list(used["outputs"])
        self.fs = float(used["fs"])
        self.method, self.detrend, self.hold, self.hankel = (
            str(used[key]) for key in ("method", "detrend", "hold", "hankel")
        )

    @classmethod
    def from_config(cls, path: str | Path, **changes: Any) -> Self:
        """A session with the channels, the rate and [identification] of a CONFIG.toml of `okid run`; `changes` replace
        arguments. Samples are fed in SI units (accelerations in m/s^2), inputs first.

        The whole file is checked, as `okid check` does it. Raises InputError with its sentence.
        """
        known = list(inspect.signature(cls.__init__).parameters)[1:]
        for name in changes:
            if name not in known:
                raise InputError(f"there is no argument {name!r}, expected one of {', '.join(known)}")
        made = cls.__new__(cls)
        made._open(changes, path)
        return made

    @property
    def names(self) -> list[str]:
        """Channels in the order of the samples: inputs, then outputs."""
        return self.inputs + self.outputs

    @property
    def stats(self) -> Stats:
        """Counts since the start."""
        counts = self._stream.counts()
        return Stats(*(getattr(counts, name) for name in Stats._fields))

    @property
    def samples(self) -> int:
        """Samples taken in, missing ones included."""
        return self.stats.samples + self.stats.missing

    @property
    def basis(self) -> int:
        """Samples that the last modes() rested on: with `window="auto"` as many as were chosen; 0 without modes."""
        return self._basis

    @property
    def rows(self) -> int:
        """Equations that are remembered now."""
        return self.stats.rows

    @property
    def nbytes(self) -> int:
        """Bytes of the sums of the whole."""
        return int(self._stream.counts().bytes)

    @property
    def settled(self) -> bool:
        """Had the modes settled at the last call of modes(), as `okid run` reports it?"""
        return bool(self._stream.counts().settled)

    @property
    def restarts(self) -> int:
        """Changes of the structure after which what was before was forgotten."""
        return int(self._stream.counts().restarts)

    def __repr__(self) -> str:
        return (
            f"<Session of {len(self.inputs)} input(s) and {len(self.outputs)} output(s) at {self.fs:g} Hz, "
            f"{self.method}, {self.samples} samples, {self.rows} equations>"
        )

    def _repr_mimebundle_(self, **asked: Any) -> Any:
        """In Jupyter: okid.notebook.LiveView, which follows every feed(); a line of text without anywidget."""
        try:
            from okid.notebook import LiveView
        except InputError as fault:
            return {"text/plain": f"{self!r}\n{fault}"}
        view = self._views[0] if self._views else LiveView(self)
        return view._repr_mimebundle_(**asked)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._stream.close()

    def feed(self, samples: ArrayLike) -> int:
        """Take in a block (N, m), inputs first, or a frame with the names of the channels as columns.

        A NaN, infinite or masked number in a channel = the sample is missing. The array is not kept.

        Returns the status of the library: 0, or a warning > 0 (missing samples, saturated codes).
        Raises InputError for a wrong shape or type. Cost: O(m q) a sample, twice that with ± and without a window.
        """
        if type(samples) is not np.ndarray:
            samples = self._in_order(samples)
        status = self._stream.add(samples)
        for view in self._views:
            view.took(samples)
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
        self._stream.gap(whole("count", count, 0, MOST_SAMPLES))

    def reset(self) -> None:
        """Forget all samples."""
        self._stream.reset()

    def modes(self) -> list[Mode]:
        """The modes by now, with ± when there are enough blocks: an update of `okid run`. [] while there are too few
        samples, or no model is possible yet (identify() says why). Cost: one identification, a short one a block."""
        found = self._stream.update()
        about: dict[str, Any] = {"modes": [], "samples": 0} if found is None else found.about()
        self._basis = int(about["samples"])
        return [Mode.of(one) for one in about["modes"]]

    def identify(self) -> Result:
        """Everything the samples tell by now: model, modes, M, K and R where degrees of freedom are given, warnings.

        The record is not kept: model.x0 and the fits are None. Raises IdentificationError when no model is possible.
        """
        return Result.of_host(self._stream.identify())

    def to_bytes(self) -> bytes:
        """The sums, for a file or another machine: what okid.Accumulator.to_bytes() gives, behind rate and channels and
        with a check sum over all; of method auto the samples. Without the blocks for ±.
        With `refine` the correlation sums too; InputError while no model has shown how far these look back."""
        return self._stream.state()

    def restore(self, state: bytes) -> None:
        """Go on where to_bytes() of a session of the same rate, channels, lags and memory stood, else InputError. For ±
        what was before is one block; a fading memory has none until it is forgotten. With `refine` how far the
        correlation sums look back and the filter of the noise are those of the state, and stay so at reset()."""
        self._stream.restore(state_bytes(state))

    def merge(self, state: bytes) -> None:
        """Add all samples of another session's to_bytes() as further records, and as one block for ±. InputError with a
        window or forgetting. With `refine` both must have begun with restore() of one state and reset(), or one of them
        with that state itself: `first.to_bytes()` for `second.restore()`, `second.reset()`, then `first.merge()`."""
        self._stream.merge(state_bytes(state))
