# SPDX-License-Identifier: MIT
"""Reads the manifests of a board library as their frameworks read them; exits 1 and says what they refuse.

usage: manifests.py FOLDER   by .venv/boards/bin/python, which has PlatformIO, ESP-IDF's component tools and kconfiglib
"""

from __future__ import annotations

import os
import sys
import tempfile
from pathlib import Path

import kconfiglib
from idf_component_tools.manager import ManifestManager
from platformio.package.manifest.parser import ManifestParserFactory
from platformio.package.manifest.schema import ManifestSchema


def check_platformio(file: Path) -> None:
    """library.json or library.properties; the list of licences would come from the network."""
    ManifestSchema.load_spdx_licenses = staticmethod(lambda: {"licenses": [{"licenseId": "MIT"}]})
    read = ManifestParserFactory.new_from_file(str(file)).as_dict()
    loaded = ManifestSchema().load_manifest(read)
    assert loaded["name"] == "okid", loaded
    print(f"{file.name}: {loaded['name']} {loaded['version']}")


def check_idf(folder: Path) -> None:
    """idf_component.yml, as for an upload."""
    manifest = ManifestManager(folder, "okid").load()
    assert str(manifest.license) == "MIT", manifest
    print(f"idf_component.yml: {manifest.version}")


def check_kconfig(folder: Path) -> None:
    """No warning, and each symbol is there when its conditions are."""
    with tempfile.TemporaryDirectory() as place:
        top = Path(place, "Kconfig")
        top.write_text(f'config CPP\n\tbool "C++"\nsource "{folder / "zephyr" / "Kconfig"}"\n')
        os.environ["KCONFIG_WARN_UNDEF"] = "y"
        kconfig = kconfiglib.Kconfig(str(top), warn_to_stderr=False)
        for name in ("CPP", "OKID", "OKID_MODES", "OKID_FLOAT"):
            assert kconfig.syms[name].set_value("y"), name
        assert not kconfig.warnings, kconfig.warnings
        assert kconfig.syms["OKID_MODES"].str_value == "y"
        kconfig.syms["CPP"].set_value("n")
        assert kconfig.syms["OKID_MODES"].str_value == "n"
    print("Kconfig: well")


if __name__ == "__main__":
    library = Path(sys.argv[1])
    for name in ("library.json", "library.properties"):
        check_platformio(library / name)
    check_idf(library)
    check_kconfig(library)
