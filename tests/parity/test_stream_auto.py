# SPDX-License-Identifier: MIT
"""Method auto of a stream finds what `okid identify` finds in the same samples of a file, at every speed."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

import numpy as np
import okid
import pytest

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parent / "property"))
from laboratory import forced  # noqa: E402
from program import okid as run_okid  # noqa: E402

RIG = """rate_hz = 200.0
duration_s = 30.0
seed = 7
masses = [1.0, 0.8]
springs = [3e3, 2e3]
zeta = [0.02, 0.02]
force_dofs = [1]
sense_dofs = [1, 2]
noise_percent = 1.0
bits = 16
"""
NAMES = ["force1", "acc1", "acc2"]


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A log with lost frames, its samples as CSV, and the head of its config."""
    folder = tmp_path_factory.mktemp("auto")
    (folder / "rig.toml").write_text(RIG)
    names = ["--log", "a.log", "--truth", "t.json", "--dbc", "a.dbc", "--config", "a.toml"]
    done = run_okid("simulate", folder / "rig.toml", *(folder / one if "." in one else one for one in names))
    assert done.returncode == 0, done.stderr
    lines = (folder / "a.log").read_text().splitlines()
    gone = {2 * k + 1 for k in range(1700, 1715)} | {2 * 3500, 2 * 3500 + 1}
    (folder / "a.log").write_text("\n".join(line for k, line in enumerate(lines) if k not in gone) + "\n")
    assert run_okid("convert", folder / "a.log", folder / "a.csv", "-c", folder / "a.toml").returncode == 0
    return folder


def config(folder: Path, keys: str) -> Path:
    path = folder / f"auto{abs(hash(keys))}.toml"
    path.write_text((folder / "a.toml").read_text().split("[identification]\n")[0] + "[identification]\n" + keys)
    return path


def replay(folder: Path, keys: str, *more: str) -> tuple[dict[str, Any], list[dict[str, Any]], bytes]:
    out, events = folder / "r.json", folder / "e.jsonl"
    done = run_okid("replay", folder / "a.log", "-c", config(folder, keys), "--json", out, "--events", events, *more)
    assert done.returncode == 0, done.stderr
    return json.loads(out.read_text()), [json.loads(line) for line in events.read_text().splitlines()], out.read_bytes()


@pytest.mark.parametrize(("keys", "window"), [("mkr = true\n", ""), ("window_s = 15.0\nmkr = true\n", "3000:6000")])
def test_a_replay_is_identify_of_the_same_samples(made: Path, keys: str, window: str) -> None:
    live, events, _ = replay(made, keys)
    dofs = ["--input-dofs", "1", "--output-dofs", "1,2", "--inputs", "force1", "--outputs", "acc1,acc2"]
    done = run_okid("identify", made / "a.csv", *dofs, "--json", "-", *(["--range", window] if window else []))
    file = json.loads(done.stdout)
    assert live["method"] == file["method"] == "auto" and live["samples"] == file["samples"]
    assert live["gaps"] == file["gaps"] and live["hold"] == file["hold"]
    assert [m["confident"] for m in live["modes"]] == [m["confident"] for m in file["modes"]]
    for ours, other in zip(live["modes"], file["modes"], strict=True):  # codes against nine digits of a CSV
        assert ours["frequency_hz"] == pytest.approx(other["frequency_hz"], rel=1e-7)
        assert ours["damping_ratio"] == pytest.approx(other["damping_ratio"], rel=1e-5)
        assert ours["damping_ratio_std"] == pytest.approx(other["damping_ratio_std"], rel=1e-3)
    np.testing.assert_allclose(live["mkr"]["M"], file["mkr"]["M"], rtol=1e-5, atol=1e-5)
    assert live["model"]["x0"] is None and live["fit"]["simulation_percent"] is None
    truth = json.loads((made / "t.json").read_text())["frequency_hz"]
    found = [m["frequency_hz"] for m in live["modes"] if m["confident"]]
    np.testing.assert_allclose(found, truth, rtol=1e-3)
    updates = [event for event in events if event["type"] == "modes"]
    assert len(updates) >= 8 and updates[-1]["settled"]
    assert all({"confident", "found_in", "why"} <= mode.keys() for event in updates for mode in event["modes"])


def test_the_result_has_the_same_bytes_at_every_speed(made: Path) -> None:
    keys = "window_s = 12.0\nupdate_s = 1.0\n"
    assert replay(made, keys)[2] == replay(made, keys, "--speed", "20")[2]


def test_auto_unless_an_option_of_one_method_is_given(made: Path) -> None:
    for keys, method in (("", "auto"), ("p = 12\n", "okid-era"), ("forgetting = 0.999\n", "okid-era")):
        done = run_okid("check", config(made, keys), "--json")
        assert json.loads(done.stdout)["identification"]["method"] == method
        assert okid.Session.from_config(config(made, keys)).method == method


@pytest.mark.parametrize(
    ("keys", "said"),
    [
        ('method = "auto"\np = 12\n', "belongs to one method"),
        ('method = "auto"\nforgetting = 0.999\n', "expected window_s"),
        ("window_s = 0.5\n", "expected a longer window"),
        ('method = "n4sid-cva"\nband = [1.0, 2.0]\n', 'belongs to method "auto"'),
        ("band = [2.0, 1.0]\n", "the lower one first"),
        ('method = "n4sid-cva"\nhold = "auto"\n', "expected zoh, foh or band"),
        ("window_s = 1000.0\nmax_memory_mb = 1\n", "a shorter window_s"),
    ],
)
def test_what_does_not_go_together_is_refused(made: Path, keys: str, said: str) -> None:
    done = run_okid("check", config(made, keys))
    assert done.returncode == 2 and said in done.stderr


def test_a_session_is_identify_of_the_samples_fed() -> None:
    """Records of a laboratory, made by code of the tests: force and sensors behind one filter."""
    lab = forced(31)
    rows, n_u, n_y = lab.samples, lab.n_u, lab.samples.shape[1] - lab.n_u
    u, y = rows[:, :n_u], rows[:, n_u:]
    session = okid.Session(n_u, n_y, fs=lab.fs)
    for block in np.array_split(rows, [7, 900, 901, 9000]):
        session.feed(block)
    live, file = session.identify(), okid.identify(u, y, fs=lab.fs)
    assert session.method == live.method == file.method == "auto"
    for name in ("frequency_hz", "damping_ratio", "damping_ratio_std", "confident"):
        assert [getattr(m, name) for m in live.modes] == [getattr(m, name) for m in file.modes]
    assert [m.frequency_hz for m in session.modes()] == [m.frequency_hz for m in file.modes]
    first, second = (okid.Session(n_u, n_y, fs=lab.fs) for _ in range(2))
    first.feed(rows[:10000])
    second.feed(rows[10000:])
    first.merge(second.to_bytes())
    parts = [slice(None, 10000), slice(10000, None)]
    both = okid.identify([u[k] for k in parts], [y[k] for k in parts], fs=lab.fs)
    assert [m.frequency_hz for m in first.identify().modes] == [m.frequency_hz for m in both.modes]
    again = okid.Session(n_u, n_y, fs=lab.fs)
    again.restore(first.to_bytes())
    assert again.samples == first.samples == len(rows)
    for damaged in (b"", first.to_bytes()[:-8], b"x" * 100):
        with pytest.raises(okid.InputError):
            again.restore(damaged)


def test_a_window_forgets_and_a_gap_is_marked() -> None:
    lab = forced(32)
    rows, n_u, n_y = lab.samples, lab.n_u, lab.samples.shape[1] - lab.n_u
    session = okid.Session(n_u, n_y, fs=lab.fs, window_s=8000 / lab.fs)
    session.feed(rows[:9000] * 3.0)
    session.gap(50)
    session.feed(rows[9000:16950])
    window = np.vstack([np.full((50, n_u + n_y), np.nan), rows[9000:16950]])
    file = okid.identify(window[:, :n_u], window[:, n_u:], fs=lab.fs)
    assert [m.frequency_hz for m in session.identify().modes] == [m.frequency_hz for m in file.modes]
    assert (session.stats.missing, session.stats.gaps) == (50, 1)


def test_a_named_method_still_waits_for_twice_its_unknowns() -> None:
    session = okid.Session(1, 2, fs=200.0, p=12)
    assert session._stream.counts().unknowns == 1 + 12 * 3
    session.feed(np.random.default_rng(1).standard_normal((80, 3)))  # 68 equations
    assert session.modes() == []
