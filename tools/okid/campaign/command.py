# SPDX-License-Identifier: MIT
"""okid-campaign: the command with its sub-commands."""

from __future__ import annotations

import argparse
import json
import signal
import sys
from collections.abc import Callable, Sequence
from dataclasses import asdict, replace
from datetime import datetime
from pathlib import Path
from types import FrameType
from typing import Any

from okid._errors import Error, IdentificationError, InputError, complain, say
from okid.campaign.grouping import group_records
from okid.campaign.pieces import make_identifier
from okid.campaign.record_list import list_records
from okid.campaign.spec import CampaignSpec, Trend, load_spec
from okid.campaign.virtual_year import Year, simulate_year
from okid.data.input_file import parse_json, read_input
from okid.data.progress import Progress
from okid.data.whole_file import whole_file
from okid.report.written_line import written_line

EXIT_DONE, EXIT_USAGE, EXIT_NO_MODEL, EXIT_INTERRUPTED = 0, 2, 3, 130
_SHOWN = 10


def _complain(text: object) -> None:
    """One line on stderr."""
    complain("okid-campaign", text)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="okid-campaign",
        description="Thousands of records into exact sums on Dask, modes of every group, trends with alarms.",
        epilog="example: okid-campaign simulate year && okid-campaign run year/SPEC.toml && open year/out/report.html. "
        "Exit codes: 0 done, 2 wrong usage or input, 3 no group gives a model, 130 interrupted (run again to go on).",
    )
    kinds = parser.add_subparsers(dest="kind", required=True, metavar="run|check|report|simulate")
    run = kinds.add_parser("run", help="sum the new records, identify, write tables and report",
                           epilog="example: okid-campaign run SPEC.toml --workers 8")  # fmt: skip
    run.add_argument("spec", metavar="SPEC.toml")
    run.add_argument("--workers", type=_positive, metavar="N", help="processes of the embedded cluster")
    run.add_argument("--cluster", nargs="?", const="", metavar="tcp://HOST:PORT",
                     help="address of a running Dask scheduler of yours (default: that of the spec)")  # fmt: skip
    run.add_argument("--out", metavar="FOLDER", help="in place of [output] folder")
    run.add_argument("--quiet", action="store_true", help="faults only")
    check = kinds.add_parser("check", help="check the spec and list what it finds; no record is read",
                             epilog="example: okid-campaign check SPEC.toml")  # fmt: skip
    check.add_argument("spec", metavar="SPEC.toml")
    report = kinds.add_parser("report", help="write the report again, from the tables",
                              epilog="example: okid-campaign report year/out")  # fmt: skip
    report.add_argument("folder", metavar="OUT_FOLDER")
    report.add_argument("--html", metavar="FILE.html", help="default: report.html in the folder")
    _add_simulate(kinds)
    return parser


def _positive(text: str) -> int:
    if not text.isdigit() or not 1 <= int(text) <= 4096:
        raise argparse.ArgumentTypeError(f"{text!r} is no number from 1 to 4096")
    return int(text)


def _add_simulate(kinds: Any) -> None:
    year = Year()
    simulate = kinds.add_parser("simulate", help="a year of a 3-storey frame with one damage",
                                epilog="example: okid-campaign simulate year --records 1460 --damage 0.01")  # fmt: skip
    simulate.add_argument("folder", metavar="OUT_FOLDER")
    for name, kind, what in (
        ("records", int, "records of the year"), ("samples", int, "of a record"), ("fs_hz", float, "sample rate"),
        ("days", float, "length of the year"), ("seed", int, "of all random numbers"),
        ("softening", float, "relative loss of stiffness a °C"),
        ("damage", float, "relative loss of stiffness of one column, 0 = none"),
        ("damage_day", float, "when"), ("damaged", int, "column 1, 2 or 3"),
    ):  # fmt: skip
        option = f"--{name.replace('_hz', '').replace('_', '-')}"
        simulate.add_argument(option, dest=name, type=kind, default=getattr(year, name), metavar="N",
                              help=f"{what} (%(default)s)")  # fmt: skip
    simulate.add_argument("--ambient", action="store_true", help="unknown forces at all storeys, outputs only")


def _about(spec: CampaignSpec, remarks: Sequence[str]) -> dict[str, Any]:
    """What the page needs beside the tables, for campaign.json."""
    return {
        "schema": "okid.campaign/1", "title": spec.title, "by": list(spec.by), "channels": asdict(spec.channels),
        "identification": asdict(spec.identification), "trend": asdict(spec.trend), "remarks": list(remarks),
    }  # fmt: skip


def _save_about(folder: Path, about: dict[str, Any]) -> None:
    with whole_file(folder / "campaign.json") as part:
        part.write_text(json.dumps(about, indent=1, default=lambda value: value.isoformat()) + "\n", encoding="utf-8")


def _load_about(folder: Path) -> tuple[dict[str, Any], Trend]:
    path = folder / "campaign.json"
    try:
        about = parse_json(read_input(path).decode("utf-8"))
        if about["schema"] != "okid.campaign/1":
            raise ValueError(f"schema is {about['schema']!r}, expected 'okid.campaign/1'")
        given = dict(about["trend"])
        until = given["training_until"]
        given["training_until"] = None if until is None else datetime.fromisoformat(until)
        given["series"] = None if given["series"] is None else tuple(given["series"])
        return about, Trend(**given)
    except InputError as fault:
        raise InputError(f"{fault}; expected the output folder of okid-campaign run") from None
    except (ValueError, KeyError, TypeError, ArithmeticError) as fault:
        raise InputError(f"{path}: damaged: {fault}") from None


def _check(args: argparse.Namespace) -> int:
    spec = load_spec(args.spec)
    method = "method auto" if spec.identification.method == "auto" else f"{make_identifier(spec).lags} lags"
    records, bad = list_records(spec)
    groups, keyless = group_records(spec, records)
    size = sum(ref.size for ref in records)
    say(
        f"{spec.path}: {len(records)} records, {size / 1e6:.1f} MB, "
        f"{len(groups)} groups by {', '.join(spec.by) or 'nothing'}"
    )
    sizes = sorted(len(group.records) for group in groups)
    if sizes:
        say(f"records a group: {sizes[0]} to {sizes[-1]}; {method}; series: "
            f"{', '.join(sorted({group.series for group in groups})[:_SHOWN])}")  # fmt: skip
    for one in [*bad, *keyless][:_SHOWN]:
        _complain(f"{one.name}: {one.reason}: it would be left out")
    if not groups:
        raise InputError(f"{spec.path}: no record belongs to a group")
    return EXIT_DONE


def _scheduler(args: argparse.Namespace, spec: CampaignSpec) -> str | None:
    """The Dask scheduler to use, None = the embedded cluster. It runs code here: a file alone does not choose it."""
    if args.cluster is None and spec.address is not None and not args.workers:
        raise InputError(
            f'{spec.path}: [cluster], key "address": {spec.address!r} runs code on this computer: give --cluster if it '
            "is a scheduler of yours, --workers N for the embedded cluster"
        )
    if args.cluster == "" and spec.address is None:
        raise InputError(f'{spec.path}: --cluster without an address, and [cluster] has no "address"')
    return None if args.cluster is None else args.cluster or spec.address


def _run(args: argparse.Namespace, written: str) -> int:
    from okid.campaign.run import run_campaign
    from okid.campaign.tables import make_tables, write_tables

    spec = load_spec(args.spec)
    spec = replace(
        spec, workers=args.workers or spec.workers, address=_scheduler(args, spec),
        folder=Path(args.out) if args.out else spec.folder,
    )  # fmt: skip
    if spec.identification.method != "auto":
        make_identifier(spec)  # sizes that the library refuses are reported before any work
    with Progress("okid-campaign", not args.quiet) as shown:
        shown.stage(f"listing the records of {spec.path}")
        outcome = run_campaign(spec, on_step=_counted(shown))
        shown.stage("writing the tables and the report")
        tables = make_tables(spec, outcome)
        write_tables(spec.folder, tables)
        about = _about(spec, outcome.remarks)
        _save_about(spec.folder, about)
        lines = _page(spec.folder / "report.html", tables, about, spec.trend, written)
    for one in outcome.skipped[:_SHOWN]:
        _complain(f"left out: {one.name}: {one.reason}")
    if len(outcome.skipped) > _SHOWN:
        _complain(f"left out: {len(outcome.skipped) - _SHOWN} more, see {spec.folder}/records.parquet")
    with_modes = int((tables["groups"]["modes"] > 0).sum()) if len(tables["groups"]) else 0
    if not args.quiet:
        summed = int((tables["records"]["status"] == "summed").sum()) if len(tables["records"]) else 0
        say(f"{summed} records summed ({outcome.read} read now), {len(outcome.skipped)} left out; "
            f"{with_modes} of {len(outcome.groups)} groups with modes")  # fmt: skip
        for line in [*lines, *outcome.remarks[:_SHOWN]]:
            say(line)
        say(f"{spec.folder}/report.html, records.parquet, groups.parquet, modes.parquet")
    if with_modes == 0:
        faults = [fault for fault in tables["groups"]["fault"].dropna().tolist()] if len(tables["groups"]) else []
        raise IdentificationError(f"no group gives a model: {faults[0] if faults else 'there is none'}")
    return EXIT_DONE


def _counted(shown: Progress) -> Callable[[int, int, int, int], None]:
    """What is called after every step of a run: the line of its progress."""

    def on_step(records: int, of_records: int, groups: int, of_groups: int) -> None:
        share = (records + groups) / max(1, of_records + of_groups)
        shown.stage("identifying", share, f"{records}/{of_records} records, {groups}/{of_groups} groups")

    return on_step


def _page(path: Path, tables: dict[str, Any], about: dict[str, Any], trend: Trend, written: str) -> list[str]:
    """Write the page; the sentences of its verdicts."""
    from okid.campaign.trend_page import build_page, verdict, write_page

    html, all_series = build_page(tables, about, trend, written)
    write_page(path, html)
    return [line for series in all_series[:_SHOWN] for line in verdict(series)[1]]


def _report(args: argparse.Namespace, written: str) -> int:
    from okid.campaign.tables import read_tables

    folder = Path(args.folder)
    about, trend = _load_about(folder)
    target = Path(args.html) if args.html else folder / "report.html"
    for line in _page(target, read_tables(folder), about, trend, written):
        say(line)
    say(f"{target}: {target.stat().st_size // 1024} KiB")
    return EXIT_DONE


def _simulate(args: argparse.Namespace) -> int:
    fields = Year.__dataclass_fields__
    year = Year(**{name: getattr(args, name) for name in fields})
    folder = Path(args.folder)
    with Progress("okid-campaign") as shown:
        simulate_year(folder, year, lambda done: shown.stage("simulating", done / max(1, year.records)))
    say(f"{folder}/SPEC.toml: {year.records} records; okid-campaign run {folder}/SPEC.toml")
    return EXIT_DONE


def _as_interrupt(_number: int, _frame: FrameType | None) -> None:
    raise KeyboardInterrupt


def main(arguments: Sequence[str] | None = None) -> int:
    """Entry point of okid-campaign; returns the exit code."""
    given = sys.argv[1:] if arguments is None else list(arguments)
    args = _parser().parse_args(given)
    before = signal.signal(signal.SIGTERM, _as_interrupt)
    try:
        if args.kind == "check":
            return _check(args)
        if args.kind == "simulate":
            return _simulate(args)
        return (_run if args.kind == "run" else _report)(args, written_line("okid-campaign", given))
    except InputError as fault:
        _complain(fault)
        return EXIT_USAGE
    except Error as fault:
        _complain(fault)
        return EXIT_NO_MODEL
    except OSError as fault:
        _complain(f"{fault.filename or 'file'}: {fault.strerror or fault}")
        return EXIT_USAGE
    except KeyboardInterrupt:
        _complain("interrupted; what is finished is kept, run again to go on")
        return EXIT_INTERRUPTED
    finally:
        signal.signal(signal.SIGTERM, before)
