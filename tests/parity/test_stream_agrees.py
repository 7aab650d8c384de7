# SPDX-License-Identifier: MIT
"""A session fed with the samples that `okid convert` gives of a log is `okid replay` of it: the same modes at every
update, the same result, the same warnings, for every method and every memory."""

from __future__ import annotations

import json
import re
import sys
from pathlib import Path
from typing import Any

import numpy as np
import okid
import pytest
from numpy.typing import NDArray

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parent / "property"))
from program import okid as run_okid  # noqa: E402

Real = NDArray[np.float64]
RIG = """rate_hz = 200.0
duration_s = {duration}
seed = 7
masses = [1.0, 0.8]
springs = [3e3, 2e3]
zeta = [0.02, 0.02]
force_dofs = [1]
sense_dofs = [1, 2]
sensing = "acceleration"
excitation = "white"
hold = "zoh"
noise_percent = 1.0
bits = 16
"""
UPDATE_S = 1.0
# Codes of the log are summed exactly, what `convert` wrote with nine digits in double: so far they agree.
TOLERANCE = {"std": 2e-4, "damping_ratio": 1e-5, "shape": 1e-5, "mkr": 1e-4, "pdc": 1e-4, "warnings": 0.0}
SKIPPED = {"A", "B", "C", "D", "K", "version", "track", "alarm", "singular_noise"}


def rig(folder: Path, duration: float = 16.0, change: str = "") -> Path:
    (folder / "rig.toml").write_text(RIG.format(duration=duration) + change)
    names = ["--log", "a.log", "--truth", "t.json", "--dbc", "a.dbc", "--config", "a.toml"]
    given = [folder / one if "." in one else one for one in names]
    done = run_okid("simulate", folder / "rig.toml", *given)
    assert done.returncode == 0, done.stderr
    return folder


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A log with lost frames: 15 samples of one message, one sample of both, the last ones of the other."""
    folder = rig(tmp_path_factory.mktemp("stream"))
    lines = (folder / "a.log").read_text().splitlines()
    gone = {2 * k + 1 for k in range(700, 715)} | {2 * 1500, 2 * 1500 + 1} | {2 * k for k in range(2900, 2904)}
    (folder / "a.log").write_text("\n".join(line for k, line in enumerate(lines) if k not in gone) + "\n")
    return folder


def config(folder: Path, name: str, ambient: bool = False, **keys: Any) -> Path:
    """The config of the rig with other keys in [identification]."""
    text = (folder / "a.toml").read_text()
    if ambient:
        text = text.replace('role = "force"', 'role = "aux"')
    keys = {"p": 12, "rows": 24, "update_s": UPDATE_S, "mkr": not ambient, "method": "okid-era", "order": 4} | keys
    head = text.split("[identification]\n")[0]
    lines = [f"{key} = {json.dumps(value)}" for key, value in keys.items() if value is not None]
    path = folder / f"{name}.toml"
    path.write_text(head + "[identification]\n" + "\n".join(lines) + "\n")
    return path


def replayed(path: Path, folder: Path) -> tuple[list[dict[str, Any]], dict[str, Any]]:
    """Events with modes, and the result."""
    events = folder / f"{path.stem}.jsonl"
    done = run_okid("replay", folder / "a.log", "-c", path, "--events", events)
    assert done.returncode == 0, done.stderr
    said = [json.loads(line) for line in events.read_text().splitlines()]
    return [one for one in said if one["type"] in ("modes", "change")], said[-1]["result"]


def samples_of(folder: Path, path: Path) -> Real:
    decoded = folder / f"{path.stem}.csv"
    done = run_okid("convert", folder / "a.log", decoded, "-c", path)
    assert done.returncode == 0, done.stderr
    record = okid.read_csv(decoded)
    return np.ascontiguousarray(record.samples[:, [record.names.index(one) for one in channels(path)]])


def channels(path: Path) -> list[str]:
    return okid.Session.from_config(path).names


def fed(session: okid.Session, samples: Real) -> tuple[list[list[Any]], dict[str, Any]]:
    """The modes at each update, and the result."""
    step = round(UPDATE_S * session.fs)
    updates = []
    for first in range(0, len(samples), step):
        session.feed(samples[first : first + step])
        if len(samples) - first >= step:
            updates.append(session.modes())
    return updates, session.identify().to_dict()


def words(text: str) -> str:
    """Without numbers, and without what tells an option of the program from an argument."""
    return " ".join(re.sub(r"[-+]?\d[\d.]*(e[-+]\d+)?", "#", re.sub(r"--|=", " ", text)).split())


def tolerance(path: str) -> float:
    return max((loose for part, loose in TOLERANCE.items() if part in path), default=1e-6)


def compare(mine: Any, theirs: Any, path: str = "") -> None:
    if isinstance(theirs, dict):
        assert list(mine) == list(theirs), path
        for key in theirs:
            if key not in SKIPPED or "mkr" in path:
                compare(mine[key], theirs[key], f"{path}.{key}")
    elif isinstance(theirs, list):
        assert len(mine) == len(theirs), path
        if theirs and all(isinstance(one, float) for one in theirs):
            scale = max(map(abs, theirs))
            np.testing.assert_allclose(mine, theirs, rtol=tolerance(path), atol=tolerance(path) * scale, err_msg=path)
            return
        for k, (one, other) in enumerate(zip(mine, theirs, strict=True)):
            compare(one, other, f"{path}[{k}]")
    elif isinstance(theirs, float):
        assert mine == pytest.approx(theirs, rel=tolerance(path), abs=1e-9), path
    elif isinstance(theirs, str) and ".text" in path:
        assert words(mine) == words(theirs), path
    else:
        assert mine == theirs, path


KINDS: dict[str, dict[str, Any]] = {
    **{method: {"method": method} for method in ("okid-era", "okid-era-dc", "n4sid-moesp", "n4sid-cva", "n4sid-ssarx")},
    "window": {"window_s": 6.0},
    "chosen window": {"window_s": 16.0, "window": "auto"},
    "forgetting": {"forgetting": 0.9985},
    "ambient": {"ambient": True, "order": 6},
    "ambient subspace": {"ambient": True, "method": "n4sid-cva"},
    "automatic order": {"order": "auto"},
    "no blocks": {"sigma_blocks": 0, "detrend": "none"},
    "many blocks": {"sigma_blocks": 33, "window_s": 7.7},
    "foh": {"hold": "foh"},
    "innovations": {"hankel": "innovations"},
}


@pytest.mark.parametrize("kind", list(KINDS))
def test_session_is_replay(made: Path, kind: str) -> None:
    path = config(made, kind.replace(" ", "_"), **KINDS[kind])
    events, truth = replayed(path, made)
    updates, mine = fed(okid.Session.from_config(path), samples_of(made, path))
    compare(mine, truth)
    theirs = [one["modes"] for one in events]
    assert len([one for one in updates if one]) == len(theirs)
    for one, other in zip([one for one in updates if one], theirs, strict=True):
        assert len(one) == len(other)
        for mode, entry in zip(one, other, strict=True):
            assert mode.frequency_hz == pytest.approx(entry["frequency_hz"], rel=1e-6)
            assert mode.damping_ratio == pytest.approx(entry["damping_ratio"], rel=1e-5)
            assert mode.frequency_std_hz == pytest.approx(entry["frequency_std_hz"], rel=2e-4)


@pytest.mark.parametrize("memory", [{"window_s": 8.0}, {"forgetting": 0.9995}, {}, {"restart": False, "window_s": 8.0}])
def test_a_change_of_the_structure(tmp_path: Path, memory: dict[str, Any]) -> None:
    """A window and a fading memory forget what was before, a growing one tells of it, at the same update."""
    folder = rig(tmp_path, 40.0, "[[change]]\nat_s = 24.0\nsprings = [2e3, 2e3]\n")
    keys = {key: value for key, value in memory.items() if key != "restart"}
    path = config(folder, "change", restart_on_change=memory.get("restart", True), **keys)
    events, truth = replayed(path, folder)
    session = okid.Session.from_config(path)
    updates, mine = fed(session, samples_of(folder, path))
    compare(mine, truth)
    changes = [one for one in events if one["type"] == "change"]
    assert changes and session.restarts == sum(one["restarted"] for one in changes)
    assert (session.restarts > 0) == (bool(keys) and memory.get("restart", True))
    assert [len(one) > 0 for one in updates][-1]


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("p = 12", "p = 12\nwindow_s = 0.15"),
        ("p = 12", "p = 5000"),
        ("p = 12", "p = 12\nforgetting = 0.9\nwindow_s = 3.0"),
        ("p = 12", 'p = 12\nwindow = "auto"'),
        ("p = 12", "p = 12\nsigma_blocks = 4"),
        ('method = "okid-era"', 'method = "okid"'),
        ('method = "okid-era"', 'method = "n4sid-cva"\nhankel = "literal"'),
        ('role = "acceleration"', 'role = "aux"'),
        ("update_s = 1.0", "update_s = 0.001"),
        ("mkr = true", "mkr = 1"),
        ("dof = 1", "dof = 7"),
        ("[[bus]]", "[[bos]]"),
    ],
)
def test_the_same_sentence_as_okid_check(made: Path, old: str, new: str) -> None:
    path = made / "wrong.toml"
    good = config(made, "good").read_text()
    assert old in good
    path.write_text(good.replace(old, new))
    done = run_okid("check", path)
    assert done.returncode == 2
    with pytest.raises(okid.InputError) as fault:
        okid.Session.from_config(path)
    assert done.stderr == f"okid: {fault.value}\n"


def test_what_check_accepts_is_fed(made: Path) -> None:
    """Channels without a degree of freedom, and changes of single arguments."""
    path = config(made, "partly", mkr=False)
    text = path.read_text()
    head, tail = text.split("dof = 2\n")
    path.write_text((head + tail).replace("mkr = false", "mkr = true"))
    assert run_okid("check", path).returncode == 0
    session = okid.Session.from_config(path, p=14, window_s=5.0)
    session.feed(samples_of(made, path))
    result = session.identify()
    assert result.p == 14 and result.samples == 1000
    assert result.mkr is not None and result.mkr.M.shape == (1, 1)


@pytest.mark.parametrize("codes", [16, 24, 32])
@pytest.mark.parametrize("memory", [{}, {"window_s": 4.0}, {"forgetting": 0.999}])
def test_codes_and_reals(made: Path, codes: int, memory: dict[str, float]) -> None:
    """Codes, summed exactly, and the numbers they stand for, as double and as float: the same modes and ±."""
    path = config(made, "codes")
    samples = samples_of(made, path)
    samples = samples[: np.flatnonzero(np.isnan(samples).any(axis=1))[0]]
    scale, offset = np.max(np.abs(samples), axis=0) / 30000.0, np.array([0.1, -0.2, 0.3])
    whole = np.rint(samples / scale).astype(np.int16 if codes == 16 else np.int32)
    numbers = whole * scale + offset
    given: dict[str, Any] = {"fs": 200.0, "p": 12, "order": 4, "sigma_blocks": 8, **memory}
    exact = okid.Session(1, 2, codes=codes, scale=scale, offset=offset, **given)
    real, single = (okid.Session(1, 2, **given) for _ in range(2))
    for first in range(0, len(whole), 97):
        assert exact.feed(whole[first : first + 97]) == 0
        real.feed(numbers[first : first + 97])
        single.feed(numbers[first : first + 97].astype(np.float32))
    modes = exact.modes()
    assert len(modes) == 2
    for other, loose in ((real, 1e-9), (single, 1e-5)):
        for a, b in zip(modes, other.modes(), strict=True):
            assert b.frequency_hz == pytest.approx(a.frequency_hz, rel=loose)
            assert b.frequency_std_hz == pytest.approx(a.frequency_std_hz, rel=max(1e-4, 100 * loose))


def test_states(made: Path) -> None:
    """A session goes on where another stood; records merge; old states of okid.Accumulator are taken."""
    samples = samples_of(made, config(made, "states"))
    given: dict[str, Any] = {"fs": 200.0, "p": 12, "order": 4}
    whole, first, second = (okid.Session(1, 2, **given) for _ in range(3))
    whole.feed(samples)
    first.feed(samples[:1111])
    second.restore(first.to_bytes())
    second.feed(samples[1111:])
    assert second.to_bytes() == whole.to_bytes() and second.stats == whole.stats
    assert second.modes()[0].frequency_hz == whole.modes()[0].frequency_hz

    sums = okid.Accumulator(1, 2, 12)
    sums.add(samples[:2000])
    merged = okid.Session(1, 2, **given)
    merged.merge(sums.to_bytes())
    sums.reset()
    sums.add(samples[2000:])
    merged.merge(sums.to_bytes())
    assert merged.stats.samples == whole.stats.samples and merged.rows < whole.rows
    assert merged.modes()[0].frequency_hz == pytest.approx(whole.modes()[0].frequency_hz, rel=1e-4)
    with pytest.raises(okid.InputError, match="damaged"):
        merged.restore(b"OKIDACC\nxxxx")
    with pytest.raises(okid.InputError, match="12 lags"):
        okid.Session(1, 2, fs=200.0, p=13, order=4).restore(whole.to_bytes())
    with pytest.raises(okid.InputError, match="only a growing one"):
        okid.Session(1, 2, window_s=5.0, **given).merge(whole.to_bytes())


def test_blocks_of_merged_states(made: Path) -> None:
    """± from merged records: each is left out in turn, as okid.identify() leaves out blocks of a record."""
    samples = samples_of(made, config(made, "blocks"))[:2800]
    merged = okid.Session(1, 2, fs=200.0, p=12, order=4)
    for piece in range(14):
        sums = okid.Accumulator(1, 2, 12)
        sums.add(samples[max(0, 200 * piece - 12) : 200 * (piece + 1)])
        merged.merge(sums.to_bytes())
    record = okid.identify(samples[:, :1], samples[:, 1:], fs=200.0, p=12, order=4, sigma_blocks=14)
    for a, b in zip(merged.identify().modes, record.modes, strict=True):
        assert a.frequency_hz == pytest.approx(b.frequency_hz, rel=1e-3)
        assert a.frequency_std_hz is not None and b.frequency_std_hz is not None
        assert 0.3 < a.frequency_std_hz / b.frequency_std_hz < 3.0


def test_a_result_outlives_its_session(made: Path) -> None:
    samples = samples_of(made, config(made, "closed"))
    with okid.Session(1, 2, fs=200.0, p=12) as session:
        session.feed(samples)
        result = session.identify()
    assert len(result.stabilization().modes) >= 2
    with pytest.raises(okid.Error, match="closed"):
        session.feed(samples)
