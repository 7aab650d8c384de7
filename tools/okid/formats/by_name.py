# SPDX-License-Identifier: MIT
"""Records and results read and written by the extension of the file name."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from okid._errors import InputError
from okid.data.geometry import Geometry
from okid.data.records import Record, read_csv
from okid.formats.csv_file import write_csv
from okid.formats.foreign_library import reading
from okid.formats.hdf5 import read_hdf5, write_hdf5
from okid.formats.logger_text import LOGGER_EXTENSIONS, is_plain, read_logger
from okid.formats.mat import read_mat, write_mat
from okid.formats.mcap_file import read_mcap, write_mcap
from okid.formats.mdf4 import read_mdf4, write_mdf4
from okid.formats.parquet import read_parquet, write_parquet
from okid.formats.sound import read_sound
from okid.formats.tdms import read_tdms
from okid.formats.uff import read_uff, write_uff
from okid.result.result import Result

Part = int | str | None
RESULT_EXTENSIONS = (".uff", ".unv", ".h5", ".hdf5", ".mat")


def _only_part(path: str | Path, group: Part) -> None:
    if group is not None:
        raise InputError(f"{path}: group {group!r} asked for, but this format has no groups")


def _whole(read: Callable[[str | Path], Record]) -> Callable[[str | Path, Part], Record]:
    def only(path: str | Path, group: Part) -> Record:
        _only_part(path, group)
        return read(path)

    return only


def _read_csv(path: str | Path) -> Record:
    """By the rules of `okid identify`; where they do not know what stands above the data, as a logger's file."""
    try:
        record = read_csv(path)
    except InputError:
        with contextlib.suppress(InputError):
            if not is_plain(path):
                return read_logger(path)
        raise
    if record.fs_hz is None:  # uneven stamps, of which there is a remark, may show rows to be missing
        try:
            found = read_logger(path)
        except InputError as fault:
            record.remarks = record.remarks or [f"no sample rate: {str(fault).removeprefix(f'{path}: ')}"]
            return record
        return found if found.fs_hz is not None or not is_plain(path) else record
    return record


def _read_uff(path: str | Path, group: Part) -> Record:
    uff = read_uff(path)
    with reading(path, "UFF"):
        return uff.record(group)


_READERS: dict[str, Callable[[str | Path, Part], Record]] = {
    ".csv": _whole(_read_csv),
    ".uff": _read_uff,
    ".unv": _read_uff,
    ".mf4": read_mdf4,
    ".h5": read_hdf5,
    ".hdf5": read_hdf5,
    ".mat": read_mat,
    ".parquet": _whole(read_parquet),
    ".mcap": _whole(read_mcap),
    ".tdms": read_tdms,
    ".wav": _whole(read_sound),
    ".flac": _whole(read_sound),
    **dict.fromkeys(LOGGER_EXTENSIONS, _whole(read_logger)),
}
_WRITERS: dict[str, Callable[[str | Path, Record], None]] = {
    ".csv": write_csv,
    ".uff": write_uff,
    ".unv": write_uff,
    ".mf4": write_mdf4,
    ".h5": write_hdf5,
    ".hdf5": write_hdf5,
    ".mat": write_mat,
    ".parquet": write_parquet,
    ".mcap": write_mcap,
}
EXTENSIONS, WRITTEN_EXTENSIONS = tuple(_READERS), tuple(_WRITERS)


def _ending(path: str | Path, known: tuple[str, ...]) -> str:
    ending = Path(path).suffix.lower()
    if ending not in known:
        raise InputError(f"{path}: the extension is {ending!r}, expected one of {', '.join(known)}")
    return ending


def read_record(path: str | Path, *, group: Part = None, fs: float | None = None) -> Record:
    """Read measured samples from .csv, .uff, .unv, .mf4, .h5, .hdf5, .mat, .parquet, .mcap, .tdms, .wav or .flac, or
    from a logger's text file: .txt, .dat, .tsv, .lvm, and .csv that is not in okid's own form (read_logger()).

    group: which part, where a file holds several of different length or rate: the number that the error message
    lists (UFF, MDF4, TDMS), the path inside the file (HDF5), variable names with commas (.mat). fs: Hz, overrides what
    the file says. InputError of one line names the file and what is wrong with it.
    """
    if fs is not None and not 0.0 < fs < float("inf"):
        raise InputError(f"sample rate is {fs}, expected Hz above 0")
    ending = _ending(path, EXTENSIONS)
    if fs is not None and ending in LOGGER_EXTENSIONS:
        _only_part(path, group)
        return read_logger(path, fs)
    record = _READERS[ending](path, group)
    if fs is not None:
        record.fs_hz = float(fs)
    return record


def write_record(path: str | Path, record: Record) -> None:
    """Write measured samples as .csv, .uff, .unv, .mf4, .h5, .hdf5, .mat, .parquet or .mcap, whole or not at all.

    InputError names what the format cannot hold (UFF, MDF4 and MCAP want a sample rate) or why the file cannot be
    written.
    """
    _WRITERS[_ending(path, WRITTEN_EXTENSIONS)](path, record)


def write_result(path: str | Path, result: Result | Mapping[str, Any], geometry: Geometry | None = None) -> None:
    """Write an identified model (a Result or an okid.result/1 dictionary) as .uff, .unv, .h5, .hdf5 or .mat.

    geometry: nodes and lines for UFF; the other formats take none.
    """
    ending = _ending(path, RESULT_EXTENSIONS)
    if ending in (".uff", ".unv"):
        write_uff(path, result, geometry=geometry)
    elif ending == ".mat":
        write_mat(path, result)
    else:
        write_hdf5(path, result)
