# SPDX-License-Identifier: MIT
"""Drawings: wires, degrees of freedom, the walk of a frame through the program, gaps, aliasing."""

from __future__ import annotations

from html import escape
from math import cos, pi

from docs_pictures import runs

INK, BLUE, RED, GREEN, GREY = "#212529", "#1f5fa8", "#c92a2a", "#2b8a3e", "#868e96"


class Drawing:
    """SVG, piece by piece."""

    def __init__(self, width: int, height: int) -> None:
        self.parts = [
            f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" '
            'font-family="sans-serif" font-size="13">',
            '<defs><marker id="a" markerWidth="9" markerHeight="8" refX="8" refY="4" orient="auto">'
            f'<path d="M0,0 L9,4 L0,8 z" fill="{INK}"/></marker></defs>',
            f'<rect width="{width}" height="{height}" fill="#fff"/>',
        ]

    def line(
        self, *points: tuple[float, float], colour: str = INK, width: float = 1.5, arrow: bool = False, dash: str = ""
    ) -> None:
        text = " ".join(f"{x:g},{y:g}" for x, y in points)
        end = ' marker-end="url(#a)"' if arrow else ""
        gaps = f' stroke-dasharray="{dash}"' if dash else ""
        self.parts.append(
            f'<polyline points="{text}" fill="none" stroke="{colour}" stroke-width="{width}"{end}{gaps}/>'
        )

    def box(self, x: float, y: float, width: float, height: float, *words: str, fill: str = "#f1f3f5") -> None:
        self.parts.append(
            f'<rect x="{x}" y="{y}" width="{width}" height="{height}" rx="4" fill="{fill}" stroke="{INK}"/>'
        )
        for k, word in enumerate(words):
            self.text(x + width / 2, y + height / 2 + 5 + 16 * (k - (len(words) - 1) / 2), word)

    def dot(self, x: float, y: float, colour: str = INK, radius: float = 4) -> None:
        self.parts.append(f'<circle cx="{x:g}" cy="{y:g}" r="{radius}" fill="{colour}"/>')

    def text(self, x: float, y: float, words: str, anchor: str = "middle", colour: str = INK) -> None:
        self.parts.append(f'<text x="{x:g}" y="{y:g}" text-anchor="{anchor}" fill="{colour}">{escape(words)}</text>')

    def keep(self, name: str) -> str:
        (runs.IMAGES / name).write_text("\n".join([*self.parts, "</svg>\n"]))
        return name


def wiring() -> str:
    d = Drawing(720, 220)
    for y, colour, name in ((110, BLUE, "CAN-H"), (130, GREEN, "CAN-L")):
        d.line((70, y), (650, y), colour=colour, width=2.5)
        d.text(360, y - 4 if name == "CAN-H" else y + 16, name, colour=colour)
    for x in (70, 650):
        d.box(x - 12, 105, 24, 30, fill="#fff3bf")
        d.text(x, 155, "120 Ω")
    for x, words in (
        (150, ("load cell", "amplifier")),
        (290, ("node with", "3 accelerometers")),
        (560, ("USB adapter,", "computer: okid")),
    ):
        d.box(x - 65, 20, 130, 50, *words)
        d.line((x - 10, 70), (x - 10, 110), colour=BLUE)
        d.line((x + 10, 70), (x + 10, 130), colour=GREEN)
    d.text(
        360,
        190,
        "one line from end to end; stubs below 30 cm at 1 Mbit/s; 60 Ω between H and L, power off",
        colour=GREY,
    )
    return d.keep("wiring.svg")


def degrees_of_freedom() -> str:
    d = Drawing(640, 320)
    d.line((120, 270), (360, 270), width=3)
    for k, y in enumerate((210, 140, 70)):
        d.line((160, y + 70 - (10 if k else 0)), (160, y + 10), width=3)
        d.line((320, y + 70 - (10 if k else 0)), (320, y + 10), width=3)
        d.box(140, y - 10, 200, 20, fill="#dee2e6")
        d.box(340, y - 9, 18, 18, fill="#d0ebff")
        d.line((362, y), (420, y), colour=BLUE, arrow=True)
        d.text(428, y + 5, f"acc{k + 1}, dof = {k + 1}", "start", BLUE)
    d.line((50, 210), (136, 210), colour=RED, width=2.5, arrow=True)
    d.text(44, 196, "force1, dof = 1", "start", RED)
    d.text(320, 294, "dof 1 has a force and a sensor: the co-located pair", "middle", GREY)
    d.text(320, 311, "all arrows point the same way: the polarity", "middle", GREY)
    return d.keep("dofs.svg")


def walk_of_a_frame() -> str:
    d = Drawing(760, 330)
    steps = (
        (20, 20, ("bus, line, log", "drivers/")),
        (210, 20, ("reader thread", "acquire/: ring")),
        (400, 20, ("merge by time", "live/capture")),
        (590, 20, ("sample grid", "align/: gaps marked")),
        (590, 130, ("row [u; y]", "into the sums, lib/")),
        (400, 130, ("identification", "lib/: A, B, C, D, K")),
        (210, 130, ("modes ± σ", "M, K, R, tracks")),
        (20, 130, ("publish/", "table, JSON, alarm")),
    )
    for x, y, words in steps:
        d.box(x, y, 150, 56, *words)
    for x in (170, 360, 550):
        d.line((x, 48), (x + 38, 48), arrow=True)
    d.line((665, 76), (665, 128), arrow=True)
    for x in (590, 400, 210):
        d.line((x, 158), (x - 38, 158), arrow=True)
    d.box(210, 240, 150, 56, "recorder thread", "journal/: every frame")
    d.line((285, 76), (285, 100), (380, 100), (380, 215), (285, 215), (285, 238), arrow=True, dash="4 3")
    d.text(380, 275, "raw frames on disk: a replay gives the same bits", "start", GREY)
    return d.keep("walk.svg")


def gap() -> str:
    d = Drawing(720, 170)
    for k in range(24):
        x, lost, used = 30 + 28 * k, 8 <= k < 11, k >= 4 and not 8 <= k < 15
        d.box(x, 40, 22, 22, fill="#ffc9c9" if lost else "#d0ebff")
        if not lost and k >= 4:
            d.line((x + 11, 70), (x + 11, 100), colour=GREEN if used else GREY, width=2)
            d.text(x + 11, 116, "✓" if used else "–", colour=GREEN if used else GREY)
    d.text(295, 30, "3 samples lost", colour=RED)
    d.text(440, 145, "p = 4 samples later every lag is there again: nothing is interpolated", colour=GREY)
    d.text(10, 116, "rows", "start")
    return d.keep("gap.svg")


def aliasing() -> str:
    d = Drawing(720, 190)
    for start, cycles, colour in ((0, 9, GREY), (0, 1, RED)):
        points = [(40 + 0.64 * k, 80 - 50 * cos(2 * pi * cycles * k / 1000 + start)) for k in range(1001)]
        d.line(*points, colour=colour, width=1.2 if cycles > 1 else 2.5)
    for k in range(11):
        d.dot(40 + 64 * k, 80 - 50 * cos(2 * pi * 9 * k / 10), BLUE, 5)
    d.text(
        360,
        165,
        "a vibration at 0.9 of the sample rate (grey), its samples, and the slow mode they look like (red)",
        colour=INK,
    )
    return d.keep("aliasing.svg")


def shift_structure() -> str:
    d = Drawing(640, 270)
    for row in range(5):
        for column in range(5):
            x, y = 40 + 60 * column, 25 + 44 * row
            if column < row:
                continue
            d.box(x, y, 54, 38, f"S{column - row}", fill="#a5d8ff" if row == 0 else "#f1f3f5")
            if row and column >= row:
                d.line((x - 16, y - 14), (x - 3, y - 2), colour=GREY, arrow=True)
    for k, words in enumerate(
        (
            "blue: summed per sample",
            "grey: the same sums, one sample",
            "earlier: shifted, plus and minus",
            "the samples at both ends",
        )
    ):
        d.text(355, 60 + 20 * k, words, "start")
    return d.keep("shift.svg")


def make() -> list[str]:
    return [one() for one in (wiring, degrees_of_freedom, walk_of_a_frame, gap, aliasing, shift_structure)]
