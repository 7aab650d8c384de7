# SPDX-License-Identifier: MIT
"""MCAP as its own reader sees it; TDMS, WAV and FLAC as npTDMS and soundfile write them."""

from __future__ import annotations

import json
import re
import subprocess
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import okid
import pytest
import soundfile
from hypothesis import given
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from nptdms import ChannelObject, TdmsWriter
from okid.data.records import Record
from okid.formats import read_mcap, read_sound, read_tdms, write_mcap
from okid.formats.conversion import convert
from okid.formats.mcap_file import McapFile
from program import PROGRAM
from sample_records import assert_same, records, steady

START = datetime(2023, 11, 14, 22, 13, 20, 123457, UTC)


def test_mcap_as_its_own_reader_sees_it(tmp_path: Path) -> None:
    samples = np.array([[1.5, np.nan], [-0.1, 2e-300]])
    record = Record(["force", "a 1"], samples, 512.0, ["N", "m/s^2"], start_time=START)
    write_mcap(tmp_path / "a.mcap", record)
    with open(tmp_path / "a.mcap", "rb") as file:
        seen = list(make_reader(file, validate_crcs=True).iter_messages())
    assert [channel.topic for _, channel, _ in seen] == ["/signals"] * 2
    schema, channel, second = seen[1]
    assert (schema.encoding, channel.message_encoding) == ("jsonschema", "json")
    properties = json.loads(schema.data)["properties"]
    assert properties["a 1"] == {"type": ["number", "null"], "description": "m/s^2"}
    assert [json.loads(one.data)["a 1"] for _, _, one in seen] == [None, 2e-300]
    assert json.loads(second.data)["force"] == -0.1
    assert second.log_time == 1_700_000_000_123_457_000 + 1_953_125
    assert json.loads(second.data)["timestamp"] == {"sec": 1_700_000_000, "nsec": 125_410_125}


@steady
@given(records())
def test_any_record_comes_back(tmp_path: Path, record: Record) -> None:
    write_mcap(tmp_path / "a.mcap", record)
    assert_same(read_mcap(tmp_path / "a.mcap"), record)


@steady
@given(records())
def test_ros2_messages_have_the_same_bits(tmp_path: Path, record: Record) -> None:
    """As the decoder of ROS 2 messages sees them: a topic a channel, NaN for a missing sample."""
    path = tmp_path / "a.ros2.mcap"
    write_mcap(path, record)
    seen: dict[str, list[float]] = {}
    with path.open("rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()], validate_crcs=True)
        assert reader.get_header().profile == "ros2"
        for schema, channel, _, message in reader.iter_decoded_messages():
            assert schema is not None and schema.name == "std_msgs/msg/Float64"
            assert re.fullmatch(r"/okid/signals/[A-Za-z_][A-Za-z0-9_]*", channel.topic)
            seen.setdefault(channel.topic, []).append(message.data)
    assert len(seen) == (len(record.names) if len(record.samples) else 0)
    np.testing.assert_array_equal(np.array(list(seen.values())).T.reshape(record.samples.shape), record.samples)


def test_what_mcap_cannot_hold_is_refused(tmp_path: Path) -> None:
    for record, fault in (
        (Record(["a"], [[1.0]]), "MCAP needs a sample rate"),
        (Record(["sample"], [[1.0]], 10.0), "a channel is named 'sample'"),
    ):
        with pytest.raises(okid.InputError, match=fault):
            write_mcap(tmp_path / "a.mcap", record)
    assert list(tmp_path.iterdir()) == []
    (tmp_path / "b.mcap").write_bytes(b"\x89MCAP0\r\nbroken")
    with pytest.raises(okid.InputError, match="b.mcap: not an MCAP file"):
        read_mcap(tmp_path / "b.mcap")


def test_samples_that_did_not_arrive_are_missing(tmp_path: Path) -> None:
    with open(tmp_path / "a.mcap", "wb") as file:
        writer = McapFile(file, 0)
        writer.describe({**Record(["a"], [[0.0]], 8.0).about()})
        writer.samples(10, [[1.0]])
        writer.samples(12, [[3.0]])
        writer.close()
    np.testing.assert_array_equal(read_mcap(tmp_path / "a.mcap").samples, [[1.0], [np.nan], [3.0]])


def test_events_of_a_run_become_topics(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    events = [
        {"type": "start", "t": 0.0, "wall_time": "2023-11-14T22:13:20.123457Z"},
        {"type": "modes", "t": 2.5, "modes": [{"frequency_hz": 10.96, "track": 1}]},
    ]
    (tmp_path / "e.jsonl").write_text("".join(json.dumps(one) + "\n" for one in events))
    assert convert([str(tmp_path / "e.jsonl"), str(tmp_path / "e.mcap")]) == 0
    assert "2 events" in capsys.readouterr().out
    with open(tmp_path / "e.mcap", "rb") as file:
        seen = [(c.topic, m.log_time, json.loads(m.data)) for _, c, m in make_reader(file).iter_messages()]
    begin = 1_700_000_000_123_457_000
    assert seen == [("/start", begin, events[0]), ("/modes", begin + 2_500_000_000, events[1])]
    (tmp_path / "f.jsonl").write_text("{}\n")
    assert convert([str(tmp_path / "f.jsonl"), str(tmp_path / "f.mcap")]) == 2
    assert "line 1 of the events" in capsys.readouterr().err and not (tmp_path / "f.mcap").exists()


def channel(group: str, name: str, values: object, **properties: object) -> ChannelObject:
    return ChannelObject(group, name, np.asarray(values), properties=properties)


def test_tdms_of_nptdms(tmp_path: Path) -> None:
    start = np.datetime64("2023-11-14T22:13:20.123457")
    wave = {"wf_increment": 1 / 1024, "wf_start_offset": 0.0, "wf_start_time": start}
    values = np.random.default_rng(1).standard_normal((2, 100))
    with TdmsWriter(tmp_path / "a.tdms") as file:
        file.write_segment(
            [channel("g", "force", values[0], unit_string="N", **wave), channel("g", "a1", values[1], **wave)]
        )
        file.write_segment([channel("h", "force", [1, 2, 3], **(wave | {"wf_increment": 0.5}))])
    with pytest.raises(okid.InputError, match=r"channels of 2 rasters.*1: g force, a1 \(100 samples, 1024 Hz\)"):
        read_tdms(tmp_path / "a.tdms")
    record = read_tdms(tmp_path / "a.tdms", 1)
    np.testing.assert_array_equal(record.samples, values.T)
    assert (record.names, record.units) == (["g force", "a1"], ["N", ""])
    assert (record.fs_hz, record.start_time) == (1024.0, START)
    second = read_tdms(tmp_path / "a.tdms", "2")
    assert (second.names, second.fs_hz, second.samples.tolist()) == (["h force"], 2.0, [[1.0], [2.0], [3.0]])


@pytest.mark.parametrize(
    ("ending", "subtype", "bits"), [("wav", "PCM_16", 16), ("wav", "PCM_24", 24), ("flac", "PCM_24", 24)]
)
def test_sound_is_exact(tmp_path: Path, ending: str, subtype: str, bits: int) -> None:
    path = tmp_path / f"a.{ending}"
    codes = np.random.default_rng(2).integers(-(2 ** (bits - 1)), 2 ** (bits - 1), (500, 3))
    soundfile.write(path, (codes << (32 - bits)).astype(np.int32), 51200, subtype=subtype)
    record = read_sound(path)
    np.testing.assert_array_equal(record.samples, codes / 2.0 ** (bits - 1))
    assert (record.names, record.fs_hz) == (["ch1", "ch2", "ch3"], 51200.0)


def test_frames_become_samples_by_a_config(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Through a .blf log, against what the program itself makes of the log it simulated."""
    (tmp_path / "rig.toml").write_text(
        "rate_hz = 100.0\nduration_s = 2.0\nmasses = [1.0]\nsprings = [1e3]\nzeta = [0.01]\n"
        'force_dofs = [1]\nsense_dofs = [1]\nexcitation = "white"\nforce_rms = 1.0\n'
    )

    def run(*arguments: str) -> None:
        subprocess.run([PROGRAM, *arguments], cwd=tmp_path, check=True, capture_output=True)

    run("simulate", "rig.toml", "--log", "a.log", "--truth", "t.json", "--dbc", "a.dbc", "--config", "a.toml")
    run("convert", "a.log", "wanted.csv", "-c", "a.toml")
    a = [str(tmp_path / name) for name in ("a.log", "a.blf", "a.mcap", "a.toml")]
    assert convert([a[0], a[1]]) == 0
    assert convert([a[1], a[2]]) == 2
    assert "give --config" in capsys.readouterr().err
    assert convert([a[1], a[2], "--config", a[3]]) == 0
    wanted = okid.read_csv(tmp_path / "wanted.csv")
    np.testing.assert_array_equal(read_mcap(tmp_path / "a.mcap").samples, wanted.samples)


CANDUMP = {
    "a": " (1700000000.100000)  can0  123   [3]  01 02 FF\n"
    " (1700000000.250000)  can0  1ABCDEF0   [0]  remote request\n",
    "z": " (000.000000)  can0  123   [3]  01 02 FF\n (000.150000)  can0  1ABCDEF0   [0]  remote request\n",
    "x": " (1700000000.100000)  can0  RX - -  123   [3]  01 02 FF   '...'\n"
    " (1700000000.250000)  can0  TX - -  1ABCDEF0   [0]  remote request\n",
    "d": " (000.000000)  can0  123   [3]  01 02 FF\n (000.150000)  can0  1ABCDEF0   [0]  remote request\n"
    " (000.050000)  can0  20000004   [8]  00 01 00 00 00 00 00 00   ERRORFRAME\n",
}


@pytest.mark.parametrize("form", sorted(CANDUMP))
def test_candump_as_it_is_shown(tmp_path: Path, form: str) -> None:
    (tmp_path / "a.log").write_text(CANDUMP[form])
    remarks: list[str] = []
    seen = list(okid.formats.read_log(tmp_path / "a.log", remarks))
    assert [one.arbitration_id for one in seen[:2]] == [0x123, 0x1ABCDEF0]
    assert bytes(seen[0].data) == b"\x01\x02\xff" and seen[1].is_remote_frame and seen[1].is_extended_id
    assert seen[1].timestamp - seen[0].timestamp == pytest.approx(0.15, abs=1e-6)
    assert seen[1].is_rx == (form != "x")
    assert bool(remarks) == (form == "d")
    if form == "d":
        assert seen[2].is_error_frame and seen[2].timestamp == pytest.approx(0.2)


def test_candump_with_dates_is_local_time(tmp_path: Path) -> None:
    (tmp_path / "a.log").write_text(" (2023-11-14 22:13:20.123457)  can0  123  [12]  " + "AA " * 12 + "\n")
    (frame,) = okid.formats.read_log(tmp_path / "a.log")
    assert frame.timestamp == pytest.approx(datetime(2023, 11, 14, 22, 13, 20, 123457).timestamp(), abs=1e-6)
    assert frame.is_fd and len(frame.data) == 12
    (tmp_path / "a.log").write_text(" (000.1)  can0  123   [3]  01 02\n")
    with pytest.raises(okid.InputError, match="shows 2 bytes and states 3"):
        list(okid.formats.read_log(tmp_path / "a.log"))
