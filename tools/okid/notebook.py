# SPDX-License-Identifier: MIT
"""A Session that shows itself live in a notebook: signals, modes with ±, stabilization to pick from, moving shapes.

session                                    # last line of a cell: the session shows itself; needs `okid[notebook]`
for block in my_acquisition():
    session.feed(block)                    # the picture follows at most ten times a second
view = okid.notebook.LiveView(session)     # the same with options of its own, and as an object:
view.picked                                # poles that were clicked on in the diagram
"""

from __future__ import annotations

import math
import time
from importlib.resources import files
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from okid._errors import IdentificationError, InputError
from okid.modal import normalised
from okid.result.parts import Mode

if TYPE_CHECKING:
    from okid.session import Session

try:
    import anywidget
    import traitlets
except ImportError:
    raise InputError(
        "okid.notebook needs anywidget, which is not installed: pip install './tools[notebook]' in a checkout of okid"
    ) from None

_DRAW_S = 0.1  # between two pictures of the signals
_COLUMNS = 400  # of a lane: each a smallest and a largest value


def _short(value: float | None) -> float | None:
    return None if value is None or not math.isfinite(value) else float(f"{value:.6g}")


def lanes(samples: NDArray[np.float64], columns: int = _COLUMNS) -> list[list[list[float | None]]]:
    """Of each channel the smallest and the largest value in each of at most `columns` stretches; None = all missing."""
    pieces = np.array_split(samples, min(columns, max(1, len(samples))))
    out: list[list[list[float | None]]] = []
    for channel in range(samples.shape[1]):
        pairs: list[list[float | None]] = []
        for piece in pieces:
            known = piece[:, channel][np.isfinite(piece[:, channel])]
            pairs.append([_short(known.min()), _short(known.max())] if len(known) else [None, None])
        out.append(pairs)
    return out


def _row(mode: Mode) -> dict[str, Any]:
    shape = normalised(mode.shape)
    turned = shape * np.exp(-0.5j * np.angle(np.nansum(shape**2)))
    keys = ("frequency_hz", "damping_ratio", "frequency_std_hz", "damping_ratio_std", "mpc")
    return {
        **{key: _short(getattr(mode, key)) for key in keys},
        "re": [_short(one) or 0.0 for one in turned.real],
        "im": [_short(one) or 0.0 for one in turned.imag],
    }


class LiveView(anywidget.AnyWidget):
    """The picture of a session, drawn again as that is fed. `seconds` of the newest samples are kept and drawn,
    `update_s` of stream between two identifications."""

    _esm = files("okid").joinpath("web", "notebook.js").read_text(encoding="utf-8")
    signals = traitlets.Dict().tag(sync=True)
    modes: Any = traitlets.List().tag(sync=True)
    poles: Any = traitlets.List().tag(sync=True)
    picked: Any = traitlets.List().tag(sync=True)
    status = traitlets.Unicode().tag(sync=True)

    def __init__(self, session: Session, seconds: float = 10.0, update_s: float = 1.0) -> None:
        if not (seconds > 0.0 and update_s > 0.0):
            raise InputError(f"seconds is {seconds} and update_s {update_s}, expected both above 0")
        super().__init__()
        self.session, self._update_s = session, update_s
        self._kept = np.empty((0, len(session.names)))
        self._most = max(2, round(seconds * session.fs))
        self._drawn_at = 0.0
        self._next = self.session.samples / self.session.fs + update_s
        session._views.append(self)

    def feed(self, samples: ArrayLike) -> int:
        """Session.feed() of the block."""
        return self.session.feed(samples)

    def took(self, block: NDArray[Any]) -> None:
        """The session has taken in the block."""
        self._kept = np.concatenate([self._kept, np.asarray(block, dtype=np.float64)])[-self._most :]
        if self.session.samples / self.session.fs >= self._next:
            self._next = self.session.samples / self.session.fs + self._update_s
            self.update()
        elif time.monotonic() - self._drawn_at >= _DRAW_S:
            self._draw()

    def _draw(self) -> None:
        self._drawn_at = time.monotonic()
        end = self.session.samples / self.session.fs
        self.signals = {
            "names": self.session.names,
            "from_s": _short(end - len(self._kept) / self.session.fs),
            "to_s": _short(end),
            "lanes": lanes(self._kept),
        }

    def update(self) -> None:
        """Identify now and draw everything."""
        self._draw()
        self.modes = [_row(mode) for mode in self.session.modes() if not mode.doubtful]
        settled = "settled" if self.session.settled else "not settled yet"
        self.status = f"{self.session.samples} samples, {settled}"
        self.poles = self._diagram()

    def _diagram(self) -> list[dict[str, Any]]:
        """Poles over orders of a named method; of "auto", which has no orders, none."""
        if self.session.method == "auto" or not self.modes:
            return []
        try:
            rows = self.session.identify().stabilization()
        except IdentificationError:
            return []
        return [
            {"f": _short(float(f)), "z": _short(float(z)), "order": row.order, "stable": bool(stable)}
            for row in rows
            for f, z, stable in zip(row.frequency_hz, row.damping_ratio, row.stable, strict=True)
        ]
