# SPDX-License-Identifier: MIT
"""The section on the run: frequency of every mode over stream time, alarms, changes."""

from __future__ import annotations

from okid.report import drawings, page
from okid.report.events import Events
from okid.report.material import Material
from okid.result import figures

MOST_TRACKS, FEWEST_POINTS, MOST_LINES = 8, 3, 20


def _chosen(events: Events) -> list[int]:
    """The tracks with most updates, ascending in frequency."""
    usable = [track for track, points in events.tracks.items() if len(points) >= FEWEST_POINTS]
    best = sorted(usable, key=lambda track: (-len(events.tracks[track]), track))[:MOST_TRACKS]
    return sorted(best, key=lambda track: events.tracks[track][-1].frequency_hz)


def _moments(events: Events) -> str:
    rows = [(t, "alarm", text + (f", over at {end:g} s" if end is not None else "")) for t, end, text in events.alarms]
    rows += [(t, "change", "the structure changed: the model no longer predicts the samples") for t in events.changes]
    rows += [(t, f"bus {name}", f"{event}: {text}") for t, name, event, text in events.bus]
    if not rows:
        return ""
    rows.sort()
    table = page.table(
        ["t [s]", "event", "what"], [[f"{t:g}", kind, text] for t, kind, text in rows[:MOST_LINES]], "words"
    )
    more = page.note(f"The first {MOST_LINES} of {len(rows)}.") if len(rows) > MOST_LINES else ""
    return table + more


def tracking_section(m: Material) -> page.Section | None:
    """Tracks of the modes over stream time; None without events."""
    if m.events is None:
        return None
    title, events = "Frequencies over time", m.events
    shown = _chosen(events)
    if not shown:
        words = f"{events.source} holds too few updates with tracked modes for a picture."
        return page.section(title, page.absent(words), _moments(events), name="Tracking")
    end = max(points[-1].t for points in events.tracks.values() if points)
    columns = 1 if len(shown) <= 3 else 2
    bands = -(-len(shown) // columns)
    drawing = figures.figure(9.6, 1.7 * bands + 0.5)
    for place, track in enumerate(shown, 1):
        ax = drawing.add_subplot(bands, columns, place)
        points = events.tracks[track]
        drawings.draw_track(ax, points, events, end)
        ax.set_title(f"track {track}: last {points[-1].frequency_hz:.4f} Hz", loc="left")
        ax.set_ylabel("f [Hz]")
        ax.tick_params(labelbottom=place > len(shown) - columns)
        if place > len(shown) - columns:
            ax.set_xlabel("stream time [s]")
        if place == 1:
            ax.legend(ncols=3, loc="lower right", bbox_to_anchor=(1.0, 1.0), borderaxespad=0.1)
    words = f"{events.updates} updates. Band: ± σ. Grey: before the mode settled; it may lie outside of the picture."
    words += (
        f" The {len(shown)} of {len(events.tracks)} tracks seen most often." if len(shown) < len(events.tracks) else ""
    )
    picture = m.pictures.inline(drawing, "frequencies of the modes over stream time")
    return page.section(title, picture, page.note(words), _moments(events), name="Tracking")
