// SPDX-License-Identifier: MIT
// The poles of all runs on a canvas: hover tells one, a click picks or drops it, a drag looks into a band; picks are saved.
"use strict";

(function () {
  const holder = document.getElementById("poles-data"), box = document.querySelector(".picker");
  if (!holder || !box) return;
  const { runs, poles, modes, command } = JSON.parse(holder.textContent);
  const part = (name) => box.querySelector("." + name);
  const canvas = part("poles"), reach = 9, edge = { left: 44, right: 12, top: 10, bottom: 34 };
  const f = poles.frequency_hz, most = Math.max(...poles.order, 1), top = 1.02 * f.reduce((a, b) => Math.max(a, b), 1e-9);
  let band = [0, top], shown = -1, hovered = -1, drag = null;
  const past = [[]], ahead = []; // of lists of picks; the last one is shown
  const picks = () => past[past.length - 1];

  function change(list) {
    past.push([...list].sort((a, b) => a.frequency_hz - b.frequency_hz));
    ahead.length = 0;
    draw();
  }
  const same = (a, b) => Math.abs(a.frequency_hz / b.frequency_hz - 1) < 1e-6;
  function toggle(pick) {
    const kept = picks().filter((one) => !same(one, pick));
    change(kept.length < picks().length ? kept : [...kept, pick]);
  }
  // A pole of a mode stands for that mode, with what all runs say of it.
  function pickOf(k) {
    const mode = modes[poles.mode[k] - 1];
    return mode ? { frequency_hz: mode.frequency_hz, damping_ratio: mode.damping_ratio }
                : { frequency_hz: f[k], damping_ratio: poles.damping_ratio[k] };
  }

  const size = () => ({ w: canvas.clientWidth, h: canvas.clientHeight });
  const x = (hz, w) => edge.left + ((hz - band[0]) / (band[1] - band[0])) * (w - edge.left - edge.right);
  const hzAt = (px, w) => band[0] + ((px - edge.left) / (w - edge.left - edge.right)) * (band[1] - band[0]);
  const y = (order, h) => h - edge.bottom - (order / most) * (h - edge.top - edge.bottom);
  const visible = (k) => (shown < 0 || poles.run[k] === shown) && f[k] >= band[0] && f[k] <= band[1];

  function axis(pen, w, h, ink, grid) {
    pen.font = "12px system-ui, sans-serif";
    const span = band[1] - band[0], step = [1, 2, 5, 10].map((s) => s * 10 ** Math.floor(Math.log10(span / 8)))
      .find((s) => span / s <= 9);
    pen.textAlign = "center";
    for (let hz = Math.ceil(band[0] / step) * step; hz <= band[1]; hz += step) {
      pen.fillStyle = grid;
      pen.fillRect(x(hz, w), edge.top, 1, h - edge.top - edge.bottom);
      pen.fillStyle = ink;
      pen.fillText(String(Number(hz.toPrecision(8))), x(hz, w), h - edge.bottom + 15);
    }
    pen.fillText("frequency in Hz", (edge.left + w) / 2, h - 4);
    pen.textAlign = "right";
    for (let order = 0; order <= most; order += most > 40 ? 20 : 5) pen.fillText(String(order), edge.left - 6, y(order, h) + 4);
  }

  function draw() {
    const { w, h } = size(), scale = window.devicePixelRatio || 1, style = getComputedStyle(document.documentElement);
    const colour = (name) => style.getPropertyValue("--" + name).trim() || "#888";
    canvas.width = w * scale;
    canvas.height = h * scale;
    const pen = canvas.getContext("2d");
    pen.scale(scale, scale);
    axis(pen, w, h, colour("muted"), colour("grid"));
    for (const known of [false, true]) {
      pen.fillStyle = colour(known ? "blue" : "faint");
      for (let k = 0; k < f.length; ++k)
        if (poles.mode[k] > 0 === known && visible(k)) pen.fillRect(x(f[k], w) - 1.5, y(poles.order[k], h) - 1.5, 3, 3);
    }
    const line = (hz, name, dash) => {
      if (hz < band[0] || hz > band[1]) return;
      pen.strokeStyle = colour(name);
      pen.setLineDash(dash);
      pen.beginPath();
      pen.moveTo(x(hz, w), edge.top);
      pen.lineTo(x(hz, w), h - edge.bottom);
      pen.stroke();
    };
    modes.filter((mode) => mode.confident).forEach((mode) => line(mode.frequency_hz, "grey", [4, 4]));
    pen.lineWidth = 2;
    picks().forEach((pick) => line(pick.frequency_hz, "orange", []));
    if (hovered >= 0) {
      pen.strokeStyle = colour("red");
      pen.setLineDash([]);
      pen.beginPath();
      pen.arc(x(f[hovered], w), y(poles.order[hovered], h), 5, 0, 7);
      pen.stroke();
    }
    if (drag && Math.abs(drag.to - drag.from) > 4) {
      pen.fillStyle = colour("blue") + "33";
      pen.fillRect(Math.min(drag.from, drag.to), edge.top, Math.abs(drag.to - drag.from), h - edge.top - edge.bottom);
    }
    list();
  }

  function list() {
    const rows = picks().map((pick) => {
      const row = document.createElement("li"), drop = document.createElement("button");
      row.textContent = `${Number(pick.frequency_hz.toPrecision(7))} Hz` +
        (pick.damping_ratio > 0 ? `, ζ ${(100 * pick.damping_ratio).toFixed(3)} % ` : " ");
      drop.type = "button";
      drop.textContent = "drop";
      drop.setAttribute("aria-label", "drop " + row.textContent);
      drop.addEventListener("click", () => toggle(pick));
      row.append(drop);
      return row;
    });
    part("picked").replaceChildren(...rows);
    part("undo").disabled = past.length < 2;
    part("redo").disabled = !ahead.length;
    part("keep").disabled = !picks().length;
    part("command").textContent = picks().length ? command : "";
  }

  function nearest(event) {
    const { w, h } = size(), place = canvas.getBoundingClientRect();
    let best = -1, least = reach ** 2;
    for (let k = 0; k < f.length; ++k) {
      if (!visible(k)) continue;
      const away = (x(f[k], w) - event.clientX + place.left) ** 2 + (y(poles.order[k], h) - event.clientY + place.top) ** 2;
      if (away < least) [least, best] = [away, k];
    }
    return best;
  }

  function textOf(k) {
    if (k < 0) return "";
    const run = runs[poles.run[k]], mode = modes[poles.mode[k] - 1];
    const std = mode && mode.frequency_std_hz ? ` (mode ${poles.mode[k]}: ${Number(mode.frequency_hz.toPrecision(7))} ± ` +
      `${mode.frequency_std_hz.toPrecision(2)} Hz)` : mode ? ` (mode ${poles.mode[k]})` : "";
    return `${f[k]} Hz, ζ ${(100 * poles.damping_ratio[k]).toFixed(3)} %, MPC ${poles.mpc[k].toFixed(3)}, order ` +
      `${poles.order[k]}, ${run.method}, ${run.rows} samples at ${Number(run.fs_hz.toPrecision(6))} Hz${std}`;
  }

  const from = (event) => event.clientX - canvas.getBoundingClientRect().left;
  canvas.addEventListener("pointerdown", (event) => {
    drag = { from: from(event), to: from(event) };
    canvas.setPointerCapture(event.pointerId);
  });
  canvas.addEventListener("pointermove", (event) => {
    if (drag) drag.to = from(event);
    hovered = drag ? -1 : nearest(event);
    part("hover").textContent = textOf(hovered);
    draw();
  });
  canvas.addEventListener("pointerup", (event) => {
    const { w } = size(), one = drag;
    drag = null;
    if (one && Math.abs(one.to - one.from) > 4) {
      const ends = [hzAt(one.from, w), hzAt(one.to, w)].sort((a, b) => a - b);
      band = [Math.max(0, ends[0]), Math.min(top, ends[1])];
      draw();
      return;
    }
    const k = nearest(event);
    if (k >= 0) toggle(pickOf(k));
    else draw();
  });
  part("whole").addEventListener("click", () => (band = [0, top], draw()));
  part("undo").addEventListener("click", () => (ahead.push(past.pop()), draw()));
  part("redo").addEventListener("click", () => (past.push(ahead.pop()), draw()));
  part("propose").addEventListener("click", () => change(modes.filter((mode) => mode.confident)
    .map((mode) => ({ frequency_hz: mode.frequency_hz, damping_ratio: mode.damping_ratio }))));
  part("hz").addEventListener("change", (event) => {
    if (event.target.value > 0) toggle({ frequency_hz: Number(event.target.value) });
    event.target.value = "";
  });
  part("keep").addEventListener("click", () => okidSelection.save("picks.json", "application/json",
    JSON.stringify({ modes: picks() }, null, 1) + "\n"));
  const choice = part("runs");
  choice.append(new Option("all", "-1"), ...runs.map((run, k) =>
    new Option(`${run.method}, ${run.rows} samples at ${Number(run.fs_hz.toPrecision(6))} Hz`, String(k))));
  choice.addEventListener("change", () => (shown = Number(choice.value), draw()));
  window.addEventListener("resize", draw);
  draw();
})();
