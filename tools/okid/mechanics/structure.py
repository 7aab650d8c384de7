# SPDX-License-Identifier: MIT
"""The forward problem: a structure of known M, R and K, its modes, and the model a data acquisition would see."""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from okid import abi
from okid._errors import InputError
from okid.result.model import Model
from okid.result.parts import Mode
from okid.shown.notebook_html import own_fields

Real = NDArray[np.float64]
SENSING = ("displacement", "velocity", "acceleration")  # in the order of okid_sensing_t
_HOLDS = {"zoh": abi.HOLD_ZERO, "foh": abi.HOLD_FIRST}


def _square(name: str, given: ArrayLike, size: int | None) -> Real:
    out = np.asarray(given, dtype=np.float64)
    if out.ndim != 2 or out.shape[0] != out.shape[1] or not np.all(np.isfinite(out)):
        raise InputError(f"{name} has shape {out.shape}, expected a square matrix of finite numbers")
    if size is not None and len(out) != size:
        raise InputError(f"{name} has {len(out)} degrees of freedom, M has {size}")
    return out


@dataclass(frozen=True)
class Structure:
    """M x'' + R x' + K x = f. M (kg, positive definite), R (N s/m), K (N/m): (n_x, n_x). Paper eq. 1.

    >>> import okid
    >>> frame = okid.Structure.chain([1.0, 0.8, 1.2], [3e4, 2e4, 2.5e4], zeta=(0.009, 0.009))
    >>> [round(mode.frequency_hz, 2) for mode in frame.modes()]
    [10.96, 31.84, 45.66]
    """

    M: Real
    R: Real
    K: Real

    def __post_init__(self) -> None:
        mass = _square("M", self.M, None)
        try:
            np.linalg.cholesky(mass)
        except np.linalg.LinAlgError:
            raise InputError("M is not positive definite: every motion needs a mass") from None
        object.__setattr__(self, "M", mass)
        object.__setattr__(self, "R", _square("R", self.R, len(mass)))
        object.__setattr__(self, "K", _square("K", self.K, len(mass)))

    @classmethod
    def chain(cls, masses: Sequence[float], springs: Sequence[float], zeta: tuple[float, float] | None = None) -> Self:
        """Masses (kg) in a row, spring k (N/m) below mass k, the first to the ground; `zeta` damping ratios of the
        first and the last mode, proportional (R = alpha M + beta K, paper eq. 124), None = undamped.

        Raises InputError for unequal lengths."""
        if len(masses) != len(springs) or not len(masses):
            raise InputError(
                f"found {len(masses)} masses and {len(springs)} springs, expected one spring for each mass"
            )
        mass, below = np.diag(np.asarray(masses, np.float64)), np.asarray(springs, np.float64)
        stiffness = np.diag(below) + np.diag(np.append(below[1:], 0.0))
        stiffness -= np.diag(below[1:], 1) + np.diag(below[1:], -1)
        free = cls(mass, np.zeros_like(mass), stiffness)
        if zeta is None:
            return free
        omega = [2.0 * np.pi * mode.frequency_hz for mode in free.modes(damped=False)]
        ends = np.array([omega[0], omega[-1]])
        if len(omega) == 1:
            return cls(mass, 2.0 * zeta[0] * omega[0] * mass, stiffness)
        alpha, beta = np.linalg.solve(np.column_stack([0.5 / ends, 0.5 * ends]), np.asarray(zeta, np.float64))
        return cls(mass, alpha * mass + beta * stiffness, stiffness)

    @property
    def n_x(self) -> int:
        """Degrees of freedom."""
        return len(self.M)

    def modes(self, damped: bool = True) -> list[Mode]:
        """Underdamped modes, ascending in frequency, shapes (n_x,) of the displacements with the largest entry 1."""
        n, library = self.n_x, abi.library()
        M, K, R = (np.asfortranarray(one) for one in (self.M, self.K, self.R))
        given = abi.Mechanics(n, M=abi.pointer(M), R=abi.pointer(R if damped else None), K=abi.pointer(K))
        size = int(library.okid_mechanics_memsize(n, n))
        frequency, ratio, real, imaginary = np.empty(n), np.empty(n), np.empty((n, n)), np.empty((n, n))
        out = abi.Modes(
            0, 0.0, abi.pointer(frequency), abi.pointer(ratio), None, abi.pointer(real), abi.pointer(imaginary)
        )
        work = abi.block(size)
        status = library.okid_mechanics_modes(given, out, work.ctypes.data, size)
        abi.check(status, "the modes of M, R and K")
        shapes = real + 1j * imaginary
        return [Mode(float(frequency[k]), float(ratio[k]), shapes[k], 1.0, 1.0) for k in range(out.count)]

    def model(
        self,
        fs: float,
        force_dofs: Sequence[int],
        sense_dofs: Sequence[int],
        sensing: str | Sequence[str] = "acceleration",
        hold: str = "zoh",
    ) -> Model:
        """The discrete model at `fs` Hz with forces at and sensors on degrees of freedom from 1 (-3: at 3 with reversed
        polarity); `sensing` "displacement", "velocity" or "acceleration", one for all or one each; `hold` "zoh" or
        "foh" as in okid.identify(). K (Kalman gain) is zero. Raises InputError. Paper eq. 6-16."""
        n, library = self.n_x, abi.library()
        if hold not in _HOLDS:
            raise InputError(f"hold is {hold!r}, expected 'zoh' or 'foh'")
        if not (np.isfinite(fs) and fs > 0.0):
            raise InputError(f"fs is {fs!r}, expected a sample rate in Hz > 0")
        names = [sensing] * len(sense_dofs) if isinstance(sensing, str) else list(sensing)
        if len(names) != len(sense_dofs) or not set(names) <= set(SENSING):
            raise InputError(
                f"sensing is {sensing!r}, expected one of {', '.join(SENSING)}, for all sensors or for each"
            )
        forces, sensors = _places("force_dofs", force_dofs, n), _places("sense_dofs", sense_dofs, n)
        kinds = np.array([SENSING.index(name) for name in names], np.int32)
        n_u, n_y = len(force_dofs), len(sense_dofs)
        push = np.zeros((n, n_u), order="F")
        maps = [np.zeros((n_y, n), order="F") for _ in SENSING]
        abi.check(library.okid_mechanics_inputs(n, n_u, *forces[:2], abi.pointer(push)), "force_dofs")
        status = library.okid_mechanics_outputs(
            n, n_y, *sensors[:2], kinds.ctypes.data_as(abi.int32s), *map(abi.pointer, maps)
        )
        abi.check(status, "sense_dofs")
        kept = [np.asfortranarray(one) for one in (self.M, self.R, self.K)]
        raw = abi.Mechanics(n, n_u, n_y, *map(abi.pointer, [*kept, push, *maps]))
        out = [np.zeros(shape, order="F") for shape in ((2 * n, 2 * n), (2 * n, n_u), (n_y, 2 * n), (n_y, n_u))]
        work = abi.block(int(library.okid_mechanics_memsize(n, n_u)))
        status = library.okid_mechanics_continuous(
            ctypes.byref(raw), *map(abi.pointer, out), work.ctypes.data, work.size
        )
        abi.check(status, "M, R and K")
        A, B, D = _sampled(out, 1.0 / fs, _HOLDS[hold])
        return Model(A, B, np.ascontiguousarray(out[2]), D, np.zeros((2 * n, n_y)), 1.0 / fs)

    def _repr_html_(self) -> str:
        return own_fields(self)


def _places(name: str, dofs: Sequence[int], n: int) -> tuple[Any, Any, Any]:
    """Pointers to places from 0 and gains of +-1, and what keeps them alive."""
    for dof in dofs:
        if isinstance(dof, bool) or not isinstance(dof, int | np.integer) or not 1 <= abs(int(dof)) <= n:
            raise InputError(f"{name}: found {dof!r}, expected degrees of freedom from 1 to {n}")
    if not len(dofs):
        raise InputError(f"{name} is empty, expected at least one degree of freedom")
    places = np.array([abs(int(dof)) - 1 for dof in dofs], np.int32)
    gains = np.array([np.sign(int(dof)) for dof in dofs], np.float64)
    return places.ctypes.data_as(abi.int32s), abi.pointer(gains), (places, gains)


def _sampled(continuous: list[Real], dt: float, hold: int) -> tuple[Real, Real, Real]:
    """A, B and D of the sampled model."""
    library = abi.library()
    view = abi.ModelView(
        continuous[1].shape[1], len(continuous[2]), len(continuous[0]), *map(abi.pointer, continuous), None
    )
    out = [np.empty(continuous[k].shape, order="F") for k in (0, 1, 3)]
    work = abi.block(int(library.okid_mechanics_hold_memsize(view.n_u, view.n_y, view.n_z)))
    status = library.okid_mechanics_c2d(
        ctypes.byref(view), dt, hold, *map(abi.pointer, out), work.ctypes.data, work.size
    )
    abi.check(status, "sampling the model")
    A, B, D = (np.ascontiguousarray(one) for one in out)
    return A, B, D
