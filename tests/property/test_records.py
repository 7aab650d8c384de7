# SPDX-License-Identifier: MIT
"""CSV records, response functions and shapes in Python."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import okid
import pytest
import systems
from okid.data.records import read_csv


@pytest.mark.parametrize(
    ("text", "names", "samples", "rate"),
    [
        ("# fs_hz = 100\na,b\n1,2\n3,4\n", ["a", "b"], [[1, 2], [3, 4]], 100.0),
        ("\ufeff# sample_rate_hz: 51.2 x\r\na;b\r\n1,5;2\r\n;nan\r\n", ["a", "b"], [[1.5, 2], [np.nan, np.nan]], 51.2),
        ("a\tb\n1e-3\t-2\n", ["a", "b"], [[1e-3, -2]], None),
        ('# fs_hz: unknown\n"a, left","b [g]"\n1,2\n', ["a, left", "b [g]"], [[1, 2]], None),
        ("time_s,a\n0,1\n0.01,2\n0.02,3\n", ["time_s", "a"], [[0, 1], [0.01, 2], [0.02, 3]], 100.0),
        ("a,\n1,2\n", ["a"], [[1]], None),
        ("a,b\n1,\n,NaN\n", ["a", "b"], [[1, np.nan], [np.nan, np.nan]], None),
    ],
)  # fmt: skip
def test_csv_forms(tmp_path: Path, text: str, names: list[str], samples: list, rate: float | None) -> None:
    path = tmp_path / "r.csv"
    path.write_bytes(text.encode())
    record = read_csv(path)
    assert record.names == names
    np.testing.assert_array_equal(record.samples, samples)
    assert record.fs_hz is None if rate is None else record.fs_hz == pytest.approx(rate)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (b"", "the file is empty"),
        (b"# nothing\n", "no line of column names"),
        (b"a,b\n", "no rows after the column names"),
        (b"a,b\n1,2\n1\n", "r.csv, line 3: found 1 cell, expected 2"),
        (b"a,b\n1,2\n3,x\n", r'r.csv, line 3, column 2 \(b\): found "x", expected a number'),
        (b"a,b\n1,2\n3,inf\n", r'r.csv, line 3, column 2 \(b\): found "inf", expected a finite number'),
        (b"a,b\n1,2\n\n3,4\n", "r.csv, line 3: an empty line between rows"),
        (b"a,a\n1,2\n", "stands twice"),
        (b"\xff\xfea,b\n1,2\n", "UTF-8"),
    ],
)
def test_csv_faults_are_named(tmp_path: Path, text: bytes, words: str) -> None:
    path = tmp_path / "r.csv"
    path.write_bytes(text)
    with pytest.raises(okid.InputError, match=words):
        read_csv(path)


def test_csv_absent_file_and_column(tmp_path: Path) -> None:
    with pytest.raises(okid.InputError, match="No such file or directory"):
        read_csv(tmp_path / "none.csv")
    (tmp_path / "r.csv").write_text("a,b\n1,2\n", encoding="utf-8")
    with pytest.raises(okid.InputError, match="'c'.*a, b"):
        read_csv(tmp_path / "r.csv").columns(["a", "c"], "r.csv")


def test_csv_columns_are_found_without_their_unit(tmp_path: Path) -> None:
    (tmp_path / "r.csv").write_text("force1 [N],a [g],a [m/s^2],b [V],b\n1,2,3,4,5\n", encoding="utf-8")
    record = read_csv(tmp_path / "r.csv")
    wanted = ["b", "force1", "a [g]", "force1 [N]"]
    np.testing.assert_array_equal(record.columns(wanted, "r.csv"), [[5, 1, 2, 1]])
    for wrong in ("a", "force", ""):
        with pytest.raises(okid.InputError, match="no column"):
            record.columns([wrong], "r.csv")


def test_segments_of_h1_follow_the_record() -> None:
    rng = np.random.default_rng(1)
    for samples in (500, 2000, 8192, 30000):
        u, y = rng.standard_normal((samples, 1)), rng.standard_normal((samples, 2))
        assert 8 <= okid.frf.h1(u, y, 100.0).averages <= 12
    y[::97] = np.nan
    measured = okid.frf.h1(u, y, 100.0)
    assert measured.resolution_hz == pytest.approx(100.0 / 64)
    assert measured.averages == 2 * (30000 // 97)
    y[::50] = np.nan
    with pytest.raises(okid.InputError, match="longest stretch .* 49 samples"):
        okid.frf.h1(u, y, 100.0)
    blow = np.zeros((1000, 1))
    blow[5:8, 0] = 1.0
    y = rng.standard_normal((1000, 2))
    y[700:710] = np.nan
    assert okid.frf.h1(blow, y, 100.0).resolution_hz == pytest.approx(100.0 / 700)
    y[30] = np.nan
    with pytest.raises(okid.InputError, match="only 30 unbroken"):
        okid.frf.h1(blow, y, 100.0)


def test_h1_and_synthesis_agree_with_the_structure() -> None:
    s = systems.w2()
    u, y = systems.record(s, 40000, 1.0, 1)
    y[12345, 2] = np.nan
    measured = okid.frf.h1([u[:20000], u[20000:]], [y[:20000], y[20000:]], s.fs, nperseg=2048)
    truth = okid.frf.synthesise(*s.discrete(), s.dt, measured.frequency_hz)
    strong = np.abs(truth) > 0.05 * np.max(np.abs(truth))
    strong[:5] = False
    error = np.abs(measured.response - truth)[strong] / np.abs(truth)[strong]
    assert np.median(error) < 0.05
    assert measured.coherence.shape == (1025, 6)
    assert np.median(measured.coherence[20:]) > 0.95
    assert measured.resolution_hz == pytest.approx(s.fs / 2048)
    assert okid.frf.cmif(measured.response).shape == (1025,)


def test_synthesis_is_the_transform_of_the_impulse_response() -> None:
    s = systems.w1()
    A, B, C, D = s.discrete()
    pulses = np.zeros((6000, 1))
    pulses[0] = 1.0
    answer = systems.simulate((A, B, C, D), pulses)
    f = np.array([3.0, 10.0, 31.0, 50.0])
    direct = np.exp(-2j * np.pi * f[:, None] * s.dt * np.arange(6000)) @ answer
    np.testing.assert_allclose(okid.frf.synthesise(A, B, C, D, s.dt, f)[:, :, 0], direct, rtol=1e-6)


def test_one_average_has_no_coherence_and_hits_are_seen() -> None:
    u = np.zeros((1000, 1))
    u[5:8, 0] = 1.0
    assert okid.frf.is_hit(u)
    assert not okid.frf.is_hit(np.random.default_rng(1).standard_normal((1000, 1)))
    assert not okid.frf.is_hit(np.zeros((10, 1)))
    measured = okid.frf.h1(u, np.random.default_rng(1).standard_normal((1000, 2)), 100.0)
    assert measured.averages == 1
    assert np.all(np.isnan(measured.coherence))
    with pytest.raises(okid.InputError, match="nperseg"):
        okid.frf.h1(u, u, 100.0, nperseg=2000)


def test_mac_and_mpc() -> None:
    rng = np.random.default_rng(1)
    a = rng.standard_normal((3, 5)) + 1j * rng.standard_normal((3, 5))
    b = rng.standard_normal((2, 5))
    table = okid.modal.mac_matrix(a, b)
    assert table.shape == (3, 2)
    assert okid.modal.mac(a[0], (2.0 - 3.0j) * a[0]) == pytest.approx(1.0)
    np.testing.assert_allclose(table, okid.modal.mac_matrix(b, a).T)
    assert np.all((table >= 0.0) & (table <= 1.0))
    assert okid.modal.mac(np.zeros(5), a[0]) == 0.0
    assert okid.modal.mpc(np.exp(0.7j) * rng.standard_normal(6)) == pytest.approx(1.0)
    assert okid.modal.mpc([1.0, 1.0j]) == pytest.approx(0.0)
    with pytest.raises(okid.InputError):
        okid.modal.mac(np.zeros(3), np.zeros(4))


def test_poles_of_a_known_model() -> None:
    s = systems.w3()
    A, _, C, _ = s.discrete()
    f, zeta = s.modes()
    poles = okid.modal.poles(A, C, s.dt)
    np.testing.assert_allclose(poles.frequency_hz, f, rtol=1e-9)
    np.testing.assert_allclose(poles.damping_ratio, zeta, rtol=1e-6)
    assert poles.shapes.shape == (10, 10)
