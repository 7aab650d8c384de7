# SPDX-License-Identifier: MIT
"""Which record belongs to which group: names, an index, time, temperature bands; and what cannot be placed."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from okid.campaign.grouping import group_records
from okid.campaign.record_list import list_records
from okid.campaign.record_read import read_one
from okid.campaign.spec import load_spec

NAMES = ("north_20250131T2330", "north_20250201T0030", "south_20250131T1200", "south_20250203T1200")
CHANNELS = '[channels]\noutputs = ["a"]\nfs_hz = 100.0\n'


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    for name in NAMES:
        np.save(tmp_path / f"{name}.npy", np.zeros((4, 1), np.int16))
    return tmp_path


def groups_of(folder: Path, text: str) -> tuple[dict[str, list[str]], list[str]]:
    (folder / "SPEC.toml").write_text(text + CHANNELS)
    spec = load_spec(folder / "SPEC.toml")
    records, bad = list_records(spec)
    groups, keyless = group_records(spec, records)
    return {g.label: [Path(ref.name).stem for ref in g.records] for g in groups}, [
        f"{s.name}: {s.reason}" for s in [*bad, *keyless]
    ]


BY_NAME = """[records]
files = ["*.npy"]
name = '(?P<structure>\\w+)_(?P<time>\\d{8}T\\d{4})'
time_format = "%Y%m%dT%H%M"
"""
INDEX = """[records]
files = ["*.npy"]
index = "i.{kind}"
index_path = "file"
index_time = "when"
[temperature]
column = "celsius"
"""


@pytest.mark.parametrize(
    ("by", "wanted"),
    [
        (["structure"], {"south": [NAMES[2], NAMES[3]], "north": [NAMES[0], NAMES[1]]}),
        (["structure", "month"], {"south · 2025-01": [NAMES[2]], "north · 2025-01": [NAMES[0]],
                                  "north · 2025-02": [NAMES[1]], "south · 2025-02": [NAMES[3]]}),
        (["day"], {"2025-01-31": [NAMES[2], NAMES[0]], "2025-02-01": [NAMES[1]], "2025-02-03": [NAMES[3]]}),
        (["week"], {"2025-W05": [NAMES[2], NAMES[0], NAMES[1]], "2025-W06": [NAMES[3]]}),
        (["year"], {"2025": [NAMES[2], NAMES[0], NAMES[1], NAMES[3]]}),
        (["hour"], {"2025-01-31T12": [NAMES[2]], "2025-01-31T23": [NAMES[0]], "2025-02-01T00": [NAMES[1]],
                    "2025-02-03T12": [NAMES[3]]}),
        ([], {"all records": [NAMES[2], NAMES[0], NAMES[1], NAMES[3]]}),
        (["record"], {f"{name}.npy": [name] for name in (NAMES[2], NAMES[0], NAMES[1], NAMES[3])}),
    ],
)  # fmt: skip
def test_keys_of_names_and_time(folder: Path, by: list[str], wanted: dict[str, list[str]]) -> None:
    found, bad = groups_of(folder, f"{BY_NAME}[group]\nby = {by!r}\n")
    assert found == wanted and list(found) == list(wanted) and not bad


@pytest.mark.parametrize("kind", ["parquet", "csv"])
def test_index_gives_time_temperature_and_keys(folder: Path, kind: str) -> None:
    table = pd.DataFrame({
        "file": [f"{name}.npy" for name in NAMES[:3]],
        "when": pd.to_datetime(["2025-01-01T01:00Z", "2025-01-01T02:00Z", "2025-01-02T03:00Z"]),
        "celsius": [-0.1, 4.9, 5.0], "bridge": ["A", "A", "B"],
    })  # fmt: skip
    getattr(table, f"to_{kind}")(folder / f"i.{kind}", index=False)
    head = INDEX.format(kind=kind)
    bands, bad = groups_of(folder, head + '[group]\nby = ["temperature_band"]\n')
    assert bands == {"-5 to 0 °C": [NAMES[0]], "0 to 5 °C": [NAMES[1]], "5 to 10 °C": [NAMES[2]]}
    assert bad == [f"{NAMES[3]}.npy: it is not in the index i.{kind}"]
    both, _ = groups_of(folder, head + '[group]\nby = ["bridge", "day"]\nband_c = 2.0\n')
    assert both == {"A · 2025-01-01": [NAMES[0], NAMES[1]], "B · 2025-01-02": [NAMES[2]]}
    absent, bad = groups_of(folder, head + '[group]\nby = ["girder"]\n')
    assert not absent and bad[-1] == f'{NAMES[2]}.npy: no value of the key "girder" of [group] (keys it has: bridge)'


def test_time_of_the_file_where_nothing_else_tells(folder: Path) -> None:
    for k, name in enumerate(NAMES):
        os.utime(folder / f"{name}.npy", (86400.0 * k, 86400.0 * k))
    found, bad = groups_of(folder, '[records]\nfiles = ["*.npy"]\n[group]\nby = ["day"]\n')
    assert found == {f"1970-01-{k + 1:02d}": [name] for k, name in enumerate(NAMES)} and not bad


def test_names_that_do_not_fit_are_told(folder: Path) -> None:
    np.save(folder / "odd.npy", np.zeros((4, 1), np.int16))
    np.save(folder / "east_20251399T0000.npy", np.zeros((4, 1), np.int16))
    found, bad = groups_of(folder, f'{BY_NAME}[group]\nby = ["structure"]\n')
    assert sorted(found) == ["north", "south"]
    assert any("odd.npy: its name does not match" in line for line in bad)
    assert any("east_20251399T0000.npy: its time '20251399T0000' is not" in line for line in bad)


def test_records_of_a_url(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A remote file system: here one in memory in the place of S3."""
    import fsspec
    from fsspec.implementations.memory import MemoryFileSystem

    class Bucket(MemoryFileSystem):  # type: ignore[misc]
        protocol = "s3"

        @classmethod
        def _strip_protocol(cls, path: str) -> str:
            return str(super()._strip_protocol(path.removeprefix("s3:/")))

    fsspec.register_implementation("s3", Bucket, clobber=True)
    for k in range(3):
        with Bucket().open(f"/bridge/{k}.npy", "wb") as file:
            np.save(file, np.zeros((4, 1), np.int16))
    found, bad = groups_of(tmp_path, '[records]\nfiles = ["s3://bridge/*.npy"]\n[group]\nby = []\n')
    assert found == {"all records": ["0", "1", "2"]} and not bad
    ref = list_records(load_spec(tmp_path / "SPEC.toml"))[0][0]
    assert ref.url.startswith("s3://") and ref.url.endswith("/bridge/0.npy")
    assert read_one(load_spec(tmp_path / "SPEC.toml"), ref.name, ref.url).samples.shape == (4, 1)
