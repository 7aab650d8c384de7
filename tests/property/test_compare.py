# SPDX-License-Identifier: MIT
"""okid compare and okid.compare(): pairs of modes, shifts with their deviations, and how often chance raises an alarm.

Results are made of drawn values where that is enough; what must come out follows from the values."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import okid as package
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from program import okid
from scipy.stats import binom
from scipy.stats import t as student
from two_masses import rig_text, simulate_rig

NAMES = ["a", "b", "c", "d"]
SHAPES = np.linalg.qr(np.random.default_rng(0).normal(size=(4, 4)))[0]  # of modes, orthogonal
Mode = tuple[float, float, float | None, float | None, Any]


def made(modes: list[Mode], outputs: list[str] = NAMES, **more: Any) -> dict[str, Any]:
    """An okid.result/1 as far as it is compared: of each mode f, ζ, their deviations and the shape."""
    listed = []
    for f, zeta, f_std, zeta_std, shape in modes:
        x = np.asarray(shape, complex)
        parts = {key: [None if np.isnan(v) else float(v) for v in getattr(x, part)]
                 for key, part in (("shape_re", "real"), ("shape_im", "imag"))}  # fmt: skip
        listed.append({"frequency_hz": f, "damping_ratio": zeta, "frequency_std_hz": f_std,
                       "damping_ratio_std": zeta_std, "confident": True, **parts})  # fmt: skip
    return {"schema": "okid.result/1", "fs_hz": 100.0, "method": "auto", "hold": "zoh", "inputs": [],
            "outputs": outputs, "modes": listed, **more}  # fmt: skip


def three(shift: float = 0.0, **more: Any) -> dict[str, Any]:
    """Three modes, the second moved by so much."""
    f = [10.0, 20.0 * (1.0 + shift), 30.0]
    return made([(f[k], 0.01, 0.01, 0.0005, SHAPES[k]) for k in range(3)], **more)


def test_shifts_are_after_minus_before() -> None:
    a = made([(10.0, 0.010, 0.03, 0.0006, SHAPES[0])], sigma_blocks=20)
    b = made([(9.5, 0.012, 0.04, 0.0008, 2.0j * SHAPES[0])], sigma_blocks=30)
    (pair,) = package.compare(a, b).pairs
    assert pair.shift_hz == pytest.approx(-0.5) and pair.shift_percent == pytest.approx(-5.0)
    assert pair.shift_std_hz == pytest.approx(0.05) and pair.shift_std_percent == pytest.approx(0.5)
    assert pair.z == pytest.approx(-10.0) and pair.mac == pytest.approx(1.0) and pair.more_than_chance
    assert pair.verdict == "lower by 5 %, more than chance (z -10.0)"
    assert pair.damping_z == pytest.approx(2.0) and pair.damping_shift_percent == pytest.approx(20.0)
    assert pair.damping_verdict == "no change beyond chance" and pair.damping_more_than_chance is False
    # Holm over both, Student's t of the fewer blocks less one
    assert pair.damping_p_value == pytest.approx(2.0 * student.sf(2.0, 19), rel=1e-9)
    assert pair.p_value == pytest.approx(4.0 * student.sf(10.0, 19), rel=1e-4)
    back = package.compare(b, a).pairs[0]
    assert back.shift_hz == pytest.approx(0.5) and back.verdict.startswith("higher by 5.3 %, more than chance")


@pytest.mark.parametrize("blocks", [2, 3, 4, 10, 15, 20, 100, 100_000])
def test_probability_is_students(blocks: int) -> None:
    for z in (0.3, 1.7, 3.0, 4.4):
        a = made([(10.0, 0.01, 0.06, None, SHAPES[0])], sigma_blocks=blocks)
        b = made([(10.0 + 0.1 * z, 0.01, 0.08, None, SHAPES[0])], sigma_blocks=blocks)
        found = package.compare(a, b).pairs[0].p_value
        assert found == pytest.approx(2.0 * student.sf(z, blocks - 1), rel=1e-2 if blocks > 1000 else 1e-9)


@given(st.lists(st.floats(-9.0, 9.0), min_size=1, max_size=4))
@settings(max_examples=40, deadline=None)
def test_many_shifts_share_one_rate_of_alarms(z: list[float]) -> None:
    """As Holm defines it: ranked, the k-th smallest of n is multiplied by n - k + 1, none less than one before."""
    a = made([(10.0 * (k + 1), 0.01, 0.006, None, SHAPES[k]) for k in range(len(z))])
    b = made([(10.0 * (k + 1) + 0.01 * z[k], 0.01, 0.008, None, SHAPES[k]) for k in range(len(z))])
    found = package.compare(a, b)
    own = [2.0 * student.sf(abs((one.b.frequency_hz - one.a.frequency_hz) / 0.01), 19) for one in found.pairs]
    rank = np.argsort(own)
    want = np.maximum.accumulate([min(1.0, own[k] * (len(z) - i)) for i, k in enumerate(rank)])
    assert [found.pairs[k].p_value for k in rank] == pytest.approx(want.tolist(), rel=1e-6, abs=1e-13)
    assert [found.pairs[k].more_than_chance for k in rank] == [p < 0.01 for p in want]


def test_shapes_decide_whatever_the_order_of_the_outputs() -> None:
    """Modes that changed places, outputs in another order, one that only one result has, one that was left out."""
    a = made([(10.0, 0.01, 0.01, 0.001, SHAPES[0]), (10.5, 0.01, 0.01, 0.001, SHAPES[1])])
    order = [2, 0, 3, 1]
    shapes = [[*SHAPES[k][order], 7.0] for k in (1, 0)]
    b = made([(10.1, 0.01, 0.01, 0.001, shapes[0]), (10.7, 0.01, 0.01, 0.001, shapes[1])],
             [*(NAMES[k] for k in order), "e"])  # fmt: skip
    found = package.compare(a, b)
    assert [(one.a.mode, one.b.mode) for one in found.pairs] == [(1, 2), (2, 1)]
    assert all(one.mac is not None and one.mac > 0.9999 for one in found.pairs)
    assert found.to_dict()["channels"] == NAMES
    np.testing.assert_allclose(found.cross_mac, [[0.0, 1.0], [1.0, 0.0]], atol=1e-12)
    gap = SHAPES.copy()
    gap[:, 1] = np.nan
    with_gap = package.compare(made([(10.0, 0.01, 0.01, 0.001, gap[0])]), a)
    assert with_gap.pairs[0].mac == pytest.approx(1.0) and len(with_gap.only_b) == 1


def test_a_shape_that_differs_is_another_mode_unless_the_frequency_is_the_same() -> None:
    a = made([(10.0, 0.01, 0.01, 0.001, SHAPES[0]), (30.0, 0.01, 0.01, 0.001, SHAPES[1])])
    b = made([(10.5, 0.01, 0.01, 0.001, SHAPES[2]), (30.02, 0.01, 0.01, 0.001, SHAPES[3])])
    found = package.compare(a, b)
    assert [(one.a.mode, one.b.mode) for one in found.pairs] == [(2, 2)]  # 1.4 deviations apart
    assert [one.mode for one in found.only_a] == [1] and [one.mode for one in found.only_b] == [1]
    assert "only in A: mode 1 (10 Hz)" in str(found.table()) and "only in B: mode 1 (10.5 Hz)" in str(found.table())


def test_places_of_roving_tests() -> None:
    a = three(shape_dofs=[1, 2, 3, 4])
    order = [3, 1, 0, 2]
    b = made([(f, 0.01, 0.01, 0.001, SHAPES[k][order]) for k, f in enumerate((9.9, 19.9, 29.9))],
             ["ref"], shape_dofs=[order[k] + 1 for k in range(4)])  # fmt: skip
    found = package.compare(a, b)
    assert found.to_dict()["channels"] == ["1", "2", "3", "4"]
    assert [one.mac for one in found.pairs] == pytest.approx([1.0] * 3)


def test_without_common_outputs_by_frequency_alone() -> None:
    found = package.compare(three(), three(0.02, outputs=["w", "x", "y", "z"]))
    assert [one.mac for one in found.pairs] == [None] * 3 and found.cross_mac.size == 0
    assert found.to_dict()["paired_by"] == "frequency" and "frequency alone" in found.warnings[0]
    assert [one.more_than_chance for one in found.pairs] == [False, True, False]


def test_a_shift_without_deviation_has_no_z() -> None:
    bare = three()
    for mode in bare["modes"]:
        mode["frequency_std_hz"] = None
    found = package.compare(bare, three(0.02))
    assert found.pairs[1].z is None and found.pairs[1].more_than_chance is None and not found.changed
    assert found.pairs[1].verdict == "higher by 2 %, no standard deviation"
    assert any(text.startswith("no_deviation") for text in found.warnings)
    assert found.pairs[1].damping_more_than_chance is False


def test_the_table_of_pairs() -> None:
    found = package.compare(three(), three(-0.012))
    rows = found.table()
    assert rows[1]["a_frequency_hz"] == 20.0 and rows[1]["shift_percent"] == pytest.approx(-1.2)
    text = str(rows)
    assert "lower by 1.2 %, more than chance (z -17.0)" in text and text.count("no change beyond chance") == 5
    assert "lower by 1.2 %, more than chance" in found._repr_html_()
    assert found.to_dict()["schema"] == "okid.comparison/1"
    assert repr(found) == "<Comparison of 3 pairs of modes, 1 moved by more than chance>"


def test_alarms_by_chance() -> None:
    """Deviations that are themselves drawn, as of 20 blocks: one comparison in a hundred may raise an alarm."""
    rng, alarms, count = np.random.default_rng(5), 0, 600
    for _ in range(count):
        sides = []
        for _side in range(2):
            scale = np.sqrt(rng.chisquare(19, (3, 2)) / 19)
            f, z = 0.01 * rng.normal(size=3), 0.0005 * rng.normal(size=3)
            sides.append(made([(10.0 * (k + 1) + f[k], 0.01 + z[k], 0.01 * scale[k, 0], 0.0005 * scale[k, 1], SHAPES[k])
                               for k in range(3)]))  # fmt: skip
        alarms += package.compare(*sides).changed
    assert alarms <= binom.ppf(0.999, count, 0.01)


def test_the_command(tmp_path: Path) -> None:
    for name, raw in (("a", three()), ("b", three(-0.012)), ("c", three())):
        (tmp_path / f"{name}.json").write_text(json.dumps(raw))
    a, b, c = (tmp_path / f"{name}.json" for name in "abc")
    done = okid("compare", a, b, status=0)
    assert "lower by 1.2 %, more than chance (z -17.0)" in done.stdout and done.stderr == ""
    assert okid("compare", a, b, "--fail-on", status=1).stdout == done.stdout
    okid("compare", a, c, "--fail-on", status=0)
    told = json.loads(okid("compare", a, b, "--json", "-", status=0).stdout)
    assert told == package.compare(a, b).to_dict()
    okid("compare", a, b, "--json", tmp_path / "c12.json", status=0)
    assert json.loads((tmp_path / "c12.json").read_text()) == told
    done = okid("compare", a, b, "--json", a, status=2)
    assert "does not overwrite" in done.stderr and json.loads(a.read_text()) == three()


@pytest.mark.parametrize(
    ("damage", "words"),
    [
        ({"schema": "okid.truth/1"}, 'schema: found "okid.truth/1", expected "okid.result/1"'),
        ({"modes": 7}, "modes: found 7, expected a list of modes"),
        ({"modes": [3]}, "modes[0]: found 3, expected an object"),
        ({"outputs": ["a", 2]}, "outputs: found 2, expected a list of names"),
        ({"outputs": ["a"]}, "modes[0].shape_re: found 4 numbers, expected a list of 1 numbers"),
        ({"shape_dofs": [1]}, "modes[0].shape_re: found 4 numbers, expected a list of 1 numbers"),
        ({"sigma_blocks": -1}, "sigma_blocks: found -1, expected a whole number"),
        ({"fs_hz": None}, "fs_hz: found null, expected Hz above 0"),
    ],
)
def test_a_damaged_result_is_named(damage: dict[str, Any], words: str, tmp_path: Path) -> None:
    good, bad = tmp_path / "good.json", tmp_path / "bad.json"
    good.write_text(json.dumps(three()))
    bad.write_text(json.dumps(three() | damage))
    done = okid("compare", good, bad, status=2)
    assert done.stderr.startswith(f"okid: {bad}: {words}") and done.stderr.count("\n") == 1
    with pytest.raises(package.InputError) as caught:
        package.compare(good, bad)
    assert str(caught.value).startswith(f"{bad}: {words}")


def test_damaged_values_and_files(tmp_path: Path) -> None:
    good, bad = tmp_path / "good.json", tmp_path / "bad.json"
    good.write_text(json.dumps(three()))
    for key, value, words in (("frequency_hz", 0.0, "modes[1].frequency_hz: found 0, expected Hz above 0"),
                              ("frequency_std_hz", -1.0, "modes[1].frequency_std_hz: found -1"),
                              ("damping_ratio", "x", 'modes[1].damping_ratio: found "x"'),
                              ("confident", 1, "modes[1].confident: found 1, expected true or false")):  # fmt: skip
        raw = three()
        raw["modes"][1][key] = value
        bad.write_text(json.dumps(raw))
        assert f"{bad}: {words}" in okid("compare", bad, good, status=2).stderr
    for text, words in (('{"schema":\n x}', f"{bad}:2:2: not JSON"), ("[" * 100, "nested deeper than 32 levels"),
                        ('{"a": 1e999}', "not finite"), ("[]", "schema: found")):  # fmt: skip
        bad.write_text(text)
        assert words in okid("compare", good, bad, status=2).stderr, text
    assert "is a folder" in okid("compare", good, tmp_path, status=2).stderr
    with pytest.raises(package.InputError, match="expected a Result"):
        package.compare(good, 3)  # type: ignore[arg-type]


def test_a_softer_spring_and_equal_structures(tmp_path: Path) -> None:
    """Records of a rig: five equal pairs, then the second spring 2 % softer: both modes move as the truth does."""
    results, truths = [], []
    for seed, springs in [*((seed, "[3e4, 2e4]") for seed in range(10)), (10, "[3e4, 1.96e4]")]:
        folder = tmp_path / str(seed)
        folder.mkdir()
        simulate_rig(folder, rig_text(40.0, seed=seed, springs=springs))
        okid("identify", folder / "a.csv", "--inputs", "force1", "--outputs", "acc1,acc2", "--json", folder / "r.json",
             "--quiet", status=0)  # fmt: skip
        results.append(package.Result.from_dict(json.loads((folder / "r.json").read_text())))
        truths.append(json.loads((folder / "t.json").read_text())["frequency_hz"])
    equal = [package.compare(results[k], results[k + 1]) for k in range(0, 10, 2)]
    assert all(len(one.pairs) == 2 and not one.changed for one in equal)
    found = package.compare(results[0], results[10])
    for k, pair in enumerate(found.pairs):
        assert pair.more_than_chance and pair.z is not None and pair.shift_std_hz is not None
        assert abs(pair.shift_hz - (truths[10][k] - truths[0][k])) < 4.0 * pair.shift_std_hz
        assert pair.damping_more_than_chance is False
