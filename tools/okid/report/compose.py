# SPDX-License-Identifier: MIT
"""From a result and what belongs to it to one HTML page, as text or as a file."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any, cast

import matplotlib

from okid._errors import InputError
from okid.data.toml_file import read_toml
from okid.report import page
from okid.report.agreement import fit_section, history_section, residual_section
from okid.report.comparison import Other, comparison_section
from okid.report.events import read_events
from okid.report.expert import circle_section, indicator_section, modal_mass_section, spectrogram_section
from okid.report.geometry import TABLES, read_geometry
from okid.report.given_records import Given, listed, take_records
from okid.report.loaded import Loaded, load_result, loaded_from
from okid.report.mass import mass_section
from okid.report.material import Material
from okid.report.modes import shape_sections, table_section
from okid.report.operating import operating_section
from okid.report.other_kinds import check_kind
from okid.report.page import count_of
from okid.report.picking import has_poles, picking_section
from okid.report.places import hits_section, place_section, set_ups_section
from okid.report.provenance import provenance_section, source_of
from okid.report.responses import (
    check_section,
    frf_section,
    markov_section,
    singular_section,
    spectra_section,
    stabilization_section,
)
from okid.report.summary import summary_section
from okid.report.svg import Pictures
from okid.report.targets import check_place, check_target, folder_for, write_whole
from okid.report.tracking import tracking_section
from okid.result import figures
from okid.result.result import Result

Place = str | Path
SECTIONS = 31  # that _sections() comes to when nothing is missing


def _sections(m: Material, written: str | None) -> Iterator[page.Section | None]:
    yield summary_section(m)
    yield table_section(m)
    yield set_ups_section(m)
    yield from shape_sections(m)
    yield comparison_section(m)
    yield hits_section(m)
    yield modal_mass_section(m)
    yield from mass_section(m)
    yield tracking_section(m)
    yield picking_section(m) if has_poles(m) else stabilization_section(m)
    yield indicator_section(m)
    yield singular_section(m)
    pairs: list[tuple[int, int]] = []
    if m.result.inputs:
        responses, pairs = (place_section if m.struck else frf_section)(m)
        yield responses
        yield check_section(m)
        yield circle_section(m)
        yield markov_section(m, pairs)
    elif not m.result.raw.get("set_ups"):
        yield spectra_section(m)
        yield operating_section(m)
    yield spectrogram_section(m)
    yield fit_section(m)
    yield history_section(m, pairs)
    yield residual_section(m)
    yield provenance_section(m, written)


def _placed(m: Material, geometry: Place | None, config: Place | None) -> None:
    """Structure and texts of the configurations: of `geometry`, else [geometry] of `config` when it has one."""
    live = {} if m.events is None else m.events.channels
    if geometry is not None:
        m.structure = read_geometry(geometry, m.result.raw, live)
        if m.structure is None:
            raise InputError(f"{geometry}: no section [geometry], expected nodes, dofs and lines")
    elif config is not None:
        m.structure = read_geometry(config, m.result.raw, live)
    for place in dict.fromkeys(str(one) for one in (config, geometry) if one is not None):
        if Path(place).suffix.lower() not in TABLES:
            m.texts.append((place, read_toml(place)[1]))


def build(
    result: Loaded,
    record: Given | Sequence[Given] | None = None,
    title: str | None = None,
    *,
    events: Place | None = None,
    geometry: Place | None = None,
    config: Place | None = None,
    compare: Place | None = None,
    source: Place | None = None,
    written: str | None = None,
    figures_folder: Place | None = None,
    progress: Callable[[float], None] | None = None,
) -> str:
    """The report as one HTML string; the same arguments and files give the same string.

    `record`: a file, what read_csv (of a result of responses: read_frf) returns, or a list of them: every hit of a
    hammer test, by the names of the files; records that were merged. Without one the hits that the result names are
    read, where all their files are beside `source` or here. `events`: JSON lines of the run; `config`: CONFIG.toml;
    `geometry`: that too, a .csv or a universal file; `compare`: the file of an earlier result; `source`: the file of
    the result, named in the provenance; `written`: when and by what, None = left out; `figures_folder`: every picture
    goes there as .svg, .png and .csv (its numbers) too; `progress`: called with the share that is drawn.
    Raises InputError or IdentificationError when a file cannot be read or does not belong to the result.
    """
    m = Material(result, pictures=Pictures(folder_for(figures_folder)))
    places = {"result": source, "events": events, "geometry": geometry, "config": config, "compare": compare}
    for kind, path in places.items():
        if path is not None:
            if kind != "geometry" or Path(path).suffix.lower() not in TABLES:
                check_kind(path, {"geometry": "config", "compare": "result"}.get(kind, kind))
            m.sources.append(source_of(kind, path))
    m.other = None if compare is None else Other(load_result(compare), Path(compare).name)
    m.events = None if events is None else read_events(events)
    _placed(m, geometry, config)
    taken = take_records(result, record, source)
    m.measured, m.no_record = taken.measured, taken.absent
    m.sources[1 if source is not None else 0 : 1 if source is not None else 0] = taken.sources
    with matplotlib.rc_context(cast(Any, figures.STYLE)):
        sections: list[page.Section] = []
        for k, one in enumerate(_sections(m, written), 1):
            sections += [one] if one is not None else []
            if progress is not None:
                progress(min(k / SECTIONS, 0.99))
    raw = result.raw
    forces = f"hits at {count_of(len(result.inputs), 'place')}" if m.struck else count_of(len(result.inputs), "input")
    if result.raw.get("set_ups"):
        forces = count_of(len(result.raw["set_ups"]), "set-up")
    subtitle = (
        f"{count_of(len(result.confident), 'confident mode')}, {forces}, {count_of(len(result.outputs), 'output')}"
    )
    foot = f"okid {raw.get('version', '')}, schema {raw['schema']}. SI units unless the channel names say otherwise."
    known = m.events.notes.get("title") if m.events is not None else None
    return page.page(title or str(raw.get("title") or known or "Modal identification"), subtitle, sections, foot)


def _loaded(result: object) -> Loaded:
    """A Result, its to_dict(), a file or what load_result() returns. InputError for anything else."""
    if isinstance(result, Loaded):
        return result
    if isinstance(result, str | Path):
        return load_result(result)
    if isinstance(result, Result):
        return loaded_from(result.to_dict(), "the result")
    if isinstance(result, dict):
        return loaded_from(result, "the result")
    raise InputError(
        f"result is {result!r:.60}, expected what okid.identify() returns, its to_dict(), or the name of an "
        "okid.result/1 file"
    )


def write_report(
    result: Result | Loaded | dict[str, Any] | Place,
    path: Place,
    record: Given | Sequence[Given] | None = None,
    *,
    title: str | None = None,
    events: Place | None = None,
    geometry: Place | None = None,
    config: Place | None = None,
    compare: Place | None = None,
    written: str | None = None,
    figures_folder: Place | None = None,
) -> int:
    """Write the report of a Result (its to_dict(), or a result file) to `path` as one HTML file; returns its bytes.

    Arguments as of build(). Raises InputError with one line for what cannot be read, and when `path` is one of the
    files that are read or an existing file that is not HTML; OSError when `path` cannot be written.
    """
    if not isinstance(path, str | Path):
        raise InputError(f"path is {path!r:.60}, expected the name of the HTML file to write")
    source = result if isinstance(result, str | Path) else None
    named = [one for one in listed(record) if isinstance(one, str | Path)]
    check_target(
        path, {"result": source, "record": named, "events": events, "geometry": geometry, "config": config,
               "compare": compare},
    )  # fmt: skip
    check_place(path, "path")
    text = build(
        _loaded(result), record, title, events=events, geometry=geometry, config=config, compare=compare, source=source,
        written=written, figures_folder=figures_folder,
    )  # fmt: skip
    write_whole(path, text)
    return len(text.encode("utf-8"))
