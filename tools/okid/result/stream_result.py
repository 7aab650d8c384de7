# SPDX-License-Identifier: MIT
"""The result of a Session as it is made in Python."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from okid import abi
from okid.result.mkr import mass_table, mkr_dict, pdc_dict
from okid.result.parts import MassMatrices, Mode, ProportionalDamping, known
from okid.result.result import Result, _Parsed

if TYPE_CHECKING:
    from okid.abi.identifier import Identified, Identifier
    from okid.result.uncertainty import Uncertainty

Real = NDArray[np.float64]


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


class StreamResult(Result):
    """okid.result/1 and table out of the attributes."""

    def as_result(self, identifier: Identifier) -> Result:
        """What a caller gets."""
        out = Result._made(_Parsed(self.to_dict(), self._text(), identifier))
        out.observer = self.observer
        return out

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
            **({} if self.mkr is None else {"mkr": mkr_dict(self.mkr)}),
            **({} if self.pdc is None else {"pdc": pdc_dict(self.pdc)}),
            "warnings": [{"code": w.code, "text": w.text} for w in self.warnings],
        }

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
        if self.mkr is not None and self.pdc is not None:
            lines += ["", mass_table(self.mkr, self.pdc)]
        lines += [f"warning {w.code}: {w.text}" for w in self.warnings]
        return "\n".join(lines)
