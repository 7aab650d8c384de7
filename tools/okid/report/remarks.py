# SPDX-License-Identifier: MIT
"""The remarks of the identification (`warnings` of the result): all are shown, those that ask for a look are named."""

from __future__ import annotations

import json
from html import escape
from typing import Any, NamedTuple

from okid.report import page
from okid.report.material import Material

# Nothing is to be done about these (docs/reference/result.md). Any other code, a newer one too, asks for a look.
HARMLESS = frozenset({
    "channel_skew", "decimated", "pdc_undetermined", "qr_factor", "refine_failed", "resampled", "restarted",
    "unit_converted",
})  # fmt: skip
MILD = ' class="mild"'


class Remark(NamedTuple):
    """`code` is "remark" when the result gives none; `harmless`: nothing is to be done about it."""

    code: str
    text: str
    harmless: bool


def _remark(given: Any) -> Remark:
    """An entry of `warnings`; one that is no object with a text is shown as it stands."""
    entry = given if isinstance(given, dict) else {"text": given}
    code, text = entry.get("code"), entry.get("text")
    if not isinstance(text, str):
        text = json.dumps(given if text is None else text, ensure_ascii=False)
    return Remark(code if isinstance(code, str) and code else "remark", text, code in HARMLESS)


def remarks(m: Material) -> list[Remark]:
    """Those of the result in their order, then the units that the report itself converted."""
    converted = [] if m.measured is None else m.measured.converted
    own = [Remark("unit_converted", text, True) for text in converted]
    return [_remark(one) for one in m.result.raw["warnings"]] + own


def remark_doubt(m: Material) -> str:
    """The codes that ask for a look, "" when none does."""
    codes = list(dict.fromkeys(one.code for one in remarks(m) if not one.harmless))
    if not codes:
        return ""
    return f"the remark{'' if len(codes) == 1 else 's'} below ({', '.join(codes)})"


def remark_list(m: Material) -> str:
    """Code and text of every remark."""
    items = "".join(
        f"<li{MILD if one.harmless else ''}><code>{escape(one.code)}</code> {escape(one.text)}</li>"
        for one in remarks(m)
    )
    if not items:
        return page.note("The identification has no remarks.")
    return f'{page.heading("Remarks of the identification")}<ul class="warnings">{items}</ul>'
