# SPDX-License-Identifier: MIT
"""okid merge and okid.merge(): set-ups that exist become one result, each mode once; results are of drawn values."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import okid as package
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from okid import modal
from program import okid

PLACES = [f"p{k}" for k in range(8)]
TRUE_HZ = np.array([4.0, 7.0, 7.4, 12.0])


def set_up(places: list[int], seed: int, noise: float = 0.02, sigma: float = 0.01, **more: Any) -> dict[str, Any]:
    """An okid.result/1 of a structure at some places: f and ζ scatter by σ, shapes by `noise`, each on a scale."""
    rng = np.random.default_rng(seed)
    modes = []
    for k, f in enumerate(TRUE_HZ):
        own = SHAPES[k, places] + noise * rng.normal(size=len(places))
        own = own * rng.uniform(0.3, 3.0) * np.exp(1j * rng.uniform(0.0, 6.0))
        modes.append({"frequency_hz": f + sigma * rng.normal(), "damping_ratio": 0.01 + 0.0005 * rng.normal(),
                      "frequency_std_hz": sigma, "damping_ratio_std": 0.0005, "confident": True, "emac": 0.9,
                      "shape_re": own.real.tolist(), "shape_im": own.imag.tolist()})  # fmt: skip
    return {"schema": "okid.result/1", "fs_hz": 100.0, "samples": 1000, "method": "auto", "hold": "zoh", "inputs": [],
            "outputs": [PLACES[p] for p in places], "modes": modes, "warnings": [], **more}  # fmt: skip


SHAPES = np.random.default_rng(3).normal(size=(4, 8))
SET_UPS = [[0, 1, 2, 3], [0, 1, 4, 5], [0, 1, 6, 7]]


@given(st.integers(0, 10**6), st.permutations([0, 1, 2]), st.floats(0.0, 0.08))
@settings(max_examples=40, deadline=None)
def test_every_mode_once_whatever_the_order(seed: int, order: list[int], noise: float) -> None:
    merged = package.merge([set_up(SET_UPS[k], seed + k, noise) for k in order])
    assert sorted(merged.outputs) == PLACES and len(merged.outputs) == 8 and merged.method == "poser"
    assert len(merged.modes) == 4 and all(mode.found_in == 1.0 and mode.confident for mode in merged.modes)
    turn = [PLACES.index(name) for name in merged.outputs]
    for mode, f, shape in zip(merged.modes, TRUE_HZ, SHAPES, strict=True):
        assert abs(mode.frequency_hz - f) < 0.06
        assert modal.mac(mode.shape, shape[turn]) > 0.9 and np.max(np.abs(mode.shape)) == pytest.approx(1.0)


def test_means_have_the_weights_of_their_deviations() -> None:
    one, two = set_up(SET_UPS[0], 1), set_up(SET_UPS[1], 2)
    for raw, f, sigma in ((one, 7.0, 0.01), (two, 7.02, 0.02)):
        raw["modes"] = [raw["modes"][1] | {"frequency_hz": f, "frequency_std_hz": sigma}]
    (mode,) = package.merge([one, two]).modes
    assert mode.frequency_hz == pytest.approx((7.0 * 4 + 7.02) / 5)
    assert mode.frequency_std_hz == pytest.approx(0.01 / np.sqrt(1.25))  # they agree
    two["modes"][0]["frequency_hz"] = 7.2  # they do not: by the root of chi-square over its one degree of freedom
    (mode,) = package.merge([one, two]).modes
    chi2 = 0.2**2 / (0.01**2 + 0.02**2)
    assert mode.frequency_std_hz == pytest.approx(0.01 / np.sqrt(1.25) * np.sqrt(chi2))
    two["modes"][0]["frequency_std_hz"] = None
    (mode,) = package.merge([one, two]).modes
    assert mode.frequency_hz == pytest.approx(7.1) and mode.frequency_std_hz == pytest.approx(0.1)


def test_blurred_references_double_no_mode() -> None:
    """Set-ups whose references are so noisy that their MAC misses 0.8: the frequencies say that the modes are one."""
    bad = 0
    for seed in range(40):
        parts = [set_up(places, 100 * seed + k, noise=0.3) for k, places in enumerate(SET_UPS)]
        macs = [
            modal.mac_matrix(
                *(
                    np.array([np.add(m["shape_re"], 1j * np.array(m["shape_im"]))[:2] for m in part["modes"]])
                    for part in two
                )
            )  # fmt: skip
            for two in zip(parts, parts[1:], strict=False)
        ]
        bad += any(np.min(np.diag(mac)) < 0.8 for mac in macs)
        assert len(package.merge(parts).modes) == 4, seed
    assert bad > 10


def test_a_mode_of_one_set_up_is_doubted() -> None:
    parts = [set_up(places, k) for k, places in enumerate(SET_UPS)]
    for part in parts[1:]:
        del part["modes"][3]
    merged = package.merge(parts)
    assert len(merged.modes) == 4 and merged.modes[3].why == ("few_runs",) and not merged.modes[3].confident
    gone = np.isnan(merged.modes[3].shape)
    assert gone[[merged.outputs.index(f"p{k}") for k in (4, 5, 6, 7)]].all() and gone.sum() == 4
    again = package.Result.from_dict(merged.to_dict())
    assert np.array_equal(np.isnan(again.modes[3].shape), gone) and str(again.table()) == str(merged.table())


def test_what_cannot_be_merged() -> None:
    a, b = set_up([0, 1], 1), set_up([2, 3], 2)
    with pytest.raises(package.InputError, match="no output in common"):
        package.merge([a, b])
    with pytest.raises(package.InputError, match='references: found "p9"'):
        package.merge([a, set_up([1, 2], 3)], references=["p9"])
    with pytest.raises(package.InputError, match="found 0 result"):
        package.merge([])
    with pytest.raises(package.InputError, match=r"result 2: modes\[0\].shape_re: found 2 numbers"):
        package.merge([a, b | {"outputs": ["p0"]}])
    for part in (a, b):
        part["modes"] = []
    with pytest.raises(package.InputError, match="no set-up has a confident mode"):
        package.merge([a, a])


def test_the_command(tmp_path: Path) -> None:
    paths = [tmp_path / f"{k}.json" for k in range(3)]
    for k, path in enumerate(paths):
        path.write_text(json.dumps(set_up(SET_UPS[k], k)))
    done = okid("merge", *paths, "--json", tmp_path / "all.json", status=0)
    assert done.stdout.startswith("poser: 0 inputs to 8 outputs, 3000 samples at 100 Hz (30 s), 3 set-ups\n")
    assert json.loads((tmp_path / "all.json").read_text()) == package.merge(paths).to_dict()
    assert str(package.Result.load(tmp_path / "all.json").table()) == done.stdout
    told = json.loads(okid("merge", *paths, "--references", "p1,p0", "--json", "-", status=0).stdout)
    assert told["outputs"] == [PLACES[k] for k in (0, 1, 2, 3, 4, 5, 6, 7)]
    assert "does not overwrite" in okid("merge", *paths, "--json", paths[0], status=2).stderr
    assert "expected two set-ups" in okid("merge", paths[0], status=2).stderr


def test_the_old_name_says_so_once() -> None:
    parts = [package.Result.from_dict(package.merge([set_up(SET_UPS[0], 1), set_up(SET_UPS[1], k)]).to_dict())
             for k in (2, 3)]  # fmt: skip
    from okid.record import setups

    setups._said.clear()
    with pytest.warns(FutureWarning, match=r"okid.merge\(\)") as seen:
        for _ in range(2):
            assert package.merge_setups(parts).to_dict() == package.merge(parts).to_dict()
    assert len(seen) == 1
