// SPDX-License-Identifier: MIT
// The page: what okid-live sends goes to lanes, plots, tables and the picture of the shape. What it asks for is in start.js.

import { Lanes, numbers } from "./lanes.js";
import { Plot, diagram, frf, saveCanvas, spectra, tracking } from "./plots.js";
import { offerEnd, offerGeometry, offerReport, offerStart } from "./start.js";
import { Log, pickedModes, showHits, showModes, showResult, showStats } from "./tables.js";

const by = (id) => document.getElementById(id);
const MOST_SPECTRA = 8, MOST_UPDATES = 1000;
const page = { run: null, facts: null, state: null, modes: null, result: null, diagram: null, spectra: null, generation: 0, updates: [], at: null, then: null };
const lanes = new Lanes(by("lanes")), log = new Log(by("log"));
let shape = null;

const plots = {
  tracking: new Plot("tracking", () => tracking(page.updates, page.state.marks, by("tracking-kind").value, page.at)),
  frf: new Plot("frf", makeFrf),
  spectra: new Plot("spectra", makeSpectra),
  diagram: new Plot("diagram", () => (page.diagram ? diagram(page.diagram, topFrequency()) : waiting())),
};

// What modes and shapes are shown of: at a time in the past of the update then, else of the result, else of the newest update.
const inPast = () => page.at !== null && page.updates.length > 0;
const shownModes = () => (inPast() ? page.then : page.result || page.modes);
const inputs = () => page.facts.channels.filter((one) => one.role === "force");
const outputs = () => page.facts.channels.filter((one) => one.role !== "force" && one.role !== "aux");

function waiting() {
  if (!page.state || page.state.samples === "off") return page.facts ? page.facts.absent : "";
  return page.facts.hammer ? "waiting for a hit" : "waiting for samples";
}

// Upper end of the frequency axes: Nyquist, or well above the highest mode.
function topFrequency() {
  const nyquist = (page.facts.rate_hz || 2) / 2, source = page.result || page.modes;
  const highest = Math.max(0, ...(source ? source.modes.map((mode) => mode.frequency_hz) : []));
  return highest > 0 ? Math.min(nyquist, 2 * highest) : nyquist;
}

function makeFrf() {
  if (page.facts.channels.length && (!inputs().length || !outputs().length)) return "no response function without a force and a response";
  const made = page.spectra && frf(page.spectra, units());
  return made || waiting();
}

function makeSpectra() {
  const found = page.spectra;
  return found && found.channels.length && found.averages ? spectra(found, page.facts.channels, page.facts.hammer) : waiting();
}

function units() {
  const y = outputs()[by("frf-output").selectedIndex], u = inputs()[by("frf-input").selectedIndex];
  return y && u ? `(${y.unit || "–"})/${u.unit || "–"}` : "";
}

// -- what comes -------------------------------------------------------------------------------------------------------

function showHello(hello) {
  const other = hello.run !== page.run;
  Object.assign(page, { run: hello.run, facts: hello.facts, result: hello.result, diagram: hello.diagram, modes: hello.modes });
  showState(hello.state);
  if (other) begin();
  page.generation = -1;
  takeTracks(hello.tracks);
  takeModes(hello.modes);
  if (hello.stats) showStats(hello.stats);
  takeLog(hello.log);
  takeHits(hello.hits);
  takeResult(hello.result);
  plots.diagram.want();
  showDiagramNote();
  fetchSpectra();
}

function begin() {
  const { facts, state } = page, measured = state.measured;
  Object.assign(page, { spectra: null, updates: [], at: null, then: null });
  offerStart(facts.start);
  document.body.classList.toggle("empty", facts.start && !facts.channels.length);
  document.title = facts.title ? `${facts.title} – okid live` : "okid live";
  by("title").textContent = facts.title || "okid live";
  by("facts").textContent = !facts.channels.length ? facts.config : [facts.config, facts.rate_hz ? `${facts.rate_hz} Hz` : "",
    `${facts.channels.length} channels`, facts.method, facts.window_s ? `window ${facts.window_s} s` : facts.forgetting ? `forgetting ${facts.forgetting}` : "all samples"].filter(Boolean).join(" · ");
  lanes.reset(facts.channels, measured ? measured.columns : 1, measured ? measured.column_s : 1);
  lanes.rate = facts.rate_hz;
  log.reset();
  showHits([]);
  by("hammer").hidden = !facts.hammer;
  for (const id of ["bus-table", "channel-table"]) by(id).replaceChildren();
  document.querySelector("#health .absent").textContent = "no counts yet";
  by("health-note").textContent = "";
  choices();
  options(by("frf-output"), outputs().map((one) => one.name));
  options(by("frf-input"), inputs().map((one) => one.name));
  for (const plot of Object.values(plots)) plot.want();
}

function showState(state) {
  page.state = state;
  const badge = by("link"), kind = { live: "good", ended: "", waiting: "warn", working: "warn", failed: "bad" }[state.link];
  badge.textContent = state.text;
  badge.className = `badge ${kind}`;
  offerEnd(page.facts.start && state.link === "live"); // only a run that was begun here is live on a start page
  showMoment();
  by("alarm").hidden = !state.alarm;
  const off = state.samples !== "live" && !(state.measured && lanes.end > 0);
  by("lanes").hidden = off;
  const text = document.querySelector("#signals .absent");
  text.hidden = !off;
  text.textContent = state.samples === "off" ? page.facts.absent : "waiting for samples";
  if (!plots.tracking.stale) markTracks();
}

let markedBefore = 0;
function markTracks() {
  if (page.state.marks.length !== markedBefore) plots.tracking.want();
  markedBefore = page.state.marks.length;
}

function takeModes(event) {
  page.modes = event;
  showModes(inPast() ? page.then : event, inPast() ? null : page.result);
  const badge = by("settled");
  badge.hidden = !event || Boolean(page.result);
  if (event) {
    badge.textContent = event.settled ? "settled" : "settling";
    badge.className = `badge ${event.settled ? "good" : "warn"}`;
  }
  showShapes();
}

function takeTracks(tracks) {
  if (tracks.generation !== page.generation) page.updates = [];
  page.generation = tracks.generation;
  const last = page.updates.length ? page.updates[page.updates.length - 1].n : 0;
  page.updates.push(...tracks.updates.filter((update) => update.n > last));
  page.updates.splice(0, page.updates.length - MOST_UPDATES);
  plots.tracking.want();
}

function takeLog({ entries }) {
  for (const entry of log.add(entries)) if (entry.type === "gap") lanes.gap(entry.channel, entry.first, entry.last);
}

function takeHits(hits) {
  if (page.facts.hammer || hits.length) {
    by("hammer").hidden = false;
    showHits(hits);
  }
}

function takeResult(result) {
  page.result = result;
  by("result").hidden = !result;
  offerReport(result);
  offerGeometry(result && page.facts.finished);
  if (!result) return;
  showResult(result);
  takeModes(page.modes);
  fetchSpectra();
}

function showDiagramNote() {
  const found = page.diagram;
  const what = found && (page.facts.hammer ? `${found.stretches} hits` : `last ${found.seconds && found.seconds.toFixed(1)} s`);
  const lines = found && !found.text ? found.modes.filter((mode) => mode[0] <= topFrequency()).length : 0;
  by("diagram-note").textContent = found && !found.text ? `${what}, p = ${found.p}, ${lines} mode${lines === 1 ? "" : "s"} hold${lines === 1 ? "s" : ""}` : "";
}

// -- spectra are fetched for the channels this page shows ---------------------------------------------------------------

let fetching = false, again = false;
async function fetchSpectra() {
  if (!page.facts || !page.facts.channels.length || document.hidden) return;
  if (fetching) return void (again = true);
  fetching = true;
  const channels = lanes.shown.slice(0, MOST_SPECTRA).join(",");
  try {
    const reply = await fetch(`spectra?channels=${channels}&output=${Math.max(0, by("frf-output").selectedIndex)}&input=${Math.max(0, by("frf-input").selectedIndex)}`);
    if (reply.ok) takeSpectra(await reply.json());
  } catch {
    // the server has gone: the badge says it
  }
  fetching = false;
  if (again) {
    again = false;
    fetchSpectra();
  }
}

function takeSpectra(found) {
  if (found.text) return;
  found.top = topFrequency();
  found.frequency = numbers(found.frequency);
  found.spectra = found.spectra.map((one) => numbers(one));
  for (const key of ["magnitude", "phase", "coherence", "model", "model_phase"]) {
    if (found.response && found.response[key]) found.response[key] = numbers(found.response[key]);
  }
  page.spectra = found;
  const more = lanes.shown.length > MOST_SPECTRA ? `, first ${MOST_SPECTRA} chosen channels` : "";
  const what = page.facts.hammer ? "hits" : "averages";
  const number = found.most && found.averages > found.most ? `newest ${found.most}` : found.averages;
  by("spectra-note").textContent = `${number} ${what} of ${found.segment_s.toPrecision(3)} s, ${found.resolution_hz.toPrecision(3)} Hz a line${more}`;
  plots.spectra.want();
  plots.frf.want();
}

// -- a time in the past -------------------------------------------------------------------------------------------------

// The slider: signals, modes and shape at another time than the newest.
function showMoment() {
  const slider = by("when"), end = page.state.t, at = page.at;
  by("moment").hidden = !(end > 0 && (lanes.end > 0 || page.updates.length > 1));
  slider.max = end.toFixed(2);
  if (at === null) slider.value = slider.max;
  by("clock").textContent = `t = ${(at === null ? end : at).toFixed(1)} s`;
  by("newest").hidden = at === null;
}

let newestWish = 0;
async function goTo(t) {
  const own = ++newestWish;
  page.at = t;
  lanes.goTo(t);
  by("lanes-pause").setAttribute("aria-pressed", String(lanes.held));
  showMoment();
  if (inPast()) {
    const reply = await fetch(`modes?t=${t}`).catch(() => null);
    if (own !== newestWish || !reply || !reply.ok) return;
    page.then = await reply.json();
  }
  plots.tracking.want();
  takeModes(page.modes);
}
by("when").addEventListener("input", (event) => goTo(event.target.value === event.target.max ? null : Number(event.target.value)));
by("newest").addEventListener("click", () => goTo(null));

// -- the picture of the shape -------------------------------------------------------------------------------------------

// Place of every entry of a shape: on the geometry of the config, else on a stick of one node an entry. `struck`: the numbers
// of the places of a roving hammer.
function geometry(names, struck) {
  const own = page.facts.geometry, channels = outputs();
  if (own && own.dofs.length) {
    const dofs = names.map((_, k) => own.dofs[((struck ? struck[k] : channels[k] && channels[k].dof) || k + 1) - 1] || null);
    return { ...own, dofs, names };
  }
  const nodes = names.map((_, k) => [0, 0, k + 1]);
  return { nodes: [[0, 0, 0], ...nodes], lines: names.map((_, k) => [k + 1, k + 2]), fixed: [1], dofs: names.map((_, k) => [k + 2, "x"]), names };
}

function showShapes() {
  const source = shownModes(), list = source ? source.modes.filter((mode) => Array.isArray(mode.shape_re)) : [];
  by("shape-canvas").hidden = !list.length;
  document.querySelector("#shape .absent").textContent = list.length ? "" : "no modes yet";
  if (!list.length) return;
  const select = by("shape-mode"), chosen = Math.max(0, select.selectedIndex);
  const titles = list.map((mode, k) => `${k + 1}: ${mode.frequency_hz.toPrecision(5)} Hz`);
  options(select, titles);
  options(by("shape-other"), ["nothing", ...titles]);
  select.selectedIndex = Math.min(chosen, list.length - 1);
  const shapes = list.map((mode, k) => ({ re: mode.shape_re, im: mode.shape_im, name: titles[k] }));
  const struck = source.shape_dofs;
  const names = struck ? struck.map(String) : outputs().length === shapes[0].re.length ? outputs().map((one) => one.name) : shapes[0].re.map((_, k) => String(k + 1));
  const place = geometry(names, struck), key = JSON.stringify([page.run, names]);
  if (!shape) {
    shape = window.okidShapes(by("shape-canvas"), place, shapes);
    shape.show(select.selectedIndex);
    shape.arrows = by("shape-arrows").checked;
    playing();
  } else {
    shape.set(shapes, key === page.shapeKey ? undefined : place);
    if (shape.mode !== select.selectedIndex) shape.show(select.selectedIndex);
  }
  page.shapeKey = key;
}

function playing() {
  by("shape-play").textContent = shape && shape.playing ? "Pause" : "Play";
}

// -- what the reader chooses --------------------------------------------------------------------------------------------

function options(select, names) {
  if (names.length === select.options.length && names.every((name, k) => select.options[k].textContent === name)) return;
  const chosen = select.selectedIndex;
  select.replaceChildren(...names.map((name) => {
    const one = document.createElement("option");
    one.textContent = name;
    return one;
  }));
  select.selectedIndex = Math.min(Math.max(0, chosen), names.length - 1);
}

function choices() {
  const list = document.querySelector("#chooser .list"), boxes = [];
  const changed = () => {
    lanes.choose(boxes.flatMap((box, k) => (box.checked ? [k] : [])));
    fetchSpectra();
  };
  const all = document.createElement("div");
  all.className = "both";
  for (const [text, value] of [["all", true], ["none", false]]) {
    const button = document.createElement("button");
    button.type = "button";
    button.textContent = text;
    button.addEventListener("click", () => {
      for (const box of boxes) box.checked = value;
      changed();
    });
    all.append(button);
  }
  list.replaceChildren(all, ...page.facts.channels.map((channel) => {
    const label = document.createElement("label"), box = document.createElement("input");
    box.type = "checkbox";
    box.checked = true;
    box.addEventListener("change", changed);
    boxes.push(box);
    label.append(box, ` ${channel.name}${channel.unit ? ` [${channel.unit}]` : ""}`);
    return label;
  }));
}

by("lanes-span").addEventListener("change", (event) => {
  lanes.whole = event.target.value === "all";
  lanes.span = Number(event.target.value) || 10;
  lanes.scale = lanes.scale.map(() => null);
  lanes.want();
});
by("lanes-pause").addEventListener("click", (event) => {
  if (page.at !== null) return void goTo(null);
  lanes.hold(!lanes.held);
  event.target.setAttribute("aria-pressed", String(lanes.held));
});
by("lanes-save").addEventListener("click", () => lanes.draws && saveCanvas(lanes.canvas, lanes.canvas.clientWidth, lanes.canvas.clientHeight, "signals.png"));
by("tracking-kind").addEventListener("change", () => plots.tracking.want());
for (const id of ["frf-output", "frf-input"]) by(id).addEventListener("change", fetchSpectra);
for (const button of document.querySelectorAll("#modes-save button")) {
  button.addEventListener("click", () => {
    const kind = button.dataset.save, numbers = [...pickedModes(page.result)].sort((a, b) => a - b);
    window.okidSelection.save(`modes.${kind}`, kind === "csv" ? "text/csv" : "application/json", window.okidSelection[kind](page.result, numbers));
  });
}
for (const id of ["shape-mode", "shape-other"]) {
  by(id).addEventListener("change", () => shape && shape.show(by("shape-mode").selectedIndex, by("shape-other").selectedIndex - 1));
}
by("shape-arrows").addEventListener("change", (event) => { if (shape) shape.arrows = event.target.checked; });
for (const button of document.querySelectorAll("#shape-save button")) {
  button.addEventListener("click", () => shape && window.okidPens.save(shape, by("shape-canvas"), button.dataset.picture, `mode-${shape.mode + 1}`));
}
by("shape-play").addEventListener("click", () => shape && (shape.playing ? shape.pause() : shape.play()));
by("shape-canvas").addEventListener("okid-shapes", playing);
document.addEventListener("click", (event) => {
  if (!by("chooser").contains(event.target)) by("chooser").open = false;
});
new IntersectionObserver((entries) => {
  lanes.visible = entries[entries.length - 1].isIntersecting;
  lanes.want();
}).observe(by("lanes"));
document.addEventListener("visibilitychange", () => {
  if (document.hidden) return;
  lanes.want();
  fetchSpectra();
  for (const plot of Object.values(plots)) if (plot.stale) plot.want();
});

// -- the stream -----------------------------------------------------------------------------------------------------------

const takes = {
  hello: showHello, state: showState, modes: takeModes, stats: showStats, tracks: takeTracks, log: takeLog, hits: takeHits, result: takeResult,
  lanes: (frame) => {
    if (lanes.channels.length) lanes.add(frame);
    if (by("moment").hidden) showMoment();
  },
  spectra: fetchSpectra,
  diagram: (found) => {
    page.diagram = found;
    showDiagramNote();
    plots.diagram.want();
  },
};
const stream = new EventSource("events");
for (const [kind, take] of Object.entries(takes)) {
  stream.addEventListener(kind, (event) => {
    if (kind === "hello" || page.run !== null) take(JSON.parse(event.data));
  });
}
stream.addEventListener("error", () => {
  by("link").textContent = "okid-live does not answer";
  by("link").className = "badge bad";
});
window.okidLive = { page, lanes, plots }; // for a look from the console
