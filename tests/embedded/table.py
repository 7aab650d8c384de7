# SPDX-License-Identifier: MIT
"""The measured sizes, stacks and instruction counts of the node, as the tables of docs/howto/port-to-a-board.md.

usage: table.py FOLDER   (build-embedded, after tests/embedded/test_node.py has run)
"""

from __future__ import annotations

import json
import re
import subprocess
import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parent / "support"))
import stack_depth  # noqa: E402

CLOCK_HZ, CYCLES_PER_INSTRUCTION = 168e6, 1.5
SMALL_STACK = 500
IMAGES = ("m4-double-p20", "m4-double-p10", "m4-float-p20", "m7-double-p20", "m4-float-O2-pm10", "m7-double-O2-pm10")
KERNELS = {
    "accumulator": (
        "absorb",
        "accumulator",
        "centre",
        "gram",
        "slots",
        "serial",
        "kernel",
        "kernel_integer",
        "spectrum",
    ),
    "correlation sums": ("correlation", "correlation_sums", "correlation_serial"),
    "observer, dense": ("observer",),
    "observer, structured": ("structured",),
    "stability of the observer": ("companion",),
    "Markov parameters": ("markov",),
    "ERA and ERA/DC": ("era", "era_correlation", "triangular"),
    "modes": ("modal",),
    "linear algebra (Eigen)": ("linalg_eigen", "linalg_eigen_symmetric"),
}


def print_table(head: list[str], rows: list[list[str]]) -> None:
    """Markdown with columns of one width."""
    widths = [max(len(row[i]) for row in [head, *rows]) for i in range(len(head))]
    for row in [head, ["-" * w for w in widths], *rows]:
        print("| " + " | ".join(cell.ljust(w) for cell, w in zip(row, widths, strict=True)) + " |")


HEAD = ["image", "text", "data", "bss", "of it sums", "work", "stack", "RAM in all", "instructions", "kHz",
        "one identification", "f, ζ off the host"]  # fmt: skip


def image_row(name: str, m: dict[str, float]) -> list[str]:
    """The cells of one image. m: what test_node.py measured; bytes, ticks."""
    per_tick = 1e9 / m["tick_hz"]
    absorb = m["summing_ticks"] * per_tick / m["samples"]
    link = m["link_ticks"] * per_tick / m["samples"]
    khz = [CLOCK_HZ / CYCLES_PER_INSTRUCTION / n / 1e3 for n in (absorb, absorb + link)]
    identify = m["identifying_ticks"] * per_tick
    seconds = identify * CYCLES_PER_INSTRUCTION / CLOCK_HZ
    ram = m["data"] + m["bss"] + m["stack_used"]
    sizes = [str(m[key]) for key in ("text", "data", "bss", "state_bytes", "work_bytes", "stack_used")]
    return [name, *sizes, f"{ram} ({ram / 1024:.1f} KiB)", f"{absorb:.0f} + {link:.0f}", f"{khz[0]:.0f}, {khz[1]:.0f}",
            f"{identify / 1e6:.1f} M, {seconds:.2f} s", f"{m['f_error']:.0e}, {m['zeta_error']:.0e}"]  # fmt: skip


def print_images(folder: Path) -> None:
    """One row an image, measured in QEMU."""
    rows = []
    for name in IMAGES:
        path = folder / f"{name}.json"
        if not path.is_file():
            raise SystemExit(
                f"table: {path} is not there, expected what tests/embedded/test_node.py measured; run it first"
            )
        rows.append(image_row(name, json.loads(path.read_text())))
    print("\nThe node, W1 (1 input, 3 outputs, 10,000 samples of 16 bits), bytes. Stack: deepest seen in QEMU;")
    print("pm10: 2 inputs, 2 outputs, 4 modes with deviations; off NumPy in the place of the host.")
    print("instructions a sample: summing + packet; kHz without and with packets, and seconds of one identification:")
    print(f"at {CLOCK_HZ / 1e6:.0f} MHz with {CYCLES_PER_INSTRUCTION} cycles an instruction.\n")
    print_table(HEAD, rows)


def print_correlation(folder: Path) -> None:
    """The nodes that sum for a refinement on the host: memory and instructions, measured in QEMU."""
    rows = []
    for name in ("m4-double-p300", "m7-double-p300"):
        m = json.loads((folder / f"{name}.json").read_text())
        each = m["summing_ticks"] * 1e9 / m["tick_hz"] / m["samples"]
        ram = m["data"] + m["bss"] + m["stack_used"]
        sizes = [str(m[key]) for key in ("text", "bss", "state_bytes", "work_bytes", "stack_used")]
        rows.append([name, *sizes, f"{ram} ({ram / 1024:.1f} KiB)", f"{each:.0f}"])
    print("\nCorrelation sums, 300 lags, two runs, 16-bit codes of W1; work: the written state:\n")
    print_table(["image", "text", "bss", "of it sums", "work", "stack", "RAM in all", "instructions a sample"], rows)


def print_core(folder: Path) -> None:
    """okid_core.c alone, measured by test_core.py."""
    rows = []
    for path in sorted((folder / "core").glob("*.json")):
        for optimise, m in json.loads(path.read_text()).items():
            each = [m[key] for key in ("sums16", "sums24", "correlation")]
            rows.append([f"{path.stem} {optimise}", *(str(cell) for cell in (m["whole"], m["used"], *each))])
    print("\nokid_core.c; in an image: what feed.c uses of it, with start-up code, libgcc and C library;")
    print("instructions a sample: 16 bits and 24 bits at p = 20, correlations of 16 bits at 100 lags:\n")
    print_table(["processor", "okid_core.o", "in an image", "16 bits", "24 bits", "correlations"], rows)


def text_bytes(folder: Path) -> dict[str, int]:
    """Code and constants of each object file of the library, before the linker leaves out what is not called."""
    objects = sorted((folder / "okid" / "lib").rglob("*.obj"))
    listing = subprocess.run(
        ["arm-none-eabi-size", *map(str, objects)], capture_output=True, text=True, check=True
    ).stdout
    lines = (line.split() for line in listing.splitlines()[1:])
    return {re.sub(r"\.(c|cpp)\.obj$", "", Path(words[5]).name): int(words[0]) for words in lines}


def print_kernels(folder: Path) -> None:
    """Code of each kernel in both number types."""
    sizes = [text_bytes(folder / name) for name in ("m4-double", "m4-float", "m7-double")]
    rows = [
        [kernel, *(str(sum(size.get(part, 0) for part in parts)) for size in sizes)]
        for kernel, parts in KERNELS.items()
    ]
    print("\nCode and constants of the kernels, bytes:\n")
    print_table(["kernel", "M4 double", "M4 float", "M7 double"], rows)


def print_stacks(folder: Path) -> None:
    """Deepest path below each public function, without what libgcc and libm take."""
    depths = []
    for name in ("m4-double", "m4-float", "m7-double"):
        frames, calls, wrong = stack_depth.read([folder / name / "okid" / "lib"])
        depth, _, loops = stack_depth.deepest(frames, calls)
        if wrong or loops or not frames:
            found = "; ".join([*wrong, *loops]) or "no frame: the library was built without -fstack-usage"
            raise SystemExit(f"table: {name}: {found}")
        depths.append(depth)
    headers = (HERE.parents[1] / "lib" / "include" / "okid").rglob("*.h")
    public = set(re.findall(r"\b(okid_\w+)\s*\(", "".join(p.read_text("utf-8") for p in headers)))
    names = sorted(
        (n for n in depths[0] if n in public and depths[0][n] >= SMALL_STACK), key=lambda n: (-depths[0][n], n)
    )
    print("\nWorst-case stack below each function by the compiler's call graph, bytes (libgcc and libm not counted;")
    print(f"the other functions take less than {SMALL_STACK}):\n")
    print_table(
        ["function", "M4 double", "M4 float", "M7 double"], [[n, *(str(d.get(n, "")) for d in depths)] for n in names]
    )


def main() -> int:
    folder = Path(sys.argv[1])
    print_kernels(folder)
    print_stacks(folder)
    print_images(folder)
    print_correlation(folder)
    print_core(folder)
    return 0


if __name__ == "__main__":
    sys.exit(main())
