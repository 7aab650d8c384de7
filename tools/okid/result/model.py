# SPDX-License-Identifier: MIT
"""A discrete state-space model at work: simulation, one-step prediction, initial state, frequency response."""

from __future__ import annotations

import ctypes
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from okid import abi, frf
from okid._errors import InputError
from okid.shown.notebook_html import own_fields

Real = NDArray[np.float64]


@dataclass
class Model:
    """x+ = A x + B u + K (y - C x - D u), y = C x + D u at the sample interval dt (s).

    A (n_z, n_z), B (n_z, n_u), C (n_y, n_z), D (n_y, n_u), K (n_z, n_y): Kalman gain. x0 (records, n_z): the initial
    state of each record the model was identified from, or None. Paper eq. 13, 15, 20.
    """

    A: Real
    B: Real
    C: Real
    D: Real
    K: Real
    dt: float
    x0: Real | None = field(default=None)

    @property
    def order(self) -> int:
        """n_z."""
        return len(self.A)

    def radius(self) -> float:
        """Spectral radius of A: stable below 1."""
        return float(np.max(np.abs(np.linalg.eigvals(self.A)))) if len(self.A) else 0.0

    def _view(self) -> tuple[abi.ModelView, list[Real]]:
        kept = [np.asfortranarray(one, dtype=np.float64) for one in (self.A, self.B, self.C, self.D, self.K)]
        sizes = (self.B.shape[1], len(self.C), len(self.A))
        return abi.ModelView(*sizes, *(abi.pointer(one) for one in kept)), kept

    def _signal(self, values: ArrayLike, channels: int, what: str) -> Real:
        given = np.ascontiguousarray(values, dtype=np.float64)
        if given.ndim == 1 and channels == 1:
            given = given[:, None]
        if given.ndim != 2 or given.shape[1] != channels:
            raise InputError(f"{what} has shape {given.shape}, the model wants (N, {channels})")
        return given

    def _state(self, x0: ArrayLike | None) -> Real | None:
        if x0 is None:
            return None
        given = np.ascontiguousarray(x0, dtype=np.float64)
        if given.shape != (len(self.A),):
            raise InputError(f"x0 has shape {given.shape}, the model wants ({len(self.A)},)")
        return given

    def simulate(self, u: ArrayLike, x0: ArrayLike | None = None) -> Real:
        """y (N, n_y) from u (N, n_u), without a look at measured outputs; x0 defaults to rest. Eq. 13, 15.

        >>> import numpy as np, okid
        >>> model = okid.demo_frame().model(1000.0, force_dofs=[1], sense_dofs=[3], sensing="displacement")
        >>> steady = model.simulate(np.ones((60000, 1)))[-1, 0]  # 1 N for a minute
        >>> round(1.0 / steady)  # N/m: the lowest column alone carries it
        30000
        """
        drive, start = self._signal(u, self.B.shape[1], "u"), self._state(x0)
        view, _kept = self._view()
        out = np.empty((len(drive), len(self.C)))
        work = np.empty(int(abi.library().okid_model_workspace(ctypes.byref(view))))
        status = abi.library().okid_model_simulate(
            ctypes.byref(view), abi.pointer(drive), len(drive), abi.pointer(start), abi.pointer(out),
            abi.pointer(work),
        )  # fmt: skip
        abi.check(status, "simulate")
        return out

    def predict(self, u: ArrayLike, y: ArrayLike, x0: ArrayLike | None = None) -> Real:
        """One-step prediction (N, n_y) from the samples before and the present input; NaN in y is skipped. Eq. 20."""
        drive, answer = self._signal(u, self.B.shape[1], "u"), self._signal(y, len(self.C), "y")
        if len(drive) != len(answer):
            raise InputError(f"u has {len(drive)} samples and y has {len(answer)}")
        start = self._state(x0)
        view, _kept = self._view()
        out = np.empty_like(answer)
        work = np.empty(int(abi.library().okid_model_workspace(ctypes.byref(view))))
        status = abi.library().okid_model_predict(
            ctypes.byref(view), abi.pointer(drive), abi.pointer(answer), len(drive), abi.pointer(start),
            abi.pointer(out), abi.pointer(work),
        )  # fmt: skip
        abi.check(status, "predict")
        return out

    def initial_state(self, u: ArrayLike, y: ArrayLike) -> Real:
        """x0 (n_z,) with which simulation fits y best in the least-squares sense; NaN in y carries no weight."""
        drive, answer = self._signal(u, self.B.shape[1], "u"), self._signal(y, len(self.C), "y")
        if len(drive) != len(answer):
            raise InputError(f"u has {len(drive)} samples and y has {len(answer)}")
        view, _kept = self._view()
        state = np.empty(len(self.A))
        work = np.empty(int(abi.library().okid_model_workspace(ctypes.byref(view))))
        status = abi.library().okid_model_initial_state(
            ctypes.byref(view), abi.pointer(drive), abi.pointer(answer), len(drive), abi.pointer(state),
            abi.pointer(work),
        )  # fmt: skip
        abi.check(status, "initial state")
        return state

    def frequency_response(self, frequency_hz: ArrayLike) -> NDArray[np.complex128]:
        """Response (F, n_y, n_u) at these frequencies."""
        return frf.synthesise(self.A, self.B, self.C, self.D, self.dt, frequency_hz)

    def to_scipy(self) -> Any:
        """scipy.signal.StateSpace with dt."""
        from scipy.signal import StateSpace

        return StateSpace(self.A, self.B, self.C, self.D, dt=self.dt)

    def to_control(self) -> Any:
        """control.StateSpace with dt; ImportError says how to install python-control."""
        try:
            import control
        except ImportError:
            raise ImportError("python-control is not installed: pip install control") from None
        return control.StateSpace(self.A, self.B, self.C, self.D, self.dt)

    def _repr_html_(self) -> str:
        return own_fields(self)
