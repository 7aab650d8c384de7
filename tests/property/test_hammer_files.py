# SPDX-License-Identifier: MIT
"""A folder of hits: one command gives the modes and their shapes over all places; bad hits are left out and named."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import beam
import numpy as np
import okid
import pytest
from program import okid as program

CHANNELS = ["--inputs", "Hammer", "--outputs", "Acc1,Acc2"]
PLACES = ["--places", r"P(\d+)_"]
BAD = {(4, 2): "double_hit", (9, 1): "overload"}


def identified(folder: Path, records: dict[str, Any], *options: str) -> tuple[dict[str, Any], str]:
    paths = beam.write(folder, records)
    done = program("identify", *paths, *CHANNELS, *PLACES, *options, "--json", folder / "r.json", status=0)
    return json.loads((folder / "r.json").read_text()), done.stdout


def confident(result: dict[str, Any]) -> list[dict[str, Any]]:
    return [mode for mode in result["modes"] if mode["confident"]]


def shape_of(mode: dict[str, Any]) -> Any:
    return np.array(mode["shape_re"]) + 1j * np.array(mode["shape_im"])


def test_modes_picked_by_their_number(tmp_path: Path) -> None:
    """Those of the table, with the deviations they have there."""
    rng = np.random.default_rng(3)
    records = {f"P{k}_1.csv": beam.record(beam.Hit(k, 100.0, 0.0015), rng, 0.002) for k in range(1, 7)}
    every, picked = (identified(tmp_path, records, *more)[0]["modes"] for more in ((), ("--modes", "1,3")))
    keys = ("frequency_hz", "frequency_std_hz", "damping_ratio_std", "found_in")
    assert [[m[key] for key in keys] for m in picked] == [[every[k][key] for key in keys] for k in (0, 2)]


def some(*faults: str) -> dict[str, Any]:
    """Good hits at places 1, 2 and 3, and one more at place 2 for each fault."""
    rng = np.random.default_rng(7)
    hits = [beam.Hit(place, 100.0, 0.0015) for place in (1, 2, 3)]
    out = {f"P{hit.place}_1.csv": beam.record(hit, rng, 0.002) for hit in hits}
    for k, fault in enumerate(faults):
        peak, width = (0.2 if fault == "weak" else 100.0), (0.004 if "force" in fault else 0.0015)
        out[f"P2_{k + 2}.csv"] = beam.record(beam.Hit(2, peak, width, fault), rng, 0.002)
    return out


def codes(result: dict[str, Any]) -> list[str]:
    return [warning["code"] for warning in result["warnings"]]


def test_modes_and_shapes_over_all_places(tmp_path: Path) -> None:
    within = []
    for seed in (1, 2):
        result, told = identified(tmp_path, beam.hammer_test(seed, BAD), "--output-dofs", "1,5")
        modes = confident(result)
        assert len(modes) == 7
        for k, mode in enumerate(modes):
            within.append(abs(mode["frequency_hz"] - beam.FREQUENCY[k]) < 2 * mode["frequency_std_hz"])
            within.append(abs(mode["damping_ratio"] - beam.DAMPING[k]) < 2 * mode["damping_ratio_std"])
            assert beam.mac(shape_of(mode), beam.shapes()[:, k]) > 0.999
            assert mode["modal_mass"] == pytest.approx(beam.modal_mass()[k], rel=0.03)
            assert abs(mode["modal_mass"] - beam.modal_mass()[k]) < 4 * mode["modal_mass_std"] < 0.1
        assert result["shape_dofs"] == list(range(1, 13))
        left = {hit["file"]: hit["reason"] for hit in result["hits"] if not hit["accepted"]}
        assert left == {"P04_2.csv": "double_hit", "P09_1.csv": "overload"}
        assert len(result["hits"]) == 36 and "hits_left_out" in codes(result)
        assert "34 of 36 hits used" in told and "left out, double_hit" in told and "ring-down cut off" in told
        assert "mkr" not in result  # twelve places, seven modes
    assert np.mean(within) >= 0.9


def test_sensors_where_nothing_was_struck(tmp_path: Path) -> None:
    """Acc2 at a place of its own comes in by Acc1 at a drive point; without places of sensors those struck alone.
    Two hits a place: the force of a single soft one has its zero where a mode is, and tells nothing of it."""
    records = {name: rows for name, rows in beam.hammer_test(3, {}, each=2).items() if not name.startswith("P05")}
    result, _ = identified(tmp_path, records, "--output-dofs", "1,5")
    assert result["shape_dofs"] == list(range(1, 13))
    for k, mode in enumerate(confident(result)):
        assert beam.mac(shape_of(mode), beam.shapes()[:, k]) > 0.999
    result, _ = identified(tmp_path, records)
    assert result["shape_dofs"] == [1, 2, 3, 4, 6, 7, 8, 9, 10, 11, 12]
    assert all(mode["modal_mass"] is None for mode in result["modes"])


def test_a_polarity_at_a_drive_point(tmp_path: Path) -> None:
    records = beam.hammer_test(4, {}, each=1)
    for rows in records.values():
        rows[:, 2] *= -1
    result, _ = identified(tmp_path, records, "--output-dofs", "1,5")
    said = {warning["code"]: warning["text"] for warning in result["warnings"]}
    assert '"Acc2" at place 5' in said["drive_point_polarity"] and "-5" in said["drive_point_polarity"]
    result, _ = identified(tmp_path, records, "--output-dofs", "1,-5")
    assert not [code for code in codes(result) if code.startswith("drive_point")]


@pytest.mark.parametrize(
    ("fault", "reason"),
    [
        ("double_hit", "double_hit"), ("overload", "overload"), ("overload of the force", "overload"),
        ("too_early", "too_early"), ("late", "late"), ("moving", "moving"), ("weak", "weak"),
        ("samples_lost", "samples_lost"), ("", None),
    ],
)  # fmt: skip
def test_each_reason(tmp_path: Path, fault: str, reason: str | None) -> None:
    if fault == "late":  # leans on the beam to the end
        records = some("")
        records["P2_2.csv"][300:, 0] += 0.08 * records["P2_2.csv"][:, 0].max()
    else:
        records = some(fault)
    one = ("--method", "n4sid-cva")  # hits are judged before any method
    result, _ = identified(tmp_path, records, *one)
    assert [hit["reason"] for hit in result["hits"]] == [None, None, None, reason]
    assert result["records"] == (4 if reason is None else 3)
    kept, _ = identified(tmp_path, records, *one, "--keep-all")
    assert [hit["accepted"] for hit in kept["hits"]] == [True] * 4 and kept["hits"][3]["reason"] == reason


def test_both_sides_of_a_second_hit(tmp_path: Path) -> None:
    for share, good in ((0.08, True), (0.13, False)):
        records = some("")
        force = records["P2_2.csv"][:, 0]
        top = int(np.argmax(force))
        force[top + 200] += share * force[top]
        assert identified(tmp_path, records)[0]["hits"][3]["accepted"] is good


def test_places_and_tests_without_a_good_hit(tmp_path: Path) -> None:
    records = {k: v for k, v in some("double_hit", "overload").items() if k != "P2_1.csv"}
    result, _ = identified(tmp_path, records)
    assert result["shape_dofs"] == [1, 3] and "place_missing" in codes(result)
    only = {k: v for k, v in records.items() if k.startswith("P2")}
    done = program("identify", *beam.write(tmp_path, only), *CHANNELS, *PLACES, status=3)
    assert "no hit was accepted: 1 double_hit, 1 overload" in done.stderr and done.stderr.count("\n") == 1


def test_bad_input(tmp_path: Path) -> None:
    paths = beam.write(tmp_path, some())

    def refused(*arguments: object) -> str:
        done = program("identify", *arguments, *CHANNELS, status=2)
        assert done.stderr.count("\n") == 1
        return done.stderr

    assert "does not match the file name" in refused(*paths, "--places", r"Q(\d+)")
    assert "0 groups, expected one" in refused(*paths, "--places", "P")
    assert "no regular expression" in refused(*paths, "--places", "P(")
    assert "leave one of them out" in refused(*paths, *PLACES, "--hit-dofs", "1,2,3")
    assert "--keep-all belongs to" in refused(*paths, "--keep-all")
    other = tmp_path / "P1_2.csv"
    other.write_text(paths[0].read_text().replace("[m/s^2]", "[g]"))
    assert 'P1_2.csv: "Acc1" is in g, in ' in (units := refused(*paths, other, *PLACES))
    assert "it is in m/s^2; expected one unit: convert one of the files" in units
    assert units == refused(*paths, other)  # merged as records too
    assert f"{tmp_path}: is a folder, expected the files in it" in refused(tmp_path, *PLACES)
    other.write_text(paths[0].read_text().replace("2048", "1024"))
    assert "P1_2.csv: found a sample rate of 1024" in refused(*paths, other, *PLACES)
    other.write_text("no record\n")
    assert "P1_2.csv" in refused(*paths, other, *PLACES)


def test_a_hammer_that_clips_in_many_hits(tmp_path: Path) -> None:
    """A smooth top behind the filter of the recorder, the same in several hits: the limit of an amplifier before it."""
    records = beam.hammer_test(5, {}, each=2)
    limit = float(np.sort([rows[:, 0].max() for rows in records.values()])[-7])
    clipped = [name for name, rows in records.items() if rows[:, 0].max() > 1.02 * limit]
    for name in clipped:  # one sample at the limit and none beside it: no flat top
        force = records[name][:, 0]
        force[:] = np.where(force > 0.9 * limit, 0.9 * limit, force)
        force[force.argmax()] = limit
    result, _ = identified(tmp_path, records, "--method", "n4sid-cva")
    left = {hit["file"]: hit["reason"] for hit in result["hits"] if not hit["accepted"]}
    assert set(clipped) <= set(left) and set(left.values()) == {"overload"} and len(left) <= len(clipped) + 1
    first = tmp_path / clipped[0]
    for name in records:  # one hit in twenty-four files is one hit
        (tmp_path / name).write_bytes(first.read_bytes())
    again, _ = identified(
        tmp_path, {}, "--method", "n4sid-cva", "--keep-all", *map(str, sorted(tmp_path.glob("P*.csv")))
    )
    assert not [hit for hit in again["hits"] if hit["reason"] == "overload"]
    assert "records_repeated" in codes(again)


def test_the_same_force_again_and_again_is_no_limit(tmp_path: Path) -> None:
    """A simulated force, or a shaker's pulse: the same samples in every file. Where only the peaks are the same, and no
    hit is weaker, the hits are kept and the limit is asked for."""
    records = beam.hammer_test(7, {}, each=1)
    pulse = 100 * np.sin(np.pi * np.arange(1, 5) / 5)
    for rows in records.values():
        at = rows[:, 0].argmax()
        rows[:, 0] = 0
        rows[at : at + 4, 0] = pulse
    result, told = identified(tmp_path, records, "--method", "n4sid-cva")
    assert all(hit["accepted"] for hit in result["hits"])
    assert "limit?" not in told
    for k, rows in enumerate(records.values()):
        rows[rows[:, 0].argmax() + 3, 0] += 4 * k
    result, told = identified(tmp_path, records, "--method", "n4sid-cva")
    assert all(hit["accepted"] for hit in result["hits"])
    assert told.count("was the amplifier at its limit?") == len(records)


def test_silence_before_a_simulated_hit_is_no_dropout(tmp_path: Path) -> None:
    """Zeros to the last digit until the force begins, as a simulation has them."""
    records = beam.hammer_test(8, {}, each=1)
    for rows in records.values():
        rows[: rows[:, 0].argmax() - 12] = 0
    result, _ = identified(tmp_path, records)
    assert "screened" not in codes(result)
    assert len(confident(result)) == 7
    records["P02_1.csv"][:400, 1] = 0  # a cable that has no contact until after the hit
    result, _ = identified(tmp_path, records)
    assert codes(result).count("screened") == 1


def test_a_sensor_beside_the_hammer_has_no_spikes(tmp_path: Path) -> None:
    """What a light structure answers at the place of the hit is one sample long and far above what rings on."""
    records = beam.hammer_test(6, {}, each=1)
    for rows in records.values():
        rows[rows[:, 0].argmax(), 1] += 40 * np.std(rows[:, 1])
    result, _ = identified(tmp_path, records)
    assert "screened" not in codes(result)
    assert len(confident(result)) == 7
    rows = records["P03_1.csv"]
    rows[3000, 1] += 40 * np.std(rows[:, 1])  # a bad contact, long after the hit
    result, _ = identified(tmp_path, records)
    texts = [warning["text"] for warning in result["warnings"] if warning["code"] == "screened"]
    assert len(texts) == 1 and "P03_1.csv" in texts[0] and '"Acc1"' in texts[0]


def test_python_is_the_command(tmp_path: Path) -> None:
    records = some("double_hit")
    told, _ = identified(tmp_path, records)
    force, motion = [r[:, :1] for r in records.values()], [r[:, 1:] for r in records.values()]
    names: dict[str, Any] = {"input_names": ["Hammer"], "output_names": ["Acc1", "Acc2"], "hit_dofs": [1, 2, 3, 2]}
    result = okid.identify(force, motion, fs=beam.FS, **names)
    assert result.shape_dofs == told["shape_dofs"] == [1, 2, 3]
    assert [hit["reason"] for hit in result.hits] == [None, None, None, "double_hit"]
    for mine, theirs in zip(result.confident_modes, confident(told), strict=True):
        np.testing.assert_allclose(mine.shape, shape_of(theirs), atol=1e-3)  # the file has seven digits
    assert okid.identify(force, motion, fs=beam.FS, keep_all=True, **names).records == 4
