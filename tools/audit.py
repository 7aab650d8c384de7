# SPDX-License-Identifier: MIT
"""Known holes in what okid stands on: the bill of materials held against PyPI's advisories and Debian's archive.

usage: tools/audit.py [--sbom build/sbom.cdx.json] [--index https://pypi.org/pypi]
PyPI tells the advisories of one release (they come from OSV); an index that only knows the newest release says nothing
of an older one, which is then counted as unknown. A Debian package is behind where apt knows a newer version for it.
exit codes: 0 nothing known against any, 1 a hole or a waiting update, 2 wrong usage, 4 nothing could be asked
"""

from __future__ import annotations

import argparse
import json
import pathlib
import re
import subprocess
import sys
import urllib.error
import urllib.request
from concurrent.futures import ThreadPoolExecutor
from typing import Any

Json = dict[str, Any]


def asked(url: str) -> Json | None:
    """The answer; None: the index does not have it."""
    try:
        with urllib.request.urlopen(url, timeout=20) as answer:
            found: Json = json.load(answer)
            return found
    except urllib.error.HTTPError as error:
        if error.code == 404:
            return None
        raise


def holes(index: str, name: str, version: str) -> list[str] | None:
    """One line an advisory; None: the index tells nothing of this release."""
    found = asked(f"{index}/{name}/{version}/json")
    if found is None:
        newest = asked(f"{index}/{name}/json")
        found = newest if newest and newest["info"]["version"] == version else None
    if found is None or "vulnerabilities" not in found:
        return None
    open_ones = [one for one in found["vulnerabilities"] if not one.get("withdrawn")]
    lines = []
    for one in open_ones:
        names, fixed = ", ".join([one["id"], *one.get("aliases", [])]), ", ".join(one.get("fixed_in") or ["no release"])
        summary = " ".join((one.get("summary") or one["details"]).split())[:120]
        lines.append(f"{names}: {summary} (fixed in {fixed})")
    if found["info"].get("yanked"):
        lines.append(f"taken back by its makers: {found['info'].get('yanked_reason') or 'no reason is given'}")
    return lines


def behind(names: list[str]) -> dict[str, str] | None:
    """Debian packages for which apt knows a newer version: {name: that version}; None: there is no apt."""
    if not names:
        return {}
    try:
        done = subprocess.run(["apt-cache", "policy", *names], capture_output=True, text=True, env={"LC_ALL": "C"})
    except FileNotFoundError:
        return None
    found = re.findall(r"(?m)^(\S+):\n  Installed: (\S+)\n  Candidate: (\S+)", done.stdout)
    return {name: candidate for name, installed, candidate in found if installed not in ("(none)", candidate)}


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("--sbom", type=pathlib.Path, default=pathlib.Path("build/sbom.cdx.json"))
    parser.add_argument("--index", default="https://pypi.org/pypi")
    given = parser.parse_args()
    if not given.sbom.exists():
        print(f"audit: {given.sbom}: No such file or directory; `make sbom` writes it", file=sys.stderr)
        return 2
    parts = [one for one in json.loads(given.sbom.read_text())["components"] if "purl" in one]
    pypi = [one for one in parts if one["purl"].startswith("pkg:pypi/")]
    debian = sorted({one["name"] for one in parts if one["purl"].startswith("pkg:deb/")})
    try:
        with ThreadPoolExecutor(8) as pool:
            answers = list(pool.map(lambda one: holes(given.index, one["name"], one["version"]), pypi))
    except (urllib.error.URLError, TimeoutError) as error:
        print(f"audit: {given.index}: {error}; nothing of PyPI was asked", file=sys.stderr)
        return 4
    bad = 0
    for one, lines in zip(pypi, answers, strict=True):
        for line in lines or []:
            bad += 1
            print(f"{one['name']} {one['version']}: {line}")
    late = behind(debian)
    for name, version in sorted((late or {}).items()):
        bad += 1
        print(f"{name}: {version} waits in the archive")
    unknown, remarks = sum(lines is None for lines in answers), sum(len(lines or []) for lines in answers)
    print(
        f"PyPI: {len(pypi)} packages, {len(pypi) - unknown} known to the index, {remarks} remarks; "
        f"Debian: {len(debian)} packages, {'apt is missing' if late is None else f'{len(late)} behind'}"
    )
    if unknown == len(pypi) and late is None:
        return 4
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main())
