# SPDX-License-Identifier: MIT
"""Result.table(): rows for pandas, text for a terminal, HTML for a notebook."""

import numpy as np
import okid
import pandas as pd
import pytest
from okid.formats.result_tree import result_tree


@pytest.fixture(scope="module")
def result() -> okid.Result:
    force, answer = okid.demo_record(5000)
    return okid.identify(force, answer, fs=1000.0, p=20, order=6, output_names=["a<1>", "b&2", "c"])


def test_pandas_takes_it(result: okid.Result) -> None:
    frame = pd.DataFrame(result.table()).set_index("mode")
    assert list(frame.index) == [1, 2, 3] and frame.frequency_hz.is_monotonic_increasing
    assert (frame.frequency_std_hz > 0).all() and np.allclose(frame.cmi, frame.mpc * frame.emac)
    assert frame.loc[1, "damping_ratio"] == result.modes[0].damping_ratio


def test_every_number_of_a_mode_reaches_tables_and_trees(result: okid.Result) -> None:
    """The JSON, changed by hand: each number once in Mode, in the table and in the arrays of .mat and HDF5."""
    raw = result.to_dict()
    for k, mode in enumerate(raw["modes"]):
        mode |= {
            "found_in": 0.5 + k / 10,
            "confident": k != 1,
            "modal_mass": 2.0 + k,
            "modal_mass_std": 0.1 + k,
        }
    raw["modes"][0]["modal_mass_std"] = None
    again = okid.Result.from_dict(raw)
    arrays = result_tree(raw)["modes"]
    columns = [key for key, value in raw["modes"][2].items() if isinstance(value, float | bool)]
    assert {
        "frequency_std_hz",
        "cmi",
        "confident",
        "found_in",
        "modal_mass",
        "modal_mass_std",
    } <= set(columns)
    for key in columns:
        given = [mode[key] for mode in raw["modes"]]
        assert [getattr(mode, key) for mode in again.modes] == pytest.approx(given, rel=1e-12), key
        assert [row[key] for row in again.table()] == pytest.approx(given, rel=1e-12), key
        np.testing.assert_allclose(
            arrays[key],
            [np.nan if x is None else x for x in given],
            rtol=1e-12,
            err_msg=key,
        )
    assert again.modes[0].modal_mass_std is None and again.table()[1]["confident"] is False


def test_people_read_it(result: okid.Result) -> None:
    text = str(result.table())
    assert "f [Hz]" in text and f"{result.modes[0].frequency_hz:.5f}" in text and "a<1>" in text
    page = result._repr_html_()
    assert page.count("<tr>") == 4 and "± [Hz]" in page and f"{result.modes[2].frequency_hz:.5f}" in page


def test_html_is_escaped() -> None:
    table = okid.ModalTable(
        [okid.Mode(1.0, 0.01, np.ones(1, complex), 1.0, float("nan"))],
        "",
        ["x: <script>&"],
    )
    page = table._repr_html_()
    assert "<script>" not in page and "&lt;script&gt;&amp;" in page and table[0]["emac"] is None and "–" in page


def test_control_and_scipy(result: okid.Result) -> None:
    """Both know the same system: equal responses, the sample interval kept."""
    control, scipy = result.to_control(), result.to_scipy()
    assert control.dt == scipy.dt == 0.001
    line = np.array([5.0, 11.0, 40.0])
    ours = result.model.frequency_response(line)
    z = np.exp(2j * np.pi * line * 0.001)
    np.testing.assert_allclose(np.moveaxis(control(z), -1, 0).reshape(3, 3, 1), ours, rtol=1e-9)
    for k in range(3):
        at = scipy.C @ np.linalg.solve(z[k] * np.eye(len(scipy.A)) - scipy.A, scipy.B) + scipy.D
        np.testing.assert_allclose(at, ours[k], rtol=1e-9)
