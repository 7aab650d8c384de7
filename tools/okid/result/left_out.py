# SPDX-License-Identifier: MIT
"""A result without the outputs that were left out of it (remark `screened`): their shape entries and rows are null."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any


def kept_outputs(raw: Mapping[str, Any]) -> list[bool]:
    """Of each output: is it in the model; all where there is none."""
    kept = [all(value is not None for value in row) for row in raw["model"]["C"]]
    return kept if any(kept) and len(kept) == len(raw["outputs"]) else [True] * len(raw["outputs"])


def without_left_out(raw: Mapping[str, Any]) -> tuple[dict[str, Any], list[str]]:
    """The same okid.result/1 with the outputs the model has, and the names of the others."""
    kept = kept_outputs(raw)
    if all(kept):
        return dict(raw), []

    def own(rows: list[Any]) -> list[Any]:
        return [row for row, stays in zip(rows, kept, strict=True) if stays]

    model = dict(raw["model"])
    model.update({key: own(model[key]) for key in ("C", "D") if model.get(key)})
    model["K"] = [own(row) for row in model.get("K") or []]
    parts = () if raw.get("shape_dofs") else ("re", "im")  # places that were struck stay
    keys = [f"shape_{part}{std}" for part in parts for std in ("", "_std")]
    modes = [{**mode, **{key: own(mode[key]) for key in keys if mode.get(key)}} for mode in raw["modes"]]
    markov = {"Y": [own(block) for block in (raw.get("markov") or {}).get("Y") or []]}
    left = [name for name, stays in zip(raw["outputs"], kept, strict=True) if not stays]
    dofs = {"output_dofs": own(raw["output_dofs"])} if raw.get("output_dofs") else {}
    out = {**raw, **dofs, "outputs": own(raw["outputs"]), "model": model, "modes": modes, "markov": markov}
    return out, left
