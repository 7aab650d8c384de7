# SPDX-License-Identifier: MIT
"""What people hand over: masked arrays, frames, turned arrays, wrong numbers. Nothing is misread in silence."""

from __future__ import annotations

import pathlib
import re
from typing import Any

import numpy as np
import okid
import pandas as pd
import pytest

U, Y = okid.demo_record(4000)
KW: dict[str, Any] = {"fs": 1000.0, "p": 20, "order": 6, "sigma_blocks": 0}


def zeta(result: okid.Result) -> list[float]:
    return [mode.damping_ratio for mode in result.modes]


def test_masked_is_missing() -> None:
    masked, holed = np.ma.masked_greater(Y, 2.0 * Y.std()), Y.copy()
    holed[holed > 2.0 * Y.std()] = np.nan
    assert np.any(np.isnan(holed))
    assert (
        zeta(okid.identify(U, masked, **KW)) == zeta(okid.identify(U, holed, **KW)) != zeta(okid.identify(U, Y, **KW))
    )
    session, other = (okid.Session(1, 3, fs=1000.0, p=20) for _ in range(2))
    session.feed(np.ma.hstack([U, masked]))
    other.feed(np.hstack([U, holed]))
    assert session.stats == other.stats and session.stats.missing > 0
    assert zeta(okid.identify(U, np.ma.array(Y), **KW)) == zeta(okid.identify(U, Y, **KW))


def test_frames_keep_their_names() -> None:
    u, y = pd.DataFrame(U, columns=["f"]), pd.DataFrame(Y, columns=["a", "b", "c"])
    result = okid.identify(u, y, **KW)
    assert (result.inputs, result.outputs) == (["f"], ["a", "b", "c"])
    twice = okid.identify([u, u], [y, y], **KW)
    assert twice.records == 2 and twice.outputs == ["a", "b", "c"]
    nullable = y.astype("Float64")
    nullable.iloc[100:110, 1] = pd.NA
    holed = Y.copy()
    holed[100:110, 1] = np.nan
    assert zeta(okid.identify(u, nullable, **KW)) == zeta(okid.identify(U, holed, **KW))


def test_a_frame_goes_by_its_columns() -> None:
    turned = pd.DataFrame(np.hstack([Y, U]), columns=["a", "b", "c", "f"])
    by_name, by_place = okid.Session(["f"], ["a", "b", "c"], fs=1000.0, p=20), okid.Session(1, 3, fs=1000.0, p=20)
    by_name.feed(turned)
    by_place.feed(np.hstack([U, Y]))
    assert [m.frequency_hz for m in by_name.modes()] == [m.frequency_hz for m in by_place.modes()]
    with pytest.raises(okid.InputError, match="no 'f'"):
        by_name.feed(turned.rename(columns={"f": "g"}))


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        ({"fs": 0}, 'fs: found "0", expected a sample rate in Hz above 0'),
        ({"fs": float("nan")}, 'fs: found "nan"'),
        ({"outputs": []}, "outputs is [], expected at least 1"),
        ({"outputs": -1}, "outputs is -1"),
        ({"outputs": "abc"}, "names are given as 'abc', expected a list"),
        ({"p": 0}, 'p: found "0", expected a whole number from 1 to 4096'),
        ({"p": 2.5}, 'p: found "2.5"'),
        ({"order": 0}, 'order: found "0"'),
        ({"order": "x"}, 'order: found "x"'),
        ({"forgetting": 2.0}, "forgetting: found 2.0, expected a factor above 0 to 1"),
        ({"window_s": 0.0}, "window_s: found 0.0, expected seconds above 0"),
        ({"window_s": 0.01}, "method auto needs 500 of so many channels: expected a longer window"),
        ({"window_s": 0.01, "p": 40}, "unknowns (p 40): expected a longer window"),
        ({"window_s": float("nan")}, "window_s: found nan"),
        ({"window": "long"}, 'window: found "long", expected fixed or auto'),
        ({"window": "auto"}, "needs window_s, the longest window"),
        ({"window": "auto", "window_s": 9.0, "method": "auto"}, 'expected a method such as "okid-era"'),
        ({"window": "auto", "window_s": 9.0, "sigma": "none"}, "expected sigma_blocks above 0"),
        ({"window": "auto", "window_s": 9.0, "refine": True}, "refine exclude each other"),
        ({"update_s": 0}, "update_s: found 0"),
        ({"codes": 16, "scale": 0}, "a channel times 0 measures nothing"),
        ({"codes": 16, "scale": [1, 2]}, "one for each of the 4 channels"),
        ({"offset": float("inf")}, "offset: found inf"),
    ],
)
def test_sessions_say_what_is_wrong(arguments: dict[str, Any], says: str) -> None:
    with pytest.raises(okid.InputError, match=re.escape(says)):
        okid.Session(**{"inputs": ["f"], "outputs": ["a", "b", "c"], "fs": 1000.0, **arguments})


def test_records_say_what_is_wrong() -> None:
    with pytest.raises(okid.InputError, match="transposed"):
        okid.identify(U, Y.T, **KW)
    with pytest.raises(okid.InputError, match='rows: found "1", expected a whole number from 2'):
        okid.identify(U, Y, fs=1000.0, rows=1)
    with pytest.raises(okid.InputError, match=re.escape("expected a list, such as ['abc']")):
        okid.identify(U, Y, output_names="abc", **KW)
    with pytest.raises(okid.IdentificationError, match='input "hammer2" repeats input "hammer1"'):
        okid.identify(np.hstack([U, U]), Y, input_names=["hammer1", "hammer2"], **KW)
    infinite = Y.copy()
    infinite[10, 1] = np.inf
    with pytest.raises(okid.InputError, match=r"infinite at sample 10 \(from 0\) of channel y2"):
        okid.identify(U, infinite, **KW)
    with pytest.raises(okid.InputError, match=re.escape("expected a list of names, such as ['force1']")):
        okid.Record(["force1"], U, 100.0).columns("force1", "x.csv")
    with pytest.raises(okid.InputError, match="fs is 0"):
        okid.frf.h1(U, Y, 0)
    with pytest.raises(okid.InputError, match="window is 'foo'"):
        okid.frf.h1(U, Y, 250.0, window="foo")
    session = okid.Session(1, 3, fs=1000.0)
    for count in (-1, 1.5):
        with pytest.raises(okid.InputError, match="count is"):
            session.gap(count)  # type: ignore[arg-type]


def test_a_config_says_what_is_wrong(tmp_path: pathlib.Path) -> None:
    text = '[acquisition]\nrate_hz = 100\n[[channel]]\nname = "a"\nrole = "forze"\n'
    (tmp_path / "c.toml").write_text(text)
    with pytest.raises(okid.InputError, match='key "role": found "forze" .did you mean "force"'):
        okid.Session.from_config(tmp_path / "c.toml")
    (tmp_path / "c.toml").write_text(text.replace("forze", "velocity").replace("= 100", '= "x"'))
    with pytest.raises(okid.InputError, match='key "rate_hz": found "x", expected a number from 1e-05'):
        okid.Session.from_config(tmp_path / "c.toml")
    with pytest.raises(okid.InputError, match="there is no argument 'foo'"):
        okid.Session.from_config(tmp_path / "c.toml", foo=1)


def test_a_result_is_written_whole_or_not(tmp_path: pathlib.Path) -> None:
    result = okid.identify(U, Y, **KW)
    folder = tmp_path / "folder"
    folder.mkdir()
    for target in (folder, tmp_path / "nowhere" / "r.json"):
        with pytest.raises(okid.InputError, match="cannot be written"):
            result.save(target)
    assert [path.name for path in tmp_path.iterdir()] == ["folder"]


def test_they_show_themselves() -> None:
    session = okid.Session(1, 3, fs=1000.0, p=20)
    session.feed(np.hstack([U, Y]))
    assert "4000 samples" in repr(session) and "1 input(s) and 3 output(s)" in repr(session)
    assert "<Stabilization of " in repr(okid.identify(U, Y, **KW).stabilization())
