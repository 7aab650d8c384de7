# SPDX-License-Identifier: MIT
"""docs/reference/rig.md against the program, and its examples played."""

from __future__ import annotations

import json
import pathlib
import re

import numpy as np
import pytest
from program import okid
from reference_tables import REFERENCE, codes, documented, keys_of, rows, sections

PAGE = REFERENCE / "rig.md"
LEAST = {"rate_hz": "250", "duration_s": "2", "masses": "[1.0]", "springs": "[1e4]", "zeta": "[0.01]",
         "force_dofs": "[1]", "sense_dofs": "[1]"}  # fmt: skip
INSTEAD = {"M": "masses", "K": "springs", "R": "zeta"}
KEYS, CHANGE = sections(PAGE)["Keys"].split("`[[change]]`, in order")


def said(folder: pathlib.Path, text: str) -> str:
    (folder / "r.toml").write_text(text)
    return okid("simulate", folder / "r.toml", "--log", "/dev/null", "--quiet").stderr.strip()


def rig(more: str, without: str = "") -> str:
    return "".join(f"{key} = {value}\n" for key, value in LEAST.items() if key != without) + more


def table(text: str) -> dict[str, str]:
    return {codes(cells[0])[0]: cells[1] for cells in rows(text, "key | value | default | meaning")}


def test_keys(tmp_path: pathlib.Path) -> None:
    found = table(KEYS)
    assert set(found) == set(said(tmp_path, "nothing = 1\n").split("the keys are: ")[1].split(", "))
    for key, expected in found.items():
        text = rig(f"{key} = 1979-05-27\n", INSTEAD.get(key, key))
        assert said(tmp_path, text).endswith(f"expected {expected}"), f"{key}: {said(tmp_path, text)}"


def test_keys_of_a_change(tmp_path: pathlib.Path) -> None:
    found = table(CHANGE)
    assert set(found) == set(said(tmp_path, rig("[[change]]\nnothing = 1\n")).split("the keys are: ")[1].split(", "))
    for key, expected in found.items():
        at = "" if key == "at_s" else "at_s = 1.0\n"
        assert said(tmp_path, rig(f"[[change]]\n{at}{key} = 1979-05-27\n")).endswith(f"expected {expected}")


def test_defaults_change_nothing(tmp_path: pathlib.Path) -> None:
    """Every default of the page, written out, gives the bytes that the program gives without it."""

    def output(text: str) -> str:
        (tmp_path / "d.toml").write_text(text)
        files = ("--log", tmp_path / "d.log", "--config", tmp_path / "c.toml")
        done = okid("simulate", tmp_path / "d.toml", *files, "--quiet")
        assert done.returncode == 0, done.stderr
        return (tmp_path / "d.log").read_text() + (tmp_path / "c.toml").read_text()

    plain, tried = output(rig("")), 0
    for cells in rows(KEYS, "key | value | default | meaning"):
        key, default = codes(cells[0])[0], codes(cells[2])
        if default and default[0] not in table(KEYS) and "required" not in cells[2]:
            assert output(rig(f"{key} = {default[0]}\n")) == plain, f"{key} = {default[0]}"
            tried += 1
    assert tried >= 7


@pytest.mark.parametrize("example", re.findall(r"```toml\n(.*?)```", PAGE.read_text(), re.DOTALL))
def test_examples_are_played(tmp_path: pathlib.Path, example: str) -> None:
    (tmp_path / "rig.toml").write_text(example)
    done = okid("simulate", tmp_path / "rig.toml", "--log", tmp_path / "a.log", "--config", tmp_path / "a.toml",
                "--truth", tmp_path / "t.json", "--quiet")  # fmt: skip
    assert (done.returncode, done.stderr) == (0, "")
    config = (tmp_path / "a.toml").read_text()
    (tmp_path / "a.toml").write_text(config.replace("update_s = 1.0", "update_s = 5.0"))
    done = okid("replay", tmp_path / "a.log", "-c", tmp_path / "a.toml", "--json", tmp_path / "r.json")
    assert done.returncode == 0, done.stderr
    truth = json.loads((tmp_path / "t.json").read_text())
    found = [mode["frequency_hz"] for mode in json.loads((tmp_path / "r.json").read_text())["modes"]]
    for wanted in truth["frequency_hz"] if "changes" not in truth else []:
        assert min(abs(f - wanted) for f in found) < 0.01 * wanted
    told = {key.split("[]")[0] for key in keys_of(truth)}
    assert told <= {key.split("[]")[0] for key in documented(PAGE.read_text())}


def test_the_truth_on_the_page_is_true(tmp_path: pathlib.Path) -> None:
    shown = re.search(r"```json\n(.*?)```", PAGE.read_text(), re.DOTALL)
    assert shown
    (tmp_path / "one.toml").write_text(rig("springs = [4742.0]\n", "springs"))
    done = okid("simulate", tmp_path / "one.toml", "--truth", "-", "--quiet")
    wanted = json.loads(done.stdout)
    assert json.loads(shown[1]).keys() == wanted.keys()
    for key, value in wanted.items():
        if key != "schema":
            assert np.allclose(json.loads(shown[1])[key], value, rtol=1e-9, atol=1e-12), key
