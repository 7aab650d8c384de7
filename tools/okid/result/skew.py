# SPDX-License-Identifier: MIT
"""How late each sensor comes against the forces, from the phases of the modes, and the model without these delays."""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from okid import abi
from okid._errors import Error
from okid.result.mkr import Plan, raw_plan
from okid.result.model import Model
from okid.result.result import Remark

Real = NDArray[np.float64]


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

    def to_dict(self, outputs: Sequence[str]) -> dict[str, Any]:
        """Key "skew" of okid.result/1."""
        return {
            "us": dict(zip(outputs, self.us.tolist(), strict=True)),
            "std_us": dict(zip(outputs, self.std_us.tolist(), strict=True)),
            "corrected": bool(np.any(self.late)),
            "outputs_corrected": [name for name, late in zip(outputs, self.late, strict=True) if late],
            "undetermined": self.undetermined,
            "scatter": self.scatter,
        }


def _list(names: Sequence[str], skew: Skew, chosen: NDArray[np.bool_]) -> str:
    return ", ".join(f"{name} {skew.us[k]:+.3g} ± {skew.std_us[k]:.2g}" for k, name in enumerate(names) if chosen[k])


def _remarks(skew: Skew, large: NDArray[np.bool_], names: Sequence[str]) -> list[Remark]:
    out = []
    if skew.undetermined:
        text = (
            f"no delays of the outputs explain the phases of the modes (what is left is {skew.scatter:.3g} times its "
            "deviation): complex modes, or a wrong kind of sensor or hold. Nothing was corrected: R of normal modes "
            "does not hold for complex modes, and R takes whatever delays there are for damping"
        )
        out.append(Remark("skew_undetermined", text))
    if np.any(skew.late):
        text = (
            f"outputs come late against the forces (µs, negative: early): {_list(names, skew, skew.late)}. M, K and R "
            "are those without these delays; the model is as recorded"
        )
        out.append(Remark("channel_skew", text))
    if np.any(large):
        text = (
            f"the phases of the modes ask for delays above 0.3 samples (µs): {_list(names, skew, large)}. Not "
            "corrected: a wrong hold or a shift by a sample is likelier"
        )
        out.append(Remark("skew_large", text))
    return out


def without_skew(
    model: Model, replicates: Sequence[Model], plan: Plan, names: Sequence[str]
) -> tuple[Model, Skew | None, list[Remark]]:
    """The model as M, K and R want it, and the delays found. None: the modes do not tell (M, K and R say why).

    `replicates`: models without one of equal blocks each (Refinement.replicates).
    """
    config, pointed = raw_plan(plan, model.dt)
    view, kept = model._view()
    shape = abi.SkewConfig(view.n_u, view.n_y, view.n_z, len(replicates), ctypes.pointer(config))
    lib, handle, raw = abi.library(), ctypes.c_void_p(), abi.SkewResult()
    block = abi.block(int(lib.okid_skew_memsize(ctypes.byref(shape))))
    place = (ctypes.byref(handle), ctypes.byref(shape), block.ctypes.data, block.size)
    try:
        abi.check(lib.okid_skew_create(*place), "skew")
        abi.check(lib.okid_skew_begin(handle, ctypes.byref(view)), "skew")
        for one in replicates:
            other, held = one._view()
            abi.check(lib.okid_skew_add(handle, ctypes.byref(other)), "skew")
            del held
        abi.check(lib.okid_skew_finish(handle, ctypes.byref(raw)), "skew")
    except Error:
        return model, None, []
    n_y = int(raw.n_y)
    late, large = (np.ctypeslib.as_array(one, (n_y,)) != 0 for one in (raw.late, raw.too_large))
    delay, std = (1e6 * np.array(np.ctypeslib.as_array(one, (n_y,))) for one in (raw.delay, raw.std))
    skew = Skew(delay, std, late, bool(raw.undetermined), float(raw.scatter))
    if np.any(late):
        C, D = np.empty_like(model.C, order="F"), np.empty_like(model.D, order="F")
        abi.check(lib.okid_skew_correct(handle, abi.pointer(C), abi.pointer(D)), "skew")
        model = Model(model.A, model.B, np.ascontiguousarray(C), np.ascontiguousarray(D), model.K, model.dt)
    del kept, pointed
    return model, skew, _remarks(skew, large, names)
