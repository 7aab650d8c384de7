// SPDX-License-Identifier: MIT
// The slower plots of the live page, by plotly.js: frequencies over time, response functions, spectra, stabilization.

export const variable = (name) => getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();
const colours = () => [1, 2, 3, 4, 5, 6, 7, 8].map((k) => variable(`c${k}`));
const KINDS = [["new", "x", "muted", 5], ["f", "circle-open", "muted", 5], ["f, ζ", "circle-open", "warn", 6],
  ["f, shape", "diamond-open", "accent", 6], ["stable", "circle", "good", 6]];

function axis(title, more = {}) {
  return { title: { text: title, standoff: 5, font: { size: 12 } }, gridcolor: variable("grid"), zerolinecolor: variable("grid"), linecolor: variable("line"),
    tickcolor: variable("line"), automargin: true, ...more };
}

function layout(more) {
  return { paper_bgcolor: "rgba(0,0,0,0)", plot_bgcolor: "rgba(0,0,0,0)", margin: { l: 58, r: 8, t: 22, b: 36 }, uirevision: "keep",
    font: { family: "system-ui, sans-serif", size: 12, color: variable("ink") }, hovermode: "closest", showlegend: true,
    hoverlabel: { bgcolor: variable("panel"), font: { color: variable("ink") } },
    legend: { orientation: "h", x: 0, y: 1.0, xanchor: "left", yanchor: "bottom", font: { size: 11 }, entrywidthmode: "pixels", borderwidth: 0 }, ...more };
}

// A logarithmic axis over these curves: whole decades only where there are enough of them.
function logarithmic(title, curves, more = {}) {
  let low = Infinity, high = 0;
  for (const curve of curves) {
    for (const value of curve) {
      if (value > 0 && value < low) low = value;
      if (value > high) high = value;
    }
  }
  const decades = high > low ? Math.log10(high / low) : 0;
  const ticks = decades > 1.5 ? { dtick: Math.ceil(decades / 6) } : {};
  return axis(title, { type: "log", exponentformat: "power", tickfont: { size: 11 }, ...ticks, ...more });
}

function transparent(colour, share) {
  const value = parseInt(colour.slice(1), 16);
  return `rgba(${value >> 16},${(value >> 8) & 255},${value & 255},${share})`;
}

// Plotly reads a few tags in names: what comes from okid must stay as it is.
export const plain = (text) => String(text).replace(/&/g, "&amp;").replace(/</g, "&lt;").replace(/>/g, "&gt;");
// m/s^2 as it is printed
export const printed = (unit) => plain(unit).replace(/\^2/g, "²").replace(/\^3/g, "³");
const cut = (text, most = 22) => (text.length > most ? `${text.slice(0, most - 1)}…` : text);

// A picture or canvas as PNG, twice as fine, on the colour of the panel.
export function saveCanvas(picture, width, height, name) {
  const sheet = Object.assign(document.createElement("canvas"), { width: 2 * width, height: 2 * height }), pen = sheet.getContext("2d");
  pen.fillStyle = variable("panel");
  pen.fillRect(0, 0, sheet.width, sheet.height);
  pen.drawImage(picture, 0, 0, sheet.width, sheet.height);
  sheet.toBlob((blob) => window.okidSelection.save(name, "image/png", blob));
}

// One panel's plot: drawn once wherever it stands, then when it is on the screen, at most once a second, and again when the
// colours change.
export class Plot {
  constructor(panel, make) {
    this.panel = document.getElementById(panel);
    this.box = this.panel.querySelector(".plot");
    this.text = this.panel.querySelector(".absent");
    this.make = make;
    this.draws = 0;
    this.last = 0;
    this.visible = false;
    this.offer();
    new IntersectionObserver((entries) => {
      this.visible = entries[entries.length - 1].isIntersecting;
      if (this.visible && this.stale) this.want();
    }, { rootMargin: "120px" }).observe(this.panel);
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.want());
  }

  // Buttons that save the picture as it is shown.
  offer() {
    const head = this.panel.querySelector(".head"), tools = head.querySelector(".tools") || head.appendChild(document.createElement("div"));
    tools.classList.add("tools");
    for (const kind of ["svg", "png"]) {
      const button = document.createElement("button");
      Object.assign(button, { type: "button", textContent: kind.toUpperCase() });
      button.dataset.picture = kind;
      button.className = "save";
      button.addEventListener("click", () => this.save(kind));
      tools.append(button);
    }
  }

  async save(kind) {
    if (this.box.hidden || !this.draws) return;
    const width = this.box.clientWidth, height = this.box.clientHeight, name = `${this.panel.id}.${kind}`;
    const drawn = await window.Plotly.toImage(this.box, { format: "svg", width, height, imageDataOnly: true });
    const text = drawn.replace(/<svg[^>]*>/, (head) => `${head}<rect width="100%" height="100%" fill="${variable("panel")}"/>`);
    if (kind === "svg") return void window.okidSelection.save(name, "image/svg+xml", text);
    const picture = new Image(width, height);
    picture.src = `data:image/svg+xml,${encodeURIComponent(text)}`;
    await picture.decode();
    saveCanvas(picture, width, height, name);
  }

  // Why there is no plot; "" = there is one.
  absent(text) {
    this.text.textContent = text;
    this.box.hidden = text !== "";
  }

  want() {
    this.stale = true;
    if ((!this.visible && this.draws > 0) || this.waiting || document.hidden) return;
    this.waiting = setTimeout(() => {
      this.waiting = null;
      this.last = performance.now();
      this.draw();
    }, Math.max(0, 1000 - (performance.now() - this.last)));
  }

  draw() {
    this.stale = false;
    const made = this.make();
    if (typeof made === "string") return void this.absent(made);
    if (!window.Plotly) return void this.absent("plotly.js could not be loaded");
    this.absent("");
    this.draws += 1;
    window.Plotly.react(this.box, made.data, made.layout, { displayModeBar: false, responsive: true, doubleClick: "reset" });
  }
}

const MARKS = { alarm: ["bad", "alarm"], alarm_over: ["good", "alarm over"], change: ["warn", "change"], change_test: ["bad", "changed (test)"], trigger: ["muted", "trigger"] };

function marks(list) {
  const newest = list.slice(-40);
  const shapes = newest.map((mark) => ({ type: "line", x0: mark.t, x1: mark.t, yref: "paper", y0: 0, y1: 1,
    line: { color: variable(MARKS[mark.kind][0]), width: 1.3, dash: "dot" } }));
  const seen = [...new Set(newest.map((mark) => mark.kind))];
  const legend = seen.map((kind) => ({ x: [null], y: [null], mode: "lines", name: MARKS[kind][1], hoverinfo: "skip",
    line: { color: variable(MARKS[kind][0]), width: 1.3, dash: "dot" } }));
  return { shapes, legend };
}

function median(values) {
  const sorted = values.slice().sort((a, b) => a - b);
  return sorted[Math.floor(sorted.length / 2)];
}

// One track as value and deviation at every update.
function trackLines(updates) {
  const lines = new Map();
  for (const update of updates) {
    for (const [track, f, df, z, dz] of update.modes) {
      if (!lines.has(track)) lines.set(track, { t: [], f: [], df: [], z: [], dz: [], rest: [] });
      const line = lines.get(track);
      line.t.push(update.t);
      line.f.push(f);
      line.df.push(df);
      line.z.push(z);
      line.dz.push(dz);
      line.rest.push(update.settled);
    }
  }
  return lines;
}

// at: a time that is looked at, null = the newest
export function tracking(updates, list, kind, at) {
  const lines = trackLines(updates);
  if (!lines.size) return "no mode has been followed yet";
  const palette = colours(), data = [];
  let low = Infinity, high = -Infinity;
  [...lines.entries()].sort((a, b) => a[0] - b[0]).slice(0, 24).forEach(([track, line], index) => {
    const value = kind === "damping" ? line.z : line.f, sigma = kind === "damping" ? line.dz : line.df;
    const quiet = line.f.filter((_, k) => line.rest[k]), base = median((quiet.length ? quiet : line.f).slice(0, 10));
    const shown = (v) => (kind === "change" ? 100 * (v / base - 1) : kind === "damping" ? 100 * v : v);
    const width = (s) => (kind === "change" ? (100 * s) / base : kind === "damping" ? 100 * s : s) || 0;
    const y = value.map(shown), band = sigma.map(width), colour = palette[index % palette.length];
    const somebodyRests = line.rest.some(Boolean);
    y.forEach((v, k) => {
      if (somebodyRests && !line.rest[k]) return;
      low = Math.min(low, v - band[k]);
      high = Math.max(high, v + band[k]);
    });
    data.push({ x: [...line.t, ...line.t.slice().reverse()], y: [...y.map((v, k) => v + band[k]), ...y.map((v, k) => v - band[k]).reverse()],
      fill: "toself", fillcolor: transparent(colour, 0.18), line: { width: 0 }, hoverinfo: "skip", showlegend: false, mode: "lines", legendgroup: String(track) });
    const now = line.f[line.f.length - 1].toPrecision(4);
    data.push({ x: line.t, y, customdata: line.f.map((f, k) => [f, line.z[k] * 100]), name: `${track}: ${now} Hz`, mode: line.t.length > 80 ? "lines" : "lines+markers", legendgroup: String(track),
      line: { color: colour, width: 1.6 }, marker: { size: 4 },
      hovertemplate: "t %{x:.1f} s<br>f %{customdata[0]:.6g} Hz<br>ζ %{customdata[1]:.4g} %<extra></extra>" });
  });
  const { shapes, legend } = marks(list), room = 0.08 * (high - low || Math.abs(high) || 1);
  if (at !== null) shapes.push({ type: "line", x0: at, x1: at, yref: "paper", y0: 0, y1: 1, line: { color: variable("ink"), width: 1.5 } });
  const title = { change: "change of f [%]", hz: "f [Hz]", damping: "ζ [%]" }[kind];
  const more = Number.isFinite(low) ? { range: [low - room, high + room] } : {};
  return { data: [...data, ...legend], layout: layout({ xaxis: axis("stream time t [s]"), yaxis: axis(title, more), shapes, uirevision: kind }) };
}

export function frf(found, units) {
  if (!found || !found.response) return null;
  const { frequency, response, top } = found, accent = variable("accent"), model = variable("c2");
  const x = frequency.subarray(1), tail = (values) => values.subarray(1);
  const line = (y, name, colour, yaxis, more = {}) => ({ x, y: tail(y), name, mode: "lines", line: { color: colour, width: 1.3 }, yaxis, ...more });
  const data = [line(response.magnitude, "measured (H1)", accent, "y3"), line(response.phase, "phase", accent, "y2", { showlegend: false })];
  if (response.averages > 1) data.push(line(response.coherence, "coherence", variable("c3"), "y"));
  if (response.model) data.push(line(response.model, "model", model, "y3"), line(response.model_phase, "", model, "y2", { showlegend: false }));
  return { data, layout: layout({
    xaxis: axis("frequency [Hz]", { range: [0, top], anchor: "y" }),
    yaxis: axis("coh.", { domain: [0, 0.14], range: [0, 1.05], tickvals: [0, 1] }),
    yaxis2: axis("phase [°]", { domain: [0.22, 0.42], range: [-190, 190], tickvals: [-180, 0, 180] }),
    yaxis3: logarithmic(`|H| [${printed(units)}]`, [tail(response.magnitude)], { domain: [0.47, 1] }),
    uirevision: `${response.output}/${response.input}` }) };
}

export function spectra(found, channels, hammer) {
  const palette = colours(), x = found.frequency.subarray(1);
  const data = found.spectra.map((values, k) => {
    const channel = channels[found.channels[k]];
    return { x, y: values.subarray(1), name: plain(cut(channel.name)) + (channel.unit ? ` [${printed(channel.unit)}]` : ""), mode: "lines",
      line: { color: palette[k % palette.length], width: 1.2 } };
  });
  return { data, layout: layout({ xaxis: axis("frequency [Hz]", { range: [0, found.top] }),
    yaxis: logarithmic(hammer ? "mean |X|² of the hits [unit²/Hz]" : "power density [unit²/Hz]", data.map((one) => one.y)) }) };
}

export function diagram(found, top) {
  if (found.text) return `no diagram: ${found.text}`;
  const data = KINDS.map(([name, symbol, colour, size], kind) => {
    const own = found.poles.filter((pole) => pole[3] === kind && pole[0] <= top);
    return { x: own.map((pole) => pole[0]), y: own.map((pole) => pole[1]), customdata: own.map((pole) => 100 * pole[2]), name, mode: "markers",
      marker: { symbol, color: variable(colour), size }, hovertemplate: "%{x:.4f} Hz<br>order %{y}<br>ζ %{customdata:.3g} %<extra></extra>" };
  }).filter((one) => one.x.length);
  const shapes = found.modes.filter((mode) => mode[0] <= top).map((mode) => ({ type: "line", x0: mode[0], x1: mode[0], yref: "paper", y0: 0, y1: 1,
    line: { color: variable("good"), width: 1 }, opacity: 0.5, layer: "below" }));
  return { data, layout: layout({ xaxis: axis("frequency [Hz]", { range: [0, top] }), yaxis: axis("model order", { rangemode: "tozero" }), shapes }) };
}
