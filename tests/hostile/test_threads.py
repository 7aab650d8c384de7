# SPDX-License-Identifier: MIT
"""Threads on one object: calls take turns, what is closed says so, and Python may end while one is inside. Release 0.2
ended by a signal in each of these."""

from __future__ import annotations

import os
import subprocess
import sys
import textwrap
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import okid
import pytest
from okid import Error

TOOLS = Path(__file__).resolve().parents[2] / "tools"
BLOCK = np.random.default_rng(1).standard_normal((500, 3))
ROUNDS, THREADS = 60, 4


def together(*works: Callable[[], None]) -> list[BaseException]:
    """All at once from a common start. What they raised."""
    raised: list[BaseException] = []
    start = threading.Barrier(len(works))

    def run(work: Callable[[], None]) -> None:
        start.wait()
        try:
            work()
        except BaseException as fault:
            raised.append(fault)

    threads = [threading.Thread(target=run, args=(work,)) for work in works]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    return raised


def sessions() -> list[Callable[[], Any]]:
    return [
        lambda: okid.Session(1, 2, fs=100.0),
        lambda: okid.Session(1, 2, fs=100.0, method="okid-era", p=10),
        lambda: okid.Session(1, 2, fs=100.0, method="n4sid-cva", window_s=20.0),
    ]


@pytest.mark.parametrize("make", sessions())
def test_threads_feed_one_session(make: Callable[[], Any]) -> None:
    with make() as session:

        def feed() -> None:
            for _ in range(ROUNDS):
                session.feed(BLOCK)
                session.feed(np.asarray(BLOCK, order="F"))  # copied first
                assert session.samples > 0

        assert together(*[feed] * THREADS, session.modes) == []
        assert session.samples == 2 * ROUNDS * THREADS * len(BLOCK)
        session.modes()


@pytest.mark.parametrize("make", sessions())
def test_a_session_is_closed_while_others_feed(make: Callable[[], Any]) -> None:
    for _ in range(5):
        session = make()

        def feed(session: Any = session) -> None:
            while True:
                session.feed(BLOCK)

        raised = together(feed, feed, lambda session=session: session.__exit__())  # type: ignore[misc]
        assert len(raised) == 2
        assert all(isinstance(one, Error) and str(one) == "this session is closed" for one in raised), raised


@pytest.mark.parametrize("kind", [okid.Accumulator, okid.SquareRoot])
def test_accumulators(kind: Any) -> None:
    sums, other = kind(1, 2, 5), kind(1, 2, 5)

    def work(one: Any, two: Any) -> None:
        for _ in range(ROUNDS):
            one.add(BLOCK)
            one.gap()
            one.merge(two)
            assert one.rows > 0
            if one.rows > 1 << 20:  # two that add each other grow as Fibonacci's numbers
                one.reset()

    assert together(lambda: work(sums, other), lambda: work(other, sums)) == []

    def use() -> None:
        while True:
            sums.add(BLOCK)
            sums.gram() if kind is okid.Accumulator else sums.factor()

    raised = together(use, use, sums.close)
    assert len(raised) == 2
    assert all(isinstance(one, Error) and str(one) == "this accumulator is closed" for one in raised), raised


CLOSED: list[tuple[str, Callable[[Any], Any]]] = [
    ("feed", lambda s: s.feed(BLOCK)), ("gap", lambda s: s.gap(3)), ("modes", lambda s: s.modes()),
    ("identify", lambda s: s.identify()), ("stats", lambda s: s.stats), ("reset", lambda s: s.reset()),
    ("to_bytes", lambda s: s.to_bytes()), ("restore", lambda s: s.restore(b"x")), ("merge", lambda s: s.merge(b"x")),
]  # fmt: skip


@pytest.mark.parametrize(("name", "use"), CLOSED)
def test_use_after_close(name: str, use: Callable[[Any], Any]) -> None:
    session = okid.Session(1, 2, fs=100.0)
    session.__exit__()
    session.__exit__()
    with pytest.raises(Error, match="this session is closed"):
        use(session)


ENDS = {
    "identify": "okid.identify(x[:, :1], x[:, 1:], fs=100.0)",
    "session": "session.feed(x); session.modes()",
    "accumulator": "sums.add(x); sums.gram()",
}


@pytest.mark.parametrize("what", list(ENDS))
def test_python_ends_while_a_thread_is_inside(what: str) -> None:
    """The call in a daemon thread is waited for; it does not begin another one."""
    text = f"""
        import threading, numpy as np, okid
        x = np.random.default_rng(1).standard_normal((20000, 4))
        moved = np.zeros(20000)  # noise alone has no model, and a thread that ends with an error says so
        for n in range(2, 20000):
            moved[n] = x[n, 0] + 1.9 * moved[n - 1] - 0.98 * moved[n - 2]
        x[:, 1:] += moved[:, None] * [1.0, -0.5, 0.8]
        session, sums = okid.Session(1, 3, fs=100.0), okid.Accumulator(1, 3, 20)
        begun = threading.Event()
        def work():
            while True:
                begun.set()
                {ENDS[what]}
        for _ in range(2):
            threading.Thread(target=work, daemon=True).start()
        begun.wait()
    """
    for _ in range(3):
        done = subprocess.run(
            [sys.executable, "-c", textwrap.dedent(text)], capture_output=True, text=True, timeout=1800, check=False,
            env={**os.environ, "PYTHONPATH": str(TOOLS), "OPENBLAS_NUM_THREADS": "1"},
        )  # fmt: skip
        assert (done.returncode, done.stderr) == (0, ""), done
