# SPDX-License-Identifier: MIT
"""M, K and R as a user meets them: `okid identify`, `okid replay`, the Python package, the report."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import okid
import pytest
import systems
from numpy.typing import NDArray
from okid import report
from program import ROOT
from program import okid as run
from scipy.signal import cont2discrete

Array = NDArray[np.float64]
KINDS = ["displacement", "velocity", "acceleration"]
SYSTEMS = {"w1": systems.w1(), "w2": systems.w2()}


def measure(
    s: systems.Structure, noise_percent: float, seed: int, kinds: list[str] | None = None, hold: str = "zoh"
) -> tuple[Array, Array]:
    """White forces and what sensors of these kinds (one an output) show."""
    n, minv = len(s.M), np.linalg.inv(s.M)
    a = np.block([[np.zeros((n, n)), np.eye(n)], [-minv @ s.K, -minv @ s.R]])
    b = np.vstack([np.zeros((n, len(s.force_dofs))), minv[:, list(s.force_dofs)]])
    motion = {"displacement": np.eye(n, 2 * n), "velocity": np.eye(n, 2 * n, n), "acceleration": a[n:]}
    wanted = kinds or ["acceleration"] * n
    c = np.array([motion[kind][o] for o, kind in enumerate(wanted)])
    d = np.array([b[n + o] if kind == "acceleration" else 0.0 * b[0] for o, kind in enumerate(wanted)])
    sampled = cont2discrete((a, b, c, d), s.dt, hold)
    rng = np.random.default_rng(seed)
    u = rng.standard_normal((10000, len(s.force_dofs)))
    y = systems.simulate(sampled[:4], u)
    return u, y + noise_percent / 100.0 * np.sqrt(np.mean(y**2, axis=0)) * rng.standard_normal(y.shape)


class Bench:
    """Writes a record and identifies it; `units` stand behind the names."""

    def __init__(self, folder: Path, s: systems.Structure, u: Array, y: Array, units: list[str] | None = None) -> None:
        self.s, self.path = s, folder / "record.csv"
        self.inputs = [f"u{k + 1}" for k in range(u.shape[1])]
        self.outputs = [f"y{k + 1}" for k in range(y.shape[1])]
        names = self.inputs + self.outputs
        behind = [f" [{unit}]" if unit else "" for unit in units or [""] * len(names)]
        head = [name + unit for name, unit in zip(names, behind, strict=True)]
        np.savetxt(
            self.path, np.hstack([u, y]), "%.17g", ",", comments="", header=f"# fs_hz: {s.fs!r}\n{','.join(head)}"
        )
        self.dofs = [f"--input-dofs={','.join(str(k + 1) for k in s.force_dofs)}"]
        self.dofs += [f"--output-dofs={','.join(str(k + 1) for k in s.sense_dofs)}"]

    def run(self, *options: str, dofs: list[str] | None = None) -> subprocess.CompletedProcess[str]:
        channels = [f"--inputs={','.join(self.inputs)}", f"--outputs={','.join(self.outputs)}"]
        method = [] if "--method" in options else ["--method", "okid-era"]
        return run("identify", self.path, *channels, *(self.dofs if dofs is None else dofs), *method, *options)

    def result(self, *options: str, dofs: list[str] | None = None) -> dict[str, Any]:
        done = self.run("--json", "-", *options, dofs=dofs)
        assert done.returncode == 0, done.stderr
        return dict(json.loads(done.stdout))

    def errors(self, result: dict[str, Any]) -> dict[str, float]:
        found = {"M": result["mkr"]["M"], "K": result["mkr"]["K"], "R": result["mkr"]["R"]}
        found |= {"R normal": result["mkr"]["R_normal_modes"], "R pdc": result["pdc"]["R"]}
        return {name: relative(x, getattr(self.s, name[0])) for name, x in found.items()}


def relative(found: Any, true: Array) -> float:
    return float(np.linalg.norm(np.array(found, float) - true) / np.linalg.norm(true))


def codes(result: dict[str, Any]) -> dict[str, str]:
    return {one["code"]: one["text"] for one in result["warnings"]}


def refused(done: subprocess.CompletedProcess[str], code: int, *parts: str) -> None:
    assert done.returncode == code, done.stderr
    assert done.stdout == ""
    for part in parts:
        assert part in done.stderr, done.stderr


@pytest.mark.parametrize("which", SYSTEMS)
@pytest.mark.parametrize("kind", KINDS)
def test_exact_from_noise_free_records(tmp_path: Path, which: str, kind: str) -> None:
    s = SYSTEMS[which]
    bench = Bench(tmp_path, s, *measure(s, 0.0, 3, [kind] * len(s.M)))
    result = bench.result("--sensing", kind)
    errors = bench.errors(result)
    assert max(errors["M"], errors["K"]) <= 1e-8
    assert max(errors["R"], errors["R normal"], errors["R pdc"]) <= 1e-6
    checks = result["mkr"]["checks"]
    assert checks["m_positive_definite"] and checks["k_positive_definite"] and checks["r_positive_definite"]
    assert checks["ww_residual"] < 1e-8 and checks["feedthrough_misfit"] < 1e-8 and checks["notes"] == []
    assert checks["collocated_pairs"] == len(s.force_dofs) and checks["modes_used"] == list(range(1, len(s.M) + 1))
    assert not [code for code in codes(result) if code.startswith(("mkr", "pdc", "unit"))]
    alpha, beta = np.linalg.lstsq(np.column_stack([s.M.ravel(), s.K.ravel()]), s.R.ravel(), rcond=None)[0]
    assert result["pdc"]["alpha"] == pytest.approx(alpha, rel=1e-6)
    assert result["pdc"]["beta"] == pytest.approx(beta, rel=1e-6)


@pytest.mark.parametrize("seed", [11, 12, 13])
def test_one_percent_noise_within_the_acceptance(tmp_path: Path, seed: int) -> None:
    bench = Bench(tmp_path, SYSTEMS["w1"], *measure(SYSTEMS["w1"], 1.0, seed))
    errors = bench.errors(bench.result("--p", "40", "--rows", "80"))
    for name, accepted in {"M": 3.5e-3, "K": 1.5e-3, "R": 6.3e-2, "R pdc": 2.1e-3, "R normal": 2.1e-3}.items():
        assert errors[name] <= 1.5 * accepted, errors


def test_the_modes_used_are_those_of_the_list(tmp_path: Path) -> None:
    bench = Bench(tmp_path, SYSTEMS["w1"], *measure(SYSTEMS["w1"], 1.0, 5))
    result = bench.result("--order", "12")
    assert result["mkr"]["checks"]["admissible_modes"] > 3  # more than needed: the strongest three are taken
    for mode in result["mkr"]["modes"]:
        listed = result["modes"][mode["mode"] - 1]
        assert listed["frequency_hz"] == pytest.approx(mode["frequency_hz"], rel=1e-9)
        assert listed["damping_ratio"] == pytest.approx(mode["damping_ratio"], rel=1e-6)
    assert bench.errors(result)["M"] < 0.02
    assert result["mkr"]["checks"]["selection_margin"] > 2.0


def test_mixed_sensors(tmp_path: Path) -> None:
    kinds = ["acceleration", "velocity", "displacement"]
    bench = Bench(tmp_path, SYSTEMS["w1"], *measure(SYSTEMS["w1"], 0.0, 2, kinds))
    errors = bench.errors(bench.result("--sensing", ",".join(kinds)))
    assert max(errors["M"], errors["K"]) <= 1e-8 and errors["R"] <= 1e-6


def test_force_at_a_mass_without_sensor(tmp_path: Path) -> None:
    s = SYSTEMS["w2"]  # sensors at 1, 2, 3, 5, 6; forces at 1 and 4
    u, y = measure(s, 0.0, 4)
    bench = Bench(tmp_path, s, u, y[:, [0, 1, 2, 4, 5]])
    result = bench.result(dofs=["--input-dofs=1,4", "--output-dofs=1,2,3,5,6"])
    errors = bench.errors(result)
    assert max(errors["M"], errors["K"]) <= 1e-8 and errors["R"] <= 1e-6
    assert result["mkr"]["checks"]["collocated_pairs"] == 1


def test_units_are_converted_and_said(tmp_path: Path) -> None:
    s, (u, y) = SYSTEMS["w1"], measure(SYSTEMS["w1"], 0.0, 6)
    bench = Bench(tmp_path, s, u / 1e3, y / np.array([9.80665, 1e-3, 1.0]), ["kN", "g", "mm/s^2", ""])
    result = bench.result()
    errors = bench.errors(result)
    assert max(errors["M"], errors["K"]) <= 1e-8 and errors["R"] <= 1e-6
    said = [one["text"] for one in result["warnings"] if one["code"] == "unit_converted"]
    assert len(said) == 3
    assert any('"y1" is in g' in text and "9.80665 m/s^2" in text for text in said)
    assert "unit_converted" in bench.run().stdout


@pytest.mark.parametrize(
    ("units", "parts"),
    [(["N", "mm", "", ""], ("--sensing", '"y1" is in mm', "acceleration")), (["m", "", "", ""], ("--inputs", '"u1"'))],
)
def test_units_that_contradict(tmp_path: Path, units: list[str], parts: tuple[str, ...]) -> None:
    bench = Bench(tmp_path, SYSTEMS["w1"], *measure(SYSTEMS["w1"], 1.0, 6), units)
    refused(bench.run("--json", "-"), 2, *parts)


def test_unknown_unit_is_said(tmp_path: Path) -> None:
    bench = Bench(tmp_path, SYSTEMS["w1"], *measure(SYSTEMS["w1"], 1.0, 6), ["V", "", "", ""])
    assert '"V"' in codes(bench.result())["unit_unknown"]


# what was done wrong, the note that must appear, and the words that must name the cause
SLIPS = [
    ("swapped", "mkr_polarity", "polarity", 'the polarity of "u1" reversed'),
    ("displacement", "mkr_polarity", "kind of sensor is wrong by two", "sensing displacement"),
    ("velocity", "mkr_residual", "kind of sensor is wrong by one", "sensing velocity"),
    ("foh", "mkr_residual", "hold", "hold foh"),
]


@pytest.mark.parametrize(("slip", "code", "words", "cause"), SLIPS)
def test_a_slip_is_named(tmp_path: Path, slip: str, code: str, words: str, cause: str) -> None:
    kind = [slip] * 3 if slip in KINDS else None
    u, y = measure(SYSTEMS["w1"], 1.0, 8, kind, "foh" if slip == "foh" else "zoh")
    bench = Bench(tmp_path, SYSTEMS["w1"], -u if slip == "swapped" else u, y)
    said = codes(bench.result())
    assert words in said[code]
    assert cause in said["mkr_likely_cause"]
    assert f"warning {code}" in bench.run().stdout
    mended = {"swapped": ["--input-dofs=-1", bench.dofs[1]], "foh": [*bench.dofs, "--hold=foh"]}
    result = bench.result(dofs=mended.get(slip, [*bench.dofs, f"--sensing={slip}"]))
    assert not [one for one in codes(result) if one.startswith("mkr")]
    assert bench.errors(result)["M"] < 5e-3


@pytest.mark.parametrize(
    ("dofs", "parts"),
    [
        (["--input-dofs=1"], ("--output-dofs is missing",)),
        (["--output-dofs=1,2,3"], ("--input-dofs is missing",)),
        (["--input-dofs=0", "--output-dofs=1,2,3"], ("--input-dofs", '"0"', "from 1")),
        (["--input-dofs=1", "--output-dofs=1,2,x"], ("--output-dofs", '"x"')),
        (["--input-dofs=1", "--output-dofs=1,2.5,3"], ("--output-dofs", '"2.5"')),
        (["--input-dofs=1", "--output-dofs=1,,3"], ("--output-dofs", '""')),
        (["--input-dofs=1,2", "--output-dofs=1,2,3"], ("--input-dofs", "2 numbers for 1 input")),
        (["--input-dofs=1", "--output-dofs=1,2"], ("--output-dofs", "2 numbers for 3 outputs")),
        (["--input-dofs=1", "--output-dofs=1,2,4"], ("--output-dofs", "degree of freedom 3 has neither")),
        (["--input-dofs=4", "--output-dofs=1,2,3"], ("--input-dofs", "co-located")),
        (["--input-dofs=99999999999", "--output-dofs=1,2,3"], ("--input-dofs", "99999999999")),
    ],
)
def test_wrong_degrees_of_freedom(tmp_path: Path, dofs: list[str], parts: tuple[str, ...]) -> None:
    bench = Bench(tmp_path, SYSTEMS["w1"], *measure(SYSTEMS["w1"], 1.0, 1))
    refused(bench.run(dofs=dofs), 2, *parts)


def test_too_few_modes(tmp_path: Path) -> None:
    bench = Bench(tmp_path, SYSTEMS["w1"], *measure(SYSTEMS["w1"], 1.0, 1))
    target = tmp_path / "r.json"
    refused(bench.run("--order", "4", "--json", str(target)), 3, "2 admissible modes", "order 4", "3 needed")
    assert not target.exists()


def test_minus_reverses_a_sensor(tmp_path: Path) -> None:
    u, y = measure(SYSTEMS["w1"], 0.0, 1)
    bench = Bench(tmp_path, SYSTEMS["w1"], u, y * np.array([1.0, 1.0, -1.0]))
    assert bench.errors(bench.result(dofs=["--input-dofs", "1", "--output-dofs", "1,2,-3"]))["M"] <= 1e-8
    assert "polarity reversed" in " ".join(run("identify", "--help").stdout.split())


def test_table_shows_matrices_with_units(tmp_path: Path) -> None:
    bench = Bench(tmp_path, SYSTEMS["w1"], *measure(SYSTEMS["w1"], 0.0, 1))
    text = bench.run().stdout
    for words in ("M [kg]", "K [N/m]", "R [N s/m]", "of normal modes", "proportional", "M yes, K yes, R yes"):
        assert words in text
    assert re.search(r"^ +1 +50000\.0 +-20000\.0 +-?0\.0$", text, re.MULTILINE)
    assert "mkr" not in bench.result(dofs=[])


@pytest.fixture(scope="module")
def rig(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("rig")
    files = [f"--{name}={folder / name}" for name in ("log", "truth", "csv", "dbc", "config")]
    done = run("simulate", ROOT / "tests" / "replay" / "demo_rig.toml", *files)
    assert done.returncode == 0, done.stderr
    return folder


def replayed(rig: Path, config: str, *options: str) -> subprocess.CompletedProcess[str]:
    place = rig / "own.toml"
    place.write_text(config, encoding="utf-8")
    return run("replay", rig / "log", "-c", place, *options)


def test_replay_of_the_demo_rig(rig: Path, tmp_path: Path) -> None:
    config = (rig / "config").read_text(encoding="utf-8")
    assert "mkr = true" in config
    done = replayed(rig, config, "--json", str(tmp_path / "r.json"), "--events", str(tmp_path / "events"))
    assert done.returncode == 0, done.stderr
    assert "M [kg]" in done.stdout
    result = json.loads((tmp_path / "r.json").read_text(encoding="utf-8"))
    truth = json.loads((rig / "truth").read_text(encoding="utf-8"))
    assert relative(result["mkr"]["M"], np.array(truth["M"])) < 0.01
    assert relative(result["mkr"]["K"], np.array(truth["K"])) < 0.01
    assert relative(result["mkr"]["R_normal_modes"], np.array(truth["R"])) < 0.01
    assert relative(result["pdc"]["R"], np.array(truth["R"])) < 0.01
    assert relative(result["mkr"]["R"], np.array(truth["R"])) < 0.1
    last = json.loads((tmp_path / "events").read_text(encoding="utf-8").splitlines()[-1])
    assert last["type"] == "result" and last["result"] == result
    printed = subprocess.run(
        [sys.executable, str(ROOT / "tools" / "demo_truth.py"), str(tmp_path / "r.json"), str(rig / "truth")],
        capture_output=True, text=True, check=True,
    ).stdout  # fmt: skip
    errors = dict(re.findall(r"^ +([MK]) \[.*error ([0-9.]+) %$", printed, re.MULTILINE))
    assert set(errors) == {"M", "K"} and max(map(float, errors.values())) < 1.0
    page = report.build(report.load_result(tmp_path / "r.json"))
    for words in ("Mass, stiffness and damping", "M [kg]", "of normal modes", "α M + β K", "M positive definite"):
        assert words in page
    assert "http" not in page.replace("http-equiv", "")


def test_without_the_wish_there_are_no_matrices(rig: Path, tmp_path: Path) -> None:
    config = (rig / "config").read_text(encoding="utf-8").replace("mkr = true", "mkr = false")
    assert replayed(rig, config, "--json", str(tmp_path / "r.json")).returncode == 0
    result = json.loads((tmp_path / "r.json").read_text(encoding="utf-8"))
    assert "mkr" not in result and "pdc" not in result
    assert "Mass, stiffness" not in report.build(report.load_result(tmp_path / "r.json"))


def test_live_result_without_enough_modes(rig: Path, tmp_path: Path) -> None:
    config = (rig / "config").read_text(encoding="utf-8").replace("update_s", "order = 4\nupdate_s")
    done = replayed(rig, config, "--json", str(tmp_path / "r.json"))
    assert done.returncode == 0, done.stderr
    result = json.loads((tmp_path / "r.json").read_text(encoding="utf-8"))
    assert "mkr" not in result and result["modes"]
    assert "3 needed" in codes(result)["mkr_failed"]


def test_live_units_are_said(rig: Path, tmp_path: Path) -> None:
    config = (rig / "config").read_text(encoding="utf-8")
    in_g = config.replace('unit = "m/s^2"', 'unit = "g"', 1)
    assert in_g != config
    assert replayed(rig, in_g, "--json", str(tmp_path / "r.json")).returncode == 0
    result = json.loads((tmp_path / "r.json").read_text(encoding="utf-8"))
    assert "m/s^2" in codes(result)["unit_converted"]


def test_live_degrees_of_freedom_are_checked(rig: Path) -> None:
    config = (rig / "config").read_text(encoding="utf-8")
    refused(replayed(rig, config.replace("dof = 2", "dof = 5")), 2, 'key "mkr"', "degree of freedom 2 has neither")
    refused(replayed(rig, re.sub(r"dof = \d\n", "", config)), 2, 'key "mkr"', "no channel stands", '"dof"')


def test_a_rig_with_an_unseen_mass_does_not_ask(tmp_path: Path) -> None:
    text = (ROOT / "tests" / "replay" / "demo_rig.toml").read_text(encoding="utf-8")
    own = tmp_path / "rig.toml"
    own.write_text(text.replace("sense_dofs = [1, 2, 3]", "sense_dofs = [1, 3]"), encoding="utf-8")
    files = [f"--{name}={tmp_path / name}" for name in ("log", "truth", "dbc", "config")]
    assert run("simulate", own, *files).returncode == 0
    assert "mkr = false" in (tmp_path / "config").read_text(encoding="utf-8")
    assert run("check", tmp_path / "config").returncode == 0


def test_python_agrees_with_the_program(tmp_path: Path) -> None:
    s, (u, y) = SYSTEMS["w1"], measure(SYSTEMS["w1"], 1.0, 9)
    bench = Bench(tmp_path, s, u, y)
    theirs = bench.result()
    ours = okid.identify(u, y, fs=s.fs, method="okid-era", input_dofs=[1], output_dofs=[1, 2, 3])
    assert isinstance(ours.mkr, okid.MassMatrices) and isinstance(ours.pdc, okid.ProportionalDamping)
    data = ours.to_dict()
    assert list(data["mkr"]) == list(theirs["mkr"]) and list(data["pdc"]) == list(theirs["pdc"])
    assert list(data["mkr"]["checks"]) == list(theirs["mkr"]["checks"])
    for name in ("M", "K", "R", "R_normal_modes"):
        assert relative(data["mkr"][name], np.array(theirs["mkr"][name])) < 1e-8
    assert relative(data["pdc"]["R"], np.array(theirs["pdc"]["R"])) < 1e-8
    assert list(data) == list(theirs)
    json.dumps(data, allow_nan=False)
    assert "K [N/m]" in str(ours.table())
    assert relative(ours.mkr.M, s.M) < 1.5 * 3.5e-3


@pytest.mark.parametrize(("slip", "code", "words", "cause"), SLIPS)
def test_python_names_a_slip(slip: str, code: str, words: str, cause: str) -> None:
    kind = [slip] * 3 if slip in KINDS else None
    u, y = measure(SYSTEMS["w1"], 1.0, 8, kind, "foh" if slip == "foh" else "zoh")
    result = okid.identify(
        -u if slip == "swapped" else u, y, fs=SYSTEMS["w1"].fs, method="okid-era", input_dofs=[1], output_dofs=[1, 2, 3]
    )
    said = dict(result.warnings)
    assert words in said[code] and cause in said["mkr_likely_cause"]
    mended = okid.identify(
        u, y, fs=SYSTEMS["w1"].fs, method="okid-era", input_dofs=[1], output_dofs=[1, 2, 3],
        sensing=slip if slip in KINDS else "acceleration", hold="foh" if slip == "foh" else "zoh",
    )  # fmt: skip
    assert mended.mkr is not None and mended.mkr.checks["notes"] == []
    assert relative(mended.mkr.M, SYSTEMS["w1"].M) < 5e-3


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"input_dofs": [1]}, "output_dofs is missing"),
        ({"input_dofs": [0], "output_dofs": [1, 2, 3]}, "input_dofs"),
        ({"input_dofs": [1.0], "output_dofs": [1, 2, 3]}, "input_dofs"),
        ({"input_dofs": [1], "output_dofs": [1, 2]}, "2 number"),
        ({"input_dofs": [1], "output_dofs": [1, 2, 4]}, "degree of freedom 3 has neither"),
        ({"input_dofs": [4], "output_dofs": [1, 2, 3]}, "co-located"),
        ({"sensing": "speed"}, "sensing"),
        ({"sensing": ["velocity"] * 2}, "2 kinds for 3"),
    ],
)
def test_python_refuses(arguments: dict[str, Any], words: str) -> None:
    u, y = measure(SYSTEMS["w1"], 1.0, 1)
    with pytest.raises(okid.InputError, match=words):
        okid.identify(u, y, fs=SYSTEMS["w1"].fs, **arguments)


def test_python_too_few_modes() -> None:
    u, y = measure(SYSTEMS["w1"], 1.0, 1)
    with pytest.raises(okid.IdentificationError, match="2 admissible.*3 needed"):
        okid.identify(u, y, fs=SYSTEMS["w1"].fs, order=4, input_dofs=[1], output_dofs=[1, 2, 3])
