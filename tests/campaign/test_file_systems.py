# SPDX-License-Identifier: MIT
"""A SPEC.toml of somebody else opens no file system that runs code, and no scheduler that does."""

from __future__ import annotations

import json
import tomllib
from pathlib import Path

import fsspec
import numpy as np
import pytest
from okid.campaign.command import main
from okid.campaign.file_systems import REMOTE

SPEC = '[records]\nfiles = ["{url}"]\n{more}[channels]\noutputs = ["a"]\nfs_hz = 100.0\n[group]\nby = []\n'
ROOT = Path(__file__).resolve().parents[2]


def checked(folder: Path, url: str, more: str = "") -> int:
    (folder / "SPEC.toml").write_text(SPEC.format(url=url, more=more))
    return main(["check", str(folder / "SPEC.toml")])


@pytest.fixture(autouse=True)
def no_file_system_is_made(monkeypatch: pytest.MonkeyPatch) -> None:
    def made(protocol: str, **_: object) -> None:
        raise AssertionError(f"{protocol} was opened")

    monkeypatch.setattr(fsspec, "filesystem", made)


def test_a_reference_renders_no_template(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Up to 0.2 a template of reference:// ran: here it would leave a file."""
    left = tmp_path / "it ran"
    call = f"{{{{ ''.__class__.__mro__[1].__subclasses__() and cycler.__init__.__globals__.os.mkdir('{left}') }}}}"
    refs = {"version": 1, "templates": {"f": call}, "refs": {"a.npy": ["{{f()}}", 0, 1]}}
    (tmp_path / "refs.json").write_text(json.dumps(refs))
    assert checked(tmp_path, "reference://*.npy", f"storage = {{fo = '{tmp_path}/refs.json'}}\n") == 2
    assert not left.exists()
    assert "SPEC.toml:2: [records], key \"files\": found 'reference://*.npy'" in capsys.readouterr().err


KNOWN = ["dir", "zip", "simplecache", "filecache", "git", "github", "ssh", "sftp", "smb", "hdfs", "ftp", "memory",
         "data", "libarchive", "tar", "dask", "jlab", "file", "local", "generic", "S3", ""]  # fmt: skip


@pytest.mark.parametrize("protocol", KNOWN)
def test_other_protocols_are_refused(tmp_path: Path, protocol: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert checked(tmp_path, f"{protocol}://x/*.npy") == 2
    said = capsys.readouterr().err
    assert f"{protocol}:// is no file system for records" in said and said.count("\n") == 1


@pytest.mark.parametrize("url", ["zip://*.npy::s3://b/a.zip", "s3::reference://x/*.npy", "https://a/b::c/*.npy"])
def test_chains_are_refused(tmp_path: Path, url: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert checked(tmp_path, url) == 2
    said = capsys.readouterr().err
    assert ("a chained URL" in said or "is no file system" in said) and said.count("\n") == 1


def test_a_local_name_with_colons_is_a_name(tmp_path: Path) -> None:
    folder = tmp_path / "reference::x"
    folder.mkdir()
    np.save(folder / "a.npy", np.zeros((4, 1)))
    assert checked(tmp_path, "reference::x/*.npy") == 0


OPTIONS = [
    ("s3", "client_kwargs = {}", '"client_kwargs" is no option of s3://, expected one of: anon'),
    ("s3", "anon = 1", '"anon": found 1, expected true or false'),
    ("s3", 'session = "x"', '"session" is no option'),
    ("gs", 'token = "/etc/passwd"', "expected anon or cloud or google_default"),
    ("http", "client_kwargs = {}", "expected one of: none"),
    ("abfs", "target_options = {}", '"target_options" is no option'),
]


@pytest.mark.parametrize(("protocol", "option", "words"), OPTIONS)
def test_options_of_storage(
    tmp_path: Path, protocol: str, option: str, words: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert checked(tmp_path, f"{protocol}://b/*.npy", f"storage = {{{option}}}\n") == 2
    said = capsys.readouterr().err
    assert 'SPEC.toml:3: [records], key "storage"' in said and words in said


def test_a_file_alone_chooses_no_scheduler(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["simulate", str(tmp_path), "--records", "1", "--samples", "256"]) == 0
    path = tmp_path / "SPEC.toml"
    text = path.read_text()
    path.write_text(text.replace("[cluster]", '[cluster]\naddress = "tcp://127.0.0.1:9"', 1)
                    if "[cluster]" in text else text + '[cluster]\naddress = "tcp://127.0.0.1:9"\n')  # fmt: skip
    assert main(["run", str(path)]) == 2
    assert "'tcp://127.0.0.1:9' runs code on this computer: give --cluster" in capsys.readouterr().err
    path.write_text(text)
    assert main(["run", str(path), "--cluster"]) == 2
    assert '--cluster without an address, and [cluster] has no "address"' in capsys.readouterr().err


def test_what_is_allowed_is_documented_and_new_enough() -> None:
    page = (ROOT / "docs" / "howto" / "campaigns.md").read_text("utf-8")
    assert [f"{p}://" for p in REMOTE if f"`{p}://`" not in page] == []
    assert [key for keys in REMOTE.values() for key in keys if f"`{key}`" not in page] == []
    project = tomllib.loads((ROOT / "tools" / "pyproject.toml").read_text("utf-8"))["project"]
    wanted = [one for many in project["optional-dependencies"].values() for one in many] + project["dependencies"]
    assert not [one for one in wanted if one.lower().startswith("jinja2")]
    assert "fsspec>=2025.10" in wanted  # before that reference:// rendered templates
