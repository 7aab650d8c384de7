# SPDX-License-Identifier: MIT
"""What --record gives: one record or several, the hits of a hammer test, or files of frequency responses."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from okid._errors import InputError
from okid.data.records import Record
from okid.formats.frf_file import read_frf
from okid.frf import Frf
from okid.report.answers import detrended
from okid.report.loaded import Loaded
from okid.report.material import Source, is_struck
from okid.report.measured import Measured, channels_of, measure, measured_from, open_record
from okid.report.other_kinds import check_kind
from okid.report.provenance import source_of
from okid.report.struck import files_beside, fitted_again, hits_of_files, hits_of_records, measure_hits

MOST_SOURCES = 6  # files that are named one by one
Given = str | Path | Record | Frf


class Taken(NamedTuple):
    """measured: None = no record; sources: files that went in; absent: why there is no record, "" = none was given."""

    measured: Measured | None
    sources: list[Source]
    absent: str = ""


def listed(record: Given | Sequence[Given] | None) -> list[Given]:
    """One or several. InputError for anything else."""
    if record is None:
        return []
    several = isinstance(record, list | tuple) and not isinstance(record, Frf)
    given: list[Any] = list(record) if several else [record]  # type: ignore[arg-type]
    for one in given:
        if not isinstance(one, str | Path | Record | Frf):
            raise InputError(
                f"record is {one!r:.60}, expected the name of a file, what okid.read_csv() or okid.read_frf() returns, "
                "or a list of them"
            )
    return given


def _sources(paths: Sequence[Path], kind: str) -> list[Source]:
    """Each file; of many one entry, with the digest of the list of their digests. kind: "record", "responses"."""
    own = [source_of(kind, path) for path in paths]
    if len(own) <= MOST_SOURCES:
        return own
    lines = "".join(f"{one.sha256}  {Path(one.name).name}\n" for one in own)
    digest = hashlib.sha256(lines.encode("utf-8")).hexdigest()
    name = f"{own[0].name} .. {own[-1].name}; SHA-256 of the output of sha256sum for them"
    return [Source(f"{len(own)} {kind.removesuffix('s')}s", name, digest, sum(one.size for one in own))]


def _hits(result: Loaded, given: Sequence[Given]) -> Measured:
    hits = hits_of_records(result)
    if all(isinstance(one, Record) for one in given):
        if len(given) != len(hits):
            raise InputError(f"record has {len(given)} records, the result {len(hits)} hits: expected one for each")
        records = [(hit, one, str(hit["file"])) for own, one in zip(hits, given, strict=True) for hit in own]
        return measure_hits(result, records)  # type: ignore[arg-type]
    paths = [Path(one) for one in given if isinstance(one, str | Path)]
    if len(paths) < len(given):
        raise InputError("record has files beside what is in memory, expected the files of the hits, or records alone")
    matched = [(hit, path) for hit, path in hits_of_files(result, paths) if hit["accepted"]]
    opened = {path: open_record(path) for path in dict.fromkeys(path for _, path in matched)}
    return measure_hits(result, [(hit, opened[path], str(path)) for hit, path in matched])


def _responses(result: Loaded, given: Sequence[Given]) -> Measured:
    """Frequency responses over what is synthesised from the modes of the result."""
    paths = [Path(one) for one in given if isinstance(one, str | Path)]
    frf = next((one for one in given if isinstance(one, Frf)), None)
    if (frf is not None and len(given) > 1) or (frf is None and len(paths) < len(given)):
        raise InputError("record: the result is of frequency responses, expected their files, or what read_frf() gave")
    source = ", ".join(path.name for path in paths[:4]) or "the responses given"
    frf = read_frf(*paths) if frf is None else frf
    wanted = result.inputs, result.outputs
    ends = frf.names()
    there = [set(one) for one in ends]
    straight = set(wanted[0]) <= there[0] and set(wanted[1]) <= there[1]
    if not straight and set(wanted[0]) <= there[1] and set(wanted[1]) <= there[0]:  # by reciprocity
        ends = ends[::-1]
        frf = frf._replace(response=frf.response.transpose(0, 2, 1), coherence=np.full(frf.response.shape[::2], np.nan))
    for names, known, what in zip(wanted, ends, ("force", "response"), strict=True):
        lost = [name for name in names if name not in known]
        if lost:
            raise InputError(f"{source}: has no {what} {lost[0]!r}, found {', '.join(known[:20])}")
    columns = [ends[0].index(name) for name in wanted[0]]
    rows = [ends[1].index(name) for name in wanted[1]]
    kept = (frf.frequency_hz > 0.0) & np.all(np.isfinite(frf.response[:, rows][:, :, columns]), axis=(1, 2))
    f = frf.frequency_hz[kept]
    data = Frf(
        f, frf.response[kept][:, rows][:, :, columns], frf.coherence[kept][:, rows], 0,
        float(np.min(np.diff(f), initial=np.inf)), tuple(wanted[0]), tuple(wanted[1]), frf.set_ups,
    )  # fmt: skip
    model, _ = result.model()
    made = data._replace(response=model.frequency_response(f))
    band = result.raw.get("band_hz")
    again = fitted_again(data, (float(f[0]), float(f[-1])) if band is None else (float(band[0]), float(band[1])))
    return Measured(data, "", None if again is None else again.stabilization(), None, source, simulated=made)


def _joined(result: Loaded, records: Sequence[Record], names: Sequence[str]) -> Record:
    """Records of one structure one behind the other, each less its mean (or line), a missing sample between them."""
    detrend = str(result.raw.get("detrend", "mean"))
    own = [channels_of(result, one, name) for one, name in zip(records, names, strict=True)]
    gap = np.full((1, len(own[0].names)), np.nan)
    rows = [part for one in own for part in (detrended(one.samples, detrend), gap)][:-1]
    for one, name in zip(own, names, strict=True):
        if one.units != own[0].units:
            raise InputError(f"{name}: the units are not those of {names[0]}, expected the same")
    first = own[0]
    return Record(first.names, np.vstack(rows), first.fs_hz, first.units, first.title, None, first.roles, first.dofs,
                  first.notes)  # fmt: skip


def _several(result: Loaded, given: Sequence[Given]) -> Measured:
    """Records that were merged into one result."""
    count = int(result.raw.get("records") or 1)
    if len(given) > count:
        raise InputError(
            f"--record: {len(given)} records were given, and the result is of {count}: give those it was made of"
        )
    names = [str(one) if isinstance(one, str | Path) else f"record {k}" for k, one in enumerate(given, 1)]
    records = [open_record(one) if isinstance(one, str | Path) else one for one in given]
    if any(isinstance(one, Frf) for one in records):
        raise InputError("record: the result is of samples, expected records and no frequency responses")
    if len(records) == 1:
        one = given[0]
        if isinstance(one, str | Path):
            return measure(result, one)
        return measured_from(result, one, "the record given")  # type: ignore[arg-type]
    whole = _joined(result, records, names)  # type: ignore[arg-type]
    found = measured_from(result, whole, f"{len(names)} records, one behind the other: {', '.join(names[:8])}")
    gaps = len(records) - 1  # the samples between the records are none
    found.samples -= gaps
    assert found.missing is not None
    found.missing = found.missing - gaps
    return found


def take_records(result: Loaded, record: Given | Sequence[Given] | None, source: str | Path | None = None) -> Taken:
    """What the report makes of `record`; without one, the hits that the result names, where their files are beside it
    (`source`) or here. InputError where a record does not belong to the result."""
    given = listed(record)
    absent = ""
    if not given and is_struck(result) and source is not None:
        found, absent = files_beside(result, [Path(source).parent, Path()])
        given = list(found)
    if not given:
        return Taken(None, [], absent)
    if result.raw.get("set_ups"):
        raise InputError(
            f"--record: the result is of {len(result.raw['set_ups'])} set-ups, of which no record has all sensors: "
            "leave it out, and give it to the report of its own set-up"
        )
    paths = [Path(one) for one in given if isinstance(one, str | Path)]
    for path in paths:
        check_kind(path, "record")
    sources = _sources(paths, "responses" if result.raw.get("responses") else "record")
    if result.raw.get("responses"):
        return Taken(_responses(result, given), sources)
    return Taken(_hits(result, given) if is_struck(result) else _several(result, given), sources)
