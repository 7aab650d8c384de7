// SPDX-License-Identifier: MIT
// Joins the buttons of the report to the moving shapes of shapes.js.
"use strict";

(function () {
  const box = document.querySelector(".player");
  if (!box) return;
  const { geometry, shapes } = JSON.parse(document.getElementById("shapes-data").textContent);
  const modes = [...box.querySelectorAll("button[data-mode]")], go = box.querySelector("button.go");
  const canvas = box.querySelector("canvas"), other = box.querySelector("select.other");
  const view = okidShapes(canvas, geometry, shapes);
  window.okidView = view; // for a look from the console

  function tell() {
    modes.forEach((button, k) => button.setAttribute("aria-pressed", String(k === view.mode)));
    go.textContent = view.playing ? "Pause" : "Play";
    const beside = modes[view.other] ? ` beside that of mode ${modes[view.other].textContent}` : "";
    canvas.setAttribute("aria-label", `moving shape of mode ${modes[view.mode].textContent}${beside}`);
  }

  canvas.addEventListener("okid-shapes", tell);
  modes.forEach((button, k) => button.addEventListener("click", () => view.show(k)));
  other.addEventListener("change", () => view.show(view.mode, Number(other.value)));
  const arrows = box.querySelector("input.arrows");
  arrows.addEventListener("change", () => { view.arrows = arrows.checked; });
  go.addEventListener("click", () => (view.playing ? view.pause() : view.play()));
  box.querySelectorAll("button[data-picture]").forEach((button) =>
    button.addEventListener("click", () => okidPens.save(view, canvas, button.dataset.picture, `mode-${parseInt(modes[view.mode].textContent, 10)}`)));
  tell();
})();
