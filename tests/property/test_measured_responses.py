# SPDX-License-Identifier: MIT
"""Frequency responses as laboratories measure them (measured_responses.py): which modes the program finds, which it
claims that are not there, how wide it says it errs, and what it does with lines that are no measurement."""

from __future__ import annotations

import json
import os
from dataclasses import replace
from pathlib import Path
from typing import Any

import measured_responses as lab
import numpy as np
import pytest
from program import okid as program

SLOW = os.environ.get("OKID_SLOW") == "1"  # the long tier
HELD_LEAST = 0.88  # of 0.95, less what 100 modes leave to chance
NARROW_ENOUGH = 0.15  # median of error over deviation; of normal errors 0.67


def identify(path: Path, *options: str) -> dict[str, Any]:
    run = program("identify", path, "--frf", "--json", "-", "--quiet", *options, status=0)
    result: dict[str, Any] = json.loads(run.stdout)
    return result


def confident(result: dict[str, Any]) -> list[dict[str, Any]]:
    return [mode for mode in result["modes"] if mode["confident"]]


def _over_deviation(file: lab.File, right: Any) -> list[tuple[float, float]]:
    """Errors of f and zeta of the modes found over their standard deviations."""
    return [
        (
            (mode["frequency_hz"] - file.truth.f[at]) / mode["frequency_std_hz"],
            (mode["damping_ratio"] - file.truth.zeta[at]) / mode["damping_ratio_std"],
        )
        for at, mode in right
    ]


def test_modes_of_eighteen_files_of_six_kinds(tmp_path: Path) -> None:
    there = found = claimed = false = 0
    lines, errors = [], []
    for kind in lab.KINDS:
        for name in lab.STRUCTURES:
            file = lab.make(kind, name, 1)
            modes = confident(identify(lab.write(file, tmp_path)))
            right, wrong = lab.score(file, modes)
            errors += _over_deviation(file, right)
            hit = [k for k, _ in right if k in file.seen]
            there, found = there + len(file.seen), found + len(hit)
            claimed, false = claimed + len(modes), false + len(wrong)
            lines.append(f"{file.name}: {len(hit)} of {len(file.seen)}, false {[m['frequency_hz'] for m in wrong]}")
            assert all(mode["frequency_hz"] <= file.f[-1] for mode in modes), "a mode beyond the last line"
            for mode in modes:
                assert mode["mpc"] > 0.5
                assert mode["found_in"] >= 0.5, "confident, though few runs found it"
    assert there > 150
    assert found >= 0.90 * there, "\n".join(lines)
    assert false <= 0.05 * claimed, "\n".join(lines)
    held = np.mean(np.abs(errors) < 2, axis=0)
    assert np.all(held >= HELD_LEAST), held
    assert np.all(np.median(np.abs(errors), axis=0) > NARROW_ENOUGH), "deviations far wider than the errors"


@pytest.mark.parametrize(("kind", "seed", "least"), [("roving_hammer", 1, 12), ("accelerance_g", 2, 9)])
def test_what_the_fit_knows_is_believed_though_runs_scatter(kind: str, seed: int, least: int, tmp_path: Path) -> None:
    """Damping of 2 to 7 %, of which the runs disagree; the fit knows it to a tenth, and the shape is real."""
    file = lab.make(kind, "plate", seed, damping=6)
    modes = confident(identify(lab.write(file, tmp_path)))
    right, _ = lab.score(file, modes)
    assert len([k for k, _ in right if k in file.seen]) >= least
    assert all(mode["found_in"] >= 0.5 for mode in modes)


if SLOW:

    @pytest.mark.parametrize("kind", ["roving_hammer", "accelerance_g"])
    def test_deviations_hold_the_truth_of_repeated_tests(kind: str, tmp_path: Path) -> None:
        """Each place of the roving hammer has its own frequencies, which scatter far more than the noise moves them;
        the averages of the other are under a Hann window: most of its damping would be beyond two deviations."""
        errors = []
        for name in lab.STRUCTURES:
            for k in range(4):
                file = lab.make(kind, name, 1, k)
                errors += _over_deviation(file, lab.score(file, confident(identify(lab.write(file, tmp_path))))[0])
        assert len(errors) >= 90
        held = np.mean(np.abs(errors) < 2, axis=0)
        assert np.all(held >= HELD_LEAST), held
        assert np.all(np.median(np.abs(errors), axis=0) > NARROW_ENOUGH), "deviations far wider than the errors"


@pytest.fixture(scope="module")
def masses() -> lab.File:
    return lab.make("accelerance_g", "masses", 2)


def _frequencies(path: Path, *options: str) -> list[float]:
    return [mode["frequency_hz"] for mode in confident(identify(path, *options))]


def test_decibels_and_magnitudes_are_real_and_imaginary_parts(masses: lab.File, tmp_path: Path) -> None:
    tables = {}
    for parts in (("re", "im"), ("db", "deg"), ("mag", "deg")):
        tables[parts] = tmp_path / f"{parts[0]}.csv"
        h = masses.h[:, :, 0]
        of = {
            "re": h.real,
            "im": h.imag,
            "db": 20 * np.log10(np.abs(h)),
            "mag": np.abs(h),
            "deg": np.degrees(np.angle(h)),
        }
        names = [f"{o + 1}z/1z:{part}" for o in masses.outputs for part in parts]
        columns = np.stack([of[part] for part in parts], axis=2).reshape(len(h), -1)
        text = ",".join(["frequency_hz", *names]) + "\n"
        rows = np.column_stack([masses.f, columns]).tolist()
        tables[parts].write_text(text + "\n".join(",".join(map(repr, r)) for r in rows) + "\n", encoding="ascii")
    first, *others = [_frequencies(path) for path in tables.values()]
    assert len(first) >= 7
    for other in others:
        assert other == pytest.approx(first, rel=1e-9)


def test_lines_without_coherence_are_in_no_fit(masses: lab.File, tmp_path: Path) -> None:
    assert masses.coherence is not None
    r = np.random.default_rng(3)
    bad = masses.f > 0.8 * masses.f[-1]
    h, coherence = masses.h.copy(), masses.coherence.copy()
    smooth = np.cumsum(r.normal(size=(int(bad.sum()), 1, 1)) + 1j * r.normal(size=(int(bad.sum()), 1, 1)), axis=0)
    h[bad] = np.mean(np.abs(h)) * smooth  # no noise to look at: only the coherence tells
    coherence[bad] = 0.05
    result = identify(lab.write(replace(masses, h=h, coherence=coherence, name="bad"), tmp_path))
    assert result["band_hz"][1] == pytest.approx(0.8 * masses.f[-1], rel=0.02)
    assert "lines_left_out" in [one["code"] for one in result["warnings"]]


def test_lines_of_noise_are_in_no_fit_where_nothing_says_so(masses: lab.File, tmp_path: Path) -> None:
    r = np.random.default_rng(4)
    bad = masses.f < 18.0
    h = masses.h.copy()
    h[bad] = 30 * np.mean(np.abs(h)) * (r.normal(size=h[bad].shape) + 1j * r.normal(size=h[bad].shape))
    path = lab.write(replace(masses, h=h, coherence=None, name="low"), tmp_path)
    result = identify(path)
    assert 16.0 < result["band_hz"][0] < 21.0
    assert "lines_left_out" in [one["code"] for one in result["warnings"]]
    assert len(confident(result)) >= 7
    asked = identify(path, "--band", "5:190")
    assert asked["band_hz"][0] == pytest.approx(5.0, abs=0.5), "--band takes lines as they are"


def test_lines_without_numbers_are_left_out(masses: lab.File, tmp_path: Path) -> None:
    h = masses.h.copy()
    h[::7, 2] = np.nan
    whole = _frequencies(lab.write(replace(masses, coherence=None, name="whole"), tmp_path))
    some = _frequencies(lab.write(replace(masses, h=h, coherence=None, name="some"), tmp_path))
    assert some == pytest.approx(whole, rel=1e-3)


def test_a_part_that_is_missing_is_named(tmp_path: Path) -> None:
    path = tmp_path / "half.csv"
    path.write_text("frequency_hz,1z/2z:db\n1,2\n2,3\n", encoding="ascii")
    assert (
        "1z/2z has not both of its two parts; expected a column" in program("identify", path, "--frf", status=2).stderr
    )
