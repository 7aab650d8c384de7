# SPDX-License-Identifier: MIT
"""docs/theory.md: every formula becomes MathML; three identities hold for numbers that no code of okid made."""

from __future__ import annotations

import importlib.util
import re

import numpy as np
import pytest
from page_runner import ROOT

PAGE = (ROOT / "docs" / "theory.md").read_text()


def test_every_formula_is_drawn() -> None:
    spec = importlib.util.spec_from_file_location("docs_math", ROOT / "tools" / "docs_math.py")
    assert spec and spec.loader
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    drawn = module.on_page_markdown(PAGE, None, None, None)
    assert drawn.count('display="block"') == len(re.findall(r"(?m)^```math$", PAGE)) >= 12
    assert "$`" not in drawn and "```math" not in drawn
    with pytest.raises(ValueError, match="nothingofthekind"):
        module.on_page_markdown("```math\n\\nothingofthekind x\n```\n", None, None, None)


def test_matrices_from_complex_modes() -> None:
    """Section 8, for a frame with general damping; the modes are those of NumPy's companion matrix."""
    m, k = np.diag([2.0, 1.5, 1.0]), np.array([[5.0, -2, 0], [-2, 4, -1], [0, -1, 3]])
    r = np.array([[0.3, -0.1, 0], [-0.1, 0.2, 0.05], [0, 0.05, 0.4]])
    zero, one = np.zeros((3, 3)), np.eye(3)
    a = np.block([[zero, one], [-np.linalg.solve(m, k), -np.linalg.solve(m, r)]])
    lam, vectors = np.linalg.eig(a)
    left = np.linalg.inv(vectors) @ np.vstack([zero, np.linalg.inv(m)])
    phi = vectors[:3]
    scale = np.array([left[i, 0] / phi[0, i] for i in range(6)])  # residue at DOF 1: the co-located pair
    phi = phi * np.sqrt(scale)
    inverse = np.linalg.inv((phi * lam) @ phi.T)
    assert np.allclose(phi @ phi.T, 0, atol=1e-12) and np.allclose(inverse, m)
    assert np.allclose(-np.linalg.inv((phi / lam) @ phi.T), k)
    assert np.allclose(-inverse @ (phi * lam**2) @ phi.T @ inverse, r)


def test_observer_and_impulse_response() -> None:
    """Section 2 and 4 for a random model: the predictor's coefficients give the impulse response."""
    rng = np.random.default_rng(1)
    a, b, c, d = rng.normal(size=(4, 4)) / 4, rng.normal(size=(4, 1)), rng.normal(size=(2, 4)), rng.normal(size=(2, 1))
    gain = rng.normal(size=(4, 2)) / 10
    observer = a - gain @ c
    powers = [np.linalg.matrix_power(observer, k) for k in range(12)]
    u_part, y_part = [c @ q @ (b - gain @ d) for q in powers], [c @ q @ gain for q in powers]
    found = [d]
    for k in range(1, 12):
        found.append(u_part[k - 1] + sum(y_part[i - 1] @ found[k - i] for i in range(1, k + 1)))
    assert all(np.allclose(found[k], c @ np.linalg.matrix_power(a, k - 1) @ b) for k in range(1, 12))


def test_shift_structure() -> None:
    """Section 3, element by element."""
    v = np.random.default_rng(2).normal(size=(40, 2))
    p, rows = 3, range(3, 40)

    def gram(i: int, j: int) -> np.ndarray:
        return sum(np.outer(v[n - i], v[n - j]) for n in rows)

    for i in range(p):
        for j in range(p):
            ends = np.outer(v[2 - i], v[2 - j]) - np.outer(v[39 - i], v[39 - j])
            assert np.allclose(gram(i + 1, j + 1), gram(i, j) + ends)
