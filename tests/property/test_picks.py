# SPDX-License-Identifier: MIT
"""Modes picked by hand: --picks, and the poles from which they are picked. The record is made by scipy, not by okid."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import okid
import pytest
from program import okid as okid_program
from scipy.signal import cont2discrete, lfilter

FS, HZ, ZETA = 500.0, (12.0, 31.0, 31.6, 77.0), (0.01, 0.006, 0.006, 0.012)
SHAPES = np.array([[1.0, 0.6, 0.2], [0.5, -1.0, 0.4], [0.3, 0.4, 1.0], [1.0, -0.5, 0.7]])


@pytest.fixture(scope="module")
def record() -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(7)
    u = rng.standard_normal(15_000)
    y = np.zeros((len(u), 3))
    for f, zeta, shape in zip(HZ, ZETA, SHAPES, strict=True):
        w = 2 * np.pi * f
        b, a, _ = cont2discrete(([1.0, 0.0, 0.0], [1.0, 2 * zeta * w, w * w]), 1 / FS, "zoh")
        y += np.outer(lfilter(b.ravel(), a, u), shape)
    return u, y + 0.02 * np.std(y, axis=0) * rng.standard_normal(y.shape)


@pytest.fixture(scope="module")
def whole(record: tuple[np.ndarray, np.ndarray]) -> dict[str, Any]:
    return okid.identify(*record, fs=FS, method="auto", stabilization=True).to_dict()


def picked(record: tuple[np.ndarray, np.ndarray], picks: Any) -> list[dict[str, Any]]:
    modes: list[dict[str, Any]] = okid.identify(*record, fs=FS, picks=picks).to_dict()["modes"]
    assert all(mode["picked"] and mode["confident"] and mode["why"] == [] for mode in modes)
    return modes


def test_the_modes_nearest_to_the_picks(record: Any, whole: dict[str, Any]) -> None:
    modes = picked(record, [77.3, 31.55])
    assert [mode["frequency_hz"] for mode in modes] == pytest.approx([31.6, 77.0], rel=2e-3)
    for mode in modes:  # with what the proposal says of them: values, deviations, shape
        same = min(whole["modes"], key=lambda other: abs(other["frequency_hz"] - mode["frequency_hz"]))
        assert mode["frequency_hz"] == pytest.approx(same["frequency_hz"], abs=3 * same["frequency_std_hz"])
        assert 0 < mode["frequency_std_hz"] < 0.1 and 0 < mode["damping_ratio_std"] < 0.01
        a, b = (np.array(one["shape_re"]) + 1j * np.array(one["shape_im"]) for one in (mode, same))
        assert abs(np.vdot(a, b)) ** 2 / (np.vdot(a, a) * np.vdot(b, b)).real > 0.999
    assert not any("picked" in mode for mode in whole["modes"])


def test_a_result_is_a_file_of_picks(record: Any, tmp_path: Path) -> None:
    first = okid.identify(*record, fs=FS, picks=[12, 77])
    first.save(tmp_path / "picked.json")
    again = okid.identify(*record, fs=FS, picks=tmp_path / "picked.json").to_dict()
    assert again["modes"] == first.to_dict()["modes"] and again["model"] == first.to_dict()["model"]
    (tmp_path / "few.json").write_text(
        '{"modes": [{"frequency_hz": 31.6, "damping_ratio": 0.006}, {"frequency_hz": 12}]}'
    )
    assert [mode["frequency_hz"] for mode in picked(record, str(tmp_path / "few.json"))] == pytest.approx(
        [12.0, 31.6], rel=2e-3
    )


def test_each_pole_can_be_picked(record: Any, whole: dict[str, Any]) -> None:
    """Also one that belongs to no mode; it may have no deviation, but its own frequency and damping."""
    poles = whole["agreement"]["poles"]
    lone = [k for k, mode in enumerate(poles["mode"]) if mode == 0 and 100 < poles["frequency_hz"][k] < 240]
    hz = poles["frequency_hz"][lone[len(lone) // 2]]
    (mode,) = picked(record, [hz])
    assert mode["frequency_hz"] == pytest.approx(hz, rel=0.01)


def test_the_poles_of_all_runs(whole: dict[str, Any], record: Any) -> None:
    runs, poles = whole["agreement"]["runs"], whole["agreement"]["poles"]
    assert {run["method"] for run in runs} >= {"n4sid-cva", "n4sid-moesp", "n4sid-ssarx", "okid-era"}
    assert len({len(column) for column in poles.values()}) == 1 and len(poles["run"]) > 1000
    assert set(poles["run"]) == set(range(len(runs)))
    f, mode, run = (np.array(poles[key]) for key in ("frequency_hz", "mode", "run"))
    assert np.all(f < np.array([one["fs_hz"] for one in runs])[run] / 2)
    for number, one in enumerate(whole["modes"], 1):
        if one["confident"]:
            of_mode = f[mode == number]
            assert len(of_mode) > 20 and np.median(of_mode) == pytest.approx(one["frequency_hz"], rel=1e-3)
    assert "agreement" not in okid.identify(*record, fs=FS).to_dict()


@pytest.mark.parametrize(
    ("picks", "reason"),
    [
        ([400.0], "no model has a pole within 1 % of 400 Hz, the nearest is at "),
        ([], "found "),
        ("31;77", 'found "31;77", expected frequencies in Hz with commas between, or a .json file'),
        ("-3", 'found "-3", expected frequencies'),
        ("nan", 'found "nan", expected frequencies'),
        ("missing.json", "missing.json"),
    ],
)
def test_what_is_refused(record: Any, picks: Any, reason: str) -> None:
    with pytest.raises(okid.InputError) as told:
        okid.identify(*record, fs=FS, picks=picks)
    assert reason in str(told.value)


@pytest.mark.parametrize(
    "text", ["{", "[]", '{"modes": []}', '{"modes": [3]}', '{"modes": [{"frequency_hz": "12"}]}', '{"modes": {}}', "\0"]
)
def test_files_that_are_no_picks(record: Any, text: str, tmp_path: Path) -> None:
    (tmp_path / "picks.json").write_text(text)
    with pytest.raises(okid.InputError, match="picks"):
        okid.identify(*record, fs=FS, picks=tmp_path / "picks.json")


def test_picks_belong_to_method_auto(record: Any) -> None:
    for more in ({"method": "okid-era"}, {"modes": [1]}):
        with pytest.raises(okid.InputError, match="picks"):
            okid.identify(*record, fs=FS, picks=[12], **more)


def test_picks_belong_to_records(tmp_path: Path) -> None:
    rows = "".join(f"{f},{1 / (f - 30.5):.6f},0.1\n" for f in range(10, 60))
    (tmp_path / "h.csv").write_text(f"frequency_hz,a/f:re,a/f:im\n{rows}")
    said = okid_program("identify", tmp_path / "h.csv", "--frf", "--picks", "30", status=2).stderr
    assert said == "okid: --picks is an option of records, found with --frf\n"


def test_modes_by_number_are_picked_too(record: Any) -> None:
    modes = okid.identify(*record, fs=FS, modes=[1]).to_dict()["modes"]
    assert [mode.get("picked") for mode in modes] == [True]
    modes = okid.identify(None, record[1], fs=FS, method="plscf", modes=[1]).to_dict()["modes"]
    assert [mode.get("picked") for mode in modes] == [True]


def test_the_words_of_a_result_are_json(whole: dict[str, Any]) -> None:
    json.dumps(whole, allow_nan=False)
