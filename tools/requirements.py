# SPDX-License-Identifier: MIT
"""Requirements of tools/pyproject.toml of a tier: build, test (build + test), dev (all), boards, release (alone)."""

import pathlib
import re
import sys
import tomllib

pyproject = tomllib.loads(pathlib.Path(__file__).with_name("pyproject.toml").read_text())
project = pyproject["project"]
tiers = {
    "build": ["run"],
    "test": ["run", "test"],
    "dev": ["run", "test", "docs", "dev"],
    "boards": ["boards"],
    "release": ["release"],
}


def wanted(extra: str) -> list[str]:
    """The requirements of one extra ("run": of the package itself), those of the extras it names in their place."""
    listed = project["dependencies"] if extra == "run" else project["optional-dependencies"][extra]
    out = []
    for requirement in listed:
        named = re.fullmatch(r"okid\[(.+)]", requirement)
        out += [line for name in named[1].split(",") for line in wanted(name)] if named else [requirement]
    return out


if sys.argv[1:] == ["release"]:  # which builds without an environment of its own for each wheel
    print("\n".join(pyproject["build-system"]["requires"]), "ninja", "cmake>=3.25", sep="\n")
for extra in tiers[sys.argv[1] if len(sys.argv) > 1 else "build"]:
    print("\n".join(wanted(extra)))
