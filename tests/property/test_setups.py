# SPDX-License-Identifier: MIT
"""Several set-ups as one result, shapes judged, estimators of frequency responses. The records are simulated by the
tests' own structures; what must come out follows from their matrices."""

from __future__ import annotations

import numpy as np
import okid
import pytest
from okid import frf, modal
from systems import record, w2


def test_roving_sensors_become_one_shape() -> None:
    structure = w2()
    u, y = record(structure, 8000, 1.0, 5)
    names = ["ref1", "ref2", "a", "b", "c", "d"]
    results = []
    for k, roving in enumerate(([2], [3], [4, 5])):
        part = slice(2500 * k, 2500 * (k + 1))
        columns = [0, 1, *roving]
        own = [names[c] for c in columns]
        results.append(okid.identify(u[part], -2.0 * y[part][:, columns] if k == 1 else y[part][:, columns],
                                     fs=structure.fs, output_names=own, sigma_blocks=0))  # fmt: skip
    whole = okid.identify(u, y, fs=structure.fs, output_names=names, sigma_blocks=0)
    merged = okid.merge(results)
    assert merged.outputs == ["ref1", "ref2", "a", "b", "c", "d"] and merged.records == 3 and merged.inputs == []
    assert len(merged.modes) == len(whole.confident_modes) == 6
    for one, other in zip(merged.modes, whole.confident_modes, strict=True):
        assert one.frequency_hz == pytest.approx(other.frequency_hz, rel=2e-3)
        assert modal.mac(one.shape, other.shape) > 0.99
        assert one.found_in == 1.0 and one.confident and one.frequency_std_hz and one.frequency_std_hz < 0.1
    poles = modal.poles(merged.model.A, merged.model.C, merged.model.dt)
    assert poles.frequency_hz == pytest.approx([mode.frequency_hz for mode in merged.modes])
    assert np.min(np.diag(modal.mac_matrix(poles.shapes, np.array([mode.shape for mode in merged.modes])))) > 0.9999
    assert okid.Result.from_dict(merged.to_dict()).outputs == merged.outputs


def test_a_mode_of_one_set_up_is_doubted_and_has_gaps() -> None:
    structure = w2()
    u, y = record(structure, 6000, 1.0, 6)
    parts = [okid.identify(u, y[:, [0, 1, k]], fs=structure.fs, output_names=["a", "b", f"c{k}"], sigma_blocks=0,
                           band=band) for k, band in ((2, None), (3, (0.0, 10.0)), (4, (0.0, 10.0)))]  # fmt: skip
    merged = okid.merge(parts)
    alone = [mode for mode in merged.modes if mode.frequency_hz > 10.5]
    assert alone and all(mode.why == ("few_runs",) and not mode.confident for mode in alone)
    assert all(np.isnan(mode.shape[3:]).all() and np.isfinite(mode.shape[:3]).all() for mode in alone)
    with pytest.raises(okid.InputError, match="no output in common"):
        okid.merge([parts[0], okid.identify(u, y[:, 3], fs=structure.fs, output_names=["z"])])
    with pytest.raises(okid.InputError, match="found 1 result to merge"):
        okid.merge(parts[:1])


def test_indicators_of_shapes() -> None:
    turned = np.array([1.0, -0.5, 0.25]) * np.exp(0.7j)
    assert modal.mpd(turned) == pytest.approx(0.0, abs=1e-6) and modal.mcf(turned) == pytest.approx(0.0, abs=1e-12)
    assert np.allclose(modal.real_shape(turned), [1.0, -0.5, 0.25])
    leaning = np.array([1.0 + 0.1j, 1.0 - 0.1j])
    assert modal.mpd(leaning) == pytest.approx(np.degrees(np.arctan(0.1)))
    a = np.array([[1.0, 0.5, 0.2], [0.3, -1.0, 0.4]])
    b = -3.0 * a * np.array([1.0, 1.0, 1.0])
    assert np.allclose(modal.comac(a, b), 1.0)
    b[1, 2] *= -1.0
    found = modal.comac(a, b)
    assert found[2] == pytest.approx(1.0) and modal.mac(a[1], b[1]) < 1.0  # CoMAC does not see signs: MAC does
    b[1, 2] = 0.0
    assert np.argmin(modal.comac(a, b)) == 2


def test_one_shape_out_of_several() -> None:
    true, r = np.array([1.0, -0.6, 0.3, 0.8]), np.random.default_rng(1)
    estimates = [3.0j * (true + 0.05 * r.normal(size=4)) for _ in range(20)]
    estimates += [true + 2.0j * r.normal(size=4) for _ in range(4)]  # as noise makes them
    assert modal.mac(modal.mean_shape(estimates), true) > 0.998 > modal.mac(np.mean(np.imag(estimates), axis=0), true)
    gap = np.array([1.0, np.nan, 0.3, 0.8])
    assert np.allclose(modal.mean_shape([gap, -true, -true]), true, atol=1e-12)
    assert np.isnan(modal.mean_shape([gap, 2 * gap])[1])


def test_what_moves_under_unknown_forces() -> None:
    """Two outputs behind one another: the second is the first through a filter that is known."""
    r = np.random.default_rng(2)
    x = np.convolve(r.normal(size=60000), [1.0, 0.7])[:60000]
    y = np.column_stack([x, np.convolve(x, [0.5, 0.25])[:60000]])
    found = frf.transmissibility(y, 100.0, nperseg=512)
    z = np.exp(-2j * np.pi * found.frequency_hz / 100.0)
    assert found.outputs == ("y2",) and np.allclose(found.response[1:-1, 0, 0], (0.5 + 0.25 * z)[1:-1], atol=0.02)
    seen = frf.deflection(frf.spectra(y, 100.0), [10.0, 30.0])
    line = np.exp(-2j * np.pi * np.array([10.0, 30.0]) / 100.0)
    assert np.allclose(seen[:, 1] / seen[:, 0], 0.5 + 0.25 * line, atol=0.05)
    with pytest.raises(okid.InputError, match="reference is 2"):
        frf.transmissibility(y, 100.0, 2)


def test_estimators_lie_where_the_noise_puts_them() -> None:
    r = np.random.default_rng(0)
    u = r.normal(size=40000)
    y = np.convolve(u, [1.0, 0.5, -0.3])[: len(u)]
    true = frf.h1(u, y, 100.0, 256)
    noisy = [x + 0.3 * r.normal(size=len(x)) for x in (u, y)]
    h1, h2, hv = (np.abs(frf.h1(*noisy, 100.0, 256, estimator=one).response[:, 0, 0]) for one in ("h1", "h2", "hv"))
    size = np.abs(true.response[:, 0, 0])
    assert np.mean(h1[1:-1] / size[1:-1]) == pytest.approx(1.0 / 1.09, abs=0.01)
    assert np.all(h2[1:-1] >= h1[1:-1])
    assert np.allclose(hv[1:-1], np.sqrt(h1 * h2)[1:-1])
    two = np.column_stack([u, r.normal(size=len(u))])
    both = np.column_stack([y + two[:, 1], y])
    exact = frf.h1(two, both, 100.0, 256, estimator="hv").response[5:-5]
    assert np.allclose(exact, frf.h1(two, both, 100.0, 256).response[5:-5], atol=2e-2)
    with pytest.raises(okid.InputError, match="'h2' with 2 inputs"):
        frf.h1(two, both, 100.0, 256, estimator="h2")
