# SPDX-License-Identifier: MIT
"""Modes of a group from its parts: identification of all, one part left out in turn for ±, stabilization."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from typing import Any

import numpy as np

from okid._errors import Error, IdentificationError
from okid.abi.accumulator import Accumulator
from okid.abi.host_result import HostResult
from okid.abi.stream import HostStream
from okid.campaign.spec import FEWEST, CampaignSpec
from okid.result.stabilization import of_identifiers

_NEAR = 0.01  # relative: a cluster of the stabilization diagram is that of a mode
_FEWEST_ORDERS = 12
_KEYS = ("frequency_hz", "frequency_std_hz", "damping_ratio", "damping_ratio_std", "mpc", "emac")


def _merged(spec: CampaignSpec, parts: Sequence[Accumulator]) -> HostStream:
    """All parts in one; each is a block for ±."""
    c, i = spec.channels, spec.identification
    blocks = i.sigma_blocks if sum(part.rows > 0 for part in parts) >= FEWEST else 0
    whole = HostStream({
        "inputs": c.inputs, "outputs": c.outputs, "fs": c.fs_hz, "codes": c.codes, "saturated": c.saturated,
        "method": i.method, "p": i.p, "rows": i.rows or None, "order": i.order or None,
        "max_order": i.max_order or None, "hankel": i.hankel, "detrend": i.detrend, "sigma_blocks": blocks,
        "states_only": True,
        **({"scale": c.scale, "offset": c.offset} if c.codes else {}),
    })  # fmt: skip
    for part in parts:
        whole.merge(part.to_bytes())
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


def identify_group(spec: CampaignSpec, parts: Sequence[Accumulator]) -> dict[str, Any]:
    """What the parts of a group tell: plain values for JSON. Without a model "modes" is empty and "fault" says why.

    Cost: one identification, a short one a part for ±, the poles of some ten orders.
    """
    whole = _merged(spec, parts)
    out: dict[str, Any] = {
        "model_key": spec.model_key, "rows": whole.counts().rows,
        "sums_sha256": hashlib.sha256(whole.state()).hexdigest(), "parts": sum(part.rows > 0 for part in parts),
        "order": None, "fault": None, "modes": [],
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
    listed = [
        {
            **{key: mode[key] for key in _KEYS},
            "holds": holds,
            "shape_re": mode["shape_re"],
            "shape_im": mode["shape_im"],
        }
        for mode, holds in zip(modes, held, strict=True)
    ]
    return out | {"order": about["order"], "modes": listed}
