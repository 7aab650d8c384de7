# SPDX-License-Identifier: MIT
"""`make test` judges okid and never the machine: no test of it reads a real clock, sleeps, or gives up early.

Read are all tests, and the helpers that they import. Left out is what a clock of its own excuses: the files of
tests/kernel/virtual, and what is marked `realtime` or `programs`.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
TESTS = ROOT / "tests"
ELSEWHERE = ("bench", "boards", "controller", "distribution", "embedded", "fuzz", "languages", "mutation", "wheel")
MAY_READ_A_CLOCK = {
    "support/waiting.py": "polls for a condition; its bound of half an hour only ends what would never end",
    "hostile/test_campaign_cluster.py": "strangers knock for two seconds; that a machine is busy lets nobody in",
    "fault/journal_disk.c": "a disk that stands still for as long as a file exists; decides nothing",
}
CLOCKS = re.compile(r"^(sleep|time|monotonic|perf_counter|process_time|thread_time|clock_gettime|getrusage)(_ns)?$")
C_CLOCKS = re.compile(
    r"\b(u?sleep|nanosleep|clock_gettime|clock_nanosleep|gettimeofday|getrusage|setitimer|alarm)\("
    r"|\bpoll\([^;]*, [1-9]\d{0,4}\)"
    r"|\b(steady_clock|system_clock|high_resolution_clock|sleep_for|sleep_until|wait_for|wait_until)\b"
)
LEAST_S = 1800  # on two processors beside thirty others that never rest, a step of 20 s took 500 s
GIVES_UP = {"settimeout", "wait", "join", "result", "communicate", "get", "recv", "until", "timeout"}
VIRTUAL = [line for line in (TESTS / "kernel" / "virtual").read_text().splitlines() if not line.startswith("#")]


def is_virtual(path: Path) -> bool:
    name = str(path.relative_to(ROOT))
    return any(name == one or name.startswith(one + "/") for one in VIRTUAL)


def is_excused(node: ast.AST) -> bool:
    """Marked `realtime` or `programs`, as a function or by the file's pytestmark."""
    told: list[ast.expr] = list(getattr(node, "decorator_list", ()))
    for one in getattr(node, "body", ()) if isinstance(node, ast.Module) else ():
        if isinstance(one, ast.Assign) and any(isinstance(t, ast.Name) and t.id == "pytestmark" for t in one.targets):
            told.append(one.value)
    return any(re.fullmatch(r"pytest\.mark\.(realtime|programs)", ast.unparse(one)) for one in told)


def number(node: ast.expr | None) -> float | None:
    return float(node.value) if isinstance(node, ast.Constant) and type(node.value) in (int, float) else None


def hasty(call: ast.Call) -> bool:
    """Gives up earlier than LEAST_S; 0 asks without waiting."""
    name = call.func.attr if isinstance(call.func, ast.Attribute) else getattr(call.func, "id", "")
    given = [key.value for key in call.keywords if key.arg in ("timeout", "timeout_s")]
    if name in GIVES_UP and len(call.args) == 1:
        given += call.args
    return any(0 < s < LEAST_S for s in map(number, given) if s is not None)


def faults_of(node: ast.AST, virtual: tuple[str, ...] = ()) -> Iterator[tuple[int, str]]:
    if is_excused(node) or getattr(node, "name", None) in virtual:
        return
    if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
        if node.value.id in ("time", "resource") and CLOCKS.match(node.attr):
            yield node.lineno, ast.unparse(node)
    elif isinstance(node, ast.ImportFrom) and node.module == "time":
        yield node.lineno, ast.unparse(node)
    elif isinstance(node, ast.Constant) and isinstance(node.value, str) and re.search(r"\btime[.]sleep\(", node.value):
        yield node.lineno, "it sleeps, in a text"
    elif isinstance(node, ast.Call) and hasty(node):
        yield node.lineno, ast.unparse(node)[-60:]
    for child in ast.iter_child_nodes(node):
        yield from faults_of(child, virtual)


def imported(tree: ast.Module, of: dict[str, list[Path]], beside: Path) -> Iterator[Path]:
    """Helpers among the tests: of the same folder, or of tests/support."""
    if is_excused(tree):
        return
    for node in ast.walk(tree):
        names = [node.module] if isinstance(node, ast.ImportFrom) else []
        names += [one.name for one in node.names] if isinstance(node, ast.Import) else []
        for name in names:
            yield from (p for p in of.get(str(name).split(".")[0], ()) if p.parent in (beside, TESTS / "support"))


def gate() -> list[Path]:
    """Python files of `make test` that run by the real clock."""
    files = [path for path in TESTS.rglob("*.py") if path.relative_to(TESTS).parts[0] not in ELSEWHERE]
    by_name: dict[str, list[Path]] = {}
    for path in files:
        by_name.setdefault(path.stem, []).append(path)
    found: set[Path] = set()
    new = {path for path in files if path.name.startswith(("test_", "conftest")) and not is_virtual(path)}
    while new:
        found |= new
        new = {h for p in new for h in imported(ast.parse(p.read_text()), by_name, p.parent)} - found
    return sorted(found)


def judged(path: Path) -> list[str]:
    if path.suffix == ".py":
        begin = f"{path.relative_to(ROOT)}::"
        virtual = tuple(one.removeprefix(begin) for one in VIRTUAL if one.startswith(begin))
        told = faults_of(ast.parse(path.read_text()), virtual)
    else:
        rows = enumerate(path.read_text().splitlines(), 1)
        told = ((at, row.strip()) for at, row in rows if C_CLOCKS.search(row.partition("//")[0]))
    return [f"{path.relative_to(ROOT)}:{at}: {what}" for at, what in sorted(set(told))]


def test_no_test_of_the_gate_reads_a_real_clock() -> None:
    unit = [path for room in ("unit", "fault", "support") for path in (TESTS / room).rglob("*.[ch]*")]
    files = [path for path in [*gate(), *unit] if str(path.relative_to(TESTS)) not in MAY_READ_A_CLOCK]
    assert len(files) > 250
    faults = [fault for path in files for fault in judged(path)]
    assert not faults, "run it in the kernel (tests/kernel/virtual), or mark it realtime:\n" + "\n".join(faults)


@pytest.mark.parametrize("name", MAY_READ_A_CLOCK)
def test_the_list_of_those_that_may_is_short(name: str) -> None:
    assert judged(TESTS / name), f"{name} reads no clock any more: take it from the list"


def test_what_is_named_is_there() -> None:
    for name in VIRTUAL:
        file, _, test = name.partition("::")
        assert (ROOT / file).exists() and (not test or f"def {test}(" in (ROOT / file).read_text()), name
    for text, bad in (("import time\ntime.monotonic()", 1), ("x.wait(60)", 1), ("x.wait(1800)", 0), ("until(f)", 0)):
        assert len(list(faults_of(ast.parse(text)))) == bad, text
    excused = "import time\n@pytest.mark.realtime\ndef test_a():\n    time.time()"
    assert not list(faults_of(ast.parse(excused)))
