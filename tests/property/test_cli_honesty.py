# SPDX-License-Identifier: MIT
"""What must not pass in silence: wrong rates, torn logs, missing forces, repeated inputs, records without vibration."""

import json
import pathlib
import subprocess

import numpy as np
import okid as package
import pytest
from methods import by_method
from program import ROOT, okid

TRUTH = [10.96009, 31.84210, 45.66197]


@pytest.fixture(scope="module")
def rig(tmp_path_factory: pytest.TempPathFactory) -> pathlib.Path:
    """The demo rig: rig.log, rig.csv, rig.toml with its DBC."""
    folder = tmp_path_factory.mktemp("rig")
    made = okid(
        "simulate", ROOT / "tests" / "replay" / "demo_rig.toml", "--log", folder / "rig.log", "--truth",
        folder / "truth.json", "--csv", folder / "rig.csv", "--config", folder / "rig.toml",
    )  # fmt: skip
    assert made.returncode == 0, made.stderr
    return folder


def samples_of(rig: pathlib.Path) -> np.ndarray:
    lines = [line for line in (rig / "rig.csv").read_text().splitlines() if not line.startswith("#")]
    names = lines[0].split(",")
    pick = [names.index(name) for name in ("force1", "acc1", "acc2", "acc3")]
    return np.array([[float(cell) for cell in line.split(",")] for line in lines[1:]])[:, pick]


def identify(tmp_path: pathlib.Path, values: np.ndarray, *more: str) -> subprocess.CompletedProcess[str]:
    path = tmp_path / "record.csv"
    with path.open("w") as file:
        file.write("# fs_hz: 250\nforce1,acc1,acc2,acc3\n")
        np.savetxt(file, values, delimiter=",", fmt="%.12g")
    method = [] if "--method" in more else ["--method", "okid-era"]
    return okid("identify", path, "--inputs", "force1", "--outputs", "acc1,acc2,acc3", "--json", "-", *method, *more)


def replay(rig: pathlib.Path, tmp_path: pathlib.Path, edit: tuple[str, str]) -> tuple[int, str, dict]:
    text = (rig / "rig.toml").read_text().replace('dbc = "', f'dbc = "{rig}/')
    assert edit[0] in text
    (tmp_path / "edited.toml").write_text(text.replace(*edit, 1))
    out = tmp_path / "result.json"
    done = okid("replay", rig / "rig.log", "-c", tmp_path / "edited.toml", "--json", out)
    return done.returncode, done.stderr, json.loads(out.read_text()) if out.exists() else {}


def test_a_wrong_rate_is_said(rig: pathlib.Path, tmp_path: pathlib.Path) -> None:
    status, errors, _ = replay(rig, tmp_path, ("rate_hz = 250", "rate_hz = 500"))
    assert status == 0
    assert "by the time stamps 250 samples came a second, but rate_hz is 500" in errors
    status, errors, result = replay(rig, tmp_path, ("rate_hz = 250", "rate_hz = 250"))
    assert (status, errors, result["warnings"]) == (0, "", [])


def test_units_are_converted_or_remarked(rig: pathlib.Path, tmp_path: pathlib.Path) -> None:
    _, _, plain = replay(rig, tmp_path, ('unit = "N"', 'unit = "N"'))
    _, errors, kilo = replay(rig, tmp_path, ('unit = "N"', 'unit = "kN"'))
    assert len(errors.splitlines()) == 1 and 'its unit is "kN", but signal Force1 of the dbc is in "N"' in errors
    np.testing.assert_allclose(np.array(kilo["model"]["D"]) * 1e3, plain["model"]["D"], rtol=1e-9)
    _, errors, _ = replay(rig, tmp_path, ('unit = "N"', 'unit = "bananas"'))
    assert "bananas" in errors


def test_a_doubtful_unit_stands_in_the_result(rig: pathlib.Path, tmp_path: pathlib.Path) -> None:
    text = (rig / "rig.toml").read_text()
    (rig / "without_mkr.toml").write_text(text.replace("mkr = true", "mkr = false"))
    for unit, code in (("g", "unit_doubtful"), ("bananas", "unit_unknown")):
        (rig / "doubtful.toml").write_text(
            (rig / "without_mkr.toml").read_text().replace('unit = "N"', f'unit = "{unit}"')
        )
        done = okid("replay", rig / "rig.log", "-c", rig / "doubtful.toml", "--json", tmp_path / "r.json")
        assert done.returncode == 0, done.stderr
        said = {each["code"]: each["text"] for each in json.loads((tmp_path / "r.json").read_text())["warnings"]}
        assert list(said) == [code] and f'"{unit}"' in said[code] and said[code] in done.stderr


def misread(rig: pathlib.Path, tmp_path: pathlib.Path, old: str, new: str) -> tuple[int, str, dict[str, str]]:
    """Replay with another DBC. Status, stderr, and the warnings of the result by code and channel or message."""
    dbc = (rig / "rig.dbc").read_text()
    assert old in dbc
    (tmp_path / "misread.dbc").write_text(dbc.replace(old, new))
    text = by_method((rig / "rig.toml").read_text()).replace("rig.dbc", "misread.dbc")
    (tmp_path / "misread.toml").write_text(text.replace("update_s", "order = 6\nsigma_blocks = 0\nupdate_s"))
    out = tmp_path / "r.json"
    done = okid("replay", rig / "rig.log", "-c", tmp_path / "misread.toml", "--json", out)
    found = json.loads(out.read_text())["warnings"] if out.exists() else []
    return done.returncode, done.stderr, {f"{w['code']} {w['text'].split()[0]}": w["text"] for w in found}


def test_a_misread_sign_is_said(rig: pathlib.Path, tmp_path: pathlib.Path) -> None:
    status, _, said = misread(rig, tmp_path, "16|16@1- (", "16|16@1+ (")  # the force and the first acceleration
    assert status == 0
    assert {name for name in said if name.startswith("code_jumps")} == {'code_jumps "force1"', 'code_jumps "acc1"'}
    assert "is it really unsigned" in said['code_jumps "acc1"'] and "(Accel1 of Accel1)" in said['code_jumps "acc1"']
    assert misread(rig, tmp_path, "VERSION", "VERSION")[2] == {}


def test_a_counter_that_does_not_count_is_the_reason_told(rig: pathlib.Path, tmp_path: pathlib.Path) -> None:
    status, errors, said = misread(rig, tmp_path, "Counter : 0|16@1+", "Counter : 16|16@1+")
    assert (status, said) == (3, {})
    assert "the counter of message Shaker rose by one in only" in errors
    assert 'Look at "sequence" of "acc1" (start bit 16, 16 bits, little endian)' in errors
    assert errors.splitlines()[-1].startswith("okid: no model")


def test_what_comes_instead_is_named(rig: pathlib.Path, tmp_path: pathlib.Path) -> None:
    log = (rig / "rig.log").read_text()
    (tmp_path / "other.log").write_text(log.replace(" 101#", " 155#"))
    done = okid("replay", tmp_path / "other.log", "-c", rig / "rig.toml")
    assert done.returncode == 3
    last = done.stderr.splitlines()[-1]
    assert 'no usable frame of channel "acc1" was received (message Accel1, identifier 0x101' in last
    assert "it carries 0x155 (5000 frames)" in last
    short = "".join(line[:-4] + "\n" if " 101#" in line else line + "\n" for line in log.splitlines())
    (tmp_path / "short.log").write_text(short)
    done = okid("replay", tmp_path / "short.log", "-c", rig / "rig.toml")
    assert done.returncode == 3
    assert "frames of it came, but none is long enough for the signal" in done.stderr


def test_exchanged_columns_are_said(rig: pathlib.Path) -> None:
    said = []
    for inputs, outputs in (("acc1", "force1,acc2,acc3"), ("force1", "acc1,acc2,acc3")):
        done = okid(
            "identify", rig / "rig.csv", "--inputs", inputs, "--outputs", outputs, "--method", "okid-era", "--json", "-"
        )
        assert done.returncode == 0, done.stderr
        said.append({each["code"]: each["text"] for each in json.loads(done.stdout)["warnings"]})
    assert 'output "force1" is a force by its name or unit, input "acc1" is not' in said[0]["exchanged"]
    assert "exchanged" not in said[1] and "fit_low" not in said[1]


def test_an_output_that_does_not_answer_is_said(rig: pathlib.Path, tmp_path: pathlib.Path) -> None:
    values = samples_of(rig)
    values[:, 3] = np.random.default_rng(8).standard_normal(len(values))  # a sensor that fell off
    said = {each["code"]: each["text"] for each in json.loads(identify(tmp_path, values).stdout)["warnings"]}
    assert '% of "acc3"' in said["fit_low"] and "acc1" not in said["fit_low"]
    names = {"input_names": ["force1"], "output_names": ["acc1", "acc2", "acc3"]}
    own = package.identify(values[:, :1], values[:, 1:], fs=250.0, method="okid-era", **names)
    assert {each.code: each.text for each in own.warnings}["fit_low"] == said["fit_low"]


def test_a_dead_sensor_is_said_live(rig: pathlib.Path, tmp_path: pathlib.Path) -> None:
    """There is no record to simulate: the sums tell what the model says of the next sample."""
    random, lines = np.random.default_rng(9), []
    for line in (rig / "rig.log").read_text().splitlines():
        head, _, data = line.partition(" 101#")
        noise = int(random.integers(-3, 4)).to_bytes(2, "little", signed=True).hex().upper()
        lines.append(f"{head} 101#{data[:8]}{noise}{data[12:]}" if data else line)
    (tmp_path / "dead.log").write_text("\n".join(lines) + "\n")
    (rig / "no_mkr.toml").write_text((rig / "rig.toml").read_text().replace("mkr = true", "mkr = false"))
    done = okid("replay", tmp_path / "dead.log", "-c", rig / "no_mkr.toml", "--json", tmp_path / "r.json")
    assert done.returncode == 0, done.stderr
    said = {each["code"]: each["text"] for each in json.loads((tmp_path / "r.json").read_text())["warnings"]}
    assert "one sample ahead the model explains only" in said["fit_low"] and '"acc2"' in said["fit_low"]
    assert "acc1" not in said["fit_low"] and "acc3" not in said["fit_low"]


def test_a_misread_sign_is_no_reversed_polarity(rig: pathlib.Path, tmp_path: pathlib.Path) -> None:
    """One cause is named, not a guess beside it."""
    dbc = (rig / "rig.dbc").read_text()
    line = next(each for each in dbc.splitlines() if "Force1" in each)
    _, _, said = misread(rig, tmp_path, line, line.replace("@1-", "@1+"))
    assert 'code_jumps "force1"' in said and 'code_jumps "acc1"' not in said
    assert not any(name.startswith("mkr_likely_cause") for name in said)


def test_no_model_is_told_with_what_was_adapted_and_what_to_try(tmp_path: pathlib.Path) -> None:
    done = identify(tmp_path, np.random.default_rng(2).standard_normal((200, 4)))
    assert done.returncode == 3
    assert "p is 4 instead of 40" in done.stderr and "method n4sid-moesp" in done.stderr


def test_a_free_decay_is_for_the_subspace_methods(tmp_path: pathlib.Path) -> None:
    t = np.arange(2000) / 250.0
    decay = [np.exp(-2 * np.pi * f * z * t) * np.sin(2 * np.pi * f * t + k) for k, (f, z) in
             enumerate([(13.0, 0.01), (29.0, 0.008)])]  # fmt: skip
    values = np.column_stack([decay[0] + decay[1], decay[0] - 0.7 * decay[1]])
    values += 0.001 * np.random.default_rng(1).standard_normal(values.shape)
    with (tmp_path / "decay.csv").open("w") as file:
        file.write("# fs_hz: 250\na1,a2\n")
        np.savetxt(file, values, delimiter=",", fmt="%.9g")
    done = okid("identify", tmp_path / "decay.csv", "--outputs", "a1,a2", "--method", "okid-era")
    assert done.returncode == 3 and "A free decay (ring-down) needs method n4sid-cva" in done.stderr
    done = okid("identify", tmp_path / "decay.csv", "--outputs", "a1,a2", "--method", "n4sid-cva", "--json", "-")
    assert done.returncode == 0, done.stderr
    found = [mode["frequency_hz"] for mode in json.loads(done.stdout)["modes"] if mode["emac"] > 0.5]
    np.testing.assert_allclose(found, [13.0, 29.0], rtol=1e-3)


def test_the_dbc_and_the_config_name_two_units(rig: pathlib.Path) -> None:
    (rig / "two.toml").write_text((rig / "rig.toml").read_text().replace('unit = "m/s^2"', 'unit = "g"', 1))
    done = okid("check", rig / "two.toml")
    assert done.returncode == 0
    assert 'warning: [[channel]] "acc1": its unit is "g", but signal Accel1 of the dbc is in "m/s^2"' in done.stdout


def test_the_same_bits_twice_are_said(rig: pathlib.Path) -> None:
    (rig / "same.toml").write_text((rig / "rig.toml").read_text().replace('signal = "Accel3"', 'signal = "Accel2"'))
    assert 'warning: [[channel]] "acc3" reads the same bits as "acc2"' in okid("check", rig / "same.toml").stdout
    assert "same bits" not in okid("check", rig / "rig.toml").stdout


def test_a_rig_is_no_config() -> None:
    done = okid("check", ROOT / "tests" / "replay" / "demo_rig.toml")
    assert done.returncode == 2 and "it looks like a RIG.toml, expected a CONFIG.toml" in done.stderr


def test_decimal_commas_between_commas(tmp_path: pathlib.Path) -> None:
    (tmp_path / "c.csv").write_text("# fs_hz: 10\na,b\n0,5,1,5\n")
    done = okid("identify", tmp_path / "c.csv", "--inputs", "a", "--outputs", "b")
    assert done.returncode == 2 and "Decimal commas need semicolons" in done.stderr


def test_the_screen_of_candump_is_no_log(rig: pathlib.Path, tmp_path: pathlib.Path) -> None:
    (tmp_path / "screen.log").write_text("  vcan0  100   [4]  00 00 9D FF\n")
    done = okid("replay", tmp_path / "screen.log", "-c", rig / "rig.toml")
    assert done.returncode == 2
    assert "expected '(' and a time in seconds, as candump -L and -l write" in done.stderr


def test_files_of_other_programs_are_for_another_command(rig: pathlib.Path, tmp_path: pathlib.Path) -> None:
    done = okid("convert", rig / "rig.log", tmp_path / "run.mf4")
    assert done.returncode == 2 and "okid-convert" in done.stderr


def test_a_torn_last_line_costs_one_frame(rig: pathlib.Path, tmp_path: pathlib.Path) -> None:
    torn = tmp_path / "torn.log"
    torn.write_bytes((rig / "rig.log").read_bytes()[:-10])
    done = okid("replay", torn, "-c", rig / "rig.toml", "--json", tmp_path / "r.json")
    assert done.returncode == 0, done.stderr
    assert "torn" in done.stderr
    assert json.loads((tmp_path / "r.json").read_text())["samples"] == 4999


def test_the_same_force_twice_is_refused_live(rig: pathlib.Path, tmp_path: pathlib.Path) -> None:
    text = (rig / "rig.toml").read_text().replace('dbc = "', f'dbc = "{rig}/')
    force = text[text.index("[[channel]]") :].split("[[channel]]")[1]
    (tmp_path / "twice.toml").write_text(
        text.replace("[identification]", "[[channel]]" + force.replace('"force1"', '"again"', 1) + "\n[identification]")
    )
    done = okid("replay", rig / "rig.log", "-c", tmp_path / "twice.toml", "--json", tmp_path / "r.json")
    assert done.returncode == 3
    assert "repeats" in done.stderr
    assert not (tmp_path / "r.json").exists()


@pytest.mark.parametrize("share", [0.002, 0.01, 0.02, 0.05])
def test_scattered_missing_cells_are_gaps(rig: pathlib.Path, tmp_path: pathlib.Path, share: float) -> None:
    values = samples_of(rig)
    values[np.random.default_rng(5).random(values.shape) < share] = np.nan
    done = identify(tmp_path, values)
    assert done.returncode == 0, done.stderr
    result = json.loads(done.stdout)
    frequencies = [mode["frequency_hz"] for mode in result["modes"] if mode["emac"] > 0.5]
    np.testing.assert_allclose(frequencies, TRUTH, rtol=2e-3)
    assert result["gaps"] > 0


def test_missing_forces_are_not_taken_as_zero(rig: pathlib.Path, tmp_path: pathlib.Path) -> None:
    values = samples_of(rig)
    values[np.random.default_rng(6).choice(len(values), 25, replace=False), 0] = np.nan
    result = json.loads(identify(tmp_path, values).stdout)
    for kind in ("simulation_percent", "prediction_percent"):
        assert min(result["fit"][kind].values()) > 98.5


def test_the_fit_can_be_recomputed(rig: pathlib.Path, tmp_path: pathlib.Path) -> None:
    values = samples_of(rig)[:700] + [3.0, -2.0, 5.0, 1.0]
    result = json.loads(identify(tmp_path, values).stdout)
    a, b, c, d = (np.array(result["model"][name]) for name in "ABCD")
    centred = values - values.mean(axis=0)
    x = np.array(result["model"]["x0"][0])
    estimate = np.empty((len(values), 3))
    for n, sample in enumerate(centred):
        estimate[n] = c @ x + d @ sample[:1]
        x = a @ x + b @ sample[:1]
    y = centred[:, 1:]
    percent = 100 * (1 - np.linalg.norm(y - estimate, axis=0) / np.linalg.norm(y - y.mean(axis=0), axis=0))
    np.testing.assert_allclose(list(result["fit"]["simulation_percent"].values()), percent, rtol=1e-8)


@pytest.mark.parametrize("kind", ["noise", "equal", "multiples"])
@pytest.mark.parametrize("method", ["okid-era", "okid-era-dc", "n4sid-moesp", "n4sid-cva", "n4sid-ssarx"])
def test_no_vibration_no_result(tmp_path: pathlib.Path, kind: str, method: str) -> None:
    rng = np.random.default_rng(7)
    values = rng.standard_normal((5000, 4))
    if kind != "noise":
        values[:, 1:] = values[:, :1] * (1.0 if kind == "equal" else [0.3, -2e3, 1e-6])
    done = identify(tmp_path, values, "--method", method)
    assert done.returncode == 3
    assert done.stdout == ""
    assert done.stderr.startswith("okid: no model")


@pytest.mark.parametrize("option", ["--json", "--events"])
def test_what_is_read_is_not_written_over(rig: pathlib.Path, tmp_path: pathlib.Path, option: str) -> None:
    """The log and the config of a replay, by whatever name they go."""
    log, config = tmp_path / "a.log", tmp_path / "a.toml"
    for name, copy in (("rig.log", log), ("rig.toml", config), ("rig.dbc", tmp_path / "rig.dbc")):
        copy.write_bytes((rig / name).read_bytes())
    before = log.read_bytes(), config.read_bytes()
    (tmp_path / "link").symlink_to(log)
    for target in (log, config, tmp_path / "link"):
        done = okid("replay", log, "-c", config, option, target)
        assert done.returncode == 2 and "a result does not overwrite it" in done.stderr, done.stderr
        assert (log.read_bytes(), config.read_bytes()) == before
