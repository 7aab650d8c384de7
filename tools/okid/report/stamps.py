# SPDX-License-Identifier: MIT
"""Is the sample rate that of the time stamps, and are the events those of this result?"""

from __future__ import annotations

from okid.report.material import Material

TOLERANCE = 0.02  # of the rate, as `okid run` warns
SAME_RATE = 1e-3


def foreign_doubts(m: Material) -> list[str]:
    """What says that the events are of another run than the result: its rate, channels that it does not have."""
    if m.events is None:
        return []
    out, source = [], m.events.source
    rate_hz = m.events.rate_hz
    if rate_hz is not None and abs(rate_hz - m.result.fs) > SAME_RATE * m.result.fs:
        out.append(f"{source} is of a run at {rate_hz:.10g} Hz, the result of {m.result.fs:.10g} Hz: another run?")
    known = m.events.channels
    lacking = [name for name in m.result.inputs + m.result.outputs if name not in known] if known else []
    if lacking:
        shown = ", ".join(lacking[:3]) + (" …" if len(lacking) > 3 else "")
        out.append(f"{source} has no channel {shown}, which the result has: another run?")
    return out


def rate_unseen(m: Material) -> str:
    """Why the rate by the time stamps cannot be compared, "" when it can."""
    if m.events is None:
        return "no events given"
    if m.events.rate_hz is not None and abs(m.events.rate_hz - m.result.fs) > SAME_RATE * m.result.fs:
        return "the events are of another rate"
    return "" if m.events.stamped_hz is not None else "not in the events"


def rate_doubt(m: Material) -> str:
    """The sentence on a rate by the time stamps that is not the result's, "" when it is, or is not known."""
    if m.events is None or m.events.stamped_hz is None or rate_unseen(m):
        return ""
    fs, seen = m.result.fs, m.events.stamped_hz
    samples = max(fs * m.events.stamped_at_s, 1.0)
    if abs(seen / fs - 1.0) <= TOLERANCE + 2.0 / samples:
        return ""
    return (
        f"by the time stamps {seen:.4g} samples came a second, fs is {fs:.10g}: every frequency scales with it "
        "(fix rate_hz, unless the frames were played at another speed)"
    )
