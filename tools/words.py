# SPDX-License-Identifier: MIT
"""Words of the pages: how many, how long the sentences are, how many words carry a digit.

usage: tools/words.py [--check] [PAGE ..]     default: README.md and all of docs/
Columns: words, longest sentence, sentences over 30 words, percent of words with a digit. Code blocks, comments and
addresses are no words, code in backquotes is one. Tables count as words only. --check: bounds of tools/words.toml.
exit codes: 0 within the bounds, 1 a bound is passed, 2 wrong usage
"""

from __future__ import annotations

import argparse
import pathlib
import re
import sys
import tomllib
from typing import NamedTuple

ROOT = pathlib.Path(__file__).resolve().parents[1]
LONG = 30  # words that a sentence may have
ENDS = re.compile(r"(?<=[.!?])[)\"'*_]*\s+(?=[(\"'*_\[]*(?:[A-Z0-9±α-ωΑ-Ω]|okid|code))")
SHORT = re.compile(r"\b(?:e\.g|i\.e|vs|ch|eq|al|etc)\.", re.IGNORECASE)


class Count(NamedTuple):
    """One page, or the sum of several."""

    words: int
    longest: int
    over: int
    prose: int
    digits: int

    @property
    def percent(self) -> float:
        """Of the words of the prose those with a digit."""
        return 100.0 * self.digits / max(self.prose, 1)

    def plus(self, other: Count) -> Count:
        """Both pages together."""
        longest = max(self.longest, other.longest)
        over, prose, digits = self.over + other.over, self.prose + other.prose, self.digits + other.digits
        return Count(self.words + other.words, longest, over, prose, digits)


def words_of(text: str) -> list[str]:
    """Pieces with a letter or a digit in them."""
    return [piece for piece in text.split() if re.search(r"\w", piece)]


def readable(text: str) -> str:
    """Without code blocks, comments, formulas and addresses; a piece of code in backquotes is one word."""
    text = re.sub(r"(?ms)^( *)(`{3,})[^\n]*\n.*?^\1\2 *$", "", text)
    text = re.sub(r"(?ms)^\$\$.*?^\$\$ *$|<!--.*?-->", "", text)
    text = re.sub(r"(?m)^ {4,}(?![-*\d ]).*$", "", text)
    text = re.sub(r"(?m)^(#+ )\d+\. ", r"\1", re.sub(r"(?m)^( *)\d+\. ", r"\1- ", text))  # numbers of items
    text = re.sub(r"(`+)(?:(?!\1).)+?\1|\$[^$\n]+\$", "code", text)
    return re.sub(r"!?\[([^\]]*)\]\([^)]*\)", r"\1", re.sub(r"<[^>\n]+>", "", text))


def sentences(text: str) -> list[str]:
    """Headings, items of lists and paragraphs end a sentence, too."""
    found: list[str] = []
    for part in re.split(r"\n\s*\n|\n(?=\s*(?:[-*]|\d+\.) )|(?m:^#.*$)", text):
        flat = SHORT.sub(lambda hit: hit[0][:-1], " ".join(part.split()))
        found += ENDS.split(flat)
    return found


def count(text: str) -> Count:
    """Of the Markdown text of one page."""
    text = readable(text)
    prose = re.sub(r"(?m)^\s*\|.*$", "\n", text)
    lengths = [len(words_of(one)) for one in sentences(prose)] or [0]
    words = words_of(prose)
    digits = sum(bool(re.search(r"\d", word)) for word in words)
    over = sum(length > LONG for length in lengths)
    return Count(len(words_of(text.replace("|", " "))), max(lengths), over, len(words), digits)


def pages() -> list[pathlib.Path]:
    """README.md and all of docs/."""
    return [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]


def counts(which: list[pathlib.Path]) -> dict[str, Count]:
    """By the name as seen from the root of the repository, the sum at last."""
    found = {str(page.resolve().relative_to(ROOT)): count(page.read_text("utf-8")) for page in which}
    total = Count(0, 0, 0, 0, 0)
    for one in found.values():
        total = total.plus(one)
    return found | {"total": total}


def passed(found: dict[str, Count]) -> list[str]:
    """Bounds that are passed, in words."""
    bounds = tomllib.loads((ROOT / "tools" / "words.toml").read_text("utf-8"))
    out: list[str] = []
    for name, bound in bounds.items():
        for what, most in bound.items() if name in found else ():
            if (there := getattr(found[name], what)) > most:
                out.append(f"{name}: {what} {there:.6g}, bound {most}")
    return out


def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description="words, long sentences and digits of the pages")
    parser.add_argument("--check", action="store_true", help="compare with tools/words.toml")
    parser.add_argument("page", nargs="*", type=pathlib.Path)
    given = parser.parse_args(arguments)
    found = counts(given.page or pages())
    for name, one in found.items():
        print(f"{one.words:7} {one.longest:4} {one.over:4} {one.percent:5.1f}  {name}")
    faults = passed(found) if given.check else []
    print("".join(f"{fault}\n" for fault in faults), end="", file=sys.stderr)
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())
