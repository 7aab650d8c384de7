# SPDX-License-Identifier: MIT
"""Universal files: ours as pyuff sees them, those of pyuff as we see them, and files of other programs by hand."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import okid
import pytest
import pyuff
from hypothesis import assume, given
from okid.data.records import Record
from okid.formats import Geometry, read_geometry, read_record, read_uff, write_record, write_result, write_uff
from okid.formats.uff import uff_losses
from okid.formats.uff_function import shortest_rate
from sample_records import NAMES, assert_same, full_record, identified, records, steady

HISTORY = {
    "type": 58, "func_type": 1, "rsp_node": 5, "rsp_dir": -3, "ref_node": 0, "ref_dir": 0, "id1": "left",
    "id2": "run 7", "abscissa_spacing": 1, "orddenom_spec_data_type": 0, "ordinate_spec_data_type": 12,
    "ordinate_axis_units_lab": "g",
}  # fmt: skip


def written_by_pyuff(path: Path, *sets: dict) -> Path:
    for one in sets:
        pyuff.UFF(str(path)).write_sets(dict(one), "add")
    return path


def seen_by_pyuff(path: Path, kind: int) -> list[dict]:
    sets = pyuff.UFF(str(path)).read_sets()
    return [one for one in (sets if isinstance(sets, list) else [sets]) if one["type"] == kind]


@pytest.mark.parametrize("binary", [True, False])
def test_time_histories_as_pyuff_sees_them(tmp_path: Path, binary: bool) -> None:
    record = full_record()
    write_uff(tmp_path / "a.uff", record, binary=binary)
    seen = seen_by_pyuff(tmp_path / "a.uff", 58)
    assert [one["id1"] for one in seen] == record.names
    assert [one["ordinate_axis_units_lab"] for one in seen] == record.units
    assert [one["ordinate_spec_data_type"] for one in seen] == [13, 12, 0, 0]
    assert [one["rsp_node"] for one in seen] == [1, 2, 3, 3]
    assert [one["binary"] for one in seen] == [int(binary)] * 4
    for one, column in zip(seen, record.samples.T, strict=True):
        np.testing.assert_allclose(one["data"], column, rtol=0.0 if binary else 1e-11)
        assert one["abscissa_inc"] == pytest.approx(1 / 1024.0, rel=1e-6)
    assert seen_by_pyuff(tmp_path / "a.uff", 164)[0]["units_code"] == 1
    assert seen_by_pyuff(tmp_path / "a.uff", 151)[0]["model_name"] == record.title


@steady
@given(records())
def test_any_record_comes_back(tmp_path: Path, record: Record) -> None:
    assume(record.title.strip().upper() != "NONE")  # the format's own word for no title
    write_record(tmp_path / "a.unv", record)
    assert_same(read_record(tmp_path / "a.unv"), record, notes=False)


def test_ascii_keeps_twelve_digits_and_gaps(tmp_path: Path) -> None:
    write_uff(tmp_path / "a.uff", full_record(), binary=False)
    found = read_record(tmp_path / "a.uff")
    np.testing.assert_allclose(found.samples, full_record().samples, rtol=1e-11)
    assert found.fs_hz == 1024.0
    assert uff_losses(full_record()) == ["note 'operator'", "note 'structure'"]


@pytest.mark.parametrize("binary", [0, 1])
@pytest.mark.parametrize("rate", [1024.0, 51200.0, 333.0, 0.5])
def test_time_histories_of_pyuff(tmp_path: Path, binary: int, rate: float) -> None:
    x, data = np.arange(200) / rate, np.random.default_rng(1).standard_normal(200)
    sets = [HISTORY | {"x": x, "data": data * k, "binary": binary, "id1": name} for k, name in ((1, "a"), (2, "b"))]
    record = read_record(written_by_pyuff(tmp_path / "a.uff", *sets))
    assert (record.names, record.units, record.fs_hz, record.title) == (["a", "b"], ["g", "g"], rate, "run 7")
    assert record.roles == ["acceleration"] * 2
    np.testing.assert_allclose(record.samples, np.column_stack([data, 2 * data]), rtol=1e-11)


def test_uneven_abscissa(tmp_path: Path) -> None:
    even = HISTORY | {"x": np.arange(9) * 0.25, "data": np.arange(9.0), "abscissa_spacing": 0}
    assert read_record(written_by_pyuff(tmp_path / "a.uff", even)).fs_hz == 4.0
    odd = even | {"x": np.array([0, 1, 2, 3, 4, 5, 6, 7, 9.0])}
    with pytest.raises(okid.InputError, match="b.uff: left: a step of 2 s after sample 7.* even abscissa is required"):
        read_record(written_by_pyuff(tmp_path / "b.uff", odd))


def test_functions_of_unequal_length_are_listed_and_chosen(tmp_path: Path) -> None:
    one = HISTORY | {"x": np.arange(100) / 50, "data": np.ones(100)}
    other = HISTORY | {"x": np.arange(80) / 50, "data": np.ones(80), "id1": "short"}
    path = written_by_pyuff(tmp_path / "a.uff", one, other, one)
    words = r"a.uff: time histories on 2 grids, .*1: left, left \(100 samples, 50 Hz, from 0 s\); 2: short \(80 samples"
    with pytest.raises(okid.InputError, match=words):
        read_record(path)
    assert read_record(path, group=1).names == ["left", "left (2)"]
    assert read_uff(path).record("2").samples.shape == (80, 1)
    with pytest.raises(okid.InputError, match="a.uff: group is 'x', expected one of 1: left"):
        read_record(path, group="x")


def test_frfs_of_pyuff(tmp_path: Path) -> None:
    values = np.exp(1j * np.arange(30.0))
    given = HISTORY | {"func_type": 4, "x": np.arange(30) * 0.5, "data": values, "ref_node": 7, "ref_dir": 1}
    path = written_by_pyuff(tmp_path / "a.uff", given, given | {"abscissa_spacing": 0})
    for frf in read_uff(path).frfs:
        np.testing.assert_allclose(frf.values, values, rtol=1e-10)
        np.testing.assert_allclose(frf.x, np.arange(30) * 0.5)
        assert (frf.response, frf.reference) == ((5, -3), (7, 1))
    with pytest.raises(okid.InputError, match="a.uff: holds no time history"):
        read_record(path)


def geometry() -> Geometry:
    nodes = [(0.0, 0.0, 0.0), (0.0, 0.0, 1.25), (0.1, 0.0, 2.5), (0.0, 0.0, 3.75)]
    return Geometry(nodes, [(2, "x"), (3, "-x"), (4, "y")], [(1, 2), (2, 3), (3, 4)], {"storey1": 1, "shaker": 1})


def test_result_as_pyuff_sees_it(tmp_path: Path) -> None:
    result = identified()
    write_result(tmp_path / "r.uff", result, geometry())
    modes = seen_by_pyuff(tmp_path / "r.uff", 55)
    assert len(modes) == len(result.modes) == 3
    for seen, mode in zip(modes, result.modes, strict=True):
        assert seen["freq"] == pytest.approx(mode.frequency_hz, rel=1e-6)
        assert seen["modal_damp_vis"] == pytest.approx(mode.damping_ratio, rel=1e-6)
        assert seen["node_nums"].tolist() == [2, 3, 4]
        np.testing.assert_allclose(
            [seen["r1"][0], seen["r1"][1], seen["r2"][2]], mode.shape * [1, -1, 1], rtol=5e-6, atol=1e-12
        )
        assert np.count_nonzero([seen["r1"], seen["r2"], seen["r3"]]) == 3
    frfs = seen_by_pyuff(tmp_path / "r.uff", 58)
    line = np.linspace(0.0, 500.0, len(frfs[0]["data"]))
    expected = result.model.frequency_response(line)
    for k, seen in enumerate(frfs):
        assert (seen["func_type"], seen["ref_node"], seen["ref_dir"]) == (4, 2, 1)
        np.testing.assert_allclose(seen["data"], expected[:, k, 0], rtol=1e-12)
    assert [(s["rsp_node"], s["rsp_dir"]) for s in frfs] == [(2, 1), (3, -1), (4, 2)]
    nodes = seen_by_pyuff(tmp_path / "r.uff", 15)[0]
    np.testing.assert_allclose(np.array([nodes["x"], nodes["y"], nodes["z"]]).T, geometry().nodes)
    lines = seen_by_pyuff(tmp_path / "r.uff", 82)[0]
    assert (lines["n_nodes"], lines["nodes"].tolist()) == (8, [1, 2, 0, 2, 3, 0, 3, 4])


def test_result_comes_back(tmp_path: Path) -> None:
    result = identified()
    tree = result.to_dict()
    for mode, mass in zip(tree["modes"], (None, 2.5, None), strict=True):
        mode["modal_mass"] = mass
    write_uff(tmp_path / "r.uff", tree)
    found = read_uff(tmp_path / "r.uff")
    assert [seen["modal_m"] for seen in seen_by_pyuff(tmp_path / "r.uff", 55)] == [0.0, 2.5, 0.0]
    assert [mode.modal_mass for mode in found.modes] == [0.0, 2.5, 0.0]
    for mode, known in zip(found.modes, result.modes, strict=True):
        assert mode.frequency_hz == pytest.approx(known.frequency_hz, rel=1e-6)
        np.testing.assert_allclose(mode.shape[:, 0], known.shape, rtol=5e-6)
        assert mode.nodes == [1, 2, 3]
    np.testing.assert_array_equal(found.frfs[2].x, np.linspace(0.0, 500.0, 1025))
    assert found.frfs[2].name == f"{NAMES[3]} / {NAMES[0]}"
    assert found.header["program"].startswith("okid ")


def test_complex_modes_and_six_values_a_node_of_pyuff(tmp_path: Path) -> None:
    pole = 2 * np.pi * 12.5 * (-0.02 + 1j * np.sqrt(1 - 0.02**2))
    shape = np.array([1.0, 0.5, -0.25])
    common = {"type": 55, "data_ch": 2, "spec_data_type": 8, "load_case": 1, "mode_n": 4, "node_nums": [1, 2, 9]}
    complex_mode = common | {"analysis_type": 3, "eig": pole, "r1": shape * 1j, "r2": shape, "r3": shape}
    real_mode = common | {
        "analysis_type": 2,
        "freq": 12.5,
        "modal_damp_vis": 0.02,
        **{f"r{k}": shape * k for k in range(1, 7)},
    }
    for mode in read_uff(written_by_pyuff(tmp_path / "a.uff", complex_mode, real_mode)).modes:
        assert (mode.number, mode.nodes) == (4, [1, 2, 9])
        assert mode.frequency_hz == pytest.approx(12.5, rel=1e-5)
        assert mode.damping_ratio == pytest.approx(0.02, rel=1e-4)
        np.testing.assert_allclose(mode.shape[:, 1].real, shape * (1 if mode.shape.shape[1] == 3 else 2), rtol=1e-5)


def test_nodes_and_lines_of_pyuff(tmp_path: Path) -> None:
    nodes = {"type": 15, "node_nums": [3, 7], "x": [0.5, 1.0], "y": [0.0, -2.0], "z": [1e-3, 4.0]}
    lines = {"type": 82, "trace_num": 1, "nodes": np.array([3, 7, 0, 7, 3])}
    found = read_uff(written_by_pyuff(tmp_path / "a.uff", nodes, lines))
    assert found.nodes == {3: (0.5, 0.0, 1e-3), 7: (1.0, -2.0, 4.0)}
    assert found.lines == [(3, 7), (7, 3)]


FORTRAN = """    -1
   164
         1SI                           2
  1.00000000000000000D+00  1.00000000000000000D+00  1.00000000000000000D+00
  2.73149999999999977D+02
    -1
    -1
  2411
         1         0         0        11
   0.0000000000000000D+00   1.5000000000000000D+00  -2.5000000000000000D-01
    -1
    -1
    58
NONE
NONE
21-Nov-26 12:00:00
NONE
NONE
    1         0    0         0       NONE         4   3       NONE         0   0
         2         7         1  0.00000E+00  9.76563E-04  0.00000E+00
        17    0    0    0                 NONE                 NONE
        12    0    0    0                 NONE                 NONE
         0    0    0    0                 NONE                 NONE
         0    0    0    0                 NONE                 NONE
-1.00000E+000 2.00000E+000-3.00000E+000 4.00000E+000-5.00000E+000 6.00000E+000
 7.00000E+000
    -1
    -1
  9999
unknown
    -1
"""


def test_a_file_as_fortran_writes_it(tmp_path: Path) -> None:
    for ends in ("\n", "\r\n"):
        (tmp_path / "a.unv").write_bytes(FORTRAN.replace("\n", ends).encode())
        found = read_uff(tmp_path / "a.unv")
        record = found.record()
        assert (record.names, record.units, record.fs_hz) == (["node 4 z"], ["m/s^2"], 1024.0)
        assert record.samples[:, 0].tolist() == [-1, 2, -3, 4, -5, 6, 7]
        assert (found.nodes, found.others) == ({1: (0.0, 1.5, -0.25)}, [9999])
        assert record.notes == {"date": "21-Nov-26 12:00:00"}


def test_minus_one_among_the_binary_samples(tmp_path: Path) -> None:
    tag = np.frombuffer(b"\n    -1\n    -1\n\n", dtype="<f8")
    write_uff(tmp_path / "a.uff", Record(["a", "b"], np.column_stack([tag, tag]), 10.0))
    np.testing.assert_array_equal(read_record(tmp_path / "a.uff").samples[:, 1], tag)


def test_big_endian_and_single_precision(tmp_path: Path) -> None:
    write_uff(tmp_path / "a.uff", Record(["a"], [[1.5], [-2.0]], 10.0))
    data = (tmp_path / "a.uff").read_bytes()
    little, big = np.array([1.5, -2.0], "<f8").tobytes(), np.array([1.5, -2.0], ">f8").tobytes()
    (tmp_path / "b.uff").write_bytes(data.replace(little, big).replace(b"    58b     1", b"    58b     2"))
    assert read_record(tmp_path / "b.uff").samples[:, 0].tolist() == [1.5, -2.0]
    single = data.replace(little, np.array([1.5, -2.0], "<f4").tobytes()).replace(
        b"         4         2", b"         2         2"
    )
    (tmp_path / "c.uff").write_bytes(single)
    assert read_record(tmp_path / "c.uff").samples[:, 0].tolist() == [1.5, -2.0]


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda text: text[:700], r"data set 58 at line 13 has no closing -1: the file is cut off"),
        (lambda text: text.replace(" 7.00000E+000\n", ""), "data set 58 at line 14: holds 6 numbers, expected 7"),
        (lambda text: text.replace("4.00000E+000", "four"), "data set 58, line 25: found .*four.*, expected a number"),
        (lambda text: text.replace("9.76563E-04", "0.00000E+00"), "line 20: abscissa increment '0.00000E.00'"),
        (lambda text: text.replace("         2         7", "         3         7"), "line 20: ordinate type 3 with 7"),
        (
            lambda text: text.replace("    58\n", "    no\n"),
            "found .*no.* behind -1, expected the number of a data set",
        ),
        (lambda text: text.replace("    -1", ""), "holds no data set, expected a universal file"),
    ],
)
def test_damage_is_named_by_line(tmp_path: Path, change, words: str) -> None:  # type: ignore[no-untyped-def]
    (tmp_path / "a.unv").write_text(change(FORTRAN), encoding="utf-8")
    with pytest.raises(okid.InputError, match=f"a.unv: .*{words}") as told:
        read_uff(tmp_path / "a.unv")
    assert "\n" not in str(told.value)


@pytest.mark.parametrize(
    ("record", "words"),
    [
        (Record(["a"], [[1.0]]), "a universal file needs a sample rate"),
        (Record(["a" * 81], [[1.0]], 1.0), "name 'aaa.* has 81 characters, a universal file holds 80"),
        (Record(["a"], [[1.0]], 1.0, ["m" * 21]), "unit 'm*' has 21 characters, a universal file holds 20"),
    ],
)
def test_what_does_not_fit_is_refused(tmp_path: Path, record: Record, words: str) -> None:
    with pytest.raises(okid.InputError, match=f"a.uff: {words}"):
        write_uff(tmp_path / "a.uff", record)
    assert list(tmp_path.iterdir()) == []


def test_rate_of_a_rounded_step() -> None:
    assert shortest_rate(9.76563e-4, 0.5001e-9) == 1024.0
    assert shortest_rate(1.953125e-5, 0.5001e-11) == 51200.0
    assert shortest_rate(0.0301, 0.00005) == pytest.approx(33.2, abs=0.05)


CONFIG = """
[[channel]]
name = "storey1"
dof = 2
[geometry]
nodes = [[0, 0, 0], [0, 0, 1.5]]
dofs = [[1, "x"], [2, "-z"]]
lines = [[1, 2]]
"""


def test_geometry_of_a_config(tmp_path: Path) -> None:
    (tmp_path / "c.toml").write_text(CONFIG, encoding="utf-8")
    found = read_geometry(tmp_path / "c.toml")
    assert (found.nodes[1], found.lines, found.places(["storey1"])) == ((0.0, 0.0, 1.5), [(1, 2)], [(2, "-z")])
    with pytest.raises(okid.InputError, match="c.toml: sensor 'storey3' is at dof 3, but .geometry. dofs has 2"):
        write_uff(tmp_path / "r.uff", identified(), geometry=found)
    for old, new, words in (
        ('"-z"', '"w"', r"dofs, entry 2: found .2, 'w'., expected a node from 1 to 2"),
        ("[[1, 2]]", "[[1, 3]]", "lines, entry 1: found .1, 3., expected two nodes from 1 to 2"),
        ("[0, 0, 1.5]", "[0, 0]", "nodes, entry 2: found .0, 0., expected .x, y, z. in m"),
        ("[geometry]", "[geo]", "no .geometry. section"),
        ("[geometry]", "[geometry", "not TOML"),
    ):
        (tmp_path / "c.toml").write_text(CONFIG.replace(old, new), encoding="utf-8")
        with pytest.raises(okid.InputError, match=f"c.toml: .*{words}"):
            read_geometry(tmp_path / "c.toml")
