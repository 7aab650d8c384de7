# SPDX-License-Identifier: MIT
"""Stabilization over orders and horizons with clusters: figures of docs/numerics.md, measured records, bad input."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import okid
import pytest
import systems
from measured_data import data_file
from program import okid as run
from test_measured import FRAME_HZ


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_the_six_modes_of_w2_and_nothing_else(seed: int) -> None:
    """5 % noise, p 15, 20, 30, orders 8 .. 24: true modes in 12 to 15 of 15, MPC > 0.999, nothing else above 30 %."""
    s = systems.w2()
    u, y = systems.record(s, 10000, 5.0, seed)
    found = okid.stabilization(u, y, fs=s.fs, horizons=[15, 20, 30], orders=[8, 12, 16, 20, 24], detrend="none")
    assert [(row.horizon, row.order) for row in found] == [(p, n) for p in (15, 20, 30) for n in (8, 12, 16, 20, 24)]
    f, zeta = s.modes()
    np.testing.assert_allclose([mode.frequency_hz for mode in found.modes], f, rtol=1e-3)
    np.testing.assert_allclose([mode.damping_ratio for mode in found.modes], zeta, rtol=0.15)
    for mode in found.modes:
        assert 12 <= mode.hits <= mode.models == 15
        assert mode.mpc > 0.999
        assert mode.frequency_spread_hz < 2e-3 * mode.frequency_hz
    assert all(cluster.hits <= 0.3 * 15 for cluster in found.clusters if not cluster.physical)


def test_rows_know_their_clusters() -> None:
    s = systems.w1()
    u, y = systems.record(s, 4000, 5.0, 4)
    found = okid.identify(u, y, fs=s.fs, p=20).stabilization()
    for k, cluster in enumerate(found.clusters):
        members = [float(row.frequency_hz[i]) for row in found for i in np.flatnonzero(row.cluster == k)]
        assert len(members) == cluster.hits
        assert np.median(members) == pytest.approx(cluster.frequency_hz)
        row = next(r for r in found if (r.horizon, r.order) == (cluster.horizon, cluster.order))
        own = int(np.flatnonzero(row.cluster == k)[0])
        np.testing.assert_array_equal(row.shapes[own], cluster.shape)
        assert all(np.sum(row.cluster == k) <= 1 for row in found)
    text = json.dumps(found.to_dict(), allow_nan=False)
    assert len(json.loads(text)["poles"]) == sum(len(row.frequency_hz) for row in found)


@pytest.mark.parametrize("options", [{}, {"p": 8, "rows": 30}])
def test_steel_frame(options: dict[str, int]) -> None:
    """All 14 peaks of the frequency responses are clusters that hold; at most three more poles do."""
    record = okid.read_csv(data_file("daisy_flexible_structure/daisy_flexible_structure.csv"))
    result = okid.identify(record.samples[:, :2], record.samples[:, 2:], fs=1024.0, method="okid-era", **options)
    modes = result.stabilization().modes
    have = np.array([mode.frequency_hz for mode in modes])
    assert all(np.min(np.abs(have - f)) <= 1.0 for f in FRAME_HZ), have
    assert len(modes) <= len(FRAME_HZ) + 3


def test_without_inputs_and_other_methods() -> None:
    s = systems.w1()
    u, y = systems.record(s, 20000, 1.0, 6)
    for force, method in ((None, "okid-era"), (None, "n4sid-cva"), (u, "n4sid-moesp"), (u, "okid-era-dc")):
        found = okid.stabilization(force, y, fs=s.fs, method=method, orders=range(2, 21, 2))
        np.testing.assert_allclose([mode.frequency_hz for mode in found.modes], s.modes()[0], rtol=1e-2)


def test_wrong_arguments() -> None:
    s = systems.w1()
    u, y = systems.record(s, 2000, 1.0, 6)
    with pytest.raises(okid.InputError, match="order is not an argument"):
        okid.stabilization(u, y, fs=s.fs, order=6)
    with pytest.raises(okid.InputError, match="no order to draw"):
        okid.stabilization(u, y, fs=s.fs, orders=[1000])


def test_program_equals_python(tmp_path: Path) -> None:
    s = systems.w1()
    u, y = systems.record(s, 6000, 5.0, 8)
    names = ["u1", "y1", "y2", "y3"]
    path = tmp_path / "record.csv"
    np.savetxt(path, np.hstack([u, y]), delimiter=",", fmt="%.17g", comments="",
               header=f"# fs_hz: {s.fs!r}\n" + ",".join(names))  # fmt: skip
    options = ["identify", path, "--inputs", "u1", "--outputs", "y1,y2,y3", "--p", 20, "--stabilization"]
    done = run(*options, "--json", tmp_path / "r.json")
    assert done.returncode == 0, done.stderr
    assert done.stdout.count(" %\n") == 3 and "stable modes over 33 models" in done.stdout
    shown = json.loads((tmp_path / "r.json").read_text())
    own = okid.stabilization(u, y, fs=s.fs, p=20).to_dict()
    theirs = shown["stabilization"]
    assert theirs["criteria"] == own["criteria"] and theirs["models"] == own["models"]
    for key in ("poles", "clusters"):
        assert len(theirs[key]) == len(own[key])
        for left, right in zip(theirs[key], own[key], strict=True):
            assert left == pytest.approx(right, rel=1e-6)
    plain = run(*options[:-1], "--json", "-")  # the model itself is the same with and without
    assert "stabilization" not in json.loads(plain.stdout)
    assert json.loads(plain.stdout)["model"] == shown["model"]
