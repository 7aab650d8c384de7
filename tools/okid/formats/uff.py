# SPDX-License-Identifier: MIT
"""Universal files (.uff, .unv): time histories, FRFs, mode shapes, nodes and lines, in and out."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np

from okid import abi, frf
from okid._errors import InputError
from okid.data.geometry import Geometry, axis_and_sign
from okid.data.geometry import Place as GeometryPlace
from okid.data.records import Record, even_rate
from okid.data.whole_file import whole_file
from okid.formats.foreign_library import reading
from okid.formats.result_tree import mode_arrays, result_dict, result_tree
from okid.formats.uff_blocks import read_blocks
from okid.formats.uff_function import FRF, ROLE_CODES, TIME, UffFunction, function_bytes, read_function
from okid.formats.uff_model import (
    UffMode,
    header_text,
    mode_text,
    read_elements,
    read_header,
    read_lines,
    read_mode,
    read_nodes,
    read_units,
    structure_text,
    units_text,
)
from okid.result.left_out import kept_outputs, without_left_out
from okid.result.result import Result
from okid.result.shape_places import entry_numbers, force_numbers, known_numbers, named_node, places_of_shapes

FRF_LINES = 1025
Place = tuple[int, int, int]  # node, axis 0..2, sign
_SENSING = {"acceleration": (12, "m/s^2"), "velocity": (11, "m/s"), "displacement": (8, "m")}


@dataclass
class UffFile:
    """What a universal file holds. nodes: coordinates by number; lines: pairs of nodes; elements: kind (descriptor of
    the format) and nodes; others: data sets left out."""

    functions: list[UffFunction] = field(default_factory=list)
    modes: list[UffMode] = field(default_factory=list)
    nodes: dict[int, tuple[float, float, float]] = field(default_factory=dict)
    lines: list[tuple[int, int]] = field(default_factory=list)
    elements: list[tuple[int, tuple[int, ...]]] = field(default_factory=list)
    header: dict[str, str] = field(default_factory=dict)
    others: list[int] = field(default_factory=list)

    @property
    def frfs(self) -> list[UffFunction]:
        """The frequency response functions."""
        return [one for one in self.functions if one.kind == FRF]

    def record(self, group: int | str | None = None) -> Record:
        """The time histories as one record.

        Functions of different length, rate or start are different records: an InputError lists them with numbers,
        `group` chooses one. Nothing is resampled: an uneven abscissa is an InputError.
        """
        groups: list[list[UffFunction]] = []
        keys: list[tuple[Any, ...]] = []
        for one in self.functions:
            if one.kind in (0, TIME) and not np.iscomplexobj(one.values) and len(one.values):
                key = (len(one.values), _rate(one), round(one.start / (one.step or 1.0), 3))
                if key not in keys:
                    keys.append(key)
                    groups.append([])
                groups[keys.index(key)].append(one)
        if not groups and self.frfs:
            raise InputError(
                f"holds no time history but {len(self.frfs)} frequency responses: okid identify FILE --frf"
            )
        return _record(_choose(groups, group))


def _rate(one: UffFunction) -> float | str:
    return even_rate(one.abscissa) if one.abscissa is not None else one.rate_hz


def _listed(groups: list[list[UffFunction]]) -> str:
    texts = []
    for number, group in enumerate(groups, 1):
        rate = _rate(group[0])
        grid = f"{rate:g} Hz" if isinstance(rate, float) else "uneven"
        shown = ", ".join(one.name for one in group[:6]) + (" .." if len(group) > 6 else "")
        texts.append(f"{number}: {shown} ({len(group[0].values)} samples, {grid}, from {group[0].start:g} s)")
    return "; ".join(texts)


def _choose(groups: list[list[UffFunction]], group: int | str | None) -> list[UffFunction]:
    if not groups:
        raise InputError("holds no time history (data set 58, function type 1)")
    if group is None:
        if len(groups) > 1:
            raise InputError(
                f"time histories on {len(groups)} grids, okid does not resample: "
                f"choose with group= or --group ({_listed(groups)})"
            )
        return groups[0]
    if not str(group).isdigit() or not 1 <= int(group) <= len(groups):
        raise InputError(f"group is {group!r}, expected one of {_listed(groups)}")
    return groups[int(group) - 1]


def _unique(names: list[str]) -> list[str]:
    """Names that stand twice get their position: "a", "a (2)"."""
    out: list[str] = []
    for name in names:
        clean = "".join(c if c.isprintable() else " " for c in name).strip() or "function"
        again = clean
        while again in out:
            again = f"{clean} ({len(out) + 1})"
        out.append(again)
    return out


def _record(group: list[UffFunction]) -> Record:
    first = group[0]
    rate = _rate(first)
    if isinstance(rate, str):
        raise InputError(f"{first.name}: {rate}; an even abscissa is required, okid does not resample")
    start = first.known.get("start_time")
    notes = {} if start or first.date == "NONE" else {"date": first.date}
    dofs = [one.known["dof"] if isinstance(one.known.get("dof"), int) else None for one in group]
    return Record(
        _unique([one.name for one in group]), np.column_stack([one.values for one in group]), rate,
        [one.unit for one in group], first.title, datetime.fromisoformat(start) if start else None,
        [one.role for one in group], dofs, notes,
    )  # fmt: skip


def read_uff(path: str | Path) -> UffFile:
    """Read a universal file, ASCII or binary: data sets 15, 55, 58, 58b, 82, 151, 164, 2411 and
    2412; the rest is counted.

    About 1 s for 10^6 samples in ASCII, far less in binary. InputError of one line names the file, the data set and
    the line that is wrong or cut off.
    """
    out, units = UffFile(), dict[int, str]()
    with reading(path, "a universal file"):
        for block in read_blocks(path):
            if block.kind == 58:
                out.functions.append(read_function(block, len(out.functions) + 1))
            elif block.kind == 55 and (mode := read_mode(block)) is not None:
                out.modes.append(mode)
            elif block.kind in (15, 2411):
                out.nodes.update(read_nodes(block))
            elif block.kind == 82:
                out.lines += read_lines(block)
            elif block.kind == 2412:
                out.elements += read_elements(block)
            elif block.kind == 151:
                out.header = read_header(block)
            elif block.kind == 164:
                units = read_units(block)
            else:
                out.others.append(block.kind)
    for one in out.functions:
        if not one.unit and one.role in ROLE_CODES and not one.known:
            one.unit = units.get(ROLE_CODES[one.role], "")
    return out


def _record_bytes(record: Record, binary: bool) -> list[bytes]:
    if record.fs_hz is None:
        raise InputError("a universal file needs a sample rate and the record has none: give fs_hz (okid-convert --fs)")
    names, units = record.labels()
    start = record.start_time
    date = "NONE" if start is None else f"{start.astimezone(UTC):%d-%b-%y %H:%M:%S}"
    out = []
    for k, column in enumerate(record.samples.T):
        role, dof = record.roles[k], record.dofs[k]
        known: dict[str, Any] = {"fs_hz": float(record.fs_hz), "role": role, "dof": dof}
        if start is not None:
            known["start_time"] = start.astimezone(UTC).isoformat()
        one = UffFunction(
            names[k], TIME, column, 0.0, 1.0 / record.fs_hz, None, units[k], "", (dof or k + 1, 0), (0, 0), role,
            record.title, date, known=known,
        )  # fmt: skip
        out.append(function_bytes(one, ROLE_CODES.get(role or "aux", 0), 0, binary))
    return out


def nodes_of(places: Sequence[GeometryPlace | None]) -> list[Place | None]:
    """Node, axis and sign of each node and direction."""
    return [None if one is None else (one[0], *axis_and_sign(one[1])) for one in places]


def _by_number(names: Sequence[str], numbers: Sequence[int | None]) -> list[Place | None]:
    """Without a geometry the node is the degree of freedom, or stands in the name ("12z"); else they are counted."""
    named = [named_node(name) for name in names]
    if any(one is not None for one in numbers):
        return [None if dof is None else (abs(dof), 0, -1 if dof < 0 else 1) for dof in numbers]
    if all(one is not None for one in named):
        return nodes_of(named)
    return [(k, 0, 1) for k in range(1, len(names) + 1)]


def shape_places(raw: Mapping[str, Any], geometry: Geometry | None = None) -> list[Place | None]:
    """Where each entry of the shapes of an okid.result/1 is. InputError names what has no place on the geometry."""
    names = [str(one) for one in raw.get("shape_dofs") or raw["outputs"]]
    if geometry is None:
        return _by_number(names, entry_numbers(raw))
    places = nodes_of(places_of_shapes(geometry, raw))
    if None in places:
        raise InputError(
            f"{geometry.source}: sensor {names[places.index(None)]!r} has no place: give its number by the key "
            '"dof" of a [[channel]] of this name'
        )
    return places


def _ends(
    raw: Mapping[str, Any], which: str, numbers: list[int | None], geometry: Geometry | None
) -> list[Place | None]:
    """Where the "outputs" or "inputs" are; None = not known: beside a geometry or struck places nothing is counted."""
    names = raw[which]
    if geometry is None and (not raw.get("shape_dofs") or any(numbers)):
        return _by_number(names, numbers)
    if geometry is None:
        return [None] * len(names)
    known = [geometry.channel_dofs.get(name, number) for name, number in zip(names, numbers, strict=True)]
    if all(one is None for one in known):
        return [None] * len(names)
    return nodes_of(geometry.places(names, known))


def _chosen(texts: list[str], modes: Sequence[int] | None) -> list[str]:
    wrong = [number for number in modes or () if not 1 <= number <= len(texts)]
    if wrong:
        raise InputError(f"modes has {wrong[0]}, expected numbers from 1 to {len(texts)}")
    return texts if modes is None else [texts[number - 1] for number in sorted(set(modes))]


def _judgement(mode: Mapping[str, Any]) -> str:
    """What is known of the trust in a mode: nothing of results before 0.2."""
    if mode.get("confident") is None:
        return ""
    share = mode.get("found_in")
    found = "" if share is None else f" (found in {100.0 * share:.0f} % of the runs that could see it)"
    why = "; ".join(mode.get("why_text") or mode.get("why") or ())
    return f"confident{found}" if mode["confident"] else f"doubtful: {', '.join(mode.get('why') or ())}: {why}"


def mode_sets(raw: Mapping[str, Any], places: Sequence[Place | None], sensing: str = "acceleration") -> list[str]:
    """The modes as data sets 55, a text each; places: node, axis 0..2 and sign of each entry, None = nowhere. A node at
    which a mode was not measured is not in its set."""
    arrays = mode_arrays(raw)
    out = []
    for k, one in enumerate(raw["modes"]):
        entries = [
            (place, value)
            for place, value in zip(places, arrays["shapes"][:, k], strict=True)
            if place is not None and np.isfinite(value)
        ]
        nodes = sorted({place[0] for place, _ in entries})
        shape = np.zeros((len(nodes), 3), dtype=np.complex128)
        for place, value in entries:
            shape[nodes.index(place[0]), place[1]] = place[2] * value
        f, z = float(arrays["frequency_hz"][k]), float(arrays["damping_ratio"][k])
        remark = f"okid mode {k + 1}: {f!r} Hz, damping ratio {z!r}"
        title = f"{raw.get('title') or 'okid'} {raw.get('method', '')}".strip()
        mode = UffMode(k + 1, f, z, nodes, shape, title, float(one.get("modal_mass") or 0.0), _judgement(one))
        out.append(mode_text(mode, _SENSING[sensing][0], remark))
    return out


def _frf_bytes(
    raw: dict[str, Any], outputs: list[Place | None], inputs: list[Place | None], binary: bool, sensing: str
) -> list[bytes]:
    """The responses of the model at FRF_LINES even lines from 0 Hz to Nyquist, output over input."""
    model = result_tree(raw)["model"]
    step = float(raw["fs_hz"]) / 2.0 / (FRF_LINES - 1)
    response = frf.synthesise(model["A"], model["B"], model["C"], model["D"], model["dt"], step * np.arange(FRF_LINES))
    code, unit = _SENSING[sensing]
    out = []
    for o, name in enumerate(raw["outputs"]):
        for i, other in enumerate(raw["inputs"]):
            ends = [(0, 0) if one is None else (one[0], one[2] * (one[1] + 1)) for one in (outputs[o], inputs[i])]
            one = UffFunction(
                f"{name} / {other}", FRF, response[:, o, i], 0.0, step, None, unit, "N", ends[0], ends[1],
                title=str(raw.get("title") or ""), known={"df_hz": step},
            )  # fmt: skip
            out.append(function_bytes(one, code, 13, binary))
    return out


def _result_bytes(
    raw: dict[str, Any], geometry: Geometry | None, binary: bool, sensing: str, modes: Sequence[int] | None
) -> list[bytes]:
    """The structure, modes, and the responses of the model."""
    out = [] if geometry is None else [structure_text(geometry).encode()]
    places, struck = shape_places(raw, geometry), bool(raw.get("shape_dofs"))
    if not struck:
        places = [one for one, stays in zip(places, kept_outputs(raw), strict=True) if stays]
    raw, _ = without_left_out(raw)
    out += [text.encode() for text in _chosen(mode_sets(raw, places, sensing), modes)]
    own = known_numbers(raw, "output_dofs", "outputs")
    outputs = _ends(raw, "outputs", own, geometry) if struck else places
    inputs = _ends(raw, "inputs", force_numbers(raw), geometry)
    return out + (_frf_bytes(raw, outputs, inputs, binary, sensing) if raw["inputs"] else [])


def write_uff(
    path: str | Path,
    what: Record | Result | Mapping[str, Any],
    *,
    geometry: Geometry | None = None,
    binary: bool = True,
    sensing: str = "acceleration",
    modes: Sequence[int] | None = None,
) -> None:
    """Write a record, or a result (Result or okid.result/1 dictionary), as a universal file.

    Both begin with data sets 151 (header) and 164 (SI). Record: a time history (58) a channel; NaN stays NaN.
    Result: 55 for each mode, or those numbered in `modes` (from 1), with "confident .." or "doubtful: why" on its third
    ID line; 58 for each modelled FRF, and 15, 82, 2412 of `geometry`; outputs that were left out are not in it. binary:
    samples exact (58b), else ASCII with 12 digits. sensing: what the outputs of the result are. InputError when a name
    or unit is too long, the rate is not known, a channel has no place in the geometry, a number of `modes` is not
    there, or the file cannot be written.
    """
    if sensing not in _SENSING:
        raise InputError(f"sensing is {sensing!r}, expected {', '.join(_SENSING)}")
    version = abi.library().okid_version().decode()
    title = what.title if isinstance(what, Record) else ""
    parts = [header_text(title, version, datetime.now(UTC)).encode(), units_text().encode()]
    try:
        if isinstance(what, Record):
            parts += _record_bytes(what, binary)
        else:
            parts += _result_bytes(result_dict(what), geometry, binary, sensing, modes)
    except InputError as fault:
        named = geometry is not None and str(fault).startswith(geometry.source)
        raise fault if named else InputError(f"{path}: {fault}") from None
    with whole_file(path) as part, part.open("wb") as out:
        out.writelines(parts)


def uff_losses(record: Record) -> list[str]:
    """What a universal file cannot keep of this record, in words; empty when it keeps everything."""
    lost = [f"note {key!r}" for key in record.notes]
    return lost + (["the title beyond 80 characters"] if len(record.title) > 80 else [])
