# SPDX-License-Identifier: MIT
"""--method auto: the modes of laboratory-like records are found, nothing else is signed, bad channels are named."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

import numpy as np
import okid as okid_module
import pytest
from laboratory import Laboratory, ambient, chain, forced, plate
from program import okid

SLOW = os.environ.get("OKID_SLOW") == "1"  # the long tier


def identify(lab: Laboratory, folder: Path, *options: str) -> dict[str, Any]:
    channels = lab.write(folder / "record.csv")
    done = okid("identify", folder / "record.csv", *channels, "--method", "auto", "--json", "-", *options)
    assert done.returncode == 0, done.stderr
    result: dict[str, Any] = json.loads(done.stdout)
    return result


def confident(result: dict[str, Any]) -> list[dict[str, Any]]:
    return [mode for mode in result["modes"] if mode["confident"]]


def matched(lab: Laboratory, result: dict[str, Any]) -> dict[int, dict[str, Any]]:
    """True mode to confident mode, the best pairs first."""
    modes = confident(result)
    pairs = sorted(
        (abs(m["frequency_hz"] / f - 1) + 0.02 * abs(np.log(m["damping_ratio"] / z)), i, j)
        for i, (f, z) in enumerate(zip(lab.frequency_hz, lab.damping_ratio, strict=True))
        for j, m in enumerate(modes)
        if abs(m["frequency_hz"] / f - 1) < 0.01
    )
    out: dict[int, int] = {}
    for _, i, j in pairs:
        if i not in out and j not in out.values():
            out[i] = j
    return {i: modes[j] for i, j in out.items()}


@pytest.mark.parametrize("seed", [11, 12, 13])
def test_forced_structure_with_a_close_pair(seed: int, tmp_path: Path) -> None:
    lab = forced(seed)
    result = identify(lab, tmp_path)
    found = matched(lab, result)
    assert len(found) == len(lab.frequency_hz), [m["frequency_hz"] for m in confident(result)]
    assert len(confident(result)) == len(found)
    errors = np.array([found[i]["damping_ratio"] / z - 1 for i, z in enumerate(lab.damping_ratio)])
    assert np.median(np.abs(errors)) < 0.0025
    sigma = np.array([found[i]["damping_ratio_std"] for i in range(len(errors))], float)
    assert np.mean(np.abs(errors) * lab.damping_ratio < 2 * sigma) >= 0.7
    poles = np.linalg.eigvals(np.array(result["model"]["A"]))
    for mode in result["modes"]:  # each listed mode is a pole of the model
        w, zeta = 2 * np.pi * mode["frequency_hz"], mode["damping_ratio"]
        pole = np.exp((-zeta + 1j * np.sqrt(1 - zeta**2)) * w / lab.fs)
        assert np.min(np.abs(poles - pole)) < 1e-9
    assert len(poles) == 2 * len(result["modes"])
    assert (result["method"], result["p"], result["rows"]) == ("auto", None, None)


def test_deviations_hold_behind_an_anti_alias_filter(tmp_path: Path) -> None:
    """Damping and frequency within two deviations, records pooled; refined values there would hold in 76 %."""
    held: dict[str, list[bool]] = {"frequency_hz": [], "damping_ratio": []}
    count = 6 if SLOW else 3
    for seed in range(31, 31 + count):
        lab = forced(seed)
        result = identify(lab, tmp_path)
        assert result["hold"] == "band" and "refinement" not in result
        for i, mode in matched(lab, result).items():
            for key, truth in (("damping_ratio", lab.damping_ratio), ("frequency_hz", lab.frequency_hz)):
                sigma = mode["frequency_std_hz" if key == "frequency_hz" else "damping_ratio_std"]
                held[key].append(abs(mode[key] - truth[i]) < 2 * sigma)
    for key, values in held.items():
        assert len(values) > 7 * count and np.mean(values) >= 0.92, (key, np.mean(values))


def test_a_run_without_modes_at_the_lowest_order_votes_with_the_others(tmp_path: Path) -> None:
    """CVA and SSARX have no mode at order 4 of this record: they voted for nothing, six modes had no deviation."""
    lab = ambient(4, False)
    result = identify(lab, tmp_path)
    found = matched(lab, result)
    assert len(confident(result)) == len(found) == 9
    assert all(mode["frequency_std_hz"] and mode["damping_ratio_std"] for mode in found.values())


def test_one_pole_is_one_mode(tmp_path: Path) -> None:
    """Runs of short horizon see one pole between two of a pair (302.62 Hz): it was confident beside both."""
    lab = plate(4)
    result = identify(lab, tmp_path)
    assert len(confident(result)) == len(matched(lab, result)) == len(lab.frequency_hz)


@pytest.mark.parametrize(("seed", "hum"), [(21, False), (22, True)])
def test_ambient_colour_and_hum(seed: int, hum: bool, tmp_path: Path) -> None:
    lab = ambient(seed, hum)
    result = identify(lab, tmp_path)
    assert len(matched(lab, result)) >= 8
    assert len(confident(result)) - len(matched(lab, result)) == 0
    at_hum = [mode for mode in result["modes"] if abs(mode["frequency_hz"] - 50) < 0.1]
    assert all("pickup" in mode["why"] for mode in at_hum)


def clip(y: np.ndarray) -> np.ndarray:
    return np.clip(y, -1.5 * y.std(), 1.5 * y.std())


def spike(y: np.ndarray) -> np.ndarray:
    out = y.copy()
    out[len(y) // 3] = 200 * y.std()
    return out


def zeros(y: np.ndarray) -> np.ndarray:
    out = y.copy()
    for first in np.linspace(500, len(y) - 500, 12).astype(int):
        out[first : first + 40] = 0.0
    return out


def frozen(y: np.ndarray) -> np.ndarray:
    out = y.copy()
    out[len(y) // 2 :] = y[len(y) // 2]
    return out


def dead(y: np.ndarray) -> np.ndarray:
    return np.full_like(y, 0.3)


def sparse(y: np.ndarray) -> np.ndarray:
    """A sensor of a seventh of the rate, or a cable that fails all the time."""
    return np.where(np.arange(len(y)) % 7 == 0, y, np.nan)


@pytest.mark.parametrize(
    ("damage", "word", "whole"),
    [
        (dead, "never moves", True),
        (sparse, "missing so often", True),
        (clip, "clipped", True),
        (spike, "spikes", False),
        (zeros, "zero", False),
        (frozen, "frozen", True),
    ],
)
def test_a_bad_channel_is_named_and_makes_no_modes(damage: Any, word: str, whole: bool, tmp_path: Path) -> None:
    lab = forced(14)
    bad = lab.n_u + 2
    samples = lab.samples.copy()
    samples[:, bad] = damage(samples[:, bad])
    result = identify(lab._replace(samples=samples), tmp_path)
    said = [w["text"] for w in result["warnings"] if w["code"] == "screened"]
    assert len(said) == 1
    assert '"y2"' in said[0]
    assert word in said[0]
    found = matched(lab, result)
    assert len(confident(result)) == len(found) == len(lab.frequency_hz)
    for mode in confident(result):
        assert (mode["shape_re"][2] is None) == whole
        assert all(entry is not None for k, entry in enumerate(mode["shape_re"]) if k != 2)


@pytest.mark.parametrize("seed", [31, 32])
def test_band_limited_force_gives_mass_and_stiffness(seed: int, tmp_path: Path) -> None:
    structure = chain(seed)
    dofs = ["--input-dofs", ",".join(map(str, structure.force_dofs)), "--output-dofs", "1,2,3,4,5"]
    result = identify(structure.lab, tmp_path, *dofs)
    assert result["hold"] == "band"
    for name, truth in (("M", structure.M), ("K", structure.K)):
        error = np.linalg.norm(np.array(result["mkr"][name]) - truth) / np.linalg.norm(truth)
        assert error < 0.005, (name, error)
        sigma = np.array(result["mkr"][f"{name}_std"], float)
        apart = np.abs(np.array(result["mkr"][name]) - truth) / sigma
        assert np.all(sigma > 0) and np.median(apart) < 3, (name, np.median(apart))
        assert np.linalg.norm(sigma) < 0.01 * np.linalg.norm(truth)


def test_modes_are_picked_by_hand_and_by_band(tmp_path: Path) -> None:
    lab = forced(15)
    every = identify(lab, tmp_path)["modes"]
    picked = identify(lab, tmp_path, "--modes", "2-3")["modes"]
    assert [m["frequency_hz"] for m in picked] == [m["frequency_hz"] for m in every[1:3]]
    assert all(m["confident"] for m in picked)
    high = identify(lab, tmp_path, "--band", "30:90")["modes"]
    assert [m["frequency_hz"] for m in high] == [m["frequency_hz"] for m in every if 30 <= m["frequency_hz"] <= 90]


def test_options_of_one_method_do_not_go_with_auto(tmp_path: Path) -> None:
    channels = forced(16, count=2000).write(tmp_path / "record.csv")
    done = okid("identify", tmp_path / "record.csv", *channels, "--method", "auto", "--p", "30")
    assert done.returncode == 2
    assert "--p belongs to one method" in done.stderr
    done = okid("identify", tmp_path / "record.csv", *channels, "--method", "n4sid-cva", "--threads", "2")
    assert done.returncode == 2
    assert "--threads belongs to --method auto" in done.stderr


def test_the_number_of_threads_changes_nothing(tmp_path: Path) -> None:
    lab = forced(16, count=4000)
    one, three = (identify(lab, tmp_path, "--threads", n) for n in ("1", "3"))
    assert one == three
    samples = [lab.samples[:, : lab.n_u], lab.samples[:, lab.n_u :]]
    from_python = [okid_module.identify(*samples, fs=lab.fs, threads=n).to_dict() for n in (1, 2, None)]
    assert from_python[0] == from_python[1] == from_python[2]


def predicted(result: dict[str, Any], samples: np.ndarray, n_u: int) -> np.ndarray:
    """100 (1 - |y - predicted| / |y|) of every output, by the equations of the result and nothing of okid's."""
    a, c, gain = (np.array(result["model"][key]) for key in "ACK")
    rows = samples - samples.mean(axis=0)
    u, y = rows[:, :n_u], rows[:, n_u:]
    b, d = (np.array(result["model"][key]).reshape(len(m), n_u) for key, m in (("B", a), ("D", c)))
    x = np.array(result["model"]["x0"][0]) if n_u else np.zeros(len(a))
    left = np.empty_like(y)
    for n in range(len(y)):
        left[n] = y[n] - c @ x - d @ u[n]
        x = a @ x + b @ u[n] + gain @ left[n]
    return 100 * (1 - np.linalg.norm(left, axis=0) / np.linalg.norm(y, axis=0))


@pytest.mark.parametrize("lab", [forced(14), ambient(23, False)], ids=["forced", "ambient"])
def test_the_gain_predicts(lab: Laboratory, tmp_path: Path) -> None:
    result = identify(lab, tmp_path)
    a, c, gain = (np.array(result["model"][key]) for key in "ACK")
    assert np.max(np.abs(np.linalg.eigvals(a - gain @ c))) < 1
    told = np.array(list(result["fit"]["prediction_percent"].values()))
    np.testing.assert_allclose(predicted(result, lab.samples, lab.n_u), told, atol=0.5)
    without = predicted(result | {"model": result["model"] | {"K": np.zeros_like(gain)}}, lab.samples, lab.n_u)
    assert np.all(told > without + (0 if lab.n_u else 40)), (told, without)
    assert not {"fit_low"} & {each["code"] for each in result["warnings"]}


def test_an_output_that_answers_nothing_is_told(tmp_path: Path) -> None:
    lab = forced(15)
    rows = lab.samples.copy()
    rows[:, -1] = np.random.default_rng(5).standard_normal(len(rows)) * rows[:, -1].std()
    result = identify(lab._replace(samples=rows), tmp_path)
    said = {each["code"]: each["text"] for each in result["warnings"]}
    assert f'"y{rows.shape[1] - lab.n_u - 1}"' in said["fit_low"] and said["fit_low"].count('"') == 2


def test_shapes_of_low_modes_are_those_of_the_own_rate(tmp_path: Path) -> None:
    """A held force, the first mode at a twentieth of the rate: a halved rate bends its shape by 1 % and R by 70 %."""
    rig = ["rate_hz = 250.0", "duration_s = 40.0", "seed = 3", "masses = [1.0, 0.8, 1.2]", "zeta = [0.01, 0.01]"]
    rig += ["springs = [3e4, 2e4, 2.5e4]", "force_dofs = [1]", "sense_dofs = [1, 2, 3]", "noise_percent = 0.0"]
    (tmp_path / "rig.toml").write_text("\n".join(rig) + "\n")
    files = {key: tmp_path / f"a.{key}" for key in ("log", "json", "csv")}
    made = ["--log", files["log"], "--truth", files["json"], "--csv", files["csv"]]
    assert okid("simulate", tmp_path / "rig.toml", *made).returncode == 0
    channels = ["--inputs", "force1", "--outputs", "acc1,acc2,acc3", "--input-dofs", "1", "--output-dofs", "1,2,3"]
    mkr = json.loads(okid("identify", files["csv"], *channels, "--json", "-").stdout)["mkr"]
    truth = json.loads(files["json"].read_text())
    for name, most in (("M", 0.002), ("K", 0.002), ("R", 0.4)):
        error = np.array(mkr[name]) - np.array(truth[name])
        assert np.linalg.norm(error) < most * np.linalg.norm(truth[name])
