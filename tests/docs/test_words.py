# SPDX-License-Identifier: MIT
"""Words of the field in everything a user reads: the odd ones that were found stay out, acronyms are explained.

Read are the prose of all pages, the texts in quotes of the program, the package and the live page, and the comments of
the public headers. Of the comments of all sources DIALECT is read too.
"""

from __future__ import annotations

import re
import subprocess
import tokenize
from collections.abc import Iterable, Iterator
from functools import cache

import pytest
from markdown_pages import ROOT, name_of, pages, prose

NOBODY = r"\b(?:nobody|whoever)\b"
ODD = {  # pattern -> what to write
    r"\bblows?\b": "hit",
    r"\badds? the good ones up\b": "averages the accepted hits",
    r"\bjudges? (?:blows|hits)\b": "accepts or rejects hits",
    r"\bmodes that hold\b": "stable modes",
    r"\bridge that cures\b": "minimum stabilising regularisation",
    r"\bonly looks on\b": "is read-only",
    r"\bspeaks? against\b": "quality warning, why doubtful",
    r"\bdie[sd]? away\b": "decays",
    r"\bwritten over\b": "overwritten",
    r"\bmust pass over\b": "must ignore",
    r"\banew\b": "again",
    r"\bfor ever\b": "forever",
    r"\bmend(?:s|ed)?\b": "fix",
    r"\bgives? way in time\b": "is deleted",
    r"\bhonest(?:ly)?\b": "reliable",
    r"\bin the place of\b": "in place of",
    r"\b(?:is|are) told\b(?! apart)": "is reported",
    r"\bis said (?:on|in)\b": "is reported",
    r"\bcomes? to rest\b": "settles",
    r"\bcure[sd]\b": "makes stable",
    r"\bof no use\b": "is rejected",
    r"\bcomes? to an end\b": "converges, ends",
    r"\bnear thing\b": "close",
    r"\bwho they are\b": "keep their identity",
    r"\blooks? on\b": "is read-only, watches",
    r"\bwhoever reaches\b": "anyone who reaches",
    r"\b(?:hard|bear|carry) no more\b": "supports no more",
    r"\bmode that holds\b": "stable mode",
    r"\bfor so long\b": "for this long",
    r"\bgood ones\b": "accepted hits, valid ones",
    r"\bto be had\b": "possible, available",
    r"\bit does not serve\b": "it cannot be used",
    r"\btells? nothing\b": "reports nothing",
    r"\bwanders\b": "scatters",
    NOBODY: "no node, no reader, unmeasured",
}
DIALECT = {  # in comments and docstrings; pattern -> what to write
    r"\btold\b(?! apart)": "reported, known, given",
    NOBODY: "no reader, unmeasured, every source",
    r"\banew\b": "again",
    r"\bmend(?:s|ed)?\b": "fix",
    r"\bno one's business\b|\bis nobody's\b": "undefined, discarded",
    r"\bwho they are\b": "keep their identity",
    r"\b(?:to be|cannot be|can be) had\b": "possible, available",
    r"\bhonest\b": "reliable",
    r"\bcomes? to rest\b": "settles",
    r"\bspeaks? against\b": "why it is doubtful, contradicts",
}
ACRONYMS = {  # spelled out where a newcomer meets them first, on the pages they begin with
    "README.md": {
        "OKID": "observer/kalman filter identification",
        "ERA": "eigensystem realization algorithm",
        "MPC": "modal phase collinearity",
        "EMAC": "extended modal amplitude coherence",
        "FRF": "frequency response function",
    },
    "docs/recipes/hammer.md": {"FRF": "frequency response function"},
    "docs/recipes/matrices.md": {"DOF": "degree of freedom"},
    "docs/recipes/live-can.md": {"DBC": "can database"},
}
TEXT = {
    ".cpp": r'"((?:[^"\\\n]|\\.)*)"',
    ".py": r'"((?:[^"\\\n]|\\.)*)"',
    ".js": r"[\"'`]([^\"'`\n]*)[\"'`]",
    ".html": r">([^<\n]+)<",
}


@cache
def texts() -> tuple[tuple[str, str], ...]:
    """(where, text): prose of the pages, texts in quotes of sources, without their comments."""
    return tuple([*of_pages(), *of_sources(), *of_headers()])


def of_pages() -> Iterator[tuple[str, str]]:
    for page in pages():
        if page.name != "CHANGELOG.md":
            yield name_of(page), re.sub(r"\]\([^)]*\)", "]", prose(page.read_text()))


def of_sources() -> Iterator[tuple[str, str]]:
    listed = ["git", "ls-files", "firmware_host", "tools/okid"]
    for name in subprocess.run(listed, cwd=ROOT, capture_output=True, text=True, check=True).stdout.split():
        path = ROOT / name
        if path.suffix in TEXT and path.exists():
            source = re.sub(r'"""(?:.|\n)*?"""|(?m:^\s*(?://|#).*$)', "", path.read_text())
            source = re.sub(r'"\n\s*f?"', "", source)  # one text on several lines
            yield name, "\n".join(re.findall(TEXT[path.suffix], source))


def of_headers() -> Iterator[tuple[str, str]]:
    for folder in ("lib/include", "drivers/include", "firmware_host/include"):
        for path in sorted((ROOT / folder).rglob("*.h")):
            yield str(path.relative_to(ROOT)), " ".join(re.findall(r"(?:///<?|^/?\s?\*+)(.*)", path.read_text(), re.M))


@cache
def comments() -> tuple[tuple[str, str], ...]:
    """(where, text) of the comments of C and C++ and of the docstrings and comments of Python."""
    listed = ["git", "ls-files", "firmware_host", "lib", "drivers", "tools/okid"]
    out = []
    for name in subprocess.run(listed, cwd=ROOT, capture_output=True, text=True, check=True).stdout.split():
        path = ROOT / name
        if path.suffix in (".c", ".h", ".cpp", ".hpp") and path.exists():
            kept = re.findall(r"(?m)(?:^|[^:\"])//(.*)$|^\s*/?\*+ (.*)$", path.read_text())
            out.append((name, "\n".join(a or b for a, b in kept)))
        elif path.suffix == ".py" and path.exists():
            with path.open("rb") as file:
                tokens = list(tokenize.tokenize(file.readline))
            strings = [token.string for token in tokens if token.type == tokenize.STRING and '"""' in token.string[:5]]
            out.append((name, "\n".join([t.string for t in tokens if t.type == tokenize.COMMENT] + strings)))
    return tuple(out)


@cache
def names() -> tuple[tuple[str, str], ...]:
    """(where, names in the code) of the sources, words within a name apart."""
    listed = ["git", "ls-files", "firmware_host", "lib", "drivers", "tools/okid"]
    out = []
    for name in subprocess.run(listed, cwd=ROOT, capture_output=True, text=True, check=True).stdout.split():
        path = ROOT / name
        if path.suffix in (".c", ".h", ".cpp", ".hpp", ".py", ".js") and path.exists():
            out.append((name, re.sub(r"[_\W]+", " ", path.read_text())))
    return tuple(out)


def found_in(named: Iterable[tuple[str, str]], pattern: str) -> list[str]:
    return [
        f"{name}: …{text[max(0, hit.start() - 40) : hit.end() + 20]!r}"
        for name, text in named
        for hit in re.finditer(pattern, text, re.IGNORECASE)
    ]


@pytest.mark.parametrize("pattern", DIALECT)
def test_comments_are_plain(pattern: str) -> None:
    found = found_in(comments(), pattern)
    assert not found, f"write {DIALECT[pattern]!r}:\n" + "\n".join(found)


@pytest.mark.parametrize("pattern", [r"\btold\b(?! apart)", r"\banew\b", NOBODY])
def test_names_are_plain(pattern: str) -> None:
    found = found_in(names(), pattern)
    assert not found, "\n".join(found)


@pytest.mark.parametrize("pattern", ODD)
def test_odd_words_stay_out(pattern: str) -> None:
    found = found_in(texts(), pattern)
    assert not found, f"write {ODD[pattern]!r}:\n" + "\n".join(found)


def test_acronyms_are_spelled_out() -> None:
    for name, wanted in ACRONYMS.items():
        text = (ROOT / name).read_text()
        for acronym, words in wanted.items():
            first = re.search(rf"\b{acronym}s?\b", text)
            assert first and words in text.lower(), f"{name}: {acronym} is not spelled out as {words!r}"
            assert abs(text.lower().index(words) - first.start()) < 900, f"{name}: {acronym} stands far from {words!r}"


def test_glossary() -> None:
    rows = re.findall(r"(?m)^\| (?!term|---)(.+?) \|", (ROOT / "docs" / "glossary.md").read_text())
    assert len(rows) >= 60 and rows == list(dict.fromkeys(rows))


def test_the_readme_is_short() -> None:
    assert len((ROOT / "README.md").read_text().splitlines()) <= 120
