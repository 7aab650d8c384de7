# SPDX-License-Identifier: MIT
"""Shifts of the baseline's frequencies in every group, from the sums on disk alone: no order, no mode is looked for.

The baseline of a series are its training groups, gathered into at most twenty blocks (okid/change.h). Every group with
sums has every mode, so that nothing is missing in the charts; temperature is taken out of the shifts as of frequencies.
"""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np

from okid._errors import Error
from okid.abi.accumulator import Accumulator
from okid.campaign.run import Outcome
from okid.campaign.spec import CampaignSpec
from okid.campaign.state_folder import StateFolder
from okid.campaign.sums_file import GroupSums, unpack, whole_of
from okid.campaign.trend import in_training
from okid.identification.change_test import ChangeTest, ModeShift

SHIFT_SERIES = ", change test"
_BLOCKS, _UNKNOWNS, _MOST_ROWS = 20, 160, 20


def _test(spec: CampaignSpec, headers: list[GroupSums]) -> ChangeTest:
    """Of the usual order of the training groups: temperature that moves a mode within the baseline would double it."""
    c = spec.channels
    n_u, n_y = len(c.inputs), len(c.outputs)
    rows = min((headers[0].lags + 1) // 2, max(_UNKNOWNS // (n_u + n_y), 4), _MOST_ROWS)
    orders = [one.result["order"] for one in headers if one.result and one.result["order"]]
    order = min(int(np.median(orders) + 1) // 2 * 2, (rows - 1) * n_y // 2 * 2) if orders else 0
    return ChangeTest(n_u, n_y, fs=c.fs_hz, rows=rows, order=order, blocks=_BLOCKS)


def _whole(spec: CampaignSpec, data: bytes) -> Accumulator:
    sums = GroupSums.from_bytes(data, "sums of a group")
    return whole_of(spec, sums.lags, [unpack(part) for _, part in sorted(sums.parts.items())])


def shift_rows(spec: CampaignSpec, out: Outcome, groups: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """A row a group and mode; `groups`: rows of the table of groups, in the order of `out.groups`."""
    state = StateFolder(spec.folder, spec.sums_key)
    on_disk = state.load()
    by_series: dict[str, list[int]] = {}
    for k, (group, row) in enumerate(zip(out.groups, groups, strict=True)):
        if group.ident in out.done and row["time"] is not None and len(on_disk.get(group.ident, [])) == 1:
            by_series.setdefault(row["series"], []).append(k)
    found: list[dict[str, Any]] = []
    for series, numbers in by_series.items():
        order = sorted(numbers, key=lambda k: (groups[k]["time"], groups[k]["group"]))
        paths = [on_disk[out.groups[k].ident][0][0] for k in order]
        first = in_training(np.array([groups[k]["time"].timestamp() for k in order]), spec.trend)
        training = np.flatnonzero(first).tolist()
        try:
            test = _test(spec, [on_disk[out.groups[order[k]].ident][0][1] for k in training])
            cuts = np.unique(
                np.linspace(0, len(training), min(_BLOCKS, len(training)) + 1).round().astype(int)
            ).tolist()
            blocks = []
            for low, high in pairwise(cuts):
                block = _whole(spec, state.read(paths[training[low]]))
                for k in training[low + 1 : high]:
                    block.merge(_whole(spec, state.read(paths[k])))
                blocks.append(block)
            test.learn(blocks)
        except Error as fault:
            out.remarks.append(f"{series}: no change test: {fault}")
            continue
        for k, path in zip(order, paths, strict=True):
            try:
                modes = test.test([_whole(spec, state.read(path))]).modes
            except Error as fault:
                out.remarks.append(f"{groups[k]['group']}: no change test: {fault}")
                continue
            found += [_row(groups[k], number, mode) for number, mode in enumerate(modes, 1)]
    return found


def _row(group: dict[str, Any], number: int, mode: ModeShift) -> dict[str, Any]:
    return {
        "group": group["group"], "series": group["series"] + SHIFT_SERIES, "time": group["time"],
        "temperature_c": group["temperature_c"], "track": number, "baseline_hz": mode.frequency_hz,
        "frequency_hz": mode.frequency_hz * (1.0 + mode.shift), "frequency_std_hz": np.nan,
        "damping_ratio": np.nan, "damping_ratio_std": np.nan,
    }  # fmt: skip
