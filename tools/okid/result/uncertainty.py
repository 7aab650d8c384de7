# SPDX-License-Identifier: MIT
"""Standard deviations of everything that is printed: delete-one-block jackknife over sums of lagged products."""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from okid import abi
from okid._errors import Error, InputError
from okid.abi.accumulator import Accumulator
from okid.abi.identifier import HANKEL, METHODS, Identifier
from okid.result.mkr import Plan, raw_plan
from okid.result.model import Model

if TYPE_CHECKING:
    from okid.result.result import Mode

Real = NDArray[np.float64]
Piece = tuple[int, int, int]  # record, first sample, one past the last
GROUPS, FEWEST, MOST = 20, 8, 100  # parts of a record; below 8 a standard deviation says nothing


@dataclass(frozen=True)
class Uncertainty:
    """One standard deviation of each quantity; a 95 % interval is +- 1.96 of them. NaN where nothing can be said.

    Modes (k,), shapes (k, n_y), matrices (n_x, n_x) or None; `used` replicates in which each mode was found.
    """

    replicates: int
    used: NDArray[np.int32]
    frequency_hz: Real
    damping_ratio: Real
    shape_re: Real
    shape_im: Real
    M: Real | None = None
    K: Real | None = None
    R: Real | None = None
    R_normal_modes: Real | None = None
    alpha: float = float("nan")
    beta: float = float("nan")


def _view(model: Model) -> tuple[Any, list[Real]]:
    kept = [np.asfortranarray(one, dtype=np.float64) for one in (model.A, model.B, model.C, model.D)]
    return abi.ModelView(kept[1].shape[1], len(kept[2]), len(kept[0]), *map(abi.pointer, kept), None), kept


class Replicates:
    """Sums of squared deviations of replicate models from `full`: see lib/include/okid/uncertainty.h.

    `plan`: where the channels stand, for M, K, R, alpha and beta. Models of any realization, order <= that of `full`.
    """

    def __init__(self, full: Model, plan: Plan | None = None) -> None:
        view, kept = _view(full)
        self._plan = None if plan is None else raw_plan(plan, full.dt)
        mkr = None if self._plan is None else ctypes.pointer(self._plan[0])
        config = abi.ReplicatesConfig(view.n_u, view.n_y, view.n_z, mkr)
        lib = abi.library()
        self._block = abi.block(int(lib.okid_replicates_memsize(ctypes.byref(config))))
        self._handle = ctypes.c_void_p()
        place = (ctypes.byref(self._handle), ctypes.byref(config), self._block.ctypes.data, self._block.size)
        abi.check(lib.okid_replicates_create(*place), "replicates")
        abi.check(lib.okid_replicates_begin(self._handle, ctypes.byref(view), full.dt), "replicates")
        del kept

    def add(self, replicate: Model | None, share: float) -> bool:
        """A model without a block that held `share` of the information, None: there is none. True: nothing missing."""
        view, kept = (None, None) if replicate is None else _view(replicate)
        status = abi.library().okid_replicates_add(
            self._handle, None if view is None else ctypes.byref(view), float(share)
        )
        del kept
        return abi.check(int(status), "replicate") == abi.OK

    def finish(self) -> Uncertainty:
        """The standard deviations of what was added."""
        raw = abi.Uncertainty()
        abi.check(abi.library().okid_replicates_finish(self._handle, ctypes.byref(raw)), "replicates")
        modes, n_y, n_x = int(raw.mode_count), int(raw.n_y), int(raw.n_x)

        def array(pointer: Any, *shape: int) -> Real:
            return np.array(np.ctypeslib.as_array(pointer, shape)) if all(shape) else np.zeros(shape)

        names = {"M": "M_std", "K": "K_std", "R": "R_std", "R_normal_modes": "R_normal_std"}
        squares = {own: array(getattr(raw, name), n_x, n_x) if n_x else None for own, name in names.items()}
        return Uncertainty(
            replicates=int(raw.replicates),
            used=array(raw.used, modes).astype(np.int32),
            frequency_hz=array(raw.frequency_std_hz, modes),
            damping_ratio=array(raw.damping_ratio_std, modes),
            shape_re=array(raw.shape_re_std, modes, n_y),
            shape_im=array(raw.shape_im_std, modes, n_y),
            alpha=float(raw.alpha_std),
            beta=float(raw.beta_std),
            **squares,
        )


class Jackknife:
    """Models of the record in `whole` without one part each, at the order of the identifier's last run()."""

    def __init__(self, identifier: Identifier, whole: Accumulator) -> None:
        sums = abi.AccumulatorConfig()
        whole._call("config", whole.handle, ctypes.byref(sums))
        config = abi.JackknifeConfig(identifier.config, sums)
        config.identify.order = config.identify.max_order = identifier.order
        lib = abi.library()
        size = int(lib.okid_jackknife_memsize(ctypes.byref(config)))
        if size == 0:
            raise InputError("a jackknife needs an accumulator with edges, without a window, and the solver 'dense'")
        self._block, self._handle = abi.block(size), ctypes.c_void_p()
        place = (ctypes.byref(self._handle), ctypes.byref(config), self._block.ctypes.data, self._block.size)
        abi.check(lib.okid_jackknife_create(*place), "jackknife")
        self._whole, self._dt = whole, 1.0 / float(identifier.config.fs_hz)  # kept alive: the library looks into it
        abi.check(lib.okid_jackknife_begin(self._handle, whole.handle, identifier.raw), "jackknife")

    def delete(self, part: Accumulator, weight: float = 1.0) -> tuple[Model | None, float]:
        """The model without this part (None: there is none), and the share of the information in it."""
        view, share = abi.ModelView(), ctypes.c_double(0.0)
        status = int(
            abi.library().okid_jackknife_delete(
                self._handle, part.handle, weight, ctypes.byref(view), ctypes.byref(share)
            )
        )
        if status == abi.ERR_MISMATCH or share.value <= 0.0:
            abi.check(status, "a part of the record")
        if status < 0:
            return None, share.value

        n_u, n_y, n_z = int(view.n_u), int(view.n_y), int(view.n_z)
        A, B = abi.matrix(view.A, n_z, n_z), abi.matrix(view.B, n_z, n_u)
        C, D = abi.matrix(view.C, n_y, n_z), abi.matrix(view.D, n_y, n_u)
        return Model(A, B, C, D, np.zeros((n_z, n_y)), self._dt), share.value


def parts_of(records: Sequence[Real], lags: int, rest: bool, groups: int = GROUPS) -> Iterator[list[Piece]]:
    """Equal parts of all regression rows together: pieces (record, first, last) of samples, without their lead-in."""
    first = 0 if rest else lags  # what stands before is history only
    rows = [max(0, len(record) - first) for record in records]
    ends = np.cumsum([0, *rows])
    cuts = [round(k * int(ends[-1]) / groups) for k in range(groups + 1)]
    for low, high in zip(cuts[:-1], cuts[1:], strict=True):
        pieces = [(r, first + max(low, a) - a, first + min(high, b) - a)
                  for r, (a, b) in enumerate(zip(ends[:-1].tolist(), ends[1:].tolist(), strict=True))
                  if max(low, a) < min(high, b)]  # fmt: skip
        yield pieces


def feed_part(part: Accumulator, records: Sequence[Real], pieces: list[Piece]) -> None:
    """The pieces with the `lags` samples before each; before a record begins there is silence."""
    part.reset()
    for record, low, high in pieces:
        samples = records[record]
        part.gap(0)
        if low < part.lags:
            part.add(np.zeros((part.lags - low, samples.shape[1])))
        part.add(samples[max(0, low - part.lags) : high])


class Replicate(NamedTuple):
    """The model without some pieces (record, first, last) of the records, None: there is none; their information."""

    model: Model | None
    share: float
    pieces: list[Piece]


def leave_out_blocks(
    identifier: Identifier, records: Sequence[Real], whole: Accumulator, blocks: int = GROUPS, rest: bool = False
) -> list[Replicate]:
    """Leave out each of `blocks` equal blocks in turn. `whole` holds `records`; the identifier's last run was on it.

    `rest`: silence stands before each record. Empty: the record is too short.
    """
    groups = min(blocks, whole.rows // whole.lags)
    if groups < FEWEST:
        return []
    out, jackknife = [], Jackknife(identifier, whole)
    with Accumulator(whole.n_u, whole.n_y, whole.lags) as part:
        for pieces in parts_of(records, whole.lags, rest, groups):
            feed_part(part, records, pieces)
            if part.rows > 0:
                out.append(Replicate(*jackknife.delete(part), pieces))
    return out


def deviations(
    full: Model,
    replicates: Sequence[Replicate],
    plan: Plan | None = None,
    refit: Callable[[Model, list[Piece]], Model] | None = None,
) -> Uncertainty | None:
    """Standard deviations of `full`; `refit` makes of a replicate what the full model is beyond the identifier.

    None without replicates.
    """
    if not replicates:
        return None
    sums = Replicates(full, plan)
    for model, share, pieces in replicates:
        try:
            sums.add(model if model is None or refit is None else refit(model, pieces), share)
        except Error:
            sums.add(None, share)
    return sums.finish()


def without_each(
    identifier: Identifier,
    whole: Accumulator,
    parts: Iterable[tuple[Accumulator, float]],
    full: Model,
    plan: Plan | None = None,
) -> Uncertainty | None:
    """Standard deviations of `full`, the identifier's last model, which was of `whole`: each of the parts (sums and the
    weight they have in it) left out in turn. Parts without equations say nothing; None when fewer than 8 others remain.
    """
    jackknife, statistics = Jackknife(identifier, whole), Replicates(full, plan)
    for part, weight in parts:
        if part.rows > 0:
            model, share = jackknife.delete(part, weight)
            if share > 0.0:
                statistics.add(model, share)
    found = statistics.finish()
    return found if found.replicates >= FEWEST else None


def finite_p_bias(config: Any, records: Sequence[Real], rest: bool, modes: Sequence[Mode], order: int) -> str | None:
    """What a horizon of 2 p says otherwise by more than two standard deviations; None: nothing, or too few samples.

    `config`: okid_identify_config_t of an okid method with inputs; `modes` with their deviations.
    """
    twice = Identifier(
        config.n_u, config.n_y, fs=config.fs_hz, p=2 * config.p, rows=config.rows or 2 * config.p, order=order,
        method=next(name for name, number in METHODS.items() if number == config.method),
        hankel=next(name for name, number in HANKEL.items() if number == config.hankel),
        detrend="mean" if config.detrend == abi.DETREND_MEAN else "none",
    )  # fmt: skip
    with Accumulator(config.n_u, config.n_y, twice.lags) as sums:
        feed_part(sums, records, next(parts_of(records, twice.lags, rest, 1)))
        if sums.rows < 10 * (config.n_u + 2 * config.p * (config.n_u + config.n_y)):
            return None
        try:
            other = twice.run(sums)
        except Error:
            return None
    moved = []
    for k, mode in enumerate(modes, 1):
        if not mode.frequency_std_hz or not mode.damping_ratio_std or len(other.frequency_hz) == 0:
            continue
        near = int(np.argmin(np.abs(other.frequency_hz - mode.frequency_hz)))
        shift = float(other.frequency_hz[near]) - mode.frequency_hz
        df = shift / mode.frequency_std_hz
        dz = (float(other.damping_ratio[near]) - mode.damping_ratio) / mode.damping_ratio_std
        if abs(shift) <= 0.05 * mode.frequency_hz and max(abs(df), abs(dz)) > 2.0:
            moved.append(f"mode {k} by {df:+.1f} σ in f and {dz:+.1f} σ in ζ")
    if not moved:
        return None
    return (
        f"p {2 * config.p} instead of {config.p} moves {', '.join(moved)}: a bias that ± does not show. Use "
        f"p={2 * config.p} or more, or an n4sid method"
    )
