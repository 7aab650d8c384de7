# SPDX-License-Identifier: MIT
"""What waits for a browser is bounded; a slow one ends with the newest state, and never holds up the others."""

from __future__ import annotations

import json
import threading

from okid.live.hub import Frame, Hub, Outbox, frame


def lanes(k: int, size: int = 10) -> Frame:
    return Frame("lanes", f"lanes {k:06d}".encode() + b"x" * size, passing=True)


def news(k: int) -> Frame:
    return Frame("modes", f"modes {k:06d}".encode())


def test_everything_arrives_in_order_when_the_browser_keeps_up() -> None:
    outbox, got = Outbox(lambda: news(0)), []
    for k in range(1000):
        outbox.put(lanes(k))
        got += outbox.take(0)
    assert got == [lanes(k).data for k in range(1000)] and outbox.dropped == 0


def test_a_slow_browser_loses_old_lanes_and_nothing_else() -> None:
    outbox = Outbox(lambda: Frame("hello", b"hello"), frames=40)
    for k in range(1000):
        outbox.put(lanes(k))
        if k % 100 == 0:
            outbox.put(news(k))
    got = outbox.take(0)
    assert [data for data in got if data.startswith(b"modes")] == [news(k).data for k in range(0, 1000, 100)]
    kept = [data for data in got if data.startswith(b"lanes")]
    assert kept == sorted(kept) and kept[-1] == lanes(999).data and len(got) <= 40
    assert outbox.dropped == 1000 - len(kept)


def test_bytes_are_bounded_too() -> None:
    outbox = Outbox(lambda: Frame("hello", b"hello"), size=10_000)
    for k in range(100):
        outbox.put(lanes(k, size=1000))
    assert sum(map(len, outbox.take(0))) <= 10_000


def test_one_that_never_reads_gets_a_snapshot_in_the_end() -> None:
    state = {"t": 0}
    outbox = Outbox(lambda: Frame("hello", f"hello {state['t']}".encode()), frames=20)
    for k in range(500):
        state["t"] = k
        outbox.put(news(k))
    assert outbox.take(0) == [b"hello 499"]
    outbox.put(news(500))
    assert outbox.take(0) == [news(500).data]


def test_take_waits_and_ends() -> None:
    outbox = Outbox(lambda: news(0))
    assert outbox.take(0.01) == []
    waiter: list[list[bytes]] = []
    thread = threading.Thread(target=lambda: waiter.append(outbox.take(600)))
    thread.start()
    outbox.put(news(1))
    thread.join()
    assert waiter == [[news(1).data]]
    outbox.close()
    assert outbox.closed and outbox.take(20) == []


def test_pages_come_and_go() -> None:
    counts: list[int] = []
    hub = Hub(counts.append, most=2)
    first, second, third = (Outbox(lambda: news(0)) for _ in range(3))
    assert hub.open(first) and hub.open(second) and not hub.open(third)
    hub.send(news(1))
    hub.leave(first)
    assert hub.open(third)
    hub.send(news(2))
    assert second.take(0) == [news(1).data, news(2).data] and third.take(0) == [news(2).data]
    assert counts == [1, 2, 1, 2]


def test_frames_are_one_event_each_and_hold_no_nan() -> None:
    text = frame("log", {"text": "two\nlines </script>", "x": [1.0, float("nan"), float("inf")]}).data.decode()
    head, data, *rest = text.split("\n")
    assert head == "event: log" and rest == ["", ""]
    assert json.loads(data.removeprefix("data: ")) == {"text": "two\nlines </script>", "x": [1.0, None, None]}
