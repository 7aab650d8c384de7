# SPDX-License-Identifier: MIT
"""A hammer that stays while accelerometers rove, and several hits in one file. The plate is that of moved_sensors.py:
its responses to a force are sums of modes at all places, so that no reciprocity goes into the data."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import moved_sensors as site
import numpy as np
import okid as package
import pytest
from numpy.typing import NDArray
from okid import modal, report
from program import okid

Real = NDArray[np.float64]
HAMMER = 4  # the place that is struck where the sensors rove, from 0
STARTS = (0.25, 3.35, 6.3)  # s, of the hits in one file


def strike(s: site.Structure, place: int, starts: tuple[float, ...], seconds: float, rng: np.random.Generator) -> Real:
    """(samples, 1 + places): force and accelerations; pulses of 5 to 6 ms, noise of force and sensors.

    The plate feels steps with the force in the middle of each: at 180 Hz 1.3 % too little, and not late.
    """
    finer = s.fs * site.FINER
    t = np.arange(int(seconds * s.fs) * site.FINER) / finer
    force, felt = np.zeros((2, len(t), 1))
    for start in starts:
        begin, width, peak = start + rng.uniform(0, 0.01), rng.uniform(0.005, 0.006), rng.uniform(60, 140)
        for to, at_times in ((force, t), (felt, t + 0.5 / finer)):
            inside = (at_times >= begin) & (at_times <= begin + width)
            to[inside, 0] += peak * np.sin(np.pi * (at_times[inside] - begin) / width) ** 2
    at = np.zeros((len(s.shapes), 1))
    at[place] = 1.0
    rows = np.hstack([s.sampled(force), s.sampled(s.respond(felt, at))])
    noise = np.concatenate([[0.05], np.full(len(s.shapes), 0.01 * rows[:, 1:].std())])
    return np.asarray(rows + noise * rng.standard_normal(rows.shape))


def set_ups(folder: Path, together: bool) -> list[Path]:
    """Three groups of four accelerometers in g, three hits each: in one file or in one each."""
    s, files, rng = site.plate(), [], np.random.default_rng(3)
    for k in range(3):
        places = list(range(4 * k, 4 * k + 4))
        names = ["force [N]", *(f"a{p + 1} [g]" for p in places)]
        for n, starts in enumerate([STARTS] if together else [(start / 10,) for start in STARTS]):
            rows = strike(s, HAMMER, starts, 9.5 if together else 3.0, rng)[:, [0, *(p + 1 for p in places)]]
            rows[:, 1:] /= 9.80665
            files.append(site.write(folder / f"s{k}_{n}.csv", s.fs, names, rows))
    return files


def confident(found: dict[str, Any]) -> list[dict[str, Any]]:
    return [mode for mode in found["modes"] if mode["confident"]]


def whole(mode: dict[str, Any]) -> Any:
    return np.array(mode["shape_re"], float) + 1j * np.array(mode["shape_im"], float)


OUTPUTS = ["--inputs", "force", "--outputs", ",".join(f"a{p + 1}" for p in range(12))]
DOFS = ["--input-dofs", str(HAMMER + 1), "--output-dofs", ",".join(map(str, range(1, 13)))]


@pytest.mark.parametrize("together", [True, False])
def test_a_hammer_that_stays(tmp_path: Path, together: bool) -> None:
    """The shapes over all sensors with their deviations, and modal masses: as exact as those of a hammer that roves."""
    s, files = site.plate(), set_ups(tmp_path, together)
    done = okid("identify", *files, "--setups", *OUTPUTS, *DOFS, "--json", tmp_path / "r.json", status=0)
    found = json.loads((tmp_path / "r.json").read_text())
    modes = confident(found)
    assert [mode["frequency_hz"] for mode in modes] == pytest.approx(s.frequency, rel=1e-4)
    assert found["records"] == 3 and len(found["set_ups"]) == 3 and "9 of 9 hits used" in done.stdout
    assert found["shape_dofs"] == list(range(1, 13)) and found["outputs"] == [f"a{p + 1}" for p in range(12)]
    assert [hit.get("range") is not None for hit in found["hits"]] == [together] * 9
    away = []
    for k, mode in enumerate(modes):
        assert abs(mode["frequency_hz"] - s.frequency[k]) < 4 * mode["frequency_std_hz"]
        assert abs(mode["damping_ratio"] - s.damping[k]) < 4 * mode["damping_ratio_std"]
        assert modal.mac(whole(mode), s.shapes[:, k]) > 0.9999
        true = s.shapes[:, k] / s.shapes[np.argmax(np.abs(whole(mode))), k]
        away += list(np.abs(whole(mode).real - true) / np.maximum(np.array(mode["shape_re_std"]), 1e-12))
        if abs(s.shapes[HAMMER, k]) > 0.2 * np.max(np.abs(s.shapes[:, k])):
            mass = s.mass[k] / np.max(np.abs(s.shapes[:, k])) ** 2
            assert mode["modal_mass"] == pytest.approx(mass, rel=0.02)
    assert np.sqrt(np.median(np.square([one for one in away if one < 1e6]))) < 3.0


def test_without_places_the_shapes_are_those_of_the_outputs(tmp_path: Path) -> None:
    """One sensor that answers to nothing is named and left out; the report has the hits."""
    s, files = site.plate(), set_ups(tmp_path, False)
    for path in files[3:6]:  # a6 lies on the table
        head, *rows = path.read_text().split("\n", 2)
        table = np.loadtxt(rows[1].splitlines(), delimiter=",")
        table[:, 2] = 1e-7 * np.random.default_rng(1).standard_normal(len(table))
        np.savetxt(path, table, delimiter=",", header=f"{head}\n{rows[0]}", comments="", fmt="%.7g")
    okid("identify", *files, "--setups", *OUTPUTS, "--json", tmp_path / "r.json", status=0)
    found = json.loads((tmp_path / "r.json").read_text())
    assert [mode["frequency_hz"] for mode in confident(found)] == pytest.approx(s.frequency, rel=1e-4)
    for k, mode in enumerate(confident(found)):
        assert mode["shape_re"][5] is None and "modal_mass" not in mode
        left = [p for p in range(12) if p != 5]
        shape = np.array([mode["shape_re"][p] + 1j * mode["shape_im"][p] for p in left])
        assert modal.mac(shape, s.shapes[left, k]) > 0.9999
    assert any(one["code"] == "screened" and '"a6"' in one["text"] for one in found["warnings"])
    assert report.main([str(tmp_path / "r.json")]) == 0
    assert "9 of 9 hits at 1 place were used" in (tmp_path / "r.html").read_text()


def test_a_kept_hit_that_never_rests_is_refused_in_one_line(tmp_path: Path) -> None:
    files = set_ups(tmp_path, False)
    head = files[4].read_text().split("\n", 2)[:2]
    rows = np.loadtxt(files[4], delimiter=",", skiprows=2)
    top = int(rows[:, 0].argmax())
    rows[top:, 0] += 15.0 * np.random.default_rng(2).standard_normal(len(rows) - top)
    np.savetxt(files[4], rows, delimiter=",", header="\n".join(head), comments="", fmt="%.7g")
    done = okid("identify", *files, "--setups", *OUTPUTS, "--json", tmp_path / "r.json", status=0)
    assert "8 of 9 hits used" in done.stdout and "s1_1.csv  left out" in done.stdout
    kept = okid("identify", *files, "--setups", *OUTPUTS, "--keep-all", status=3)
    assert "--keep-all takes never rests" in kept.stderr and kept.stderr.count("\n") == 1


def test_python_gives_the_same(tmp_path: Path) -> None:
    files = set_ups(tmp_path, True)
    okid("identify", *files, "--setups", *OUTPUTS, "--json", tmp_path / "r.json", status=0)
    records = [package.read_csv(path) for path in files]
    found = package.identify_setups(
        [one.samples[:, :1] for one in records], [one.samples[:, 1:] for one in records], fs=records[0].fs_hz,
        output_names=[list(one.names[1:]) for one in records], input_names=["force"],
    )  # fmt: skip
    want = confident(json.loads((tmp_path / "r.json").read_text()))
    assert [mode.frequency_hz for mode in found.confident_modes] == [mode["frequency_hz"] for mode in want]


def test_several_hits_in_a_file(tmp_path: Path) -> None:
    """A file a place: each hit is judged by itself, a bounce spoils its own; the report reads the parts."""
    s, rng, files = site.plate(), np.random.default_rng(8), []
    for place in range(12):
        rows = strike(s, place, STARTS, 9.5, rng)[:, [0, 1, 6]]
        if place == 2:  # a bounce after the second hit
            top = int(np.argmax(rows[:, 0] * (np.abs(np.arange(len(rows)) / s.fs - STARTS[1]) < 0.1)))
            rows[top + 20, 0] += 0.3 * rows[top, 0]
        files.append(site.write(tmp_path / f"P{place + 1:02}.csv", s.fs, ["hammer", "a1", "a6"], rows))
    wanted = ["--inputs", "hammer", "--outputs", "a1,a6", "--places", r"P(\d+)", "--output-dofs", "1,6"]
    okid("identify", *files, *wanted, "--json", tmp_path / "r.json", status=0)
    found = json.loads((tmp_path / "r.json").read_text())
    modes = confident(found)
    assert [mode["frequency_hz"] for mode in modes] == pytest.approx(s.frequency, rel=1e-4)
    for k, mode in enumerate(modes):
        assert modal.mac(whole(mode), s.shapes[:, k]) > 0.9999
        true = s.mass[k] / np.max(np.abs(s.shapes[:, k])) ** 2
        assert mode["modal_mass"] == pytest.approx(true, rel=0.02)
    hits = found["hits"]
    assert [(hit["file"], hit["reason"]) for hit in hits if not hit["accepted"]] == [("P03.csv", "double_hit")]
    assert len(hits) == 36 and hits[1]["range"][0] == hits[0]["range"][1] and hits[2]["range"][1] == int(9.5 * s.fs)
    assert report.main([str(tmp_path / "r.json")]) == 0
    page = (tmp_path / "r.html").read_text()
    assert "35 of 36 hits at 12 places were used" in page and f"P03.csv[{hits[7]['range'][0]}:" in page
    assert "35 of 35 good hits" in page


def test_the_direction_in_a_name(tmp_path: Path) -> None:
    """P03Z- was struck against the axis: with a group for the sign, or it is refused, not pooled."""
    s, rng, files = site.plate(), np.random.default_rng(9), []
    for place in range(12):
        sign = -1.0 if place % 2 else 1.0
        rows = strike(s, place, STARTS[:1], 3.0, rng)[:, [0, 1, 6]] * [1.0, sign, sign]
        name = f"P{place + 1:02}Z{'-' if place % 2 else '+'}_1.csv"
        files.append(site.write(tmp_path / name, s.fs, ["hammer", "a1", "a6"], rows))
    channels = ["--inputs", "hammer", "--outputs", "a1,a6", "--json", tmp_path / "r.json"]
    okid("identify", *files, *channels, "--places", r"P(\d+)[XYZ]([+-]?)_", status=0)
    for k, mode in enumerate(confident(json.loads((tmp_path / "r.json").read_text()))):
        assert modal.mac(whole(mode), s.shapes[:, k]) > 0.999
    refused = okid("identify", *files, *channels, "--places", r"P(\d+)", status=2).stderr
    assert "P02Z-_1.csv: a direction with a sign stands behind place 02" in refused and refused.count("\n") == 1
    other = files[0].rename(tmp_path / "P01X_1.csv")
    site.write(tmp_path / "P01Y_1.csv", s.fs, ["hammer", "a1", "a6"], rows)
    refused = okid("identify", other, tmp_path / "P01Y_1.csv", *channels, "--places", r"P(\d+)", status=2).stderr
    assert "place 01 is struck in Y, in an earlier file in X" in refused
