# SPDX-License-Identifier: MIT
"""What a notebook shows of an object: one style of tables, every text escaped."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from html import escape
from typing import Any

import numpy as np

from okid._errors import shown

_MOST_ROWS, _MOST_NUMBERS = 40, 36  # of a table; of an array that is shown whole


def summary(text: str) -> str:
    """A line above the tables."""
    return f"<p>{escape(shown(text))}</p>"


def table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Cells to the right, as numbers want it."""

    def line(cells: Sequence[str], tag: str) -> str:
        return "".join(f'<{tag} style="text-align:right">{escape(shown(cell))}</{tag}>' for cell in cells)

    body = "".join(f"<tr>{line(row, 'td')}</tr>" for row in rows)
    return f"<table><thead><tr>{line(head, 'th')}</tr></thead><tbody>{body}</tbody></table>"


def items(texts: Sequence[str]) -> str:
    """A list below a table, nothing of no texts."""
    return f"<ul>{''.join(f'<li>{escape(shown(text))}</li>' for text in texts)}</ul>" if texts else ""


def short(value: Any, factor: float = 1.0, form: str = ".6g") -> str:
    """A number, or a dash where it is not known."""
    return "–" if value is None or np.isnan(value) else format(factor * value, form)


def _shown(value: Any) -> str:
    """One value as text: numbers to six digits, long arrays by their shape."""
    if value is None:
        return "–"
    if isinstance(value, bool | str):
        return str(value)
    if isinstance(value, np.ndarray):
        if value.size > _MOST_NUMBERS:
            return " × ".join(map(str, value.shape))
        return np.array2string(value, precision=5, suppress_small=True)
    if isinstance(value, int | float | complex | np.number):
        return f"{value:.6g}"
    if isinstance(value, Mapping):
        return ", ".join(f"{key}: {_shown(one)}" for key, one in list(value.items())[:_MOST_ROWS])
    if isinstance(value, tuple) and hasattr(value, "_asdict"):
        return _shown(value._asdict())
    if isinstance(value, list | tuple):
        return f"{len(value)}" if len(value) > _MOST_NUMBERS else ", ".join(map(_shown, value))
    return repr(value)


def own_fields(what: Any) -> str:
    """_repr_html_ of a named tuple or a dataclass: a table of what it holds."""
    values = what._asdict() if hasattr(what, "_asdict") else vars(what)
    rows = ((name, _shown(value)) for name, value in values.items() if not name.startswith("_"))
    return summary(type(what).__name__) + table(("", ""), rows)
