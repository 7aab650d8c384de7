# SPDX-License-Identifier: MIT
"""Lines out of bytes that come in pieces."""

from __future__ import annotations

from okid.data.input_file import LONGEST_LINE


class LineSplitter:
    """Bytes as they come in, whole lines out. A line longer than `longest` is dropped to its end and counted."""

    def __init__(self, longest: int = LONGEST_LINE) -> None:
        self.dropped = 0
        self._longest = longest
        self._parts: list[bytes] = []
        self._size = 0
        self._skipping = False

    def add(self, data: bytes) -> list[bytes]:
        """The lines that `data` completes, without their ends, empty ones left out. O(len(data))."""
        *whole, rest = data.split(b"\n")
        out = []
        for piece in whole:
            if self._skipping:
                self._skipping = False
            elif line := b"".join([*self._parts, piece]).strip():
                out.append(line)
            self._parts, self._size = [], 0
        if rest and not self._skipping:
            self._parts.append(rest)
            self._size += len(rest)
            if self._size > self._longest:
                self._parts, self._size, self._skipping = [], 0, True
                self.dropped += 1
        return out
