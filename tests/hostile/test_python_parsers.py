# SPDX-License-Identifier: MIT
"""Every reader of Python on what a real file becomes when its values, bytes or nesting are changed: it is taken, or
refused by okid's own error in one line. The readers of records: tests/formats/test_damaged_files.py."""

from __future__ import annotations

import copy
import io
import json
import os
import pathlib
from contextlib import redirect_stderr, suppress
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from okid import Error
from okid.campaign.spec import load_spec
from okid.formats import read_geometry, read_uff, write_result
from okid.formats.uff_model import structure_text
from okid.live.config import read_config
from okid.live.session import Session
from okid.report.command import main as report
from okid.result.result_file import read_result
from program import okid
from two_masses import rig_text, simulate_rig

MORE = 30 if os.environ.get("OKID_SLOW") == "1" else 1
EXAMPLES = settings(deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow])
GEOMETRY = '[geometry]\nnodes = [[0,0,0],[0,0,1],[0,0,2]]\nlines = [[1,2],[2,3]]\ndofs = [[2,"x"],[3,"x"]]\n'
TABLE = "node,1,0,0,0\nnode,2,0,0,1.5\nnode,3,1,0,1.5\nline,1,2\nsurface,1,2,3\nsensor,a1,2,x\nfixed,1\n"
SPEC = """[campaign]
title = "bridge"
[records]
files = ["*.npy"]
name = '(?P<structure>[a-z]+)_(?P<time>[0-9T]+)'
[channels]
inputs = ["f"]
outputs = ["a", "b"]
fs_hz = 100.0
[group]
by = ["structure", "day"]
[trend]
training_share = 0.5
"""
ODD = st.one_of(
    st.none(), st.booleans(), st.floats(), st.integers(-(2**70), 2**70), st.text(max_size=8),
    st.sampled_from([[], {}, [[]], [None], "NaN", "\x1b[31m", "\ud800", 1e308, -0.0, [1] * 1000, {"a": {"b": [1]}}]),
    st.lists(st.one_of(st.none(), st.floats(), st.text(max_size=3)), max_size=4),
)  # fmt: skip


@pytest.fixture(scope="module")
def real(tmp_path_factory: pytest.TempPathFactory) -> pathlib.Path:
    folder = simulate_rig(tmp_path_factory.mktemp("real"), rig_text(8.0))
    config = (folder / "a.toml").read_text() + '[publish]\nsocket = "s"\nsamples = true\n' + GEOMETRY
    (folder / "a.toml").write_text(config)
    (folder / "b.toml").write_text(config.replace('socket = "s"\nsamples = true', ""))
    options = ("--json", folder / "r.json", "--events", folder / "e.jsonl")
    okid("replay", folder / "a.log", "-c", folder / "b.toml", *options, status=0)
    (folder / "spec.toml").write_text(SPEC)
    write_result(folder / "r.uff", json.loads((folder / "r.json").read_text()))
    (folder / "g.csv").write_text(TABLE)
    (folder / "g.unv").write_text(structure_text(read_geometry(folder / "g.csv")))
    return folder


def places(value: Any, path: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    """Where something stands in it: keys and numbers from the top."""
    inner = value.items() if isinstance(value, dict) else enumerate(value[:3]) if isinstance(value, list) else ()
    return [path, *(place for key, each in inner for place in places(each, (*path, key)))]


def changed(value: Any, data: st.DataObject) -> Any:
    """One to three places of it hold something else, or nothing at all."""
    out = copy.deepcopy(value)
    for _ in range(data.draw(st.integers(1, 3))):
        place = data.draw(st.sampled_from(places(out)[1:] or [()]))
        if not place:
            return copy.deepcopy(data.draw(ODD))
        holder = out
        for key in place[:-1]:
            holder = holder[key]
        if data.draw(st.booleans()) and isinstance(holder, dict):
            del holder[place[-1]]
        else:
            holder[place[-1]] = copy.deepcopy(data.draw(ODD))  # what is drawn once more must be unchanged
    return out


def damaged(whole: bytes, data: st.DataObject) -> bytes:
    """A piece replaced, left out or repeated; sometimes by what nests."""
    first = data.draw(st.integers(0, len(whole)))
    last = min(len(whole), first + data.draw(st.integers(0, 40)))
    piece = data.draw(
        st.one_of(
            st.binary(max_size=12),
            st.sampled_from([b"[" * 60, b'{"a":' * 60, b"a." * 60, b'"', b"\n", b"1e999", b"-1", b"\0"]),
        )
    )
    return whole[:first] + piece * data.draw(st.integers(0, 3)) + whole[last:]


def refused_in_one_line(*arguments: object) -> None:
    """okid-report takes it (0), or says in one line why not (2)."""
    told = io.StringIO()
    with redirect_stderr(told):
        code = report([str(each) for each in arguments])
    assert code in (0, 2) and told.getvalue().count("\n") == (1 if code == 2 else 0), told.getvalue()


@settings(EXAMPLES, max_examples=10 * MORE)
@given(data=st.data())
def test_results(real: pathlib.Path, tmp_path: pathlib.Path, data: st.DataObject) -> None:
    whole = json.loads((real / "r.json").read_text())
    text = json.dumps(changed(whole, data)).encode("utf-8", "surrogatepass")
    (tmp_path / "r.json").write_bytes(text if data.draw(st.booleans()) else damaged(text, data))
    refused_in_one_line(tmp_path / "r.json", "--out", tmp_path / "r.html")
    with suppress(Error):
        write_result(tmp_path / "r.mat", read_result(tmp_path / "r.json"))


@settings(EXAMPLES, max_examples=10 * MORE)
@given(data=st.data())
def test_events(real: pathlib.Path, tmp_path: pathlib.Path, data: st.DataObject) -> None:
    lines = [json.loads(line) for line in (real / "e.jsonl").read_text().splitlines()]
    at = data.draw(st.integers(0, len(lines) - 1))
    lines[at] = changed(lines[at], data)
    text = "".join(json.dumps(line) + "\n" for line in lines).encode("utf-8", "surrogatepass")
    (tmp_path / "e.jsonl").write_bytes(text if data.draw(st.booleans()) else damaged(text, data))
    refused_in_one_line(real / "r.json", "--events", tmp_path / "e.jsonl", "--out", tmp_path / "r.html")


@settings(EXAMPLES, max_examples=10 * MORE)
@given(data=st.data())
def test_events_of_a_socket(real: pathlib.Path, data: st.DataObject) -> None:
    """The page goes on whatever a line holds: the lines behind it are shown."""
    session = Session(read_config(real / "a.toml"))
    lines = [json.loads(line) for line in (real / "e.jsonl").read_text().splitlines()][:20]
    for line in lines:
        session.line(json.dumps(line).encode())
        odd = json.dumps(changed(line, data)).encode("utf-8", "surrogatepass")
        session.line(odd if data.draw(st.booleans()) else damaged(odd, data))


@settings(EXAMPLES, max_examples=30 * MORE)
@given(data=st.data())
@pytest.mark.parametrize("name", ["a.toml", "spec.toml", "r.uff", "g.csv", "g.unv"])
def test_files(real: pathlib.Path, tmp_path: pathlib.Path, name: str, data: st.DataObject) -> None:
    (tmp_path / name).write_bytes(damaged((real / name).read_bytes(), data))
    readers = {"a.toml": (read_geometry, read_config), "spec.toml": (load_spec,), "r.uff": (read_uff,),
               "g.csv": (read_geometry,), "g.unv": (read_geometry,)}  # fmt: skip
    for reader in readers[name]:
        try:
            reader(tmp_path / name)
        except Error as fault:
            assert "\n" not in str(fault) and name in str(fault)
