# SPDX-License-Identifier: MIT
"""The report of frequency responses, and the check of a record's modes in the frequency domain."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import okid
import pytest
from okid.report.compose import build
from okid.report.loaded import loaded_from

pytestmark = pytest.mark.usefixtures("words_only_in_module")


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory, words_only_in_module: None) -> str:
    force, y = okid.demo_record()
    result = okid.identify(force, y, fs=1000.0, input_names=["f"], output_names=["a", "b", "c"], sigma_blocks=0)
    path = tmp_path_factory.mktemp("check") / "run.csv"
    okid.write_csv(path, okid.Record(["f", "a", "b", "c"], np.column_stack([force, y]), 1000.0))
    return build(loaded_from(result.to_dict(), "result"), str(path))


def _cells(page: str, section: str) -> list[list[str]]:
    part = page[page.index(f'<section id="{section}"') :]
    part = part[: part.index("</section>")]
    return [re.findall(r"<td[^>]*>(.*?)</td>", row) for row in re.findall(r"<tr[^>]*>(.*?)</tr>", part, re.S)][1:]


def test_check_in_the_frequency_domain(page: str) -> None:
    rows = _cells(page, "check")
    assert len(rows) == 3
    for row in rows:
        f, share = float(row[1]), float(row[3].removesuffix(" %"))
        assert share > 90.0
        assert float(row[4]) == pytest.approx(f, rel=0.02) and float(row[6]) > 0.95


def test_complexity_in_numbers(page: str) -> None:
    rows = _cells(page, "complexity")
    assert len(rows) == 3 and all(0.0 <= float(row[2]) < 5.0 and 0.0 <= float(row[3]) < 0.02 for row in rows)


def test_another_result_beside(tmp_path: Path) -> None:
    force, y = okid.demo_record()
    names = ["a", "b", "c"]
    one = okid.identify(force, y, fs=1000.0, output_names=names, sigma_blocks=0)
    moved = y.copy()
    moved[:, 2] = 0.7 * y[:, 2] + 0.3 * y[:, 0]  # a sensor that no longer measures what it did
    okid.identify(force, moved, fs=1010.0, output_names=names, sigma_blocks=0).save(tmp_path / "other.json")
    text = build(loaded_from(one.to_dict(), "result"), compare=tmp_path / "other.json")
    rows = [row for row in _cells(text, "comparison") if row]
    assert [row[:2] for row in rows] == 2 * [["1", "1"], ["2", "2"], ["3", "3"]]  # frequency, then damping
    for row in rows[:3]:  # this result minus the earlier one, whose rate was said 1 % too high
        assert float(row[4]) == pytest.approx(-100.0 / 101.0, abs=0.1) and float(row[6]) < 0.999
        assert re.match(r"lower by (0.9|1)\S* %, no standard deviation", row[7])
    assert "CoMAC" in text and "Compared with other.json" in text
    okid.identify(force, y[:, 0], fs=1000.0, output_names=["z"], sigma_blocks=0).save(tmp_path / "z.json")
    alone = build(loaded_from(one.to_dict(), "result"), compare=tmp_path / "z.json")
    assert "have no output in common" in alone and len([row for row in _cells(alone, "comparison") if row]) == 6


def test_a_softer_spring_in_the_report(tmp_path: Path) -> None:
    """The same comparison as `okid compare`: shift with ± and z, and which are more than chance."""
    names = ["a", "b", "c"]
    results = []
    for factor in (1.0, 0.96):
        frame = okid.Structure.chain([1.0, 0.8, 1.2], [factor * 3e4, 2e4, 2.5e4], zeta=(0.01, 0.01))
        force = np.random.default_rng(1).normal(size=(20000, 1))
        y = frame.model(1000.0, force_dofs=[1], sense_dofs=[1, 2, 3]).simulate(force)
        y += 0.01 * y.std(axis=0) * np.random.default_rng(2).normal(size=y.shape)
        results.append(okid.identify(force, y, fs=1000.0, output_names=names))
    results[0].save(tmp_path / "before.json")
    text = build(loaded_from(results[1].to_dict(), "result"), compare=tmp_path / "before.json")
    found = okid.compare(tmp_path / "before.json", results[1])
    rows = [row for row in _cells(text, "comparison") if row]
    assert found.changed and [row[7] for row in rows[:3]] == [one.verdict for one in found.pairs]
    assert any("more than chance (z -" in row[7] for row in rows[:3]) and all("±" in row[4] for row in rows)


def test_deflection_of_an_ambient_record() -> None:
    _, y = okid.demo_record()
    record = okid.Record(["a", "b", "c"], y, 1000.0)
    result = okid.identify(None, y, fs=1000.0, output_names=["a", "b", "c"], method="plscf")
    rows = _cells(build(loaded_from(result.to_dict(), "result"), record), "deflection")
    assert len(rows) >= 2 and all(float(row[3]) > 0.9 for row in rows)


def test_report_and_universal_file_of_responses(tmp_path: Path) -> None:
    force, y = okid.demo_record()
    result = okid.identify_frf(okid.frf.h1(force, y, 1000.0, nperseg=4096), band=(5.0, 80.0))
    text = build(loaded_from(result.to_dict(), "result"))
    assert "plscf" in text and 'id="check"' not in text
    okid.write_uff(tmp_path / "modes.uff", result)
    modes = okid.read_uff(tmp_path / "modes.uff").modes
    assert [one.frequency_hz for one in modes] == pytest.approx([one.frequency_hz for one in result.modes], rel=1e-5)
