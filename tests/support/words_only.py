# SPDX-License-Identifier: MIT
"""Pages of a report without their pictures, which are most of its cost: for tests that read the words."""

from __future__ import annotations

from html import escape
from typing import Any

import pytest
from okid.report.svg import Pictures


def described(_self: Pictures, _drawing: Any, text: str, kind: str = "fig") -> str:
    """Instead of Pictures.inline: a picture that is empty but for its description."""
    return f'<svg class="{kind}" role="img" aria-label="{escape(text, quote=True)}"></svg>'


def leave_pictures_out(patch: pytest.MonkeyPatch) -> None:
    patch.setattr(Pictures, "inline", described)
