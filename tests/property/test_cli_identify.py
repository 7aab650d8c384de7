# SPDX-License-Identifier: MIT
"""`okid identify` and `okid simulate` as a user meets them: results, exit codes, messages."""

from __future__ import annotations

import json
import math
import random
import subprocess
import tomllib
from pathlib import Path

import pytest
from program import ROOT, okid
from two_masses import rig_text as two_masses
from two_masses import simulate_rig

DEMO_RIG = ROOT / "tests" / "replay" / "demo_rig.toml"
CHANNELS = ["--inputs", "u1", "--outputs", "y1,y2"]
RESULT_KEYS = [
    "schema", "version", "method", "fs_hz", "samples", "records", "gaps", "inputs", "outputs", "p", "rows", "hankel",
    "order", "hold", "detrend", "start", "singular_values", "singular_noise", "model", "markov", "judged_by",
    "sigma_blocks", "modes", "fit", "warnings",
]  # fmt: skip
MODE_KEYS = [
    "frequency_hz", "damping_ratio", "shape_re", "shape_im", "frequency_std_hz", "damping_ratio_std", "shape_re_std",
    "shape_im_std", "mpc", "emac", "cmi", "confident", "found_in", "why", "why_text",
]  # fmt: skip


def refused(done: subprocess.CompletedProcess[str], code: int, *parts: str) -> None:
    """The command ended with `code` and one message that holds every part."""
    assert done.returncode == code, done.stderr
    assert done.stdout == ""
    assert done.stderr.count("\n") == 1, done.stderr
    assert done.stderr.startswith("okid: ")
    for part in parts:
        assert part in done.stderr, done.stderr


def rows(count: int = 600, seed: int = 1) -> list[list[float]]:
    """u1, y1, y2 of two damped oscillators excited by white noise."""
    rng = random.Random(seed)
    states, out = [[0.0, 0.0], [0.0, 0.0]], []
    poles = [(0.99, 0.3), (0.985, 1.1)]
    for _ in range(count):
        u = rng.gauss(0, 1)
        y = [s[0] for s in states]
        out.append(
            [
                u,
                y[0] + 0.3 * y[1] + 0.1 * u,
                0.5 * y[0] - y[1] + 0.2 * u + 0.01 * rng.gauss(0, 1),
            ]
        )
        for state, (radius, angle) in zip(states, poles, strict=True):
            c, s = radius * math.cos(angle), radius * math.sin(angle)
            state[0], state[1] = (
                c * state[0] - s * state[1] + u,
                s * state[0] + c * state[1],
            )
    return out


def text_of(
    data: list[list[float]],
    head: str = "# fs_hz: 100\n",
    names: str = "u1,y1,y2",
    join: str = ",",
    end: str = "\n",
) -> str:
    return head + names + end + "".join(join.join(f"{x:.9g}" for x in row) + end for row in data)


@pytest.fixture
def record(tmp_path: Path) -> Path:
    path = tmp_path / "record.csv"
    path.write_text(text_of(rows()))
    return path


def identify(path: Path, *more: object, channels: list[str] | None = None) -> subprocess.CompletedProcess[str]:
    return okid(
        "identify",
        path,
        *(CHANNELS if channels is None else channels),
        "--p",
        10,
        *more,
    )


def result_of(done: subprocess.CompletedProcess[str]) -> dict:
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout, parse_constant=lambda name: pytest.fail(f"{name} in the result"))


def shape(matrix: list) -> tuple[int, int]:
    assert len({len(row) for row in matrix}) <= 1
    return len(matrix), len(matrix[0]) if matrix else 0


# ------------------------------------------------------------------ what a good record gives


def test_result_has_the_fixed_keys_in_order(record: Path) -> None:
    result = result_of(identify(record, "--json", "-"))
    assert list(result) == RESULT_KEYS
    assert result["schema"] == "okid.result/1"
    assert (result["fs_hz"], result["samples"], result["records"], result["gaps"]) == (
        100.0,
        600,
        1,
        0,
    )
    assert (result["inputs"], result["outputs"]) == (["u1"], ["y1", "y2"])
    assert (result["p"], result["rows"], result["hold"], result["detrend"]) == (
        10,
        20,
        "zoh",
        "mean",
    )
    order, model = result["order"], result["model"]
    assert list(model) == ["dt", "A", "B", "C", "D", "K", "x0"]
    assert model["dt"] == pytest.approx(0.01)
    assert [shape(model[k]) for k in "ABCDK"] == [
        (order, order),
        (order, 1),
        (2, order),
        (2, 1),
        (order, 2),
    ]
    assert shape(model["x0"]) == (1, order)
    assert len(result["markov"]["Y"]) >= 2 * result["rows"] + 1
    assert all(shape(block) == (2, 1) for block in result["markov"]["Y"])
    assert result["markov"]["Y"][0] == model["D"]
    assert result["singular_values"] == sorted(result["singular_values"], reverse=True)
    assert [list(mode) for mode in result["modes"]] == [MODE_KEYS] * len(result["modes"])
    assert list(result["fit"]["simulation_percent"]) == ["y1", "y2"]
    assert all(set(w) == {"code", "text"} and w["text"] for w in result["warnings"])


def test_modes_of_a_known_system(record: Path) -> None:
    modes = result_of(identify(record, "--order", 4, "--json", "-"))["modes"]
    for mode, (radius, angle) in zip(modes, [(0.99, 0.3), (0.985, 1.1)], strict=True):
        pole = complex(math.log(radius), angle) * 100
        assert mode["frequency_hz"] == pytest.approx(abs(pole) / (2 * math.pi), rel=1e-3)
        assert mode["damping_ratio"] == pytest.approx(-pole.real / abs(pole), rel=3e-2)
        assert max(math.hypot(a, b) for a, b in zip(mode["shape_re"], mode["shape_im"], strict=True)) == pytest.approx(
            1
        )


def test_table_goes_to_stdout(record: Path) -> None:
    done = identify(record)
    assert done.returncode == 0
    assert "f [Hz]" in done.stdout and "ζ [%]" in done.stdout and "y1" in done.stdout
    assert "\x1b" not in done.stdout and done.stderr == ""


def test_no_inputs_by_name(record: Path) -> None:
    ambient = okid("identify", record, "--outputs", "y1,y2", "--method", "n4sid-cva", "--json", "-")
    assert ambient.returncode == 0
    named = okid("identify", record, "--inputs", "none", "--outputs", "y1,y2", "--method", "n4sid-cva", "--json", "-")
    assert named.stdout == ambient.stdout and json.loads(named.stdout)["inputs"] == []


def test_quiet_writes_only_the_file(record: Path, tmp_path: Path) -> None:
    target = tmp_path / "result.json"
    done = identify(record, "--json", target, "--quiet")
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")
    assert json.loads(target.read_text())["order"] > 0
    assert sorted(p.name for p in tmp_path.iterdir()) == ["record.csv", "result.json"]


def test_same_record_same_bytes(record: Path) -> None:
    assert identify(record, "--json", "-").stdout == identify(record, "--json", "-").stdout


@pytest.mark.parametrize(
    ("names", "join", "end", "bom", "comma"),
    [
        ("u1,y1,y2", ",", "\r\n", True, False),
        ("u1;y1;y2", ";", "\r\n", True, True),
        ("u1;y1;y2", ";", "\n", False, False),
        ("u1\ty1\ty2", "\t", "\n", False, False),
        ('"u1","y1","y2"', ",", "\n", False, False),
        (" u1 , y1 , y2 ", " , ", "\n", False, False),
    ],
)
def test_dialects_give_the_same_result(
    record: Path,
    tmp_path: Path,
    names: str,
    join: str,
    end: str,
    bom: bool,
    comma: bool,
) -> None:
    text = text_of(rows(), names=names, join=join, end=end, head=f"# fs_hz: 100{end}")
    if comma:
        head, _, body = text.partition(names)
        text = head + names + body.replace(".", ",")
    other = tmp_path / "other.csv"
    other.write_bytes((b"\xef\xbb\xbf" if bom else b"") + text.encode())
    assert identify(other, "--json", "-").stdout == identify(record, "--json", "-").stdout


def test_last_line_without_its_end(record: Path, tmp_path: Path) -> None:
    other = tmp_path / "other.csv"
    other.write_text(record.read_text().rstrip("\n"))
    assert identify(other, "--json", "-").stdout == identify(record, "--json", "-").stdout


@pytest.mark.parametrize(
    "head",
    [
        "# fs_hz: 100\n",
        "# fs_hz=100\n",
        "# sample_rate_hz = 100 ; units: none\n",
        "# made here\n#sample_rate_hz:100Hz\n",
    ],
)
def test_rate_lines(tmp_path: Path, head: str) -> None:
    path = tmp_path / "r.csv"
    path.write_text(text_of(rows(), head=head))
    assert result_of(identify(path, "--json", "-"))["fs_hz"] == 100


def test_rate_of_the_option_wins(record: Path) -> None:
    assert result_of(identify(record, "--fs", 250, "--json", "-"))["fs_hz"] == 250


def timed(times: list[float]) -> str:
    data = [[t, *row] for t, row in zip(times, rows(len(times)), strict=True)]
    return text_of(data, head="", names="time_s,u1,y1,y2")


def test_rate_of_a_time_column(tmp_path: Path) -> None:
    path = tmp_path / "r.csv"
    path.write_text(timed([3 + n / 100 for n in range(600)]))
    assert result_of(identify(path, "--json", "-"))["fs_hz"] == 100


def test_uneven_time_column(tmp_path: Path) -> None:
    path = tmp_path / "r.csv"
    path.write_text(timed([n / 100 + (0.004 if n % 7 == 5 else 0) for n in range(600)]))
    refused(identify(path), 2, "line 7", "time_s", "0.014")
    path.write_text(timed([n / 100 + (0.01 if n >= 300 else 0) for n in range(600)]))  # a row is missing
    assert result_of(identify(path, "--order", 4, "--json", "-"))["gaps"] == 1


def test_missing_cells_are_gaps(record: Path, tmp_path: Path) -> None:
    lines = record.read_text().splitlines()
    for line in (100, 101, 300):
        cells = lines[line].split(",")
        cells[1] = "nan" if line == 100 else ""
        lines[line] = ",".join(cells)
    path = tmp_path / "gaps.csv"
    path.write_text("\n".join(lines) + "\n")
    result = result_of(identify(path, "--order", 4, "--json", "-"))
    assert (result["samples"], result["gaps"]) == (600, 2)
    note = next(w["text"] for w in result["warnings"] if w["code"] == "missing_samples")
    assert "3 of 600" in note and "2 gaps" in note
    assert result["modes"][0]["frequency_hz"] == pytest.approx(4.78, abs=0.02)
    assert result["fit"]["simulation_percent"]["y1"] > 95


def test_two_records_are_merged(tmp_path: Path) -> None:
    paths = []
    for seed in (1, 2):
        paths.append(tmp_path / f"r{seed}.csv")
        shifted = [[u, y1 + 50 * seed, y2] for u, y1, y2 in rows(seed=seed)]  # the offset moved between the records
        paths[-1].write_text(text_of(shifted))
    result = result_of(okid("identify", *paths, *CHANNELS, "--p", 10, "--order", 4, "--json", "-"))
    assert (result["records"], result["samples"], result["gaps"]) == (2, 1200, 0)
    assert shape(result["model"]["x0"]) == (2, 4)
    assert result["modes"][0]["frequency_hz"] == pytest.approx(4.780, abs=0.005)
    assert result["fit"]["simulation_percent"]["y1"] > 95


def test_linear_detrend_removes_drift(tmp_path: Path) -> None:
    path = tmp_path / "r.csv"
    path.write_text(text_of([[u, y1 + 3 * n, y2 - 7] for n, (u, y1, y2) in enumerate(rows())]))
    result = result_of(identify(path, "--detrend", "linear", "--order", 4, "--json", "-"))
    assert result["fit"]["simulation_percent"]["y1"] > 95


def test_range_selects_samples(record: Path) -> None:
    assert result_of(identify(record, "--range", "100:500", "--json", "-"))["samples"] == 400
    assert result_of(identify(record, "--range", ":500", "--json", "-"))["samples"] == 500


def test_short_record_reduces_p(tmp_path: Path) -> None:
    path = tmp_path / "r.csv"
    path.write_text(text_of(rows(200)))
    result = result_of(identify(path, "--json", "-"))
    assert 10 * (1 + result["p"] * 3) <= 200 and result["p"] == 6
    assert "p_reduced" in [w["code"] for w in result["warnings"]]


def test_names_with_units_and_commas(tmp_path: Path) -> None:
    path = tmp_path / "r.csv"
    path.write_text(text_of(rows(), names='force [N],"acc, top [g]",acc2_g'))
    channels = ["--inputs", "force", "--outputs", '"acc, top [g]",acc2_g']
    result = result_of(identify(path, "--json", "-", channels=channels))
    assert result["outputs"] == ["acc, top [g]", "acc2_g"]


def test_model_file_for_scipy(record: Path, tmp_path: Path) -> None:
    io = pytest.importorskip("scipy.io")
    target = tmp_path / "model.mat"
    result = result_of(identify(record, "--model", target, "--json", "-"))
    matrices = io.loadmat(str(target))
    for name in "ABCDK":
        assert matrices[name].tolist() == result["model"][name]
    assert matrices["dt"].item() == result["model"]["dt"]


# ------------------------------------------------------------------ what is wrong with a record


def test_missing_file(tmp_path: Path) -> None:
    refused(identify(tmp_path / "none.csv"), 2, "none.csv", "No such file")


def test_folder(tmp_path: Path) -> None:
    refused(identify(tmp_path), 2, "folder")


@pytest.mark.parametrize(
    ("content", "parts"),
    [
        (b"", ("empty",)),
        (b"# fs_hz: 100\n", ("no line of column names",)),
        (b"# fs_hz: 100\nu1,y1,y2\n", ("no rows",)),
        (b"\x7fELF\x02\x01\x01\x00\x00\x00", ("not a text file",)),
        ("u1,y1,y2\n1,2,3\n".encode("utf-16"), ("UTF-16",)),
        (b"\x1f\x8b\x08\x00", ("compressed",)),
        (b"# fs_hz: 100\n1,2,3\n4,5,6\n", ("no column", "line of column names")),
        (b'# fs_hz: 100\nu1,y1,"y2\n1,2,3\n', ("line 2", "closing quote")),
        (b"# fs_hz: 100\nu1,y1,y2\n1,2,3\n\n1,2,3\n", ("line 4", "empty line")),
        (b"# fs_hz: 0\nu1,y1,y2\n1,2,3\n", ("line 1", "above 0")),
        (
            b"# fs_hz: 100\n# sample_rate_hz: 200\nu1,y1,y2\n1,2,3\n",
            ("line 2", "100", "200"),
        ),
    ],
)
def test_files_that_are_no_record(tmp_path: Path, content: bytes, parts: tuple[str, ...]) -> None:
    path = tmp_path / "bad.csv"
    path.write_bytes(content)
    refused(identify(path), 2, "bad.csv", *parts)


def test_unknown_column(record: Path) -> None:
    done = identify(record, channels=["--inputs", "u1", "--outputs", "y1,y22"])
    refused(done, 2, "record.csv", '"y22"', 'did you mean "y2"', "u1, y1, y2")


def test_duplicate_names(tmp_path: Path) -> None:
    path = tmp_path / "r.csv"
    path.write_text(text_of(rows(), names="u1,y1,y1"))
    refused(
        identify(path, channels=["--inputs", "u1", "--outputs", "y1"]),
        2,
        "r.csv",
        "line 2",
        "column 3",
        "twice",
    )


@pytest.mark.parametrize("cell", ["abc", "1.5 V", "1,5", "0x10", "--1", "1e", "#", "1.2.3"])
def test_text_in_a_cell(tmp_path: Path, cell: str) -> None:
    lines = text_of(rows(), names="u1;y1;y2" if "," in cell else "u1,y1,y2").splitlines()
    quoted = f'"{cell}"' if "," in cell else cell
    lines[50] = lines[50].split(",")[0] + f",{quoted}," + "1"
    path = tmp_path / "r.csv"
    path.write_text("# fs_hz: 100\nu1,y1,y2\n" + "\n".join(lines[2:]) + "\n")
    refused(identify(path), 2, "r.csv", "line 51", "column 2", "y1", cell, "a number")


@pytest.mark.parametrize("cell", ["inf", "-Inf", "1e999", "infinity"])
def test_infinite_cell(tmp_path: Path, cell: str) -> None:
    lines = text_of(rows()).splitlines()
    lines[9] = f"1,2,{cell}"
    path = tmp_path / "r.csv"
    path.write_text("\n".join(lines))
    refused(identify(path), 2, "line 10", "column 3", "y2", cell, "finite")


@pytest.mark.parametrize(("line", "count"), [("1,2", "2 cells"), ("1,2,3,4", "4 cells"), ("7", "1 cell,")])
def test_ragged_row(tmp_path: Path, line: str, count: str) -> None:
    lines = text_of(rows()).splitlines()
    lines[19] = line
    path = tmp_path / "r.csv"
    path.write_text("\n".join(lines))
    refused(identify(path), 2, "line 20", count, "expected 3")


def test_all_missing_column(tmp_path: Path) -> None:
    path = tmp_path / "r.csv"
    path.write_text(text_of([[u, y1, math.nan] for u, y1, _ in rows()]))
    refused(identify(path), 2, "y2", "no number")


@pytest.mark.parametrize("head", ["", "# sample_rate_hz=unknown (left blank)\n"])
def test_no_rate(tmp_path: Path, head: str) -> None:
    path = tmp_path / "r.csv"
    path.write_text(text_of(rows(), head=head))
    refused(identify(path), 2, "no sample rate", "--fs", *(["unknown"] if head else []))


def test_records_of_two_rates(record: Path, tmp_path: Path) -> None:
    other = tmp_path / "other.csv"
    other.write_text(text_of(rows(), head="# fs_hz: 200\n"))
    refused(okid("identify", record, other, *CHANNELS), 2, "other.csv", "200", "100")


# ------------------------------------------------------------------ data without an honest model


@pytest.mark.parametrize("detrend", ["none", "mean", "linear"])
def test_constant_input(tmp_path: Path, detrend: str) -> None:
    path = tmp_path / "r.csv"
    path.write_text(text_of([[2.5, y1, y2] for _, y1, y2 in rows()]))
    target = tmp_path / "result.json"
    refused(
        identify(path, "--detrend", detrend, "--json", target),
        3,
        '"u1"',
        "constant",
        "2.5",
    )
    assert not target.exists()


def test_constant_output(tmp_path: Path) -> None:
    path = tmp_path / "r.csv"
    path.write_text(text_of([[u, y1, 0.0] for u, y1, _ in rows()]))
    refused(identify(path), 3, '"y2"', "constant")


def test_straight_line_is_no_excitation(tmp_path: Path) -> None:
    path = tmp_path / "r.csv"
    path.write_text(text_of([[0.5 * n, y1, y2] for n, (_, y1, y2) in enumerate(rows())]))
    refused(identify(path, "--detrend", "linear"), 3, '"u1"', "straight line")


def test_too_few_samples(tmp_path: Path) -> None:
    path = tmp_path / "r.csv"
    path.write_text(text_of(rows(30)))
    target = tmp_path / "result.json"
    refused(identify(path, "--json", target), 3, "too few samples", "30", "40")
    assert not target.exists()


def test_one_sample(tmp_path: Path) -> None:
    path = tmp_path / "r.csv"
    path.write_text(text_of(rows(1)))
    assert identify(path).returncode == 3


def test_repeated_input_is_not_enough_excitation(tmp_path: Path) -> None:
    path = tmp_path / "r.csv"
    path.write_text(text_of([[u, y1, y2, u] for u, y1, y2 in rows()], names="u1,y1,y2,u2"))
    refused(identify(path, channels=["--inputs", "u1,u2", "--outputs", "y1,y2"]), 3, "excit")


# ------------------------------------------------------------------ wrong usage


@pytest.mark.parametrize(
    ("options", "parts"),
    [
        (["--p", "0"], ("--p", '"0"')),
        (["--p", "ten"], ("--p", "ten")),
        (["--p", "99999"], ("--p", "4096")),
        (["--rows", "1"], ("--rows",)),
        (["--order", "0"], ("--order",)),
        (["--order", "-4"], ("--order",)),
        (["--order", "many"], ("--order", "auto")),
        (["--fs", "0"], ("--fs", "above 0")),
        (["--fs", "fast"], ("--fs", "fast")),
        (["--hold", "soh"], ("--hold", 'did you mean "zoh"')),
        (["--detrend", "cubic"], ("--detrend", "linear")),
        (["--sensing", "speed"], ("--sensing", "velocity")),
        (["--sensing", "velocity,velocity,velocity"], ("--sensing", "3 kinds for 2")),
        (["--range", "10"], ("--range", "a:b")),
        (["--range", "500:100"], ("--range",)),
        (["--range", "0:601"], ("--range", "601")),
        (["--method", "magic"], ("--method", "okid-era")),
        (["--method", "n4sid-cvo"], ("n4sid-cvo", 'did you mean "n4sid-cva"?')),
        (["--input-dofs", "1"], ("--output-dofs is missing",)),
        (["--outputs", "y1,u1"], ("--inputs and in --outputs",)),
        (["--outputs", "y1,y1"], ("--outputs", "twice")),
        (["--outputs", "y1,,y2"], ("--outputs", "empty name")),
        (
            ["--json", "/nonexistent/folder/r.json"],
            ("/nonexistent/folder/r.json", "cannot be written"),
        ),
        (["--json", "/"], ("/", "cannot be written")),
    ],
)
def test_wrong_options(record: Path, options: list[str], parts: tuple[str, ...]) -> None:
    given = {"--inputs": "u1", "--outputs": "y1,y2", "--p": "10"}
    flags = [options[0]] if len(options) == 1 else []
    given |= {options[0]: options[1]} if len(options) == 2 else {}
    refused(
        okid("identify", record, *flags, *[f"{k}={v}" for k, v in given.items()]),
        2,
        *parts,
    )


def test_no_channels_named(record: Path) -> None:
    refused(okid("identify", record), 2, "--outputs", "u1, y1, y2")
    refused(okid("identify", record, "--outputs", "y1", "--hankel", "literal"), 2, "--hankel", "needs a force")
    refused(identify(record, "--hankel", "innovation"), 2, "--hankel", 'did you mean "innovations"?')
    refused(identify(record, "--method", "n4sid-cva", "--hankel", "literal"), 2, "--hankel", "n4sid-cva")


def test_a_record_is_never_written_over(record: Path) -> None:
    before = record.read_bytes()
    refused(identify(record, "--json", record), 2, "record.csv")
    assert record.read_bytes() == before


def test_unknown_option_and_help(record: Path) -> None:
    assert identify(record, "--jsn", "x").returncode == 2
    done = okid("identify", "--help")
    assert done.returncode == 0 and "Example" in done.stdout


# ------------------------------------------------------------------ the virtual rig


def rig_text(**changes: object) -> str:
    text = DEMO_RIG.read_text()
    for key, value in changes.items():
        text = "\n".join(f"{key} = {value}" if line.startswith(f"{key} ") else line for line in text.split("\n"))
    return text


@pytest.mark.parametrize("seed", [1, 2, 3, 4, 5, 6])
def test_simulated_rig_is_identified(tmp_path: Path, seed: int) -> None:
    rig, csv, truth_file = (tmp_path / name for name in ("rig.toml", "rig.csv", "truth.json"))
    rig.write_text(rig_text(seed=seed))
    assert okid("simulate", rig, "--csv", csv, "--truth", truth_file).returncode == 0
    truth = json.loads(truth_file.read_text())
    result = result_of(
        okid(
            "identify",
            csv,
            "--inputs",
            "force1",
            "--outputs",
            "acc1,acc2,acc3",
            "--json",
            "-",
        )
    )
    modes = [mode for mode in result["modes"] if mode["confident"]]
    for mode, frequency, damping in zip(modes, truth["frequency_hz"], truth["damping_ratio"], strict=True):
        assert mode["frequency_hz"] == pytest.approx(frequency, rel=5e-4)
        assert mode["damping_ratio"] == pytest.approx(damping, rel=0.05)


def test_title_of_a_rig_reaches_the_config(tmp_path: Path) -> None:
    rig, config = tmp_path / "rig.toml", tmp_path / "c.toml"
    rig.write_text("title = 'a \"tall\" frame \\ σ'\n" + rig_text().rsplit("\ntitle", 1)[0])
    assert okid("simulate", rig, "--config", config).returncode == 0
    assert tomllib.loads(config.read_text("utf-8"))["acquisition"]["title"] == 'a "tall" frame \\ σ'
    rig.write_text('title = "two\\nlines"\n' + rig_text().rsplit("\ntitle", 1)[0])
    done = okid("simulate", rig, "--config", config)
    assert done.returncode == 2 and "title" in done.stderr and "expected one line of text" in done.stderr


def test_truth_file(tmp_path: Path) -> None:
    done = okid("simulate", DEMO_RIG, "--truth", "-")
    assert done.returncode == 0
    truth = json.loads(done.stdout)
    keys = [
        "schema",
        "frequency_hz",
        "damping_ratio",
        "M",
        "K",
        "R",
        "alpha",
        "beta",
        "fs_hz",
    ]
    assert list(truth) == keys and truth["schema"] == "okid.truth/1"
    assert truth["damping_ratio"][0] == pytest.approx(0.01) and truth["damping_ratio"][-1] == pytest.approx(0.01)
    for m, k, r in zip(truth["M"], truth["K"], truth["R"], strict=True):
        assert r == pytest.approx([truth["alpha"] * a + truth["beta"] * b for a, b in zip(m, k, strict=True)])


def test_same_seed_same_bytes(tmp_path: Path) -> None:
    files = {}
    for run in ("a", "b"):
        (tmp_path / run).mkdir()
        names = [tmp_path / run / n for n in ("r.log", "r.csv", "t.json", "c.toml")]
        done = okid(
            "simulate",
            DEMO_RIG,
            "--log",
            names[0],
            "--csv",
            names[1],
            "--truth",
            names[2],
            "--config",
            names[3],
        )
        assert done.returncode == 0, done.stderr
        files[run] = {p.name: p.read_bytes() for p in sorted((tmp_path / run).iterdir())}
    assert files["a"] == files["b"] and "c.dbc" in files["a"]


@pytest.mark.parametrize("bits", [12, 16, 20, 24])
def test_log_and_csv_hold_the_same_values(tmp_path: Path, bits: int) -> None:
    cantools = pytest.importorskip("cantools")
    rig = tmp_path / "rig.toml"
    rig.write_text(rig_text(bits=bits, duration_s="0.4", sense_dofs="[3, 1, 2]"))
    log, csv, dbc = (tmp_path / name for name in ("r.log", "r.csv", "r.dbc"))
    assert okid("simulate", rig, "--log", log, "--csv", csv, "--dbc", dbc).returncode == 0
    database = cantools.database.load_file(str(dbc))
    decoded: dict[int, dict[str, float]] = {}
    for line in log.read_text().splitlines():
        _, interface, frame = line.split()
        assert interface == "vcan0"
        number, data = frame.split("#")
        values = database.decode_message(int(number, 16), bytes.fromhex(data))
        decoded.setdefault(int(values.pop("Counter")), {}).update(values)
    lines = csv.read_text().splitlines()
    names = lines[2].split(",")
    assert names == ["force1", "acc3", "acc1", "acc2"] and len(lines) - 3 == len(decoded) == 100
    signals = [name.replace("force", "Force").replace("acc", "Accel") for name in names]
    for n, line in enumerate(lines[3:]):
        assert [decoded[n][s] for s in signals] == pytest.approx([float(x) for x in line.split(",")], rel=1e-12)


@pytest.mark.parametrize(
    ("change", "parts"),
    [
        ({"masses": "[1.0, -0.8, 1.2]"}, ("line 6", "masses", "-0.8", "above 0")),
        ({"springs": "[3e4, 2e4]"}, ("springs", "as many as masses")),
        ({"springs": "[3e4, 'x', 1]"}, ("springs", "x")),
        ({"zeta": "[0.01]"}, ("zeta", "two numbers")),
        ({"zeta": "[-0.01, 0.01]"}, ("zeta", "-0.01")),
        ({"force_dofs": "[4]"}, ("force_dofs", "4", "from 1 to 3")),
        ({"sense_dofs": "[1, 1]"}, ("sense_dofs", "different")),
        ({"sensing": '"strain"'}, ("sensing", "velocity")),
        ({"bits": "48"}, ("bits", "48")),
        ({"rate_hz": "0"}, ("rate_hz", "above 0")),
        ({"noise_percent": "nan"}, ("noise_percent",)),
        (
            {"seed": "1\nnoise = 2"},
            ("line 6", '"noise"', 'did you mean "noise_percent"'),
        ),
        ({"seed": "1\nseed = 2"}, ("line 6", "seed")),
        ({"seed": "= 1"}, ("line 5",)),
    ],
)
def test_bad_rig(tmp_path: Path, change: dict[str, str], parts: tuple[str, ...]) -> None:
    rig = tmp_path / "rig.toml"
    rig.write_text(rig_text(**change))
    refused(okid("simulate", rig, "--truth", tmp_path / "t.json"), 2, "rig.toml", *parts)
    assert not (tmp_path / "t.json").exists()


def test_simulate_usage(tmp_path: Path) -> None:
    refused(okid("simulate", DEMO_RIG), 2, "nothing to write")
    refused(okid("simulate", tmp_path / "none.toml", "--truth", "-"), 2, "none.toml")
    refused(
        okid("simulate", DEMO_RIG, "--csv", "/nonexistent/x.csv"),
        2,
        "/nonexistent/x.csv",
    )
    refused(
        okid("simulate", DEMO_RIG, "--to", "/dev/no-such-port", "--quiet"),
        4,
        "/dev/no-such-port",
    )


def test_changed_rig(tmp_path: Path) -> None:
    rig = tmp_path / "rig.toml"
    rig.write_text(rig_text() + "\n[[change]]\nat_s = 10.0\nsprings = [3e4, 1.8e4, 2.5e4]\n")
    truth = json.loads(okid("simulate", rig, "--truth", "-").stdout)
    assert truth["changes"][0]["at_s"] == 10 and truth["changes"][0]["frequency_hz"][0] < truth["frequency_hz"][0]
    csv = tmp_path / "r.csv"
    assert okid("simulate", rig, "--csv", csv, "--quiet").returncode == 0
    channels = ["--inputs", "force1", "--outputs", "acc1,acc2,acc3", "--json", "-"]
    for part, true in ((":2500", truth), ("2500:", truth["changes"][0])):
        modes = result_of(okid("identify", csv, *channels, "--range", part))["modes"]
        sure = [m["frequency_hz"] for m in modes if m["confident"]]
        assert sure == pytest.approx(true["frequency_hz"], rel=1e-3)


def test_alias_warning(tmp_path: Path) -> None:
    rig = tmp_path / "rig.toml"
    rig.write_text(rig_text(rate_hz="100.0"))
    done = okid("simulate", rig, "--truth", tmp_path / "t.json")
    assert done.returncode == 0 and "rate_hz" in done.stderr


def test_how_many_blocks_the_deviations_rest_on(tmp_path: Path) -> None:
    found = {}
    channels = [simulate_rig(tmp_path, two_masses(20.0)) / "a.csv", "--inputs", "force1", "--outputs", "acc1,acc2"]
    for blocks in (0, 8, 40):
        out = tmp_path / f"{blocks}.json"
        okid("identify", *channels, "--p", 10, "--sigma-blocks", blocks, "--json", out, status=0)
        found[blocks] = [mode["frequency_std_hz"] for mode in json.loads(out.read_text())["modes"]]
    assert set(found[0]) == {None} and len(found[8]) == len(found[40]) == 2
    for few, many in zip(found[8], found[40], strict=True):
        assert few != many and 0.3 < few / many < 3.0
    refused(okid("identify", *channels, "--sigma-blocks", 7), 2, "--sigma-blocks", "8")
