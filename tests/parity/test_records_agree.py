# SPDX-License-Identifier: MIT
"""A record says the same in the program and in Python: same keys, same numbers, same words, same refusals."""

from __future__ import annotations

import json
import re
import sys
from pathlib import Path
from typing import Any

import numpy as np
import okid as package
import pytest
from methods import METHODS
from numpy.typing import NDArray

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "property"))
from program import okid  # noqa: E402
from systems import record, w1, w2  # noqa: E402

Real = NDArray[np.float64]
S = w1()
U = ["force"]
Y = ["a1", "a2", "a3"]
EXIT = {package.InputError: 2, package.IdentificationError: 3}


def write(path: Path, samples: Real, names: list[str], fs: float | None = S.fs) -> Path:
    cells = [",".join("" if np.isnan(x) else repr(float(x)) for x in row) for row in samples]
    head = [] if fs is None else [f"# fs_hz: {fs!r}"]
    path.write_text("\n".join([*head, ",".join(names), *cells]) + "\n", encoding="utf-8")
    return path


def said(text: str) -> str:
    """Options of the program and arguments of Python alike, records by number."""
    plain = re.sub(r"--([a-z]+(?:-[a-z]+)*)", lambda found: found[1].replace("-", "_"), text)
    return re.sub(r"\S*/record(\d)\.csv", r"record \1 (counted from 0)", plain.replace("=", " "))


def both(
    tmp_path: Path,
    records: list[Real],
    inputs: list[str],
    outputs: list[str],
    **arguments: Any,
) -> tuple[tuple[int, Any], tuple[int, Any]]:
    """Exit code and result (or sentence) of the program and of Python, for records of inputs and outputs.

    By okid-era unless a method is named; method=None: neither is told one."""
    arguments = {"method": "okid-era", **arguments}
    if arguments["method"] is None:
        del arguments["method"]
    files = [write(tmp_path / f"record{k}.csv", one, inputs + outputs) for k, one in enumerate(records)]
    options: list[str] = []
    for name, value in arguments.items():
        option = f"--{name.replace('_', '-')}"
        text = ",".join(map(str, value)) if isinstance(value, list) else str(value)
        options += [option] if value is True else [f"{option}={text}"]
    chosen = ["--inputs", ",".join(inputs)] if inputs else []
    done = okid(
        "identify",
        *files,
        *chosen,
        "--outputs",
        ",".join(outputs),
        *options,
        "--json",
        "-",
    )
    shown = json.loads(done.stdout) if done.returncode == 0 else said(done.stderr.removeprefix("okid: ").strip())
    n_u = len(inputs)
    try:
        own = package.identify(
            [one[:, :n_u] for one in records] if inputs else None, [one[:, n_u:] for one in records], fs=S.fs,
            input_names=inputs or None, output_names=outputs, **arguments,
        ).to_dict()  # fmt: skip
    except package.Error as fault:
        return (done.returncode, shown), (EXIT[type(fault)], said(str(fault)))
    return (done.returncode, shown), (0, own)


def differences(a: Any, b: Any, place: str = "") -> list[str]:
    """Where two results are not the same: keys in order, numbers within 1e-12, words."""
    if isinstance(a, dict) and isinstance(b, dict):
        if list(a) != list(b):
            return [f"{place}: keys {list(a)} and {list(b)}"]
        return [x for key in a for x in differences(a[key], b[key], f"{place}.{key}")]
    if isinstance(a, list) and isinstance(b, list):
        if len(a) != len(b):
            return [f"{place}: {len(a)} and {len(b)} entries"]
        return [
            x for k, (one, other) in enumerate(zip(a, b, strict=True)) for x in differences(one, other, f"{place}[{k}]")
        ]
    if isinstance(a, float) and isinstance(b, float):
        return [] if abs(a - b) <= 1e-12 * max(1.0, abs(a)) else [f"{place}: {a!r} and {b!r}"]
    if isinstance(a, str) and isinstance(b, str):
        return [] if said(a) == said(b) else [f"{place}: {a!r} and {b!r}"]
    return [] if a == b and type(a) is type(b) else [f"{place}: {a!r} and {b!r}"]


def measured(samples: int = 3000, noise: float = 2.0, seed: int = 1) -> Real:
    return np.hstack(record(S, samples, noise, seed))


def same(
    tmp_path: Path,
    records: list[Real],
    inputs: list[str] = U,
    outputs: list[str] = Y,
    **more: Any,
) -> dict[str, Any]:
    (code, shown), (own_code, own) = both(tmp_path, records, inputs, outputs, **more)
    assert (code, own_code) == (0, 0), (shown, own)
    assert differences(shown, own) == []
    result: dict[str, Any] = own
    return result


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("ambient", [False, True], ids=["driven", "ambient"])
def test_every_method(tmp_path: Path, method: str, ambient: bool) -> None:
    one = measured()
    if ambient:
        found = same(tmp_path, [one[:, 1:]], [], Y, method=method)
    else:
        found = same(tmp_path, [one], method=method, input_dofs=[1], output_dofs=[1, 2, 3])
        assert found["mkr"]["M_std"] is not None
    assert len(found["modes"]) >= 3 and found["modes"][0]["frequency_std_hz"] > 0


@pytest.mark.parametrize("arguments", [{}, {"input_dofs": [1], "output_dofs": [1, 2, 3]}, {"hold": "foh"}], ids=str)
def test_the_default_method(tmp_path: Path, arguments: dict[str, Any]) -> None:
    """No method named, here or there: "auto", with what it says of every mode."""
    found = same(tmp_path, [measured()], method=None, **arguments)
    assert found["method"] == "auto" and found["hold"] == arguments.get("hold", "zoh")
    assert [mode["confident"] for mode in found["modes"]].count(True) == 3
    assert all(mode["why"] for mode in found["modes"] if not mode["confident"])


def test_the_default_method_without_a_force(tmp_path: Path) -> None:
    found = same(tmp_path, [measured(8000)[:, 1:]], [], Y, method=None)
    assert found["method"] == "auto" and found["fit"]["simulation_percent"] is None


@pytest.mark.parametrize("arguments", [{"p": 20}, {"rows": 30}, {"order": 6}, {"max_order": 10},
                                       {"hankel": "innovations"}, {"refine": True}], ids=str)  # fmt: skip
def test_an_option_of_one_method_means_okid_era(tmp_path: Path, arguments: dict[str, Any]) -> None:
    assert same(tmp_path, [measured(1500)], method=None, sigma_blocks=0, **arguments)["method"] == "okid-era"


@pytest.mark.parametrize("arguments", [
    {"method": "auto", "p": 5}, {"refine": "perhaps"}, {"method": "okid-era", "refine": "auto"},
    {"method": "okid-era", "decimate": 4}, {"decimate": 0}, {"modes": [0]}, {"modes": [40]}], ids=str)  # fmt: skip
def test_arguments_that_do_not_go_with_the_method(tmp_path: Path, arguments: dict[str, Any]) -> None:
    one, other = both(tmp_path, [measured(1000)], U, Y, **{"method": None, **arguments})
    assert one == other and one[0] == 2


def gaps(one: Real) -> Real:
    out = one.copy()
    out[700:712, 2] = np.nan
    out[1500, :] = np.nan
    out[2200:2203, 0] = np.nan  # a missing force
    return out


@pytest.mark.parametrize("method", ["okid-era", "n4sid-moesp"])
@pytest.mark.parametrize("detrend", ["none", "mean", "linear"])
def test_gaps_offsets_and_lines(tmp_path: Path, method: str, detrend: str) -> None:
    one = gaps(measured()) + ([0.0] * 4 if detrend == "none" else [3.0, -20.0, 0.5, 100.0])
    if detrend == "linear":
        one = one + np.linspace(0.0, 50.0, len(one))[:, None]
    found = same(tmp_path, [one], method=method, detrend=detrend, p=20, rows=25)
    assert found["gaps"] == 3 and "missing_samples" in [w["code"] for w in found["warnings"]]


@pytest.mark.parametrize("arguments", [{}, {"start": "rest"}, {"detrend": "linear"},
                                       {"method": "n4sid-cva", "detrend": "none"}], ids=str)  # fmt: skip
def test_several_records(tmp_path: Path, arguments: dict[str, Any]) -> None:
    records = [
        measured(1500, seed=3) + 7.0,
        measured(2200, seed=4) - 2.0,
        measured(900, seed=5),
    ]
    found = same(tmp_path, records, **arguments)
    assert found["records"] == 3 and len(found["model"]["x0"]) == 3


@pytest.mark.parametrize("blocks", [0, 8, 13, 97])
def test_blocks_that_do_not_divide(tmp_path: Path, blocks: int) -> None:
    same(tmp_path, [measured(2999)], sigma_blocks=blocks, p=7)


@pytest.mark.parametrize("arguments", [{}, {"input_dofs": [1], "output_dofs": [1, 2, 3]}, {"method": "n4sid-moesp"},
                                       {"detrend": "none", "order": 4}], ids=str)  # fmt: skip
def test_refinement(tmp_path: Path, arguments: dict[str, Any]) -> None:
    found = same(tmp_path, [measured(1500, 5.0)], refine=True, **arguments)
    assert "refinement" in found


@pytest.mark.parametrize("dofs", [[1, 2, 3], [-1, 2, 3], [-1, -2, -3]], ids=str)
def test_matrices_and_reversed_polarity(tmp_path: Path, dofs: list[int]) -> None:
    found = same(tmp_path, [measured()], input_dofs=[1], output_dofs=dofs)
    codes = [w["code"] for w in found["warnings"]]
    assert ("mkr_polarity" in codes) == (dofs[0] < 0)


def test_mixed_sensing_and_units(tmp_path: Path) -> None:
    s = w1()
    mixed = type(s)(
        s.M,
        s.R,
        s.K,
        s.force_dofs,
        s.sense_dofs,
        s.dt,
        ("acceleration", "velocity", "displacement"),
    )
    one = np.hstack(record(mixed, 4000, 0.5, 9))
    kinds = ["acceleration", "velocity", "displacement"]
    plain = same(tmp_path, [one], sensing=kinds, input_dofs=[1], output_dofs=[1, 2, 3])
    scaled = one / [1e3, 9.80665, 1e-3, 1e-3]
    names = ["f [kN]", "a [g]", "v [mm/s]", "x_mm"]
    found = same(
        tmp_path,
        [scaled],
        names[:1],
        names[1:],
        sensing=kinds,
        input_dofs=[1],
        output_dofs=[1, 2, 3],
    )
    np.testing.assert_allclose(found["mkr"]["M"], plain["mkr"]["M"], rtol=1e-3, atol=1e-3)
    assert [w["code"] for w in found["warnings"]].count("unit_converted") == 4


def test_warnings_of_every_part(tmp_path: Path) -> None:
    """Short, noise-free, an order too high, a hit at the start: each with its words."""
    rng = np.random.default_rng(2)
    hit = measured(600, 0.1)
    hit[:, 0] = 1e-3 * rng.standard_normal(600)
    hit[5, 0] = 50.0
    cases: list[tuple[Real, dict[str, Any], str]] = [
        (measured(500), {}, "p_reduced"),
        (measured(600), {"method": "n4sid-moesp"}, "rows_reduced"),
        (measured(3000, 0.0), {}, "qr_factor"),
        (measured(), {"method": "n4sid-cva", "p": 12}, "p_ignored"),
        (measured(20000, 5.0, 3), {"p": 10, "order": 6}, "finite_p_bias"),
        (measured(), {"hankel": "literal"}, "literal_hankel"),
    ]
    for one, arguments, code in cases:
        assert code in [w["code"] for w in same(tmp_path, [one], **arguments)["warnings"]], code
    one, other = both(tmp_path, [hit], U, Y, p=40)
    assert differences(one[1], other[1]) == [] and one[0] == other[0]


@pytest.mark.parametrize("arguments", [
    {"method": "era"}, {"p": 0}, {"p": 2.5}, {"rows": 1}, {"order": "many"}, {"order": -3}, {"hold": "first"},
    {"detrend": "line"}, {"start": "still"}, {"hankel": "innovations", "method": "n4sid-cva"}, {"sigma_blocks": 5},
    {"sigma_blocks": 101},
    {"sensing": "force"}, {"sensing": ["acceleration", "velocity"]}, {"input_dofs": [1]}, {"output_dofs": [1, 2, 3]},
    {"input_dofs": [1, 2], "output_dofs": [1, 2, 3]}, {"input_dofs": [0], "output_dofs": [1, 2, 3]},
    {"input_dofs": [4], "output_dofs": [1, 2, 3]}, {"max_order": 0}, {"p": 4000, "rows": 90000},
], ids=str)  # fmt: skip
def test_refused_arguments(tmp_path: Path, arguments: dict[str, Any]) -> None:
    one, other = both(tmp_path, [measured(1000)], U, Y, **arguments)
    assert one == other and one[0] == 2


def damaged(kind: str) -> Real:
    one = measured(1000)
    if kind == "constant input":
        one[:, 0] = 2.0
    if kind == "constant output":
        one[:, 2] = -1.5
    if kind == "short":
        one = one[:30]
    if kind == "line":
        one[:, 1] = np.arange(len(one))
    if kind == "unrelated":
        one[:, 0] = np.random.default_rng(8).standard_normal(len(one))
        one[:, 1:] = np.random.default_rng(9).standard_normal((len(one), 3))
    return one


@pytest.mark.parametrize("kind", ["constant input", "constant output", "short", "line", "unrelated"])
@pytest.mark.parametrize("method", ["okid-era", "n4sid-moesp"])
def test_refused_records(tmp_path: Path, kind: str, method: str) -> None:
    arguments = {"detrend": "linear"} if kind == "line" else {}
    one, other = both(tmp_path, [damaged(kind)], U, Y, method=method, **arguments)
    assert differences(one[1], other[1]) == [] and one[0] == other[0] == 3


@pytest.mark.parametrize("method", ["auto", "okid-era", "plscf"])
@pytest.mark.parametrize("value", [1e37, -3.4028234663852886e38, 9.96921e36])
def test_a_fill_value_is_refused_where_it_stands(tmp_path: Path, value: float, method: str) -> None:
    """Loggers and netCDF write such numbers where they have none: 1e37, the largest float, 9.96921e36."""
    fill = measured(1000)
    fill[500:503, 2] = value
    one, other = both(tmp_path, [measured(1000, seed=2), fill], U, Y, method=method)
    assert one == other and one[0] == 2
    assert f'output "{Y[1]}" is {value:g} at sample 500 (from 0), expected less than 1e+30' in one[1]


@pytest.mark.parametrize("method", ["okid-era", "n4sid-moesp", "okid-era-dc"])
def test_a_force_never_there_long_enough_to_judge_a_model(tmp_path: Path, method: str) -> None:
    sparse = measured(1000)
    sparse[::16, 0] = np.nan
    one, other = both(tmp_path, [sparse], U, Y, method=method)
    assert one == other and one[0] == 3
    assert "no stretch of the record can judge it" in one[1] and "explains" not in one[1]


def test_too_few_modes_and_a_repeated_force(tmp_path: Path) -> None:
    one = measured(2000)
    for arguments, code in (
        ({"order": 2, "input_dofs": [1], "output_dofs": [1, 2, 3]}, 3),
        ({"order": 1}, 0),  # a model without a vibration mode was asked for: it comes with the warning no_modes
    ):
        first, other = both(tmp_path, [one], U, Y, **arguments)
        assert differences(first[1], other[1]) == [] and first[0] == other[0] == code
    forces = np.hstack(record(w2(), 2000, 1.0, 3))
    forces[:, 1] = 3.0 * forces[:, 0]
    names = [f"c{k}" for k in range(8)]
    first, other = both(tmp_path, [forces], names[:2], names[2:])
    assert first == other and first[0] == 3
    assert "repeats" in first[1]


CSV = {
    "empty line": "# fs_hz: 10\na,b\n1,2\n\n3,4\n",
    "ragged": "# fs_hz: 10\na,b\n1,2\n3\n",
    "text": "# fs_hz: 10\na,b\n1,two\n",
    "inf": "# fs_hz: 10\na,b\n1,inf\n",
    "twice": "# fs_hz: 10\na,a\n1,2\n",
    "no rows": "# fs_hz: 10\na,b\n",
    "two rates": "# fs_hz: 10\n# fs_hz: 20\na,b\n1,2\n",
    "negative rate": "# fs_hz: -10\na,b\n1,2\n",
    "decimal commas": "# fs_hz: 10\na,b\n1,5,2,5\n",
    "two marks": "# fs_hz: 10\na;b\n1,5;2.5\n",
    "open quote": '# fs_hz: 10\n"a,b\n1,2\n',
    "bytes": "# fs_hz: 10\na,b\x01\n1,2\n",
}


@pytest.mark.parametrize("kind", CSV)
def test_one_grammar_of_csv(tmp_path: Path, kind: str) -> None:
    path = tmp_path / "record.csv"
    path.write_text(CSV[kind], encoding="utf-8")
    done = okid("identify", path, "--inputs", "a", "--outputs", "b")
    assert done.returncode == 2
    with pytest.raises(package.InputError) as caught:
        package.read_csv(path)
    assert f"okid: {caught.value}\n" == done.stderr


def test_what_csv_allows(tmp_path: Path) -> None:
    path = tmp_path / "record.csv"
    path.write_bytes('\ufeff# Sample_rate_hz = 12.5 Hz\r\n"f [N]";a (g);\r\n1,5; nan;x\r\n+2;;\r\n'.encode())
    one = package.read_csv(path)
    assert (one.names, one.units, one.fs_hz) == (["f [N]", "a (g)"], ["N", "g"], 12.5)
    np.testing.assert_array_equal(one.samples, [[1.5, np.nan], [2.0, np.nan]])
    path.write_text("time_s,x\n0,1\n0.1,2\n0.5,3\n", encoding="utf-8")
    one = package.read_csv(path)
    assert one.fs_hz is None and "not evenly spaced" in one.remarks[0]


def test_the_table_is_that_of_the_program(tmp_path: Path) -> None:
    one = measured()
    path = write(tmp_path / "record0.csv", one, U + Y)
    done = okid(
        "identify",
        path,
        "--inputs",
        "force",
        "--outputs",
        ",".join(Y),
        "--input-dofs",
        1,
        "--output-dofs",
        "1,2,3",
        "--method",
        "okid-era",
    )
    result = package.identify(
        one[:, :1],
        one[:, 1:],
        fs=S.fs,
        input_names=U,
        output_names=Y,
        method="okid-era",
        input_dofs=[1],
        output_dofs=[1, 2, 3],
    )
    assert said(str(result.table())) == said(done.stdout)
