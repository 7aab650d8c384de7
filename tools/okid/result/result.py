# SPDX-License-Identifier: MIT
"""An identified model as people and programs see it: modes, fit, table, okid.result/1."""

from __future__ import annotations

import json
from collections.abc import Iterable
from dataclasses import dataclass, field
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from okid import abi
from okid._errors import Error
from okid.data.whole_file import whole_file
from okid.result.mkr import MassMatrices, ProportionalDamping, mass_table
from okid.result.modal_table import ModalTable, known
from okid.result.model import Model
from okid.result.stabilization import Criteria, Stabilization, of_identifiers

if TYPE_CHECKING:
    from okid.abi.identifier import Identified, Identifier, Observer
    from okid.result.refine import Refinement
    from okid.result.skew import Skew
    from okid.result.uncertainty import Uncertainty

Real = NDArray[np.float64]


class Mode(NamedTuple):
    """One vibration mode. shape (n_y,) complex, largest entry 1; mpc and emac 0..1; std: 1 sigma, None = not known."""

    frequency_hz: float
    damping_ratio: float
    shape: NDArray[np.complex128]
    mpc: float
    emac: float
    frequency_std_hz: float | None = None
    damping_ratio_std: float | None = None
    shape_re_std: Real | None = None
    shape_im_std: Real | None = None

    @property
    def cmi(self) -> float:
        """Consistent-mode indicator EMAC x MPC, 0..1."""
        return self.emac * self.mpc


class Fit(NamedTuple):
    """100 (1 - |y - yhat| / |y - mean|) for each output by name; None = not available."""

    simulation_percent: dict[str, float | None]
    prediction_percent: dict[str, float | None]


class Remark(NamedTuple):
    """A remark on a valid result."""

    code: str
    text: str


def modes_of(found: Identified) -> list[Mode]:
    """The modes of an Identified as a list, ascending in frequency."""
    return [
        Mode(float(f), float(z), shape, float(mpc), float(emac))
        for f, z, shape, mpc, emac in zip(
            found.frequency_hz, found.damping_ratio, found.shapes, found.mpc, found.emac, strict=True
        )
    ]


def with_deviations(modes: list[Mode], sigma: Uncertainty) -> list[Mode]:
    """The same modes with their standard deviations."""
    return [
        mode._replace(
            frequency_std_hz=known(float(sigma.frequency_hz[k])),
            damping_ratio_std=known(float(sigma.damping_ratio[k])),
            shape_re_std=sigma.shape_re[k],
            shape_im_std=sigma.shape_im[k],
        )
        for k, mode in enumerate(modes)
    ]


def put_deviations(sigma: Uncertainty, mkr: MassMatrices | None, pdc: ProportionalDamping | None) -> None:
    """Standard deviations of the matrices, alpha and beta to where they are, if they are."""
    if mkr is not None:
        mkr.M_std, mkr.K_std, mkr.R_std = sigma.M, sigma.K, sigma.R
        mkr.R_normal_modes_std = sigma.R_normal_modes
    if pdc is not None:
        pdc.alpha_std, pdc.beta_std = known(sigma.alpha), known(sigma.beta)


def _spread(value: float | None, factor: float) -> str:
    """One cell of a column of standard deviations."""
    number = known(value)
    return f" {'-' if number is None else format(factor * number, '.2g'):>9}"


def _nested(array: Real) -> Any:
    if array.ndim == 1:
        return [known(x) for x in array.tolist()]
    return [_nested(row) for row in array]


@dataclass(repr=False)
class Result:
    """What identify() returns. singular_values (s,) of H(0), the correlations (ERA/DC) or the projection (n4sid);
    markov (count, n_y, n_u) Y_0 .. by eq. 40, n4sid of the model.

    mkr and pdc: mass, stiffness and damping where the channels have degrees of freedom, else None.
    """

    method: str
    fs_hz: float
    samples: int
    records: int
    gaps: int
    inputs: list[str]
    outputs: list[str]
    p: int
    rows: int
    order: int
    hold: str
    detrend: str
    start: str
    singular_values: Real
    model: Model
    markov: Real
    modes: list[Mode]
    fit: Fit
    warnings: list[Remark]
    observer: Observer
    identifier: Identifier | None = field(default=None, repr=False, compare=False)
    mkr: MassMatrices | None = None
    pdc: ProportionalDamping | None = None
    hankel: str | None = None  # of methods with an observer
    singular_noise: float | None = None  # singular values up to this can come from the observer's errors alone
    refinement: Refinement | None = None  # with refine=True
    skew: Skew | None = None  # with refine=True and degrees of freedom

    def __getstate__(self) -> dict[str, Any]:
        return {**self.__dict__, "identifier": None}  # holds memory of the C library: cannot be pickled

    def to_dict(self) -> dict[str, Any]:
        """okid.result/1 (docs/result-json): plain lists and numbers, None for a missing number."""
        m = self.model
        return {
            "schema": "okid.result/1",
            "version": abi.library().okid_version().decode(),
            "method": self.method,
            "fs_hz": self.fs_hz,
            "samples": self.samples,
            "records": self.records,
            "gaps": self.gaps,
            "inputs": list(self.inputs),
            "outputs": list(self.outputs),
            "p": self.p,
            "rows": self.rows,
            "hankel": self.hankel,
            "order": self.order,
            "hold": self.hold,
            "detrend": self.detrend,
            "start": self.start,
            "singular_values": _nested(self.singular_values),
            "singular_noise": known(self.singular_noise),
            "model": {
                "dt": m.dt,
                **{name: _nested(getattr(m, name)) for name in "ABCDK"},
                "x0": None if m.x0 is None else _nested(m.x0),
            },
            "markov": {"Y": _nested(self.markov)},
            "modes": [
                {
                    "frequency_hz": mode.frequency_hz,
                    "damping_ratio": mode.damping_ratio,
                    "shape_re": _nested(mode.shape.real),
                    "shape_im": _nested(mode.shape.imag),
                    "frequency_std_hz": known(mode.frequency_std_hz),
                    "damping_ratio_std": known(mode.damping_ratio_std),
                    "shape_re_std": None if mode.shape_re_std is None else _nested(mode.shape_re_std),
                    "shape_im_std": None if mode.shape_im_std is None else _nested(mode.shape_im_std),
                    "mpc": known(mode.mpc),
                    "emac": known(mode.emac),
                    "cmi": known(mode.cmi),
                }
                for mode in self.modes
            ],
            "fit": {
                "simulation_percent": dict(self.fit.simulation_percent),
                "prediction_percent": dict(self.fit.prediction_percent),
            },
            **({} if self.refinement is None else {"refinement": self.refinement.to_dict(self.outputs)}),
            **({} if self.skew is None else {"skew": self.skew.to_dict(self.outputs)}),
            **({} if self.mkr is None else {"mkr": self.mkr.to_dict()}),
            **({} if self.pdc is None else {"pdc": self.pdc.to_dict()}),
            "warnings": [{"code": w.code, "text": w.text} for w in self.warnings],
        }

    def save(self, path: str | Path) -> None:
        """Write okid.result/1 as JSON, whole or not at all (temporary file, then rename), else InputError."""
        with whole_file(path) as part:
            part.write_text(json.dumps(self.to_dict(), allow_nan=False) + "\n", encoding="utf-8")

    def to_scipy(self) -> Any:
        """scipy.signal.StateSpace with dt."""
        return self.model.to_scipy()

    def to_control(self) -> Any:
        """control.StateSpace with dt; ImportError says how to install python-control."""
        return self.model.to_control()

    def table(self) -> ModalTable:
        """The modes as rows (pandas.DataFrame(result.table())); str() of it: with fits and remarks, for a person."""
        return ModalTable(self.modes, self._text(), [f"{w.code}: {w.text}" for w in self.warnings])

    def _head(self) -> str:
        return (
            f"{self.method}: {self.samples} samples at {self.fs_hz:g} Hz, order {self.order}, "
            f"{len(self.inputs)} input(s), {len(self.outputs)} output(s)"
        )

    def __repr__(self) -> str:
        found = ", ".join(f"{mode.frequency_hz:.4g}" for mode in self.modes[:12])
        return f"<Result of {self._head()}, modes at {found}{' ..' * (len(self.modes) > 12)} Hz>"

    def _repr_html_(self) -> str:
        return f"<p>{escape(self._head())}</p>" + self.table()._repr_html_()

    def _text(self) -> str:
        f_std = any(known(mode.frequency_std_hz) is not None for mode in self.modes)
        z_std = any(known(mode.damping_ratio_std) is not None for mode in self.modes)
        lines = [
            f"{self.method}: {self.samples} samples at {self.fs_hz:g} Hz, {self.records} record(s), {self.gaps} gap(s)",
            f"p {self.p}, {self.rows} block rows, order {self.order}, detrend {self.detrend}, start {self.start}",
            "",
            f"   #       f [Hz]{'         ±' * f_std}     ζ [%]{'         ±' * z_std}     MPC    EMAC     CMI",
        ]
        for k, mode in enumerate(self.modes, 1):
            line = f"{k:4d} {mode.frequency_hz:12.5f}"
            line += _spread(mode.frequency_std_hz, 1.0) if f_std else ""
            line += f" {100 * mode.damping_ratio:9.4f}"
            line += _spread(mode.damping_ratio_std, 100.0) if z_std else ""
            lines.append(f"{line} {mode.mpc:7.4f} {mode.emac:7.4f} {mode.cmi:7.4f}")
        width = max([6, *(len(name) for name in self.outputs)])
        lines += ["", f"{'output':<{width}}  simulated [%]  predicted [%]"]
        for name in self.outputs:
            pair = (self.fit.simulation_percent.get(name), self.fit.prediction_percent.get(name))
            cells = ["-" if value is None else f"{value:.2f}" for value in pair]
            lines.append(f"{name:<{width}}  {cells[0]:>13}  {cells[1]:>13}")
        if self.refinement is not None:
            lines += ["", self.refinement.text(self.outputs)]
        if self.mkr is not None and self.pdc is not None:
            lines += ["", mass_table(self.mkr, self.pdc)]
        lines += [f"warning {w.code}: {w.text}" for w in self.warnings]
        return "\n".join(lines)

    def stabilization(self, orders: Iterable[int] | None = None, criteria: Criteria | None = None) -> Stabilization:
        """Poles of other orders from the same decomposition, each compared with the order before, and their clusters.

        Default: every even order the data carry. Orders they cannot carry are left out. Several horizons:
        okid.stabilization(). Raises Error on a result that was unpickled: it has no decomposition any more.
        """
        if self.identifier is None:
            raise Error("this result no longer holds its decomposition: identify again for a stabilization diagram")
        return of_identifiers([self.identifier], orders, criteria)

    def plot_stabilization(self, ax: Any = None, orders: Iterable[int] | None = None) -> Any:
        """Draw the stabilization diagram into `ax` (default: a new matplotlib figure); returns the axes.

        Lines: modes of this result; bands and rings: the clusters that hold, and the pole nearest each one's medians.
        """
        from okid.result.figures import draw_stabilization

        if ax is None:
            from matplotlib.figure import Figure

            ax = Figure(figsize=(9.0, 4.5), layout="constrained").add_subplot()
        draw_stabilization(ax, self.stabilization(orders), self.fs_hz / 2.0, [mode.frequency_hz for mode in self.modes])
        return ax
