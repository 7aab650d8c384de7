# SPDX-License-Identifier: MIT
"""Campaigns: thousands of records into exact sums on Dask, modes of every group, trends; docs/howto/campaigns.md.

okid-campaign is the command; run_campaign(load_spec("SPEC.toml")) does the same from Python.
"""

from importlib import import_module
from typing import Any

from okid.campaign.spec import CampaignSpec, load_spec

__all__ = ["CampaignSpec", "Outcome", "load_spec", "main", "run_campaign"]
_PLACES = {"main": "command", "run_campaign": "run", "Outcome": "run"}


def __getattr__(name: str) -> Any:
    """What needs Dask, pandas or matplotlib loads when it is first used: workers do without."""
    if name in _PLACES:
        return getattr(import_module(f"okid.campaign.{_PLACES[name]}"), name)
    raise AttributeError(f"module 'okid.campaign' has no attribute {name!r}")
