# SPDX-License-Identifier: MIT
"""A CONFIG.toml means the same to the program and to Python: one parser, one set of sentences."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import okid
import pytest
from okid.abi import host

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parent / "property"))
from program import okid as run_okid  # noqa: E402

CONFIG = HERE.parent / "compatibility" / "0.1.0" / "run.toml"


def test_the_same_json() -> None:
    done = run_okid("check", CONFIG, "--json")
    assert done.returncode == 0, done.stderr
    found = host.config(CONFIG)
    assert json.loads(done.stdout) == found == host.config(CONFIG, CONFIG.read_text())
    assert [one["name"] for one in found["channels"]] == ["force1", "acc1", "acc2"]
    assert found["identification"]["window_s"] == 3.0 and found["buses"][0]["interface"] == "vcan0"
    assert found["geometry"] is None and found["hammer"] is None


def test_geometry_and_passwords(tmp_path: Path) -> None:
    """A geometry is there as it was written; who may publish to a broker is nobody else's business."""
    text = CONFIG.read_text().replace("frame.dbc", str(CONFIG.parent / "frame.dbc"))
    text += '[geometry]\nnodes = [[0, 0, 1.5]]\ndofs = [[1, "x"], [1, "-y"]]\n'
    text += '[publish]\nsocket = "a.sock"\nmqtt = "mqtt://me:secret@localhost/okid"\n'
    found = host.config(tmp_path / "c.toml", text)
    assert found["geometry"] == {"nodes": [[0, 0, 1.5]], "dofs": [[1, "x"], [1, "-y"]]}
    assert found["publish"]["socket"] == str(tmp_path / "a.sock") and "secret" not in json.dumps(found)


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("rate_hz = 100", "rate_hz = -1"),
        ("p = 10", "p = 10\nq = 1"),
        ('signal = "Force1"', 'signal = "Force2"'),
        ("window_s = 3.0", "window_s = 0.1"),
        ('role = "force"', 'role = "wind"'),
        ('detrend = "mean"', 'detrend = "linear"'),
        ("[[bus]]", "[[bus]"),
        ("frame.dbc", "none.dbc"),
    ],
)
def test_the_same_sentence(old: str, new: str, tmp_path: Path) -> None:
    (tmp_path / "frame.dbc").write_text((CONFIG.parent / "frame.dbc").read_text())
    path = tmp_path / "c.toml"
    path.write_text(CONFIG.read_text().replace(old, new, 1))
    done = run_okid("check", path)
    assert done.returncode == 2
    with pytest.raises(okid.InputError) as fault:
        host.config(path)
    assert done.stderr == f"okid: {fault.value}\n" and str(fault.value).startswith(str(path))
