# SPDX-License-Identifier: MIT
"""okid.identify as a user calls it: recovery of known structures, shapes, names, errors, results."""

from __future__ import annotations

import json
import pickle
import sys
from functools import lru_cache

import numpy as np
import okid
import pytest
import reference
import systems

# Acceptance: frequency and damping, worst over all seeds, W1 p 40 r 80
ACCEPTED = {1.0: (3.1e-5, 4.3e-3), 5.0: (1.6e-4, 3.0e-2)}


@lru_cache(maxsize=64)
def w1_record(noise: float, seed: int, samples: int = 10000) -> tuple[np.ndarray, np.ndarray]:
    return systems.record(systems.w1(), samples, noise, seed)


def mode_errors(result: okid.Result, s: systems.Structure) -> tuple[float, float]:
    f, zeta = s.modes()
    assert len(result.modes) == len(f)
    found = np.array([(m.frequency_hz, m.damping_ratio) for m in result.modes])
    return float(np.max(np.abs(found[:, 0] / f - 1.0))), float(np.max(np.abs(found[:, 1] / zeta - 1.0)))


@pytest.fixture(scope="module")
def result() -> okid.Result:
    u, y = w1_record(1.0, 1)
    return okid.identify(u, y, fs=systems.w1().fs, method="okid-era")


@pytest.mark.parametrize("noise", [1.0, 5.0])
def test_w1_modes_within_the_acceptance_table(noise: float) -> None:
    s, good = systems.w1(), 0
    for seed in range(101, 121):
        u, y = systems.record(s, 10000, noise, seed)
        result = okid.identify(u, y, fs=s.fs, p=40, rows=80)
        assert result.order == 6
        f_error, z_error = mode_errors(result, s)
        good += f_error <= 1.5 * ACCEPTED[noise][0] and z_error <= 1.5 * ACCEPTED[noise][1]
    assert good >= 19


@pytest.mark.parametrize(("name", "rows"), [("w1", 80), ("w2", 80), ("w3", 60)])
def test_noise_free_modes_and_automatic_order(name: str, rows: int) -> None:
    s = getattr(systems, name)()
    u, y = systems.record(s, 10000, 0.0, 17)
    result = okid.identify(u, y, fs=s.fs, p=40, rows=rows)
    assert result.order == 2 * len(s.M)
    f_error, z_error = mode_errors(result, s)
    assert f_error < 1e-8
    assert z_error < 1e-5
    assert min(result.fit.simulation_percent.values()) > 98.0  # the mean of a finite record is no offset of the model
    exact = okid.identify(u, y, fs=s.fs, p=40, rows=rows, detrend="none")
    assert min(exact.fit.simulation_percent.values()) > 99.999
    assert exact.order == result.order


def test_shapes_agree_with_the_structure(result: okid.Result) -> None:
    s = systems.w1()
    _, phi = np.linalg.eigh(np.diag(1 / np.sqrt(np.diag(s.M))) @ s.K @ np.diag(1 / np.sqrt(np.diag(s.M))))
    phi = np.diag(1 / np.sqrt(np.diag(s.M))) @ phi
    for k, mode in enumerate(result.modes):
        assert reference.mac(mode.shape, phi[:, k]) > 0.999
        assert np.max(np.abs(mode.shape)) == pytest.approx(1.0)
        assert mode.mpc == pytest.approx(okid.modal.mpc(mode.shape), abs=1e-9)
        assert 0.9 < mode.emac <= 1.0


def test_inputs_are_never_modified() -> None:
    u, y = (a.copy() for a in w1_record(1.0, 2, 3000))
    y[100:110] = np.nan
    before = u.copy(), y.copy()
    u.setflags(write=False)
    y.setflags(write=False)
    for options in ({}, {"detrend": "linear"}, {"start": "rest"}, {"detrend": "none"}):
        okid.identify([u, u], [y, y], fs=1000.0, p=10, **options)
    np.testing.assert_array_equal(u, before[0])
    np.testing.assert_array_equal(y, before[1])


def test_missing_samples_are_left_out() -> None:
    s = systems.w1()
    u, y = (a.copy() for a in w1_record(1.0, 3))
    y[2000:2050, 1] = np.nan
    u[5000] = np.nan
    result = okid.identify(u, y, fs=s.fs, method="okid-era")
    assert result.gaps == 2
    assert "missing_samples" in [w.code for w in result.warnings]
    f_error, z_error = mode_errors(result, s)
    assert f_error < 5e-5
    assert z_error < 7e-3
    v = np.hstack([u, y])
    expected = reference.markov(reference.observer([v], 1, 40), 160)
    assert np.linalg.norm(result.markov - expected) <= 1e-8 * np.linalg.norm(expected)


def test_several_records_are_each_centred_and_merged() -> None:
    s = systems.w1()
    parts = [w1_record(1.0, seed, 3000) for seed in (4, 5, 6)]
    us = [u + 10.0 * k for k, (u, _) in enumerate(parts)]
    ys = [y - 3.0 * k for k, (_, y) in enumerate(parts)]
    result = okid.identify(us, ys, fs=s.fs, p=20, rows=40)
    assert result.records == 3
    assert result.samples == 9000
    assert result.model.x0 is not None
    assert result.model.x0.shape == (3, result.order)
    f_error, z_error = mode_errors(result, s)
    assert f_error < 1e-4
    assert z_error < 5e-2
    turned = okid.identify(us[::-1], ys[::-1], fs=s.fs, p=20, rows=40)
    np.testing.assert_allclose(turned.markov, result.markov, atol=1e-9 * np.max(np.abs(result.markov)))


@pytest.mark.parametrize("detrend", ["mean", "linear"])
def test_offset_and_drift_are_removed(detrend: str) -> None:
    s = systems.w1()
    u, y = w1_record(1.0, 7)
    plain = okid.identify(u, y, fs=s.fs, p=20)
    drift = np.linspace(-1.0, 1.0, len(u))[:, None] if detrend == "linear" else 0.0
    moved = okid.identify(u + 5.0 + drift, y - 40.0 + 3.0 * drift, fs=s.fs, p=20, detrend=detrend)
    for before, after in zip(plain.modes, moved.modes, strict=True):
        assert after.frequency_hz == pytest.approx(before.frequency_hz, rel=1e-5)
        assert after.damping_ratio == pytest.approx(before.damping_ratio, rel=2e-3)


def hammer(s: systems.Structure, samples: int, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """A blow of three samples after five quiet ones, structure at rest before, a little noise on everything."""
    rng = np.random.default_rng(seed)
    u = np.zeros((samples, 1))
    u[5:8, 0] = [40.0, 80.0, 30.0]
    y = systems.simulate(s.discrete(), u)
    y += 1e-3 * np.sqrt(np.mean(y**2, axis=0)) * rng.standard_normal(y.shape)
    return u + 0.01 * rng.standard_normal(u.shape), y


def test_a_blow_at_the_start_needs_the_silent_past() -> None:
    s = systems.w1()
    u, y = hammer(s, 6000, 1)
    lost = okid.identify(u, y, fs=s.fs, p=40, order=6)
    kept = okid.identify(u, y, fs=s.fs, p=40, order=6, start="rest")
    assert "hit_at_start" in [w.code for w in lost.warnings]
    assert "hit_at_start" not in [w.code for w in kept.warnings]
    f_error, z_error = mode_errors(kept, s)
    assert f_error < 2e-3
    assert z_error < 0.1
    truth = s.discrete()
    first = np.array([truth[3]] + [truth[2] @ np.linalg.matrix_power(truth[0], k) @ truth[1] for k in range(10)])
    errors = [np.linalg.norm(r.markov[:11] - first) / np.linalg.norm(first) for r in (kept, lost)]
    assert errors[0] < 0.01
    assert errors[0] < 0.1 * errors[1]


@pytest.mark.parametrize("method", ["okid-era", "n4sid-cva"])  # the fits of the latter wait until they are asked for
def test_fits_are_the_formula(result: okid.Result, method: str) -> None:
    u, y = w1_record(1.0, 1)
    if method != "okid-era":
        result = okid.identify(u, y, fs=systems.w1().fs, method=method, order=6, rows=10)
    centred_u, centred_y = u - u.mean(axis=0), y - y.mean(axis=0)
    assert result.model.x0 is not None
    x0 = result.model.x0[0]
    matrices = (result.model.A, result.model.B, result.model.C, result.model.D)
    simulated = systems.simulate(matrices, centred_u, x0)
    np.testing.assert_allclose(result.model.simulate(centred_u, x0), simulated, atol=1e-10)
    for k, name in enumerate(result.outputs):
        error = np.linalg.norm(centred_y[:, k] - simulated[:, k])
        percent = 100.0 * (1.0 - error / np.linalg.norm(centred_y[:, k] - centred_y[:, k].mean()))
        assert result.fit.simulation_percent[name] == pytest.approx(percent, abs=1e-6)
        predicted = result.fit.prediction_percent[name]
        assert predicted is not None
        assert predicted > percent - 0.5


def test_fits_start_anew_after_missing_inputs() -> None:
    s = systems.w1()
    u, y = (a.copy() for a in w1_record(1.0, 12, 6000))
    u[0:3], u[2000:2500], u[2510], u[4000] = np.nan, np.nan, np.nan, np.nan  # nine samples alone: left out
    y[3000:3005, 1] = np.nan
    result = okid.identify(u + 7.0, y - 9.0, fs=s.fs, method="okid-era")
    m = result.model
    assert m.x0 is not None
    centred_u, centred_y = u - np.nanmean(u, axis=0), y - np.nanmean(y, axis=0)
    measured, simulated = [], []
    for turn, part in enumerate((slice(3, 2000), slice(2511, 4000), slice(4001, 6000))):
        part_u, part_y = centred_u[part], centred_y[part]
        x0 = m.initial_state(part_u, part_y)
        if turn == 0:
            np.testing.assert_allclose(m.x0[0], x0, rtol=1e-6, atol=1e-9 * np.max(np.abs(x0)))
        measured.append(part_y)
        simulated.append(systems.simulate((m.A, m.B, m.C, m.D), part_u, x0))
    truth, made = np.concatenate(measured), np.concatenate(simulated)
    for k, name in enumerate(result.outputs):
        there = np.isfinite(truth[:, k])
        spread = np.linalg.norm(truth[there, k] - truth[there, k].mean())
        percent = 100.0 * (1.0 - np.linalg.norm((truth - made)[there, k]) / spread)
        assert percent > 90.0
        assert result.fit.simulation_percent[name] == pytest.approx(percent, abs=1e-6)


def test_a_record_without_inputs_in_any_stretch_has_no_fit() -> None:
    u, y = (a.copy() for a in w1_record(1.0, 3))
    u[::15] = np.nan  # stretches of 14, too short to tell their initial state; the other record has the fits
    result = okid.identify([w1_record(1.0, 4)[0], u], [w1_record(1.0, 4)[1], y], fs=systems.w1().fs, p=5)
    alone = okid.identify(*w1_record(1.0, 4), fs=systems.w1().fs, p=5)
    assert result.model.x0 is not None and alone.model.x0 is not None
    np.testing.assert_array_equal(result.model.x0[1], np.zeros(result.order))
    np.testing.assert_allclose(result.fit.simulation_percent["y1"], alone.fit.simulation_percent["y1"], atol=0.1)


def test_gaps_reduce_p() -> None:
    s = systems.w1()
    u, y = (a.copy() for a in w1_record(1.0, 13))
    y[::20, 0] = np.nan  # 500 runs of 19
    result = okid.identify(u, y, fs=s.fs, p=40)
    rows = {p: 500 * max(0, 19 - p) / (1 + 4 * p) for p in range(1, 41)}
    assert result.p == max(p for p in rows if rows[p] >= 10) == 17
    assert "p_reduced" in [w.code for w in result.warnings]
    single = w1_record(1.0, 13)[1].copy()
    single[5000] = np.nan
    assert okid.identify(u, single, fs=s.fs, p=40).p == 40


def test_prediction_skips_missing_outputs(result: okid.Result) -> None:
    u, y = (a[:200].copy() for a in w1_record(1.0, 1))
    y[50:60] = np.nan
    predicted = result.model.predict(u, y)
    assert np.all(np.isfinite(predicted))
    x, m = np.zeros(result.order), result.model
    for n in range(len(u)):
        expected = m.C @ x + m.D @ u[n]
        np.testing.assert_allclose(predicted[n], expected, atol=1e-10)
        correction = np.where(np.isfinite(y[n]), y[n] - expected, 0.0)
        x = m.A @ x + m.B @ u[n] + m.K @ correction


def test_initial_state_is_recovered() -> None:
    s = systems.w1()
    A, B, C, D = s.discrete()
    model = okid.Model(A, B, C, D, np.zeros((6, 3)), s.dt)
    x0 = np.array([0.1, -0.2, 0.05, 3.0, -1.0, 2.0])
    u = np.random.default_rng(1).standard_normal((400, 1))
    y = systems.simulate((A, B, C, D), u, x0)
    y[30:40] = np.nan
    np.testing.assert_allclose(model.initial_state(u, y), x0, rtol=1e-7, atol=1e-9)
    for wrong in (np.zeros((400, 2)), np.zeros((10, 3))):
        with pytest.raises(okid.InputError):
            model.initial_state(u, wrong)
    with pytest.raises(okid.InputError):
        model.simulate(u, np.zeros(5))


def test_okid_result_1(result: okid.Result, tmp_path) -> None:
    result.save(tmp_path / "r.json")
    data = json.loads((tmp_path / "r.json").read_text(encoding="utf-8"))
    assert data == json.loads(json.dumps(result.to_dict(), allow_nan=False))
    assert data["schema"] == "okid.result/1"
    for key in "version method fs_hz samples records gaps inputs outputs p rows order hold detrend".split():
        assert key in data
    assert (data["inputs"], data["outputs"], data["order"], data["p"], data["rows"]) == (
        ["u1"], ["y1", "y2", "y3"], 6, 40, 80,
    )  # fmt: skip
    assert np.array(data["model"]["A"]).shape == (6, 6)
    assert np.array(data["model"]["K"]).shape == (6, 3)
    assert np.array(data["model"]["x0"]).shape == (1, 6)
    assert np.array(data["markov"]["Y"]).shape == (161, 3, 1)
    assert len(data["singular_values"]) >= 6
    assert [len(m["shape_re"]) for m in data["modes"]] == [3, 3, 3]
    assert list(data["modes"][0]) == (
        "frequency_hz damping_ratio shape_re shape_im frequency_std_hz damping_ratio_std shape_re_std shape_im_std "
        "mpc emac cmi confident found_in why why_text".split()
    )
    assert 0.0 < data["modes"][0]["frequency_std_hz"] < 1e-3 * data["modes"][0]["frequency_hz"]
    assert min(data["modes"][0]["shape_re_std"]) == 0.0  # the entry that is 1 by scaling
    assert result.mkr is result.pdc is None
    assert data["version"] == okid.__version__
    assert not list(tmp_path.glob("*.part"))


def test_markov_parameters_agree_with_the_model(result: okid.Result) -> None:
    m = result.model
    made = np.array([m.D] + [m.C @ np.linalg.matrix_power(m.A, k) @ m.B for k in range(80)])
    assert np.linalg.norm(made - result.markov[:81]) < 0.02 * np.linalg.norm(made)


def test_scipy_and_control(result: okid.Result, monkeypatch: pytest.MonkeyPatch) -> None:
    from scipy.signal import dlsim

    u = np.random.default_rng(1).standard_normal((50, 1))
    _, y, _ = dlsim(result.to_scipy(), u)
    np.testing.assert_allclose(y, result.model.simulate(u), atol=1e-10)
    monkeypatch.setitem(sys.modules, "control", None)
    with pytest.raises(ImportError, match="pip install control"):
        result.to_control()


def test_table_pickle_and_repr(result: okid.Result) -> None:
    text = str(result.table())
    assert f"{result.modes[0].frequency_hz:.5f}" in text
    assert "order 6" in text
    assert text.splitlines()[3].count("±") == text.splitlines()[4].count("±") == 2
    s = systems.w1()
    bare = okid.identify(*w1_record(1.0, 3), fs=s.fs, order=6, sigma_blocks=0)
    assert bare.modes[0].frequency_std_hz is None and "±" not in str(bare.table()).splitlines()[4]
    again = pickle.loads(pickle.dumps(result))
    assert again.to_dict() == result.to_dict()
    with pytest.raises(okid.Error):
        again.stabilization()
    assert "identifier" not in repr(result)


def test_stabilization(result: okid.Result) -> None:
    rows = result.stabilization(range(2, 25, 2))
    orders = [row.order for row in rows]
    assert orders == sorted(orders)
    f, _ = systems.w1().modes()
    for row in rows:
        if row.order >= 8:
            hits = [np.argmin(np.abs(row.frequency_hz - target)) for target in f]
            assert np.all(row.stable[hits])
    assert result.plot_stabilization(orders=[2, 4, 6, 8]).get_xlabel() == "frequency [Hz]"
    np.testing.assert_array_equal(rows[2].frequency_hz, [m.frequency_hz for m in result.modes])


def test_one_dimensional_and_named_channels() -> None:
    s = systems.w1()
    u, y = w1_record(1.0, 8)
    result = okid.identify(
        u[:, 0], y[:, 0], fs=s.fs, method="okid-era", input_names=["hammer"], output_names=["tip [m/s^2]"]
    )
    assert (result.inputs, result.outputs) == (["hammer"], ["tip [m/s^2]"])
    assert [m.shape.shape for m in result.modes] == [(1,)] * len(result.modes)


def test_short_records_reduce_p_and_say_so() -> None:
    u, y = w1_record(1.0, 9)
    result = okid.identify(u[:600], y[:600], fs=100.0, method="okid-era")
    assert result.p == okid.usable_p(1, 3, 40, 600) == 14
    assert "p_reduced" in [w.code for w in result.warnings]


GOOD_U, GOOD_Y = np.random.default_rng(0).standard_normal((500, 1)), np.random.default_rng(1).standard_normal((500, 2))


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"u": GOOD_U[:-1]}, "499"),
        ({"u": np.zeros((500, 0))}, "shape"),
        ({"u": np.zeros((2, 500, 1))}, "shape"),
        ({"y": np.where(np.arange(500)[:, None] == 7, np.inf, GOOD_Y)}, "sample 7"),
        ({"y": GOOD_Y.astype(complex)}, "complex"),
        ({"y": GOOD_Y.astype(str)}, "real numbers"),
        ({"y": np.column_stack([GOOD_Y[:, 0], np.full(500, np.nan)])}, '"y2" holds no number'),
        ({"u": [GOOD_U, GOOD_U], "y": [GOOD_Y]}, "2 records"),
        ({"u": [GOOD_U, GOOD_U], "y": [GOOD_Y, GOOD_Y[:, :1]]}, "record 1"),
        ({"fs": 0.0}, "fs"),
        ({"fs": np.nan}, "fs"),
        ({"p": 0}, 'p: found "0"'),
        ({"p": 2.5}, 'p: found "2.5"'),
        ({"order": "large"}, "order"),
        ({"rows": 0}, "rows"),
        ({"method": "magic"}, "magic"),
        ({"detrend": "cubic"}, "cubic"),
        ({"hold": "soh"}, "soh"),
        ({"start": "now"}, "now"),
        ({"input_names": ["a", "b"]}, "1 names are needed"),
        ({"output_names": ["a", "a"]}, "stands twice"),
    ],
)
def test_wrong_arguments_are_input_errors(change: dict, words: str) -> None:
    arguments = {"u": GOOD_U, "y": GOOD_Y, "fs": 100.0, **change}
    with pytest.raises(okid.InputError, match=words):
        okid.identify(arguments.pop("u"), arguments.pop("y"), **arguments)


@pytest.mark.parametrize(
    ("u", "y", "words"),
    [
        (np.ones((500, 1)), GOOD_Y, 'input "u1" is constant'),
        (GOOD_U, np.column_stack([GOOD_Y[:, 0], np.full(500, 2.0)]), 'output "y2" is constant'),
        (GOOD_U[:20], GOOD_Y[:20], "too few samples"),
        (np.hstack([GOOD_U, 2.0 * GOOD_U]), GOOD_Y, "no model"),
    ],
)
def test_no_honest_model(u: np.ndarray, y: np.ndarray, words: str) -> None:
    with pytest.raises(okid.IdentificationError, match=words) as caught:
        okid.identify(u, y, fs=100.0, p=5)
    assert isinstance(caught.value, ValueError)


def test_demo(capsys: pytest.CaptureFixture[str]) -> None:
    result = okid.demo()
    assert len(result.modes) == 3
    assert "truth: " in capsys.readouterr().out


def test_outputs_that_do_not_answer_give_no_model() -> None:
    rng = np.random.default_rng(8)
    with pytest.raises(okid.IdentificationError, match="no model"):
        okid.identify(rng.standard_normal(5000), rng.standard_normal((5000, 3)), fs=100.0)
    for order in (6, "auto"):
        with pytest.raises(okid.IdentificationError, match="no model"):
            okid.identify(
                rng.standard_normal(5000),
                rng.standard_normal((5000, 3)),
                fs=100.0,
                method="n4sid-moesp",
                order=order,
                sigma_blocks=0,
            )


def test_what_a_poor_fit_says_waits_with_the_fit() -> None:
    u, y = (a.copy() for a in w1_record(1.0, 1))
    y[:, 1] = np.random.default_rng(2).standard_normal(len(y)) * y[:, 1].std()
    result = okid.identify(u, y, fs=systems.w1().fs, method="n4sid-moesp", order=6, rows=10, sigma_blocks=0)
    assert [m.frequency_hz for m in result.modes]
    assert [w.code for w in result.warnings].count("fit_low") == 1
    assert (result.fit.simulation_percent["y2"] or 0.0) < 30.0
    assert "fit_low" in str(result.table())
    assert json.loads(json.dumps(result.to_dict()))["fit"]["simulation_percent"]["y2"] < 30.0
