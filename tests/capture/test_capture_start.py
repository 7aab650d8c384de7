# SPDX-License-Identifier: MIT
"""How the commands of the package begin: what --help loads, and Ctrl-C before anything is open."""

from __future__ import annotations

import subprocess
import sys

import pytest

COMMANDS = {"okid-capture": "okid.capture", "okid-convert": "okid.formats.command", "okid-live": "okid.live"}
INTERRUPTED = """
import importlib.abc, os, signal, sys
{first}
class Interrupt(importlib.abc.MetaPathFinder):
    def find_spec(self, name, path=None, target=None):
        if name == {name!r}:
            try:
                os.kill(os.getpid(), signal.SIGINT)
                for _ in range(1000):
                    pass
            except BaseException:  # as C code of a library does
                pass
        return None
sys.meta_path.insert(0, Interrupt())
signal.signal(signal.SIGINT, signal.default_int_handler)
sys.exit(main({arguments!r}))
"""


@pytest.mark.parametrize("arguments", [[], ["can"], ["serial"], ["sync"], ["emulate"]])
def test_help_does_not_load_python_can(arguments: list[str]) -> None:
    program = (
        "import sys\nfrom okid.capture import main\ntry:\n    main(sys.argv[1:])\nfinally:\n"
        "    print([name for name in ('can', 'cantools', 'serial', 'scipy') if name in sys.modules], file=sys.stderr)\n"
    )
    command = [sys.executable, "-c", program, *arguments, "--help"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=1800, check=False)
    assert (done.returncode, done.stderr) == (0, "[]\n")
    assert "example" in done.stdout


@pytest.mark.parametrize(
    ("program", "loading", "arguments"),
    [
        ("okid-capture", "okid.capture.command", ["can", "--log", "none.log", "--out", "new.log"]),
        ("okid-capture", "can", ["can", "--log", "none.log", "--out", "new.log"]),
        ("okid-convert", "okid.formats.by_name", ["none.csv", "new.h5"]),
        ("okid-live", "okid.live.server", ["none.toml"]),
    ],
)
def test_ctrl_c_while_libraries_load(program: str, loading: str, arguments: list[str]) -> None:
    first = f"from {COMMANDS[program]} import main"
    text = INTERRUPTED.format(first=first, name=loading, arguments=arguments)
    done = subprocess.run([sys.executable, "-c", text], capture_output=True, text=True, timeout=1800, check=False)
    assert (done.returncode, done.stdout) == (130, "")
    assert done.stderr == f"{program}: interrupted before it began\n"
