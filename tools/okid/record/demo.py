# SPDX-License-Identifier: MIT
"""okid.demo(): a 3-storey frame on the computer, shaken, measured and identified."""

from __future__ import annotations

from typing import TYPE_CHECKING

from okid.record.identify import identify

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from okid.mechanics.structure import Structure
    from okid.result.result import Result

    Real = NDArray[np.float64]


def demo_frame() -> Structure:
    """Three storeys on elastic columns, proportionally damped: 10.96, 31.84 and 45.66 Hz."""
    from okid.mechanics.structure import Structure

    free = Structure.chain([1.0, 0.8, 1.2], [3e4, 2e4, 2.5e4])
    return Structure(free.M, 1.0 * free.M + 5e-5 * free.K, free.K)


def demo_record(
    samples: int = 20000, fs: float = 1000.0, noise_percent: float = 1.0, seed: int = 1
) -> tuple[Real, Real]:
    """White shaker force u (N, 1) on the first storey, three noisy accelerations y (N, 3) in m/s^2."""
    import numpy as np

    rng = np.random.default_rng(seed)
    force = rng.standard_normal((samples, 1))
    y = demo_frame().model(fs, [1], [1, 2, 3]).simulate(force)
    sigma = noise_percent / 100.0 * np.sqrt(np.mean(y**2, axis=0))
    return force, y + sigma * rng.standard_normal(y.shape)


def demo(verbose: bool = True) -> Result:
    """Shake the frame, identify it, print the modal table beside the truth; returns the Result."""
    force, acceleration = demo_record()
    names = [f"storey{k}" for k in (1, 2, 3)]
    result = identify(force, acceleration, fs=1000.0, method="okid-era", input_names=["shaker"], output_names=names)
    if verbose:
        print(result.table())
        truth = [f"{mode.frequency_hz:.5f} Hz {100 * mode.damping_ratio:.4f} %" for mode in demo_frame().modes()]
        print("truth: " + ", ".join(truth))
    return result
