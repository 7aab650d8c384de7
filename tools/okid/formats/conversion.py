# SPDX-License-Identifier: MIT
"""What okid-convert does: records, results and logs of CAN frames from one file format into another."""

from __future__ import annotations

import argparse
import contextlib
import hashlib
import signal
import socket
import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path

from okid._errors import Error, InputError, complain, say
from okid.data.interrupt import EXIT_INTERRUPTED
from okid.data.line_splitter import LineSplitter
from okid.data.progress import Progress
from okid.data.records import Record
from okid.formats.by_name import (
    EXTENSIONS,
    RESULT_EXTENSIONS,
    WRITTEN_EXTENSIONS,
    read_record,
    write_record,
    write_result,
)
from okid.formats.geometry_file import read_geometry
from okid.formats.log_names import LOG_EXTENSIONS, is_frame_csv
from okid.formats.mcap_file import write_events_mcap, write_live_mcap
from okid.formats.mdf4 import holds_frames
from okid.formats.result_tree import load_result
from okid.formats.uff import uff_losses

EXIT_DONE, EXIT_USAGE = 0, 2
_FRAMES_ONLY = (".log", ".asc", ".blf", ".trc", ".db")


def _kind(path: Path, read: bool) -> str:
    """ "live", "frames", "record", "result", "events" or "either" by the name; files .csv and .mf4 are looked into."""
    ending = path.suffix.lower()
    if read and path.is_socket():
        return "live"
    if ending == ".okj":
        raise InputError(f"{path}: a journal is read and written by the program: okid convert {path} OUT.log")
    if ending == ".json" and read:
        return "result"
    if ending == ".jsonl" and read:
        return "events"
    if (
        ending in _FRAMES_ONLY
        or path.name.lower().endswith(".can.csv")
        or (read and ending == ".csv" and is_frame_csv(path))
    ):
        return "frames"
    if ending == ".mf4":
        return "either" if not read else "frames" if holds_frames(path) else "record"
    samples = EXTENSIONS if read else WRITTEN_EXTENSIONS
    if ending in samples:
        return "record"
    known = sorted({*samples, *LOG_EXTENSIONS, *([".json", ".jsonl"] if read else [])})
    raise InputError(f"{path}: the extension is {ending!r}, expected one of {', '.join(known)}")


def _check_pair(source: Path, target: Path, given: str, wanted: str, config: str | None) -> None:
    if given == "frames" and wanted == "record" and config is None:
        raise InputError(
            f"{source} holds CAN frames and {target} would hold samples: which bits are which channel is in a "
            f"CONFIG.toml, so give --config CONFIG.toml (a table of frames: OUT.can.csv)"
        )
    if config is not None and (given, wanted) != ("frames", "record"):
        raise InputError("--config says which bits of CAN frames are which channel: IN holds frames, OUT samples")
    if given in ("events", "live") and target.suffix.lower() != ".mcap":
        raise InputError(f"{target}: events are written as .mcap")
    if given == "record" and wanted == "frames":
        raise InputError(
            f"{source} holds samples and {target} would hold CAN frames: which bits are which channel is in a "
            "CONFIG.toml, so okid convert IN.csv OUT.log -c CONFIG.toml"
        )
    if given == "result" and target.suffix.lower() not in RESULT_EXTENSIONS:
        raise InputError(f"{target}: an identified model is written as one of {', '.join(RESULT_EXTENSIONS)}")


def _convert_frames(args: argparse.Namespace, source: Path, target: Path) -> str:
    for option, value in (("--fs", args.fs), ("--channels", args.channels), ("--group", args.group)):
        if value is not None:
            raise InputError(f"{option} is for samples, {source} holds CAN frames")
    from okid.formats.can_log import convert_log  # python-can: only when it is needed

    summary = convert_log(source, target)
    _note(summary.remarks)
    span = (summary.last_s or 0.0) - (summary.first_s or 0.0)
    return f"{target}: {summary.frames} frames over {span:.3f} s"


def _decoded(args: argparse.Namespace, source: Path) -> Record:
    """The samples in a log of frames, on the grid of the config: `okid convert` makes them."""
    from okid.abi.program import run_program
    from okid.formats.can_log import convert_log

    if args.group is not None or args.fs is not None:
        raise InputError("--group and --fs are for files of samples; the rate of decoded frames is that of --config")
    with tempfile.TemporaryDirectory() as folder:
        log, table = Path(folder, "frames.log"), Path(folder, "samples.csv")
        _note(convert_log(source, log).remarks)
        run_program("convert", log, table, "-c", args.config)
        return read_record(table)


def _convert_record(args: argparse.Namespace, source: Path, target: Path) -> str:
    record = _decoded(args, source) if args.config else read_record(source, group=args.group, fs=args.fs)
    if args.channels is not None:
        record = record.select([name.strip() for name in args.channels.split(",")], str(source))
    with source.open("rb") as file:
        digest = hashlib.file_digest(file, "sha256").hexdigest()
    record.notes = {"source": source.name, "source_sha256": digest, **record.notes}
    write_record(target, record)
    lost = uff_losses(record) if target.suffix.lower() in (".uff", ".unv") else []
    lost = [one for one in lost if one not in ("note 'source'", "note 'source_sha256'")]
    _note(record.remarks + ([f"not kept in a universal file: {', '.join(lost)}"] if lost else []))
    rate = "no sample rate known" if record.fs_hz is None else f"{record.fs_hz:.9g} Hz"
    count = f"{len(record.names)} channel{'s' * (len(record.names) != 1)}"
    return f"{target}: {len(record.samples)} samples x {count}, {rate}"


def _convert_result(args: argparse.Namespace, source: Path, target: Path) -> str:
    for option, value in (("--fs", args.fs), ("--channels", args.channels), ("--group", args.group)):
        if value is not None:
            raise InputError(f"{option} is for samples, {source} is an identified model")
    raw = load_result(source)
    write_result(target, raw, None if args.geometry is None else read_geometry(args.geometry))
    places = raw.get("shape_dofs")
    over = f"over {len(places)} places" if places else f"of {len(raw['outputs'])} outputs"
    return f"{target}: {len(raw['modes'])} modes {over}"


def _live_lines(path: Path) -> Iterator[bytes]:
    """The lines of `[publish] socket` until the run ends, or Ctrl-C or SIGTERM comes."""
    with socket.socket(socket.AF_UNIX) as wire:
        wire.connect(str(path))

        def end(_number: int, _frame: object) -> None:
            with contextlib.suppress(OSError):
                wire.shutdown(socket.SHUT_RDWR)

        before = {each: signal.signal(each, end) for each in (signal.SIGINT, signal.SIGTERM)}
        try:
            lines = LineSplitter()
            while data := wire.recv(1 << 18):
                yield from lines.add(data)
        finally:
            for each, handler in before.items():
                signal.signal(each, handler)


def _note(remarks: Sequence[str]) -> None:
    for remark in remarks:
        complain("okid-convert", f"note: {remark}")


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="okid-convert",
        description="Convert measured samples, identified models or logs of CAN frames by file name extension. "
        f"Samples: {', '.join(EXTENSIONS)} (from .tdms on only read). Models: .json (okid.result/1) to "
        f"{', '.join(RESULT_EXTENSIONS)}. Events: .jsonl (okid run --events), or the socket of [publish] "
        "while a run goes on, to .mcap; *.ros2.mcap is for ROS 2. "
        "Logs: .log (candump -L), .asc, .blf, .trc, .db, .mf4, .can.csv.",
        epilog="examples: okid-convert run.mf4 run.csv --channels force,a1,a2; "
        "okid-convert result.json modes.uff --geometry frame.toml; okid-convert trace.blf trace.log; "
        "okid-convert hits/*.mat tables/",
    )
    parser.add_argument("sources", metavar="IN", nargs="+", help="file to read, or socket of a run")
    parser.add_argument("target", metavar="OUT", help="file to write, whole or not at all; a folder: each IN in it")
    parser.add_argument("--to", metavar="EXT", help="of the files in a folder OUT: csv (default), mat, h5, log ...")
    parser.add_argument("--fs", type=float, metavar="HZ", help="sample rate, overrides that of the file")
    parser.add_argument("--channels", metavar="a,b", help="only these channels, in this order")
    parser.add_argument(
        "--group", metavar="G", help="part of IN when it holds several rasters: its error message lists them"
    )
    parser.add_argument(
        "--geometry",
        metavar="FILE",
        help="a structure (CONFIG.toml, .csv, .uff) gives a model's nodes and lines in .uff",
    )
    parser.add_argument(
        "--config", metavar="CONFIG.toml", help="decode a log of CAN frames into samples by this config"
    )
    parser.add_argument("--force", action="store_true", help="replace OUT when it is there")
    parser.add_argument("--quiet", action="store_true", help="no summary, no progress")
    return parser


def _pairs(args: argparse.Namespace) -> list[tuple[Path, Path]]:
    """What is read and what is written; no two files of a folder may end under one name."""
    target, sources = Path(args.target), [Path(one) for one in args.sources]
    if not target.is_dir() and not args.target.endswith("/"):
        if len(sources) > 1:
            raise InputError(f"{target}: found {len(sources)} files for one OUT, expected a folder, as tables/")
        if args.to is not None:
            raise InputError(f"--to {args.to} is for a folder OUT, {target} says itself what it is")
        return [(sources[0], target)]
    ending = "." + (args.to or "csv").lstrip(".")
    pairs = [(one, target / f"{one.stem}{ending}") for one in sources]
    first: dict[Path, Path] = {}
    for source, out in pairs:
        if out in first:
            raise InputError(f"{out}: {first[out]} and {source} would both be written there")
        first[out] = source
    target.mkdir(exist_ok=True)
    return pairs


def _run(args: argparse.Namespace, source: Path, target: Path) -> str:
    if not source.exists():
        raise InputError(f"{source}: No such file or directory")
    given, wanted = _kind(source, True), _kind(target, False)
    _check_pair(source, target, given, wanted, args.config)
    if args.geometry is not None and (given != "result" or target.suffix.lower() not in (".uff", ".unv")):
        raise InputError("--geometry is for an identified model written as .uff or .unv")
    if target.exists() and target.samefile(source):
        raise InputError(f"{target}: IN and OUT are the same file: name another OUT")
    if target.is_dir() or (target.exists() and not args.force):
        remedy = "" if target.is_dir() else ": give --force to replace it"
        raise InputError(f"{target}: is there already{remedy}")
    if given == "frames" and not args.config:
        return _convert_frames(args, source, target)
    if given == "events":
        with source.open("rb") as lines:
            return f"{target}: {write_events_mcap(target, lines)} events"
    if given == "live":
        return f"{target}: {write_live_mcap(target, _live_lines(source))} events and blocks of signals"
    return _convert_result(args, source, target) if given == "result" else _convert_record(args, source, target)


def convert(arguments: Sequence[str] | None = None) -> int:
    """The command with its arguments (None = those of the process); exit code 0, 2 or 130 (interrupted)."""
    args = _parser().parse_args(arguments)
    done: list[str] = []
    try:
        pairs = _pairs(args)
        with Progress("okid-convert", not args.quiet) as shown:
            for k, (source, target) in enumerate(pairs):
                shown.stage("converting", k / len(pairs) if len(pairs) > 1 else None, str(source))
                done.append(_run(args, source, target))
    except Error as fault:
        complain("okid-convert", fault)
        return EXIT_USAGE
    except OSError as fault:
        complain("okid-convert", f"{fault.filename or args.target}: {fault.strerror or fault}")
        return EXIT_USAGE
    except KeyboardInterrupt:
        complain("okid-convert", "interrupted, the file in work was not written")
        return EXIT_INTERRUPTED
    finally:
        for line in done if not args.quiet else []:
            say(line)
    return EXIT_DONE
