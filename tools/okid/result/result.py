# SPDX-License-Identifier: MIT
"""An identified model as people and programs see it: modes, fit, table, okid.result/1."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, fields
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from okid._errors import Error, InputError
from okid.abi import host
from okid.data.whole_file import whole_file
from okid.result.modal_table import ModalTable
from okid.result.model import Model
from okid.result.parts import Fit, MassMatrices, Mode, Observer, ProportionalDamping, Refinement, Skew, Warning, numbers
from okid.result.result_file import read_result
from okid.result.stabilization import Criteria, Stabilization, of_identifiers
from okid.shown.notebook_html import summary

if TYPE_CHECKING:
    from okid.identification.host_result import HostResult
    from okid.identification.identifier import Identifier

Real = NDArray[np.float64]
_PLAIN = ("method", "fs_hz", "samples", "records", "gaps", "p", "rows", "order", "hold", "detrend", "start")


class _Parsed(NamedTuple):
    """An okid.result/1 object in the place of a result of the library."""

    raw: dict[str, Any]

    def json(self) -> str:
        return json.dumps(self.raw, allow_nan=False) + "\n"

    def about(self, whole: bool = True) -> dict[str, Any]:
        return self.raw

    def table(self) -> str:
        return host.table(self.json().encode(), b"the result")

    def array(self, name: str) -> Real | None:
        part: Any = self.raw
        for key in name.split("."):
            part = part.get(key) if isinstance(part, dict) else None
        return None if part is None else numbers(part)

    def identifier(self) -> Identifier | None:
        return None


@dataclass(repr=False)
class Result:
    """What identify() returns. singular_values (s,) of H(0), the correlations (ERA/DC) or the projection (n4sid);
    markov (count, n_y, n_u) Y_0 .. by eq. 40, n4sid of the model.

    Of method "auto": p and rows None, no singular values, no decomposition; `modes` lists doubtful ones too
    (mode.confident False), all of them are poles of the model.

    mkr and pdc: mass, stiffness and damping where the channels have degrees of freedom, else None.
    """

    method: str
    fs_hz: float
    samples: int
    records: int
    gaps: int
    inputs: list[str]
    outputs: list[str]
    p: int | None
    rows: int | None
    order: int
    hold: str
    detrend: str
    start: str
    singular_values: Real
    model: Model
    markov: Real
    modes: list[Mode]
    fit: Fit
    warnings: list[Warning]
    observer: Observer
    mkr: MassMatrices | None
    pdc: ProportionalDamping | None
    hankel: str | None  # of methods with an observer
    singular_noise: float | None  # singular values up to this can come from the observer's errors alone
    refinement: Refinement | None  # with refine=True
    skew: Skew | None  # with refine=True and degrees of freedom
    shape_dofs: list[int] | None  # of a roving hammer: the place of each entry of a shape; None: the outputs
    hits: list[dict[str, Any]]  # of a hammer test: file, place, accepted, reason, text, peak, duration_s ...
    _source: Any = field(repr=False, compare=False)

    @classmethod
    def of_host(cls, source: HostResult | _Parsed) -> Result:
        """The result behind a handle of the host library."""
        out = cls.__new__(cls)
        out._source = source
        return out

    @classmethod
    def from_dict(cls, raw: Mapping[str, Any]) -> Result:
        """The result of an okid.result/1 object, as to_dict() and json.loads() give it: all but what stabilization()
        needs. InputError when it is not complete."""
        return cls._read(dict(raw))

    @classmethod
    def load(cls, path: str | Path) -> Result:
        """The result of a file of save() or `okid identify --json`; without decomposition, as from_dict(). InputError
        of one line names the file, and line and column or key."""
        try:
            return cls._read(read_result(path))
        except InputError as fault:
            named = str(fault).startswith(str(path))
            raise fault if named else InputError(f"{path}: {fault}") from None

    @classmethod
    def _read(cls, raw: dict[str, Any]) -> Result:
        if raw.get("schema") != "okid.result/1":
            raise InputError(f"schema is {raw.get('schema')!r}, expected 'okid.result/1'")
        try:
            json.dumps(raw, allow_nan=False)  # a missing number is null
            out = cls.of_host(_Parsed(raw))
            for one in fields(cls):
                getattr(out, one.name)
            return out
        except (KeyError, TypeError, ValueError, AttributeError, ArithmeticError, RecursionError) as fault:
            raise InputError(f"not a complete okid.result/1: {type(fault).__name__}: {fault}") from None

    def __getattr__(self, name: str) -> Any:
        """A field at its first use, made with those that come of the same work."""
        if name not in type(self).__dataclass_fields__ or name == "_source":
            raise AttributeError(f"{type(self).__name__!r} object has no attribute {name!r}")
        if name in ("fit", "warnings"):
            about = self._source.about()
            self.fit = Fit.of(about["fit"], list(about["outputs"]))
            self.warnings = [Warning(**one) for one in about["warnings"]]
        elif name in ("model", "singular_values", "markov", "observer"):
            self._take_arrays()
        else:
            self._take(self._source.about(False))
        return self.__dict__[name]

    def _take_arrays(self) -> None:
        array = self._source.array
        n_u, n_y, n_z = len(self.inputs), len(self.outputs), int(self.order)

        def shaped(name: str, *empty: int) -> Real:
            found = array(name)
            return np.zeros(empty) if found is None or found.size == 0 else found

        self.model = Model(
            shaped("model.A", n_z, n_z), shaped("model.B", n_z, n_u), shaped("model.C", n_y, n_z),
            shaped("model.D", n_y, n_u), shaped("model.K", n_z, n_y), 1.0 / float(self.fs_hz), array("model.x0"),
        )  # fmt: skip
        self.singular_values, self.markov = shaped("singular_values", 0), shaped("markov.Y", 0, n_y, n_u)
        observer = array("observer")
        self.observer = Observer(*([np.nan] * len(Observer._fields) if observer is None else observer.tolist()))

    def _take(self, about: dict[str, Any]) -> None:
        for key in _PLAIN:
            setattr(self, key, about[key])
        self.inputs, self.outputs = list(about["inputs"]), list(about["outputs"])
        self.modes = [Mode.of(one) for one in about["modes"]]
        self.mkr, self.pdc = MassMatrices.of(about.get("mkr")), ProportionalDamping.of(about.get("pdc"))
        self.shape_dofs, self.hits = about.get("shape_dofs"), list(about.get("hits") or [])
        self.hankel, self.singular_noise = about.get("hankel"), about.get("singular_noise")
        self.refinement, self.skew = Refinement.of(about.get("refinement")), Skew.of(about.get("skew"), self.outputs)

    def __reduce__(self) -> Any:  # what holds memory of the C library cannot be pickled
        return Result._read, (self.to_dict(),)

    @property
    def confident_modes(self) -> list[Mode]:
        """The modes an expert would sign: the poles of the model of "auto"; of a named method EMAC from 0.5 on."""
        return [mode for mode in self.modes if mode.confident is not False]

    @property
    def shape_places(self) -> list[str]:
        """Names of the entries of a shape: the outputs, of a roving hammer the numbers of its places."""
        return [str(dof) for dof in self.shape_dofs or self.outputs]

    @cached_property
    def identifier(self) -> Identifier | None:
        """The decomposition of the library, for models of other orders; None: there is none."""
        found: Identifier | None = self._source.identifier()
        return found

    def to_dict(self) -> dict[str, Any]:
        """okid.result/1 (docs/result-json) as it was identified: plain lists and numbers, None for a missing number."""
        out: dict[str, Any] = json.loads(self._source.json())
        return out

    def save(self, path: str | Path) -> None:
        """Write okid.result/1 as JSON, whole or not at all (temporary file, then rename), else InputError."""
        with whole_file(path) as part:
            part.write_text(self._source.json(), encoding="utf-8")

    def to_scipy(self) -> Any:
        """scipy.signal.StateSpace with dt."""
        return self.model.to_scipy()

    def to_control(self) -> Any:
        """control.StateSpace with dt; ImportError says how to install python-control."""
        return self.model.to_control()

    def table(self) -> ModalTable:
        """The modes as rows (pandas.DataFrame(result.table())); str() of it: what `okid identify` prints."""
        return ModalTable(self.modes, self._source.table(), [f"{w.code}: {w.text}" for w in self.warnings])

    def _head(self) -> str:
        return (
            f"{self.method}: {self.samples} samples at {self.fs_hz:g} Hz, order {self.order}, "
            f"{len(self.inputs)} input(s), {len(self.outputs)} output(s)"
        )

    def __repr__(self) -> str:
        shown = [f"{mode.frequency_hz:.4g}" for mode in self.modes if not mode.doubtful]
        return f"<Result of {self._head()}, modes at {', '.join(shown[:12])}{' ..' * (len(shown) > 12)} Hz>"

    def _repr_html_(self) -> str:
        return summary(self._head()) + self.table()._repr_html_()

    def stabilization(self, orders: Iterable[int] | None = None, criteria: Criteria | None = None) -> Stabilization:
        """Poles of other orders from the same decomposition, each compared with the order before, and their clusters.

        Default: every even order the data carry. Orders they cannot carry are left out. Several horizons:
        okid.stabilization(). A result that was identified with `--stabilization` (stabilization=True) gives the poles
        that it holds, when no orders or criteria are asked for. Raises Error on other results that were loaded or
        unpickled: they have no decomposition any more; and on one of method "auto", which has none.
        """
        kept = self._source.about(False).get("stabilization")
        if kept and orders is None and criteria is None and self.identifier is None:
            return Stabilization.from_dict(kept)
        if self.method in ("auto", "plscf", "poser"):
            other = "okid.identify_frf(responses, stabilization=True)"
            if not self._source.about(False).get("responses"):
                other = 'okid.identify(u, y, fs=fs, method="okid-era"), or call okid.stabilization()'
            raise Error(
                f'a result of method "{self.method}" has no decomposition of its own: for a stabilization diagram '
                f"identify again, as in {other}"
            )
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
