# SPDX-License-Identifier: MIT
"""Modes picked by hand: the poles of all runs of method "auto", with the answer as a proposal."""

from __future__ import annotations

import shlex
from typing import Any

from okid.report import page
from okid.report.material import Material

_PARTS = """<div class="picker">
<div class="tools">
<label>runs <select class="runs"></select></label>
<button type="button" class="undo">Undo</button><button type="button" class="redo">Redo</button>
<button type="button" class="propose">Take the proposal</button>
<button type="button" class="whole">Whole band</button>
<label>add <input type="number" class="hz" step="any" min="0" placeholder="Hz"></label>
</div>
<canvas class="poles" role="img" aria-label="poles over frequency and order"></canvas>
<p class="hover" aria-live="polite"></p>
<ul class="picked"></ul>
<div class="tools"><button type="button" class="keep">Save picks.json</button></div>
<pre class="command"></pre>
</div>"""


def has_poles(m: Material) -> bool:
    """Was the result identified by method "auto" with --stabilization?"""
    return isinstance(m.result.raw.get("agreement"), dict)


def picking_section(m: Material) -> page.Section:
    """Poles of all runs to pick from; what is picked is reproduced by `okid identify --picks`."""
    agreement: dict[str, Any] = m.result.raw["agreement"]
    poles = {key: agreement["poles"][key] for key in ("run", "order", "frequency_hz", "damping_ratio", "mpc", "mode")}
    for key, digits in (("frequency_hz", 9), ("damping_ratio", 5), ("mpc", 3)):
        poles[key] = [float(f"{value:.{digits}g}") for value in poles[key]]
    modes = [
        {"frequency_hz": float(mode["frequency_hz"]), "damping_ratio": mode["damping_ratio"],
         "frequency_std_hz": mode.get("frequency_std_hz"), "damping_ratio_std": mode.get("damping_ratio_std"),
         "confident": bool(mode.get("confident"))}
        for mode in m.result.raw["modes"]
    ]  # fmt: skip
    inputs = f" --inputs {shlex.quote(','.join(m.result.inputs))}" if m.result.inputs else ""
    command = f"okid identify RECORD.csv{inputs} --outputs {shlex.quote(','.join(m.result.outputs))} --picks picks.json"
    words = (
        "Every dot is a pole of one model. Coloured dots belong to a mode of the result, dashed lines are the "
        "modes that the runs agree on: a proposal. Click a dot to pick or drop it; drag over a band to look closer. "
        "The command gives each pick its shape, standard deviation and place in the model."
    )
    return page.section(
        "Pick modes", _PARTS, page.data("poles-data", {"runs": agreement["runs"], "poles": poles, "modes": modes,
                                                       "command": command}), page.note(words), name="Picking",
    )  # fmt: skip
