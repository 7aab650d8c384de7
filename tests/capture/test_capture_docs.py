# SPDX-License-Identifier: MIT
"""docs/howto/acquisition-scripts.md: its script runs, its commands exist."""

from __future__ import annotations

import re
import runpy
import sys
import threading
from pathlib import Path

import can
import pytest
from captured import frames
from okid import capture
from waiting import until

PAGE = (Path(__file__).parents[2] / "docs" / "howto" / "acquisition-scripts.md").read_text()


def test_the_script_of_the_page(
    rig: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    (script,) = re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL)
    (tmp_path / "script.py").write_text(script)
    from can.interfaces.virtual import channels

    with can.Bus(interface="virtual", channel="okid-page", preserve_timestamps=True) as sender:

        def send() -> None:
            until(lambda: len(channels["okid-page"]) >= 2)
            for message in frames(rig / "a.log"):
                sender.send(message)

        thread = threading.Thread(target=send, daemon=True)
        thread.start()
        monkeypatch.setattr(sys, "argv", ["script.py", "virtual", "okid-page", str(rig / "a.toml"), "5"])
        runpy.run_path(str(tmp_path / "script.py"))
        thread.join()
    shown = capfd.readouterr().out
    assert "t 5.000 s: " in shown
    assert "1250 samples" in shown
    assert re.search(r"can0: \d+ received, 0 lost", shown)


def test_every_option_of_the_page_exists(capsys: pytest.CaptureFixture[str]) -> None:
    commands = re.findall(r"^okid-capture (\w+) (.*)$", PAGE, re.MULTILINE)
    assert {kind for kind, _ in commands} == {"can", "serial", "sync", "emulate"}
    for kind, rest in commands:
        with pytest.raises(SystemExit) as ended:
            capture.main([kind, "--help"])
        assert ended.value.code == 0
        help_text = capsys.readouterr().out
        assert "example" in help_text
        for option in re.findall(r"--[a-z-]+", rest):
            assert option in help_text, (kind, option)


def test_every_function_of_the_page_exists() -> None:
    rows = re.findall(r"^\| (`\w+\(.*?) \|", PAGE, re.MULTILINE)
    names = [name for row in rows for name in re.findall(r"`(\w+)", row)]
    assert len(names) > 8
    assert [name for name in names if not hasattr(capture, name)] == []
