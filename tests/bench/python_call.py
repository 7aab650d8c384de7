# SPDX-License-Identifier: MIT
"""What a call of Accumulator.add() costs in Python beside the work in C. usage: python_call.py [BENCH.json to add to]

Of a single sample nearly all is the call: the kernel only keeps it for its next batch. Its share is of a block of
4,096 samples of W1.
"""

from __future__ import annotations

import timeit

import numpy as np
import okid
from bench_file import keep

LAGS, BLOCK = 40, 4096


def microseconds(accumulator: okid.Accumulator, samples: np.ndarray) -> float:
    """Best of many short runs: others share the machine."""
    calls = 2 if len(samples) > 1 else 1000
    return 1e6 * min(timeit.repeat(lambda: accumulator.add(samples), number=calls, repeat=300)) / calls


def main() -> None:
    rng = np.random.default_rng(1)
    ratios: dict[str, float] = {}
    for name, kind, codes in (("i16", np.int16, 16), ("f64", np.float64, 0)):
        with okid.Accumulator(1, 3, LAGS, codes=codes, bulk=False) as accumulator:
            samples = (1000.0 * rng.standard_normal((BLOCK, 4))).astype(kind)
            call, block = microseconds(accumulator, samples[:1]), microseconds(accumulator, samples)
        ratios[f"python_call_us_{name}"] = call
        ratios[f"python_share_{name}"] = call / (block - call)
        print(f"Accumulator.add of {name}: {call:.2f} us a call, {100 * call / (block - call):.1f} % of the C time "
              f"of {BLOCK} samples (W1, p {LAGS})")  # fmt: skip
    keep(ratios)


if __name__ == "__main__":
    main()
