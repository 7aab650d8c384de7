# SPDX-License-Identifier: MIT
"""What an installed wheel is used for beside identifying: exports, read by other libraries, and a notebook.

Runs inside a clean system, in the folder where `okid simulate` left rig.csv, rig.log, rig.toml and rig.dbc.
usage: walk.py exports|notebook
"""

from __future__ import annotations

import json
import re
import subprocess
import sys
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np
import okid

BIN = Path(sys.executable).parent


def run(*arguments: str) -> str:
    """A command of the wheel; what it printed."""
    done = subprocess.run([BIN / arguments[0], *arguments[1:]], capture_output=True, text=True)
    if done.returncode != 0:
        sys.exit(f"{' '.join(arguments)}: exit {done.returncode}\n{done.stdout}{done.stderr}")
    return done.stdout


def events() -> list[dict[str, Any]]:
    return [json.loads(line) for line in Path("run.jsonl").read_text().splitlines()]


def exports() -> None:
    """Each file is read by the library of its format, not by okid."""
    import asammdf
    import h5py
    import pyarrow.parquet
    import scipy.io
    from mcap.reader import make_reader

    known = np.loadtxt("rig.csv", delimiter=",", skiprows=3)
    names = Path("rig.csv").read_text().splitlines()[2].split(",")
    for ending in ("mcap", "mf4", "h5", "mat", "parquet", "uff", "ros2.mcap"):
        run("okid-convert", "rig.csv", f"rig.{ending}")
    with open("rig.mcap", "rb") as file:
        rows = [json.loads(one.data) for _, _, one in make_reader(file, validate_crcs=True).iter_messages()]
    with asammdf.MDF("rig.mf4") as mdf:
        columns = [mdf.get(name).samples for name in names]
    seen = {
        "mcap": np.array([[row[name] for name in names] for row in rows]),
        "mf4": np.column_stack(columns),
        "h5": h5py.File("rig.h5")["samples"][:],
        "mat": scipy.io.loadmat("rig.mat")["samples"],
        "parquet": np.column_stack([pyarrow.parquet.read_table("rig.parquet")[name].to_numpy() for name in names]),
    }
    for ending, values in seen.items():
        np.testing.assert_array_equal(values, known, err_msg=f"rig.{ending}")
    for ending in (*seen, "uff"):
        run("okid-convert", f"rig.{ending}", f"from_{ending}.csv")
        np.testing.assert_array_equal(okid.read_csv(f"from_{ending}.csv").samples, known, err_msg=f"from rig.{ending}")

    # Frames: candump to MDF 4 and to .blf, and decoded from there by the config and its DBC.
    for ending in ("mf4", "blf"):
        run("okid-convert", "rig.log", f"frames.{ending}")
        run("okid-convert", f"frames.{ending}", f"decoded_{ending}.csv", "--config", "rig.toml")
        decoded = okid.read_csv(f"decoded_{ending}.csv").samples
        np.testing.assert_allclose(decoded, known, rtol=0, atol=1e-9, err_msg=f"frames.{ending}")

    # A run: events, as topics of MCAP, and lines for InfluxDB.
    Path("published.toml").write_text(Path("rig.toml").read_text() + '\n[publish]\ninflux = "run.lp"\n')
    run("okid", "replay", "rig.log", "-c", "published.toml", "--events", "run.jsonl", "--json", "replayed.json")
    tracked = [
        (mode["track"], mode["frequency_hz"], event["t"])
        for event in events()
        if event["type"] == "modes"
        for mode in event["modes"]
        if mode["track"] is not None
    ]
    assert len({track for track, _, _ in tracked}) == 3, tracked
    begin = datetime.fromisoformat(events()[0]["wall_time"]).timestamp()
    line = re.compile(r"okid_mode,rig=\S+,mode=(\d+) frequency_hz=([\d.eE+-]+),\S+ (\d+)")
    lines = [line.fullmatch(one) for one in Path("run.lp").read_text().splitlines() if one.startswith("okid_mode,")]
    points = [(int(one[1]), float(one[2]), int(one[3])) for one in lines if one]
    assert [one[:2] for one in points] == [one[:2] for one in tracked] and len(points) == len(lines)
    assert all(abs(ns / 1e9 - begin - t) < 0.1 for (_, _, ns), (_, _, t) in zip(points, tracked, strict=True))
    run("okid-convert", "run.jsonl", "events.mcap")
    with open("events.mcap", "rb") as file:
        topics = [
            (channel.topic, json.loads(one.data))
            for _, channel, one in make_reader(file, validate_crcs=True).iter_messages()
        ]
    assert topics == [("/" + event["type"], event) for event in events()]
    print(f"exports: {len(known)} samples in {len(seen) + 2} formats, {len(points)} points, {len(topics)} events")


def notebook() -> None:
    """As the cells of a notebook ask for them; no browser is here."""
    u, y = okid.demo_record()
    rows = np.hstack([u, y])
    session = okid.Session(["shaker"], ["a1", "a2", "a3"], fs=1000.0, p=20)
    shown = session._repr_mimebundle_()
    assert "application/vnd.jupyter.widget-view+json" in shown[0], shown
    view = okid.notebook.LiveView(session, seconds=5.0)
    for block in np.array_split(rows, 20):
        session.feed(block)
    assert [round(row["frequency_hz"]) for row in view.modes] == [11, 32, 46], view.modes
    assert all(row["frequency_std_hz"] > 0 for row in view.modes) and len(view.modes[0]["re"]) == 3
    assert view.signals["names"] == ["shaker", "a1", "a2", "a3"] and view.told.startswith("20000 samples")
    assert any(pole["stable"] and abs(pole["f"] - 10.96) < 0.05 for pole in view.poles)
    view.picked = [view.poles[0]]
    assert "export default" in str(view._esm)
    result = session.identify()
    for found in (result, okid.stabilization(u, y, fs=1000.0), okid.frf.h1(u, y, fs=1000.0)):
        assert "<table" in found._repr_html_(), type(found)
    for picture in (okid.plots.stabilization(result), okid.plots.shapes(result), okid.plots.mac(result)):
        assert picture._repr_svg_().count("<path") > 5
    print(f"notebook: {view.told}, {len(view.poles)} poles")


{"exports": exports, "notebook": notebook}[sys.argv[1]]()
