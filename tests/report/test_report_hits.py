# SPDX-License-Identifier: MIT
"""The report of many files: hits of a hammer test, records that were merged, frequency responses, set-ups."""

from __future__ import annotations

import json
import re
import shutil
from html import unescape
from pathlib import Path
from typing import Any

import beam
import numpy as np
import okid
import pytest
from okid import report
from okid.report.loaded import loaded_from
from okid.report.struck import measure_hits
from program import okid as program

CHANNELS = ["--inputs", "Hammer", "--outputs", "Acc1,Acc2", "--places", r"P(\d+)_", "--output-dofs", "1,5"]


def cells(page: str, section: str) -> list[list[str]]:
    text = page[page.index(f'<section id="{section}"') :]
    rows = re.findall(r"<tr>(.*?)</tr>", text[: text.index("</section>")])
    return [[unescape(cell) for cell in re.findall(r"<td[^>]*>(.*?)</td>", row)] for row in rows if "<td" in row]


def cells_text(page: str, section: str) -> str:
    text = page[page.index(f'<section id="{section}"') :]
    return text[: text.index("</section>")]


def without_time(page: str) -> str:
    return re.sub(r"<tr><th>Written.*?</tr>", "", page)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Twelve places, two hits each, one of them a double hit; the result and its report, which finds the hits."""
    out = tmp_path_factory.mktemp("hits")
    paths = beam.write(out, beam.hammer_test(1, {(4, 2): "double_hit"}, each=2))
    program("identify", *paths, *CHANNELS, "--json", out / "all.json", status=0)
    assert report.main([str(out / "all.json")]) == 0
    return out


def refusal(capsys: pytest.CaptureFixture[str], *arguments: object) -> str:
    capsys.readouterr()
    assert report.main([str(one) for one in arguments]) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    return said


def test_hits_and_places(folder: Path) -> None:
    page = (folder / "all.html").read_text()
    hits = cells(page, "hits")
    assert hits[0][1] == "P04_2.csv" and hits[0][5] == "left out: double_hit" and "a second hit" in hits[0][6]
    assert len(hits) == 1 + 24 and [row[5] for row in hits[1:]].count("used") == 23
    assert "23 of 24 hits at 12 places were used" in page
    places = [row for row in cells(page, "responses") if len(row) == 6]
    assert [row[0] for row in places] == [str(k) for k in range(1, 13)]
    assert [row[1] for row in places] == ["1" if k == 4 else "2" for k in range(1, 13)]
    for row in places:  # the model explains what it was made of; two hits agree where the force has power
        assert min(float(row[2]), float(row[3])) > 70.0
        assert row[4] == "–" if row[0] == "4" else float(row[4]) > 0.95
    words = unescape(page)
    for title in ("Acc1 / place 1 (drive point)", "Acc2 / place 5 (drive point)", "(best fit)", "(worst fit)"):
        assert title in words
    for row in cells(page, "check"):
        assert float(row[6]) > 0.99 and float(row[4]) == pytest.approx(float(row[1]), rel=1e-3)
    assert "7 columns found" in page  # the diagram is of the whole band


def test_what_is_averaged(folder: Path) -> None:
    """Of the accepted hits alone, by okid.frf.h1(); H2 and Hv follow from the coherence."""
    result = report.load_result(folder / "all.json")
    raw = result.raw["hits"]
    records = [(hit, okid.read_csv(folder / hit["file"]), hit["file"]) for hit in raw]
    measured = measure_hits(result, records)
    assert measured.struck is not None and measured.frf is not None
    assert measured.struck.averages == [2, 2, 2, 1, *[2] * 8]
    own = [record.samples for hit, record, _ in records if hit["place"] == 7]
    sides = [one[:, :1] for one in own], [one[:, 1:] for one in own]
    for name, power in (("h1", 0.0), ("hv", -0.5), ("h2", -1.0)):
        wanted = okid.frf.h1(*sides, beam.FS, nperseg=len(own[0]), window="boxcar", estimator=name)
        found = measured.frf.response[1:, :, 6] * measured.struck.coherence[1:, :, 6] ** power
        np.testing.assert_allclose(found, wanted.response[1:, :, 0], rtol=1e-6)
    assert measured.fit is not None and min(v for v in measured.fit.simulation_percent.values() if v) > 95.0
    assert measured.factor == pytest.approx([1.0, 1.0], abs=0.02)
    turned = [
        (dict(hit, place=-hit["place"]), okid.Record(record.names, record.samples * [-1, 1, 1], record.fs_hz), name)
        for hit, record, name in records
    ]
    again = measure_hits(result, turned).frf
    assert again is not None
    np.testing.assert_allclose(again.response, measured.frf.response)


def test_records_named_by_the_result(folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    shutil.copy(folder / "all.json", tmp_path / "all.json")
    assert report.main([str(tmp_path / "all.json")]) == 0
    alone = (tmp_path / "all.html").read_text()
    assert "needs the records of the hits (the files of the hits are not beside it (P01_1.csv ..))" in unescape(alone)
    assert len(cells(alone, "hits")) == 25  # the table needs no record
    records = sorted(folder.glob("P*.csv"))
    assert report.main([str(tmp_path / "all.json"), "--record", *map(str, records)]) == 0
    whole = without_time((tmp_path / "all.html").read_text())
    found = without_time((folder / "all.html").read_text())
    same = [page[: page.index('<section id="provenance"')] for page in (whole, found)]
    assert same[0] == same[1]


def test_hits_in_a_folder_beside(folder: Path, tmp_path: Path) -> None:
    """Two tests of one structure, whose files have the same names: which one is asked, not guessed."""
    shutil.copy(folder / "all.json", tmp_path / "all.json")
    alone = set()
    for name in ("after", "before"):
        shutil.copytree(folder, tmp_path / name)
        assert report.main([str(tmp_path / "all.json")]) == 0
        page = unescape((tmp_path / "all.html").read_text())
        alone.add(re.sub(str(tmp_path), "", "".join(re.findall(r"\(files of their names are in .*?\)", page)[:1])))
        assert ("hits (files of their names" in page) == (name == "before")
    assert alone == {"", "(files of their names are in /after and in /before: --record says which)"}


def test_hits_of_numpy(folder: Path, tmp_path: Path) -> None:
    """Files that `okid identify` reads are read by the report."""
    paths = []
    for path in sorted(folder.glob("P0[1-3]_*.csv")):
        paths.append(tmp_path / f"{path.stem}.npy")
        np.save(paths[-1], okid.read_csv(path).samples)
    channels = ["--inputs", "c1", "--outputs", "c2,c3", "--places", r"P(\d+)_", "--output-dofs", "1,5"]
    program("identify", *paths, *channels, "--fs", str(beam.FS), "--json", tmp_path / "all.json", status=0)
    assert report.main([str(tmp_path / "all.json")]) == 0
    assert "6 of 6 hits at 3 places were used" in unescape((tmp_path / "all.html").read_text())


def test_files_that_do_not_belong(folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    given = [folder / "all.json", "--out", tmp_path / "o.html", "--record"]
    records = sorted(folder.glob("P*.csv"))
    other = tmp_path / "P13_1.csv"
    shutil.copy(records[0], other)
    assert "P13_1.csv: is none of the 24 hits of the result" in refusal(capsys, *given, *records, other)
    twice = tmp_path / "P01_1.csv"
    shutil.copy(records[0], twice)
    assert "P01_1.csv: is the second file of this name" in refusal(capsys, *given, *records, twice)
    assert "no file of Hammer@7 was given, expected P07_1.csv" in refusal(
        capsys, *given, *[path for path in records if not path.name.startswith("P07")]
    )
    text = records[0].read_text()
    twice.write_text(text.replace("2048", "1024"))
    assert "but the result is of 2048 Hz" in refusal(capsys, *given, twice, *records[1:])
    twice.write_text(text.replace("Acc2", "Acc9"))
    assert "P01_1.csv" in refusal(capsys, *given, twice, *records[1:])
    assert not (tmp_path / "o.html").exists()


def test_modal_masses_stand_beside_the_modes(folder: Path) -> None:
    """Of the shape with largest entry 1, as the result has them."""
    raw, page = json.loads((folder / "all.json").read_text()), (folder / "all.html").read_text()
    sure = [row for row in cells(page, "modes") if len(row) > 8]
    masses = [mode["modal_mass"] for mode in raw["modes"] if mode["confident"]]
    assert "mass [kg]" in page and len(sure) >= len(masses) == 7
    for row, mass in zip(sure, masses, strict=False):
        assert f"{mass:.4g}" in row


def test_three_hundred_files(folder: Path, tmp_path: Path) -> None:
    """Bounded: so many pictures as for twelve places, the table has all, hits are folded."""
    raw = json.loads((folder / "all.json").read_text())
    count, rng = 100, np.random.default_rng(1)
    columns = rng.integers(0, 12, count)
    for key in ("B", "D"):
        raw["model"][key] = np.array(raw["model"][key])[:, columns].tolist()
    raw["markov"]["Y"] = np.array(raw["markov"]["Y"])[:, :, columns].tolist()
    raw["inputs"] = [f"Hammer@{k}" for k in range(1, count + 1)]
    raw["input_dofs"] = list(range(1, count + 1))
    raw["hits"] = [
        dict(raw["hits"][0], file=f"P{k:03}_{n}.csv", place=k) for k in range(1, count + 1) for n in (1, 2, 3)
    ]
    result = loaded_from(raw, "many")
    model, _ = result.model()
    records = []
    for hit in raw["hits"]:
        force = np.zeros((600, count))
        force[40:43, hit["place"] - 1] = 100.0 * rng.uniform(0.5, 1.0)
        y = model.simulate(force)
        rows = np.column_stack([force[:, hit["place"] - 1], y + 0.001 * y.std() * rng.standard_normal(y.shape)])
        records.append(okid.Record(["Hammer", "Acc1", "Acc2"], rows, beam.FS, ["N", "m/s^2", "m/s^2"]))
    size = report.write_report(raw, tmp_path / "many.html", records)
    page = (tmp_path / "many.html").read_text()
    assert size < 4e6 and page.count("<svg") <= (folder / "all.html").read_text().count("<svg")
    assert "All 300 hits (folded; not printed)" in page and "the 24 of 100 places that fit worst" in page
    assert len([row for row in cells(page, "responses") if len(row) == 6]) == 100
    assert "Hammer, roving over 100 places" in page


def test_records_that_were_merged(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    u, y = okid.demo_record()
    names = ["u1", "y1", "y2", "y3"]
    halves = [np.hstack([u, y])[:8000], np.hstack([u, y])[8000:]]
    for k, rows in enumerate(halves):
        okid.formats.write_record(tmp_path / f"{k}.csv", okid.Record(names, rows + 5.0 * k, 1000.0))
    sides = [one[:, :1] for one in halves], [one[:, 1:] for one in halves]
    okid.identify(*sides, fs=1000.0, method="okid-era", sigma_blocks=0).save(tmp_path / "r.json")
    files = [str(tmp_path / f"{k}.csv") for k in (0, 1)]
    measured = report.build(report.load_result(tmp_path / "r.json"), files)
    assert "2 records, one behind the other" in measured and measured.count("<td>0</td>") >= 4  # nothing is missing
    fits = re.findall(r">(\d\d\.\d)</text>", measured[measured.index('id="fit"') :])
    assert fits and min(map(float, fits)) > 95.0  # each less its own mean
    okid.identify(u, y, fs=1000.0, method="okid-era", sigma_blocks=0).save(tmp_path / "one.json")
    said = refusal(capsys, tmp_path / "one.json", "--record", files[0], "--record", files[1])
    assert "2 records were given, and the result is of 1" in said


def test_responses_over_those_of_the_result(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    u, y = okid.demo_record()
    measured = okid.frf.h1(u, y, 1000.0, nperseg=4096)._replace(inputs=("1x",), outputs=("1x", "2x", "3x"))
    turned = measured._replace(
        response=measured.response.transpose(0, 2, 1), inputs=measured.outputs, outputs=measured.inputs
    )  # a roving hammer: exchanged by reciprocity
    for frf in (measured, turned):
        okid.write_frf(tmp_path / "h.uff", frf)
        program("identify", tmp_path / "h.uff", "--frf", "--band", "5:80", "--json", tmp_path / "r.json", status=0)
        assert report.main([str(tmp_path / "r.json"), "--record", str(tmp_path / "h.uff")]) == 0
        page = (tmp_path / "r.html").read_text()
        assert "Frequency responses, measured and synthesised" in page and "Gaps" not in page
        pairs = [row for row in cells(page, "responses") if len(row) == 3]
        assert [row[0] for row in pairs] == ["1x", "2x", "3x"] and all(float(row[2]) > 70.0 for row in pairs)
        assert [len(row) for row in cells(page, "check")] == [4, 4, 4]
        assert re.search("[34] columns found", page) and "completeness" not in page
        plain = re.sub(r"--record|<style.*?</style>|<script.*?</script>", "", page, flags=re.DOTALL)
        assert not re.search(r"\b(records?|holds?|detrend|samples?|simulation)\b", plain, re.IGNORECASE)
        assert "<td>responses</td>" in cells_text(page, "provenance") and ">of the modes<" in page
    okid.write_frf(tmp_path / "other.csv", measured._replace(outputs=("7x", "2x", "3x")))
    said = refusal(capsys, tmp_path / "r.json", "--record", tmp_path / "other.csv")
    assert "other.csv: has no response '1x'" in said


def test_set_ups(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    _, y = okid.demo_record()
    for name, columns in (("p", [0, 1]), ("q", [0, 2])):
        record = okid.Record(["ref", f"{name}1"], y[:, columns], 1000.0)
        okid.formats.write_record(tmp_path / f"{name}.csv", record)
    files = [tmp_path / "p.csv", tmp_path / "q.csv"]
    program("identify", *files, "--setups", "--outputs", "ref,p1,q1", "--json", tmp_path / "r.json", status=0)
    assert report.main([str(tmp_path / "r.json")]) == 0
    page = (tmp_path / "r.html").read_text()
    assert cells(page, "set-ups") == [["1", "p.csv", "p1"], ["2", "q.csv", "q1"]]
    assert "In every set-up: ref; the shapes are scaled there." in page
    assert "result is of 2 set-ups" in refusal(capsys, tmp_path / "r.json", "--record", files[0], files[1])


def test_universal_file_of_the_places(folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    from okid.formats.command import main

    raw: dict[str, Any] = json.loads((folder / "all.json").read_text())
    nodes = ", ".join(f"[{k}, 0, 0]" for k in range(13))
    places = ", ".join(f'[{14 - k}, "-z"]' for k in range(1, 13))  # place 1 is at node 13
    (tmp_path / "g.toml").write_text(f"[geometry]\nnodes = [{nodes}]\ndofs = [{places}]\n")
    assert main([str(folder / "all.json"), str(tmp_path / "a.uff"), "--geometry", str(tmp_path / "g.toml")]) == 0
    assert "8 modes over 12 places" in capsys.readouterr().out or len(raw["modes"]) != 8
    found = okid.read_uff(tmp_path / "a.uff")
    assert found.modes[0].nodes == list(range(2, 14))
    own = np.array(raw["modes"][0]["shape_re"])
    np.testing.assert_allclose(found.modes[0].shape[:, 2].real, -own[::-1], rtol=1e-4, atol=1e-6)
    ends = {one.name: (one.response, one.reference) for one in found.frfs}
    assert ends["Acc2 / Hammer@3"] == ((9, -3), (11, -3))
    assert main([str(folder / "all.json"), str(tmp_path / "b.uff")]) == 0  # without a geometry the node is the place
    assert okid.read_uff(tmp_path / "b.uff").modes[0].nodes == raw["shape_dofs"]
    (tmp_path / "g.toml").write_text(f"[geometry]\nnodes = [{nodes}]\ndofs = [[1, 'x'], [2, 'x']]\n")
    assert main([str(folder / "all.json"), str(tmp_path / "c.uff"), "--geometry", str(tmp_path / "g.toml")]) == 2
    assert re.search(r"g.toml: place '\d+' is at dof \d+, but \[geometry\] dofs has", capsys.readouterr().err)


def test_a_sensor_without_a_place(tmp_path: Path) -> None:
    u, y = okid.demo_record()
    result = okid.identify(u, y, fs=1000.0, output_names=["a", "b", "c"], sigma="none")
    text = "[geometry]\nnodes = [[0, 0, 0], [0, 0, 1], [0, 0, 2]]\n" + 'dofs = [[1, "x"], [2, "x"], [3, "x"]]\n'
    channels = "".join(f'[[channel]]\nname = "{name}"\ndof = {k}\n' for k, name in ((3, "a"), (1, "c")))
    for more, words in (
        (channels, "sensor 'b' has no place"),
        (channels.replace('"a"', '"x"').replace('"c"', '"y"'), "no .*channel.* has the name 'a'"),
    ):
        (tmp_path / "g.toml").write_text(text + more)
        with pytest.raises(okid.InputError, match=f"g.toml: {words}"):
            okid.write_uff(tmp_path / "a.uff", result, geometry=okid.formats.read_geometry(tmp_path / "g.toml"))
    (tmp_path / "g.toml").write_text(text + channels + '[[channel]]\nname = "b"\ndof = -2\n')
    okid.write_uff(tmp_path / "a.uff", result, geometry=okid.formats.read_geometry(tmp_path / "g.toml"))
    shape = okid.read_uff(tmp_path / "a.uff").modes[0].shape[:, 0]
    np.testing.assert_allclose(shape, result.modes[0].shape[[2, 1, 0]] * [1, -1, 1], rtol=1e-4)
