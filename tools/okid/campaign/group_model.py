# SPDX-License-Identifier: MIT
"""Modes of a group: from the sums of its parts by one method, or from its samples by method auto."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from okid._errors import Error, IdentificationError
from okid.abi.accumulator import Accumulator
from okid.campaign.record_read import ReadRecord
from okid.campaign.spec import FEWEST, CampaignSpec
from okid.data.memory import decompressed
from okid.identification.host_result import HostResult, identify
from okid.identification.stream import HostStream, behind_refinement
from okid.result.stabilization import of_identifiers

MOST_NUMBERS = 10_000_000  # of a group that auto looks at, as live: an identification holds them some 8 times
_NEAR = 0.01  # relative: a cluster of the stabilization diagram is that of a mode
_FEWEST_ORDERS = 12
_KEYS = ("frequency_hz", "frequency_std_hz", "damping_ratio", "damping_ratio_std", "mpc", "emac")


def stream_of(spec: CampaignSpec, **more: Any) -> HostStream:
    """The identification of the spec as a stream."""
    c, i = spec.channels, spec.identification
    return HostStream({
        "inputs": c.inputs, "outputs": c.outputs, "fs": c.fs_hz, "method": i.method, "p": i.p, "rows": i.rows or None,
        "order": i.order or None, "max_order": i.max_order or None, "hankel": i.hankel, "detrend": i.detrend, **more,
    })  # fmt: skip


def _merged(spec: CampaignSpec, parts: Sequence[Accumulator], refinement: bytes) -> HostStream:
    """All parts in one; each is a block for ±. With the sums of a refinement, packed."""
    c, i = spec.channels, spec.identification
    blocks = i.sigma_blocks if sum(part.rows > 0 for part in parts) >= FEWEST else 0
    units = {"scale": c.scale, "offset": c.offset} if c.codes else {}
    whole = stream_of(
        spec, codes=c.codes, saturated=c.saturated, sigma_blocks=blocks, states_only=True,
        refine=i.refine if refinement else None, **units,
    )  # fmt: skip
    for part in parts:
        whole.merge(part.to_bytes())
    if refinement:
        whole.merge(decompressed(refinement))
    return whole


def _held(found: HostResult, order: int, frequencies_hz: Sequence[float]) -> list[bool | None]:
    """Is the mode one that holds over the orders? None: there is no diagram."""
    identifier = found.identifier()
    assert identifier is not None
    last = min(identifier.largest_order(), max(_FEWEST_ORDERS, 2 * order))
    try:
        clusters = of_identifiers([identifier], range(2, last + 1, 2)).modes
    except Error:
        return [None] * len(frequencies_hz)
    at = np.array([cluster.frequency_hz for cluster in clusters])
    return [bool(np.any(np.abs(at - f) <= _NEAR * f)) for f in frequencies_hz]


def in_units(spec: CampaignSpec, record: ReadRecord) -> tuple[NDArray[np.float64], int]:
    """Samples in engineering units with NaN where one is missing, and how many have a code at full scale."""
    c, rows = spec.channels, np.array(record.samples, dtype=np.float64)
    scale, offset = np.array(c.scale), np.array(c.offset)
    if record.samples.dtype.kind != "f":
        rows = rows * scale + offset
    rows[:, np.isnan(rows).all(axis=0)] = 0.0  # no number at all: a dead channel, as one that never moves
    if not c.codes:
        return rows, 0
    codes, most = np.rint((rows - offset) / scale), 2 ** (c.codes - 1)
    full = (codes <= -most) | (codes >= most - 1)
    if c.saturated == "missing":
        rows[full] = np.nan
    return rows, int(full.any(axis=1).sum())


def agree(spec: CampaignSpec, records: Sequence[NDArray[np.float64]]) -> dict[str, Any]:
    """What method auto finds in the records of a group, as identify_group() tells it; "holds" is its confidence."""
    c, i = spec.channels, spec.identification
    whole = hashlib.sha256()
    for record in records:
        whole.update(record.tobytes())
    out: dict[str, Any] = {
        "model_key": spec.model_key, "rows": sum(int(np.isfinite(one).all(axis=1).sum()) for one in records),
        "sums_sha256": whole.hexdigest(), "parts": None, "order": None, "fault": None, "modes": [],
    }  # fmt: skip
    options = {
        "inputs": list(c.inputs), "outputs": list(c.outputs), "fs": c.fs_hz, "method": "auto",
        "sigma_blocks": i.sigma_blocks, "band": ":".join(map(str, i.band)) or None, "decimate": i.decimate or None,
        "threads": 1, "refine": i.refine or None,
    }  # fmt: skip
    try:
        n_u = len(c.inputs)
        found = identify(options, [one[:, :n_u] for one in records], [one[:, n_u:] for one in records])
    except Error as fault:
        return out | {"fault": str(fault)}
    return out | {"modes": [_listed(mode, mode["confident"]) for mode in found.about()["modes"]]}


def _listed(mode: dict[str, Any], holds: bool | None) -> dict[str, Any]:
    shape = {key: mode[key] for key in ("shape_re", "shape_im")}
    return {**{key: mode[key] for key in _KEYS}, "holds": holds, **shape}


def identify_group(spec: CampaignSpec, parts: Sequence[Accumulator], refinement: bytes = b"") -> dict[str, Any]:
    """What the parts of a group tell: plain values for JSON. Without a model "modes" is empty and "fault" says why.
    "refined": samples behind a refinement of the modes, None: there is none.

    Cost: one identification, a short one a part for ±, the poles of some ten orders.
    """
    whole = _merged(spec, parts, refinement)
    out: dict[str, Any] = {
        "model_key": spec.model_key, "rows": whole.counts().rows,
        "sums_sha256": hashlib.sha256(behind_refinement(whole.state())).hexdigest(),
        "parts": sum(part.rows > 0 for part in parts), "order": None, "refined": None, "fault": None, "modes": [],
    }  # fmt: skip
    try:
        found = whole.identify()
    except IdentificationError as fault:
        return out | {"fault": str(fault)}
    about = found.about()
    modes = about["modes"]
    held: list[bool | None] = [None] * len(modes)
    if spec.identification.stabilization:
        held = _held(found, int(about["order"]), [mode["frequency_hz"] for mode in modes])
    out["refined"] = (about.get("refinement") or {}).get("samples")
    return out | {"order": about["order"], "modes": [_listed(*one) for one in zip(modes, held, strict=True)]}
