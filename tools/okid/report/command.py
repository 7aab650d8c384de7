# SPDX-License-Identifier: MIT
"""okid-report: the command."""

from __future__ import annotations

import argparse
import difflib
import os
import re
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import NoReturn

from okid._errors import Error, InputError, complain, say, shown
from okid.data.interrupt import halt_if_interrupted
from okid.data.progress import Progress
from okid.report.other_kinds import MADE_BY, check_kind
from okid.report.pdf import browser, print_pdf
from okid.report.targets import check_place, check_target, write_whole
from okid.report.written_line import written_line


class _Parser(argparse.ArgumentParser):
    """Tells what is wrong with a command line in one line."""

    def error(self, message: str) -> NoReturn:
        if "arguments are required" in message:
            message = f"RESULT.json is missing: an okid.result/1, {MADE_BY}; it is named before --record"
        elif found := re.fullmatch(r"argument (\S+): expected (?:one|at least one) argument", message):
            message = f"{found[1]} needs {self._wanted[found[1]]} after it"
        print(f"{self.prog}: {message} (example and all options: {self.prog} --help)", file=sys.stderr)
        raise SystemExit(2)

    @property
    def _wanted(self) -> dict[str, str]:
        """Option -> what stands behind it."""
        return {name: str(one.metavar) for one in self._actions for name in one.option_strings}

    def refuse(self, rest: Sequence[str]) -> NoReturn:
        """What no argument takes: an option that is not known, or a second file."""
        word = next((one for one in rest if one.startswith("--")), rest[0])
        if not word.startswith("-"):
            self.error(
                f"{word}: found after RESULT.json, expected one result; a record goes after --record, the events of a "
                "run after --events"
            )
        near = difflib.get_close_matches(word.partition("=")[0], self._wanted, 1)
        self.error(f"{word} is no option" + (f": did you mean {near[0]}?" if near else ""))


def _parser() -> _Parser:
    parser = _Parser(
        prog="okid-report",
        description="Write one self-contained HTML report of an identified model.",
        epilog="example: okid identify run.csv --inputs force --outputs a1,a2,a3 --json r.json && "
        "okid-report r.json --record run.csv --out report.html",
    )
    parser.add_argument("result", metavar="RESULT.json", help="okid.result/1, as `okid identify --json` writes it")
    parser.add_argument(
        "--record", metavar="FILE", nargs="+", action="extend", default=[],
        help="the record, the hits, or the frequency responses that the result is of (one file or several; default: "
        "the hits that it names): adds measured responses, stabilization, residual",
    )  # fmt: skip
    parser.add_argument("--events", metavar="FILE.jsonl", help="events of the run: adds completeness, tracking, alarms")
    parser.add_argument(
        "--geometry", metavar="FILE", help="[geometry] of a CONFIG.toml, a .csv or a .uff: adds moving mode shapes"
    )
    parser.add_argument("--config", metavar="CONFIG.toml", help="its text goes into the report, its [geometry] too")
    parser.add_argument("--compare", metavar="EARLIER.json", help="an earlier result: shifts since then, MAC, CoMAC")
    parser.add_argument("--out", metavar="FILE.html|-", help="default: the result's name with .html; - is stdout")
    parser.add_argument("--pdf", metavar="FILE.pdf", help="print the page too; needs Chromium or Chrome on PATH")
    parser.add_argument("--figures", metavar="FOLDER", help="every picture as .svg, .png and .csv too")
    parser.add_argument("--title", metavar="TEXT", help="heading of the report")
    parser.add_argument("--quiet", action="store_true", help="no summary, no progress")
    return parser


def _check_targets(args: argparse.Namespace, target: Path | None) -> None:
    """Nothing that is read is written over, the two outputs are two files, and both have a folder."""
    inputs = {key: getattr(args, key) for key in ("result", "record", "events", "geometry", "config", "compare")}
    if target is not None:
        check_target(target, inputs)
        if args.out or target.parent.is_dir():  # else the result is not there either
            check_place(target, "--out")
    if args.pdf == "-":
        raise InputError("--pdf -: a PDF is not written to stdout, expected the name of a file")
    if args.pdf:
        check_target(args.pdf, {**inputs, "report": target}, ".pdf")
        check_place(args.pdf, "--pdf", ".pdf")


def _page(args: argparse.Namespace, written: str, shown: Progress) -> str:
    """The HTML; matplotlib and scipy load here, after all that can be refused without them."""
    from okid.report.compose import build
    from okid.report.loaded import load_result

    return build(
        load_result(args.result), args.record or None, args.title, events=args.events, geometry=args.geometry,
        config=args.config, compare=args.compare, source=args.result, written=written,
        figures_folder=args.figures, progress=lambda share: shown.stage("drawing", share),
    )  # fmt: skip


def _print(program: str, html: Path | None, text: str, pdf: str) -> None:
    """The PDF of the page, from its file or, when it went to stdout, from a temporary one."""
    if html is not None:
        print_pdf(program, html, pdf)
        return
    with tempfile.TemporaryDirectory(prefix="okid-report-") as folder:
        page = Path(folder) / "report.html"
        page.write_text(text, encoding="utf-8")
        print_pdf(program, page, pdf)


def _run(args: argparse.Namespace, target: Path | None, written: str) -> None:
    check_kind(args.result, "result")
    _check_targets(args, target)
    program = browser() if args.pdf else ""
    with Progress("okid-report", not args.quiet) as progress:
        progress.stage("reading")
        text = _page(args, written, progress)
    halt_if_interrupted()
    messages = sys.stdout
    if target is None:
        messages = sys.stderr
        sys.stdout.write(text)
        sys.stdout.flush()
    else:
        write_whole(target, text)
        if not args.quiet:
            say(f"{target}: {len(text.encode('utf-8')) // 1024} KiB")
    if args.pdf:
        with Progress("okid-report", not args.quiet) as progress:
            progress.stage("printing the PDF")
            _print(program, target, text, args.pdf)
    if args.pdf and not args.quiet:
        print(shown(f"{args.pdf}: {Path(args.pdf).stat().st_size // 1024} KiB"), file=messages)


def _system_words(fault: OSError, target: Path | None) -> str:
    """What the system refused, with its place and what to do."""
    place, words = fault.filename or target or "stdout", str(fault.strerror or fault)
    if str(place) == str(target) and ": " not in words and "expected" not in words:
        words += ": the report cannot be written there, name another file by --out"
    return f"{place}: {words}"


def main(arguments: Sequence[str] | None = None) -> int:
    """The command without its guard against Ctrl-C; returns the exit code 0 or 2."""
    given = sys.argv[1:] if arguments is None else list(arguments)
    parser = _parser()
    args, rest = parser.parse_known_args(given)
    if rest:
        parser.refuse(rest)
    target = None if args.out == "-" else Path(args.out or Path(args.result).with_suffix(".html"))
    try:
        _run(args, target, written_line("okid-report", given))
    except Error as fault:
        complain("okid-report", fault)
        return 2
    except BrokenPipeError:  # the reader of stdout has seen enough
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    except OSError as fault:
        complain("okid-report", _system_words(fault, target))
        return 2
    return 0
