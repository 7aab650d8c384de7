# SPDX-License-Identifier: MIT
"""A clipped channel from the record to the report: its shape entries are missing everywhere, nothing else is."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import okid
import pandas as pd
import pytest
from laboratory import forced
from okid import modal, report
from okid.data.records import Record

NAMES = [f"y{k}" for k in range(8)]


@pytest.fixture(scope="module")
def clipped() -> tuple[okid.Result, Record]:
    lab = forced(14, count=10000)
    samples = lab.samples.copy()
    bad = samples[:, lab.n_u + 2]
    bad[:] = np.clip(bad, -1.5 * bad.std(), 1.5 * bad.std())
    forces = [f"u{k}" for k in range(lab.n_u)]
    result = okid.identify(
        samples[:, : lab.n_u],
        samples[:, lab.n_u :],
        fs=lab.fs,
        input_names=forces,
        output_names=NAMES,
    )
    assert [w.code for w in result.warnings] == ["screened"]
    assert len(result.confident_modes) == len(lab.frequency_hz)
    return result, Record(forces + NAMES, samples, lab.fs)


@pytest.mark.filterwarnings("error")
def test_report(clipped: tuple[okid.Result, Record], tmp_path: Path) -> None:
    result, record = clipped
    report.write_report(result, tmp_path / "r.html", record)
    page = (tmp_path / "r.html").read_text(encoding="utf-8")
    assert "<tr><th>Left out</th><td>y2 (screened: see the warnings)</td></tr>" in page
    assert f"<p>{len(result.confident_modes)} confident modes from " in page
    assert "7 outputs" in page
    assert "NaN" not in page and ">nan<" not in page


def test_universal_file(clipped: tuple[okid.Result, Record], tmp_path: Path) -> None:
    result, _ = clipped
    okid.write_uff(tmp_path / "r.uff", result)
    found = okid.read_uff(tmp_path / "r.uff")
    assert len(found.modes) == len(result.modes)
    for mode, own in zip(found.modes, result.modes, strict=True):
        assert mode.nodes == [1, 2, 4, 5, 6, 7, 8]
        np.testing.assert_allclose(mode.shape[:, 0], np.delete(own.shape, 2), atol=1e-5)
        assert mode.confident == own.confident
    assert {one.name.split(" / ")[0] for one in found.frfs} == set(NAMES) - {"y2"}
    okid.write_uff(tmp_path / "two.uff", result, modes=[1, 3])
    assert [mode.number for mode in okid.read_uff(tmp_path / "two.uff").modes] == [1, 3]
    with pytest.raises(okid.InputError, match="modes has 99, expected numbers from 1 to"):
        okid.write_uff(tmp_path / "no.uff", result, modes=[99])


def test_python(clipped: tuple[okid.Result, Record], tmp_path: Path) -> None:
    result, _ = clipped
    shapes = np.array([mode.shape for mode in result.modes])
    assert np.all(np.isnan(shapes[:, 2])) and np.all(np.isfinite(np.delete(shapes, 2, axis=1)))
    np.testing.assert_allclose(np.diag(modal.mac_matrix(shapes)), 1.0)
    assert modal.mpc(shapes[0]) > 0.99 and modal.normalised(shapes[0])[np.nanargmax(np.abs(shapes[0]))] == 1.0
    frame = pd.DataFrame(result.table())
    assert list(frame.confident) == [mode.confident for mode in result.modes]
    assert list(frame.why) == [", ".join(mode.why) for mode in result.modes]
    okid.write_mat(tmp_path / "r.mat", result)
    okid.write_hdf5(tmp_path / "r.h5", result)
    again = okid.Result.from_dict(result.to_dict())
    assert [mode.frequency_hz for mode in again.confident_modes] == [m.frequency_hz for m in result.confident_modes]


def test_a_noisy_output_is_named() -> None:
    lab = forced(17, count=10000)
    said = []
    for noise in (0.0, 0.4):
        y = lab.samples[:, lab.n_u :].copy()
        y[:, 3] += noise * y[:, 3].std() * np.random.default_rng(1).standard_normal(len(y))
        result = okid.identify(lab.samples[:, : lab.n_u], y, fs=lab.fs, output_names=NAMES, sigma_blocks=0)
        said.append([w.text for w in result.warnings if w.code == "noisy_output"])
        assert len(result.confident_modes) == len(lab.frequency_hz)
    assert said[0] == [] and len(said[1]) == 1 and said[1][0].startswith('output "y3" is much noisier than the rest')


@pytest.mark.parametrize("fault", ["polarity", "gain", "noise", "clipped early"])
def test_a_sensor_that_fails_half_way_adds_no_mode(fault: str) -> None:
    """Its part of each mode is no mode by itself: all modes of the structure are found, and no other is believed."""
    lab = forced(14, count=10000)
    y = lab.samples[:, lab.n_u :].copy()
    bad, spread = y[:, 2], y[:, 2].std()
    if fault == "polarity":
        bad[5000:] *= -1
    elif fault == "gain":
        bad[5000:] *= 2
    elif fault == "noise":
        bad[5000:] = spread * np.random.default_rng(1).standard_normal(5000)
    else:
        bad[:5000] = np.clip(bad[:5000], -spread, spread)
    result = okid.identify(lab.samples[:, : lab.n_u], y, fs=lab.fs, output_names=NAMES, sigma_blocks=0)
    said = " ".join(w.text for w in result.warnings if w.code in {"noisy_output", "screened"})
    assert 'output "y2"' in said
    found = [mode.frequency_hz for mode in result.confident_modes]
    np.testing.assert_allclose(found, lab.frequency_hz, rtol=2e-3)


def test_a_sensor_that_dies_between_records_costs_no_record() -> None:
    """Five records, one with a dead sensor, another that holds no number of another one: no record is lost for it."""
    lab = forced(21, count=10000)
    u, y = lab.samples[:, : lab.n_u], lab.samples[:, lab.n_u :].copy()
    us, ys = np.array_split(u, 5), np.array_split(y, 5)
    ys[1][:, 3] = 0.25
    ys[4][:, 6] = np.nan
    result = okid.identify(us, ys, fs=lab.fs, output_names=NAMES)
    said = " ".join(w.text for w in result.warnings if w.code == "screened")
    assert 'output "y3" of record 1' in said and "never moves" in said
    assert len(result.confident_modes) == len(lab.frequency_hz)
    for mode, truth in zip(result.confident_modes, lab.frequency_hz, strict=True):
        assert mode.frequency_hz == pytest.approx(truth, rel=1e-3)


def test_one_line_for_the_same_fault_of_many_records() -> None:
    lab = forced(21, count=10000)
    u, y = lab.samples[:, : lab.n_u], lab.samples[:, lab.n_u :].copy()
    us, ys = np.array_split(u, 5), np.array_split(y, 5)
    for k in (1, 2, 4):
        ys[k][500 + k, 3] += 60 * ys[k][:, 3].std()
    result = okid.identify(us, ys, fs=lab.fs, output_names=NAMES)
    (said,) = [w.text for w in result.warnings if w.code == "screened"]
    assert said.startswith(
        'output "y3" of record 1 (counted from 0) and 2 more records: spikes (3 samples, the first is number 501)'
    )


def test_outputs_that_are_all_dead_are_refused() -> None:
    rng = np.random.default_rng(3)
    with pytest.raises(okid.IdentificationError, match='output "y1" is constant'):
        okid.identify(rng.standard_normal((4000, 1)), np.ones((4000, 2)), fs=100.0)
    with pytest.raises(okid.IdentificationError, match='input "u1" is constant'):
        okid.identify(np.ones((4000, 1)), rng.standard_normal((4000, 2)), fs=100.0)
    with pytest.raises(okid.InputError, match='column "u1" holds no number'):
        okid.identify(np.full((4000, 1), np.nan), rng.standard_normal((4000, 2)), fs=100.0)


def test_records_of_a_whole_number_of_blocks() -> None:
    """5,120 samples are 20 blocks of the sums that compare records: the last one is empty."""
    lab = forced(21, count=10240)
    u, y = np.array_split(lab.samples[:, : lab.n_u], 2), np.array_split(lab.samples[:, lab.n_u :], 2)
    result = okid.identify(u, y, fs=lab.fs, sigma_blocks=0)
    assert len(result.confident_modes) == len(lab.frequency_hz) and not result.warnings
