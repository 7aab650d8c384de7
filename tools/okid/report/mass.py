# SPDX-License-Identifier: MIT
"""The report's section on mass, stiffness and damping: matrices with units, checks in words, damping beside damping."""

from __future__ import annotations

from typing import Any

import numpy as np

from okid._errors import InputError
from okid.report import page
from okid.report.material import Material
from okid.result import figures

MOST_SHOWN = 12  # columns that fit on the page


def _spread(title: str, values: Any, size: int) -> list[list[str]] | None:
    """The standard deviations of a matrix, or None."""
    if values is None:
        return None
    if len(values) != size or any(len(row) != size for row in values):
        raise InputError(f"not a complete okid.result/1: the deviations of {title} do not fit the matrix")
    return [["–" if x is None else f"±{float(x):.2g}" for x in row] for row in values]


def _matrix(title: str, values: Any, deviations: Any = None) -> str:
    """A heading and the numbers; rows and columns are the degrees of freedom."""
    rows = np.array(values, dtype=np.float64)
    if rows.ndim != 2 or rows.shape[0] != rows.shape[1]:
        raise InputError(f"not a complete okid.result/1: {title} has shape {rows.shape}, expected a square matrix")
    if rows.size and bool(np.isnan(rows).all()):
        return f"{page.heading(title)}\n{page.note('Not determined: see the warnings.')}"
    largest = float(np.max(np.abs(rows), initial=0.0))
    digits = 0 if largest <= 0.0 else int(np.clip(5 - np.floor(np.log10(largest)), 0, 10))
    style = f".{digits}f" if 1e-6 <= largest < 1e8 else ".4e"
    head = ["dof", *(str(k + 1) for k in range(len(rows)))]
    body = [[str(k), *(f"{x:{style}}" for x in row)] for k, row in enumerate(rows.tolist(), 1)]
    spread = _spread(title, deviations, len(rows))
    if spread is not None:
        for row, own in zip(body, spread, strict=True):
            row[1:] = [f"{x} {s}" for x, s in zip(row[1:], own, strict=True)]
    return f"{page.heading(title)}\n{page.table(head, body)}"


def _value(value: object, digits: str = ".3g") -> str:
    if value is None:
        return "–"
    if isinstance(value, bool):
        return "yes" if value else "no"
    return format(value, digits) if isinstance(value, float) else str(value)


def _with_deviation(pdc: dict[str, Any], name: str) -> str:
    std = pdc.get(f"{name}_std")
    return f"{float(pdc[name]):.5g}" + ("" if std is None else f" ±{float(std):.2g}")


def _checks(checks: dict[str, Any]) -> str:
    used = ", ".join(str(k) for k in checks.get("modes_used", []))
    margin = checks.get("selection_margin")
    chosen = f"{used} of {_value(checks.get('admissible_modes'))} admissible"
    chosen += "" if margin is None else f"; the weakest is {margin:.3g} times stronger than the best left out"
    where = checks.get("feedthrough_output")
    return page.facts(
        [
            ("M positive definite", _value(checks.get("m_positive_definite"))),
            ("K positive definite", _value(checks.get("k_positive_definite"))),
            ("R positive definite", _value(checks.get("r_positive_definite"))),
            ("Residual of W Wᵀ = 0", f"{_value(checks.get('ww_residual'))} (doubtful above 0.03)"),
            (
                "Misfit of D to M",
                f"{_value(checks.get('feedthrough_misfit'))}{'' if where is None else f' at {where}'}"
                " (doubtful above 0.1)",
            ),
            ("D over M⁻¹ at the pairs", f"{_value(checks.get('feedthrough_gain'), '.4f')} (1 is expected)"),
            ("Modes used", chosen),
            ("Co-located pairs", _value(checks.get("collocated_pairs"))),
            ("Condition of the eigenvectors", _value(checks.get("eigenvector_condition"))),
        ]
    )


def _damping_picture(m: Material, mkr: dict[str, Any], pdc: dict[str, Any]) -> str:
    """Diagonals of the three damping matrices side by side."""
    parts = [("R", mkr["R"]), ("of normal modes", mkr["R_normal_modes"]), ("proportional", pdc["R"])]
    drawing = figures.figure(9.6, 2.8)
    ax = drawing.add_subplot()
    figures.draw_diagonals(ax, [(label, np.diag(np.array(values, dtype=np.float64))) for label, values in parts])
    ax.set_xlabel("degree of freedom")
    ax.set_ylabel("diagonal of R [N s/m]")
    return m.pictures.inline(drawing, "diagonals of the three damping matrices")


def mass_section(m: Material) -> list[page.Section]:
    """The section of an okid.result/1 with "mkr" and "pdc"; nothing when it has none."""
    mkr, pdc = m.result.raw.get("mkr"), m.result.raw.get("pdc")
    if mkr is None or pdc is None:
        return []
    try:
        parts = [page.heading("Checks: read them before the matrices"), _checks(mkr["checks"])]
        if len(mkr["M"]) <= MOST_SHOWN:
            alpha, beta = (_with_deviation(pdc, name) for name in ("alpha", "beta"))
            formula = f"R = α M + β K, α = {alpha} 1/s, β = {beta} s"
            parts.append(page.beside(
                _matrix("M [kg]", mkr["M"], mkr.get("M_std")),
                _matrix("K [N/m]", mkr["K"], mkr.get("K_std")),
                _matrix("R [N s/m]", mkr["R"], mkr.get("R_std")),
                _matrix("R [N s/m] of normal modes", mkr["R_normal_modes"], mkr.get("R_normal_modes_std")),
                _matrix(f"R [N s/m] proportional: {formula}", pdc["R"]),
            ))  # fmt: skip
        else:
            parts.append(page.absent(f"More than {MOST_SHOWN} columns: the matrices are in the result file."))
        parts.append(_damping_picture(m, mkr, pdc))
    except (KeyError, TypeError, ValueError, ArithmeticError) as fault:
        if isinstance(fault, InputError):
            raise
        raise InputError(f"not a complete okid.result/1: mkr, pdc: {type(fault).__name__}: {fault}") from None
    parts.append(
        page.note(
            "R of the modes is the least certain of the three: a channel late by a hundredth of a sample distorts it. "
            "R of normal modes and the proportional R need only frequencies, damping ratios and real shapes, and are "
            "more certain."
        )
    )
    return [page.section("Mass, stiffness and damping", *parts, name="M, K, R")]
