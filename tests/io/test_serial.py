# SPDX-License-Identifier: MIT
"""A rig on a serial line, end to end: `okid run` at one end of a pseudo terminal, packets or text at the other.

The line is fed as fast as it is read: samples are counted by their numbers, not by the clock.
"""

from __future__ import annotations

import json
import random
from pathlib import Path
from typing import Any

import program
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from lines import Reader, Run, line, of_type, packet, unpack
from methods import by_method

RIG = """rate_hz = 250.0
duration_s = {seconds}
seed = 5
masses = [1.0, 0.8, 1.2]
springs = [3e4, 2e4, 2.5e4]
zeta = [0.01, 0.01]
force_dofs = [1]
sense_dofs = [1, 2, 3]
noise_percent = 1.0
bits = {bits}
"""


class Rig:
    """What `okid simulate` says of a rig: the codes of every sample, the config of a serial node, the truth."""

    def __init__(self, folder: Path, seconds: float = 40.0, bits: int = 16) -> None:
        (folder / "rig.toml").write_text(RIG.format(seconds=seconds, bits=bits))
        device = folder / "far-end"
        done = program.okid(
            "simulate", folder / "rig.toml", "--quiet", "--csv", folder / "rig.csv", "--truth", folder / "truth.json",
            "--log", folder / "rig.log", "--config", folder / "can.toml",
        )  # fmt: skip
        assert done.returncode == 0, done.stderr
        self.truth = json.loads((folder / "truth.json").read_text())
        text = (folder / "rig.csv").read_text().splitlines()
        self.names = text[2].split(",")
        self.values = [[float(cell) for cell in row.split(",")] for row in text[3:]]
        self.device, self.folder, self.size = device, folder, 3 if bits > 16 else 2
        dbc = (folder / "can.dbc").read_text()
        signals = {part.split()[0]: part for part in dbc.split(" SG_ ")[1:]}
        self.scales = [
            float(signals[name.replace("force", "Force").replace("acc", "Accel")].split("(")[1].split(",")[0])
            for name in self.names
        ]
        self.codes = [[round(v / s) for v, s in zip(row, self.scales, strict=True)] for row in self.values]

    def config(self, name: str, bus: str, *, scaled: bool = True, first_field: int = 0) -> Path:
        text = '[acquisition]\nrate_hz = 250.0\n[[bus]]\nname = "node"\ntype = "serial"\n'
        text += f'device = "{self.device}"\n{bus}\n'
        for i, (channel, scale) in enumerate(zip(self.names, self.scales, strict=True)):
            role, unit = ("force", "N") if channel.startswith("force") else ("acceleration", "m/s^2")
            text += f'[[channel]]\nname = "{channel}"\nrole = "{role}"\nunit = "{unit}"\ndof = {channel[-1]}\n'
            text += f"field = {first_field + i}\n" + (f"scale = {scale!r}\n" if scaled else "")
        text += "[identification]\np = 30\nrows = 60\nupdate_s = 10.0\nsigma_blocks = 0\nmkr = true\n"
        path = self.folder / f"{name}.toml"
        path.write_text(text)
        return path

    def packets(self, size: int = 5) -> list[bytes]:
        rows = self.codes
        return [packet(n, rows[n : n + size], time_us=n * 4000, size=self.size) for n in range(0, len(rows), size)]


def check_modes(result: dict[str, Any], truth: dict[str, Any]) -> None:
    modes = result["modes"]
    assert len(modes) >= 3
    for f, zeta in zip(truth["frequency_hz"], truth["damping_ratio"], strict=True):
        nearest = min(modes, key=lambda mode: abs(mode["frequency_hz"] - f))
        assert nearest["frequency_hz"] == pytest.approx(f, rel=2e-3)
        assert nearest["damping_ratio"] == pytest.approx(zeta, rel=0.15)


@pytest.mark.parametrize("bits", [16, 24])
def test_own_stream_gives_what_the_can_log_gives(tmp_path: Path, bits: int) -> None:
    rig = Rig(tmp_path, bits=bits)
    config = rig.config("node", 'framing = "cobs"\nbaud = 921600')
    with line(rig.device) as ours:
        run = Run(config, "--duration", len(rig.codes) / 250.0)
        for piece in rig.packets():
            ours.write(piece)
        events = run.finish()
    result = events[-1]["result"]
    check_modes(result, rig.truth)
    stats = of_type(events, "stats")[-1]
    assert stats["bus"]["node"]["received"] == len(rig.codes)
    assert stats["bus"]["node"]["lost"] == 0
    assert not of_type(events, "gap")
    can = by_method((tmp_path / "can.toml").read_text(), p=30, rows=60)
    (tmp_path / "can.toml").write_text(can.replace("update_s = 1.0", "update_s = 10.0\nsigma_blocks = 0"))
    done = program.okid("replay", tmp_path / "rig.log", "-c", tmp_path / "can.toml", "--json", "-")
    by_can = json.loads(done.stdout)
    assert result["mkr"]["M"][0][0] == pytest.approx(rig.truth["M"][0][0], rel=0.05)
    for mode in by_can["modes"]:
        assert min(abs(m["frequency_hz"] / mode["frequency_hz"] - 1) for m in result["modes"]) < 5e-3


def test_lines_of_text(tmp_path: Path) -> None:
    rig = Rig(tmp_path)
    config = rig.config("text", 'framing = "ascii"\ncounter_field = 0\ncounter_bits = 16', scaled=False, first_field=1)
    draw = random.Random(3)
    lost = {n for n in range(100, len(rig.values) - 100) if draw.random() < 0.002}
    torn = {n for n in range(100, len(rig.values) - 100) if draw.random() < 0.002} - lost
    with line(rig.device) as ours:
        run = Run(config, "--duration", len(rig.values) / 250.0)
        ours.write(b"boot: sensor v1.2\r\n")
        for n, row in enumerate(rig.values):
            cells = [str(65530 + n & 0xFFFF), *(f"{v:.9g}" for v in row)]
            text = [",".join(cells), " ".join(cells), "; ".join(cells)][n % 3] + ["\n", "\r\n"][n % 2]
            if n % 50 == 1:
                text = "n:{} f:{} a1:{} a2:{} a3:{}\n".format(*cells)
            if n in torn:
                text = text[:-2].replace("e", "") + "x\n"
            if n not in lost:
                ours.write(text.encode())
        events = run.finish()
    check_modes(events[-1]["result"], rig.truth)
    stats = of_type(events, "stats")[-1]["bus"]["node"]
    marked = {
        n for gap in of_type(events, "gap") if gap["channel"] == "acc1" for n in range(gap["first"], gap["last"] + 1)
    }
    assert marked == lost | torn
    assert stats["lost"] == len(lost | torn)
    assert stats["lost_by"]["crc"] >= len(torn) and stats["lost_by"]["sequence"] <= len(lost)


@settings(max_examples=6, suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow])
@given(seed=st.integers(0, 2**32 - 1))
def test_marked_gaps_are_the_injected_losses(tmp_path: Path, seed: int) -> None:
    rig = Rig(tmp_path, seconds=12.0)
    config = rig.config("faults", 'framing = "cobs"')
    draw, size = random.Random(seed), 4
    pieces = rig.packets(size)
    lost: dict[int, str] = {}
    doubled = 0
    with line(rig.device) as ours:
        run = Run(config, "--duration", len(rig.codes) / 250.0)
        for k, piece in enumerate(pieces):
            fate = draw.random() if 2 <= k < len(pieces) - 2 else 1.0
            if fate < 0.02:
                lost[k] = "sequence"
            elif fate < 0.04:
                at = draw.randrange(len(piece) - 1)
                bit = 1 << draw.randrange(8)
                ours.write(piece[:at] + bytes([piece[at] ^ bit]) + piece[at + 1 :])
                lost[k] = "crc"
            elif fate < 0.06:
                at = draw.randrange(len(piece) - 1)
                ours.write(piece[:at] + piece[at + 1 :])
                lost[k] = "crc"
            elif fate < 0.08:
                ours.write(piece + piece)
                doubled += 1
            else:
                ours.write(piece)
        events = run.finish()
    missing = {k * size + i for k in lost for i in range(size)}
    for channel in rig.names:
        gaps = [gap for gap in of_type(events, "gap") if gap["channel"] == channel]
        assert sum(gap["count"] for gap in gaps) == len(missing)
        assert {n for gap in gaps for n in range(gap["first"], gap["last"] + 1)} == missing
        for gap in gaps:
            causes = {lost[n // size] for n in range(gap["first"], gap["last"] + 1)}
            assert gap["cause"] == ("crc" if "crc" in causes else "sequence")
    stats = of_type(events, "stats")[-1]["bus"]["node"]
    assert stats["lost"] == len(missing) == sum(stats["lost_by"].values())
    assert stats["duplicate"] == doubled * size
    assert stats["received"] == len(rig.codes) - len(missing) + doubled * size


def test_unplugged_and_plugged_in_again(tmp_path: Path) -> None:
    rig = Rig(tmp_path, seconds=12.0)
    config = rig.config("plug", 'framing = "cobs"')
    config.write_text(config.read_text().replace("update_s = 10.0", "update_s = 4.0"))
    pieces = rig.packets(5)
    with line(rig.device) as ours:
        run = Run(config, "--duration", len(rig.codes) / 250.0)
        for piece in pieces[:200]:
            ours.write(piece)
        while not of_type(run.events(), "stats"):  # after sample 1000: nothing is on the way any more
            assert run.process.poll() is None
        ours.unplug()
        ours.plug_in()
        for piece in pieces[240:]:
            ours.write(piece)
        events = run.finish()
    gaps = [gap for gap in of_type(events, "gap") if gap["channel"] == "force1"]
    assert [(gap["first"], gap["last"], gap["cause"]) for gap in gaps] == [(1000, 1199, "link_down")]
    assert of_type(events, "stats")[-1]["bus"]["node"]["lost_by"]["link_down"] == 200
    assert f"{rig.device}: went down or away" in run.stderr


def test_simulate_plays_a_node(tmp_path: Path) -> None:
    rig = Rig(tmp_path, seconds=1.0)
    with line(rig.device) as ours:
        reader = Reader(ours)
        done = program.okid("simulate", tmp_path / "rig.toml", "--to", rig.device, "--config", tmp_path / "node.toml")
        assert done.returncode == 0, done.stderr
        packets = unpack(reader.packets(250))
    rows = [row for _, _, rows in packets for row in rows]
    assert rows == rig.codes
    expected = 0
    for sequence, time_us, some in packets:
        assert (sequence, time_us) == (expected, expected * 4000)
        expected += len(some)
    done = program.okid("check", tmp_path / "node.toml")
    assert done.returncode == 0, done.stderr
    assert "cobs" in (tmp_path / "node.toml").read_text()


def test_a_link_in_this_folder_is_a_device(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Release 0.1 took a name without a slash for a CAN interface."""
    rig = Rig(tmp_path, seconds=1.0)
    monkeypatch.chdir(tmp_path)
    with line(rig.device) as ours:
        Path("node").symlink_to(rig.device)
        reader = Reader(ours)
        done = program.okid("simulate", "rig.toml", "--to", "node")
        assert done.returncode == 0, done.stderr
        assert [row for _, _, rows in unpack(reader.packets(250)) for row in rows] == rig.codes


@pytest.mark.parametrize(
    ("bus", "channel", "expected"),
    [
        ('framing = "cobs"', "", '"device": is missing: a bus of type serial needs one'),
        ('device = "/dev/ttyX"', "", '"framing": is missing'),
        ('device = "/dev/ttyX"\nframing = "cob"', "", 'did you mean "cobs"?'),
        ('device = "/dev/ttyX"\nframing = "cobs"\nbaud = 12', "", "found 12, expected a whole number from 50"),
        ('device = "/dev/ttyX"\nframing = "cobs"\nbitrate = 9600', "", "a serial line has a baud"),
        ('device = "/dev/ttyX"\nframing = "cobs"\ndbc = "a.dbc"', "", "the channels of a serial bus have a field"),
        ('device = "/dev/ttyX"\nframing = "cobs"\ncounter_field = 0', "", "counts samples by itself"),
        ('device = "/dev/ttyX"\nframing = "ascii"\ncounter_bits = 8', "", "it needs counter_field"),
        ('device = "/dev/ttyX"\nframing = "cobs"', "can_id = 1", "a channel of a serial bus has a field instead"),
        ('device = "/dev/ttyX"\nframing = "cobs"', 'sequence = "C"', 'framing "cobs" counts samples by itself'),
        ('device = "/dev/ttyX"\nframing = "witmotion"', "field = 9", "found 9, expected 0 to 8"),
        ('device = "/dev/ttyX"\nframing = "vectornav"', "field = 6", "found 6, expected 0 to 5"),
    ],
)
def test_what_a_config_cannot_ask_for(tmp_path: Path, bus: str, channel: str, expected: str) -> None:
    field = "" if channel.startswith("field") else "field = 0\n"
    (tmp_path / "a.toml").write_text(
        f'[acquisition]\nrate_hz = 100\n[[bus]]\nname = "n"\ntype = "serial"\n{bus}\n'
        f'[[channel]]\nname = "a"\nrole = "force"\n{field}{channel}\n'
    )
    done = program.okid("check", tmp_path / "a.toml")
    assert done.returncode == 2, done.stdout
    assert expected in done.stderr, done.stderr


def test_the_example_of_the_document_is_a_packet() -> None:
    text = (Path(__file__).resolve().parents[2] / "docs" / "wire-protocol.md").read_text()
    example = text.partition("as bytes on the wire:\n\n```\n")[2].partition("\n")[0]
    assert bytes.fromhex(example) == packet(7, [[100, -100]], time_us=7000)
    assert unpack(bytes.fromhex(example)) == [(7, 7000, [[100, -100]])]


def test_a_device_that_is_not_there(tmp_path: Path) -> None:
    rig = Rig(tmp_path, seconds=1.0)
    config = rig.config("gone", 'framing = "cobs"')
    done = program.okid("run", config)
    assert done.returncode == 4
    assert f"{rig.device}: there is no such device" in done.stderr
    assert "correct device in the [[bus]]" in done.stderr
    done = program.okid("simulate", tmp_path / "rig.toml", "--to", rig.device)
    assert done.returncode == 4 and "there is no such device" in done.stderr
    with line(rig.device) as ours:
        other = Run(config)
        ours.write(b"".join(rig.packets()))
        while not of_type(other.events(), "start"):
            assert other.process.poll() is None
        busy = program.okid("run", config, "--events", tmp_path / "other.jsonl")
        assert busy.returncode == 4 and "another program has it open" in busy.stderr, busy.stderr
        other.stop()
        other.process.communicate(timeout=1800)


def test_doctor_looks_at_the_line(tmp_path: Path) -> None:
    rig = Rig(tmp_path, seconds=1.0)
    config = rig.config("doctor", 'framing = "cobs"\nbaud = 921600')
    done = program.okid("doctor", config)
    assert done.returncode == 4
    assert "bus node (serial)" in done.stdout and "there is no such device" in done.stdout
    with line(rig.device):
        done = program.okid("doctor", config)
    assert done.returncode == 0, done.stdout + done.stderr
    assert f"{rig.device} at 921600 baud" in done.stdout
    assert "CAN in the kernel" not in done.stdout


def test_bytes_that_are_no_packets_are_told(tmp_path: Path) -> None:
    rig = Rig(tmp_path, seconds=1.0)
    config = rig.config("noise", 'framing = "cobs"')
    with line(rig.device) as ours:
        run = Run(config)
        ours.write(b"1.0,2.0,3.0\r\n" * 400)
        told = "bytes arrive, but nothing that could be read: is the baud rate or the framing wrong?"
        while told not in (said := run.process.stderr.readline()):
            assert said, "ended without a word"
        run.stop()
        run.finish(status=3)
    assert 'no usable sample of channel "force1" was received (field 0, bus "node")' in run.stderr
