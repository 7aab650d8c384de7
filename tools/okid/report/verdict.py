# SPDX-License-Identifier: MIT
"""The result in one line, reasons to doubt it in a second one, and in a third what was not looked at."""

from __future__ import annotations

from html import escape

import numpy as np

from okid.report import scale
from okid.report.completeness import completeness
from okid.report.loaded import known_fit
from okid.report.material import Material
from okid.report.missed import missed_modes
from okid.report.page import count_of
from okid.report.result_warnings import warning_doubt
from okid.report.stamps import foreign_doubts, rate_doubt, rate_unseen

NOT_OF_RESPONSES = ("completeness", "units", "whiteness of the residual", "rate by the time stamps")
MOST_WORDS = 4  # doubts that are named in the verdict, besides those on the time stamps and the warnings


def headline(m: Material) -> str:
    """How many modes, where, how sure."""
    listed, sure = m.result.raw["modes"], m.result.confident
    if not listed:
        return "No underdamped mode was found."
    more = len(listed) - len(sure)
    apart = f"{count_of(more, 'doubtful mode')} listed apart" if more else ""
    if not sure:
        return f"No mode to sign; {apart}."
    modes, f = [listed[k] for k in sure], m.result.frequency_hz[sure]
    zeta = [100.0 * float(mode["damping_ratio"]) for mode in modes]
    where = f"at {f[0]:.4g} Hz" if len(f) == 1 else f"from {f[0]:.4g} to {f[-1]:.4g} Hz"
    damping = f"{min(zeta):.3g} %" if len(zeta) == 1 else f"{min(zeta):.3g} to {max(zeta):.3g} %"
    text = f"{count_of(len(modes), 'confident mode')} {where}, damping {damping}"
    spread = [mode.get("frequency_std_hz") for mode in modes]
    if all(isinstance(one, int | float) for one in spread):
        text += f"; frequencies to ±{100.0 * max(s / x for s, x in zip(spread, f, strict=True)):.2g} % or better (1 σ)"
    return f"{text}; {apart}." if apart else f"{text}."


def _simulated(m: Material) -> list[float | None]:
    """Simulation fits of the outputs: of the record when it is given, else those of the result."""
    if m.measured is not None and m.measured.fit is not None:
        return list(m.measured.fit.simulation_percent.values())
    return known_fit(m.result.raw, "simulation_percent")


def _scale_doubts(m: Material) -> list[str]:
    if m.measured is None or m.measured.factor is None:
        return []
    doubts = scale.doubts(m.measured.factor, m.result.outputs)
    return [*doubts[:1], f"so are {len(doubts) - 1} more outputs"] if len(doubts) > 2 else doubts


def _order_doubts(m: Material) -> list[str]:
    """Modes that the diagram holds and the model lacks, and the order that has them."""
    if m.measured is None or m.measured.rows is None:
        return []
    order = int(m.result.raw["order"])
    lost = missed_modes(m.measured.rows, m.result.frequency_hz)
    if not lost:
        return []
    where = ", ".join(f"{m.measured.rows.clusters[k].frequency_hz:.4g}" for k in lost)
    text = f"the diagram holds {'a mode' if len(lost) == 1 else 'modes'} at {where} Hz that the model of order {order} "
    if m.result.raw.get("method") == "auto":
        return [f"{text}does not have"]
    better = next((row.order for row in m.measured.rows if row.order > order and set(lost) <= set(row.cluster)), None)
    return [f"{text}does not have" + ("" if better is None else f": try --order {better}")]


def _model_doubts(m: Material) -> list[str]:
    raw = m.result.raw
    out = _scale_doubts(m) + _order_doubts(m)
    fits = [value for value in _simulated(m) if value is not None]
    if fits and min(fits) < 80.0:
        who, what = ("modes explain", "the responses") if raw.get("responses") else ("simulation explains", "an output")
        out.append(f"the {who} only {min(fits):.1f} % of {what}")
    checks = (raw.get("mkr") or {}).get("checks") or {}
    bad = [x for x, key in (("M", "m_positive_definite"), ("K", "k_positive_definite")) if checks.get(key) is False]
    if bad:
        out.append(f"{' and '.join(bad)} not positive definite")
    if (checks.get("ww_residual") or 0.0) > 0.03:
        out.append("the residual of W Wᵀ = 0 is large: M, K, R are doubtful")
    white = None if m.measured is None else m.measured.whiteness
    if white is not None:
        poor = [name for k, name in enumerate(m.result.outputs) if white.verdict(k) == "not white"]
        if poor:
            out.append(f"residual not white at {count_of(len(poor), 'output')}: something is not in the model")
    return out


def _data_doubts(m: Material) -> list[str]:
    out = []
    missing = [row for row in completeness(m) if row[2] != row[1]]
    if missing:
        worst = min(missing, key=lambda row: row[2] / max(row[1], 1))
        share = 100.0 * (worst[1] - worst[2]) / max(worst[1], 1)
        out.append(f"samples are missing at {count_of(len(missing), 'channel')}, at most {share:.2g} % ({worst[0]})")
    for bus, events in m.events.bus_trouble.items() if m.events is not None else ():
        out.append(f"bus {bus}: {', '.join(events)} (in Frequencies over time)")
    if m.events is not None and m.events.alarms:
        out.append(count_of(len(m.events.alarms), "alarm"))
    if m.events is not None and m.events.changes:
        out.append(f"the structure changed ({count_of(len(m.events.changes), 'time')})")
    return out


def _doubts(m: Material) -> str:
    """Every reason to doubt the result, "" when nothing does."""
    first = [*foreign_doubts(m), rate_doubt(m)]
    if not m.result.raw["modes"]:
        first.append("the singular values and the record")
    others = _model_doubts(m) + _data_doubts(m)
    more = "and more below" if len(others) > MOST_WORDS else ""
    named = [*first, *others[:MOST_WORDS], more, warning_doubt(m)]
    return "; ".join(one for one in named if one)


def _looked_at(m: Material) -> tuple[list[str], dict[str, list[str]]]:
    """What the verdict rests on, and by reason what it does not."""
    of_responses = bool(m.result.raw.get("responses"))
    seen, unseen = ["warnings of the identification"], dict[str, list[str]]()

    def file(what: str, why: str) -> None:
        """Under what was looked at, or under the reason why not."""
        if why and not (of_responses and what in NOT_OF_RESPONSES):
            unseen.setdefault(why, []).append(what)
        elif not why:
            seen.append(what)

    given, ambient = m.measured, not m.result.inputs
    seen += ["consistency of the modes"] if m.result.raw["modes"] else []
    no_record = "" if given is not None else "no responses given" if of_responses else "no record given"
    no_record = "several set-ups" if m.result.raw.get("set_ups") else no_record
    file("completeness", "" if completeness(m) else no_record or "nothing tells it")
    if not ambient:
        file("fit", "" if any(v is not None for v in _simulated(m)) else no_record or "the model gives no simulation")
    known = given is not None and given.factor is not None and bool(np.all(np.isfinite(given.factor)))
    file("units", "" if known else no_record or ("no force" if ambient else "record and simulation are too different"))
    file("modes that the order cut off", no_record)
    white = given is not None and given.whiteness is not None
    file("whiteness of the residual", "" if white else no_record or "no stable predictor, or a short record")
    seen += ["checks of M, K, R"] if m.result.raw.get("mkr") else []
    file("rate by the time stamps", rate_unseen(m))
    if m.result.raw.get("judged_by") == "emac":
        file("that several methods agree on the modes", "one was named")
    return seen, unseen


def verdict(m: Material) -> str:
    """The result, reasons to doubt it, and what was not looked at."""
    doubts, (seen, unseen) = _doubts(m), _looked_at(m)
    last = f"Look at: {doubts}." if doubts else f"No quality warning in what was checked: {', '.join(seen)}."
    text = f"<p>{escape(headline(m))}</p>\n<p>{escape(last)}</p>"
    if unseen:
        parts = "; ".join(f"{', '.join(what)} ({why})" for why, what in unseen.items())
        text += f'\n<p class="unseen">{escape(f"Not checked: {parts}.")}</p>'
    return f'<div class="verdict{" doubt" if doubts else ""}">{text}</div>'
