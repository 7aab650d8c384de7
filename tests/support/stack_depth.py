# SPDX-License-Identifier: MIT
"""Worst-case stack of the library's public functions, from the compiler's own call graph (tests/support/call_graph).

usage: stack_depth.py LIMIT_BYTES FOLDER [FOLDER ..]
Reads every *.su below the folders, adds the frames along the deepest path of each okid_ function, prints the deepest
ones, and fails when one is deeper than the limit, when a frame has no bound or when functions call themselves.
Functions outside the library (libm, memcpy, LAPACK) count as nothing: their names are printed.
"""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

NODE = re.compile(r'node: \{ title: "([^"]+)" label: "([^"]*)"')
EDGE = re.compile(r'edge: \{ sourcename: "([^"]+)" targetname: "([^"]+)"(?: label: "([^":]*))?')
LINKED = re.compile(r"(\bokid_\w+?)_\d+_(?:double|float)\b")  # lib/include/okid/abi.h
FRAME = re.compile(r"(\d+) bytes \(([^)]+)\)")


def read(folders: list[Path]) -> tuple[dict[str, int], dict[str, set[str]], list[str]]:
    """Frame sizes, calls, and what is wrong with a frame."""
    frames: dict[str, int] = {}
    calls: dict[str, set[str]] = {}
    files: dict[str, set[str]] = {}
    wrong = []
    for path in sorted(p for folder in folders for p in folder.rglob("*.su")):
        text = LINKED.sub(r"\1", path.read_text(encoding="utf-8"))
        for title, label in NODE.findall(text):
            found = FRAME.search(label)
            if found is None:
                continue
            frames[title] = max(frames.get(title, 0), int(found[1]))
            if found[2] not in ("static", "dynamic,bounded"):  # bounded: only the alignment is found out at run time
                wrong.append(f"{title}: frame is {found[2]}, expected a bounded size")
        for source, target, file in EDGE.findall(text):
            calls.setdefault(source, set()).add(target)
            files.setdefault(source, set()).add(Path(file).name)
    by_suffix = {title.rpartition(":")[2]: title for title in frames}  # templates are titled with their file
    kernels = {f for f in frames if f.startswith("okid_kernel_")}
    spectra = {f for f in frames if f.startswith("okid_spectrum_")}
    for source, targets in calls.items():
        if "__indirect_call" in targets:  # chosen at run time: the instruction sets of one kernel
            family = kernels if "absorb.c" in files[source] else {f for f in frames if "householder" in f}
            targets |= family | (spectra if "okid_spectrum_pick" in targets else set())
        calls[source] = {t if t in frames else by_suffix.get(t, t) for t in targets}
    return frames, calls, wrong


def deepest(frames: dict[str, int], calls: dict[str, set[str]]) -> tuple[dict[str, int], dict[str, str], list[str]]:
    """Depth of every function, the call that makes it, and the functions that reach themselves."""
    depth: dict[str, int] = {}
    through: dict[str, str] = {}
    loops: list[str] = []

    def visit(name: str, path: tuple[str, ...]) -> int:
        if name in path:
            loops.append(" -> ".join([*path[path.index(name) :], name]))
            return 0
        if name not in depth:
            below = 0
            for target in sorted(calls.get(name, ())):
                if target in frames and target != name + ".cold":
                    reached = visit(target, (*path, name))
                    if reached > below:
                        below, through[name] = reached, target
            depth[name] = frames[name] + below
        return depth[name]

    for name in frames:
        visit(name, ())
    return depth, through, loops


def readable(title: str) -> str:
    """The bare name of a mangled title."""
    name = title.rpartition(":")[2]
    shown = subprocess.run(["c++filt", name], capture_output=True, text=True, check=True).stdout.strip()
    while re.search(r"<[^<>]*>|\([^()]*\)", shown):
        shown = re.sub(r"<[^<>]*>|\([^()]*\)", "", shown)
    return re.sub(r"\b(void|const|okid::|linalg::|Eigen::internal::)\s*", "", shown).strip(" :")


def main() -> int:
    limit, folders = int(sys.argv[1]), [Path(a) for a in sys.argv[2:]]
    frames, calls, wrong = read(folders)
    if not frames:
        print(f"stack: no *.su file below {', '.join(map(str, folders))}: build with gcc first", file=sys.stderr)
        return 1
    depth, through, loops = deepest(frames, calls)
    headers = Path(__file__).resolve().parents[2] / "lib" / "include" / "okid"
    declared = set(re.findall(r"\b(okid_\w+)\s*\(", "".join(p.read_text("utf-8") for p in headers.glob("*.h"))))
    public = sorted((n for n in depth if n in declared), key=lambda n: -depth[n])
    outside = sorted({t for n in frames for t in calls.get(n, ()) if t not in frames and "__" not in t})
    print(f"stack: {len(frames)} functions, deepest of {len(public)} public ones (limit {limit} bytes):")
    for name in public[:6]:
        path, at = [], name
        while at in through:
            at = through[at]
            path.append(readable(at))
        print(f"  {depth[name]:6} bytes  {name}" + (f" via {' > '.join(path)}" if path else ""))
    print(f"  outside the library: {' '.join(outside)}")
    wrong += [f"recursion: {loop}" for loop in loops]
    wrong += [f"{n}: {depth[n]} bytes, more than {limit}" for n in public if depth[n] > limit]
    for line in wrong:
        print(f"stack: {line}", file=sys.stderr)
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
