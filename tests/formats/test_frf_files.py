# SPDX-License-Identifier: MIT
"""Files of frequency responses: universal files as pyuff writes them (the judge: it shares no code with okid), CSV,
HDF5, set-ups joined, and files that are damaged or hold something else."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import okid
import pytest
import pyuff
from okid.frf import Frf

LINES = np.arange(1.0, 65.0) * 0.5


def _response(seed: int) -> Any:
    r = np.random.default_rng(seed)
    return r.normal(size=len(LINES)) + 1j * r.normal(size=len(LINES))


def _written(path: Path, binary: int, wide: bool = True, function: int = 4) -> dict[tuple[int, int], Any]:
    """Responses of nodes 4 and 7 (z, against x) to node 7 (z) and a function that is none."""
    values = {(4, 3): _response(1), (7, -1): _response(2)}
    sets = [
        {
            "type": 58, "binary": binary, "func_type": function, "ver_num": 0, "load_case_id": 0,
            "rsp_ent_name": "NONE", "rsp_node": node, "rsp_dir": way,
            "ref_ent_name": "NONE", "ref_node": 7, "ref_dir": 3, "x": LINES, "data": h,
            "ord_data_type": 6 if wide else 5, "abscissa_spacing": 1, "abscissa_min": LINES[0],
            "abscissa_inc": 0.5, "abscissa_num_points": len(LINES), "num_pts": len(LINES), "z_axis_value": 0.0,
            "id1": "a", "id2": "b", "id3": "c", "id4": "d", "id5": "e",
            "orddenom_spec_data_type": 13, "ordinate_spec_data_type": 12, "abscissa_spec_data_type": 18,
            "z_axis_spec_data_type": 0, "version_num": 0, "abscissa_axis_units_lab": "Hz", "n_bytes": 0,
        }
        for (node, way), h in values.items()
    ]  # fmt: skip
    path.unlink(missing_ok=True)
    for one in sets:
        pyuff.UFF(str(path)).write_sets(one, "add")
    return values


@pytest.mark.parametrize(("binary", "wide"), [(0, True), (1, True), (0, False)])
def test_universal_files_of_another_program(tmp_path: Path, binary: int, wide: bool) -> None:
    values = _written(tmp_path / "a.uff", binary, wide)
    found = okid.read_frf(tmp_path / "a.uff")
    assert found.names() == (["7z"], ["4z", "-7x"])
    assert np.allclose(found.frequency_hz, LINES)
    for k, h in enumerate(values.values()):
        assert np.allclose(found.response[:, k, 0], h, rtol=1e-4)


@pytest.mark.parametrize("name", ["a.uff", "a.unv", "a.csv", "a.h5"])
@pytest.mark.parametrize("binary", [True, False])
def test_what_is_written_is_read(tmp_path: Path, name: str, binary: bool) -> None:
    h = np.stack([_response(k) for k in range(6)], axis=1).reshape(-1, 3, 2)
    before = Frf.of(LINES, h, ["1x", "2x"], ["1x", "-3y", "12rz"])
    okid.write_frf(tmp_path / name, before, binary=binary)
    after = okid.read_frf(tmp_path / name)
    assert after.names() == before.names() and np.allclose(after.frequency_hz, LINES)
    assert np.allclose(after.response, h, rtol=1e-10)
    if name == "a.uff":
        sets = pyuff.UFF(str(tmp_path / name)).read_sets()
        assert np.allclose(sets[4]["data"], h[:, 1, 1]) and (sets[4]["rsp_node"], sets[4]["rsp_dir"]) == (3, -2)


def test_set_ups_are_joined(tmp_path: Path) -> None:
    h = np.stack([_response(k) for k in range(4)], axis=1)[:, :, None]
    okid.write_frf(tmp_path / "a.csv", Frf.of(LINES, h[:, :2], ["f"], ["r", "a"]))
    okid.write_frf(tmp_path / "b.csv", Frf.of(LINES, h[:, 2:], ["f"], ["r", "b"]))
    found = okid.read_frf(tmp_path / "a.csv", tmp_path / "b.csv")
    assert found.set_ups == 2 and found.outputs == ("r", "a", "b")
    assert np.allclose(found.response[:, 0, 0], (h[:, 0, 0] + h[:, 2, 0]) / 2)
    okid.write_frf(tmp_path / "c.csv", Frf.of(LINES, h[:, 3:], ["g"], ["c"]))
    with pytest.raises(okid.InputError, match="no response of c to f, expected one of every output to every input"):
        okid.read_frf(tmp_path / "a.csv", tmp_path / "c.csv")
    okid.write_frf(tmp_path / "d.csv", Frf.of(2 * LINES, h[:, 3:], ["f"], ["c"]))
    with pytest.raises(okid.InputError, match=r"d.csv: found 64 lines up to 64 Hz, expected the 64 lines up to 32 Hz"):
        okid.read_frf(tmp_path / "a.csv", tmp_path / "d.csv")


def test_files_that_are_none(tmp_path: Path) -> None:
    path = tmp_path / "a.uff"
    _written(path, 0, function=1)
    with pytest.raises(okid.InputError, match="no data set 58 with a frequency response"):
        okid.read_frf(path)
    _written(path, 1)
    whole = path.read_bytes()
    path.write_bytes(whole[: 3 * len(whole) // 4])
    with pytest.raises(okid.InputError, match=r"a.uff: line \d+: .*(cut off|numbers, expected)"):
        okid.read_frf(path)
    path.write_text("nothing\n")
    with pytest.raises(okid.InputError, match="no data set, expected a universal file"):
        okid.read_frf(path)
    table = tmp_path / "a.csv"
    table.write_text("time_s,a\n0,1\n1,2\n")
    with pytest.raises(okid.InputError, match='the first column is "time_s"; expected a column frequency_hz'):
        okid.read_frf(table)
    table.write_text("frequency_hz,a/b:re,a/b:abs\n1,1,1\n2,2,2\n")
    with pytest.raises(okid.InputError, match='found the column "a/b:abs"'):
        okid.read_frf(table)
    table.write_text("frequency_hz,a/b:re,a/b:im\n2,1,1\n1,2,2\n")
    with pytest.raises(okid.InputError, match="1 Hz behind 2 Hz, expected ascending"):
        okid.read_frf(table)
    with pytest.raises(okid.InputError, match=r"the extension is '.txt'"):
        okid.read_frf(tmp_path / "a.txt")
