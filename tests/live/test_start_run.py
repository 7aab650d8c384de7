# SPDX-License-Identifier: MIT
"""A run that the start page begins: a serial line that is named, its proposed config, the run, its end, its result.

The line is fed as fast as it is read: samples are counted by their numbers, not by the clock.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import waiting
from event_source import Listener
from lines import Line, line
from live_process import Live, post
from two_masses import rig_text, simulate_rig


@pytest.fixture(scope="module")
def rows(tmp_path_factory: pytest.TempPathFactory) -> list[bytes]:
    """Twelve seconds of two masses as lines of text: number, force, two accelerations."""
    folder = simulate_rig(tmp_path_factory.mktemp("rows"), rig_text(12.0, 500.0))
    data = [row for row in (folder / "a.csv").read_text().splitlines() if row[:1] in "-0123456789"]
    return [f"{n},{row}\n".encode() for n, row in enumerate(data)]


def wish(live: Live, where: str, /, **content: object) -> tuple[int, Any]:
    status, data = post(live, where, content)
    return status, json.loads(data) if status == 200 else data.decode()


def until(live: Live, wanted: Callable[[str, Any], bool]) -> Any:
    page = Listener(live.port)
    for kind, content in page.events():
        assert kind != "state" or content["link"] != "failed", content
        if wanted(kind, content):
            page.close()
            return content
    raise AssertionError("the stream ended")


def propose(live: Live, device: Path, config: Path) -> str:
    assert wish(live, "/look", path=str(device)) == (200, {"kind": "bus", "path": str(device), "serial": True})
    named = {"path": str(device), "config": str(config), "fields": "count,force,a1,a2", "rate": "500"}
    status, made = wish(live, "/propose", **named)
    assert status == 200, made
    assert made["command"] == f"okid init {config} --device={device} --fields=count,force,a1,a2 --rate=500"
    assert made["toml"] == config.read_text() and 'name = "a2"' in made["toml"]
    return str(made["toml"])


def feed(ours: Line, rows: list[bytes]) -> None:
    for row in rows:
        ours.write(row)


def test_from_a_line_to_its_result(rows: list[bytes], tmp_path: Path, okid_live: Callable[..., Live]) -> None:
    live, device, config = okid_live(), tmp_path / "tty", tmp_path / "lab.toml"
    with line(device) as ours:
        toml = propose(live, device, config).replace("update_s = 2.0", "update_s = 1.0")
        status, begun = wish(live, "/run", path=str(config), toml=toml)
        assert status == 200 and begun["command"].startswith(
            f"okid-live {config} --open\nokid run {config} --json="
        ), begun
        assert config.read_text() == toml
        until(live, lambda kind, content: kind == "state" and content["link"] == "live")
        feed(ours, rows)
        until(live, lambda kind, content: kind == "modes" and len(content["modes"]) >= 2)
        for path in ("/identify", "/open", "/run"):
            status, said = wish(live, path, path=str(config), files=[str(config)], outputs=["a1"])
            assert (status, said) == (409, "a run goes on: end it first\n")
        assert wish(live, "/end")[0] == 200
        shown = until(live, lambda kind, content: kind == "result" or (kind == "hello" and content["result"]))
    found = (shown.get("result") or shown)["modes"]
    assert sum(mode["confident"] for mode in found) == 2
    waiting.until(lambda: wish(live, "/end") == (422, "no run goes on\n"))  # the file comes after the page's result
    results = list(tmp_path.glob("lab-*.json"))
    assert len(results) == 1 and json.loads(results[0].read_text())["inputs"] == ["force"]
    assert live.end() == (0, "")


def test_what_is_wrong_is_said_and_nothing_is_overwritten(tmp_path: Path, okid_live: Callable[..., Live]) -> None:
    live, device, config = okid_live(), tmp_path / "tty", tmp_path / "own.toml"
    config.write_text("# mine\n")
    named = {"path": str(device), "fields": "count,force,a1", "rate": "500"}
    with line(device):
        for more, said in (
            ({"config": str(config)}, "exists, expected a new name"),
            ({"config": str(tmp_path / "a.txt")}, "expected a new name that ends with .toml"),
            ({"config": str(tmp_path / "a.toml"), "fields": ""}, "expected --fields"),
            ({"config": str(tmp_path / "a.toml"), "path": "/etc/passwd"}, "is no bus"),
            ({"config": str(tmp_path / "a.toml"), "path": 7}, "expected a text"),
        ):
            status, text = wish(live, "/propose", **{**named, **more})
            assert status == 422 and said in text, text
        assert not (tmp_path / "a.toml").exists()
        status, text = wish(live, "/run", path=str(config), toml="[acquisition]\nrate_hz = 1\n")
        assert status == 422 and config.read_text() == "# mine\n", text
        propose(live, device, tmp_path / "b.toml")
        status, text = wish(live, "/run", path=str(tmp_path / "b.toml"), toml="[acquisition]\nrate_hz = -1\n")
        assert status == 422 and "rate_hz" in text
    assert live.end() == (0, "")
