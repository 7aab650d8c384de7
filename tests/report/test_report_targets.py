# SPDX-License-Identifier: MIT
"""okid-report writes over nothing that it reads, to stdout when asked, and nothing at all after Ctrl-C."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import okid
import pytest
import report_files
from okid import report
from okid.record.demo import demo_record
from report_files import FS

pytestmark = pytest.mark.usefixtures("words_only")

COMMAND = [sys.executable, "-m", "okid.report"]


@pytest.fixture(scope="module")
def given(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with r.json, r.csv, e.jsonl, c.toml."""
    folder = tmp_path_factory.mktemp("targets")
    u, y = demo_record(1500)
    okid.identify(u, y, fs=FS, p=15, sigma_blocks=0).save(folder / "r.json")
    report_files.write_csv(folder / "r.csv", ["u1", "y1", "y2", "y3"], np.hstack([u, y]), FS)
    report_files.write_events(folder / "e.jsonl", ["y1"], [10.0])
    (folder / "c.toml").write_text(
        '[geometry]\nnodes = [[0, 0, 0]]\ndofs = [[1, "x"], [1, "y"], [1, "z"]]\nlines = []\n', encoding="utf-8"
    )
    (folder / "link.html").symlink_to(folder / "r.csv")
    os.link(folder / "r.json", folder / "hard.pdf")
    return folder


def contents(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.iterdir()}


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--out", "r.json"], "r.json: is a result to be read, a report does not overwrite it"),
        (["--out", "../{}/r.json"], "is a result to be read"),
        (["--record", "r.csv", "--out", "r.csv"], "r.csv: is a record to be read"),
        (["--record", "r.csv", "--out", "link.html"], "link.html: is a record to be read"),
        (["--events", "e.jsonl", "--out", "e.jsonl"], "is an events file to be read"),
        (["--config", "c.toml", "--out", "c.toml"], "is a configuration to be read"),
        (["--geometry", "c.toml", "--out", "c.toml"], "is a geometry to be read"),
        (["--pdf", "r.json"], "r.json: is a result to be read"),
        (["--pdf", "hard.pdf"], "hard.pdf: is a result to be read"),
        (["--out", "o.html", "--pdf", "o.html"], "o.html: is to be the report"),
        (["--out", "o.html", "--pdf", "r.csv"], "r.csv: exists and is not PDF"),
        (["--out", "r.csv"], "r.csv: exists and is not HTML"),
        (["--pdf", "-"], "--pdf -: a PDF is not written to stdout"),
    ],
)
def test_what_is_read_is_not_written_over(
    given: Path, options: list[str], words: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    before = contents(given)
    monkeypatch.chdir(given)
    assert report.main(["r.json", *(one.format(given.name) for one in options)]) == 2
    message = capsys.readouterr().err
    assert words in message
    assert message.count("\n") == 1
    assert contents(given) == before


def test_the_function_refuses_too(given: Path, tmp_path: Path) -> None:
    before = contents(given)
    result = report.load_result(given / "r.json")
    with pytest.raises(okid.InputError, match="is a record to be read"):
        report.write_report(result, given / "r.csv", record=given / "r.csv")
    with pytest.raises(okid.InputError, match="exists and is not HTML"):
        report.write_report(result, given / "r.csv")
    assert contents(given) == before
    for name, text in (("old.htm", "text"), ("page", "\ufeff <!doctype HTML>"), ("empty.txt", "")):
        (tmp_path / name).write_text(text, encoding="utf-8")
        assert report.write_report(result, tmp_path / name) == (tmp_path / name).stat().st_size


def test_what_a_result_may_be(given: Path, tmp_path: Path) -> None:
    raw = json.loads((given / "r.json").read_text(encoding="utf-8"))
    report.write_report(raw, tmp_path / "dict.html")
    report.write_report(report.load_result(given / "r.json"), tmp_path / "loaded.html")
    assert (tmp_path / "dict.html").read_bytes() == (tmp_path / "loaded.html").read_bytes()
    wrong: list[Any] = [None, [raw], 3.0]
    for one in wrong:
        with pytest.raises(okid.InputError, match="result is .*, expected what okid.identify"):
            report.write_report(one, tmp_path / "no.html")
    with pytest.raises(okid.InputError, match="the result: schema is None"):
        report.write_report({}, tmp_path / "no.html")
    nowhere: Any = None
    with pytest.raises(okid.InputError, match="path is None"):
        report.write_report(raw, nowhere)
    array: Any = np.zeros((3, 3))
    with pytest.raises(okid.InputError, match="record is array"):
        report.write_report(raw, tmp_path / "no.html", array)
    assert not (tmp_path / "no.html").exists()


def test_the_page_on_stdout(given: Path, tmp_path: Path) -> None:
    before = contents(given)
    done = subprocess.run(
        [*COMMAND, str(given / "r.json"), "--out", "-"], capture_output=True, cwd=tmp_path, timeout=1800
    )  # fmt: skip
    assert done.returncode == 0
    assert done.stderr == b""
    assert done.stdout.startswith(b"<!DOCTYPE html>")
    assert done.stdout.endswith(b"</html>\n")
    assert list(tmp_path.iterdir()) == []
    assert contents(given) == before


def test_devices_stay_what_they_are(given: Path, tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    reader = subprocess.Popen(["cat", str(tmp_path / "pipe")], stdout=subprocess.PIPE)
    size = report.write_report(report.load_result(given / "r.json"), tmp_path / "pipe")
    assert len(reader.communicate(timeout=1800)[0]) == size
    assert (tmp_path / "pipe").is_fifo()


def test_help_draws_nothing() -> None:
    code = "import sys, okid.report\ntry: okid.report.main(['--help'])\nexcept SystemExit: pass\n"
    code += "print([name for name in ('matplotlib', 'scipy') if name in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=1800)
    assert done.stdout.endswith("\n[]\n")


# Ctrl-C at a stated place, not after a stated time: the place raises the signal by itself.
INTERRUPT = """
import os, signal, sys, okid.report
where, wanted = sys.argv[1:3]
def strike(): os.kill(os.getpid(), signal.SIGINT)
class Strike:
    def find_spec(self, name, path=None, target=None):
        if name == wanted: sys.meta_path.remove(self); strike()
class Swallowed:
    def __del__(self): strike()
if where == "import": sys.meta_path.insert(0, Strike())
else:
    import okid.report.compose as compose, okid.report.svg as svg
    svg.Pictures.inline = lambda *given: "<svg></svg>"  # most of the time
    module, name = {"section": (compose, "summary_section"), "swallowed": (compose, "summary_section"),
                    "writing": (__import__("pathlib").Path, "replace")}[where]
    kept = getattr(module, name)
    def struck(*given):
        if where == "swallowed": Swallowed()
        else: strike()
        return kept(*given)
    setattr(module, name, struck)
del sys.argv[1:3]
sys.exit(okid.report.main())
"""


@pytest.mark.parametrize(
    ("where", "module"),
    [("import", "matplotlib"), ("import", "scipy.special"), ("section", "-"), ("swallowed", "-"), ("writing", "-")],
)
def test_interrupted_at_any_time(given: Path, tmp_path: Path, where: str, module: str) -> None:
    arguments = [where, module, str(given / "r.json"), "--out", str(tmp_path / "o.html")]
    done = subprocess.run([sys.executable, "-c", INTERRUPT, *arguments], capture_output=True, text=True, timeout=1800)
    assert done.returncode == 130
    assert done.stderr == "okid-report: interrupted\n"
    assert done.stdout == ""
    assert list(tmp_path.iterdir()) == []


def test_the_handler_of_the_caller_comes_back(given: Path, tmp_path: Path) -> None:
    before, hook = signal.getsignal(signal.SIGINT), sys.unraisablehook
    assert report.main([str(given / "r.json"), "--out", str(tmp_path / "o.html")]) == 0
    assert signal.getsignal(signal.SIGINT) is before
    assert sys.unraisablehook is hook
