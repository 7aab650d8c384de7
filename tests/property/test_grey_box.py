# SPDX-License-Identifier: MIT
"""okid.fit_structure and okid.VirtualSensors: parameters, lost sensors and forces of structures that the tests simulate
by themselves; standard deviations are held against the errors."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import okid
import pytest
from scipy.linalg import eigh
from systems import Structure, record, simulate, w2

MASSES, SPRINGS = [2.0, 1.5, 1.8, 1.2, 1.6, 1.0], [8e4, 6e4, 7e4, 5e4, 5.5e4, 4e4]
START = {f"k{k}": 5e4 for k in range(1, 7)} | {"z": 0.02}


def _frame(z: float, **springs: float) -> okid.Structure:
    return okid.Structure.chain(MASSES, [springs[f"k{k}"] for k in range(1, 7)], zeta=(z, z))


def test_springs_and_a_mass_from_forced_vibration() -> None:
    s = w2()
    u, y = record(s, 12000, 2.0, 1)
    result = okid.identify(u, y[:, [0, 2, 5]], fs=s.fs)

    def build(m: float, **others: float) -> okid.Structure:
        return okid.Structure.chain([m, *MASSES[1:]], [others[f"k{k}"] for k in range(1, 7)], zeta=(others["z"],) * 2)

    found = okid.fit_structure(result, build, START | {"m": 1.0}, input_dofs=[1, 4], output_dofs=[1, 3, 6])
    true = {f"k{k}": value for k, value in enumerate(SPRINGS, 1)} | {"m": 2.0, "z": 0.01}
    for name, value in found.values.items():
        assert value == pytest.approx(true[name], rel=0.01)
        assert abs(value - true[name]) < 4.0 * found.std[name]
        assert found.std[name] < 0.02 * value
    assert found.misfit < 2.0 and len(found.modes) == 6 and min(mode.mac for mode in found.modes) > 0.99
    assert found.structure.M[0, 0] == found.values["m"]


def test_ground_motion_and_relative_coordinates() -> None:
    s = replace(w2(), force_dofs=tuple(range(6)))
    A, B, C, D = s.discrete()
    r = np.random.default_rng(3)
    ground = r.normal(size=(15000, 1))
    shake = -s.M @ np.ones((6, 1))
    y = simulate((A, B @ shake, C, D @ shake + 1.0), ground)  # absolute accelerations
    y += 0.02 * np.std(y, axis=0) * r.normal(size=y.shape)
    result = okid.identify(ground, y[:, [1, 3, 5]], fs=s.fs)
    found = okid.fit_structure(result, _frame, START, ground=[1.0] * 6, output_dofs=[2, 4, 6])
    assert list(found.values.values())[:6] == pytest.approx(SPRINGS, rel=2e-3)


def test_ambient_modes_tell_springs_of_known_masses_only() -> None:
    s = replace(w2(), force_dofs=tuple(range(6)))
    result = okid.identify(None, record(s, 30000, 2.0, 4)[1], fs=s.fs)
    found = okid.fit_structure(result, _frame, START, output_dofs=[1, 2, 3, 4, 5, 6])
    assert list(found.values.values())[:6] == pytest.approx(SPRINGS, rel=0.05)
    errors = [(found.values[f"k{k}"] - value) / found.std[f"k{k}"] for k, value in enumerate(SPRINGS, 1)]
    assert np.sqrt(np.mean(np.square(errors))) < 2.5

    def scaled(m: float, **springs: float) -> okid.Structure:
        one = _frame(**springs)
        return okid.Structure(m * one.M, one.R, one.K)

    with pytest.raises(okid.IdentificationError, match="without forces only ratios can be identified"):
        okid.fit_structure(result, scaled, START | {"m": 1.0}, output_dofs=[1, 2, 3, 4, 5, 6])
    for given, words in (
        ({"output_dofs": [1]}, "output_dofs has 1"),
        ({"modes": [9]}, "modes is"),
        ({"ground": [1.0] * 6}, "ground needs one input"),
        ({"input_dofs": [1]}, "input_dofs has 1"),
    ):
        with pytest.raises(okid.InputError, match=words):
            okid.fit_structure(result, _frame, START, **{"output_dofs": [1, 2, 3, 4, 5, 6], **given})


def _beam(left: float, right: float, tip: float, z: float) -> okid.Structure:
    """A cantilever of eight Euler-Bernoulli elements and 2 kg: E I of its halves in N m^2, a mass at its tip."""
    length, per_metre, nodes = 0.1, 2.5, 8
    mass = per_metre * length / 420.0 * np.array([
        [156.0, 22.0 * length, 54.0, -13.0 * length],
        [22.0 * length, 4.0 * length**2, 13.0 * length, -3.0 * length**2],
        [54.0, 13.0 * length, 156.0, -22.0 * length],
        [-13.0 * length, -3.0 * length**2, -22.0 * length, 4.0 * length**2],
    ])  # fmt: skip
    bend = np.array([
        [12.0, 6.0 * length, -12.0, 6.0 * length],
        [6.0 * length, 4.0 * length**2, -6.0 * length, 2.0 * length**2],
        [-12.0, -6.0 * length, 12.0, -6.0 * length],
        [6.0 * length, 2.0 * length**2, -6.0 * length, 4.0 * length**2],
    ]) / length**3  # fmt: skip
    M, K = np.zeros((2 * nodes + 2,) * 2), np.zeros((2 * nodes + 2,) * 2)
    for k in range(nodes):
        own = slice(2 * k, 2 * k + 4)
        M[own, own] += mass
        K[own, own] += (left if k < nodes // 2 else right) * bend
    M, K = M[2:, 2:], K[2:, 2:]  # clamped
    M[-2, -2] += tip
    squares, V = eigh(K, M)
    keep = V[:, :5]  # its lower modes; the others are far above what is measured
    R = M @ keep @ np.diag(2.0 * z * np.sqrt(squares[:5])) @ keep.T @ M
    return okid.Structure(M, R, K)


def test_finite_elements_are_updated_by_named_parameters() -> None:
    """Two stiffnesses and a mass of 16 degrees of freedom out of two accelerometers and one force. The record is a sum
    of five modes, not the model that is fitted."""
    true = {"left": 40.0, "right": 25.0, "tip": 0.3, "z": 0.01}
    made, fs, samples = _beam(**true), 2000.0, 20000
    squares, V = eigh(made.K, made.M)
    r = np.random.default_rng(11)
    force, y = r.normal(size=samples), np.zeros((samples, 2))
    for k in range(5):
        one = Structure(
            np.eye(1), np.eye(1) * 2.0 * true["z"] * np.sqrt(squares[k]), np.eye(1) * squares[k], (0,), (0,), 1 / fs
        )
        y += np.outer(simulate(one.discrete(), V[14, k] * force[:, None])[:, 0], V[[6, 14], k])
    y += 0.01 * y.std(axis=0) * r.normal(size=y.shape)
    result = okid.identify(force[:, None], y, fs=fs)
    start = {"left": 30.0, "right": 30.0, "tip": 0.2, "z": 0.02}
    found = okid.fit_structure(result, _beam, start, input_dofs=[15], output_dofs=[7, 15])
    for name, value in true.items():
        assert found.values[name] == pytest.approx(value, rel=0.02 if name != "z" else 0.05), found.values


def _record(seed: int) -> tuple[Structure, np.ndarray, np.ndarray, okid.Result]:
    s = w2()
    u, y = record(s, 9000, 2.0, seed)
    return s, u, y, okid.identify(u[:6000], y[:6000], fs=s.fs, method="n4sid-cva", sigma="none")


def test_lost_sensor_and_bridged_gap() -> None:
    _, u, y, result = _record(1)
    sensors = okid.VirtualSensors.of(result.model, u[:6000], y[:6000])
    late = y[6000:].copy()
    late[:, 2] = np.nan
    late[1000:1030] = np.nan
    found = sensors.run(late, u[6000:])
    error = (found.y - y[6000:])[200:]
    assert np.std(error[:, 2]) < 0.05 * np.std(y[:, 2])
    assert 0.6 < float(np.std(error[:, 2] / found.y_std[200:, 2])) < 1.6
    gap = slice(800, 830)
    assert 0.5 < float(np.std(error[gap] / found.y_std[200:][gap])) < 1.7
    measured = np.isfinite(late)
    assert np.array_equal(found.y[measured], late[measured]) and np.all(found.y_std[measured] == 0.0)


def test_ambient_forecast_grows_to_the_spread_of_the_output() -> None:
    s = replace(w2(), force_dofs=tuple(range(6)))
    _, y = record(s, 16000, 2.0, 2)
    model = okid.identify(None, y[:12000], fs=s.fs, sigma="none").model
    sensors = okid.VirtualSensors.of(model, None, y[:12000])
    late = y[12000:].copy()
    late[:, 2] = np.nan
    found = sensors.run(late)
    error = found.y[200:, 2] - y[12200:, 2]
    assert np.std(error) < 0.4 * np.std(y[:, 2]) and 0.7 < float(np.std(error / found.y_std[200:, 2])) < 1.4
    ahead = sensors.forecast(400)
    assert np.all(np.diff(ahead.y_std[:5, 0]) > 0.0)
    assert np.allclose(ahead.y_std[-1, [0, 1, 3, 4, 5]] / np.std(y[:, [0, 1, 3, 4, 5]], axis=0), 1.0, atol=0.5)
    assert np.array_equal(sensors.forecast(400).y, ahead.y)  # it stays where it is


def test_forces_and_places_without_a_sensor() -> None:
    s, u, y, result = _record(3)
    sensors = okid.VirtualSensors.of(result.model, u[:6000], y[:6000], force_std=1.0)
    found = sensors.run(y[6000:])
    assert min(np.corrcoef(found.force[200:, k], u[6200:, k])[0, 1] for k in (0, 1)) > 0.9
    assert 0.8 < float(np.std((found.force - u[6000:])[200:] / found.force_std[200:])) < 1.3
    known = okid.Structure(s.M, s.R, s.K).model(s.fs, [1, 4], [1, 2, 3, 4, 5, 6])
    noise = np.diag((0.02 * np.std(y, axis=0)) ** 2)
    some = y[6000:].copy()
    some[:, [2, 5]] = np.nan
    found = okid.VirtualSensors(known, noise, force_std=1.0).run(some)
    error = (found.y - y[6000:])[200:, [2, 5]]
    assert np.all(np.std(error, axis=0) < 0.05 * np.std(y[:, [2, 5]], axis=0))
    assert 0.8 < float(np.std(error / found.y_std[200:, [2, 5]])) < 1.3
    with pytest.raises(okid.InputError, match="a sample of 6 outputs and 0 inputs"):
        okid.VirtualSensors(known, noise).step(y[0])
    with pytest.raises(okid.InputError, match="expected force_std beside it"):
        okid.VirtualSensors(known, noise, force_hz=3.0)
