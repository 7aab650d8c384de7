# SPDX-License-Identifier: MIT
"""A node on a clock of its own beside counted ones: modes, M and K as if all had sampled together."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from program import okid
from scipy.interpolate import make_interp_spline
from scipy.signal import lfilter, ss2tf
from systems import Structure, chain, rayleigh

RATE = 500.0
OVER = 8  # the structure is simulated so many times finer than it is sampled
CONFIG = """
[acquisition]
rate_hz = {rate}
decimate = {decimate}
[[bus]]
name = "can0"
interface = "vcan0"
[[bus]]
name = "can1"
interface = "vcan1"
{clock}
[[channel]]
name = "force"
role = "force"
dof = 1
bus = "can0"
can_id = 0x100
start_bit = 32
length = 32
signed = true
scale = 1e-6
sequence = {{ start_bit = 0, length = 32 }}
[[channel]]
name = "acc1"
role = "acceleration"
dof = 1
bus = "can0"
can_id = 0x101
start_bit = 32
length = 32
signed = true
scale = 1e-6
sequence = {{ start_bit = 0, length = 32 }}
[[channel]]
name = "acc2"
role = "acceleration"
dof = 2
bus = "can1"
can_id = 0x102
start_bit = 32
length = 32
signed = true
scale = 1e-6
sequence = {{ start_bit = 0, length = 32 }}
[identification]
p = 40
order = 4
hold = "{hold}"
update_s = 5.0
mkr = true
"""


def structure(dt: float) -> Structure:
    M, K = chain([2.0, 1.5], [8e4, 5e4])
    R, _ = rayleigh(M, K, 0.02)
    return Structure(M, R, K, force_dofs=(0,), sense_dofs=(0, 1), dt=dt)


@pytest.fixture(scope="module")
def motion() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Times, force and accelerations of 30 s on a fine grid; the force has no content above 0.3 of the sample rate."""
    count = int(30 * RATE * OVER)
    random = np.random.default_rng(4)
    spectrum = np.fft.rfft(random.standard_normal(count))
    spectrum[np.fft.rfftfreq(count, 1 / (RATE * OVER)) > 0.3 * RATE] = 0
    force = 40 * np.fft.irfft(spectrum, count)
    numerators, denominator = ss2tf(*structure(1 / (RATE * OVER)).discrete())
    y = np.column_stack([lfilter(numerator, denominator, force) for numerator in numerators])
    return np.arange(count) / (RATE * OVER), force, y


def write_log(path: Path, motion: tuple[np.ndarray, np.ndarray, np.ndarray], ppm: float, rate: float = RATE) -> None:
    """can1 samples by a clock that runs fast by ppm and began 0.4 samples later; frames come up to some 0.1 ms late."""
    t, force, y = motion
    random = np.random.default_rng(9)
    frames = []
    for channel, (bus, values) in enumerate([(0, force), (0, y[:, 0]), (1, y[:, 1])]):
        own = rate * (1 + 1e-6 * ppm) if bus else rate
        at = (np.arange(int(29 * rate)) + (0.4 if bus else 0)) / own
        clean = make_interp_spline(t, values, k=5)(at)
        codes = np.rint((clean + 0.005 * np.std(clean) * random.standard_normal(len(at))) * 1e6).astype(np.int64)
        stamps = at + random.exponential(5e-5, len(at)) + 2e-5 * channel
        frames += [(s, bus, 0x100 + channel, n, c) for n, (s, c) in enumerate(zip(stamps, codes, strict=True))]
    with path.open("w") as out:
        for stamp, bus, can_id, number, code in sorted(frames):
            data = number.to_bytes(4, "little") + int(code).to_bytes(4, "little", signed=True)
            out.write(f"({1700000000 + stamp:.6f}) vcan{bus} {can_id:03X}#{data.hex()}\n")


def identify(folder: Path, clock: str, hold: str = "foh", decimate: int = 1) -> tuple[dict, list[dict]]:
    (folder / "a.toml").write_text(CONFIG.format(clock=clock, hold=hold, rate=RATE, decimate=decimate))
    done = okid("replay", folder / "a.log", "-c", folder / "a.toml", "--events", folder / "e", "--json", folder / "r")
    assert done.returncode == 0, done.stderr
    assert "scales with it" not in done.stderr  # the rate by the stamps is the rate, wherever the grid begins
    return json.loads((folder / "r").read_text()), [json.loads(x) for x in (folder / "e").read_text().splitlines()]


def worst(result: dict) -> tuple[float, float, float]:
    """Relative errors of frequencies, of M and of K."""
    one = structure(1 / RATE)
    f, _ = one.modes()
    found = np.array([mode["frequency_hz"] for mode in result["modes"]])
    if len(found) != 2 or "mkr" not in result:
        return np.inf, np.inf, np.inf
    M, K = np.array(result["mkr"]["M"]), np.array(result["mkr"]["K"])
    return (
        float(np.max(np.abs(found / f - 1))),
        float(np.linalg.norm(M - one.M) / np.linalg.norm(one.M)),
        float(np.linalg.norm(K - one.K) / np.linalg.norm(one.K)),
    )


def test_a_free_node_is_as_good_as_a_counted_one(tmp_path: Path, motion) -> None:
    write_log(tmp_path / "a.log", motion, 0.0)
    together = worst(identify(tmp_path, 'clock = "free"')[0])
    write_log(tmp_path / "a.log", motion, 150.0)
    result, events = identify(tmp_path, 'clock = "free"')
    apart = worst(result)
    ignored = worst(identify(tmp_path, "")[0])
    print(f"errors of f, M, K: same rate {together}, 150 ppm {apart}, clock not told {ignored}")
    assert apart[0] < 2e-3 and apart[1] < 0.03 and apart[2] < 0.03
    assert ignored[2] > 3 * apart[2]
    last = [event for event in events if event["type"] == "stats"][-1]
    assert last["rate_hz_by_stamps"] == pytest.approx(RATE, rel=1e-4)
    stats = last["channel"]
    assert stats["acc2"]["rate_ppm"] == pytest.approx(-150, abs=1)
    assert stats["acc2"]["skew_std_us"] < 5 and abs(stats["acc2"]["skew_us"]) < 5
    assert "skew_us" not in stats["acc1"]
    remark = next(w["text"] for w in result["warnings"] if w["code"] == "resampled")
    assert "acc2 has a clock of its own (-150.0 ppm)" in remark and "good up to 225 Hz" in remark


def test_played_again_it_is_the_same(tmp_path: Path, motion) -> None:
    write_log(tmp_path / "a.log", motion, -80.0)
    first = identify(tmp_path, 'clock = "free"')
    assert identify(tmp_path, 'clock = "free"') == first


def test_two_rates(tmp_path: Path, motion) -> None:
    """The free node sends 1250 samples a second."""
    t, force, y = motion
    write_log(tmp_path / "a.log", (t, force, y), 0.0)
    fast = tmp_path / "fast.log"
    write_log(fast, motion, 90.0, 1250.0)
    slow = [x for x in (tmp_path / "a.log").read_text().splitlines() if " vcan0 " in x]
    quick = [x for x in fast.read_text().splitlines() if " vcan1 " in x]
    (tmp_path / "a.log").write_text("\n".join(sorted(slow + quick)) + "\n")
    errors = worst(identify(tmp_path, 'clock = "free"\nrate_hz = 1250.0')[0])
    assert errors[0] < 2e-3 and errors[1] < 0.03 and errors[2] < 0.03


def test_decimation(tmp_path: Path, motion) -> None:
    write_log(tmp_path / "a.log", motion, 0.0, 2000.0)
    result, _ = identify(tmp_path, "", decimate=4)
    assert result["fs_hz"] == RATE
    errors = worst(result)
    assert errors[0] < 2e-3 and errors[1] < 0.03 and errors[2] < 0.03
    assert any(w["code"] == "decimated" for w in result["warnings"])


def test_a_long_pause_is_no_work(tmp_path: Path, motion) -> None:
    """An hour without a frame: one update behind it, and every missing sample counted."""
    write_log(tmp_path / "a.log", motion, 0.0, 2000.0)
    lines = (tmp_path / "a.log").read_text().splitlines()
    hour = [f"({float(line[1:18]) + 3600:.6f}) {line[20:]}" for line in lines]
    (tmp_path / "a.log").write_text("\n".join(lines + hour) + "\n")
    result, events = identify(tmp_path, "", decimate=4)
    assert result["samples"] > 3500 * RATE
    assert len([event for event in events if event["type"] == "modes"]) < 200
    stats = [event for event in events if event["type"] == "stats"][-1]
    assert all(3560 * RATE < channel["missing"] < 3580 * RATE for channel in stats["channel"].values())


@pytest.mark.parametrize(
    ("clock", "expected"),
    [
        ("rate_hz = 1000.0", 'rate_hz goes with clock = "free"'),
        ('clock = "own"', "expected one of"),
        ('clock = "free"\nrate_hz = 1.0', "expected 7.8125 to 32000 Hz"),
    ],
)
def test_what_a_config_cannot_ask_for(tmp_path: Path, clock: str, expected: str) -> None:
    (tmp_path / "a.toml").write_text(CONFIG.format(clock=clock, hold="zoh", rate=RATE, decimate=1))
    done = okid("check", tmp_path / "a.toml")
    assert done.returncode == 2 and expected in done.stderr, done.stderr
