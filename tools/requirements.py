# SPDX-License-Identifier: MIT
"""The requirements of tools/pyproject.toml for one tier: build, test (build + test), dev (all), boards (alone)."""

import pathlib
import re
import sys
import tomllib

project = tomllib.loads(pathlib.Path(__file__).with_name("pyproject.toml").read_text())["project"]
tiers = {"build": ["run"], "test": ["run", "test"], "dev": ["run", "test", "docs", "dev"], "boards": ["boards"]}


def wanted(extra: str) -> list[str]:
    """The requirements of one extra ("run": of the package itself), those of the extras it names in their place."""
    listed = project["dependencies"] if extra == "run" else project["optional-dependencies"][extra]
    out = []
    for requirement in listed:
        named = re.fullmatch(r"okid\[(.+)]", requirement)
        out += [line for name in named[1].split(",") for line in wanted(name)] if named else [requirement]
    return out


for extra in tiers[sys.argv[1] if len(sys.argv) > 1 else "build"]:
    print("\n".join(wanted(extra)))
