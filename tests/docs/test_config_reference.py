# SPDX-License-Identifier: MIT
"""docs/reference/config.md against the program: it is asked what it knows, and what it expects of each key."""

from __future__ import annotations

import pathlib
import re

import pytest
from command_help import ROOT
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


def initialisers(struct: str) -> dict[str, str]:
    """member -> value of a struct of config.hpp."""
    body = re.search(rf"struct {struct} \{{(.*?)\n\}};", (SOURCES / "config.hpp").read_text(), re.DOTALL)
    assert body, struct
    text = re.sub(r"///<?[^\n]*", "", body[1])
    return {name: value.strip() for name, value in re.findall(r"(\w+) = ([^,;]+)[,;]", text)}


IN_CONFIG_HPP = {
    "identification": (
        "method", "p", "hankel", "hold", "detrend", "update_s", "sigma_blocks", "restart_on_change", "mkr",
        "max_memory_mb", "decimate",
    ),
    "alarm": ("enabled", "k_sigma", "baseline_updates", "false_alarm"),
    "trigger": ("pretrigger_s",),
    "hammer": ("hits", "length_s", "pretrigger_s", "double_percent", "spectrum_hz"),
    "record": ("directory", "segment_mb", "max_mb", "pretrigger_s"),
    "publish": ("samples",),
    "realtime": ("priority", "lock_memory"),
    "bus": ("type", "fd", "counter_bits"),
}  # fmt: skip


@pytest.mark.parametrize("section", IN_CONFIG_HPP)
def test_defaults_are_those_of_the_source(section: str) -> None:
    source, table = initialisers(f"{section}_config"), page_rows(section)
    for key in IN_CONFIG_HPP[section]:
        assert codes(table[key][1])[0] == source[key], f"{PAGE.name}, [{section}] {key}"


OF_OTHER_FILES = {
    ("bus", "baud"): ("config_line.cpp", r"usual_baud = (\d+);"),
    ("publish", "discovery"): ("config.hpp", r"bool discovery = (\w+);"),
    ("bus", "sync_id"): ("config_send.cpp", r"canopen_sync_id = (0x[0-9a-f]+);"),
    ("bus", "clock"): ("config_clock.cpp", r'\["clock"\]\.value_or\(std::string\("(\w+)"\)\)'),
    ("acquisition", "decimate"): ("config_clock.cpp", r'\["decimate"\]\.value_or\(std::int64_t\{(\d+)\}\)'),
    ("channel", "byte_order"): ("config_channel.cpp", r'table\["byte_order"\]\.value_or\(std::string\("(\w+)"\)\)'),
    ("channel", "value"): ("config_channel.cpp", r'\["value"\]\.value_or\(std::string\("(\w+)"\)\)'),
    ("channel", "signed"): ("config_channel.cpp", r'\["signed"\]\.value_or\((\w+)\)'),
    ("identification", "refine"): ("config_identification.cpp", r'std::string\(agreed \? "(\w+)" : "no"\)'),
    ("identification", "sigma"): ("config_identification.cpp", r'"sigma_blocks"\) \? "jackknife" : "(\w+)"'),
    ("trigger", "source"): ("config_trigger.cpp", r'\["source"\]\.value_or\(std::string\("(\w+)"\)\)'),
    ("trigger", "edge"): ("config_trigger.cpp", r'\["edge"\]\.value_or\(std::string\("(\w+)"\)\)'),
    ("trigger", "active_low"): ("config_trigger.cpp", r'\["active_low"\]\.value_or\((\w+)\)'),
}


@pytest.mark.parametrize("section, key", OF_OTHER_FILES)
def test_other_defaults(section: str, key: str) -> None:
    name, pattern = OF_OTHER_FILES[section, key]
    found = re.search(pattern, (SOURCES / name).read_text())
    assert found, f"{name} has changed: {pattern}"
    value = str(int(found[1], 0)) if found[1].startswith("0x") else found[1]
    assert codes(page_rows(section)[key][1])[0].strip('"') == value


def test_every_default_is_checked_by_one_of_the_two_above() -> None:
    """A literal in the column "default" that nothing compares with the source would grow stale."""
    checked = {(section, key) for section, keys in IN_CONFIG_HPP.items() for key in keys} | set(OF_OTHER_FILES)
    apart = {("channel", "extended"), ("channel", "scale"), ("channel", "offset"), ("channel", "zero_code"),
             ("identification", "rows"), ("identification", "order")}  # fmt: skip
    for section in (name.strip("[]") for name in sections(PAGE)):
        for key, (_, default, _) in page_rows(section).items():
            if default.startswith(("`", "2 `p`")):
                assert (section, key) in checked | apart, f"{PAGE.name}, [{section}] {key}: {default}"
