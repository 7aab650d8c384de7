# SPDX-License-Identifier: MIT
"""Modal mass, stiffness and damping of a result with a drive point: a sensor where the force acts."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from okid.result.parts import known


class ModalMass(NamedTuple):
    """Of the shape whose largest displacement is 1: mass_kg, stiffness_n_m = mass omega^2, damping_n_s_m = 2 zeta omega
    mass, each with one standard deviation, None = not known; phase_deg: how far the residue of the drive point is from
    that of a real mode (0), beyond 20 the mass is doubtful. shape / sqrt(mass_kg) is mass-normalised."""

    mass_kg: float
    stiffness_n_m: float
    damping_n_s_m: float
    phase_deg: float = 0.0
    mass_std: float | None = None
    stiffness_std: float | None = None
    damping_std: float | None = None


def modal_masses(raw: Mapping[str, Any]) -> list[ModalMass | None]:
    """One for each mode of an okid.result/1, None where it has none; [] where no mode has one."""
    found = [_of(mode) for mode in raw["modes"]]
    return found if any(one is not None for one in found) else []


def _of(mode: Mapping[str, Any]) -> ModalMass | None:
    mass, deviation = known(mode.get("modal_mass")), known(mode.get("modal_mass_std"))
    if mass is None:
        return None
    if "modal_stiffness" in mode:
        return ModalMass(
            mass, float(mode["modal_stiffness"]), float(mode["modal_damping"]), float(mode["modal_mass_phase_deg"]),
            deviation, known(mode["modal_stiffness_std"]), known(mode["modal_damping_std"]),
        )  # fmt: skip
    omega, zeta = 2.0 * np.pi * float(mode["frequency_hz"]), float(mode["damping_ratio"])  # of a roving hammer
    return ModalMass(mass, mass * omega**2, 2.0 * zeta * omega * mass, mass_std=deviation)
