# SPDX-License-Identifier: MIT
"""Virtual sensors: a Kalman filter of an identified model says what sensors that are missing would show, and which
forces act, sample by sample."""

from __future__ import annotations

import ctypes
import json
import weakref
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from okid._errors import InputError
from okid.abi import host
from okid.abi.turns import Turn, in_turn
from okid.data.whole_file import whole_file
from okid.result.model import Model
from okid.shown.notebook_html import own_fields

Real = NDArray[np.float64]


class Estimate(NamedTuple):
    """Of one sample, or of many in rows: what every output shows, measured or not, with one sigma (measured: 0); the
    forces, where they are estimated (else empty)."""

    y: Real
    y_std: Real
    force: Real
    force_std: Real

    def _repr_html_(self) -> str:
        return own_fields(self)


class VirtualSensors:
    """Kalman filter of `model` for samples of which some channels are missing (NaN), for a while or for good.

    `noise`: covariance (n_y, n_y) of the innovations, what the model's predictor leaves (VirtualSensors.of() takes it
    from a record, on which it also tries how large the deviations of each sensor have to be). The state noise is that
    of the innovation form, K e. A lost sensor, a gap of all of them and an output that was only there in the test are
    one and the same: NaN.

    `force_std`: the inputs of the model are not measured but estimated (joint input-state): random forces of this
    standard deviation (one or n_u) whose spectrum falls off above `force_hz`; no more than there are sensors.

    >>> import numpy as np, okid
    >>> force, y = okid.demo_record()
    >>> result = okid.identify(force, y, fs=1000.0)
    >>> sensors = okid.VirtualSensors.of(result.model, force, y)
    >>> lost = y.copy()
    >>> lost[:, 1] = np.nan  # the sensor on the second mass is gone
    >>> found = sensors.run(lost, force)
    >>> bool(np.std(found.y[500:, 1] - y[500:, 1]) < 0.05 * np.std(y[:, 1]))
    True
    """

    def __init__(
        self, model: Model, noise: ArrayLike, *, force_std: ArrayLike | None = None, force_hz: float | None = None
    ) -> None:
        n_u = model.B.shape[1]
        std = None if force_std is None else np.broadcast_to(np.asarray(force_std, dtype=np.float64), (n_u,)).tolist()
        if std is not None and n_u == 0:
            raise InputError("force_std belongs to inputs, the model has none")
        given = {
            "schema": "okid.virtual/1",
            "model": {name: np.asarray(getattr(model, name)).tolist() for name in "ABCDK"} | {"dt": model.dt},
            "noise": np.asarray(noise, dtype=np.float64).tolist(), "force_std": std, "force_hz": force_hz,
        }  # fmt: skip
        handle = ctypes.c_void_p()
        host.call("virtual_create", json.dumps(given).encode(), ctypes.byref(handle))
        self._hold(handle, n_u, len(model.C), std is not None)

    def _hold(self, handle: ctypes.c_void_p, n_u: int, n_y: int, estimates: bool) -> None:
        self._handle, self._inputs, self._n_y, self._estimates = handle, n_u, n_y, estimates
        self._turn = Turn()
        weakref.finalize(self, host.library().okid_host_virtual_delete, handle).atexit = False

    @property
    def _n_u(self) -> int:
        """Inputs that are measured."""
        return 0 if self._estimates else self._inputs

    @classmethod
    def of(cls, model: Model, u: ArrayLike | None, y: ArrayLike, *, force_std: ArrayLike | None = None,
           force_hz: float | None = None) -> Self:  # fmt: skip
        """With means and noise of a record: u (N, n_u), None without inputs, and y (N, n_y); NaN = missing."""
        n_y = len(model.C)
        out = cls(model, np.eye(n_y), force_std=force_std, force_hz=force_hz)
        rows = out._rows(y, u, out._inputs)
        host.call("virtual_learn", out._handle, len(rows), rows.ctypes.data)
        return out

    @in_turn
    def save(self, path: str | Path, *, inputs: Sequence[str] = (), outputs: Sequence[str] = ()) -> None:
        """Write the file that [virtual] of a CONFIG.toml names; channels: `inputs`, `outputs` (default u1, y1).
        Raises InputError."""
        text: bytes = host.library().okid_host_virtual_json(self._handle)
        about = json.loads(text)
        for key, names in (("inputs", inputs), ("outputs", outputs)):
            if names and len(names) != len(about[key]):
                raise InputError(f"{key} has {len(names)} names, expected {len(about[key])}")
            about[key] = list(names) or about[key]
        with whole_file(Path(path)) as part:
            part.write_text(json.dumps(about) + "\n", encoding="utf-8")

    @in_turn
    def reset(self) -> None:
        """Forget the state: what comes next begins at rest."""
        host.library().okid_host_virtual_reset(self._handle)

    def _rows(self, y: ArrayLike, u: ArrayLike | None, n_u: int) -> Real:
        answer = np.asarray(y, dtype=np.float64)
        answer = answer[:, None] if answer.ndim == 1 else answer
        drive = np.zeros((len(answer), 0)) if u is None else np.asarray(u, dtype=np.float64).reshape(len(answer), -1)
        if answer.shape[1:] != (self._n_y,) or drive.shape[1] != n_u:
            raise InputError(
                f"a sample of {answer.shape[-1]} outputs and {drive.shape[1]} inputs, expected {self._n_y} (NaN = "
                f"missing) and {n_u}"
            )
        return np.ascontiguousarray(np.hstack([drive, answer]))

    def step(self, y: ArrayLike, u: ArrayLike | None = None) -> Estimate:
        """One sample: y (n_y,) with NaN where a sensor is missing, u (n_u,) where the model has measured inputs (NaN:
        one that is missing, where of() has learnt how strong it is)."""
        answer, drive = np.asarray(y, dtype=np.float64), None if u is None else np.asarray(u, dtype=np.float64)
        found = self.run(answer.reshape(1, -1), None if drive is None else drive.reshape(1, -1))
        return Estimate(*(each[0] for each in found))

    @in_turn
    def run(self, y: ArrayLike, u: ArrayLike | None = None) -> Estimate:
        """Many samples, y (N, n_y) and u (N, n_u), from where the filter stands."""
        rows = self._rows(y, u, self._n_u)
        count, forces = len(rows), self._inputs if self._estimates else 0
        out = Estimate(*(np.empty((count, width)) for width in (self._n_y, self._n_y, forces, forces)))
        host.call("virtual_run", self._handle, count, rows.ctypes.data, *(each.ctypes.data for each in out))
        return out

    @in_turn
    def forecast(self, steps: int, u: ArrayLike | None = None) -> Estimate:
        """The next samples without any measurement, u (steps, n_u) where the model has measured inputs (default 0); the
        filter stays where it is."""
        handle, ahead = ctypes.c_void_p(), type(self).__new__(type(self))
        host.call("virtual_copy", self._handle, ctypes.byref(handle))
        ahead._hold(handle, self._inputs, self._n_y, self._estimates)
        drive = np.zeros((steps, self._n_u)) if u is None else u
        return ahead.run(np.full((steps, self._n_y), np.nan), drive)
