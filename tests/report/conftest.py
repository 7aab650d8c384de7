# SPDX-License-Identifier: MIT
"""Reports of several kinds, made once."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import okid
import pytest
from okid import report
from okid.record.demo import demo_record
from report_files import write_csv, write_events
from words_only import leave_pictures_out

HOSTILE = ["<script>alert(1)</script>", 'a$b</script><img src=x onerror="alert(2)">', "acc '3' & ]]> $\\frac$"]


def _frame(folder: Path) -> Path:
    """Names that want to be code, M, K, R with deviations, events, geometry: everything a report can hold."""
    u, y = demo_record(3000)
    result = okid.identify(
        u, y, fs=1000.0, p=25, input_names=["force"], output_names=HOSTILE, input_dofs=[1], output_dofs=[1, 2, 3]
    )  # fmt: skip
    (folder / "frame.toml").write_text(
        "[geometry]\nnodes = [[0, 0, 0], [0, 0, 1], [0, 0, 2], [1, 0, 2]]\n"
        'dofs = [[2, "x"], [3, "x"], [4, "-z"]]\nlines = [[1, 2], [2, 3], [3, 4]]\n'
        '# </pre><script>alert(3)</script> mqtt = "mqtt://user:secret@host/okid"\n',
        encoding="utf-8",
    )
    record = okid.Record(["force", *HOSTILE], np.hstack([u, y]), 1000.0)
    hz = [mode.frequency_hz for mode in result.modes]
    events = write_events(folder / "frame.jsonl", HOSTILE, hz)
    report.write_report(
        result, folder / "frame.html", record, events=events, geometry=folder / "frame.toml", title="<u>A</u> & B"
    )  # fmt: skip
    return folder / "frame.html"


def _wide(folder: Path) -> Path:
    """Thirty-two outputs with long names that differ at their ends."""
    u, y = demo_record(2500)
    rng = np.random.default_rng(1)
    many = y @ rng.standard_normal((3, 32))
    many += 0.02 * many.std() * rng.standard_normal(many.shape)
    names = [f"bridge deck accelerometer {k}" for k in range(1, 33)]
    result = okid.identify(u, many, fs=1000.0, p=4, rows=12, output_names=names, sigma_blocks=0)
    result.save(folder / "wide.json")
    record = write_csv(folder / "wide.csv", ["u1", *names], np.hstack([u, many]), 1000.0)
    assert report.main([str(folder / "wide.json"), "--record", str(record), "--out", str(folder / "wide.html")]) == 0
    return folder / "wide.html"


def _ambient(folder: Path) -> Path:
    """A result without inputs."""
    y = demo_record(6000)[1]
    names = ["storey 1", "storey 2", "storey 3"]
    result = okid.identify(None, y, fs=1000.0, method="okid-era", output_names=names, sigma_blocks=0)
    result.save(folder / "ambient.json")
    record = write_csv(folder / "ambient.csv", names, y, 1000.0)
    target = folder / "ambient.html"
    assert report.main([str(folder / "ambient.json"), "--record", str(record), "--out", str(target)]) == 0
    return target


@pytest.fixture(scope="session")
def pages(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """A report of each kind."""
    folder = tmp_path_factory.mktemp("reports")
    return {"frame": _frame(folder), "wide": _wide(folder), "ambient": _ambient(folder)}


@pytest.fixture
def words_only(monkeypatch: pytest.MonkeyPatch) -> None:
    """For tests that read the words of a page: its pictures are most of its cost."""
    leave_pictures_out(monkeypatch)


@pytest.fixture(scope="module")
def words_only_in_module() -> Iterator[None]:
    """The same for a whole file and the pages it makes once."""
    with pytest.MonkeyPatch.context() as patch:
        leave_pictures_out(patch)
        yield
