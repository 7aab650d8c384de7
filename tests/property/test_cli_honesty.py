# SPDX-License-Identifier: MIT
"""What must not pass in silence: wrong rates, torn logs, missing forces, repeated inputs, records without vibration."""

import json
import pathlib
import subprocess

import numpy as np
import pytest
from program import ROOT, okid

TRUTH = [10.96009, 31.84210, 45.66197]


@pytest.fixture(scope="module")
def rig(tmp_path_factory: pytest.TempPathFactory) -> pathlib.Path:
    """The demo rig: rig.log, rig.csv, rig.toml with its DBC."""
    folder = tmp_path_factory.mktemp("rig")
    made = okid(
        "simulate", ROOT / "tests" / "replay" / "demo_rig.toml", "--log", folder / "rig.log", "--truth",
        folder / "truth.json", "--csv", folder / "rig.csv", "--config", folder / "rig.toml",
    )  # fmt: skip
    assert made.returncode == 0, made.stderr
    return folder


def samples_of(rig: pathlib.Path) -> np.ndarray:
    lines = [line for line in (rig / "rig.csv").read_text().splitlines() if not line.startswith("#")]
    names = lines[0].split(",")
    pick = [names.index(name) for name in ("force1", "acc1", "acc2", "acc3")]
    return np.array([[float(cell) for cell in line.split(",")] for line in lines[1:]])[:, pick]


def identify(tmp_path: pathlib.Path, values: np.ndarray) -> subprocess.CompletedProcess[str]:
    path = tmp_path / "record.csv"
    with path.open("w") as file:
        file.write("# fs_hz: 250\nforce1,acc1,acc2,acc3\n")
        np.savetxt(file, values, delimiter=",", fmt="%.12g")
    return okid("identify", path, "--inputs", "force1", "--outputs", "acc1,acc2,acc3", "--json", "-")


def replay(rig: pathlib.Path, tmp_path: pathlib.Path, edit: tuple[str, str]) -> tuple[int, str, dict]:
    text = (rig / "rig.toml").read_text().replace('dbc = "', f'dbc = "{rig}/')
    assert edit[0] in text
    (tmp_path / "edited.toml").write_text(text.replace(*edit, 1))
    out = tmp_path / "result.json"
    done = okid("replay", rig / "rig.log", "-c", tmp_path / "edited.toml", "--json", out)
    return done.returncode, done.stderr, json.loads(out.read_text()) if out.exists() else {}


def test_a_wrong_rate_is_said(rig: pathlib.Path, tmp_path: pathlib.Path) -> None:
    status, errors, _ = replay(rig, tmp_path, ("rate_hz = 250", "rate_hz = 500"))
    assert status == 0
    assert "by the time stamps 250 samples came a second, but rate_hz is 500" in errors
    status, errors, result = replay(rig, tmp_path, ("rate_hz = 250", "rate_hz = 250"))
    assert (status, errors, result["warnings"]) == (0, "", [])


def test_units_are_converted_or_remarked(rig: pathlib.Path, tmp_path: pathlib.Path) -> None:
    _, _, plain = replay(rig, tmp_path, ('unit = "N"', 'unit = "N"'))
    _, errors, kilo = replay(rig, tmp_path, ('unit = "N"', 'unit = "kN"'))
    assert errors == ""
    np.testing.assert_allclose(np.array(kilo["model"]["D"]) * 1e3, plain["model"]["D"], rtol=1e-9)
    _, errors, _ = replay(rig, tmp_path, ('unit = "N"', 'unit = "bananas"'))
    assert "bananas" in errors


def test_a_torn_last_line_costs_one_frame(rig: pathlib.Path, tmp_path: pathlib.Path) -> None:
    torn = tmp_path / "torn.log"
    torn.write_bytes((rig / "rig.log").read_bytes()[:-10])
    done = okid("replay", torn, "-c", rig / "rig.toml", "--json", tmp_path / "r.json")
    assert done.returncode == 0, done.stderr
    assert "torn" in done.stderr
    assert json.loads((tmp_path / "r.json").read_text())["samples"] == 4999


def test_the_same_force_twice_is_refused_live(rig: pathlib.Path, tmp_path: pathlib.Path) -> None:
    text = (rig / "rig.toml").read_text().replace('dbc = "', f'dbc = "{rig}/')
    force = text[text.index("[[channel]]") :].split("[[channel]]")[1]
    (tmp_path / "twice.toml").write_text(
        text.replace("[identification]", "[[channel]]" + force.replace('"force1"', '"again"', 1) + "\n[identification]")
    )
    done = okid("replay", rig / "rig.log", "-c", tmp_path / "twice.toml", "--json", tmp_path / "r.json")
    assert done.returncode == 3
    assert "repeats" in done.stderr
    assert not (tmp_path / "r.json").exists()


@pytest.mark.parametrize("share", [0.002, 0.01, 0.02, 0.05])
def test_scattered_missing_cells_are_gaps(rig: pathlib.Path, tmp_path: pathlib.Path, share: float) -> None:
    values = samples_of(rig)
    values[np.random.default_rng(5).random(values.shape) < share] = np.nan
    done = identify(tmp_path, values)
    assert done.returncode == 0, done.stderr
    result = json.loads(done.stdout)
    frequencies = [mode["frequency_hz"] for mode in result["modes"] if mode["emac"] > 0.5]
    np.testing.assert_allclose(frequencies, TRUTH, rtol=2e-3)
    assert result["gaps"] > 0


def test_missing_forces_are_not_taken_as_zero(rig: pathlib.Path, tmp_path: pathlib.Path) -> None:
    values = samples_of(rig)
    values[np.random.default_rng(6).choice(len(values), 25, replace=False), 0] = np.nan
    result = json.loads(identify(tmp_path, values).stdout)
    for kind in ("simulation_percent", "prediction_percent"):
        assert min(result["fit"][kind].values()) > 98.5


def test_the_fit_can_be_recomputed(rig: pathlib.Path, tmp_path: pathlib.Path) -> None:
    values = samples_of(rig)[:700] + [3.0, -2.0, 5.0, 1.0]
    result = json.loads(identify(tmp_path, values).stdout)
    a, b, c, d = (np.array(result["model"][name]) for name in "ABCD")
    centred = values - values.mean(axis=0)
    x = np.array(result["model"]["x0"][0])
    estimate = np.empty((len(values), 3))
    for n, sample in enumerate(centred):
        estimate[n] = c @ x + d @ sample[:1]
        x = a @ x + b @ sample[:1]
    y = centred[:, 1:]
    percent = 100 * (1 - np.linalg.norm(y - estimate, axis=0) / np.linalg.norm(y - y.mean(axis=0), axis=0))
    np.testing.assert_allclose(list(result["fit"]["simulation_percent"].values()), percent, rtol=1e-8)


@pytest.mark.parametrize("kind", ["noise", "equal"])
def test_no_vibration_no_result(tmp_path: pathlib.Path, kind: str) -> None:
    rng = np.random.default_rng(7)
    values = rng.standard_normal((5000, 4))
    if kind == "equal":
        values[:, 1:] = values[:, :1]
    done = identify(tmp_path, values)
    assert done.returncode == 3
    assert done.stdout == ""
    assert done.stderr.startswith("okid: no model")
