# SPDX-License-Identifier: MIT
"""MOESP, CVA and SSARX of the library against explicit Hankel matrices and projections, published results, the traps.

The reference below is written from the paper's equations with j x j projectors and np.linalg.lstsq; the library sees
only the Gram matrix of the lagged samples, or its triangular factor.
"""

from __future__ import annotations

import ctypes
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import okid
import pytest
import reference
import systems
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from okid import Accumulator, abi
from scipy.linalg import expm, solve_discrete_are
from scipy.signal import detrend, lfilter
from test_measured import FRAME_HZ, data_file

Array = NDArray[np.float64]
METHODS = {"moesp": abi.SUBSPACE_MOESP, "cva": abi.SUBSPACE_CVA, "ssarx": abi.SUBSPACE_SSARX}
ROWS = {"w1": 40, "w2": 30, "w3": 25}


@dataclass
class Model:
    """x+ = A x + B u + K e, y = C x + D u + e with the covariance of e."""

    A: Array
    B: Array
    C: Array
    D: Array
    K: Array = field(default_factory=lambda: np.zeros(0))
    innovation: Array = field(default_factory=lambda: np.zeros(0))

    def poles(self) -> NDArray[np.complex128]:
        return np.sort_complex(np.linalg.eigvals(self.A))

    def markov(self, count: int = 30) -> Array:
        """D, C B, C A B, .."""
        return chain(self.A, self.B, self.C, self.D, count)

    def gain_markov(self, count: int = 30) -> Array:
        """The same from the innovations, without the leading identity."""
        return chain(self.A, self.K, self.C, self.C @ self.K, count)

    def predictor_radius(self) -> float:
        return float(np.max(np.abs(np.linalg.eigvals(self.A - self.K @ self.C))))


def chain(A: Array, B: Array, C: Array, D: Array, count: int) -> Array:
    blocks, x = [D], B
    for _ in range(count):
        blocks.append(C @ x)
        x = A @ x
    return np.array(blocks)


def relative(left: Any, right: Any) -> float:
    return float(np.linalg.norm(np.asarray(left) - right) / np.linalg.norm(right))


# ---- the library ---------------------------------------------------------------------------------------------------


class Subspace:
    """okid_subspace_t in NumPy memory."""

    def __init__(
        self, n_u: int, n_y: int, rows: int, method: str, max_order: int = 0, factor: int = 0, ridge: float = 0.0
    ) -> None:
        self.n_u, self.n_y, self.lib = n_u, n_y, abi.library()
        config = abi.SubspaceConfig(n_u, n_y, rows, METHODS[method], max_order, factor, ridge)
        self.block = abi.block(self.lib.okid_subspace_memsize(ctypes.byref(config)))
        self.handle, self.info = ctypes.c_void_p(), abi.SubspaceInfo()
        args = (ctypes.byref(self.handle), ctypes.byref(config), self.block.ctypes.data, self.block.size)
        assert self.lib.okid_subspace_create(*args) == 0

    def decompose(self, gram: Array, rows: int) -> Subspace:
        status = self.lib.okid_subspace_decompose(
            self.handle, abi.pointer(np.ascontiguousarray(gram)), rows, ctypes.byref(self.info)
        )
        assert status == 0, abi.status_text(status)
        return self

    def decompose_factor(self, columns: Array, rows: int) -> Subspace:
        """`columns`: the column-major factor as NumPy sees it, transposed."""
        status = self.lib.okid_subspace_decompose_factor(
            self.handle, abi.pointer(columns), rows, ctypes.byref(self.info)
        )
        assert status == 0, abi.status_text(status)
        return self

    def singular_values(self) -> Array:
        count = ctypes.c_int32()
        values = self.lib.okid_subspace_singular_values(self.handle, ctypes.byref(count))
        return np.ctypeslib.as_array(values, (count.value,)).copy()

    def model(self, n: int) -> Model:
        u, y = self.n_u, self.n_y
        shapes = {"A": (n, n), "B": (u, n), "C": (n, y), "D": (u, y), "K": (y, n), "innovation": (y, y)}
        out = {name: np.zeros(shape) for name, shape in shapes.items()}
        pointers = [None if u == 0 and name in "BD" else abi.pointer(a) for name, a in out.items()]
        status = self.lib.okid_subspace_realize(self.handle, n, *pointers)
        assert status == 0, abi.status_text(status)
        return Model(**{name: a.T for name, a in out.items()})


def sums(records: list[Array], n_u: int, i: int, mean: bool = False) -> tuple[Array, int]:
    with Accumulator(n_u, records[0].shape[1] - n_u, 2 * i - 1) as accumulator:
        for record in records:
            accumulator.gap(0)
            accumulator.add(record)
        return accumulator.gram("mean" if mean else "none")[0], accumulator.rows


def triangle(record: Array, n_u: int, i: int) -> tuple[Array, int]:
    """okid_square_root_factor() of one record, as `decompose_factor` takes it."""
    lib, config = abi.library(), abi.SquareRootConfig()
    config.n_u, config.n_y, config.lags, config.forgetting = n_u, record.shape[1] - n_u, 2 * i - 1, 1.0
    block, handle = abi.block(lib.okid_square_root_memsize(ctypes.byref(config))), ctypes.c_void_p()
    args = (ctypes.byref(handle), ctypes.byref(config), block.ctypes.data, block.size)
    assert lib.okid_square_root_create(*args) == 0
    samples, size = np.ascontiguousarray(record), 2 * i * record.shape[1]
    assert lib.okid_square_root_add(handle, abi.pointer(samples), len(samples)) == 0
    factor = np.zeros((size, size))
    assert lib.okid_square_root_factor(handle, abi.DETREND_NONE, abi.pointer(factor), None) == 0
    return factor, lib.okid_square_root_rows(handle)


def identified(records: list[Array], n_u: int, i: int, n: int, method: str, ridge: float = 0.0) -> Model:
    solver = Subspace(n_u, records[0].shape[1] - n_u, i, method, n, ridge=ridge)
    return solver.decompose(*sums(records, n_u, i)).model(n)


def output_error(A: Array, C: Array, records: list[Array], n_u: int) -> tuple[Array, Array, Array]:
    """B, D and the initial states (records, n_z)."""
    lib, n, n_y = abi.library(), len(A), len(C)
    v = np.ascontiguousarray(np.vstack(records))
    counts = np.array([len(r) for r in records], np.int32)
    work = abi.block(lib.okid_subspace_output_error_memsize(n_u, n_y, n, len(records)))
    B, D, x0 = np.zeros((n_u, n)), np.zeros((n_u, n_y)), np.zeros((len(records), n))
    given_a, given_c = np.ascontiguousarray(A.T), np.ascontiguousarray(C.T)
    status = lib.okid_subspace_output_error(
        abi.ModelView(n_u, n_y, n, A=abi.pointer(given_a), C=abi.pointer(given_c)),
        abi.Records(len(records), counts.ctypes.data_as(abi.int32s), abi.pointer(v)),
        *map(abi.pointer, (B, D, x0)), work.ctypes.data, work.size,
    )  # fmt: skip
    assert status == 0, abi.status_text(status)
    return B.T, D.T, x0


# ---- the reference -------------------------------------------------------------------------------------------------


@dataclass
class Hankel:
    """Eq. 56-59 over all records; columns with a missing sample are left out. `v` is (2i, m, j), the oldest first."""

    records: list[Array]
    n_u: int
    i: int

    def __post_init__(self) -> None:
        m = self.records[0].shape[1]
        w = reference.lagged(self.records, 2 * self.i - 1)
        self.v = np.ascontiguousarray(w.reshape(len(w), 2 * self.i, m)[:, ::-1].transpose(1, 2, 0))
        self.j, self.n_y = len(w), m - self.n_u
        i, j = self.i, self.j
        self.W_p, self.U_f = self.v[:i].reshape(-1, j), self.v[i:, : self.n_u].reshape(-1, j)
        self.Y_f = self.v[i:, self.n_u :].reshape(-1, j)

    def pi(self) -> Array:
        """The projector of eq. 68."""
        if self.n_u == 0:
            return np.eye(self.j)
        return np.eye(self.j) - self.U_f.T @ np.linalg.pinv(self.U_f @ self.U_f.T) @ self.U_f


def fitted(target: Array, rows: Array) -> Array:
    """The part of `target` in the span of `rows`."""
    return np.linalg.lstsq(rows.T, target.T, rcond=None)[0].T @ rows


def observability(h: Hankel, n: int, method: str) -> tuple[Array, Array]:
    """Gamma (eq. 72-83 with the pseudo-inverse of W2) and all singular values."""
    pi = h.pi()
    o = h.Y_f @ pi @ np.linalg.pinv(h.W_p @ pi) @ h.W_p
    w1 = np.eye(len(h.Y_f))
    if method == "cva":  # the symmetric root: another factor than the library's
        values, vectors = np.linalg.eigh(h.Y_f @ pi @ h.Y_f.T)
        w1 = vectors / np.sqrt(values) @ vectors.T
    left, s, _ = np.linalg.svd(w1 @ o @ pi, full_matrices=False)
    return np.linalg.solve(w1, left[:, :n] * np.sqrt(s[:n])), s


def toeplitz(A: Array, B: Array, C: Array, D: Array, i: int) -> Array:
    """H of eq. 64."""
    n_y, n_u = D.shape
    blocks, h = chain(A, B, C, D, i), np.zeros((i * n_y, i * n_u))
    for r in range(i):
        for c in range(r + 1):
            h[r * n_y : (r + 1) * n_y, c * n_u : (c + 1) * n_u] = blocks[r - c]
    return h


def joint_inputs(h: Hankel, gamma: Array, A: Array, C: Array) -> tuple[Array, Array]:
    """B and D: least squares of (I - Gamma Gamma^+) (Y_f U_f^+ U_f - H(B, D) U_f), one column for each unknown."""
    n, n_u, n_y = len(A), h.n_u, h.n_y
    keep = np.eye(len(gamma)) - gamma @ np.linalg.pinv(gamma)
    columns = []
    for k in range(n_u * (n + n_y)):
        unit = np.zeros(n_u * (n + n_y))
        unit[k] = 1.0
        B, D = unit[: n * n_u].reshape(n, n_u), unit[n * n_u :].reshape(n_y, n_u)
        columns.append((keep @ toeplitz(A, B, C, D, h.i) @ h.U_f).reshape(-1))
    target = (keep @ fitted(h.Y_f, h.U_f)).reshape(-1)
    found = np.linalg.lstsq(np.array(columns).T, target, rcond=None)[0]
    return found[: n * n_u].reshape(n, n_u), found[n * n_u :].reshape(n_y, n_u)


def riccati_gain(A: Array, C: Array, W: Array, V: Array) -> tuple[Array, Array]:
    """K and the innovation covariance from the residuals of the state equations (SciPy's solver)."""
    n, j = len(A), W.shape[1]
    both = np.vstack([W, V])
    cov = both @ both.T / j
    P = solve_discrete_are(A.T, C.T, cov[:n, :n], cov[n:, n:], s=cov[:n, n:])
    innovation = C @ P @ C.T + cov[n:, n:]
    return (A @ P @ C.T + cov[:n, n:]) @ np.linalg.inv(innovation), innovation


def projection_reference(h: Hankel, n: int, method: str) -> tuple[Model, Array]:
    """MOESP or CVA (eq. 84-86), B and D, K from the residuals of both state sequences."""
    gamma, s = observability(h, n, method)
    n_y, n_u, i = h.n_y, h.n_u, h.i
    A = np.linalg.lstsq(gamma[:-n_y], gamma[n_y:], rcond=None)[0]
    C = gamma[:n_y]
    B, D = joint_inputs(h, gamma, A, C) if n_u else (np.zeros((n, 0)), np.zeros((n_y, 0)))
    known = np.vstack([h.W_p, h.U_f])
    x = np.linalg.pinv(gamma) @ (fitted(h.Y_f, known) - toeplitz(A, B, C, D, i) @ h.U_f)
    later = fitted(h.Y_f[n_y:], np.vstack([known, h.Y_f[:n_y]])) - toeplitz(A, B, C, D, i - 1) @ h.U_f[n_u:]
    x_next = np.linalg.lstsq(gamma[:-n_y], later, rcond=None)[0]
    u, y = h.U_f[:n_u], h.Y_f[:n_y]
    K, innovation = riccati_gain(A, C, x_next - A @ x - B @ u, y - C @ x - D @ u)
    return Model(A, B, C, D, K, innovation), s


def ssarx_reference(h: Hankel, n: int) -> tuple[Model, Array, Array]:
    """Jansson (2003) as in numerics.md; also the observability matrix that the SVD gives."""
    i, n_u, n_y = h.i, h.n_u, h.n_y
    m, y, u = n_u + n_y, h.Y_f[:n_y], h.U_f[:n_u]
    arx = np.linalg.lstsq(np.vstack([h.W_p, u]).T, y.T, rcond=None)[0].T
    D, lag = arx[:, i * m :], [arx[:, (i - k) * m : (i - k + 1) * m] for k in range(1, i + 1)]
    rows = []
    for a in range(i):
        row = h.v[i + a, n_u:] - D @ h.v[i + a, :n_u]
        for k in range(1, a + 1):
            row = row - lag[k - 1] @ h.v[i + a - k]
        rows.append(row)
    corrected = np.vstack(rows)
    F11 = np.linalg.cholesky(h.W_p @ h.W_p.T)
    F21 = np.linalg.solve(F11, h.W_p @ corrected.T).T
    S = np.linalg.cholesky(corrected @ corrected.T)
    left, s, right = np.linalg.svd(np.linalg.solve(S, F21), full_matrices=False)
    J = np.sqrt(s[:n])[:, None] * np.linalg.solve(F11.T, right[:n].T).T
    x, x_next = J @ h.W_p, J @ h.v[1 : i + 1].reshape(-1, h.j)
    xu = np.vstack([x, u])
    CD = np.linalg.lstsq(xu.T, y.T, rcond=None)[0].T
    AB = np.linalg.lstsq(xu.T, x_next.T, rcond=None)[0].T
    V, W = y - CD @ xu, x_next - AB @ xu
    K, innovation = riccati_gain(AB[:, :n], CD[:, :n], W, V)
    return Model(AB[:, :n], AB[:, n:], CD[:, :n], CD[:, n:], K, innovation), s, S @ left[:, :n] * np.sqrt(s[:n])


# ---- the same as the reference -------------------------------------------------------------------------------------


@settings(max_examples=12)
@given(st.integers(0, 2**31), st.sampled_from(["w1", "w2"]), st.sampled_from(sorted(METHODS)), st.integers(0, 3))
def test_equals_explicit_hankel_matrices(seed: int, name: str, method: str, holes: int) -> None:
    s = getattr(systems, name)()
    v = np.hstack(systems.record(s, 900, 3.0, seed))
    rng = np.random.default_rng(seed)
    for hole in rng.integers(0, len(v), holes):
        v[hole, rng.integers(v.shape[1])] = np.nan
    records, n, n_u, i = [v[:400], v[400:]], 2 * len(s.M), len(s.force_dofs), 8
    h = Hankel(records, n_u, i)
    gram, rows = sums(records, n_u, i)
    assert rows == h.j
    solver = Subspace(n_u, h.n_y, i, method, n).decompose(gram, rows)
    found = solver.model(n)
    expected, values = ssarx_reference(h, n)[:2] if method == "ssarx" else projection_reference(h, n, method)
    np.testing.assert_allclose(solver.singular_values(), values, rtol=1e-8)
    assert np.max(np.abs(found.poles() - expected.poles())) < 1e-9
    assert relative(found.markov(), expected.markov()) < 1e-8
    assert relative(found.gain_markov(), expected.gain_markov()) < 1e-6
    assert relative(found.innovation, expected.innovation) < 1e-6
    assert found.predictor_radius() < 1.0


@pytest.mark.parametrize("method", sorted(METHODS))
def test_output_only_equals_explicit_hankel_matrices(method: str) -> None:
    s = systems.w1()
    y = systems.record(s, 3000, 3.0, 5)[1]
    h = Hankel([y], 0, 8)
    found = identified([y], 0, 8, 6, method)
    expected = ssarx_reference(h, 6)[0] if method == "ssarx" else projection_reference(h, 6, method)[0]
    assert np.max(np.abs(found.poles() - expected.poles())) < 1e-9
    assert relative(found.gain_markov(), expected.gain_markov()) < 1e-6
    assert found.predictor_radius() < 1.0


@pytest.mark.parametrize("method", sorted(METHODS))
def test_units_change_nothing(method: str) -> None:
    s = systems.w2()
    u, y = systems.record(s, 4000, 2.0, 3)
    base = identified([np.hstack([u, y])], 2, 15, 12, method)
    scaled = identified([np.hstack([u * 1e4, y])], 2, 15, 12, method)
    assert np.max(np.abs(base.poles() - scaled.poles())) < 1e-10
    assert relative(scaled.markov() * 1e4, base.markov()) < 1e-8


# ---- accuracy ------------------------------------------------------------------------------------------------------


def errors(s: systems.Structure, model: Model) -> tuple[float, float]:
    """Worst relative error of frequency and damping ratio."""
    f, zeta = s.modes()
    found, damping, _ = reference.modal(model.A, model.C, s.dt)
    if len(found) < len(f):
        return np.inf, np.inf
    near = [int(np.argmin(np.abs(found - x))) for x in f]
    return float(np.max(np.abs(found[near] / f - 1))), float(np.max(np.abs(damping[near] / zeta - 1)))


@pytest.mark.parametrize("name", sorted(ROWS))
@pytest.mark.parametrize("form", ["gram", "factor"])
def test_noise_free(name: str, form: str) -> None:
    s = getattr(systems, name)()
    i, n, n_u = ROWS[name], 2 * len(s.M), len(s.force_dofs)
    v = np.hstack(systems.record(s, 10000, 0.0, 7))
    truth = Model(*s.discrete()).markov()
    data = sums([v], n_u, i) if form == "gram" else triangle(v, n_u, i)
    for method in METHODS:
        solver = Subspace(n_u, len(s.M), i, method, n, int(form == "factor"))
        found = (solver.decompose if form == "gram" else solver.decompose_factor)(*data).model(n)
        f, zeta = errors(s, found)
        assert f < 1e-8 and zeta < 1e-8, (method, f, zeta)
        assert relative(found.markov(), truth) < 1e-8
        assert found.predictor_radius() < 1.0


def test_the_factor_does_not_square_the_condition() -> None:
    """A steep red input and 1e-8 of noise: the Gram matrix has lost what the factor still has."""
    s = systems.w1()
    rng = np.random.default_rng(2)
    u = lfilter(np.full(4, 0.25), 1, lfilter([1e-3], [1, -1.96, 0.98**2], rng.standard_normal(6000)))[:, None]
    y = systems.simulate(s.discrete(), u)
    y += 1e-8 * np.std(y, axis=0) * rng.standard_normal(y.shape)
    v, worst = np.hstack([u, y]), {}
    for form in ("gram", "factor"):
        solver = Subspace(1, 3, 20, "moesp", 6, 1)
        found = solver.decompose(*sums([v], 1, 20)) if form == "gram" else solver.decompose_factor(*triangle(v, 1, 20))
        worst[form] = errors(s, found.model(6))[1]
    assert worst["factor"] < 1e-8 < 0.1 * worst["gram"]


def test_process_noise_the_gain_predicts_as_the_true_kalman_filter() -> None:
    """Unmeasured forces on all masses: the innovations of the identified gain are within 5 % of the optimum."""
    s = systems.w1()
    all_forces = systems.Structure(s.M, s.R, s.K, (0, 1, 2), s.sense_dofs, s.dt)
    (A, B, C, D), (_, E, _, F) = s.discrete(), all_forces.discrete()
    rng = np.random.default_rng(4)
    u, w = rng.standard_normal((20000, 1)), 0.3 * rng.standard_normal((20000, 3))
    y = systems.simulate((A, B, C, D), u) + systems.simulate((A, E, C, F), w)
    sigma = 0.05 * np.std(y, axis=0)
    y += sigma * rng.standard_normal(y.shape)
    P = solve_discrete_are(A.T, C.T, 0.09 * E @ E.T, 0.09 * F @ F.T + np.diag(sigma**2), s=0.09 * E @ F.T)
    best = np.diag(C @ P @ C.T + 0.09 * F @ F.T + np.diag(sigma**2))
    for method in METHODS:
        found = identified([np.hstack([u, y])], 1, 40, 6, method)
        x, residual = np.zeros(6), np.zeros_like(y)
        for k in range(len(y)):
            residual[k] = y[k] - found.C @ x - found.D @ u[k]
            x = found.A @ x + found.B @ u[k] + found.K @ residual[k]
        assert np.all(np.mean(residual[500:] ** 2, axis=0) < 1.05 * best), method


# ---- published results ---------------------------------------------------------------------------------------------

HAIR_DRYER = [69.8841, 14.9963, 3.6675, 1.9677, 0.3000, 0.2078, 0.1651, 0.1373,
              0.1133, 0.1059, 0.0856, 0.0784, 0.0733, 0.0678, 0.0571]  # fmt: skip


def test_slicot_example_record() -> None:
    v = np.genfromtxt(data_file("slicot_ib01_example/slicot_ib01_example.csv"), delimiter=",", comments="#")[1:]
    solver = Subspace(1, 1, 15, "moesp").decompose(*sums([v], 1, 15))
    np.testing.assert_allclose(solver.singular_values(), HAIR_DRYER, rtol=0, atol=0.5001e-4)
    poles = solver.model(4).poles()
    printed = np.sort_complex([0.9611, 0.7455, 0.4758 + 0.2001j, 0.4758 - 0.2001j])
    assert np.max(np.abs(poles - printed)) < 2.1e-4  # what the rounding of the printed A leaves


@pytest.mark.parametrize(
    ("path", "n_u", "i", "n", "published"),
    [
        ("daisy_robot_arm/daisy_robot_arm.csv", 1, 20, 4, 3.60e-2),
        ("slicot_ib01_example/slicot_ib01_example.csv", 1, 15, 4, 1.50e-2),
        ("daisy_cd_player_arm/daisy_cd_player_arm.csv", 2, 15, 8, 1.76e-1),
    ],
    ids=["robot arm", "hair dryer", "CD arm"],
)
def test_published_simulation_errors(path: str, n_u: int, i: int, n: int, published: float) -> None:
    v = np.genfromtxt(data_file(path), delimiter=",", comments="#")[1:]
    if n_u == 2:
        v = detrend(v, axis=0)
    u, y = v[:, :n_u], v[:, n_u:]
    found = identified([v], n_u, i, n, "moesp")
    B, D, x0 = output_error(found.A, found.C, [v], n_u)
    error = np.linalg.norm(y - systems.simulate((found.A, B, found.C, D), u, x0[0]), 1) / np.linalg.norm(y, 1)
    assert error < 1.02 * published
    assert found.predictor_radius() < 1.0  # the orders are far below that of the plant: a hard case for the gain
    live = systems.simulate((found.A, found.B, found.C, found.D), u, x0[0])
    assert np.linalg.norm(y - live, 1) < 0.4 * np.linalg.norm(y, 1)  # B and D without the record


@pytest.mark.parametrize(("method", "ridge", "order"), [("moesp", 1e-4, 40), ("cva", 0.0, 40), ("ssarx", 1e-2, 60)])
def test_steel_frame_with_28_redundant_accelerometers(method: str, ridge: float, order: int) -> None:
    frame = okid.read_csv(data_file("daisy_flexible_structure/daisy_flexible_structure.csv"))
    solver = Subspace(2, 28, 15, method, order, ridge=ridge).decompose(*sums([frame.samples], 2, 15, mean=True))
    found = solver.model(order)
    f, _, _ = reference.modal(found.A, found.C, 1.0 / 1024.0)
    assert [x for x in FRAME_HZ if np.min(np.abs(f - x)) > 1.0] == []
    assert np.max(np.abs(found.poles())) < 1.0  # without a ridge SSARX has a radius above 2 here (trap 22)
    assert found.predictor_radius() < 1.0


# ---- traps of the printed equations --------------------------------------------------------------------------------


def test_trap_6_the_second_weight_is_a_projector() -> None:
    """W2 of table 1 has no inverse; L32 of the LQ factor is O_i W2 in orthonormal coordinates."""
    s = systems.w1()
    h = Hankel([np.hstack(systems.record(s, 500, 2.0, 3))], 1, 8)
    pi = h.pi()
    np.testing.assert_allclose(pi @ pi, pi, atol=1e-12)
    assert np.linalg.matrix_rank(pi) == h.j - 8
    np.testing.assert_allclose(np.linalg.pinv(pi, rcond=1e-8), pi, atol=1e-10)
    o = h.Y_f @ pi @ np.linalg.pinv(h.W_p @ pi) @ h.W_p
    L = np.linalg.qr(np.vstack([h.U_f, h.W_p, h.Y_f]).T, mode="r").T
    L31, L32 = L[8 + 32 :, :8], L[8 + 32 :, 8 : 8 + 32]
    L21, L22 = L[8 : 8 + 32, :8], L[8 : 8 + 32, 8 : 8 + 32]
    np.testing.assert_allclose(o @ pi @ o.T, L32 @ L32.T, rtol=1e-8, atol=1e-8 * np.linalg.norm(L32) ** 2)
    oblique = L32 @ np.linalg.pinv(L22) @ np.hstack([L21, L22])  # O_i itself, in coordinates
    np.testing.assert_allclose(o @ o.T, oblique @ oblique.T, atol=1e-8 * np.linalg.norm(o) ** 2)
    assert relative(L31, o @ np.linalg.pinv(h.U_f)) > 0.1  # and L31 is not part of it
    solver = Subspace(1, 3, 8, "moesp").decompose(*sums(h.records, 1, 8))
    np.testing.assert_allclose(solver.singular_values(), np.linalg.svd(L32, compute_uv=False), rtol=1e-8)


@pytest.mark.parametrize("name", ["w1", "w2"])
def test_trap_7_the_cva_weight_of_noise_free_data_is_singular(name: str) -> None:
    s = getattr(systems, name)()
    n, n_u, i = 2 * len(s.M), len(s.force_dofs), 10
    v = np.hstack(systems.record(s, 2000, 0.0, 3))
    h = Hankel([v], n_u, i)
    free = h.Y_f - fitted(h.Y_f, h.U_f)
    spectrum = np.linalg.eigvalsh(free @ free.T)[::-1]
    assert spectrum[n - 1] > 1e-8 * spectrum[0] > 1e4 * abs(spectrum[n])  # rank n_z: no inverse square root
    f, zeta = errors(s, identified([v], n_u, i, n, "cva"))
    assert f < 1e-10 and zeta < 1e-8


def test_trap_8_the_ssarx_observability_is_that_of_the_predictor() -> None:
    """Shift invariance of S U Sigma^(1/2) gives A - K C, not A: the model must come from the states."""
    s = systems.w1()
    v = np.hstack(systems.record(s, 20000, 5.0, 3))
    truth = Model(*s.discrete()).poles()
    _, _, gamma = ssarx_reference(Hankel([v], 1, 20), 6)
    shifted = np.linalg.lstsq(gamma[:-3], gamma[3:], rcond=None)[0]
    found = identified([v], 1, 20, 6, "ssarx")
    assert np.max(np.abs(found.poles() - truth)) < 1e-3
    assert np.max(np.abs(np.sort_complex(np.linalg.eigvals(shifted)) - truth)) > 1e-2
    assert np.max(np.abs(np.linalg.eigvals(shifted))) < found.predictor_radius() + 0.05


def printed_inputs(h: Hankel, gamma: Array, A: Array, C: Array, joint: bool) -> tuple[Array, Array]:
    """Eq. 87-94 with L11 divided out. Joint: least squares of (91); else (93), the product of two pseudo-inverses."""
    i, n_y, n_u, n = h.i, h.n_y, h.n_u, len(A)
    P = np.linalg.svd(gamma)[0][:, n:].T
    N = P @ h.Y_f @ np.linalg.pinv(h.U_f)
    left = np.zeros((i * len(P), i * n_y))
    for k in range(i):
        left[k * len(P) : (k + 1) * len(P), : (i - k) * n_y] = P[:, k * n_y :]
    right = np.zeros((i * n_y, n_y + n))
    right[:n_y, :n_y], right[n_y:, n_y:] = np.eye(n_y), gamma[:-n_y]
    stack = np.vstack([N[:, k * n_u : (k + 1) * n_u] for k in range(i)])
    if joint:
        omega = np.linalg.lstsq(left @ right, stack, rcond=None)[0]
    else:
        omega = np.linalg.pinv(right) @ np.linalg.pinv(left) @ stack
    return omega[n_y:], omega[:n_y]


def test_trap_9_a_product_of_pseudo_inverses_is_not_least_squares() -> None:
    """Noise-free all ways agree. With noise (93) differs from least squares and output error is best; the library's own
    way, without the record, is about as good as (93)."""
    s = systems.w1()
    truth, levels = Model(*s.discrete()).markov(), {}
    for noise, seeds in ((0.0, 1), (5.0, 6)):
        for seed in range(seeds):
            v, i = np.hstack(systems.record(s, 4000, noise, seed)), 10
            h, found = Hankel([v], 1, i), identified([v], 1, i, 6, "moesp")
            gamma = observability(h, 6, "moesp")[0]
            C = gamma[:3]
            A = np.linalg.lstsq(gamma[:-3], gamma[3:], rcond=None)[0]
            ways = {"93": printed_inputs(h, gamma, A, C, False), "joint": printed_inputs(h, gamma, A, C, True)}
            ways["output error"] = output_error(A, C, [v], 1)[:2]
            for way, (B, D) in ways.items():
                levels.setdefault((noise, way), []).append(relative(chain(A, B, C, D, 30), truth))
            levels.setdefault((noise, "library"), []).append(relative(found.markov(), truth))
            if noise:
                assert relative(np.vstack(ways["93"]), np.vstack(ways["joint"])) > 1e-4
    rms = {key: float(np.sqrt(np.mean(np.square(values)))) for key, values in levels.items()}
    assert max(value for (noise, _), value in rms.items() if noise == 0.0) < 1e-11
    assert rms[5.0, "output error"] < rms[5.0, "library"] < 1.2 * rms[5.0, "93"], rms


def test_trap_9_what_was_not_excited_must_not_decide() -> None:
    """CD player arm, inputs without high frequencies: (88) divides by them and the printed B and D explode."""
    v = np.genfromtxt(data_file("daisy_cd_player_arm/daisy_cd_player_arm.csv"), delimiter=",", comments="#")[1:]
    v = detrend(v, axis=0)
    h, found = Hankel([v], 2, 15), identified([v], 2, 15, 8, "moesp")
    gamma = np.vstack(list(chain(found.A, found.A, found.C, found.C, 14)))
    u, y = v[:, :2], v[:, 2:]

    def misfit(B: Array, D: Array) -> float:
        answer = systems.simulate((found.A, B, found.C, D), u)
        return float(np.linalg.norm(y - answer, 1) / np.linalg.norm(y, 1))

    assert misfit(*printed_inputs(h, gamma, found.A, found.C, joint=False)) > 5.0
    assert misfit(*printed_inputs(h, gamma, found.A, found.C, joint=True)) > 5.0
    assert misfit(found.B, found.D) < 0.5


# ---- output error --------------------------------------------------------------------------------------------------


@settings(max_examples=10)
@given(st.integers(0, 2**31), st.integers(1, 3), st.booleans())
def test_output_error_is_the_least_squares_fit(seed: int, records: int, holes: bool) -> None:
    """Against lstsq over simulated unit responses, in any basis of the states, some poles real."""
    rng = np.random.default_rng(seed)
    n, n_u, n_y = int(rng.integers(2, 7)), int(rng.integers(1, 3)), int(rng.integers(1, 4))
    A = 0.95 * expm((lambda g: g - g.T)(rng.standard_normal((n, n)))) + 0.02 * rng.standard_normal((n, n))
    C = rng.standard_normal((n_y, n))
    data = [rng.standard_normal((int(rng.integers(40, 90)), n_u + n_y)) for _ in range(records)]
    if holes:
        data[0][int(rng.integers(0, 40)), n_u] = np.nan
    B, D, x0 = output_error(A, C, data, n_u)
    columns, targets, weights = [], [], []
    unknowns = n * n_u + n_y * n_u + n * records
    for k in range(unknowns):
        unit = np.zeros(unknowns)
        unit[k] = 1.0
        b, d = unit[: n * n_u].reshape(n, n_u), unit[n * n_u : n_u * (n + n_y)].reshape(n_y, n_u)
        starts = unit[n_u * (n + n_y) :].reshape(records, n)
        columns.append(
            np.vstack([systems.simulate((A, b, C, d), v[:, :n_u], x) for v, x in zip(data, starts, strict=True)])
        )
    for v in data:
        good = np.isfinite(v[:, n_u:]).all(axis=1)
        targets.append(np.where(good[:, None], v[:, n_u:], 0.0))
        weights.append(np.repeat(good[:, None], n_y, axis=1))
    weight = np.vstack(weights).reshape(-1).astype(float)
    design = np.array([c.reshape(-1) for c in columns]).T * weight[:, None]
    expected = np.linalg.lstsq(design, np.vstack(targets).reshape(-1), rcond=None)[0]
    found = np.concatenate([B.reshape(-1), D.reshape(-1), x0.reshape(-1)])
    np.testing.assert_allclose(found, expected, rtol=1e-6, atol=1e-7 * np.max(np.abs(expected)))
