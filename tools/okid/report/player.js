// SPDX-License-Identifier: MIT
// Joins the buttons of the report to the moving shapes of shapes.js.
"use strict";

(function () {
  const box = document.querySelector(".player");
  if (!box) return;
  const { geometry, shapes } = JSON.parse(document.getElementById("shapes-data").textContent);
  const modes = [...box.querySelectorAll("button[data-mode]")], go = box.querySelector("button.go");
  const canvas = box.querySelector("canvas");
  const view = okidShapes(canvas, geometry, shapes);

  function tell() {
    modes.forEach((button, k) => button.setAttribute("aria-pressed", String(k === view.mode)));
    go.textContent = view.playing ? "Pause" : "Play";
    canvas.setAttribute("aria-label", "moving shape of mode " + modes[view.mode].textContent);
  }

  canvas.addEventListener("okid-shapes", tell);
  modes.forEach((button, k) => button.addEventListener("click", () => view.show(k)));
  go.addEventListener("click", () => (view.playing ? view.pause() : view.play()));
  tell();
})();
