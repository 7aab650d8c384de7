# SPDX-License-Identifier: MIT
"""Modal mass, stiffness and damping of a result with a drive point: a sensor where the force acts."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from okid._errors import InputError
from okid.result.shape_places import force_numbers, known_numbers

Real = NDArray[np.float64]
Complex = NDArray[np.complex128]
_POWERS = {"acceleration": 2, "velocity": 1, "displacement": 0}


class ModalMass(NamedTuple):
    """Of the shape as the result has it (largest entry 1), when forces are in N and responses in SI: mass_kg,
    stiffness_n_m = mass omega^2, damping_n_s_m = 2 zeta omega mass; phase_deg: how far the residue of the drive point
    is from that of a real mode (0), beyond 20 the mass is doubtful. shape / sqrt(mass_kg) is mass-normalised."""

    mass_kg: float
    stiffness_n_m: float
    damping_n_s_m: float
    phase_deg: float


def drive_points(raw: Mapping[str, Any]) -> list[tuple[int, int, int]]:
    """(input, output, sign) of each pair of an okid.result/1 at one degree of freedom; sign -1: opposite directions."""
    outputs = known_numbers(raw, "output_dofs", "outputs")
    out = []
    for k, force in enumerate(force_numbers(raw)):
        for o, place in enumerate(outputs):
            if force is not None and place is not None and abs(force) == abs(place):
                out.append((k, o, 1 if force * place > 0 else -1))
    return out


def modal_masses(raw: Mapping[str, Any], sensing: str | Sequence[str] = "acceleration") -> list[ModalMass | None]:
    """One for each mode of an okid.result/1 that has a drive point; None where the model has no such pole or the force
    does not reach the mode. [] without a drive point. sensing: what the outputs measure, one word or one for each;
    InputError for another word or number of them.

    From the residues of the model: r = Q psi_y psi_u with Q = 1 / (2 i omega_d m) of a real mode; several drive points
    count by the square of their entries. Of a roving hammer the masses are those that the result holds.
    """
    modes = raw["modes"]
    if any(mode.get("modal_mass") is not None for mode in modes):
        return [_known(mode) for mode in modes]
    pairs, model = drive_points(raw), raw.get("model") or {}
    if not pairs or raw.get("shape_dofs") or not model.get("A"):
        return []
    a, b, c = (np.array(model[key], dtype=np.float64) for key in "ABC")
    mu, v = np.linalg.eig(a)
    left = np.linalg.solve(v, b.astype(np.complex128))
    fs, seen = float(raw["fs_hz"]), c @ v
    pole = np.log(mu.astype(np.complex128)) * fs
    kinds = [sensing] * len(c) if isinstance(sensing, str) else list(sensing)
    if len(kinds) != len(c) or not set(kinds) <= set(_POWERS):
        raise InputError(f"sensing is {sensing!r:.60}, expected {', '.join(_POWERS)}, or one of them for each output")
    powers = np.array([_POWERS[one] for one in kinds])
    out: list[ModalMass | None] = []
    for mode in modes:
        omega = 2.0 * np.pi * float(mode["frequency_hz"])
        zeta = float(mode["damping_ratio"])
        wanted = omega * complex(-zeta, np.sqrt(max(1.0 - zeta**2, 0.0)))
        k = int(np.argmin(np.abs(pole - wanted)))
        if abs(pole[k] - wanted) > 1e-3 * omega:
            out.append(None)
            continue
        gain = _gain(str(raw.get("hold", "zoh")), mu[k], pole[k], fs)
        residue = np.outer(seen[:, k], left[k]) * gain / pole[k] ** powers[:, None]
        shape = np.array(mode["shape_re"], dtype=np.float64) + 1j * np.array(mode["shape_im"], dtype=np.float64)
        top = sum(np.conj(shape[o] ** 2) * sign * residue[o, i] for i, o, sign in pairs)
        under = sum(abs(shape[o]) ** 4 for _, o, _ in pairs)
        ratio = top / under if under > 0.0 else 0.0
        if not np.isfinite(ratio) or abs(ratio) == 0.0:
            out.append(None)
            continue
        mass = 1.0 / (2j * pole[k].imag * ratio)
        out.append(_of(float(mass.real), omega, zeta, float(np.degrees(np.angle(mass)))))
    return out


def _gain(hold: str, mu: complex, pole: complex, fs: float) -> complex:
    """Residue of the continuous response over that of the discrete one, by what held the force between the samples."""
    if hold == "zoh":
        return pole / (mu - 1.0)
    if hold == "foh":
        return pole**2 / (fs * (mu - 1.0) ** 2)
    return fs / mu  # band-limited: the discrete response is the continuous one


def _of(mass: float, omega: float, zeta: float, phase: float) -> ModalMass:
    return ModalMass(mass, mass * omega**2, 2.0 * zeta * omega * mass, phase)


def _known(mode: Mapping[str, Any]) -> ModalMass | None:
    mass = mode.get("modal_mass")
    if mass is None:
        return None
    return _of(float(mass), 2.0 * np.pi * float(mode["frequency_hz"]), float(mode["damping_ratio"]), 0.0)
