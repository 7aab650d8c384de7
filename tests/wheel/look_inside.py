# SPDX-License-Identifier: MIT
"""What a wheel holds and what its libraries and program need of the system. usage: look_inside.py WHEEL PACKAGE"""

import re
import subprocess
import sys
import tempfile
import zipfile
from pathlib import Path

ALLOWED = re.compile(r"(libc|libm|libdl|librt|libgcc_s|libstdc\+\+|libpthread|ld-linux[\w-]*)\.so\.\d+")
MOST_BYTES = 8 << 20

wheel, package = Path(sys.argv[1]), Path(sys.argv[2])
if "-py3-none-" not in wheel.name:
    sys.exit(f"{wheel.name}: expected one wheel for every Python 3 (py3-none)")
with zipfile.ZipFile(wheel) as archive, tempfile.TemporaryDirectory() as folder:
    held = set(archive.namelist())
    tracked = subprocess.run(["git", "ls-files", package], capture_output=True, text=True, check=True).stdout.split()
    lacking = {f"okid/{Path(name).relative_to(package)}" for name in tracked if Path(name).exists()} - held
    if lacking:
        sys.exit(f"{wheel.name}: lacks {', '.join(sorted(lacking))}")
    needed = set()
    program = next((name for name in held if name.endswith(".data/scripts/okid")), None)
    if program is None:
        sys.exit(f"{wheel.name}: lacks the program okid")
    for inside, also in (("okid/libokid.so", None), ("okid/libokid_host.so", "libokid.so"), (program, None)):
        library = Path(inside).name
        archive.extract(inside, folder)
        dynamic = subprocess.run(
            ["readelf", "-d", f"{folder}/{inside}"], capture_output=True, text=True, check=True
        ).stdout
        own = set(re.findall(r"\(NEEDED\).*\[(.*)\]", dynamic))
        foreign = sorted(name for name in own if not ALLOWED.fullmatch(name) and name != also)
        if foreign:
            sys.exit(f"{wheel.name}: {library} needs {', '.join(foreign)} of the system")
        if also and (also not in own or "[$ORIGIN]" not in dynamic):
            sys.exit(f"{wheel.name}: {library} does not take {also} from beside itself")
        needed |= own
size = wheel.stat().st_size / 1024
if wheel.stat().st_size > MOST_BYTES:
    sys.exit(f"{wheel.name}: has {size:.0f} KiB, expected at most {MOST_BYTES // 1024}")
print(f"wheel: {wheel.name}, {size:.0f} KiB, {len(held)} files, needs {', '.join(sorted(needed))}")
