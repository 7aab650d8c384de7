# SPDX-License-Identifier: MIT
"""Modes from frequency responses: against responses solved line by line from M, R and K (no modal sum, no pole is put
in), as a roving hammer measures them, through the formats, and where there is nothing to find."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import okid
import pytest
import systems
from numpy.typing import NDArray
from okid.frf import Frf
from program import okid as program

Real = NDArray[np.float64]
POINTS, SENSORS, MODES = 8, 3, 13


def _structure(seed: int, n: int = MODES) -> tuple[Real, Real, Real]:
    """A lattice of springs between random masses, every mass tied to the ground, with viscous damping of its own."""
    r = np.random.default_rng(seed)
    M, K = np.diag(r.uniform(0.5, 2.0, n)), np.diag(r.uniform(2e4, 9e5, n))
    for a in range(n):
        for b in range(a + 1, n):
            k = r.uniform(0.0, 2.5e5) if r.random() < 0.5 else 0.0
            K[[a, b], [a, b]] += k
            K[a, b] -= k
            K[b, a] -= k
    return M, 1.2 * M + 6e-6 * K, K


def _truth(M: Real, R: Real, K: Real) -> tuple[Real, Real, NDArray[np.complex128]]:
    n = len(M)
    A = np.block(
        [
            [np.zeros((n, n)), np.eye(n)],
            [-np.linalg.solve(M, K), -np.linalg.solve(M, R)],
        ]
    )
    poles, vectors = np.linalg.eig(A)
    upper = np.flatnonzero(poles.imag > 0.0)
    upper = upper[np.argsort(np.abs(poles[upper]))]
    size = np.abs(poles[upper])
    return size / (2 * np.pi), -poles[upper].real / size, vectors[:n, upper].T


def _responses(M: Real, R: Real, K: Real, f: Real, outputs: list[int], inputs: list[int]) -> NDArray[np.complex128]:
    w = 2 * np.pi * f
    out = []
    for one in w:
        out.append(-(one**2) * np.linalg.inv(K - one**2 * M + 1j * one * R)[np.ix_(outputs, inputs)])
    return np.array(out)


def _noisy(h: NDArray[np.complex128], share: float, seed: int) -> NDArray[np.complex128]:
    r = np.random.default_rng(seed)
    noise = r.normal(size=h.shape) + 1j * r.normal(size=h.shape)
    return h + share * np.sqrt(np.mean(np.abs(h) ** 2, axis=0) / 2) * noise


def _paired(result: okid.Result, f: Real) -> list[tuple[int, okid.Mode]]:
    """Each true mode with the confident mode within 0.5 %, none twice."""
    left, out = list(result.confident_modes), []
    for k, one in enumerate(f):
        near = [mode for mode in left if abs(mode.frequency_hz / one - 1) < 0.005]
        if near:
            best = min(near, key=lambda mode: abs(mode.frequency_hz - one))
            left.remove(best)
            out.append((k, best))
    return out


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_roving_hammer_of_eight_points_and_three_accelerometers(seed: int) -> None:
    M, R, K = _structure(seed)
    f_true, zeta, shapes = _truth(M, R, K)
    line = np.arange(0.25, 1.15 * f_true[-1], 0.25)
    h = _noisy(_responses(M, R, K, line, list(range(SENSORS)), list(range(POINTS))), 0.01, seed)
    names = [f"{k + 1}z" for k in range(POINTS)]
    result = okid.identify_frf(Frf.of(line, h, names, names[:SENSORS]))
    assert result.outputs == names and result.method == "plscf"
    assert [one.code for one in result.warnings].count("reciprocity") == 1
    found = _paired(result, f_true)
    assert len(found) >= 12
    assert len(result.confident_modes) == len(found), "a confident mode that the structure does not have"
    for k, mode in found:
        assert mode.damping_ratio == pytest.approx(zeta[k], rel=0.1)
        assert okid.modal.mac(mode.shape, shapes[k, :POINTS]) >= 0.95


def test_deviations_cover_the_errors() -> None:
    M, R, K = _structure(4, 6)
    f_true, zeta, _ = _truth(M, R, K)
    line = np.arange(0.25, 1.1 * f_true[-1], 0.25)
    clean, ratios = _responses(M, R, K, line, [0, 1, 2, 3], [0]), []
    for seed in range(8):
        for k, mode in _paired(okid.identify_frf(Frf.of(line, _noisy(clean, 0.02, seed))), f_true):
            assert mode.frequency_std_hz and mode.damping_ratio_std
            ratios += [(mode.frequency_hz - f_true[k]) / mode.frequency_std_hz,
                       (mode.damping_ratio - zeta[k]) / mode.damping_ratio_std]  # fmt: skip
    assert len(ratios) >= 80
    assert 0.7 < float(np.sqrt(np.mean(np.square(ratios)))) < 1.4


def _rms(values: list[float]) -> float:
    return float(np.sqrt(np.mean(np.square(values))))


def _real(shape: NDArray[np.complex128]) -> Real:
    return np.asarray((shape / shape[np.argmax(np.abs(shape))]).real, dtype=np.float64)


@pytest.mark.parametrize("sensor", ["3z", "-3z"])
def test_modal_masses_where_names_say_that_force_and_sensor_share_a_place(sensor: str) -> None:
    """A roving hammer, one accelerometer: mass by the whole mass matrix, which the residues do not have."""
    M, R, K = _structure(4, 6)
    _, _, shapes = truth = _truth(M, R, K)
    line = np.arange(0.25, 1.1 * truth[0][-1], 0.25)
    names = [f"{k + 1}z" for k in range(6)]
    clean, off = _responses(M, R, K, line, [2], list(range(6))) * (-1 if sensor[0] == "-" else 1), []
    for seed in range(6):
        result = okid.identify_frf(Frf.of(line, _noisy(clean, 0.01, seed), names, [sensor]))
        for k, mode in _paired(result, truth[0]):
            shape = _real(shapes[k])
            mass = shape @ M @ shape
            assert mode.modal_mass is not None and mode.modal_mass_std is not None
            if mode.modal_mass_std < 0.1 * mass:  # others do not move the third place
                assert mode.modal_mass == pytest.approx(mass, rel=0.2)
                off.append((mode.modal_mass - mass) / mode.modal_mass_std)
    assert len(off) >= 24
    assert 0.5 < _rms(off) < 1.5
    for sensing in ("displacement", "velocity"):  # what was not measured gives no mass
        wrong = okid.identify_frf(Frf.of(line, clean, names, [sensor]), sensing=sensing)
        assert all(mode.modal_mass is None for mode in wrong.modes)
        assert [w.code for w in wrong.warnings].count("drive_point_polarity") == 1
    assert all(m.modal_mass is None for m in okid.identify_frf(Frf.of(line, clean, names, ["7z"])).modes)


def _chain(n: int, top_hz: float) -> tuple[Real, Real, Real]:
    """Slowly growing masses on equal springs, damping of both."""
    M, K = systems.chain(list(np.linspace(1.0, 1.6, n)), [(np.pi * top_hz) ** 2] * n)
    return M, 3.0 * M + 1e-5 * K, K


def test_a_place_that_measures_nothing_is_named_and_rules_no_pole() -> None:
    """All but the weak first mode are found; where the noise counts as much as a response, four are."""
    M, R, K = _chain(8, 150.0)
    f_true, _, shapes = _truth(M, R, K)
    line = np.arange(0.25, 1.2 * f_true[-1], 0.25)
    h = _noisy(np.tile(_responses(M, R, K, line, list(range(8)), [0]), (1, 2, 1)), 0.003, 8)
    dead, r = 5, np.random.default_rng(1)
    h[:, dead, 0] = np.mean(np.abs(h)) * (r.normal(size=len(line)) + 1j * r.normal(size=len(line)))
    result = okid.identify_frf(Frf.of(line, h))
    found = _paired(result, f_true)
    assert [k for k, _ in found][-7:] == list(range(1, 8)) and len(result.confident_modes) == len(found)
    for k, mode in found:
        assert okid.modal.mac(np.delete(mode.shape, dead), np.delete(np.tile(shapes[k], 2), dead)) > 0.999
    noisy = [w.text for w in result.warnings if w.code == "noisy_output"]
    assert len(noisy) == 1 and '"y6"' in noisy[0]


def test_stepped_sines_of_a_free_structure() -> None:
    """Receptances with finer lines where it rings, and noise that goes with them: at the first line rigid motion has at
    least 900 times the power of the last mode. All modes are found, and the model explains the responses."""
    M, K = np.diag([2.0, 1.0, 1.5, 1.0, 1.2, 3.0]), np.zeros((6, 6))
    for a, k in enumerate([2e6, 1e6, 1.5e6, 8e5, 1e6]):
        K[a : a + 2, a : a + 2] += k * np.array([[1, -1], [-1, 1]])
    R = 1.0 * M + 4e-6 * K
    f_true, zeta_true, _ = _truth(M, R, K)
    f_true, zeta_true = f_true[-5:], zeta_true[-5:]
    coarse = np.arange(4.0, 1.2 * f_true[-1], 4.0)
    fine = [f * (1 + np.linspace(-4.0, 4.0, 41) * zeta) for f, zeta in zip(f_true, zeta_true, strict=True)]
    line = np.unique(np.concatenate([coarse, *fine]).round(4))
    shares = []
    for seed in range(3):
        r = np.random.default_rng(seed)
        h = _responses(M, R, K, line, list(range(6)), [0]) / -((2 * np.pi * line[:, None, None]) ** 2)
        h *= 1 + 0.005 * (r.normal(size=h.shape) + 1j * r.normal(size=h.shape))
        result = okid.identify_frf(Frf.of(line, h), sensing="displacement")
        assert len(result.confident_modes) == 5
        for k, mode in _paired(result, f_true):
            assert mode.frequency_std_hz < 0.01 * mode.damping_ratio * f_true[k]
            shares.append((mode.frequency_hz - f_true[k]) / mode.frequency_std_hz)
            shares.append((mode.damping_ratio - zeta_true[k]) / mode.damping_ratio_std)
        assert min(result.to_dict()["fit"]["simulation_percent"].values()) > 80.0
    assert 0.4 < np.sqrt(np.mean(np.square(shares))) < 1.8


@pytest.mark.parametrize("unit", ["g", "mm/s^2", "m/s^2", "furlong"])
def test_units_of_a_universal_file(tmp_path: Path, unit: str) -> None:
    """What stands beside the axis counts, for the program as for Python; what is no unit changes nothing."""
    factor = {"g": 9.80665, "mm/s^2": 1e-3}.get(unit, 1.0)
    M, R, K = _chain(3, 60.0)
    line = np.arange(0.25, 1.5 * _truth(M, R, K)[0][-1], 0.25)
    h = _responses(M, R, K, line, [0, 1, 2], [0])
    path = tmp_path / "h.uff"
    okid.write_frf(path, Frf.of(line, h / factor, ["1z"], ["1z", "2z", "3z"]))
    first, *sets = path.read_bytes().split(b"    58b")
    for k, text in enumerate(sets):
        header = text.split(b"\n", 11)  # line 9: kind, exponents, name and unit of the ordinate
        header[9] = f"{12:10d}{0:5d}{0:5d}{0:5d} {'NONE':20s} {unit:20s}".encode()
        sets[k] = b"\n".join(header)
    path.write_bytes(b"    58b".join([first, *sets]))
    program("identify", path, "--frf", "--json", tmp_path / "r.json", status=0)
    done = okid.Result.from_dict(json.loads((tmp_path / "r.json").read_text(encoding="utf-8")))
    whole = okid.identify_frf(Frf.of(line, h, ["1z"], ["1z", "2z", "3z"]))
    for other in (done, okid.identify_frf(path)):
        masses = [mode.modal_mass for mode in other.modes]
        assert masses == pytest.approx([mode.modal_mass for mode in whole.modes], rel=1e-4)
        assert [w.code for w in other.warnings].count("unit_converted") == (factor != 1.0)
    wrong = okid.identify_frf(path, sensing="velocity")
    assert "the file says acceleration" in next(w.text for w in wrong.warnings if w.code == "drive_point_polarity")


@pytest.mark.parametrize("power", [-1, -2])
def test_quantity_of_a_universal_file(tmp_path: Path, power: int) -> None:
    """Velocities and displacements are what the file says; an option says otherwise."""
    quantity = {-1: "velocity", -2: "displacement"}[power]
    M, R, K = _chain(3, 60.0)
    line = np.arange(0.25, 1.5 * _truth(M, R, K)[0][-1], 0.25)
    h = _responses(M, R, K, line, [0, 1, 2], [0])
    own = Frf.of(line, h * (2j * np.pi * line[:, None, None]) ** power, ["1z"], ["1z", "2z", "3z"])
    path = tmp_path / "h.uff"
    okid.write_frf(path, own)
    text = path.read_bytes().split(b"\n")
    kind = f"{12:10d}".encode()
    other = f"{ {-1: 11, -2: 8}[power]:10d}".encode()
    said = [row.replace(kind, other, 1) if row.startswith(kind) else row for row in text]
    path.write_bytes(b"\n".join(said))
    whole = okid.identify_frf(Frf.of(line, h, ["1z"], ["1z", "2z", "3z"]))
    expected = [mode.modal_mass for mode in whole.modes]
    program("identify", path, "--frf", "--json", tmp_path / "r.json", status=0)
    done = okid.Result.from_dict(json.loads((tmp_path / "r.json").read_text(encoding="utf-8")))
    for result in (done, okid.identify_frf(path), okid.identify_frf(own, sensing=quantity)):
        assert [mode.modal_mass for mode in result.modes] == pytest.approx(expected, rel=1e-3)
        assert "drive_point_polarity" not in [w.code for w in result.warnings]
    assert all(mode.modal_mass is None for mode in okid.identify_frf(path, sensing="acceleration").modes)


@pytest.mark.parametrize(
    ("head", "factor"),
    [
        ("frequency_hz,{o}:re,{o}:im", 1.0),
        ("Frequency [Hz],3z [g]/3z [N]:re,3z [g]/3z [N]:im", 9.80665),
        ("Freq (Hz),3z (g)/3z (N):Real,3z (g)/3z (N):Imag", 9.80665),
        ("frequency_hz,{o}:re [g/N],{o}:im [g/N]", 9.80665),
        ("frequency_hz,3z/3z [lbf]:re,3z/3z [lbf]:im", 1 / 4.4482216152605),
        ("Frequency,Real,Imaginary", 1.0),
    ],
)
def test_heads_of_tables_as_analysers_write_them(tmp_path: Path, head: str, factor: float) -> None:
    M, R, K = _chain(3, 60.0)
    line = np.arange(0.25, 1.5 * _truth(M, R, K)[0][-1], 0.25)
    h = _responses(M, R, K, line, [0], [0])[:, 0, 0] / factor
    path = tmp_path / "h.csv"
    rows = "\n".join(f"{f:.6g},{x.real:.12g},{x.imag:.12g}" for f, x in zip(line, h, strict=True))
    path.write_text(head.format(o="3z/3z") + "\n" + rows + "\n")
    result = okid.identify_frf(path)
    whole = okid.identify_frf(Frf.of(line, h[:, None, None] * factor, ["3z"], ["3z"]))
    assert [m.frequency_hz for m in result.modes] == pytest.approx([m.frequency_hz for m in whole.modes], rel=1e-6)
    if "3z" in head.format(o="3z/3z"):
        assert [m.modal_mass for m in result.modes] == pytest.approx([m.modal_mass for m in whole.modes], rel=1e-4)
    assert ("unit_converted" in [w.code for w in result.warnings]) == (factor != 1)


def test_phases_of_tables_in_radians(tmp_path: Path) -> None:
    M, R, K = _chain(3, 60.0)
    line = np.arange(0.25, 1.5 * _truth(M, R, K)[0][-1], 0.25)
    h = _noisy(_responses(M, R, K, line, [0], [0]), 0.001, 1)[:, 0, 0]
    for unit, factor in (("rad", 1.0), ("deg", 180 / np.pi)):
        rows = [f"{f:.6g},{abs(x):.17g},{factor * np.angle(x):.17g}" for f, x in zip(line, h, strict=True)]
        (tmp_path / f"{unit}.csv").write_text(f"Frequency [Hz],Magnitude,Phase [{unit}]\n" + "\n".join(rows) + "\n")
    in_rad, in_deg = (okid.identify_frf(tmp_path / f"{unit}.csv") for unit in ("rad", "deg"))
    assert [m.frequency_hz for m in in_rad.modes] == pytest.approx([m.frequency_hz for m in in_deg.modes], rel=1e-9)
    assert len(in_rad.confident_modes) == 3


def test_many_modes_in_a_small_part_of_the_lines() -> None:
    """Below a quarter of the last line, one force: a fraction of 64 degrees over all lines loses three of them."""
    n = 20
    M, R, K = _chain(n, 200.0)
    f_true, _, shapes = _truth(M, R, K)
    line = np.arange(0.5, 4.0 * f_true[-1], 0.5)
    h = _noisy(_responses(M, R, K, line, list(range(n)), [0]), 0.003, n)
    result = okid.identify_frf(Frf.of(line, h))
    found = _paired(result, f_true)
    assert len(found) >= n - 1
    assert len(result.confident_modes) == len(found)
    for k, mode in found:
        assert okid.modal.mac(mode.shape, shapes[k]) > 0.95


def test_deviations_of_shapes_under_an_exponential_window() -> None:
    """Noise of samples that grow quieter: its lines repeat each other, and so do those of what ends with the record."""
    M, R, K = _structure(9, 4)
    f_true, _, shapes = _truth(M, R, K)
    step, count, constant = 1.0 / 2048.0, 8192, 0.3
    t = np.arange(count) * step
    w = 2 * np.pi * np.arange(1, count // 2 + 1) / (count * step)
    h = np.array([np.linalg.inv(K - one**2 * M + 1j * one * R)[:, 0] for one in w])
    answer = np.fft.irfft(np.vstack([np.linalg.inv(K)[:1, :], h]), axis=0)
    off: list[float] = []
    for seed in range(8):
        noise = 0.01 * np.std(answer, axis=0) * np.random.default_rng(seed).normal(size=answer.shape)
        lines = np.fft.rfft((answer + noise) * np.exp(-t / constant)[:, None], axis=0)
        kept = lines[: 4 * int(f_true[-1] * count * step) // 3]
        measured = Frf.of(np.arange(len(kept)) / (count * step), kept)
        for k, mode in _paired(okid.identify_frf(measured, sensing="displacement", exponential=constant), f_true):
            assert mode.shape_re_std is not None
            off += [
                (found - true) / std
                for found, true, std in zip(np.real(mode.shape), _real(shapes[k]), mode.shape_re_std, strict=True)
                if found != 1.0
            ]
    assert len(off) >= 80
    assert 0.6 < _rms(off) < 1.6


def test_matrices_of_a_known_structure() -> None:
    M, R, K = _structure(5, 3)
    f_true = _truth(M, R, K)[0]
    line = np.arange(0.25, 2.0 * f_true[-1], 0.25)
    h = _responses(M, R, K, line, [0, 1, 2], [0])
    result = okid.identify_frf(Frf.of(line, h), input_dofs=[1], output_dofs=[1, 2, 3])
    assert result.mkr is not None
    assert np.allclose(result.mkr.M, M, atol=0.02 * np.max(M))
    assert np.allclose(result.mkr.K, K, atol=0.02 * np.max(K))


def test_exponential_window_is_taken_out() -> None:
    M, R, K = _structure(9, 4)  # every mode moves the first mass
    f_true, zeta, _ = _truth(M, R, K)
    step, constant = 1.0 / 2048.0, 0.4
    t = np.arange(16384) * step
    w = 2 * np.pi * np.arange(1, len(t) // 2 + 1) / (len(t) * step)
    h = np.array([np.linalg.inv(K - one**2 * M + 1j * one * R)[:, 0] for one in w])  # receptance: it has an end in time
    answer = np.fft.irfft(np.vstack([np.linalg.inv(K)[:1, :], h]), axis=0)
    windowed = np.fft.rfft(answer * np.exp(-t / constant)[:, None], axis=0)[: 4 * int(f_true[-1] * len(t) * step) // 3]
    line = np.arange(len(windowed)) / (len(t) * step)
    plain = okid.identify_frf(Frf.of(line, windowed), sensing="displacement")
    result = okid.identify_frf(Frf.of(line, windowed), sensing="displacement", exponential=constant)
    found = _paired(result, f_true)
    assert len(found) == 4
    for k, mode in found:
        assert mode.damping_ratio == pytest.approx(zeta[k], rel=0.02)
    assert all(one.damping_ratio > 1.2 * two.damping_ratio for one, two in zip(plain.modes, result.modes, strict=True))


def test_noise_has_no_modes() -> None:
    r = np.random.default_rng(0)
    h = r.normal(size=(800, 4, 1)) + 1j * r.normal(size=(800, 4, 1))
    with pytest.raises(okid.IdentificationError, match="no model: at [0-9]+ of 800 lines .* more than noise"):
        okid.identify_frf(Frf.of(np.arange(1, 801) * 0.25, h))


def test_files_of_set_ups_give_what_the_whole_gives(tmp_path: Path) -> None:
    M, R, K = _structure(7, 5)
    line = np.arange(0.5, 1.2 * _truth(M, R, K)[0][-1], 0.5)
    h = _noisy(_responses(M, R, K, line, [0, 1, 2, 3, 4], [0, 1]), 0.01, 7)
    names = [f"{k + 1}z" for k in range(5)]
    whole = okid.identify_frf(Frf.of(line, h, names[:2], names))
    paths = []
    for kind, part in (("uff", [0, 1]), ("csv", [2, 3, 4])):
        paths.append(tmp_path / f"set.{kind}")
        okid.write_frf(paths[-1], Frf.of(line, h[:, part], names[:2], [names[o] for o in part]))
    joined = okid.identify_frf(paths)
    assert joined.records == 2 and joined.outputs == names
    run = program("identify", *paths, "--frf", "--json", tmp_path / "r.json", "--quiet", status=0)
    assert run.stdout == ""
    text = (tmp_path / "r.json").read_text(encoding="utf-8")
    by_program = okid.Result.from_dict(json.loads(text))
    for other in (joined, by_program):
        assert [m.frequency_hz for m in other.modes] == pytest.approx([m.frequency_hz for m in whole.modes], rel=1e-6)
        assert np.allclose([m.shape for m in other.modes], [m.shape for m in whole.modes], atol=1e-4)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--fs", "100"], "--fs is an option of records"),
        (["--sigma", "none"], "--sigma is an option of records"),
        (["--threads", "1"], "--threads is an option of records"),
        (["--exponential", "-1"], '--exponential: found "-1"'),
        (["--outputs", "9z"], '--outputs: found "9z"'),
        (["--band", "5:6"], "lines between 5 and 6 Hz, expected at least 32"),
    ],
)
def test_what_cannot_be_meant(tmp_path: Path, arguments: list[str], words: str) -> None:
    okid.write_frf(
        tmp_path / "a.csv",
        Frf.of(np.arange(1.0, 101.0), np.ones((100, 1)), ["1z"], ["2z"]),
    )
    run = program("identify", tmp_path / "a.csv", "--frf", *arguments, status=2)
    assert words in run.stderr


def test_the_table_speaks_of_responses(tmp_path: Path) -> None:
    """Neither of records nor of what is done to samples; with many outputs it says where the shapes are."""
    M, R, K = _structure(3, 8)
    f = np.arange(1, 1201) * 0.25
    for outputs in ([0, 1, 2], list(range(8))):
        okid.write_frf(tmp_path / "h.uff", Frf.of(f, _responses(M, R, K, f, outputs, [0])))
        done = program("identify", tmp_path / "h.uff", "--frf", status=0)
        assert "responses at 1200 lines\n" in done.stdout and "explained [%]" in done.stdout
        assert not any(word in done.stdout for word in ("record", "detrend", "predicted", "simulated"))
        many = "   shapes of 8 outputs: the JSON has them, okid-report draws them\n"
        assert (many in done.stdout) == (len(outputs) > 6)
