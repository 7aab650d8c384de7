# SPDX-License-Identifier: MIT
"""Every public class of a result shows itself in a notebook, in one style, and no name that stands in it is markup."""

from __future__ import annotations

import dataclasses
import inspect
from collections.abc import Iterator
from html.parser import HTMLParser
from importlib import import_module
from typing import Any

import numpy as np
import okid
import pytest
from okid.mechanics.grey_box import FittedMode, GreyBox
from okid.result import stabilization

HOSTILE = "<script>alert('1')</script>&amp;\"</td>\u202e"
MODULES = (
    "frf", "modal", "campaign", "mechanics.virtual", "result.parts", "result.stabilization",
    "identification.change_test",
)  # fmt: skip
# What works, instead of being found: it has a state, or says how to find something.
TOOLS = {
    "Accumulator", "CampaignSpec", "ChangeTest", "Collector", "Error", "IdentificationError", "Identifier",
    "InputError", "Session", "SquareRoot", "Turn", "VirtualSensors",
}  # fmt: skip


def public_classes() -> Iterator[type]:
    places = [(okid, okid.__all__)] + [(import_module(f"okid.{name}"), None) for name in MODULES]
    for module, names in places:
        for name in names or getattr(module, "__all__", dir(module)):
            one = getattr(module, name)
            if inspect.isclass(one) and one.__module__.startswith("okid.") and not one.__name__.startswith("_"):
                yield one


CLASSES = sorted({one for one in public_classes() if one.__name__ not in TOOLS}, key=lambda one: one.__name__)


class Seen(HTMLParser):
    """Tags in their order, and the text between them."""

    def __init__(self, page: str) -> None:
        super().__init__()
        self.tags: list[str] = []
        self.open: list[str] = []
        self.text = ""
        self.feed(page)
        self.close()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        assert attrs in ([], [("style", "text-align:right")])
        self.tags.append(tag)
        self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.text += data


def checked(page: str) -> Seen:
    """In the one style: paragraphs, tables, lists, every tag closed, nothing else."""
    seen = Seen(page)
    assert seen.open == []
    assert set(seen.tags) <= {"p", "table", "thead", "tbody", "tr", "th", "td", "ul", "li"}
    assert "table" in seen.tags
    return seen


def test_classes_are_found() -> None:
    names = {one.__name__ for one in CLASSES}
    assert {"Result", "Mode", "Stabilization", "GreyBox", "ChangeVerdict", "Frf", "Poles", "Outcome", "Record"} <= names


@pytest.mark.parametrize("one", CLASSES, ids=lambda one: one.__name__)
def test_it_shows_itself(one: type) -> None:
    assert callable(getattr(one, "_repr_html_", None)), f"{one.__name__} has no _repr_html_"


FIELDS = [one for one in CLASSES if hasattr(one, "_fields") or dataclasses.is_dataclass(one)]
OWN_TABLES = {"GreyBox", "ChangeVerdict", "Result"}  # below


@pytest.mark.parametrize("one", [c for c in FIELDS if c.__name__ not in OWN_TABLES], ids=lambda one: one.__name__)
def test_a_hostile_text_in_any_field_is_text(one: type) -> None:
    named = getattr(one, "_fields", None) or [field.name for field in dataclasses.fields(one)]
    if hasattr(one, "_make"):
        made: Any = one._make([HOSTILE] * len(named))
    else:
        made = object.__new__(one)
        for name in named:
            object.__setattr__(made, name, {HOSTILE: [HOSTILE, None, np.array([1.5, np.nan]), True]})
    seen = checked(made._repr_html_())
    assert seen.text.count("<script>") >= len(named)
    assert "\u202e" not in seen.text and "\\u202e" in seen.text
    assert all(name in seen.text for name in named)


@pytest.fixture(scope="module")
def result() -> okid.Result:
    force, answer = okid.demo_record(5000)
    names = {"input_names": ["f"], "output_names": [f"{HOSTILE}{k}" for k in range(3)]}
    return okid.identify(force, answer, fs=1000.0, p=20, order=6, method="okid-era", **names)


def test_a_result_and_its_parts(result: okid.Result) -> None:
    first = result.modes[0].frequency_hz
    assert f"{first:.5f}" in checked(result._repr_html_()).text
    assert f"{first:.5f}" in checked(result.table()._repr_html_()).text
    assert f"frequency_hz{first:.6g}" in checked(result.modes[0]._repr_html_()).text
    assert "<script>" in checked(result.fit._repr_html_()).text
    checked(result.model._repr_html_())


def test_stabilization(result: okid.Result) -> None:
    diagram = result.stabilization()
    seen = checked(diagram._repr_html_())
    assert seen.tags.count("tr") == 1 + len(diagram.modes) and len(diagram.modes) >= 3
    assert f"Stabilization of {len(diagram)} models" in seen.text
    assert f"{diagram.modes[0].frequency_hz:.5f}" in seen.text
    assert f"{diagram.modes[0].hits} of {diagram.modes[0].models}" in seen.text
    nothing = stabilization.Stabilization([], [], stabilization.Criteria())
    assert checked(nothing._repr_html_()).tags.count("tr") == 1


def test_grey_box() -> None:
    frame = okid.Structure.chain([1.0], [3e4])
    made = GreyBox({HOSTILE: 2.5, "k": 3e4}, {HOSTILE: 0.1, "k": float("nan")}, frame,
                   [FittedMode(2, 10.0, 10.1, 0.01, 0.011, 0.99)], 1.25, np.eye(2))  # fmt: skip
    seen = checked(made._repr_html_())
    assert "misfit 1.25" in seen.text and "<script>" in seen.text and "10.10000" in seen.text
    assert "30000–" in seen.text  # no deviation: a dash


def test_change_verdict() -> None:
    shifts = [okid.ModeShift(10.0, 0.01, -0.002, 0.001), okid.ModeShift(30.0, 0.01, -0.05, 0.001)]
    text = checked(okid.ChangeVerdict(True, 1e-9, 80.0, 4.0, 1, 12, shifts)._repr_html_()).text
    assert text.startswith("alarm: p-value 1e-09, 12 blocks") and "-50.1←" in text and text.count("←") == 1
    calm = checked(okid.ChangeVerdict(False, float("nan"), 0.0, 4.0, 0, 2, shifts)._repr_html_()).text
    assert calm.startswith("no alarm: p-value –") and "←" not in calm


def test_long_arrays_are_their_shape() -> None:
    seen = checked(
        okid.Model(np.zeros((20, 20)), np.zeros((20, 1)), *[np.zeros((3, 20))] * 2, np.eye(3), 1e-3)._repr_html_()
    )
    assert "20 × 20" in seen.text and len(seen.text) < 1000
