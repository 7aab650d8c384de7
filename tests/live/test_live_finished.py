# SPDX-License-Identifier: MIT
"""The page of what is over: results with records, records to identify, logs and journals; how it is asked, by whom."""

from __future__ import annotations

import csv
import http.client
import json
import os
import re
import shlex
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any
from urllib.parse import quote

import beam
import numpy as np
import pytest
from event_source import Listener, ask
from live_process import Live, post
from okid.data.records import read_csv
from okid.formats.geometry_file import read_geometry
from okid.live import desk as desks
from okid.live import main
from okid.live.child import Child, Failed
from okid.live.config import PageConfig
from okid.live.desk import Desk, identify_options, proposed, spec_of
from okid.live.session import Session
from okid.live.tracks import Tracks
from program import okid
from two_masses import rig_text, simulate_rig


@pytest.fixture(scope="module")
def rig(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Twelve seconds of two masses: a.log and a.toml, the journal a.okj, the table t.csv and its result r.json."""
    folder = simulate_rig(tmp_path_factory.mktemp("over"), rig_text(12.0, 500.0), lags=20)
    okid("convert", folder / "a.log", folder / "t.csv", "-c", folder / "a.toml", status=0)
    okid("convert", folder / "a.log", folder / "a.okj", "-c", folder / "a.toml", status=0)
    columns = ("--inputs", "force1", "--outputs", "acc1,acc2", "--p", "20")
    okid("identify", folder / "t.csv", *columns, "--json", folder / "r.json", status=0)
    return folder


def until_over(live: Live) -> dict[str, Any]:
    """What a page knows once the result is there: `facts`, `modes` (the last), `result`, `columns` of the lanes."""
    page, seen = Listener(live.port), {"columns": 0}
    for kind, content in page.events():
        if kind == "hello":
            seen.update(facts=content["facts"], modes=content["modes"], result=content["result"], log=content["log"])
        elif kind == "lanes":
            seen["columns"] = max(seen["columns"], content["first"] + content["count"])
        elif kind in ("modes", "result"):
            seen[kind] = content
        elif kind == "state":
            assert content["link"] != "failed", seen
        if seen.get("result") and seen["columns"] + 1 >= 1200:
            page.close()
            return seen
    raise AssertionError("the stream ended")


def frequencies(modes: list[dict[str, Any]]) -> list[float]:
    return [mode["frequency_hz"] for mode in modes]


def test_a_result_with_its_record(rig: Path, okid_live: Callable[..., Live]) -> None:
    live = okid_live(rig / "r.json", "--record", rig / "t.csv")
    seen = until_over(live)
    assert [(one["name"], one["role"]) for one in seen["facts"]["channels"]] == [
        ("force1", "force"), ("acc1", "response"), ("acc2", "response"),
    ]  # fmt: skip
    assert seen["facts"]["rate_hz"] == 500.0 and seen["facts"]["length_s"] == 12.0
    assert frequencies(seen["result"]["modes"]) == frequencies(json.loads((rig / "r.json").read_text())["modes"])
    spectra = json.loads(ask(live.port, "/spectra?channels=0,1")[2])
    assert spectra["averages"] > 3 and "model" in spectra["response"]
    status, page = post(live, "/report", {})
    assert status == 200 and page.startswith(b"<!DOCTYPE html>") and b"t.csv" in page
    assert live.end() == (0, "")


def test_hits_of_a_roving_hammer_show_their_signals(tmp_path: Path, okid_live: Callable[..., Live]) -> None:
    """The force moves from place to place: it is a lane, and there is no response to it."""
    rng = np.random.default_rng(7)
    hits = {f"P{place}_1.csv": beam.record(beam.Hit(place, 100.0, 0.0015), rng, 0.002) for place in (1, 2, 3)}
    files = beam.write(tmp_path, hits)
    names = ("--inputs", "Hammer", "--outputs", "Acc1,Acc2", "--places", r"P(\d+)_", "--json", tmp_path / "r.json")
    okid("identify", *files, *names, status=0)
    live = okid_live(tmp_path / "r.json", "--record", *files)
    page, columns = Listener(live.port), 0
    for kind, content in page.events():
        if kind == "hello":
            channels = content["facts"]["channels"]
        elif kind == "lanes":
            columns = max(columns, content["first"] + content["count"])
        if columns > 2 * beam.SECONDS * 100:
            break
    page.close()
    assert [(one["name"], one["role"], one["dof"]) for one in channels] == [
        ("Hammer", "aux", None), ("Acc1", "response", None), ("Acc2", "response", None),
    ]  # fmt: skip
    spectra = json.loads(ask(live.port, "/spectra?channels=0,1")[2])
    assert spectra["averages"] > 1 and not spectra.get("response")
    assert live.end() == (0, "")


GEOMETRY = "node,1,0,0,2\nnode,2,0,0,1\nnode,7,0,0,0\nline,1,2\nline,2,7\nsensor,acc2,1,x\nsensor,acc1,2,-x\nfixed,7\n"


def test_a_geometry_is_drawn_from_a_table(rig: Path, tmp_path: Path, okid_live: Callable[..., Live]) -> None:
    """Typed on the page of a finished result; the TOML that is answered gives the same structure."""
    live = okid_live(rig / "r.json", "--record", rig / "t.csv")
    assert until_over(live)["facts"]["geometry"] is None
    for table in ("", 3, "node,1,0,0", "node,1,0,0,0\nsensor,other,1,x", "node,1,0,0,0\nline,1,2"):
        status, said = post(live, "/geometry", {"table": table})
        assert status == 422 and said.count(b"\n") == 1 and b"table" in said and b"/" not in said
    status, said = post(live, "/geometry", {"table": GEOMETRY})
    assert status == 200, said
    shown = until_over(live)["facts"]["geometry"]
    assert shown["nodes"] == [[0, 0, 2], [0, 0, 1], [0, 0, 0]] and shown["lines"] == [[1, 2], [2, 3]]
    assert shown["dofs"] == [[2, "-x"], [1, "x"]] and shown["fixed"] == [3]  # of acc1, of acc2
    toml = json.loads(said)["toml"]
    channels = re.findall(r'# \[\[channel\]\] "(\w+)": dof = (-?\d+)', toml)
    toml += "".join(f'\n[[channel]]\nname = "{name}"\ndof = {dof}\n' for name, dof in channels)
    (tmp_path / "g.toml").write_text(toml)
    (tmp_path / "g.csv").write_text(GEOMETRY)
    one, other = read_geometry(tmp_path / "g.toml"), read_geometry(tmp_path / "g.csv")
    names = ["acc1", "acc2"]
    assert (one.nodes, one.lines, one.fixed) == (other.nodes, other.lines, other.fixed)
    assert one.places(names) == other.places(names) == [(2, "-x"), (1, "x")]
    assert b"geometry.csv" in post(live, "/report", {})[1] and live.end() == (0, "")


def test_records_are_identified_by_the_program(rig: Path, okid_live: Callable[..., Live]) -> None:
    columns = ("--inputs", "force1", "--outputs", "acc1,acc2")
    live = okid_live(rig / "t.csv", *columns, "--", "--p", "20")
    seen = until_over(live)
    assert frequencies(seen["result"]["modes"]) == frequencies(json.loads((rig / "r.json").read_text())["modes"])
    assert seen["facts"]["config"] == "t.csv" and seen["facts"]["start"] is False
    assert live.end() == (0, "")


@pytest.mark.parametrize("what", ["log", "journal"])
def test_a_replay_has_every_sample_and_every_update(rig: Path, okid_live: Callable[..., Live], what: str) -> None:
    okid("replay", rig / "a.okj", "--events", rig / "e.jsonl", "--quiet", status=0)
    events = [json.loads(line) for line in (rig / "e.jsonl").read_text().splitlines()]
    updates = [event for event in events if event["type"] == "modes"]
    live = okid_live(*([rig / "a.log", "-c", rig / "a.toml"] if what == "log" else [rig / "a.okj"]))
    seen = until_over(live)
    assert seen["columns"] == 1200 and seen["facts"]["title"] == "virtual rig"
    assert frequencies(seen["result"]["modes"]) == frequencies(events[-1]["result"]["modes"])
    for t in (3.0, 6.4, 11.0):
        then = json.loads(ask(live.port, f"/modes?t={t}")[2])
        wanted = [event for event in updates if event["t"] <= t][-1]
        assert then == wanted
    assert json.loads(ask(live.port, "/modes?t=0.1")[2]) is None and ask(live.port, "/modes?t=x")[0] == 400
    status, page = post(live, "/report", {})
    assert status == 200 and b"tracking" in page.lower()
    assert live.end() == (0, "")


def test_a_replay_opens_no_listener_and_runs_no_command(
    rig: Path, tmp_path: Path, okid_live: Callable[..., Live]
) -> None:
    text = (rig / "a.toml").read_text().replace('"a.dbc"', json.dumps(str(rig / "a.dbc")))
    (tmp_path / "b.toml").write_text(text + '\n[publish]\nsocket = "s"\nudp = "127.0.0.1:9"\n')
    live = okid_live(rig / "a.log", "-c", tmp_path / "b.toml")
    until_over(live)
    assert not (tmp_path / "s").exists() and live.end() == (0, "")


def test_a_large_record_is_read_while_the_page_is_there(
    rig: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """One that is not of the result ends the page with the same line."""
    monkeypatch.setattr("okid.live.finished.LARGE_BYTES", 10)
    monkeypatch.chdir(rig)
    (rig / "a.csv").write_text("# fs_hz: 500\nother,names\n1,2\n3,4\n")
    assert main(["r.json", "--record", "a.csv", "--port", "0"]) == 2
    out, errors = capsys.readouterr()
    assert "http://" in out and "a.csv" in errors and errors.count("\n") == 1


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["no.json"], "no.json: No such file"),
        (["t.csv"], "by their names perhaps --inputs force1 --outputs acc1,acc2"),
        (["t.csv", "--outputs", "acc1", "-c", "a.toml"], "-c is not an option of records"),
        (["a.log"], "a log needs the config it was measured with: -c CONFIG.toml"),
        (["a.okj", "-c", "a.toml"], "a journal holds its own config"),
        (["r.json", "--record", "a.toml"], "a.toml: is a CONFIG.toml"),
        (["r.json", "--record", "a.csv"], "a.csv"),
        (["r.json", "t.csv"], "t.csv: found a second file, expected one result"),
        (["a.dbc", "--outputs", "x"], "a.dbc: is a DBC, expected the record"),
        (["--inputs", "f"], "--inputs is not an option of the start page"),
        (["--host", "0.0.0.0"], "the start page reads files by their names"),
    ],
)  # fmt: skip
def test_what_is_wrong_is_one_line_before_anything_is_served(
    rig: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], arguments: list[str], said: str
) -> None:
    monkeypatch.chdir(rig)
    (rig / "a.csv").write_text("# fs_hz: 500\nother,names\n1,2\n3,4\n")
    assert main([*arguments, "--port", "0"]) == 2
    out, errors = capsys.readouterr()
    assert out == "" and said in errors and errors.startswith("okid-live: ") and errors.count("\n") == 1


def test_a_failed_identification_ends_with_what_okid_said(rig: Path, okid_live: Callable[..., Live]) -> None:
    live = okid_live(rig / "t.csv", "--inputs", "force1", "--outputs", "nothing")
    errors = live.process.communicate(timeout=1800)[1]
    assert live.process.returncode == 2 and 'no column "nothing"' in errors and errors.count("\n") == 1


# -- who may ask ------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def start(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Live]:
    live = Live()
    yield live
    assert live.end() == (0, "")


WISHES = ("/report", "/geometry", "/look", "/identify", "/open", "/propose", "/run", "/end", "/upload?name=a.csv")


@pytest.mark.parametrize("path", WISHES)
def test_nobody_without_the_key_is_heard(start: Live, path: str) -> None:
    assert len(start.token) >= 32
    for token in ("", "x", start.token[:-1], start.token + "x", "é"):
        assert post(start, path, {}, token)[0] == 403
    assert post(start, path, {}, Host="evil.example")[0] == 403
    for method in ("GET", "PUT", "DELETE", "OPTIONS"):
        assert ask(start.port, path, method)[0] in (404, 405)
    page = Listener(start.port)
    assert start.token not in json.dumps(page.event())
    page.close()


def test_keys_differ_and_a_page_of_a_run_takes_no_files(start: Live, rig: Path, okid_live: Callable[..., Live]) -> None:
    live = okid_live(rig / "r.json")
    assert live.token != start.token
    for path in WISHES[2:]:
        assert post(live, path, {"path": str(rig / "t.csv")})[0] == 405


@pytest.mark.parametrize(
    "body",
    [b"", b"{", b"[]", b"1", b'{"files": 1}', b'{"files": ["/no/such"], "outputs": ["a"]}', b'{"files": [{}]}',
     b'{"files": ["\\u0000"]}', b"[" * 5000, b'{"outputs": [' + b'"a",' * 5000 + b'"a"]}', b"\xff"],
)  # fmt: skip
def test_damaged_wishes_are_refused(start: Live, body: bytes) -> None:
    for path in ("/identify", "/look", "/open", "/propose", "/run", "/end"):
        status, said = post(start, path, body)
        assert status in (400, 422) and said.count(b"\n") == 1, said


def test_wishes_are_bounded(start: Live) -> None:
    link = http.client.HTTPConnection("127.0.0.1", start.port, timeout=1800)
    for path, length in (
        ("/look", str(64 << 20)),
        ("/look", "-1"),
        ("/look", "x"),
        ("/upload?name=a.csv", str(1 << 60)),
    ):
        link.putrequest("POST", path)
        link.putheader("X-Okid-Token", start.token)
        link.putheader("Content-Length", length)
        link.endheaders()
        reply = link.getresponse()
        assert reply.status in (400, 422), reply.read()
        link.close()


def test_dropped_files_stay_in_a_private_folder(start: Live, rig: Path) -> None:
    data = (rig / "t.csv").read_bytes()
    for name in ("t.csv", "../../t.csv", "/etc/t.csv", "-t.csv", "..", "%00", "a\\..\\t.csv", "x" * 500 + ".csv"):
        status, said = post(start, f"/upload?name={quote(name)}", data)
        assert status == 200, said
        path = Path(json.loads(said)["path"])
        assert path.read_bytes() == data and path.name[0] not in "-." and path.parent.name.startswith("job-")
        private = path.parent.parent
        assert private.name.startswith("okid-live-") and private.stat().st_mode & 0o777 == 0o700
    seen = json.loads(post(start, "/look", {"path": str(path)})[1])
    assert seen["kind"] == "record" and seen["samples"] == 6000


def test_a_file_named_like_an_option(rig: Path, tmp_path: Path, okid_live: Callable[..., Live]) -> None:
    """`--json=...` is a file's name here, never an option; the folder is the one okid-live stands in."""
    odd = tmp_path / "--json=x.csv"
    odd.write_bytes((rig / "t.csv").read_bytes())
    here = os.getcwd()
    os.chdir(tmp_path)
    try:
        live = okid_live()
    finally:
        os.chdir(here)
    wish = {"files": [odd.name], "inputs": ["force1"], "outputs": ["acc1", "acc2"], "method": "okid-era"}
    status, said = post(live, "/identify", wish)
    made = json.loads(said)
    assert status == 200 and str(odd) in made["command"] and sorted(p.name for p in tmp_path.iterdir()) == [odd.name]
    seen = until_over(live)
    assert seen["facts"]["config"] == odd.name and seen["facts"]["start"] is True
    dropped = Path(json.loads(post(live, "/upload?name=a.csv", b"1")[1])["path"])
    assert dropped.exists() and live.end() == (0, "") and not dropped.parent.parent.exists()


# -- the start page's words -------------------------------------------------------------------------------------------


@pytest.fixture
def desk(tmp_path: Path) -> Desk:
    (tmp_path / "private").mkdir()
    return Desk(Session(PageConfig(Path(), None, False, "")), tmp_path / "private", start=True)


def test_what_was_named_is_said(desk: Desk, rig: Path, tmp_path: Path) -> None:
    (tmp_path / ".hidden").touch()
    assert desk.look({"path": str(rig)})["kind"] == "folder" and "t.csv" in desk.look({"path": str(rig)})["files"]
    assert desk.look({"path": str(tmp_path)})["files"] == []
    seen = desk.look({"path": str(rig / "t.csv")})
    assert [(one["name"], one["side"], one["unit"]) for one in seen["channels"]] == [
        ("force1", "inputs", "N"), ("acc1", "outputs", "m/s^2"), ("acc2", "outputs", "m/s^2"),
    ]  # fmt: skip
    kinds = {name: desk.look({"path": str(rig / name)})["kind"] for name in ("a.log", "a.okj", "r.json", "a.toml")}
    assert kinds == {"a.log": "log", "a.okj": "journal", "r.json": "result", "a.toml": "config"}
    for bus, serial in (("can0", False), ("/dev/ttyACM0", True)):
        assert desk.look({"path": bus}) == {"kind": "bus", "path": bus, "serial": serial}
    for wrong, said in (("", "no file was named"), ("/no/such", "no such file"), (str(rig / "a.dbc"), "is a DBC")):
        with pytest.raises(desks.InputError, match=said):
            desk.look({"path": wrong})


def test_command_and_toml_do_the_same(rig: Path, tmp_path: Path) -> None:
    fields = {"inputs": ["force1"], "outputs": ["acc1", "acc2"], "method": "okid-era", "fs": "500"}
    options = identify_options({**fields, "input_dofs": "-1", "output_dofs": "1,2"})
    assert options == ["--inputs=force1", "--outputs=acc1,acc2", "--fs=500", "--method=okid-era", "--input-dofs=-1",
                       "--output-dofs=1,2"]  # fmt: skip
    assert identify_options({"outputs": ["a,b"]}) == ['--outputs="a,b"']
    record = read_csv(rig / "t.csv")
    assert proposed(record) == ["inputs", "outputs", "outputs"]
    odd = tmp_path / "a [1].csv"
    odd.write_bytes((rig / "t.csv").read_bytes())
    (tmp_path / "s.toml").write_text(spec_of(fields, [odd], record.fs_hz), encoding="utf-8")
    from okid.campaign.spec import load_spec

    spec = load_spec(tmp_path / "s.toml")
    assert spec.channels.fs_hz == 500.0 and list(spec.channels.outputs) == ["acc1", "acc2"]


def test_a_second_subject_replaces_the_first(start: Live, rig: Path) -> None:
    assert post(start, "/open", {"path": str(rig / "r.json"), "records": [str(rig / "t.csv")]})[0] == 200
    first = until_over(start)
    status, said = post(start, "/open", {"path": str(rig / "a.log"), "config": str(rig / "a.toml")})
    assert status == 200 and "-c " in json.loads(said)["command"]
    assert first["facts"]["config"] == "r.json" and until_over(start)["facts"]["config"] == "a.log"
    assert post(start, "/open", {"path": str(rig / "a.log")})[0] == 422


# -- the parts --------------------------------------------------------------------------------------------------------


def test_a_program_is_watched_and_ended(tmp_path: Path) -> None:
    stages: list[str] = []
    lines: list[str] = []
    script = tmp_path / "tells"
    stage = "printf '\\rokid: 2 s, reading a, 40 %%, 3 s left   \\r' >&2"
    script.write_text(f"#!/bin/sh\n{stage}\necho line\necho 'okid: bad' >&2\nexit $1\n")
    script.chmod(0o755)
    Child().run([str(script), "0"], stages.append, lines.append)
    assert stages == ["reading a, 40 %, 3 s left"] and lines == ["line\n"]
    with pytest.raises(Failed, match="bad"):
        Child().run([str(script), "2"], stages.append)
    with pytest.raises(Failed, match="cannot be run"):
        Child().run([str(tmp_path / "none")], stages.append)
    waits = Child()
    (tmp_path / "waits").write_text("#!/bin/sh\necho ready\nexec cat /dev/zero > /dev/null\n")
    (tmp_path / "waits").chmod(0o755)
    with pytest.raises(Failed, match="stopped"):
        waits.run([str(tmp_path / "waits")], stages.append, lambda _line: waits.stop())
    with pytest.raises(Failed, match="stopped"):
        waits.run([str(script), "0"], stages.append)


@pytest.mark.parametrize("names", [["Last [N]", "a1", "f2", "x", "T [degC]", "b [g]"], ["f1", "F'2", "acc,3", "out"]])
def test_what_is_proposed_is_what_okid_identify_says(tmp_path: Path, names: list[str]) -> None:
    """The page has it as data, the program in a sentence."""
    table = tmp_path / "n.csv"
    head = ",".join(f'"{name}"' for name in names)
    table.write_text(f"# fs_hz: 10\n{head}\n" + "1,2,3,4,5,6\n"[: 2 * len(names) - 1] + "\n", encoding="utf-8")
    sides = dict(zip(names, proposed(read_csv(table)), strict=True))
    said = okid("identify", table, status=2).stderr.rpartition("; by their names perhaps ")[2]
    typed = dict(zip(*[iter(shlex.split(said))] * 2, strict=True))
    for side in ("inputs", "outputs"):
        assert next(csv.reader([typed[f"--{side}"]])) == [name for name, own in sides.items() if own == side]


def test_modes_of_any_time_stay_within_bounds() -> None:
    def event(t: float) -> dict[str, Any]:
        return {"type": "modes", "t": t, "modes": [{"track": 1, "frequency_hz": t}], "settled": True}

    tracks = Tracks(most=100)
    for k in range(1, 1001):
        tracks.add(event(float(k)))
    kept = [update["t"] for update in tracks.updates]
    assert len(kept) <= 100 and kept[-1] == 1000.0 and len(tracks._events) == len(kept)
    for t in (kept[0], kept[40], 1000.0, 5000.0):
        assert tracks.at(t) == event(max(x for x in kept if x <= t))
    assert tracks.at(kept[0] - 0.5) is None
    small = Tracks(most_bytes=2000)
    for k in range(1, 200):
        small.add(event(float(k)))
    assert small._bytes <= 2000 and small.at(1e9) == event(199.0)
    assert small._bytes == sum(map(len, small._events.values()))


def test_lanes_of_a_long_record_fit_a_page() -> None:
    from okid.live.hub import MOST_BYTES
    from okid.live.measured import Measured
    from okid.live.run_state import Channel

    channels = [Channel(f"c{k}", "response", "", None) for k in range(40)]
    measured = Measured(channels, 1000.0, PageConfig(Path(), None, True, "", length_s=36000.0))
    assert measured.envelope.capacity * measured.envelope.width >= 36000.0 * 1000.0
    assert measured.envelope.capacity * 40 * 9 * 4 / 3 < MOST_BYTES
    assert np.isfinite(measured.envelope.width)
