# SPDX-License-Identifier: MIT
"""All five methods through okid.identify and `okid identify`: published results, records without inputs, and the same
numbers from both. How exact they are: test_acceptance.py."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import okid
import pytest
import systems
from csv_record import write_csv
from measured_data import data_file
from methods import METHODS, N4SID, by_method
from numpy.typing import NDArray
from okid import abi
from program import ROOT
from program import okid as run
from scipy.signal import detrend

Array = NDArray[np.float64]


def errors(s: systems.Structure, f: Array, zeta: Array) -> tuple[float, float]:
    """Worst relative error of frequency and damping over the true modes."""
    true_f, true_zeta = s.modes()
    near = [int(np.argmin(np.abs(f - x))) for x in true_f]
    return float(np.max(np.abs(f[near] / true_f - 1))), float(np.max(np.abs(zeta[near] / true_zeta - 1)))


def of_result(s: systems.Structure, result: okid.Result) -> tuple[float, float]:
    return errors(
        s,
        np.array([mode.frequency_hz for mode in result.modes]),
        np.array([mode.damping_ratio for mode in result.modes]),
    )


def channels(u: Array, y: Array) -> dict[str, Array]:
    return {f"u{k + 1}": u[:, k] for k in range(u.shape[1])} | {f"y{k + 1}": y[:, k] for k in range(y.shape[1])}


@pytest.mark.parametrize("inputs", [1, 0], ids=["driven", "ambient"])
@pytest.mark.parametrize("method", METHODS)
def test_what_stood_in_the_memory_does_not_matter(method: str, inputs: int, monkeypatch: pytest.MonkeyPatch) -> None:
    s = systems.w1()
    samples = np.hstack(systems.record(s, 3000, 1.0, 1))[:, 1 - inputs :]
    found = []
    block = abi.block
    for byte in (0, 0x3F, 0xFF):  # zeros, small numbers, NaN

        def filled(size: int, byte: int = byte) -> NDArray[np.uint8]:
            out = block(size)
            out[:] = byte
            return out

        monkeypatch.setattr(abi, "block", filled)
        identifier = okid.Identifier(inputs, 3, fs=s.fs, method=method, order=6)
        with okid.Accumulator(inputs, 3, identifier.lags) as sums:
            sums.add(samples)
            found.append(identifier.run(sums))
    for other in found[1:]:
        for name in ("A", "B", "C", "D", "K", "singular_values", "frequency_hz", "emac"):
            np.testing.assert_array_equal(getattr(other, name), getattr(found[0], name), err_msg=name)


@pytest.mark.parametrize("method", METHODS)
def test_program_equals_python(method: str, tmp_path: Path) -> None:
    s = systems.w2()
    u, y = systems.record(s, 6000, 2.0, 3)
    fs = 1 / s.dt
    record = channels(u, y)
    path = write_csv(tmp_path / "record.csv", fs, record)
    rows = 20 if method in N4SID else 40
    options = ["--inputs", "u1,u2", "--outputs", ",".join(f"y{k}" for k in range(1, 7)), "--rows", rows, "--quiet"]
    options += [] if method in N4SID else ["--p", 20]
    run("identify", path, *options, "--method", method, "--json", tmp_path / "r.json", status=0)
    shown = json.loads((tmp_path / "r.json").read_text())
    p = None if method in N4SID else 20
    own = okid.identify(u, y, fs=fs, method=method, p=p, rows=rows).to_dict()
    assert shown["method"] == method
    assert (shown["p"], shown["rows"], shown["order"]) == (own["p"], own["rows"], own["order"])
    assert [w["code"] for w in shown["warnings"]] == [w["code"] for w in own["warnings"]]
    for key in ("frequency_hz", "damping_ratio", "emac", "mpc"):
        np.testing.assert_allclose([m[key] for m in shown["modes"]], [m[key] for m in own["modes"]], rtol=1e-9)
    np.testing.assert_allclose(shown["singular_values"], own["singular_values"], rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(shown["markov"]["Y"], own["markov"]["Y"], rtol=1e-7, atol=1e-10)
    for kind in ("simulation_percent", "prediction_percent"):
        for channel, value in own["fit"][kind].items():
            assert shown["fit"][kind][channel] == pytest.approx(value, abs=1e-6)


@pytest.mark.parametrize("method", METHODS)
def test_record_without_inputs(method: str, tmp_path: Path) -> None:
    """Modes and a predictor; nothing is simulated, and program and Python agree."""
    s = systems.w1()
    _, y = systems.record(s, 60000, 1.0, 5)
    fs = 1 / s.dt
    result = okid.identify(None, y, fs=fs, method=method, rows=40, order=6)
    f, zeta = of_result(s, result)
    assert f < 5e-3 and zeta < 0.5, (f, zeta)  # 100 to 700 cycles at 1 % damping
    assert (result.model.B.shape, result.model.D.shape, result.markov.shape) == ((6, 0), (3, 0), (0, 3, 0))
    assert result.model.x0 is None
    assert set(result.fit.simulation_percent.values()) == {None}
    assert min(v or 0.0 for v in result.fit.prediction_percent.values()) > 50.0
    path = write_csv(tmp_path / "ambient.csv", fs, channels(y[:, :0], y))
    options = ["--outputs", "y1,y2,y3", "--method", method, "--rows", 40, "--order", 6]
    shown = json.loads(run("identify", path, *options, "--json", "-", status=0).stdout)
    assert shown["inputs"] == [] and shown["markov"]["Y"] == [] and shown["model"]["x0"] is None
    assert shown["fit"]["simulation_percent"] is None
    np.testing.assert_allclose(
        [m["damping_ratio"] for m in shown["modes"]], [m.damping_ratio for m in result.modes], rtol=1e-8
    )
    own = result.fit.prediction_percent
    assert shown["fit"]["prediction_percent"] == pytest.approx(own, abs=1e-6)
    table = run("identify", path, *options, "--model", tmp_path / "model.mat", status=0).stdout
    assert "0 inputs" in table and "remark" not in table


@pytest.mark.parametrize(
    ("path", "names", "rows", "order", "trend", "published"),
    [
        ("daisy_robot_arm/daisy_robot_arm.csv", "u_reaction_torque y_acceleration", 20, 4, "none", 3.60e-2),
        ("slicot_ib01_example/slicot_ib01_example.csv", "u y", 15, 4, "none", 1.50e-2),
        ("daisy_cd_player_arm/daisy_cd_player_arm.csv",
         "u1_actuator,u2_actuator y1_tracking,y2_tracking", 15, 8, "linear", 1.76e-1),
    ],
    ids=["robot arm", "hair dryer", "CD arm"],
)  # fmt: skip
def test_published_simulation_errors(
    path: str, names: str, rows: int, order: int, trend: str, published: float, tmp_path: Path
) -> None:
    """norm(y - simulated, 1) / norm(y, 1) from the result file alone: model, its initial state, the record."""
    file, (inputs, outputs) = data_file(path), names.split()
    options = ["--method", "n4sid-moesp", "--rows", rows, "--order", order, "--detrend", trend, "--fs", 100]
    run("identify", file, "--inputs", inputs, "--outputs", outputs, *options, "--json", tmp_path / "r.json", status=0)
    model = json.loads((tmp_path / "r.json").read_text())["model"]
    v = np.genfromtxt(file, delimiter=",", comments="#")[1:]
    v = detrend(v, axis=0) if trend == "linear" else v
    n_u = inputs.count(",") + 1
    A, B, C, D = (np.array(model[name]) for name in "ABCD")
    simulated = systems.simulate((A, B, C, D), v[:, :n_u], np.array(model["x0"][0]))
    error = np.linalg.norm(v[:, n_u:] - simulated, 1) / np.linalg.norm(v[:, n_u:], 1)
    assert abs(error / published - 1) < 0.02, error


def test_remarks_on_what_is_not_used(tmp_path: Path) -> None:
    s = systems.w1()
    u, y = systems.record(s, 1000, 1.0, 2)
    path = write_csv(tmp_path / "short.csv", 1 / s.dt, channels(u, y))
    options = ["--inputs", "u1", "--outputs", "y1,y2,y3", "--method", "n4sid-moesp", "--p", 20, "--json", "-"]
    shown = json.loads(run("identify", path, *options, status=0).stdout)
    own = okid.identify(u, y, fs=1 / s.dt, method="n4sid-moesp", p=20)
    for codes in ([w["code"] for w in shown["warnings"]], [w.code for w in own.warnings]):
        assert {"p_ignored", "rows_reduced"} <= set(codes)
    assert shown["rows"] == own.rows == 19  # 10 columns for each of 19 (2 * 1 + 3) unknowns: 950 of 963
    assert 1000 - (2 * 20 - 1) < 10 * 20 * 5


@pytest.fixture(scope="module")
def rig(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The demo rig: rig.log, rig.toml, truth.json."""
    folder = tmp_path_factory.mktemp("rig")
    run("simulate", ROOT / "tests" / "replay" / "demo_rig.toml", "--log", folder / "rig.log", "--truth",
        folder / "truth.json", "--dbc", folder / "okid.dbc", "--config", folder / "rig.toml", status=0)  # fmt: skip
    return folder


@pytest.mark.parametrize("method", METHODS)
def test_replay_of_a_rig(method: str, rig: Path) -> None:
    """Live, from the bus: every method finds the modes of the virtual rig from its accumulator."""
    config = rig / f"{method}.toml"
    config.write_text(by_method((rig / "rig.toml").read_text(), method, None if method in N4SID else 40))
    assert method in run("check", config, status=0).stdout
    run("replay", rig / "rig.log", "-c", config, "--json", rig / f"{method}.json", status=0)
    result, truth = (json.loads((rig / name).read_text()) for name in (f"{method}.json", "truth.json"))
    assert result["method"] == method
    assert result["rows"] == (30 if method in N4SID else 80)
    assert result["fit"]["simulation_percent"] is None
    modes = [m for m in result["modes"] if m["emac"] > 0.5]
    for f, zeta in zip(truth["frequency_hz"], truth["damping_ratio"], strict=True):
        near = min(modes, key=lambda m: abs(m["frequency_hz"] - f))
        assert near["frequency_hz"] == pytest.approx(f, rel=2e-3)
        assert near["damping_ratio"] == pytest.approx(zeta, rel=0.15)
