# SPDX-License-Identifier: MIT
"""Measured records (read from $OKID_DATA, else ../shared/data): the modes their references list are found."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import okid
import pytest
from gram import solve_gram
from measured_data import data_file
from okid import Accumulator

FRAME_HZ = [62, 119, 155, 193, 215, 230, 239, 287, 321, 334, 352, 398, 417, 468]
PLANE_HZ = [18.84, 40.18, 97.53, 105.19, 143.37, 166.27]
PLANE_ALL_HZ = [*PLANE_HZ, 87.74, 89.63, 117.91, 125.2, 125.69, 129.74, 135.12]


def found(result: okid.Result, wanted: Sequence[float], within_hz: float) -> list[float]:
    """The listed frequencies that the result has a consistent mode (EMAC > 0.5) near."""
    have = np.array([mode.frequency_hz for mode in result.modes if mode.emac > 0.5])
    return [f for f in wanted if len(have) and np.min(np.abs(have - f)) <= within_hz]


@pytest.fixture(scope="module")
def frame() -> okid.Record:
    return okid.read_csv(data_file("daisy_flexible_structure/daisy_flexible_structure.csv"))


@pytest.fixture(scope="module")
def plane() -> list[np.ndarray]:
    return [okid.read_csv(data_file(f"uliege_plane_hammer/lab1_0000{k}.csv")).samples for k in (1, 2, 3, 4)]


@pytest.mark.parametrize("options", [{}, {"p": 8, "rows": 30}, {"p": 15, "rows": 60}, {"order": 40}])
def test_steel_frame_with_28_redundant_accelerometers(frame: okid.Record, options: dict[str, int]) -> None:
    assert frame.fs_hz == 1024.0
    assert frame.samples.shape == (8523, 30)
    result = okid.identify(frame.samples[:, :2], frame.samples[:, 2:], fs=frame.fs_hz, method="okid-era", **options)
    assert len(found(result, FRAME_HZ, 1.0)) >= 13, result.table()
    assert result.model.radius() < 1.0
    codes = [w.code for w in result.warnings]
    assert result.observer.radius_plain >= 1.0  # plain least squares explodes on these data (trap 22)
    assert result.observer.radius < 1.0
    assert "arx_stabilised" in codes
    assert len(result.modes) <= 2 * len(FRAME_HZ)
    assert np.median([v for v in result.fit.prediction_percent.values() if v is not None]) > 90.0


@pytest.mark.parametrize("chosen", [(0,), (1,), (0, 1)], ids=["record 1", "record 2", "1 and 2 merged"])
def test_struck_plane_from_rest(plane: list[np.ndarray], chosen: tuple[int, ...]) -> None:
    forces, answers = [plane[k][:, :1] for k in chosen], [plane[k][:, 1:] for k in chosen]
    result = okid.identify(forces, answers, fs=512.0, method="okid-era", start="rest", hold="foh")
    assert found(result, PLANE_HZ, 0.5) == PLANE_HZ, result.table()
    assert len(found(result, PLANE_ALL_HZ, 0.5)) >= 11
    assert result.model.radius() < 1.0
    assert result.records == len(chosen)


@pytest.mark.parametrize(("chosen", "clear"), [(0, PLANE_HZ), (1, PLANE_HZ[:-1])], ids=["record 1", "record 2"])
def test_struck_plane_without_the_silent_past(plane: list[np.ndarray], chosen: int, clear: list[float]) -> None:
    """The hit is lost (and that is said): in record 2 the mode at 166 Hz is then too weak to hold."""
    u, y = plane[chosen][:, :1], plane[chosen][:, 1:]
    result = okid.identify(u, y, fs=512.0, method="okid-era", start="moving", hold="foh")
    assert set(clear) <= set(found(result, PLANE_HZ, 0.5)), result.table()
    assert len(found(result, PLANE_ALL_HZ, 0.5)) >= 8  # from rest: 11, the hit is then in the sums
    assert result.model.radius() < 1.0
    assert "hit_at_start" in [w.code for w in result.warnings]


def test_a_hit_lost_in_the_first_samples_is_said(plane: list[np.ndarray]) -> None:
    result = okid.identify(plane[0][:, :1], plane[0][:, 1:], fs=512.0, method="okid-era")
    assert "hit_at_start" in [w.code for w in result.warnings]


def companion_radius(theta: np.ndarray, n_u: int, n_y: int) -> float:
    """Largest |eigenvalue| of the ARX model by NumPy."""
    m = n_u + n_y
    own = np.hstack([theta[:, at : at + n_y] for at in range(2 * n_u, theta.shape[1], m)])
    below = np.eye(own.shape[1] - n_y, own.shape[1])
    return float(np.max(np.abs(np.linalg.eigvals(np.vstack([own, below])))))


@pytest.mark.parametrize("record", [0, 1, 2])
@pytest.mark.parametrize("p", [40, 80])
def test_the_stability_of_a_measured_arx_model_is_known_to_all_digits(
    plane: list[np.ndarray], record: int, p: int
) -> None:
    """120 and 240 states, dozens of them within 1 % of the circle: the ridge, and with it the modes, hang on it."""
    sums = Accumulator(1, 3, p)
    sums.add(plane[record])
    stable = 0
    for ridge in (3e-2, 1e-2, 3e-3, 1e-3):
        theta, info = solve_gram(sums, "mean", False, ridge)
        true = companion_radius(theta, 1, 3)
        if info.radius > 1.0005:  # the growth, which stands above
            assert info.radius > true
        else:
            assert info.radius == pytest.approx(true, abs=1e-7)
            stable += 1
    assert stable >= 2


def test_replicates_of_a_stabilised_model_keep_its_ridge() -> None:
    """With ridges of their own they were other estimates: the damping's deviation ten times that of the derivative."""
    record = okid.read_csv(data_file("measured/frame3_flex_sine20.csv"))
    u, y = record.samples[:, :1], record.samples[:, 1:]
    by = {kind: okid.identify(u, y, fs=120.0, method="okid-era", sigma=kind) for kind in ("analytic", "jackknife")}
    assert "arx_stabilised" in [remark.code for remark in by["jackknife"].warnings]
    compared = 0
    for a, b in zip(by["analytic"].modes, by["jackknife"].modes, strict=True):
        for one, other in ((a.frequency_std_hz, b.frequency_std_hz), (a.damping_ratio_std, b.damping_ratio_std)):
            if one is not None and other is not None:
                compared += 1
                assert other < 4.0 * one, f"{a.frequency_hz} Hz"
    assert compared > 30
