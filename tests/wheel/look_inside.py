# SPDX-License-Identifier: MIT
"""What a wheel holds and what its library needs of the system. usage: look_inside.py WHEEL PACKAGE_FOLDER"""

import re
import subprocess
import sys
import tempfile
import zipfile
from pathlib import Path

ALLOWED = re.compile(r"(libc|libm|libgcc_s|libstdc\+\+|libpthread|ld-linux[\w-]*)\.so\.\d+")

wheel, package = Path(sys.argv[1]), Path(sys.argv[2])
if "-py3-none-" not in wheel.name:
    sys.exit(f"{wheel.name}: expected one wheel for every Python 3 (py3-none)")
with zipfile.ZipFile(wheel) as archive, tempfile.TemporaryDirectory() as folder:
    held = set(archive.namelist())
    tracked = subprocess.run(["git", "ls-files", package], capture_output=True, text=True, check=True).stdout.split()
    lacking = {f"okid/{Path(name).relative_to(package)}" for name in tracked if Path(name).exists()} - held
    if lacking:
        sys.exit(f"{wheel.name}: lacks {', '.join(sorted(lacking))}")
    archive.extract("okid/libokid.so", folder)
    dynamic = subprocess.run(
        ["readelf", "-d", f"{folder}/okid/libokid.so"], capture_output=True, text=True, check=True
    ).stdout
    needed = re.findall(r"\(NEEDED\).*\[(.*)\]", dynamic)
    foreign = [name for name in needed if not ALLOWED.fullmatch(name)]
    if foreign:
        sys.exit(f"{wheel.name}: its library needs {', '.join(foreign)} of the system")
print(f"wheel: {wheel.name}, {wheel.stat().st_size / 1024:.0f} KiB, {len(held)} files, needs {', '.join(needed)}")
