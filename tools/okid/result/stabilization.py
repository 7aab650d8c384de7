# SPDX-License-Identifier: MIT
"""Which poles hold while model order and horizon change, and the modes of the structure found from that."""

from __future__ import annotations

import ctypes
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from okid import abi
from okid._errors import Error, InputError
from okid.shown.notebook_html import own_fields, short, summary, table

if TYPE_CHECKING:
    from okid.identification.identifier import Identified, Identifier

Real = NDArray[np.float64]
Complex = NDArray[np.complex128]
Flags = NDArray[np.bool_]


class OrderPoles(NamedTuple):
    """Poles of one order, (k,) each, shapes (k, n_y); the flags compare with the next lower order of the diagram.

    `cluster` (k,): index into Stabilization.clusters, -1 = none; `horizon`: p, or block rows, of the model.
    """

    order: int
    frequency_hz: Real
    damping_ratio: Real
    shapes: Complex
    stable_frequency: Flags
    stable_damping: Flags
    stable_shape: Flags
    horizon: int
    cluster: NDArray[np.int32]

    @property
    def stable(self) -> Flags:
        """Frequency, damping and shape all hold."""
        return self.stable_frequency & self.stable_damping & self.stable_shape

    def _repr_html_(self) -> str:
        return own_fields(self)


class Cluster(NamedTuple):
    """Poles that belong together, at most one of each model: medians, and robust spreads over the models (how much the
    choice of order matters, not an error of measurement).

    `hits` of `models`: where it was found; `physical`: in at least the share asked for; `horizon`, `order`: the model
    whose pole lies nearest the medians, `shape` (n_y,) its shape.
    """

    frequency_hz: float
    damping_ratio: float
    frequency_spread_hz: float
    damping_ratio_spread: float
    mpc: float
    hits: int
    models: int
    physical: bool
    horizon: int
    order: int
    shape: Complex

    def _repr_html_(self) -> str:
        return own_fields(self)


class Criteria(NamedTuple):
    """A pole holds when the order before has one within `frequency` and `damping` (relative) and `mac`; a cluster is
    a mode of the structure when it is found in `share` of the models."""

    frequency: float = 0.01
    damping: float = 0.05
    mac: float = 0.98
    share: float = 0.5

    def _repr_html_(self) -> str:
        return own_fields(self)


class Stabilization(Sequence[OrderPoles]):
    """The rows of the diagram, one a model, and the clusters, ascending in frequency."""

    def __init__(self, rows: list[OrderPoles], clusters: list[Cluster], criteria: Criteria) -> None:
        self.rows, self.clusters, self.criteria = rows, clusters, criteria

    def __repr__(self) -> str:
        found = ", ".join(f"{mode.frequency_hz:.4g}" for mode in self.modes)
        return f"<Stabilization of {len(self.rows)} models, modes at {found} Hz>"

    def _repr_html_(self) -> str:
        """The modes of the structure, with their spreads over the models."""
        rows = (
            [f"{k}", f"{one.frequency_hz:.5f}", short(one.frequency_spread_hz, form=".2g"),
             f"{100.0 * one.damping_ratio:.4f}", short(one.damping_ratio_spread, 100.0, ".2g"),
             short(one.mpc, form=".4f"), f"{one.hits} of {one.models}"]
            for k, one in enumerate(self.modes, 1)
        )  # fmt: skip
        head = ("mode", "f [Hz]", "spread [Hz]", "ζ [%]", "spread [%]", "MPC", "found in models")
        return summary(f"Stabilization of {len(self.rows)} models") + table(head, rows)

    def __len__(self) -> int:
        return len(self.rows)

    def __getitem__(self, index: Any) -> Any:
        return self.rows[index]

    def __iter__(self) -> Iterator[OrderPoles]:
        return iter(self.rows)

    @property
    def modes(self) -> list[Cluster]:
        """The clusters found in enough models: modes of the structure."""
        return [cluster for cluster in self.clusters if cluster.physical]

    def to_dict(self) -> dict[str, Any]:
        """The key "stabilization" of okid.result/1."""
        keys = ("frequency_hz", "damping_ratio", "frequency_spread_hz", "damping_ratio_spread", "mpc", "hits",
                "models", "physical", "horizon", "order")  # fmt: skip
        return {
            "criteria": self.criteria._asdict(),
            "models": [[row.horizon, row.order] for row in self.rows],
            "poles": [
                {
                    "horizon": row.horizon,
                    "order": row.order,
                    "frequency_hz": float(row.frequency_hz[k]),
                    "damping_ratio": float(row.damping_ratio[k]),
                    "stable_frequency": bool(row.stable_frequency[k]),
                    "stable_damping": bool(row.stable_damping[k]),
                    "stable_shape": bool(row.stable_shape[k]),
                    "cluster": int(row.cluster[k]),
                }
                for row in self.rows
                for k in range(len(row.frequency_hz))
            ],
            "clusters": [{key: getattr(cluster, key) for key in keys} for cluster in self.clusters],
        }

    @classmethod
    def from_dict(cls, raw: Mapping[str, Any]) -> Stabilization:
        """Of the key "stabilization" of okid.result/1, which keeps no shapes: they are empty here."""
        rows = []
        for horizon, order in raw["models"]:
            own = [one for one in raw["poles"] if (one["horizon"], one["order"]) == (horizon, order)]
            column = {key: np.array([one[key] for one in own]) for key in own[0]} if own else {}
            empty = np.zeros(0)
            held = [column.get(f"stable_{key}", empty).astype(bool) for key in ("frequency", "damping", "shape")]
            rows.append(OrderPoles(
                order, column.get("frequency_hz", empty), column.get("damping_ratio", empty),
                np.zeros((len(own), 0), np.complex128), held[0], held[1], held[2], horizon,
                column.get("cluster", empty).astype(np.int32),
            ))  # fmt: skip
        shape = np.zeros(0, np.complex128)
        return cls(rows, [Cluster(**one, shape=shape) for one in raw["clusters"]], Criteria(**raw["criteria"]))


class Collector:
    """The library's workspace: add() the last model of an identifier, find() the clusters."""

    def __init__(self, n_y: int, models: int, poles: int, criteria: Criteria) -> None:
        self.criteria = criteria
        config = abi.StabilizationConfig(n_y, models, poles, *criteria)
        size = int(abi.library().okid_stabilization_memsize(ctypes.byref(config)))
        if size == 0:
            raise InputError(f"{models} models of {poles} poles with {criteria}: outside what the library takes")
        self._block = abi.block(size)
        self._handle = ctypes.c_void_p()
        status = abi.library().okid_stabilization_create(
            ctypes.byref(self._handle), ctypes.byref(config), self._block.ctypes.data, self._block.size
        )
        abi.check(status, "stabilization")
        self._found: list[Identified] = []

    def add_orders(self, identifier: Identifier, orders: Iterable[int]) -> None:
        """Every order, ascending, from the decomposition of the identifier's last run()."""
        for order in sorted(set(orders)):
            try:
                found = identifier.poles(order)
            except Error as fault:
                if fault.status not in (abi.ERR_NO_MODES, abi.ERR_NUMERIC, abi.ERR_DIM):
                    raise
                continue  # no pole to draw at this order
            abi.check(abi.library().okid_stabilization_add(self._handle, identifier.raw), f"order {order}")
            self._found.append(found)

    def find(self) -> Stabilization:
        """Rows and clusters."""
        raw = abi.Stabilized()
        abi.check(abi.library().okid_stabilization_find(self._handle, ctypes.byref(raw)), "clusters")
        rows, first = [], 0
        for found in self._found:
            own = [raw.poles[k] for k in range(first, first + len(found.frequency_hz))]
            first += len(own)
            holds = np.array([pole.holds for pole in own], dtype=np.int32)
            flags = [holds & bit != 0 for bit in (abi.HOLDS_FREQUENCY, abi.HOLDS_DAMPING, abi.HOLDS_SHAPE)]
            cluster = np.array([pole.cluster for pole in own], dtype=np.int32)
            rows.append(OrderPoles(found.order, found.frequency_hz, found.damping_ratio, found.shapes,
                                   flags[0], flags[1], flags[2], found.p, cluster))  # fmt: skip
        shapes = np.vstack([found.shapes for found in self._found]) if rows else np.zeros((0, 1), complex)
        clusters = []
        for k in range(int(raw.cluster_count)):
            c = raw.clusters[k]
            pole = raw.poles[c.pole]
            clusters.append(Cluster(
                c.frequency_hz, c.damping_ratio, c.frequency_spread_hz, c.damping_ratio_spread, c.mpc, c.hits,
                int(raw.model_count), bool(c.physical), pole.horizon, pole.order, shapes[c.pole],
            ))  # fmt: skip
        return Stabilization(rows, clusters, self.criteria)


def default_orders(identifier: Identifier) -> range:
    """Every even order up to half of the rank that the past can have: near that rank noise looks consistent too."""
    config = identifier.config
    past = config.p if config.n_u > 0 and not identifier.subspace else identifier.block_rows
    return range(2, max(2, min(identifier.largest_order(), past * config.n_y // 2)) + 1, 2)


def of_identifiers(
    identifiers: Sequence[Identifier], orders: Iterable[int] | None = None, criteria: Criteria | None = None
) -> Stabilization:
    """Orders (default: default_orders()) of one identifier for each horizon, each after its run()."""
    wanted = [
        sorted({n for n in (default_orders(one) if orders is None else orders) if 1 <= n <= one.largest_order()})
        for one in identifiers
    ]
    models, largest = sum(len(each) for each in wanted), max((each[-1] for each in wanted if each), default=0)
    if models == 0:
        raise InputError("no order to draw: expected numbers from 1 to the largest order of the decomposition")
    collector = Collector(int(identifiers[0].config.n_y), models, max(1, largest // 2), criteria or Criteria())
    for one, each in zip(identifiers, wanted, strict=True):
        collector.add_orders(one, each)
    return collector.find()
