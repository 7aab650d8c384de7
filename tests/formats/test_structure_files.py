# SPDX-License-Identifier: MIT
"""How a structure moves where it is not measured, and the files that describe it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import okid
import pytest
import pyuff
from hypothesis import given, settings
from hypothesis import strategies as st
from okid.data.geometry import Geometry
from okid.data.structure_motion import StructureMotion, edges_of
from okid.formats import read_geometry, read_uff, write_uff
from okid.result.shape_places import places_of_shapes
from sample_records import identified

CHAIN = [(0.0, 0.0, 0.0), (0.0, 0.0, 1.0), (0.0, 0.0, 4.0), (0.0, 0.0, 6.0)]


def test_between_two_nodes_a_line_is_straight() -> None:
    """From the ground at 0 m to the sensor at 4 m; what is above has one neighbour and goes with it."""
    one = StructureMotion(Geometry(CHAIN, [(3, "-x")], [(1, 2), (2, 3), (3, 4)]), [(3, "-x")])
    moved = one.moved(np.array([2.0 - 1.0j]))
    np.testing.assert_allclose(moved[:, 0], np.array([0.0, 0.25, 1.0, 1.0]) * (-2.0 + 1.0j), atol=1e-14)
    assert not np.any(moved[:, 1:])
    assert one.measured(np.array([1.0 + 0j])).tolist() == [False, False, True, False]


def test_every_axis_by_itself_and_islands_at_rest() -> None:
    nodes = [(0.0, 0.0, 1.0), (1.0, 0.0, 1.0), (2.0, 0.0, 1.0), (9.0, 0.0, 0.0)]
    geometry = Geometry(nodes, [(1, "z"), (3, "y"), (3, "z")], [(1, 2), (2, 3)], fixed=[])
    one = StructureMotion(geometry, [(1, "z"), (3, "y"), (3, "z"), (3, "z"), None])
    moved = one.moved(np.array([1.0, 0.5, 3.0, 5.0, 7.0], dtype=complex)).real
    np.testing.assert_allclose(moved[:3], [[0, 0.5, 1.0], [0, 0.5, 2.5], [0, 0.5, 4.0]], atol=1e-14)
    assert not np.any(moved[3])
    lost = one.moved(np.array([np.nan, np.nan, 3.0, 5.0, 7.0], dtype=complex)).real
    np.testing.assert_allclose(lost[:3], [[0, 0, 4.0]] * 3, atol=1e-14)


def test_edges_of_surfaces_join_nodes() -> None:
    square = [(0.0, 0.0, 1.0), (1.0, 0.0, 1.0), (1.0, 1.0, 1.0), (0.0, 1.0, 1.0)]
    geometry = Geometry(square, [(1, "z")], [(2, 1)], surfaces=[(1, 2, 3, 4)], fixed=[3])
    assert edges_of(geometry) == [(0, 1), (0, 3), (1, 2), (2, 3)]
    moved = StructureMotion(geometry, [(1, "z")]).moved(np.array([1.0 + 0j])).real
    np.testing.assert_allclose(moved[:, 2], [1.0, 0.5, 0.0, 0.5], atol=1e-14)


def test_the_ground_is_at_rest_unless_it_is_measured_or_said() -> None:
    chain = {"nodes": CHAIN, "lines": [(1, 2), (2, 3), (3, 4)]}
    assert Geometry(dofs=[], **chain).at_rest([(4, "x"), None]) == [1]
    assert Geometry(dofs=[], **chain).at_rest([(1, "z"), (4, "x")]) == []
    assert Geometry(dofs=[], fixed=[], **chain).at_rest([(4, "x")]) == []
    assert Geometry(dofs=[], fixed=[2], **chain).at_rest([(4, "x")]) == [2]


def test_the_edge_of_a_surface_is_ten_times_as_stiff() -> None:
    nodes = [(0.0, 0.0, 2.0), (1.0, 0.0, 2.0), (0.0, 1.0, 2.0), (1.0, 0.0, 1.0)]
    geometry = Geometry(nodes, [], [(2, 4)], surfaces=[(1, 2, 3)], fixed=[3, 4])
    moved = StructureMotion(geometry, [(1, "x")]).moved(np.array([1.0 + 0j])).real
    plate = 10.0 / np.sqrt(2.0)  # node 2 to node 3
    assert moved[1, 0] == pytest.approx(10.0 / (10.0 + plate + 1.0), rel=1e-12)


@settings(deadline=None, max_examples=60)
@given(st.data())
def test_a_free_node_is_the_mean_of_its_neighbours(data: st.DataObject) -> None:
    """On any structure: nothing moves farther than a sensor, and each free node is the weighted mean by definition."""
    count = data.draw(st.integers(2, 12))
    place = st.tuples(*[st.integers(-3, 3).map(float)] * 3)
    nodes = data.draw(st.lists(place, min_size=count, max_size=count))
    number = st.integers(1, count)
    lines = data.draw(st.lists(st.tuples(number, number), max_size=20))
    sensors = data.draw(st.lists(st.tuples(number, st.just("x")), min_size=1, max_size=4))
    geometry = Geometry(nodes, sensors, lines, fixed=data.draw(st.lists(number, max_size=2)))
    entries = np.array(data.draw(st.lists(st.floats(-1, 1), min_size=len(sensors), max_size=len(sensors))), complex)
    one = StructureMotion(geometry, sensors)
    x = one.moved(entries)[:, 0].real
    assert np.max(np.abs(x)) <= np.max(np.abs(entries)) + 1e-9
    held = {node - 1 for node, _ in sensors} | {node - 1 for node in one.at_rest}
    at, edges = np.array(nodes), edges_of(geometry)
    for k in set(range(count)) - held:
        near = [(b if a == k else a, np.linalg.norm(at[a] - at[b])) for a, b in edges if k in (a, b)]
        weights = np.array([1.0 / max(length, 1e-6 * one.size) for _, length in near])
        if near:
            assert x[k] == pytest.approx(np.sum(weights * x[[n for n, _ in near]]) / np.sum(weights), abs=1e-6)


CSV = """# a frame
node;10;0,0;0;0
node;20;1,5;0;0
node;30;1,5;2;0
line;10;20
surface;10;20;30
sensor;roof, left;30;-z
fixed;10
"""


def test_a_table(tmp_path: Path) -> None:
    (tmp_path / "g.csv").write_text(CSV, encoding="utf-8")
    found = read_geometry(tmp_path / "g.csv")
    assert found.nodes == [(0.0, 0.0, 0.0), (1.5, 0.0, 0.0), (1.5, 2.0, 0.0)]
    assert (found.lines, found.surfaces, found.fixed) == ([(1, 2)], [(1, 2, 3)], [1])
    assert found.places(["other", "roof, left"], [5, None]) == [None, (3, "-z")]
    with pytest.raises(okid.InputError, match="g.csv: it places no sensor 'a1'"):
        found.places(["a1", "a2"], [1, 2])
    plain = CSV.replace(",", ".").replace(";", ",").replace("roof. left", "roof")
    (tmp_path / "h.csv").write_text("\ufeff" + plain, encoding="utf-8")
    assert read_geometry(tmp_path / "h.csv").nodes == found.nodes


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("line;10;20", "lines;10;20", r"g.csv: line 5: found 'lines;10;20', expected one of node,NUMBER,x,y,z; line"),
        ("line;10;20", "line;10", "g.csv: line 5: found 'line;10', expected line,NODE,NODE"),
        ("line;10;20", "line;10;40", "g.csv: line 5: node 40 has no row node"),
        ("node;20;", "node;10;", "g.csv: line 3: node 10 stands twice"),
        ("1,5;0;0", "nan;0;0", "g.csv: line 3: found .*, expected node,NUMBER,x,y,z"),
        ("surface;10;20;30", "surface;10;20", "g.csv: line 6: found .*, expected surface"),
        (";-z", ";w", "g.csv: line 7: found .*, expected sensor,CHANNEL,NODE,DIRECTION"),
        ("sensor;roof, left;30;-z\n", "", "g.csv: no row sensor"),
        ("fixed;10", "fixed;11", "g.csv: line 8: node 11 has no row node"),
    ],
)
def test_a_table_that_is_wrong(tmp_path: Path, old: str, new: str, words: str) -> None:
    assert old in CSV
    (tmp_path / "g.csv").write_text(CSV.replace(old, new, 1), encoding="utf-8")
    with pytest.raises(okid.InputError, match=words):
        read_geometry(tmp_path / "g.csv")


def element(number: int, kind: int, *nodes: int) -> str:
    head = f"{number:10d}{kind:10d}{1:10d}{1:10d}{8:10d}{len(nodes):10d}\n"
    rows = "".join("".join(f"{n:10d}" for n in nodes[k : k + 8]) + "\n" for k in range(0, len(nodes), 8))
    return head + ("         0         1         1\n" if kind == 21 else "") + rows


def universal(path: Path, *elements: str) -> Path:
    nodes = {"type": 15, "node_nums": [1, 5, 7, 9, 11, 13, 15, 17], "x": [0, 1, 1, 0] * 2, "y": [0, 0, 1, 1] * 2,
             "z": [0] * 4 + [2] * 4}  # fmt: skip
    pyuff.UFF(str(path)).write_sets({key: value if key == "type" else np.array(value, float if key in "xyz" else int)
                                     for key, value in nodes.items()}, "add")  # fmt: skip
    pyuff.UFF(str(path)).write_sets({"type": 82, "trace_num": 1, "nodes": np.array([1, 5, 0, 7, 9])}, "add")
    with path.open("a") as out:
        out.write(f"    -1\n  2412\n{''.join(elements)}    -1\n")
    return path


def test_a_universal_file(tmp_path: Path) -> None:
    path = universal(tmp_path / "m.unv", element(1, 21, 1, 11), element(2, 94, 11, 13, 15, 17), element(3, 91, 1, 5, 7),
                     element(4, 115, 1, 5, 7, 9, 11, 13, 15, 17), element(5, 161, 7))  # fmt: skip
    found = read_geometry(path)
    assert found.lines == [(1, 2), (3, 4), (1, 5)]
    assert found.surfaces[:2] == [(5, 6, 7, 8), (1, 2, 3)] and len(found.surfaces) == 2 + 6
    assert found.places(["13z", "-7x", "no"]) == [(6, "z"), (3, "-x"), None]
    assert found.at_rest([(5, "z")]) == [1, 2, 3, 4]
    raw = {"outputs": ["5x", "15y"], "output_dofs": [1, 2]}
    assert places_of_shapes(found, raw) == [(2, "x"), (7, "y")]
    with pytest.raises(okid.InputError, match='m.unv: it places no sensor .a1.*called by node and direction ."12z"'):
        found.places(["a1"])


@pytest.mark.parametrize(
    ("elements", "words"),
    [
        ((element(1, 116, *range(1, 21)),), "an element of kind 116 with 20 nodes is not drawn"),
        ((element(1, 94, 1, 5, 7, 99),), "joined to node 99, which is not in the file"),
        (("         1        94         1         1         8         0\n",), "an element of 0 nodes"),
        ((element(1, 94, 1, 5, 7, 9)[:61],), "ends after 1 lines"),
    ],
)
def test_a_universal_file_that_is_wrong(tmp_path: Path, elements: tuple[str, ...], words: str) -> None:
    with pytest.raises(okid.InputError, match=f"m.unv: .*({words})"):
        read_geometry(universal(tmp_path / "m.unv", *elements))


def test_surfaces_go_out_and_come_back(tmp_path: Path) -> None:
    nodes = [(0.0, 0.0, 1.0), (1.0, 0.0, 1.0), (2.0, 1.0, 1.0), (1.0, 2.0, 1.0), (0.0, 2.0, 1.0)]
    given_one = Geometry(
        nodes, [(k, "z") for k in (1, 2, 3)], [(1, 3)], surfaces=[(1, 2, 3, 4, 5), (1, 2, 3), (1, 2, 3, 4)]
    )
    write_uff(tmp_path / "r.uff", identified(), geometry=given_one)
    back = read_geometry(tmp_path / "r.uff")
    assert back.nodes == nodes and back.lines == [(1, 3)]
    assert back.surfaces == [(1, 2, 3), (1, 3, 4), (1, 4, 5), (1, 2, 3), (1, 2, 3, 4)]
    seen = pyuff.UFF(str(tmp_path / "r.uff"))
    elements = next(one for one in seen.read_sets() if one["type"] == 2412)
    assert [one["nodes_nums"] for one in elements[91]] == [[1, 2, 3], [1, 3, 4], [1, 4, 5], [1, 2, 3]]
    assert [one["nodes_nums"] for one in elements[94]] == [[1, 2, 3, 4]]
    assert read_uff(tmp_path / "r.uff").elements[-1] == (94, (1, 2, 3, 4))
