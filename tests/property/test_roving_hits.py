# SPDX-License-Identifier: MIT
"""Records struck at different places: one input a place with hit_dofs, named as contradicting without."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import okid
import pytest
from laboratory import chain, respond
from measured_data import data_file
from numpy.typing import NDArray
from program import ROOT
from program import okid as program

Real = NDArray[np.float64]
FS, COUNT = 256.0, 4096


def blows(
    places: list[int],
    at_places: Real,
    at_sensors: Real,
    f: Real,
    z: Real,
    noise: float = 0.005,
    fs: float = FS,
    count: int = COUNT,
) -> list[Real]:
    """A record (samples, force and sensors) a blow: four samples of force after a short silence, its free decay."""
    rng = np.random.default_rng(5)
    records = []
    for place in places:
        force = np.zeros((8 * count, 1))
        first = int(rng.integers(40, 60))
        force[first : first + 4, 0] = rng.uniform(50, 150) * np.array([0.3, 1.0, 0.8, 0.2])
        motion = respond(np.sign(place) * force, at_places[[abs(place) - 1]], at_sensors, f, z, fs)[:count]
        motion = motion + noise * motion.std(0) * rng.standard_normal(motion.shape)
        records.append(np.hstack([force[:count] + 0.02 * rng.standard_normal((count, 1)), motion]))
    return records


@pytest.fixture(scope="module")
def structure() -> tuple[Real, Real, Real]:
    """Frequencies, damping and shapes at nine places."""
    rng = np.random.default_rng(8)
    return np.array([9.0, 15.5, 24.0, 37.0, 52.0, 71.0]), rng.uniform(0.004, 0.01, 6), rng.standard_normal((9, 6))


def identify(records: list[Real], fs: float = FS, **more: object) -> okid.Result:
    return okid.identify([r[:, :1] for r in records], [r[:, 1:] for r in records], fs=fs, **more)  # type: ignore[arg-type]


def test_each_place_is_an_input(structure: tuple[Real, Real, Real]) -> None:
    f, z, shapes = structure
    hits = [7, 2, 5, 2, -7, 9]
    result = identify(blows(hits, shapes, shapes[:3], f, z), hit_dofs=hits, input_names=["hammer"])
    assert result.inputs == ["hammer@2", "hammer@5", "hammer@7", "hammer@9"]
    assert [mode.frequency_hz for mode in result.confident_modes] == pytest.approx(f, rel=1e-4)
    assert [mode.damping_ratio for mode in result.confident_modes] == pytest.approx(z, rel=0.01)
    b = result.model.B[0::2] + 1j * result.model.B[1::2]  # modes x places: what a blow there does to a mode
    wanted = shapes[[1, 4, 6, 8]].T
    for k in range(len(f)):
        strongest = np.argmax(np.abs(wanted[k]))
        expected = wanted[k] / wanted[k, strongest]
        np.testing.assert_allclose(b[k] / b[k, strongest], expected, atol=0.02)
    assert min(value for value in result.fit.simulation_percent.values() if value is not None) > 95
    assert "records_contradict" not in [w.code for w in result.warnings]


def test_many_modes_and_two_sensors() -> None:
    """28 modes with two accelerometers: 56 states fill the usual runs, those with twice the horizon have room."""
    rng = np.random.default_rng(31)
    f = 1.0 * ((np.arange(28) + 1.5) / 1.5) ** 1.6  # 1 to 110 Hz at 256 Hz
    z, shapes = rng.uniform(0.002, 0.006, 28), rng.standard_normal((10, 28))
    shapes[:2] += np.sign(shapes[:2])  # both sensors see every mode
    hits = list(range(1, 11)) * 2
    result = identify(blows(hits, shapes, shapes[:2], f, z, noise=0.001), hit_dofs=hits)
    seen = f < 0.42 * FS
    found = np.array([mode.frequency_hz for mode in result.confident_modes])
    assert len(found) == seen.sum()
    assert found == pytest.approx(f[seen], rel=1e-4)
    for k, mode in enumerate(result.confident_modes):
        assert mode.frequency_std_hz is not None and mode.frequency_std_hz < 2e-3 * f[k]


def test_many_records_one_place_each(structure: tuple[Real, Real, Real]) -> None:
    """As many inputs as places, and no more unknowns in the search: nine places, all modes."""
    f, z, shapes = structure
    result = identify(blows(list(range(1, 10)), shapes, shapes[:2], f, z), hit_dofs=range(1, 10))
    assert len(result.inputs) == 9
    assert [mode.frequency_hz for mode in result.confident_modes] == pytest.approx(f, rel=1e-4)


def test_matrices_of_a_roving_hammer() -> None:
    """Blows and sensors at every mass: M and K as of the chain."""
    rig = chain(32)
    root = np.diag(1 / np.sqrt(np.diag(rig.M)))
    values, vectors = np.linalg.eigh(root @ rig.K @ root)
    f, shapes = np.sqrt(values) / (2 * np.pi), root @ vectors
    hits = [1, 2, 3, 4, 5]
    records = blows(hits, shapes, shapes, f, rig.lab.damping_ratio, 0.001)
    result = identify(records, hit_dofs=hits, output_dofs=[1, 2, 3, 4, 5])
    assert result.mkr is not None
    for found, truth in ((result.mkr.M, rig.M), (result.mkr.K, rig.K)):
        assert np.linalg.norm(found - truth) / np.linalg.norm(truth) < 0.005


def test_heavily_damped_modes_are_seen_with_the_force() -> None:
    """The modes fill a tenth of the records. Their masses are those of the shapes over the places, M and K or no."""
    f, z = np.array([29.3, 78.7, 119.0, 159.2, 194.7]), np.array([0.061, 0.0436, 0.0531, 0.0583, 0.0565])
    shapes = np.sin(np.outer(np.arange(1, 6), np.arange(1, 6)) * np.pi / 6)
    result = identify(
        blows([1, 2, 3, 4, 5] * 3, shapes, shapes[[0, 4]], f, z, 0.003, fs=1024, count=1536),
        fs=1024, hit_dofs=[1, 2, 3, 4, 5] * 3, output_dofs=[1, 5],
    )  # fmt: skip
    modes = result.confident_modes
    assert [mode.frequency_hz for mode in modes] == pytest.approx(f, rel=2e-3)
    assert [mode.damping_ratio for mode in modes] == pytest.approx(z, rel=0.03)
    for k, mode in enumerate(modes):
        shape = shapes[:, k] / shapes[np.argmax(np.abs(mode.shape)), k]
        np.testing.assert_allclose(mode.shape.real, shape, atol=0.02)
        assert mode.modal_mass == pytest.approx(1 / shapes[np.argmax(np.abs(mode.shape)), k] ** 2, rel=0.03)


def test_a_light_mode_in_a_short_window_is_no_tone() -> None:
    """Its amplitude hardly falls in 0.32 s, but it was silent before each hit."""
    f, z = np.array([90.0, 110.0, 421.0, 790.0]), np.array([0.0005, 0.001, 0.002, 0.0015])
    shapes = np.sin(np.outer(np.arange(1, 5), np.arange(1, 5)) * np.pi / 5)
    records = blows([1, 2, 3, 4] * 2, shapes, shapes[[0]], f, z, 0.003, fs=6400, count=2048)
    result = identify(records, fs=6400, hit_dofs=[1, 2, 3, 4] * 2, output_dofs=[1])
    assert [mode.frequency_hz for mode in result.confident_modes] == pytest.approx(f, rel=1e-3)


@pytest.mark.parametrize("method", [None, "n4sid-moesp"])
def test_records_that_contradict_are_named(structure: tuple[Real, Real, Real], method: str | None) -> None:
    f, z, shapes = structure
    records = blows([4, 4, 4, 8], shapes, shapes[:3], f, z)
    said = [w.text for w in identify(records, method=method).warnings if w.code == "records_contradict"]
    assert len(said) == 1
    alike, other = said[0].split("; otherwise ")
    assert [f"record {k} " in alike for k in range(4)] == [True, True, True, False]
    assert "record 3 " in other and "--hit-dofs" not in said[0] and "hit_dofs says where" in said[0]
    same = identify(blows([4, 4, 4, 4], shapes, shapes[:3], f, z), method=method)
    assert "records_contradict" not in [w.code for w in same.warnings]
    wrong = identify(records, hit_dofs=[1, 1, 1, 1])
    assert "records_contradict" in [w.code for w in wrong.warnings]


def test_continuous_forces(structure: tuple[Real, Real, Real]) -> None:
    """A shaker that moved between two records contradicts, one that stayed does not, moving start or not."""
    f, z, shapes = structure
    rng = np.random.default_rng(2)

    def shaken(place: int) -> Real:
        force = rng.standard_normal((2 * COUNT, 1))
        motion = respond(force, shapes[[place]], shapes[:3], f, z, FS)
        return np.hstack([force, motion + 0.01 * rng.standard_normal(motion.shape) * motion.std(0)])[COUNT // 2 :]

    for places, contradict in (((3, 3), False), ((3, 7), True)):
        codes = [w.code for w in identify([shaken(place) for place in places]).warnings]
        assert ("records_contradict" in codes) == contradict


def test_measured_blows_at_different_places() -> None:
    """The first two of four records of a model aircraft were struck at one place, the third elsewhere."""
    paths = [data_file("uliege_plane_hammer", f"lab1_0000{k}.csv") for k in (1, 2, 3)]
    channels = ["--inputs", "force_N", "--outputs", "acc1_g,acc2_g,acc3_g"]
    told = program("identify", *paths, *channels, status=0).stdout
    line = next(line for line in told.splitlines() if line.startswith("warning records_contradict"))
    assert line.index("lab1_00001.csv") < line.index("lab1_00002.csv") < line.index("; otherwise")
    assert "lab1_00003.csv" in line.split("; otherwise")[1]
    assert "records_contradict" not in program("identify", *paths[:2], *channels, status=0).stdout


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--hit-dofs", "1,2"], "--hit-dofs: found 2 numbers for 1 records, expected one for each"),
        (["--hit-dofs", "0"], "--hit-dofs: found 0, expected numbers from 1"),
        (["--hit-dofs", "x"], '--hit-dofs: found "x", expected a whole number'),
        (["--hit-dofs", "1", "--input-dofs", "1", "--output-dofs", "1"], "--input-dofs: --hit-dofs says where"),
    ],
)
def test_wrong_places(tmp_path: Path, options: list[str], words: str) -> None:
    np.savetxt(tmp_path / "r.csv", np.random.default_rng(1).standard_normal((3000, 2)), delimiter=",",
               header="# fs_hz: 100\nu,y", comments="")  # fmt: skip
    done = program("identify", tmp_path / "r.csv", "--inputs", "u", "--outputs", "y", *options, status=2)
    assert words in done.stderr


def test_short_pulses_that_are_straight_between_samples(tmp_path: Path) -> None:
    """Their spectrum falls towards half the rate, as behind a filter; taken for filtered, M was 9 % off."""
    done = program("simulate", ROOT / "examples" / "recipes" / "hits_rig.toml", "--hits", tmp_path / "hits", "--quiet")
    assert done.returncode == 0, done.stderr
    files = sorted((tmp_path / "hits").glob("*.csv"))
    where = ("--inputs", "hammer", "--outputs", "acc2,acc5", "--places", r"P(\d+)_", "--output-dofs", "2,5")
    done = program("identify", *files, *where, "--json", tmp_path / "r.json")
    assert done.returncode == 0, done.stderr
    result = okid.Result.load(tmp_path / "r.json")
    assert result.hold == "foh"
    M = np.array(json.loads((tmp_path / "r.json").read_text())["mkr"]["M"])
    assert np.allclose(M, np.diag([1.0, 0.8, 1.2, 0.9, 1.1]), atol=0.01)
