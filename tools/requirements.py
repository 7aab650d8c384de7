# SPDX-License-Identifier: MIT
"""Print the requirements of tools/pyproject.toml for one tier: build, test (build + test) or dev (all)."""

import pathlib
import sys
import tomllib

project = tomllib.loads(pathlib.Path(__file__).with_name("pyproject.toml").read_text())["project"]
tiers = {"build": ["run"], "test": ["run", "test"], "dev": ["run", "test", "dev"]}
for extra in tiers[sys.argv[1] if len(sys.argv) > 1 else "build"]:
    wanted = project["dependencies"] if extra == "run" else project["optional-dependencies"][extra]
    print("\n".join(wanted))
