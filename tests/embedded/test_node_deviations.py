# SPDX-License-Identifier: MIT
"""The node with 2 forces, 2 accelerations, 4 modes and their standard deviations, in QEMU, beside NumPy: the same parts
of the record left out one by one, each time with an observer and a realization of its own, from the rows.

The numbers share the definition of the parts with the node, and no code. What is measured goes where table.py reads it.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import core_feed
import numpy as np
import pytest
import systems
from qemu_node import RESET, Node, packet, samples
from test_node import RATE_HZ, Codes, Image, Real, each_in_a_process, keep_measurements, keep_within

SAMPLES, P, INPUTS, OUTPUTS, ORDER, EACH, FIRST_PART = 10000, 10, 2, 2, 8, 32, 128
RAM = 64 * 1024
PARTS = {False: 8, True: 12}  # most of them, in double and in float: CMakeLists.txt of the node
IMAGES = [Image("m7-double-O2", "mps2-an500", P, "pm"), Image("m4-float-O2", "netduinoplus2", P, "pm")]


@pytest.fixture(scope="module", params=each_in_a_process(IMAGES))
def image(request: pytest.FixtureRequest) -> Image:
    return request.param  # type: ignore[no-any-return]


@pytest.fixture(scope="module")
def node(image: Image) -> Iterator[Node]:
    with Node(image.machine, image.path) as it:
        yield it


def structure() -> systems.Structure:
    """Four masses in a chain, shaken at two, measured at the other two."""
    chain = systems.chain([1.0, 1.2, 0.9, 1.1], [2000.0, 2500.0, 1800.0, 2200.0])
    return replace(systems._finish(*chain, (0, 2)), sense_dofs=(1, 3))


def record(seed: int) -> Codes:
    return core_feed.record_codes(structure(), SAMPLES, seed)


def true_modes() -> tuple[Real, Real]:
    """At the rate that the node believes."""
    f, zeta = structure().modes()
    return f * RATE_HZ * structure().dt, zeta


def ends_of_parts(most: int) -> list[int]:
    """Rows at which the node's parts end, and the end of the record."""
    ends: list[int] = []
    length = FIRST_PART
    for rows in (n - P for n in range(EACH, SAMPLES + 1, EACH)):
        if rows >= (ends[-1] if ends else 0) + length:
            ends.append(rows)
        if len(ends) == most:
            ends, length = ends[1::2], 2 * length
    return [*ends, SAMPLES - P]


def identified(theta: Real) -> tuple[Real, Real]:
    """Frequencies and damping ratios of the observer's parameters (outputs x regressors), by ERA of 10 x 10 blocks."""
    gain, ahead = theta[:, :INPUTS], theta[:, INPUTS:].reshape(OUTPUTS, P, INPUTS + OUTPUTS).transpose(1, 0, 2)
    markov = [gain]
    for k in range(1, 2 * P + 1):
        own = ahead[k - 1, :, :INPUTS] if k <= P else np.zeros((OUTPUTS, INPUTS))
        markov.append(own + sum(ahead[i - 1, :, INPUTS:] @ markov[k - i] for i in range(1, min(k, P) + 1)))
    first, second = (np.block([[markov[s + i + j] for j in range(P)] for i in range(P)]) for s in (1, 2))
    left, values, right = np.linalg.svd(first)
    root = np.sqrt(values[:ORDER])
    poles = np.linalg.eigvals((left[:, :ORDER] / root).T @ second @ (right[:ORDER].T / root))
    s = np.log(poles[poles.imag > 0]) * RATE_HZ
    at = np.argsort(np.abs(s))
    return np.abs(s)[at] / (2 * np.pi), (-s.real / np.abs(s))[at]


def left_out(codes: Codes, ends: list[int]) -> tuple[Real, Real, Real, Real]:
    """Frequencies, damping ratios and the standard deviations of both, by full identifications without each part."""
    v = codes.astype(float)
    rows = np.hstack([v[P:, :INPUTS], *(v[P - h : SAMPLES - h] for h in range(1, P + 1))])
    y = v[P:, INPUTS:]
    rows, y = rows - rows.mean(axis=0), y - y.mean(axis=0)
    parts = list(zip([0, *ends[:-1]], ends, strict=True))
    grams = [(rows[a:b].T @ rows[a:b], rows[a:b].T @ y[a:b], b - a) for a, b in parts if b > a]
    square, cross = sum(g for g, _, _ in grams), sum(c for _, c, _ in grams)
    f, zeta = identified(np.linalg.solve(square, cross).T)
    without = [identified(np.linalg.solve(square - g, cross - c).T) for g, c, _ in grams]
    share = np.array([count for _, _, count in grams]) / ends[-1]
    out = []
    for k in (0, 1):
        values = np.array([each[k] for each in without])
        centre = (1 - share) @ values / (1 - share).sum()
        out.append(np.sqrt((1 - share) ** 2 @ (values - centre) ** 2 / (share @ (1 - share))))
    return f, zeta, out[0], out[1]


def test_deviations_are_those_of_identifications_without_each_part(node: Node, image: Image) -> None:
    ends = ends_of_parts(PARTS[image.is_float])
    assert PARTS[image.is_float] / 2 < len(ends) <= PARTS[image.is_float] + 1
    for seed in (1, 2):
        codes = record(seed)
        node.send(packet(bytes([RESET])), *samples(codes, 0, EACH))
        modes = node.modes(OUTPUTS)
        assert (modes.status, modes.stage) == (0, 6)
        f, zeta, f_std, zeta_std = left_out(codes, ends)
        if seed == 1:
            keep_measurements(node, image, modes, f, zeta)
        np.testing.assert_allclose(modes.frequency_hz, f, rtol=1e-5 if image.is_float else 1e-7)
        np.testing.assert_allclose(modes.damping_ratio, zeta, rtol=2e-3 if image.is_float else 1e-5)
        assert modes.frequency_std_hz is not None and modes.damping_ratio_std is not None
        np.testing.assert_allclose(modes.frequency_std_hz, f_std, rtol=0.1)
        np.testing.assert_allclose(modes.damping_ratio_std, zeta_std, rtol=0.1)
        true_f, true_zeta = true_modes()
        assert np.all(np.abs(modes.frequency_hz - true_f) < 10 * modes.frequency_std_hz)  # few parts: a wide t
        assert np.all(np.abs(modes.damping_ratio - true_zeta) < 10 * modes.damping_ratio_std)
    keep_within(node, image, RAM)


@pytest.mark.parametrize("most", PARTS.values())
def test_errors_over_deviations_scatter_as_t_does(most: int) -> None:
    """With so few parts a deviation is uncertain itself: of 60 records."""
    ends, (true_f, true_zeta) = ends_of_parts(most), true_modes()
    errors = []
    for seed in range(100, 160):
        f, zeta, f_std, zeta_std = left_out(record(seed), ends)
        errors.append([(f - true_f) / f_std, (zeta - true_zeta) / zeta_std])
    rms, freedom = np.sqrt(np.mean(np.square(errors))), len(ends) - 1
    print(f"{len(ends)} parts: errors are {rms:.2f} deviations (rms), t has {np.sqrt(freedom / (freedom - 2)):.2f}")
    assert rms == pytest.approx(np.sqrt(freedom / (freedom - 2)), rel=0.15)


def test_parts_begin_again_behind_a_gap(node: Node, image: Image) -> None:
    codes = record(3)
    node.send(packet(bytes([RESET])), *samples(codes, 0, EACH))
    whole = node.modes(OUTPUTS)
    node.send(packet(bytes([RESET])), *samples(record(4)[:4000], 0, EACH), *samples(codes, 5000, EACH))
    behind = node.modes(OUTPUTS)
    for name in ("frequency_hz", "damping_ratio", "frequency_std_hz", "damping_ratio_std"):
        np.testing.assert_array_equal(getattr(behind, name), getattr(whole, name), err_msg=name)
