# SPDX-License-Identifier: MIT
"""The embedded cluster of a campaign: who has no certificate of the run cannot speak to it."""

from __future__ import annotations

import gc

import pytest
from distributed import Client
from okid.campaign.cluster import connected


def test_a_neighbour_runs_nothing(tmp_path: object) -> None:
    """Release 0.1 ran code of every local user on tcp://127.0.0.1."""
    with connected(1, None, 500.0) as client:
        address = client.scheduler.address
        assert address.startswith("tls://127.0.0.1:")
        assert client.submit(int, "41").result(1800) == 41
        for other in (address, address.replace("tls://", "tcp://")):
            with pytest.raises((OSError, TypeError, ValueError)):
                Client(other, timeout=2, set_as_default=False)  # type: ignore[no-untyped-call]
            gc.collect()  # else its __del__ may run in the next client's loop and wait for that client's lock
        assert client.submit(int, "42").result(1800) == 42
