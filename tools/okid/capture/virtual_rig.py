# SPDX-License-Identifier: MIT
"""A RIG.toml as the log, truth and configs that a script is tried with: made by the program `okid simulate`."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from okid.abi.program import run_program
from okid.capture.config import CaptureConfig
from okid.data.toml_file import read_toml
from okid.data.whole_file import whole_file


@dataclass(frozen=True)
class VirtualRig:
    """Files of a simulated test: frames as `candump -L` writes them, what they mean, true modes and matrices."""

    log: Path
    config: Path
    truth: Path


def simulate_rig(rig: str | Path, folder: str | Path) -> VirtualRig:
    """Play a rig into files of `folder`, about 1 us a number. Raises InputError with the message of the program."""
    out = VirtualRig(Path(folder) / "rig.log", Path(folder) / "rig.toml", Path(folder) / "rig.truth.json")
    run_program("simulate", rig, "--quiet", "--log", out.log, "--truth", out.truth, "--config", out.config)
    return out


def line_config(of_can: CaptureConfig, url: str, baud: int) -> str:
    """The CONFIG.toml of the same channels on a serial line, as packets_of() numbers them."""
    file = read_toml(of_can.path)[0]
    text = "# written by okid-capture emulate\n" + _section("[acquisition]", file["acquisition"])
    bus = {"name": "node", "type": "serial", "device": url, "baud": baud, "framing": "cobs"}
    text += "\n" + _section("[[bus]]", bus)
    for field, channel in enumerate(of_can.wanted):
        kept = {"name": channel.name, "role": channel.role, "dof": channel.dof, "unit": channel.unit or None}
        place = {"bus": "node", "field": field, "scale": channel.scale, "offset": channel.offset}
        text += "\n" + _section("[[channel]]", {key: value for key, value in kept.items() if value is not None} | place)
    if "identification" in file:
        text += "\n" + _section("[identification]", file["identification"])
    return text


def _section(head: str, table: dict[str, object]) -> str:
    return head + "\n" + "".join(f"{key} = {_value(value)}\n" for key, value in table.items())


def _value(value: object) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return '"' + value.replace("\\", "\\\\").replace('"', '\\"') + '"'
    return repr(value)


def write_whole(path: str | Path, data: bytes) -> None:
    """Whole or not at all. InputError when it cannot be."""
    with whole_file(path) as part:
        part.write_bytes(data)


def hand_over(rig: VirtualRig, config: str | None, truth: str | None) -> None:
    """Copies of the files that were asked for; the DBC goes beside the config, as it names it."""
    if truth is not None:
        write_whole(truth, rig.truth.read_bytes())
    if config is None:
        return
    dbc = Path(config).with_suffix(".dbc")
    text = rig.config.read_text(encoding="utf-8").replace('dbc = "rig.dbc"', f"dbc = {_value(dbc.name)}")
    write_whole(dbc, rig.config.with_suffix(".dbc").read_bytes())
    write_whole(config, text.encode())
