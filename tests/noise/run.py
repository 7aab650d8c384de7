# SPDX-License-Identifier: MIT
"""Records of noise alone: no structure is in them, so no mode may be confident.

usage: run.py [--method M] [--records N] [--jobs N]   default: auto, 400 records of 20 kinds, 1,000 to 30,000 samples
Every other record has an input, which the outputs do not answer. Record k is always the same. A table of confident
modes by kind; of auto one is allowed (exit 1 above that), of a named method, which does not judge, as many as come.
"""

from __future__ import annotations

import argparse
import os
import sys
import time
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from typing import Any

import numpy as np
import okid
from numpy.typing import NDArray
from scipy.signal import butter, lfilter, sosfilt

Real = NDArray[np.float64]
Dice = np.random.Generator
FS, ALLOWED = 100.0, 1


def white(dice: Dice, n: int, m: int) -> Real:
    return dice.standard_normal((n, m))


def coloured(pole: float, dice: Dice, n: int, m: int) -> Real:
    """AR(1)."""
    return np.asarray(lfilter([1.0], [1.0, -pole], white(dice, n, m), axis=0))


def spectrum(exponent: float, dice: Dice, n: int, m: int) -> Real:
    """Power that goes as f^exponent."""
    f = np.fft.rfftfreq(n)[:, None]
    f[0] = f[1]
    return np.asarray(np.fft.irfft(np.fft.rfft(white(dice, n, m), axis=0) * f ** (exponent / 2), n, axis=0))


def moving_average(dice: Dice, n: int, m: int) -> Real:
    return np.asarray(lfilter(np.ones(7) / 7, [1.0], white(dice, n, m), axis=0))


def anti_alias(dice: Dice, n: int, m: int) -> Real:
    """A gentle filter well below half the rate."""
    return np.asarray(sosfilt(butter(2, 0.6, output="sos"), white(dice, n, m), axis=0))


def common(dice: Dice, n: int, m: int) -> Real:
    """One noise in all channels, as of a bad ground, and a little of their own."""
    return white(dice, n, 1) * dice.uniform(0.5, 2.0, m) + 0.1 * white(dice, n, m)


def mixed(dice: Dice, n: int, m: int) -> Real:
    return np.asarray(white(dice, n, m) @ dice.standard_normal((m, m)))


def levels(dice: Dice, n: int, m: int) -> Real:
    """Louder and softer, slowly."""
    return white(dice, n, m) * np.exp(np.sin(2 * np.pi * np.arange(n) / n * dice.uniform(1, 5)))[:, None]


def bursts(dice: Dice, n: int, m: int) -> Real:
    on = np.repeat(dice.random(n // 50 + 1) < 0.2, 50)[:n, None]
    return white(dice, n, m) * np.where(on, 1.0, 0.02)


def spikes(dice: Dice, n: int, m: int) -> Real:
    return 0.05 * white(dice, n, m) + np.where(dice.random((n, m)) < 0.002, 20.0 * white(dice, n, m), 0.0)


def drift(dice: Dice, n: int, m: int) -> Real:
    """A random walk under white noise."""
    return white(dice, n, m) + 0.05 * np.cumsum(white(dice, n, m), axis=0)


def steps(dice: Dice, n: int, m: int) -> Real:
    """Offsets that jump, as of a loose contact."""
    return white(dice, n, m) + np.cumsum(np.where(dice.random((n, m)) < 0.001, 5.0 * white(dice, n, m), 0.0), axis=0)


def clipped(dice: Dice, n: int, m: int) -> Real:
    return np.clip(white(dice, n, m), -1.0, 1.0)


def held(dice: Dice, n: int, m: int) -> Real:
    """Sampled at a third of the rate."""
    return np.repeat(white(dice, n // 3 + 1, m), 3, axis=0)[:n] + 0.01 * white(dice, n, m)


def gaps(dice: Dice, n: int, m: int) -> Real:
    out = white(dice, n, m)
    out[dice.random(n) < 0.01] = np.nan
    return out


def trend(dice: Dice, n: int, m: int) -> Real:
    """The sun on a cable."""
    return white(dice, n, m) + 20.0 * np.sin(np.pi * np.arange(n) / n)[:, None] * dice.uniform(0.5, 2.0, m)


KINDS: dict[str, Callable[[Dice, int, int], Real]] = {
    "white": white,
    "uniform": lambda dice, n, m: dice.uniform(-1.0, 1.0, (n, m)),
    "heavy tails": lambda dice, n, m: dice.standard_t(3.0, (n, m)),
    "few codes": lambda dice, n, m: np.round(1.5 * white(dice, n, m)),
    "AR(1) 0.5": partial(coloured, 0.5),
    "AR(1) 0.9": partial(coloured, 0.9),
    "AR(1) 0.99": partial(coloured, 0.99),
    "AR(1) -0.7": partial(coloured, -0.7),
    "pink": partial(spectrum, -1.0),
    "blue": partial(spectrum, 1.0),
    "moving average": moving_average,
    "anti-alias filter": anti_alias,
    "common": common,
    "mixed": mixed,
    "changing level": levels,
    "bursts": bursts,
    "spikes": spikes,
    "drift": drift,
    "steps": steps,
    "trend": trend,
}
OTHERS = {"clipped": clipped, "held": held, "gaps": gaps}  # not counted: --kind


def make(kind: str, seed: int) -> tuple[Real | None, Real]:
    """Input (of every other seed) and outputs."""
    dice = np.random.default_rng([seed, *kind.encode()])
    n, m = int(np.exp(dice.uniform(np.log(1000), np.log(30000)))), int(dice.integers(1, 5))
    y = (KINDS | OTHERS)[kind](dice, n, m)
    return (white(dice, n, 1) if seed % 2 else None), y


def judge(method: str, one: tuple[str, int]) -> tuple[str, int, int, float]:
    """Kind, seed, confident modes, processor time."""
    began = time.process_time()
    u, y = make(*one)
    more: dict[str, Any] = {"threads": 1} if method == "auto" else {}
    try:
        found = len(okid.identify(u, y, fs=FS, method=method, **more).confident_modes)
    except okid.IdentificationError:
        found = 0
    return *one, found, time.process_time() - began


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--method", default="auto")
    parser.add_argument("--records", type=int, default=400)
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1)
    parser.add_argument("--kind", action="append", choices=[*KINDS, *OTHERS])
    given = parser.parse_args()
    kinds = given.kind or list(KINDS)
    wanted = [(kinds[k % len(kinds)], k // len(kinds)) for k in range(given.records)]
    counts: dict[str, list[int]] = {kind: [] for kind in kinds}
    spent = 0.0
    with ProcessPoolExecutor(given.jobs) as pool:
        for kind, seed, found, seconds in pool.map(partial(judge, given.method), wanted):
            counts[kind].append(found)
            spent += seconds
            if found and given.method == "auto":
                print(f"{kind}, record {seed}: {found} confident", flush=True)
    for kind, found in counts.items():
        print(f"{kind:18} {len(found):4} records, {sum(map(bool, found)):4} with confident modes, {sum(found):5} modes")
    total, touched = sum(map(sum, counts.values())), sum(bool(one) for found in counts.values() for one in found)
    print(f"{given.method}: {total} confident modes in {touched} of {given.records} records of noise ({spent:.0f} s)")
    return 1 if given.method == "auto" and total > ALLOWED else 0


if __name__ == "__main__":
    sys.exit(main())
