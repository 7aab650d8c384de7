# SPDX-License-Identifier: MIT
"""A result that was saved and loaded does what a fresh one does, of every kind, or refuses with the same clear line."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import beam
import numpy as np
import okid
import pytest
from okid import plots, report
from words_only import leave_pictures_out

KINDS = ("auto", "named", "ambient", "responses", "merged", "set-ups", "struck")
WORKS: dict[str, Callable[[okid.Result, Path], Any]] = {
    "table": lambda r, _: str(r.table()) + str(list(r.table())),
    "notebook": lambda r, _: r._repr_html_(),
    "dict": lambda r, _: okid.Result.from_dict(r.to_dict()).to_dict(),
    "shapes": lambda r, _: plots.shapes(r)._repr_svg_() != "",
    "mac": lambda r, _: plots.mac(r)._repr_svg_() != "",
    "singular_values": lambda r, _: plots.singular_values(r)._repr_svg_() != "",
    "fit": lambda r, _: plots.fit(r)._repr_svg_() != "",
    "frf": lambda r, _: plots.frf(r)._repr_svg_() != "",
    "stabilization": lambda r, _: plots.stabilization(r)._repr_svg_() != "",
    "uff": lambda r, folder: _uff(r, folder),
    "mat": lambda r, folder: okid.write_mat(folder / "a.mat", r),
    "hdf5": lambda r, folder: okid.write_hdf5(folder / "a.h5", r),
    "report": lambda r, folder: report.write_report(r, folder / "a.html") > 10_000,
    "compare": lambda r, _: okid.compare(r, r).changed,
    "scipy": lambda r, _: r.to_scipy().A.shape,
}
NO_DECOMPOSITION = "has no decomposition of its own: for a stabilization diagram identify again, as in okid.identify"
REFUSED = {  # (kind, function): what stands in the line
    **{(kind, "stabilization"): NO_DECOMPOSITION for kind in KINDS if kind != "named"},
    **{(kind, "singular_values"): "has no singular values: name a method" for kind in KINDS if kind != "named"},
    **{(kind, "frf"): "no inputs, so there is no response to draw" for kind in ("ambient", "merged", "set-ups")},
    **{(kind, "fit"): "this result has no fit: it takes a record" for kind in ("merged", "set-ups")},
}  # fmt: skip
REFUSED_LOADED = {("named", "stabilization"): "no longer holds its decomposition: identify again"}


def _uff(result: okid.Result, folder: Path) -> Any:
    okid.write_uff(folder / "a.uff", result)
    return [(mode.nodes, mode.shape.tolist()) for mode in okid.read_uff(folder / "a.uff").modes]


def _merged(u: Any, y: Any) -> okid.Result:
    """Two of three modes are in two of three set-ups: a confident mode without a value at "d"."""
    parts = [
        okid.identify(u, y[:, [0, 1]], fs=1000.0, output_names=["a", "b"]),
        okid.identify(u, y[:, [0, 2]], fs=1000.0, output_names=["a", "c"]),
        okid.identify(u, np.column_stack([y[:, 0], y[:, 1] - y[:, 2]]), fs=1000.0, output_names=["a", "d"],
                      band=(0.0, 20.0)),
    ]  # fmt: skip
    return okid.merge(parts)


def _struck() -> okid.Result:
    rng = np.random.default_rng(5)
    hits = [beam.record(beam.Hit(place, 100.0, 0.0015), rng, 0.002) for place in (1, 4, 7, 9)]
    sides = [hit[:, :1] for hit in hits], [hit[:, 1:] for hit in hits]
    return okid.identify(*sides, fs=beam.FS, hit_dofs=[1, 4, 7, 9], output_dofs=[1, 5])


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> dict[tuple[str, str], okid.Result]:
    u, y = okid.demo_record()
    fresh = {
        "auto": okid.identify(u, y, fs=1000.0),
        "named": okid.identify(u, y, fs=1000.0, method="okid-era", input_dofs=[1], output_dofs=[1, 2, 3]),
        "ambient": okid.identify(None, y, fs=1000.0),
        "responses": okid.identify_frf(okid.frf.h1(u, y, 1000.0, nperseg=4096), band=(5.0, 80.0)),
        "merged": _merged(u, y),
        "set-ups": okid.identify_setups(None, [y[:, [0, 1]], y[:, [0, 2]]], fs=1000.0, output_names=["ab", "ac"]),
        "struck": _struck(),
    }
    out = {}
    folder = tmp_path_factory.mktemp("results")
    for kind, result in fresh.items():
        result.save(folder / f"{kind}.json")
        out[kind, "fresh"], out[kind, "loaded"] = result, okid.Result.load(folder / f"{kind}.json")
    return out


@pytest.mark.parametrize("function", WORKS)
@pytest.mark.parametrize("kind", KINDS)
def test_fresh_and_loaded(
    results: dict[tuple[str, str], okid.Result], kind: str, function: str, tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    if function == "report":
        leave_pictures_out(monkeypatch)
    made: list[Any] = []
    for way in ("fresh", "loaded"):
        words = REFUSED.get((kind, function)) or (REFUSED_LOADED.get((kind, function)) if way == "loaded" else None)
        if words is None:
            made.append(WORKS[function](results[kind, way], tmp_path))
            continue
        with pytest.raises(okid.Error) as told:
            WORKS[function](results[kind, way], tmp_path)
        assert words in str(told.value) and "\n" not in str(told.value)
    assert len(made) < 2 or made[0] == made[1]


def test_places_that_were_not_measured(results: dict[tuple[str, str], okid.Result], tmp_path: Path) -> None:
    """They are no zeros: absent from the mode of a universal file, a gap in a picture, null in the moving shapes."""
    merged = results["merged", "loaded"]
    assert [mode.confident for mode in merged.modes] == [True] * 3
    assert [bool(np.isnan(mode.shape[3])) for mode in merged.modes] == [False, True, True]
    assert [nodes for nodes, _ in _uff(merged, tmp_path)] == [[1, 2, 3, 4], [1, 2, 3], [1, 2, 3]]
    text = "[geometry]\nnodes = [[0, 0, 0], [0, 0, 1], [0, 0, 2], [0, 0, 3]]\nlines = [[1, 2], [2, 3], [3, 4]]\n"
    (tmp_path / "c.toml").write_text(text + 'dofs = [[1, "x"], [2, "x"], [3, "x"], [4, "x"]]\n')
    report.write_report(merged, tmp_path / "a.html", geometry=tmp_path / "c.toml")
    page = (tmp_path / "a.html").read_text()
    assert ',null],"im"' in page and "A place without a bar was not measured" in page
    assert "Not measured, and left open in the shapes: mode 2 at d; mode 3 at d" in page
    assert not re.search(r"[\s\",]nan[\s\",]", page, re.IGNORECASE)  # in no coordinate of a picture
