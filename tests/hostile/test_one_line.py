# SPDX-License-Identifier: MIT
"""Numbers, texts and sizes that are absurd: exit 2 and one line, or okid's own error, never a traceback or a signal."""

from __future__ import annotations

import json
import math
import resource
import subprocess
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import okid
import pytest
from measured_run import Measured, measured
from okid import Error, InputError
from okid.campaign.command import main as campaign
from okid.campaign.record_list import list_records
from okid.campaign.spec import load_spec
from okid.campaign.sums_file import HEAD, GroupSums
from okid.data.input_file import parse_json, parse_toml
from okid.formats import read_geometry
from okid.report.command import main as report
from program import PROGRAM

DIGITS = "1" * 5000
CONFIG = """[acquisition]
rate_hz = 100.0
[[bus]]
name = "can0"
interface = "vcan0"
[[channel]]
name = "a"
role = "acceleration"
can_id = 256
start_bit = 0
length = 16
"""
SPEC = '[records]\nfiles = ["*.npy"]\n{more}[channels]\noutputs = ["a"]\nfs_hz = 100.0\n[group]\nby = ["day"]\n'


def one_line(done: Measured, *words: str) -> None:
    assert done.returncode == 2 and len(done.stderr.splitlines()) == 1, done
    assert all(word in done.stderr for word in words) and "Traceback" not in done.stderr, done.stderr


def result() -> dict[str, Any]:
    u, y = okid.demo_record()
    return okid.identify(u[:2000], y[:2000], fs=1000.0, method="okid-era", p=10, order=6).to_dict()


@pytest.fixture(scope="module")
def good() -> dict[str, Any]:
    return result()


WRONG_JSON = [
    (DIGITS, "a number of 5000 digits"), ("NaN", "found NaN"), ("Infinity", "found Infinity"),
    ("-Infinity", "found -Infinity"), ("1e999", "found 1e999"), ('"\\ud800"', "half of a letter"),
    ('{"\\udfff": 1}', "half of a letter"),
]  # fmt: skip


@pytest.mark.parametrize(("value", "words"), WRONG_JSON)
def test_numbers_and_halves_of_letters_in_json(
    tmp_path: Path, good: dict[str, Any], value: str, words: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(json.JSONDecodeError, match=words):
        parse_json(f'{{"a": [{value}]}}')
    for key in ("fs_hz", "samples", "modes", "outputs"):
        text = json.dumps({**good, key: "HERE"}).replace('"HERE"', value)
        (tmp_path / "r.json").write_text(text)
        assert report([str(tmp_path / "r.json"), "--out", str(tmp_path / "r.html")]) == 2
        said = capsys.readouterr().err
        assert said.count("\n") == 1 and "r.json:" in said and words in said, said
    text = json.dumps(good)
    assert parse_json(text) == json.loads(text)
    assert parse_json('["\\ud83d\\ude00", 1e300, 123456789012345678901234567890]')[0] == "\U0001f600"


@pytest.mark.parametrize("value", ["Infinity", "1e999", DIGITS, "1e300", '"x"', "[]"])
def test_the_track_of_a_mode(
    tmp_path: Path, good: dict[str, Any], value: str, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "r.json").write_text(json.dumps(good))
    mode = f'{{"track": {value}, "frequency_hz": 1.0, "damping_ratio": 0.01}}'
    (tmp_path / "e.jsonl").write_text(
        '{"type": "start", "t": 0}\n'
        f'{{"type": "modes", "t": 1.0, "modes": [{mode}]}}\n'
        '{"type": "stats", "t": 2}\n'
    )
    code = report([str(tmp_path / "r.json"), "--events", str(tmp_path / "e.jsonl"), "--out", str(tmp_path / "r.html")])
    said = capsys.readouterr().err
    assert code in (0, 2) and said.count("\n") == (code == 2), said
    assert code == 2 or value == "1e300"


def test_numbers_of_5000_digits_in_toml(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(ValueError, match="."):
        parse_toml(f"a = {DIGITS}")
    for number in ("0x" + "f" * 1000, "9" * 400, str(2**63), str(-(2**63) - 1)):  # tomllib takes them
        with pytest.raises(ValueError, match="64 bits"):
            parse_toml(f"a = [{{b = {number}}}]")
        (tmp_path / "g.toml").write_text(f"[geometry]\nnodes = [[0, 0, {number}]]\ndofs = [[1, 'x']]\n")
        with pytest.raises(InputError, match="64 bits"):
            read_geometry(tmp_path / "g.toml")
    assert parse_toml(f"a = {2**63 - 1}\nb = {-(2**63)}")["b"] == -(2**63)
    (tmp_path / "c.toml").write_text(CONFIG + f"[identification]\np = {DIGITS}\n")
    one_line(measured("check", tmp_path / "c.toml", within_s=60), "c.toml: line 13")
    (tmp_path / "SPEC.toml").write_text(SPEC.format(more="") + f"band_c = {DIGITS}\n")
    assert campaign(["check", str(tmp_path / "SPEC.toml")]) == 2
    assert capsys.readouterr().err.count("\n") == 1
    with pytest.raises(Error):
        okid.Session.from_config(tmp_path / "c.toml")


@pytest.mark.parametrize("when", ["inf", "-inf", "1e300", "253402300800", "-62135596801", "nonsense", "9" * 400])
def test_times_of_an_index(tmp_path: Path, when: str) -> None:
    np.save(tmp_path / "a.npy", np.zeros((4, 1)))
    np.save(tmp_path / "b.npy", np.zeros((4, 1)))
    (tmp_path / "i.csv").write_text(f"path,time\na.npy,{when}\nb.npy,1e9\n")
    (tmp_path / "SPEC.toml").write_text(SPEC.format(more='index = "i.csv"\n'))
    good, bad = list_records(load_spec(tmp_path / "SPEC.toml"))
    told = {one.name: one.reason for one in bad}
    assert "a.npy" in told and "its time in the index is" in told["a.npy"] and "\n" not in told["a.npy"]
    assert [one.name for one in good] == ["b.npy"] or when in ("nonsense", "9" * 400)  # a column of texts
    assert campaign(["check", str(tmp_path / "SPEC.toml")]) in (0, 2)


def sums(**changed: Any) -> bytes:
    header = {"group": "g", "lags": 3, "merged": False, "records": [], "left_out": [], "result": None, "parts": [],
              "refinement": 0}  # fmt: skip
    text = json.dumps({**header, **changed}).encode()
    return HEAD.pack(b"OKIDSUM1", len(text), zlib.crc32(text)) + text


HEADS: list[dict[str, Any]] = [
    {"group": 3}, {"group": None}, {"lags": "x"}, {"lags": None}, {"lags": math.inf}, {"records": 3},
    {"records": [3]}, {"records": [{}]}, {"records": [{"name": 3}]}, {"left_out": [[]]}, {"parts": 3},
    {"parts": [[1]]}, {"parts": [[0, -5]]}, {"parts": [["x", 0]]}, {"parts": [[0, 1e300]]}, {"result": 3},
    {"result": {}}, {"refinement": -1}, {"refinement": None}, {"refinement": "x"},
]  # fmt: skip


@pytest.mark.parametrize("changed", HEADS)
def test_headers_of_sums(changed: dict[str, Any]) -> None:
    """With a checksum that is right."""
    assert GroupSums.from_bytes(sums(), "x").group == "g"
    with pytest.raises(InputError, match="x: sums of a campaign are damaged"):
        GroupSums.from_bytes(sums(**changed), "x")
    for text in (b"[]", b"3", b"\xff", b"{", f'{{"group": {DIGITS}}}'.encode(), b"[" * 60):
        with pytest.raises(InputError, match="damaged"):
            GroupSums.from_bytes(HEAD.pack(b"OKIDSUM1", len(text), zlib.crc32(text)) + text, "x")


@pytest.mark.parametrize("key", ["fs_hz", "modes", "model", "singular_values", "fit"])
def test_nan_in_a_result(good: dict[str, Any], key: str) -> None:
    for value in (math.nan, math.inf, [math.nan], {"a": math.nan}):
        with pytest.raises(InputError, match="not a complete okid.result/1"):
            okid.Result.from_dict({**good, key: value})
    assert okid.Result.from_dict(good).fs_hz == good["fs_hz"]


@pytest.mark.parametrize("key", ["frequency_hz", "frequency_std_hz", "damping_ratio_std", "found_in", "mpc", "why"])
def test_a_mode_of_something_else(good: dict[str, Any], key: str) -> None:
    for value in ("x", [1], {"a": 1}, *([3.0] if key == "why" else [])):
        modes = [{**good["modes"][0], key: value}, *good["modes"][1:]]
        if key == "why" and not isinstance(value, float):
            assert okid.Result.from_dict({**good, "modes": modes}).modes[0].why == tuple(map(str, value))
            continue
        with pytest.raises(InputError, match="not a complete okid.result/1"):
            str(okid.Result.from_dict({**good, "modes": modes}).table())


ABSURD: list[tuple[str, Callable[[], Any]]] = [
    ("outputs", lambda: okid.Session(1, 10**9, fs=100.0)),
    ("inputs", lambda: okid.Session(2**70, 1, fs=100.0)),
    ("n_u", lambda: okid.Accumulator(2**32 + 1, 1, 5)),
    ("lags", lambda: okid.Accumulator(1, 1, 2**40)),
    ("n_y", lambda: okid.SquareRoot(1, 2**40, 5)),
    ("half", lambda: okid.Session(["\ud800"], ["a"], fs=100.0)),
]


@pytest.mark.parametrize(("what", "make"), ABSURD)
def test_sizes(what: str, make: Callable[[], Any]) -> None:
    """One billion outputs took all memory for their names."""
    with pytest.raises(Error) as told:
        make()
    assert "\n" not in str(told.value)


@pytest.mark.parametrize("method", ["auto", "okid-era"])
def test_gaps(method: str) -> None:
    """2**70 was taken as 0, three of 2**62 gave -4.6e18 missing samples."""
    with okid.Session(1, 2, fs=100.0, method=method) as session:
        for wrong in (2**70, 2**63, 2**62 + 1, -1, 1.5, None):
            with pytest.raises(InputError, match="count is"):
                session.gap(wrong)  # type: ignore[arg-type]
        session.gap(2**62)
        for _ in range(2):
            with pytest.raises(InputError, match="count: found 4611686018427387904, expected 0 to 0"):
                session.gap(2**62)
        assert session.stats.missing == 2**62
        session.gap(0)
    accumulator = okid.Accumulator(1, 2, 3)
    with pytest.raises(InputError, match="count is"):
        accumulator.gap(2**70)
    for _ in range(3):
        accumulator.gap(2**62)
    assert accumulator.stats.missing == 2**62


@pytest.mark.parametrize("state", [None, 3, "text", [1, 2], b"", b"x", bytes(100)])
def test_states_that_are_none(state: Any) -> None:
    with okid.Session(1, 2, fs=100.0) as session, okid.Accumulator(1, 2, 3) as accumulator:
        root = okid.SquareRoot(1, 2, 3)
        for use in (session.restore, session.merge, accumulator.restore, okid.Accumulator.from_bytes, root.restore):
            with pytest.raises(Error) as told:
                use(state)
            assert "\n" not in str(told.value)


def test_a_limit_of_the_size_of_files(tmp_path: Path) -> None:
    """SIGXFSZ ended okid replay."""
    (tmp_path / "c.toml").write_text(CONFIG)
    (tmp_path / "x.log").write_text("".join(f"({k / 100:.6f}) vcan0 100#{k % 251:02X}00\n" for k in range(5000)))
    for command in (
        ("replay", "x.log", "-c", "c.toml", "--events", "e.jsonl"), ("convert", "x.log", "x.csv", "-c", "c.toml"),
    ):  # fmt: skip
        done = subprocess.run(
            [PROGRAM, *command], capture_output=True, text=True, cwd=tmp_path, timeout=1800, check=False,
            preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (4096, 4096)),
        )  # fmt: skip
        assert done.returncode in (
            (2, 4) if command[0] == "convert" else (2, 3, 4)
        ), done  # 3: no model, which comes first
        assert command[0] == "replay" or "File too large" in done.stderr.splitlines()[-1], done
        assert not (tmp_path / "x.csv").exists()


def record_of(path: Path, y: Callable[[float, int], float]) -> Path:
    dice = np.random.default_rng(1)
    rows = "".join(f"{dice.standard_normal()},{y(float(dice.standard_normal()), k)!r}\n" for k in range(3000))
    path.write_text("# fs_hz: 100\nu,y\n" + rows)
    return path


MESSAGES: list[tuple[str, int, Callable[[float, int], float], str]] = [
    ("impulse", 3, lambda _, k: float(k == 100), "is constant (1) where it was not screened"),
    ("clipped", 3, lambda x, _: max(-1.0, min(1.0, x)), "no run of any method was possible"),
    ("1e300", 2, lambda _, k: 1e300, "is 1e+300 at sample 0 (from 0), expected less than 1e+30"),
    ("constant", 3, lambda _, k: 3.0, "is constant (3): it measures nothing"),
]


@pytest.mark.parametrize(("what", "code", "y", "words"), MESSAGES)
def test_messages_name_the_cause(
    tmp_path: Path, what: str, code: int, y: Callable[[float, int], float], words: str
) -> None:
    """An impulse was "constant (1)", 1e300 "constant", clipping at one sigma gave "none of 0 runs"."""
    done = measured("identify", record_of(tmp_path / "x.csv", y), "--inputs", "u", "--outputs", "y", within_s=300)
    assert done.returncode == code and len(done.stderr.splitlines()) == 1 and words in done.stderr, done


def test_a_force_of_one_frequency(tmp_path: Path) -> None:
    """All samples are there, and it said that too few of them were."""
    dice = np.random.default_rng(1)
    force = np.sin(2 * np.pi * 5 * np.arange(6000) / 100)
    rows = np.column_stack([force, np.roll(force, 3) + 0.01 * dice.standard_normal(6000)])
    np.savetxt(tmp_path / "x.csv", rows, delimiter=",", header="# fs_hz: 100\nu,y", comments="")
    done = measured("identify", tmp_path / "x.csv", "--inputs", "u", "--outputs", "y", within_s=300)
    assert done.returncode == 3 and "a force has too few frequencies" in done.stderr, done


@pytest.mark.parametrize("part", ["re", "im"])
def test_frequency_responses_of_one_part(tmp_path: Path, part: str) -> None:
    """Real parts alone were taken for responses."""
    rows = "".join(f"{k},{1 / (1 + k)}\n" for k in range(100))
    (tmp_path / "x.csv").write_text(f'frequency_hz,"a/f:{part}"\n' + rows)
    done = measured("identify", "--frf", tmp_path / "x.csv", within_s=120)
    one_line(done, "a/f has not both of its two parts", "OUT/IN:re and OUT/IN:im")


@pytest.mark.parametrize("picks", [["x"], [10**400], [None], 5, {"a": 1}, Path("a\0.json"), "a\0.json", object()])
def test_picks_that_are_none(picks: Any) -> None:
    u, y = okid.demo_record()
    with pytest.raises(InputError, match="^picks is "):
        okid.identify(u, y, fs=1000.0, picks=picks)


def test_halves_of_letters_in_options() -> None:
    u, y = okid.demo_record()
    for option in ({"method": "\ud800"}, {"input_names": ["\udfff"]}, {"picks": "\ud800.json"}):
        with pytest.raises(InputError, match="half of a letter"):
            okid.identify(u, y, fs=1000.0, **option)  # type: ignore[arg-type]
    with pytest.raises(InputError, match="half of a letter"):
        okid.Session(1, 1, fs=100.0, method="\ud800")
    assert okid.Session(["\U0001f600"], ["\\ud800"], fs=100.0).inputs == ["\U0001f600"]


def test_a_result_of_very_many_modes(tmp_path: Path, good: dict[str, Any]) -> None:
    """The work grows with the cube of their number."""
    (tmp_path / "a.json").write_text(json.dumps(good))
    (tmp_path / "b.json").write_text(json.dumps({**good, "modes": good["modes"][:1] * 5001}))
    for command in (("compare",), ("merge", "--json", tmp_path / "m.json")):
        one_line(
            measured(*command, tmp_path / "a.json", tmp_path / "b.json", within_s=1800),
            "found 5001, expected at most 5000",
        )


POLES = dict.fromkeys(("run", "order", "frequency_hz", "damping_ratio", "mpc", "mode"), [0])
WRONG_AGREEMENTS: list[Any] = [
    [], {}, "x", {"runs": 3, "poles": {}}, {"runs": [{}], "poles": POLES},
    {"runs": [], "poles": POLES}, {"runs": [{"method": "a", "fs_hz": 1, "rows": 1}], "poles": {**POLES, "mpc": [1, 2]}},
    {"runs": [{"method": "a", "fs_hz": 1, "rows": 1}], "poles": {**POLES, "frequency_hz": ["</script>"]}},
    {"runs": [{"method": "a", "fs_hz": 1, "rows": 1}], "poles": {**POLES, "run": [0.5]}},
]  # fmt: skip


@pytest.mark.parametrize("value", WRONG_AGREEMENTS)
def test_poles_of_a_result(
    tmp_path: Path, good: dict[str, Any], value: Any, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "r.json").write_text(json.dumps({**good, "agreement": value}))
    assert report([str(tmp_path / "r.json"), "--out", str(tmp_path / "r.html")]) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1 and "agreement" in said, said


@pytest.mark.parametrize("far", [1e300, -5e9])
def test_nodes_beyond_the_moon(tmp_path: Path, far: float) -> None:
    (tmp_path / "g.csv").write_text(f"node,1,0,0,0\nnode,2,0,{far},0\nsensor,a,1,z\n")
    (tmp_path / "g.toml").write_text(f'[geometry]\nnodes = [[0, 0, 0], [0, {far}, 0]]\ndofs = [[1, "x"]]\n')
    numbers = "".join(f"{k:>10}{0:>10}{0:>10}{11:>10}{x:>13}{0.0:>13}{0.0:>13}\n" for k, x in ((1, 0.0), (2, far)))
    (tmp_path / "g.uff").write_text(f"    -1\n    15\n{numbers}    -1\n")
    for name in ("g.csv", "g.toml", "g.uff"):
        with pytest.raises(InputError, match=f"{name}: node 2 is at .* expected coordinates of at most 1e"):
            read_geometry(tmp_path / name)
