# SPDX-License-Identifier: MIT
"""Bill of materials: docs/reference/dependencies.md and a CycloneDX 1.5 file, read off the packages of this machine.

usage: tools/sbom.py [--table FILE] [--json FILE] [--build FOLDER]

What is needed stands in tools/packages/*.txt, tools/pyproject.toml and the two tools/get_*.sh; versions and licences
come from dpkg, /usr/share/doc/PACKAGE/copyright and the metadata of the Python packages; what is linked and which
headers are compiled in from the programs in the build folder. Exit codes: 0 written, 2 wrong usage, 4 a package is not
installed here.
"""

from __future__ import annotations

import argparse
import json
import os
import pathlib
import platform
import re
import subprocess
import sys
import tomllib
from dataclasses import dataclass
from importlib import metadata

ROOT = pathlib.Path(__file__).resolve().parent.parent
COMMANDS = {
    "debian": "build",
    "debian-test": "`make test`",
    "debian-programs": "`make test-programs`",
    "debian-bench": "`make bench`",
    "debian-embedded": "`make test-embedded`",
    "debian-languages": "`make test-languages`",
    "debian-fuzz": "`make fuzz`, `make lint`",
    "debian-dev": "`make lint`, `make docs`",
    "debian-package": "`make package`, `make test-package`",
}
APART = ("wheel", "boards", "release")  # what they list is not in .venv
EXTRAS = {
    "test": "`make test`",
    "docs": "`make docs`",
    "boards": "`make test-embedded`",
    "release": "`packaging/release`",
    "dev": "`make lint`, `make coverage`, `make sbom`",
}  # the others are for users

INTRODUCTION = """\
# Dependencies

What okid is built from, runs with and is tested with. None of it is part of this repository. Versions and licences
are those of the machine where the release was tested, read off its packages by `tools/sbom.py`. That also writes a
bill of materials (CycloneDX 1.5) into `build/sbom.cdx.json`.

How a package is used: `make …` and `packaging/release` stand for tests and checks only, `import okid` for what the
Python package and its commands load. `okid[…]` is an extra, loaded when it is asked for. `a|b`: the first the
distribution has. Licences stand as the packages name them.

The headers of Eigen, fmt, nlohmann-json, toml++ and CLI11 are compiled into the wheel. It links the run-time
libraries of C and C++ only (that of `packaging/release` the one of C, with LLVM's libc++ inside). Both toml++ (MIT)
and CLI11 (BSD-3-Clause) come from libtomlplusplus-dev and libcli11-dev, or from the source distributions of pytomlpp
1.1.0 and highspy 1.15.1."""


class Missing(Exception):
    """A package that this machine does not have."""


@dataclass(frozen=True)
class Part:
    """One row: a package, what it is for and how okid touches it."""

    name: str
    version: str
    licence: str
    purpose: str
    use: str
    purl: str
    system: str  # deb, pypi or generic
    needs: tuple[str, ...] = ()  # names of parts that come with it


def output_of(*command: str) -> str:
    return subprocess.run(command, capture_output=True, text=True, check=False).stdout


def debian_lists() -> list[tuple[str, str, str]]:
    """(names joined by |, what for, list) of every line of tools/packages."""
    rows = []
    for path in sorted((ROOT / "tools/packages").glob("*.txt"), key=lambda one: list(COMMANDS).index(one.stem)):
        for line in path.read_text(encoding="utf-8").splitlines():
            if line and not line.startswith("#"):
                names, _, purpose = line.partition(" ")
                rows.append((names, purpose.strip(), path.stem))
    return rows


def python_lists() -> list[tuple[str, str]]:
    """(requirement, extra) of tools/pyproject.toml; extra "run" for the package itself, "wheel" for its build."""
    text = tomllib.loads((ROOT / "tools/pyproject.toml").read_text(encoding="utf-8"))
    rows = [(one, "run") for one in text["project"]["dependencies"]]
    for extra, listed in text["project"]["optional-dependencies"].items():
        rows += [(one, extra) for one in listed if not one.startswith("okid[")]
    return rows + [(one, "wheel") for one in text["build-system"]["requires"]]


def name_of(requirement: str) -> str:
    return re.split(r"[\[<>=!~; ]", requirement, maxsplit=1)[0]


def debian_licence(package: str, documents: pathlib.Path = pathlib.Path("/usr/share/doc")) -> str:
    """Short names of the licences in the package's copyright file: of `Files: *` where a machine can read it."""
    path = documents / package / "copyright"
    if not path.exists():
        raise Missing(f"{package}: no {path}: the machine leaves out documentation")
    text = path.read_text(encoding="utf-8", errors="replace")
    if re.match(r"format(-specification)?:", text, re.IGNORECASE):
        found: list[str] = []
        for stanza in re.split(r"\n\s*\n", text):
            files = re.search(r"^Files:\s*(.*)", stanza, re.MULTILINE)
            licence = re.search(r"^License:[ \t]*\n?[ \t]*(.*)", stanza, re.MULTILINE)
            if files and licence and licence[1].strip():
                if files[1].split()[:1] == ["*"]:
                    return licence[1].strip()
                found.append(licence[1].strip())
        if found:
            return ", ".join(sorted(set(found))[:4])
    if "GCC RUNTIME LIBRARY EXCEPTION" in text and package.startswith("lib"):
        return "GPL-3+ with GCC Runtime Library Exception"
    common = set(re.findall(r"/usr/share/common-licenses/([A-Za-z0-9.-]*[A-Za-z0-9])", text))
    if "Permission is hereby granted, free of charge, to any person obtaining" in text:
        common.add("Expat")
    if not common and "PYTHON SOFTWARE FOUNDATION LICENSE" in text.upper():
        common = {"PSF-2.0"}
    if not common:
        raise Missing(f"{package}: {path} names no licence that is known here")
    return ", ".join(sorted(common))


class Debian:
    """What dpkg knows, and which packages the built programs link and include."""

    def __init__(self, build: pathlib.Path) -> None:
        listed = output_of("dpkg-query", "-W", "-f=${db:Status-Status}\t${Package}\t${Version}\t${source:Package}\n")
        rows = [line.split("\t") for line in listed.splitlines()]
        self.version = {package: version for status, package, version, _ in rows if status == "installed"}
        self.source = {package: source for status, package, _, source in rows if status == "installed"}
        self.architecture = output_of("dpkg", "--print-architecture").strip()
        self.distribution = platform.freedesktop_os_release()["ID"]
        programs = [build / "okid", build / "libokid.so"]
        for program in programs:
            if not program.exists():
                raise Missing(f"{program.name} is not built: run make build")
        libraries = set()
        for program in programs:
            needed = set(re.findall(r"\(NEEDED\).*\[(.*)]", output_of("readelf", "-d", str(program))))
            loaded = re.findall(r"(\S+) => (\S+)", output_of("ldd", str(program)))
            libraries |= {os.path.realpath(path) for name, path in loaded if name in needed}
        self.linked = self.owners(libraries)
        includes = re.findall(r"^ +(/usr/\S+)", output_of("ninja", "-C", str(build), "-t", "deps"), re.MULTILINE)
        self.included = self.owners(set(includes))

    def owners(self, paths: set[str]) -> set[str]:
        """Packages that own these files; dpkg may know a file of /usr/lib by its old name in /lib."""
        asked = sorted(paths | {path.removeprefix("/usr") for path in paths})
        found: set[str] = set()
        for at in range(0, len(asked), 500):
            text = output_of("dpkg-query", "-S", *asked[at : at + 500])
            found |= {line.split(":")[0] for line in text.splitlines() if not line.startswith("diversion")}
        return found

    def part(self, names: str, purpose: str, group: str) -> Part:
        package = next((one for one in names.split("|") if one in self.version), None)
        if package is None:
            raise Missing(f"{names} ({group}.txt) is not installed")
        runtime = tuple(sorted(one for one in self.linked if self.source[one] == self.source[package]))
        if group != "debian":
            use, runtime = f"tests and checks only: {COMMANDS.get(group, group)}", ()
        elif runtime:
            use = f"linked ({', '.join(f'{one} {self.version[one]}' for one in runtime)})"
        elif package in self.included:
            use = "headers, compiled in"
        else:
            use = "build only"
        return self.plain(package, names, purpose, use, runtime)

    def plain(self, package: str, names: str, purpose: str, use: str, needs: tuple[str, ...] = ()) -> Part:
        version = self.version[package]
        purl = f"pkg:deb/{self.distribution}/{package}@{version}?arch={self.architecture}"
        return Part(names, version, debian_licence(package), purpose, use, purl, "deb", needs)

    def parts(self) -> list[Part]:
        rows = [self.part(*row) for row in debian_lists()]
        covered = {one for row in rows for one in row.needs}
        rest = sorted(self.linked - covered)
        return rows + [self.plain(one, one, "run-time library of C and C++", "linked") for one in rest]

    def closure(self, direct: list[Part]) -> list[Part]:
        """The run-time packages of what is linked."""
        return [
            self.plain(one, one, f"run-time library of {part.name}", "linked") for part in direct for one in part.needs
        ]


class Python:
    """Metadata of the Python packages: of this environment, and of what stands apart from it."""

    def __init__(self, build: pathlib.Path) -> None:
        self.folder = build / "sbom-site"
        wanted = [one for one, extra in python_lists() if extra in APART and not self.find(name_of(one))]
        if wanted:
            pip = [sys.executable, "-m", "pip", "install", "--quiet", "--disable-pip-version-check", "--no-deps"]
            subprocess.run([*pip, "--target", str(self.folder), *wanted], check=False)

    def find(self, name: str) -> metadata.Distribution | None:
        for place in (None, [str(self.folder)]):
            found = (
                metadata.distributions(name=name) if place is None else metadata.distributions(name=name, path=place)
            )
            for one in found:
                return one
        return None

    def part(self, name: str, use: str) -> Part:
        found = self.find(name)
        if found is None:
            raise Missing(f"{name} (tools/pyproject.toml) is not installed in this environment")
        about = found.metadata
        licence = about["License-Expression"] or ", ".join(
            sorted(one.split(" :: ")[-1] for one in about.get_all("Classifier", []) if one.startswith("License ::"))
        )
        if licence in ("", "OSI Approved"):
            licence = (about["License"] or "").strip().splitlines()[0] if about["License"] else ""
        if not licence:
            raise Missing(f"{name}: its metadata name no licence")
        purl = f"pkg:pypi/{name.lower()}@{found.version}"
        return Part(name, found.version, licence, about["Summary"] or "", use, purl, "pypi", self.needs(found))

    def needs(self, found: metadata.Distribution) -> tuple[str, ...]:
        plain = [one for one in found.requires or [] if "extra ==" not in one]
        return tuple(sorted({name_of(one).lower() for one in plain if self.find(name_of(one))}))

    def parts(self) -> list[Part]:
        rows: dict[str, Part] = {}
        for requirement, extra in python_lists():
            name = name_of(requirement)
            if extra == "run":
                use = "loaded by `import okid` and its commands"
            elif extra == "wheel":
                use = "builds the wheel"
            elif extra in EXTRAS:
                use = f"tests and checks only: {EXTRAS[extra]}"
            else:
                use = f"loaded when asked for: `okid[{extra}]`"
            rows.setdefault(name, self.part(name, use))
        return list(rows.values())

    def closure(self, direct: list[Part]) -> list[Part]:
        """What the packages that okid loads bring along, and what that brings along."""
        known = {part.name.lower() for part in direct}
        waiting = [one for part in direct if part.use.startswith("loaded") for one in part.needs]
        rows = []
        while waiting:
            name = waiting.pop()
            if name not in known:
                known.add(name)
                rows.append(self.part(name, "loaded by another"))
                waiting += rows[-1].needs
        return sorted(rows, key=lambda part: part.name)


def fetched() -> list[Part]:
    """Sources that tests fetch: they are no package of the distribution."""
    cache = pathlib.Path(os.environ.get("XDG_CACHE_HOME", pathlib.Path.home() / ".cache"), "okid")
    header = cache / "unity/src/unity.h"
    if not header.exists():
        raise Missing("the sources of Unity are not at hand: run make test")
    # Headers before 2.5 do not name their version; the one in Debian's cjson is 2.4.3.
    numbers = re.findall(r"#define UNITY_VERSION_\w+\s+\(?(\d+)", header.read_text(encoding="utf-8"))
    unity = ".".join(numbers) or "2.4.3"
    script = (ROOT / "tools/get_gpiod2.sh").read_text(encoding="utf-8")
    gpiod = re.search(r"version=(\S+)", script)
    assert gpiod is not None
    use = "tests and checks only: `make test`"
    return [
        Part("Unity", unity, "MIT", "framework of the unit tests", use, f"pkg:generic/unity@{unity}", "generic"),
        Part(
            "libgpiod 2",
            gpiod[1],
            "LGPL-2.1-or-later",
            "its driver is tested where the system has 1.6",
            use,
            f"pkg:generic/libgpiod@{gpiod[1]}",
            "generic",
        ),
    ]


def shown(part: Part) -> tuple[str, ...]:
    """The cells of a row; the introduction says what the short forms of `use` stand for."""
    use = re.sub(r"^tests and checks only: |^loaded when asked for: |^loaded by | and its commands$", "", part.use)
    purpose = re.sub(r"\.( .*)?$", "", part.purpose)  # the first sentence
    return part.name, part.version, part.licence, purpose, use


def table(parts: list[Part]) -> str:
    titles = {"deb": "Debian packages", "pypi": "Python packages", "generic": "Sources that tests fetch"}
    lines = [INTRODUCTION]
    for system, title in titles.items():
        lines += [
            "",
            f"## {title}",
            "",
            "| name | version tested | licence | what for | how |",
            "|---|---|---|---|---|",
        ]
        for part in parts:
            if part.system == system:
                lines.append("| " + " | ".join(cell.replace("|", "\\|") for cell in shown(part)) + " |")
    return "\n".join(lines) + "\n"


def scope_of(use: str) -> str:
    """In the words of CycloneDX."""
    if use.startswith("loaded when"):
        return "optional"
    return "required" if use.startswith(("linked", "headers", "loaded")) else "excluded"


def cyclonedx(parts: list[Part]) -> str:
    """The parts as CycloneDX 1.5 JSON, checked against its schema."""
    from cyclonedx.model.bom import Bom
    from cyclonedx.model.component import Component, ComponentScope, ComponentType
    from cyclonedx.model.license import DisjunctiveLicense
    from cyclonedx.output.json import JsonV1Dot5
    from cyclonedx.schema import SchemaVersion
    from cyclonedx.validation.json import JsonStrictValidator
    from packageurl import PackageURL

    project = tomllib.loads((ROOT / "tools/pyproject.toml").read_text(encoding="utf-8"))["project"]
    bom = Bom()
    root = Component(
        name="okid",
        version=project["version"],
        type=ComponentType.APPLICATION,
        bom_ref="okid",
        licenses=[DisjunctiveLicense(id="MIT")],
    )
    bom.metadata.component = root
    made: dict[str, Component] = {}
    for part in parts:
        url = PackageURL.from_string(part.purl)
        made[url.name] = Component(
            name=url.name,
            version=part.version,
            type=ComponentType.LIBRARY,
            scope=ComponentScope(scope_of(part.use)),
            bom_ref=part.purl,
            purl=url,
            description=f"{part.purpose} ({part.use})",
            licenses=[DisjunctiveLicense(name=part.licence)],
        )
        bom.components.add(made[url.name])
    brought = {one for part in parts for one in part.needs}
    for part in parts:
        component = made[PackageURL.from_string(part.purl).name]
        bom.register_dependency(component, [made[one] for one in part.needs if one in made])
    bom.register_dependency(root, [one for name, one in made.items() if name not in brought])
    text: str = JsonV1Dot5(bom).output_as_string(indent=1)
    wrong = JsonStrictValidator(SchemaVersion.V1_5).validate_str(text)
    if wrong is not None:
        raise ValueError(f"the bill of materials does not follow CycloneDX 1.5: {wrong}")
    return text


def write(path: pathlib.Path, text: str) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    temporary = path.with_name(path.name + ".tmp")
    temporary.write_text(text, encoding="utf-8")
    temporary.replace(path)


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--table", type=pathlib.Path, default=ROOT / "docs/reference/dependencies.md")
    parser.add_argument("--json", type=pathlib.Path, default=ROOT / "build/sbom.cdx.json")
    parser.add_argument(
        "--build", type=pathlib.Path, default=ROOT / "build", help="where okid and libokid.so are built"
    )
    asked = parser.parse_args()
    try:
        debian, python = Debian(asked.build), Python(asked.build)
        direct = python.parts()
        system = debian.parts()
        parts = system + direct + fetched()
        write(asked.table, table(parts))
        write(asked.json, cyclonedx(parts + debian.closure(system) + python.closure(direct)))
    except Missing as why:
        print(f"sbom: {why}; install with tools/setup.sh (build, test, bench, embedded, fuzz, dev)", file=sys.stderr)
        return 4
    components = len(json.loads(asked.json.read_text(encoding="utf-8"))["components"])
    print(f"sbom: {len(parts)} direct dependencies in {asked.table.name}, {components} components in {asked.json.name}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
