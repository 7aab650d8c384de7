// SPDX-License-Identifier: MIT
// Tables and lists of the live page. Everything from okid goes in as text content, never as markup.

import { short } from "./lanes.js";

const MOST_LINES = 400;

export function element(kind, text, ...classes) {
  const out = document.createElement(kind);
  if (text !== undefined) out.textContent = text;
  out.classList.add(...classes.filter(Boolean));
  return out;
}

// head: names, a leading "<" for a column of text; rows: {cells, away} or cells; a cell is a text, an element or [either, class]
export function fill(table, head, rows) {
  const left = head.map((name) => name.startsWith("<"));
  const top = element("tr");
  head.forEach((name, k) => top.append(element("th", left[k] ? name.slice(1) : name, left[k] && "text")));
  const body = rows.map((row) => {
    const line = element("tr", undefined, row.away && "away");
    (row.cells || row).forEach((cell, k) => {
      const [text, kind] = Array.isArray(cell) ? cell : [cell];
      line.append(element("td", text instanceof Node ? undefined : text, left[k] && "text", kind));
      line.lastElementChild.dataset.label = left[k] ? head[k].slice(1) : head[k]; // where there is no room for a head
      if (text instanceof Node) line.lastElementChild.append(text);
    });
    return line;
  });
  const thead = element("thead"), tbody = element("tbody");
  thead.append(top);
  tbody.append(...body);
  table.replaceChildren(thead, tbody);
}

const known = (value) => typeof value === "number" && Number.isFinite(value);

// A value with as many decimals as two digits of its deviation.
export function measured(value, deviation) {
  if (!known(value)) return ["–", "–"];
  if (!known(deviation) || deviation <= 0) return [Number(value.toPrecision(6)).toString(), "–"];
  const places = Math.min(9, Math.max(0, 1 - Math.floor(Math.log10(deviation))));
  return [value.toFixed(places), `±${deviation.toFixed(places)}`];
}

// "3 confident modes, 1 doubtful"
export function counted(result) {
  const doubtful = result.modes.filter((mode) => mode.confident === false).length, sure = result.modes.length - doubtful;
  return `${sure} confident mode${sure === 1 ? "" : "s"}${doubtful ? `, ${doubtful} doubtful` : ""}`;
}

// The modes of a result that are saved, by number: the confident ones until somebody chooses.
let pickedOf = null, picked = new Set();
export function pickedModes(result) {
  if (pickedOf !== result) picked = new Set(result.modes.flatMap((mode, k) => (mode.confident === false ? [] : [k + 1])));
  pickedOf = result;
  return picked;
}

function box(chosen, number) {
  const out = element("label"), tick = element("input");
  Object.assign(tick, { type: "checkbox", checked: chosen.has(number) });
  tick.addEventListener("change", () => (tick.checked ? chosen.add(number) : chosen.delete(number)));
  out.append(tick, ` ${number}`);
  return out;
}

export function showModes(event, result) {
  const table = document.getElementById("modes-table"), note = document.getElementById("modes-note");
  const source = result && result.modes ? result : event;
  document.querySelector("#modes .absent").textContent = source ? (source.modes.length ? "" : "no mode yet") : "no modes yet";
  if (!source) return void table.replaceChildren();
  const all = source === result, picked = all ? pickedModes(result) : null;
  const rows = source.modes.map((mode, k) => {
    const [f, df] = measured(mode.frequency_hz, mode.frequency_std_hz);
    const percent = known(mode.damping_ratio_std) ? 100 * mode.damping_ratio_std : null;
    const [z, dz] = measured(100 * mode.damping_ratio, percent);
    const name = known(mode.track) ? String(mode.track) : "new";
    const mpc = known(mode.mpc) ? mode.mpc.toFixed(4) : "–";
    const remark = mode.alarm ? "alarm" : mode.confident === false ? `doubtful: ${(mode.why_text || mode.why || []).join("; ")}` : "";
    return { away: mode.alarm, doubtful: mode.confident === false, cells: [all ? box(picked, k + 1) : name, f, df, z, dz, mpc, remark] };
  });
  rows.sort((a, b) => Boolean(a.doubtful) - Boolean(b.doubtful)); // stable: the doubtful ones last
  fill(table, [all ? "#" : "track", "f [Hz]", "± σ", "ζ [%]", "± σ", "MPC", "<"], rows);
  document.getElementById("modes-save").hidden = !all || !result.modes.length;
  note.textContent = all ? `result: ${counted(result)}, order ${result.order}, ${result.samples} samples` :
    `${event.samples} samples, ${short(event.window_s)} s${event.settled ? ", settled" : ""}`;
}

export function showStats(event) {
  const percent = (value) => (known(value) ? `${value.toFixed(1)} %` : "–");
  const lost = (one) => Object.entries(one.lost_by || {}).filter(([, n]) => n > 0).map(([cause, n]) => `${cause} ${n}`).join(", ");
  fill(document.getElementById("bus-table"), ["<bus", "received", "lost", "<lost by", "order", "double", "errors", "load"],
    Object.entries(event.bus || {}).map(([name, one]) => [name, String(one.received), [String(one.lost), one.lost > 0 ? "bad" : ""],
      [lost(one) || "–", "long"], String(one.out_of_order), String(one.duplicate),
      [String(one.decode_errors), one.decode_errors > 0 ? "bad" : ""], percent(one.load_percent)]));
  fill(document.getElementById("channel-table"), ["<channel", "expected", "received", "missing", "complete"],
    Object.entries(event.channel || {}).map(([name, one]) => {
      const whole = known(one.completeness_percent) ? one.completeness_percent : 0;
      const text = `${(Math.floor(whole * 1000) / 1000).toFixed(3)} %`; // 99.9996 is not complete
      return [name, String(one.expected), String(one.received), [String(one.missing), one.missing > 0 ? "bad" : ""], [text, one.missing > 0 ? "bad" : "good"]];
    }));
  document.querySelector("#health .absent").textContent = "";
  document.getElementById("health-note").textContent =
    known(event.rate_hz_by_stamps) ? `${event.rate_hz_by_stamps.toFixed(2)} Hz by time stamps, at t = ${event.t.toFixed(1)} s` : `at t = ${event.t.toFixed(1)} s`;
}

export function showHits(hits) {
  const last = hits[hits.length - 1];
  fill(document.getElementById("hammer-table"), ["hit", "t [s]", "<verdict", "peak", "width [ms]", "force to [Hz]", "<what was seen"],
    hits.slice().reverse().map((hit) => [String(hit.number), hit.t.toFixed(2), hit.accepted ? ["good", "good"] : [String(hit.reason), "bad"],
      known(hit.peak) ? hit.peak.toPrecision(4) : "–", known(hit.duration_s) ? (1000 * hit.duration_s).toFixed(2) : "–",
      known(hit.force_band_hz) ? hit.force_band_hz.toFixed(0) : "–", [hit.text || "", "long"]]));
  document.querySelector("#hammer .absent").textContent = last ? "" : "waiting for the first hit";
  document.getElementById("hammer-note").textContent = last ? `${last.accepted_hits} good, ${last.left} to go` : "";
}

export class Log {
  constructor(list) {
    this.list = list;
    this.reset();
  }

  reset() {
    this.last = 0;
    this.list.replaceChildren();
    document.querySelector("#events .absent").textContent = "no events yet";
  }

  // Entries newer than the last one shown; returns them.
  add(entries) {
    const fresh = entries.filter((entry) => entry.n > this.last);
    if (!fresh.length) return fresh;
    const left = fresh[0].n - this.last - 1;
    if (this.last > 0 && left > 0) this.line("", "", "warn", `${left} more events not shown`);
    const signs = { good: "✓", bad: "!", warn: "△" };
    for (const entry of fresh) this.line(known(entry.t) ? `${entry.t.toFixed(2)} s` : "", signs[entry.weight] || "", entry.weight, entry.text);
    this.last = fresh[fresh.length - 1].n;
    while (this.list.childElementCount > MOST_LINES) this.list.lastElementChild.remove();
    document.querySelector("#events .absent").textContent = "";
    document.getElementById("events-note").textContent = `${this.last} so far, newest first`;
    return fresh;
  }

  line(time, sign, weight, text) {
    const item = element("li");
    item.append(element("time", time), element("span", sign, weight), element("span", text, weight));
    this.list.prepend(item);
  }
}

function matrix(title, unit, values, deviations) {
  const box = element("div"), table = element("table");
  box.append(element("h3", `${title} [${unit}]`), table);
  fill(table, ["", ...values[0].map((_, k) => String(k + 1))], values.map((row, i) => [String(i + 1), ...row.map((value, j) => {
    const [v, d] = measured(value, deviations ? deviations[i][j] : null);
    return deviations ? `${v} ${d}` : v;
  })]));
  return box;
}

// The checks of M, K and R in the words of the report.
function checks(found) {
  const box = element("div"), table = element("table");
  const digits = (value) => (known(value) ? Number(value.toPrecision(3)).toString() : "–");
  const yes = (value) => (value === undefined || value === null ? "–" : [value ? "yes" : "no", value ? "good" : "bad"]);
  const below = (value, most) => [digits(value), known(value) && value > most ? "bad" : ""];
  const where = found.feedthrough_output ? ` at ${found.feedthrough_output}` : "";
  const chosen = `${(found.modes_used || []).join(", ") || "–"} of ${digits(found.admissible_modes)} admissible`;
  fill(table, ["<check", "<found"], [
    ...["M", "K", "R"].map((name) => [`${name} positive definite`, yes(found[`${name.toLowerCase()}_positive_definite`])]),
    ["residual of W Wᵀ = 0 (doubtful above 0.03)", below(found.ww_residual, 0.03)],
    [`misfit of D to M${where} (doubtful above 0.1)`, below(found.feedthrough_misfit, 0.1)],
    ["D over M⁻¹ at the pairs (1 is expected)", digits(found.feedthrough_gain)],
    ["modes used", chosen],
    ["how much stronger than the best left out", known(found.selection_margin) ? `${digits(found.selection_margin)} times` : "–"],
    ["co-located pairs", digits(found.collocated_pairs)],
    ["condition of the eigenvectors", digits(found.eigenvector_condition)],
  ]);
  box.append(element("h3", "checks"), table);
  return box;
}

export function showResult(result) {
  const parts = [], mkr = result.mkr, pdc = result.pdc;
  if (mkr) {
    parts.push(matrix("M", "kg", mkr.M, mkr.M_std), matrix("K", "N/m", mkr.K, mkr.K_std), matrix("R", "N s/m", mkr.R, mkr.R_std));
    parts.push(checks(mkr.checks || {}));
  } else {
    parts.push(element("p", "no M, K, R in this result: they need mkr = true, and dof of every force and response", "note"));
  }
  if (pdc && known(pdc.alpha)) {
    const box = element("div"), table = element("table");
    const [a, da] = measured(pdc.alpha, pdc.alpha_std), [b, db] = measured(1e6 * pdc.beta, known(pdc.beta_std) ? 1e6 * pdc.beta_std : null);
    fill(table, ["<", "value", "± σ"], [["α [1/s]", a, da], ["β [µs]", b, db]]);
    box.append(element("h3", "proportional damping R = α M + β K"), table);
    parts.push(box);
  }
  const fit = Object.entries((result.fit && result.fit.prediction_percent) || {}).filter(([, value]) => known(value));
  if (fit.length) {
    const box = element("div"), table = element("table");
    fill(table, ["<output", "prediction fit [%]"], fit.map(([name, value]) => [name, value.toFixed(2)]));
    box.append(element("h3", "one-step prediction"), table);
    parts.push(box);
  }
  document.getElementById("result-parts").replaceChildren(...parts);
  document.getElementById("result-warnings").replaceChildren(...(result.warnings || []).map((one) => element("li", `${one.code}: ${one.text}`)));
  document.getElementById("result-note").textContent =
    `${result.method}, order ${result.order}${known(result.p) ? `, p ${result.p}` : ""}, ${result.samples} samples, ${result.gaps} gaps, ${counted(result)}`;
}
