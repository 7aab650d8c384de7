# SPDX-License-Identifier: MIT
"""Programs that work for the page: started without a shell, watched while they work, ended with the page."""

from __future__ import annotations

import contextlib
import os
import re
import subprocess
import sys
import threading
from collections.abc import Callable, Sequence
from pathlib import Path

from okid._errors import InputError

ENDS_S = 5.0  # from SIGTERM to SIGKILL
MOST_SAID = 200  # lines of a program's messages that are kept
_STAGE = re.compile(r"okid[\w-]*: \d+ s, (.*)$")  # as Progress and files/progress.cpp write it


class Failed(InputError):
    """A program ended with an error; the text is its own last line."""


class Child:
    """One program at a time; `stopped`: stop() was called. run() may be called again and again from one thread, stop()
    from any other."""

    def __init__(self) -> None:
        self._process: subprocess.Popen[str] | None = None
        self._lock = threading.Lock()
        self.stopped = False

    def run(
        self, command: Sequence[str], on_stage: Callable[[str], None] = lambda _text: None,
        on_line: Callable[[str], None] | None = None,
    ) -> None:  # fmt: skip
        """Run to the end. `on_stage(text)`: what the program does now and how long it goes on; `on_line(text)`: every
        line of its standard output, which waits meanwhile. Raises Failed with what it said; after stop() at once."""
        shown, inside = os.openpty()  # programs report their progress to a terminal
        said: list[str] = []
        try:
            process = self._begin(command, inside, on_line is not None)
        except OSError as fault:
            os.close(shown)
            raise Failed(f"{command[0]}: cannot be run: {fault.strerror or fault}") from None
        finally:
            os.close(inside)
        reader = threading.Thread(target=_follow, args=(shown, said, on_stage), daemon=True)
        reader.start()
        with process:
            try:
                for line in process.stdout or ():
                    on_line(line)  # type: ignore[misc]
            except BaseException:
                process.kill()
                raise
        reader.join()
        if self.stopped:
            raise Failed("it was stopped")
        if process.returncode != 0:
            raise Failed(said[-1] if said else f"{Path(command[0]).name} ended with {process.returncode}")

    def _begin(self, command: Sequence[str], errors: int, piped: bool) -> subprocess.Popen[str]:
        beside = str(Path(sys.executable).parent)  # okid-convert of this installation, for files of other programs
        path = os.pathsep.join([beside, os.environ.get("PATH", os.defpath)])
        with self._lock:
            if self.stopped:
                raise Failed("it was stopped")
            self._process = subprocess.Popen(
                list(command), stdin=subprocess.DEVNULL, stdout=subprocess.PIPE if piped else subprocess.DEVNULL,
                stderr=errors, text=True, encoding="utf-8", errors="replace", start_new_session=True,
                env={**os.environ, "PATH": path, "NO_COLOR": "1"},
            )  # fmt: skip
            return self._process

    def finish(self) -> None:
        """Ask what runs to end by itself (SIGTERM)."""
        with self._lock:
            if self._process is not None:
                self._process.terminate()

    def stop(self) -> None:
        """End what runs; nothing can be run any more."""
        with self._lock:
            self.stopped, process = True, self._process
        if process is None or process.poll() is not None:
            return
        process.terminate()
        with contextlib.suppress(subprocess.TimeoutExpired):
            process.wait(ENDS_S)
        process.kill()


def _follow(shown: int, said: list[str], on_stage: Callable[[str], None]) -> None:
    """Read a program's terminal to its end: stages go on, everything else is kept as what it said."""
    rest = ""
    with contextlib.closing(open(shown, "rb", buffering=0)) as terminal, contextlib.suppress(OSError):  # EIO: the end
        while piece := terminal.read(4096):
            *whole, rest = re.split(r"[\r\n]", rest + piece.decode("utf-8", "replace"))
            said += [line for line in whole if line.strip() and not _STAGE.match(line.strip())]
            newest = next((m for line in (rest, *reversed(whole)) if (m := _STAGE.match(line.strip()))), None)
            if newest is not None:
                on_stage(newest[1])
            del said[:-MOST_SAID]
    if rest.strip() and not _STAGE.match(rest.strip()):
        said.append(rest)
    said[:] = [re.sub(r"^[\w-]+: ", "", line.strip(), count=1) for line in said]
