# SPDX-License-Identifier: MIT
"""Modes of a group from its parts: identification of all, one part left out in turn for ±, stabilization."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from typing import Any

import numpy as np

from okid._errors import Error, IdentificationError
from okid.abi.accumulator import Accumulator
from okid.abi.identifier import Identified, Identifier
from okid.campaign.pieces import make_identifier
from okid.campaign.spec import CampaignSpec
from okid.campaign.sums_file import whole_of
from okid.result.parts import known
from okid.result.stabilization import of_identifiers
from okid.result.uncertainty import FEWEST, Uncertainty, without_each

_NEAR = 0.01  # relative: a cluster of the stabilization diagram is that of a mode
_FEWEST_ORDERS = 12


def _held(identifier: Identifier, found: Identified) -> list[bool | None]:
    """Is the mode one that holds over the orders? None: there is no diagram."""
    last = min(identifier.largest_order(), max(_FEWEST_ORDERS, 2 * found.order))
    try:
        clusters = of_identifiers([identifier], range(2, last + 1, 2)).modes
    except Error:
        return [None] * len(found.frequency_hz)
    at = np.array([cluster.frequency_hz for cluster in clusters])
    return [bool(np.any(np.abs(at - f) <= _NEAR * f)) for f in found.frequency_hz]


def _modes(found: Identified, sigma: Uncertainty | None, held: Sequence[bool | None]) -> list[dict[str, Any]]:
    return [
        {
            "frequency_hz": float(found.frequency_hz[k]),
            "frequency_std_hz": None if sigma is None else known(float(sigma.frequency_hz[k])),
            "damping_ratio": float(found.damping_ratio[k]),
            "damping_ratio_std": None if sigma is None else known(float(sigma.damping_ratio[k])),
            "mpc": known(float(found.mpc[k])),
            "emac": known(float(found.emac[k])),
            "holds": held[k],
            "shape_re": found.shapes[k].real.tolist(),
            "shape_im": found.shapes[k].imag.tolist(),
        }
        for k in range(len(found.frequency_hz))
    ]


def identify_group(spec: CampaignSpec, lags: int, parts: Sequence[Accumulator]) -> dict[str, Any]:
    """What the parts of a group tell: plain values for JSON. Without a model "modes" is empty and "fault" says why.

    Cost: one identification, a short one a part for ±, the poles of some ten orders.
    """
    whole = whole_of(spec, lags, parts)
    out: dict[str, Any] = {
        "model_key": spec.model_key, "rows": whole.rows, "sums_sha256": hashlib.sha256(whole.to_bytes()).hexdigest(),
        "parts": sum(part.rows > 0 for part in parts), "order": None, "fault": None, "modes": [],
    }  # fmt: skip
    identifier = make_identifier(spec)
    try:
        found = identifier.run(whole)
    except IdentificationError as fault:
        return out | {"fault": str(fault)}
    sigma = None
    if spec.identification.sigma_blocks and sum(part.rows > 0 for part in parts) >= FEWEST:
        sigma = without_each(identifier, whole, ((part, 1.0) for part in parts), found.model())
    held: list[bool | None] = [None] * len(found.frequency_hz)
    if spec.identification.stabilization:
        held = _held(identifier, found)
    return out | {"order": found.order, "modes": _modes(found, sigma, held)}
