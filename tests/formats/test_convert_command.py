# SPDX-License-Identifier: MIT
"""okid-convert as a user types it."""

from __future__ import annotations

import hashlib
import json
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import okid
import pytest
import pyuff
from can_frames import plain_frames
from okid.data.records import Record
from okid.formats import read_record, write_csv, write_log
from okid.formats.command import main
from okid.formats.hdf5 import read_hdf5_result
from program import okid as okid_program
from sample_records import full_record, identified, shaken_frame

GEOMETRY = """
[geometry]
nodes = [[0, 0, 1], [0, 0, 2], [0, 0, 3]]
dofs = [[1, "x"], [2, "x"], [3, "x"]]
lines = [[1, 2]]
"""
RIG = """
rate_hz = 250.0
duration_s = 8
masses = [1.0]
springs = [3e4]
zeta = [0.02]
force_dofs = [1]
sense_dofs = [1]
sensing = "acceleration"
excitation = "white"
"""


def test_one_record_round_all_formats(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write_csv(tmp_path / "0.csv", full_record())
    digest = hashlib.sha256((tmp_path / "0.csv").read_bytes()).hexdigest()
    chain = ["0.csv", "1.mf4", "2.h5", "3.mat", "4.parquet", "5.hdf5", "6.uff", "7.csv"]
    for one, other in zip(chain, chain[1:], strict=False):
        assert main([str(tmp_path / one), str(tmp_path / other)]) == 0
    shown = capsys.readouterr()
    assert f"{tmp_path / '7.csv'}: 400 samples x 4 channels, 1024 Hz" in shown.out
    assert "note: not kept in a universal file: note 'operator', note 'structure'" in shown.err
    np.testing.assert_array_equal(read_record(tmp_path / "7.csv").samples, full_record().samples)
    notes = read_record(tmp_path / "5.hdf5").notes
    assert (notes["source"], notes["source_sha256"], notes["operator"]) == ("0.csv", digest, "Ä. Müller")


def test_channels_rate_and_force(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    given, out = str(tmp_path / "a.csv"), str(tmp_path / "b.uff")
    write_csv(given, Record(["a", "b", "c"], np.arange(30.0).reshape(10, 3), None, ["N", "", "g"]))
    assert main([given, out]) == 2
    assert "b.uff: a universal file needs a sample rate and the record has none: give fs_hz" in capsys.readouterr().err
    assert main([given, out, "--fs", "50", "--channels", "c, a"]) == 0
    record = read_record(out)
    assert (record.names, record.units, record.fs_hz) == (["c", "a"], ["g", "N"], 50.0)
    assert main([given, out, "--fs", "20"]) == 2
    assert f"{out}: is there already: give --force to replace it" in capsys.readouterr().err
    assert main([given, out, "--fs", "20", "--force"]) == 0
    assert read_record(out).fs_hz == 20.0
    capsys.readouterr()
    assert main([given, given, "--force"]) == 2
    assert f"{given}: IN and OUT are the same file: name another OUT" in capsys.readouterr().err


def test_a_result_into_every_format(tmp_path: Path) -> None:
    result = identified()
    result.save(tmp_path / "r.json")
    (tmp_path / "c.toml").write_text(GEOMETRY, encoding="utf-8")
    for name in ("r.h5", "r.mat"):
        assert main([str(tmp_path / "r.json"), str(tmp_path / name)]) == 0
    assert main([str(tmp_path / "r.json"), str(tmp_path / "r.uff"), "--geometry", str(tmp_path / "c.toml")]) == 0
    assert read_hdf5_result(tmp_path / "r.h5") == json.loads((tmp_path / "r.json").read_text())
    kinds = pyuff.UFF(str(tmp_path / "r.uff")).get_set_types().tolist()
    assert kinds == [151, 164, 15, 82, 55, 55, 55, 58, 58, 58]


def test_logs_both_ways_and_replayed(tmp_path: Path) -> None:
    (tmp_path / "rig.toml").write_text(RIG, encoding="utf-8")
    names = {"--log": "a.log", "--truth": "t.json", "--config": "c.toml", "--dbc": "a.dbc"}
    options = [part for option, name in names.items() for part in (option, tmp_path / name)]
    assert okid_program("simulate", tmp_path / "rig.toml", *options).returncode == 0
    assert main([str(tmp_path / "a.log"), str(tmp_path / "b.blf")]) == 0
    assert main([str(tmp_path / "b.blf"), str(tmp_path / "c.can.csv")]) == 0
    assert main([str(tmp_path / "c.can.csv"), str(tmp_path / "d.mf4")]) == 0
    assert main([str(tmp_path / "d.mf4"), str(tmp_path / "e.log")]) == 0
    modes = []
    for name in ("a.log", "e.log"):
        done = okid_program("replay", tmp_path / name, "-c", tmp_path / "c.toml", "--json", "-")
        assert done.returncode == 0, done.stderr
        modes.append(json.loads(done.stdout)["modes"])
    assert modes[0] == modes[1]


@pytest.mark.parametrize(
    ("source", "target", "options", "words"),
    [
        (
            "a.log",
            "b.csv",
            [],
            r"a.log holds CAN frames .* so give --config CONFIG.toml .*OUT.can.csv",
        ),
        ("r.csv", "b.h5", ["--config", "c.toml"], "--config says which bits of CAN frames"),
        ("r.csv", "b.wav", [], "b.wav: the extension is '.wav', expected one of"),
        ("r.csv", "b.blf", [], "r.csv holds samples and .* so okid convert IN.csv OUT.log -c CONFIG.toml"),
        ("r.csv", "b.xyz", [], "b.xyz: the extension is '.xyz', expected one of"),
        ("r.csv", "b.okj", [], "a journal is read and written by the program: okid convert"),
        ("r.csv", "b.json", [], "b.json: the extension is '.json'"),
        ("none.csv", "b.h5", [], "none.csv: No such file or directory"),
        ("r.csv", "b.h5", ["--channels", "shaker,x"], "no column 'x'; it has shaker"),
        ("r.csv", "b.h5", ["--fs", "-1"], "sample rate is -1.0"),
        ("r.csv", "b.h5", ["--group", "2"], "group '2' asked for, but this format has no groups"),
        ("r.csv", "b.h5", ["--geometry", "c.toml"], "--geometry is for an identified model"),
        ("a.log", "b.blf", ["--fs", "5"], "--fs is for samples, .*a.log holds CAN frames"),
        ("r.json", "b.csv", [], "b.csv: an identified model is written as one of .uff"),
        ("r.json", "b.mat", ["--channels", "a"], "--channels is for samples"),
        ("bad.json", "b.mat", [], "bad.json:1:2: not JSON"),
        ("old.json", "b.mat", [], "old.json: schema is 'okid.result/0', expected 'okid.result/1'"),
        ("half.json", "b.mat", [], "half.json: key 'fs_hz' is missing"),
        ("thin.json", "b.mat", [], "not a complete okid.result/1"),
    ],
)
def test_refusals(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], source: str, target: str, options: list[str], words: str
) -> None:
    write_csv(tmp_path / "r.csv", full_record(9))
    write_log(tmp_path / "a.log", plain_frames(5))
    write_log(tmp_path / "a.blf", plain_frames(5))
    identified().save(tmp_path / "r.json")
    thin = {"schema": "okid.result/1", "fs_hz": 1, "inputs": [], "outputs": ["a"], "model": {}, "modes": []}
    for name, text in (("bad", "{"), ("old", '{"schema": "okid.result/0"}'), ("half", '{"schema": "okid.result/1"}')):
        (tmp_path / f"{name}.json").write_text(text)
    (tmp_path / "thin.json").write_text(json.dumps(thin))
    assert main([str(tmp_path / source), str(tmp_path / target), *options]) == 2
    told = capsys.readouterr()
    assert told.out == ""
    assert told.err.count("\n") == 1
    assert re.search(words, told.err), told.err
    assert not (tmp_path / target).exists()


def test_help_and_usage(capsys: pytest.CaptureFixture[str]) -> None:
    for arguments, code in (([], 2), (["--help"], 0), (["a", "b", "--fs", "x"], 2)):
        with pytest.raises(SystemExit) as ended:
            main(arguments)
        assert ended.value.code == code
    assert "examples: okid-convert" in capsys.readouterr().out


def test_as_a_program(tmp_path: Path) -> None:
    write_csv(tmp_path / "a.csv", full_record(9))
    words = [sys.executable, "-m", "okid.formats.command", str(tmp_path / "a.csv"), str(tmp_path / "a.h5")]
    done = subprocess.run(words, capture_output=True, text=True, timeout=1800, check=False)
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout == f"{tmp_path / 'a.h5'}: 9 samples x 4 channels, 1024 Hz\n"


@pytest.mark.parametrize("ending", ["uff", "h5", "mat"])
def test_ambient_and_live_results(tmp_path: Path, ending: str) -> None:
    _, y = shaken_frame()
    ambient = okid.identify(None, y, fs=1000.0).to_dict()
    live = identified().to_dict() | {"modes": []}
    live["model"]["x0"] = None
    for name, raw in (("ambient", ambient), ("live", live)):
        (tmp_path / f"{name}.json").write_text(json.dumps(raw), encoding="utf-8")
        assert main([str(tmp_path / f"{name}.json"), str(tmp_path / f"{name}.{ending}")]) == 0
    if ending == "uff":
        assert pyuff.UFF(str(tmp_path / "ambient.uff")).get_set_types().tolist()[2:] == [55] * len(ambient["modes"])
        assert pyuff.UFF(str(tmp_path / "live.uff")).get_set_types().tolist()[2:] == [58] * 3
