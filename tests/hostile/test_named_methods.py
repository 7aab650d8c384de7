# SPDX-License-Identifier: MIT
"""Records that no structure is in, given to methods that do not judge: refused where it is plain, and said."""

from __future__ import annotations

import numpy as np
import okid
import pytest
from okid.record.demo import demo_record

FS = 100.0
NOISE = np.random.default_rng(5).standard_normal((6000, 3))


def test_ten_samples_of_six_thousand() -> None:
    """plscf gave six confident modes."""
    y = NOISE.copy()
    y[10:] = np.nan
    with pytest.raises(okid.IdentificationError, match="has 10 samples of which no channel is missing, .* takes 1024"):
        okid.identify(None, y, fs=FS, method="plscf")


@pytest.mark.parametrize("method", ["okid-era", "n4sid-cva", "plscf"])
@pytest.mark.parametrize("with_input", [False, True])
def test_outputs_that_hold_the_same_numbers(method: str, with_input: bool) -> None:
    """okid-era gave 18 confident modes of three times the same output."""
    u = NOISE[:, :1] if with_input else None
    same = np.repeat(NOISE[:, 1:2], 3, axis=1)
    for y in (same, np.column_stack([NOISE[:, 1], NOISE[:, 2], NOISE[:, 1]])):
        with pytest.raises(okid.IdentificationError, match="hold the same numbers: leave one of them out"):
            okid.identify(u, y, fs=FS, method=method)


def test_a_named_method_says_that_it_does_not_judge() -> None:
    u, y = demo_record()
    words = "not judged by a named method"
    for method in ("okid-era", "n4sid-moesp", "okid-era-dc"):
        found = okid.identify(u[:3000], y[:3000], fs=1000.0, method=method)
        assert found.modes and found.to_dict()["judged_by"] == "emac"
        assert words in str(found.table())
    with okid.Session(1, y.shape[1], fs=1000.0, method="okid-era", p=20) as session:
        session.feed(np.hstack([u, y])[:3000])
        live = session.identify()
    assert live.to_dict()["judged_by"] == "emac" and words in str(live.table())
    auto = okid.identify(u[:6000], y[:6000], fs=1000.0)
    assert auto.to_dict()["judged_by"] == "agreement" and words not in str(auto.table())


def test_a_machine_is_no_mode_of_plscf() -> None:
    """It gave seven confident modes of a square wave, and one of a sine, judged by "agreement"."""
    time = np.arange(6000) / FS
    wave = np.sin(2 * np.pi * 3.1 * time)
    for y in (wave[:, None] + 0.01 * NOISE[:, :1], np.sign(wave)[:, None] * [1.0, 0.5] + 0.01 * NOISE[:, :2]):
        try:
            found = okid.identify(None, y, fs=FS, method="plscf").confident_modes
        except okid.IdentificationError as told:
            assert "(tone" in str(told)
            continue
        assert [mode.frequency_hz for mode in found if mode.frequency_hz < 40] == []  # multiples above are folded
