# SPDX-License-Identifier: MIT
"""docs/reference/config.md against the program: it is asked what it knows, and what it expects of each key."""

from __future__ import annotations

import json
import pathlib
import re
from typing import Any

import pytest
from command_help import ROOT
from page_runner import LEAST_CONFIG
from program import okid
from reference_tables import REFERENCE, codes, rows, sections

PAGE = REFERENCE / "config.md"
COLUMNS = "key | value | default | meaning"
MANY = ("bus", "channel")  # [[name]]
SOURCES = ROOT / "firmware_host" / "config"


def page_rows(section: str) -> dict[str, list[str]]:
    """key -> [value, default, meaning] of the first table of a section."""
    text = sections(PAGE)[f"[[{section}]]" if section in MANY else f"[{section}]"]
    return {codes(cells[0])[0]: cells[1:] for cells in rows(text.split("Each is a table")[0], COLUMNS)}


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> pathlib.Path:
    return tmp_path_factory.mktemp("config")


def said(folder: pathlib.Path, text: str) -> str:
    """What `okid check` says against a config."""
    (folder / "c.toml").write_text(text)
    return okid("check", folder / "c.toml").stderr.strip()


def known(folder: pathlib.Path, text: str, before: str = "known here: ") -> list[str]:
    return said(folder, text).split(before)[1].split(", ")


def program_sections(folder: pathlib.Path) -> list[str]:
    return known(folder, "[nothing_of_the_kind]\n", "known: ")


def head(section: str) -> str:
    return f"[[{section}]]\n" if section in MANY else f"[{section}]\n"


def test_sections(folder: pathlib.Path) -> None:
    assert {name.strip("[]") for name in sections(PAGE)} == set(program_sections(folder))


def test_keys_and_what_is_expected_of_them(folder: pathlib.Path) -> None:
    """Asked by a key that cannot be, and by a date, which no key takes."""
    for section in program_sections(folder):
        table = page_rows(section)
        keys = known(folder, head(section) + "nothing_of_the_kind = 1\n")
        assert set(table) == set(keys), f"{PAGE.name}, [{section}]"
        for key in keys:
            expected = said(folder, head(section) + f"{key} = 1979-05-27\n").split("expected ", 1)[1]
            assert table[key][0] == expected, f"{PAGE.name}, [{section}] {key}: the program expects {expected}"


def test_keys_of_a_lamp(folder: pathlib.Path) -> None:
    table = dict((codes(c[0])[0], c[1]) for c in rows(sections(PAGE)["[lamps]"].split("Each is a table")[1], COLUMNS))
    assert set(table) == set(known(folder, "[lamps]\ngo = { nothing = 1 }\n"))
    for key, value in table.items():
        assert said(folder, f"[lamps]\ngo = {{ {key} = 1979-05-27 }}\n").endswith(f"expected {value}")


SHOWN = {
    "acquisition": ("decimate",),
    "bus": ("type", "clock", "fd", "adapter_channel"),
    "channel": ("extended", "byte_order", "signed", "value", "scale", "offset"),
    "identification": (
        "method", "hankel", "order", "hold", "detrend", "refine", "window", "update_s", "sigma", "sigma_blocks",
        "restart_on_change", "mkr",
    ),
    "alarm": ("enabled", "k_sigma", "baseline_updates", "false_alarm"),
    "trigger": ("source", "pretrigger_s"),
    "hammer": ("hits", "length_s", "pretrigger_s", "double_percent", "spectrum_hz"),
    "record": ("directory", "segment_mb", "max_mb", "pretrigger_s"),
    "publish": ("samples",),
}  # fmt: skip
NEEDED = {"trigger": 'source = "level"\nchannel = "force"\nlevel = 2.0\n', "hammer": "level = 20.0\n"}


def shown(folder: pathlib.Path, more: str = "", rate: str = "1000.0") -> dict[str, Any]:
    """What `okid check --json` says of the least config and some lines more."""
    (folder / "c.toml").write_text(LEAST_CONFIG.replace("1000.0", rate) + more)
    said: dict[str, Any] = json.loads(okid("check", folder / "c.toml", "--json", status=0).stdout)
    del said["sections"]
    return said


@pytest.mark.parametrize("section", SHOWN)
def test_defaults_are_those_of_the_program(folder: pathlib.Path, section: str) -> None:
    """A section that is not there is one without a key; `okid check` shows what stands then."""
    said, table = (
        shown(folder, f"[{section}]\n{NEEDED.get(section, '')}" if section not in LEAST_CONFIG else ""),
        page_rows(section),
    )
    values = {"acquisition": said, "bus": said["buses"][0], "channel": said["channels"][1]}.get(section) or said[
        section
    ]
    for key in SHOWN[section]:
        named = codes(table[key][1])
        literal = {"extended": "false", "scale": named[-1], "offset": named[-1]}.get(key, named[0]).strip('"')
        value = values[key] if key != "source" else shown(folder)["trigger"]["source"]
        value = pathlib.Path(value).name if key == "directory" else value
        found = json.dumps(value).strip('"')
        assert found in (literal, f"{literal}.0"), f"{PAGE.name}, [{section}] {key}: the program takes {found}"


@pytest.mark.parametrize("rate", ["1000.0", "1.0"])
def test_a_section_that_is_not_there_is_an_empty_one(folder: pathlib.Path, rate: str) -> None:
    assert shown(folder, "", rate) == shown(folder, "[identification]\n[alarm]\n", rate)


OF_OTHER_FILES = {
    ("bus", "baud"): ("config_line.cpp", r"usual_baud = (\d+);"),
    ("publish", "discovery"): ("config.hpp", r"bool discovery = (\w+);"),
    ("bus", "sync_id"): ("config_send.cpp", r"canopen_sync_id = (0x[0-9a-f]+);"),
    ("bus", "counter_bits"): ("config.hpp", r"counter_bits = (\d+)[,;]"),
    ("identification", "p"): ("config.hpp", r"int p = (\d+), rows"),
    ("identification", "decimate"): ("config_identification.cpp", r'\["decimate"\]\.value_or\(std::int64_t\{(\d+)\}\)'),
    ("identification", "max_memory_mb"): ("config.hpp", r"max_memory_mb = (\d+);"),
    ("realtime", "priority"): ("config.hpp", r"int priority = (\d+)"),
    ("realtime", "lock_memory"): ("config.hpp", r"bool lock_memory = (\w+)"),
    ("trigger", "edge"): ("config_trigger.cpp", r'\["edge"\]\.value_or\(std::string\("(\w+)"\)\)'),
    ("trigger", "active_low"): ("config_trigger.cpp", r'\["active_low"\]\.value_or\((\w+)\)'),
}


@pytest.mark.parametrize("section, key", OF_OTHER_FILES)
def test_defaults_that_are_not_shown(section: str, key: str) -> None:
    name, pattern = OF_OTHER_FILES[section, key]
    found = re.search(pattern, (SOURCES / name).read_text())
    assert found, f"{name} has changed: {pattern}"
    value = str(int(found[1], 0)) if found[1].startswith("0x") else found[1]
    assert codes(page_rows(section)[key][1])[0].strip('"') == value


def test_every_default_is_checked_by_one_of_the_two_above() -> None:
    """A literal in the column "default" that nothing compares with the program would grow stale."""
    checked = {(section, key) for section, keys in SHOWN.items() for key in keys} | set(OF_OTHER_FILES)
    apart = {("channel", "zero_code"), ("identification", "rows")}
    for section in (name.strip("[]") for name in sections(PAGE)):
        for key, (_, default, _) in page_rows(section).items():
            if default.startswith(("`", "2 `p`")):
                assert (section, key) in checked | apart, f"{PAGE.name}, [{section}] {key}: {default}"
