# SPDX-License-Identifier: MIT
"""A Session fed block by block: a line of modes at every update, and whether they have come to rest."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable, Sequence

import numpy as np
from numpy.typing import NDArray

from okid.result.result import Mode
from okid.session import Session

Real = NDArray[np.float64]
_UPDATES = 3
_NEAR = 0.05  # a mode this near is the same one


class Settling:
    """At rest when every mode that the last three updates have stayed within 0.1 % in frequency and 20 % in damping."""

    def __init__(self) -> None:
        self._last: deque[list[tuple[float, float]]] = deque(maxlen=_UPDATES)

    def add(self, modes: Sequence[Mode]) -> bool:
        """Take in an update; an empty one begins anew."""
        now = [(mode.frequency_hz, mode.damping_ratio) for mode in modes]
        if not now:
            self._last.clear()
            return False
        self._last.append(now)
        if len(self._last) < _UPDATES:
            return False
        verdicts = [self._stays(f, zeta) for f, zeta in now]
        return True in verdicts and False not in verdicts

    def _stays(self, f: float, zeta: float) -> bool | None:
        """None: it comes and goes, which is no mode of the structure."""
        stays = True
        for update in self._last:
            near = [(f2, z2) for f2, z2 in update if abs(f2 - f) <= _NEAR * f]
            if not near:
                return None
            stays = stays and any(abs(f2 - f) <= 1e-3 * f and abs(z2 - zeta) <= 0.2 * zeta for f2, z2 in near)
        return stays


def mode_text(mode: Mode) -> str:
    """17.3487±0.0006 Hz 1.003±0.004 %"""
    f, zeta = mode.frequency_std_hz, mode.damping_ratio_std
    f_text = "" if f is None else f"±{f:.2g}"
    zeta_text = "" if zeta is None else f"±{100 * zeta:.2g}"
    return f"{mode.frequency_hz:.6g}{f_text} Hz {100 * mode.damping_ratio:.3f}{zeta_text} %"


class ModeWatch:
    """Feeds a session and looks at its modes every `update_s` of the stream, as `okid run` does.

    `say` gets a line for each update; `settled` and `modes` are those of the newest one.
    """

    def __init__(self, session: Session, update_s: float, say: Callable[[str], None] = print) -> None:
        self.session = session
        self.settled = False
        self.modes: list[Mode] = []
        self.samples = 0
        self._update = max(1, round(update_s * session.fs))
        self._say = say
        self._settling = Settling()

    def feed(self, block: Real) -> None:
        """Samples (n, channels), split where an update is due. A long silence is one update."""
        silent = len(block) > self._update and bool(np.isnan(block[:: len(block) - 1]).all())
        if silent and bool(np.isnan(block).all(axis=1).all()):
            self.session.gap(len(block))
            self._count(len(block))
            return
        while len(block):
            room = self._update - self.samples % self._update
            self.session.feed(block[:room])
            self._count(min(room, len(block)))
            block = block[room:]

    def follow(self, blocks: Iterable[Real]) -> None:
        """All of them."""
        for block in blocks:
            self.feed(block)

    def _count(self, samples: int) -> None:
        before, self.samples = self.samples, self.samples + samples
        if self.samples // self._update != before // self._update:
            self._look()

    def _look(self) -> None:
        self.modes = self.session.modes()
        self.settled = self._settling.add(self.modes)
        t = self.samples / self.session.fs
        if not self.modes:
            self._say(f"t {t:.3f} s: waiting for samples, no model yet")
            return
        listed = ", ".join(mode_text(mode) for mode in self.modes)
        self._say(f"t {t:.3f} s: {listed}; {'settled' if self.settled else 'settling'}")
