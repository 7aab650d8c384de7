# SPDX-License-Identifier: MIT
"""The library's one-call identification over an Accumulator: for records, and again and again while a stream runs."""

from __future__ import annotations

import ctypes
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from okid import abi
from okid._errors import IdentificationError, InputError
from okid.abi.accumulator import Accumulator
from okid.abi.arguments import choice, positive, whole
from okid.abi.square_root import SquareRoot
from okid.abi.turns import Turn, both, in_turn
from okid.result.model import Model
from okid.result.parts import Observer
from okid.shown.notebook_html import own_fields

Real = NDArray[np.float64]
Complex = NDArray[np.complex128]


METHODS = {
    "okid-era": abi.METHOD_OKID_ERA,
    "okid-era-dc": abi.METHOD_OKID_ERA_DC,
    "n4sid-moesp": abi.METHOD_N4SID_MOESP,
    "n4sid-cva": abi.METHOD_N4SID_CVA,
    "n4sid-ssarx": abi.METHOD_N4SID_SSARX,
}
HANKEL = {
    "system": abi.HANKEL_SYSTEM,
    "innovations": abi.HANKEL_INNOVATIONS,
    "literal": abi.HANKEL_LITERAL,
}
_SOLVER = {"dense": abi.SOLVER_DENSE, "structured": abi.SOLVER_STRUCTURED}


class Identified(NamedTuple):
    """A copy of okid_identified_t: nothing points into the identifier any more.

    A (n_z, n_z) .. K (n_z, n_y); singular_values (s,); markov (count, n_y, n_u); theta (n_y, q), of an n4sid method
    (n_y, 0); innovation (n_y, n_y); mean (m,) channel means that were removed; modes (k,) with cmi = emac x mpc and
    shapes (k, n_y), largest entry 1.
    """

    notes: int
    p: int
    rows: int
    order: int
    regression_rows: int
    dt: float
    A: Real
    B: Real
    C: Real
    D: Real
    K: Real
    singular_values: Real
    markov: Real
    theta: Real
    innovation: Real
    mean: Real
    frequency_hz: Real
    damping_ratio: Real
    mpc: Real
    emac: Real
    cmi: Real
    shapes: Complex
    model_radius: float
    noise_level: float
    observer: Observer

    def model(self) -> Model:
        """A .. K as a model at work."""
        return Model(self.A, self.B, self.C, self.D, self.K, self.dt)

    def _repr_html_(self) -> str:
        return own_fields(self)


def usable_p(n_u: int, n_y: int, p: int, samples: int) -> int:
    """p, or the largest p with 10 (n_u + p (n_u + n_y)) <= samples when that is smaller; at least 1."""
    return int(abi.library().okid_identify_usable_p(n_u, n_y, p, samples))


def _copy(raw: abi.Identified) -> Identified:
    n_u, n_y, n_z, p = int(raw.n_u), int(raw.n_y), int(raw.n_z), int(raw.p)
    modes, blocks = int(raw.mode_count), int(raw.markov_count)
    markov = abi.matrix(raw.markov, n_y, n_u * blocks).reshape(n_y, blocks, n_u).transpose(1, 0, 2)
    shapes = abi.matrix(raw.shape_re, n_y, modes).T + 1j * abi.matrix(raw.shape_im, n_y, modes).T
    info = raw.observer_info
    return Identified(
        notes=int(raw.warnings),
        p=p,
        rows=int(raw.rows),
        order=n_z,
        regression_rows=int(raw.regression_rows),
        dt=float(raw.dt),
        A=abi.matrix(raw.A, n_z, n_z),
        B=abi.matrix(raw.B, n_z, n_u),
        C=abi.matrix(raw.C, n_y, n_z),
        D=abi.matrix(raw.D, n_y, n_u),
        K=abi.matrix(raw.K, n_z, n_y),
        singular_values=abi.matrix(raw.singular_values, int(raw.singular_count), 1)[:, 0],
        markov=np.ascontiguousarray(markov),
        theta=abi.matrix(raw.observer, n_y, n_u + p * (n_u + n_y) if raw.observer else 0),
        innovation=abi.matrix(raw.innovation, n_y, n_y),
        mean=abi.matrix(raw.mean, n_u + n_y, 1)[:, 0],
        frequency_hz=abi.matrix(raw.frequency_hz, modes, 1)[:, 0],
        damping_ratio=abi.matrix(raw.damping_ratio, modes, 1)[:, 0],
        mpc=abi.matrix(raw.mpc, modes, 1)[:, 0],
        emac=abi.matrix(raw.emac, modes, 1)[:, 0],
        cmi=abi.matrix(raw.cmi, modes, 1)[:, 0],
        shapes=shapes,
        model_radius=float(raw.model_radius),
        noise_level=float(raw.noise_level),
        observer=Observer(*(float(getattr(info, name)) for name in Observer._fields)),
    )


class Identifier:
    """Workspace for models of one shape; run() may be called as often as results are wanted.

    `method` one of METHODS; the accumulator must have `lags` lags. n4sid methods do not use p, okid methods without
    inputs (n_u = 0, ambient) only as the default of rows. `hankel` "system", "innovations" or "literal": what the
    Hankel matrix of the okid methods holds beside the system's Markov parameters, see okid/identify.h.
    `solver` "structured" needs O(m q) memory instead of q^2, and one unbroken run in the accumulator.
    `order` 0 = automatic, bounded by `max_order` (0 = the library's own bound); `rows` 0 = 2 p,
    for n4sid methods 30.
    Raises InputError for sizes outside the documented range. Source: lib/include/okid/identify.h, paper eq. 36-95.
    """

    def __init__(
        self,
        n_u: int,
        n_y: int,
        *,
        fs: float,
        p: int = 40,
        rows: int = 0,
        order: int = 0,
        max_order: int = 0,
        detrend: str = "mean",
        solver: str = "dense",
        method: str = "okid-era",
        hankel: str = "system",
    ) -> None:
        choice("method", method, list(METHODS))
        choice("solver", solver, list(_SOLVER))
        choice("hankel", hankel, list(HANKEL))
        for name, value, least in (("n_u", n_u, 0), ("n_y (outputs)", n_y, 1), ("p", p, 1), ("rows", rows, 0),
                                   ("order", order, 0), ("max_order", max_order, 0)):  # fmt: skip
            whole(name, value, least)
        positive("fs", fs, "a sample rate in Hz")
        mode = abi.DETREND_MEAN if detrend == "mean" else abi.DETREND_NONE
        self.config = abi.IdentifyConfig(
            n_u, n_y, p, rows, order, max_order, fs, METHODS[method], mode, _SOLVER[solver], HANKEL[hankel]
        )
        size = int(abi.library().okid_identify_memsize(ctypes.byref(self.config)))
        if size == 0:
            raise InputError(
                f"method={method}, n_u={n_u}, n_y={n_y}, fs={fs}, p={p}, rows={rows}, order={order}, "
                f"max_order={max_order}, hankel={hankel}: these do not go together: at most 256 channels and p = 4096, "
                "n4sid needs rows >= 2, an order is at most what rows and p carry",
                abi.ERR_DIM,
            )
        self._block: Any = abi.block(size)
        self._handle = ctypes.c_void_p()
        status = abi.library().okid_identify_create(
            ctypes.byref(self._handle), ctypes.byref(self.config), self._block.ctypes.data, self._block.size
        )
        abi.check(status, "identifier")
        self._raw, self._turn = abi.Identified(), Turn()

    @classmethod
    def of_handle(cls, handle: int, config: Any, last: Any, owner: Any) -> Identifier:
        """The identifier behind an okid_identify_t that `owner` keeps alive; `last` the model of its last run()."""
        out = cls.__new__(cls)
        out.config, out._block, out._handle = config, owner, ctypes.c_void_p(handle)
        out._raw, out._turn = abi.Identified.from_buffer_copy(last), owner._turn
        return out

    def run(self, accumulator: Accumulator | SquareRoot) -> Identified:
        """Identify from what the accumulator, or the factor of the second kernel, holds now; it is not changed.

        Raises InputError when it does not fit, IdentificationError with `status` and, where one is at fault, `channel`
        as an attribute.
        """
        library = abi.library()
        of_factor = isinstance(accumulator, SquareRoot)
        run = library.okid_identify_run_factor if of_factor else library.okid_identify_run
        with both(self._turn, accumulator._turn):
            status = int(run(self._handle, accumulator.handle, ctypes.byref(self._raw)))
        if status == abi.ERR_MISMATCH:
            raise InputError(
                "this accumulator does not fit: n_u, n_y and lags must be the identifier's, its solver 'dense' for a "
                "SquareRoot, and one unbroken run must be in it for the solver 'structured'",
                status,
            )
        if status < 0:
            channel = int(self._raw.observer_info.channel)
            who = "" if channel < 0 else f" (channel {channel}, counted from 0: inputs, then outputs)"
            fault = IdentificationError(f"no model: {abi.status_text(status)}{who}", status)
            fault.channel = channel  # type: ignore[attr-defined]
            raise fault
        return _copy(self._raw)

    @property
    def raw(self) -> Any:
        """okid_identified_t of the last run(), by reference."""
        return ctypes.byref(self._raw)

    @property
    def order(self) -> int:
        """n_z of the last run()."""
        return int(self._raw.n_z)

    @property
    def lags(self) -> int:
        """Lags an accumulator must have for run()."""
        return int(abi.library().okid_identify_lags(ctypes.byref(self.config)))

    @in_turn
    def realise(self, order: int) -> Identified:
        """Another order from the decomposition of the last run(), for stabilization diagrams."""
        status = int(abi.library().okid_identify_order(self._handle, order, ctypes.byref(self._raw)))
        abi.check(status, f"order {order}")
        return _copy(self._raw)

    @in_turn
    def poles(self, order: int) -> Identified:
        """The modes of another order only, much cheaper: A and C are that order's, B, D, K, innovation are zeros."""
        status = int(abi.library().okid_identify_poles(self._handle, order, ctypes.byref(self._raw)))
        abi.check(status, f"order {order}")
        found = _copy(self._raw)
        blank = {name: np.zeros_like(getattr(found, name)) for name in ("B", "D", "K", "innovation")}
        return found._replace(**blank)

    @property
    def subspace(self) -> bool:
        """An n4sid method."""
        return bool(self.config.method >= abi.METHOD_N4SID_MOESP)

    @property
    def block_rows(self) -> int:
        """Block rows of the Hankel matrices of the last run()."""
        return int(self._raw.rows)

    @in_turn
    def set_inputs(self, B: Real, D: Real) -> Identified:
        """The n4sid model of the last run() with other B (n_z, n_u) and D (n_y, n_u); the Markov parameters follow."""
        given = [np.asfortranarray(one, dtype=np.float64) for one in (B, D)]
        raw = self._raw
        if [one.shape for one in given] != [(raw.n_z, raw.n_u), (raw.n_y, raw.n_u)]:
            raise InputError(f"B {given[0].shape} and D {given[1].shape} do not fit the model")
        status = int(abi.library().okid_identify_set_inputs(self._handle, *map(abi.pointer, given), ctypes.byref(raw)))
        abi.check(status, "B and D")
        return _copy(raw)

    def largest_order(self) -> int:
        """The largest order realise() can be asked for."""
        return int(abi.library().okid_identify_max_order(ctypes.byref(self.config)))
