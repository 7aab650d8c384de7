# SPDX-License-Identifier: MIT
"""Hook of mkdocs: formulas of a page (```math blocks, $`…`$ inside text: TeX, as code hosts show it) become MathML.

Browsers draw MathML by themselves: no script, no font, nothing from a network.
"""

from __future__ import annotations

import re
from typing import Any

from latex2mathml.converter import convert

BLOCK = re.compile(r"(?m)^```math\n(.*?)^```$", re.DOTALL)
INLINE = re.compile(r"\$`([^`]+)`\$")


def mathml(tex: str, display: str) -> str:
    """One formula on one line; TeX that is not known would be shown as text: an error instead."""
    made = re.sub(r"\s*\n\s*", " ", convert(tex, display=display))
    unknown = re.search(r"<m[io]>(\\[a-zA-Z]+)", made)
    if unknown:
        raise ValueError(f"{unknown[1]} in the formula {tex.strip()!r} has no MathML here")
    return made


def on_page_markdown(markdown: str, page: Any, config: Any, files: Any) -> str:
    """The page with its formulas drawn."""
    drawn = BLOCK.sub(lambda found: f'<div class="formula">{mathml(found[1], "block")}</div>\n', markdown)
    return INLINE.sub(lambda found: f'<span class="formula-inline">{mathml(found[1], "inline")}</span>', drawn)
