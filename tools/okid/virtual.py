# SPDX-License-Identifier: MIT
"""Virtual sensors: a Kalman filter of an identified model says what sensors that are missing would show, and which
forces act, sample by sample."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from okid._errors import InputError
from okid.result.model import Model

Real = NDArray[np.float64]
SETTLED = 1e-10  # relative change of the covariance below which it no longer moves
TRIED = 1500  # samples of a record on which the deviations of missing sensors are tried


class Estimate(NamedTuple):
    """Of one sample, or of many in rows: what every output shows, measured or not, with one sigma (measured: 0); the
    forces, where they are estimated (else empty)."""

    y: Real
    y_std: Real
    force: Real
    force_std: Real


def _covariance(noise: ArrayLike, n_y: int) -> Real:
    out = np.asarray(noise, dtype=np.float64)
    if out.shape != (n_y, n_y) or not np.allclose(out, out.T) or np.min(np.linalg.eigvalsh(out), initial=1.0) <= 0.0:
        raise InputError(f"noise has shape {out.shape}, expected a positive definite ({n_y}, {n_y}) covariance")
    return out


class VirtualSensors:
    """Kalman filter of `model` for samples of which some channels are missing (NaN), for a while or for good.

    `noise`: covariance (n_y, n_y) of the innovations, what the model's predictor leaves (VirtualSensors.of() takes it
    from a record, on which it also tries how large the deviations of each sensor have to be). The state noise is that
    of the innovation form, K e. A lost sensor, a gap of all of them and an output that was only there in the test are
    one and the same: NaN.

    `force_std`: the inputs of the model are not measured but estimated (joint input-state): random forces of this
    standard deviation (one or n_u) whose spectrum falls off above `force_hz`; as many as sensors at most can be told.

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
        n, n_u, n_y = len(model.A), model.B.shape[1], len(model.C)
        self._R = _covariance(noise, n_y)
        self._A, self._B, self._C, self._D = model.A, model.B, model.C, model.D
        self._Q, self._S = model.K @ self._R @ model.K.T, model.K @ self._R
        self._forces = 0
        if force_std is not None:
            self._augment(model, np.broadcast_to(np.asarray(force_std, dtype=np.float64), (n_u,)), force_hz)
        elif force_hz is not None:
            raise InputError("force_hz belongs to force_std")
        self._n, self._grow = n, np.ones(n_y)
        self.reset()

    @classmethod
    def of(cls, model: Model, u: ArrayLike | None, y: ArrayLike, *, force_std: ArrayLike | None = None,
           force_hz: float | None = None) -> VirtualSensors:  # fmt: skip
        """With the noise of a record: u (N, n_u), None without inputs, and y (N, n_y); NaN = missing."""
        answer = np.asarray(y, dtype=np.float64).reshape(len(np.asarray(y)), -1)
        drive = np.zeros((len(answer), 0)) if u is None else np.asarray(u, dtype=np.float64).reshape(len(answer), -1)
        left = (answer - model.predict(np.nan_to_num(drive), answer))[min(5 * len(model.A), len(answer) // 4) :]
        left = left[np.all(np.isfinite(left), axis=1)]
        if len(left) < 10 * len(model.C):
            raise InputError(f"{len(left)} complete samples of y, expected {10 * len(model.C)} to know the noise")
        out = cls(model, left.T @ left / len(left), force_std=force_std, force_hz=force_hz)
        out._try_deviations(answer, None if out._forces or u is None else drive)
        return out

    def _try_deviations(self, y: Real, u: Real | None) -> None:
        """A model is never exact: the deviations of each sensor grow by what leaving it out of the record shows."""
        first = max(0, (len(y) - TRIED) // 2)
        part, drive = y[first : first + TRIED], None if u is None else np.nan_to_num(u[first : first + TRIED])
        grow = np.ones(y.shape[1])
        for k in range(y.shape[1]) if y.shape[1] > 1 else ():
            lost = part.copy()
            lost[:, k] = np.nan
            self.reset()
            found = self.run(lost, drive)
            ratio = ((found.y[:, k] - part[:, k]) / np.maximum(found.y_std[:, k], 1e-300))[len(part) // 5 :]
            ratio = ratio[np.isfinite(ratio)]
            grow[k] = max(1.0, float(np.sqrt(np.mean(ratio**2)))) if len(ratio) else 1.0
        self._grow = grow
        self.reset()

    def _augment(self, model: Model, std: Real, corner_hz: float | None) -> None:
        n, n_u = len(model.A), model.B.shape[1]
        if n_u == 0 or not np.all(std > 0.0):
            raise InputError(f"force_std is {std.tolist()} for {n_u} inputs, expected one above 0 for each")
        keep = 0.0 if corner_hz is None else float(np.exp(-2.0 * np.pi * corner_hz * model.dt))
        self._A = np.block([[model.A, model.B], [np.zeros((n_u, n)), keep * np.eye(n_u)]])
        self._B, self._D = np.zeros((n + n_u, 0)), np.zeros((len(model.C), 0))
        self._C = np.hstack([model.C, model.D])
        whole = np.zeros((n + n_u, n + n_u))
        whole[:n, :n], whole[n:, n:] = self._Q, np.diag((1.0 - keep**2) * std**2)
        self._Q, self._S = whole, np.vstack([self._S, np.zeros((n_u, len(model.C)))])
        self._forces, self._std = n_u, std

    def reset(self) -> None:
        """Forget the state: what comes next begins at rest."""
        size = len(self._A)
        self._x, self._P = np.zeros(size), np.zeros((size, size))
        if self._forces:
            self._P[self._n :, self._n :] = np.diag(self._std**2)
        self._pattern: bytes | None = None
        self._settled = False

    def _find_gains(self, there: NDArray[np.bool_]) -> None:
        """Gains for the sensors that are there, and the covariance of the next state; settled ones stay."""
        pattern = there.tobytes()
        if self._pattern == pattern and self._settled:
            return
        P, C, R = self._P, self._C, self._R
        seen = C @ P
        whole = seen @ C.T + R
        inverse = np.linalg.inv(whole[np.ix_(there, there)])
        to_state, to_y, to_x = self._A @ seen[there].T + self._S[:, there], whole[:, there], seen[there].T
        self._gain = to_state @ inverse
        self._to_y, self._to_x = to_y @ inverse, to_x @ inverse
        left = np.diag(whole) - np.einsum("ij,ij->i", self._to_y, to_y)
        self._y_std = np.where(there, 0.0, np.sqrt(np.maximum(left, 0.0)) * self._grow)
        part = np.diag(P)[self._n :] - np.einsum("ij,ij->i", self._to_x[self._n :], to_x[self._n :])
        self._force_std = np.sqrt(np.maximum(part, 0.0))
        P_next = self._A @ P @ self._A.T + self._Q - self._gain @ to_state.T
        P_next = 0.5 * (P_next + P_next.T)
        change = float(np.max(np.abs(P_next - P), initial=0.0))
        self._settled = self._pattern == pattern and change <= SETTLED * float(np.max(np.abs(P_next), initial=0.0))
        self._P, self._pattern = P_next, pattern

    def step(self, y: ArrayLike, u: ArrayLike | None = None) -> Estimate:
        """One sample: y (n_y,) with NaN where a sensor is missing, u (n_u,) where the model has measured inputs."""
        answer = np.asarray(y, dtype=np.float64).ravel()
        drive = np.zeros(0) if u is None else np.asarray(u, dtype=np.float64).ravel()
        if len(answer) != len(self._C) or len(drive) != self._B.shape[1] or not np.all(np.isfinite(drive)):
            raise InputError(
                f"a sample of {len(answer)} outputs and {len(drive)} inputs, expected {len(self._C)} (NaN = missing) "
                f"and {self._B.shape[1]} finite ones"
            )
        there = np.isfinite(answer)
        self._find_gains(there)
        expected = self._C @ self._x + self._D @ drive
        e = answer[there] - expected[there]
        now = np.where(there, answer, expected + self._to_y @ e)
        force = self._x[self._n :] + self._to_x[self._n :] @ e
        self._x = self._A @ self._x + self._B @ drive + self._gain @ e
        return Estimate(now, self._y_std.copy(), force, self._force_std.copy())

    def run(self, y: ArrayLike, u: ArrayLike | None = None) -> Estimate:
        """Many samples, y (N, n_y) and u (N, n_u), from where the filter stands."""
        answer = np.asarray(y, dtype=np.float64)
        answer = answer[:, None] if answer.ndim == 1 else answer
        drive = [None] * len(answer) if u is None else np.asarray(u, dtype=np.float64).reshape(len(answer), -1)
        rows = [self.step(one, other) for one, other in zip(answer, drive, strict=True)]
        return Estimate(*(np.array([row[k] for row in rows]) for k in range(4)))

    def forecast(self, steps: int, u: ArrayLike | None = None) -> Estimate:
        """The next samples without any measurement, u (steps, n_u) where the model has measured inputs (default 0); the
        filter stays where it is."""
        kept = self._x, self._P, self._pattern
        drive = np.zeros((steps, self._B.shape[1])) if u is None else np.asarray(u, dtype=np.float64).reshape(steps, -1)
        out = self.run(np.full((steps, len(self._C)), np.nan), drive)
        self._x, self._P, self._pattern = kept
        self._settled = False
        return out
