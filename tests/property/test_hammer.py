# SPDX-License-Identifier: MIT
"""[hammer]: blows are waited for, judged, and the good ones added up; each fault is named for what it is."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from program import okid
from systems import Structure, chain, rayleigh, simulate

RATE = 1000.0
LENGTH = 1500  # samples between two blows
CODES = {"force": 0.05, "acc1": 0.01, "acc2": 0.01}  # N and m/s^2 a count
CONFIG = """
[acquisition]
rate_hz = 1000.0
[[bus]]
name = "can0"
interface = "vcan0"
[identification]
p = 20
order = 4
mkr = true
[hammer]
level = 20.0
hits = {hits}
length_s = 0.8
{more}
"""
CHANNEL = """
[[channel]]
name = "{name}"
role = "{role}"
dof = {dof}
can_id = {can_id}
start_bit = 16
length = 16
signed = true
scale = {scale}
sequence = {{ start_bit = 0, length = 16 }}
"""


def structure() -> Structure:
    M, K = chain([2.0, 1.5], [8e4, 5e4])
    R, _ = rayleigh(M, K, 0.02)
    return Structure(M, R, K, force_dofs=(0,), sense_dofs=(0, 1), dt=1 / RATE)


def pulse(length: int, peak: float) -> np.ndarray:
    return peak * np.sin(np.pi * (np.arange(length) + 0.5) / length)


def record(blows: Sequence[str], seed: int = 1) -> np.ndarray:
    """Samples of force, acc1, acc2 as codes: one blow every 1.5 s, each of a kind."""
    random = np.random.default_rng(seed)
    force = np.zeros(LENGTH * len(blows) + LENGTH)
    for number, kind in enumerate(blows):
        at = LENGTH * number + LENGTH - 100
        if kind == "soft":
            force[at : at + 60] += pulse(60, 300.0)
        elif kind == "weak":
            force[at : at + 5] += pulse(5, 25.0)
        else:
            force[at : at + 5] += pulse(5, 400.0)
        if kind == "double":
            force[at + 40 : at + 45] += pulse(5, 90.0)
        if kind == "early":  # the structure still moves, by a knock below the level of the trigger
            force[at - 45 : at - 32] += 18.0
    one = structure()
    A, B, C, D = one.discrete()
    x, y = np.zeros(len(A)), np.empty((len(force), 2))
    for n, f in enumerate(force):
        y[n] = C @ x + D[:, 0] * f
        x = A @ x + B[:, 0] * f
    noise = np.full(len(force), 0.15)
    for number, kind in enumerate(blows):
        if kind == "weak":
            noise[LENGTH * number : LENGTH * (number + 1)] = 4.0
    force = force + noise * random.standard_normal(len(force))
    y = y + 0.05 * random.standard_normal(y.shape)
    columns = np.column_stack([force, y]) / list(CODES.values())
    for number, kind in enumerate(blows):
        if kind == "overload":
            at = LENGTH * number + LENGTH - 98
            columns[at : at + 2, 2] = 40000
    return np.clip(np.rint(columns), -32768, 32767).astype(int)


def write_log(path: Path, codes: np.ndarray, lost: Sequence[int] = ()) -> None:
    with path.open("w") as out:
        for n, row in enumerate(codes):
            for channel, code in enumerate(row):
                if channel == 1 and n in lost:
                    continue
                data = (n & 0xFFFF).to_bytes(2, "little") + int(code).to_bytes(2, "little", signed=True)
                out.write(f"({1700000000 + n / RATE + channel * 2e-5:.6f}) vcan0 {0x100 + channel:03X}#{data.hex()}\n")


def play(folder: Path, codes: np.ndarray, hits: int, more: str = "", lost: Sequence[int] = (), config: str = CONFIG):
    text = config.format(hits=hits, more=more)
    for number, (name, scale) in enumerate(CODES.items()):
        role = "acceleration" if number else "force"
        text += CHANNEL.format(name=name, role=role, dof=max(number, 1), can_id=0x100 + number, scale=scale)
    (folder / "h.toml").write_text(text)
    write_log(folder / "h.log", codes, lost)
    done = okid("replay", folder / "h.log", "-c", folder / "h.toml", "--events", folder / "e", "--json", folder / "r")
    events = [json.loads(line) for line in (folder / "e").read_text().splitlines()] if (folder / "e").exists() else []
    return done, events


def hits_of(events: list[dict]) -> list[dict]:
    return [event for event in events if event["type"] == "hit"]


def test_good_blows_are_added_up_and_faults_are_named(tmp_path: Path) -> None:
    blows = ["good", "double", "good", "overload", "early", "soft", "weak", "good", "good"]
    done, events = play(tmp_path, record(blows), 3, "spectrum_hz = 100.0")
    assert done.returncode == 0, done.stderr
    told = hits_of(events)
    reasons = [hit["reason"] for hit in told]
    assert reasons == [None, "double_hit", None, "overload", "moving", "spectrum", "weak", None]  # then it is done
    assert [hit["left"] for hit in told] == [2, 2, 1, 1, 1, 1, 1, 0]
    assert [hit["number"] for hit in told] == list(range(1, 9))
    assert all(abs(hit["peak"] - 400) < 15 for hit in told if hit["accepted"])
    assert "acc2 stood at full scale for 2 samples" in told[3]["text"]
    result = events[-1]["result"]
    f, zeta = structure().modes()
    modes = result["modes"]
    assert len(modes) == 2
    assert np.allclose([mode["frequency_hz"] for mode in modes], f, rtol=2e-3)
    assert np.allclose([mode["damping_ratio"] for mode in modes], zeta, rtol=0.1)
    assert np.allclose(result["mkr"]["M"], structure().M, atol=0.06)
    assert result["gaps"] == 0
    assert not [w for w in result["warnings"] if w["code"] == "missing_samples"]


def test_a_plan_of_points_is_struck_one_after_the_other(tmp_path: Path) -> None:
    """Four places of one structure, two good hits each: the guide names the next, each becomes an input of its own."""
    one = replace(structure(), force_dofs=(0, 1))
    plan, kinds = [1, 1, 1, -2, -2], ["good", "double", "good", "good", "good"]  # the second is no good one
    f = np.zeros((LENGTH * 6, 2))
    for number, (point, kind) in enumerate(zip(plan, kinds, strict=True)):
        at = LENGTH * number + LENGTH - 100
        f[at : at + 5, abs(point) - 1] += np.sign(point) * pulse(5, 400.0)
        if kind == "double":
            f[at + 40 : at + 45, abs(point) - 1] += pulse(5, 90.0)
    random = np.random.default_rng(2)
    y = simulate(one.discrete(), f)
    force = f[:, 0] - f[:, 1]  # the load cell in the hammer knows no direction
    noise = random.standard_normal((len(f), 3)) * [0.15, 0.05, 0.05]
    columns = np.column_stack([force, y]) + noise
    codes = np.clip(np.rint(columns / list(CODES.values())), -32768, 32767).astype(int)
    text = CONFIG.replace("p = 20\norder = 4\n", "")
    done, events = play(tmp_path, codes, 2, "points = [1, -2]", config=text)
    assert done.returncode == 0, done.stderr
    told = hits_of(events)
    assert [hit["point"] for hit in told] == plan and [hit["accepted"] for hit in told] == [k == "good" for k in kinds]
    assert [hit["left"] for hit in told] == [3, 3, 2, 1, 0]
    for words in (
        "strike point 1 (force beyond 20), 2 of 2 there, 4 of 4 left",
        "wait, next point -2, 2 of 2 there, 2 of 4 left",
        "1 of 2 there, 1 of 4 left",
    ):
        assert words in done.stdout, done.stdout
    result = events[-1]["result"]
    assert result["inputs"] == ["force@1", "force@2"]
    sure = [mode["frequency_hz"] for mode in result["modes"] if mode["confident"]]
    assert np.allclose(sure, one.modes()[0], rtol=2e-3), result["modes"]
    feed = np.array(result["model"]["D"])  # a force moves its own mass at once, and in its own direction
    assert np.allclose(np.diag(feed), 1.0 / np.diag(one.M), rtol=0.2), feed
    for given, fault in (("points = [1, 0]", "expected the numbers of the places"), ("points = []", "is empty")):
        assert fault in play(tmp_path, codes[:10], 2, given, config=text)[0].stderr
    assert 'belongs to method "auto"' in play(tmp_path, codes[:10], 2, "points = [1, 2]")[0].stderr


@pytest.mark.parametrize(("percent", "reason"), [(15, "double_hit"), (30, None)])
def test_how_large_a_second_blow_may_be(tmp_path: Path, percent: int, reason: str | None) -> None:
    """The second one has 90 N of 400, and the noise some more."""
    done, events = play(tmp_path, record(["double", "good", "good"]), 2, f"double_percent = {percent}.0")
    assert done.returncode == 0, done.stderr
    assert hits_of(events)[0]["reason"] == reason


def test_one_blow_is_the_record_of_the_same_samples(tmp_path: Path) -> None:
    """What goes in is just the samples from before the blow to its end: identify says the same of them."""
    codes = record(["good", "good"])
    done, events = play(tmp_path, codes, 1)
    assert done.returncode == 0, done.stderr
    hit = hits_of(events)[0]
    crossing = int(np.flatnonzero(codes[:, 0] * CODES["force"] >= 20)[0])
    assert hit["sample"] == crossing
    result = events[-1]["result"]
    before = 20 + 20 // 8 + 4
    cut = (codes * list(CODES.values()))[crossing - before : crossing + 800]
    assert result["samples"] == len(cut)
    lines = ["# fs_hz: 1000", "force,acc1,acc2", *(",".join(f"{x:.6f}" for x in row) for row in cut)]
    (tmp_path / "cut.csv").write_text("\n".join(lines) + "\n")
    again = okid("identify", tmp_path / "cut.csv", "--inputs", "force", "--outputs", "acc1,acc2", "--p", 20,
                 "--order", 4, "--quiet", "--json", tmp_path / "i.json")  # fmt: skip
    assert again.returncode == 0, again.stderr
    batch = json.loads((tmp_path / "i.json").read_text())
    for live, file in zip(result["modes"], batch["modes"], strict=True):
        assert live["frequency_hz"] == pytest.approx(file["frequency_hz"], rel=1e-9)
        assert live["damping_ratio"] == pytest.approx(file["damping_ratio"], rel=1e-7)


def test_lost_samples_cost_the_blow_and_not_the_test(tmp_path: Path) -> None:
    codes = record(["good", "good", "good"])
    done, events = play(tmp_path, codes, 2, lost=range(1500, 1510))
    assert done.returncode == 0, done.stderr
    assert [hit["reason"] for hit in hits_of(events)] == ["samples_lost", None, None]


def test_too_few_blows_still_give_what_is_there(tmp_path: Path) -> None:
    done, events = play(tmp_path, record(["good", "double"]), 5)
    assert done.returncode == 0, done.stderr
    assert "1 of 5" in done.stderr
    assert events[-1]["result"]["samples"] == 826
    done, events = play(tmp_path, record(["double"]), 5)
    assert done.returncode == 3
    assert "no hit was accepted" in done.stderr and "double_hit" in done.stderr
    done, events = play(tmp_path, record(["good"])[:1000], 5)
    assert done.returncode == 3
    assert "no hit" in done.stderr and "20" in done.stderr


@pytest.mark.parametrize(
    ("more", "expected"),
    [
        ("level = 0.0", '"level" is 0'),
        ("spectrum_hz = 900.0", "expected at most half of rate_hz, 500 Hz"),
        ('channel = "acc1"', '"acc1" has not the role force'),
        ("hits = 0", "expected a whole number from 1"),
        ('[trigger]\nsource = "level"\nlevel = 1.0', "leave [trigger] out"),
        ("hitz = 3", 'did you mean "hits"?'),
    ],
)
def test_what_a_config_cannot_ask_for(tmp_path: Path, more: str, expected: str) -> None:
    key = more.split()[0]
    text = CONFIG.format(hits=3, more="").rstrip()
    text = "\n".join(line for line in text.splitlines() if line.split(" ")[0] != key) + "\n" + more + "\n"
    for number, (name, scale) in enumerate(CODES.items()):
        role = "acceleration" if number else "force"
        text += CHANNEL.format(name=name, role=role, dof=max(number, 1), can_id=0x100 + number, scale=scale)
    (tmp_path / "h.toml").write_text(text)
    done = okid("check", tmp_path / "h.toml")
    assert done.returncode == 2, done.stdout
    assert expected in done.stderr, done.stderr
