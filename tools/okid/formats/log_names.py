# SPDX-License-Identifier: MIT
"""Which files are logs of CAN frames, without python-can (which takes a second to load)."""

from __future__ import annotations

from pathlib import Path

LOG_EXTENSIONS = (".log", ".asc", ".blf", ".trc", ".db", ".mf4", ".csv")
FRAME_CSV_HEAD = "timestamp,arbitration_id,extended,remote,error,dlc,data"


def is_frame_csv(path: str | Path) -> bool:
    """Whether a .csv file is python-can's table of frames; False when it cannot be read."""
    try:
        with open(path, encoding="utf-8") as file:
            return file.readline(1000).strip() == FRAME_CSV_HEAD
    except (OSError, UnicodeDecodeError):
        return False
