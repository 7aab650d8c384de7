# SPDX-License-Identifier: MIT
"""The stabilization diagram of the newest samples, made again and again in a thread that everything else precedes."""

from __future__ import annotations

import contextlib
import os
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from okid._errors import Error
from okid.abi.accumulator import Accumulator
from okid.identification.identifier import Identifier, usable_p
from okid.live.config import Identification
from okid.result.stabilization import Cluster, OrderPoles, Stabilization, default_orders, of_identifiers

Real = NDArray[np.float64]
PAUSE_S, SHARE, MOST_ORDER = 4.0, 0.15, 60
KINDS = ("new", "frequency", "damping", "shape", "stable")


@dataclass(frozen=True)
class Material:
    """Samples to identify from: stretches (count, n_u + n_y), inputs first, NaN = missing."""

    n_u: int
    n_y: int
    rate_hz: float
    stretches: list[Real]

    @property
    def samples(self) -> int:
        """In all stretches."""
        return sum(len(each) for each in self.stretches)


def _kind(row: OrderPoles, k: int) -> int:
    """Index into KINDS, as the report marks them."""
    if row.stable[k]:
        return 4
    if row.stable_shape[k]:
        return 3
    return 2 if row.stable_damping[k] else int(row.stable_frequency[k])


def _standing(found: Stabilization) -> list[Cluster]:
    """The modes that stand in the diagram as lines of stable poles: in the same share of the models that makes a
    cluster a mode. Noise of a short record comes back at many orders too, but its damping and shape do not hold."""
    stable = np.concatenate([np.zeros(0, np.int32), *(row.cluster[row.stable] for row in found)])
    counts = np.bincount(stable[stable >= 0], minlength=len(found.clusters))
    return [
        c for c, count in zip(found.clusters, counts, strict=True)
        if c.physical and count >= found.criteria.share * c.models
    ]  # fmt: skip


def _content(found: Stabilization, material: Material, p: int) -> dict[str, Any]:
    poles = [
        [round(float(row.frequency_hz[k]), 6), row.order, round(float(row.damping_ratio[k]), 6), _kind(row, k)]
        for row in found
        for k in range(len(row.frequency_hz))
    ]
    modes = [[c.frequency_hz, c.frequency_spread_hz, c.damping_ratio, c.hits, c.models] for c in _standing(found)]
    return {"samples": material.samples, "seconds": material.samples / material.rate_hz, "p": p,
            "stretches": len(material.stretches), "kinds": KINDS,
            "poles": poles, "modes": modes, "text": ""}  # fmt: skip


def draw(material: Material, wanted: Identification) -> dict[str, Any]:
    """The diagram as JSON: poles [Hz, order, damping, kind], modes [Hz, spread Hz, damping, hits, models] that
    stand as lines of stable poles, and `text` that says why there is none.

    Method, p, rows, forgetting and detrend as in the config (p smaller where samples are few). Orders: the even ones up
    to 60, or to half of the rank that the lags can have where that is less. Cost: one identification and its poles.
    """
    n_u, n_y = material.n_u, material.n_y
    p = max(1, usable_p(n_u, n_y, wanted.p, material.samples))
    detrend = "none" if wanted.detrend == "none" else "mean"
    try:
        rows = min(wanted.rows, 2 * p) if wanted.rows and p < wanted.p else wanted.rows
        identifier = Identifier(
            n_u, n_y, fs=material.rate_hz, p=p, rows=rows, max_order=MOST_ORDER, detrend=detrend, method=wanted.drawn
        )
        forgetting = wanted.forgetting or 1.0
        block = max(1, round(0.5 * material.rate_hz)) if forgetting < 1.0 else 0
        sums = Accumulator(n_u, n_y, identifier.lags, block=block, forgetting=forgetting)
        for stretch in material.stretches:
            sums.add(stretch)
            sums.add(np.full((1, n_u + n_y), np.nan))  # the next stretch is a run of its own
        identifier.run(sums)
        orders = [order for order in default_orders(identifier) if order <= MOST_ORDER]
        return _content(of_identifiers([identifier], orders), material, p)
    except Error as fault:
        return {"samples": material.samples, "text": str(fault)}


class DiagramMaker:
    """Calls `material()` and hands the diagram to `publish` while wanted(True): after every 4 s, and never more than
    15 % of one processor's time. The thread has the lowest priority the system has."""

    def __init__(
        self, material: Callable[[], Material | None], wanted: Identification,
        publish: Callable[[dict[str, Any]], None], pause_s: float = PAUSE_S,
    ) -> None:  # fmt: skip
        self._material, self._publish, self._pause_s = material, publish, pause_s
        self.identification = wanted  # of what material() gives next
        self._awake, self._stop = threading.Event(), threading.Event()
        self._thread = threading.Thread(target=self._run, name="okid-live diagram", daemon=True)

    def start(self) -> None:
        """Begin; nothing happens before wanted(True)."""
        self._thread.start()

    def wanted(self, yes: bool) -> None:
        """Is there anybody to look at it?"""
        if yes:
            self._awake.set()
        else:
            self._awake.clear()

    def stop(self) -> None:
        """End the thread; one that computes ends by itself."""
        self._stop.set()
        self._awake.set()

    def _run(self) -> None:
        with contextlib.suppress(OSError):
            os.setpriority(os.PRIO_PROCESS, threading.get_native_id(), 19)
        while True:
            self._awake.wait()
            if self._stop.is_set():
                return
            begun = time.thread_time()
            material = self._material()
            if material is not None:
                self._publish(draw(material, self.identification))
            used = time.thread_time() - begun
            if self._stop.wait(max(self._pause_s if material is not None else 0.5, used * (1.0 / SHARE - 1.0))):
                return
