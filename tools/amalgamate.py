#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""The microcontroller's part of okid as two pairs of files: okid_core.c/.h (C11: sums, packets, frames) and
okid_modes.cpp/.h (C++17, on Eigen's headers: observer, ERA, modes).

usage: amalgamate.py FOLDER
       amalgamate.py FOLDER --boards [URL]   a library for Zephyr, PlatformIO, Arduino, ESP-IDF, CMSIS-Pack

URL: where the library is published, for its manifests. What goes in is what the lists say that the build itself uses:
OKID_CORE_C and OKID_CORE_CXX of lib/CMakeLists.txt and DRV_NODE_SOURCES of drivers/node_sources.cmake. Every file is
taken as it is, its includes put in their place; a private name that two files have gets the name of its file before it.
The headers declare what these sources define: other functions of okid are left out.
"""

from __future__ import annotations

import re
import sys
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
LIB, DRIVERS = ROOT / "lib", ROOT / "drivers"
SEARCHED = (LIB / "include", LIB / "src", DRIVERS / "include")
INCLUDE = re.compile(r'#include [<"]([^>"]+)[>"]')
TOKEN = re.compile(
    r'//[^\n]*|/\*.*?\*/|"(?:\\.|[^"\\\n])*"|\'(?:\\.|[^\'\\\n])+\'|(?:\.|->|\bstd::|\bEigen::)?[A-Za-z_]\w*', re.S
)
PRIVATE = re.compile(r"^(?!okid|OKID|drv|DRV)[A-Za-z_]\w*$")
WORDS = "static inline const constexpr void int double char unsigned struct enum typedef using namespace template class"

FUNCTION = re.compile(r"\b((?:okid|drv)_\w+)\s*\(")
PROTOTYPE = re.compile(r"^(?:OKID_NODISCARD )?OKID_API\b[^;{]*?\b(\w+)\s*\([^;{]*\)[^;{]*;[^\n]*\n", re.M)

FAST = ("kernel_integer.c",)  # runs per sample: made for speed where everything else is made for size
GCC = "defined(__GNUC__) && !defined(__clang__)"


def listed(file: Path, name: str) -> list[Path]:
    """The sources that a CMake file sets under this name."""
    found = re.search(rf"set\({name}\s([^)]*)\)", file.read_text("utf-8"))
    if not found:
        raise SystemExit(f"amalgamate: {file}: no set({name} ...), expected the list of sources")
    return [file.parent / source for source in found[1].split()]


def blanked(text: str) -> str:
    """The text without comments, strings, attributes and preprocessor lines."""
    text = TOKEN.sub(lambda m: m[0] if re.match(r"[.:>A-Za-z_-]", m[0]) else " ", text)
    text = re.sub(r"^[ \t]*#(?:[^\n]*\\\n)*[^\n]*", "", text, flags=re.M)
    return re.sub(r"__attribute__\s*\(\(.*?\)\)(?=[\s;])", "", text)


def statements(text: str) -> list[tuple[str, str]]:
    """Head and braces of each declaration of a file, those inside namespaces too."""
    out, head, body, depth = [], "", "", 0
    for c in re.sub(r"\bnamespace\b[\w\s:]*\{", ";", blanked(text)):
        if c == "{":
            depth += 1
        if depth:
            body += c
            if c == "}" and depth == 1:
                depth = 0
                if not re.match(r"\s*(typedef|struct|enum|class)\b", head) or "(" in head:  # a function or a value ends
                    out.append((head, body))
                    head = body = ""
            elif c == "}":
                depth -= 1
        elif c in ";}":
            out.append((head, body))
            head = body = ""
        else:
            head += c
    return out


def private_names(text: str) -> set[str]:
    """What a source defines for itself at file scope: functions, values, types, members of enums."""
    names = set()
    for head, body in statements(text):
        head = re.sub(r"\btemplate\s*<(?:[^<>]|<[^<>]*>)*>", " ", head).strip()
        if re.match(r"(typedef )?enum\b", head):
            names |= set(re.findall(r"[{,]\s*(\w+)", body))
        if found := re.match(r"(?:typedef )?(?:struct|enum|class)\s+(\w+)", head):
            names.add(found[1])
        if head.startswith("using"):
            names |= set(re.findall(r"^using\s+(\w+)\s*=", head))
        elif head.startswith("typedef"):
            names.add(head.split()[-1])
        elif found := re.match(r"[\w\s:<>,*&]*?(?<!:)\b(\w+)\s*(?:<[^<>()]*>\s*)?(?:[(\[=]|$)", head):
            names.add(found[1])
    return {name for name in names if PRIVATE.match(name)} - set(WORDS.split())


def functions(text: str) -> set[str]:
    """The public functions that a source defines."""
    found = (FUNCTION.search(head) for head, body in statements(text) if body.startswith("{"))
    return {one[1] for one in found if one}


def pruned(header: str, defined: set[str]) -> str:
    """Without functions that are not defined and their comments; a comment that several share stays with the last."""
    paragraphs = []
    for paragraph in header.split("\n\n"):
        kept = PROTOTYPE.sub(lambda m: m[0] if m[1] in defined else "", paragraph + "\n")
        gone = kept != paragraph + "\n" and not PROTOTYPE.search(kept)
        if gone:
            kept = re.sub(r"^///[^\n]*\n", "", kept, flags=re.M)
        if kept.strip():
            paragraphs.append(kept.rstrip("\n"))
    return "\n\n".join(paragraphs) + "\n"


def renamed(text: str, names: dict[str, str]) -> str:
    """The text with these identifiers replaced, where they are no members and stand in no comment or string."""
    return TOKEN.sub(lambda m: names.get(m[0], m[0]), text)


@dataclass
class Pair:
    """A source and a header under way."""

    name: str
    source: str
    known: set[Path] = field(default_factory=set)  ## files that stand in it already, or in a pair before it
    system: list[str] = field(default_factory=list)
    public: str = ""

    def text(self, path: Path, renames: dict[str, str] | None = None) -> str:
        """A file, its includes in their place; those of the public headers go to the header."""
        whole = path.read_text("utf-8")
        if "#pragma once" in whole or re.search(r"#ifndef \w+_H\b", whole):
            if path in self.known:
                return ""
            self.known.add(path)
        chapter = path.relative_to(ROOT)
        whole = re.sub(r"^// SPDX-License-Identifier: MIT\n|#pragma once\n", "", whole, flags=re.M)
        whole = renamed(whole, renames or {})
        lines = [f"// ---- {chapter}"]
        for line in whole.splitlines():
            found = INCLUDE.match(line)
            if not found:
                lines.append(line)
                continue
            places = [folder / found[1] for folder in (path.parent, *SEARCHED) if (folder / found[1]).is_file()]
            if not places:
                self.system.append(found[1]) if found[1] not in self.system else None
            elif "include" in places[0].parts and "include" not in path.parts:
                self.public += self.text(places[0])
            else:
                lines.append(self.text(places[0]))
        return re.sub(r"\n{3,}", "\n\n", "\n".join(lines)) + "\n"

    def write(self, folder: Path, sources: list[Path], first: str, above: str, defined: set[str]) -> None:
        """Both files. first: C of the source before all; above: include of the header; defined: all functions."""
        files = [*sources, *(LIB / "src").rglob("*.h")]
        shared = Counter(name for path in files for name in private_names(path.read_text("utf-8")))
        body = ""
        for path in sources:
            clashes = {name for name in private_names(path.read_text("utf-8")) if shared[name] > 1}
            part = self.text(path, {name: f"{path.stem}_{name}" for name in clashes})
            if path.name in FAST:
                part = f'#if {GCC}\n#pragma GCC push_options\n#pragma GCC optimize("O3")\n#endif\n{part}'
                part += f"#if {GCC}\n#pragma GCC pop_options\n#endif\n"
            macros = re.findall(r"^#define (\w+)", path.read_text("utf-8"), re.M)
            body += part + "".join(f"#undef {name}\n" for name in dict.fromkeys(macros)) + "\n"
        self.public = pruned(self.public, defined)
        in_header = [name for name in self.system if name in ("stddef.h", "stdint.h")]
        top = f"// okid, made by tools/amalgamate.py of {len(sources)} sources: change those, not this file.\n//\n"
        top += "".join(f"// {line}".rstrip() + "\n" for line in (ROOT / "LICENSE").read_text("utf-8").splitlines())
        top = f"// SPDX-License-Identifier: MIT\n{top}"
        guard = self.name.upper() + "_H"
        includes = "".join(f"#include <{name}>\n" for name in in_header)
        header = f"{top}#ifndef {guard}\n#define {guard}\n{above}{includes}{self.public}#endif\n"
        includes = "".join(f"#include <{name}>\n" for name in self.system if name not in in_header)
        (folder / f"{self.name}.h").write_text(header, "utf-8")
        (folder / self.source).write_text(f'{top}{first}#include "{self.name}.h"\n{includes}\n{body}', "utf-8")


MODES_FIRST = """// The build of a board compiles every file that a library has.
#if !__has_include(<Eigen/Core>)
#warning "okid_modes.cpp is empty: Eigen/Core is not in the include path"
#else
#ifndef EIGEN_NO_DEBUG
#define EIGEN_NO_DEBUG 1
#endif
"""
CORE_FIRST = """// Codes are summed in integers: for a processor without double arithmetic, the same bits.
#ifndef OKID_INTEGER_KERNEL
#define OKID_INTEGER_KERNEL 1
#endif
"""


def amalgamate(folder: Path) -> None:
    """Write the four files into the folder."""
    folder.mkdir(parents=True, exist_ok=True)
    lib = LIB / "CMakeLists.txt"
    core = Pair("okid_core", "okid_core.c")
    of_core = listed(lib, "OKID_CORE_C") + listed(DRIVERS / "node_sources.cmake", "DRV_NODE_SOURCES")
    of_modes = listed(lib, "OKID_CORE_CXX") + listed(lib, "OKID_LINALG_eigen")
    defined = {name for path in of_core + of_modes for name in functions(path.read_text("utf-8"))}
    core.write(folder, of_core, CORE_FIRST, "", defined)
    public = {path for path in core.known if "include" in path.parts}
    modes = Pair("okid_modes", "okid_modes.cpp", known=public)
    modes.write(folder, of_modes, MODES_FIRST, '#include "okid_core.h"\n', defined)
    with (folder / modes.source).open("a", encoding="utf-8") as end:
        end.write("#endif\n")


PLACES = {  # what packaging/ has, and where it stands in the library that all of them share
    "arduino/library.json": "library.json",
    "arduino/library.properties": "library.properties",
    "boards/README.md": "README.md",
    "arduino/stream_node": "examples/stream_node",
    "arduino/modes_node": "examples/modes_node",
    "cmsis/okid.okid.pdsc": "okid.okid.pdsc",
    "esp-idf/CMakeLists.txt": "CMakeLists.txt",
    "esp-idf/idf_component.yml": "idf_component.yml",
    "zephyr/CMakeLists.txt": "zephyr/CMakeLists.txt",
    "zephyr/Kconfig": "zephyr/Kconfig",
    "zephyr/module.yml": "zephyr/module.yml",
    "zephyr/sample": "samples/stream",
}


def boards(folder: Path, url: str) -> None:
    """The library in the form that the build of a board expects."""
    amalgamate(folder / "src")
    version = re.search(r'#define OKID_VERSION "([^"]+)"', (LIB / "include" / "okid" / "types.h").read_text("utf-8"))
    assert version
    for here, there in PLACES.items():
        from_ = ROOT / "packaging" / here
        for path in [from_] if from_.is_file() else sorted(p for p in from_.rglob("*") if p.is_file()):
            to = folder / there / path.relative_to(from_)
            to.parent.mkdir(parents=True, exist_ok=True)
            to.write_text(path.read_text("utf-8").replace("@VERSION@", version[1]).replace("@URL@", url), "utf-8")
    (folder / "LICENSE").write_text((ROOT / "LICENSE").read_text("utf-8"), "utf-8")


if __name__ == "__main__":
    match sys.argv[1:]:
        case [folder] if not folder.startswith("-"):
            amalgamate(Path(folder))
        case [folder, "--boards", *url] if not folder.startswith("-") and len(url) < 2:
            boards(Path(folder), url[0] if url else "https://okid.invalid/")
        case _:
            sys.exit(__doc__)
