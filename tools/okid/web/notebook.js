// SPDX-License-Identifier: MIT
// PURPOSE  the picture of okid.notebook.LiveView: lanes, table of modes, moving shape, stabilization diagram to pick from
// METHOD   an ESM of anywidget; every part is drawn again when its trait changes; all text goes in as text
const COLOURS = { line: "#1f5fa8", pole: "#2a8c4a", weak: "#8b959f", picked: "#b8292f", text: "#56616c" };

function part(tag, parent, text, look) {
  const one = document.createElement(tag);
  if (text !== undefined) one.textContent = text;
  Object.assign(one.style, look || {});
  parent.appendChild(one);
  return one;
}

function canvas(parent, name, width, height) {
  const one = part("canvas", parent, undefined, { maxWidth: "100%", display: "block" });
  one.className = name;
  one.width = width;
  one.height = height;
  return one;
}

function drawSignals(target, signals) {
  const pen = target.getContext("2d"), lanes = signals.lanes || [], names = signals.names || [];
  target.height = Math.max(40, 46 * lanes.length + 16);
  pen.clearRect(0, 0, target.width, target.height);
  lanes.forEach((lane, k) => {
    const known = lane.flat().filter((v) => v !== null);
    const low = Math.min(...known), high = Math.max(...known), top = 46 * k + 4, reach = high - low || 1;
    const y = (v) => top + 38 - (36 * (v - low)) / reach, step = (target.width - 90) / Math.max(1, lane.length);
    pen.strokeStyle = COLOURS.line;
    pen.beginPath();
    lane.forEach(([least, most], i) => {
      if (least === null) return;
      pen.moveTo(90 + i * step, y(most) - 0.5);
      pen.lineTo(90 + i * step, y(least) + 0.5);
    });
    pen.stroke();
    pen.fillStyle = COLOURS.text;
    pen.font = "11px sans-serif";
    pen.fillText(String(names[k]).slice(0, 14), 2, top + 22);
  });
  pen.fillText(`${signals.from_s ?? 0} s`, 90, target.height - 3);
  pen.fillText(`${signals.to_s ?? 0} s`, target.width - 50, target.height - 3);
}

function drawTable(target, modes, chosen, choose) {
  target.replaceChildren();
  const head = part("tr", target);
  for (const word of ["mode", "f [Hz]", "± [Hz]", "ζ [%]", "± [%]", "MPC"]) part("th", head, word);
  const shown = (value, factor, digits) => (value === null ? "–" : (factor * value).toPrecision(digits));
  modes.forEach((mode, k) => {
    const row = part("tr", target, undefined, { cursor: "pointer", fontWeight: k === chosen ? "bold" : "normal" });
    row.addEventListener("click", () => choose(k));
    const cells = [String(k + 1), shown(mode.frequency_hz, 1, 6), shown(mode.frequency_std_hz, 1, 2),
                   shown(mode.damping_ratio, 100, 4), shown(mode.damping_ratio_std, 100, 2), shown(mode.mpc, 1, 3)];
    for (const text of cells) part("td", row, text, { textAlign: "right", padding: "1px 8px" });
  });
}

function drawShape(target, mode, phase) {
  const pen = target.getContext("2d"), middle = target.height / 2, count = mode ? mode.re.length : 0;
  pen.clearRect(0, 0, target.width, target.height);
  if (!count) return;
  const x = (k) => (target.width * (k + 1)) / (count + 1);
  const y = (k) => middle - 0.42 * target.height * (mode.re[k] * Math.cos(phase) - mode.im[k] * Math.sin(phase));
  pen.strokeStyle = "#c3ccd6";
  pen.beginPath();
  pen.moveTo(0, middle);
  pen.lineTo(target.width, middle);
  pen.stroke();
  pen.strokeStyle = pen.fillStyle = COLOURS.line;
  pen.beginPath();
  for (let k = 0; k < count; ++k) k ? pen.lineTo(x(k), y(k)) : pen.moveTo(x(k), y(k));
  pen.stroke();
  for (let k = 0; k < count; ++k) pen.fillRect(x(k) - 3, y(k) - 3, 6, 6);
}

/// Places of the poles on the canvas, as drawn: what is clicked on is looked for among them.
function drawDiagram(target, poles, picked) {
  const pen = target.getContext("2d");
  pen.clearRect(0, 0, target.width, target.height);
  const far = Math.max(...poles.map((one) => one.f), 1e-9) * 1.03, tall = Math.max(...poles.map((one) => one.order), 1) + 1;
  const places = poles.map((one) => ({ ...one, x: 30 + ((target.width - 40) * one.f) / far,
                                       y: target.height - 20 - ((target.height - 30) * one.order) / tall }));
  for (const one of places) {
    const chosen = picked.some((other) => other.f === one.f && other.order === one.order);
    pen.fillStyle = chosen ? COLOURS.picked : one.stable ? COLOURS.pole : COLOURS.weak;
    pen.beginPath();
    pen.arc(one.x, one.y, chosen ? 5 : 3, 0, 2 * Math.PI);
    pen.fill();
  }
  pen.fillStyle = COLOURS.text;
  pen.font = "11px sans-serif";
  if (poles.length) pen.fillText(`0 to ${far.toPrecision(3)} Hz; click on poles to pick them`, 30, target.height - 4);
  return places;
}

function render({ model, el }) {
  const status = part("div", el, "", { color: COLOURS.text, fontSize: "12px" });
  const signals = canvas(el, "okid-signals", 700, 60);
  const row = part("div", el, undefined, { display: "flex", gap: "1em", flexWrap: "wrap" });
  const table = part("table", row), shape = canvas(row, "okid-shape", 260, 150), diagram = canvas(el, "okid-poles", 700, 220);
  let chosen = 0, places = [], frame = 0;
  const show = {
    status: () => (status.textContent = model.get("status")),
    signals: () => drawSignals(signals, model.get("signals")),
    modes: () => drawTable(table, model.get("modes"), chosen, (k) => ((chosen = k), show.modes())),
    poles: () => {
      diagram.style.display = model.get("poles").length ? "block" : "none";
      places = drawDiagram(diagram, model.get("poles"), model.get("picked"));
    },
  };
  diagram.addEventListener("click", (event) => {
    const box = diagram.getBoundingClientRect(), scale = diagram.width / box.width;
    const x = (event.clientX - box.left) * scale, y = (event.clientY - box.top) * scale;
    const near = places.map((one) => [Math.hypot(one.x - x, one.y - y), one]).sort((a, b) => a[0] - b[0])[0];
    if (!near || near[0] > 10) return;
    const one = { f: near[1].f, z: near[1].z, order: near[1].order };
    const others = model.get("picked").filter((other) => other.f !== one.f || other.order !== one.order);
    model.set("picked", others.length < model.get("picked").length ? others : [...others, one]);
    model.save_changes();
  });
  for (const name of Object.keys(show)) model.on(`change:${name}`, show[name]);
  model.on("change:picked", show.poles);
  Object.values(show).forEach((draw) => draw());
  const move = (now) => {
    drawShape(shape, model.get("modes")[chosen], now / 200);
    frame = requestAnimationFrame(move);
  };
  frame = requestAnimationFrame(move);
  return () => cancelAnimationFrame(frame);
}

export default { render };
