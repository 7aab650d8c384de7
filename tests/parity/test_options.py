# SPDX-License-Identifier: MIT
"""An option of an identification is declared once, in firmware_host/record/identify_options.cpp: what Python, campaigns
and the page of okid-live offer is what that table has."""

from __future__ import annotations

import inspect
import re
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import okid
import pytest
from okid.campaign.spec_keys import KEYS, Number
from okid.identification import host_result
from okid.identification.stream import HostStream

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tests" / "docs"))
from command_help import options_of  # noqa: E402

OF_FILES = {  # of the command line alone: which files, and what comes out
    "records", "--places", "--frf", "--exponential", "--setups", "--references", "--range", "--group", "--all-modes",
    "--json", "--model", "--quiet", "--help",
}  # fmt: skip
TYPED = {option.names[0]: option.value for option in options_of("okid identify") if option.names[0] not in OF_FILES}
ARRAYS = [np.zeros((8, 1))]


def known(call: Callable[[dict[str, Any]], Any]) -> set[str]:
    """The options that a door of the library lists when it is asked for one that there is not."""
    with pytest.raises(okid.InputError) as refused:
        call({"nothing_of_the_kind": 1})
    listed = re.search(r"expected one of: (.*)", str(refused.value))
    assert listed
    return set(listed[1].split(", "))


def of_records() -> set[str]:
    return known(lambda options: host_result.identify(options, ARRAYS, ARRAYS))


def keywords(function: Callable[..., Any]) -> set[str]:
    return {p.name for p in inspect.signature(function).parameters.values() if p.kind is p.KEYWORD_ONLY}


def test_records_know_what_the_command_line_has() -> None:
    assert len(TYPED) > 20
    own = {"units", "references"}  # said by the header of a file; an option of set-ups, as --references
    assert of_records() - own == {name.removeprefix("--").replace("-", "_") for name in TYPED}


def test_identify_offers_what_the_library_knows() -> None:
    of_arrays = {"inputs", "outputs", "references"}  # named by the arguments input_names and output_names
    assert keywords(okid.identify) - {"input_names", "output_names"} == of_records() - of_arrays


def test_session_offers_what_streams_know() -> None:
    offered = keywords(okid.Session.__init__) | {"inputs", "outputs"}
    assert offered == known(HostStream) - {"states_only", "saturated"}  # of campaigns


@pytest.mark.parametrize(("option", "value"), [("band", (1.0, 40.0)), ("decimate", 2), ("max_order", 12)])
def test_session_takes_every_option(option: str, value: Any) -> None:
    """`band` and `decimate` of 0.2 were arguments that the library refused."""
    session = okid.Session(1, 2, fs=100.0, **{option: value})
    assert session.fs == 100.0


def test_campaigns_take_the_same_values() -> None:
    rules = KEYS["identification"]
    assert set(rules) - {"pieces"} <= of_records()
    words = {name: set(value.split("|")) for name, value in TYPED.items()}
    assert set(rules["method"]) == words["--method"] - {"plscf"}  # takes whole records
    assert set(rules["hankel"]) == words["--hankel"]
    assert set(rules["detrend"]) == words["--detrend"] - {"linear"}  # a group has no line of its own
    for key, rule in rules.items():
        if not isinstance(rule, Number) or key == "pieces":
            continue
        for value in (rule.low, rule.high):
            used = {key: int(value), "method": "auto" if key == "decimate" else "okid-era"}
            with pytest.raises(okid.Error) as refused:  # eight samples of nothing bear no model
                host_result.identify({"inputs": ["u"], "outputs": ["y"], "fs": 1.0, **used}, ARRAYS, ARRAYS)
            assert "expected a whole number" not in str(refused.value)


def test_the_page_offers_the_same_methods() -> None:
    page = (ROOT / "tools" / "okid" / "web" / "live.html").read_text()
    listed = re.search(r'<select id="start-method">(.*?)</select>', page)
    assert listed
    assert set(re.findall(r">([\w-]+)</option>", listed[1])) == set(TYPED["--method"].split("|"))
