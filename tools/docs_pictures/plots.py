# SPDX-License-Identifier: MIT
"""Pictures of numbers: each from a run made here and now."""

from __future__ import annotations

import json
import subprocess
from pathlib import Path
from typing import Any

import matplotlib

matplotlib.use("svg")
import matplotlib.pyplot as plt
import numpy as np
import okid

from docs_pictures import runs

BLUE, ORANGE, GREEN, RED, GREY = "#1f5fa8", "#d9730d", "#2b8a3e", "#c92a2a", "#868e96"
plt.rcParams.update(
    {
        "svg.hashsalt": "okid",
        "svg.fonttype": "none",
        "font.size": 9,
        "axes.spines.top": False,
        "axes.spines.right": False,
        "figure.dpi": 100,
    }
)


def keep(name: str, figure: Any) -> str:
    figure.tight_layout()
    figure.savefig(runs.IMAGES / name, metadata={"Date": None, "Creator": None}, facecolor="white")
    plt.close(figure)
    return name


def record(rig: str, **changes: str) -> Any:
    """Samples of a recipe's rig with some keys changed."""
    text = (runs.RECIPES / rig).read_text()
    for key, value in changes.items():
        lines = [line for line in text.splitlines() if not line.startswith(f"{key} =")]
        text = "\n".join([f"{key} = {value}", *lines])
    (runs.FOLDER / "picture_rig.toml").write_text(text)
    runs.okid("simulate", "picture_rig.toml", "--csv", "picture.csv", "--truth", "picture.json", "--quiet")
    return okid.read_csv(str(runs.FOLDER / "picture.csv"))


def hits() -> str:
    """A good hit, a double one and one with a tip that is too soft: force over time and its spectrum."""
    got = record("hammer_rig.toml", noise_percent="0.2", duration_s="4.0")
    force = np.asarray(got.samples[:, 0])
    peak = int(np.argmax(force[:2500]))
    good = force[peak - 100 : peak + 924]
    double = good + 0.45 * np.roll(good, 35)
    width = np.hanning(41) / np.hanning(41).sum()
    soft = np.convolve(good, width, "same") * 4
    figure, axes = plt.subplots(2, 3, figsize=(8.2, 4.2))
    for column, (pulse, title, colour) in enumerate(
        ((good, "accepted", GREEN), (double, "rejected: double_hit", RED), (soft, "rejected: spectrum", RED))
    ):
        time = (np.arange(pulse.size) - 100) / got.fs_hz * 1000
        top, below = axes[:, column]
        top.plot(time[60:260], pulse[60:260], color=colour)
        top.set(title=title, xlabel="time [ms]", ylabel="force [N]" if column == 0 else None)
        level = np.abs(np.fft.rfft(pulse))
        below.plot(
            np.fft.rfftfreq(pulse.size, 1 / got.fs_hz), 20 * np.log10((level + 1e-12) / level[:3].max()), color=colour
        )
        below.axhline(-20, color=GREY, linestyle=":")
        below.set(ylim=(-60, 12), xlabel="frequency [Hz]", ylabel="force [dB]" if column == 0 else None)
    return keep("hits.svg", figure)


def holds() -> str:
    """One force between its samples under the three holds."""
    got = record("frame_rig.toml", duration_s="2.0")
    samples = np.asarray(got.samples[100:113, 0])
    at = np.arange(samples.size)
    fine = np.linspace(0, samples.size - 1, 1201)
    whole = np.asarray(got.samples[:, 0])
    sinc = [float(whole @ np.sinc(100 + t - np.arange(whole.size))) for t in fine]
    figure, axes = plt.subplots(1, 3, figsize=(8.2, 2.4), sharey=True)
    held = samples[np.minimum(np.floor(fine).astype(int), samples.size - 1)]
    for axis, curve, title in zip(
        axes,
        (held, np.interp(fine, at, samples), sinc),
        ("zoh: held (D/A converter)", "foh: linear (load cell)", "band: band-limited (filter)"),
        strict=True,
    ):
        axis.plot(fine / got.fs_hz * 1000, curve, color=BLUE)
        axis.plot(at / got.fs_hz * 1000, samples, "o", color=ORANGE, markersize=4)
        axis.set(title=title, xlabel="time [ms]")
    axes[0].set_ylabel("force [N]")
    return keep("holds.svg", figure)


def wrong_hold() -> str:
    """Errors of M, K, R of the frame recipe for each hold; its force is linear between samples."""
    got = record("frame_rig.toml")
    truth = json.loads((runs.FOLDER / "picture.json").read_text())
    u, y = got.columns(["force1"], "frame"), got.columns(["acc1", "acc2", "acc3"], "frame")
    figure, axis = plt.subplots(figsize=(5.2, 2.8))
    for place, hold in enumerate(("foh", "zoh", "band")):
        result = okid.identify(u, y, fs=got.fs_hz, hold=hold, input_dofs=[1], output_dofs=[1, 2, 3]).to_dict()["mkr"]
        for bar, (name, of) in enumerate((("M", "M"), ("K", "K"), ("R", "R"), ("R_normal_modes", "R"))):
            want = np.array(truth[of])
            off = 100 * np.linalg.norm(np.array(result[name]) - want) / np.linalg.norm(want)
            axis.bar(
                place + 0.2 * (bar - 1.5),
                off,
                0.18,
                color=(BLUE, GREEN, RED, ORANGE)[bar],
                label=name if place == 0 else None,
            )
            axis.text(place + 0.2 * (bar - 1.5), off * 1.15, f"{off:.2g}", ha="center", fontsize=7)
    axis.set(yscale="log", ylabel="error [%]", xticks=range(3))
    axis.set_xticklabels(["foh (right)", "zoh", "band"])
    axis.set_ylim(top=axis.get_ylim()[1] * 4)
    axis.legend(ncol=4, frameon=False, fontsize=8)
    return keep("wrong-hold.svg", figure)


def sigma() -> str:
    """What ± means: 40 records of the same frame, 10 s each, first mode with its 2 σ bars."""
    found, truth = [], 0.0
    for seed in range(1, 41):
        got = record("frame_rig.toml", duration_s="10.0", seed=str(seed))
        truth = json.loads((runs.FOLDER / "picture.json").read_text())["damping_ratio"][0]
        u, y = got.columns(["force1"], "frame"), got.columns(["acc1", "acc2", "acc3"], "frame")
        mode = okid.identify(u, y, fs=got.fs_hz, method="okid-era").to_dict()["modes"][0]
        found.append((mode["damping_ratio"], mode["damping_ratio_std"]))
    value, std = 100 * np.array(found).T
    inside = np.abs(value - 100 * truth) <= 2 * std
    figure, axis = plt.subplots(figsize=(8.2, 2.6))
    for k in range(value.size):
        axis.errorbar(k + 1, value[k], 2 * std[k], fmt="o", color=BLUE if inside[k] else RED, markersize=3, capsize=2)
    axis.axhline(100 * truth, color=GREY, linestyle="--")
    axis.set(
        xlabel="record",
        ylabel="damping ratio [%]",
        title=f"truth within ± 2 σ: {inside.sum()} of {value.size}",
    )
    return keep("sigma.svg", figure)


def shapes() -> str:
    """The mode shapes of the frame, moving (SVG animation; a still picture where motion is off)."""
    modes = runs.frame()["modes"]
    parts = []
    for place, mode in enumerate(modes):
        x0, shape = 120 + 220 * place, [0.0, *mode["shape_re"]]

        def points(sign: float, x0: int = x0, shape: list[float] = shape) -> str:
            return " ".join(f"{x0 + sign * 45 * s:.1f},{230 - 65 * k}" for k, s in enumerate(shape))

        period = 1.2 if place == 0 else 1.2 * modes[0]["frequency_hz"] / mode["frequency_hz"]
        steps = [points(float(np.cos(2 * np.pi * k / 24))) for k in range(25)]
        parts.append(
            f'<polyline points="{points(0)}" fill="none" stroke="#ced4da" stroke-dasharray="4 3"/>'
            f'<polyline points="{points(1)}" fill="none" stroke="{BLUE}" stroke-width="3" marker-start="url(#m)" '
            f'marker-mid="url(#m)" marker-end="url(#m)"><animate attributeName="points" dur="{2 * period:.2f}s" '
            f'repeatCount="indefinite" values="{";".join(steps)}"/></polyline>'
            f'<text x="{x0}" y="262" text-anchor="middle">{mode["frequency_hz"]:.2f} Hz, '
            f'{100 * mode["damping_ratio"]:.2f} %</text>'
        )
    marker = '<marker id="m" markerWidth="6" markerHeight="6" refX="3" refY="3">'
    marker += f'<circle cx="3" cy="3" r="2" fill="{BLUE}"/></marker>'
    head = '<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 680 280" font-family="sans-serif" font-size="14">'
    (runs.IMAGES / "shapes.svg").write_text(
        f'{head}<rect width="680" height="280" fill="#fff"/><defs>{marker}</defs>{"".join(parts)}</svg>\n'
    )
    return "shapes.svg"


def speed() -> str:
    """Cost of a sample beside other kernels in the same run of `okid bench`."""
    bench = json.loads(runs.okid("bench", "--only", "kernels", "--json"))
    kernels = {
        "direct": "okid",
        "qr": "block QR",
        "lapack_ls": "LAPACK",
        "rls": "recursive least squares",
    }
    cases = {"W1": "1 + 3 channels", "W2": "2 + 6", "W3": "3 + 10"}
    figure, axis = plt.subplots(figsize=(6.4, 2.8))
    for bar, (kernel, label) in enumerate(kernels.items()):
        rows = {
            row["case"]: row["ns_per_sample"] for row in bench["rows"] if row["kernel"] == kernel and row["p"] == 40
        }
        axis.bar(
            np.arange(3) + 0.2 * (bar - 1.5), [rows[case] for case in cases], 0.18,
            color=(BLUE, GREEN, ORANGE, RED)[bar], label=label,
        )  # fmt: skip
    axis.set(yscale="log", ylabel="ns a sample, 40 lags", xticks=range(3))
    axis.set_xticklabels(list(cases.values()))
    axis.legend(frameon=False, fontsize=8, ncol=2, loc="upper left")
    axis.set_ylim(top=axis.get_ylim()[1] * 8)
    return keep("speed.svg", figure)


def latency() -> str:
    """Line to identification, and line to the event with the modes, calm and beside a load: `bench_latency`."""
    file = runs.FOLDER / "latency.json"
    file.write_text('{"rows": [], "ratios": {}}')
    build = Path(runs.OKID).parent
    subprocess.run(["cmake", "--build", build, "--target", "bench_latency", "--", "--quiet"], check=True)
    subprocess.run([build / "tests" / "bench_latency", file], check=True, stdout=subprocess.DEVNULL)
    figure, axes = plt.subplots(1, 2, figsize=(8.2, 2.8), sharex=True, sharey=True)
    titles = {"calm": "calm machine", "busy": "beside two busy processors"}
    rows = [row for row in json.loads(file.read_text())["rows"] if row["case"] in titles]  # of okid-era
    for axis, row in zip(axes, rows, strict=True):
        for name, label, colour in (
            ("bare", "a bare reader", GREY),
            ("handed_over", "sample handed over", BLUE),
            ("modes", "modes reported", ORANGE),
        ):
            begin, count = np.array(row["histograms_ms"][name]).T
            axis.step(begin, 100 * count / count.sum(), where="post", color=colour, label=label)
        axis.set(xscale="log", xlabel="behind the line [ms]", title=titles[row["case"]])
    axes[0].set_ylabel("% of all")
    axes[0].legend(frameon=False, fontsize=8)
    return keep("latency.svg", figure)


def settling() -> str:
    """Damping of the first mode, update by update, with its ± 2 σ, of a replay of the frame."""
    runs.frame()
    text = (runs.FOLDER / "lab.toml").read_text().replace("[identification]", '[identification]\nmethod = "okid-era"')
    (runs.FOLDER / "settling.toml").write_text(text)
    runs.okid("replay", "frame.log", "-c", "settling.toml", "--events", "settling.jsonl", "--json", "settling.json")
    rows = []
    for line in (runs.FOLDER / "settling.jsonl").read_text().splitlines():
        event = json.loads(line)
        if event["type"] == "modes" and event["modes"] and event["modes"][0]["damping_ratio_std"]:
            mode = event["modes"][0]
            if abs(mode["frequency_hz"] - 13.34) < 0.5:
                rows.append((event["t"], 100 * mode["damping_ratio"], 100 * mode["damping_ratio_std"]))
    t, zeta, std = np.array(rows).T
    figure, axis = plt.subplots(figsize=(8.2, 2.6))
    axis.fill_between(t, zeta - 2 * std, zeta + 2 * std, color=BLUE, alpha=0.2, linewidth=0)
    axis.plot(t, zeta, color=BLUE)
    axis.axhline(1.0, color=GREY, linestyle="--")
    axis.set(xlabel="stream time [s]", ylabel="damping, mode 1 [%]", ylim=(0.97, 1.03))
    return keep("settling.svg", figure)


def finite_p() -> str:
    """Bias of damping for few lags: okid-era over p on 20 s with 5 % noise, five records each."""
    lags, rows = (10, 15, 20, 30, 40, 60, 80), []
    records = [record("frame_rig.toml", duration_s="20.0", noise_percent="5.0", seed=str(seed)) for seed in range(1, 6)]
    for p in lags:
        row = []
        for got in records:
            u, y = got.columns(["force1"], "frame"), got.columns(["acc1", "acc2", "acc3"], "frame")
            modes = okid.identify(u, y, fs=got.fs_hz, method="okid-era", p=p, order=6, sigma_blocks=0).to_dict()[
                "modes"
            ]
            row.append(100 * min(modes, key=lambda m: abs(m["frequency_hz"] - 13.34))["damping_ratio"])
        rows.append(row)
    figure, axis = plt.subplots(figsize=(5.2, 2.6))
    for p, row in zip(lags, rows, strict=True):
        axis.plot([p] * len(row), row, "o", color=BLUE, markersize=4, alpha=0.7)
    axis.plot(lags, np.mean(rows, axis=1), color=BLUE)
    axis.axhline(1.0, color=GREY, linestyle="--")
    axis.set(xlabel="lags p", ylabel="damping, mode 1 [%]")
    return keep("finite-p.svg", figure)


def make() -> list[str]:
    return [one() for one in (hits, holds, wrong_hold, sigma, shapes, speed, latency, settling, finite_p)]
