# SPDX-License-Identifier: MIT
"""Method auto of more samples than it keeps: estimated from all of them, judged from the newest, in fixed memory; the
same of a file, of a stream cut anywhere, and of a stream that was saved and goes on."""

from __future__ import annotations

import functools

import numpy as np
import okid
import pytest
import systems
from laboratory import respond
from numpy.typing import NDArray
from scipy.linalg import eigh

W2 = systems.w2()
KEPT = 65536  # of 8 channels
COUNT = 150_000


@functools.cache
def rows() -> NDArray[np.float64]:
    """Two forces and six accelerations, 2 % noise, an offset."""
    u, y = systems.record(W2, COUNT, 2.0, 3)
    return np.hstack([u, y + 0.3])


def split(samples: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    return samples[:, :2], samples[:, 2:]


@functools.cache
def whole() -> okid.Result:
    return okid.identify(*split(rows()), fs=W2.fs, input_dofs=[1, 4], output_dofs=[1, 2, 3, 4, 5, 6])


def confident(result: okid.Result) -> list[okid.Mode]:
    return [mode for mode in result.modes if mode.confident]


def session() -> okid.Session:
    return okid.Session(2, 6, fs=W2.fs)


def test_all_samples_count() -> None:
    found, newest = whole(), okid.identify(*split(rows()[-KEPT:]), fs=W2.fs, refine=False)
    raw = found.to_dict()
    assert raw["samples"] == COUNT and KEPT / 2 < raw["judged_samples"] <= KEPT
    assert "judged_samples" not in newest.to_dict()
    f, zeta = W2.modes()
    assert len(confident(found)) == 6
    for mode, true_f, true_zeta in zip(confident(found), f, zeta, strict=True):
        assert abs(mode.frequency_hz / true_f - 1) < 2e-5 and abs(mode.damping_ratio / true_zeta - 1) < 3e-3
        assert abs(mode.frequency_hz - true_f) < 5 * mode.frequency_std_hz
    ratios = [a.frequency_std_hz / b.frequency_std_hz for a, b in zip(confident(found), confident(newest), strict=True)]
    assert np.median(ratios) < 0.85  # 0.66 where blocks alone decide; methods that disagree add the same to both
    assert found.mkr is not None
    np.testing.assert_allclose(found.mkr.M, W2.M, atol=0.005)


def test_a_stream_is_the_file() -> None:
    live = session()
    for block in np.array_split(rows(), [7, 70000, 70001, 131072]):
        live.feed(block)
    found = live.identify()
    file = whole()
    for name in ("frequency_hz", "damping_ratio", "frequency_std_hz", "damping_ratio_std", "mpc", "why"):
        assert [getattr(m, name) for m in found.modes] == [getattr(m, name) for m in file.modes]
    assert found.to_dict()["judged_samples"] == file.to_dict()["judged_samples"]


def test_a_saved_stream_goes_on() -> None:
    straight, first, second = session(), session(), session()
    straight.feed(rows()[:110_000])
    first.feed(rows()[:90_000])
    state = first.to_bytes()
    second.restore(state)
    second.feed(rows()[90_000:110_000])
    assert second.samples == straight.samples == 110_000 and second.stats == straight.stats
    assert second.to_bytes() == straight.to_bytes()
    for damage in (state[:-100], state + b"x"):
        with pytest.raises(okid.InputError, match="damaged"):
            second.restore(damage)
    assert second.to_bytes() == straight.to_bytes()  # nothing was lost by that


def test_halves_merged_are_the_whole() -> None:
    a, b = session(), session()
    a.feed(rows()[: COUNT // 2])
    b.feed(rows()[COUNT // 2 :])
    a.merge(b.to_bytes())
    assert a.samples == COUNT
    for ours, other in zip(confident(a.identify()), confident(whole()), strict=True):
        assert abs(ours.frequency_hz / other.frequency_hz - 1) < 1e-5
        assert abs(ours.damping_ratio / other.damping_ratio - 1) < 1e-3


def test_memory_does_not_grow() -> None:
    live = session()
    before, sizes = live.nbytes, []
    for _ in range(2):
        live.feed(rows())
        sizes.append(len(live.to_bytes()))
    assert live.nbytes == before and live.samples == live.identify().to_dict()["samples"] == 2 * COUNT
    assert max(sizes) < 25e6 < 2 * COUNT * 8 * 8 * 2


@pytest.mark.parametrize("count", [KEPT + 1, KEPT + 20_000])
def test_deviations_from_the_first_sums_on(count: int) -> None:
    """Few blocks are sums as yet; with forces and without."""
    u, y = split(rows()[:count])
    for found in (okid.identify(u, y, fs=W2.fs), okid.identify(None, np.hstack([y, y[:, :2] + u]), fs=W2.fs)):
        assert found.to_dict()["judged_samples"] < KEPT and len(confident(found)) >= 5
        assert all(mode.frequency_std_hz and mode.damping_ratio_std for mode in confident(found))


def test_gaps_and_many_records() -> None:
    """Samples are missing throughout, and the stream is cut into records."""
    holed = rows().copy()
    holed[5000::5000, 3] = np.nan
    live = session()
    for piece in np.array_split(holed, 6):
        live.feed(piece)
        live.gap()
    found = live.identify()
    assert live.stats.missing == 29 and live.samples == COUNT
    f, _ = W2.modes()
    np.testing.assert_allclose([mode.frequency_hz for mode in confident(found)], f, rtol=1e-4)
    assert found.to_dict()["records"] == 6


def test_faults_of_older_samples_are_reported() -> None:
    """Samples that are gone by the end: spikes among them are no part of the sums, missing ones are counted apart."""
    faulty = rows().copy()
    faulty[1000:30_000:1000, 4] = 1e4
    faulty[700:5700:500, 2] = np.nan
    found = okid.identify(*split(faulty), fs=W2.fs)
    text = {warning.code: warning.text for warning in found.warnings}
    assert text["screened"].startswith("29 of the ") and text["missing_samples"].startswith("10 ")
    np.testing.assert_allclose([mode.frequency_hz for mode in confident(found)], W2.modes()[0], rtol=1e-4)


def test_an_output_that_is_left_out() -> None:
    """Only in the newest samples it fails: it is struck out of the sums, and all samples of the others count."""
    broken = rows().copy()
    broken[80_000:, 7] = 0.3
    found = okid.identify(*split(broken), fs=W2.fs)
    codes = [warning.code for warning in found.warnings]
    assert "screened" in codes and found.to_dict()["samples"] == len(broken)
    without = okid.identify(*split(broken[:, :7]), fs=W2.fs)  # never measured: runs may have longer horizons
    for name, rtol in (("frequency_hz", 1e-5), ("damping_ratio", 1e-2)):
        wanted = [getattr(mode, name) for mode in confident(without)]
        np.testing.assert_allclose([getattr(mode, name) for mode in confident(found)], wanted, rtol=rtol)


def test_the_noise_of_an_output_that_is_left_out() -> None:
    """Each number stands under the name of its own output."""
    broken = rows()[:60_000].copy()
    broken[:, 5] = 0.3
    noise = list(okid.identify(*split(broken), fs=W2.fs).to_dict()["refinement"]["noise_std"].values())
    assert noise[3] is None
    measured = [0, 1, 2, 4, 5]
    np.testing.assert_allclose([noise[k] for k in measured], 0.02 * broken[:, 2:].std(axis=0)[measured], rtol=0.05)


@pytest.mark.parametrize("kept", [1, 2])
def test_most_outputs_are_left_out(kept: int) -> None:
    """Of one or two outputs the runs would look back further than the sums of all six."""
    broken = rows().copy()
    broken[80_000:, 2 + kept :] = 0.3
    found = okid.identify(*split(broken), fs=W2.fs)
    assert found.to_dict()["samples"] == len(broken)
    np.testing.assert_allclose([mode.frequency_hz for mode in confident(found)], W2.modes()[0], rtol=1e-3)


@pytest.mark.parametrize("left", [0.0, 1e-3])
def test_a_force_that_ended_before_the_newest_samples(left: float) -> None:
    """The shaker was off at the end: a force of exact zeros, or the noise of its load cell. All samples count."""
    noise = np.random.default_rng(5).standard_normal((80_000, 8))
    quiet = noise * 0.02 * rows().std(axis=0) + rows().mean(axis=0)
    quiet[:, :2] = left * rows()[:, :2].std(axis=0) * noise[:, :2]
    samples = np.vstack([rows()[:100_000], quiet])
    found = okid.identify(*split(samples), fs=W2.fs, input_dofs=[1, 4], output_dofs=[1, 2, 3, 4, 5, 6])
    codes = [warning.code for warning in found.warnings]
    assert "force_earlier" in codes and "fit_low" not in codes and found.to_dict()["samples"] == 180_000
    np.testing.assert_allclose([mode.frequency_hz for mode in confident(found)], W2.modes()[0], rtol=1e-4)
    assert found.mkr is not None
    np.testing.assert_allclose(found.mkr.M, W2.M, atol=0.02 * W2.M.max())
    live = session()
    live.feed(samples)
    assert [mode.frequency_hz for mode in live.identify().modes] == [mode.frequency_hz for mode in found.modes]


def test_a_force_that_never_acted_is_refused() -> None:
    still = rows().copy()
    still[:, 1] = 0.0
    with pytest.raises(okid.IdentificationError, match='input "u2" is constant'):
        okid.identify(*split(still), fs=W2.fs)


def test_shapes_of_modes_that_only_the_whole_rate_has() -> None:
    """Up to three tenths of the rate, each sensor in another unit: short horizons take the sums of long ones."""
    w1, size = systems.w1(), np.array([1.0, 20.0, 0.05])
    u, y = systems.record(w1, 260_000, 2.0, 5)
    found = okid.identify(u, y * size, fs=w1.fs)
    assert found.to_dict()["judged_samples"] < len(u)
    modes = confident(found)
    assert [mode.frequency_hz for mode in modes] == pytest.approx(w1.modes()[0], rel=1e-4)
    for mode, shape in zip(modes, eigh(w1.K, w1.M)[1].T, strict=True):
        assert okid.modal.mac(mode.shape / size, shape) > 0.9999
        assert mode.frequency_std_hz is not None and mode.found_in == 1.0


def test_spikes_between_two_decisions_move_no_mode() -> None:
    """Spikes are in no mode that is followed, neither those before the first decision nor those behind it."""
    structure = systems.w1()
    u, y = systems.record(structure, 24_000, 1.0, 5)
    f, zeta = structure.modes()
    y[:, 1] += 0.2
    for k in (700, 3_001, 20_400, 21_000, 21_900):
        y[k, 1] += 40 * np.std(y[:, 1])
    one = okid.Session(1, 3, fs=structure.fs)
    for first in range(0, 20_000, 500):
        one.feed(np.hstack([u, y])[first : first + 500])
    one.modes()
    for first in range(20_000, 22_000, 500):  # less than an eighth: no new decision
        one.feed(np.hstack([u, y])[first : first + 500])
        known = [mode for mode in one.modes() if mode.confident]
        for mode, true_f, true_zeta in zip(known, f, zeta, strict=True):
            assert abs(mode.frequency_hz - true_f) < 5 * mode.frequency_std_hz
            assert abs(mode.damping_ratio - true_zeta) < 5 * mode.damping_ratio_std


def test_a_storm_tells_of_its_own_minutes_alone() -> None:
    """Ambient vibration with a storm of a minute in twenty: deviations cover the errors, where by the energies of the
    blocks the errors were 1.7 and 2.4 deviations (rms of eight such records), 10 at most."""
    M, K = systems.chain([1.0, 0.9, 0.9, 0.7], [900.0, 800.0, 700.0, 500.0])
    w2, phi = eigh(K, M)
    f, zeta, shares = np.sqrt(w2) / (2 * np.pi), np.array([0.01, 0.012, 0.015, 0.02]), []
    for seed in (1, 2, 5):
        r = np.random.default_rng(seed)
        forces = r.standard_normal((60_000, 4))
        forces[25_000:28_000] *= 30.0
        y = respond(forces, phi, phi, f, zeta, 50.0)
        found = okid.identify(None, y + 1e-3 * r.standard_normal(y.shape), fs=50.0)
        assert len(confident(found)) == 4
        for mode, true_f, true_zeta in zip(confident(found), f, zeta, strict=True):
            shares.append(abs(mode.frequency_hz - true_f) / mode.frequency_std_hz)
            shares.append(abs(mode.damping_ratio - true_zeta) / mode.damping_ratio_std)
    assert 0.4 < np.sqrt(np.mean(np.square(shares))) < 1.6 and max(shares) < 5
