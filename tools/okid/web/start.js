// SPDX-License-Identifier: MIT
// What a page may ask for: a report, and on a start page files, channels and an identification. Each wish carries the key
// that stands behind the # of the address okid-live printed; without it the page is read-only.

import { element, fill } from "./tables.js";

const by = (id) => document.getElementById(id);
const key = location.hash.slice(1);
const SIDES = [["", "not used"], ["inputs", "force"], ["outputs", "response"]];
const files = []; // that are identified together
let found = null, busy = false;

async function post(path, body) {
  const reply = await fetch(path, { method: "POST", headers: { "X-Okid-Token": key }, body });
  if (!reply.ok) throw new Error((await reply.text()).trim());
  return reply;
}
const ask = async (path, content) => (await post(path, JSON.stringify(content))).json();

function say(text, bad = false) {
  by("start-note").textContent = text;
  by("start-note").classList.toggle("bad", bad);
}

// One wish at a time; why it was not granted is said where `where` says it.
async function wish(work, where = say) {
  if (busy) return;
  busy = true;
  try {
    await work();
  } catch (fault) {
    where(fault.message || String(fault), true);
  }
  busy = false;
}

function button(text, press) {
  const out = element("button", text);
  out.type = "button";
  out.addEventListener("click", press);
  return out;
}

// -- the report -------------------------------------------------------------------------------------------------------

export function offerReport(result) {
  by("report").hidden = !(result && key);
}

// -- the geometry of a finished result --------------------------------------------------------------------------------

export function offerGeometry(wanted) {
  by("geometry").hidden = !(wanted && key);
}

by("geometry-draw").addEventListener("click", () => {
  const tell = (text, bad = false) => {
    by("geometry-note").textContent = text;
    by("geometry-note").classList.toggle("bad", bad);
  };
  wish(async () => {
    const rows = by("geometry-table").value.replaceAll("\t", ","); // as a spreadsheet pastes them
    by("geometry-toml").textContent = (await ask("geometry", { table: rows })).toml;
    tell("the same in a CONFIG.toml:");
  }, tell);
});

by("report").addEventListener("click", () => {
  const own = by("report"), tell = (text) => { own.title = own.textContent = text; };
  own.disabled = true;
  tell("writing the report");
  wish(async () => {
    const page = await (await post("report", "{}")).arrayBuffer();
    window.okidSelection.save("report.html", "text/html", page);
    tell("Report");
  }, tell).finally(() => { own.disabled = false; });
});

// -- the start page ---------------------------------------------------------------------------------------------------

export function offerStart(wanted) {
  by("start").hidden = !wanted;
  if (wanted && !key) say("open the page by the address that okid-live printed: it holds the key", true);
}

function showList() {
  by("start-list").replaceChildren(...files.map((file) => {
    const item = element("li", `${file} `);
    item.append(button("remove", () => {
      files.splice(files.indexOf(file), 1);
      showList();
    }));
    return item;
  }));
  by("start-go").hidden = !files.length;
}

function showFolder({ path, files: names }) {
  by("start-list").replaceChildren(...names.map((name) => {
    const item = element("li");
    item.append(button(name, () => look(`${path}/${name}`)));
    return item;
  }));
  say(names.length ? `${names.length} files in ${path}: choose one` : `${path}: no files`);
}

function showChannels() {
  const rows = found.channels.map((channel) => {
    const side = element("select"), dof = element("input");
    side.append(...SIDES.map(([value, text]) => Object.assign(element("option", text), { value })));
    side.value = channel.side;
    side.setAttribute("aria-label", `${channel.name} is`);
    Object.assign(dof, { type: "number", size: 4 });
    dof.setAttribute("aria-label", `degree of freedom of ${channel.name}`);
    Object.assign(channel, { select: side, dof });
    return [channel.name, channel.unit, side, dof];
  });
  fill(by("start-channels"), ["<channel", "<unit", "<is", "<degree of freedom (for M, K, R)"], rows);
  by("start-fs").value = found.fs_hz || "";
  say(`${found.samples} samples of ${rows.length} channels${found.fs_hz ? "" : ": no sampling rate in the file, name it"}`);
}

function showCommand(command, toml) {
  by("start-command").textContent = [command, toml && `\n# SPEC.toml, for okid-campaign run SPEC.toml\n${toml}`].filter(Boolean).join("\n");
}

async function openFile(content) {
  showCommand((await ask("open", content)).command);
  say(`opened ${content.path}`);
}

// -- a run ------------------------------------------------------------------------------------------------------------

let bus = "", config = ""; // that are looked at

export function offerEnd(goesOn) {
  by("run-end").hidden = !(goesOn && key);
}

// `toml`: a config that was proposed here and may be changed; null for one of the user's own
function showRun(path, toml) {
  config = path;
  by("run-toml").value = toml || "";
  by("run-toml").hidden = toml === null;
  by("start-run").hidden = false;
  say(toml === null ? `${path}: a config; it goes with a log, or starts a run` : `wrote ${path}: read every line, change what is wrong`);
}

function showBus({ path, serial }) {
  bus = path;
  by("start-bus").hidden = false;
  for (const label of document.querySelectorAll("#start-bus [data-of]")) label.hidden = (label.dataset.of === "serial") !== serial;
  say(serial ? `${path}: name the numbers of its lines (- is none), then propose a config` : `${path}: name its DBC, then propose a config; that listens for some seconds`);
}

by("bus-propose").addEventListener("click", () => wish(async () => {
  say(`asking okid init for a config of ${bus}`);
  const of = (name) => by(`bus-${name}`).value;
  const made = await ask("propose", { path: bus, config: of("config"), fields: of("fields"), baud: of("baud"), dbc: of("dbc"), rate: of("rate") });
  showCommand(made.command);
  showRun(made.path, made.toml);
}));
by("run-start").addEventListener("click", () => wish(async () => {
  showCommand((await ask("run", { path: config, toml: by("run-toml").hidden ? null : by("run-toml").value })).command);
  say("the run goes on, also when this page is closed; okid-live ends it when it ends");
}));
by("run-end").addEventListener("click", () => wish(async () => {
  await ask("end", {});
  say("the run ends with its result");
}));

// A log waits for its config, a result may get its record: both are named next.
let waiting = null;
const look = (text) => wish(async () => {
  const seen = await ask("look", { path: text });
  if (waiting && waiting.kind === "log" && seen.kind === "config") {
    const log = waiting.path;
    waiting = null;
    return openFile({ path: log, config: seen.path });
  }
  waiting = null;
  by("start-bus").hidden = by("start-run").hidden = true;
  if (seen.kind === "bus") return showBus(seen);
  if (seen.kind === "config") return showRun(seen.path, null);
  if (seen.kind === "folder") return showFolder(seen);
  if (seen.kind === "log") {
    waiting = seen;
    return say(`${seen.path}: now name the CONFIG.toml it was measured with`);
  }
  if (seen.kind === "journal") return openFile({ path: seen.path });
  if (seen.kind === "result") return openFile({ path: seen.path, records: files });
  if (!files.includes(seen.path)) files.push(seen.path);
  found = seen;
  showList();
  showChannels();
});

async function drop(list) {
  for (const file of list) {
    say(`copying ${file.name}`);
    let path = "";
    await wish(async () => { path = (await (await post(`upload?name=${encodeURIComponent(file.name)}`, file)).json()).path; });
    if (path) await look(path);
  }
}

function identify() {
  const of = (side) => found.channels.filter((channel) => channel.select.value === side);
  const dofs = (side) => (of(side).some((channel) => channel.dof.value) ? of(side).map((channel) => channel.dof.value).join(",") : "");
  wish(async () => {
    const made = await ask("identify", {
      files, inputs: of("inputs").map((one) => one.name), outputs: of("outputs").map((one) => one.name), fs_hz: found.fs_hz,
      fs: Number(by("start-fs").value) === found.fs_hz ? "" : by("start-fs").value, method: by("start-method").value,
      sensing: by("start-sensing").value, input_dofs: dofs("inputs"), output_dofs: dofs("outputs"),
    });
    showCommand(made.command, made.toml);
    say("identifying: the panels below show it");
  });
}

by("start-look").addEventListener("click", () => look(by("start-path").value));
by("start-path").addEventListener("keydown", (event) => { if (event.key === "Enter") look(by("start-path").value); });
by("start-identify").addEventListener("click", identify);
by("start-files").addEventListener("change", (event) => drop([...event.target.files]));
for (const kind of ["dragover", "drop"]) {
  by("start").addEventListener(kind, (event) => {
    event.preventDefault();
    if (kind === "drop") drop([...event.dataTransfer.files]);
  });
}
