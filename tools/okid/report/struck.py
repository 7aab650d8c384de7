# SPDX-License-Identifier: MIT
"""A hammer test in files: which file is which hit of the result, and the averaged responses of every place."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from okid._errors import Error, InputError
from okid.data.records import Record
from okid.frf import SHORTEST, Frf, h1, struck_part
from okid.record.identify_frf import identify_frf
from okid.report.answers import Answer, answers, detrended, fit_of
from okid.report.loaded import Loaded
from okid.report.measured import Measured, Struck, channels_of, excerpt_of, residual_of
from okid.report.scale import factor_of
from okid.result.model import Model
from okid.result.result import Result
from okid.result.shape_places import struck_at

Real = NDArray[np.float64]
MOST_COLUMNS = 60  # responses that are fitted again for the diagram; of more, those of one sensor


class Hit(NamedTuple):
    """An accepted hit: its file, place (column of the inputs), samples (N, 1 + n_y) with the force first."""

    file: str
    column: int
    samples: Real


def _names(hits: Sequence[dict[str, Any]]) -> list[str]:
    return [Path(str(hit.get("file"))).name for hit in hits]


def range_of_hit(hit: dict[str, Any]) -> tuple[int, int] | None:
    """Its samples in a record of several hits, (first, end); None: the record is the hit."""
    given = hit.get("range") or []
    return (int(given[0]), int(given[1])) if len(given) == 2 else None


def name_of_hit(hit: dict[str, Any]) -> str:
    """The file, with the samples where it holds several hits: P03.csv[3072:6144]."""
    part = range_of_hit(hit)
    return f"{hit['file']}[{part[0]}:{part[1]}]" if part else str(hit["file"])


def hits_of_records(result: Loaded) -> list[list[dict[str, Any]]]:
    """The hits of each record that was given: one, or several with their range in it."""
    out: list[list[dict[str, Any]]] = []
    for hit in result.raw["hits"]:
        first, _ = range_of_hit(hit) or (0, 0)
        if first == 0 or not out:
            out.append([])
        out[-1].append(hit)
    return out


def files_beside(result: Loaded, folders: Sequence[Path]) -> tuple[list[Path], str]:
    """The files of the accepted hits, in the first of these folders that has any, else in the only folder inside them
    that has; none: why not. Tests of one structure name their files alike: of two folders none is taken."""
    wanted = [hits for hits in hits_of_records(result) if any(hit["accepted"] for hit in hits)]
    names = [_names(hits)[0] for hits in wanted]
    if len(set(names)) < len(names):
        return [], "several hits have one name: --record gives their files in the order of the identification"
    inside = {inner.resolve(): inner for one in folders for inner in sorted(one.glob("*/")) if inner.is_dir()}
    here = [one for one in folders if any((one / name).is_file() for name in names)]
    there = [one for one in inside.values() if any((one / name).is_file() for name in names)]
    if not here and len(there) > 1:
        return [], f"files of their names are in {there[0]} and in {there[1]}: --record says which"
    folder = next(iter(here + there), None)
    if folder is None:
        return [], f"the files of the hits are not beside it ({names[0]} ..)"
    lost = [name for name in names if not (folder / name).is_file()]
    if lost:
        return [], f"not all files of the hits are in {folder} ({lost[0]} ..)"
    return [folder / name for name in names], ""


def hits_of_files(result: Loaded, paths: Sequence[Path]) -> list[tuple[dict[str, Any], Path]]:
    """Each hit with its file, by its name; where records share one by their order. InputError names what fits not."""
    records = hits_of_records(result)
    names, given = [_names(hits)[0] for hits in records], [path.name for path in paths]
    if given == names:
        return [(hit, path) for hits, path in zip(records, paths, strict=True) for hit in hits]
    if len(set(names)) < len(names):
        twice = next(name for name in names if names.count(name) > 1)
        raise InputError(
            f"--record: the result has several hits of the name {twice}, expected all {len(names)} files in the order "
            "of the identification"
        )
    by_name = dict(zip(names, records, strict=True))
    for k, path in enumerate(paths):
        if path.name not in by_name:
            raise InputError(
                f"{path}: is none of the {len(names)} hits of the result, expected files of the names {names[0]} .. "
                f"{names[-1]}"
            )
        if path.name in given[:k]:
            raise InputError(f"{path}: is the second file of this name, expected each hit once")
    return [(hit, path) for path in paths for hit in by_name[path.name]]


def _read(result: Loaded, records: Sequence[tuple[dict[str, Any], Record, str]]) -> Iterator[tuple[Hit, Record]]:
    """The accepted hits with the channels of the result."""
    force = (struck_at(result.inputs[0]) or ("", 0))[0]
    columns = {(struck_at(name) or ("", 0))[1]: k for k, name in enumerate(result.inputs)}
    for hit, record, source in records:
        if not hit["accepted"]:
            continue
        own = channels_of(result, record, source, [force, *result.outputs])
        place = int(hit["place"])
        if abs(place) not in columns:
            raise InputError(f"{source}: the result has no input for place {abs(place)}")
        first, end = range_of_hit(hit) or (0, len(own.samples))
        samples = own.samples[first:end].copy()
        samples[:, 0] *= 1.0 if place > 0 else -1.0
        yield Hit(name_of_hit(hit), columns[abs(place)], samples), own


def _of_place(model: Model, column: int) -> Model:
    """The same model with the force of one place."""
    return Model(model.A, model.B[:, [column]], model.C, model.D[:, [column]], model.K, model.dt)


def _averaged(result: Loaded, hits: Sequence[Hit], data: Sequence[tuple[Real, Real]]) -> tuple[Frf, Real]:
    """H1 of every place over its hits, (F, n_y, places), and the coherence of each, of the same shape."""
    parts = []
    for k in range(len(result.inputs)):
        own = [one for hit, one in zip(hits, data, strict=True) if hit.column == k]
        force, motion = [u for u, _ in own], [y for _, y in own]
        parts.append(h1(force, motion, result.fs, nperseg=len(force[0]), window="boxcar"))
    first = parts[0]
    response = np.concatenate([one.response for one in parts], axis=2)
    names = tuple(result.inputs), tuple(result.outputs)
    coherence = np.stack([one.coherence for one in parts], axis=2)
    nothing = np.full(response.shape[:2], np.nan)
    return Frf(first.frequency_hz, response, nothing, len(hits), first.resolution_hz, *names), coherence


def fitted_again(responses: Frf, band: tuple[float, float]) -> Result | None:
    """What pLSCF makes of measured responses by themselves, with its diagram; None when it finds nothing."""
    n_y, n_u = responses.response.shape[1:]
    if n_y * n_u > MOST_COLUMNS:
        strongest = int(np.argmax(np.sum(np.abs(responses.response) ** 2, axis=(0, 2))))
        responses = responses._replace(
            response=responses.response[:, [strongest]], outputs=(responses.outputs[strongest],)
        )
    try:
        return identify_frf(responses, band=band, stabilization=True)
    except Error:
        return None


def _factors(answered: Sequence[Answer], n_y: int) -> Real:
    """Simulation over record of each output, NaN = not comparable."""
    sums = np.zeros((3, n_y))
    for one in answered:
        if one.simulated is None:
            return np.full(n_y, np.nan)
        use = np.isfinite(one.y)
        made, there = np.where(use, one.simulated, 0.0), np.where(use, one.y, 0.0)
        sums += np.array([np.sum(made * there, axis=0), np.sum(there**2, axis=0), np.sum(made**2, axis=0)])
    return factor_of(sums)


def measure_hits(result: Loaded, records: Sequence[tuple[dict[str, Any], Record, str]]) -> Measured:
    """What the records of the hits add: responses of each place, fit, the hardest hit over time, the residual.

    Everything is of the accepted hits, each cut to the unbroken stretch around its force, all as long as the shortest.
    InputError when a file does not fit, or a place has no hit.
    """
    read = list(_read(result, records))
    hits, own = [hit for hit, _ in read], [record for _, record in read]
    for k, name in enumerate(result.inputs):
        if all(hit.column != k for hit in hits):
            wanted = [str(one["file"]) for one in result.raw["hits"] if one["accepted"]
                      and abs(int(one["place"])) == (struck_at(name) or ("", 0))[1]]  # fmt: skip
            raise InputError(f"--record: no file of {name} was given, expected {', '.join(wanted[:4])}")
    parts = [struck_part(hit.samples, 1) for hit in hits]
    length = min(map(len, parts))
    if length < SHORTEST:
        worst = hits[int(np.argmin([len(part) for part in parts]))].file
        raise InputError(f"{worst}: only {length} unbroken samples around the hit, expected {SHORTEST}")
    detrend, (model, predict) = str(result.raw.get("detrend", "mean")), result.model()
    answered = [
        answers(_of_place(model, hit.column), predict, detrended(part[:length], detrend), 1)[0]
        for hit, part in zip(hits, parts, strict=True)
    ]
    responses, coherence = _averaged(result, hits, [(part[:length, :1], part[:length, 1:]) for part in parts])
    simulated = None
    if all(one.simulated is not None and np.all(np.isfinite(one.simulated)) for one in answered):
        made = [(one.u, one.simulated) for one in answered]
        simulated, _ = _averaged(result, hits, made)  # type: ignore[arg-type]
    again = fitted_again(responses, (responses.resolution_hz, min(result.shown_hz, 0.98 * result.fs / 2.0)))
    white, covariance = residual_of(result, answered)
    good = sum(bool(hit["accepted"]) for hit in result.raw["hits"])
    counts = [sum(hit.column == k for hit in hits) for k in range(len(result.inputs))]
    source = f"{len(hits)} of {good} good hits, {hits[0].file} to {hits[-1].file}"
    part = f"the first {length / result.fs:.3g} s of each" if any(len(one.samples) > length for one in hits) else ""
    excerpt = excerpt_of(result, answered, [hit.file for hit in hits])
    return Measured(
        responses, "", None if again is None else again.stabilization(), fit_of(answered, result.outputs), source,
        None, covariance, excerpt, white, np.sum([np.sum(~np.isfinite(one.samples), axis=0) for one in hits], axis=0),
        sum(len(one.samples) for one in hits), part, own[0], _factors(answered, len(result.outputs)), [], simulated,
        Struck(counts, coherence), None if again is None else again.confident_modes,
    )  # fmt: skip
