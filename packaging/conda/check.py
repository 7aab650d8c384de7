# SPDX-License-Identifier: MIT
"""Renders recipe.yaml by rattler-build's own parser, as conda-forge would for two processors and each Python; it builds
nothing, for that takes the packages of conda-forge. usage: check.py SOURCE_DISTRIBUTION (py-rattler-build installed)"""

import sys
import tarfile
from pathlib import Path

from rattler_build import PlatformConfig, RenderConfig, Stage0Recipe, VariantConfig

RECIPE = Path(__file__).resolve().with_name("recipe.yaml")
PYTHONS = ("3.11", "3.12", "3.13", "3.14")
VARIANTS = {
    "python": [f"{version}.* *_cp{version.replace('.', '')}" for version in PYTHONS],
    "c_compiler": ["gcc"], "c_compiler_version": ["14"], "cxx_compiler": ["gxx"], "cxx_compiler_version": ["14"],
    "c_stdlib": ["sysroot"], "c_stdlib_version": ["2.17"],
}  # fmt: skip

sdist = Path(sys.argv[1]).resolve()
recipe = Stage0Recipe.from_file(RECIPE)
assert recipe.to_dict()["build"]["skip"] == ["not linux", 'match(python, "<3.11")'], recipe.to_dict()["build"]
with tarfile.open(sdist) as archive:
    held = set(archive.getnames())
for platform in ("linux-64", "linux-aarch64"):
    made = recipe.render(VariantConfig(VARIANTS), RenderConfig(platform=PlatformConfig(target_platform=platform)))
    assert [one.variant["python"].split(".*")[0] for one in made] == list(PYTHONS), "one package for each Python"
    for one, version in zip(made, PYTHONS, strict=True):
        found = one.recipe.to_dict()
        source = (RECIPE.parent / found["source"][0]["path"]).resolve()
        assert source == sdist, f"the source is {source}, expected {sdist}"
        assert found["build"]["string"].startswith(f"py{version.replace('.', '')}h"), found["build"]
        for needed in (f"gcc_{platform} 14.*", f"gxx_{platform} 14.*", f"sysroot_{platform} 2.17.*"):
            assert needed in found["requirements"]["build"], found["requirements"]
        for name in found["about"]["license_file"]:
            assert f"{sdist.name.removesuffix('.tar.gz')}/{name}" in held, f"no {name} in the source distribution"
print(f"conda: recipe rendered for two processors and Python {', '.join(PYTHONS)}")
