# SPDX-License-Identifier: MIT
"""What a campaign found: records.parquet, groups.parquet, modes.parquet (columns: docs/howto/campaigns.md)."""

from __future__ import annotations

from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np

from okid._errors import InputError
from okid.campaign.change_shifts import shift_rows
from okid.campaign.grouping import Group
from okid.campaign.mode_tracks import follow
from okid.campaign.run import Outcome
from okid.campaign.spec import CampaignSpec
from okid.data.whole_file import whole_file

NAMES = ("records", "groups", "modes")
SHIFTS = "shifts"  # with [trend] change_test


def _when(seconds: float | None) -> datetime | None:
    return None if seconds is None else datetime.fromtimestamp(seconds, UTC)


def _record_rows(out: Outcome) -> list[dict[str, Any]]:
    rows = []
    for group in out.groups:
        done = out.done.get(group.ident)
        facts = {} if done is None else {str(record["name"]): record for record in done.records}
        for ref in group.records:
            own = facts.get(ref.name)
            temperature = ref.temperature_c if ref.temperature_c is not None else (own or {}).get("temperature_c")
            rows.append({
                "record": ref.name, "group": group.label, "time": _when(ref.time_s), "temperature_c": temperature,
                "bytes": ref.size, "samples": None if own is None else own["samples"],
                "missing": None if own is None else own["missing"],
                "saturated": None if own is None else own["saturated"],
                "sha256": None if own is None else own["sha256"], "status": "skipped" if own is None else "summed",
                "reason": None,
            })  # fmt: skip
    reasons: dict[Any, str] = {one.name: one.reason for one in out.skipped}
    known = {row["record"] for row in rows}
    for row in rows:
        row["reason"] = reasons.get(row["record"]) if row["status"] == "skipped" else None
    empty = dict.fromkeys(rows[0] if rows else ("record",))
    rows += [{**empty, "record": one.name, "status": "skipped", "reason": one.reason}
             for one in out.skipped if one.name not in known]  # fmt: skip
    return rows


def _mean(values: list[float | None]) -> float | None:
    known = [value for value in values if value is not None]
    return float(np.mean(known)) if known else None


def _group_row(out: Outcome, group: Group, reasons: dict[str, str]) -> dict[str, Any]:
    """One group: when, how warm, how much went in, the checksum of its sums, what came of it."""
    done = out.done.get(group.ident)
    facts = {} if done is None else {str(record["name"]): record for record in done.records}
    used = [ref for ref in group.records if ref.name in facts]
    shown = used or group.records
    temperatures = [
        ref.temperature_c if ref.temperature_c is not None else facts.get(ref.name, {}).get("temperature_c")
        for ref in shown
    ]
    result = (None if done is None else done.result) or {}
    return {
        "group": group.label, **{f"key_{name}": value for name, value in group.key.items() if name != "record"},
        "series": group.series, "time": _when(_mean([ref.time_s for ref in shown])),
        "temperature_c": _mean(temperatures), "records": len(used),
        "skipped": sum(ref.name in reasons for ref in group.records if ref.name not in facts),
        "samples": sum(record["samples"] - record["missing"] for record in facts.values()),
        "rows": result.get("rows"), "parts": result.get("parts"), "order": result.get("order"),
        "refined": result.get("refined"),
        "modes": len(result.get("modes", [])), "sums_sha256": result.get("sums_sha256"),
        "fault": out.faults.get(group.ident) or result.get("fault"),
    }  # fmt: skip


def _mode_rows(spec: CampaignSpec, out: Outcome, rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
    found: list[dict[str, Any]] = []
    by_series: dict[str, list[int]] = {}
    for k, row in enumerate(rows):
        by_series.setdefault(row["series"], []).append(k)
    for numbers in by_series.values():
        order = sorted(numbers, key=lambda k: (rows[k]["time"] or datetime.fromtimestamp(0, UTC), rows[k]["group"]))
        results = [(out.done[ident].result or {}) if (ident := out.groups[k].ident) in out.done else {} for k in order]
        modes = [result.get("modes", []) for result in results]
        tracks = follow(modes, len(spec.channels.outputs), spec.trend)
        for k, own, followed in zip(order, modes, tracks, strict=True):
            row = rows[k]
            for number, (mode, track) in enumerate(zip(own, followed, strict=True), 1):
                found.append({
                    "group": row["group"], "series": row["series"], "time": row["time"],
                    "temperature_c": row["temperature_c"], "mode": number, "track": track or None, **mode,
                })  # fmt: skip
    return found


def make_tables(spec: CampaignSpec, out: Outcome) -> dict[str, Any]:
    """pandas.DataFrames by name, times in UTC; modes have the number of their track in the series, or none."""
    import pandas as pd

    reasons = {one.name: one.reason for one in out.skipped}
    rows = [_group_row(out, group, reasons) for group in out.groups]
    tables = {
        "records": pd.DataFrame(_record_rows(out)),
        "groups": pd.DataFrame(rows),
        "modes": pd.DataFrame(_mode_rows(spec, out, rows)),
    }
    if spec.trend.change_test:
        tables[SHIFTS] = pd.DataFrame(shift_rows(spec, out, rows))
    for whole, columns in (
        ("records", ("samples", "missing", "saturated")),
        ("groups", ("rows", "parts", "order", "refined")),
        ("modes", ("track",)),
    ):
        for column in columns:
            if column in tables[whole]:
                tables[whole][column] = tables[whole][column].astype("Int64")
    return tables


def write_tables(folder: Path, tables: dict[str, Any]) -> None:
    """NAME.parquet of each table, whole or not at all. InputError when the disk refuses."""
    if SHIFTS not in tables:
        (folder / f"{SHIFTS}.parquet").unlink(missing_ok=True)
    for name, table in tables.items():
        with whole_file(folder / f"{name}.parquet") as part:
            table.to_parquet(part, index=False)


def read_tables(folder: Path) -> dict[str, Any]:
    """The tables of an earlier run. InputError when one is missing or damaged."""
    import pandas as pd

    out = {}
    for name in (*NAMES, *([SHIFTS] if (folder / f"{SHIFTS}.parquet").exists() else [])):
        path = folder / f"{name}.parquet"
        try:
            out[name] = pd.read_parquet(path)
        except FileNotFoundError:
            raise InputError(f"{path}: not found, expected the output folder of okid-campaign run") from None
        except Exception as fault:  # pyarrow's errors share no base class with OSError
            raise InputError(f"{path}: no table of a campaign: {' '.join(str(fault).split())[:160]}") from None
    return out
