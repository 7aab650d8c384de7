// SPDX-License-Identifier: MIT
// Modes chosen by hand, out of a report or the live page: as CSV, as okid.result/1, and into a file.
"use strict";

const okidSelection = {
  // A row a mode; the shape follows as one column a part of each output, an output that was left out stays empty.
  csv(result, numbers) {
    const quoted = (text) => `"${String(text).replaceAll('"', '""')}"`;
    const first = ["frequency_hz", "frequency_std_hz", "damping_ratio", "damping_ratio_std", "mpc", "emac", "confident", "found_in"];
    const number = (value) => typeof value === "number" || typeof value === "boolean";
    const others = result.modes.flatMap((mode) => Object.keys(mode).filter((key) => number(mode[key])));
    const keys = [...new Set([...first, ...others])];
    const shapes = (result.shape_dofs || result.outputs).flatMap((name) => [`${name} re`, `${name} im`]).map(quoted);
    const rows = numbers.map((k) => {
      const mode = result.modes[k - 1];
      const entries = (mode.shape_re || []).flatMap((re, i) => [re, mode.shape_im[i]]);
      return [k, ...keys.map((key) => mode[key]), quoted((mode.why || []).join(" ")), ...entries].map((x) => x ?? "").join(",");
    });
    return [["mode", ...keys, "why", ...shapes].join(","), ...rows, ""].join("\n");
  },

  // The same result with these modes; chosen by hand they count as confident, as with okid identify --modes.
  json(result, numbers) {
    const modes = numbers.map((k) => ({ ...result.modes[k - 1], confident: true }));
    const text = `modes ${numbers.join(", ")} of ${result.modes.length} were chosen by hand; model and matrices are those of the whole result`;
    return JSON.stringify({ ...result, modes, warnings: [...(result.warnings || []), { code: "modes_chosen", text }] }) + "\n";
  },

  save(name, kind, content) { // text, or a Blob
    const link = document.createElement("a"), place = URL.createObjectURL(new Blob([content], { type: kind }));
    link.href = place;
    link.download = name;
    link.click();
    setTimeout(() => URL.revokeObjectURL(place), 1000);
  },
};
window.okidSelection = okidSelection;
