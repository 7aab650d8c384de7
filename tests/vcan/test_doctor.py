# SPDX-License-Identifier: MIT
"""What `okid doctor` says of a machine that lacks something: here we are root and may take things away."""

from __future__ import annotations

import os
import subprocess
from pathlib import Path

from lines import line, node_config
from test_vcan import OKID, interface, make_record, sh  # noqa: F401  (interface is a fixture)

ADMIN = "-net_admin"
FILES = "-dac_override,-dac_read_search"


def without(capabilities: str, *command: object) -> subprocess.CompletedProcess[str]:
    words = ["setpriv", f"--bounding-set={capabilities}", "--inh-caps=-all", *map(str, command)]
    return subprocess.run(words, capture_output=True, text=True, timeout=1800, check=False)


def test_a_small_receive_buffer(tmp_path: Path) -> None:
    config = make_record(tmp_path, 1.0) / "a.toml"
    assert "CAP_NET_ADMIN lets okid take" in sh(OKID, "doctor", str(config)).stdout
    done = without(ADMIN, OKID, "doctor", config)
    assert done.returncode == 4
    assert "missing  receive buffer" in done.stdout and "sudo sysctl -w net.core.rmem_max=" in done.stdout


def test_no_right_to_open_the_line(tmp_path: Path) -> None:
    config = node_config(tmp_path)
    with line(tmp_path / "tty"):
        os.chmod(os.path.realpath(tmp_path / "tty"), 0)
        done = without(FILES, OKID, "doctor", config)
        assert done.returncode == 4
        assert "missing  bus node (serial)" in done.stdout and "sudo usermod -aG dialout $USER" in done.stdout
        run = without(FILES, OKID, "run", config)
        assert run.returncode == 4 and "sudo usermod -aG dialout $USER" in run.stderr


def test_an_adapter_that_holds_bytes_back(tmp_path: Path) -> None:
    """Its latency timer as the kernel's ftdi_sio shows it; one that cannot be set is said, and how."""
    config = node_config(tmp_path)
    with line(tmp_path / "tty"):
        name = os.path.basename(os.path.realpath(tmp_path / "tty"))
        knob = f"/sys/class/tty/{name}/device/latency_timer"
        make = f"mount -t tmpfs none /sys/class/tty && mkdir -p {os.path.dirname(knob)} && echo"
        ask = f"{OKID} doctor {config}"
        mended = sh("unshare", "-m", "sh", "-c", f"{make} 8 >{knob} && {ask} && cat {knob}")
        assert mended.stdout.endswith("\n1\n") and "holds bytes back" not in mended.stdout
        poor = f"setpriv --bounding-set={FILES} --inh-caps=-all"
        said = sh("unshare", "-m", "sh", "-c", f"{make} 16 >{knob} && chmod 444 {knob} && {poor} {ask}")
        assert f"holds bytes back for up to 16 ms: echo 1 | sudo tee {knob}" in said.stdout


def test_memory_and_priority(tmp_path: Path) -> None:
    config = node_config(tmp_path, "[realtime]\npriority = 30\nlock_memory = true\n")
    limits = ("prlimit", "--rtprio=0", "--memlock=65536")
    with line(tmp_path / "tty"):
        well = sh(OKID, "doctor", str(config)).stdout
        assert "the reader may run at 30" in well and "ok       locked memory" in well
        done = without("-sys_nice,-ipc_lock,-sys_resource", *limits, OKID, "doctor", config)
    assert done.returncode == 4
    assert "RLIMIT_RTPRIO is 0, expected 30" in done.stdout and "rtprio" in done.stdout
    assert "missing  locked memory" in done.stdout and "memlock unlimited" in done.stdout
