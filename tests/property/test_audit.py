# SPDX-License-Identifier: MIT
"""tools/audit.py and an index of this test: a hole, a release taken back, an advisory withdrawn, an unknown one."""

from __future__ import annotations

import json
import subprocess
import sys
import threading
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
HOLE = {
    "id": "PYSEC-1",
    "aliases": ["CVE-9"],
    "summary": "reads\nbeyond the end",
    "fixed_in": ["1.1"],
    "withdrawn": None,
}
INDEX = {
    "/holed/1.0/json": {"info": {"version": "1.0"}, "vulnerabilities": [HOLE]},
    "/back/2.0/json": {"info": {"version": "2.0", "yanked": True, "yanked_reason": "broken"}, "vulnerabilities": []},
    "/newest/3.0/json": None,
    "/newest/json": {"info": {"version": "3.0"}, "vulnerabilities": [{**HOLE, "withdrawn": "2026-01-01"}]},
    "/old/json": {"info": {"version": "9.9"}, "vulnerabilities": []},
}


class Index(BaseHTTPRequestHandler):
    def do_GET(self) -> None:  # noqa: N802 (the name is given)
        body = INDEX.get(self.path)
        self.send_response(200 if body else 404)
        self.end_headers()
        self.wfile.write(json.dumps(body or {}).encode())

    def log_message(self, *_: object) -> None:
        """Quiet."""


def audit(folder: Path, index: str, parts: list[tuple[str, str]]) -> tuple[int, str]:
    listed = [{"name": name, "version": version, "purl": f"pkg:pypi/{name}@{version}"} for name, version in parts]
    (folder / "sbom.json").write_text(json.dumps({"components": listed}))
    command = [sys.executable, ROOT / "tools/audit.py", "--sbom", folder / "sbom.json", "--index", index]
    done = subprocess.run(command, capture_output=True, text=True)
    return done.returncode, done.stdout + done.stderr


@pytest.mark.parametrize("holed", [True, False])
def test_what_an_index_tells(tmp_path: Path, holed: bool) -> None:
    server = ThreadingHTTPServer(("127.0.0.1", 0), Index)
    threading.Thread(target=server.serve_forever, daemon=True).start()
    parts = [("newest", "3.0"), ("old", "1.0")] + [("holed", "1.0"), ("back", "2.0")] * holed
    status, said = audit(tmp_path, f"http://127.0.0.1:{server.server_port}", parts)
    server.shutdown()
    server.server_close()
    assert status == int(holed), said
    assert ("holed 1.0: PYSEC-1, CVE-9: reads beyond the end (fixed in 1.1)" in said) == holed
    assert ("back 2.0: taken back by its makers: broken" in said) == holed
    assert f"PyPI: {len(parts)} packages, {len(parts) - 1} known to the index, {2 * holed} remarks" in said


def test_nothing_can_be_asked(tmp_path: Path) -> None:
    assert audit(tmp_path, "http://127.0.0.1:9", [("x", "1")])[0] == 4
    missing = subprocess.run(
        [sys.executable, ROOT / "tools/audit.py", "--sbom", tmp_path / "none"], capture_output=True
    )
    assert missing.returncode == 2 and b"make sbom" in missing.stderr
