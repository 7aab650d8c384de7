# SPDX-License-Identifier: MIT
"""Records to write and read back, drawn or fixed, and what must be the same afterwards."""

from __future__ import annotations

import functools
from datetime import UTC, datetime, timedelta

import numpy as np
import okid
from hypothesis import HealthCheck, settings
from hypothesis import strategies as st
from okid.data.records import ROLES, Record
from scipy.signal import cont2discrete, dlsim

# The same examples every time; each one writes over the file of the one before.
steady = settings(
    deadline=None, derandomize=True, database=None, max_examples=25, print_blob=True,
    suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow],
)  # fmt: skip
NAMES = ["shaker", "storey1", "storey2", "storey3"]


@functools.cache
def shaken_frame(samples: int = 4000) -> tuple[np.ndarray, np.ndarray]:
    """Force (N, 1) on the first of three storeys and accelerations (N, 3) with 1 % noise, at 1000 Hz."""
    mass = np.diag([1.0, 0.8, 1.2])
    stiffness = np.array([[5e4, -2e4, 0.0], [-2e4, 4.5e4, -2.5e4], [0.0, -2.5e4, 2.5e4]])
    damping, inverse = mass + 5e-5 * stiffness, np.linalg.inv(mass)
    a = np.block([[np.zeros((3, 3)), np.eye(3)], [-inverse @ stiffness, -inverse @ damping]])
    b = np.vstack([np.zeros((3, 1)), inverse[:, :1]])
    rng = np.random.default_rng(1)
    force = rng.standard_normal((samples, 1))
    _, y, _ = dlsim(cont2discrete((a, b, a[3:], b[3:]), 1e-3), force)
    return force, y + 0.01 * np.std(y, axis=0) * rng.standard_normal(y.shape)


def full_record(samples: int = 400) -> Record:
    """A record with everything a record can hold, and gaps."""
    u, y = shaken_frame()
    values = np.hstack([u, y])[:samples].copy()
    values[10:13, 2] = np.nan
    values[-1, 0] = np.nan
    return Record(
        list(NAMES), values, 1024.0, ["N", "m/s^2", "m/s^2", "g"], "frame, shaker: \"A\" fs_hz: 5",
        datetime(2026, 11, 21, 12, 0, 0, 123456, UTC), ["force", "acceleration", "aux", None], [1, 2, None, 3],
        {"operator": "Ä. Müller", "structure": "frame 7"},
    )  # fmt: skip


@functools.cache
def identified() -> okid.Result:
    """The demo's frame identified, with M, K, R."""
    u, y = shaken_frame()
    dofs = {"input_dofs": [1], "output_dofs": [1, 2, 3]}
    names = {"input_names": NAMES[:1], "output_names": NAMES[1:]}
    return okid.identify(u, y, fs=1000.0, method="okid-era", **names, **dofs)


letters = st.characters(codec="utf-8", categories=["L", "N", "P", "S", "Zs"])
words = st.text(letters, min_size=1, max_size=12).map(str.strip).filter(lambda text: text != "" and text.isprintable())
units = st.one_of(st.sampled_from(["", "N", "g", "m/s^2", "µm", "Nm/rad"]), words)
numbers = st.floats(allow_infinity=False, allow_nan=True, width=64)


@st.composite
def records(draw: st.DrawFn) -> Record:
    """Any record: names, units, gaps, lengths, rates, roles."""
    names = draw(st.lists(words, min_size=1, max_size=4, unique=True))
    count = len(names)
    rows = draw(st.lists(st.lists(numbers, min_size=count, max_size=count), min_size=2, max_size=8))
    start = draw(st.none() | st.integers(0, 2 * 10**15))
    return Record(
        names, np.array(rows), draw(st.floats(1e-3, 1e6)), draw(st.lists(units, min_size=count, max_size=count)),
        draw(st.just("") | words),
        None if start is None else datetime(1970, 1, 1, tzinfo=UTC) + timedelta(microseconds=start),
        draw(st.lists(st.sampled_from([None, *ROLES]), min_size=count, max_size=count)),
        draw(st.lists(st.none() | st.integers(1, 999), min_size=count, max_size=count)),
        draw(st.dictionaries(words, words, max_size=2)),
    )  # fmt: skip


def assert_same(found: Record, given: Record, notes: bool = True) -> None:
    """Samples to the last bit, NaN at the same places, and all the rest equal."""
    np.testing.assert_array_equal(found.samples, given.samples)
    assert found.about() | {"notes": 0} == given.about() | {"notes": 0}
    assert found.notes == (given.notes if notes else {})
