# SPDX-License-Identifier: MIT
"""Modal masses at drive points against psi^T M psi of the frame, whose samples SciPy makes, and their deviations."""

from __future__ import annotations

from typing import Any

import numpy as np
import okid
import pytest
import scipy.linalg
from okid.mechanics.modal_mass import ModalMass, modal_masses
from okid.record.demo import demo_frame, demo_record
from scipy.signal import cont2discrete, dlsim

FS = 1000.0


def truth() -> tuple[Any, Any]:
    """Natural frequencies in Hz and modal masses of the shapes whose largest entry is 1."""
    frame = demo_frame()
    squares, shapes = scipy.linalg.eigh(frame.K, frame.M)
    shapes = shapes / np.max(np.abs(shapes), axis=0)
    return np.sqrt(squares) / (2.0 * np.pi), np.diag(shapes.T @ frame.M @ shapes)


def exact(hold: str, sensing: str, force: int, dofs: list[int], samples: int = 4000) -> tuple[Any, Any]:
    """A record of the frame without noise; -2: the channel at 2 counts the other way."""
    frame = demo_frame()
    m, k, r = (np.asarray(one, dtype=float) for one in (frame.M, frame.K, frame.R))
    flexible = np.linalg.inv(m)
    a = np.block([[np.zeros((3, 3)), np.eye(3)], [-flexible @ k, -flexible @ r]])
    b = np.vstack([np.zeros((3, 1)), flexible[:, [abs(force) - 1]]]) * np.sign(force)
    rows = {"displacement": np.eye(6)[:3], "velocity": np.eye(6)[3:], "acceleration": a[3:]}[sensing]
    d = b[3:] if sensing == "acceleration" else np.zeros((3, 1))
    u = np.random.default_rng(7).standard_normal((samples, 1))
    y = dlsim((*cont2discrete((a, b, rows, d), 1.0 / FS, hold)[:4], 1.0 / FS), u)[1]
    return u, np.column_stack([np.sign(one) * y[:, abs(one) - 1] for one in dofs])


@pytest.mark.parametrize("hold", ["zoh", "foh"])
@pytest.mark.parametrize("sensing", ["acceleration", "velocity", "displacement"])
@pytest.mark.parametrize(("force", "dofs"), [(1, [1, 2, 3]), (-2, [3, 2, 1]), (3, [-3, 1, 2])])
def test_masses_without_noise(hold: str, sensing: str, force: int, dofs: list[int]) -> None:
    """Whatever held the force, whatever is sensed, whichever way the sensor faces."""
    u, y = exact(hold, sensing, force, dofs)
    named = {"sensing": sensing, "hold": hold, "input_dofs": [force], "output_dofs": dofs}
    found = modal_masses(okid.identify(u, y, fs=FS, method="n4sid-moesp", order=6, sigma="none", **named).to_dict())
    hz, masses = truth()
    assert len(found) == 3
    for one, f, mass in zip(found, hz, masses, strict=True):
        assert one is not None and abs(one.phase_deg) < 2.0 and one.mass_std is None
        assert one.mass_kg == pytest.approx(mass, rel=2e-3)
        assert one.stiffness_n_m == pytest.approx(mass * (2 * np.pi * f) ** 2, rel=4e-3)


@pytest.mark.parametrize("method", ["okid-era", "n4sid-cva", "auto"])
def test_deviations_hold_the_truth(method: str) -> None:
    """Of 12 records with 2 % noise: errors are as large as their deviations, of the default a little smaller."""
    masses, pulls = truth()[1], []
    for seed in range(12):
        u, y = demo_record(6000, seed=seed, noise_percent=2.0)
        result = okid.identify(u, y, fs=FS, method=method, input_dofs=[1], output_dofs=[1, 2, 3])
        found = [one for one in modal_masses(result.to_dict()) if one is not None]
        assert len(found) == 3
        for one, mass in zip(found, masses, strict=True):
            assert one.mass_std is not None and 0 < one.mass_std < 0.2 * mass
            assert one.stiffness_std is not None and one.damping_std is not None
            pulls.append((one.mass_kg - mass) / one.mass_std)
    assert 0.5 < np.sqrt(np.mean(np.square(pulls))) < 1.5, pulls


def test_units_are_converted() -> None:
    u, y = demo_record(6000)
    named = {"fs": FS, "method": "n4sid-moesp", "order": 6, "input_dofs": [1], "output_dofs": [1, 2, 3]}
    si = modal_masses(okid.identify(u, y, **named).to_dict())
    other = modal_masses(okid.identify(u / 1000.0, y / 9.80665, units=["kN", "g", "g", "g"], **named).to_dict())
    for one, same in zip(si, other, strict=True):
        assert one is not None and same is not None
        assert same == pytest.approx(one, rel=1e-6)


def test_results_without_stiffness_get_it_from_their_mass() -> None:
    roving = {"modes": [{"modal_mass": 2.0, "modal_mass_std": 0.1, "frequency_hz": 10.0, "damping_ratio": 0.01},
                        {"modal_mass": None, "frequency_hz": 20.0, "damping_ratio": 0.01}]}  # fmt: skip
    first, second = modal_masses(roving)
    expected = ModalMass(2.0, 2.0 * (20.0 * np.pi) ** 2, 0.02 * 2.0 * 20.0 * np.pi, mass_std=0.1)
    assert first == pytest.approx(expected) and second is None
    assert modal_masses({"modes": roving["modes"][1:]}) == []
