# SPDX-License-Identifier: MIT
"""One record from its URL into codes or real numbers: read once, hashed on the way. Runs on the workers."""

from __future__ import annotations

import hashlib
import io
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import Any

import numpy as np
from numpy.typing import NDArray

from okid._errors import InputError
from okid.campaign.file_systems import is_remote, opened
from okid.campaign.spec import CampaignSpec
from okid.data.input_file import read_input
from okid.data.memory import load_npy, most_bytes, require_memory

Real = NDArray[np.float64]
_WHOLE = 0.02  # of a code: how far a decoded number may lie from one
_RANGE = {16: (-(2**15), 2**15 - 1), 24: (-(2**23), 2**23 - 1), 32: (-(2**31), 2**31 - 1)}


class Unreachable(InputError):
    """The file system refused: another time it may not."""


@dataclass(frozen=True)
class ReadRecord:
    """Runs of samples (N, m), inputs first: codes (int16, int32) or float64 with NaN; mean temperature or None."""

    samples: NDArray[Any]
    missing: NDArray[np.bool_] | None
    sha256: str
    temperature_c: float | None


def _fetch(url: str, storage: dict[str, Any]) -> bytes:
    if not is_remote(url):
        return read_input(url, most_bytes())
    with opened(url, storage).open(url, "rb") as file:
        data: bytes = file.read(most_bytes() + 1)
    require_memory(len(data), "its bytes")
    return data


def content_hash(url: str, storage: dict[str, Any]) -> str:
    """SHA-256 of the bytes of a record."""
    return hashlib.sha256(_fetch(url, storage)).hexdigest()


@contextmanager
def _as_file(url: str, data: bytes) -> Iterator[Path]:
    """A local file with these bytes: the record's own when it is local."""
    if not is_remote(url):
        yield Path(url)
        return
    with tempfile.TemporaryDirectory(prefix="okid-campaign-") as folder:
        path = Path(folder) / PurePosixPath(url).name
        path.write_bytes(data)
        yield path


def read_one(spec: CampaignSpec, name: str, url: str) -> ReadRecord:
    """Read a record whole; memory: its bytes and its samples. InputError of one line says what is wrong with it."""
    try:
        data = _fetch(url, spec.records.storage)
        digest = hashlib.sha256(data).hexdigest()
        kind = PurePosixPath(name).suffix.lower()
        if not data:
            raise InputError("is empty")
        if kind == ".npy":
            samples, temperature = _of_array(spec, data)
        else:
            with _as_file(url, data) as path:
                samples, temperature = _of_file(spec, kind, path)
    except InputError as fault:
        raise InputError(_about(name, url, str(fault))) from None
    except OSError as fault:
        raise Unreachable(f"{name}: {fault.strerror or fault}") from None
    except (ValueError, EOFError, KeyError, ImportError, ArithmeticError) as fault:
        raise InputError(f"{name}: not a record, or damaged: {' '.join(str(fault).split())[:160]}") from None
    if len(samples) == 0:
        raise InputError(f"{name}: holds no samples")
    whole, missing = _as_codes(spec, name, samples)
    return ReadRecord(whole, missing, digest, temperature)


def _about(name: str, url: str, text: str) -> str:
    """The message with the record's name once, in front; the machine's own path of it left out."""
    text = text.removeprefix(f"{url}: ").replace(url, name)
    return text if text.startswith(name) else f"{name}: {text}"


def _mean(values: NDArray[Any], scale: float, offset: float) -> float | None:
    known = values[np.isfinite(values)] if values.dtype.kind == "f" else values
    return None if len(known) == 0 else float(np.mean(known, dtype=np.float64)) * scale + offset


def _of_array(spec: CampaignSpec, data: bytes) -> tuple[NDArray[Any], float | None]:
    array = load_npy(io.BytesIO(data), len(data))
    columns = spec.channels.columns
    if array.ndim != 2 or array.shape[1] != len(columns):
        raise InputError(f"holds an array {array.shape}, expected (samples, {len(columns)}): {', '.join(columns)}")
    if array.dtype.kind not in "if":
        raise InputError(f"holds {array.dtype}, expected int16, int32 or real numbers")
    temperature = None
    t = spec.temperature
    if t.channel is not None:
        temperature = _mean(array[:, columns.index(t.channel)], t.scale, t.offset)
    places = [columns.index(name) for name in spec.channels.names]
    if places == list(range(array.shape[1])):
        return array, temperature
    return array[:, places], temperature


def _of_file(spec: CampaignSpec, kind: str, path: Path) -> tuple[NDArray[Any], float | None]:
    from okid.formats import read_record

    if kind in (".okj", ".log"):
        from okid.abi.program import run_program

        if kind == ".log" and spec.records.config is None:
            raise InputError('a candump log needs the CONFIG.toml of its channels: give [records] "config"')
        config = [] if spec.records.config is None else ["-c", str(spec.base / spec.records.config)]
        with tempfile.TemporaryDirectory(prefix="okid-campaign-") as folder:
            table = Path(folder) / "decoded.csv"
            run_program("convert", path, table, *config)
            record = read_record(table)
    else:
        record = read_record(path)
    wanted = spec.channels.fs_hz
    if record.fs_hz is not None and abs(record.fs_hz - wanted) > 1e-6 * wanted:
        raise InputError(f"has a sample rate of {record.fs_hz:g} Hz, the campaign of {wanted:g} Hz")
    temperature, t = None, spec.temperature
    if t.channel is not None:
        temperature = _mean(record.columns([t.channel], str(path))[:, 0], t.scale, t.offset)
    return record.columns(list(spec.channels.names), str(path)), temperature


def _missing(samples: Real) -> NDArray[np.bool_] | None:
    """The rows in which a number is missing, None = none."""
    absent = ~np.all(np.isfinite(samples), axis=1)
    return absent if np.any(absent) else None


def _as_codes(spec: CampaignSpec, name: str, samples: NDArray[Any]) -> tuple[NDArray[Any], NDArray[np.bool_] | None]:
    """The samples as the accumulator takes them; which are missing, None = none. Auto takes them as they are, and does
    without a channel that has no number."""
    codes = spec.channels.codes
    if spec.identification.method == "auto":
        if samples.dtype.kind != "f":
            return samples, None
        alive = np.isfinite(samples).any(axis=0)
        if not np.any(alive):
            raise InputError(f"{name}: holds no number in any row")
        return samples, _missing(samples[:, alive])
    if samples.dtype.kind == "f":
        missing = _missing(samples)
        if not codes:
            return np.ascontiguousarray(samples, dtype=np.float64), missing
        whole = _rounded(spec, name, samples, missing)
    else:
        whole, missing = samples, None
        if not codes:
            scale, offset = np.array(spec.channels.scale), np.array(spec.channels.offset)
            return np.ascontiguousarray(samples * scale + offset), None
    kind = np.int16 if codes == 16 else np.int32
    if not np.can_cast(whole.dtype, kind):
        low, high = _RANGE[codes]
        if whole.min() < low or whole.max() > high:
            raise InputError(f"{name}: holds codes from {whole.min()} to {whole.max()}, expected {codes} bits")
    return np.ascontiguousarray(whole, dtype=kind), missing


def _rounded(spec: CampaignSpec, name: str, samples: Real, missing: NDArray[np.bool_] | None) -> NDArray[np.int64]:
    """Codes of real numbers, when each of them is one: (value - offset) / scale, rounded, and checked."""
    raw = (samples - np.array(spec.channels.offset)) / np.array(spec.channels.scale)
    if missing is not None:
        raw[missing] = 0.0
    whole = np.rint(raw)
    off = np.abs(raw - whole)
    worst = np.unravel_index(int(np.argmax(off)), off.shape)
    if off[worst] > _WHOLE:
        channel = spec.channels.names[int(worst[1])]
        raise InputError(
            f"{name}: channel {channel!r}, sample {int(worst[0])}: {samples[worst]:.9g} is not scale code + offset "
            f"({raw[worst]:.3f} codes): correct [channels] scale, or set codes = 0 for sums of real numbers"
        )
    return np.asarray(whole, dtype=np.int64)
