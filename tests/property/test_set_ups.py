# SPDX-License-Identifier: MIT
"""Sensors that are moved between records: one command, one set of modes. The structures share no code with okid
(tests/support/moved_sensors.py); drift, a machine, a dead channel and free decays are those of a site."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import moved_sensors as site
import numpy as np
import okid as package
import pytest
from numpy.typing import NDArray
from okid import modal
from program import okid

Real = NDArray[np.float64]


def run(tmp_path: Path, files: list[Path], *options: str, status: int = 0) -> dict[str, Any]:
    out = tmp_path / "all.json"
    okid("identify", *files, "--setups", "--json", out, *options, status=status)
    found: dict[str, Any] = json.loads(out.read_text(encoding="utf-8"))
    return found


def whole(mode: dict[str, Any]) -> NDArray[np.complex128]:
    return np.array([complex(np.nan if a is None else a, np.nan if b is None else b)
                     for a, b in zip(mode["shape_re"], mode["shape_im"], strict=True)])  # fmt: skip


def check(found: dict[str, Any], s: site.Structure, places: list[int], least_mac: float, sigmas: float = 4.0) -> None:
    """Each mode once and no other; within so many of its own standard deviations; shapes of all places."""
    modes = [mode for mode in found["modes"] if mode["confident"]]
    assert [mode["frequency_hz"] for mode in modes] == pytest.approx(s.frequency, rel=0.01)
    for k, mode in enumerate(modes):
        assert abs(mode["frequency_hz"] - s.frequency[k]) < sigmas * mode["frequency_std_hz"], k
        assert abs(mode["damping_ratio"] - s.damping[k]) < sigmas * mode["damping_ratio_std"], k
        assert modal.mac(whole(mode), s.shapes[places, k]) > least_mac, k
        assert mode["found_in"] == 1.0


def footbridge(tmp_path: Path, unit: str = " [m/s^2]") -> list[Path]:
    s, out = site.footbridge(), []
    for k, places in enumerate(([0, 3, 6, 1, 2, 4], [0, 3, 6, 5, 7])):
        y = site.ambient(s, 300.0, 10 + k)
        y = site.beside_a_machine(site.drifting(y, 20 + k), s.fs, 16.67, 30 + k)
        out.append(site.write(tmp_path / f"s{k}.csv", s.fs, [f"P{p + 1}{unit}" for p in places], y[:, places]))
    return out


def test_a_footbridge_in_two_set_ups(tmp_path: Path) -> None:
    found = run(tmp_path, footbridge(tmp_path), "--outputs", "P1,P2,P3,P4,P5,P6,P7,P8")
    check(found, site.footbridge(), [int(name[1:]) - 1 for name in found["outputs"]], 0.97)
    assert found["method"] == "auto" and found["records"] == 2
    assert found["outputs"] == [f"P{k}" for k in range(1, 9)]  # in the order in which they were asked for
    lines = [mode for mode in found["modes"] if abs(mode["frequency_hz"] - 16.67) < 0.05]
    assert lines and all("tone" in line["why"] for line in lines)
    assert "unexplained" not in [warning["code"] for warning in found["warnings"]]  # it has a name


def test_a_shaker_that_stays_needs_no_reference(tmp_path: Path) -> None:
    """Four accelerometers at a time; the first set-up has one where the shaker pushes."""
    s, files = site.plate(), []
    at = np.zeros((12, 1))
    at[4] = 1.0
    for k in range(3):
        rng = np.random.default_rng(40 + k)
        force = rng.standard_normal((20000 * site.FINER, 1)) * (1.0 + k)
        both = np.hstack([s.sampled(force), s.sampled(s.respond(force, at))])
        both += 0.01 * both.std(axis=0) * rng.standard_normal(both.shape)
        places = [(4 + 4 * k + i) % 12 for i in range(4)]
        names = ["force [N]", *(f"a{p + 1} [g]" for p in places)]
        both[:, 1:] /= 9.80665
        files.append(site.write(tmp_path / f"{k}.csv", s.fs, names, both[:, [0, *(p + 1 for p in places)]]))
    outputs = ["--inputs", "force", "--outputs", ",".join(f"a{p + 1}" for p in range(12))]
    found = run(tmp_path, files, *outputs)
    check(found, s, [int(name[1:]) - 1 for name in found["outputs"]], 0.99, sigmas=5.0)
    placed = run(tmp_path, files, *outputs, "--input-dofs", "5", "--output-dofs", ",".join(map(str, range(1, 13))))
    assert placed["shape_dofs"] == list(range(1, 13))
    for k, mode in enumerate(mode for mode in placed["modes"] if mode["confident"]):
        assert modal.mac(whole(mode), s.shapes[:, k]) > 0.99 and max(abs(whole(mode))) == pytest.approx(1.0)
        true = s.mass[k] / np.max(np.abs(s.shapes[:, k])) ** 2  # of a shape whose largest entry is 1
        assert mode["modal_mass"] == pytest.approx(true, rel=0.05) if abs(s.shapes[4, k]) > 0.2 else True


def test_velocities_beside_accelerations(tmp_path: Path) -> None:
    """Three accelerations and nine velocities, no sensor stays: one shape, real as the structure's is."""
    s, files = site.plate(), []
    at = np.zeros((12, 1))
    at[4] = 1.0
    for k in range(2):
        rng = np.random.default_rng(70 + k)
        force = rng.standard_normal((20000 * site.FINER, 1))
        moved = s.respond(force, at)
        moved[:, 3:] = s.respond(force, at, velocity=True)[:, 3:]
        both = np.hstack([s.sampled(force), s.sampled(moved)])
        both += 0.01 * both.std(axis=0) * rng.standard_normal(both.shape)
        places = range(6 * k, 6 * k + 6)
        names = ["force", *(f"a{p + 1}" for p in places)]
        files.append(site.write(tmp_path / f"{k}.csv", s.fs, names, both[:, [0, *(p + 1 for p in places)]]))
    kinds = ",".join(["acceleration"] * 3 + ["velocity"] * 9)
    options = ["--inputs", "force", "--outputs", ",".join(f"a{p + 1}" for p in range(12)), "--sensing", kinds]
    for more in ([], ["--input-dofs", "5", "--output-dofs", ",".join(map(str, range(1, 13)))]):
        found = run(tmp_path, files, *options, *more)
        check(found, s, list(range(12)), 0.99, sigmas=5.0)
        assert found["shape_quantity"] == "displacement"
        assert min(mode["mpc"] for mode in found["modes"] if mode["confident"]) > 0.95


@pytest.mark.parametrize("noise", [0.0, 1e-4])
def test_a_building_in_four_set_ups_with_a_dead_channel(tmp_path: Path, noise: float) -> None:
    """The cable is off: one value for ever, or the recorder's own noise."""
    s, files = site.building(), []
    for k in range(4):
        places = [8, 9, 2 * k, 2 * k + 1]
        y = site.ambient(s, 900.0, 50 + k)[:, places]
        if k == 2:
            y[:, 3] = 0.25 + noise * y[:, 2].std() * np.random.default_rng(60).standard_normal(len(y))
        files.append(site.write(tmp_path / f"{k}.csv", s.fs, [f"f{p}" for p in places], y))
    found = run(tmp_path, files, "--outputs", ",".join(f"f{p}" for p in range(10)))
    there = [name for name in found["outputs"] if name != "f5"]
    at = [found["outputs"].index(name) for name in there]
    modes = [mode for mode in found["modes"] if mode["confident"]]
    assert [mode["frequency_hz"] for mode in modes] == pytest.approx(s.frequency, rel=0.01)
    for k, mode in enumerate(modes):
        shape = whole(mode)
        assert modal.mac(shape[at], s.shapes[[int(name[1:]) for name in there], k]) > 0.97
        assert np.isnan(shape[found["outputs"].index("f5")])
    assert any("f5" in one["text"] for one in found["warnings"])


def test_free_decays_of_a_pipe(tmp_path: Path) -> None:
    """Struck by a hand that no cable measures: each set-up has two files of six decays."""
    s, files = site.plate(), []
    at = np.eye(12)[:, [0, 6]]
    for k, places in enumerate(([3, 8, 0, 1, 2, 4, 5], [3, 8, 6, 7, 9, 10, 11])):
        for part in range(2):
            rng = np.random.default_rng(60 + 2 * k + part)
            force = np.zeros((12 * 512 * site.FINER, 2))
            for hit in range(6):
                begin = int((2 * hit + 0.2) * 512 * site.FINER)
                force[begin : begin + 4, hit % 2] = rng.uniform(50, 100)
            y = s.sampled(s.respond(force, at))
            y += 0.003 * y.std() * rng.standard_normal(y.shape)
            files.append(site.write(tmp_path / f"{k}{part}.csv", s.fs, [f"q{p}" for p in places], y[:, places]))
    found = run(tmp_path, files, "--outputs", ",".join(f"q{p}" for p in range(12)))
    modes = [mode for mode in found["modes"] if mode["confident"]]
    assert [mode["frequency_hz"] for mode in modes] == pytest.approx(s.frequency, rel=0.01)
    places = [int(name[1:]) for name in found["outputs"]]
    assert min(modal.mac(whole(mode), s.shapes[places, k]) for k, mode in enumerate(modes)) > 0.97
    assert found["records"] == 2


def contradictions(result: package.Result) -> list[str]:
    return [one.text for one in result.warnings if one.code == "records_contradict"]


def test_channels_at_other_places_are_no_repeats() -> None:
    """Files whose columns have the names of channels are repeats by their names; the sensors were moved."""
    for s, seconds in ((site.plate(), 20), (site.footbridge(), 120)):
        first, second = site.ambient(s, seconds, 1), site.ambient(s, seconds, 2)
        for places, moved in (([0, 1, 2, 3], False), ([0, 3, 5, 7], True)):
            said = contradictions(package.identify(None, [first[:, :4], second[:, places]], fs=s.fs))
            assert len(said) == moved
            assert all("record 1" in text and "sensors at other places" in text for text in said)


def test_another_wind_does_not_move_sensors() -> None:
    """A chimney has two modes at nearly one frequency; each record shows that to which its wind turns."""
    height, way = np.repeat([0.3, 0.6, 1.0], 2), np.tile([0, 1], 3)
    frequency = np.array([0.6, 0.609, 2.9, 2.943])
    shapes = np.array([np.sin((2 * (k // 2) + 1) * np.pi / 2 * height) * (way == k % 2) for k in range(4)]).T
    s, records = site.Structure(12.0, frequency, np.full(4, 0.01), shapes, np.full(4, 1e4)), []
    for seed, turn in enumerate((10, 80)):
        rng = np.random.default_rng(seed)
        along, across = rng.standard_normal((2, 1500 * 12 * site.FINER, 3)) * np.array([1, 0.3])[:, None, None]
        c, d = np.cos(np.radians(turn)), np.sin(np.radians(turn))
        force = np.stack([c * along - d * across, d * along + c * across], axis=2).reshape(len(along), 6)
        y = s.sampled(s.respond(force, np.eye(6)))
        records.append(y + 0.02 * y.std() * rng.standard_normal(y.shape))
    found = package.identify(None, records, fs=s.fs)
    assert len(found.confident_modes) == 4 and not contradictions(found), found.table()


def test_python_gives_what_the_command_gives(tmp_path: Path) -> None:
    files = footbridge(tmp_path)
    told = run(tmp_path, files, "--outputs", "P1,P4,P7,P2,P3,P5,P6,P8")
    parts = [package.read_csv(path) for path in files]
    names = [[name.split()[0] for name in part.names] for part in parts]
    found = package.identify_setups(None, [part.samples for part in parts], fs=100.0, output_names=names)
    mine = found.to_dict()
    assert mine["outputs"] == told["outputs"]
    assert [mode["frequency_hz"] for mode in mine["modes"]] == [mode["frequency_hz"] for mode in told["modes"]]
    assert [mode["shape_re"] for mode in mine["modes"]] == [mode["shape_re"] for mode in told["modes"]]


def test_what_is_refused_in_one_line(tmp_path: Path) -> None:
    rng = np.random.default_rng(1)
    y = rng.standard_normal((3000, 3))
    a = site.write(tmp_path / "a.csv", 100.0, ["r [g]", "a", "b"], y)
    other = site.write(tmp_path / "b.csv", 100.0, ["r [m/s^2]", "c", "d"], y)
    fast = site.write(tmp_path / "f.csv", 200.0, ["r [g]", "c", "d"], y)
    alone = site.write(tmp_path / "n.csv", 100.0, ["c", "d", "e"], y)
    cases: list[tuple[list[Any], str, str]] = [
        ([a, other], "r,a,b,c,d", '"r" is in m/s^2, in an earlier file in g'),
        ([a, fast], "r,a,b,c,d", "200 Hz, expected 100 Hz"),
        ([a, alone], "a,b,c,d,e", "no output in common"),
        ([a, tmp_path / "nothing.csv"], "r,a", "nothing.csv"),
        ([a], "r,a", "found one file"),
        ([a, other, "--places", "(.)"], "r,a,b,c,d", "leave one out"),
    ]
    for files, outputs, words in cases:
        text = okid("identify", *files, "--setups", "--outputs", outputs, status=2).stderr
        assert words in text and len(text.strip().splitlines()) == 1, text
    text = okid("identify", a, site.write(tmp_path / "m.csv", 100.0, ["r [g]", "c", "d"], y), "--setups", "--outputs",
                "r,a,b,c,d", status=3).stderr  # fmt: skip
    assert "no model: modes were found in 0 of 2 set-ups" in text
