# SPDX-License-Identifier: MIT
"""Records as numpy.save() writes them: `okid identify x.npy` gives what the same numbers give as CSV, whatever their
type and order; damaged files and others are refused with their name."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import okid as package
import pytest
from program import okid

ASKED = ("--fs", "200", "--inputs", "c1", "--outputs", "c3,c2", "--method", "n4sid-moesp", "--order", "4", "--quiet")


@pytest.fixture(scope="module")
def codes() -> Any:
    """Small whole numbers: every type holds them."""
    rng = np.random.default_rng(1)
    force = rng.integers(-90, 90, 3000)
    body = package.Structure.chain([1.0, 0.8], [3e3, 2e3])
    frame = package.Structure(body.M, 1.0 * body.M + 1e-4 * body.K, body.K)
    y = frame.model(200.0, [1], [1, 2]).simulate(force[:, None].astype(float))
    return np.column_stack([force, np.round(y * 60 / np.abs(y).max())]).astype(np.int8)


def result(folder: Path, record: Path) -> Any:
    out = folder / "r.json"
    okid("identify", record, *ASKED, "--json", out, status=0)
    return json.loads(out.read_text())["modes"]


def test_every_type_and_order(tmp_path: Path, codes: Any) -> None:
    table = tmp_path / "t.csv"
    np.savetxt(table, codes, fmt="%d", delimiter=",", header="c1,c2,c3", comments="")
    expected = result(tmp_path, table)
    assert len(expected) == 2
    path = tmp_path / "t.npy"
    for kind in ("<f8", ">f8", "<f4", ">f4", "i1", "<i2", ">i2", "<i4", "<i8"):
        np.save(path, codes.astype(kind))
        assert result(tmp_path, path) == expected, kind
    np.save(path, np.asfortranarray(codes.astype("<i2")))
    assert result(tmp_path, path) == expected
    with open(path, "wb") as file:
        np.lib.format.write_array(file, codes.astype(float), version=(2, 0))
    assert result(tmp_path, path) == expected
    np.save(path, codes.astype(np.int64)[:, 1] + (1 << 40))
    assert np.array_equal(package.read_csv(path).samples[:, 0], codes[:, 1] + float(1 << 40))
    np.save(path, (codes.astype(np.int16) + 200).astype(np.uint16))
    assert np.array_equal(package.read_csv(path).samples, codes + 200.0)


def test_a_missing_sample(tmp_path: Path, codes: Any) -> None:
    values = codes.astype(float)
    values[1000, 1] = np.nan
    np.save(tmp_path / "t.npy", values)
    okid("identify", tmp_path / "t.npy", *ASKED, "--json", tmp_path / "r.json", status=0)
    assert json.loads((tmp_path / "r.json").read_text())["gaps"] == 1


def test_refusals(tmp_path: Path, codes: Any) -> None:
    path = tmp_path / "t.npy"

    def refused(*words: str, options: tuple[str, ...] = ASKED) -> None:
        said = okid("identify", path, *options, status=2).stderr
        assert all(word in said for word in ("t.npy", *words)), said

    np.save(path, codes)
    whole = path.read_bytes()
    refused("no sample rate", "--fs HZ", options=ASKED[2:])
    refused('no column "c4"', "c1 to c3", options=(*ASKED[:2], "--outputs", "c4"))
    refused("c1, c2, c3", options=("--fs", "200"))
    path.write_bytes(whole[:-1])
    refused("found 8999 bytes of numbers, expected 9000")
    path.write_bytes(whole[:50])
    refused("head is cut off")
    path.write_bytes(b"1,2,3\n4,5,6\n")
    refused("is no .npy file")
    for array, words in (
        (np.zeros((4, 3), complex), "found numbers of type '<c16'"),
        (np.zeros((4, 3), np.float16), "found numbers of type '<f2'"),
        (np.zeros((4, 3, 2)), "3 dimensions"),
        (np.zeros((0, 3)), "found 0 samples"),
        (np.zeros(4, [("a", float), ("b", float)]), "found numbers of type"),
    ):
        np.save(path, array)
        refused(words)
    values = codes.astype(float)
    values[17, 2] = np.inf
    np.save(path, values)
    refused("row 18, column c3: found inf")
