# SPDX-License-Identifier: MIT
"""The parts of a result: modes, fits, warnings, matrices; each is made of its key of okid.result/1."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from okid.shown.notebook_html import own_fields

Real = NDArray[np.float64]
_Part = Mapping[str, Any]


def known(value: float | None) -> float | None:
    """The number, None for one that is missing or not finite."""
    return float(value) if value is not None and math.isfinite(value) else None


def numbers(nested: Any) -> Real:
    """Nested lists as an array; None is NaN."""
    return np.array(nested, dtype=np.float64)


def _optional(nested: Any) -> Real | None:
    return None if nested is None else numbers(nested)


# The numbers of a mode, in the order of tables: keys of okid.result/1 and fields of Mode. Its checks, ModalTable, .mat
# and HDF5 follow this list.
MODE_NUMBERS = (
    "frequency_hz", "frequency_std_hz", "damping_ratio", "damping_ratio_std", "mpc", "emac", "cmi", "confident",
    "found_in", "modal_mass", "modal_mass_std",
)  # fmt: skip


class Observer(NamedTuple):
    """What the least-squares step found; see okid_observer_info_t."""

    ridge: float
    radius: float
    radius_plain: float
    condition: float
    input_excitation: float

    def _repr_html_(self) -> str:
        return own_fields(self)


class Mode(NamedTuple):
    """One vibration mode. shape (n_y,) complex, largest entry 1; mpc and emac 0..1; std: 1 sigma, None = not known.
    Of a roving hammer shape has an entry a place (Result.shape_dofs); modal_mass: kg of this shape, where a force and a
    sensor share a place. shape / sqrt(modal_mass) is mass-normalised.

    confident: an expert would sign it; found_in: share of the runs of "auto" that could have seen it and did; why:
    codes of why it is doubtful, why_text the same in words. None: not judged, or by EMAC alone (found_in of a
    named method). Entries of outputs that were left out (remark "screened") are NaN.
    """

    frequency_hz: float
    damping_ratio: float
    shape: NDArray[np.complex128]
    mpc: float
    emac: float
    frequency_std_hz: float | None = None
    damping_ratio_std: float | None = None
    shape_re_std: Real | None = None
    shape_im_std: Real | None = None
    confident: bool | None = None
    found_in: float | None = None
    why: tuple[str, ...] = ()
    why_text: tuple[str, ...] = ()
    modal_mass: float | None = None
    modal_mass_std: float | None = None

    @property
    def doubtful(self) -> bool:
        """Listed by "auto", but not signed: tables leave it out."""
        return self.found_in is not None and not self.confident

    @property
    def cmi(self) -> float:
        """Consistent-mode indicator EMAC x MPC, 0..1."""
        return self.emac * self.mpc

    @classmethod
    def of(cls, one: _Part) -> Mode:
        """Of an entry of "modes"."""
        f, zeta, mpc, emac = numbers([one[key] for key in ("frequency_hz", "damping_ratio", "mpc", "emac")]).tolist()
        shape = numbers(one["shape_re"]) + 1j * numbers(one["shape_im"])
        why, texts = (tuple(map(str, one.get(key) or one.get("why") or ())) for key in ("why", "why_text"))
        more: dict[str, Any] = {key: known(one.get(key)) for key in MODE_NUMBERS if key in cls._field_defaults}
        more |= {f"shape_{part}_std": _optional(one.get(f"shape_{part}_std")) for part in ("re", "im")}
        more["confident"] = one.get("confident")
        return cls(f, zeta, shape, mpc, emac, why=why, why_text=texts, **more)

    def _repr_html_(self) -> str:
        return own_fields(self)


class Fit(NamedTuple):
    """100 (1 - |y - yhat| / |y - mean|) for each output by name; None = not available."""

    simulation_percent: dict[str, float | None]
    prediction_percent: dict[str, float | None]

    @classmethod
    def of(cls, fit: _Part, outputs: Sequence[str]) -> Fit:
        """Of "fit"; null stands for all outputs."""
        return cls(*(dict(fit[key] or dict.fromkeys(outputs)) for key in cls._fields))

    def _repr_html_(self) -> str:
        return own_fields(self)


class Warning(NamedTuple):
    """A reason to doubt a valid result, or a fact that its reader must know."""

    code: str
    text: str

    def _repr_html_(self) -> str:
        return own_fields(self)


@dataclass
class MassMatrices:
    """M (kg), K (N/m), R (N s/m), R_normal_modes: (n_x, n_x), symmetric; degrees of freedom 1 .. n_x in order.

    `checks` tells whether they can be believed, `modes` what they were made of: docs of okid/mkr.h. Paper eq. 96-123.
    """

    M: Real
    K: Real
    R: Real
    R_normal_modes: Real
    checks: dict[str, Any]
    modes: list[dict[str, Any]]
    M_std: Real | None = None
    K_std: Real | None = None
    R_std: Real | None = None
    R_normal_modes_std: Real | None = None

    @classmethod
    def of(cls, mkr: _Part | None) -> MassMatrices | None:
        """Of "mkr"."""
        if mkr is None:
            return None
        found = cls(
            numbers(mkr["M"]), numbers(mkr["K"]), numbers(mkr["R"]), numbers(mkr["R_normal_modes"]),
            mkr.get("checks") or {}, mkr.get("modes") or [],
        )  # fmt: skip
        for name in ("M_std", "K_std", "R_std", "R_normal_modes_std"):
            setattr(found, name, _optional(mkr.get(name)))
        return found

    def _repr_html_(self) -> str:
        return own_fields(self)


@dataclass
class ProportionalDamping:
    """R = alpha M + beta K (N s/m) from the damping ratios; `residual`: share of them it misses. Paper eq. 124-131."""

    alpha: float
    beta: float
    R: Real
    residual: float
    condition: float
    alpha_std: float | None = None
    beta_std: float | None = None

    @classmethod
    def of(cls, pdc: _Part | None) -> ProportionalDamping | None:
        """Of "pdc"."""
        if pdc is None:
            return None
        alpha, beta, residual, condition = numbers([pdc.get(k) for k in ("alpha", "beta", "residual", "condition")])
        return cls(float(alpha), float(beta), numbers(pdc["R"]), float(residual), float(condition),
                   pdc.get("alpha_std"), pdc.get("beta_std"))  # fmt: skip

    def _repr_html_(self) -> str:
        return own_fields(self)


@dataclass(frozen=True)
class Refinement:
    """What came of it: steps, log-likelihood gained over the start and left (of one more step), the mean of N r^2 over
    the autocorrelations of the residuals at lags 1..20 (1 = white), residual standard deviation of each output, order
    of the autoregression that the noise was taken for (0 = white)."""

    iterations: int
    converged: bool
    samples: int
    gain: float
    decrement: float
    whiteness: float
    noise_std: Real
    noise_order: int = 0

    @classmethod
    def of(cls, part: _Part | None) -> Refinement | None:
        """Of "refinement"."""
        if part is None:
            return None
        gain, left, white = numbers([part["log_likelihood_gain"], part["log_likelihood_left"], part["whiteness"]])
        return cls(part["iterations"], part["converged"], part["samples"], float(gain), float(left), float(white),
                   numbers(list(part["noise_std"].values())), part.get("noise_order", 0))  # fmt: skip

    def _repr_html_(self) -> str:
        return own_fields(self)


@dataclass(frozen=True)
class Skew:
    """Delay and standard deviation of each output, µs (> 0: late against the forces); `late` those that were corrected.

    `scatter`: what is left of the angles of the modes over its deviation; above 3 the delays are undetermined.
    """

    us: Real
    std_us: Real
    late: NDArray[np.bool_]
    undetermined: bool
    scatter: float

    @classmethod
    def of(cls, part: _Part | None, outputs: Sequence[str]) -> Skew | None:
        """Of "skew"."""
        if part is None:
            return None
        late = np.array([name in part["outputs_corrected"] for name in outputs])
        return cls(numbers(list(part["us"].values())), numbers(list(part["std_us"].values())), late,
                   part["undetermined"], float(numbers(part["scatter"])))  # fmt: skip

    def _repr_html_(self) -> str:
        return own_fields(self)
