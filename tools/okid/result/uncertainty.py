# SPDX-License-Identifier: MIT
"""Standard deviations of everything that is printed: delete-one-block jackknife over sums of lagged products."""

from __future__ import annotations

import ctypes
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from okid import abi
from okid._errors import InputError
from okid.abi.accumulator import Accumulator
from okid.abi.identifier import Identifier
from okid.result.mkr import Plan, raw_plan
from okid.result.model import Model

Real = NDArray[np.float64]
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
