# SPDX-License-Identifier: MIT
"""okid-report --pdf: printed by the browser that is there, refused in one line when none is."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import okid
import pytest
from okid import report
from okid.record.demo import demo_record


@pytest.fixture(scope="module")
def result(tmp_path_factory: pytest.TempPathFactory) -> Path:
    u, y = demo_record(1500)
    path = tmp_path_factory.mktemp("pdf") / "r.json"
    okid.identify(u, y, fs=1000.0, p=15, sigma_blocks=0).save(path)
    return path


@pytest.mark.usefixtures("chromium")
def test_pages(result: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    target = tmp_path / "r.pdf"
    assert report.main([str(result), "--out", str(tmp_path / "r.html"), "--pdf", str(target)]) == 0
    assert str(target) in capsys.readouterr().out
    data = target.read_bytes()
    assert data.startswith(b"%PDF-")
    assert len(re.findall(rb"/Type\s*/Page\b", data)) >= 3
    assert sorted(path.name for path in tmp_path.iterdir()) == ["r.html", "r.pdf"]


def test_no_browser_is_one_line(
    result: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    assert report.main([str(result), "--out", str(tmp_path / "r.html"), "--pdf", str(tmp_path / "r.pdf")]) == 2
    message = capsys.readouterr().err
    assert message.count("\n") == 1
    assert "apt-get install chromium" in message
    assert list(tmp_path.iterdir()) == []


@pytest.mark.usefixtures("words_only")
def test_a_browser_that_fails_leaves_nothing(
    result: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    fake: Any = tmp_path / "bin" / "chromium"
    fake.parent.mkdir()
    fake.write_text("#!/bin/sh\necho 'no display' >&2\nexit 7\n", encoding="utf-8")
    fake.chmod(0o755)
    monkeypatch.setenv("PATH", str(fake.parent), prepend=":")
    for target, words in ((tmp_path / "r.pdf", "(exit 7): no display"), (tmp_path / "no" / "r.pdf", "no is not there")):
        assert report.main([str(result), "--out", str(tmp_path / "r.html"), "--pdf", str(target)]) == 2
        message = capsys.readouterr().err
        assert words in message
        assert message.count("\n") == 1
    assert sorted(path.name for path in tmp_path.iterdir()) == ["bin", "r.html"]
