# SPDX-License-Identifier: MIT
"""Small campaigns in a folder: records of the simulated frame and a SPEC.toml."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from okid.campaign.spec import CampaignSpec, load_spec
from okid.campaign.virtual_year import Year, simulate_year

SMALL = Year(records=24, samples=1500, days=6.0, damage=0.0)


def campaign(folder: Path, year: Year = SMALL, changes: dict[str, str] | None = None, **own: Any) -> CampaignSpec:
    """Simulate a year into a folder; `changes` replace text of its SPEC.toml, `own` attributes of what is read."""
    simulate_year(folder, year)
    path = folder / "SPEC.toml"
    text = path.read_text()
    for old, new in (changes or {}).items():
        assert old in text, old
        text = text.replace(old, new)
    path.write_text(text)
    return load_spec(path, **own)


def facts(outcome: Any) -> dict[str, tuple[str, list[dict[str, Any]]]]:
    """Checksum of the sums and modes of each group: what must not depend on who did the work, and when."""
    return {
        group.label: (outcome.done[group.ident].result["sums_sha256"], outcome.done[group.ident].result["modes"])
        for group in outcome.groups
    }
