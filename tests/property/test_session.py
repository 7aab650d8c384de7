# SPDX-License-Identifier: MIT
"""okid.Session is `okid replay` in Python: the same numbers from the same samples, however they are cut into blocks."""

from __future__ import annotations

import pathlib
import re
from typing import Any

import numpy as np
import okid
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from program import okid as run_okid
from two_masses import rig_text, simulate_rig

Real = NDArray[np.float64]
MEMORIES = {"growing": {}, "window": {"window_s": 10.0}, "forgetting": {"forgetting": 0.9995}}


@pytest.fixture(scope="module")
def rig(tmp_path_factory: pytest.TempPathFactory) -> pathlib.Path:
    return simulate_rig(tmp_path_factory.mktemp("session"), rig_text(30.0))


@pytest.fixture(scope="module")
def samples(rig: pathlib.Path) -> Real:
    done = run_okid("convert", rig / "a.log", rig / "decoded.csv", "-c", rig / "a.toml")
    assert done.returncode == 0, done.stderr
    return okid.read_csv(rig / "decoded.csv").samples


def fed(session: okid.Session, samples: Real, size: int = 125) -> okid.Session:
    for first in range(0, len(samples), size):
        session.feed(samples[first : first + size])
    return session


@settings(max_examples=15, deadline=None)
@given(cuts=st.lists(st.integers(0, 3000), max_size=30), memory=st.sampled_from(list(MEMORIES)))
def test_the_cut_into_blocks_does_not_matter(cuts: list[int], memory: str) -> None:
    """Whole records, single samples, empty blocks: the same sums, so the same modes to the last bits of doubles."""
    force, answer = okid.demo_record(3000)
    record = np.hstack([force, answer])
    given_memory: dict[str, Any] = {"window_s": 2.0} if memory == "window" else MEMORIES[memory]
    whole, parts = (okid.Session(1, 3, fs=1000.0, p=12, order=6, sigma_blocks=8, **given_memory) for _ in range(2))
    whole.feed(record)
    edges = [0, *sorted(cuts), len(record)]
    for first, last in zip(edges[:-1], edges[1:], strict=True):
        parts.feed(record[first:last])
    a, b = whole.modes(), parts.modes()
    assert len(a) == len(b) == 3
    for one, other in zip(a, b, strict=True):
        assert other.frequency_hz == pytest.approx(one.frequency_hz, rel=1e-9)
        assert other.frequency_std_hz == pytest.approx(one.frequency_std_hz, rel=1e-3)


def test_missing_samples_are_a_gap(samples: Real) -> None:
    """NaN rows, and gap() in their place, are the same; the count says what is missing."""
    holed = samples.copy()
    holed[2000:2010] = np.nan
    marked = fed(okid.Session(1, 2, fs=250.0, p=12), holed)
    cut = okid.Session(1, 2, fs=250.0, p=12)
    cut.feed(samples[:2000])
    cut.gap(10)
    cut.feed(samples[2010:])
    assert marked.samples == cut.samples == len(samples) and marked.stats.missing == cut.stats.missing == 10
    a, b = marked.identify(), cut.identify()
    assert a.modes[0].frequency_hz == pytest.approx(b.modes[0].frequency_hz, rel=1e-12)
    assert a.gaps == 1 and a.warnings[0].code == "missing_samples" and "10 of 7500" in a.warnings[0].text


def test_codes_are_exact() -> None:
    """16-bit codes with a scale give the modes of the numbers they stand for; a saturated code is told."""
    force, answer = okid.demo_record(6000)
    record = np.hstack([force, answer])
    scale = 1.05 * np.max(np.abs(record), axis=0) / 32767.0
    codes = np.rint(record / scale).astype(np.int16)
    exact = okid.Session(1, 3, fs=1000.0, p=20, codes=16, scale=scale)
    real = okid.Session(1, 3, fs=1000.0, p=20)
    assert exact.feed(codes) == 0 and real.feed(codes * scale) == 0
    for a, b in zip(exact.modes(), real.modes(), strict=True):
        assert a.frequency_hz == pytest.approx(b.frequency_hz, rel=1e-9)
    codes[0, 0] = 32767
    assert exact.feed(codes[:100]) > 0 and exact.stats.saturated == 1
    with pytest.raises(okid.InputError, match="16-bit codes as int16"):
        exact.feed(record)


def test_memory_does_not_grow() -> None:
    """A long stream costs what a short one did; what is remembered is the window."""
    rng = np.random.default_rng(2)
    session = okid.Session(1, 3, fs=1000.0, p=10, window_s=2.0)
    before = session.nbytes
    for _ in range(40):
        session.feed(rng.standard_normal((1000, 4)))
    assert session.nbytes == before and session.samples == 40000 and session.rows <= 2100


def test_too_early_there_are_no_modes() -> None:
    session = okid.Session(["u"], ["y1", "y2"], fs=100.0, p=10)
    assert session.modes() == []
    session.feed(np.ones((5, 3)))
    assert session.modes() == []
    with pytest.raises(okid.IdentificationError):
        session.identify()
    session.reset()
    assert session.samples == 0


def test_ambient_session() -> None:
    _, answer = okid.demo_record(20000)
    session = fed(okid.Session([], ["a", "b", "c"], fs=1000.0, p=30, order=6), answer, 1000)
    result = session.identify()
    assert result.inputs == [] and result.hankel is None
    assert [round(mode.frequency_hz) for mode in result.modes] == [11, 32, 46]


@pytest.mark.parametrize(
    ("wrong", "text"),
    [
        ({"window_s": 2.0, "forgetting": 0.99}, "exclude each other"),
        ({"detrend": "linear"}, "none or mean"),
        ({"sigma_blocks": 3}, "8 to 100"),
        ({"forgetting": -0.5}, "forgetting: found -0.5, expected a factor above 0 to 1"),
        ({"method": "okid"}, 'method: found "okid"'),
        ({"inputs": ["y1"]}, "name of its own"),
        ({"p": 5000}, "from 1 to 4096"),
        ({"codes": 12}, "codes: found 12"),
    ],
)
def test_wrong_arguments(wrong: dict[str, Any], text: str) -> None:
    with pytest.raises(okid.InputError, match=re.escape(text)):
        okid.Session(**{"inputs": ["u1"], "outputs": ["y1"], "fs": 100.0, **wrong})


@pytest.mark.parametrize(
    ("text", "says"),
    [
        (None, "No such file or directory"),
        ("a = [", "line 1"),
        ("[acquisition]\nrate_hz = 100\n", "no [[bus]]"),
        ('[[channel]]\nname = "a"\nrole = "acceleration"\n', '"rate_hz" is missing'),
        ('[acquisition]\nrate_hz = "x"\n', 'found "x", expected a number from 1e-05'),
    ],
)
def test_wrong_configs(tmp_path: pathlib.Path, text: str | None, says: str) -> None:
    path = tmp_path / "c.toml"
    if text is not None:
        path.write_text(text)
    with pytest.raises(okid.InputError) as fault:
        okid.Session.from_config(path)
    assert str(fault.value).startswith(str(path)) and says in str(fault.value)


@pytest.mark.parametrize("memory", list(MEMORIES))
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_ten_gaps_do_not_swell_the_deviations(memory: str, seed: int) -> None:
    """At every update: what is lost costs its share of the samples and no more, wherever blocks and gaps meet."""
    draw = np.random.default_rng(seed)
    force, answer = okid.demo_record(12000)
    whole = np.hstack([force, answer])
    holed = whole.copy()
    for first, count in zip(draw.integers(100, 11900, 10), draw.choice([1, 2, 5, 30, 150, 300], 10), strict=True):
        holed[first : first + count] = np.nan
    given: dict[str, Any] = {"window_s": 4.0} if memory == "window" else MEMORIES[memory]
    gaps, calm = (okid.Session(1, 3, fs=1000.0, method="okid-era", p=20, order=6, **given) for _ in range(2))
    for first in range(0, 12000, 1000):
        gaps.feed(holed[first : first + 1000])
        calm.feed(whole[first : first + 1000])
        if first < 4000:
            continue
        for one, other in zip(gaps.modes(), calm.modes(), strict=True):
            assert (
                one.frequency_std_hz < 5 * other.frequency_std_hz
                and one.damping_ratio_std < 5 * other.damping_ratio_std
            )


@pytest.mark.parametrize("method", ["auto", "n4sid-cva"])
def test_settled_once_three_updates_agree(method: str) -> None:
    force, answer = okid.demo_record(4000)
    session, said = okid.Session(1, 3, fs=1000.0, method=method, order="auto" if method == "auto" else 6), []
    for first in range(0, 4000, 500):
        session.feed(np.hstack([force, answer])[first : first + 500])
        session.modes()
        said.append(session.settled)
    assert not any(said[:2]) and all(said[-3:])
    session.reset()
    assert not session.settled
