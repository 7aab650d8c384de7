# SPDX-License-Identifier: MIT
"""The modes of a result as a table: rows for programs (pandas.DataFrame takes it), text and HTML for people."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from okid.result.parts import MODE_NUMBERS, Mode, known
from okid.shown.notebook_html import items, short, table


def _rows(modes: Sequence[Mode]) -> list[dict[str, Any]]:
    return [
        {
            "mode": k,
            **{key: known(getattr(mode, key)) for key in MODE_NUMBERS},
            "confident": mode.confident,
            "why": ", ".join(mode.why),
        }
        for k, mode in enumerate(modes, 1)
    ]


class ModalTable(list[dict[str, Any]]):
    """A row a mode, ascending in frequency: mode (from 1), frequency_hz, frequency_std_hz, damping_ratio,
    damping_ratio_std, mpc, emac, cmi, confident, found_in, modal_mass, modal_mass_std (kg), why (codes); None = not
    known. str() and notebooks show it with the warnings of the result, without the modes that "auto" lists as doubtful.

    >>> import okid
    >>> table = okid.ModalTable([okid.Mode(10.96, 0.012, None, 0.99, 0.98)], "one mode")
    >>> table[0]["frequency_hz"], str(table)
    (10.96, 'one mode')
    """

    def __init__(self, modes: Sequence[Mode], text: str, warnings: Sequence[str] = ()) -> None:
        super().__init__(_rows(modes))
        self._text, self._warnings, self._doubtful = text, list(warnings), [mode.doubtful for mode in modes]

    def __str__(self) -> str:
        return self._text

    def _repr_html_(self) -> str:
        shown = [row for row, doubtful in zip(self, self._doubtful, strict=True) if not doubtful]
        with_std = [any(row[key] is not None for row in shown) for key in ("frequency_std_hz", "damping_ratio_std")]
        head = ["mode", "f [Hz]", *["± [Hz]"] * with_std[0], "ζ [%]", *["± [%]"] * with_std[1], "MPC", "EMAC", "CMI"]
        lines = []
        for row in shown:
            cells = [str(row["mode"]), f"{row['frequency_hz']:.5f}"]
            cells += [short(row["frequency_std_hz"], form=".2g")] * with_std[0]
            cells += [f"{100.0 * row['damping_ratio']:.4f}"]
            cells += [short(row["damping_ratio_std"], 100.0, ".2g")] * with_std[1]
            cells += [short(row[key], form=".4f") for key in ("mpc", "emac", "cmi")]
            lines.append(cells)
        return table(head, lines) + items(self._warnings)
