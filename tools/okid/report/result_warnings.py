# SPDX-License-Identifier: MIT
"""The warnings of the identification (`warnings` of the result): all are shown, those that ask for a look are named."""

from __future__ import annotations

import json
from html import escape
from typing import Any, NamedTuple

from okid.report import page
from okid.report.material import Material

# Nothing is to be done about these (docs/reference/result.md). Any other code, a newer one too, asks for a look.
HARMLESS = frozenset({
    "channel_skew", "decimated", "force_window", "free_decays", "pdc_undetermined", "qr_factor", "reciprocity",
    "refine_failed", "resampled", "restarted", "unit_converted", "window_shortened",
})  # fmt: skip
MILD = ' class="mild"'


class ResultWarning(NamedTuple):
    """`code` is "warning" when the result gives none; `harmless`: nothing is to be done about it."""

    code: str
    text: str
    harmless: bool


def _warning(given: Any) -> ResultWarning:
    """An entry of `warnings`; one that is no object with a text is shown as it stands."""
    entry = given if isinstance(given, dict) else {"text": given}
    code, text = entry.get("code"), entry.get("text")
    if not isinstance(text, str):
        text = json.dumps(given if text is None else text, ensure_ascii=False)
    return ResultWarning(code if isinstance(code, str) and code else "warning", text, code in HARMLESS)


def result_warnings(m: Material) -> list[ResultWarning]:
    """Those of the result in their order, then the units that the report itself converted."""
    converted = [] if m.measured is None else m.measured.converted
    own = [ResultWarning("unit_converted", text, True) for text in converted]
    return [_warning(one) for one in m.result.raw["warnings"]] + own


def warning_doubt(m: Material) -> str:
    """The codes that ask for a look, "" when none does."""
    codes = list(dict.fromkeys(one.code for one in result_warnings(m) if not one.harmless))
    if not codes:
        return ""
    return f"the warning{'' if len(codes) == 1 else 's'} below ({', '.join(codes)})"


def warning_list(m: Material) -> str:
    """Code and text of every warning."""
    items = "".join(
        f"<li{MILD if one.harmless else ''}><code>{escape(one.code)}</code> {escape(one.text)}</li>"
        for one in result_warnings(m)
    )
    if not items:
        return page.note("The identification has no warnings.")
    return f'{page.heading("Warnings of the identification")}<ul class="warnings">{items}</ul>'
