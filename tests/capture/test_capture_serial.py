# SPDX-License-Identifier: MIT
"""okid-capture serial: packets and lines by pyserial over ptys, sockets and loop://, kept as bytes and identified."""

from __future__ import annotations

import io
import json
import socket
import struct
import threading
import tomllib
import zlib
from pathlib import Path

import lines
import numpy as np
import okid
import pytest
import serial
from captured import assert_same_result, assert_truth, edited
from cobs import cobs
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from okid import capture
from okid.capture import emulate
from waiting import until


@pytest.fixture(scope="session")
def line(rig: Path, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, bytes]:
    """The rig on a serial line: its config and the bytes of its packets."""
    config = capture.load_config(rig / "a.toml")
    folder = tmp_path_factory.mktemp("line")
    (folder / "line.toml").write_text(capture.line_config(config, "/dev/ttyUSB9", 921600))
    packets = capture.packets_of(capture.messages_for(rig / "a.log", config), config)
    return folder / "line.toml", b"".join(data for _, data in packets)


def run(*arguments: object) -> int:
    return capture.main([str(argument) for argument in arguments])


@pytest.mark.parametrize("number_format", [0, 1, 2])
def test_packets_of_every_format(rig: Path, number_format: int) -> None:
    """As docs/wire-protocol.md has them, by other code."""
    config = capture.load_config(rig / "a.toml")
    rows = np.random.default_rng(1).integers(-(2 ** [15, 23, 20][number_format]), 2**15, (7, 5)).astype(float)
    data = emulate._packet(number_format, rows, 2**32 - 3, config)
    plain = cobs.decode(data[:-1])
    assert data[-1] == 0 and zlib.crc32(plain[:-4]) == int.from_bytes(plain[-4:], "little")
    time_us = round((2**32 - 3) / config.rate_hz * 1e6) & 0xFFFFFFFF
    assert struct.unpack("<BBBBII", plain[:12]) == (1, number_format, 5, 7, 2**32 - 3, time_us)
    if number_format == 2:
        assert np.array_equal(np.frombuffer(plain[12:-4], "<f4"), rows.ravel())
    else:
        assert lines.unpack(data)[0][2] == rows.astype(int).tolist()
    with pytest.raises(okid.InputError, match="do not fit a packet"):
        emulate._packet(2, np.zeros((1, 253)), 0, config)


@settings(
    deadline=None, max_examples=25, suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow]
)
@given(st.lists(st.binary(max_size=300), max_size=6), st.integers(1, 50))
def test_any_bytes_in_any_pieces(tmp_path: Path, pieces: list[bytes], cut: int) -> None:
    """Nothing raises, and the cut into reads changes nothing."""
    config = lines.node_config(tmp_path)
    whole = [lines.packet(k, [[k, -k]], time_us=10000 * k) for k in range(12)]
    stream = b"".join([whole[0], *pieces, *whole[1:10], *pieces, *whole[10:]])
    found = []
    for size in (len(stream), cut):
        with capture.Capture(config, identify=False) as kept:
            for k in range(0, len(stream), size):
                kept.push_bytes(stream[k : k + size])
            kept.finish()
            found.append((np.vstack(kept.take()).tolist(), kept.counts["node"].more))
    assert found[0][1] == found[1][1] and str(found[0][0]) == str(found[1][0])


def test_recorded_bytes_give_the_result_of_the_can_bus(
    rig: Path, line: tuple[Path, bytes], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    config, stream = line
    (tmp_path / "run.bin").write_bytes(stream)
    assert run("serial", "--from", tmp_path / "run.bin", "--config", config, "--json", tmp_path / "r.json") == 0
    assert_same_result(json.loads((tmp_path / "r.json").read_text()), json.loads((rig / "replay.json").read_text()))
    assert "node: 1500 received, 0 lost" in capsys.readouterr().out


def test_losses_by_cause(line: tuple[Path, bytes], tmp_path: Path) -> None:
    config, stream = line
    packets = [piece + b"\0" for piece in stream.split(b"\0")[:-1]]
    packets[100] = packets[100][:8] + bytes([packets[100][8] ^ 0xFF or 1]) + packets[100][9:]  # damaged
    del packets[200:203]  # never came
    packets.insert(300, packets[300])  # came twice
    loaded = capture.load_config(config)
    kept = capture.Capture(loaded, identify=False)
    blocks = capture.serial_blocks(io.BytesIO(b"".join(packets)), loaded, samples=kept)
    rows = np.vstack(list(blocks))
    in_packet, counts = len(rows) // (len(packets) - 1 + 3), kept.counts["node"]
    assert counts.lost == {"crc": in_packet, "sequence": 3 * in_packet}
    assert counts.duplicate == in_packet
    assert counts.more["damaged"] == 1
    assert int(np.isnan(rows).all(axis=1).sum()) == 4 * in_packet


def test_a_line_that_is_unplugged_keeps_everything(
    line: tuple[Path, bytes], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    config, stream = line
    half = stream[: stream.index(b"\0", 2 * len(stream) // 3) + 1]

    def play_then_unplug(tty: lines.Line) -> None:
        wait_for_file(tmp_path / "run.bin")
        tty.write(half)
        wait_for_file(tmp_path / "run.bin", len(half))
        tty.unplug()

    with lines.line(tmp_path / "tty") as tty:
        thread = threading.Thread(target=play_then_unplug, args=(tty,), daemon=True)
        thread.start()
        outputs = ("--out", tmp_path / "run.bin", "--json", tmp_path / "r.json")
        assert run("serial", "--port", tmp_path / "tty", "--config", config, *outputs) == 4
        thread.join()
        tty.plug_in()
    assert "what came before is in the result" in capsys.readouterr().err
    assert (tmp_path / "run.bin").read_bytes() == half
    assert json.loads((tmp_path / "r.json").read_text())["samples"] >= 900


def wait_for_file(path: Path, size: int = 0) -> None:
    until(lambda: path.exists() and path.stat().st_size >= size)


def test_a_socket_and_a_duration(rig: Path, line: tuple[Path, bytes], tmp_path: Path) -> None:
    config, stream = line
    with socket.create_server(("127.0.0.1", 0)) as server:

        def serve() -> None:
            peer, _ = server.accept()
            with peer:
                wait_for_file(tmp_path / "run.bin")  # pyserial drops what comes before the port is open
                peer.sendall(stream)
                peer.recv(1)  # until the other end closes

        thread = threading.Thread(target=serve, daemon=True)
        thread.start()
        url = f"socket://127.0.0.1:{server.getsockname()[1]}"
        outputs = ("--duration", 4, "--json", tmp_path / "r.json", "--out", tmp_path / "run.bin", "--quiet")
        assert run("serial", "--port", url, "--config", config, *outputs) == 0
        thread.join()
    result = json.loads((tmp_path / "r.json").read_text())
    assert result["samples"] == 1000
    assert_truth(result, rig / "t.json")
    kept = (tmp_path / "run.bin").read_bytes()
    assert stream.startswith(kept)


def test_loop_and_a_script(rig: Path, line: tuple[Path, bytes]) -> None:
    config, stream = line
    with capture.open_port("loop://") as port, okid.Session.from_config(config) as session:
        writer = threading.Thread(target=port.write, args=(stream,), daemon=True)
        writer.start()
        for block in capture.serial_blocks(port, config, stop=lambda: session.samples >= 1500):
            session.feed(block)
        writer.join()
        assert_truth(session.identify().to_dict(), rig / "t.json")


def test_lines_of_text_are_placed_by_their_counter(rig: Path, line: tuple[Path, bytes], tmp_path: Path) -> None:
    def to_text(text: str) -> str:
        text = text.replace('framing = "cobs"', 'framing = "ascii"\ncounter_field = 0\ncounter_bits = 8')
        for field in (2, 1, 0):
            text = text.replace(f"field = {field}\n", f"field = {field + 1}\n").replace(
                "counter_field = 1", "counter_field = 0"
            )
        return text

    config = edited(line[0], tmp_path / "a.toml", to_text)
    fields = [channel["field"] for channel in tomllib.loads(config.read_text())["channel"]]
    assert fields == [1, 2, 3]
    codes = np.vstack([rows for _, _, rows in lines.unpack(line[1])])
    text = "".join(f"{k & 255},{u},{a},{b}\r\n" for k, (u, a, b) in enumerate(codes.tolist()) if k not in (500, 501))
    (tmp_path / "run.txt").write_text("torn,1\n" + text)
    assert run("serial", "--from", tmp_path / "run.txt", "--config", config, "--json", tmp_path / "r.json") == 0
    result = json.loads((tmp_path / "r.json").read_text())
    assert (result["samples"], result["gaps"]) == (1500, 1)
    assert_truth(result, rig / "t.json")


@pytest.mark.parametrize(
    ("arguments", "code", "words"),
    [
        (["--port", "/nowhere/tty"], 4, "cannot open /nowhere/tty"),
        (["--port", "nosuch://x"], 4, "nosuch"),
        (["--port", "loop://", "--from", "x"], 2, "--from is read instead of a port"),
        (["--from", "/nowhere/run.bin"], 2, "/nowhere/run.bin"),
        (["--port", "loop://", "--out", "/nowhere/run.bin"], 2, "/nowhere/run.bin"),
        (["--port", "loop://", "--duration", "0"], 2, "--duration"),
        (["--port", "loop://", "--baud", "1"], 2, "--baud"),
        (["--port", "loop://", "--duration", "0.01"], 3, 'no usable sample of channel "force1" was received (field 0,'),
    ],
)
def test_refusals(
    line: tuple[Path, bytes], capsys: pytest.CaptureFixture[str], arguments: list[str], code: int, words: str
) -> None:
    assert run("serial", "--config", line[0], *arguments) == code
    shown = capsys.readouterr().err
    assert words in shown
    assert shown.startswith("okid-capture: ") and shown.count("\n") == 1


def test_a_can_config_is_refused(rig: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run("serial", "--config", rig / "a.toml", "--port", "loop://") == 2
    assert "expected a serial bus" in capsys.readouterr().err


def test_serial_exceptions_are_what_the_scripts_expect() -> None:
    assert issubclass(serial.SerialException, OSError)
