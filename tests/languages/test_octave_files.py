# SPDX-License-Identifier: MIT
"""Exports of Testlab and Dewesoft, written by GNU Octave in their layouts, and what okid writes, read by Octave."""

from __future__ import annotations

import subprocess
from pathlib import Path

import numpy as np
import pytest
from okid.data.records import Record
from okid.formats import read_record, write_record

SAMPLES = """
n = 500; k = (0:n-1)'; a = [sin(k / 7), cos(k / 11) .* k, mod(k, 13) / 3]; f = 1 ./ (k + 1);
"""
TESTLAB = """
x = struct ('start_value', 0, 'increment', 1 / 4096, 'number_of_values', n, 'quantity', struct ('label', 's'));
q = struct ('label', 'm/s^2', 'unit_transformation', struct ('factor', 1, 'offset', 0));
Signal_0 = struct ('x_values', x, 'y_values', struct ('values', a, 'quantity', q));
Signal_0.function_record.name = {'wing:1:+Z', 'wing:2:+Z', 'wing:3:+Z'};
Signal_1 = struct ('x_values', x, 'y_values', struct ('values', f, 'quantity', struct ('label', 'N')));
Signal_1.function_record.name = 'wing:1:-Z';
save ('-v%d', 'a.mat', 'Signal_0', 'Signal_1');
"""
DEWESOFT = """
Sample_rate = 4096; Start_time = 'today';
Data1_Force = f; Data1_a1 = a(:,1); Data1_a2 = a(:,2); Data1_a3 = a(:,3);
t = datenum (2024, 5, 2, 10, 11, 12) + k / 4096 / 86400;
Data1_time_Force = t; Data1_time_a1 = t; Data1_time_a2 = t; Data1_time_a3 = t;
save ('-v%d', 'a.mat', 'Data1_*', 'Sample_rate', 'Start_time');
"""


def octave(folder: Path, script: str) -> str:
    command = ["octave-cli", "--norc", "--quiet", "--eval", script]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, check=True).stdout


def expected() -> np.ndarray:
    k = np.arange(500.0)
    return np.column_stack([np.sin(k / 7), np.cos(k / 11) * k, np.mod(k, 13) / 3, 1 / (k + 1)])


@pytest.mark.parametrize("version", [6, 7])
def test_testlab(tmp_path: Path, version: int) -> None:
    octave(tmp_path, SAMPLES + TESTLAB % version)
    record = read_record(tmp_path / "a.mat")
    assert record.names == ["wing:1:+Z", "wing:2:+Z", "wing:3:+Z", "wing:1:-Z"]
    assert (record.units, record.fs_hz) == (["m/s^2"] * 3 + ["N"], 4096.0)
    np.testing.assert_allclose(record.samples, expected(), rtol=1e-12)


@pytest.mark.parametrize("version", [6, 7])
def test_dewesoft(tmp_path: Path, version: int) -> None:
    octave(tmp_path, SAMPLES + DEWESOFT % version)
    record = read_record(tmp_path / "a.mat")
    assert record.fs_hz == 4096.0
    np.testing.assert_allclose(record.columns(["a1", "a2", "a3", "Force"], "a.mat"), expected(), rtol=1e-12)


def test_what_okid_writes(tmp_path: Path) -> None:
    samples = np.random.default_rng(1).standard_normal((300, 2))
    write_record(tmp_path / "b.mat", Record(["force", "a 1"], samples, 1024.0, ["N", "m/s^2"]))
    script = "load b.mat; printf ('%s|%s|%g\\n', names{2}, units{1}, fs); printf ('%.17g %.17g\\n', samples');"
    head, *rows = octave(tmp_path, script).splitlines()
    assert head == "a 1|N|1024"
    np.testing.assert_array_equal(np.array([row.split() for row in rows], dtype=float), samples)
