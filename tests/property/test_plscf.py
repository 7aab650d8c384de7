# SPDX-License-Identifier: MIT
"""Modes by way of correlations (method plscf), and several set-ups identified together. Records are simulated by the
tests' own structures; frequencies, damping and shapes that must come out follow from their matrices."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import okid
import pytest
from numpy.typing import NDArray
from okid import modal
from program import okid as program
from scipy.linalg import eigh
from scipy.signal import lfilter
from systems import Structure, record, w2

Real = NDArray[np.float64]
NAMES = ["a", "b", "c", "d", "e", "f"]
SETUPS = ([0, 3, 1], [0, 3, 2], [0, 3, 4, 5])  # a and d stay


def _ambient() -> Structure:
    """Every mass is driven."""
    return replace(w2(), force_dofs=tuple(range(6)))


def _truth(s: Structure) -> tuple[Real, Real, Real]:
    f, zeta = s.modes()
    return f, zeta, eigh(s.K, s.M)[1].T


def _check(result: okid.Result, s: Structure, f_off: float, zeta_off: float, least_mac: float) -> None:
    f, zeta, shapes = _truth(s)
    found = result.confident_modes
    assert [mode.frequency_hz for mode in found] == pytest.approx(f, rel=f_off)
    assert [mode.damping_ratio for mode in found] == pytest.approx(zeta, rel=zeta_off)
    places = [NAMES.index(name) for name in result.outputs]
    assert min(modal.mac(mode.shape, phi[places]) for mode, phi in zip(found, shapes, strict=True)) > least_mac


def _set_ups(s: Structure, n_u: int, seed: int) -> tuple[list[Real], list[Real]]:
    """Other samples, another level and another sign of the sensors' unit in each."""
    u, y = record(s, 45000, 2.0, seed)
    inputs, outputs = [], []
    for k, columns in enumerate(SETUPS):
        part = slice(15000 * k, 15000 * (k + 1))
        scale = [1.0, 5.0, 0.2][k]
        inputs.append(scale * u[part, :n_u])
        outputs.append(scale * y[part][:, columns])
    return inputs, outputs


def test_ambient_set_ups_become_one_set_of_modes() -> None:
    s = _ambient()
    _, y = _set_ups(s, 0, 1)
    names = [[NAMES[c] for c in columns] for columns in SETUPS]
    result = okid.identify_setups(None, y, fs=s.fs, output_names=names, method="plscf")
    _check(result, s, 3e-3, 0.35, 0.97)
    assert (result.method, result.records, result.samples, result.inputs) == ("plscf", 3, 45000, [])
    assert result.outputs == ["a", "d", "b", "c", "e", "f"]
    for mode in result.confident_modes:
        assert mode.frequency_std_hz and 1e-5 < mode.frequency_std_hz / mode.frequency_hz < 1e-2  # between set-ups
    one = okid.identify_setups(
        None, y, fs=s.fs, output_names=names, references=["d", "a"], sigma="none", method="plscf"
    )
    _check(one, s, 3e-3, 0.35, 0.97)
    assert one.modes[0].frequency_std_hz is None


def test_set_ups_under_one_force_need_no_reference() -> None:
    s = w2()
    u, y = _set_ups(s, 2, 2)
    y = [one[:, 2:] for one in y]
    names = [[NAMES[c] for c in columns[2:]] for columns in SETUPS]
    _check(okid.identify_setups(u, y, fs=s.fs, output_names=names, method="plscf"), s, 1e-3, 0.1, 0.98)


def test_command_gives_what_python_gives(tmp_path: Path) -> None:
    s = _ambient()
    _, y = _set_ups(s, 0, 3)
    paths = []
    for k, columns in enumerate(SETUPS):
        paths.append(tmp_path / f"{k}.csv")
        head = f"# fs_hz: {s.fs!r}\n" + ",".join(NAMES[c] for c in columns)
        np.savetxt(paths[-1], y[k], delimiter=",", header=head, comments="", fmt="%.17g")
    out = tmp_path / "r.json"
    common = [*paths, "--setups", "--method", "plscf", "--json", out, "--quiet"]
    program("identify", *common, "--outputs", "a,b,c,d,e,f", status=0)
    by_program = okid.Result.from_dict(json.loads(out.read_text(encoding="utf-8")))
    _check(by_program, s, 3e-3, 0.35, 0.97)
    assert by_program.outputs == NAMES
    own = [[NAMES[c] for c in sorted(columns)] for columns in SETUPS]
    ordered = [one[:, np.argsort(columns)] for one, columns in zip(y, SETUPS, strict=True)]
    by_python = okid.identify_setups(None, ordered, fs=s.fs, output_names=own, method="plscf")
    assert [m.frequency_hz for m in by_program.modes] == pytest.approx([m.frequency_hz for m in by_python.modes])
    for arguments, words in ((["--outputs", "a,b,z"], "no file has z"), (["--outputs", "b,c,e"], "no output in common"),
                             (["--outputs", "a,b,c,d", "--references", "b"], '--references: found "b"')):  # fmt: skip
        assert words in program("identify", *common, *arguments, status=2).stderr
    alone = program("identify", paths[0], "--outputs", "a", "--references", "a", status=2)
    assert "belongs to --setups" in alone.stderr


def test_half_spectra_of_an_ambient_record() -> None:
    s = _ambient()
    _, y = record(s, 30000, 2.0, 4)
    y[10000:10040] = np.nan  # a gap is no product of what lies on either side
    result = okid.identify(None, y, fs=s.fs, method="plscf", output_names=NAMES)
    _check(result, s, 4e-3, 0.35, 0.98)
    assert result.gaps == 1 and result.p is None
    f, zeta, _ = _truth(s)
    off = [(mode.frequency_hz - a) / mode.frequency_std_hz for mode, a in zip(result.confident_modes, f, strict=True)
           if mode.frequency_std_hz]  # fmt: skip
    assert len(off) == 6 and np.sqrt(np.mean(np.square(off))) < 2.0
    assert all((mode.damping_ratio_std or 0) > 0.3 * np.sqrt(z / (2 * np.pi * a * 30000 / s.fs)) * 1.0
               for mode, a, z in zip(result.confident_modes, f, zeta, strict=True))  # fmt: skip
    assert result.model.K.shape == (12, 6) and np.all(np.abs(np.linalg.eigvals(result.model.A)) < 1.0)
    narrow = okid.identify(None, y, fs=s.fs, method="plscf", band=(0.5 * f[0], 1.1 * f[2]))
    assert [mode.frequency_hz for mode in narrow.confident_modes] == pytest.approx(f[:3], rel=4e-3)


def test_damping_near_the_nyquist_frequency() -> None:
    """A mode at 0.86 of it: the spectrum of samples is another than that of the continuous decay."""
    errors = []
    for seed in range(3):
        rng = np.random.default_rng(seed)
        shapes, y = rng.standard_normal((4, 4)), np.zeros((60000, 4))
        for f, shape in zip((5.0, 20.0, 33.0, 43.0), shapes, strict=True):
            pole = np.exp(2 * np.pi * f * complex(-0.01, np.sqrt(1 - 0.01**2)) / 100.0)
            one = lfilter([0, 1], [1, -2 * pole.real, abs(pole) ** 2], rng.standard_normal(len(y)))
            y += np.outer(one / one.std(), shape)
        y += 0.02 * y.std(axis=0) * rng.standard_normal(y.shape)
        modes = okid.identify(None, y, fs=100.0, method="plscf").modes
        nearest = min(modes, key=lambda mode: abs(mode.frequency_hz - 43.0))
        assert nearest.frequency_hz == pytest.approx(43.0, rel=1e-3)
        errors.append(nearest.damping_ratio / 0.01 - 1.0)
    assert abs(np.mean(errors)) < 0.05


def test_responses_of_a_record_with_forces() -> None:
    s = w2()
    u, y = record(s, 20000, 2.0, 5)
    result = okid.identify(u, y, fs=s.fs, method="plscf", output_names=NAMES)
    _check(result, s, 1e-3, 0.05, 0.99)
    assert result.fit.simulation_percent and min(result.fit.simulation_percent.values()) > 90.0
    with pytest.raises(okid.InputError, match="found with plscf"):
        okid.identify(u, y, fs=s.fs, method="plscf", input_dofs=[1, 4], output_dofs=[1, 2, 3, 4, 5, 6])
    for given, words in (({"p": 10}, "--p|p belongs to the okid"), ({"decimate": 2}, "belongs to method=auto"),
                         ({"order": 8}, "belongs to the okid")):  # fmt: skip
        with pytest.raises(okid.InputError, match=words):
            okid.identify(u, y, fs=s.fs, method="plscf", **given)


def test_noise_has_no_modes() -> None:
    with pytest.raises(okid.IdentificationError, match="no model: "):
        okid.identify(None, np.random.default_rng(0).normal(size=(6000, 3)), fs=100.0, method="plscf")
    with pytest.raises(okid.IdentificationError, match="has 500 samples"):
        okid.identify(None, np.random.default_rng(0).normal(size=(500, 3)), fs=100.0, method="plscf")
