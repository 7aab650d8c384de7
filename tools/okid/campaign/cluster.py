# SPDX-License-Identifier: MIT
"""The Dask cluster a campaign runs on: an embedded one of single-threaded processes, or one at an address."""

from __future__ import annotations

import logging
import signal
import tempfile
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module
from typing import Any

from okid._errors import InputError

_CONNECT_S = 15


@contextmanager
def _deaf() -> Iterator[None]:
    """Processes that are begun in this block ignore SIGINT: Ctrl-C on a terminal goes to the whole group, and only the
    one that started the run is to hear it."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)


def _local(workers: int, memory_mb: float, folder: str) -> Any:
    """The embedded cluster, begun: TLS on the loopback, with certificates made for this run and kept in memory."""
    from distributed import LocalCluster
    from distributed.security import Security

    # Anyone who can speak to a scheduler runs code as its owner: other users of this computer have no certificate.
    security = Security.temporary()  # type: ignore[no-untyped-call]
    single = {name: "1" for name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS")}
    with _deaf():
        return LocalCluster(  # type: ignore[no-untyped-call]
            n_workers=workers, threads_per_worker=1, processes=True, dashboard_address=None,
            scheduler_kwargs={"dashboard_address": "127.0.0.1:0"},  # of its counters: two campaigns share no port
            host="127.0.0.1", protocol="tls://", security=security, memory_limit=round(memory_mb * 1e6),
            local_directory=folder, env=single, silence_logs=logging.CRITICAL,
        )  # fmt: skip


@contextmanager
def connected(workers: int, address: str | None, memory_mb: float) -> Iterator[Any]:
    """A dask.distributed.Client. Without an address a LocalCluster of `workers` processes, one thread each (also in
    BLAS), each restarted when it takes more than `memory_mb`; it ends with the block.

    Raises InputError when nothing answers at the address, or Dask is not installed.
    """
    try:
        import dask
        from distributed import Client

        import_module("cryptography")  # for the certificates
    except ImportError:
        raise InputError(
            "a campaign needs Dask and cryptography, which are not installed: pip install './tools[campaign]' in a "
            "checkout of okid"
        ) from None
    settings = {
        "distributed.admin.large-graph-warning-threshold": "4GB",
        "distributed.comm.timeouts.connect": f"{_CONNECT_S}s",
        "distributed.scheduler.allowed-failures": 1,
    }
    for noisy in (
        "distributed.nanny",
        "distributed.worker",
        "distributed.scheduler",
        "distributed.core",
        "distributed.comm",
    ):
        logging.getLogger(noisy).setLevel(logging.CRITICAL)  # the campaign reports itself what happens to records
    with dask.config.set(settings):
        if address is not None:
            try:
                client = Client(address, timeout=_CONNECT_S, set_as_default=False)  # type: ignore[no-untyped-call]
            except (OSError, ValueError) as fault:
                raise InputError(f"{address}: no Dask scheduler answers there: {fault}") from None
            with client:
                yield client
            return
        with (
            tempfile.TemporaryDirectory(prefix="okid-campaign-", ignore_cleanup_errors=True) as folder,
            _local(workers, memory_mb, folder) as cluster,
            Client(cluster, set_as_default=False) as client,  # type: ignore[no-untyped-call]
        ):
            yield client
