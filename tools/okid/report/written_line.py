# SPDX-License-Identifier: MIT
"""The one line of a page that differs from run to run."""

from __future__ import annotations

import os
import shlex
from collections.abc import Sequence
from datetime import UTC, datetime


def written_line(program: str, arguments: Sequence[str]) -> str:
    """Time (SOURCE_DATE_EPOCH when it is set) and command."""
    epoch = os.environ.get("SOURCE_DATE_EPOCH", "")
    now = datetime.fromtimestamp(int(epoch), UTC) if epoch.isdigit() else datetime.now(UTC)
    return f"{now:%Y-%m-%d %H:%M:%S} UTC by: {shlex.join([program, *arguments])}"
